"""GeoJSON (RFC 7946): a Point per waypoint in flight order, then the path as a LineString."""

from __future__ import annotations

import io
import json
from typing import TYPE_CHECKING

from aosplan.geodesy import path_parts
from aosplan.mission.format import Format
from aosplan.mission.formats.csv import columns
from aosplan.mission.formats.rows import blocks, rows

if TYPE_CHECKING:
    from aosplan.mission.mission import Mission

FORMAT = Format("geojson", (".geojson",), "GeoJSON", needs_place=True)

_PLACE = "[%.10f, %.10f, %.4f]"
_STEP = f"{_PLACE},\n"


def render(mission: Mission) -> bytes:
    """Coordinates are longitude, latitude, altitude; the foreign member ``aosplan`` has the plan.

    A path across the antimeridian is cut there into a MultiLineString, as RFC 7946 asks.
    """
    ways = mission.waypoints
    assert ways.latitude is not None  # the format needs a place
    assert ways.longitude is not None
    known = columns(mission)
    properties = ", ".join(f'"{name}": {mark}' for name, (mark, _) in known.items())
    place = (ways.longitude, ways.latitude, ways.altitude_m)
    template = (
        f'{{"type": "Feature", "geometry": {{"type": "Point", "coordinates": {_PLACE}}}, '
        f'"properties": {{{properties}}}}},\n'
    )
    sites = (template, [*place, *(column for _, column in known.values())])
    pieces = path_parts(*place)
    whole = [(_STEP, place)] if len(pieces) == 1 else []
    lines = [rows(_STEP, *piece) for piece in pieces if not whole]
    steps: list[bytes | bytearray] = []
    out = io.BytesIO()
    out.write(b'{"type": "FeatureCollection",\n')
    out.write(b'"altitudes": "metres above the ground at each point",\n"features": [\n')
    for points, *line in blocks(sites, *whole):
        out.write(points)
        steps += line
    if len(ways) > 1:
        out.writelines(_path(lines or [b"".join(steps)]))
    else:
        out.seek(-2, io.SEEK_CUR)  # no feature follows its comma
    summary = json.dumps(mission.summary, ensure_ascii=False, allow_nan=False, indent=1)
    out.write(b'\n],\n"aosplan": %b}\n' % summary.encode())
    return out.getvalue()


def _path(lines: list[bytes]) -> list[bytes | memoryview]:
    """The last feature, in pieces: one line, or several where it is cut."""
    head = b'{"type": "Feature", "geometry": {"type": "%b", "coordinates": ['
    tail = b']}, "properties": {"name": "path"}}'
    # Each piece ends in a comma and a line break, which its last place must not have.
    if len(lines) == 1:
        return [head % b"LineString", memoryview(lines[0])[:-2], tail]
    parts = [b"[%b]" % line[:-2] for line in lines]
    return [head % b"MultiLineString", b",\n".join(parts), tail]
