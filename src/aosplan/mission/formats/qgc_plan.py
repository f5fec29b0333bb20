"""QGroundControl's ``.plan`` files, for PX4 or ArduPilot.

Sources: QGroundControl's developer guide (file formats, plan) and its src/MissionManager, which
requires more keys than the guide lists.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from aosplan.mission.format import Format
from aosplan.mission.mavlink import (
    ARDUPILOT,
    PX4,
    RELATIVE,
    TERRAIN,
    Command,
    commands,
    mavlink_notes,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.mission.mission import Mission

FORMAT = Format(
    "plan",
    (".plan",),
    "QGroundControl plan",
    needs_place=True,
    altitudes="take-off, or ground",
    limits=(PX4, ARDUPILOT),
    flown_by=("px4", "ardupilot"),
)

FIRMWARE = {"px4": 12, "ardupilot": 3}
"""MAV_AUTOPILOT by name."""

_MODES = {RELATIVE: 1, TERRAIN: 4}
"""QGroundControl's AltitudeMode by frame."""

_ITEMS = "<items>"


def render(mission: Mission) -> bytes:
    """Write one item per line; missing values are null, because JSON has no NaN."""
    settings = mission.settings
    autopilot = settings.autopilot or "px4"
    plan = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "aosplan",
        "aosplan": {"title": mission.title, "altitudes_above": _above(mission)},
        "geoFence": {"version": 2, "circles": [], "polygons": []},
        "rallyPoints": {"version": 2, "points": []},
        "mission": {
            "version": 2,
            "firmwareType": FIRMWARE[autopilot],
            "vehicleType": 2,
            "cruiseSpeed": mission.transit_mps,
            "hoverSpeed": mission.transit_mps,
            "globalPlanAltitudeMode": 4 if settings.altitude_frame == "terrain" else 1,
            "plannedHomePosition": [
                *(round(degrees, 10) for degrees in mission.home()),
                settings.takeoff_ground_m or 0.0,
            ],
            "items": _ITEMS,
        },
    }
    items = ",\n".join(
        json.dumps(_item(number, command), allow_nan=False)
        for number, command in enumerate(commands(mission, autopilot), 1)
    )
    frame = json.dumps(plan, ensure_ascii=False, allow_nan=False, indent=1)
    head, _, tail = frame.rpartition(json.dumps(_ITEMS))
    return f"{head}[\n{items}\n]{tail}\n".encode()


def size(mission: Mission) -> int:
    """Number of commands of the file, plus 1, because the autopilot also stores the home
    position.
    """
    return 1 + sum(1 for _ in commands(mission, mission.settings.autopilot or "px4"))


def notes(missions: Sequence[Mission]) -> list[str]:
    """Assumptions of the file, one sentence each."""
    autopilot = missions[0].settings.autopilot
    found = mavlink_notes(missions, autopilot or "px4")
    if autopilot is not None:
        return found
    return [
        "no autopilot is given, so the file is for PX4; for ArduPilot, give --autopilot ardupilot",
        *found,
    ]


def _above(mission: Mission) -> str:
    return "ground" if mission.settings.altitude_frame == "terrain" else "take-off"


def _item(number: int, command: Command) -> dict[str, Any]:
    first, second, third, fourth, latitude, longitude, altitude = command.params
    item = {
        "type": "SimpleItem",
        "command": command.command,
        "frame": command.frame,
        "params": [
            first,
            second,
            third,
            fourth,
            round(latitude, 10),
            round(longitude, 10),
            round(altitude, 4),
        ],
        "autoContinue": True,
        "doJumpId": number,
    }
    if command.frame in _MODES:
        item |= {
            "AltitudeMode": _MODES[command.frame],
            "Altitude": round(altitude, 4),
            "AMSLAltAboveTerrain": None,
        }
    return item
