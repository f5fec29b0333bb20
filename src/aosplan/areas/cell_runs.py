"""Sets of lattice cells as runs of whole numbers.

A cell (row, column) is the number row · stride + column, so a row's neighbours are neighbours
in number, and an area of a million cells is a few thousand runs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    Whole = NDArray[np.int64]


class CellRuns(NamedTuple):
    """Runs of whole numbers from `start` up to, not including, `stop`: sorted, none touching."""

    start: Whole
    stop: Whole

    @property
    def size(self) -> int:
        """How many numbers there are in all."""
        return int((self.stop - self.start).sum())

    def numbers(self) -> Whole:
        """All of them, in order."""
        lengths = self.stop - self.start
        offsets = np.repeat(self.start - (np.cumsum(lengths) - lengths), lengths)
        return offsets + np.arange(len(offsets))

    def dilated(self, runs: Iterable[tuple[int, int]]) -> CellRuns:
        """Every sum of a number here and one of some runs (first, last)."""
        pairs = [(self.start + first, self.stop + last) for first, last in runs]
        return united(
            np.concatenate([start for start, _ in pairs]),
            np.concatenate([stop for _, stop in pairs]),
        )

    def without(self, other: CellRuns) -> CellRuns:
        """What is here and not in the other."""
        bounds = np.unique(np.concatenate([*self, *other]))
        if len(bounds) < 2:
            return self
        kept = self.holds(bounds[:-1]) & ~other.holds(bounds[:-1])
        return united(bounds[:-1][kept], bounds[1:][kept])

    def holds(self, numbers: Whole) -> NDArray[np.bool_]:
        """Whether each of some numbers is here."""
        return np.searchsorted(self.start, numbers, "right") > np.searchsorted(
            self.stop, numbers, "right"
        )


def united(start: Whole, stop: Whole) -> CellRuns:
    """The runs that cover given ones, which may be in any order and overlap."""
    order = np.argsort(start, kind="stable")
    start, reach = start[order], np.maximum.accumulate(stop[order])
    if len(start) == 0:
        return CellRuns(start, reach)
    first = np.append(True, start[1:] > reach[:-1])
    last = np.append(first[1:], True)
    return CellRuns(start[first], reach[last])


def runs_of(numbers: Whole) -> CellRuns:
    """Runs of sorted numbers, each there once."""
    return united(numbers, numbers + 1)
