"""Density of the canopy above each place, for a stand with a known location.

Slanted rays to a place cross the canopy around it. If photos with a footprint of width F are taken
from the altitude h, the rays to a place cross the height H within a square of side F H/h. The
density above the place is therefore the share of this square that is hidden from vertically above.
H is the mean height at which vertical rays end in the canopy. The canopy above a place is known
only if the whole square is on the plot, because the rim of a plot is often sparse.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.scenes.plot_frame import plot_frame

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

NARROWEST_M = 4.0
"""Smallest side of the square over which the canopy is averaged.  It is the side of the detector's
box.
"""

DEEPEST = 6.0
"""Largest optical depth.  Denser canopy, through which less than 1/400 of the ground is visible, is
treated as having this depth.
"""


class LocalCanopy(NamedTuple):
    """The canopy above some places.

    Attributes
    ----------
    depth
        Optical depth -ln(1 - p), where p is the share of the ground around a place that is hidden
        from vertically above; nan if the square around the place is not within the stand.
    window_m
        Side of the square around a place over which p is averaged.
    mean_depth
        Optical depth of the whole stand.
    """

    depth: Floats
    window_m: float
    mean_depth: float

    @property
    def known_share(self) -> float:
        """Share of the places whose canopy is known."""
        return float(np.isfinite(self.depth).mean()) if len(self.depth) else 0.0


def local_canopy(
    volume: VoxelVolume,
    places_m: Floats,
    origin: tuple[float, float],
    *,
    altitude_m: float,
    footprint_m: float,
    focal_height_m: float = 0.0,
) -> LocalCanopy:
    """The canopy above places.

    Parameters
    ----------
    volume
        The stand, which has a location.
    places_m
        Metres east and north of the origin, shape (places, 2).
    origin
        Latitude and longitude of the origin.
    altitude_m, focal_height_m
        Altitude of the cameras above the focal plane, and height of the focal plane above the
        ground.
    footprint_m
        Longer side of a photo on the ground.
    """
    from scipy.ndimage import uniform_filter

    lowest = int(focal_height_m / volume.slice_height_m)
    above = volume.occupied[lowest:]
    hidden = above.any(axis=0)
    densities = above.mean(axis=(1, 2)) if len(above) else np.zeros(0)
    heights = (np.arange(len(above)) + 0.5) * volume.slice_height_m
    height_m = float((densities @ heights) / densities.sum()) if densities.sum() > 0.0 else 0.0
    window_m = max(footprint_m * height_m / altitude_m, NARROWEST_M)
    size = max(round(window_m / volume.voxel_m), 1)
    around = uniform_filter(hidden.astype(np.float64), size, mode="nearest")
    width_m, depth_m = volume.size_m
    on_plot = plot_frame(volume, origin).onto_plot(places_m)
    column, row = (
        np.floor((on_plot[:, axis] + 0.5 * length) / volume.voxel_m).astype(np.int64)
        for axis, length in enumerate((width_m, depth_m))
    )
    rows, columns = hidden.shape
    rim = size // 2
    known = (column >= rim) & (column < columns - rim) & (row >= rim) & (row < rows - rim)
    share = np.full(len(places_m), np.nan)
    share[known] = around[row[known], column[known]]
    return LocalCanopy(_depth(share), window_m, float(_depth(np.array(hidden.mean()))))


def _depth(share: Floats) -> Floats:
    depth: Floats = -np.log1p(-np.clip(share, 0.0, -np.expm1(-DEEPEST)))
    return depth
