"""The numbers of figures of a sweep: two columns against each other, or a third column over two
columns.

The table is streamed. Only one number per drawn cell is in memory, however many rows there are.
"""

from __future__ import annotations

import os
from glob import escape
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.files import check_input
from aosplan.show.figures.sweep_columns import (
    DEFAULT_X,
    DEFAULT_Y,
    MORE_IS_BETTER,
    TRADEOFF,
    ColumnChoice,
    check_columns,
    equation,
    value_text,
    way,
    word,
)
from aosplan.sweeps.scenarios import polars
from aosplan.sweeps.sweep import SUFFIXES

if TYPE_CHECKING:
    import polars as pl

BINS = (200, 150)
"""Number of cells of a scatter plot along x and y.  All rows in a cell are drawn as one point."""

MOST_VALUES = 400
"""Largest number of different values along a side of a map."""

MOST_GROUPS = 4
"""Largest number of values that each have a colour and a marker of their own."""

MOST_PANELS = 6
"""Largest number of maps in a figure."""


class Group(NamedTuple):
    """The points of the scenarios that have a certain value in the column of the colours."""

    value: Any
    points: tuple[tuple[float, float], ...]


class ScatterFigure(NamedTuple):
    """Scatter plot of two results: one point for each cell that has rows, and the Pareto front.

    A row is on the front if no other row is at least as good in both results and better in one of
    them.
    `by` is the column of the colours.  If it has few values, `groups` are the points of each value.
    Otherwise `shades` are the means of its values in the cell of each point.
    """

    x: str
    y: str
    rows: int
    met: int
    points: tuple[tuple[float, float], ...]
    front: tuple[tuple[float, float], ...]
    by: str | None = None
    groups: tuple[Group, ...] = ()
    shades: tuple[float | None, ...] = ()

    @property
    def title(self) -> str:
        """Title of the figure, in one line."""
        return f"{word(self.y)} against {word(self.x)} of {self.rows} scenarios"

    def description(self) -> str:
        """Description of the front as text."""
        few = (
            self.front
            if len(self.front) <= 5
            else [self.front[k * (len(self.front) - 1) // 4] for k in range(5)]
        )
        text = f"{self.title}; {self.rows - self.met} of them are infeasible. "
        text += f"The front, {way(self.x)} and {way(self.y)}: "
        text += "; ".join(f"{x:.4g} and {y:.4g}" for x, y in few) + "."
        if self.by is None:
            return text
        if self.groups:
            values = ", ".join(value_text(group.value) for group in self.groups)
        else:
            shades = [shade for shade in self.shades if shade is not None]
            values = f"{min(shades):.4g} to {max(shades):.4g}"
        return f"{text} Colours: {word(self.by)} {values}."

    def document(self) -> dict[str, Any]:
        """The numbers as plain values."""
        return self._asdict() | {"groups": [group._asdict() for group in self.groups]}


class Cell(NamedTuple):
    """Scenarios with the same x and y: their number, the number of scenarios with a plan, and the
    mean value of the scenarios with a plan.
    """

    rows: int
    met: int
    value: float | None


class MapFigure(NamedTuple):
    """Map of a result over two columns. It has a cell for each pair of values of the columns. A
    cell without scenarios is None.
    """

    x: str
    y: str
    value: str
    rows: int
    met: int
    x_values: tuple[Any, ...]
    y_values: tuple[Any, ...]
    cells: tuple[tuple[Cell | None, ...], ...]

    @property
    def title(self) -> str:
        """Title of the figure, in one line."""
        mean = "Mean " if any(cell and cell.rows > 1 for row in self.cells for cell in row) else ""
        return f"{mean}{word(self.value)} by {word(self.x)} and {word(self.y)}"

    def description(self) -> str:
        """Description of the extremes, and of the scenarios without a plan."""
        text = (
            f"{self.title}: {len(self.x_values)} by {len(self.y_values)} cells of "
            f"{self.rows} scenarios; {self.rows - self.met} of them are infeasible"
        )
        filled = [
            (cell.value, x, y)
            for y, row in zip(self.y_values, self.cells, strict=True)
            for x, cell in zip(self.x_values, row, strict=True)
            if cell is not None and cell.value is not None
        ]
        if filled:
            low, high = min(filled, key=_first), max(filled, key=_first)
            text += "".join(
                f"; the {name} {value:.4g} at {word(self.x)} {value_text(x)} and "
                f"{word(self.y)} {value_text(y)}"
                for name, (value, x, y) in (("least", low), ("most", high))
            )
        empty = sum(cell is not None and cell.met == 0 for row in self.cells for cell in row)
        return f"{text}; cells without a feasible scenario: {empty}."

    def document(self) -> dict[str, Any]:
        """The numbers as plain values."""
        cells = [[None if cell is None else cell._asdict() for cell in row] for row in self.cells]
        return self._asdict() | {"cells": cells}


class PanelsFigure(NamedTuple):
    """A map for each value of a column."""

    by: str
    values: tuple[Any, ...]
    maps: tuple[MapFigure, ...]

    @property
    def title(self) -> str:
        """Title of the figure, in one line."""
        return f"{max((each.title for each in self.maps), key=len)}, for each {word(self.by)}"

    def description(self) -> str:
        """Description of each map."""
        panels = (
            f"{equation(self.by, value)}: {each.description()}"
            for value, each in zip(self.values, self.maps, strict=True)
        )
        return f"{self.title}. {' '.join(panels)}"

    def document(self) -> dict[str, Any]:
        """The numbers as plain values."""
        return self._asdict() | {"maps": [each.document() for each in self.maps]}


SweepFigure = ScatterFigure | MapFigure | PanelsFigure


def _first(filled: tuple[float, Any, Any]) -> float:
    return filled[0]


def results_of(path: str, choice: ColumnChoice = TRADEOFF) -> SweepFigure:
    """The numbers of a figure of a sweep's results.

    Parameters
    ----------
    path
        A result of ``aosplan sweep``: .csv, .parquet or .jsonl, or a folder.
    choice
        The columns that are shown.

    Raises
    ------
    RequestError
        If the file or a column does not exist, or if a map would have too many cells.
    """
    lazy = _scan(path)
    if "status" not in _collected(lazy.head(0)).columns:
        raise RequestError(
            f"'{path}' has no column 'status'", "give a file that aosplan sweep wrote"
        )
    return frame_of(lazy, choice)


def frame_of(lazy: pl.LazyFrame, choice: ColumnChoice = TRADEOFF) -> SweepFigure:
    """The numbers of a figure, computed from the rows of a sweep. Parameters and errors are those
    of `results_of`.
    """
    check_columns(_collected(lazy.head(0)).columns, choice)
    x, y, value, by = choice
    if value is None:
        return _scatter(lazy, x or DEFAULT_X, y or DEFAULT_Y, by)
    assert x is not None  # The columns have been checked.
    assert y is not None
    if by is None:
        return _map(lazy, x, y, value)
    values = _different(lazy, by, MOST_PANELS)
    if values is None:
        raise RequestError(
            f"column '{by}' has more than {MOST_PANELS} different values, but a figure can have at "
            f"most {MOST_PANELS} maps",
            f"sweep fewer values of {by}",
        )
    column = polars().col(by)
    maps = (_map(lazy.filter(column.eq_missing(each)), x, y, value) for each in values)
    return PanelsFigure(by, tuple(values), tuple(maps))


def _different(lazy: Any, column: str, most: int) -> list[Any] | None:
    """The different values of a column in order; None if there are more than `most`."""
    pl = polars()
    if _collected(lazy.select(pl.col(column).approx_n_unique())).item() > 2 * most + 10:
        return None
    found = _collected(lazy.select(pl.col(column).unique())).to_series().to_list()
    return sorted(found, key=_order) if len(found) <= most else None


def _scan(path: str) -> pl.LazyFrame:
    pl = polars()
    if os.path.isdir(path):
        return pl.scan_parquet(path, glob=False)  # type: ignore[no-any-return]
    ending = os.path.splitext(path)[1].lower()
    scans = dict(zip(SUFFIXES, (pl.scan_csv, pl.scan_parquet, pl.scan_ndjson), strict=True))
    if ending not in scans:
        raise RequestError(
            f"'{path}' does not have one of the extensions {', '.join(SUFFIXES)}",
            "give a file that aosplan sweep wrote",
        )
    check_input(path)
    # Brackets in a file name are escaped, because polars would read them as a pattern.
    return scans[ending](escape(path))  # type: ignore[no-any-return]


def _collected(lazy: Any) -> Any:
    """Run a query in streaming mode, and return its rows."""
    exceptions = polars().exceptions
    try:
        try:
            return lazy.collect(engine="streaming")
        except (TypeError, ValueError):  # Versions of polars before 1.23 have another argument.
            return lazy.collect(streaming=True)
    except exceptions.PolarsError as error:
        raise RequestError(f"the results cannot be read: {str(error).splitlines()[0]}") from None


def _scatter(lazy: Any, x: str, y: str, by: str | None) -> ScatterFigure:
    pl = polars()
    groups = None if by is None else _different(lazy, by, MOST_GROUPS)
    kept_by = [] if by is None else [pl.col(by).alias("by")]
    numbers = [
        pl.col(column).cast(pl.Float64, strict=False).alias(name)
        for column, name in ((x, "x"), (y, "y"))
    ]
    rows = lazy.select(*numbers, *kept_by, (pl.col("status") == "ok").alias("ok"))
    kept = rows.filter(pl.col("ok") & pl.col("x").is_finite() & pl.col("y").is_finite())
    total, met = _collected(rows.select(pl.len(), pl.col("ok").sum())).row(0)
    low, high = (
        _collected(kept.select(getattr(pl, end)("x", "y"))).row(0) for end in ("min", "max")
    )
    if None in low:
        raise RequestError(
            f"no scenario has numbers in '{x}' and '{y}', so there is nothing to draw"
        )
    places = [
        ((pl.col(name) - low[axis]) * (BINS[axis] / ((high[axis] - low[axis]) or 1.0)))
        .floor()
        .clip(0, BINS[axis] - 1)
        .alias(place)
        for axis, (name, place) in enumerate((("x", "i"), ("y", "j")))
    ]
    binned = kept.with_columns(*places)
    # The point of a cell is at the smallest x and the smallest y of its rows. The mean is not used,
    # because it would depend on the order of the rows.
    corner = pl.min("x", "y")
    front = tuple(_front(binned, x in MORE_IS_BETTER, y in MORE_IS_BETTER))
    if by is None or groups is not None:
        points = _collected(binned.group_by("i", "j").agg(corner)).select("x", "y").rows()
        found = ScatterFigure(x, y, total, met, tuple(sorted(points)), front, by)
        if groups is None:
            return found
        table = _collected(binned.group_by("i", "j", "by").agg(corner))
        of_value = {
            value: sorted(table.filter(pl.col("by").eq_missing(value)).select("x", "y").rows())
            for value in groups
        }
        return found._replace(groups=tuple(Group(v, tuple(p)) for v, p in of_value.items() if p))
    # The result is rounded, because its last digits depend on the order of addition.
    shade = pl.col("by").cast(pl.Float64, strict=False).mean().round_sig_figs(12)
    table = _collected(binned.group_by("i", "j").agg(corner, shade)).select("x", "y", "by")
    if table["by"].null_count() == len(table):
        raise RequestError(
            f"column '{by}' has more than {MOST_GROUPS} different values, which are not numbers",
            "a column of text can colour the points if it has few values",
        )
    shaded = sorted(table.rows(), key=_place)
    points = tuple((along, up) for along, up, _ in shaded)
    shades = tuple(shade for *_, shade in shaded)
    return ScatterFigure(x, y, total, met, points, front, by, shades=shades)


def _place(row: tuple[float, float, float | None]) -> tuple[float, float]:
    return row[:2]


def _front(binned: Any, more_x: bool, more_y: bool) -> list[tuple[float, float]]:  # noqa: FBT001
    """The rows of the Pareto front, in the order of x.  They are found among the best rows of each
    bin.
    """
    pl = polars()
    signs = [-1.0 if more else 1.0 for more in (more_x, more_y)]
    rated = binned.select("i", pl.col("x") * signs[0], pl.col("y") * signs[1])
    best = rated.group_by("i").agg(pl.min("y").alias("best"))
    tops = rated.join(best, on="i").filter(pl.col("y") == pl.col("best"))
    tops = _collected(tops.group_by("i").agg(pl.min("x", "y"))).select("x", "y").rows()
    front: list[tuple[float, float]] = []
    for along, up in sorted(tops):
        if not front or up < front[-1][1]:
            front.append((along, up))
    return [(along * signs[0], up * signs[1]) for along, up in front]


def _map(lazy: Any, x: str, y: str, value: str) -> MapFigure:
    pl = polars()
    for name in (x, y):
        count = _collected(lazy.select(pl.col(name).approx_n_unique())).item()
        if count > 1.1 * MOST_VALUES:
            raise RequestError(
                f"column '{name}' has about {count} different values, but a map can have at "
                f"most {MOST_VALUES} on an axis",
                f"draw a scatter plot (without value), or sweep fewer values of {name}",
            )
    ok = pl.col("status") == "ok"
    # The result is rounded, because its last digits depend on the order of addition.
    found = pl.col(value).cast(pl.Float64, strict=False).filter(ok).mean().round_sig_figs(12)
    table = _collected(
        lazy.group_by(pl.col(x).alias("x"), pl.col(y).alias("y")).agg(
            pl.len().alias("rows"), ok.sum().alias("met"), found.alias("value")
        )
    )
    sides = [sorted(set(table[name].to_list()), key=_order) for name in "xy"]
    cells = {
        (row[0], row[1]): Cell(*row[2:])
        for row in table.select("x", "y", "rows", "met", "value").rows()
    }
    if all(cell.value is None for cell in cells.values()):
        raise RequestError(f"no scenario has a number in '{value}', so there is nothing to draw")
    return MapFigure(
        x,
        y,
        value,
        table["rows"].sum(),
        table["met"].sum(),
        tuple(sides[0]),
        tuple(sides[1]),
        tuple(tuple(cells.get((along, up)) for along in sides[0]) for up in sides[1]),
    )


def _order(value: Any) -> tuple[int, Any]:
    """Sort key: numbers before text, and missing values last."""
    return (
        (2, 0)
        if value is None
        else (0, value)
        if isinstance(value, (int, float))
        else (1, str(value))
    )
