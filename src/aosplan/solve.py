"""Solving for the baseline b and the number of samples N.

For a pattern that keeps its shape, V̂ rises with b, so a smallest baseline exists for every
pattern that can meet the target at all.  Along the frames of a kind of grid (`aosplan.pattern`)
V̂ rises with N while b is fixed; within one frame it always does.  The solver uses both, and
evaluates no pattern that cannot be the answer.
"""

from __future__ import annotations

from itertools import count, takewhile
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import InfeasibleError
from aosplan.flight import Timing, path_of
from aosplan.models.equations import required_samples, required_samples_for_visibility
from aosplan.pattern import MOST_SITES, Frame, Pattern, check_size, frame_at, pattern_for
from aosplan.roots import smallest, smallest_whole

if TYPE_CHECKING:
    from collections.abc import Iterator
    from fractions import Fraction

    from aosplan.models import Prediction, VisibilityModel

OBJECTIVES = ("samples", "aperture", "time")
"""What a plan may minimise."""

TOLERANCE = 1e-12
"""Relative tolerance on the shortfall when samples are counted."""

ROUNDING = 1e-15
"""The same when a baseline is solved for: no more than rounding may excuse."""

APERTURE_SLACK = 1.01
"""How far the least aperture may be exceeded to save samples."""

SEARCHED_SAMPLES = 400
"""Samples up to which the objectives search that would add samples without end."""

DENSE_SAMPLES = 2500
"""Samples of a pattern so dense that its extent is nearly the least there is."""


class Requirement(NamedTuple):
    """A target: normalised visibility V̂, or absolute visibility V; exact as it was written."""

    quantity: str
    target: Fraction

    @property
    def symbol(self) -> str:
        """How messages call the quantity."""
        return "V̂" if self.quantity == "normalized" else "V"

    def __str__(self) -> str:
        """The target as messages show it."""
        return f"{self.symbol} = {float(self.target):.10g}"

    def is_met(self, prediction: Prediction, tolerance: float = TOLERANCE) -> bool:
        """Whether a prediction reaches the target, to a relative tolerance of the shortfall."""
        normalized = self.quantity == "normalized"
        error = prediction.shortfall if normalized else prediction.mean_squared_error
        return error <= float(1 - self.target) * (1.0 + tolerance)

    def fewest_independent(self, model: VisibilityModel) -> int:
        """Samples that would do if all were independent: a lower bound for every pattern.

        Raises
        ------
        InfeasibleError
            Where no number of samples reaches the target.
        """
        if self.quantity == "normalized":
            return required_samples(self.target)
        fewest = required_samples_for_visibility(float(self.target), model.density)
        if fewest is None:
            p = model.density
            raise InfeasibleError(
                f"visibility {float(self.target):g} is out of reach for this scene: one sample has "
                f"{1 - p:.4g}, infinitely many have {(1 - p) * (1 + p):.4g}",
                f"ask for a --visibility below {(1 - p) * (1 + p):.4g}, or for a --vhat",
            )
        return fewest


class Bounds(NamedTuple):
    """Bounds on the unknowns, or fixed values for them."""

    max_aperture_m: float | None = None
    max_samples: int | None = None
    baseline_m: float | None = None
    samples: int | None = None


class GridKind(NamedTuple):
    """A kind of grid by name, and what it needs to know."""

    name: str = "trimmed"
    lanes: int = 3
    lane_pitch: float = 4.0

    def frame(self, index: int) -> Frame:
        """The frame at a place of the sequence, from 1."""
        return frame_at(self.name, index, lanes=self.lanes, lane_pitch=self.lane_pitch)

    def pattern(self, samples: int) -> Pattern:
        """The smallest pattern of this kind with at least this many samples."""
        return pattern_for(self.name, samples, lanes=self.lanes, lane_pitch=self.lane_pitch)

    def index_of(self, samples: int) -> int:
        """Place of the first frame that takes this many samples."""
        high = 1
        while self.frame(high).most < samples:
            high *= 2
        return smallest_whole(lambda index: self.frame(index).most >= samples, 1, high)


