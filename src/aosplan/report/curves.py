"""Curves of a plan: what it would show with other numbers of samples, and at other baselines."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable

    from aosplan.models import Prediction
    from aosplan.pattern import Sites
    from aosplan.problem import Problem, Solution

STEPS = 40
"""Baselines of a curve; of a measured stand, where each is a simulation of its own, `FEW`."""

FEW = 16


class Point(NamedTuple):
    """What a pattern of so many samples shows at a baseline."""

    samples: int
    baseline_m: float
    prediction: Prediction


class Bound(NamedTuple):
    """A value that the quantity along the axis meets or may not pass, and why."""

    value: float
    text: str


def against_samples(problem: Problem, solution: Solution) -> list[Point]:
    """Grids of the plan's kind and baseline, from one sample to about twice the plan's.

    The numbers rise by the same factor, so that the work is that of a few plans.
    """
    planned, baseline = solution.pattern.samples, solution.baseline_m
    most = 2 * planned if planned <= 1000 else planned
    factor = (1.12 if problem.model.rises_with_baseline else 1.5) if planned <= 1000 else 1.5
    counts = {1, planned, most}
    count = 1.0
    while count < most:
        counts.add(math.ceil(count))
        count = max(count * factor, count + 1.0)
    patterns = {solution.pattern.samples: solution.pattern}
    for wanted in sorted(counts):
        pattern = problem.grid.pattern(wanted)
        patterns.setdefault(pattern.samples, pattern)
    widest = problem.model.widest_aperture_m * (1.0 + 1e-9)
    return [
        _point(problem, pattern, baseline)
        for _, pattern in sorted(patterns.items(), key=lambda item: item[0])
        if pattern == solution.pattern or pattern.longer_side * baseline <= widest
    ]


def against_baseline(problem: Problem, solution: Solution) -> list[Point]:
    """The plan's own pattern from no baseline at all to well beyond what bounds it."""
    pattern, planned = solution.pattern, solution.baseline_m
    if pattern.samples == 1 or planned == 0.0:
        return []
    ends = [bound.value for bound in baseline_bounds(problem, pattern)]
    most = max(1.5 * planned, *(1.15 * end for end in ends if end <= 3.0 * planned), 0.0)
    most = max(min(most, problem.model.widest_aperture_m / pattern.longer_side), planned)
    rising = problem.model.rises_with_baseline and pattern.samples <= 100_000
    steps = STEPS if rising else FEW
    baselines = {most * step / steps for step in range(1, steps + 1)} | {planned}
    return [_point(problem, pattern, baseline) for baseline in sorted(baselines)]


def baseline_bounds(problem: Problem, pattern: Sites) -> list[Bound]:
    """Baselines beyond which nothing is gained, allowed or known."""
    model, bounds = problem.model, problem.bounds
    found = [
        Bound(model.independent_baseline_m / pattern.nearest, "neighbours share no occluder"),
    ]
    if pattern.longer_side > 0.0:
        found.append(Bound(model.widest_aperture_m / pattern.longer_side, "the plot ends"))
        if bounds.max_aperture_m is not None:
            found.append(Bound(bounds.max_aperture_m / pattern.longer_side, "--max-aperture"))
    if bounds.baseline_m is not None:
        found.append(Bound(bounds.baseline_m, "--baseline"))
    return _finite(found)


def sample_bounds(problem: Problem, solution: Solution) -> list[Bound]:
    """Numbers of samples that are asked for, or needed."""
    bounds, required = problem.bounds, solution.samples_required
    found = [] if required is None else [Bound(required, "fewest that meet the target")]
    if bounds.max_samples is not None:
        found.append(Bound(bounds.max_samples, "--max-samples"))
    if bounds.samples is not None:
        found.append(Bound(bounds.samples, "--samples"))
    return _finite(found)


def _finite(found: Iterable[Bound]) -> list[Bound]:
    return [bound for bound in found if math.isfinite(bound.value) and bound.value > 0.0]


def _point(problem: Problem, pattern: Sites, baseline_m: float) -> Point:
    return Point(pattern.samples, baseline_m, problem.model.predict(pattern, baseline_m))
