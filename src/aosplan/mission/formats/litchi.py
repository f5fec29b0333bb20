"""Litchi's CSV of 46 columns: eight fields, fifteen pairs of an action, eight fields.

Rules: litchiutilities.com/docs/litchiCsv.php, and DJI's Mobile SDK 4, which flies it.  Litchi
keeps no heading mode in the file: set it to Custom (wd) after the import.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.mission.format import Format, Limits
from aosplan.mission.formats.rows import rows
from aosplan.mission.mission import photo_lines

if TYPE_CHECKING:
    from aosplan.mission.mission import Mission

FORMAT = Format(
    "litchi",
    (),
    "Litchi CSV",
    needs_place=True,
    altitudes="take-off, or ground",
    limits=(
        Limits(
            "litchi",
            waypoints=(2, 99),
            leg_m=(0.5, 2000.0),
            speed_mps=(0.0, 15.0),
            height_m=(-200.0, 500.0),
            hold_s=(0.0, 32.0),
            source="2 to 99 waypoints, legs of 0.5 to 2000 m and speeds of DJI's Mobile SDK 4 "
            "(DJIWaypointMission); heights and stays of Litchi's CSV",
        ),
    ),
    flown_by=("dji",),
)

_PAIRS = 15
_STAY, _PHOTO, _TILT, _NOTHING = 0, 1, 5, -1

HEADER = ",".join(
    [
        "latitude,longitude,altitude(m),heading(deg),curvesize(m),rotationdir,gimbalmode",
        "gimbalpitchangle",
        *(f"actiontype{pair},actionparam{pair}" for pair in range(1, _PAIRS + 1)),
        "altitudemode,speed(m/s),poi_latitude,poi_longitude,poi_altitude(m),poi_altitudemode",
        "photo_timeinterval,photo_distinterval",
    ]
)


def render(mission: Mission) -> bytes:
    """Numbers are plain decimals, as some readers skip rows with others without a word."""
    ways, settings = mission.waypoints, mission.settings
    assert ways.latitude is not None  # the format needs a place
    assert ways.longitude is not None
    pitch = f"{settings.gimbal_pitch_deg:g}"
    actions, intervals = _camera(mission, pitch)
    above_ground = int(settings.altitude_frame == "terrain")
    return f"{HEADER}\n".encode() + rows(
        f"%.10f,%.10f,%.3f,{settings.yaw_deg % 360.0:.2f},0,0,2,{pitch},%s,"
        f"{above_ground},{settings.speed_mps:.2f},0,0,0,0,-1,%s\n",
        ways.latitude,
        ways.longitude,
        mission.flown_m(),
        actions,
        intervals,
    )


def notes(mission: Mission) -> list[str]:
    """What the file takes for granted."""
    if mission.settings.altitude_frame != "terrain":
        return []
    return [
        f"{FORMAT.title}: Litchi takes the ground below the first waypoint for the height of the "
        "take-off, so heights above ground hold only for a take-off at that height"
    ]


def _camera(mission: Mission, pitch: str) -> tuple[list[str], list[str]]:
    """Actions at each waypoint, and metres between photos on the way to the next."""
    settings, photo = mission.settings, mission.waypoints.photo
    count = len(mission.waypoints)
    aim, shoot = f"{_TILT},{pitch}", f"{_PHOTO},0"
    stay = [f"{_STAY},{round(1000.0 * settings.hold_s)}"] if settings.hold_s else []
    intervals = ["-1"] * count
    if settings.trigger == "stop":
        site = _fifteen(aim, *stay, shoot)
        actions = [
            site if photo is None or photo[index] else _fifteen(aim) for index in range(count)
        ]
        return actions, intervals
    actions = [_fifteen(aim), *[_fifteen()] * (count - 1)]
    for first, last in photo_lines(mission):
        intervals[first:last] = [f"{settings.spacing_m:.3f}"] * (last - first)
        actions[last] = _fifteen(*([] if last else [aim]), shoot)
    return actions, intervals


def _fifteen(*pairs: str) -> str:
    return ",".join([*pairs, *[f"{_NOTHING},0"] * (_PAIRS - len(pairs))])
