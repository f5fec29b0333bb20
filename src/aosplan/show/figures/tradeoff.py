"""Figure of a trade-off: baseline, extent and flight time by number of samples, with the Pareto
front.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.show.figures.style import LINES, entitle, legend_below, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.planning.result import Plan
    from aosplan.show.figures.style import Theme


class Point(NamedTuple):
    """A row of `aosplan tradeoff`: a number of samples with its cost and benefit."""

    grid: str
    samples: int
    baseline_m: float
    extent_m: float
    time_s: float
    normalized: float
    expected: float
    contrast: float
    meets: bool
    front: bool
    chosen: bool


class TradeoffFigure(NamedTuple):
    """Rows of all requested kinds of grid."""

    scene: str
    altitude_m: float
    target: str
    objective: str
    points: tuple[Point, ...]

    @property
    def title(self) -> str:
        """Title of the figure, in one line."""
        return f"Trade-off over {self.scene}, from {self.altitude_m:g} m, {self.target}"

    def description(self) -> str:
        """Description of the front and the plan as text."""
        front = sorted((p for p in self.points if p.front), key=lambda p: p.samples)
        several = len({p.grid for p in self.points}) > 1
        missed = sum(not p.meets for p in self.points)
        text = f"{self.title}. {len(self.points)} rows"
        text += f"; {missed} of them miss the target" if missed else ""
        text += (
            f"; {len(front)} of them are on the Pareto front, from the fewest photos to the most: "
        )
        named = front if len(front) <= 5 else [front[k * (len(front) - 1) // 4] for k in range(5)]
        text += "; ".join(
            f"{p.samples} samples{f' ({p.grid})' if several else ''} {p.baseline_m:.3g} m apart, "
            f"{p.extent_m:.3g} m, {p.time_s:.0f} s"
            for p in named
        )
        own = next(p for p in self.points if p.chosen)
        return (
            f"{text}. The plan has {own.samples} samples {own.baseline_m:.3g} m apart over "
            f"{own.extent_m:.3g} m, takes {own.time_s:.0f} s and reaches V̂ = {own.normalized:.4g}."
        )

    def document(self) -> dict[str, Any]:
        """The numbers as plain values."""
        return self._asdict() | {"points": [point._asdict() for point in self.points]}


def tradeoff_of(plan: Plan) -> TradeoffFigure:
    """The rows of a plan's trade-off.

    Raises
    ------
    RequestError
        If there are no occluders.
    """
    rows = plan.tradeoff()
    # `problem` is None only if there are no occluders, and then `tradeoff` has raised an error.
    assert plan.problem is not None
    return TradeoffFigure(
        scene=plan.scene.title or plan.scene.name,
        altitude_m=plan.altitude_m,
        target=str(plan.problem.requirement),
        objective=plan.problem.objective,
        points=tuple(
            Point(
                row.problem.grid.title,
                row.pattern.samples,
                row.baseline_m,
                row.pattern.longer_side * row.baseline_m,
                row.time_s,
                row.prediction.normalized,
                row.prediction.expected,
                row.prediction.contrast,
                row.meets,
                row.front,
                row.chosen,
            )
            for row in rows
        ),
    )


PANELS = (
    ("samples", "baseline_m", "baseline $b$ [m]"),
    ("samples", "extent_m", "extent, longer side [m]"),
    ("samples", "time_s", "flight time [s]"),
)
LAST = {
    "visibility": ("samples", "expected", "visibility $V$"),
    "contrast": ("samples", "contrast", "contrast"),
}
"""Columns and label of the last panel, for objectives that are maximised. For other objectives, the
last panel shows time against extent.
"""


def draw(figure: Figure, shown: TradeoffFigure, theme: Theme) -> None:
    """Draw baseline, extent and time against N, and time against extent."""
    axes = figure.subplots(2, 2)
    looks = _looks(shown, theme)
    (own,) = (p for p in shown.points if p.chosen)
    last = LAST.get(shown.objective, ("extent_m", "time_s", "flight time [s]"))
    # A single sample has no baseline.
    several = [p for p in shown.points if p.samples > 1] or shown.points
    for panel, (x, y, label) in zip(axes.flat, (*PANELS, last), strict=True):
        for grid, look in looks.items():
            rows = [p for p in shown.points if p.grid == grid]
            along = [getattr(p, x) for p in rows]
            for kept, more in (
                ([p.meets for p in rows], look | {"lw": 1.1}),
                ([not p.meets for p in rows], {"color": theme.muted, "ls": (0, (1, 1.5))}),
                ([p.front for p in rows], FRONT | {"mfc": look["color"], "mec": theme.text}),
            ):
                # Each line is interrupted at the rows that belong to the other line.
                up = [
                    getattr(p, y) if keep else math.nan for p, keep in zip(rows, kept, strict=True)
                ]
                panel.plot(along, up, **({"lw": 0.9} | more))
        panel.plot(
            [getattr(own, x)], [getattr(own, y)], **PLAN, mfc=theme.text, mec=theme.background
        )
        panel.set_ylabel(label)
        panel.set_xlabel("number of samples $N$" if x == "samples" else "extent, longer side [m]")
        panel.set_xlim(0.0, 1.04 * max(getattr(p, x) for p in several) or 1.0)
        panel.set_ylim(0.0, 1.08 * max(getattr(p, y) for p in several) or 1.0)
    legend_below(figure, _legend(looks, shown, theme))
    entitle(figure, shown.title)


FRONT: dict[str, Any] = {"ls": "", "marker": "o", "ms": 4.5, "mew": 0.6, "zorder": 4}
PLAN: dict[str, Any] = {"ls": "", "marker": "*", "ms": 13, "zorder": 5}


def _looks(shown: TradeoffFigure, theme: Theme) -> dict[str, dict[str, Any]]:
    """Colour and line style of each kind of grid."""
    grids = dict.fromkeys(point.grid for point in shown.points)
    return {
        grid: {"color": theme.data[place % 4], "ls": LINES[place % 4]}
        for place, grid in enumerate(grids)
    }


def _legend(looks: dict[str, dict[str, Any]], shown: TradeoffFigure, theme: Theme) -> list[Any]:
    from matplotlib.lines import Line2D

    first = theme.data[0]
    handles = [
        Line2D([], [], **PLAN, mfc=theme.text, mec=theme.background, label="the plan"),
        Line2D(
            [], [], **FRONT, mfc=first, mec=theme.text, label="Pareto front (no point is better)"
        ),
        *(Line2D([], [], **look, label=plain(grid)) for grid, look in looks.items()),
    ]
    if not all(p.meets for p in shown.points):
        look: dict[str, Any] = {"color": theme.muted, "ls": (0, (1, 1.5)), "lw": 0.9}
        handles.append(Line2D([], [], **look, label="target not reached"))
    return handles
