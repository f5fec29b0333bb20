"""The search for models whose V̂ need not rise with the baseline, and for the best visibility.

All patterns are evaluated at the baselines of one **scan**, so that they share their views.  Each
baseline is `SCAN_RATIO` times the one below, from `SCAN_STEPS` steps below the widest baseline that
a pattern may have up to the widest itself.  Between the first baseline of the scan that meets the
target and the one below it, the smallest baseline that meets the target is found by bisection.

**What is guaranteed.**  Of all patterns of a kind with up to `SEARCHED_SAMPLES` samples (or
`--max-samples`), none has a lower cost at a baseline of the scan than the answer has:

- not fewer samples, and not a shorter flight;
- not a smaller extent, of the densest patterns (the answer is then the fewest samples within 1 %
  of the least extent);
- no visibility or contrast that is higher by more than half the slack than the best found, of the
  densest patterns (the answer is the fewest samples within the slack of the best found, which the
  solution states).

The densest patterns are those with the most samples in one rectangle.  Of lines, lanes and spirals
they are all patterns with up to `THINNED_FROM` samples, and then the largest of each family; a
family has the sample counts of one rectangle of the trimmed grid.  Candidates are evaluated in the
order of the lowest cost that they could have, so the first candidate that holds is the best.

**A surrogate** of the model (`Problem.surrogate`), which is quick but not exact, saves most
evaluations of the model.  A candidate is skipped if it would not meet the target even with a
shortfall and a density that are lower by a margin.  The margins are `CAUTION` times the largest
error of the surrogate that the search has seen, and at least `LEAST_MARGINS`.  Whenever they have
grown, the search begins again with the new margins.  Without a surrogate the model evaluates all
candidates, and the guarantee has no condition.  Every number of the answer comes from the model.
"""

from __future__ import annotations

import math
from functools import cache, lru_cache, partial
from heapq import heapify, heappop, heappush
from itertools import count, islice, takewhile
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from aosplan.flight.kinematics import path_of
from aosplan.models.model import Prediction
from aosplan.solver.problem import GridKind
from aosplan.solver.solution import out_of_scan, solution_of
from aosplan.solver.solve_monotone import APERTURE_SLACK, SEARCHED_SAMPLES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from aosplan.grid.patterns import AnyFrame, Sites
    from aosplan.solver.problem import Problem
    from aosplan.solver.solution import Solution

    Cost = Callable[["Candidate"], float]
    Bounds = Iterator[tuple[float, "Candidate | None"]]

Found = TypeVar("Found")

THINNED_FROM = 64
"""Samples up to which every pattern is evaluated for the least extent and the best value."""

SCAN_RATIO, SCAN_STEPS = 8.0 / 7.0, 30
"""A scan's baselines begin at about one fiftieth of the widest."""

REFINEMENTS = 8
"""Halvings of a scan's step."""

LEAST_MARGINS = 0.03, 0.005, 0.003
"""Shares of the shortfall 1 - V̂, of the transparency 1 - p, and of what is maximised, by which a
surrogate may be off."""

PROBES, PROBE_STEPS = (4, 9, 16), 5
"""Samples of the patterns at which a surrogate is measured at first, and steps of the scan between.

Correlograms are off by the most where samples are few: of generated stands, by 1 to 6 % of the
shortfall at 4 to 16 samples, and by 0 to 3 % at 49."""

CAUTION = 1.5
"""Factor of the margins over the largest error of the surrogate that was seen."""

VISIBILITY_SLACK = 0.005
"""Slack below the best visibility for the fewest samples, if it is 0.5 or more."""

RELATIVE_SLACK = 0.01
"""The same slack for lower visibilities and for contrast, as a share of the best value."""


def near_best(objective: str, best: float) -> float:
    """The least visibility or contrast within the slack of the best."""
    enough = best * (1.0 - RELATIVE_SLACK)
    return enough if objective == "contrast" else max(enough, best - VISIBILITY_SLACK)


