"""Sets of lattice cells, stored as runs of whole numbers.

The cell (row, column) has the number row · stride + column.  Neighbours in a row have consecutive
numbers.  An area of a million cells therefore needs only a few thousand runs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    Whole = NDArray[np.int64]


class CellRuns(NamedTuple):
    """Runs of whole numbers from `start` to `stop` - 1.  They are sorted, and there is a gap
    between any two runs.
    """

    start: Whole
    stop: Whole

    @property
    def size(self) -> int:
        """Number of whole numbers in all runs."""
        return int((self.stop - self.start).sum())

    def numbers(self) -> Whole:
        """All numbers of the runs in order."""
        lengths = self.stop - self.start
        offsets = np.repeat(self.start - (np.cumsum(lengths) - lengths), lengths)
        return offsets + np.arange(len(offsets))

    def dilated(self, runs: Iterable[tuple[int, int]]) -> CellRuns:
        """All sums of a number in this set and a number in the given runs. Each given run is a pair
        (first, last).
        """
        pairs = [(self.start + first, self.stop + last) for first, last in runs]
        return united(
            np.concatenate([start for start, _ in pairs]),
            np.concatenate([stop for _, stop in pairs]),
        )

    def without(self, other: CellRuns) -> CellRuns:
        """The numbers of this set that are not in the other set."""
        bounds = np.unique(np.concatenate([*self, *other]))
        if len(bounds) < 2:
            return self
        kept = self.holds(bounds[:-1]) & ~other.holds(bounds[:-1])
        return united(bounds[:-1][kept], bounds[1:][kept])

    def holds(self, numbers: Whole) -> NDArray[np.bool_]:
        """Whether each of the numbers is in this set."""
        return np.searchsorted(self.start, numbers, "right") > np.searchsorted(
            self.stop, numbers, "right"
        )


def united(start: Whole, stop: Whole) -> CellRuns:
    """The union of runs that may be in any order and may overlap."""
    order = np.argsort(start, kind="stable")
    start, reach = start[order], np.maximum.accumulate(stop[order])
    if len(start) == 0:
        return CellRuns(start, reach)
    first = np.append(True, start[1:] > reach[:-1])
    last = np.append(first[1:], True)
    return CellRuns(start[first], reach[last])


def runs_of(numbers: Whole) -> CellRuns:
    """Runs of sorted numbers without duplicates."""
    return united(numbers, numbers + 1)
