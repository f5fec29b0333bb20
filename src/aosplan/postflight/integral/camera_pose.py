"""Pose and intrinsics of a view."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.units import number

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from aosplan.camera.camera import Camera


ROTATION_TOLERANCE = 1e-3
"""A matrix R in a file is accepted as a rotation if no element of R Rᵀ differs from the unit matrix
by more than this.
"""

FARTHEST_M = 1e9
"""Greatest distance of a camera from the origin of its world."""


class Intrinsics(NamedTuple):
    """A pinhole camera with lens distortion, in pixels.

    A direction (x, y, 1) in the camera's frame is imaged at (fx x' + cx, fy y' + cy), where x' and
    y' are x and y after `distorted`.
    """

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    @property
    def is_pinhole(self) -> bool:
        """Whether the camera has no distortion, so that straight lines stay straight."""
        return self.k1 == self.k2 == self.k3 == self.p1 == self.p2 == 0.0

    def distorted(
        self, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Directions after lens distortion; nan beyond the fold of its polynomial.

        The model includes COLMAP's models RADIAL and OPENCV, and the third radial term of DJI. With
        r² = x² + y², x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²). The formula of
        y' is the same, with x and y exchanged, and p1 and p2 exchanged.
        """
        r2 = x * x + y * y
        scale = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        # Without this limit, directions beyond the fold of the polynomial would wrongly appear
        # inside the image.
        scale = np.where(r2 < self._fold(), scale, np.nan)
        return (
            x * scale + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * scale + 2.0 * self.p2 * x * y + self.p1 * (r2 + 2.0 * y * y),
        )

    def undistorted(self, x: float, y: float) -> tuple[float, float]:
        """The direction that is imaged at (x, y): the inverse of `distorted`, by Newton's method.

        The result is nan if no direction is imaged there.
        """
        guess = np.array([x, y])
        for _ in range(50):
            steps = guess[:, None] + 1e-7 * np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
            there = np.stack(self.distorted(steps[0], steps[1]))
            error = there[:, 0] - (x, y)
            if not np.isfinite(there).all():
                break
            if np.abs(error).max() < 1e-13:
                return float(guess[0]), float(guess[1])
            try:
                guess = guess - np.linalg.solve((there[:, 1:] - there[:, :1]) / 1e-7, error)
            # The matrix is singular at the fold of the polynomial.
            except np.linalg.LinAlgError:
                break
        there = np.stack(self.distorted(guess[:1], guess[1:]))[:, 0]
        close = np.abs(there - (x, y)).max() < 1e-9
        return (float(guess[0]), float(guess[1])) if close else (math.nan, math.nan)

    def scaled(self, width_px: int, height_px: int) -> Intrinsics:
        """Intrinsics for the same photo scaled to another size."""
        x, y = width_px / self.width_px, height_px / self.height_px
        return self._replace(
            width_px=width_px,
            height_px=height_px,
            fx_px=self.fx_px * x,
            fy_px=self.fy_px * y,
            cx_px=self.cx_px * x,
            cy_px=self.cy_px * y,
        )

    def in_blocks(self, block_px: int) -> Intrinsics:
        """Intrinsics for the same photo after its pixels are averaged in square blocks.  Incomplete
        blocks at the right and lower edges are left out.
        """
        return self._replace(
            width_px=self.width_px // block_px,
            height_px=self.height_px // block_px,
            fx_px=self.fx_px / block_px,
            fy_px=self.fy_px / block_px,
            cx_px=self.cx_px / block_px,
            cy_px=self.cy_px / block_px,
        )

    def _fold(self) -> float:
        """Smallest r² at which r (1 + k1 r² + k2 r⁴ + k3 r⁶) stops increasing; inf if it never
        does.
        """
        roots = np.roots([7.0 * self.k3, 5.0 * self.k2, 3.0 * self.k1, 1.0])
        real = [root.real for root in roots if abs(root.imag) < 1e-12 and root.real > 0.0]
        return min(real, default=math.inf)


@dataclass(frozen=True)
class View:
    """One image: file name, pose, and the camera if it is known.

    Parameters
    ----------
    name
        Name of the image file in the folder of images.
    rotation, translation
        R, shape (3, 3), and t, shape (3,), which transform world coordinates to camera coordinates.
    intrinsics
        The camera; None if the file of poses does not contain it.
    """

    name: str
    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]
    intrinsics: Intrinsics | None = None

    @property
    def position(self) -> NDArray[np.float64]:
        """Position of the camera in the world, -Rᵀ t [m]."""
        return -self.rotation.T @ self.translation

    def moved(self, shift_m: NDArray[np.float64], turn: NDArray[np.float64]) -> View:
        """The view shifted and rotated; `turn` is a rotation of the world, shape (3, 3)."""
        rotation = self.rotation @ turn.T
        return replace(self, rotation=rotation, translation=-rotation @ (self.position + shift_m))

    @property
    def forward(self) -> NDArray[np.float64]:
        """Viewing direction of the camera in the world."""
        direction: NDArray[np.float64] = self.rotation[2]
        return direction


