"""The interior of a plot: the places from which all rays of a plan stay on the plot.

A plot that was clipped out of a cloud is sparse at its rim.  If the plot is repeated beyond its
edges, this rim also affects rays from its middle.  Predictions therefore count the places of the
interior only, if they are a large enough part of the plot.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from aosplan.scenes.voxels import VoxelVolume

LEAST_INTERIOR = 0.2
"""Smallest share of a plot's places whose rays all stay on the plot.  If the share is smaller,
``auto`` counts all places.
"""


class PlotInterior(NamedTuple):
    """A rectangle of a plot's voxel columns: first row, first column, number of rows, number of
    columns.  The numbers are 0 if no place is inside.
    """

    row: int
    column: int
    rows: int
    columns: int

    def of(self, values: NDArray[np.float64], volume: VoxelVolume) -> NDArray[np.float64]:
        """The part of a map that is inside. The map covers the whole plot, and its last two axes
        are rows and columns of any pitch.
        """
        rows, columns = volume.occupied.shape[1:]
        down, across = values.shape[-2] / rows, values.shape[-1] / columns
        part: NDArray[np.float64] = values[
            ...,
            round(self.row * down) : round((self.row + self.rows) * down),
            round(self.column * across) : round((self.column + self.columns) * across),
        ]
        return part


def margins(
    volume: VoxelVolume,
    altitude_m: float,
    positions_m: ArrayLike,
    *,
    focal_height_m: float = 0.0,
    perspective: bool = False,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Widths of the margins at both ends of x and y, in voxels.  From a place in a margin, some ray
    leaves the plot.

    Parameters
    ----------
    volume
        The voxels of the plot.
    altitude_m
        Altitude of the cameras above the focal plane.
    positions_m
        Camera positions, metres east and north, shape (N, 2): relative to each place, or in
        perspective relative to the middle of the plot.
    focal_height_m
        Height of the focal plane above the ground.
    perspective
        Whether all places are below the same cameras.
    """
    positions = np.asarray(positions_m, dtype=np.float64)
    rise = max(volume.canopy_top_m - focal_height_m, 0.0) / altitude_m
    low, high = -positions.min(axis=0), positions.max(axis=0)
    if perspective:
        # The plot is convex, so a ray whose two ends are above the plot stays above it.
        half = 0.5 * np.array(volume.size_m)
        low, high, rise = low - half, high - half, rise / (1.0 - rise)
    # The margins are whole voxels, because all places of a voxel are treated in the same way.
    first, last = (
        np.ceil(np.maximum(side, 0.0) * rise / volume.voxel_m).astype(np.intp)
        for side in (low, high)
    )
    return first, last


def counted_part(
    volume: VoxelVolume,
    altitude_m: float,
    positions_m: ArrayLike,
    edges: str,
    *,
    focal_height_m: float = 0.0,
) -> tuple[PlotInterior | None, PlotInterior | None]:
    """The part of a plot that is counted in the telecentric view, and the interior with which the
    result for the whole plot is compared.

    Parameters
    ----------
    volume, altitude_m, positions_m, focal_height_m
        As in `margins`.
    edges
        ``auto``, ``interior`` or ``wrapped``, as in `aosplan.models.measured.MeasuredModel`.

    Returns
    -------
    tuple
        The first is None if the whole plot is counted.  The second is None if there is nothing to
        compare.

    Raises
    ------
    RequestError
        If `edges` is ``interior`` and no place has all rays on the plot.
    """
    first, last = margins(volume, altitude_m, positions_m, focal_height_m=focal_height_m)
    if edges == "wrapped" or not (first.any() or last.any()):
        return None, None
    rows, columns = volume.occupied.shape[1:]
    across, down = (np.array([columns, rows]) - first - last).tolist()
    if min(across, down) <= 0:
        if edges == "interior":
            raise nothing_inside()
        return None, None
    inside = PlotInterior(int(first[1]), int(first[0]), down, across)
    if edges == "auto" and down * across < LEAST_INTERIOR * rows * columns:
        return None, inside
    return inside, None


def nothing_inside() -> RequestError:
    """The error if only the interior may be counted, but no place is inside."""
    return RequestError(
        "--edges interior is not possible, because from every place, at least one ray to this "
        "grid leaves the plot",
        "measure a larger plot, plan a smaller grid (--max-aperture), or give --edges wrapped",
    )
