"""The path in a mission file: the points, the speeds, and the commands of the camera.

A mission has a waypoint for every photo. If photos are taken while flying, a file needs only the
ends of each line and the points at which its slope changes. The distance trigger is switched on at
the first photo of a line. It is switched off half a spacing after the last photo. A small error of
the position then neither drops the last photo nor adds another photo. If the transit is higher than
the first waypoint, the path starts vertically above this waypoint, because the drone climbs first.
If the transit back home is higher than the last waypoint, the path ends vertically above the last
waypoint.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from aosplan.mission.mission import LEAST_LEG_M, LEVEL_M, STRAIGHT, photo_lines, way_height_m

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from aosplan.mission.mission import Mission

BEND_M = 0.1
"""A point of a line is left out if its height differs by less than this from the straight line
between the remaining points.
"""


class PathPoint(NamedTuple):
    """One point of the path in a mission file.

    - `speed_mps`: speed from this point on
    - `stop`: whether the drone stops here; otherwise it flies through
    - `photo`: whether a photo is taken here
    - `switch`: whether the distance trigger is switched on here (True), switched off (False), or
      not changed (None)
    - `height_m`: above the take-off point if `above_takeoff`, otherwise in the mission's altitude
      frame
    """

    east_m: float
    north_m: float
    latitude: float
    longitude: float
    height_m: float
    speed_mps: float
    stop: bool = True
    photo: bool = False
    switch: bool | None = None
    above_takeoff: bool = False


def flown_path(mission: Mission) -> list[PathPoint]:
    """The points of the path in a mission's file.

    The path may include a point vertically above the first waypoint, and one above the last.
    """
    points = list(_stops(mission) if mission.settings.trigger == "stop" else _lines(mission))
    points = _without_short_legs(points)
    above = mission.above_takeoff_m()
    transit, climb_m, return_m = mission.transit_mps, mission.climb_m(), mission.return_m()
    climb_m, return_m = way_height_m(above[0], climb_m), way_height_m(above[-1], return_m)
    if climb_m > above[0]:
        points.insert(0, _above(points[0], climb_m, transit))
    if return_m > above[-1]:
        points[-1] = points[-1]._replace(speed_mps=transit)
        points.append(_above(points[-1], return_m, transit))
    return points


def path_size(mission: Mission) -> int:
    """The number of points of a mission's file."""
    return len(flown_path(mission))


def _without_short_legs(points: Sequence[PathPoint]) -> list[PathPoint]:
    """Remove points that have no command and are too close to a neighbour."""
    kept: list[PathPoint] = []
    for point in points:
        idle = not point.photo and point.switch is None
        if kept and math.dist(_place(kept[-1]), _place(point)) < LEAST_LEG_M:
            last = kept[-1]
            if idle:
                kept[-1] = last._replace(speed_mps=point.speed_mps)
                continue
            if not last.photo and last.switch is None:
                kept.pop()
        kept.append(point)
    return kept


def _place(point: PathPoint) -> tuple[float, float, float]:
    return point.east_m, point.north_m, point.height_m


def _above(point: PathPoint, height_m: float, speed_mps: float) -> PathPoint:
    """The point vertically above a given point. The horizontal part of the transit to the first
    waypoint ends at such a point, and the transit home starts at such a point.
    """
    east, north, latitude, longitude = point[:4]
    return PathPoint(east, north, latitude, longitude, height_m, speed_mps, above_takeoff=True)


def _points(mission: Mission) -> Iterator[PathPoint]:
    ways, speed = mission.waypoints, mission.settings.speed_mps
    # Formats for autopilots require a location, so it is not None.
    assert ways.latitude is not None
    assert ways.longitude is not None
    columns = (ways.east_m, ways.north_m, ways.latitude, ways.longitude, mission.flown_m())
    for place in zip(*columns, strict=True):
        yield PathPoint(*place, speed)


def _stops(mission: Mission) -> Iterator[PathPoint]:
    photo = mission.waypoints.photo or [True] * len(mission.waypoints)
    for point, taken in zip(_points(mission), photo, strict=True):
        yield point._replace(photo=taken)


def line_ends(mission: Mission) -> list[int]:
    """Indices of the waypoints at which the course turns, including the first and the last."""
    ways = mission.waypoints
    places = list(zip(ways.east_m, ways.north_m, strict=True))
    courses = [_course(one, other) for one, other in pairwise(places)]
    turns = (
        index
        for index, (one, other) in enumerate(pairwise(courses), 1)
        if one is None or other is None or math.dist(one, other) >= STRAIGHT
    )
    return [0, *turns, *([len(places) - 1] if len(places) > 1 else [])]


