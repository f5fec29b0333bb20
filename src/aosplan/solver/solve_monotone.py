"""The solver for models whose V̂ increases with the baseline b and with the number of samples N.

For a given pattern, V̂ increases with b.  Every pattern that can meet the target therefore has a
smallest baseline.  At a given b, V̂ increases with N from frame to frame of a kind of grid
(`aosplan.grid.patterns`), and within each frame.  The solver uses both properties to skip patterns
that cannot be the solution.
"""

from __future__ import annotations

import math
from itertools import takewhile
from typing import TYPE_CHECKING

from aosplan.errors import InfeasibleError
from aosplan.flight.kinematics import Path, Timing, path_of
from aosplan.grid.patterns import MOST_SITES, AnyFrame, AnyPattern, check_size
from aosplan.numerics import smallest, smallest_whole
from aosplan.solver import refusals
from aosplan.solver.problem import TOLERANCE, Bounds, Problem
from aosplan.solver.solution import Solution, solution_of
from aosplan.units import rounded_up

if TYPE_CHECKING:
    from collections.abc import Iterator


HOPELESS = 0.05
"""If the shortfall of the densest grid exceeds the shortfall that the target allows by more than
this share, no sparser grid meets the target.
"""

MANY_SAMPLES = 2000
"""Number of samples above which the densest grid is evaluated first."""

APERTURE_SLACK = 1.01
"""Factor for the smallest aperture.  Among grids whose aperture is at most the smallest aperture
times this factor, the grid with the fewest samples is preferred.
"""

SEARCHED_FRAMES = 2000
"""Largest number of frames in a search.  They are squares of up to about a million samples, or
lines of up to 2000 samples.
"""

SEARCHED_SAMPLES = 400
"""Largest number of samples for the objectives that improve with every sample."""


def solve_monotone(problem: Problem) -> Solution:
    """Find the best baseline and number of samples if V̂ increases with the baseline.

    Raises
    ------
    InfeasibleError
        If no grid within the bounds meets the target.  The message gives the best value that is
        possible.
    RequestError
        If the solution has more sites than a plan may have.
    """
    bounds = problem.bounds
    if bounds.baseline_m is not None and bounds.samples is not None:
        return _solution(problem, problem.grid.pattern(bounds.samples), bounds.baseline_m)
    if bounds.max_samples is None:
        check_size(_fewest_independent(problem), f"{problem.requirement} needs")
    if bounds.baseline_m is not None:
        return _for_baseline(problem, bounds.baseline_m)
    if bounds.samples is not None:
        return _for_samples(problem, bounds.samples)
    if problem.objective == "aperture":
        return _least_aperture(problem)
    if problem.objective == "time":
        return _least_time(problem)
    return _fewest_samples(problem)


def fewest_at(problem: Problem, baseline_m: float | None) -> int | None:
    """Smallest number of samples that meets the target at one baseline; None if no number up to the
    limit does.

    V̂ of whole frames increases from frame to frame.  Within a frame, V̂ increases with every
    sample.
    """
    fewest = problem.requirement.fewest_independent(problem.model)
    if fewest is None:
        return None
    first = problem.grid.index_of(fewest)

    def at(pattern: AnyPattern) -> float:
        return problem.widest_m(pattern) if baseline_m is None else baseline_m

    def frame_meets(index: int) -> bool:
        whole = problem.grid.frame(index).whole
        optimistic = problem.requirement.is_met(problem.model.at_best(whole, at(whole)))
        return optimistic and problem.meets(whole, at(whole))

    last = problem.grid.index_of(MOST_SITES)
    if first > last:
        return None
    low = high = first
    while not frame_meets(high):
        if high == last:
            return None
        low, high = high + 1, min(2 * high, last)
    frame = problem.grid.frame(smallest_whole(frame_meets, low, high))
    samples = smallest_whole(
        lambda samples: problem.meets(pattern := frame.pattern(samples), at(pattern)),
        min(max(frame.fewest, fewest), frame.most),
        frame.most,
    )
    return samples if samples <= MOST_SITES else None