class Limit(NamedTuple):
    """What bound the result: a quantity, its value, the bound it met, and why."""

    quantity: str
    value: float
    bound: float
    message: str


class Solution(NamedTuple):
    """A pattern and its baseline, with what they show and what bound them."""

    pattern: Pattern
    baseline_m: float
    prediction: Prediction
    samples_required: int | None
    limits: tuple[Limit, ...]
    met: bool


class Problem(NamedTuple):
    """Everything the solver needs: a model, a target, a kind of grid, bounds and an objective."""

    model: VisibilityModel
    requirement: Requirement
    grid: GridKind = GridKind()
    bounds: Bounds = Bounds()
    objective: str = "samples"
    timing: Timing = Timing()

    def meets(self, pattern: Pattern, baseline_m: float, tolerance: float = TOLERANCE) -> bool:
        """Whether a pattern at a baseline reaches the target."""
        return self.requirement.is_met(self.model.predict(pattern, baseline_m), tolerance)

    def widest_m(self, side: float) -> float:
        """Widest baseline worth trying for a pattern whose longer side is so many baselines.

        Beyond it nothing is gained, or the bound on the aperture is broken.
        """
        cap = self.model.independent_baseline_m
        if self.bounds.max_aperture_m is not None and side > 0.0:
            cap = min(cap, self.bounds.max_aperture_m / side)
        return cap

    def smallest_baseline_m(self, pattern: Pattern) -> float | None:
        """Smallest baseline at which a pattern meets the target; None where none within bounds."""
        widest = self.widest_m(pattern.longer_side)
        if not self.meets(pattern, widest):
            return None
        if not self.meets(pattern, widest, ROUNDING):
            return widest
        return smallest(lambda baseline: self.meets(pattern, baseline, ROUNDING), 0.0, widest)


def solve(problem: Problem) -> Solution:
    """Baseline and number of samples that meet a target best.

    Raises
    ------
    InfeasibleError
        Where nothing within the bounds meets the target; the message says what is reachable.
    RequestError
        Where the answer has more sites than one plan may have.
    """
    bounds = problem.bounds
    if bounds.baseline_m is not None and bounds.samples is not None:
        return _solution(problem, problem.grid.pattern(bounds.samples), bounds.baseline_m)
    if bounds.baseline_m is not None:
        return _for_baseline(problem, bounds.baseline_m)
    if bounds.samples is not None:
        return _for_samples(problem, bounds.samples)
    if problem.objective == "aperture":
        return _least_aperture(problem)
    if problem.objective == "time":
        return _least_time(problem)
    return _fewest_samples(problem)


def fewest_at(problem: Problem, baseline_m: float) -> int | None:
    """Fewest samples that meet the target at one baseline; None where no count up to the limit does.

    V̂ of whole frames rises from frame to frame, and within a frame with every sample.
    """
    fewest = problem.requirement.fewest_independent(problem.model)
    first = problem.grid.index_of(fewest)

    def frame_meets(index: int) -> bool:
        return problem.meets(problem.grid.frame(index).whole, baseline_m)

    low, high = first, first
    while not frame_meets(high):
        if problem.grid.frame(high).most > MOST_SITES:
            return None
        low, high = high + 1, 2 * high
    frame = problem.grid.frame(smallest_whole(frame_meets, low, high))
    return smallest_whole(
        lambda samples: problem.meets(frame.pattern(samples), baseline_m),
        min(max(frame.fewest, fewest), frame.most),
        frame.most,
    )


