"""Limits of samples and baseline that are marked on the axes of a plan's curves."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from aosplan.grid.patterns import AnyPattern
    from aosplan.solver.problem import Problem
    from aosplan.solver.solution import Solution


class AxisBound(NamedTuple):
    """A limit of the quantity along an axis, and the reason."""

    value: float
    text: str


def baseline_bounds(problem: Problem, pattern: AnyPattern) -> list[AxisBound]:
    """Baselines that are marked: the limits of the baseline, and the baseline beyond which the
    visibility does not increase.
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
