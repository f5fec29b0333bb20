"""CSV: a header line and a line per waypoint, in flight order."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.export import Format

if TYPE_CHECKING:
    from aosplan.mission import Mission

FORMAT = Format("csv", (".csv",), "CSV", needs_place=False)


def render(mission: Mission) -> bytes:
    """Metres to a tenth of a millimetre, degrees to ten decimals (0.01 mm); UTF-8 without BOM."""
    header = "index,east_m,north_m,altitude_m"
    if mission.has_place:
        lines = [
            f"{w.index},{w.east_m:.4f},{w.north_m:.4f},{w.altitude_m:.4f},"
            f"{w.latitude:.10f},{w.longitude:.10f}"
            for w in mission.waypoints
        ]
        header += ",latitude,longitude"
    else:
        lines = [
            f"{w.index},{w.east_m:.4f},{w.north_m:.4f},{w.altitude_m:.4f}"
            for w in mission.waypoints
        ]
    return ("\n".join([header, *lines]) + "\n").replace("-0.0000,", "0.0000,").encode()
