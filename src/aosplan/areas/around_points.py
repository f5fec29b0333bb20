"""Areas around points.  Each area is a polygon that contains a disc around the point."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from aosplan.areas.boundary_file import (
    Outline,
    Point,
    check_globe,
    check_position,
    read_shapes,
)
from aosplan.areas.reprojection import change_of
from aosplan.errors import RequestError
from aosplan.geodesy import to_wgs84

if TYPE_CHECKING:
    from aosplan.messages import Message

CORNERS = 32
"""Number of corners of the polygon around a disc. The area of the polygon is 0.3 % larger than that
of the disc.
"""

MOST_POINTS = 1000


def read_surroundings(path: str, radius_m: float) -> Outline:
    """Read the points of a file, and return a polygon around each point.

    Parameters
    ----------
    path
        GeoJSON, KML or KMZ file with points.  Lines and polygons in the file are ignored.
    radius_m
        Radius of the disc around each point that belongs to the area.

    Raises
    ------
    RequestError
        If the file is not valid, has no points, or has more than `MOST_POINTS`.
    """
    found = read_shapes(path)
    if not found.points:
        raise RequestError(
            f"'{path}' contains no point", "if the file contains polygons, give it as --area"
        )
    if len(found.points) > MOST_POINTS:
        raise RequestError(
            f"'{path}' has {len(found.points)} points, more than {MOST_POINTS}",
            "keep the points with the largest contrast",
        )
    ignored = found.ignored.copy()
    for kind in ("Point", "MultiPoint"):
        ignored.pop(kind, None)
    if found.polygons:
        ignored["Polygon"] += len(found.polygons)
    angle = 2.0 * math.pi * np.arange(CORNERS + 1) / CORNERS
    angle[-1] = 0.0  # The last angle equals the first, so that the ring is closed.
    corner_m = radius_m / math.cos(math.pi / CORNERS)
    east_m, north_m = (corner_m * np.sin(angle)).tolist(), (corner_m * np.cos(angle)).tolist()
    polygons = []
    for point in found.points:
        longitude, latitude = _place_of(point, path, found.notices)
        place = to_wgs84((latitude, longitude), east_m, north_m)
        polygons.append([np.column_stack(place[::-1])])
    places = [point.place for point in found.points]
    return found._replace(polygons=polygons, places=places, ignored=ignored)


def _place_of(point: Point, path: str, notices: list[Message]) -> tuple[float, float]:
    """Longitude and latitude [deg] of a point, after a check."""
    place, position = f"'{path}': {point.place}", point.position
    if isinstance(position, list) and all(isinstance(part, str) for part in position):
        try:  # The coordinates of KML are text.
            position = [float(part) for part in position]
        except ValueError:
            position = point.position
    check_position(position, place)
    at = np.array([position[:2]], dtype=np.float64)
    change = change_of(point.crs, path, notices)
    if change is not None and np.isfinite(at).all():
        at = change.degrees(at, place)
    check_globe(at, place)
    return float(at[0, 0]), float(at[0, 1])
