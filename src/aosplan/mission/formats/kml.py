"""KML 2.2 (OGC 07-147r2): one Point per waypoint in flight order, and the path."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.geodesy import path_parts
from aosplan.mission.format import Format
from aosplan.mission.formats.csv import rows
from aosplan.xml_text import xml_text

if TYPE_CHECKING:
    from aosplan.mission.mission import Mission

FORMAT = Format("kml", (".kml",), "KML", needs_place=True)

_MODE = "<altitudeMode>relativeToGround</altitudeMode><coordinates>"
_PLACE = "%.10f,%.10f,%.4f"


def render(mission: Mission) -> bytes:
    """Write placemarks whose names are the indices in the plan, from 0.  The path is cut at the
    antimeridian.
    """
    ways = mission.waypoints
    assert ways.latitude is not None  # The format requires a location.
    assert ways.longitude is not None
    kind = "" if ways.photo is None else "<description>%s</description>"
    kinds = [] if ways.photo is None else [["photo" if shot else "turn" for shot in ways.photo]]
    place = (ways.longitude, ways.latitude, ways.altitude_m)
    template = (
        f"<Placemark><name>%d</name>{kind}<Point>{_MODE}{_PLACE}</coordinates></Point>"
        "</Placemark>\n"
    )
    numbers = range(mission.first_index, mission.first_index + len(ways))
    head = (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>\n'
        f"<name>{xml_text(mission.title)}</name>\n"
        "<description>Altitudes are metres above the ground at each point.</description>\n"
        "<Folder><name>waypoints</name>\n"
    )
    lines = [rows(f"{_PLACE}\n", *piece) for piece in path_parts(*place)]
    return b"".join(
        [
            head.encode(),
            rows(template, numbers, *kinds, *place),
            b"</Folder>\n",
            *(_path(lines) if len(ways) > 1 else []),
            b"</Document></kml>\n",
        ]
    )


def _path(lines: list[bytes]) -> list[bytes]:
    start, stop = f"<LineString>{_MODE}".encode(), b"</coordinates></LineString>"
    pieces = [part for line in lines for part in (start, line, stop)]
    return [
        b"<Placemark><name>path</name><MultiGeometry>",
        *pieces,
        b"</MultiGeometry></Placemark>\n",
    ]
