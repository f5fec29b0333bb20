"""Conversion of positions between metres east and north and the axes of a plot's voxels.

Rows and columns of a point cloud are along the axes of its coordinate reference system, which may be
turned by a few degrees from north and east.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.geodesy import to_local

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]


class PlotFrame(NamedTuple):
    """The axes of a plot in metres east and north of an origin.

    Attributes
    ----------
    east_m, north_m
        The middle of the plot.
    turn_deg
        Direction of increasing rows, clockwise from true north.
    """

    east_m: float
    north_m: float
    turn_deg: float

    @property
    def _axes(self) -> Floats:
        """Matrix whose columns are the unit vectors along columns and along rows, in
        (east, north).
        """
        turn = math.radians(self.turn_deg)
        return np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])

    def onto_plot(self, points_m: Floats) -> Floats:
        """Convert points (east, north) relative to the origin to points (x, y) relative to the
        middle of the plot, shape (N, 2).
        """
        away: Floats = points_m - np.array([self.east_m, self.north_m])
        return away @ self._axes

    def from_plot(self, points_m: Floats) -> Floats:
        """The inverse of `onto_plot`."""
        back: Floats = points_m @ self._axes.T
        back += np.array([self.east_m, self.north_m])
        return back


def plot_frame(volume: VoxelVolume, origin: tuple[float, float]) -> PlotFrame:
    """The axes of a volume with a location. `origin` is a latitude and a longitude."""
    assert volume.place is not None
    (east,), (north,) = to_local(origin, [volume.place[0]], [volume.place[1]])
    return PlotFrame(east, north, volume.turn_deg)
