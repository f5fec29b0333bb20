"""Search where V̂ need not rise with the baseline, or where visibility itself is the objective.

A sketch of the model (`Problem.sketch`), quick and a little off, ranks patterns and baselines;
the model itself decides, and every number of the answer is the model's.  Without a sketch the
model does both.

Frames are judged by their fullest pattern, and baselines on a scan of `SCAN_STEPS` steps, each a
seventh wider, refined to a thousandth.  What the sketch sees miss the target by more than its
own error is passed over.
"""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING, NamedTuple

from aosplan.answer import solution_of, value_text
from aosplan.errors import InfeasibleError
from aosplan.flight import path_of
from aosplan.models import Prediction
from aosplan.solve import APERTURE_SLACK, SEARCHED_SAMPLES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.pattern import Frame, Pattern
    from aosplan.problem import Problem, Solution

SCAN_RATIO, SCAN_STEPS = 8.0 / 7.0, 30
"""A scan's baselines begin at one fiftieth of the widest."""

REFINEMENTS = 8
"""Halvings of a scan's step."""

SKETCH_ERROR = 0.02
"""Error of V̂ that a sketch may have."""

VISIBILITY_SLACK = 0.005
"""How far below the best visibility the fewest samples may stay."""

CONTRAST_SLACK = 0.01
"""The same for contrast, relative."""

SHORTLIST = 12
"""Candidates of the sketch that the model looks at for the best visibility or contrast."""


class Candidate(NamedTuple):
    """A pattern at a baseline."""

    pattern: Pattern
    baseline_m: float

    @property
    def extent_m(self) -> float:
        """Its longer side."""
        return self.pattern.longer_side * self.baseline_m


def search(problem: Problem) -> Solution:
    """Baseline and number of samples for a model whose visibility need not rise with either.

    Raises
    ------
    InfeasibleError
        Where nothing that was looked at meets the target; the message says what is reachable.
    """
    bounds = problem.bounds
    if bounds.baseline_m is not None and bounds.samples is not None:
        best: Candidate | None = Candidate(problem.grid.pattern(bounds.samples), bounds.baseline_m)
    elif problem.objective in ("visibility", "contrast"):
        best = _best(problem)
    elif problem.objective == "aperture":
        best = _least_aperture(problem)
    elif problem.objective == "time":
        best = _least_time(problem)
    else:
        best = next(_meeting(problem), None)
    if best is None:
        raise _out_of_reach(problem)
    required = _fewest_at(problem, best.baseline_m)
    return solution_of(problem, best.pattern, best.baseline_m, required)


def _frames(problem: Problem) -> Iterator[Frame]:
    """Frames that may be planned, in rising order of samples."""
    fixed, grid = problem.bounds.samples, problem.grid
    if fixed is not None:
        frame = grid.frame(grid.index_of(fixed))
        samples = frame.pattern(max(fixed, frame.fewest)).samples
        yield frame._replace(fewest=samples, most=samples)
        return
    most = problem.bounds.max_samples or SEARCHED_SAMPLES
    for index in count(1):
        frame = grid.frame(index)
        if frame.fewest > most:
            return
        yield frame._replace(most=min(frame.most, most))


def _baselines_m(problem: Problem, side: float) -> list[float]:
    """Baselines to look at for a pattern whose longer side is so many baselines."""
    fixed, widest = problem.bounds.baseline_m, problem.widest_m(side)
    if fixed is not None:
        return [fixed] if fixed * side <= problem.widest_aperture_m * (1.0 + 1e-12) else []
    if problem.model.rises_with_baseline:
        return [widest]
    return [widest * SCAN_RATIO**-step for step in range(SCAN_STEPS, -1, -1)]


def _sketched(problem: Problem, pattern: Pattern, baseline_m: float) -> Prediction:
    return (problem.sketch or problem.model).predict(pattern, baseline_m)


def _may_meet(problem: Problem, pattern: Pattern, baseline_m: float) -> bool:
    if problem.sketch is None:
        return True
    density, transparency, shortfall = problem.sketch.predict(pattern, baseline_m)
    hopeful = Prediction(density, transparency, max(shortfall - SKETCH_ERROR, 0.0))
    return problem.requirement.is_met(hopeful)


def _smallest(problem: Problem, pattern: Pattern) -> Candidate | None:
    """A pattern at the smallest baseline of the scan that meets the target, refined."""
    lower = 0.0
    for baseline in _baselines_m(problem, pattern.longer_side):
        if _may_meet(problem, pattern, baseline) and problem.meets(pattern, baseline):
            break
        lower = baseline
    else:
        return None
    if problem.bounds.baseline_m is None:
        for _ in range(REFINEMENTS):
            middle = 0.5 * (lower + baseline)
            if problem.meets(pattern, middle):
                baseline = middle
            else:
                lower = middle
    return Candidate(pattern, baseline)