def _for_baseline(problem: Problem, baseline_m: float) -> Solution:
    bounds = problem.bounds
    samples = fewest_at(problem, baseline_m)
    if samples is None or samples > (bounds.max_samples or MOST_SITES):
        needed = f"more than {MOST_SITES}" if samples is None else samples
        raise InfeasibleError(
            f"{problem.requirement} at --baseline {baseline_m:g} needs {needed} samples, more than "
            f"{'one plan may have' if bounds.max_samples is None else 'allowed'}",
            f"neighbours share no occluder from --baseline "
            f"{problem.model.independent_baseline_m:.4g} on, where "
            f"{_fewest_independent(problem)} samples do",
        )
    pattern = problem.grid.pattern(samples)
    extent = pattern.longer_side * baseline_m
    most = bounds.max_aperture_m
    if most is not None and extent > most * (1.0 + TOLERANCE):
        raise InfeasibleError(
            f"{problem.requirement} at --baseline {baseline_m:g} needs {samples} samples over "
            f"{extent:.4g} m, more than --max-aperture {most:g}",
            "leave the baseline free, or allow a larger aperture",
        )
    return _solution(problem, pattern, baseline_m)


def _for_samples(problem: Problem, samples: int) -> Solution:
    pattern = problem.grid.pattern(samples)
    widest = problem.widest_m(pattern.longer_side)
    prediction = problem.model.predict(pattern, widest)
    if not problem.requirement.is_met(prediction):
        raise InfeasibleError(
            f"{problem.requirement} is out of reach with --samples {samples}: at most "
            f"{_value_text(problem, prediction)}, {widest:.4g} m apart",
            f"independent samples need to be at least {_fewest_independent(problem)}; with "
            "--baseline given as well, the plan is evaluated as it is",
        )
    return _solution(problem, pattern, _preferred_baseline_m(problem, pattern))


def _fewest_samples(problem: Problem) -> Solution:
    if problem.bounds.max_aperture_m is None:
        samples = fewest_at(problem, problem.model.independent_baseline_m)
        if samples is None or samples > _most_samples(problem):
            raise _out_of_reach(problem)
        check_size(samples)
        pattern = problem.grid.pattern(samples)
        return _solution(problem, pattern, _preferred_baseline_m(problem, pattern))
    for frame in _candidate_frames(problem):
        # The frame is as wide as the bound lets it be, so its fewest samples lie at one baseline.
        baseline = problem.widest_m(frame.side)
        most = min(frame.most, _most_samples(problem))
        if problem.meets(frame.pattern(most), baseline):
            pattern = frame.pattern(_fewest_in(problem, frame, baseline, most))
            return _solution(problem, pattern, _preferred_baseline_m(problem, pattern))
    raise _out_of_reach(problem)


def _least_aperture(problem: Problem) -> Solution:
    """The fewest samples within 1 % of the least extent."""
    candidates: list[tuple[float, Frame, int]] = []
    for frame in _candidate_frames(problem):
        # Within a frame more samples need less baseline, so its best is its fullest pattern.
        most = min(frame.most, _most_samples(problem))
        baseline = problem.smallest_baseline_m(frame.pattern(most))
        if baseline is not None:
            candidates.append((baseline * frame.side, frame, most))
    if not candidates:
        raise _out_of_reach(problem)
    allowed = APERTURE_SLACK * min(extent for extent, _, _ in candidates)
    frame, most = next((frame, most) for extent, frame, most in candidates if extent <= allowed)
    widest = problem.widest_m(frame.side)
    if frame.side > 0.0:
        widest = min(widest, allowed / frame.side)
    pattern = frame.pattern(_fewest_in(problem, frame, widest, most))
    baseline = problem.smallest_baseline_m(pattern)
    assert baseline is not None  # the fullest pattern of the frame meets the target at `widest`
    return _solution(problem, pattern, baseline)


