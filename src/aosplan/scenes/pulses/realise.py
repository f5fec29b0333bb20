"""A volume of opaque and empty cells of leaf size, drawn at random from the attenuation.

Each cell is opaque with probability 1 - exp(-λ t), where λ is its attenuation and t the thickness
of its slice.  The cells are plates: a ray meets one plate in each slice, and further plates if its
path is longer (`aosplan.scenes.occlusion`).  Cubes would hide more than leaves do, because slanted
rays would also meet the side faces of cubes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from aosplan.scenes.voxels import FACE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

SEED = 1
"""Random seed of the cells. It is constant, because the same cloud should always give the same
stand.
"""

LEAF_M = 0.06
"""Approximate default edge of a cell.  Sizes up to 0.1 m make little difference to a prediction."""

SMALLEST_LEAF_M = 0.03
FEWEST_COLUMNS = 65_000
"""A plot with fewer columns of cells than this gets smaller cells, but not smaller than
`SMALLEST_LEAF_M`.  On a plot with sides of 8 m, this halves the random error of p̄ and V that is
due to the seed. The error is then 0.001.
"""

MOST_CELLS = 400_000_000
"""Largest number of cells of a volume. On larger plots, the cells are larger."""


def leaf_size_for(size_m: tuple[float, float], slices: int, voxel_m: float) -> float:
    """Edge of a cell [m] for a plot.  It is about `LEAF_M`, smaller on small plots, and larger on
    large plots to limit the number of cells.

    If possible, a voxel is a whole number of cells wide, so that all voxels have the same number of
    cells.
    """
    area_m2 = math.prod(size_m)
    wanted = min(LEAF_M, max(SMALLEST_LEAF_M, math.sqrt(area_m2 / FEWEST_COLUMNS)))
    least = math.sqrt(area_m2 * max(slices, 1) / MOST_CELLS)
    across = min(math.floor(voxel_m / wanted + 0.5), math.floor(voxel_m / least))
    return voxel_m / across if across else max(wanted, least)


def realised(
    attenuation_per_m: NDArray[np.float32],
    voxel_m: float,
    cut_m: float,
    leaf_m: float,
    size_m: tuple[float, float],
    scales: Sequence[float],
    seed: int = SEED,
) -> list[NDArray[np.bool_]]:
    """Opaque cells of a stand, for each scale of its attenuation.

    The same random numbers are used for all scales.  A cell that is opaque at one scale is
    therefore opaque at every larger scale.

    Parameters
    ----------
    attenuation_per_m
        λ [1/m], shape (slices, rows, columns), in cubes of edge `voxel_m`.
    voxel_m
        Edge of these cubes, and thickness of a slice of cells.
    cut_m
        Height below which the volume is empty.
    leaf_m
        Edge of a cell along x and y.
    size_m
        Size of the plot along x and y.  A margin that is narrower than a cell is left out.
    scales
        Factors of λ.
    seed
        Random seed.

    Returns
    -------
    list of ndarray
        Each of shape (slices, rows, columns) in cells.
    """
    slices, rows, columns = attenuation_per_m.shape
    across, down = (max(int(length / leaf_m + FACE), 1) for length in size_m)
    row, column = (
        np.minimum(((np.arange(n) + 0.5) * (leaf_m / voxel_m)).astype(np.intp), most - 1)
        for n, most in ((down, rows), (across, columns))
    )
    rng = np.random.Generator(np.random.PCG64(seed))
    volumes = [np.zeros((slices, down, across), dtype=np.bool_) for _ in scales]
    for k, plane in enumerate(attenuation_per_m):
        thickness_m = min((k + 1) * voxel_m - cut_m, voxel_m)
        if thickness_m <= 0.0 or not plane.any():
            continue
        # A cell is opaque if an exponentially distributed random number is smaller than its optical
        # depth.
        drawn = rng.standard_exponential((down, across), dtype=np.float32)
        depth = plane[row[:, np.newaxis], column] * np.float32(thickness_m)
        for scale, volume in zip(scales, volumes, strict=True):
            np.less(drawn, depth * np.float32(scale), out=volume[k])
    return volumes
