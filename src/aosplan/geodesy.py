"""Conversion between local metres and latitude and longitude on the WGS 84 ellipsoid."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Sequence

FARTHEST_M = 1e6
"""Greatest distance [m] of a point from the origin of its local frame."""


def to_wgs84(
    origin: tuple[float, float], east_m: Sequence[float], north_m: Sequence[float]
) -> tuple[list[float], list[float]]:
    """Latitudes and longitudes of points that are given as metres east and north of an origin.

    The local frame is an azimuthal equidistant projection. Distances and azimuths from the origin
    are exact on the ellipsoid, everywhere on earth. The distance between two neighbouring points at
    the distance r from the origin has a relative error of at most r²/(6 R²), where R is the radius
    of the earth. This is 1e-9 at r = 500 m and 2e-6 at r = 20 km.

    Parameters
    ----------
    origin
        Latitude and longitude [deg].
    east_m, north_m
        Offsets of N points [m].

    Raises
    ------
    RequestError
        If a point is more than `FARTHEST_M` from the origin.

    Returns
    -------
    latitudes, longitudes
        Lists of N angles [deg]; longitudes in [-180, 180).
    """
    from pyproj import Geod

    azimuth = [math.degrees(math.atan2(e, n)) for e, n in zip(east_m, north_m, strict=True)]
    distance = [math.hypot(e, n) for e, n in zip(east_m, north_m, strict=True)]
    if max(distance, default=0.0) > FARTHEST_M:
        raise RequestError(
            f"the grid reaches {max(distance) / 1000.0:.4g} km from its origin, more "
            f"than the {FARTHEST_M / 1000.0:g} km for which coordinates are computed",
            "leave --origin out, or plan a smaller grid",
        )
    count = len(distance)
    longitudes, latitudes, _ = Geod(ellps="WGS84").fwd(
        [origin[1]] * count, [origin[0]] * count, azimuth, distance
    )
    return list(latitudes), [(longitude + 180.0) % 360.0 - 180.0 for longitude in longitudes]


def to_local(
    origin: tuple[float, float], latitudes: Sequence[float], longitudes: Sequence[float]
) -> tuple[list[float], list[float]]:
    """Convert latitudes and longitudes to metres east and north of an origin: the inverse of
    `to_wgs84`.
    """
    from pyproj import Geod

    count = len(latitudes)
    azimuth, _, distance = Geod(ellps="WGS84").inv(
        [origin[1]] * count, [origin[0]] * count, list(longitudes), list(latitudes)
    )
    turns = [math.radians(angle) for angle in azimuth]
    return (
        [length * math.sin(turn) for length, turn in zip(distance, turns, strict=True)],
        [length * math.cos(turn) for length, turn in zip(distance, turns, strict=True)],
    )


def local_crs(latitude: float, longitude: float) -> str:
    """The local frame of `to_wgs84` as a PROJ string, which GIS programs read."""
    return f"+proj=aeqd +lat_0={latitude:.9f} +lon_0={longitude:.9f} +datum=WGS84 +units=m +no_defs"


def path_parts(
    longitude: Sequence[float], latitude: Sequence[float], altitude_m: Sequence[float]
) -> list[tuple[Sequence[float], Sequence[float], Sequence[float]]]:
    """Split a path into parts that do not cross the antimeridian. Returns the columns of each part.

    A leg that crosses the antimeridian is cut there.  The leg is assumed to be straight in
    longitude and latitude.
    """
    if max(longitude) - min(longitude) <= 180.0:
        return [(longitude, latitude, altitude_m)]
    pieces: list[list[tuple[float, float, float]]] = [[]]
    for place in zip(longitude, latitude, altitude_m, strict=True):
        before = pieces[-1][-1] if pieces[-1] else place
        if abs(place[0] - before[0]) > 180.0:
            side = 180.0 if before[0] > 0.0 else -180.0
            to_edge = side - before[0]
            whole = to_edge + (place[0] + side)
            share = to_edge / whole if whole else 0.5
            middle = before[1] + share * (place[1] - before[1])
            pieces[-1].append((side, middle, before[2]))
            pieces.append([(-side, middle, place[2])])
        pieces[-1].append(place)
    columns = (tuple(zip(*piece, strict=True)) for piece in pieces)
    return [(east, north, up) for east, north, up in columns]
