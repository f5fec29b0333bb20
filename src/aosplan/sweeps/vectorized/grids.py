"""Frames of lattice grids, for whole columns of sample counts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Counts = NDArray[np.int64]


def frame(grid: str, index: Counts) -> tuple[Counts, Counts]:
    """Rows and columns of the frame at an index of a kind's sequence
    (`aosplan.grid.patterns.frame_at`).
    """
    if grid == "line":
        return np.ones_like(index), index
    if grid == "square":
        return index, index
    return (index + 1) // 2, index // 2 + 1


def index_of(grid: str, samples: Counts) -> Counts:
    """Index of the first frame that holds this many samples."""
    if grid == "line":
        return samples.copy()
    side = np.floor(np.sqrt(samples.astype(float))).astype(np.int64)
    side += (side + 1) ** 2 <= samples
    side -= side**2 > samples
    if grid == "square":
        return np.asarray(side + (side * side < samples))
    square = side * side == samples
    index: Counts = np.where(square, 2 * side - 1, 2 * side + (samples > side * (side + 1)))
    return index
