"""CSV: a header line and a line per waypoint, in flight order."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from aosplan.mission.format import Format

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


def rows(template: str, *columns: Sequence[Any]) -> bytes:
    r"""A row of text for each place in some columns, all by the same template.

    Parameters
    ----------
    template
        As of the operator ``%``, with ``%d``, ``%.Nf`` and ``%s`` for the columns in their order.
        No number is written as a negative zero.
    columns
        Numbers or texts, of equal lengths.

    Examples
    --------
    >>> rows("%d: %.2f\n", range(3), [0.125, -0.001, 99.995])
    b'0: 0.12\n1: 0.00\n2: 100.00\n'
    """
    # Rounding first, and adding zero, turns what would be written "-0.0" into a plain zero.
    plain = [
        [round(value, int(decimals)) + 0.0 for value in column] if decimals else column
        for column, decimals in zip(
            columns, re.findall(r"%(?:\.(\d+)f|d|s)", template), strict=True
        )
    ]
    return "".join(template % row for row in zip(*plain, strict=True)).encode()


def render(mission: Mission) -> bytes:
    """UTF-8 without BOM; longitude and latitude only with a place."""
    known = columns(mission)
    header = ",".join(known) + "\n"
    template = ",".join(mark for mark, _ in known.values()) + "\n"
    return header.encode() + rows(template, *(column for _, column in known.values()))
