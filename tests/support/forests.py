"""Random clumped forests as voxels: trees with a stem and a crown of leafy clumps.

Tests use them instead of real point clouds, which are not part of the project.  The plot is
periodic, as in the models.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aosplan.scenes.voxels import VoxelVolume


class Stand(NamedTuple):
    """Parameters of a stand.  Heights and radii are means, and vary by 20 % between trees."""

    seed: int
    trees: int
    height_m: float
    crown_radius_m: float
    crown_share: float
    foliage: float
    clump_m: float


STANDS = {
    "spruce": Stand(1, 22, 24.0, 2.2, 0.7, 0.25, 0.5),
    "beech": Stand(2, 10, 22.0, 3.6, 0.55, 0.12, 1.0),
    "open_pine": Stand(3, 8, 18.0, 2.5, 0.35, 0.3, 0.75),
}


def clumped_forest(stand: Stand, *, side_m: float = 24.0, voxel_m: float = 0.25) -> VoxelVolume:
    """A stand as voxels.  Crowns are ellipsoids of clumps.  Each clump is either leafy or empty."""
    rng = np.random.default_rng(stand.seed)
    cells = round(side_m / voxel_m)
    levels = round(1.4 * stand.height_m / voxel_m)
    occupied = np.zeros((levels, cells, cells), dtype=bool)
    clump = round(stand.clump_m / voxel_m)
    shape = [-(-levels // clump), -(-cells // clump), -(-cells // clump)]
    leafy = rng.random(shape) < 0.5
    for axis in range(3):
        leafy = leafy.repeat(clump, axis=axis)
    leafy = leafy[:levels, :cells, :cells] & (rng.random(occupied.shape) < stand.foliage)
    z = (np.arange(levels) + 0.5)[:, None, None] * voxel_m
    along = (np.arange(cells) + 0.5) * voxel_m
    for _ in range(stand.trees):
        x, y = rng.uniform(0.0, side_m, 2)
        height, radius = rng.normal(1.0, 0.15, 2).clip(0.6, 1.4) * (
            stand.height_m,
            stand.crown_radius_m,
        )
        dx, dy = (np.abs((along - at + side_m / 2) % side_m - side_m / 2) for at in (x, y))
        from_stem = np.hypot(dx[None, None, :], dy[None, :, None])
        half = 0.5 * stand.crown_share * height
        crown = (from_stem / radius) ** 2 + ((z - (height - half)) / half) ** 2 < 1.0
        stem = (from_stem < 0.2) & (z < height)
        occupied |= (crown & leafy) | stem
    occupied[: round(0.5 / voxel_m)] = False
    return VoxelVolume(occupied, voxel_m, min_height_m=0.5, source="generated")
