"""The search for models whose V̂ may decrease if the baseline increases, and for the best
visibility.

All patterns are evaluated at the baselines of one **scan**, so that they share their views.  The
baselines form a geometric sequence with the ratio `SCAN_RATIO`.  For each pattern, the scan has
`SCAN_STEPS` baselines below the largest baseline of the pattern, and this largest baseline.  If a
baseline of the scan meets the target and the next smaller one does not, bisection between the two
gives the smallest baseline that meets the target.

**Guarantee.** All patterns of a kind with up to `SEARCHED_SAMPLES` samples (or `--max-samples`) are compared at the baselines of the scan. Depending on the objective, no pattern that meets the target has

- fewer samples, or a shorter flight;
- a smaller extent, among the densest patterns.  The result is the pattern with the fewest samples
  within 1 % of the smallest extent;
- a visibility or contrast that exceeds the best one found by more than half the slack, among the
  densest patterns.  The result is the pattern with the fewest samples within the slack of the best
  one.  The solution also gives the best one.

The densest patterns are those with the most samples in one rectangle.  For lines, lanes and
spirals, they are all patterns with up to `THINNED_FROM` samples, and above this number the largest
pattern of each family.  A family has the sample counts of one rectangle of the trimmed grid.

Candidates are evaluated in the order of a lower bound of their cost.  The first candidate that
meets the target is therefore the best.

**A surrogate** (`Problem.surrogate`) is a quick approximation of the model.  It saves most
evaluations of the model.  A candidate is skipped if it would not meet the target even if its
shortfall and density were lower by a margin.  The margins are `CAUTION` times the largest error of
the surrogate that the search has seen, and at least `LEAST_MARGINS`.  If the margins have increased
during a search, the search begins again with the new margins.  With a surrogate, the guarantee
depends on these margins.  Without a surrogate, the model evaluates all candidates, and the
guarantee is unconditional.  All numbers of the result come from the model.
"""

from __future__ import annotations

import math
from functools import cache, lru_cache, partial
from heapq import heapify, heappop, heappush
from itertools import count, islice, takewhile
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from aosplan.flight.kinematics import path_of
from aosplan.models.model import Prediction
from aosplan.solver.problem import GridKind, Problem
from aosplan.solver.solution import Solution, out_of_scan, solution_of
from aosplan.solver.solve_monotone import APERTURE_SLACK, SEARCHED_SAMPLES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from aosplan.grid.patterns import AnyFrame, AnyPattern

    Cost = Callable[["Candidate"], float]
    Test = Callable[["Candidate"], bool]
    PatternPairs = Iterator[tuple[AnyPattern, AnyPattern]]
    Bounds = Iterator[tuple[float, "Candidate | None"]]

Found = TypeVar("Found")

THINNED_FROM = 64
"""Largest number of samples up to which every pattern is evaluated for the smallest extent and the
best value.
"""

SCAN_RATIO, SCAN_STEPS = 8.0 / 7.0, 30
"""Ratio between consecutive baselines of a scan, and number of its steps.  The smallest baseline is
about one fiftieth of the largest.
"""

REFINEMENTS = 8
"""Number of times that a step of a scan is halved by bisection."""

LEAST_MARGINS = 0.03, 0.005, 0.003
"""Smallest margins for the relative errors of a surrogate: in the shortfall 1 - V̂, in the
transparency 1 - p, and in the quantity that is maximised.
"""

PROBES, PROBE_STEPS = (4, 9, 16), 5
"""Numbers of samples for which the errors of a surrogate are measured first, and number of steps of
the scan between the baselines of these measurements.

The errors of correlograms are largest for few samples.  For generated stands, they are 1 to 6 % of
the shortfall at 4 to 16 samples, and 0 to 3 % at 49 samples.
"""

CAUTION = 1.5
"""The margins are this factor times the largest measured error of the surrogate."""

