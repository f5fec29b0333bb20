"""GeoJSON (RFC 7946): one Point per waypoint in flight order, then the path as a LineString."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from aosplan.geodesy import path_parts
from aosplan.mission.format import Format
from aosplan.mission.formats import csv
from aosplan.mission.formats.csv import columns, rows

if TYPE_CHECKING:
    from aosplan.mission.mission import Mission

FORMAT = Format("geojson", (".geojson",), "GeoJSON", needs_place=True)

_PLACE = "[%.10f, %.10f, %.4f]"


notes = csv.notes


def render(mission: Mission) -> bytes:
    """Write longitude, latitude and altitude; the foreign member ``aosplan`` contains the plan.

    A path across the antimeridian is cut into a MultiLineString, as RFC 7946 requires.
    """
    ways = mission.waypoints
    assert ways.latitude is not None  # The format requires a location.
    assert ways.longitude is not None
    known = columns(mission)
    properties = ", ".join(f'"{name}": {mark}' for name, (mark, _) in known.items())
    place = (ways.longitude, ways.latitude, ways.altitude_m)
    template = (
        f'{{"type": "Feature", "geometry": {{"type": "Point", "coordinates": {_PLACE}}}, '
        f'"properties": {{{properties}}}}},\n'
    )
    features = rows(template, *place, *(column for _, column in known.values()))
    if len(ways) > 1:
        features += _path([rows(f"{_PLACE},\n", *piece) for piece in path_parts(*place)])
    summary = json.dumps(mission.summary, ensure_ascii=False, allow_nan=False, indent=1)
    return b"".join(
        [
            b'{"type": "FeatureCollection",\n',
            b'"altitudes": "metres above the ground at each point",\n"features": [\n',
            features.removesuffix(b",\n"),
            b'\n],\n"aosplan": %b}\n' % summary.encode(),
        ]
    )


def _path(lines: list[bytes]) -> bytes:
    """The path as the last feature: one line, or several lines if the path crosses the
    antimeridian.
    """
    parts = [line.removesuffix(b",\n") for line in lines]
    kind, places = b"LineString", parts[0]
    if len(parts) > 1:
        kind, places = b"MultiLineString", b",\n".join(b"[%b]" % part for part in parts)
    return (
        b'{"type": "Feature", "geometry": {"type": "%b", "coordinates": [%b]}, '
        b'"properties": {"name": "path"}}' % (kind, places)
    )
