"""Cameras: intrinsics, ground resolution and footprint on the focal plane."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from aosplan.errors import RequestError
from aosplan.numerics import SCALARS

T = TypeVar("T")
"""A float, or a column of floats."""

SMALLEST, LARGEST = 1e-6, 1e9
"""Bounds of a camera's lengths [mm] and of its image size [px]."""


def focal_length_of_fov(fov_deg: Any, xp: Any = SCALARS) -> Any:
    """Focal length divided by the sensor width, for a horizontal field of view [deg].

    The argument is a float, or an array if `xp` is numpy.
    """
    return 0.5 / xp.tan(xp.radians(fov_deg) / 2.0)


class Optics(Generic[T]):
    """Formulas for a pinhole camera that looks straight down, or for a column of such cameras."""

    focal_length_mm: Any
    sensor_width_mm: Any
    sensor_height_mm: Any
    image_width_px: Any

    @property
    def focal_length_px(self) -> T:
        """Focal length in pixels, computed with the pixel pitch along the image width."""
        pixels: T = self.focal_length_mm * self.image_width_px / self.sensor_width_mm
        return pixels

    def gsd_m(self, altitude_m: Any) -> T:
        """Ground sampling distance: size of a pixel on the focal plane along the image width [m]."""
        size: T = altitude_m / self.focal_length_px
        return size

    def altitude_for_gsd_m(self, gsd_m: Any) -> T:
        """Altitude above the focal plane [m] at which the ground sampling distance is `gsd_m`."""
        altitude: T = gsd_m * self.focal_length_px
        return altitude

    def footprint_m(self, altitude_m: Any) -> tuple[T, T]:
        """Size of the image on the focal plane, along the heading (x) and across it (y) [m]."""
        return (
            altitude_m * self.sensor_height_mm / self.focal_length_mm,
            altitude_m * self.sensor_width_mm / self.focal_length_mm,
        )


@dataclass(frozen=True)
class Camera(Optics[float]):
    """A pinhole camera that looks straight down.

    The width of the image is across the heading (y), and the height of the image is along the
    heading (x).

    Parameters
    ----------
    name
        Name of the camera in the output.
    focal_length_mm
        Physical focal length, not the 35 mm equivalent.
    sensor_width_mm, sensor_height_mm
        Size of the part of the sensor that becomes the image.
    image_width_px, image_height_px
        Size of the image.

    Raises
    ------
    RequestError
        If a number is not positive and finite.
    """

    name: str
    focal_length_mm: float
    sensor_width_mm: float
    sensor_height_mm: float
    image_width_px: int
    image_height_px: int
    title: str = ""
    source: str = ""
    assumed: str = ""

    def __post_init__(self) -> None:
        for field in (
            "focal_length_mm",
            "sensor_width_mm",
            "sensor_height_mm",
            "image_width_px",
            "image_height_px",
        ):
            value = getattr(self, field)
            if not (math.isfinite(value) and value > 0):
                raise RequestError(
                    f"camera '{self.name}': {field} {value:g} is not a positive number"
                )
            if not SMALLEST <= value <= LARGEST:
                raise RequestError(
                    f"camera '{self.name}': {field} {value:g} is not between {SMALLEST:g} and "
                    f"{LARGEST:g}"
                )

    @classmethod
    def from_field_of_view(
        cls, fov_deg: float, image_width_px: int, image_height_px: int, *, name: str = "custom"
    ) -> Camera:
        """Make a camera with a given horizontal field of view [deg]. Its sensor width is set to 1
        mm, because only the ratio of the sensor width to the focal length matters.
        """
        if not 0.0 < fov_deg < 180.0:
            raise RequestError(f"field of view {fov_deg:g} is not between 0 and 180 degrees")
        focal = focal_length_of_fov(fov_deg)
        height = image_height_px / image_width_px
        return cls(name, focal, 1.0, height, image_width_px, image_height_px)

    @property
    def fov_deg(self) -> tuple[float, float]:
        """Fields of view along the image width and along the image height [deg]."""
        width = math.atan(0.5 * self.sensor_width_mm / self.focal_length_mm)
        height = math.atan(0.5 * self.sensor_height_mm / self.focal_length_mm)
        return math.degrees(2 * width), math.degrees(2 * height)
