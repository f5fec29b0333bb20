"""Shortfalls of lattice patterns, and the fewest samples that do, for whole columns of d̂.

The same formulas as `aosplan.models.positions.pattern_shortfall` and the same searches as
`aosplan.solver.solve_monotone`, each step taken by all scenarios at once.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.grid.patterns import MOST_SITES, Pattern, pattern_for
from aosplan.models.equations import line_shortfall
from aosplan.models.positions import line_overlaps
from aosplan.numerics import triangle

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Counts = NDArray[np.int64]

TERMS_AT_ONCE = 1 << 17
"""Pairs of removed sites times scenarios evaluated at a time."""

MOST_REMOVED = 128
"""Removed sites up to which a pattern's pairs are summed; with more, rows are solved one by one."""

NONE, UNKNOWN = 0, -1
"""In place of a number of samples: no number of them does; too many are removed to tell here."""


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
    if grid != "trimmed":
        return _whole(*frame(grid, index_of(grid, samples)), dhat)
    rows, columns = frame(grid, index_of(grid, samples))
    removed = rows * columns - samples
    result = np.full(len(dhat), np.nan)
    whole = removed == 0
    result[whole] = _whole(rows[whole], columns[whole], dhat[whole])
    few = np.flatnonzero((removed > 0) & (removed <= np.minimum(MOST_REMOVED, samples)))
    order = few[np.argsort(samples[few], kind="stable")]
    counts, firsts = np.unique(samples[order], return_index=True)
    for count, first, end in zip(
        counts.tolist(), firsts.tolist(), [*firsts[1:].tolist(), len(order)], strict=False
    ):
        part = order[first:end]
        result[part] = _trimmed(count, dhat[part])
    return result


def _whole(rows: Any, columns: Any, dhat: Floats) -> Floats:
    """Shortfall of whole rectangles."""
    product = line_shortfall(columns, dhat) * line_shortfall(rows, dhat)
    # Where neighbours share nothing it is 1/N to the last digit, for targets met by just so many.
    found: Floats = np.where(dhat >= 1.0, 1.0 / (rows * columns), product)
    return found


class _Removed(NamedTuple):
    """Sites that a rectangle lacks: places of each, and distinct distances of their pairs.

    `pairs` has how many ordered pairs of different sites are so far apart.
    """

    sites: Pattern
    rows: Floats
    columns: Floats
    apart_y: Floats
    apart_x: Floats
    pairs: Floats


@lru_cache(maxsize=2048)
def _removed(grid: str, samples: int) -> _Removed:
    sites = pattern(grid, samples)
    rows, columns = np.array(sites.removed).T
    apart = np.abs(rows[:, None] - rows) * sites.columns + np.abs(columns[:, None] - columns)
    found, pairs = np.unique(apart, return_counts=True)
    # The first are the sites and themselves.
    y, x = np.divmod(found[1:], sites.columns)
    return _Removed(sites, *(each.astype(np.float64) for each in (rows, columns, y, x, pairs[1:])))


def _trimmed(samples: int, dhat: Floats) -> Floats:
    """Shortfall of a rectangle without some sites: what they share is taken away."""
    sites, rows, columns, apart_y, apart_x, pairs = _removed("trimmed", samples)
    result = np.empty(len(dhat))
    step = max(TERMS_AT_ONCE // max(len(pairs), len(rows)), 1)
    for start in range(0, len(dhat), step):
        part = dhat[start : start + step, None]
        lost = line_overlaps(rows, sites.rows, part, np)
        lost = lost * line_overlaps(columns, sites.columns, part, np)
        shared = triangle(apart_y * part, np) * triangle(apart_x * part, np)
        result[start : start + step] = shared @ pairs - 2.0 * lost.sum(axis=1)
    total = (
        _whole(float(sites.rows), float(sites.columns), dhat) * (sites.rows * sites.columns) ** 2
    )
    shortfall = (total + (result + len(rows))) / samples**2
    return np.where(dhat >= 1.0, 1.0 / samples, shortfall)


def fewest(grid: str, most: Floats, independent: Counts, dhat: Floats) -> Counts:
    """Fewest samples at one spacing whose shortfall is small enough, or `NONE`, or `UNKNOWN`.

    Parameters
    ----------
    grid
        As in `shortfalls`.
    most
        Shape (n,): the largest shortfall that is.
    independent
        Shape (n,): samples that would do at d̂ >= 1, a lower bound; 0 where none would.
    dhat
        Shape (n,).
    """

    def enough(index: Counts, chosen: NDArray[np.intp]) -> NDArray[np.bool_]:
        found = _whole(*frame(grid, index), dhat[chosen])
        return np.asarray(found <= most[chosen])

    last = index_of(grid, np.array([MOST_SITES]))[0]
    hopeless = (independent < 1) | (independent > MOST_SITES)
    low = index_of(grid, np.where(hopeless, 1, independent))
    high, chosen = low.copy(), np.flatnonzero(~hopeless)
    while len(chosen := chosen[~enough(high[chosen], chosen)]):
        at_last = high[chosen] == last
        hopeless[chosen[at_last]] = True
        chosen = chosen[~at_last]
        low[chosen], high[chosen] = high[chosen] + 1, np.minimum(2 * high[chosen], last)
    low = np.where(hopeless, high, low)
    rows, columns = frame(grid, index := _smallest(low, high, enough))
    whole = rows * columns
    if grid != "trimmed":
        return np.where(hopeless | (whole > MOST_SITES), NONE, whole)
    least = np.minimum(np.maximum(least_of(index), independent), whole)
    found = fewest_within(grid, most, np.where(hopeless, whole, least), whole, dhat)
    return np.where(hopeless | (found > MOST_SITES), NONE, found)


def fewest_within(grid: str, most: Floats, low: Counts, high: Counts, dhat: Floats) -> Counts:
    """Fewest samples from `low` to `high`, which do, all of one frame; or `UNKNOWN`."""
    unknown = np.zeros(len(dhat), dtype=bool)

    def meets(samples: Counts, chosen: NDArray[np.intp]) -> NDArray[np.bool_]:
        found = shortfalls(grid, samples, dhat[chosen])
        unknown[chosen[np.isnan(found)]] = True
        return np.asarray(found <= most[chosen])

    return np.where(unknown, UNKNOWN, _smallest(low, high, meets))


def _smallest(
    low: Counts, high: Counts, meets: Callable[[Counts, NDArray[np.intp]], NDArray[np.bool_]]
) -> Counts:
    """Smallest whole numbers from `low` that meet, those of `high` do; all rows at once."""
    low, high = low.copy(), high.copy()
    while len(chosen := np.flatnonzero(low < high)):
        middle = (low[chosen] + high[chosen]) // 2
        met = meets(middle, chosen)
        high[chosen[met]] = middle[met]
        low[chosen[~met]] = middle[~met] + 1
    return high


def frame(grid: str, index: Counts) -> tuple[Counts, Counts]:
    """Rows and columns of the frame at a place of a kind's sequence (`aosplan.grid.patterns.frame_at`)."""
    if grid == "line":
        return np.ones_like(index), index
    if grid == "square":
        return index, index
    return (index + 1) // 2, index // 2 + 1


def least_of(index: Counts) -> Counts:
    """Fewest samples that the frame of the trimmed grid at a place is for."""
    return (index // 2) * ((index - 1) // 2 + 1) + 1


def index_of(grid: str, samples: Counts) -> Counts:
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
