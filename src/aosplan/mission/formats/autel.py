"""Autel's ``.kmz`` routes for Autel Enterprise and the EVO Max series.

Elements and their order follow Autel's Cloud API documentation (template.kml, waylines.wpml, common
elements).  The format is based on DJI's WPML, with a namespace and numbers of Autel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.errors import RequestError
from aosplan.mission.dji_models import DjiDrone
from aosplan.mission.format import Format, Limits
from aosplan.mission.formats import wpml

if TYPE_CHECKING:
    from aosplan.mission.mission import Mission

FORMAT = Format(
    "autel",
    (),
    "Autel KMZ",
    needs_place=True,
    altitudes="take-off",
    limits=(
        Limits(
            "autel-enterprise",
            waypoints=(2, 65_535),
            speed_mps=(0.1, 15.0),
            source="2 to 65,535 waypoints: Autel's Payload SDK documentation; speeds: its Mobile SDK",
        ),
    ),
    flown_by=("autel",),
    triggers=("stop",),
    asks_drone=True,
)

DRONES = {"autel-evo-max-4t": 0, "autel-evo-max-4n": 1}
"""droneSubEnumValue of each drone; the droneEnumValue of all of them is 11000."""

GIMBAL = 806
"""payloadEnumValue of the gimbal in files of the EVO Max series, from the documented list."""


def render(mission: Mission) -> bytes:
    """A zip of ``wpmz/template.kml`` and ``wpmz/waylines.wpml`` with constant timestamps.

    Raises
    ------
    RequestError
        If Autel's documentation has no number for the drone.
    """
    return wpml.render(mission, _AUTEL)


notes = wpml.reference_notes


def _machine(mission: Mission) -> wpml.Machine:
    name = str(mission.settings.drone)
    if name not in DRONES:
        raise RequestError(
            f"{FORMAT.title} has no code for the drone '{name}'",
            f"supported drones: {' and '.join(DRONES)}",
        )
    return wpml.Machine(name, DjiDrone(11_000, DRONES[name], None), GIMBAL)


_AUTEL = wpml.Dialect("http://www.autel.com/wpmz/1.0.0", _machine)
