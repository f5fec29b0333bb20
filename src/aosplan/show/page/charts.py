"""Charts of the page: curves in an SVG image, with axes, limits and a mark at the plan."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from aosplan.show.figures.visibility import POINTS, VisibilityCurve, by_baseline, by_samples
from aosplan.show.page.number_text import spacing

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from aosplan.grid.patterns import AnyPattern
    from aosplan.planning.result import Plan
    from aosplan.solver.problem import Problem
    from aosplan.solver.solution import Solution


class AxisBound(NamedTuple):
    """A limit of the quantity along an axis, and the reason for this limit."""

    value: float
    text: str


def baseline_bounds(problem: Problem, pattern: AnyPattern) -> list[AxisBound]:
    """Baselines that are marked: the limits of the baseline, and the baseline beyond which the
    visibility does not increase further.
    """
    model, bounds = problem.model, problem.bounds
    found = [
        AxisBound(model.independent_baseline_m / pattern.nearest, "neighbours share no occluder"),
    ]
    if pattern.longer_side > 0.0:
        found.append(AxisBound(model.widest_aperture_m / pattern.longer_side, "the plot ends"))
        if bounds.max_aperture_m is not None:
            found.append(AxisBound(bounds.max_aperture_m / pattern.longer_side, "--max-aperture"))
    if bounds.baseline_m is not None:
        found.append(AxisBound(bounds.baseline_m, "--baseline"))
    return [bound for bound in found if math.isfinite(bound.value)]


def sample_bounds(problem: Problem, solution: Solution) -> list[AxisBound]:
    """Numbers of samples that are marked: the limits of this number, and the required number."""
    bounds, required = problem.bounds, solution.samples_required
    found = [] if required is None else [AxisBound(required, "fewest that meet the target")]
    if bounds.max_samples is not None:
        found.append(AxisBound(bounds.max_samples, "--max-samples"))
    if bounds.samples is not None:
        found.append(AxisBound(bounds.samples, "--samples"))
    return found


LEFT, RIGHT, TOP, BOTTOM = 46, 326, 14, 240
"""Frame of the axes within the image.  A character is about 12 units high."""

TICKS_Y = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)


class Tick(NamedTuple):
    """A position along an axis, and its label."""

    place: float
    text: str


FEW, COUNTED = 12, 2000
"""For a measured stand: the largest number of points on a curve, and the largest sum of the numbers
of photos of these points.