def _least_time(problem: Problem) -> Solution:
    best: tuple[float, int, Pattern, float] | None = None
    floor = _extent_floor_m(problem)
    timing = problem.timing
    for frame in _candidate_frames(problem):
        most = min(frame.most, _most_samples(problem))
        shortest_leg = timing.leg_s(floor / max(frame.side, 1.0))
        fewest = _lower_bound(problem, frame, most)
        for samples in range(fewest, most + 1):
            least = samples * timing.hold_s + (samples - 1) * shortest_leg
            if best is not None and least >= best[0]:
                if samples == fewest:  # later frames have more samples, and take longer
                    return _solution(problem, best[2], best[3])
                break
            pattern = frame.pattern(samples)
            baseline = problem.smallest_baseline_m(pattern)
            if baseline is None:
                continue
            time = path_of(pattern).time_s(baseline, timing)
            if best is None or time < best[0]:
                best = time, samples, pattern, baseline
    if best is None:
        raise _out_of_reach(problem)
    return _solution(problem, best[2], best[3])


def _extent_floor_m(problem: Problem) -> float:
    """An extent that no pattern with the target goes below: nearly that of a very dense one."""
    free = problem._replace(bounds=Bounds())
    dense = free.grid.pattern(max(DENSE_SAMPLES, 4 * _fewest_independent(problem)))
    baseline = free.smallest_baseline_m(dense)
    return 0.0 if baseline is None else 0.95 * baseline * dense.longer_side


def _candidate_frames(problem: Problem) -> Iterator[Frame]:
    """Frames from the first that could meet the target to the most samples allowed."""
    grid = problem.grid
    most = _most_samples(problem)
    for index in count(grid.index_of(_fewest_independent(problem))):
        frame = grid.frame(index)
        if frame.fewest > most:
            return
        yield frame


def _most_samples(problem: Problem) -> int:
    if problem.bounds.max_samples is not None:
        return problem.bounds.max_samples
    if problem.bounds.max_aperture_m is None and problem.objective == "samples":
        return MOST_SITES
    return max(SEARCHED_SAMPLES, 4 * _fewest_independent(problem))


def _fewest_independent(problem: Problem) -> int:
    return problem.requirement.fewest_independent(problem.model)


def _lower_bound(problem: Problem, frame: Frame, most: int) -> int:
    return min(max(frame.fewest, _fewest_independent(problem)), most)


def _fewest_in(problem: Problem, frame: Frame, baseline_m: float, most: int) -> int:
    """Fewest samples of a frame that meet the target at a baseline; `most` of them do."""
    return smallest_whole(
        lambda samples: problem.meets(frame.pattern(samples), baseline_m),
        _lower_bound(problem, frame, most),
        most,
    )


def _preferred_baseline_m(problem: Problem, pattern: Pattern) -> float:
    """The model's own rule where it has one and samples are the objective, else the smallest."""
    if problem.model.rule_baseline_m is not None and problem.objective == "samples":
        return problem.widest_m(pattern.longer_side)
    baseline = problem.smallest_baseline_m(pattern)
    assert baseline is not None  # callers have checked the widest
    return baseline


def _solution(problem: Problem, pattern: Pattern, baseline_m: float) -> Solution:
    prediction = problem.model.predict(pattern, baseline_m)
    trimmed = problem.grid._replace(name="trimmed")
    counted = problem if problem.grid.name in ("line", "lanes") else problem._replace(grid=trimmed)
    required = fewest_at(counted, baseline_m)
    return Solution(
        pattern=pattern,
        baseline_m=baseline_m,
        prediction=prediction,
        samples_required=required,
        limits=tuple(_limits(problem, pattern, baseline_m, prediction)),
        met=problem.requirement.is_met(prediction),
    )