VISIBILITY_SLACK = 0.005
"""Slack for visibilities of 0.5 or more: plans whose visibility is at least the best one minus the
slack are treated as equally good.
"""

RELATIVE_SLACK = 0.01
"""The slack for lower visibilities and for contrast, as a share of the best value."""


def near_best(objective: str, best: float) -> float:
    """The smallest visibility or contrast that is within the slack of the best one."""
    enough = best * (1.0 - RELATIVE_SLACK)
    return enough if objective == "contrast" else max(enough, best - VISIBILITY_SLACK)


class Candidate(NamedTuple):
    """A pattern at a baseline."""

    pattern: AnyPattern
    baseline_m: float

    @property
    def extent_m(self) -> float:
        """The longer side of the pattern."""
        return self.pattern.longer_side * self.baseline_m


def solve_by_scan(problem: Problem) -> Solution:
    """Find baseline and number of samples for a model whose visibility may decrease if either of
    them increases.

    Raises
    ------
    InfeasibleError
        If no grid meets the target.  The message gives the best value that is possible.
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
    """Predictions of the model for patterns at baselines, and bounds of these predictions from the
    surrogate.
    """

    def __init__(self, problem: Problem, errors: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        self.problem = problem
        self.errors = list(errors)
        self._margins: tuple[float, ...] = LEAST_MARGINS
        self._pattern = lru_cache(maxsize=None)(problem.grid.pattern)
        self._known: dict[Candidate, Prediction] = {}
        self._by_surrogate: dict[Candidate, Prediction] = {}

    def until_margins_hold(self, look: Callable[[Scan], Found]) -> Found:
        """The result of a search.  The search is repeated until its margins cover the errors of the
        surrogate.
        """
        if self.problem.surrogate is not None and not any(self.errors):
            self._probe()
        while True:
            self._margins = self._wanted_margins()
            found = look(self)
            if self._wanted_margins() == self._margins:
                return found

    def _wanted_margins(self) -> tuple[float, ...]:
        """The margins that the largest errors of the surrogate so far require."""
        return tuple(map(max, LEAST_MARGINS, (CAUTION * error for error in self.errors)))

    def _probe(self) -> None:
        """Measure the errors of the surrogate for a few patterns and baselines that are far from
        each other.
        """
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
        """Prediction of the model.  The largest errors of the surrogate are updated."""
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
        """The best prediction that the model may give, according to the surrogate and its
        margins.
        """
        if self.problem.surrogate is None or candidate in self._known:
            return self.predict(candidate)
        shortfall, transparency, _ = self._margins
        guess = self._guess(candidate)
        clear = min(guess.transparency / max(1.0 - transparency, 0.5), 1.0)
        least = guess.shortfall * max(1.0 - shortfall, 0.0)
        return Prediction(1.0 - clear, clear, least)

    def value(self, prediction: Prediction) -> float:
        """Value of the quantity that is maximised: the objective, or else the quantity of the
        target.
        """
        if self.problem.objective == "contrast":
            return prediction.contrast
        if self.problem.objective == "visibility":
            return prediction.expected
        return self.problem.requirement.value_of(prediction)

    def near(self, value: float) -> float:
        """The smallest value that is within the slack of a best value."""
        return near_best(self.problem.objective, value)

    def optimistic_value(self, candidate: Candidate) -> float:
        """The highest value that the model may give, according to the surrogate and its margins."""
        if self.problem.surrogate is None or candidate in self._known:
            return self.value(self.predict(candidate))
        return self.value(self._guess(candidate)) / max(1.0 - self._margins[2], 0.5)

    def meets(self, candidate: Candidate) -> bool:
        """Whether a candidate meets the target.  The model is evaluated only if the surrogate does
        not exclude it.
        """
        requirement = self.problem.requirement
        return requirement.is_met(self.optimistic(candidate)) and requirement.is_met(
            self.predict(candidate)
        )

    def may_meet(self, candidate: Candidate) -> bool:
        """Whether a candidate may meet the target, according to the surrogate and its margins."""
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
    ) -> Iterator[tuple[AnyPattern, Iterable[AnyPattern]]]:
        """The patterns that may be planned, as families.  Each item is a family: its densest
        pattern, and all its patterns.

        The patterns of one frame have the same size and form a family.  For a kind of grid whose
        size differs for each sample count, each pattern is a separate family.  With `thinned`,
        sample counts above `thinned_from` form families as in the trimmed grid.
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

    def baselines_m(self, sites: AnyPattern | AnyFrame) -> list[float]:
        """The baselines of the scan for a pattern, in increasing order."""
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
        self, pattern: AnyPattern, lower: float, baseline: float, halvings: int = REFINEMENTS
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

    def smallest(self, pattern: AnyPattern, halvings: int = REFINEMENTS) -> Candidate | None:
        """A pattern at the smallest baseline that meets the target, found by the scan and
        bisection.
        """
        lower = 0.0
        for baseline in self.baselines_m(pattern):
            if self.meets(Candidate(pattern, baseline)):
                return self.refined(pattern, lower, baseline, halvings)
            lower = baseline
        return None


