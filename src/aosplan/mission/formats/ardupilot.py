"""ArduPilot's ``.waypoints`` files (QGC WPL 110): one command per line, fields separated by tabs.

The format has no comments.  The frame of each line gives the reference of its altitude.  Sources:
Mission Planner's MissionFile.cs, pymavlink's mavwp.py, QGroundControl's MissionItem.cc.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.mission.format import Format
from aosplan.mission.mavlink import (
    ABSOLUTE,
    ARDUPILOT,
    WAYPOINT,
    Command,
    commands,
    mavlink_notes,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.mission.mission import Mission

FORMAT = Format(
    "waypoints",
    (".waypoints",),
    "ArduPilot waypoints (QGC WPL 110)",
    needs_place=True,
    altitudes="take-off, or ground",
    limits=(ARDUPILOT,),
    flown_by=("ardupilot",),
)


def size(mission: Mission) -> int:
    """Number of commands of the file, including the home position."""
    return 1 + sum(1 for _ in commands(mission, "ardupilot"))


def notes(missions: Sequence[Mission]) -> list[str]:
    """Assumptions of the file, one sentence each."""
    return mavlink_notes(missions, "ardupilot")


def render(mission: Mission) -> bytes:
    """Write the mission.  Row 0 is the home position, because ArduPilot reads the first row as
    home.
    """
    ground = mission.settings.takeoff_ground_m or 0.0
    home = Command(WAYPOINT, ABSOLUTE, (0.0, 0.0, 0.0, 0.0, *mission.home(), ground))
    lines = [
        f"{number}\t{int(number == 0)}\t{frame}\t{command}\t"
        + "\t".join([f"{param or 0.0:.8f}" for param in params])
        + "\t1"
        for number, (command, frame, params) in enumerate(
            (home, *commands(mission, "ardupilot")),
        )
    ]
    return "\n".join(["QGC WPL 110", *lines, ""]).encode()
