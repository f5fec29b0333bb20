"""Figures of a sweep's results: a scatter plot of two columns, or a map of a third column over two
columns.

The table is streamed.  For any number of rows, only one number per drawn cell is kept in memory.
"""

from __future__ import annotations

import os
from glob import escape
from math import isnan
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.files import check_input
from aosplan.planning.options import BY_NAME
from aosplan.show.figures.style import entitle, legend_below, logarithmic, plain
from aosplan.sweeps.scenarios import polars
from aosplan.sweeps.sweep import SUFFIXES
from aosplan.units import nearest_hint

if TYPE_CHECKING:
    from collections.abc import Sequence

    import polars as pl
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from aosplan.show.figures.style import Theme

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

BINS = (200, 150)
"""Number of cells of a scatter plot along x and y.  All rows in a cell are drawn as one point."""

FEW = 500
"""Largest number of points with which points are drawn large."""

MOST_VALUES = 400
"""Largest number of different values along a side of a map."""

MOST_TICKS = 12

WIDE, WIDE_MAP = 30.0, 20.0
"""If the ratio of the largest value to the smallest value is greater than this, an axis, or the
colours of a map, are logarithmic.
"""

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
"""Columns that have a symbol."""


class ScatterFigure(NamedTuple):
    """Scatter plot of two results: one point for each cell that has rows, and the Pareto front.

    A row is on the front if no other row is at least as good in both results and better in one of
    them.
    """

    x: str
    y: str
    rows: int
    met: int
    points: tuple[tuple[float, float], ...]
    front: tuple[tuple[float, float], ...]

    @property
    def title(self) -> str:
        """Title of the figure, in one line."""
        return f"{_word(self.y)} against {_word(self.x)} of {self.rows} scenarios"

    def description(self) -> str:
        """Description of the front as text."""
        few = (
            self.front
            if len(self.front) <= 5
            else [self.front[k * (len(self.front) - 1) // 4] for k in range(5)]
        )
        text = f"{self.title}, {self.rows - self.met} of which are infeasible. "
        text += f"The front, {_way(self.x)} and {_way(self.y)}: "
        return text + "; ".join(f"{x:.4g} and {y:.4g}" for x, y in few) + "."

    def document(self) -> dict[str, Any]:
        """The numbers as plain values."""
        return self._asdict()


class Cell(NamedTuple):
    """Scenarios with the same x and y: their number, the number of those with a plan, and the mean
    value of those with a plan.
    """

    rows: int
    met: int
    value: float | None


class MapFigure(NamedTuple):
    """Map of a result over two columns.  It has a cell for each pair of their values; the cell is
    None if there are no scenarios.
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
        return f"{mean}{_word(self.value)} by {_word(self.x)} and {_word(self.y)}"

    def description(self) -> str:
        """Description of the extremes, and of the scenarios without a plan."""
        text = (
            f"{self.title}: {len(self.x_values)} by {len(self.y_values)} cells of "
            f"{self.rows} scenarios, {self.rows - self.met} of which are infeasible"
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
                f"; the {name} {value:.4g} at {_word(self.x)} {_shown(x)} and "
                f"{_word(self.y)} {_shown(y)}"
                for name, (value, x, y) in (("least", low), ("most", high))
            )
        empty = sum(cell is not None and cell.met == 0 for row in self.cells for cell in row)
        return f"{text}; cells without a feasible scenario: {empty}."

    def document(self) -> dict[str, Any]:
        """The numbers as plain values."""
        cells = [[None if cell is None else cell._asdict() for cell in row] for row in self.cells]
        return self._asdict() | {"cells": cells}


def _first(filled: tuple[float, Any, Any]) -> float:
    return filled[0]


def check_columns(
    names: Sequence[str], x: str | None, y: str | None, value: str | None, *, flags: str = "--"
) -> None:
    """Refuse columns that the results do not have.

    Raises
    ------
    RequestError
        If a name is unknown, or if one of the two columns of a map is not given.
    """
    if value is not None and (x is None or y is None):
        raise RequestError(f"{flags}value without {flags}x and {flags}y", "a map needs two columns")
    for option, name in (("x", x or DEFAULT_X), ("y", y or DEFAULT_Y), ("value", value)):
        if name is not None and name not in names:
            raise RequestError(
                f"{flags}{option}: the results have no column '{name}'",
                nearest_hint(name, names) or f"columns: {', '.join(names)}",
            )


def results_of(
    path: str, x: str | None = None, y: str | None = None, value: str | None = None
) -> ScatterFigure | MapFigure:
    """The numbers of a figure of a sweep's results.

    Parameters
    ----------
    path
        A result of ``aosplan sweep``: .csv, .parquet or .jsonl, or a folder.
    x, y
        Columns: results for a scatter plot, any columns for a map.
    value
        A result that is drawn as a map over x and y; None for a scatter plot.

    Raises
    ------
    RequestError
        If the file or a column does not exist, or if a map would have too many cells.
    """
    lazy = _scan(path)
    if "status" not in _collected(lazy.head(0)).columns:
        raise RequestError(f"'{path}' has no column 'status'", "aosplan sweep writes one")
    return frame_of(lazy, x, y, value)


def frame_of(
    lazy: pl.LazyFrame, x: str | None = None, y: str | None = None, value: str | None = None
) -> ScatterFigure | MapFigure:
    """The numbers of a figure of a sweep's rows.  Parameters and errors are those of
    `results_of`.
    """
    check_columns(_collected(lazy.head(0)).columns, x, y, value)
    if value is None:
        return _scatter(lazy, x or DEFAULT_X, y or DEFAULT_Y)
    assert x is not None  # The columns have been checked.
    assert y is not None
    return _map(lazy, x, y, value)


def _scan(path: str) -> pl.LazyFrame:
    pl = polars()
    if os.path.isdir(path):
        return pl.scan_parquet(path, glob=False)  # type: ignore[no-any-return]
    ending = os.path.splitext(path)[1].lower()
    scans = dict(zip(SUFFIXES, (pl.scan_csv, pl.scan_parquet, pl.scan_ndjson), strict=True))
    if ending not in scans:
        raise RequestError(
            f"'{path}' does not have one of the extensions {', '.join(SUFFIXES)}",
            "results of a sweep have one of them",
        )
    check_input(path)
    # Brackets in a file name are escaped, because polars would read them as a pattern.
    return scans[ending](escape(path))  # type: ignore[no-any-return]


def _collected(lazy: Any) -> Any:
    """The rows of a query.  The query is streamed."""
    exceptions = polars().exceptions
    try:
        try:
            return lazy.collect(engine="streaming")
        except (TypeError, ValueError):  # Versions of polars before 1.23 have another argument.
            return lazy.collect(streaming=True)
    except exceptions.PolarsError as error:
        raise RequestError(f"the results cannot be read: {str(error).splitlines()[0]}") from None


def _scatter(lazy: Any, x: str, y: str) -> ScatterFigure:
    pl = polars()
    numbers = [
        pl.col(column).cast(pl.Float64, strict=False).alias(name)
        for column, name in ((x, "x"), (y, "y"))
    ]
    rows = lazy.select(*numbers, (pl.col("status") == "ok").alias("ok"))
    kept = rows.filter(pl.col("ok") & pl.col("x").is_finite() & pl.col("y").is_finite())
    total, met = _collected(rows.select(pl.len(), pl.col("ok").sum())).row(0)
    low, high = (
        _collected(kept.select(getattr(pl, end)("x", "y"))).row(0) for end in ("min", "max")
    )
    if None in low:
        raise RequestError(f"no scenario has numbers in '{x}' and '{y}': there is nothing to draw")
    places = [
        ((pl.col(name) - low[axis]) * (BINS[axis] / ((high[axis] - low[axis]) or 1.0)))
        .floor()
        .clip(0, BINS[axis] - 1)
        .alias(place)
        for axis, (name, place) in enumerate((("x", "i"), ("y", "j")))
    ]
    binned = kept.with_columns(*places)
    # The point of a cell is at the smallest x and y of its rows. A mean would depend on the order
    # of the rows.
    points = _collected(binned.group_by("i", "j").agg(pl.min("x", "y"))).select("x", "y").rows()
    front = _front(binned, x in MORE_IS_BETTER, y in MORE_IS_BETTER)
    return ScatterFigure(x, y, total, met, tuple(sorted(points)), tuple(front))


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
                f"column '{name}' has about {count} different values, and a map at most "
                f"{MOST_VALUES} a side",
                f"omit the value to draw a scatter plot, or sweep fewer values of {name}",
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
        raise RequestError(f"no scenario has a number in '{value}': there is nothing to draw")
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


def _word(column: str) -> str:
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


def _way(column: str) -> str:
    more = "more" if column in MORE_IS_BETTER else "less"
    return f"the {more} {_word(column)} the better"


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else "none" if value is None else str(value)


def draw(figure: Figure, shown: ScatterFigure | MapFigure, theme: Theme) -> None:
    """Draw a scatter plot with its front, or a map."""
    handles = draw_panel(figure.subplots(), shown, theme)
    if handles:
        legend_below(figure, handles)
    entitle(figure, shown.title[0].upper() + shown.title[1:])


def draw_panel(panel: Axes, shown: ScatterFigure | MapFigure, theme: Theme) -> list[Any]:
    """Draw a scatter plot or a map on one panel.  Returns the handles of its legend."""
    if isinstance(shown, ScatterFigure):
        _draw_scatter(panel, shown, theme)
        return []
    return _draw_map(panel, shown, theme)


def _spans(values: Sequence[float], factor: float) -> bool:
    """Whether positive values differ by more than a factor."""
    return min(values) > 0.0 and max(values) > factor * min(values)


def _draw_scatter(panel: Axes, shown: ScatterFigure, theme: Theme) -> None:
    panel.plot(
        *zip(*shown.points, strict=True),
        "o",
        ms=3.0 if len(shown.points) > FEW else 4.5,
        mew=0.0,
        color=theme.data[2],
        alpha=0.55,
        label=f"{shown.met} feasible scenarios",
    )
    panel.plot(
        *zip(*shown.front, strict=True),
        ":o",
        lw=0.8,
        color=theme.data[0],
        mec=theme.background,
        ms=5.5,
        label="Pareto front",
    )
    if shown.rows > shown.met:
        panel.plot([], [], " ", label=f"{shown.rows - shown.met} infeasible")
    said = ["", ""]
    for axis, name, column in ((panel.xaxis, "x", 0), (panel.yaxis, "y", 1)):
        values = [point[column] for point in shown.points]
        if _spans(values, WIDE):
            getattr(panel, f"set_{name}scale")("log")
            logarithmic(axis)
            said[column] = ", log scale"
    panel.set(xlabel=plain(_word(shown.x)) + said[0], ylabel=plain(_word(shown.y)) + said[1])
    panel.legend(loc="best")


def _draw_map(panel: Axes, shown: MapFigure, theme: Theme) -> list[Any]:
    import numpy as np
    from matplotlib.colors import ListedColormap
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    values = [
        [float("nan") if cell is None or cell.value is None else cell.value for cell in row]
        for row in shown.cells
    ]
    wide = _spans([value for row in values for value in row if not isnan(value)], WIDE_MAP)
    image = panel.pcolormesh(
        values, cmap=theme.map, norm="log" if wide else None, rasterized=len(values) > 60
    )
    hatched: dict[str, Any] = {"ec": theme.muted, "hatch": "////", "lw": 0.0}
    dotted: dict[str, Any] = {"mfc": "white", "mec": "black", "ms": 4.0, "mew": 0.9}
    missing = [[cell is not None and cell.met == 0 for cell in row] for row in shown.cells]
    partly = [
        (i + 0.5, j + 0.5)
        for j, row in enumerate(shown.cells)
        for i, cell in enumerate(row)
        if cell is not None and 0 < cell.met < cell.rows
    ]
    handles: list[Any] = []
    if any(map(any, missing)):
        only = ListedColormap([theme.shade])
        panel.pcolor(np.ma.masked_equal(missing, value=False), cmap=only, **hatched)
        handles.append(Patch(label="no feasible scenario", fc=theme.shade, **hatched))
    if partly:
        panel.plot(*zip(*partly, strict=True), "o", **dotted)
        handles.append(
            Line2D([], [], ls="", marker="o", label="some infeasible scenarios", **dotted)
        )
    if any(cell is None for row in shown.cells for cell in row):
        handles.append(Patch(label="no scenario", fc=theme.background, ec=theme.muted, lw=0.6))
    for axis, side in ((panel.xaxis, shown.x_values), (panel.yaxis, shown.y_values)):
        places = ticked([plain(_shown(value), 18) for value in side])
        axis.set_ticks(
            [place + 0.5 for place in places], [plain(_shown(side[k]), 18) for k in places]
        )
    if max(len(plain(_shown(value), 18)) for value in shown.x_values) > 5:
        panel.tick_params(axis="x", rotation=30)
    panel.set(xlabel=plain(_word(shown.x)), ylabel=plain(_word(shown.y)))
    panel.grid(visible=False)
    figure = panel.get_figure()
    assert figure is not None  # The panel belongs to a figure.
    scale = figure.colorbar(
        image, ax=panel, label=plain(_word(shown.value)) + (", log scale" if wide else "")
    )
    if wide:
        logarithmic(scale.ax.yaxis)
    return handles


def ticked(labels: Sequence[str]) -> range:
    """Indices of the labels that are shown along a side.  They are evenly spaced, and round numbers
    are preferred.
    """
    step = next(
        digit * 10**power
        for power in range(len(str(len(labels))) + 1)
        for digit in (1, 2, 5)
        if digit * 10**power * MOST_TICKS >= len(labels)
    )
    choices = [range(first, len(labels), step) for first in range(min(step, len(labels)))]
    figures = [len(label.rstrip("0")) for label in labels]
    return min(choices, key=lambda places: sum(figures[k] for k in places) / len(places))
