"""A block of consecutive scenarios as columns."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray


class Block(NamedTuple):
    """Scenarios `start` to `start + rows` - 1: columns by option, which broadcast to `shape`.

    `kinds` has, for each column of objects, the types of its values in any block, without None.
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