def _for_baseline(problem: Problem, baseline_m: float) -> Solution:
    bounds, asked = problem.bounds, problem.requirement.asked
    samples = fewest_at(problem, baseline_m)
    if samples is None or samples > (bounds.max_samples or MOST_SITES):
        raise InfeasibleError(
            refusals.beyond_baseline(
                *asked, baseline_m, samples, bounded=bounds.max_samples is not None
            ),
            f"from --baseline {rounded_up(problem.model.independent_baseline_m)} on, "
            "neighbouring photos share no occluder, and "
            f"{problem.grid.pattern(_fewest_independent(problem)).samples} photos are enough",
        )
    pattern = problem.grid.pattern(samples)
    if bounds.ground is not None and not bounds.ground.allows(pattern, baseline_m):
        widest = bounds.ground.widest_m(pattern)
        raise InfeasibleError(
            refusals.beyond_ground(*asked, baseline_m, samples, widest), refusals.LIFT_GROUND
        )
    extent = pattern.longer_side * baseline_m
    most = bounds.max_aperture_m
    if most is not None and extent > most * (1.0 + TOLERANCE):
        raise InfeasibleError(
            refusals.beyond_aperture(*asked, baseline_m, samples, extent, most),
            "leave --baseline out, or give a larger --max-aperture",
        )
    return _solution(problem, pattern, baseline_m)


def _for_samples(problem: Problem, samples: int) -> Solution:
    pattern = problem.grid.pattern(samples)
    widest = problem.widest_m(pattern)
    prediction, requirement = problem.model.predict(pattern, widest), problem.requirement
    if not requirement.is_met(prediction):
        raise InfeasibleError(
            refusals.beyond_samples(
                *requirement.asked, samples, requirement.value_of(prediction), widest
            ),
            f"it needs at least {_fewest_independent(problem)} photos; if --baseline is "
            "given as well, the given grid is evaluated",
        )
    return _solution(problem, pattern, _preferred_baseline_m(problem, pattern))


def _fewest_samples(problem: Problem) -> Solution:
    if not problem.bounds.on_extent:
        samples = fewest_at(problem, None)
        if samples is None or samples > _most_samples(problem):
            raise _out_of_reach(problem)
        pattern = problem.grid.pattern(samples)
        return _solution(problem, pattern, _preferred_baseline_m(problem, pattern))
    if not _may_be_dense_enough(problem):
        raise _out_of_reach(problem)
    for frame in _candidate_frames(problem):
        # The frame has the largest extent that is allowed. The baseline is therefore known, and only
        # the number of samples has to be found.
        baseline = problem.widest_m(frame)
        most = min(frame.most, _most_samples(problem))
        if problem.meets(frame.pattern(most), baseline):
            pattern = frame.pattern(_fewest_in(problem, frame, baseline, most))
            return _solution(problem, pattern, _preferred_baseline_m(problem, pattern))
    raise _out_of_reach(problem)


def _may_be_dense_enough(problem: Problem) -> bool:
    """Whether the largest number of samples reaches, or almost reaches, the target within the
    bounds.

    For a given extent, denser grids have a higher visibility.  If the densest grid misses the
    target by a large margin, no other grid meets it.
    """
    grid, most = problem.grid, _most_samples(problem)
    fewest = _fewest_independent(problem)
    if fewest < MANY_SAMPLES:
        return True  # There are few frames, and their shapes differ.
    first = grid.index_of(fewest)
    last = min(grid.index_of(max(most, 1)), first + SEARCHED_FRAMES - 1)
    densest = grid.frame(max(first, last)).whole
    prediction = problem.model.at_best(densest, problem.widest_m(densest))
    return problem.requirement.is_met(prediction, HOPELESS)


def _least_aperture(problem: Problem) -> Solution:
    solution = _least_aperture_or_none(problem)
    if solution is None:
        raise _out_of_reach(problem)
    return solution


def _least_aperture_or_none(problem: Problem) -> Solution | None:
    """The solution with the fewest samples within 1 % of the smallest extent; None if no grid meets
    the target.
    """
    # Within a frame, more samples need a smaller baseline. The densest pattern therefore has the
    # smallest extent. A single prediction at the smallest extent so far shows whether the frame can
    # be better.
    least = math.inf
    for frame in _candidate_frames(problem):
        densest = _densest(problem, frame)
        widest = problem.widest_m(frame)
        if frame.longer_side > 0.0:
            widest = min(widest, least / frame.longer_side)
        if problem.meets(densest, widest):
            baseline = problem.smallest_baseline_m(densest)
            # The pattern meets the target at `widest`, so a smallest baseline exists.
            assert baseline is not None
            least = min(least, baseline * frame.longer_side)
    if math.isinf(least):
        return None
    for frame in _candidate_frames(problem):
        widest = problem.widest_m(frame)
        if frame.longer_side > 0.0:
            widest = min(widest, APERTURE_SLACK * least / frame.longer_side)
        if problem.meets(_densest(problem, frame), widest):
            most = min(frame.most, _most_samples(problem))
            pattern = frame.pattern(_fewest_in(problem, frame, widest, most))
            baseline = problem.smallest_baseline_m(pattern)
            assert baseline is not None
            return _solution(problem, pattern, baseline)
    raise AssertionError("no frame has the least extent")


