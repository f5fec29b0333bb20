"""Flights: what one battery reaches, each from the take-off and back to it.

A flight climbs to the height of its first waypoint, flies there on the level, and comes back from
its last one the same way.  Where the take-off is not known it is taken to lie below the first
waypoint of the plan.
"""

from __future__ import annotations

import math
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import InfeasibleError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.flight import Timing, Track


class Flight(NamedTuple):
    """Waypoints of one battery, from `first` to `last`, and the way there and back.

    `samples` photos are taken.  Length and time count from the take-off to the landing.
    """

    first: int
    last: int
    samples: int
    length_m: float
    time_s: float


class Home(NamedTuple):
    """The take-off: metres east, north and up, in the axes of the track."""

    east_m: float
    north_m: float
    up_m: float

    def way_m(self, track: Track, place: int) -> tuple[float, float]:
        """Level and vertical length of the way between the take-off and a waypoint."""
        level = math.hypot(track.east_m[place] - self.east_m, track.north_m[place] - self.north_m)
        return level, abs(track.up_m[place] - self.up_m)

    def way_s(self, track: Track, place: int, timing: Timing, *, back: bool = False) -> float:
        """Time of that way, there or back: it matters to the wind."""
        east, north = track.east_m[place] - self.east_m, track.north_m[place] - self.north_m
        sign = -1.0 if back else 1.0
        climb = timing.leg_s(0.0, 0.0, track.up_m[place] - self.up_m)
        return climb + timing.leg_s(sign * east, sign * north)


class _Part(NamedTuple):
    """Waypoints that one flight takes together: a site, or a line that is flown through."""

    first: int
    last: int


def _parts(track: Track, timing: Timing) -> Iterator[_Part]:
    if not timing.fly_through:
        yield from (_Part(place, place) for place, photo in enumerate(track.photo) if photo)
        return
    for start, stop in pairwise(track.stops(timing)):
        if any(track.photo[start : stop + 1]):
            yield _Part(start, stop)


def flights_of(
    track: Track, timing: Timing, home: Home, longest_s: float = math.inf
) -> tuple[Flight, ...]:
    """The fewest flights, taken in order, of which none is longer than a battery lasts.

    Sites stay in order, and each belongs to one flight; waypoints between the last site of a
    flight and the first of the next belong to none.

    Raises
    ------
    InfeasibleError
        Where one site, or one line that is flown through, takes longer than that.
    """
    times, lengths = track.times_s(timing), track.lengths_m()
    taken = [0, *accumulate(track.photo)]

    def flight(first: int, last: int) -> Flight:
        there, back = home.way_m(track, first), home.way_m(track, last)
        hold = timing.hold_s if track.photo[last] and not timing.fly_through else 0.0
        ways = home.way_s(track, first, timing) + home.way_s(track, last, timing, back=True)
        return Flight(
            first,
            last,
            taken[last + 1] - taken[first],
            math.fsum([*there, lengths[last] - lengths[first], *back]),
            ways + times[last] - times[first] + hold,
        )

    whole = flight(0, len(track.photo) - 1)
    if whole.time_s <= longest_s:
        return (whole,)
    parts = list(_parts(track, timing))
    alone = [flight(*part) for part in parts]
    worst = max(alone, key=lambda single: single.time_s)
    if worst.time_s > longest_s:
        what = "line" if timing.fly_through else "site"
        raise InfeasibleError(
            f"to fly to one {what}, at waypoint {worst.first}, and back takes "
            f"{worst.time_s / 60.0:.4g} min, more than --flight-time {longest_s / 60.0:.4g}",
            "take off nearer, fly faster, or use a battery that lasts longer"
            + (", or --trigger stop" if timing.fly_through else ""),
        )
    flights = [alone[0]]
    for part, single in zip(parts[1:], alone[1:], strict=True):
        longer = flight(flights[-1].first, part.last)
        if longer.time_s > longest_s:
            flights.append(single)
        else:
            flights[-1] = longer
    return tuple(flights)
