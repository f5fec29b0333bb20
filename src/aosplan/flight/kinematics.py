"""Flight time along straight legs, with limited speed, climb rate and acceleration.

Between two stops, the speed as a function of time is a trapezoid, or a triangle if the leg is
short. If the drone stops at every site, the speed has this shape on each leg. A drone that flies
through its sites stops only at turns. It accelerates over `Timing.run_in_m`, passes the sites at a
constant speed, and decelerates over the same length.

An autopilot keeps the required ground speed, unless the airspeed would exceed its maximum.  In this
case, wind reduces the ground speed.
"""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import InfeasibleError
from aosplan.numerics import SCALARS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from aosplan.grid.patterns import AnyPattern

STRAIGHT = 1e-6
"""Sine of the smallest angle that counts as a turn."""


SLOWEST_MPS = 1e-9
"""Lower limit of the speed.  Without it, photos at the same place would give a speed of 0."""


def stop_to_stop_s(length_m: Any, speed_mps: Any, acceleration_mps2: Any, xp: Any = SCALARS) -> Any:
    """Time from stop to stop. As a function of time, the speed is a trapezoid, or a triangle if the
    leg is short.

    The arguments are floats, or arrays if `xp` is numpy.
    """
    trapezoid = length_m / speed_mps + speed_mps / acceleration_mps2
    short = length_m < speed_mps**2 / acceleration_mps2
    return xp.where(short, 2.0 * xp.sqrt(length_m / acceleration_mps2), trapezoid)


def passing_s(
    distance_m: float, length_m: float, speed_mps: float, acceleration_mps2: float
) -> float:
    """Time from the start of a line until the drone has flown a distance.  The drone starts at
    rest.
    """
    left = length_m - distance_m
    # The drone decelerates. A deceleration takes the same time as the corresponding acceleration.
    if left < distance_m:
        whole: float = stop_to_stop_s(length_m, speed_mps, acceleration_mps2)
        return whole - passing_s(left, length_m, speed_mps, acceleration_mps2)
    ramp = 0.5 * speed_mps**2 / acceleration_mps2
    if distance_m <= ramp:
        return math.sqrt(2.0 * max(distance_m, 0.0) / acceleration_mps2)
    return speed_mps / acceleration_mps2 + (distance_m - ramp) / speed_mps


def wind_mps(speed_mps: float, from_deg: float, heading_deg: float = 0.0) -> tuple[float, float]:
    """Components of the wind velocity along a heading and to its right [m/s].

    `from_deg` is the direction that the wind comes from, clockwise from true north.
    """
    angle = math.radians(math.fmod(from_deg - heading_deg, 360.0))
    return -speed_mps * math.cos(angle) + 0.0, -speed_mps * math.sin(angle) + 0.0


