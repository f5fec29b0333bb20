"""Warnings about points of a cloud that are far away from all others.

A single bird above a stand raises the canopy top to its height, and a ground point that is too low
raises the heights of all plants around it.  Such points are not removed.  A warning gives their
place, and the user decides.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

GAP_M = 10.0
"""Voxels above an empty gap of at least this height may not be vegetation."""

FEW = 0.001
"""Voxels above a gap are outliers if their share of all occupied voxels is at most this."""

NARROW = 0.5
"""Points are treated as far beside a cloud if the length of the cloud without them is less than
this share of its length with them.
"""

GROUND_STEP_M = 10.0
STEEPEST = 2.0
"""A ground point is suspect if its height differs from that of its neighbours, and the slope to
them is steeper than this.
"""

NEIGHBOURS = 8


def outliers_above(volume: VoxelVolume) -> Iterator[tuple[str, str]]:
    """Yield a warning about voxels high above all others, if there are any."""
    slices = np.flatnonzero(volume.occupied.any(axis=(1, 2)))
    gaps = np.flatnonzero(np.diff(slices) > GAP_M / volume.voxel_m)
    if gaps.size == 0:
        return
    counts = np.count_nonzero(volume.occupied[slices], axis=(1, 2))
    total = int(counts.sum())
    for gap in gaps:
        count = int(counts[gap + 1 :].sum())
        if count > max(FEW * total, 1):
            continue
        top, low = slices[gap], slices[gap + 1]
        _, row, column = np.argwhere(volume.occupied[low : low + 1])[0]
        x = volume.x_min_m + (column + 0.5) * volume.voxel_m
        y = volume.y_min_m + (row + 0.5) * volume.voxel_m
        message = (
            f"{count} of {total} occupied voxels are {low * volume.voxel_m:.4g} m or more "
            f"above the ground, near x {x:.1f}, y {y:.1f}, and all others are below "
            f"{(top + 1) * volume.voxel_m:.4g} m.  They determine the top of the canopy.  If "
            "they are birds or noise, set their class to 7 or 18"
        )
        yield "points_far_above", message
        return


def beside(columns: NDArray[np.bool_], volume: VoxelVolume) -> Iterator[tuple[str, str]]:
    """Yield a warning about a few points far beside all others, which enlarge the plot.

    Parameters
    ----------
    columns
        Voxel columns with points, shape (rows, columns).
    volume
        The voxels.
    """
    total = int(np.count_nonzero(columns))
    for axis, name in ((1, "x"), (0, "y")):
        counts = np.count_nonzero(columns, axis=1 - axis)
        few, length = max(FEW * total, 1), columns.shape[axis]
        low = int(np.argmax(np.cumsum(counts) > few))
        high = length - 1 - int(np.argmax(np.cumsum(counts[::-1]) > few))
        if high - low + 1 >= NARROW * length:
            continue
        at_start = low > length - 1 - high
        places = np.argwhere(columns)
        row, column = places[np.argmin(places[:, axis]) if at_start else np.argmax(places[:, axis])]
        x = volume.x_min_m + (column + 0.5) * volume.voxel_m
        y = volume.y_min_m + (row + 0.5) * volume.voxel_m
        away_m = (low if at_start else length - 1 - high) * volume.voxel_m
        count = int((counts[:low] if at_start else counts[high + 1 :]).sum())
        message = (
            f"{count} of {total} voxel columns with points are far from all others along "
            f"{name}; the farthest, near x {x:.1f}, y {y:.1f}, is {away_m:.4g} m away and "
            "enlarges the plot.  Set the class of its points to 7, or crop the cloud (--crop)"
        )
        yield "points_far_beside", message


def ground_outliers(points: Floats, origin_m: Floats) -> Iterator[tuple[str, str]]:
    """Yield a warning about ground points far below or above their neighbours, if there are any.

    Parameters
    ----------
    points
        Ground points relative to the origin, shape (3, n).
    origin_m
        Corner of the plot, shape (3,).
    """
    from scipy.spatial import cKDTree

    if points.shape[1] <= NEIGHBOURS:
        return
    # The first neighbour is skipped, because it is the point itself.
    nearest = range(2, NEIGHBOURS + 2)
    distance, index = map(np.asarray, cKDTree(points[:2].T).query(points[:2].T, list(nearest)))
    step = points[2] - np.median(points[2, index], axis=1)
    found = np.flatnonzero(np.abs(step) > GROUND_STEP_M + STEEPEST * distance[:, -1])
    if found.size == 0:
        return
    worst = found[np.argmax(np.abs(step[found]))]
    x, y, z = points[:, worst] + origin_m
    side = "below" if step[worst] < 0.0 else "above"
    message = (
        f"{found.size} of {points.shape[1]} ground points are far from their neighbours; the "
        f"worst, at x {x:.1f}, y {y:.1f}, z {z:.1f}, is {abs(step[worst]):.3g} m {side} "
        "them, and heights near this point have the same error.  Set their class to 7, or "
        "give --ground filter"
    )
    yield "ground_outliers", message
