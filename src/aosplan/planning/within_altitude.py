"""The best flight at one altitude within a given time.

The shortest time in which a shape can be flown is known in closed form
(`aosplan.planning.least_time`).  Shapes that take too long are therefore left out before their
visibility is predicted.  Only the best few shapes are *laid out*: their flights are planned
completely, with exact times.  See `aosplan.planning.within`.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any

from aosplan.errors import InfeasibleError, RequestError
from aosplan.models.model import Prediction
from aosplan.planning.dependent_defaults import BEST
from aosplan.planning.shape_space import ShapeSpace
from aosplan.planning.solved_plan import Memo, problem_of
from aosplan.planning.within_shapes import (
    FlownShape,
    Shape,
    TimedFlight,
    last_number,
    lay_out,
    shape_time_s,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.planning.request import PlanRequest
    from aosplan.planning.within_shapes import Way

MOST_SAMPLES = 400
"""Largest number of samples of a grid, unless --max-samples allows more."""

AT_PLACE = (0.65, 0.4, 0.22, 0.1)
"""Shares with which the search of grids at one place begins (`aosplan.planning.shape_space`). Over
an area, it begins with the share 1.
"""

HOPELESS = 4
"""The search over numbers of rows ends when this many successive numbers of rows reach less than
half of the best objective.
"""

STEPS = (0.6, 0.8)
"""Factors by which the spacing is changed in successive refinements."""

REFINED = 3
"""The spacing is refined for this many numbers of rows: those with the best objective."""

FEWER = (1.0, 0.8, 0.65, 0.5)
"""Numbers of columns that are tried, as fractions of the largest number of columns."""

LAID_OUT = 12
"""Largest number of flights that are laid out in each round of a search."""

ROUNDS = 3

QUICKER = 2
"""Number of flights that are laid out to find a faster flight that is almost as good as the
best.
"""

POLISHED = 4
"""Largest number of neighbours of the best flight that are laid out in each step."""

COUNTED = 4
"""In each search at one altitude, detection is counted in the voxels of a stand for at most this
number of flights.
"""

REFUSED = 4
"""A way is no longer tried if this many shapes in succession cannot be flown in it."""

TIMED = 4
"""Number of flights that are laid out to compare their exact times, if the time is the
objective.
"""

NEARLY = 0.001
"""Relative difference of the objective below which the shorter flight is preferred."""


def octave(shape: Shape) -> int:
    """Exponent of the largest power of two that is not larger than the number of photos."""
    return shape.samples.bit_length() - 1


class AltitudeSearch:
    """The shapes at one altitude, the ways to fly them, and their results.

    Parameters
    ----------
    request
        The request.
    ways
        The ways to fly.  All of them have the same altitude.
    """

    def __init__(self, request: PlanRequest, ways: tuple[Way, ...]) -> None:
        self.request = request
        self.scores: dict[Shape, float] = {}
        self.timed: dict[tuple[Shape, int], TimedFlight | None] = {}
        self.reason: InfeasibleError | RequestError | None = None
        self._least: dict[Shape, FlownShape] = {}
        self._refused: dict[int, float] = {}
        self._counted: dict[Shape, float] = {}
        self.most_samples = request.max_samples or MOST_SAMPLES
        self.ways = ways
        self.inputs, self.altitude_m = ways[0].inputs, ways[0].altitude_m
        self.over_area = self.inputs.area is not None
        x, y = self.inputs.footprint_m
        self.space = ShapeSpace(
            request,
            self.altitude_m,
            (x / self.altitude_m, y / self.altitude_m),
            over_area=self.over_area,
            most_samples=self.most_samples,
        )

    # --- Prediction for a shape ---

    @cached_property
    def _model(self) -> Any:
        posed = problem_of(self.inputs, Memo())
        if posed is None:
            return None
        problem, _ = posed
        return problem.surrogate or problem.model

    @cached_property
    def _detection(self) -> Any:
        from aosplan.planning.plan_detection import detection_model

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
        """The objective of a shape, with a sign such that larger values are better; minus infinity
        if the target is not met.
        """
        if shape not in self.scores:
            self.scores[shape] = self._score(shape) if self.meets(shape) else -math.inf
        return self.scores[shape]

    def _score(self, shape: Shape) -> float:
        objective = self.request.optimize
        if objective == "detection":
            baseline_m = shape.along * self.altitude_m
            return float(self._detection.probability(shape.pattern, baseline_m))
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
        """The score of a flight that was laid out, computed with its exact time, or with its
        detection counted in voxels.
        """
        shape = timed.candidate.shape
        if self.request.optimize == "time":
            return -timed.time_s
        if self.request.optimize != "detection" or self.inputs.model != "measured":
            return self.score(shape)
        if shape not in self._counted:
            self._counted[shape] = self._probability(timed.candidate)
        return self._counted[shape]

    def _probability(self, candidate: FlownShape) -> float:
        from aosplan.planning.plan_detection import detection_of

        way, shape = candidate.way, candidate.shape
        baseline_m = shape.along * way.altitude_m
        return detection_of(way.inputs, shape.pattern, baseline_m).probability

    # --- Time of a shape ---

    def least(self, shape: Shape) -> FlownShape:
        """The way in which a shape takes the least time.  The time is infinite if no way is
        possible.
        """
        if shape not in self._least:
            timed = [
                (math.inf if self._is_refused(shape, way) else shape_time_s(shape, way), place)
                for place, way in enumerate(self.ways)
            ]
            least_s, place = min(timed)
            self._least[shape] = FlownShape(shape, self.ways[place], least_s)
        return self._least[shape]

    def time(self, candidate: FlownShape) -> TimedFlight | None:
        """Lay out the flight of a candidate; None if it cannot be flown."""
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
        """Whether a way is known to be impossible for a shape, because laying out its flight has
        failed, or because the way is no longer tried.
        """
        refused = self.timed.get((shape, id(way)), way) is None
        return refused or self._refused.get(id(way), 0.0) >= REFUSED

    def _laid_out(self, candidate: FlownShape) -> TimedFlight | None:
        """The flight of a candidate. If it cannot be flown, the shape is flown in the next best way
        instead.
        """
        timed = self.time(candidate)
        while timed is None:
            candidate = self.least(candidate.shape)
            if not math.isfinite(candidate.least_s):
                return None
            timed = self.time(candidate)
        return timed

    def _least_known_s(self, candidate: FlownShape) -> float:
        """The exact time of a candidate if it was laid out, otherwise the lower bound."""
        key = candidate.shape, id(candidate.way)
        if key not in self.timed:
            return candidate.least_s
        timed = self.timed[key]
        return math.inf if timed is None else timed.time_s

    # --- Search ---

    def best(self, longest_s: float, tries: int = LAID_OUT) -> TimedFlight | None:
        """The best flight within `longest_s`, planned completely; None if no flight that was tried
        is possible.
        """
        allowed_s = longest_s
        for _ in range(ROUNDS):
            candidates = [self.least(shape) for shape in self._shapes(allowed_s)]
            candidates = [
                each
                for each in candidates
                if self.score(each.shape) > -math.inf and math.isfinite(each.least_s)
            ]
            candidates.sort(key=lambda each: (-self.score(each.shape), each.least_s, each.shape))
            over: list[float] = []
            if self._counts:
                best = self._best_counted(candidates, longest_s, tries, over)
                if best is not None:
                    return best
            else:
                found = self._fitting_flights(candidates, longest_s, tries, over)
                if found:
                    return self._polished(self._preferred(candidates, found), longest_s)
            # No-fly zones, terrain or gaps in the area make the flights longer than the lower
            # bounds. The next round therefore searches with a shorter time.
            allowed_s /= max(min(over, default=1.0), 1.02)
        return None

    def _fitting_flights(
        self, candidates: list[FlownShape], longest_s: float, tries: int, over: list[float]
    ) -> list[TimedFlight]:
        """The flights of the first candidates that fit into the time.  `over` receives the times of
        flights that do not fit into the time, divided by this time.
        """
        wanted = TIMED if self.request.optimize == "time" else 1
        found: list[TimedFlight] = []
        for candidate in candidates[:tries]:
            timed = self._laid_out(candidate)
            if timed is not None and timed.time_s <= longest_s:
                found.append(timed)
                if len(found) == wanted:
                    break
            elif timed is not None:
                over.append(timed.time_s / longest_s)
        return found

    @property
    def _counts(self) -> bool:
        """Whether the objective is counted in the voxels of a stand."""
        return self.request.optimize == "detection" and self.inputs.model == "measured"

    def _best_counted(
        self, candidates: list[FlownShape], longest_s: float, tries: int, over: list[float]
    ) -> TimedFlight | None:
        """The flight with the largest counted probability of detection.

        The score of a shape assumes independent slices.  In a real stand it is too high, and the
        ratio of the counted probability to the score depends on the number of photos.  Therefore,
        the candidate with the largest product of score and ratio is counted next.  The ratio is the
        mean over the counted shapes with a similar number of photos.  The ratio is 1 if no such
        shape has been counted yet, so that every number of photos with a high score is counted
        once.
        """
        found: dict[Shape, TimedFlight] = {}
        left = {each.shape: each for each in candidates}
        for _ in range(tries + COUNTED):
            if not left or len(found) == COUNTED:
                break
            ratios = self._ratios()
            shape = max(left, key=lambda each: self.score(each) * ratios.get(octave(each), 1.0))
            if shape in found:
                break
            timed = self._laid_out(left[shape])
            if timed is not None and timed.time_s <= longest_s:
                found[shape] = timed
                self.counted(timed)
            else:
                del left[shape]
                if timed is not None:
                    over.append(timed.time_s / longest_s)
        return max(found.values(), key=self.counted, default=None)

    def _ratios(self) -> dict[int, float]:
        """Mean ratio of the counted probability of detection to the score, by octave of the number
        of photos.
        """
        known: dict[int, list[float]] = {}
        for shape, counted in self._counted.items():
            if self.score(shape) > 0.0:
                known.setdefault(octave(shape), []).append(counted / self.score(shape))
        return {each: sum(ratios) / len(ratios) for each, ratios in known.items()}

    def _preferred(self, candidates: list[FlownShape], found: list[TimedFlight]) -> TimedFlight:
        """The best of the found flights, or a faster flight that is almost as good."""
        best = max(found, key=self.counted)
        if self.request.optimize == "time":
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
        """The best flight that is found by small steps from a flight.  Each step leads to a better
        neighbour.
        """
        if self.request.optimize == "time":
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

    @property
    def least_s(self) -> float:
        """The shortest time of any shape; infinite if there is no shape."""
        return min((self.least(shape).least_s for shape in self._families(1)), default=math.inf)

    def _families(self, columns: int) -> Iterator[Shape]:
        for rows in self.space.rows:
            shape = self.space.shape(rows, columns, 1.0, 1.0)
            if shape is not None:
                yield shape

    def _shapes(self, longest_s: float) -> set[Shape]:
        """Promising shapes.

        For each number of rows, the number of columns is about the largest one that can be flown in
        the time. Fewer columns are tried too, because more photos in the same aperture do not
        always find more targets.
        """
        coarse = [(1.0, 1.0)]
        if not self.over_area:
            coarse += [share for each in AT_PLACE for share in ((each, each), (1.0, each))]
        found: dict[int, set[Shape]] = {}
        tops: list[float] = []
        for rows in self.space.rows:
            shapes: set[Shape] = set()
            for share in coarse:
                shapes |= self._fitting(rows, share, longest_s, FEWER[:2])
            found[rows] = shapes
            tops.append(max(map(self.score, shapes), default=-math.inf))
            if self.request.optimize in BEST and max(tops[-HOPELESS:]) < 0.5 * max(tops):
                break
        best = {
            rows: max(shapes, key=lambda shape: (self.score(shape), shape))
            for rows, shapes in found.items()
            if shapes
        }
        ranked = sorted(best, key=lambda rows: self.score(best[rows]), reverse=True)
        chosen = {shape for shapes in found.values() for shape in shapes}
        for rows in ranked[:REFINED]:
            top = best[rows]
            for step in STEPS:
                top, seen = self._climbed(top, step, longest_s)
                chosen |= seen
            chosen |= self._fitting(rows, self.space.filled(top), longest_s, FEWER)
        return chosen

    def _climbed(self, top: Shape, step: float, longest_s: float) -> tuple[Shape, set[Shape]]:
        """The best shape that is found by steps of the spacing, and all shapes that were tried.

        Each step changes the spacing along the lines, across them, or both.  The number of columns
        is the largest one that can be flown in the time.
        """
        seen: set[Shape] = set()
        while True:
            x, y = self.space.filled(top)
            shares = {
                (min(x * along, 1.0), min(y * across, 1.0))
                for along in (step, 1.0, 1.0 / step)
                for across in (step, 1.0, 1.0 / step)
            } - {(x, y)}
            near: set[Shape] = set()
            for share in sorted(shares):
                near |= self._fitting(top.rows, share, longest_s, FEWER[:2])
            seen |= near
            best = max(near | {top}, key=lambda shape: (self.score(shape), shape))
            if self.score(best) <= self.score(top):
                return top, seen
            top = best

    def _fitting(
        self, rows: int, share: tuple[float, float], longest_s: float, parts: tuple[float, ...]
    ) -> set[Shape]:
        """Shapes with a given number of rows and given shares.

        If the objective is maximised, the shapes have the largest number of columns that can be
        flown in the time, or fractions of this number.  Otherwise they have the smallest number of
        columns that meets the target.
        """
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
