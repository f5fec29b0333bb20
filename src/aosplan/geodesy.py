"""Local metres to latitude and longitude on the WGS 84 ellipsoid."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Sequence

FARTHEST_M = 1e6
"""Grids reach no farther from their origin."""


def to_wgs84(
    origin: tuple[float, float], east_m: Sequence[float], north_m: Sequence[float]
) -> tuple[list[float], list[float]]:
    """Latitudes and longitudes of points given east and north of an origin.

    The local frame is azimuthal equidistant: distance and azimuth from the origin are true on
    the ellipsoid, everywhere on earth.  Between neighbours r from the origin, distances are
    off by at most r²/(6 R²) of themselves: 1e-9 at 500 m, 2e-6 at 20 km.

    Parameters
    ----------
    origin
        Latitude and longitude [deg].
    east_m, north_m
        Offsets of N points [m].

    Raises
    ------
    RequestError
        Where a point is more than `FARTHEST_M` from the origin.

    Returns
    -------
    latitudes, longitudes
        Lists of N, degrees; longitudes in [-180, 180).
    """
    from pyproj import Geod

    azimuth = [math.degrees(math.atan2(e, n)) for e, n in zip(east_m, north_m, strict=True)]
    distance = [math.hypot(e, n) for e, n in zip(east_m, north_m, strict=True)]
    if max(distance, default=0.0) > FARTHEST_M:
        raise RequestError(
            f"the grid reaches {max(distance) / 1000.0:.4g} km from its origin, more than the "
            f"{FARTHEST_M / 1000.0:g} km that are placed on earth",
            "leave --origin out, or plan a smaller grid",
        )
    count = len(distance)
    longitudes, latitudes, _ = Geod(ellps="WGS84").fwd(
        [origin[1]] * count, [origin[0]] * count, azimuth, distance
    )
    return list(latitudes), [(longitude + 180.0) % 360.0 - 180.0 for longitude in longitudes]


def path_parts(
    latitude: Sequence[float], longitude: Sequence[float], altitude_m: Sequence[float]
) -> list[tuple[Sequence[float], Sequence[float], Sequence[float]]]:
    """A path as pieces of which none crosses the antimeridian: columns of each.

    A leg across it is cut there, on the straight line in longitude and latitude.
    """
    crossings = [
        index
        for index, (start, stop) in enumerate(pairwise(longitude), 1)
        if not -180.0 <= stop - start <= 180.0
    ]
    pieces = []
    lead: list[tuple[float, float, float]] = []
    for begin, end in pairwise([0, *crossings, len(longitude)]):
        columns = [column[begin:end] for column in (latitude, longitude, altitude_m)]
        tail: list[tuple[float, float, float]] = []
        follow: list[tuple[float, float, float]] = []
        if end < len(longitude):
            start, stop = longitude[end - 1], longitude[end]
            side = 180.0 if start > 0.0 else -180.0
            to_edge = side - start
            whole = to_edge + (stop + side)
            share = to_edge / whole if whole else 0.5
            cut = latitude[end - 1] + share * (latitude[end] - latitude[end - 1])
            tail, follow = [(cut, side, altitude_m[end - 1])], [(cut, -side, altitude_m[end])]
        if lead or tail:
            columns = [
                [*(point[axis] for point in lead), *column, *(point[axis] for point in tail)]
                for axis, column in enumerate(columns)
            ]
        pieces.append((columns[0], columns[1], columns[2]))
        lead = follow
    return pieces
