"""Shortfalls of lattice patterns, and the fewest samples that do, for whole columns of d̂.

The same formulas as `aosplan.models.sites.pattern_shortfall` and the same search as
`aosplan.solve.fewest_at`, each step taken by all scenarios at once.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.models.equations import visibility_shortfall
from aosplan.pattern import MOST_SITES, Pattern, pattern_for
from aosplan.problem import TOLERANCE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Counts = NDArray[np.int64]

MOST_REMOVED = 64
"""Removed sites up to which a pattern's pairs are summed; with more, rows are solved one by one."""


@lru_cache(maxsize=4096)
def pattern(grid: str, samples: int) -> Pattern:
    """The pattern of a kind of lattice with at least so many samples."""
    found = pattern_for(grid, samples)
    assert isinstance(found, Pattern)  # columns know lattices only
    return found


def shortfalls(grid: str, samples: Counts, dhat: Floats) -> Floats:
    """Shortfall 1 - V̂ of patterns of so many samples; nan where too many sites are removed.

    Parameters
    ----------
    grid
        ``trimmed``, ``rectangle``, ``square`` or ``line``.
    samples, dhat
        Shape (n,): samples of each pattern, and d̂ between its neighbours.
    """
    result = np.empty(len(dhat))
    if not len(result):
        return result
    counts, places = np.unique(samples, return_inverse=True)
    order = np.argsort(places, kind="stable")
    for count, rows in zip(
        counts.tolist(), np.split(order, np.cumsum(np.bincount(places))[:-1]), strict=True
    ):
        result[rows] = _shortfalls_of(pattern(grid, count), dhat[rows])
    return result


def _shortfalls_of(sites: Pattern, dhat: Floats) -> Floats:
    whole: Floats = visibility_shortfall(float(sites.rows), float(sites.columns), dhat)
    if sites.removed:
        if len(sites.removed) > min(MOST_REMOVED, sites.samples):
            return np.full(len(dhat), np.nan)
        lost, twice = np.zeros(len(dhat)), np.full(len(dhat), float(len(sites.removed)))
        for index, (row, column) in enumerate(sites.removed):
            lost += _overlaps(row, sites.rows, dhat) * _overlaps(column, sites.columns, dhat)
            for other_row, other_column in sites.removed[index + 1 :]:
                y = np.maximum(1.0 - abs(other_row - row) * dhat, 0.0)
                twice += 2.0 * y * np.maximum(1.0 - abs(other_column - column) * dhat, 0.0)
        total = whole * (sites.rows * sites.columns) ** 2
        whole = (total - 2.0 * lost + twice) / sites.samples**2
    independent = 1.0 / sites.samples
    return np.where(dhat >= 1.0, independent, whole)


def _overlaps(index: int, count: int, dhat: Floats) -> Floats:
    """Sum of max(0, 1 - |i - index| d̂) over the sites i = 0 … count - 1 of a line."""
    return 1.0 + _one_side(index, dhat) + _one_side(count - 1 - index, dhat)


def _one_side(neighbours: int, dhat: Floats) -> Floats:
    reach = np.where(neighbours * dhat <= 1.0, neighbours, np.floor(1.0 / dhat))
    side: Floats = reach * (1.0 - 0.5 * dhat * (reach + 1.0))
    return side


def fewest(grid: str, allowed: Floats, independent: Counts, dhat: Floats) -> Counts:
    """Fewest samples whose shortfall is at most what is allowed; 0 where none or not known here.

    Parameters
    ----------
    grid
        As in `shortfalls`.
    allowed
        Shape (n,): 1 - V̂ of the targets.
    independent
        Shape (n,): samples that would do at d̂ >= 1, a lower bound.
    dhat
        Shape (n,).
    """
    allowed = allowed * (1.0 + TOLERANCE)

    def enough(index: Counts, chosen: NDArray[np.intp]) -> NDArray[np.bool_]:
        rows, columns = _frame(grid, index)
        found = visibility_shortfall(rows.astype(float), columns.astype(float), dhat[chosen])
        return np.asarray(found <= allowed[chosen])

    low = _index_of(grid, independent)
    high, chosen = low.copy(), np.arange(len(dhat))
    hopeless = np.zeros(len(dhat), dtype=bool)
    while len(chosen := chosen[~enough(high[chosen], chosen)]):
        rows, columns = _frame(grid, high[chosen])
        far = rows * columns > MOST_SITES
        hopeless[chosen[far]] = True
        chosen = chosen[~far]
        low[chosen], high[chosen] = high[chosen] + 1, 2 * high[chosen]
    index = _smallest(low, high, enough)
    rows, columns = _frame(grid, index)
    if grid != "trimmed":
        return np.where(hopeless, 0, rows * columns)
    most = rows * columns
    least = np.minimum(np.maximum((index // 2) * ((index - 1) // 2 + 1) + 1, independent), most)

    def meets(samples: Counts, chosen: NDArray[np.intp]) -> NDArray[np.bool_]:
        found = shortfalls(grid, samples, dhat[chosen])
        hopeless[chosen[np.isnan(found)]] = True
        return np.asarray(found <= allowed[chosen])

    hopeless |= most > MOST_SITES
    high = np.where(hopeless, least, most)
    return np.where(hopeless, 0, _smallest(least, high, meets))


def _smallest(low: Counts, high: Counts, meets: Any) -> Counts:
    """Smallest whole numbers from `low` that meet, those of `high` do; all rows at once."""
    low, high = low.copy(), high.copy()
    while len(chosen := np.flatnonzero(low < high)):
        middle = (low[chosen] + high[chosen]) // 2
        met = meets(middle, chosen)
        high[chosen[met]] = middle[met]
        low[chosen[~met]] = middle[~met] + 1
    return high


def _frame(grid: str, index: Counts) -> tuple[Counts, Counts]:
    """Rows and columns of the frame at a place of a kind's sequence (`aosplan.pattern.frame_at`)."""
    if grid == "line":
        return np.ones_like(index), index
    if grid == "square":
        return index, index
    return (index + 1) // 2, index // 2 + 1


def _index_of(grid: str, samples: Counts) -> Counts:
    """Place of the first frame that takes so many samples."""
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