For every photo of every point, all voxels are counted.  If `FEW` points would have more than
`COUNTED` photos in total, there are fewer points, but at least half of `FEW`.
"""

MANY = 10_000
"""If a plan has at most this number of photos, the curve extends to twice the number of
the plan.
"""

APART = 13.0
"""Vertical distance between labels."""


class ChartLine(NamedTuple):
    """A straight line across the frame, and its label with position and alignment."""

    place: float
    text: str
    label: float
    anchor: str


class Chart(NamedTuple):
    """A chart ready to be drawn, with its numbers.

    Attributes
    ----------
    name, title, axis, column
        Name of the element, title, label of the x axis, and name of the table's first column.
    summary
        Description in one sentence.
    x_ticks, y_ticks
        Ticks along the axes.
    normalized, expected
        Points of the curves of V̂ and V in the format of SVG.
    chosen
        Position of the plan: position along the axis, V̂ and V.
    bounds, levels
        Vertical lines at the limits of the plan, and horizontal lines at the target and the limits
        of V.
    rows
        Numbers of the curves: value along the axis, V̂ and V.
    """

    name: str
    title: str
    axis: str
    column: str
    summary: str
    x_ticks: list[Tick]
    y_ticks: list[Tick]
    normalized: str
    expected: str
    chosen: tuple[float, float, float]
    bounds: list[ChartLine]
    levels: list[ChartLine]
    rows: list[tuple[float, float, float]]


def charts_of(plan: Plan) -> list[Chart]:
    """Charts of visibility against samples and against the baseline; empty if there are no
    occluders.
    """
    problem, solution = plan.problem, plan.solution
    if problem is None or solution.baseline_m == 0.0 or plan.guided is not None:
        return []
    samples, baseline = solution.pattern.samples, solution.baseline_m
    bounds = baseline_bounds(problem, solution.pattern)
    # Only the first curve of each kind is needed, which is the curve of the plan.
    rising = problem.model.rises_with_baseline
    points = POINTS if rising else min(max(COUNTED // samples, FEW // 2), FEW)
    many = next(by_samples(problem, _most_samples(samples), baseline, samples, points), None)
    near = [1.2 * bound.value for bound in bounds if bound.value < 3.0 * baseline]
    widest = max([1.5 * baseline, *near])
    wide = next(by_baseline(problem, samples, widest, baseline, points), None)
    found = []
    if many is not None:
        found.append(
            _chart(
                plan,
                ("samples", f"Visibility by number of photos, {spacing(baseline)} apart", "N"),
                "number of photos N",
                many,
                samples,
                sample_bounds(problem, solution),
            )
        )
    if wide is not None and samples > 1:
        found.append(
            _chart(
                plan,
                ("baseline", f"Visibility by baseline, {samples:,} photos", "b [m]"),
                "baseline b [m]",
                wide,
                baseline,
                bounds,
            )
        )
    return found


def _most_samples(planned: int) -> int:
    """Largest number of samples of a chart. It is twice the number of samples of the plan. If this
    would take too long, it is the number of samples of the plan itself.
    """
    return max(2 * planned, 8) if planned <= MANY else planned


def _chart(
    plan: Plan,
    names: tuple[str, str, str],
    axis: str,
    curve: VisibilityCurve,
    planned: float,
    bounds: Sequence[AxisBound],
) -> Chart:
    name, title, column = names
    prediction = plan.solution.prediction
    high = curve.x[-1]
    x, y = scale(high, LEFT, RIGHT), scale(1.0, BOTTOM, TOP)

    def path(shares: Sequence[float]) -> str:
        return " ".join(
            f"{x(value):.2f},{y(share):.2f}" for value, share in zip(curve.x, shares, strict=True)
        )

    first, last = (
        f"{curve.normalized[at]:.1%} and {curve.expected[at]:.1%} at {curve.x[at]:,.4g}"
        for at in (0, -1)
    )
    return Chart(
        name=name,
        title=title,
        axis=axis,
        column=column,
        summary=(
            f"Along the {axis}, V̂ and V change from {first} to {last}. This plan has "
            f"{planned:,.4g}, V̂ = {prediction.normalized:.2%} and V = "
            f"{prediction.expected:.2%}."
        ),
        x_ticks=[Tick(x(value), f"{value:,.4g}") for value in ticks(0.0, high)],
        y_ticks=[Tick(y(value), f"{value:.0%}") for value in TICKS_Y],
        normalized=path(curve.normalized),
        expected=path(curve.expected),
        chosen=(x(planned), y(prediction.normalized), y(prediction.expected)),
        bounds=_bound_lines(bounds, x, high),
        levels=_levels(plan, y),
        rows=list(zip(curve.x, curve.normalized, curve.expected, strict=True)),
    )


def _bound_lines(
    bounds: Sequence[AxisBound], x: Callable[[float], float], high: float
) -> list[ChartLine]:
    """Lines at the limits within the frame.  Limits at the same place have a common line and
    label.
    """
    places: dict[float, list[str]] = {}
    for bound in bounds:
        if bound.value <= high * (1.0 + 1e-9):
            places.setdefault(round(x(min(bound.value, high)), 1), []).append(bound.text)
    lines = []
    for place, texts in sorted(places.items()):
        leftwards = place > 0.5 * (LEFT + RIGHT)
        label = place - 5.0 if leftwards else place + 5.0
        lines.append(ChartLine(place, ", ".join(texts), label, "end" if leftwards else "start"))
    return lines


def _levels(plan: Plan, y: Callable[[float], float]) -> list[ChartLine]:
    """Lines at the visibility of one photo and of infinitely many photos, and at the target if the
    plan has one.
    """
    from aosplan.solver.solution import BEST

    requirement, prediction = plan.requirement, plan.solution.prediction
    shares = [(prediction.maximum, "∞ photos"), (prediction.minimum, "one photo")]
    if plan.inputs.objective not in BEST:
        shares.append((float(requirement.target), f"target {requirement.symbol}"))
    lines: list[ChartLine] = []
    for share, text in sorted(shares, reverse=True):
        label = max(y(share), lines[-1].label + APART if lines else TOP)
        lines.append(ChartLine(y(share), text, label, "start"))
    return lines


def scale(high: float, start: float, end: float) -> Callable[[float], float]:
    """Function that maps values from 0 to `high` to positions."""
    return lambda value: start + value / high * (end - start)


def ticks(low: float, high: float) -> list[float]:
    """Four to six round values between two values."""
    rough = (high - low) / 6.0
    unit = 10.0 ** math.floor(math.log10(rough))
    step = next(unit * factor for factor in (1, 2, 5, 10) if unit * factor >= rough)
    first, last = math.ceil(low / step * (1 - 1e-9)), math.floor(high / step * (1 + 1e-9))
    return [step * place for place in range(first, last + 1)]
