"""The search for the best flight within a given time, over all options that a request does not
give.

A *shape* is a grid in units of the altitude: rows, columns, and the spacings along and across lines
divided by the altitude. A *way* is a trigger, an altitude and a heading with which a shape can be
flown. Each altitude is searched separately (`aosplan.planning.within_altitude`), beginning with the
highest. At every altitude, a given shape sees a target from the same directions. At a lower
altitude, however, the rays to neighbouring points of the target meet the same occluders more often,
which is a disadvantage. A lower altitude is therefore searched only if the flight takes less time
there.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import InfeasibleError
from aosplan.planning.shape_space import MOST_ROWS
from aosplan.planning.within_altitude import LAID_OUT, NEARLY, AltitudeSearch
from aosplan.planning.within_result import (
    PHOTO_INTERVAL_S,
    WithinResult,
    WithinRow,
    interval_assumed,
    samples_bounded,
)
from aosplan.planning.within_shapes import request_for, ways_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.messages import Message
    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.resolve import PlanInputs
    from aosplan.planning.within_shapes import TimedFlight, Way

GAIN = 0.005
"""A search without a given time ends when doubling the time improves the objective by less than
this share of its value.
"""

MULTIPLES = (1.5, 2.0, 3.0, 4.5, 7.0, 10.0)
"""Multiples of the time of the request. The best flight within each multiple is found, and its
first part is considered.
"""

LARGER = (15.0, 25.0, 40.0, 70.0)
"""Multiples that are tried if there is no flight within the smaller multiples."""

CURVE = (0.5, 0.7, 1.0, 1.4, 2.0)
"""The best plans within these multiples of the time are reported."""


def choose_flight(
    request: PlanRequest, *, folder: str = "", load: Callable[[PlanRequest], LoadedScene]
) -> tuple[PlanRequest, WithinResult]:
    """Choose the options that a request does not give, within its time.

    Parameters
    ----------
    request
        A request with ``within``, or with detection as its objective.
    folder
        Folder in which its files are looked for before the current folder.
    load
        Function that returns the scene.

    Returns
    -------
    request, answer
        A request with all options, and the results of the search.

    Raises
    ------
    RequestError
        If values contradict each other.
    InfeasibleError
        If no flight within the time is possible, or if no such flight reaches the target.
    """
    search = WithinSearch(request, folder, load)
    longest_s = search.longest_s()
    # The best flight of a longer or a shorter time may also be the best one within this time.
    search.best(2.0 * longest_s)
    search.best(0.5 * longest_s)
    chosen = search.best(longest_s)
    if chosen is None:
        raise search.refusal(longest_s)
    if request.within is None and request.optimize == "time":
        longest_s = chosen.time_s
    return request_for(search.request, chosen.candidate), _answer(search, longest_s, chosen)


class WholeFlight(NamedTuple):
    """A flight over a whole area: its request, probability of detection and time."""

    request: PlanRequest
    probability: float
    time_s: float


def choose_flights(
    request: PlanRequest, *, folder: str = "", load: Callable[[PlanRequest], LoadedScene]
) -> tuple[list[WholeFlight], PlanInputs, WithinResult]:
    """The best flights over a whole area within the time of a request and within multiples of it.

    The first part of a longer flight may find more within the time than a flight over the whole
    area (`aosplan.planning.gain_order`).

    Parameters
    ----------
    request, folder, load
        As in `choose_flight`.

    Returns
    -------
    flights, inputs, answer
        The flights, by increasing time; inputs of a plan over the area; and the results of the
        search within the time.

    Raises
    ------
    RequestError, InfeasibleError
        As in `choose_flight`, if there is not even a longer flight.
    """
    search = WithinSearch(request, folder, load)
    longest_s = search.longest_s()
    found = {1.0: search.best(longest_s)}
    if request.within is not None and request.optimize == "detection":
        found |= {part: search.best(part * longest_s) for part in MULTIPLES}
        if all(timed is None for timed in found.values()):
            found |= {part: search.best(part * longest_s) for part in LARGER}
    flights = [
        WholeFlight(
            request_for(search.request, timed.candidate), search.probability(timed), timed.time_s
        )
        for timed in {id(timed): timed for timed in found.values()}.values()
        if timed is not None
    ]
    if not flights:
        raise search.refusal(longest_s)
    return flights, search.levels[0].inputs, _answer(search, longest_s, found[1.0])


def _answer(search: WithinSearch, longest_s: float, chosen: TimedFlight | None) -> WithinResult:
    """The results of a search."""
    assumed = search.assumed
    best = {0.5: search.best(0.5 * longest_s), 1.0: chosen, 2.0: search.best(2.0 * longest_s)}
    rows = tuple(
        WithinRow(part * longest_s / 60.0, None)
        if timed is None
        else search.row(part * longest_s, timed)
        for part, timed in best.items()
    )
    curve = tuple(search.point(part * longest_s, best.get(part)) for part in CURVE)
    most = search.most_samples
    if chosen is not None and most <= chosen.candidate.shape.samples + MOST_ROWS:
        assumed = (*assumed, samples_bounded(most))
    return WithinResult(
        search.asked,
        longest_s / 60.0,
        rows,
        tuple(point for point in curve if point is not None),
        sum(len(level.scores) for level in search.levels),
        sum(len(level.timed) for level in search.levels),
        assumed,
    )


class WithinSearch:
    """A search over all altitudes, beginning with the highest."""

    def __init__(
        self, request: PlanRequest, folder: str, load: Callable[[PlanRequest], LoadedScene]
    ) -> None:
        self.asked = request
        self.assumed: tuple[Message, ...] = ()
        if request.trigger != "stop" and request.photo_interval is None:
            request = replace(request, photo_interval=PHOTO_INTERVAL_S)
            self.assumed = (interval_assumed(),)
        self.request = request
        self._found: dict[tuple[float, int], TimedFlight | None] = {}
        ways: dict[float, list[Way]] = {}
        for way in ways_of(request, folder, load):
            ways.setdefault(way.altitude_m, []).append(way)
        self.levels = [
            AltitudeSearch(request, tuple(ways[altitude]))
            for altitude in sorted(ways, reverse=True)
        ]

    @property
    def most_samples(self) -> int:
        """Largest number of samples of a grid."""
        return self.levels[0].most_samples

    def best(self, longest_s: float, tries: int = LAID_OUT) -> TimedFlight | None:
        """The best flight within `longest_s`, planned completely; None if no flight that was tried
        is possible.

        The best flight within a longer time is also the best within this time if it fits.  A flight
        that was found for a shorter time is never better than the result.
        """
        key = longest_s, tries
        if key not in self._found and not any(
            timed is not None and timed.time_s <= longest_s <= known_s and known_tries == tries
            for (known_s, known_tries), timed in self._found.items()
        ):
            self._found[key] = self._searched(longest_s, tries)
        best: TimedFlight | None = None
        for timed in self._found.values():
            if timed is None or timed.time_s > longest_s:
                continue
            if best is None or self._is_better(timed, best):
                best = timed
        return best

    def _searched(self, longest_s: float, tries: int) -> TimedFlight | None:
        best: TimedFlight | None = None
        for level in self.levels:
            if best is not None and not self._may_be_better(level, best):
                continue
            timed = level.best(longest_s, tries)
            if best is None or (timed is not None and self._is_better(timed, best)):
                best = timed
        return best

    def _may_be_better(self, level: AltitudeSearch, best: TimedFlight) -> bool:
        """Whether a lower altitude can have a better flight, because the flight takes less time
        there.
        """
        if self.request.optimize == "aperture":
            return True
        shape = best.candidate.shape
        return level.least(shape).least_s < best.candidate.least_s

    def _is_better(self, timed: TimedFlight, best: TimedFlight) -> bool:
        value, known = self.value(timed), self.value(best)
        if abs(value - known) <= NEARLY * abs(known):
            return timed.time_s < best.time_s
        return value > known

    def value(self, timed: TimedFlight) -> float:
        """The objective of a flight, with a sign such that larger values are better."""
        altitude_m = timed.candidate.way.altitude_m
        (level,) = (level for level in self.levels if level.altitude_m == altitude_m)
        return level.counted(timed)

    def probability(self, timed: TimedFlight) -> float:
        """Probability of detection of a flight; 1 if it is not the objective."""
        return self.value(timed) if self.request.optimize == "detection" else 1.0

    def longest_s(self) -> float:
        """The time of the request, or else the time from `enough_s`."""
        within = self.request.within
        return self.enough_s() if within is None else 60.0 * within

    def enough_s(self) -> float:
        """The time at which doubling the time improves the objective only slightly."""
        least = min(level.least_s for level in self.levels)
        if not math.isfinite(least):
            raise self.refusal(math.inf)
        before, longest_s = -math.inf, 1.05 * least
        for _ in range(20):
            timed = self.best(longest_s)
            now = -math.inf if timed is None else self.value(timed)
            if now > -math.inf and now - before <= GAIN * abs(now):
                break
            before, longest_s = now, 2.0 * longest_s
        return 0.5 * longest_s

    # --- Results ---

    def row(self, longest_s: float, timed: TimedFlight) -> WithinRow:
        """The row of results for the best flight within a given time."""
        return WithinRow(longest_s / 60.0, timed, self.value(timed))

    def point(self, longest_s: float, timed: TimedFlight | None) -> tuple[float, float] | None:
        """Time [s] and objective of the best flight within a given time; None if there is no
        flight, or if its search would take too long.
        """
        if timed is not None:
            return timed.time_s, self.value(timed)
        if self.levels[0].inputs.model == "measured":
            return None
        found = self.best(longest_s)
        return None if found is None else (found.time_s, self.value(found))

    def refusal(self, longest_s: float) -> InfeasibleError:
        """The error for a time within which no flight reaches the target."""
        target = self.levels[0].inputs.requirement.target
        for part in range(1, 13):
            later = self.best(longest_s * 2.0**part) if math.isfinite(longest_s) else None
            if later is not None:
                minutes = math.ceil(later.time_s / 60.0)
                return InfeasibleError(
                    f"no plan {'that reaches the target ' if target else ''}can be flown "
                    f"within {longest_s / 60.0:.4g} min, from take-off to landing",
                    f"--within {minutes} is enough",
                )
        message = "no plan satisfies the given options, however long the flight may take"
        reason = self.levels[0].reason
        if reason is not None:
            return InfeasibleError(f"{message}: {reason.message}", reason.hint)
        return InfeasibleError(
            message, "leave out some options, such as --grid, --baseline, --trigger or the target"
        )