def _limits(
    problem: Problem, pattern: Pattern, baseline_m: float, prediction: Prediction
) -> Iterator[Limit]:
    bounds, requirement, model = problem.bounds, problem.requirement, problem.model
    extent = pattern.longer_side * baseline_m
    if bounds.baseline_m is not None:
        yield Limit("baseline_m", baseline_m, bounds.baseline_m, "the baseline is fixed")
    elif bounds.max_aperture_m is not None and extent >= bounds.max_aperture_m * (1 - 1e-9):
        yield Limit(
            "extent_m",
            extent,
            bounds.max_aperture_m,
            "the baseline is as wide as --max-aperture lets it be",
        )
    elif baseline_m >= model.independent_baseline_m * (1 - 1e-9):
        yield Limit(
            "baseline_m",
            baseline_m,
            model.independent_baseline_m,
            "neighbouring samples share no occluder at this baseline; a wider one gains nothing",
        )
    else:
        yield Limit(
            "baseline_m",
            baseline_m,
            baseline_m,
            f"the smallest baseline at which {pattern.samples} samples reach {requirement}",
        )
    if bounds.samples is not None:
        yield Limit("samples", pattern.samples, bounds.samples, "the number of samples is fixed")
    elif bounds.max_samples is not None and pattern.samples >= bounds.max_samples:
        yield Limit(
            "samples",
            pattern.samples,
            bounds.max_samples,
            "as many samples as --max-samples allows",
        )
    else:
        reached = (
            prediction.normalized if requirement.quantity == "normalized" else prediction.expected
        )
        message = {
            "samples": "the fewest samples",
            "aperture": "the fewest samples within 1 % of the least aperture",
            "time": "the number of samples that takes the least time",
        }[problem.objective]
        yield Limit(
            requirement.quantity,
            reached,
            float(requirement.target),
            f"{message} with {requirement}",
        )


def _out_of_reach(problem: Problem) -> InfeasibleError:
    """The error of a target that the bounds exclude: what they allow, and what would do."""
    bounds, requirement = problem.bounds, problem.requirement
    within = []
    if bounds.max_aperture_m is not None:
        within.append(f"--max-aperture {bounds.max_aperture_m:g}")
    if bounds.max_samples is not None:
        within.append(f"--max-samples {bounds.max_samples}")
    fewest = _fewest_independent(problem)
    if bounds.max_samples is not None and bounds.max_samples < fewest:
        return InfeasibleError(
            f"{requirement} needs at least {fewest} samples, more than --max-samples "
            f"{bounds.max_samples}: at most {_best_within(problem._replace(objective='aperture'))}",
            f"allow {fewest} samples, or ask for less",
        )
    return InfeasibleError(
        f"{requirement} is out of reach within {' and '.join(within) or 'any baseline'}: "
        f"at most {_best_within(problem)}",
        _remedy(problem),
    )


def _best_within(problem: Problem) -> str:
    """The best that the bounds allow, as text."""
    limit = problem.bounds.max_samples or SEARCHED_SAMPLES
    frames = takewhile(lambda frame: frame.fewest <= limit, map(problem.grid.frame, count(1)))
    reachable = (
        (problem.model.predict(pattern, widest), pattern, widest)
        for pattern in (frame.pattern(min(frame.most, limit)) for frame in frames)
        for widest in (problem.widest_m(pattern.longer_side),)
    )
    prediction, pattern, baseline = min(reachable, key=lambda found: found[0].shortfall)
    return (
        f"{_value_text(problem, prediction)} with {pattern.samples} samples {baseline:.4g} m apart"
    )


def _remedy(problem: Problem) -> str:
    """What would reach the target if the aperture were free."""
    most = problem.bounds.max_samples
    free = problem._replace(bounds=Bounds(max_samples=most), objective="aperture")
    try:
        solution = solve(free)
    except InfeasibleError:
        return "ask for less"
    extent = solution.pattern.longer_side * solution.baseline_m
    return f"--max-aperture {extent:.4g} is enough, with {solution.pattern.samples} samples"


def _value_text(problem: Problem, prediction: Prediction) -> str:
    if problem.requirement.quantity == "normalized":
        return f"V̂ = {prediction.normalized:.4g}"
    return f"V = {prediction.expected:.4g}"
