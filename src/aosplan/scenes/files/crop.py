"""Cropping of a point cloud to a rectangle while it is read.

The sides of the rectangle are parallel to the axes x and y of the cloud.  The rectangle is given in
the coordinates of the cloud or in degrees.  Tiles that do not overlap it are not read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from aosplan.crs import transformer
from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from pyproj import CRS

    from aosplan.scenes.files.las import PointFile

    Floats = NDArray[np.float64]

WGS84 = "EPSG:4326"

GLOBE_DEG = (180.0, 90.0, 180.0, 90.0)

NEARBY = 10_000.0
"""Bounds may be in degrees or in coordinates of the cloud. They are read as coordinates of the
cloud if no coordinate of the first point of the cloud exceeds this value.
"""

NARROWEST_M = 50.0
"""If the overlap between the cloud and the surroundings of a plan is narrower than this, the whole
cloud is used.
"""


@dataclass(frozen=True)
class Crop:
    """The rectangle to which a point cloud is cropped.

    Parameters
    ----------
    bounds
        West, south, east and north; or smallest x, smallest y, largest x and largest y.
    frame
        ``degrees``: longitudes and latitudes of WGS 84.  ``either``: coordinates of the cloud, or
        degrees if the numbers cannot be coordinates of the cloud.
    margin_m
        Margin around the bounds.
    of_plan
        Whether the bounds come from a plan and not from the user. If such bounds overlap the cloud,
        the cloud is cropped, with a warning. If they do not overlap, the whole cloud is used.
    """

    bounds: tuple[float, float, float, float]
    frame: Literal["degrees", "either"] = "either"
    margin_m: float = 0.0
    of_plan: bool = False

    def __str__(self) -> str:
        return ",".join(f"{bound:.10g}" for bound in self.bounds)


class CropBox(NamedTuple):
    """A rectangle in the coordinates of a cloud, in metres.

    Attributes
    ----------
    low_m, high_m
        Smallest and largest x and y, each of shape (2,).
    said
        Warnings for the user.
    is_empty
        The error to raise if no point is in the rectangle.
    """

    low_m: Floats
    high_m: Floats
    said: list[tuple[str, str]]
    is_empty: RequestError

    def holds(self, raw: NDArray[np.int32], file: PointFile) -> NDArray[np.bool_]:
        """Mask of the points of a file that are in the rectangle.

        The points have the shape (3, n) and are integers as in the file.
        """
        scales, offsets = file.scales_m[:2], file.offsets_m[:2]
        least = np.ceil((self.low_m - offsets) / scales - 1e-6)
        most = np.floor((self.high_m - offsets) / scales + 1e-6)
        x, y = raw[0], raw[1]
        inside: NDArray[np.bool_] = (x >= least[0]) & (x <= most[0])
        inside &= (y >= least[1]) & (y <= most[1])
        return inside

    def meets(self, file: PointFile) -> bool:
        """Whether a file may have points in the rectangle, according to the bounds in its header.

        If the first point of the file is outside of these bounds, the bounds are wrong, and the
        result is true.
        """
        low, high = file.bounds * file.metres
        first = file.first_m()[:2]
        if not ((low - 1.0 <= first) & (first <= high + 1.0)).all():
            return True
        return bool(((low <= self.high_m) & (self.low_m <= high)).all())


def box_of(crop: Crop, files: Sequence[PointFile], source: str) -> CropBox | None:
    """The rectangle of a crop in the coordinates of some files; None if all points of the files are
    used.

    Raises
    ------
    RequestError
        If the crop is in degrees and the cloud has no coordinate reference system, or if the user's
        rectangle does not overlap the cloud.
    """
    file = next((file for file in files if file.reference.horizontal is not None), files[0])
    crs, metres = file.reference.horizontal, file.metres
    reach = np.array([file.bounds * file.metres for file in files])
    low, high = reach[:, 0].min(axis=0), reach[:, 1].max(axis=0)
    bounds = np.array(crop.bounds)
    in_degrees = crop.frame == "degrees" or (
        crs is not None
        and (np.abs(bounds) <= GLOBE_DEG).all()
        and np.abs(files[0].first_m()[:2] / metres).max() > NEARBY
    )
    if in_degrees:
        if crs is None:
            if crop.of_plan:
                return None
            raise RequestError(
                f"--crop is given in degrees, but point cloud {source} has no coordinate "
                "reference system",
                "give W,S,E,N in the coordinates of the cloud",
            )
        bounds = _in_system(crs, crop.bounds)
    if not np.isfinite(bounds).all():
        if crop.of_plan:
            return None
        raise RequestError(f"--crop {crop} is not a place in {crs and crs.name}")
    corners = bounds.reshape(2, 2) * metres
    corners += [[-crop.margin_m], [crop.margin_m]]
    missed = (corners[0] > high).any() or (corners[1] < low).any()
    if missed and crop.of_plan:
        return None
    size = np.minimum(corners[1], high) - np.maximum(corners[0], low)
    whole = (corners[0] <= low).all() and (corners[1] >= high).all()
    if crop.of_plan and (whole or size.min() < NARROWEST_M):
        return None
    in_units = _text(corners / metres)
    said = []
    if crop.of_plan:
        message = (
            f"only the part of the point cloud around the plan is used, {size[0]:.0f} x "
            f"{size[1]:.0f} m ({in_units}); --crop all uses the whole cloud"
        )
        said = [("cropped_to_plan", message)]
    error = RequestError(
        f"no point of point cloud {source} lies in {'the crop' if crop.of_plan else '--crop'} "
        f"{in_units}",
        f"according to its headers, the cloud covers {_text(np.array([low, high]) / metres)}",
    )
    if missed:
        raise error
    return CropBox(corners[0], corners[1], said, error)


def _text(corners: Floats) -> str:
    (west, south), (east, north) = corners.tolist()
    return f"x {west:.10g} to {east:.10g}, y {south:.10g} to {north:.10g}"


def _in_system(crs: CRS, bounds: tuple[float, float, float, float]) -> Floats:
    """Bounds in degrees, converted to a coordinate reference system.  If the conversion is
    impossible, the result is not finite.
    """
    if (np.abs(bounds) > GLOBE_DEG).any():
        return np.full(4, math.nan)
    from pyproj.exceptions import ProjError

    try:
        return np.array(transformer(WGS84, crs).transform_bounds(*bounds))
    except ProjError:
        return np.full(4, math.nan)
