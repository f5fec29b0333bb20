"""A mission as MAVLink commands, for the files of ArduPilot and QGroundControl.

Numbers of commands and frames are those of MAVLink's common message set.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import RequestError
from aosplan.mission.flown_path import flown_path
from aosplan.mission.format import Limits
from aosplan.mission.mission import LEVEL_M, check_hold

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from aosplan.mission.mission import Mission

ABSOLUTE, COMMAND, RELATIVE, TERRAIN = 0, 2, 3, 10
"""Frames of a command, in this order: height above sea level, no position, height above home,
height above the ground.
"""

WAYPOINT, RETURN, TAKEOFF, DELAY, YAW, SPEED, SHOOT, GIMBAL, BY_DISTANCE, CAPTURE = (
    16, 20, 22, 93, 115, 178, 203, 205, 206, 2000,
)  # fmt: skip
"""Command numbers, in increasing order."""

REACHED_M = 0.5
"""Acceptance radius of a site for PX4.  The default of PX4 is several metres."""

STOP_S = 0.01
"""Hold at points without a photo, which makes PX4 stop there. Any time greater than zero makes it
stop.
"""

ARDUPILOT = Limits(
    "ardupilot",
    unit="commands",
    waypoints=(1, 718),
    height_m=(-83_886.0, 83_886.0),
    hold_s=(0.0, 65_535.0),
    source="718 commands on small boards; heights are stored as 24 bits of centimetres",
)

PX4 = Limits(
    "px4",
    unit="commands",
    waypoints=(1, 500),
    source="500 mission items: NUM_MISSIONS_SUPPORTED of PX4's navigator",
)


PX4_LEG_M = 900.0
"""Former default of MIS_DIST_WPS in PX4's mission_params.c.  Later versions of PX4 allow legs of
any length.
"""

METRES_PER_DEGREE = 111_200.0

RETURN_HEIGHTS = {"ardupilot": "RTL_ALT", "px4": "RTL_RETURN_ALT"}
"""Name of the parameter that gives the lowest height of the return flight, by autopilot."""


class Command(NamedTuple):
    """One item of a mission. A parameter that is None has no value, or tells the autopilot to leave
    its setting unchanged.
    """

    command: int
    frame: int
    params: tuple[float | None, float | None, float | None, float | None, float, float, float]


def commands(mission: Mission, autopilot: str) -> Iterator[Command]:
    """Commands for the autopilot, from take-off to return.

    The drone climbs, flies horizontally to its first waypoint, flies through all waypoints with
    fixed yaw and gimbal, climbs, and returns.

    PX4 executes the photo command of a waypoint after the hold, just before the drone leaves the
    waypoint. Half of the hold is therefore written as a delay after the photo.

    Raises
    ------
    RequestError
        If the autopilot is PX4 and heights are above the terrain, because PX4 refuses such
        missions, or if the autopilot does not stop for the hold.
    """
    settings = mission.settings
    own_yaw = autopilot == "px4"
    frame = TERRAIN if settings.altitude_frame == "terrain" else RELATIVE
    if own_yaw and frame == TERRAIN:
        raise RequestError(
            "PX4 does not accept heights above terrain", "plan with --altitude-frame takeoff"
        )
    if settings.trigger == "stop":
        check_hold(autopilot, settings.hold_s)
    hold = 0.5 * settings.hold_s if own_yaw else settings.hold_s
    by_mavlink = own_yaw and settings.camera_control != "outputs"
    shoot = _plain(CAPTURE, 0.0, 0.0, 1.0, None) if by_mavlink else _plain(SHOOT, fifth=1.0)
    speed = mission.transit_mps
    yield Command(TAKEOFF, RELATIVE, (0.0, 0.0, 0.0, None, *mission.home(), mission.climb_m()))
    yield _plain(SPEED, 1.0, speed, -1.0)
    yield Command(GIMBAL, COMMAND, (settings.gimbal_pitch_deg, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0))
    for point in flown_path(mission):
        where = point.latitude, point.longitude, point.height_m
        if own_yaw:
            lead = (REACHED_M, 0.0, settings.yaw_deg % 360.0)
        else:
            # The yaw is set again at each waypoint, because ArduPilot would otherwise turn towards
            # the next waypoint.
            yield _plain(YAW, settings.yaw_deg % 360.0)
            lead, where = (0.0, 0.0, 0.0), _meant(*where)
        holds = point.photo and settings.trigger == "stop"
        # PX4 would enter a line that is straight ahead at the transit speed. A stop before the line
        # prevents this.
        stay = STOP_S if own_yaw and point.stop and settings.trigger == "distance" else 0.0
        at = RELATIVE if point.above_takeoff else frame
        yield Command(WAYPOINT, at, (hold if holds else stay, *lead, *where))
        if point.photo:
            yield shoot
        if holds and own_yaw:
            yield _plain(DELAY, hold)
        if point.switch is not None:
            # The third parameter makes the camera take the first photo at once.
            yield _plain(
                BY_DISTANCE, settings.spacing_m if point.switch else 0.0, 0.0, float(point.switch)
            )
        if point.speed_mps != speed:
            speed = point.speed_mps
            yield _plain(SPEED, 1.0, speed, -1.0)
    if speed != mission.transit_mps:
        yield _plain(SPEED, 1.0, mission.transit_mps, -1.0)
    yield _plain(RETURN)


def mavlink_notes(missions: Sequence[Mission], autopilot: str) -> list[str]:
    """Notes on the absolute heights in the files and on settings that only the autopilot has."""
    settings = missions[0].settings
    if settings.takeoff_ground_m is None:
        home = (
            "the height of the home position above sea level is not known, so the file contains 0"
        )
    else:
        home = (
            f"the height of the home position in the file is {settings.takeoff_ground_m:.1f} m "
            f"above {settings.height_datum or 'the datum of the terrain file'}, although the "
            "format expects the height above sea level"
        )
    found = [f"{home}; the autopilot measures it at take-off, and all other heights are above it"]
    if autopilot == "px4" and (
        settings.trigger == "distance" or settings.camera_control == "outputs"
    ):
        found.append(
            "PX4's camera trigger takes the photos: set its parameter TRIG_MODE to 4 "
            "(distance, on command), and TRIG_INTERFACE to the interface of the camera"
        )
    longest_m = max(map(_longest_leg_m, missions))
    if autopilot == "px4" and longest_m > PX4_LEG_M:
        found.append(
            f"PX4 may reject legs of {longest_m:.0f} m: in many versions, the limits "
            f"MIS_DIST_WPS and MIS_DIST_1WP are {PX4_LEG_M:.0f} m"
        )
    found += return_notes(missions, f"the parameter {RETURN_HEIGHTS[autopilot]}")
    return found


def _longest_leg_m(mission: Mission) -> float:
    """Approximate length of the longest horizontal leg of a file, including the leg from the
    take-off point.
    """
    (latitude, longitude), path = mission.home(), flown_path(mission)
    first = path[0]
    turn = (first.longitude - longitude + 180.0) % 360.0 - 180.0
    level = turn * math.cos(math.radians(latitude)), first.latitude - latitude
    legs = (math.dist(one[:2], other[:2]) for one, other in pairwise(path))
    return max(METRES_PER_DEGREE * math.hypot(*level), *legs, 0.0)


def return_notes(missions: Sequence[Mission], setting: str) -> list[str]:
    """A note if the return flight may have to be higher than the last waypoint, because the file
    cannot contain this height.
    """
    return_m = max(mission.return_m() for mission in missions)
    lowest_m = min(min(mission.above_takeoff_m()) for mission in missions)
    if return_m <= lowest_m + LEVEL_M:
        return []
    return [
        "the file contains no height for a return before the end of the mission, which may "
        f"have to be higher than the last waypoint: set {setting} to {math.ceil(return_m)} m "
        "or more"
    ]


def _meant(latitude: float, longitude: float, height_m: float) -> tuple[float, float, float]:
    """A position whose zeros are replaced by tiny values, because ArduCopter replaces a zero by the
    current position or height.
    """
    if abs(latitude) < 1e-7 and abs(longitude) < 1e-7:
        latitude = 1e-7
    return latitude, longitude, 0.01 if abs(height_m) < 0.01 else height_m


def _plain(
    command: int,
    first: float = 0.0,
    second: float = 0.0,
    third: float = 0.0,
    fourth: float | None = 0.0,
    fifth: float = 0.0,
) -> Command:
    """A command without a position."""
    return Command(command, COMMAND, (first, second, third, fourth, fifth, 0.0, 0.0))
