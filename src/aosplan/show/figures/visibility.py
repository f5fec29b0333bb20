"""Figure of V̂ and V against the number of samples and against the baseline, with a mark at the
plan.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.show.figures.style import LINES, entitle, plain
from aosplan.solver.solution import BEST

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from aosplan.planning.result import Plan
    from aosplan.show.figures.style import Theme
    from aosplan.solver.problem import Problem

BASELINES = (1.0, 0.5, 0.25, 2.0)
"""Baselines of the curves, as multiples of the plan's baseline.  The first curve has the baseline
of the plan.
"""

SAMPLES = (1.0, 0.5, 0.25, 2.0)
"""Numbers of samples of the curves, as multiples of the plan's number.  The first curve has the
number of the plan.
"""

POINTS = 24
"""Approximate number of points of a curve."""


class VisibilityCurve(NamedTuple):
    """V̂ and V as functions of `x`. If `x` is the number of samples, `fixed` is the baseline [m].
    If `x` is the baseline [m], `fixed` is the number of samples.
    """

    fixed: float
    x: tuple[float, ...]
    normalized: tuple[float, ...]
    expected: tuple[float, ...]


class VisibilityFigure(NamedTuple):
    """Curves around a plan.  The target is None if the plan maximises an objective.

    Each curve in `by_samples` has a fixed baseline, and each curve in `by_baseline` has a fixed
    number of samples. The first curve has the value of the plan. `independent_m` is the smallest
    baseline at which neighbours do not share occluders, or None if there is no such baseline.
    """

    scene: str
    model: str
    altitude_m: float
    samples: int
    baseline_m: float
    normalized: float
    expected: float
    minimum: float
    maximum: float
    target: float | None
    target_quantity: str
    independent_m: float | None
    by_samples: tuple[VisibilityCurve, ...]
    by_baseline: tuple[VisibilityCurve, ...]
    bounds: tuple[str, ...]

    @property
    def title(self) -> str:
        """Title of the figure, in one line."""
        return f"Visibility of {self.scene}, from {self.altitude_m:g} m ({self.model} model)"

    def description(self) -> str:
        """Description of the plan and its curves as text."""
        first, second = self.by_samples[0], self.by_baseline[0]
        symbol = "V̂" if self.target_quantity == "normalized" else "V"
        target = "" if self.target is None else f"; the target is {symbol} = {self.target:.6g}"
        return (
            f"{self.title}. The plan: {self.samples} samples {self.baseline_m:.3g} m apart "
            f"reach V̂ = {self.normalized:.4g} and V = {self.expected:.4g}, between "
            f"{self.minimum:.4g} of one photo and {self.maximum:.4g} of infinitely "
            f"many{target}. Against the number of samples, at {first.fixed:.3g} m: "
            f"{_stations(first, 'V̂ = {1:.3g} with {0:.0f}')}. Against the baseline, with "
            f"{second.fixed:.0f} samples: {_stations(second, 'V̂ = {1:.3g} at {0:.3g} m')}. "
            f"Limits: {'; '.join(self.bounds)}."
        )

    def document(self) -> dict[str, Any]:
        """The numbers as plain values."""
        return self._asdict() | {
            "by_samples": [curve._asdict() for curve in self.by_samples],
            "by_baseline": [curve._asdict() for curve in self.by_baseline],
        }


def _stations(curve: VisibilityCurve, form: str) -> str:
    """Text with the values at a few points of a curve."""
    places = sorted({0, len(curve.x) // 4, len(curve.x) // 2, len(curve.x) - 1})
    return ", ".join(form.format(curve.x[at], curve.normalized[at]) for at in places)


def visibility_of(plan: Plan) -> VisibilityFigure:
    """The curves around a plan, computed with its model.

    Raises
    ------
    RequestError
        If there are no occluders.
    """
    problem, solution = plan.problem, plan.solution
    if plan.guided is not None:
        raise RequestError(
            "curves cannot be drawn for --grid guided, because its positions are chosen for one place"
        )
    if problem is None:
        raise RequestError("no occluder is above the focal plane, so one photo shows everything")
    requirement, prediction = problem.requirement, solution.prediction
    samples, baseline = solution.pattern.samples, solution.baseline_m
    independent = problem.model.independent_baseline_m
    base = baseline or (independent if math.isfinite(independent) else 1.0)
    widest = 1.5 * base
    if independent / solution.pattern.nearest < 3.0 * base:
        widest = max(widest, 1.25 * independent / solution.pattern.nearest)
    return VisibilityFigure(
        scene=plan.scene.title or plan.scene.name,
        model=plan.model,
        altitude_m=plan.altitude_m,
        samples=samples,
        baseline_m=baseline,
        normalized=prediction.normalized,
        expected=prediction.expected,
        minimum=prediction.minimum,
        maximum=prediction.maximum,
        target=None if problem.objective in BEST else float(requirement.target),
        target_quantity=requirement.quantity,
        independent_m=independent if math.isfinite(independent) else None,
        by_samples=tuple(by_samples(problem, max(2 * samples, 8), base, samples)),
        by_baseline=tuple(by_baseline(problem, samples, widest, base)),
        bounds=tuple(limit.message for limit in plan.limits),
    )


def by_samples(
    problem: Problem, most: int, base: float, own: int, points: int = POINTS
) -> Iterator[VisibilityCurve]:
    """Yield curves with up to `most` samples, including `own`.  The first curve has the baseline
    `base` [m].
    """
    counts = {round(1 + (most - 1) * (k / points) ** 2) for k in range(points + 1)} | {own}
    patterns = {problem.grid.pattern(count) for count in sorted(counts)}
    inside = sorted((p for p in patterns if p.samples <= most), key=lambda p: p.samples)
    independent = problem.model.independent_baseline_m
    for factor in BASELINES:
        baseline = factor * base
        if factor > 1.0 and base * inside[-1].nearest >= independent * (1.0 - 1e-9):
            continue  # A larger baseline would not improve V̂.
        found = [
            (p, problem.model.predict(p, baseline))
            for p in inside
            if _fits(problem, p.longer_side * baseline)
        ]
        if len(found) > 1:
            yield VisibilityCurve(
                baseline,
                tuple(float(p.samples) for p, _ in found),
                tuple(prediction.normalized for _, prediction in found),
                tuple(prediction.expected for _, prediction in found),
            )


def by_baseline(
    problem: Problem, samples: int, widest: float, own: float, points: int = POINTS
) -> Iterator[VisibilityCurve]:
    """Yield curves with baselines up to `widest` [m], including `own`.  The first curve has
    `samples` samples.
    """
    baselines = sorted({widest * k / points for k in range(1, points + 1)} | {own})
    drawn = set()
    for factor in SAMPLES:
        pattern = problem.grid.pattern(max(round(factor * samples), 1))
        if pattern.samples in drawn or (factor != 1.0 and pattern.samples < 2):
            continue
        drawn.add(pattern.samples)
        found = [
            (b, problem.model.predict(pattern, b))
            for b in baselines
            if _fits(problem, pattern.longer_side * b)
        ]
        if found:
            yield VisibilityCurve(
                float(pattern.samples),
                tuple(b for b, _ in found),
                tuple(prediction.normalized for _, prediction in found),
                tuple(prediction.expected for _, prediction in found),
            )


def _fits(problem: Problem, extent_m: float) -> bool:
    """Whether the scene is large enough for an aperture."""
    return extent_m <= problem.model.widest_aperture_m * (1.0 + 1e-9)


def draw(figure: Figure, shown: VisibilityFigure, theme: Theme) -> None:
    """Draw two columns of panels, against N and against b. In each column, the panel of V̂ is above
    the panel of V.
    """
    axes = figure.subplots(2, 2, sharex="col", sharey="row")
    quantities = (
        ("normalized", r"normalised visibility $\hat{V}$"),
        ("expected", "visibility $V$"),
    )
    columns = (
        (shown.by_samples, float(shown.samples), "number of samples $N$", "$b$ = {:.3g} m"),
        (shown.by_baseline, shown.baseline_m, "baseline $b$ [m]", "$N$ = {:.0f}"),
    )
    for row, (name, label) in zip(axes, quantities, strict=True):
        row[0].set_ylabel(label)
        for panel, (curves, at, _, form) in zip(row, columns, strict=True):
            _lines(panel, curves, name, form, theme)
            if shown.target is not None and name == shown.target_quantity:
                panel.axhline(shown.target, color=theme.muted, ls=(0, (1, 1)), lw=1.2)
            panel.plot(
                [at],
                [getattr(shown, name)],
                "*",
                ms=12,
                mfc=theme.text,
                mec=theme.background,
                zorder=5,
                label="the plan",
            )
    for panel, (_, _, label, _) in zip(axes[1], columns, strict=True):
        panel.set_xlabel(label)
    for panel in axes[1]:
        for height, words in (
            (shown.minimum, "one photo"),
            (shown.maximum, "infinitely many photos"),
        ):
            panel.axhline(height, color=theme.muted, ls="--", lw=0.9)
            if panel is axes[1][0]:  # On the right, the text would cross the vertical line.
                panel.annotate(
                    words,
                    (0.99, height),
                    xycoords=("axes fraction", "data"),
                    ha="right",
                    va="bottom",
                    size=7,
                    color=theme.muted,
                    xytext=(0, 1.5),
                    textcoords="offset points",
                )
    if shown.independent_m is not None:
        for panel in axes[:, 1]:
            if shown.independent_m <= panel.get_xlim()[1]:
                panel.axvline(shown.independent_m, color=theme.muted, ls="-.", lw=0.9, zorder=1)
    for panel in axes[0]:
        panel.legend(loc="best")
        panel.set_ylim(-0.03, 1.06)
    heights = [v for curve in (*shown.by_samples, *shown.by_baseline) for v in curve.expected]
    low, high = min(shown.minimum, *heights), max(shown.maximum, *heights)
    axes[1][0].xaxis.get_major_locator().set_params(integer=True)
    room = 0.12 * (high - low) or 1e-12
    axes[1][0].set_ylim(low - room, high + 1.5 * room)
    if shown.target is not None:
        symbol = r"$\hat{V}$" if shown.target_quantity == "normalized" else "$V$"
        axes[0][0].annotate(
            f"target {symbol} = {shown.target:.6g}",
            (0.0, 1.0),
            xycoords="axes fraction",
            size=7.5,
            xytext=(2, 2),
            textcoords="offset points",
            color=theme.muted,
            va="bottom",
        )
    entitle(figure, shown.title)
    figure.supxlabel(
        "Limits: " + "; ".join(plain(words, 200) for words in shown.bounds),
        x=0.01,
        ha="left",
        size=7.5,
        wrap=True,
        color=theme.muted,
    )


def _lines(
    panel: Axes, curves: Sequence[VisibilityCurve], name: str, form: str, theme: Theme
) -> None:
    for place, curve in enumerate(curves):
        panel.plot(
            curve.x,
            getattr(curve, name),
            LINES[place],
            color=theme.data[place],
            label=form.format(curve.fixed),
            lw=1.8 if place == 0 else 1.3,
        )
