"""KML 2.2 (OGC 07-147r2): a Point per waypoint in flight order, and the path."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.export import Format
from aosplan.geodesy import path_parts
from aosplan.markup import xml_text
from aosplan.rows import rows

if TYPE_CHECKING:
    from aosplan.mission import Mission, Waypoints

FORMAT = Format("kml", (".kml",), "KML", needs_place=True)

_MODE = "<altitudeMode>relativeToGround</altitudeMode><coordinates>"


def render(mission: Mission) -> bytes:
    """Placemarks are numbered from 1; a path across the antimeridian is cut there."""
    ways = mission.waypoints
    assert ways.latitude is not None  # the format needs a place
    assert ways.longitude is not None
    kind = "" if ways.photo is None else "<description>%s</description>"
    kinds = [] if ways.photo is None else [["photo" if shot else "turn" for shot in ways.photo]]
    points = rows(
        f"<Placemark><name>%d</name>{kind}<Point>{_MODE}%.10f,%.10f,%.4f</coordinates></Point>"
        "</Placemark>\n",
        range(1, len(ways) + 1),
        *kinds,
        ways.longitude,
        ways.latitude,
        ways.altitude_m,
    )
    head = (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>\n'
        f"<name>{xml_text(mission.title)}</name>\n"
        "<description>Altitudes are metres above the ground at each point.</description>\n"
        "<Folder><name>waypoints</name>\n"
    )
    return b"".join(
        [
            head.encode(),
            points,
            b"</Folder>\n",
            *([_path(ways)] if len(ways) > 1 else []),
            b"</Document></kml>\n",
        ]
    )


def _path(ways: Waypoints) -> bytes:
    assert ways.latitude is not None
    assert ways.longitude is not None
    lines = b"".join(
        b"<LineString>%b%b</coordinates></LineString>"
        % (_MODE.encode(), rows("%.10f,%.10f,%.4f\n", longitude, latitude, altitude))
        for latitude, longitude, altitude in path_parts(
            ways.latitude, ways.longitude, ways.altitude_m
        )
    )
    return b"<Placemark><name>path</name><MultiGeometry>%b</MultiGeometry></Placemark>\n" % lines