def _densest(problem: Problem, frame: AnyFrame) -> AnyPattern:
    """The pattern of a frame with the largest number of samples that is allowed."""
    return frame.pattern(min(frame.most, _most_samples(problem)))


def _least_time(problem: Problem) -> Solution:
    timing = problem.timing
    # Without a shortest run-in, the time increases with the baseline and gives a lower bound.
    rising = timing._replace(least_run_in_m=0.0)
    calm = rising._replace(wind=(0.0, 0.0))
    if timing.fly_through and timing.transit.speed_mps > timing.speed_mps:
        # The drone may fly faster between lines than while it takes photos.
        calm = calm.transit
    best: tuple[float, AnyPattern, float] | None = None
    for frame in _candidate_frames(problem):
        most = min(frame.most, _most_samples(problem))
        fewest = _lower_bound(problem, frame, most)
        if best is not None:
            if fewest * timing.hold_s >= best[0]:
                break
            # No leg is shorter than the baseline, and the densest pattern of a frame needs the
            # smallest baseline. A single prediction for this pattern shows whether any pattern can
            # be faster.
            shortest = Path.shortest(fewest, timing)
            allowed = _widest_within(shortest, calm, best[0], problem.widest_m(frame))
            if allowed is None or not problem.meets(frame.pattern(most), allowed):
                continue
        for samples in range(fewest, most + 1):
            pattern = frame.pattern(samples)
            path = path_of(pattern, timing)
            if best is not None:
                # A single prediction at the largest baseline that is still faster makes most
                # searches unnecessary.
                allowed = _widest_within(path, rising, best[0], problem.widest_m(frame))
                if allowed is None or not problem.meets(pattern, allowed):
                    continue
            baseline = problem.smallest_baseline_m(pattern)
            if baseline is None:
                continue
            time = path.time_s(baseline, timing)
            if best is None or time < best[0]:
                best = time, pattern, baseline
    if best is None:
        raise _out_of_reach(problem)
    return _solution(problem, best[1], best[2])


def _widest_within(path: Path, timing: Timing, time_s: float, widest_m: float) -> float | None:
    """Largest baseline, up to a limit, at which a path takes no longer than a given time."""
    if path.time_s(0.0, timing) >= time_s:
        return None
    if path.time_s(widest_m, timing) < time_s:
        return widest_m
    return smallest(lambda baseline: path.time_s(baseline, timing) >= time_s, 0.0, widest_m)


def _candidate_frames(problem: Problem) -> Iterator[AnyFrame]:
    """Frames in order, from the first frame that may meet the target to the frame with the largest
    number of samples.
    """
    grid = problem.grid
    most = _most_samples(problem)
    first = grid.index_of(_fewest_independent(problem))
    for index in range(first, first + SEARCHED_FRAMES):
        frame = grid.frame(index)
        if frame.fewest > most:
            return
        yield frame


def _most_samples(problem: Problem) -> int:
    if problem.bounds.max_samples is not None:
        return problem.bounds.max_samples
    if not problem.bounds.on_extent and problem.objective == "samples":
        return MOST_SITES
    return max(SEARCHED_SAMPLES, 4 * _fewest_independent(problem))


def _fewest_independent(problem: Problem) -> int:
    """Lower bound of the number of samples.  Raises an error if no number of samples meets the
    target.
    """
    fewest = problem.requirement.fewest_independent(problem.model)
    if fewest is None:
        low, high = problem.model.transparency, problem.model.density
        high = low * (1.0 + high)
        raise InfeasibleError(
            refusals.beyond_scene(*problem.requirement.asked, low, high),
            f"give a --visibility below {high:.4g}, or give --vhat instead",
        )
    return fewest


def _lower_bound(problem: Problem, frame: AnyFrame, most: int) -> int:
    return min(max(frame.fewest, _fewest_independent(problem)), most)


