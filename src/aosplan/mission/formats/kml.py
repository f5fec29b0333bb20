"""KML 2.2 (OGC 07-147r2): a Point per waypoint in flight order, and the path."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from aosplan.geodesy import path_parts
from aosplan.mission.format import Format
from aosplan.mission.formats.rows import blocks, rows
from aosplan.xml_text import xml_text

if TYPE_CHECKING:
    from aosplan.mission.mission import Mission

FORMAT = Format("kml", (".kml",), "KML", needs_place=True)

_MODE = "<altitudeMode>relativeToGround</altitudeMode><coordinates>"
_PLACE = "%.10f,%.10f,%.4f"
_STEP = f"{_PLACE}\n"


def render(mission: Mission) -> bytes:
    """Placemarks have the numbers of the plan, from 0; a path across the antimeridian is cut there."""
    ways = mission.waypoints
    assert ways.latitude is not None  # the format needs a place
    assert ways.longitude is not None
    kind = "" if ways.photo is None else "<description>%s</description>"
    kinds = [] if ways.photo is None else [["photo" if shot else "turn" for shot in ways.photo]]
    place = (ways.longitude, ways.latitude, ways.altitude_m)
    template = (
        f"<Placemark><name>%d</name>{kind}<Point>{_MODE}{_PLACE}</coordinates></Point>"
        "</Placemark>\n"
    )
    sites = (
        template,
        [range(mission.first_index, mission.first_index + len(ways)), *kinds, *place],
    )
    pieces = path_parts(*place)
    whole = [(_STEP, place)] if len(pieces) == 1 else []
    lines = [rows(_STEP, *piece) for piece in pieces if not whole]
    steps: list[bytes | bytearray] = []
    head = (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>\n'
        f"<name>{xml_text(mission.title)}</name>\n"
        "<description>Altitudes are metres above the ground at each point.</description>\n"
        "<Folder><name>waypoints</name>\n"
    )
    out = io.BytesIO()
    out.write(head.encode())
    for points, *line in blocks(sites, *whole):
        out.write(points)
        steps += line
    out.write(b"</Folder>\n")
    if len(ways) > 1:
        out.writelines(_path(lines or [b"".join(steps)]))
    out.write(b"</Document></kml>\n")
    return out.getvalue()


def _path(lines: list[bytes]) -> list[bytes]:
    start, stop = f"<LineString>{_MODE}".encode(), b"</coordinates></LineString>"
    pieces = [part for line in lines for part in (start, line, stop)]
    return [
        b"<Placemark><name>path</name><MultiGeometry>",
        *pieces,
        b"</MultiGeometry></Placemark>\n",
    ]
