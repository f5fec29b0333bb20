"""Simulation of an ideal flight of a mission file: its path and its photos.

The readers and the flight follow the rules of the formats and share no code with the package.
Positions are in metres east and north of a given origin.  Heights are in metres above the take-off
point.
"""

import csv
import io
import json
import math
import zipfile
from itertools import pairwise
from typing import NamedTuple
from xml.etree import ElementTree as ET

KML = "{http://www.opengis.net/kml/2.2}"
WPML = "{*}"
"""Pattern for elements in any namespace, because DJI and Autel have different namespaces."""


class Point(NamedTuple):
    """A point of a file, with the actions at this point."""

    x: float
    y: float
    up: float
    speed: float
    """Speed from this point on."""
    hold: float = 0.0
    stop: bool = False
    photos: int = 0
    spacing: float | None = None
    """Spacing of the distance trigger from this point on. 0 switches the trigger off, and None does
    not change it.
    """


class Flown(NamedTuple):
    """The flight of a mission file: points from take-off to landing, and positions of the
    photos.
    """

    points: list
    photos: list


class Ground:
    """Conversion of positions to local metres, and of heights above the ground to heights above the
    take-off point.
    """

    def __init__(self, origin, height=lambda _lat, _lon: 0.0):
        self.origin, self.height = origin, height
        sine = math.sin(math.radians(origin[0]))
        a, e2 = 6378137.0, 0.00669437999014
        bend = 1.0 - e2 * sine * sine
        self.north = math.radians(1.0) * a * (1.0 - e2) / bend**1.5
        self.east = math.radians(1.0) * a / math.sqrt(bend) * math.cos(math.radians(origin[0]))

    def place(self, latitude, longitude):
        turn = (longitude - self.origin[1] + 180.0) % 360.0 - 180.0
        return turn * self.east, (latitude - self.origin[0]) * self.north

    def back(self, x, y):
        return self.origin[0] + y / self.north, self.origin[1] + x / self.east


def mavlink_items(name, content):
    """Items of a `.waypoints` or `.plan` file without the home position: command, frame, and seven
    parameters.
    """
    if name == "waypoints":
        first, *lines = content.decode().splitlines()
        assert first == "QGC WPL 110"
        rows = [[float(field) for field in line.split("\t")] for line in lines]
        home = rows[0][8:11]
        return home, [(int(row[3]), int(row[2]), row[4:11]) for row in rows[1:]]
    plan = json.loads(content)["mission"]
    items = [(i["command"], i["frame"], i["params"]) for i in plan["items"]]
    return plan["plannedHomePosition"], items


def fly_mavlink(name, content, ground):
    """Fly a MAVLink file.  Commands after a waypoint are executed when the hold of the waypoint
    ends.
    """
    home, items = mavlink_items(name, content)
    assert items[0][0] == 22
    x, y = ground.place(*home[:2])
    climb = items[0][2][6]
    points = [Point(x, y, 0.0, 0.0, stop=True), Point(x, y, climb, 0.0, stop=True)]
    for command, frame, params in items[1:]:
        last = points[-1]
        if command == 16:
            east, north = ground.place(*params[4:6])
            assert frame in {3, 10}
            above = params[6]
            if frame == 10:
                above += ground.height(*params[4:6]) - ground.height(*home[:2])
            points.append(
                Point(east, north, above, last.speed, params[0] or 0.0, stop=bool(params[0]))
            )
        elif command == 178:
            assert params[0] == 1
            points[-1] = last._replace(speed=params[1])
        elif command in {203, 2000}:
            points[-1] = last._replace(photos=last.photos + 1)
        elif command == 93:
            points[-1] = last._replace(hold=last.hold + params[0])
        elif command == 206:
            points[-1] = last._replace(spacing=params[0], photos=last.photos + int(params[2] == 1))
        else:
            assert command in {20, 115, 205}
    assert items[-1][0] == 20
    # Both autopilots return at their current height, or higher if a parameter requires it.
    points.append(Point(x, y, points[-1].up, points[-1].speed, stop=True))
    return flown([*points, Point(x, y, 0.0, 0.0, stop=True)])


def fly_parrot(content, ground, takeoff, climb):
    """Fly a Parrot file.

    The drone climbs to the height of the first waypoint and then flies to this waypoint.  During a
    delay, it stays at its position.
    """
    first, *lines = content.decode().splitlines()
    assert first == "QGC WPL 120"
    x, y = ground.place(*takeoff)
    points = [Point(x, y, 0.0, 0.0, stop=True), Point(x, y, climb, 0.0, stop=True)]
    for line in lines:
        _, _, frame, command, *params, _ = (float(field) for field in line.split("\t"))
        assert frame == 3
        last = points[-1]
        if command == 16:
            points.append(Point(*ground.place(*params[4:6]), params[6], last.speed, stop=True))
        elif command == 178:
            points[-1] = last._replace(speed=params[1])
        elif command == 112:
            points[-1] = last._replace(hold=last.hold + params[0])
        elif command == 2000:
            points[-1] = last._replace(photos=last.photos + 1)
        else:
            assert command in {20, 22, 205, 50_000}
    points.append(Point(x, y, points[-1].up, points[-1].speed, stop=True))
    return flown([*points, Point(x, y, 0.0, 0.0, stop=True)])