def _fewest(scan: Scan) -> Candidate | None:
    """The candidate with the fewest samples that meets the target, at its smallest baseline."""
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
    """The candidate with the fewest samples whose extent is within 1 % of the smallest extent."""
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


def _fits(scan: Scan, pattern: AnyPattern, extent_m: float, test: Test) -> bool:
    """Whether a pattern passes a test at the largest baseline within an extent."""
    widest, side = scan.problem.widest_m(pattern), pattern.longer_side
    fixed = scan.problem.bounds.baseline_m
    if fixed is not None:
        return fixed * side <= extent_m and test(Candidate(pattern, fixed))
    return test(Candidate(pattern, min(widest, extent_m / side) if side > 0.0 else widest))


def _least(scan: Scan, patterns: PatternPairs, cost: Cost) -> Candidate | None:
    """The candidate with the lowest cost that meets the target, found by a best-first search.

    Each pattern has an increasing sequence of lower bounds of its cost, one for each baseline at
    which it may meet the target.  In each step, the pattern with the lowest bound is advanced by
    one baseline.  If the cost of a candidate is not larger than any remaining bound, it is the best
    candidate.

    Parameters
    ----------
    scan
        The scan.
    patterns
        Pairs of the densest pattern of a frame and a pattern of this frame.  Let b be the smallest
        baseline at which the densest pattern may meet the target.  The other patterns of the frame
        are not tried at baselines below b.
    cost
        The quantity to minimise.  It increases with the baseline.
    """
    fixed_m = scan.problem.bounds.baseline_m

    @cache
    def start_m(densest: AnyPattern) -> float:
        """Smallest baseline at which the densest pattern of a frame may meet the target."""
        steps = scan.baselines_m(densest)
        hopeless = math.inf if steps else 0.0
        return next((b for b in steps if scan.may_meet(Candidate(densest, b))), hopeless)

    def bounds(densest: AnyPattern, pattern: AnyPattern) -> Bounds:
        """Yield increasing lower bounds of the cost of a pattern, and finally its candidate."""
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

    order = count()  # The count orders entries of the heap that are otherwise equal.
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
    """Candidates with the fewest samples within the slack of the highest value, and with this value."""
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
    """Smallest number of samples that meets the target at one baseline; None if no searched number
    does.
    """
    problem = scan.problem
    if problem.model.rises_with_baseline:
        from aosplan.solver.solve_monotone import fewest_at

        return fewest_at(problem, baseline_m)
    free = problem.bounds._replace(max_aperture_m=None, ground=None)
    bounds = free._replace(baseline_m=baseline_m, samples=None)
    found = Scan(problem._replace(bounds=bounds), scan.errors).until_margins_hold(_fewest)
    return None if found is None else found.pattern.samples
