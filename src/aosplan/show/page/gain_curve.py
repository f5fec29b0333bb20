"""Curves for the page: probability of success over time, in the order of gain and in the shortest
order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from aosplan.planning.gain_result import thinned
from aosplan.show.page.charts import BOTTOM, LEFT, RIGHT, TOP, Tick, scale, ticks
from aosplan.show.text.gain_rows import gain_texts

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.planning.gain_result import Curve
    from aosplan.planning.result import Plan


class GainCurve(NamedTuple):
    """Two curves ready to be drawn, with their description.

    Attributes
    ----------
    summary
        Description of the picture in one sentence.
    texts
        Results of the order in sentences.
    x_ticks, y_ticks
        Ticks along the axes.
    points, usual_points
        Points of the curves in the order of gain and in the shortest order, in the format of SVG.
    """

    summary: str
    texts: list[str]
    x_ticks: list[Tick]
    y_ticks: list[Tick]
    points: str
    usual_points: str


def gain_curve(plan: Plan) -> GainCurve | None:
    """The curves of a plan in the order of gain; None for other plans."""
    gain = plan.gain
    if gain is None:
        return None
    both = (*gain.curve, *gain.usual_curve)
    longest = max(time_s for time_s, _ in both) / 60.0
    highest = max(success for _, success in both)
    x, y = scale(longest, LEFT, RIGHT), scale(highest, BOTTOM, TOP)
    halfway = next(time_s for time_s, success in gain.curve if success >= 0.5 * gain.curve[-1][1])
    return GainCurve(
        summary=(
            f"Probability of success by time since take-off. It reaches {gain.curve[-1][1]:.1%} after "
            f"{gain.curve[-1][0] / 60.0:.1f} min, and half of this after {halfway / 60.0:.1f} min. "
            "The dashed line is the shortest order."
        ),
        texts=gain_texts(gain),
        x_ticks=[Tick(x(value), f"{value:g}") for value in ticks(0.0, longest)],
        y_ticks=[Tick(y(value), f"{100.0 * value:g}%") for value in ticks(0.0, highest)],
        points=_points(gain.curve, x, y),
        usual_points=_points(gain.usual_curve, x, y),
    )


def _points(curve: Curve, x: Callable[[float], float], y: Callable[[float], float]) -> str:
    return " ".join(
        f"{x(time_s / 60.0):.2f},{y(success):.2f}" for time_s, success in thinned(curve)
    )