def fly_litchi(content, ground, takeoff, transit):
    """Fly a Litchi file.

    The drone climbs to the height of the first waypoint and then flies to this waypoint.  It
    returns at the height of the last waypoint.  The file has no speed for these two paths.
    `transit` is the speed that is set in Litchi and in DJI's app.
    """
    rows = list(csv.DictReader(io.StringIO(content.decode(), newline="")))
    x, y = ground.place(*takeoff)
    climb = float(rows[0]["altitude(m)"])
    points = [Point(x, y, 0.0, transit, stop=True), Point(x, y, climb, transit, stop=True)]
    on = False
    for row in rows:
        place = float(row["latitude"]), float(row["longitude"])
        up, hold, photos = float(row["altitude(m)"]), 0.0, 0
        if row["altitudemode"] == "1":
            up += ground.height(*place) - ground.height(*takeoff)
        for pair in range(1, 16):
            kind, value = float(row[f"actiontype{pair}"]), float(row[f"actionparam{pair}"])
            hold += value / 1000.0 if kind == 0 else 0.0
            photos += kind == 1
        spacing = float(row["photo_distinterval"])
        # It is assumed that the trigger continues over waypoints with the same interval.
        begins, on = spacing > 0.0 and not on, spacing > 0.0
        points.append(
            Point(
                *ground.place(*place), up, float(row["speed(m/s)"]), hold, bool(hold or photos),
                photos + begins, None if on and not begins else max(spacing, 0.0),
            )
        )  # fmt: skip
    # The drone stops at the first waypoint, because the mission begins with the next leg.
    points[2] = points[2]._replace(stop=True)
    points[-1] = points[-1]._replace(speed=transit)
    points.append(Point(x, y, points[-1].up, transit, stop=True))
    return flown([*points, Point(x, y, 0.0, 0.0, stop=True)])


def text(element, name):
    return element.findtext(f".//{WPML}{name}")


def fly_wpml(content, ground, takeoff):
    """Fly a WPML file.

    The drone climbs to the security height, flies to the first point, and descends.  At the end, it
    climbs again and returns.
    """
    archive = zipfile.ZipFile(io.BytesIO(content))
    document = ET.fromstring(archive.read("wpmz/waylines.wpml"))
    transit = float(text(document, "globalTransitionalSpeed"))
    marks = list(document.iter(f"{KML}Placemark"))
    x, y = ground.place(*takeoff)
    made = []
    for mark in marks:
        longitude, latitude = map(float, mark.find(f"{KML}Point/{KML}coordinates").text.split(","))
        up, speed = float(text(mark, "executeHeight")), float(text(mark, "waypointSpeed"))
        stop = "AndStop" in text(mark, "waypointTurnMode")
        made.append(Point(*ground.place(latitude, longitude), up, speed, stop=stop))
    for group in document.iterfind(f".//{WPML}actionGroup"):
        first, last = (
            int(text(group, "actionGroupStartIndex")),
            int(text(group, "actionGroupEndIndex")),
        )
        kinds = [found.text for found in group.iterfind(f".//{WPML}actionActuatorFunc")]
        if text(group, "actionTriggerType") == "multipleDistance":
            assert kinds == ["takePhoto"]
            spacing = float(text(group, "actionTriggerParam"))
            made[first] = made[first]._replace(spacing=spacing, photos=made[first].photos + 1)
            made[last] = made[last]._replace(spacing=0.0)
        else:
            assert first == last
            holds = [float(found.text) for found in group.iterfind(f".//{WPML}hoverTime")]
            point = made[first]
            made[first] = point._replace(
                photos=point.photos + kinds.count("takePhoto"), hold=point.hold + sum(holds)
            )
    security, back = (
        float(text(document, "takeOffSecurityHeight")),
        float(text(document, "globalRTHHeight")),
    )
    climb, home = max(security, made[0].up), max(back, made[-1].up)
    points = [Point(x, y, 0.0, transit, stop=True), Point(x, y, climb, transit, stop=True)]
    points.append(Point(*made[0][:2], climb, transit, stop=True))
    made[-1] = made[-1]._replace(speed=transit, stop=True)
    points += made
    points.append(Point(*made[-1][:2], home, transit, stop=True))
    points += [Point(x, y, home, transit, stop=True), Point(x, y, 0.0, 0.0, stop=True)]
    return flown(points)


def flown(points):
    """The flight with its photos: single photos, and one photo per spacing of the path while the
    trigger is on.
    """
    photos, spacing, gone = [], 0.0, 0.0
    for point, following in zip(points, [*points[1:], None], strict=True):
        photos += [point[:3]] * point.photos
        if point.spacing is not None:
            spacing, gone = point.spacing, 0.0
        if not spacing or following is None:
            continue
        length = math.hypot(following.x - point.x, following.y - point.y)
        due = spacing - gone
        while due < length:
            share = due / length
            photos.append(
                tuple(a + share * (b - a) for a, b in zip(point[:3], following[:3], strict=True))
            )
            due += spacing
        gone = length - (due - spacing)
    return Flown(points, photos)


