"""Missions: waypoints in flight order, ready to be written by any format."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from aosplan.pattern import Pattern


class Waypoint(NamedTuple):
    """One photo position.

    East and north count from the centre of the grid, true north; the altitude from the ground
    there.  Latitude and longitude are WGS 84 degrees, or None without a place.
    """

    index: int  # type: ignore[assignment]  # hides tuple.index, which nobody calls
    east_m: float
    north_m: float
    altitude_m: float
    latitude: float | None = None
    longitude: float | None = None


class Mission(NamedTuple):
    """What a format writes: waypoints in flight order, and a summary of the plan."""

    waypoints: tuple[Waypoint, ...]
    summary: dict[str, Any]

    @property
    def has_place(self) -> bool:
        """Whether the waypoints have latitudes and longitudes."""
        return self.waypoints[0].latitude is not None


def local_sites(
    pattern: Pattern, baseline_m: float, heading_deg: float
) -> tuple[list[float], list[float]]:
    """Sites of a pattern in flight order, east and north of the rectangle's centre [m].

    x runs along the heading, y to its right; columns lie along x and rows along y.
    """
    heading = math.radians(math.fmod(heading_deg, 360.0))
    sine, cosine = math.sin(heading), math.cos(heading)
    east, north = [], []
    for row, column in pattern.sites():
        x = (column - 0.5 * (pattern.columns - 1)) * baseline_m
        y = (row - 0.5 * (pattern.rows - 1)) * pattern.row_pitch * baseline_m
        # Adding zero turns a negative zero into a plain one.
        east.append(x * sine + y * cosine + 0.0)
        north.append(x * cosine - y * sine + 0.0)
    return east, north


def waypoints_of(
    pattern: Pattern,
    baseline_m: float,
    *,
    heading_deg: float,
    altitude_m: float,
    origin: tuple[float, float] | None,
) -> tuple[Waypoint, ...]:
    """Waypoints of a pattern in flight order, with latitudes and longitudes where a place is given."""
    east, north = local_sites(pattern, baseline_m, heading_deg)
    if origin is None:
        return tuple(
            Waypoint(index, e, n, altitude_m)
            for index, (e, n) in enumerate(zip(east, north, strict=True))
        )
    from aosplan.geodesy import to_wgs84

    latitudes, longitudes = to_wgs84(origin, east, north)
    return tuple(
        Waypoint(index, e, n, altitude_m, latitude, longitude)
        for index, (e, n, latitude, longitude) in enumerate(
            zip(east, north, latitudes, longitudes, strict=True)
        )
    )
