"""Curve for the page: objective against flight time, for a search for the best flight in a given
time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from aosplan.show.page.charts import BOTTOM, LEFT, RIGHT, TICKS_Y, TOP, Tick, scale, ticks
from aosplan.show.text.plan_rows import row_text

if TYPE_CHECKING:
    from aosplan.planning.result import Plan

SHARES = {"detection": "probability of detection", "visibility": "visibility V"}
"""The curve is drawn only for these objectives.  Their values are between 0 and 1."""


class WithinCurve(NamedTuple):
    """A curve ready to be drawn, with its description.

    Attributes
    ----------
    title, summary
        Title of the picture, and its description in one sentence.
    rows
        The best plans within half the time, the time, and twice the time, as text.
    x_ticks, y_ticks
        Ticks along the axes.
    points
        Points of the curve in the format of SVG.
    marks
        Positions of the marks on the curve.
    chosen
        Position of the plan.
    """

    title: str
    summary: str
    rows: list[str]
    x_ticks: list[Tick]
    y_ticks: list[Tick]
    points: str
    marks: list[tuple[float, float]]
    chosen: tuple[float, float]


def within_curve(plan: Plan) -> WithinCurve | None:
    """The curve of a plan that a search has chosen; None for other plans."""
    answer = plan.within
    if answer is None or answer.asked.optimize not in SHARES or len(answer.curve) < 2:
        return None
    if plan.gain is not None:  # The plan is not one of the flights over the whole area.
        return None
    curve = [(time_s / 60.0, value) for time_s, value in answer.curve]
    _, this, _ = answer.rows
    assert this.timed is not None
    assert this.value is not None
    longest = max(minutes for minutes, _ in curve)
    x, y = scale(longest, LEFT, RIGHT), scale(1.0, BOTTOM, TOP)
    title = SHARES[answer.asked.optimize]
    marks = [(x(minutes), y(value)) for minutes, value in curve]
    return WithinCurve(
        title=title[0].upper() + title[1:],
        summary=(
            f"The best {title} by time, from {curve[0][1]:.1%} in {curve[0][0]:.1f} min to "
            f"{curve[-1][1]:.1%} in {curve[-1][0]:.1f} min; this plan has {this.value:.1%} in "
            f"{this.timed.time_s / 60.0:.1f} min."
        ),
        rows=[
            ", ".join(part for part in row_text(row, answer.asked.optimize) if part)
            for row in answer.rows
        ],
        x_ticks=[Tick(x(value), f"{value:g}") for value in ticks(0.0, longest)],
        y_ticks=[Tick(y(value), f"{value:.0%}") for value in TICKS_Y],
        points=" ".join(f"{across:.2f},{up:.2f}" for across, up in marks),
        marks=marks,
        chosen=(x(this.timed.time_s / 60.0), y(this.value)),
    )
