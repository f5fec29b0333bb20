"""The target area of guided positions and reciprocal maps: the area of a plan, or a disc."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.models.place import Ground
from aosplan.numerics import heading_axis, turned

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from aosplan.planning.resolve import PlanInputs
    from aosplan.scenes.plot_frame import PlotFrame
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

CORNERS = 360
"""Number of corners of the polygon that represents a disc."""


class TargetArea(NamedTuple):
    """The ground that the photos should show, in metres east and north of an origin.

    Attributes
    ----------
    origin
        Latitude and longitude of the origin.
    corners_m
        Points of the outline, shape (n, 2).
    area_m2
        Size of the area.
    holds
        Function that takes points of shape (n, 2) and returns a mask of the points in the area,
        shape (n,).
    """

    origin: tuple[float, float]
    corners_m: Floats
    area_m2: float
    holds: Callable[[Floats], NDArray[np.bool_]]

    def on(self, frame: PlotFrame) -> Ground:
        """The area in the axes of a plot."""
        corners = frame.onto_plot(self.corners_m)
        (west, south), (east, north) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        return Ground(
            (west, south), (east, north), lambda points: self.holds(frame.from_plot(points))
        )

    def bounds_m(self, heading_deg: float) -> tuple[Floats, Floats]:
        """Smallest and largest coordinates along a heading and across it, each of shape (2,)."""
        axis = heading_axis(heading_deg)
        corners = np.column_stack(turned(self.corners_m[:, 0], self.corners_m[:, 1], axis))
        return corners.min(axis=0), corners.max(axis=0)


def target_area_of(inputs: PlanInputs) -> TargetArea:
    """The area of a plan, or the disc around its origin.

    Raises
    ------
    RequestError
        If the plan has no location.
    """
    if inputs.area is not None:
        import shapely

        whole = inputs.area.whole
        shapely.prepare(whole)

        def in_area(points: Floats) -> NDArray[np.bool_]:
            found: NDArray[np.bool_] = shapely.contains_xy(whole, points[:, 0], points[:, 1])
            return found

        return TargetArea(
            inputs.area.origin, shapely.get_coordinates(whole), float(whole.area), in_area
        )
    if inputs.origin is None:
        raise RequestError("there is no target area", "give --origin LAT,LON or --area FILE")
    radius_m = inputs.around_radius_m
    angles = np.arange(CORNERS) * (2.0 * math.pi / CORNERS)

    def in_disc(points: Floats) -> NDArray[np.bool_]:
        found: NDArray[np.bool_] = np.hypot(points[:, 0], points[:, 1]) <= radius_m
        return found

    rim = radius_m * np.column_stack([np.sin(angles), np.cos(angles)])
    return TargetArea(inputs.origin, rim, math.pi * radius_m**2, in_disc)


def located_stand(inputs: PlanInputs, what: str) -> VoxelVolume:
    """The voxels of a scene with a location.

    Parameters
    ----------
    inputs
        The inputs of a plan.
    what
        The option that needs the voxels, for error messages.

    Raises
    ------
    RequestError
        If the scene has no voxels or no location.
    """
    volume = inputs.loaded.volume
    if volume is None:
        raise RequestError(
            f"{what} needs the voxels of the place, and scene '{inputs.scene_name}' has none",
            "give the point cloud of the place with --scene FILE.laz",
        )
    if volume.place is None:
        raise RequestError(
            f"{what} needs a scene with a location, and scene '{inputs.scene_name}' has no "
            "coordinate reference system",
            "give a point cloud that names its coordinate reference system",
        )
    return volume