class Timing(NamedTuple):
    """Settings that determine the flight time between photos.

    - `wind`: velocity of the air in the axes of the path
    - `airspeed_mps`: highest airspeed
    - `climb_mps`: highest climb rate and descent rate
    - `interval_s`: shortest time between photos while flying. The speed is at most the baseline
      divided by `interval_s`
    - `least_run_in_m`: shortest run-in
    - `transit_mps`: speed to, from and between lines that are flown through. If it is None, it
      equals the speed along these lines
    """

    speed_mps: float = 5.0
    acceleration_mps2: float = 2.0
    hold_s: float = 1.0
    climb_mps: float = 3.0
    fly_through: bool = False
    interval_s: float = 0.0
    wind: tuple[float, float] = (0.0, 0.0)
    airspeed_mps: float = math.inf
    least_run_in_m: float = 0.0
    transit_mps: float | None = None

    @property
    def transit(self) -> Timing:
        """The settings for parts of the flight without photos."""
        if self.transit_mps is None:
            return self
        return self._replace(speed_mps=self.transit_mps, interval_s=0.0)

    @property
    def run_in_m(self) -> float:
        """Length of the run-in, on which the drone accelerates before a line; 0 if the drone stops
        at every site.
        """
        ramp = 0.5 * self.speed_mps**2 / self.acceleration_mps2
        return max(ramp, self.least_run_in_m) if self.fly_through else 0.0

    def at(self, baseline_m: float) -> Timing:
        """The same settings, with a lower speed if photos would otherwise be taken at intervals
        shorter than `interval_s`.
        """
        if not (self.fly_through and self.interval_s):
            return self
        paced = max(baseline_m / self.interval_s, SLOWEST_MPS)
        return self._replace(speed_mps=min(self.speed_mps, paced), interval_s=0.0)

    def ground_speed_mps(self, x: float, y: float) -> float:
        """Ground speed in a direction that is given as a unit vector.

        With the ground speed g in the direction u and the wind w, the airspeed |g u - w| is at most
        A.  The greatest ground speed is therefore g = u·w + √(A² - (u x w)²).

        Raises
        ------
        InfeasibleError
            If the wind is faster than the highest airspeed.
        """
        along, across = x * self.wind[0] + y * self.wind[1], x * self.wind[1] - y * self.wind[0]
        left = self.airspeed_mps**2 - across**2
        fastest = along + math.sqrt(left) if left > 0.0 else 0.0
        if fastest <= 0.0 or math.hypot(*self.wind) >= self.airspeed_mps:
            raise InfeasibleError(
                f"wind of {math.hypot(*self.wind):.4g} m/s is too strong for a drone with "
                f"an airspeed of {self.airspeed_mps:.4g} m/s",
                "wait for less wind, or give the --airspeed that the drone can reach",
            )
        return min(self.speed_mps, fastest)

    def leg_speed_mps(self, x_m: float, y_m: float, up_m: float) -> float:
        """Speed along a straight leg.  Its horizontal and vertical components both stay within
        their limits.
        """
        level = math.hypot(x_m, y_m)
        length = math.hypot(level, up_m)
        speed = math.inf
        if level:
            speed = self.speed_mps
            if self.wind != (0.0, 0.0):
                speed = self.ground_speed_mps(x_m / level, y_m / level)
            speed *= length / level
        return min(speed, self.climb_mps * length / abs(up_m)) if up_m else speed

    def leg_s(self, x_m: float, y_m: float = 0.0, up_m: float = 0.0) -> float:
        """Time of a straight leg between two stops."""
        length = math.hypot(x_m, y_m, up_m)
        if not length:
            return 0.0
        speed = self.leg_speed_mps(x_m, y_m, up_m)
        return float(stop_to_stop_s(length, speed, self.acceleration_mps2))


class SpeedBound(NamedTuple):
    """An upper limit of the speed, and the reason."""

    speed_mps: float
    message: str


def lowest_bound(wanted_mps: float, bounds: Sequence[SpeedBound]) -> SpeedBound | None:
    """The limit with the lowest speed, or the first of several equal limits. It is None if the
    requested speed is lower than all limits.
    """
    slowest = min(bounds, key=lambda bound: bound.speed_mps, default=None)
    return slowest if slowest is not None and slowest.speed_mps < wanted_mps else None


class Leg(NamedTuple):
    """A leg between lines, and how much the run-out and the run-in at its ends shorten it. Along
    each axis, the length is in baselines and the shortening is in run-ins.
    """

    x: float
    y: float = 0.0
    run_x: float = 0.0
    run_y: float = 0.0


class Path(NamedTuple):
    """A flight over a pattern: the different legs and the different lines that are flown through,
    each with its number of occurrences.

    Lengths are in baselines, in the axes of the pattern.  `courses` are the directions, as unit
    vectors, in which the drone flies while it takes photos.
    """

    legs: tuple[tuple[Leg, int], ...]
    samples: int
    lines: tuple[tuple[float, int], ...] = ()
    courses: tuple[tuple[float, float], ...] = ()

    @classmethod
    def shortest(cls, samples: int, timing: Timing) -> Path:
        """The path along one straight line. Without wind, no pattern with the same number of
        samples takes less time.
        """
        if timing.fly_through:
            return cls((), samples, ((samples - 1.0, 1),))
        return cls(((Leg(1.0), samples - 1),), samples)

    def _legs_m(self, baseline_m: float, run_in_m: float) -> Iterator[tuple[float, float, int]]:
        for (x, y, run_x, run_y), count in self.legs:
            yield x * baseline_m - run_x * run_in_m, y * baseline_m - run_y * run_in_m, count

    def length_m(self, baseline_m: float, timing: Timing | None = None) -> float:
        """Length of the path from the first site to the last."""
        run = (timing or Timing()).at(baseline_m).run_in_m
        turns = sum(count for _, count in self.legs) if run else 0
        legs = (math.hypot(x, y) * count for x, y, count in self._legs_m(baseline_m, run))
        lines = (length * baseline_m * count for length, count in self.lines)
        return math.fsum([*legs, *lines, 2.0 * turns * run])

    def time_s(self, baseline_m: float, timing: Timing) -> float:
        """Time from the first site to the last. It includes the hold at each site, unless sites are
        flown through.
        """
        flown = steady(timing.at(baseline_m), self.courses)
        run = flown.run_in_m
        between = flown.transit if timing.fly_through else flown
        legs = [between.leg_s(x, y) * count for x, y, count in self._legs_m(baseline_m, run)]
        if not timing.fly_through:
            return self.samples * flown.hold_s + math.fsum(legs)
        turns = sum(count for _, count in self.legs)
        # An acceleration from rest to the speed v takes v/2a longer than a flight over the same
        # distance at the speed v.
        ramp = run / flown.speed_mps + 0.5 * flown.speed_mps / flown.acceleration_mps2
        lines = (length * baseline_m / flown.speed_mps * count for length, count in self.lines)
        return math.fsum([*legs, *lines, 2.0 * turns * ramp])