class Candidate(NamedTuple):
    """A pattern at a baseline."""

    pattern: Sites
    baseline_m: float

    @property
    def extent_m(self) -> float:
        """Its longer side."""
        return self.pattern.longer_side * self.baseline_m


def solve_by_scan(problem: Problem) -> Solution:
    """Baseline and number of samples for a model whose visibility may fall with either.

    Raises
    ------
    InfeasibleError
        If no grid meets the target; the message says what is reachable.
    """
    bounds = problem.bounds
    scan = Scan(problem)
    top: Candidate | None = None
    if bounds.baseline_m is not None and bounds.samples is not None:
        best: Candidate | None = Candidate(problem.grid.pattern(bounds.samples), bounds.baseline_m)
    elif problem.objective in ("visibility", "contrast"):
        best, top = scan.until_margins_hold(_best)
    elif problem.objective == "aperture":
        best = scan.until_margins_hold(_least_aperture)
    elif problem.objective == "time":
        best = scan.until_margins_hold(_least_time)
    else:
        best = scan.until_margins_hold(_fewest)
    if best is None:
        most = scan.until_margins_hold(_highest)
        reached = None if most is None else (*most, scan.predict(most))
        raise out_of_scan(problem, reached, problem.bounds.max_samples or SEARCHED_SAMPLES)
    required = _fewest_at(scan, best.baseline_m) if problem.count_required else None
    highest = None if top is None else (*top, scan.value(scan.predict(top)))
    return solution_of(problem, best.pattern, best.baseline_m, required, highest)


