"""Waypoint missions of DJI Fly: a ``.kmz`` file that replaces a mission on the remote controller.

DJI does not document the format of DJI Fly.  Its files have the structure of DJI WPML.  The
differences are taken from public planners whose files DJI Fly accepts: YMapper, FlyPath and HOT's
Drone Tasking Manager.  For every drone, all three write the drone number 68 with sub-number 0, and
do not name a camera.  According to these planners, DJI Fly cannot trigger photos by distance or
time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.mission.dji_models import DjiDrone
from aosplan.mission.format import Format, Limits
from aosplan.mission.formats import wpml

if TYPE_CHECKING:
    from aosplan.mission.mission import Mission

FORMAT = Format(
    "dji-fly",
    (),
    "DJI Fly KMZ",
    needs_place=True,
    altitudes="take-off",
    limits=(
        Limits(
            "dji-fly",
            waypoints=(2, 99),
            leg_m=(0.5, 2000.0),
            speed_mps=(0.1, 15.0),
            height_m=(None, 500.0),
            source=(
                "99 waypoints and 500 m: the limits in DJI Fly; speeds and legs: DJI's "
                "Mobile SDK 4, because those of DJI Fly are not documented"
            ),
        ),
    ),
    flown_by=("dji",),
    triggers=("stop",),
    asks_drone=True,
)


def render(mission: Mission) -> bytes:
    """A zip of ``wpmz/template.kml`` and ``wpmz/waylines.wpml`` with constant timestamps."""
    return wpml.render(mission, _FLY)


notes = wpml.reference_notes


def _machine(mission: Mission) -> wpml.Machine:
    return wpml.Machine(str(mission.settings.drone), DjiDrone(68, 0, None))


_FLY = wpml.Dialect(wpml.PILOT.namespace, _machine, fly=True)
