"""Photos in passing: how fast a drone may fly through its sites, and where it turns.

Three things bound the speed besides the wish: motion blur (the ground moves v t / GSD pixels
during an exposure of t), the camera (no two photos within its shortest interval, so v <= b / T),
and the drone.  Before the first site of a line the drone runs in over v² / 2a and at least a
metre, after the last it runs out over as much, so that every photo is taken at steady speed; it stops at both ends, and
the way from the one to the next is flown from stop to stop.
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
"""How photos are taken: standing still, or each so many metres."""


class Bound(NamedTuple):
    """A bound on the speed, and why."""

    speed_mps: float
    message: str


def blur_speed_mps(gsd_m: float, blur_px: float, exposure_s: float) -> float:
    """Speed at which the ground moves so many pixels during an exposure."""
    return blur_px * gsd_m / exposure_s


def ruling(wanted_mps: float, bounds: Sequence[Bound]) -> Bound | None:
    """The bound that leaves the least speed, the first of equals; None where the wish is slower."""
    slowest = min(bounds, key=lambda bound: bound.speed_mps, default=None)
    return slowest if slowest is not None and slowest.speed_mps < wanted_mps else None


class Sites(NamedTuple):
    """Points in flight order, east and north [m], and at which of them a photo is taken."""

    east_m: list[float]
    north_m: list[float]
    photo: list[bool]


class Ground(NamedTuple):
    """Points with the height of the ground below [m], and how far the ways between them miss it.

    A straight way comes up to `closer_by_m` nearer to the ground than its ends, and up to `farther_by_m`
    farther away.
    """

    sites: Sites
    heights_m: list[float]
    closer_by_m: float = 0.0
    farther_by_m: float = 0.0


def with_turns(sites: Sites, *, spacing_m: float, run_in_m: float, heading_deg: float) -> Sites:
    """Sites with the points before and after each line at which the drone turns.

    Points without a photo stay where they are, between lines.
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