def _fewest_in(problem: Problem, frame: AnyFrame, baseline_m: float, most: int) -> int:
    """Smallest number of samples of a frame that meets the target at a baseline. The caller has
    checked that `most` samples meet the target.
    """
    return smallest_whole(
        lambda samples: problem.meets(frame.pattern(samples), baseline_m),
        _lower_bound(problem, frame, most),
        most,
    )


def _preferred_baseline_m(problem: Problem, pattern: AnyPattern) -> float:
    """If the objective is the number of samples, the baseline that the model recommends; otherwise
    the smallest baseline.
    """
    rule = problem.model.rule_baseline_m
    if rule is not None and problem.objective == "samples":
        preferred = min(rule / pattern.nearest, problem.widest_m(pattern))
        if problem.meets(pattern, preferred):
            return preferred
    baseline = problem.smallest_baseline_m(pattern)
    # Callers have checked that the pattern meets the target at its largest baseline.
    assert baseline is not None
    return baseline


def _solution(problem: Problem, pattern: AnyPattern, baseline_m: float) -> Solution:
    if not problem.count_required:
        return solution_of(problem, pattern, baseline_m, None)
    trimmed = problem.grid._replace(name="trimmed")
    whole = problem.grid.name in ("rectangle", "square")
    counted = problem._replace(grid=trimmed) if whole else problem
    return solution_of(problem, pattern, baseline_m, fewest_at(counted, baseline_m))


def _out_of_reach(problem: Problem) -> InfeasibleError:
    """The error for a target that the bounds exclude, with the best value and a remedy."""
    bounds, asked = problem.bounds, problem.requirement.asked
    fewest = problem.grid.pattern(_fewest_independent(problem)).samples
    if bounds.max_samples is not None and bounds.max_samples < fewest:
        return InfeasibleError(
            refusals.beyond_max_samples(
                *asked,
                fewest,
                bounds.max_samples,
                _best_within(problem._replace(objective="aperture")),
            ),
            f"give --max-samples {fewest}, or a lower target"
            if bounds.max_aperture_m is None
            else (
                f"give --max-samples {fewest} or more and a larger --max-aperture, or give a "
                "lower target"
            ),
        )
    return InfeasibleError(
        refusals.beyond_bounds(
            *asked,
            bounds.max_aperture_m,
            bounds.max_samples,
            _best_within(problem),
            on_ground=_ground_binds(problem),
        ),
        _remedy(problem) if problem.seek_remedy else "",
    )


def _best_within(problem: Problem) -> str:
    """Text of the best value within the bounds."""
    limit = problem.bounds.max_samples or SEARCHED_SAMPLES
    searched = map(problem.grid.frame, range(1, SEARCHED_FRAMES + 1))
    frames = takewhile(lambda frame: frame.fewest <= limit, searched)
    reachable = (
        (problem.model.predict(pattern, widest), pattern, widest)
        for pattern in (frame.pattern(min(frame.most, limit)) for frame in frames)
        for widest in (problem.widest_m(pattern),)
    )
    best = min(reachable, key=lambda found: found[0].shortfall, default=None)
    if best is None:
        return "nothing, because no grid of this kind has so few photos"
    prediction, pattern, baseline = best
    requirement = problem.requirement
    reached = requirement.value_of(prediction)
    return refusals.best_text(requirement.symbol, reached, pattern.samples, baseline)


def _ground_binds(problem: Problem) -> bool:
    """Whether the common ground limits grids more than the other bounds do."""
    if problem.bounds.ground is None:
        return False
    pattern = problem.grid.pattern(_fewest_independent(problem))
    free = problem._replace(bounds=problem.bounds._replace(ground=None))
    return not problem.bounds.ground.allows(pattern, free.widest_m(pattern))


def _remedy(problem: Problem) -> str:
    """Text of a remedy that does not depend on a bound on the aperture."""
    if problem.bounds.max_aperture_m is None and _ground_binds(problem):
        return refusals.LIFT_GROUND
    free = Bounds(max_samples=problem.bounds.max_samples)
    solution = _least_aperture_or_none(problem._replace(bounds=free, objective="aperture"))
    if solution is None:
        return "give a lower target, or allow more samples"
    if problem.bounds.max_aperture_m is None:
        return (
            "give a lower target, or allow more samples: with --optimize aperture, "
            f"which increases the baseline, {solution.pattern.samples} are enough"
        )
    extent = solution.pattern.longer_side * solution.baseline_m
    return f"--max-aperture {rounded_up(extent)} is enough, with {solution.pattern.samples} samples"
