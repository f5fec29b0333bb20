"""Averaged noise patterns: the experiment of the paper (Kurmi et al. 2019, Figs. 3 and 4).

A pattern is a plane of square cells of o x o pixels with a random phase.  Each cell is occupied
with probability p.  Views are shifted copies of the pattern.  Their average is the integral image X
of a black target, and V = 1 - mean X².  There is no volume and no camera.  The experiment therefore
tests only the statistics of shifted occluders.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.simulation.moments import Counts

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class NoisePattern(NamedTuple):
    """A plane of occupied cells.  It extends to the right of its first pixel and below it.

    Attributes
    ----------
    cells
        Shape (rows, columns), true for occupied cells.
    occluder_px
        o, edge length of a cell [px].
    phase_px
        Position of the first pixel within the first cell, along y and x, from 0 to o.
    """

    cells: NDArray[np.bool_]
    occluder_px: float
    phase_px: tuple[float, float]

    def view(self, shape: tuple[int, int], shift_px: tuple[float, float]) -> NDArray[np.bool_]:
        """The pixels of a view whose occluders are shifted by `shift_px` along x and y. Shifts are
        at least 0.
        """
        rows, columns = (
            np.floor((np.arange(count) + 0.5 + phase + shift) / self.occluder_px).astype(np.intp)
            for count, phase, shift in zip(shape, self.phase_px, shift_px[::-1], strict=True)
        )
        seen: NDArray[np.bool_] = self.cells[rows[:, np.newaxis], columns]
        return seen


def grid_shifts(rows: int, columns: int, disparity_px: float) -> NDArray[np.float64]:
    """Shifts of the views of a grid, x and y [px], shape (rows * columns, 2)."""
    y, x = np.mgrid[:rows, :columns]
    return np.column_stack([x.ravel(), y.ravel()]) * float(disparity_px)


def noise_pattern(
    rng: np.random.Generator,
    density: float,
    occluder_px: float,
    shape: tuple[int, int],
    reach_px: tuple[float, float] = (0.0, 0.0),
) -> NoisePattern:
    """A random pattern that is large enough for views of a given shape and shifts up to `reach_px`
    along x and y.

    Raises
    ------
    RequestError
        If the density is not a share, or if the size of an occluder is not positive.
    """
    if not 0.0 <= density <= 1.0:
        raise RequestError(f"noise pattern: density {density:g} is not between 0 and 1")
    if not 0.0 < occluder_px < np.inf:
        raise RequestError(f"noise pattern: occluder_px {occluder_px:g} is not positive")
    phase = rng.random(2) * occluder_px
    needed = [
        int((count + reach) / occluder_px) + 2
        for count, reach in zip(shape, reach_px[::-1], strict=True)
    ]
    return NoisePattern(rng.random(needed) < density, occluder_px, (phase[0], phase[1]))


def blocked_views(
    rng: np.random.Generator,
    density: float,
    occluder_px: float,
    shifts_px: ArrayLike,
    shape: tuple[int, int],
    *,
    only: int | None = None,
) -> NDArray[np.int32]:
    """Number of blocked views of one random pattern at each pixel. This number divided by N is the
    integral image.

    Parameters
    ----------
    rng
        Random generator of the pattern.
    density
        p, probability that a cell is occupied.
    occluder_px
        o, edge length of a cell [px].  It need not be a whole number.
    shifts_px
        Shape (N, 2): shift of each view along x and y [px].  Shifts need not be whole numbers.
    shape
        Rows and columns of the image.
    only
        Index of the only view that is counted; None for all views.  The pattern does not depend on
        it.
    """
    shifts = np.asarray(shifts_px, dtype=np.float64)
    shifts = shifts - shifts.min(axis=0)
    reach_x, reach_y = shifts.max(axis=0).tolist()
    pattern = noise_pattern(rng, density, occluder_px, shape, (reach_x, reach_y))
    blocked = np.zeros(shape, dtype=np.int32)
    for x, y in shifts.tolist() if only is None else [shifts[only].tolist()]:
        blocked += pattern.view(shape, (x, y))
    return blocked


def counts_of(blocked: NDArray[np.int32], views: int) -> Counts:
    """Counts over the pixels of an image of blocked views.  Each pixel is a target."""
    flat = blocked.ravel().astype(np.int64)
    return Counts(views, flat.size, int(flat.sum()), int(flat @ flat))