def pose(matrix: Any, place: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """R and t from a 3 x 4 matrix of numbers, which may be written as text.

    Raises
    ------
    RequestError
        If the matrix has another shape, or if its left part is not a rotation.
    """
    rows = matrix if isinstance(matrix, list) and len(matrix) == 3 else []
    if not rows or any(not isinstance(row, list) or len(row) != 4 for row in rows):
        raise RequestError(f"{place}: M3x4 is not 3 rows of 4 numbers")
    numbers = np.array([[number(value, f"{place}: M3x4") for value in row] for row in rows])
    rotation, translation = numbers[:, :3], numbers[:, 3]
    # The elements of a rotation are not larger than 1. They are limited here, because products of
    # large elements would overflow.
    within = np.clip(rotation, -2.0, 2.0)
    off = np.abs(within @ within.T - np.eye(3)).max()
    if not off < ROTATION_TOLERANCE or np.linalg.det(rotation) < 0.0:
        raise RequestError(
            f"{place}: the left 3 x 3 of M3x4 is not a rotation",
            "M3x4 is [R|t], which transforms world coordinates to camera coordinates; R has no unit, "
            "and t is in metres",
        )
    if np.abs(translation).max() > FARTHEST_M:
        raise RequestError(f"{place}: the camera is more than {FARTHEST_M:g} m from the origin")
    return rotation, translation


LENS = {"fx": 1e7, "fy": 1e7, "cx": 1e6, "cy": 1e6, "k1": 1e6, "k2": 1e6, "p1": 1e3, "p2": 1e3}
"""Largest allowed values of a lens: fx, fy, cx and cy [px], and distortion coefficients."""


def checked_intrinsics(width: int, height: int, values: list[float], place: str) -> Intrinsics:
    """Intrinsics from numbers: fx, fy, cx, cy, followed by distortion coefficients if there are
    any.

    Raises
    ------
    RequestError
        If a focal length is not positive, or a number exceeds its limit in `LENS`.
    """
    if not (values[0] > 0.0 and values[1] > 0.0):
        raise RequestError(f"{place}: focal length {min(values[:2]):g} px is not above zero")
    for name, value in zip(LENS, values, strict=False):
        if abs(value) > LENS[name]:
            raise RequestError(f"{place}: {name} {value:g} is not within {LENS[name]:g}")
    return Intrinsics(width, height, *values)


def from_field_of_view(fov_deg: float) -> Callable[[int, int], Intrinsics]:
    """Make a function that returns intrinsics for any image size, from a horizontal field of view
    [deg].
    """
    if not 0.0 < fov_deg < 180.0:
        raise RequestError(f"--fov {fov_deg:g} is not between 0 and 180 degrees")

    def made(width: int, height: int) -> Intrinsics:
        focal = 0.5 * width / math.tan(math.radians(fov_deg) / 2.0)
        return Intrinsics(width, height, focal, focal, width / 2.0, height / 2.0)

    return made


def named_camera(
    name: str | None, fov_deg: float | None
) -> Callable[[int, int], Intrinsics] | None:
    """Intrinsics from the name of a camera or a horizontal field of view [deg]; None without
    either.

    Raises
    ------
    RequestError
        If both are given, or if the camera is unknown.
    """
    if name is not None and fov_deg is not None:
        raise RequestError("--camera and --fov both give the camera", "leave out one of them")
    if name is not None:
        from aosplan.camera.presets import find_camera

        return from_camera(find_camera(name))
    return None if fov_deg is None else from_field_of_view(fov_deg)


def from_camera(camera: Camera) -> Callable[[int, int], Intrinsics]:
    """Make a function that returns the intrinsics of a camera for any size of its images."""

    def made(width: int, height: int) -> Intrinsics:
        own = (camera.image_width_px, camera.image_height_px)
        if abs(width * own[1] - height * own[0]) > max(own):
            raise RequestError(
                f"camera '{camera.name}' makes images of {own[0]} x {own[1]} pixels, "
                f"not {width} x {height}",
                "for cropped images, give a camera file or --fov",
            )
        return Intrinsics(
            width,
            height,
            camera.focal_length_mm / camera.sensor_width_mm * width,
            camera.focal_length_mm / camera.sensor_height_mm * height,
            width / 2.0,
            height / 2.0,
        )

    return made
