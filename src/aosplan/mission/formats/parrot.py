"""Parrot's ``.mavlink`` flight plan (QGC WPL 120), which ANAFI, ANAFI Thermal and ANAFI USA fly.

Commands, parameters and frames follow Parrot's FlightPlan documentation, messages V1, and its
GroundSDK for Android.  The GroundSDK ignores the hold of a waypoint, and it replaces an acceptance
radius of 0 by 5 m.  The ANAFI Ai reads other parameters (V2) and is not supported.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.mission import mavlink as mav
from aosplan.mission.flown_path import flown_path
from aosplan.mission.format import Format, Limits

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from aosplan.mission.mission import Mission

FORMAT = Format(
    "parrot",
    (".mavlink",),
    "Parrot flight plan (QGC WPL 120)",
    needs_place=True,
    altitudes="take-off",
    limits=(
        Limits(
            "parrot-anafi",
            speed_mps=(1.0, 10.0),
            source=(
                "speeds: Parrot's FlightPlan documentation, messages V1, which does not "
                "limit the number of commands"
            ),
        ),
    ),
    flown_by=("parrot",),
    triggers=("stop",),
    asks_drone=True,
)

DELAY, VIEW_MODE = 112, 50_000
"""Commands of Parrot's own dialect: a delay before the next command, and the yaw mode."""

REACHED_M = 0.5
"""Acceptance radius of a site. The default of the drone is 5 m."""

FULL_FRAME = 13.0
"""Photo format: the whole sensor as JPEG."""


def render(mission: Mission) -> bytes:
    """Write one command per line, with fields separated by tabs.  All heights are above the
    take-off point.
    """
    lines = [
        f"{number}\t0\t{mav.RELATIVE}\t{command}\t"
        + "\t".join(f"{param:.8f}" for param in params)
        + "\t1"
        for number, (command, params) in enumerate(_commands(mission))
    ]
    return "\n".join(["QGC WPL 120", *lines, ""]).encode()


def notes(missions: Sequence[Mission]) -> list[str]:
    """Assumptions of the file, one sentence each."""
    return mav.return_notes(missions, "the return height of the drone")


def _commands(mission: Mission) -> Iterator[tuple[int, tuple[float, ...]]]:
    """The commands: take-off, the sites with a photo in the middle of each hold, and the return."""
    settings = mission.settings
    pause = _plain(DELAY, settings.hold_s / 2.0)
    speed = mission.transit_mps
    yield _plain(mav.TAKEOFF)
    yield _plain(mav.SPEED, 1.0, speed)
    yield _plain(VIEW_MODE)  # In mode 0, the nose turns to the yaw of each waypoint.
    yield mav.GIMBAL, (settings.gimbal_pitch_deg, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0)
    for point in flown_path(mission):
        lead = (0.0, REACHED_M, 0.0, round(settings.yaw_deg, 4) % 360.0)
        yield mav.WAYPOINT, (*lead, point.latitude, point.longitude, point.height_m)
        if point.photo:
            if settings.hold_s:
                yield pause
            yield _plain(mav.CAPTURE, 0.0, 1.0, FULL_FRAME)
            if settings.hold_s:
                yield pause
        if point.speed_mps != speed:
            speed = point.speed_mps
            yield _plain(mav.SPEED, 1.0, speed)
    if speed != mission.transit_mps:
        yield _plain(mav.SPEED, 1.0, mission.transit_mps)
    yield _plain(mav.RETURN)


def _plain(
    command: int, first: float = 0.0, second: float = 0.0, third: float = 0.0
) -> tuple[int, tuple[float, ...]]:
    return command, (first, second, third, 0.0, 0.0, 0.0, 0.0)