class Scan:
    """Predictions of the model for patterns at baselines, and bounds on them by the surrogate."""

    def __init__(self, problem: Problem, errors: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        self.problem = problem
        self.errors = list(errors)
        self._margins: tuple[float, ...] = LEAST_MARGINS
        self._pattern = lru_cache(maxsize=None)(problem.grid.pattern)
        self._known: dict[Candidate, Prediction] = {}
        self._by_surrogate: dict[Candidate, Prediction] = {}

    def until_margins_hold(self, look: Callable[[Scan], Found]) -> Found:
        """The result of a search, which is repeated until its margins are wide enough."""
        if self.problem.surrogate is not None and not any(self.errors):
            self._probe()
        while True:
            self._margins = self._wanted_margins()
            found = look(self)
            if self._wanted_margins() == self._margins:
                return found

    def _wanted_margins(self) -> tuple[float, ...]:
        """The margins for the largest errors of the surrogate so far."""
        return tuple(map(max, LEAST_MARGINS, (CAUTION * error for error in self.errors)))

    def _probe(self) -> None:
        """Measure the surrogate at a few patterns and baselines, far from each other."""
        densest = [
            densest
            for densest, _ in takewhile(
                lambda family: family[0].samples <= PROBES[-1], self.families()
            )
        ]
        for wanted in PROBES:
            for pattern in sorted(densest, key=lambda each: abs(each.samples - wanted))[:1]:
                for baseline in self.baselines_m(pattern)[::-PROBE_STEPS][:3]:
                    self.predict(Candidate(pattern, baseline))

    def predict(self, candidate: Candidate) -> Prediction:
        """Prediction of the model; the error of the surrogate is updated with it."""
        known = self._known.get(candidate)
        if known is None:
            self._tell(candidate)
            known = self.problem.model.predict(*candidate)
            self._known[candidate] = known
            if self.problem.surrogate is not None:
                guess = self._guess(candidate)
                pairs = (
                    (known.shortfall, guess.shortfall),
                    (guess.transparency, known.transparency),
                    (self.value(guess), self.value(known)),
                )
                off = (1.0 - low / high if high > low else 0.0 for low, high in pairs)
                self.errors = list(map(max, self.errors, off))
        return known

    def optimistic(self, candidate: Candidate) -> Prediction:
        """The best prediction that the model may give, by the surrogate and its margins."""
        if self.problem.surrogate is None or candidate in self._known:
            return self.predict(candidate)
        shortfall, transparency, _ = self._margins
        guess = self._guess(candidate)
        clear = min(guess.transparency / max(1.0 - transparency, 0.5), 1.0)
        least = guess.shortfall * max(1.0 - shortfall, 0.0)
        return Prediction(1.0 - clear, clear, least)

    def value(self, prediction: Prediction) -> float:
        """The value that is maximised: the objective, or the quantity of the target."""
        if self.problem.objective == "contrast":
            return prediction.contrast
        if self.problem.objective == "visibility":
            return prediction.expected
        return self.problem.requirement.value_of(prediction)

    def near(self, value: float) -> float:
        """The least value within the slack of the best."""
        return near_best(self.problem.objective, value)

    def optimistic_value(self, candidate: Candidate) -> float:
        """The highest value that the model may give, by the surrogate and its margins."""
        if self.problem.surrogate is None or candidate in self._known:
            return self.value(self.predict(candidate))
        return self.value(self._guess(candidate)) / max(1.0 - self._margins[2], 0.5)

    def meets(self, candidate: Candidate) -> bool:
        """Whether a candidate meets the target; the model is evaluated only if it may."""
        requirement = self.problem.requirement
        return requirement.is_met(self.optimistic(candidate)) and requirement.is_met(
            self.predict(candidate)
        )

    def may_meet(self, candidate: Candidate) -> bool:
        """Whether a candidate may meet the target."""
        return self.problem.requirement.is_met(self.optimistic(candidate))

    def _guess(self, candidate: Candidate) -> Prediction:
        guess = self._by_surrogate.get(candidate)
        if guess is None:
            assert self.problem.surrogate is not None
            self._tell(candidate)
            guess = self._by_surrogate[candidate] = self.problem.surrogate.predict(*candidate)
        return guess

    def _tell(self, candidate: Candidate) -> None:
        if self.problem.on_trial is not None:
            self.problem.on_trial(self.problem, *candidate)

    def families(
        self, *, thinned: bool = False, thinned_from: int = THINNED_FROM
    ) -> Iterator[tuple[Sites, Iterable[Sites]]]:
        """The patterns that may be planned, by families: the densest of each, and all of it.

        The patterns of one frame have one size and are a family.  If each sample count has its own
        size, each is a family by itself.  With `thinned`, the counts above `thinned_from` samples are
        grouped as those of the frames of the trimmed grid.
        """
        bounds, grid = self.problem.bounds, self.problem.grid
        if bounds.samples is not None:
            pattern = grid.pattern(bounds.samples)
            yield pattern, (pattern,)
            return
        most = bounds.max_samples or SEARCHED_SAMPLES
        first = 1
        while first <= most:
            framing = GridKind() if thinned and first > thinned_from else grid
            frame = framing.frame(framing.index_of(first))
            counts = range(first, min(frame.most, most) + 1)
            patterns = map(self._pattern, counts)
            family = [each for each in patterns if each.samples in counts]
            if family:
                yield family[-1], dict.fromkeys(family)
            first = frame.most + 1

    def baselines_m(self, sites: Sites | AnyFrame) -> list[float]:
        """The baselines of the scan for a pattern, in rising order."""
        problem = self.problem
        fixed, widest = problem.bounds.baseline_m, problem.widest_m(sites)
        if fixed is not None:
            reach = problem.widest_aperture_m * (1.0 + 1e-12)
            ground = problem.bounds.ground
            grounded = ground is None or ground.allows(sites, fixed)
            return [fixed] if grounded and fixed * sites.longer_side <= reach else []
        if problem.model.rises_with_baseline or sites.longer_side == 0.0:
            return [widest]
        top = problem.model.independent_baseline_m
        first = math.ceil(math.log(top / widest) / math.log(SCAN_RATIO) + 1e-9)
        steps = range(first + SCAN_STEPS - 1, first - 1, -1)
        return [*(top * SCAN_RATIO**-step for step in steps), widest]

    def refined(
        self, pattern: Sites, lower: float, baseline: float, halvings: int = REFINEMENTS
    ) -> Candidate:
        """Bisect between a baseline that misses the target and one that meets it."""
        if self.problem.bounds.baseline_m is None:
            for _ in range(halvings):
                middle = 0.5 * (lower + baseline)
                if self.problem.requirement.is_met(self.predict(Candidate(pattern, middle))):
                    baseline = middle
                else:
                    lower = middle
        return Candidate(pattern, baseline)

    def smallest(self, pattern: Sites, halvings: int = REFINEMENTS) -> Candidate | None:
        """A pattern at its smallest baseline that meets the target, by the scan."""
        lower = 0.0
        for baseline in self.baselines_m(pattern):
            if self.meets(Candidate(pattern, baseline)):
                return self.refined(pattern, lower, baseline, halvings)
            lower = baseline
        return None


def _fewest(scan: Scan) -> Candidate | None:
    """The fewest samples that meet the target, at their smallest baseline."""
    for densest, patterns in scan.families():
        steps = scan.baselines_m(densest)
        if not steps or any(scan.may_meet(Candidate(densest, b)) for b in steps):
            found = next(filter(None, map(scan.smallest, patterns)), None)
            if found is not None:
                return found
    return None


def _least_time(scan: Scan) -> Candidate | None:
    timing = scan.problem.timing
    path = lru_cache(maxsize=None)(partial(path_of, timing=timing))
    patterns = ((densest, pattern) for densest, patterns in scan.families() for pattern in patterns)
    return _least(scan, patterns, lambda at: path(at.pattern).time_s(at.baseline_m, timing))


def _least_aperture(scan: Scan) -> Candidate | None:
    """The fewest samples within 1 % of the least extent."""
    densest = ((densest, densest) for densest, _ in scan.families(thinned=True))
    least = _least(scan, densest, lambda at: at.extent_m)
    if least is None:
        return None
    allowed = APERTURE_SLACK * least.extent_m
    for whole, patterns in scan.families():
        if whole.samples > least.pattern.samples:
            break
        if not _fits(scan, whole, allowed, scan.may_meet):
            continue
        for pattern in patterns:
            if pattern.samples >= least.pattern.samples:
                break
            if _fits(scan, pattern, allowed, scan.meets):
                found = scan.smallest(pattern)
                if found is not None and found.extent_m <= allowed:
                    return found
    return least


def _fits(scan: Scan, pattern: Sites, extent_m: float, test: Callable[[Candidate], bool]) -> bool:
    """Whether a pattern passes a test at the largest baseline within an extent."""
    widest, side = scan.problem.widest_m(pattern), pattern.longer_side
    fixed = scan.problem.bounds.baseline_m
    if fixed is not None:
        return fixed * side <= extent_m and test(Candidate(pattern, fixed))
    return test(Candidate(pattern, min(widest, extent_m / side) if side > 0.0 else widest))


def _least(scan: Scan, patterns: Iterator[tuple[Sites, Sites]], cost: Cost) -> Candidate | None:
    """The candidate of least cost that meets the target, found best first.

    Each pattern has a series of lower bounds on its cost, one for each baseline at which it may
    meet the target; the pattern with the least bound is advanced by one baseline.  A candidate
    whose cost is no more than every remaining bound is the best.

    Parameters
    ----------
    scan
        The scan.
    patterns
        Each pattern behind the densest pattern of its frame.  No pattern of a frame is tried at a
        baseline below the smallest at which the densest one may meet the target.
    cost
        What is minimised; it rises with the baseline.
    """
    fixed_m = scan.problem.bounds.baseline_m

    @cache
    def start_m(densest: Sites) -> float:
        """Smallest baseline at which the densest pattern of a frame may meet the target."""
        steps = scan.baselines_m(densest)
        hopeless = math.inf if steps else 0.0
        return next((b for b in steps if scan.may_meet(Candidate(densest, b))), hopeless)

    def bounds(densest: Sites, pattern: Sites) -> Iterator[tuple[float, Candidate | None]]:
        """Yield ever higher lower bounds on the cost of a pattern, and at last its candidate."""
        below_m = 0.0 if fixed_m is None else fixed_m
        steps = scan.baselines_m(pattern)
        if steps:
            yield cost(Candidate(pattern, below_m)), None
        for baseline_m in steps:
            at = Candidate(pattern, baseline_m)
            if baseline_m >= start_m(densest) and scan.may_meet(at):
                yield cost(Candidate(pattern, below_m)), None
                if scan.meets(at):
                    found = scan.refined(pattern, below_m, baseline_m)
                    yield cost(found), found
                    return
            below_m = baseline_m if fixed_m is None else fixed_m

    order = count()  # breaks ties
    waiting: list[tuple[float, int, int, Candidate | None, Bounds]] = []

    def wait(samples: int, following: Bounds) -> None:
        for bound, found in islice(following, 1):
            heappush(waiting, (bound, samples, next(order), found, following))

    for densest, pattern in patterns:
        wait(pattern.samples, bounds(densest, pattern))
    while waiting:
        _, samples, _, found, following = heappop(waiting)
        if found is not None:
            return found
        wait(samples, following)
    return None


def _highest(scan: Scan) -> Candidate | None:
    """The candidate with the highest value among the densest patterns, within half the slack."""
    best: Candidate | None = None
    enough = -math.inf
    waiting: list[tuple[float, int, int, Candidate]] = []
    for densest, _ in scan.families(thinned=True):
        for baseline in scan.baselines_m(densest):
            at = Candidate(densest, baseline)
            waiting.append((-scan.optimistic_value(at), densest.samples, len(waiting), at))
    heapify(waiting)
    while waiting:
        optimistic, _, _, at = heappop(waiting)
        if -optimistic <= enough:
            break
        value = scan.value(scan.predict(at))
        if best is None or value > scan.value(scan.predict(best)):
            best, enough = at, value + 0.5 * (value - scan.near(value))
    return best


def _best(scan: Scan) -> tuple[Candidate | None, Candidate | None]:
    """The fewest samples whose visibility or contrast is within the slack of the best, and the best."""
    best = _highest(scan)
    if best is None:
        return None, None
    enough = scan.near(scan.value(scan.predict(best)))
    for densest, patterns in scan.families():
        if densest.samples > best.pattern.samples:
            break
        steps = scan.baselines_m(densest)
        if steps and all(scan.optimistic_value(Candidate(densest, b)) < enough for b in steps):
            continue
        for pattern in patterns:
            at = (Candidate(pattern, baseline) for baseline in scan.baselines_m(pattern))
            near = [each for each in at if scan.optimistic_value(each) >= enough]
            found = max(near, key=lambda each: scan.value(scan.predict(each)), default=None)
            if found is not None and scan.value(scan.predict(found)) >= enough:
                return found, best
    return best, best


def _fewest_at(scan: Scan, baseline_m: float) -> int | None:
    """Fewest samples that meet the target at one baseline; None if no searched number does."""
    problem = scan.problem
    if problem.model.rises_with_baseline:
        from aosplan.solver.solve_monotone import fewest_at

        return fewest_at(problem, baseline_m)
    free = problem.bounds._replace(max_aperture_m=None, ground=None)
    bounds = free._replace(baseline_m=baseline_m, samples=None)
    found = Scan(problem._replace(bounds=bounds), scan.errors).until_margins_hold(_fewest)
    return None if found is None else found.pattern.samples
