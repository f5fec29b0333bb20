"""Columns of a sweep's results: the choice of the columns that a figure shows, and their names in
words.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.planning.options import BY_NAME
from aosplan.units import nearest_hint

if TYPE_CHECKING:
    from collections.abc import Sequence

DEFAULT_X, DEFAULT_Y = "samples", "flight_time_s"
"""Columns of the default figure, which shows a trade-off."""

MORE_IS_BETTER = (
    "visibility_minimum",
    "visibility_maximum",
    "visibility_expected",
    "visibility_normalized",
    "visibility_effective_samples",
    "visibility_contrast",
)
"""Results for which larger values are better.  For all other results, smaller values are better."""

UNITS = {"_m": "m", "_s": "s", "_deg": "°", "_px": "px", "_mps": "m/s"}

OPTION_UNITS = {"M": "m", "M|RANGE": "m", "S": "s", "DEG": "°", "M/S": "m/s", "MIN": "min"}
"""Unit of an option, by the placeholder of its value in the help."""

SYMBOLS = {
    "samples": "samples N",
    "baseline_m": "baseline b [m]",
    "aperture_m": "aperture a [m]",
    "vhat": "target V̂",
    "visibility": "target V",
    "visibility_density": "density p",
    "visibility_expected": "visibility V",
    "visibility_normalized": "normalised visibility V̂",
}
"""The symbols of columns that have one."""


class ColumnChoice(NamedTuple):
    """The columns of a figure.

    Attributes
    ----------
    x, y
        Columns of the axes; None for `DEFAULT_X` and `DEFAULT_Y` in a scatter plot.
    value
        A result that is drawn as a map over x and y; None for a scatter plot.
    by
        A column that colours the points of a scatter plot, or that has a map for each of its values.
    """

    x: str | None = None
    y: str | None = None
    value: str | None = None
    by: str | None = None


TRADEOFF = ColumnChoice()
"""The default figure: flight time against samples."""


def check_columns(names: Sequence[str], choice: ColumnChoice, *, flags: str = "--") -> None:
    """Refuse columns that the results do not have.

    Raises
    ------
    RequestError
        If a name is unknown, or if one of the two columns of a map is not given.
    """
    x, y, value, by = choice
    if value is not None and (x is None or y is None):
        raise RequestError(
            f"{flags}value needs {flags}x and {flags}y",
            f"give {flags}x and {flags}y as well, because a map needs two inputs",
        )
    known = ("x", x or DEFAULT_X), ("y", y or DEFAULT_Y), ("value", value), ("by", by)
    for option, name in known:
        if name is not None and name not in names:
            raise RequestError(
                f"{flags}{option}: the results have no column '{name}'",
                nearest_hint(name, names) or f"columns: {', '.join(names)}",
            )


def word(column: str) -> str:
    """Name of a column with spaces, symbol and unit."""
    if column in SYMBOLS:
        return SYMBOLS[column]
    if column in BY_NAME:
        unit = OPTION_UNITS.get(BY_NAME[column].metavar)
        return column.replace("_", " ") + (f" [{unit}]" if unit else "")
    for ending, unit in UNITS.items():
        if column.endswith(ending):
            return f"{column.removesuffix(ending).replace('_', ' ')} [{unit}]"
    return column.replace("_", " ")


def equation(column: str, value: Any) -> str:
    """A column and its value in words: ``altitude = 30 m``."""
    name, bracket, unit = word(column).partition(" [")
    return f"{name} = {value_text(value)}" + (f" {unit[:-1]}" if bracket else "")


def way(column: str) -> str:
    """Which values of a result are better, in words."""
    more = "more" if column in MORE_IS_BETTER else "less"
    return f"the {more} {word(column)} the better"


def value_text(value: Any) -> str:
    """A value of a column as text."""
    return f"{value:.4g}" if isinstance(value, float) else "none" if value is None else str(value)
