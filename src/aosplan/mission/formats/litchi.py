"""Litchi's CSV with 46 columns: eight fields, then fifteen pairs of columns for actions, then eight
fields.

Sources: litchiutilities.com/docs/litchiCsv.php, and DJI's Mobile SDK 4, which flies the mission.
The file does not contain Litchi's heading mode; the user sets it to Custom (wd) after the import.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from aosplan.mission.flown_path import flown_path
from aosplan.mission.format import Format, Limits

if TYPE_CHECKING:
    from collections.abc import Sequence

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
    """Write numbers as plain decimals, because some readers silently skip rows with other
    notations.
    """
    settings = mission.settings
    pitch = f"{settings.gimbal_pitch_deg:g}"
    aim, shoot = f"{_TILT},{pitch}", f"{_PHOTO},0"
    stay = [f"{_STAY},{round(1000.0 * settings.hold_s)}"] if settings.hold_s else []
    above_ground = settings.altitude_frame == "terrain"
    by_stop, on = settings.trigger == "stop", False
    lines = [HEADER]
    for index, point in enumerate(flown_path(mission)):
        actions = [aim] if by_stop or index == 0 else []
        if point.photo:
            actions += [*(stay if by_stop else []), shoot]
        on = on if point.switch is None else point.switch
        lines.append(
            f"{point.latitude:.10f},{point.longitude:.10f},{point.height_m:.3f},"
            f"{settings.yaw_deg % 360.0:.2f},0,0,2,{pitch},{_fifteen(*actions)},"
            f"{int(above_ground and not point.above_takeoff)},{point.speed_mps:.4f},0,0,0,0,-1,"
            + (f"{settings.spacing_m:.6f}" if on else "-1")
        )
    return "\n".join([*lines, ""]).encode()


def notes(missions: Sequence[Mission]) -> list[str]:
    """Assumptions of the file, one sentence each."""
    return_m = math.ceil(max(mission.return_m() for mission in missions))
    ways = (
        "the file contains no heading mode, no transit speed and no return height: in "
        "Litchi, set the heading mode to Custom (WD) and the cruising speed to "
        f"{missions[0].transit_mps:.3g} m/s; in DJI's app, set the return height to "
        f"{return_m} m or more; set the action at the end of the mission to return home"
    )
    if missions[0].settings.altitude_frame != "terrain":
        return [ways]
    return [
        ways,
        "Litchi's heights above ground are relative to the ground below the first waypoint, "
        "so take off from ground of this height",
    ]


def _fifteen(*pairs: str) -> str:
    return ",".join([*pairs, *[f"{_NOTHING},0"] * (_PAIRS - len(pairs))])
