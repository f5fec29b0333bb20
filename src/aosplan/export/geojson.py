"""GeoJSON (RFC 7946): a Point per waypoint in flight order, then the path as a LineString."""

from __future__ import annotations

import json
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from aosplan.export import Format
from aosplan.summary import waypoints_document

if TYPE_CHECKING:
    from aosplan.mission import Mission, Waypoint

FORMAT = Format("geojson", (".geojson",), "GeoJSON", needs_place=True)


def render(mission: Mission) -> bytes:
    """Coordinates are longitude, latitude, altitude; the foreign member ``aosplan`` has the plan.

    A path across the antimeridian is cut there into a MultiLineString, as RFC 7946 asks.
    """
    features: list[dict[str, Any]] = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": _coordinates(waypoint)},
            "properties": {name: _rounded(name, value) for name, value in row.items()},
        }
        for waypoint, row in zip(
            mission.waypoints, waypoints_document(mission.waypoints), strict=True
        )
    ]
    if len(mission.waypoints) > 1:
        features.append(
            {
                "type": "Feature",
                "geometry": _path([_coordinates(waypoint) for waypoint in mission.waypoints]),
                "properties": {"name": "path"},
            }
        )
    collection = {
        "type": "FeatureCollection",
        "features": features,
        "aosplan": mission.summary,
    }
    return (json.dumps(collection, ensure_ascii=False, allow_nan=False, indent=1) + "\n").encode()


def _coordinates(waypoint: Waypoint) -> list[float]:
    assert waypoint.longitude is not None  # the format needs a place
    assert waypoint.latitude is not None
    return [
        round(waypoint.longitude, 10),
        round(waypoint.latitude, 10),
        round(waypoint.altitude_m, 4),
    ]


def _rounded(name: str, value: float) -> float:
    return (
        value
        if name in {"index", "photo"}
        else round(value, 4 if name.endswith("_m") else 10) + 0.0
    )


def _path(points: list[list[float]]) -> dict[str, Any]:
    parts = [[points[0]]]
    for start, stop in pairwise(points):
        if abs(stop[0] - start[0]) > 180.0:
            side = 180.0 if start[0] > 0.0 else -180.0
            to_edge = side - start[0]
            whole = to_edge + (stop[0] + side)
            share = to_edge / whole if whole else 0.5
            latitude = round(start[1] + share * (stop[1] - start[1]), 10)
            parts[-1].append([side, latitude, start[2]])
            parts.append([[-side, latitude, stop[2]]])
        parts[-1].append(stop)
    if len(parts) == 1:
        return {"type": "LineString", "coordinates": parts[0]}
    return {"type": "MultiLineString", "coordinates": parts}
