"""CSV: a header and one line per waypoint, in flight order."""

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
    """The columns whose values are known, by name, each with the ``%`` format of its numbers.

    Metres have four decimals (0.1 mm), and degrees have ten (0.01 mm).  There are three heights:
    `altitude_m` of the waypoint above the ground, `ground_m` of the ground above sea level, and
    `above_takeoff_m` of the waypoint above the take-off point.
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


def notes(missions: Sequence[Mission]) -> list[str]:
    """A sentence that names the vertical datum of the ground heights."""
    if missions[0].waypoints.ground_m is None or missions[0].settings.height_datum is None:
        return []
    return [f"ground_m is relative to {missions[0].settings.height_datum}"]


def rows(template: str, *columns: Sequence[Any]) -> bytes:
    r"""Make rows of text from columns. The template is filled once for each row.

    Parameters
    ----------
    template
        A template for the operator ``%``, with ``%d``, ``%.Nf`` or ``%s`` for each column in order.
        Numbers that round to -0 are written as 0.
    columns
        Numbers or texts, all of the same length.

    Examples
    --------
    >>> rows("%d: %.2f\n", range(3), [0.125, -0.001, 99.995])
    b'0: 0.12\n1: 0.00\n2: 100.00\n'
    """
    # Adding zero after rounding turns -0.0 into 0.0.
    plain = [
        [round(value, int(decimals)) + 0.0 for value in column] if decimals else column
        for column, decimals in zip(
            columns, re.findall(r"%(?:\.(\d+)f|d|s)", template), strict=True
        )
    ]
    return "".join(template % row for row in zip(*plain, strict=True)).encode()


def render(mission: Mission) -> bytes:
    """Write UTF-8 without a byte order mark.  Longitude and latitude are written only if the
    mission has a location.
    """
    known = columns(mission)
    header = ",".join(known) + "\n"
    template = ",".join(mark for mark, _ in known.values()) + "\n"
    return header.encode() + rows(template, *(column for _, column in known.values()))
