"""CSV: a header line and a line per waypoint, in flight order."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from aosplan.export import Format

if TYPE_CHECKING:
    from aosplan.mission import Mission

FORMAT = Format("csv", (".csv",), "CSV", needs_place=False)

_NEGATIVE_ZERO = re.compile(r"-0(?=\.0+(?:,|$))", re.MULTILINE)


def render(mission: Mission) -> bytes:
    """Metres to a tenth of a millimetre, degrees to ten decimals (0.01 mm); UTF-8 without BOM."""
    header = "index,east_m,north_m,altitude_m"
    line = "%d,%.4f,%.4f,%.4f"
    if mission.has_place:
        header += ",latitude,longitude"
        line += ",%.10f,%.10f"
    ways = mission.waypoints
    columns = [ways.east_m, ways.north_m, ways.altitude_m]
    if ways.latitude is not None and ways.longitude is not None:
        columns += [ways.latitude, ways.longitude]
    lines = [line % row for row in zip(range(len(ways)), *columns, strict=True)]
    text = "\n".join([header, *lines]) + "\n"
    return _NEGATIVE_ZERO.sub("0", text).encode()