def working(points):
    """The points with photos, and the points that switch a distance trigger off."""
    found, on = [], False
    for point in points:
        off = on and point.spacing == 0.0
        on = on if point.spacing is None else point.spacing > 0.0
        if point.photos or off:
            found.append(point)
    return found


def between(points, first, last):
    """The points from the first point at one position to the first point at another position."""
    start, stop = (
        next(k for k, point in enumerate(points) if math.dist(point[:3], place[:3]) < 1e-3)
        for place in (first, last)
    )
    return points[start : stop + 1]


def duration_s(points, *, acceleration, climb):
    """Time of a flight that stops at the stops in the file and at turns of the course."""
    total, line = 0.0, []
    stops = {0, len(points) - 1}
    for index in range(1, len(points) - 1):
        before, here, after = points[index - 1 : index + 2]
        one = (here.x - before.x, here.y - before.y)
        other = (after.x - here.x, after.y - here.y)
        across = one[0] * other[1] - one[1] * other[0]
        along = one[0] * other[0] + one[1] * other[1]
        if here.stop or along <= 0.0 or abs(across) > 1e-3 * along:
            stops.add(index)
    for start, stop in pairwise(sorted(stops)):
        line = points[start : stop + 1]
        lengths = [math.dist(a[:3], b[:3]) for a, b in pairwise(line)]
        bounds = []
        for (a, b), length in zip(pairwise(line), lengths, strict=True):
            level, rise = math.hypot(b.x - a.x, b.y - a.y), abs(b.up - a.up)
            bound = a.speed * length / level if level > 1e-6 else math.inf
            bounds.append(min(bound, climb * length / rise) if rise > 1e-6 else bound)
        length = sum(lengths)
        if length > 1e-6:
            speed = min(bounds)
            if length >= speed * speed / acceleration:
                total += length / speed + speed / acceleration
            else:
                total += 2.0 * math.sqrt(length / acceleration)
    return total + sum(point.hold for point in points)


# The following lists contain the commands that the autopilots accept. Sources for PX4:
# MavlinkMissionManager::parse_mavlink_mission_item and FeasibilityChecker.  Sources for ArduPilot:
# AP_Mission::mavlink_int_to_mission_cmd and ArduCopter's mode_auto.

PX4_PLACED = {16, 17, 19, 21, 22, 31, 84, 85, 195, 201}
# The parser accepts 112 and 114, but the feasibility check rejects them.
PX4_PLAIN = {20, 93, 177, 178, 179, 189, 197, 203, 204, 205, 206, 214, 530, 532, 1000}
PX4_PLAIN |= {1001, 2000, 2001, 2003, 2500, 2501, 3000}


def check_px4(items, home):
    """Check that PX4 accepts every item, and that its feasibility check passes with default
    parameters.
    """
    placed = False
    for command, frame, params in items:
        assert frame in {0, 2, 3, 5, 6}
        assert command in (PX4_PLAIN if frame == 2 else PX4_PLACED)
        if command == 22:
            assert not placed  # The take-off has to be the first item with a position.
            assert params[6] - 1.0 >= 2.0  # Its height is at least 1 m more than NAV_ACC_RAD.
        placed |= frame != 2
        if frame != 2:
            assert -90.0 <= params[4] <= 90.0
            assert -180.0 <= params[5] <= 180.0
    assert items[0][0] == 22
    assert len(items) <= 500
    assert all(math.isfinite(value) for value in home)


ARDUPILOT = {16, 17, 19, 20, 21, 22, 93, 112, 114, 115, 177, 178, 179, 201, 203, 205, 206}


def check_ardupilot(items, home):
    """Check that ArduCopter stores every item, and that no item contains a zero that it would
    replace by the current position.
    """
    assert len(items) + 1 <= 718
    assert all(math.isfinite(value) for value in home)
    for command, frame, params in items:
        assert command in ARDUPILOT
        # AP_Mission::sanity_check_params accepts "not a number" only for a yaw.
        missing = [place for place, param in enumerate(params) if param is None]
        assert missing in ([], [3] if command in {16, 21, 22} else [])
        if command == 203:
            assert params[4] == 1
        if command == 178:
            assert params[:3] == [1, params[1], -1]
            assert params[1] > 0
        if command in {16, 22}:
            assert frame in {0, 3, 10}
            assert abs(params[6]) < 83_000.0
            # Heights are stored in centimetres. Zero would mean the current height.
            assert round(100.0 * params[6]) != 0
            assert (round(1e7 * params[4]), round(1e7 * params[5])) != (0, 0)
        if command == 16:
            assert params[0] == int(params[0])
    yaws = [params[0] for command, _, params in items if command == 115]
    assert all(0.0 <= yaw <= 360.0 for yaw in yaws)
    # ArduCopter turns towards the next waypoint unless the preceding item sets the yaw.
    codes = [command for command, _, _ in items]
    assert all(codes[place - 1] == 115 for place, code in enumerate(codes) if code == 16)