def _course(start: tuple[float, float], stop: tuple[float, float]) -> tuple[float, float] | None:
    length = math.dist(start, stop)
    return ((stop[0] - start[0]) / length, (stop[1] - start[1]) / length) if length else None


def _lines(mission: Mission) -> Iterator[PathPoint]:
    """Points of lines on which photos are taken while flying: the ends of the lines, the points at
    which the slope changes, and the points at which the trigger is switched.
    """
    points, spacing = list(_points(mission)), mission.settings.spacing_m
    photo = mission.waypoints.photo or [True] * len(points)
    ends, lines = line_ends(mission), photo_lines(mission)
    on = {first for first, last in lines if last > first}
    off = {last for first, last in lines if last > first}
    lone = {first for first, last in lines if last == first}
    kept = {*ends, *on, *lone}
    # Even if the heights of the file are above the ground, a drone may fly on a straight line
    # between two points, as Litchi does. The bends are therefore found from the height above the
    # take-off point.
    above = mission.above_takeoff_m()
    profile = [point._replace(height_m=up) for point, up in zip(points, above, strict=True)]
    for first, last in pairwise(ends):
        heights = above[first : last + 1]
        if max(heights) - min(heights) > LEVEL_M:
            # Between points of the file, the height changes linearly. The points that are kept for
            # other reasons therefore divide the line into parts.
            fixed = {first, last, *(kept | off) & set(range(first, last))}
            kept |= fixed
            for start, stop in pairwise(sorted(fixed)):
                kept |= {start + place for place in _bends(profile[start : stop + 1])}
        if not any(photo[first : last + 1]):
            points[first] = points[first]._replace(speed_mps=mission.transit_mps)
    stops = set(ends)
    for place, point in enumerate(points):
        near = place in stops and place - 1 in off and _is_off(points, place, spacing)
        if place in kept:
            beyond = place in off and place in stops
            switch = True if place in on else False if near else None
            stop = place in stops and not beyond
            yield point._replace(stop=stop, photo=place in lone, switch=switch)
        if place in off and not (place + 1 in stops and _is_off(points, place + 1, spacing)):
            yield _after(points, place, spacing, end=place in stops, near=place + 1 in stops)


def _is_off(points: Sequence[PathPoint], place: int, spacing_m: float) -> bool:
    """Whether the trigger is switched off at the end of the line itself, because this end is close
    to the last photo.
    """
    return _apart(points[place - 1], points[place]) <= 0.9 * spacing_m


def _after(
    points: Sequence[PathPoint], place: int, spacing_m: float, *, end: bool, near: bool
) -> PathPoint:
    """The point half a spacing after the last photo of a line.  It is on the line or beyond the end
    of the line.
    """
    point, other = points[place], points[place - 1 if end else place + 1]
    length, off_m = _apart(point, other), 0.5 * spacing_m
    if off_m < LEAST_LEG_M:
        off_m = min(1.1 * LEAST_LEG_M, 0.95 * spacing_m)
    if near and length - off_m < LEAST_LEG_M:
        off_m = 0.5 * length
    share = -off_m / length if end else off_m / length
    turn = (other.longitude - point.longitude + 180.0) % 360.0 - 180.0
    return point._replace(
        east_m=point.east_m + share * (other.east_m - point.east_m),
        north_m=point.north_m + share * (other.north_m - point.north_m),
        latitude=max(-90.0, min(90.0, point.latitude + share * (other.latitude - point.latitude))),
        longitude=(point.longitude + share * turn + 180.0) % 360.0 - 180.0,
        height_m=point.height_m + share * (other.height_m - point.height_m),
        stop=end,
        photo=False,
        switch=False,
    )


def _apart(one: PathPoint, other: PathPoint) -> float:
    return math.hypot(one.east_m - other.east_m, one.north_m - other.north_m)


def _bends(line: Sequence[PathPoint]) -> Iterator[int]:
    """Indices of the points at which the slope of a line changes, by the algorithm of Douglas and
    Peucker (1973).
    """
    along = [_apart(line[0], point) for point in line]
    waiting = [(0, len(line) - 1)]
    while waiting:
        start, stop = waiting.pop()
        if stop - start < 2 or along[stop] == along[start]:
            continue
        slope = (line[stop].height_m - line[start].height_m) / (along[stop] - along[start])
        miss = [
            abs(line[start].height_m + slope * (along[k] - along[start]) - line[k].height_m)
            for k in range(start + 1, stop)
        ]
        worst = max(range(len(miss)), key=miss.__getitem__)
        if miss[worst] > BEND_M:
            yield start + 1 + worst
            waiting += [(start, start + 1 + worst), (start + 1 + worst, stop)]
