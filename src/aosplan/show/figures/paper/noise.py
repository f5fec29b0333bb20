"""Averaged noise patterns of Figs. 3 to 5, with their standard errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from aosplan.simulation.moments import Estimate

OCCLUDER_PX = 5
PATTERNS = 16
"""Independent patterns for each point."""


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
        Seed of the figure, and number of the point in it.
    p
        Share of the occupied cells, which have sides of `OCCLUDER_PX`.
    grid
        Rows and columns of the views.
    disparity_px
        Shift between neighbouring views.
    shape
        Rows and columns of the image.
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