def steady(timing: Timing, courses: Sequence[tuple[float, float]]) -> Timing:
    """The same settings with one speed for all courses: the highest speed that the drone can reach
    on every course in the wind.
    """
    if not (timing.fly_through and courses) or timing.wind == (0.0, 0.0):
        return timing
    return timing._replace(speed_mps=min(timing.ground_speed_mps(*course) for course in courses))


def path_of(pattern: AnyPattern, timing: Timing | None = None) -> Path:
    """The path of a flight over a pattern: the legs, and the lines if sites are flown through."""
    timing = timing or Timing()
    if timing.fly_through:
        return _flown_through(list(pattern.offsets()))
    # Without wind, the time depends only on the length of a leg.
    calm = timing.wind == (0.0, 0.0)
    legs: Counter[Leg] = Counter()
    for (x, y), count in pattern.steps().items():
        legs[Leg(math.hypot(x, y)) if calm else Leg(x, y)] += count
    return Path(tuple(sorted(legs.items())), pattern.samples)


def _flown_through(sites: list[tuple[float, float]]) -> Path:
    lines = list(lines_of(sites, 1.0))
    lengths: Counter[float] = Counter()
    legs: Counter[Leg] = Counter()
    for line in lines:
        (x, y), (to_x, to_y) = sites[line.first], sites[line.last]
        lengths[math.hypot(to_x - x, to_y - y)] += 1
    for line, following in pairwise(lines):
        (x, y), (to_x, to_y) = sites[line.last], sites[following.first]
        run_x, run_y = line.x + following.x, line.y + following.y
        legs[Leg(to_x - x, to_y - y, run_x, run_y)] += 1
    return Path(
        tuple(sorted(legs.items())),
        len(sites),
        tuple(sorted(lengths.items())),
        tuple(sorted({(line.x, line.y) for line in lines})),
    )


class FlownLine(NamedTuple):
    """Sites that are flown through on one course: indices of the first and the last site, and the
    course.

    The course is a unit vector in the axes of the sites.
    """

    first: int
    last: int
    x: float
    y: float


def lines_of(
    sites: Sequence[tuple[float, float]], spacing: float, along: tuple[float, float] = (1.0, 0.0)
) -> Iterator[FlownLine]:
    """Lines of sites along the heading, in flight order.

    The distances between the sites of a line are whole numbers of spacings. A distance trigger
    therefore takes a photo at every site. `along` is the heading as a unit vector. Lines run along
    this heading or opposite to it. A single site is flown through along the heading.
    """
    first = 0
    while first < len(sites):
        last, course = first, None
        while last + 1 < len(sites):
            x, y = (to - at for to, at in zip(sites[last + 1], sites[last], strict=True))
            steps = math.hypot(x, y) / spacing if spacing else 0.0
            if round(steps) < 1 or abs(steps - round(steps)) > STRAIGHT * steps:
                break
            forth = x * along[0] + y * along[1] > 0.0
            way = along if forth else (0.0 - along[0], 0.0 - along[1])
            length = math.hypot(x, y)
            if course not in (None, way) or not same_course(way, (x / length, y / length)):
                break
            last, course = last + 1, way
        yield FlownLine(first, last, *(course or along))
        first = last + 1


def same_course(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Whether two unit vectors have the same direction."""
    across = one[0] * other[1] - one[1] * other[0]
    return abs(across) < STRAIGHT and one[0] * other[0] + one[1] * other[1] > 0.0