def _meeting(problem: Problem) -> Iterator[Candidate]:
    """The fewest samples of each frame whose fullest pattern meets the target."""
    for frame in _frames(problem):
        if _smallest(problem, frame.whole) is not None:
            patterns = map(frame.pattern, range(frame.fewest, frame.most + 1))
            found = (_smallest(problem, pattern) for pattern in patterns)
            yield next(candidate for candidate in found if candidate is not None)


def _fullest(problem: Problem) -> Iterator[Candidate]:
    """The fullest pattern of each frame that meets the target."""
    for frame in _frames(problem):
        candidate = _smallest(problem, frame.whole)
        if candidate is not None:
            yield candidate


def _least_aperture(problem: Problem) -> Candidate | None:
    """The fewest samples within 1 % of the least extent."""
    found = list(_fullest(problem))
    allowed = APERTURE_SLACK * min((each.extent_m for each in found), default=0.0)
    return next((each for each in found if each.extent_m <= allowed), None)


def _least_time(problem: Problem) -> Candidate | None:
    def time_s(candidate: Candidate) -> float:
        return path_of(candidate.pattern, problem.timing).time_s(
            candidate.baseline_m, problem.timing
        )

    return min(_fullest(problem), key=time_s, default=None)


def _value(problem: Problem, prediction: Prediction) -> float:
    return prediction.contrast if problem.objective == "contrast" else prediction.expected


def _best(problem: Problem) -> Candidate | None:
    """The fewest samples that come near the best visibility or contrast there is."""
    sketched = [
        (_value(problem, _sketched(problem, frame.whole, baseline)), frame.whole, baseline)
        for frame in _frames(problem)
        for baseline in _baselines_m(problem, frame.side)
    ]
    sketched.sort(key=lambda rated: -rated[0])
    judged = [
        (_value(problem, problem.model.predict(pattern, baseline)), Candidate(pattern, baseline))
        for _, pattern, baseline in sketched[:SHORTLIST]
    ]
    if not judged:
        return None
    top = max(value for value, _ in judged)
    enough = (
        top * (1.0 - CONTRAST_SLACK) if problem.objective == "contrast" else top - VISIBILITY_SLACK
    )
    # What the sketch rates far below its own best is not looked at again.
    rated_best = sketched[0][0]
    hopeful = rated_best - 4.0 * (top - enough)
    by_samples = sorted(sketched, key=lambda rated: (rated[1].samples, -rated[0]))
    looked_at: dict[int, int] = {}
    for rated, pattern, baseline in by_samples:
        tries = looked_at.get(pattern.samples, 0)
        if rated < hopeful or tries >= 3:
            continue
        looked_at[pattern.samples] = tries + 1
        if _value(problem, problem.model.predict(pattern, baseline)) >= enough:
            return Candidate(pattern, baseline)
    return max(judged, key=lambda found: found[0])[1]


def _fewest_at(problem: Problem, baseline_m: float) -> int | None:
    """Fewest samples that meet the target at one baseline; None where none that was looked at."""
    if problem.model.rises_with_baseline:
        from aosplan.solve import fewest_at

        return fewest_at(problem, baseline_m)
    bounds = problem.bounds._replace(baseline_m=baseline_m, samples=None, max_aperture_m=None)
    found = next(_meeting(problem._replace(bounds=bounds)), None)
    return None if found is None else found.pattern.samples


def _out_of_reach(problem: Problem) -> InfeasibleError:
    """The error of a target that nothing meets: what is reachable, with how many samples."""
    requirement = problem.requirement
    rated = [
        (requirement.value_of(_sketched(problem, frame.whole, baseline)), frame.whole, baseline)
        for frame in _frames(problem)
        for baseline in _baselines_m(problem, frame.side)
    ]
    if not rated:
        return InfeasibleError(
            f"{requirement} is out of reach: no grid fits into an aperture of "
            f"{problem.widest_aperture_m:.4g} m",
            "allow a larger aperture, or a smaller baseline",
        )
    rated.sort(key=lambda each: -each[0])
    prediction, pattern, baseline = max(
        ((problem.model.predict(pattern, at), pattern, at) for _, pattern, at in rated[:3]),
        key=lambda found: requirement.value_of(found[0]),
    )
    return InfeasibleError(
        f"{requirement} is out of reach: of up to {problem.bounds.max_samples or SEARCHED_SAMPLES} "
        f"samples within an aperture of {problem.widest_aperture_m:.4g} m the best reach "
        f"{value_text(problem, prediction)}, {pattern.samples} of them {baseline:.4g} m apart",
        "ask for less, or for the best there is: --optimize contrast, or --optimize visibility",
    )
