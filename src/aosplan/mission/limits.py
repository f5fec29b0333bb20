"""Limits of the programs that read missions, checked in this one place."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.mission.format import Format, Limits
    from aosplan.mission.mission import Mission


def limits_of(mission: Mission, chosen: Format) -> Limits:
    """The limits that rule a mission: those of its autopilot, or the format's first."""
    wanted = mission.settings.autopilot
    limits = next((one for one in chosen.limits if one.target == wanted), chosen.limits[0])
    fewest, most = limits.waypoints
    drone = mission.settings.most_waypoints
    if most is not None and drone is not None:
        return limits._replace(waypoints=(fewest, max(fewest, min(most, drone))))
    return limits


def check_flown(mission: Mission, chosen: Format) -> None:
    """Refuse a mission whose drone, trigger or heights a format cannot express.

    Raises
    ------
    RequestError
        Where the drone is not known or flies other formats, the format has not such a trigger, or
        it holds heights above the take-off alone.
    """
    settings = mission.settings
    flown = settings.mission_formats or ()
    if chosen.asks_drone and settings.drone is None:
        raise RequestError(
            f"{chosen.title} needs to know the drone",
            "give its --drone NAME; aosplan drones --json lists what each one flies",
        )
    if chosen.asks_drone and chosen.name not in flown:
        raise RequestError(
            f"the drone {settings.drone} does not fly {chosen.title}",
            f"it flies {' and '.join(flown)}" if flown else "no format is known that it flies",
        )
    if settings.trigger not in chosen.triggers:
        raise RequestError(
            f"{chosen.title} has no photos by {settings.trigger}: the drone stops for each one",
            f"give --trigger {chosen.triggers[0]}",
        )
    if settings.altitude_frame == "terrain" and "ground" not in chosen.altitudes:
        raise RequestError(
            f"{chosen.title} holds no height above the ground over trees",
            "plan heights above the take-off",
        )


def parts(mission: Mission, chosen: Format) -> list[Mission]:
    """The mission in pieces that the format's target takes: consecutive, gapless, equally long.

    Turning points nearer to their neighbour than the target's shortest leg are left out.

    Raises
    ------
    RequestError
        Where it is beyond a limit that splitting does not cure; the message has the number.
    """
    limits = limits_of(mission, chosen)
    mission = _without_short_turns(mission, limits.leg_m[0])
    count = len(mission.waypoints)
    fewest, most = limits.waypoints
    if count < fewest:
        raise RequestError(
            f"{chosen.title} needs {fewest} waypoints or more, and the mission has {count}",
            "ask for more --samples, or write another format",
        )
    _check_flight_settings(mission, chosen, limits)
    _check_legs(mission, chosen, limits)
    pieces = 1 if most is None else -(-count // most)
    if pieces == 1:
        return [mission]
    edges = [count * piece // pieces for piece in range(pieces + 1)]
    return [
        mission._replace(waypoints=mission.waypoints[begin:end], part=part, parts=pieces)
        for part, (begin, end) in enumerate(pairwise(edges), 1)
    ]


def _check_flight_settings(mission: Mission, chosen: Format, limits: Limits) -> None:
    settings = mission.settings
    _check([settings.speed_mps], limits.speed_mps, "speed", "m/s", chosen, "give a lower --speed")
    if settings.trigger == "stop":
        _check([settings.hold_s], limits.hold_s, "hold", "s", chosen, "give a shorter --hold")
    if limits.height_m != (None, None):
        heights = mission.flown_m()
        hint = "its heights count from the take-off"
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
            shown = " to ".join("any" if one is None else f"{one:g}" for one in bounds)
            raise RequestError(
                f"{name} {value:.6g} {unit}: {chosen.title} takes {shown} {unit}", hint
            )


def _without_short_turns(mission: Mission, shortest_m: float) -> Mission:
    """The mission without waypoints that take no photo and lie on their neighbour."""
    ways = mission.waypoints
    if shortest_m <= 0.0 or ways.photo is None:
        return mission
    heights = mission.flown_m()
    kept: list[int] = []
    for index, photo in enumerate(ways.photo):
        place = (ways.east_m[index], ways.north_m[index], heights[index])
        if kept:
            last = kept[-1]
            before = (ways.east_m[last], ways.north_m[last], heights[last])
            if math.dist(place, before) < shortest_m:
                if not photo:
                    continue
                if not ways.photo[last]:
                    kept.pop()
        kept.append(index)
    columns = {name: [column[i] for i in kept] for name, column in ways.columns().items()}
    return mission._replace(waypoints=replace(ways, **columns))


def _check_legs(mission: Mission, chosen: Format, limits: Limits) -> None:
    shortest, longest = limits.leg_m
    if shortest <= 0.0 and longest is None:
        return
    ways = mission.waypoints
    places = zip(ways.east_m, ways.north_m, mission.flown_m(), strict=True)
    for index, (start, stop) in enumerate(pairwise(places), 1):
        leg = math.dist(start, stop)
        if not shortest <= leg <= (math.inf if longest is None else longest):
            raise RequestError(
                f"waypoints {index} and {index + 1} are {leg:.4g} m apart: {chosen.title} takes "
                f"legs of {shortest:g} to {longest:g} m",
                "give another --baseline, or write another format",
            )
