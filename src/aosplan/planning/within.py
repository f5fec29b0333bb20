"""What can be flown within a time: the best of everything that a request leaves open.

A *shape* is a grid in units of the altitude: rows, columns, and the spacing along lines and across
them as slopes.  Cameras at the same slopes see a target from the same directions at every altitude,
so a shape is judged once, whichever way it is flown.  A *way* is a trigger, an altitude and a
heading.  The least time of a shape over all ways is known in closed form
(`aosplan.planning.least_time`), so that shapes which take too long are left out before anything is
predicted for them.  Only the best few are laid out and timed exactly.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from aosplan.errors import InfeasibleError, RequestError
from aosplan.models.model import Prediction
from aosplan.planning.option_relations import BEST
from aosplan.planning.shape_space import MOST_ROWS, ShapeSpace
from aosplan.planning.solved_plan import Memo, problem_of
from aosplan.planning.within_result import (
    PHOTO_INTERVAL_S,
    WithinResult,
    WithinRow,
    interval_assumed,
    samples_bounded,
)
from aosplan.planning.within_shapes import (
    FlownShape,
    Shape,
    TimedFlight,
    Way,
    last_number,
    lay_out,
    near_shares,
    request_of,
    shape_time_s,
    ways_of,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from aosplan.messages import Message
    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.planning.request import PlanRequest

MOST_SAMPLES = 400
"""Samples of a grid, unless --max-samples allows more."""


OVER_AREA = (1.0, 0.8, 0.6, 0.45)
"""Shares of the footprint that a grid over an area may fill, along or across the heading."""

AT_PLACE = (1.0, 0.8, 0.65, 0.5, 0.4, 0.3, 0.22, 0.16, 0.1, 0.05)
"""The same at one place, where a smaller grid takes less time."""

REFINED = 3
"""Numbers of rows, the best of them, whose spacing is refined."""

FEWER = (1.0, 0.8, 0.65, 0.5)
"""Parts of the most columns that are tried as well."""

LAID_OUT = 12
"""Flights that are laid out for one time, at most, in each of a few rounds."""

ROUNDS = 3

QUICKER = 2
"""Flights that are laid out to find a quicker one that is nearly as good."""

POLISHED = 4
"""Neighbours of the best flight that are laid out, at most, in each step to a better one."""

COUNTED = 2
"""Of them, those whose detection is counted in the voxels of a stand."""

REFUSED = 4
"""Shapes after which a way that none of them can be flown in is given up."""

TIMED = 4
"""Flights whose times are compared as they are laid out, if the time is the objective."""

NEARLY = 0.001
"""Relative: what is no better than this is not worth a longer flight."""

GAIN = 0.005
"""Relative gain of twice the time below which a search without a bound on the time ends."""

CURVE = (0.5, 0.7, 1.0, 1.4, 2.0)
"""Parts of the time for which the best is told."""


def choose(
    request: PlanRequest, *, folder: str = "", load: Callable[[PlanRequest], LoadedScene]
) -> tuple[PlanRequest, WithinResult]:
    """Choose what a request leaves open, within its time.

    Parameters
    ----------
    request
        With ``within``, or with detection as its objective.
    folder
        Where its file names are looked for before the current folder.
    load
        Gives the scene.

    Returns
    -------
    request, answer
        A request that leaves nothing open, and what it was compared with.

    Raises
    ------
    RequestError
        If values do not fit each other.
    InfeasibleError
        If nothing can be flown within the time, or nothing that can reaches the target.
    """
    asked = request
    assumed: tuple[Message, ...] = ()
    if request.trigger != "stop" and request.photo_interval is None:
        request = replace(request, photo_interval=PHOTO_INTERVAL_S)
        assumed = (interval_assumed(),)
    search = WithinSearch(request, folder, load)
    longest_s = search.enough_s() if request.within is None else 60.0 * request.within
    chosen = search.best(longest_s)
    if chosen is None:
        raise search.refusal(longest_s)
    if request.within is None and request.optimize == "time":
        longest_s = chosen.time_s
    best = {0.5: search.best(0.5 * longest_s), 1.0: chosen, 2.0: search.best(2.0 * longest_s)}
    rows = tuple(
        WithinRow(part * longest_s / 60.0, None)
        if timed is None
        else search.row(part * longest_s, timed)
        for part, timed in best.items()
    )
    curve = tuple(search.point(part * longest_s, best.get(part)) for part in CURVE)
    if search.most_samples <= chosen.candidate.shape.samples + MOST_ROWS:
        assumed = (*assumed, samples_bounded(search.most_samples))
    answer = WithinResult(
        asked,
        longest_s / 60.0,
        rows,
        tuple(point for point in curve if point is not None),
        len(search.scores),
        len(search.timed),
        assumed,
    )
    return request_of(request, chosen.candidate), answer


class WithinSearch:
    """Shapes, ways and what is known of them."""

    def __init__(
        self, request: PlanRequest, folder: str, load: Callable[[PlanRequest], LoadedScene]
    ) -> None:
        self.request = request
        self.scores: dict[Shape, float] = {}
        self.timed: dict[tuple[Shape, int], TimedFlight | None] = {}
        self.reason: InfeasibleError | RequestError | None = None
        self._least: dict[Shape, FlownShape] = {}
        self._refused: dict[int, float] = {}
        self._counted: dict[Shape, float] = {}
        self.most_samples = request.max_samples or MOST_SAMPLES
        self.ways = tuple(ways_of(request, folder, load))
        highest = max(self.ways, key=lambda way: way.altitude_m)
        self.inputs, self.altitude_m = highest.inputs, highest.altitude_m
        self.over_area = self.inputs.area is not None
        x, y = self.inputs.footprint_m
        self.space = ShapeSpace(
            request,
            self.altitude_m,
            (x / self.altitude_m, y / self.altitude_m),
            over_area=self.over_area,
            most_samples=self.most_samples,
        )

    # What a shape shows

    @cached_property
    def _model(self) -> Any:
        posed = problem_of(self.inputs, Memo())
        if posed is None:
            return None
        problem, _ = posed
        return problem.surrogate or problem.model

    @cached_property
    def _detection(self) -> Any:
        from aosplan.planning.detection import detection_model

        return detection_model(self.inputs).for_search()

    def prediction(self, shape: Shape) -> Prediction:
        """Visibility of a shape."""
        if self._model is None:
            return Prediction(0.0, 1.0, 1.0 / shape.samples)
        found: Prediction = self._model.predict(shape.pattern, shape.along * self.altitude_m)
        return found

    def meets(self, shape: Shape) -> bool:
        """Whether a shape reaches the target."""
        requirement = self.inputs.requirement
        return not requirement.target or requirement.is_met(self.prediction(shape))

    def score(self, shape: Shape) -> float:
        """The objective, so that more is better; minus infinity if the target is missed."""
        if shape not in self.scores:
            self.scores[shape] = self._score(shape) if self.meets(shape) else -math.inf
        return self.scores[shape]

    def _score(self, shape: Shape) -> float:
        objective = self.request.optimize
        if objective == "detection":
            baseline_m = shape.along * self.altitude_m
            return float(self._detection.predict(shape.pattern, baseline_m).probability)
        if objective in BEST:
            found = self.prediction(shape)
            return found.expected if objective == "visibility" else found.contrast
        if objective == "samples":
            return -float(shape.samples)
        if objective == "aperture":
            sides = (shape.columns - 1) * shape.along, (shape.rows - 1) * shape.across
            return -max(sides) * self.altitude_m
        return -self.least(shape).least_s

    def counted(self, timed: TimedFlight) -> float:
        """The score of a flight: its time as laid out, or detection counted in voxels."""
        shape = timed.candidate.shape
        if self.request.optimize == "time":
            return -timed.time_s
        if self.request.optimize != "detection" or self.inputs.model != "measured":
            return self.score(shape)
        if shape not in self._counted:
            self._counted[shape] = self._probability(timed.candidate)
        return self._counted[shape]

    def _probability(self, candidate: FlownShape) -> float:
        from aosplan.planning.detection import detection_of

        way, shape = candidate.way, candidate.shape
        baseline_m = shape.along * way.altitude_m
        return detection_of(way.inputs, shape.pattern, baseline_m).probability

    # What it takes

    def least(self, shape: Shape) -> FlownShape:
        """The way in which a shape takes the least time; infinite if it cannot be flown in any."""
        if shape not in self._least:
            timed = [
                (math.inf if self._is_refused(shape, way) else shape_time_s(shape, way), place)
                for place, way in enumerate(self.ways)
            ]
            least_s, place = min(timed)
            self._least[shape] = FlownShape(shape, self.ways[place], least_s)
        return self._least[shape]

    def time(self, candidate: FlownShape) -> TimedFlight | None:
        """The flight of a candidate, laid out; None if it cannot be flown."""
        key = candidate.shape, id(candidate.way)
        if key not in self.timed:
            way = id(candidate.way)
            try:
                self.timed[key] = lay_out(candidate)
                self._refused[way] = -math.inf
            except (InfeasibleError, RequestError) as error:
                self.timed[key], self.reason = None, error
                self._refused[way] = self._refused.get(way, 0.0) + 1.0
                self._least.clear()
        return self.timed[key]

    def _is_refused(self, shape: Shape, way: Way) -> bool:
        """Whether a shape was laid out in a way and cannot be flown so, or no other shape can."""
        refused = self.timed.get((shape, id(way)), way) is None
        return refused or self._refused.get(id(way), 0.0) >= REFUSED

    def _laid_out(self, candidate: FlownShape) -> TimedFlight | None:
        """The flight of a candidate, or of its shape in the next way in which it can be flown."""
        timed = self.time(candidate)
        while timed is None:
            candidate = self.least(candidate.shape)
            if not math.isfinite(candidate.least_s):
                return None
            timed = self.time(candidate)
        return timed

    def _least_known_s(self, candidate: FlownShape) -> float:
        """The time of a candidate: as it was laid out, or else the least."""
        key = candidate.shape, id(candidate.way)
        if key not in self.timed:
            return candidate.least_s
        timed = self.timed[key]
        return math.inf if timed is None else timed.time_s

    # The search

    def best(self, longest_s: float, tries: int = LAID_OUT) -> TimedFlight | None:
        """The best flight that takes no longer, laid out; None if none of the tries of a round is."""
        allowed_s = longest_s
        for _ in range(ROUNDS):
            candidates = [self.least(shape) for shape in self._shapes(allowed_s)]
            candidates = [
                each
                for each in candidates
                if self.score(each.shape) > -math.inf and math.isfinite(each.least_s)
            ]
            candidates.sort(key=lambda each: (-self.score(each.shape), each.least_s, each.shape))
            over = []
            found: list[TimedFlight] = []
            for candidate in candidates[:tries]:
                timed = self._laid_out(candidate)
                if timed is not None and timed.time_s <= longest_s:
                    found.append(timed)
                    if len(found) == self._wanted:
                        break
                elif timed is not None:
                    over.append(timed.time_s / longest_s)
            if found:
                return self._polished(self._preferred(candidates, found), longest_s)
            # The least times are too low here: no-fly zones, terrain, or gaps in the area.
            allowed_s /= max(min(over, default=1.0), 1.02)
        return None

    @property
    def _wanted(self) -> int:
        """Flights that are compared once they are laid out."""
        if self.request.optimize == "time":
            return TIMED
        counts = self.request.optimize == "detection" and self.inputs.model == "measured"
        return COUNTED if counts else 1

    def _preferred(self, candidates: list[FlownShape], found: list[TimedFlight]) -> TimedFlight:
        """The best of some flights, or a quicker one that is nearly as good."""
        best = max(found, key=self.counted)
        if self._wanted > 1:
            return best
        score = self.score(best.candidate.shape)
        near = [
            each
            for each in candidates
            if self.score(each.shape) >= score - NEARLY * abs(score) and each.least_s < best.time_s
        ]
        near.sort(key=lambda each: (each.least_s, each.shape))
        timed = [self.time(each) for each in near[:QUICKER]]
        return min([best, *(each for each in timed if each)], key=lambda each: each.time_s)

    def _polished(self, best: TimedFlight, longest_s: float) -> TimedFlight:
        """The best that is found from a flight by small steps, each of them to a better one."""
        if self._wanted > 1:
            return best
        while True:
            score = self.score(best.candidate.shape)
            near = [self.least(shape) for shape in self.space.neighbours(best.candidate.shape)]
            near = [
                each
                for each in near
                if self._least_known_s(each) <= longest_s
                and self.score(each.shape) > score + NEARLY * abs(score)
            ]
            near.sort(key=lambda each: (-self.score(each.shape), each.shape))
            timed = map(self.time, near[:POLISHED])
            better = (each for each in timed if each and each.time_s <= longest_s)
            found = next(better, None)
            if found is None:
                return best
            best = found

    def enough_s(self) -> float:
        """The time from which on twice as much gains next to nothing."""
        least = min((self.least(shape).least_s for shape in self._families(1)), default=math.inf)
        if not math.isfinite(least):
            raise self.refusal(math.inf)
        before, longest_s = -math.inf, 1.05 * least
        for _ in range(20):
            timed = self.best(longest_s)
            now = -math.inf if timed is None else self.score(timed.candidate.shape)
            if now > -math.inf and now - before <= GAIN * abs(now):
                break
            before, longest_s = now, 2.0 * longest_s
        return 0.5 * longest_s

    def _families(self, columns: int) -> Iterator[Shape]:
        for rows in self.space.rows:
            shape = self.space.shape(rows, columns, 1.0, 1.0)
            if shape is not None:
                yield shape

    def _shapes(self, longest_s: float) -> set[Shape]:
        """Shapes worth a look: for each number of rows, about as many columns as there is time for.

        More photos in the same aperture do not always find more, so fewer are tried as well.
        """
        shares = OVER_AREA if self.over_area else AT_PLACE
        coarse = [(1.0, 1.0)] if self.over_area else [(each, each) for each in shares[::2]]
        found: dict[int, set[Shape]] = {}
        for rows in self.space.rows:
            shapes: set[Shape] = set()
            for share in coarse:
                shapes |= self._fitting(rows, share, longest_s, FEWER[:2])
            found[rows] = shapes
        best = {
            rows: max(shapes, key=lambda shape: (self.score(shape), shape))
            for rows, shapes in found.items()
            if shapes
        }
        ranked = sorted(best, key=lambda rows: self.score(best[rows]), reverse=True)
        chosen = {shape for shapes in found.values() for shape in shapes}
        for rows in ranked[:REFINED]:
            for share in near_shares(best[rows], shares, self.space.filled):
                chosen |= self._fitting(rows, share, longest_s, FEWER[:1])
            chosen |= self._fitting(rows, self.space.filled(best[rows]), longest_s, FEWER)
        return chosen

    def _fitting(
        self, rows: int, share: tuple[float, float], longest_s: float, parts: tuple[float, ...]
    ) -> set[Shape]:
        """Shapes with the most columns that fit and parts of them; if samples cost, the fewest."""
        request = self.request
        most = self.most_samples // rows
        if request.samples is not None:
            columns = {request.samples // rows} if request.samples % rows == 0 else set()
        elif request.optimize in BEST:
            most = last_number(
                most, lambda n: self._fits(self.space.shape(rows, n, *share), longest_s)
            )
            columns = {math.floor(part * most) for part in parts} | {max(most - 1, 0)}
        else:
            missed = last_number(most, lambda n: self._misses(self.space.shape(rows, n, *share)))
            columns = {missed + 1} if missed < most else set()
        shapes = (self.space.shape(rows, each, *share) for each in columns if each)
        return {shape for shape in shapes if shape and self._fits(shape, longest_s)}

    def _misses(self, shape: Shape | None) -> bool:
        return shape is not None and not self.meets(shape)

    def _fits(self, shape: Shape | None, longest_s: float) -> bool:
        return shape is not None and self._least_known_s(self.least(shape)) <= longest_s

    # What is told of it

    def row(self, longest_s: float, timed: TimedFlight) -> WithinRow:
        """What is told of the best within a time."""
        return WithinRow(longest_s / 60.0, timed, self.counted(timed))

    def point(self, longest_s: float, timed: TimedFlight | None) -> tuple[float, float] | None:
        """Time [s] and objective of the best within a time, laid out or expected; None for none."""
        if timed is not None:
            return timed.time_s, self.counted(timed)
        if self.inputs.model == "measured":
            return None
        found = self.best(longest_s)
        return None if found is None else (found.time_s, self.counted(found))

    def refusal(self, longest_s: float) -> InfeasibleError:
        """The error of a time in which nothing can be flown that reaches the target."""
        target = self.inputs.requirement.target
        for part in range(1, 13):
            later = self.best(longest_s * 2.0**part) if math.isfinite(longest_s) else None
            if later is not None:
                minutes = math.ceil(later.time_s / 60.0)
                return InfeasibleError(
                    f"no plan {'that reaches the target ' if target else ''}can be flown "
                    f"within {longest_s / 60.0:.4g} min, from take-off to landing",
                    f"--within {minutes} is enough",
                )
        message = "no plan satisfies the given options in any time"
        if self.reason is not None:
            return InfeasibleError(f"{message}: {self.reason.message}", self.reason.hint)
        return InfeasibleError(
            message, "leave out options: the kind of grid, its spacing, the trigger or the target"
        )
