"""Drawings of a sweep's results: a scatter plot of two columns, or a map of a third column over two
columns.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError
from aosplan.show.figures.style import MARKERS, entitle, legend_below, logarithmic, plain
from aosplan.show.figures.sweep_columns import equation, value_text, word
from aosplan.show.figures.sweep_results import PanelsFigure, ScatterFigure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from aosplan.show.figures.style import Theme
    from aosplan.show.figures.sweep_results import MapFigure, SweepFigure

FEW = 500
"""If a figure has at most this number of points, they are drawn large."""

MOST_TICKS = 12

WIDE, WIDE_MAP = 30.0, 20.0
"""An axis, or the colours of a map, are logarithmic if the ratio of the largest value to the
smallest value is greater than this.
"""

LAYOUTS = ((1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (2, 3))
"""For each number of panels, the numbers of rows and columns in which they are arranged."""


def draw(figure: Figure, shown: SweepFigure, theme: Theme) -> None:
    """Draw a scatter plot with its front, a map, or several maps."""
    if isinstance(shown, PanelsFigure):
        handles = _draw_panels(figure, shown, theme)
    else:
        handles = draw_panel(figure.subplots(), shown, theme)
    if handles:
        legend_below(figure, handles)
    entitle(figure, shown.title[0].upper() + shown.title[1:])


def draw_panel(panel: Axes, shown: SweepFigure, theme: Theme) -> list[Any]:
    """Draw a scatter plot or a map on one panel.  Returns the handles of its legend.

    Raises
    ------
    RequestError
        If it is a figure of several maps.
    """
    if isinstance(shown, PanelsFigure):
        raise RequestError("several maps do not fit into one axes", "leave ax out")
    if isinstance(shown, ScatterFigure):
        _draw_scatter(panel, shown, theme)
        return []
    norm, wide = _norm([shown])
    image, handles = _draw_map(panel, shown, theme, norm)
    _add_scale(image, [panel], shown.value, wide=wide)
    return handles


def _spans(values: Sequence[float], factor: float) -> bool:
    """Whether positive values differ by more than a factor."""
    return min(values) > 0.0 and max(values) > factor * min(values)


def _draw_scatter(panel: Axes, shown: ScatterFigure, theme: Theme) -> None:
    size = 3.0 if len(shown.points) > FEW else 4.5
    if shown.by is None:
        look: dict[str, Any] = {"ms": size, "mew": 0.0, "color": theme.data[2], "alpha": 0.55}
        label = f"{shown.met} feasible scenarios"
        panel.plot(*zip(*shown.points, strict=True), "o", label=label, **look)
    elif shown.groups:
        _draw_groups(panel, shown, theme, size)
    else:
        _draw_shades(panel, shown, theme, size)
    panel.plot(
        *zip(*shown.front, strict=True),
        ":o",
        lw=0.8,
        color=theme.data[0] if shown.by is None else theme.text,
        mfc=theme.data[0] if shown.by is None else "none",
        mec=theme.background if shown.by is None else theme.text,
        ms=5.5 if shown.by is None else 7.5,
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
    panel.set(xlabel=plain(word(shown.x)) + said[0], ylabel=plain(word(shown.y)) + said[1])
    panel.legend(loc="best")


def _draw_groups(panel: Axes, shown: ScatterFigure, theme: Theme, size: float) -> None:
    """Draw the points of each value with a colour and a marker of their own."""
    assert shown.by is not None
    for group, color, marker in zip(shown.groups, theme.data, MARKERS, strict=False):
        label = plain(equation(shown.by, group.value))
        look: dict[str, Any] = {"ms": size, "mew": 0.0, "color": color, "alpha": 0.75}
        panel.plot(*zip(*group.points, strict=True), marker, label=label, **look)


def _draw_shades(panel: Axes, shown: ScatterFigure, theme: Theme, size: float) -> None:
    """Draw the points in colours of a scale."""
    assert shown.by is not None
    shades = [math.nan if shade is None else shade for shade in shown.shades]
    wide = _spans([shade for shade in shades if not math.isnan(shade)], WIDE_MAP)
    along, up = zip(*shown.points, strict=True)
    image = panel.scatter(
        along,
        up,
        c=shades,
        s=size**2,
        cmap=theme.map,
        norm="log" if wide else None,
        edgecolors=theme.muted,
        linewidths=0.6,
        plotnonfinite=True,
        label=f"{shown.met} feasible scenarios",
    )
    _add_scale(image, [panel], shown.by, wide=wide)


def _norm(maps: Sequence[MapFigure]) -> tuple[Any, bool]:
    """The common scale of the colours of maps, and whether it is logarithmic."""
    from matplotlib.colors import LogNorm, Normalize

    cells = [cell for each in maps for row in each.cells for cell in row if cell is not None]
    values = [cell.value for cell in cells if cell.value is not None]
    wide = _spans(values, WIDE_MAP)
    return (LogNorm if wide else Normalize)(min(values), max(values)), wide


def _add_scale(image: Any, panels: list[Axes], column: str, *, wide: bool) -> None:
    figure: Any = panels[0].get_figure()
    label = plain(word(column)) + (", log scale" if wide else "")
    scale = figure.colorbar(image, ax=panels, label=label)
    if wide:
        logarithmic(scale.ax.yaxis)


def _draw_panels(figure: Figure, shown: PanelsFigure, theme: Theme) -> list[Any]:
    """Draw a map for each value, with a common scale of colours."""
    rows, columns = LAYOUTS[len(shown.maps) - 1]
    norm, wide = _norm(shown.maps)
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    handles: dict[str, Any] = {}
    for panel, value, each in zip(panels, shown.values, shown.maps, strict=False):
        image, found = _draw_map(panel, each, theme, norm)
        panel.set_title(plain(equation(shown.by, value)))
        handles |= {handle.get_label(): handle for handle in found}
    for panel in panels[len(shown.maps) :]:
        panel.remove()
    _add_scale(image, panels[: len(shown.maps)], shown.maps[0].value, wide=wide)
    return list(handles.values())


def _draw_map(panel: Axes, shown: MapFigure, theme: Theme, norm: Any) -> tuple[Any, list[Any]]:
    """Draw a map, and return its image and the handles of its legend."""
    import numpy as np
    from matplotlib.colors import ListedColormap
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    values = [
        [float("nan") if cell is None or cell.value is None else cell.value for cell in row]
        for row in shown.cells
    ]
    image = panel.pcolormesh(values, cmap=theme.map, norm=norm, rasterized=len(values) > 60)
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
        places = ticked([plain(value_text(value), 18) for value in side])
        axis.set_ticks(
            [place + 0.5 for place in places], [plain(value_text(side[k]), 18) for k in places]
        )
    if max(len(plain(value_text(value), 18)) for value in shown.x_values) > 5:
        panel.tick_params(axis="x", rotation=30)
    panel.set(xlabel=plain(word(shown.x)), ylabel=plain(word(shown.y)))
    panel.grid(visible=False)
    return image, handles


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
