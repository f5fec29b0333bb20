"""GeoJSON (RFC 7946): a Point per waypoint in flight order, then the path as a LineString."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from aosplan.export import Format
from aosplan.export.csv import columns
from aosplan.geodesy import path_parts
from aosplan.rows import rows

if TYPE_CHECKING:
    from aosplan.mission import Mission, Waypoints

FORMAT = Format("geojson", (".geojson",), "GeoJSON", needs_place=True)

_PLACE = "[%.10f, %.10f, %.4f]"


def render(mission: Mission) -> bytes:
    """Coordinates are longitude, latitude, altitude; the foreign member ``aosplan`` has the plan.

    A path across the antimeridian is cut there into a MultiLineString, as RFC 7946 asks.
    """
    ways = mission.waypoints
    assert ways.latitude is not None  # the format needs a place
    assert ways.longitude is not None
    known = columns(mission)
    properties = ", ".join(f'"{name}": {mark}' for name, (mark, _) in known.items())
    points = rows(
        f'{{"type": "Feature", "geometry": {{"type": "Point", "coordinates": {_PLACE}}}, '
        f'"properties": {{{properties}}}}},\n',
        ways.longitude,
        ways.latitude,
        ways.altitude_m,
        *(column for _, column in known.values()),
    )
    summary = json.dumps(mission.summary, ensure_ascii=False, allow_nan=False, indent=1)
    return b"".join(
        [
            b'{"type": "FeatureCollection",\n"altitudes": "metres above the ground at each point",\n',
            b'"features": [\n',
            *([points, _path(ways)] if len(ways) > 1 else [points[:-2]]),
            b'\n],\n"aosplan": ',
            summary.encode(),
            b"}\n",
        ]
    )


def _path(ways: Waypoints) -> bytes:
    assert ways.latitude is not None
    assert ways.longitude is not None
    parts = [
        b"[%b]" % rows(f"{_PLACE},\n", longitude, latitude, altitude)[:-2]
        for latitude, longitude, altitude in path_parts(
            ways.latitude, ways.longitude, ways.altitude_m
        )
    ]
    kind, lines = (
        (b"LineString", parts[0])
        if len(parts) == 1
        else (b"MultiLineString", b"[%b]" % b",\n".join(parts))
    )
    return (
        b'{"type": "Feature", "geometry": {"type": "%b", "coordinates": %b}, '
        b'"properties": {"name": "path"}}' % (kind, lines)
    )
