"""The stand that replaces the scan in the paper's Figs. 6 to 10, and views of the ground below it.

The paper's scan is not public.  A clumped stand with the paper's p is generated from a seed
instead.  Its crowns and trunks are on a periodic plot of 40 x 40 m and hide 56.7 % of the ground
from above.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from aosplan.scenes.occlusion import PlotWindow
from aosplan.simulation.forests import clumped_forest, generator
from aosplan.simulation.voxel_views import VoxelViews

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.scenes.voxels import VoxelVolume

DENSITY, SLICE_DENSITY = 0.567, 0.0095
"""p and mean D of the paper's LiDAR scan (its Figs. 4, 6 and 8)."""

OCCLUDER_M, BASE_M, HEIGHT_M = 0.20, 2.506, 17.54
"""Dimensions of the stand.  The size o is chosen for this project.  The other dimensions follow
from the paper: l/o = 87.69, and d̂ >= 1 for 98 % of the occluders at b = 3.5 m.
"""

ALTITUDE_M, BASELINE_M, SAMPLES = 50.0, 3.5, 50
"""Altitude, baseline and number of samples in section III of the paper."""

TARGET_M = 12.0
"""Side of the target area below the centre of the aperture."""


@lru_cache(maxsize=1)
def stand(seed: int, index: int = 0) -> VoxelVolume:
    """The voxels of a stand; stands with different indices are independent."""
    rng = generator(seed, index)
    return clumped_forest(rng, DENSITY, OCCLUDER_M, BASE_M, HEIGHT_M, (40.0, 40.0))


def centred_window(volume: VoxelVolume, per_voxel: int, side_m: float) -> PlotWindow:
    """Window that contains a square of targets at the centre of a stand."""
    side = round(side_m / volume.voxel_m) * per_voxel
    first = (volume.occupied.shape[1] * per_voxel - side) // 2
    return PlotWindow(first, first, side, side)


def views(seed: int, index: int = 0) -> VoxelViews:
    """Perspective views of a square of targets at the centre of a stand."""
    volume = stand(seed, index)
    window = centred_window(volume, 2, TARGET_M)
    return VoxelViews(volume, ALTITUDE_M, targets_per_voxel=2, window=window)


def grid(side: int, pitch_m: float) -> NDArray[np.float64]:
    """Positions of the cameras of a square grid [m], shape (side², 2). `side` is the number of
    cameras along each side.
    """
    along = (np.arange(side) - 0.5 * (side - 1)) * pitch_m
    return np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
