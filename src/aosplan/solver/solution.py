"""Solutions, the limits that determined them, and the text of values in messages."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import InfeasibleError
from aosplan.messages import Limit
from aosplan.solver.problem import reached_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.grid.patterns import AnyPattern
    from aosplan.models.model import Prediction
    from aosplan.solver.problem import Problem


BEST = {
    "visibility": "the best visibility",
    "contrast": "the best contrast",
    "detection": "the best detection",
}
"""Names of the objectives that are maximised."""


def solution_of(
    problem: Problem,
    pattern: AnyPattern,
    baseline_m: float,
    samples_required: int | None,
    highest: tuple[AnyPattern, float, float] | None = None,
) -> Solution:
    """The solution for a pattern at a baseline, with its limits.

    `highest` has the pattern and the baseline with the highest visibility or contrast that was
    found, and this value.
    """
    prediction = problem.model.predict(pattern, baseline_m)
    return Solution(
        pattern=pattern,
        baseline_m=baseline_m,
        prediction=prediction,
        samples_required=samples_required,
        limits=tuple(_limits(problem, pattern, baseline_m, prediction, highest)),
        met=problem.requirement.is_met(prediction),
    )


def solution_limits(problem: Problem, solution: Solution) -> tuple[Limit, ...]:
    """The limits that determined a solution."""
    return tuple(_limits(problem, *solution[:3]))


def _limits(
    problem: Problem,
    pattern: AnyPattern,
    baseline_m: float,
    prediction: Prediction,
    highest: tuple[AnyPattern, float, float] | None = None,
) -> Iterator[Limit]:
    bounds, requirement, model = problem.bounds, problem.requirement, problem.model
    extent = pattern.longer_side * baseline_m
    if bounds.baseline_m is not None:
        yield Limit("baseline_m", baseline_m, bounds.baseline_m, "the baseline is given")
    elif bounds.max_aperture_m is not None and extent >= bounds.max_aperture_m * (1 - 1e-9):
        yield Limit(
            "extent_m",
            extent,
            bounds.max_aperture_m,
            "with a larger baseline, the grid would be longer than --max-aperture allows",
        )
    elif bounds.ground is not None and baseline_m >= (widest := bounds.ground.widest_m(pattern)) * (
        1 - 1e-9
    ):
        yield Limit(
            "common_ground_m",
            baseline_m,
            widest,
            "with a larger baseline, no ground would be in all photos; "
            "--allow-no-common-ground removes this limit",
        )
    elif extent >= model.widest_aperture_m * (1 - 1e-9):
        yield Limit(
            "extent_m",
            extent,
            model.widest_aperture_m,
            "the scanned plot is too small for a larger grid",
        )
    elif baseline_m >= (independent := model.independent_baseline_m / pattern.nearest) * (1 - 1e-9):
        yield Limit(
            "baseline_m",
            baseline_m,
            independent,
            "a larger baseline gains nothing, because neighbouring photos already share no "
            "occluder",
        )
    elif (
        model.sharp_baseline_m < model.independent_baseline_m
        and baseline_m >= model.sharp_baseline_m / pattern.nearest * (1 - 1e-9)
        and problem.bounds.samples is None
    ):
        yield Limit(
            "baseline_m",
            baseline_m,
            baseline_m,
            "neighbouring photos share no occluder; a larger baseline would only compensate "
            "for the position error (--hold-error)",
        )
    elif problem.objective in BEST:
        yield Limit(
            "baseline_m", baseline_m, baseline_m, f"this baseline gives {BEST[problem.objective]}"
        )
    else:
        yield Limit(
            "baseline_m",
            baseline_m,
            baseline_m,
            f"with a smaller baseline, {pattern.samples} photos do not reach {requirement}",
        )
    if bounds.samples is not None:
        yield Limit("samples", pattern.samples, bounds.samples, "the number of photos is given")
    elif bounds.max_samples is not None and pattern.samples >= bounds.max_samples:
        yield Limit(
            "samples",
            pattern.samples,
            bounds.max_samples,
            "--max-samples does not allow more photos",
        )
    elif problem.objective in BEST:
        value = prediction.contrast if problem.objective == "contrast" else prediction.expected
        message = f"fewer photos do not come close enough to {BEST[problem.objective]}"
        if highest is None:
            yield Limit(problem.objective, value, value, message)
        else:
            densest, apart_m, most = highest
            message += f", which is {most:.4g} with N = {densest.samples} and b = {apart_m:.4g} m"
            yield Limit(problem.objective, value, most, message)
    else:
        message = {
            "samples": f"fewer photos do not reach {requirement}",
            "aperture": (
                f"with fewer photos, the grid that reaches {requirement} is more than 1 % larger "
                "than the smallest one"
            ),
            "time": f"no other number of photos reaches {requirement} in less time",
        }[problem.objective]
        yield Limit(
            requirement.quantity,
            requirement.value_of(prediction),
            float(requirement.target),
            message,
        )


def out_of_scan(
    problem: Problem, reached: tuple[AnyPattern, float, Prediction] | None, most: int
) -> InfeasibleError:
    """The error for a target that no searched grid meets.  The message gives the best value and its
    grid.
    """
    requirement, widest = problem.requirement, problem.widest_aperture_m
    if reached is None:
        return InfeasibleError(
            f"{requirement} is out of reach: no grid is at most {widest:.4g} m long",
            "allow a longer grid (--max-aperture), or give a smaller baseline",
        )
    pattern, baseline, prediction = reached
    extent = pattern.longer_side * baseline
    return InfeasibleError(
        f"{requirement} is out of reach: the best {problem.grid.name} grid of up "
        f"to {most} samples and at most {widest:.4g} m long reaches "
        f"{value_text(problem, prediction)}, with {pattern.samples} samples "
        f"{baseline:.4g} m apart over {extent:.4g} m",
        "give a lower target, or give --optimize contrast or --optimize visibility",
    )


def value_text(problem: Problem, prediction: Prediction) -> str:
    """Text of the predicted value of the target's quantity."""
    requirement = problem.requirement
    return reached_text(requirement.symbol, requirement.value_of(prediction))


class Solution(NamedTuple):
    """A pattern and its baseline, with the prediction and the limits that determined them."""

    pattern: AnyPattern
    baseline_m: float
    prediction: Prediction
    samples_required: int | None
    limits: tuple[Limit, ...]
    met: bool
