"""Splitting a path into flights, one per battery.

A flight starts and ends at the take-off point. The drone climbs to a height that is safe for the
transit, and flies horizontally to the first waypoint at the transit speed. From the last waypoint
it returns in the same way. The return flight is at a safe height too, whichever waypoint it starts
from. If the take-off point is not known, it is assumed to be below the first waypoint of the plan.
"""

from __future__ import annotations

import math
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import InfeasibleError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from aosplan.flight.kinematics import Timing
    from aosplan.flight.track import Track


class Flight(NamedTuple):
    """A flight: waypoints `first` to `last`, and the transits from and to the take-off point.

    `samples` is the number of photos.  Length and time are from take-off to landing.  During the
    transit to the first waypoint, the drone is `climb_m` above the take-off point.  During the
    transit back, it is `return_m` above the take-off point.  The height of the return is the same
    from every waypoint.
    """

    first: int
    last: int
    samples: int
    length_m: float
    time_s: float
    climb_m: float = 0.0
    return_m: float = 0.0


class TakeoffPoint(NamedTuple):
    """The take-off point: metres east, north and up, in the axes of the track.

    For each waypoint, `ways_up_m` has the height of the horizontal transit to it, and
    `returns_up_m` has the height of the transit back from it.  Both use the same zero as `up_m`.
    If they are None, the transit is at the height of the waypoint.
    """

    east_m: float
    north_m: float
    up_m: float
    ways_up_m: Sequence[float] | None = None
    returns_up_m: Sequence[float] | None = None

    def way_up_m(self, track: Track, place: int, *, back: bool = False) -> float:
        """Height of the horizontal part of the transit to a waypoint, or back from a waypoint."""
        ways = self.returns_up_m if back else self.ways_up_m
        return track.up_m[place] if ways is None else ways[place]

    def level_m(self, track: Track, place: int) -> float:
        """Horizontal distance between the take-off point and a waypoint."""
        return math.hypot(track.east_m[place] - self.east_m, track.north_m[place] - self.north_m)

    def way_m(self, track: Track, place: int, *, back: bool = False) -> float:
        """Length of the transit between the take-off point and a waypoint, including climb and
        descent.
        """
        level = self.level_m(track, place)
        up = self.way_up_m(track, place, back=back)
        return level + abs(up - self.up_m) + abs(up - track.up_m[place])

    def way_s(self, track: Track, place: int, timing: Timing, *, back: bool = False) -> float:
        """Time of the transit to a waypoint, or back from it. Because of wind, the two times may
        differ.
        """
        east, north = track.east_m[place] - self.east_m, track.north_m[place] - self.north_m
        sign, flown = -1.0 if back else 1.0, timing.transit
        up = self.way_up_m(track, place, back=back)
        vertical = flown.leg_s(0.0, 0.0, up - self.up_m) + flown.leg_s(
            0.0, 0.0, up - track.up_m[place]
        )
        return vertical + flown.leg_s(sign * east, sign * north)


class _Part(NamedTuple):
    """Waypoints that have to be in one flight: a site, or a line that the drone flies through."""

    first: int
    last: int


def _parts(track: Track, timing: Timing) -> Iterator[_Part]:
    if not timing.fly_through:
        yield from (_Part(place, place) for place, photo in enumerate(track.photo) if photo)
        return
    for start, stop in pairwise(track.stops(timing)):
        if any(track.photo[start : stop + 1]):
            yield _Part(start, stop)


def _shorter(
    track: Track, timing: Timing, home: TakeoffPoint, part: _Part, longest_s: float
) -> str:
    """Hint that tells how the flight to one part can be made short enough."""
    there = home.way_s(track, part.first, timing)
    ways = there + home.way_s(track, part.last, timing, back=True)
    level = max(home.level_m(track, part.first), home.level_m(track, part.last))
    hint = (
        f"{ways / 60.0:.3g} min of this time are for the path from the take-off and back (up "
        f"to {level:.0f} m each) at {timing.transit.speed_mps:.3g} m/s; take off nearer to the "
        "sites, or give a higher --transit-speed or a longer --flight-time"
    )
    if not timing.fly_through:
        return hint
    length = track.lengths_m[part.last] - track.lengths_m[part.first]
    left_m = (longest_s - ways) * timing.speed_mps - timing.speed_mps**2 / timing.acceleration_mps2
    shorter = f", lines of at most {left_m:.0f} m" if left_m > 0.0 else ""
    return (
        f"{hint}; the line of {length:.0f} m at {timing.speed_mps:.3g} m/s takes the rest of "
        f"the time; give a higher --speed, a shorter --photo-interval{shorter} (with a narrower "
        "--area or another --heading), or --trigger stop"
    )


def flights_of(
    track: Track, timing: Timing, home: TakeoffPoint, longest_s: float = math.inf
) -> tuple[Flight, ...]:
    """Split the waypoints into as few consecutive flights as possible, so that one battery is
    enough for each flight.

    The order of the sites does not change, and each site is in one flight.  Waypoints between the
    last site of a flight and the first site of the next flight are in neither of the two flights.

    Raises
    ------
    InfeasibleError
        If the flight to a single site, or to a line that is flown through, takes too long.
    """
    times, lengths = track.times_s(timing), track.lengths_m
    taken = [0, *accumulate(track.photo)]

    def flight(first: int, last: int) -> Flight:
        ways = [home.way_m(track, first), lengths[last] - lengths[first]]
        ways.append(home.way_m(track, last, back=True))
        there, back = home.way_s(track, first, timing), home.way_s(track, last, timing, back=True)
        time = there + left(last) - times[first] + back
        samples = taken[last + 1] - taken[first]
        climb, back_up = (
            home.way_up_m(track, first) - home.up_m,
            home.way_up_m(track, last, back=True) - home.up_m,
        )
        return Flight(first, last, samples, math.fsum(ways), time, climb, back_up)

    def left(place: int) -> float:
        holds = track.photo[place] and not timing.fly_through
        return times[place] + (timing.hold_s if holds else 0.0)

    whole = flight(0, len(track.photo) - 1)
    if whole.time_s <= longest_s:
        return (whole,)
    parts = list(_parts(track, timing))
    # Times at which a flight to a single part would start and end. Both are on the time axis of the
    # whole path.
    begun = [times[part.first] - home.way_s(track, part.first, timing) for part in parts]
    landed = [left(part.last) + home.way_s(track, part.last, timing, back=True) for part in parts]
    worst = max(range(len(parts)), key=lambda place: landed[place] - begun[place])
    if landed[worst] - begun[worst] > longest_s:
        what = "line" if timing.fly_through else "site"
        raise InfeasibleError(
            f"the flight to a single {what} (at waypoint {parts[worst].first}) and back "
            f"takes {(landed[worst] - begun[worst]) / 60.0:.4g} min, more than --flight-time "
            f"{longest_s / 60.0:.4g}",
            _shorter(track, timing, home, parts[worst], longest_s),
        )
    firsts = [0]
    for place in range(1, len(parts)):
        if landed[place] - begun[firsts[-1]] > longest_s:
            firsts.append(place)
    lasts = [*(first - 1 for first in firsts[1:]), len(parts) - 1]
    return tuple(
        flight(parts[first].first, parts[last].last)
        for first, last in zip(firsts, lasts, strict=True)
    )
