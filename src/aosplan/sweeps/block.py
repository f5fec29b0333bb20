"""A block of consecutive scenarios as columns, and the status of each of them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray


class Block(NamedTuple):
    """Scenarios `start` to `start + rows` - 1, as columns by option.  The columns broadcast to
    `shape`.

    For each column of objects, `kinds` has the types of its values in all blocks, without the type
    of None.
    """

    start: int
    shape: tuple[int, ...]
    columns: dict[str, NDArray[Any]]
    kinds: Mapping[str, frozenset[type]] = {}

    @property
    def rows(self) -> int:
        """Number of scenarios."""
        return math.prod(self.shape)

    def flat(self, name: str) -> NDArray[Any]:
        """A column with one value for every scenario, in order."""
        return np.broadcast_to(self.columns[name], self.shape).reshape(-1)

    def request_values(self, row: int) -> dict[str, Any]:
        """The options of one scenario, by name."""
        place = np.unravel_index(row, self.shape)
        values = {
            name: np.broadcast_to(column, self.shape)[place]
            for name, column in self.columns.items()
        }
        return {
            name: value.item() if isinstance(value, np.generic) else value
            for name, value in values.items()
            if value is not None
        }


STATUSES = ("ok", "infeasible", "invalid")
"""Statuses of scenarios: solved (``ok``), no plan meets the target (``infeasible``), and the
request is not valid (``invalid``).
"""

OK, INFEASIBLE, INVALID = range(3)

DEFERRED = 3
"""Status of a scenario that has to be solved individually."""


class RowStatuses:
    """Status and reason of each scenario of a block.

    Attributes
    ----------
    status
        Shape of the block: index in `STATUSES`, or `DEFERRED`.
    reason
        Shape of the block: index of the reason in `texts`; -1 without a reason.
    texts
        Reasons.  Several scenarios may have the same reason.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.status: NDArray[np.uint8] = np.zeros(shape, dtype=np.uint8)
        self.reason: NDArray[np.int32] = np.full(shape, -1, dtype=np.int32)
        self.texts: list[str] = []

    def defer(self, where: Any) -> None:
        """Mark scenarios that have to be solved individually.  The mask broadcasts to the shape of
        the block.
        """
        if np.any(where):
            self.status[np.asarray(where) & (self.status == OK)] = DEFERRED

    def refuse(self, status: int, where: Any, text: Callable[..., str], *values: Any) -> None:
        """Refuse those scenarios of a mask whose status is still ``ok``.

        Parameters
        ----------
        status
            `INFEASIBLE` or `INVALID`.
        where
            Mask of the scenarios, which broadcasts to the block's shape.
        text
            Function that returns the reason.  Its arguments are the values of a scenario.
        values
            Columns that broadcast to the shape of the block.  Scenarios with the same values have
            the same reason.
        """
        if not np.any(where):
            return
        hit = np.asarray(where) & (self.status == OK)
        columns = np.broadcast_arrays(np.zeros(()), *values)[1:]
        shape = np.broadcast_shapes(*map(np.shape, columns))
        numbered = np.arange(np.prod(shape, dtype=int)).reshape(shape)
        places = np.broadcast_to(numbered, hit.shape)[hit]
        used = np.zeros(numbered.size, dtype=bool)
        used[places] = True
        self.status[hit] = status
        self.reason[hit] = (len(self.texts) - 1 + np.cumsum(used))[places]
        parts = (column.reshape(-1)[used].tolist() for column in columns)
        self.texts += map(text, *parts) if columns else [text()] * int(used.any())
