"""Tracks: the points of a flight and the time at which the drone reaches each of them.

If photos are taken while flying, the drone accelerates before the first site of a line.  The
distance is v² / 2a for the speed v and the acceleration a, but at least one metre.  After the last
site, the drone decelerates over the same distance.  All photos are therefore taken at constant
speed.  The drone stops at both ends of a line and then flies to the next line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, groupby, pairwise, starmap
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple

from aosplan.flight.kinematics import lines_of, passing_s, same_course
from aosplan.numerics import heading_axis

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from aosplan.flight.kinematics import Timing


class FlightPoints(NamedTuple):
    """Points in flight order: metres east and north, and whether a photo is taken at each point."""

    east_m: list[float]
    north_m: list[float]
    photo: list[bool]


class Ground(NamedTuple):
    """Points with the height of the ground below them [m], and deviations of the ground between the
    points.

    On a straight leg, the drone is up to `closer_by_m` closer to the ground than at the two ends of
    the leg, and up to `farther_by_m` farther away.
    """

    sites: FlightPoints
    heights_m: list[float]
    closer_by_m: float = 0.0
    farther_by_m: float = 0.0


@dataclass(frozen=True)
class Track:
    """Points of a flight in order: metres east, north and up, and whether a photo is taken at each
    point.

    If sites are not flown through, the drone stops at every point and holds at points with a photo.
    """

    east_m: Sequence[float]
    north_m: Sequence[float]
    up_m: Sequence[float]
    photo: Sequence[bool]

    @cached_property
    def legs(self) -> list[tuple[float, float, float]]:
        """Vectors from point to point."""
        points = zip(self.east_m, self.north_m, self.up_m, strict=True)
        return [(b[0] - a[0], b[1] - a[1], b[2] - a[2]) for a, b in pairwise(points)]

    @cached_property
    def lengths_m(self) -> list[float]:
        """Length of the path from the first point to each point."""
        return list(accumulate(starmap(math.hypot, self.legs), initial=0.0))

    def stops(self, timing: Timing) -> list[int]:
        """Points at which the drone stops: all points, or only the turns if sites are flown
        through.
        """
        count = len(self.east_m)
        if not timing.fly_through or count < 2:
            return list(range(count))
        courses = [_course(leg) for leg in self.legs]
        turns = (
            place
            for place, (one, other) in enumerate(pairwise(courses), 1)
            if one is None or other is None or not same_course(one, other)
        )
        return [0, *turns, count - 1]

    def times_s(self, timing: Timing) -> list[float]:
        """Time at which the drone reaches each point.

        The drone starts at rest at the first point. The hold at a point is not part of the time at
        which the point is reached. If sites are flown through, a whole line is flown at the speed
        that its steepest leg allows. Lines without photos are flown at the transit speed.
        """
        if not timing.fly_through:
            # A grid has many legs, but few different legs, so the time of each different leg is
            # computed once.
            known = {leg: timing.leg_s(*leg) for leg in set(self.legs)}
            holds = (timing.hold_s if photo else 0.0 for photo in self.photo)
            legs = (held + known[leg] for held, leg in zip(holds, self.legs, strict=False))
            return list(accumulate(legs, initial=0.0))
        times = [0.0]
        for start, stop in pairwise(self.stops(timing)):
            line = self.legs[start:stop]
            reached = list(accumulate(starmap(math.hypot, line)))
            flown = timing if any(self.photo[start : stop + 1]) else timing.transit
            speed = min(starmap(flown.leg_speed_mps, line))
            begun, length = times[-1], reached[-1]
            times += [
                begun + passing_s(distance, length, speed, timing.acceleration_mps2)
                if length
                else begun
                for distance in reached
            ]
        return times


def _course(leg: tuple[float, float, float]) -> tuple[float, float] | None:
    """Horizontal direction of a leg; None if the leg is vertical."""
    level = math.hypot(leg[0], leg[1])
    return (leg[0] / level, leg[1] / level) if level else None


def with_turns(
    sites: FlightPoints, *, spacing_m: float, run_in_m: float, heading_deg: float
) -> FlightPoints:
    """Sites with the turning points before and after each line.

    Points without a photo remain at their positions between the lines.
    """
    along = heading_axis(heading_deg)

    def line(points: list[tuple[float, float]]) -> Iterator[tuple[float, float, bool]]:
        for first, last, x, y in lines_of(points, spacing_m, along):
            east, north = points[first]
            yield east - x * run_in_m + 0.0, north - y * run_in_m + 0.0, False
            yield from ((*point, True) for point in points[first : last + 1])
            east, north = points[last]
            yield east + x * run_in_m + 0.0, north + y * run_in_m + 0.0, False

    found: list[tuple[float, float, bool]] = []
    for photo, group in groupby(zip(*sites, strict=True), key=itemgetter(2)):
        points = list(group)
        found += line([point[:2] for point in points]) if photo else points
    return FlightPoints(*map(list, zip(*found, strict=True)))
