"""Averaged noise patterns of Figs. 3 to 5, with their standard errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from aosplan.simulation.moments import Estimate

OCCLUDER_PX = 5
PATTERNS = 16
"""Number of independent patterns for each point of a figure."""


def averaged(
    seed: int,
    index: int,
    p: float,
    grid: tuple[int, int],
    disparity_px: float,
    shape: tuple[int, int],
) -> Estimate:
    """Mean V and V̂ of several averaged noise patterns with the same density.

    Parameters
    ----------
    seed, index
        Seed of the figure, and index of the point in the figure.
    p
        Share of the cells that are occupied. The side of a cell is `OCCLUDER_PX`.
    grid
        Number of rows and columns of the grid of views.
    disparity_px
        Shift between neighbouring views [px].
    shape
        Number of rows and columns of the image.
    """
    from aosplan.simulation.forests import generator
    from aosplan.simulation.moments import estimate
    from aosplan.simulation.noise_patterns import blocked_views, counts_of, grid_shifts

    shifts = grid_shifts(*grid, disparity_px)
    return estimate(
        [
            counts_of(
                blocked_views(generator(seed, index * PATTERNS + k), p, OCCLUDER_PX, shifts, shape),
                len(shifts),
            )
            for k in range(PATTERNS)
        ]
    )
