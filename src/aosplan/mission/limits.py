"""Checks of a mission against the limits of the program that reads its file."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

from aosplan.errors import RequestError
from aosplan.mission.flown_path import flown_path, line_ends

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from aosplan.mission.flown_path import PathPoint
    from aosplan.mission.format import Format, Limits
    from aosplan.mission.mission import Mission


def limits_of(mission: Mission, chosen: Format) -> Limits:
    """The limits that apply to a mission: the limits for its autopilot if the format has such
    limits, otherwise the first limits of the format.

    If the user gives a number of waypoints per file, this number replaces the known limit.
    """
    wanted = mission.settings.autopilot
    limits = next((one for one in chosen.limits if one.target == wanted), chosen.limits[0])
    fewest, most = limits.waypoints
    if mission.settings.file_waypoints is not None:
        return limits._replace(waypoints=(fewest, mission.settings.file_waypoints))
    drone = mission.settings.most_waypoints
    if most is not None and drone is not None:
        return limits._replace(waypoints=(fewest, max(fewest, min(most, drone))))
    return limits


def check_flown(mission: Mission, chosen: Format) -> None:
    """Refuse a mission if the format cannot express its drone, trigger or heights.

    Raises
    ------
    RequestError
        If the drone is not known or does not fly this format, if the format cannot express the
        trigger, or if the mission follows the terrain and the format has only heights above the
        take-off point.
    """
    settings = mission.settings
    flown = settings.mission_formats or ()
    if chosen.asks_drone and settings.drone is None:
        raise RequestError(
            f"{chosen.title} needs a drone",
            "give --drone NAME; aosplan drones --json lists the formats of each drone",
        )
    if chosen.asks_drone and chosen.name not in flown:
        raise RequestError(
            f"the drone {settings.drone} does not fly {chosen.title}",
            f"it flies {' and '.join(flown)}"
            if flown
            else "aosplan knows no mission format for this drone",
        )
    if settings.trigger not in chosen.triggers:
        raise RequestError(
            f"{chosen.title} does not support --trigger {settings.trigger}, because the "
            "drone stops for each photo",
            f"give --trigger {chosen.triggers[0]}",
        )
    if settings.altitude_frame == "terrain" and "ground" not in chosen.altitudes:
        raise RequestError(
            f"{chosen.title} does not support heights above terrain",
            "give --altitude-frame takeoff",
        )


def split_for_limits(
    mission: Mission, chosen: Format, size: Callable[[Mission], int]
) -> list[Mission]:
    """Split a mission into consecutive parts of about equal size, each within the limits of the
    program that reads the file.

    A line on which photos are taken while flying is never split.  `size` is the function that
    counts the limited items.

    Raises
    ------
    RequestError
        If the mission exceeds a limit even after splitting.  The message gives the limit.
    """
    limits = limits_of(mission, chosen)
    path = flown_path(mission)
    fewest, most = limits.waypoints
    if len(path) < fewest:
        raise RequestError(
            f"{chosen.title} needs {fewest} waypoints or more, and the mission has {len(path)}",
            "give more --samples, or write another format",
        )
    _check_settings(mission, path, chosen, limits)
    _check_legs(path, chosen, limits)
    whole = size(mission)
    if most is None or whole <= most:
        return [mission]
    begins = _begins(mission)
    for count in range(-(-whole // most), len(begins) + 1):
        edges = [
            0,
            *(begins[len(begins) * piece // count] for piece in range(1, count)),
            len(mission.waypoints),
        ]
        pieces = [
            mission._replace(waypoints=mission.waypoints[begin:end], part=part, parts=count)
            for part, (begin, end) in enumerate(pairwise(edges), 1)
        ]
        if all(size(piece) <= most for piece in pieces):
            return pieces
    raise RequestError(
        f"one line needs more than the {most} {limits.unit} that a file of {chosen.title} can have",
        "give a larger --terrain-tolerance, or --trigger stop",
    )


def _begins(mission: Mission) -> list[int]:
    """Waypoints at which a file may start: all waypoints, or only the first waypoint of each line
    if the drone does not stop on lines.
    """
    if mission.settings.trigger == "stop":
        return list(range(len(mission.waypoints)))
    photo = mission.waypoints.photo
    ends = line_ends(mission)
    lines = pairwise(ends) if len(ends) > 1 else [(0, 0)]
    return [first for first, last in lines if photo is None or any(photo[first : last + 1])]


def _check_settings(
    mission: Mission, path: Sequence[PathPoint], chosen: Format, limits: Limits
) -> None:
    settings = mission.settings
    speeds = [settings.speed_mps, mission.transit_mps]
    _check(
        speeds, limits.speed_mps, "speed", "m/s", chosen, "give a lower --speed, --transit-speed"
    )
    if settings.trigger == "stop":
        _check([settings.hold_s], limits.hold_s, "hold", "s", chosen, "give a shorter --hold")
    if limits.height_m != (None, None):
        heights = [point.height_m for point in path]
        hint = "the heights in this format are above the take-off"
        _check([min(heights), max(heights)], limits.height_m, "height", "m", chosen, hint)


def _check(
    values: Sequence[float],
    bounds: tuple[float | None, float | None],
    name: str,
    unit: str,
    chosen: Format,
    hint: str,
) -> None:
    least, most = bounds
    for value in values:
        if (least is not None and value < least) or (most is not None and value > most):
            shown = (
                f"at most {most:g}"
                if least is None
                else f"at least {least:g}"
                if most is None
                else f"{least:g} to {most:g}"
            )
            raise RequestError(
                f"the {name} is {value:.6g} {unit}, but {chosen.title} allows {shown} {unit}",
                hint,
            )


def _check_legs(path: Sequence[PathPoint], chosen: Format, limits: Limits) -> None:
    shortest, longest = limits.leg_m
    if shortest <= 0.0 and longest is None:
        return
    for index, (start, stop) in enumerate(pairwise(path), 1):
        leg = math.dist(
            (start.east_m, start.north_m, start.height_m),
            (stop.east_m, stop.north_m, stop.height_m),
        )
        # One of the two heights is relative to the take-off point, and the other is relative to the
        # ground.
        if start.above_takeoff != stop.above_takeoff:
            continue
        if not shortest <= leg <= (math.inf if longest is None else longest):
            raise RequestError(
                f"waypoints {index} and {index + 1} are {leg:.4g} m apart, but {chosen.title} "
                f"allows only distances of {shortest:g} to {longest:g} m",
                "give another --baseline, or write another format",
            )
