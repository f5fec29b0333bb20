"""CSV: a header line and a line per waypoint, in flight order."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.mission.format import Format
from aosplan.mission.formats.rows import rows

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from aosplan.mission.mission import Mission

FORMAT = Format("csv", (".csv",), "CSV", needs_place=False)


def columns(mission: Mission) -> dict[str, tuple[str, Sequence[Any]]]:
    """Columns by name, each with its mark in a template: what is known of the waypoints.

    Metres to a tenth of a millimetre, degrees to ten decimals (0.01 mm).  Heights are
    `altitude_m` above the ground at the waypoint, the ground's `ground_m` above sea level, and
    `above_takeoff_m`.
    """
    ways = mission.waypoints
    known: dict[str, tuple[str, Sequence[Any] | None]] = {
        "index": ("%d", range(mission.first_index, mission.first_index + len(ways))),
        "east_m": ("%.4f", ways.east_m),
        "north_m": ("%.4f", ways.north_m),
        "altitude_m": ("%.4f", ways.altitude_m),
        "latitude": ("%.10f", ways.latitude),
        "longitude": ("%.10f", ways.longitude),
        "ground_m": ("%.4f", ways.ground_m),
    }
    if ways.ground_m is not None and mission.settings.takeoff_ground_m is not None:
        known["above_takeoff_m"] = ("%.4f", mission.above_takeoff_m())
    if ways.photo is not None:
        known["photo"] = ("%s", ["true" if photo else "false" for photo in ways.photo])
    return {name: (mark, column) for name, (mark, column) in known.items() if column is not None}


def render(mission: Mission) -> bytes:
    """UTF-8 without BOM; longitude and latitude only with a place."""
    known = columns(mission)
    header = ",".join(known) + "\n"
    template = ",".join(mark for mark, _ in known.values()) + "\n"
    return header.encode() + rows(template, *(column for _, column in known.values()))
