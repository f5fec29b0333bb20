"""Charts of the page: curves as lines of an SVG picture, with axes, bounds and the plan itself."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from aosplan.report.curves import (
    Bound,
    Point,
    against_baseline,
    against_samples,
    baseline_bounds,
    sample_bounds,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from aosplan.planning import Plan

LEFT, RIGHT, TOP, BOTTOM = 46, 326, 14, 240
"""The picture, and the frame of its axes, in units of which a letter is about 12 high."""

TICKS_Y = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)


class Tick(NamedTuple):
    """A place along an axis, and what is written there."""

    place: float
    text: str


APART = 13.0
"""Distance of labels below each other."""


class Line(NamedTuple):
    """A straight line across the frame, and its label: where it stands, and how it is aligned."""

    place: float
    text: str
    label: float
    anchor: str


class Chart(NamedTuple):
    """A picture ready to be drawn, and the numbers behind it.

    Attributes
    ----------
    name, title, axis
        Of the element, of the picture, and of the axis.
    summary
        What it shows, in a sentence.
    x_ticks, y_ticks
        Places along the axes.
    normalized, expected
        Lines of V̂ and V, as SVG has points.
    chosen
        The plan: along the axis, V̂ and V.
    bounds, levels
        Lines up and down with what bounds the plan, and across with target and limits.
    points
        The numbers of the lines.
    right
        Where the frame ends, and the labels of the levels begin.
    """

    name: str
    title: str
    axis: str
    summary: str
    x_ticks: list[Tick]
    y_ticks: list[Tick]
    normalized: str
    expected: str
    chosen: tuple[float, float, float]
    bounds: list[Line]
    levels: list[Line]
    points: list[Point]
    right: float = RIGHT


def charts_of(plan: Plan) -> list[Chart]:
    """Visibility against the number of samples, and against the baseline; none of a clear view."""
    problem, solution = plan.problem, plan.solution
    if problem is None:
        return []
    many = against_samples(problem, solution)
    wide = against_baseline(problem, solution)
    samples = solution.pattern.samples
    found = []
    if len(many) > 1:
        found.append(
            _chart(
                plan,
                "samples",
                f"Visibility by number of photos, {solution.baseline_m:.2f} m apart",
                "number of photos N",
                many,
                [float(point.samples) for point in many],
                sample_bounds(problem, solution),
                logarithmic=True,
            )
        )
    if wide:
        found.append(
            _chart(
                plan,
                "baseline",
                f"Visibility by baseline, {samples:,} photos",
                "baseline b [m]",
                wide,
                [point.baseline_m for point in wide],
                baseline_bounds(problem, solution.pattern),
                logarithmic=False,
            )
        )
    return found


def _chart(
    plan: Plan,
    name: str,
    title: str,
    axis: str,
    points: list[Point],
    values: list[float],
    bounds: Sequence[Bound],
    *,
    logarithmic: bool,
) -> Chart:
    solution = plan.solution
    low, high = (values[0] if logarithmic else 0.0), values[-1]
    x = _scale(low, high, LEFT, RIGHT, logarithmic=logarithmic)
    y = _scale(0.0, 1.0, BOTTOM, TOP)
    planned = solution.baseline_m if name == "baseline" else float(solution.pattern.samples)
    normalized, expected = solution.prediction.normalized, solution.prediction.expected

    def path(shares: Sequence[float]) -> str:
        return " ".join(
            f"{x(value):.2f},{y(share):.2f}" for value, share in zip(values, shares, strict=True)
        )

    first, last = points[0].prediction, points[-1].prediction
    return Chart(
        name=name,
        title=title,
        axis=axis,
        summary=(
            f"V̂ goes from {first.normalized:.1%} at {axis.partition(' [')[0]} = {values[0]:.3g} to "
            f"{last.normalized:.1%} at {values[-1]:.3g}, V from {first.expected:.1%} to "
            f"{last.expected:.1%}; the plan has {planned:.4g}, V̂ = {normalized:.2%} and "
            f"V = {expected:.2%}."
        ),
        x_ticks=[Tick(x(value), f"{value:,.4g}") for value in _ticks(low, high, logarithmic)],
        y_ticks=[Tick(y(value), f"{value:.0%}") for value in TICKS_Y],
        normalized=path([point.prediction.normalized for point in points]),
        expected=path([point.prediction.expected for point in points]),
        chosen=(x(planned), y(normalized), y(expected)),
        bounds=_bound_lines(bounds, x, low, high),
        levels=_levels(plan, y),
        points=points,
    )


def _bound_lines(
    bounds: Sequence[Bound], x: Callable[[float], float], low: float, high: float
) -> list[Line]:
    """Bounds within the frame; those at one place share a line and a label."""
    places: dict[float, list[str]] = {}
    for bound in bounds:
        if low <= bound.value <= high * (1.0 + 1e-9):
            places.setdefault(round(x(min(bound.value, high)), 1), []).append(bound.text)
    lines = []
    for place, texts in sorted(places.items()):
        leftwards = place > 0.5 * (LEFT + RIGHT)
        label = place - 5.0 if leftwards else place + 5.0
        lines.append(Line(place, ", ".join(texts), label, "end" if leftwards else "start"))
    return lines


def _levels(plan: Plan, y: Callable[[float], float]) -> list[Line]:
    """The target, and what one photo and endless ones see."""
    from aosplan.task import requirement_of

    requirement, prediction = requirement_of(plan.request), plan.solution.prediction
    shares = (
        (float(requirement.target), f"target {requirement.symbol}"),
        (prediction.maximum, "endless V"),
        (prediction.minimum, "one photo"),
    )
    lines: list[Line] = []
    for share, text in sorted(shares, reverse=True):
        label = max(y(share), lines[-1].label + APART if lines else TOP)
        lines.append(Line(y(share), text, label, "start"))
    return lines


def _scale(
    low: float, high: float, start: float, end: float, *, logarithmic: bool = False
) -> Callable[[float], float]:
    """A map from values to places."""
    of = math.log if logarithmic else float
    width = (of(high) - of(low)) or 1.0
    return lambda value: start + (of(value) - of(low)) / width * (end - start)


def _ticks(low: float, high: float, logarithmic: bool) -> list[float]:  # noqa: FBT001
    """Round values between two, about six of them."""
    if not logarithmic:
        rough = (high - low) / 6.0
        unit = 10.0 ** math.floor(math.log10(rough))
        step = next(unit * factor for factor in (1, 2, 5, 10) if unit * factor >= rough)
        return [step * place for place in range(math.floor(high / step * (1 + 1e-9)) + 1)]
    decades = range(math.ceil(math.log10(high)) + 1)
    factors = (1, 2, 5) if high / low <= 1e3 else (1,)
    found = [factor * 10.0**decade for decade in decades for factor in factors]
    return [value for value in found if low <= value <= high]
