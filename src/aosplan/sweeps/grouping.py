"""Groups of a sweep's summary: the values of its inputs, and the column that is optimised.

The groups depend only on the scenarios, and are known before any scenario is solved.  Parts can
therefore be summarised independently.
"""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.sweeps.block import Block
from aosplan.sweeps.scenarios import ScenarioProduct
from aosplan.sweeps.solve_rows import DETECTION, RESULTS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.sweeps.scenarios import ScenarioTable

MOST_GROUPS = 20
"""Largest number of values of an input that are listed individually. If an input has more numbers
than this, the numbers are grouped into `BINS` bins of equal size.
"""

BINS = 10

OBJECTIVES = {
    "samples": ("samples", False),
    "aperture": ("aperture_m", False),
    "time": ("flight_time_s", False),
    "visibility": ("visibility_expected", True),
    "contrast": ("visibility_contrast", True),
}
"""Column of each quantity that a plan optimises, and whether a larger value is better."""


class InputGroups(NamedTuple):
    """Groups of the values of one input: numbers and text.

    `numbers` has single values, or the first and last value of each bin, in increasing order.
    `words` has all other values, including None, in the order of the sweep.
    """

    name: str
    numbers: tuple[tuple[float, float], ...]
    words: tuple[Any, ...]

    @property
    def size(self) -> int:
        """Number of groups, including one group for values that are in no other group."""
        return len(self.numbers) + len(self.words) + 1

    def labels(self) -> list[dict[str, Any]]:
        """Description of each group, for a document."""
        numbers = [
            {"value": low} if low == high else {"first": low, "last": high}
            for low, high in self.numbers
        ]
        return [*numbers, *({"value": word} for word in self.words), {"others": True}]

    def places(self, values: NDArray[Any]) -> NDArray[np.intp]:
        """Index of the group of each value."""
        lows = [low for low, _ in self.numbers]
        if values.dtype != object:
            return np.searchsorted(lows, values, "right") - 1
        known = {word: len(lows) + place for place, word in enumerate(self.words)}
        found = [
            bisect_right(lows, value) - 1 if _is_number(value) else known.get(value, self.size - 1)
            for value in values.flat
        ]
        return np.array(found, dtype=np.intp).reshape(values.shape)


class Grouping(NamedTuple):
    """Groups of a summary: inputs with several values, and the column of the objective."""

    objective: str
    most: bool
    groups: tuple[InputGroups, ...]
    fixed: tuple[tuple[str, Any], ...]

    @property
    def needed(self) -> tuple[str, ...]:
        """Results that the summary needs in addition to the results that are written."""
        return (self.objective,)


def grouping(scenarios: ScenarioProduct | ScenarioTable, best: str | None = None) -> Grouping:
    """The groups of a sweep's summary.

    Parameters
    ----------
    scenarios
        The scenarios.
    best
        Column to maximise, or to minimise if it starts with a minus.  By default, it is the
        quantity that the sweep optimises, or the number of samples if this quantity differs between
        rows.
    """
    wanted = best or ""
    objective, most = wanted.lstrip("-"), not wanted.startswith("-")
    if objective not in RESULTS + DETECTION:
        chosen = set(scenarios.values.get("optimize", np.array(["samples"], dtype=object)).flat)
        only = chosen.pop() if len(chosen) == 1 else "samples"
        objective, most = OBJECTIVES.get(only, OBJECTIVES["samples"])
    groups, fixed = [], []
    for name, values in scenarios.values.items():
        found = _groups(name, values)
        if len(found.numbers) + len(found.words) > 1:
            groups.append(found)
        else:
            single = values.flat[0]
            fixed.append((name, single.item() if isinstance(single, np.generic) else single))
    return Grouping(objective, most, tuple(groups), tuple(fixed))


def _groups(name: str, values: NDArray[Any]) -> InputGroups:
    words: list[Any] = []
    if values.dtype != object:
        numbers = np.unique(values)
    else:
        distinct = list(dict.fromkeys(values.flat))
        words = [value for value in distinct if not _is_number(value)][:MOST_GROUPS]
        numbers = np.unique([value for value in distinct if _is_number(value)])
    parts = np.array_split(numbers, BINS if len(numbers) > MOST_GROUPS else max(len(numbers), 1))
    bounds = tuple((part[0].item(), part[-1].item()) for part in parts if len(part))
    return InputGroups(name, bounds, tuple(words))


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def scenario(scenarios: ScenarioProduct | ScenarioTable, row: int) -> dict[str, Any]:
    """The inputs of one row, counted from 0, by their names in a request."""
    sizes = [len(values) for values in scenarios.values.values()]
    crossed = isinstance(scenarios, ScenarioProduct)
    places = map(int, np.unravel_index(row, sizes)) if crossed else [row] * len(sizes)
    columns = {
        name: values[[place]]
        for (name, values), place in zip(scenarios.values.items(), places, strict=True)
    }
    values = Block(row, (1,), columns).request_values(0)
    return {
        name: list(value) if isinstance(value, tuple) else value for name, value in values.items()
    }
