"""The user's own defaults for scenarios.  They are applied in the same way as `aosplan plan`
applies them to a request file.

A scenario overrides the defaults, and also removes defaults that it contradicts.  For example, a
``gsd`` removes the default altitude, and a ``drone`` removes the default camera and speeds.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.errors import RequestError
from aosplan.planning.request import fitting_defaults
from aosplan.sweeps.scenarios import ScenarioProduct, ScenarioTable, column_of, share_alone

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

DECIDING = ("grid", "trigger")
"""Options whose value determines which other options apply. For all other options, only their
presence matters.
"""


def with_defaults(
    scenarios: ScenarioProduct | ScenarioTable, own: Mapping[str, Any], where: str, folder: str = ""
) -> ScenarioProduct | ScenarioTable:
    """The scenarios with the user's own defaults.  Each scenario gets only the defaults that it
    does not contradict.

    Parameters
    ----------
    scenarios
        The scenarios.
    own, where
        Defaults by option, and the file of these defaults.
    folder
        Folder in which files of the scenarios are looked for first.

    Raises
    ------
    RequestError
        If the defaults contradict each other, or if a default applies to only some values of a
        crossing.
    """
    if isinstance(scenarios, ScenarioTable):
        filled = _filled(scenarios.values, own, where)
        return ScenarioTable(filled, share_alone(filled, folder))
    values = scenarios.values
    deciding = {name: dict.fromkeys(values[name].flat) for name in DECIDING if name in values}
    asked = {name: axis.flat[0] for name, axis in values.items()}
    found = [
        fitting_defaults(own, asked | dict(zip(deciding, chosen, strict=True)), where)
        for chosen in product(*deciding.values())
    ]
    for name in {name for each in found for name in each}:
        if not all(name in each for each in found):
            raise RequestError(
                f"'{where}': {name} cannot be combined with all values of "
                f"{' and '.join(deciding)} of the sweep",
                f"give {name} in the sweep's own file, or --defaults none",
            )
    values = values | {name: column_of([value]) for name, value in found[0].items()}
    return ScenarioProduct(values, share_alone(values, folder))


def _filled(
    values: Mapping[str, NDArray[Any]], own: Mapping[str, Any], where: str
) -> dict[str, NDArray[Any]]:
    """Columns of a table, in which missing values are replaced by the defaults."""
    given = {
        name: np.array([value is not None for value in column.flat])
        for name, column in values.items()
        if column.dtype == object
    }
    rows = len(next(iter(values.values())))
    # Rows are alike if they give the same options, and the same values for the options in
    # `DECIDING`.
    alike = np.zeros(rows, dtype=np.int64)
    for name, hole in given.items():
        kinds = list(dict.fromkeys(values[name].flat)) if name in DECIDING else []
        known = {kind: place for place, kind in enumerate(kinds)}
        part = np.array([known[kind] for kind in values[name].flat]) if kinds else hole
        alike = np.unique(alike * (len(kinds) + 2) + part, return_inverse=True)[1].reshape(-1)
    filled: dict[str, list[Any]] = {}
    for kind, first in zip(*np.unique(alike, return_index=True), strict=True):
        asked = {name: column[first] for name, column in values.items()}
        asked = {name: value for name, value in asked.items() if value is not None}
        for name, value in fitting_defaults(own, asked, where).items():
            if name not in filled:
                filled[name] = values[name].tolist() if name in values else [None] * rows
            for row in np.flatnonzero(alike == kind).tolist():
                filled[name][row] = value
    return dict(values) | {name: column_of(column) for name, column in filled.items()}
