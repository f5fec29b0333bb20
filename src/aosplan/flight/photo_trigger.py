"""Photos in passing: the highest speed, and the points where the drone turns.

Three limits apply in addition to the wanted speed: motion blur (the ground moves by v t / GSD
pixels during an exposure time t), the camera (consecutive photos are at least its shortest interval
T apart, so v <= b / T), and the drone.  Before the first site of a line the drone accelerates over
v² / 2a, but at least one metre; after the last site it decelerates over the same distance.  All
photos are therefore taken at constant speed.  The drone stops at both ends and flies from one line
to the next from stop to stop.
"""

from __future__ import annotations

from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple

from aosplan.flight.kinematics import lines_of
from aosplan.numerics import heading_axis

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

TRIGGERS = ("stop", "distance")
"""How photos are taken: at a stop, or by distance in passing."""


class SpeedBound(NamedTuple):
    """An upper limit of the speed, and the reason."""

    speed_mps: float
    message: str


def blur_speed_mps(gsd_m: float, blur_px: float, exposure_s: float) -> float:
    """Speed at which the ground moves by `blur_px` pixels during an exposure."""
    return blur_px * gsd_m / exposure_s


def lowest_bound(wanted_mps: float, bounds: Sequence[SpeedBound]) -> SpeedBound | None:
    """The limit with the lowest speed; None if the wanted speed is lower. Of equals, the first."""
    slowest = min(bounds, key=lambda bound: bound.speed_mps, default=None)
    return slowest if slowest is not None and slowest.speed_mps < wanted_mps else None


class Sites(NamedTuple):
    """Points in flight order, east and north [m], and for each point whether a photo is taken."""

    east_m: list[float]
    north_m: list[float]
    photo: list[bool]


class Ground(NamedTuple):
    """Points with the height of the ground below [m], and deviations of the ground between them.

    On a straight leg, the drone is up to `closer_by_m` closer to the ground than at the two ends of
    the leg, and up to `farther_by_m` farther away.
    """

    sites: Sites
    heights_m: list[float]
    closer_by_m: float = 0.0
    farther_by_m: float = 0.0


def with_turns(sites: Sites, *, spacing_m: float, run_in_m: float, heading_deg: float) -> Sites:
    """Sites with the turning points before and after each line.

    Points without a photo keep their place between the lines.
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
    return Sites(*map(list, zip(*found, strict=True)))
