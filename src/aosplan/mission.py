"""Missions: waypoints in flight order and how they are flown, ready to be written by any format."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, NamedTuple, overload

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from aosplan.pattern import Pattern


class Waypoint(NamedTuple):
    """One position of a flight.

    East and north count from the centre of the grid, true north; the altitude from the ground
    there.  Latitude and longitude are WGS 84 degrees, or None without a place; `ground_m` is the
    ground's height above sea level, or None where it is not known.  Where `photo` is False the
    drone only turns.
    """

    index: int  # type: ignore[assignment]  # hides tuple.index, which nobody calls
    east_m: float
    north_m: float
    altitude_m: float
    latitude: float | None = None
    longitude: float | None = None
    ground_m: float | None = None
    photo: bool = True


@dataclass(frozen=True)
class Waypoints:
    """Waypoints in flight order, a column each of what `Waypoint` has; None: the same for all.

    Columns, since a mission may have a million of them.  Iterating gives `Waypoint` values.
    """

    east_m: Sequence[float]
    north_m: Sequence[float]
    altitude_m: Sequence[float]
    latitude: Sequence[float] | None = None
    longitude: Sequence[float] | None = None
    ground_m: Sequence[float] | None = None
    photo: Sequence[bool] | None = None

    def __len__(self) -> int:
        return len(self.east_m)

    def __iter__(self) -> Iterator[Waypoint]:
        return (self[index] for index in range(len(self)))

    @overload
    def __getitem__(self, place: int) -> Waypoint: ...

    @overload
    def __getitem__(self, place: slice) -> Waypoints: ...

    def __getitem__(self, place: int | slice) -> Waypoint | Waypoints:
        """One waypoint, or the columns of several."""
        if isinstance(place, slice):
            return Waypoints(**{name: column[place] for name, column in self.columns().items()})
        index = range(len(self))[place]
        return Waypoint(index, **{name: column[index] for name, column in self.columns().items()})

    def columns(self) -> dict[str, Sequence[Any]]:
        """The columns there are, by name."""
        named = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: column for name, column in named.items() if column is not None}

    @classmethod
    def of(cls, rows: Iterable[Waypoint]) -> Waypoints:
        """The columns of single waypoints; what the first one lacks is left out."""
        names = Waypoint._fields[1:]
        columns = dict(
            zip(names, map(list, zip(*(row[1:] for row in rows), strict=True)), strict=True)
        )
        kept = {name: column for name, column in columns.items() if column[0] is not None}
        if all(kept["photo"]):
            del kept["photo"]
        return cls(**kept)


class Conduct(NamedTuple):
    """How a mission is flown: what each format says beside the waypoints.

    The heading of the drone is fixed over the whole flight, clockwise from true north.  With
    trigger ``stop`` the drone holds at each site and takes a photo; with ``distance`` it flies
    on and the camera fires each `spacing_m`.  Latitude, longitude and height above sea level
    of the take-off are None where they are not known.
    """

    trigger: str = "stop"
    speed_mps: float = 5.0
    hold_s: float = 1.0
    spacing_m: float = 0.0
    yaw_deg: float = 0.0
    gimbal_pitch_deg: float = -90.0
    autopilot: str | None = None
    drone: str | None = None
    payload: str | None = None
    takeoff_latitude: float | None = None
    takeoff_longitude: float | None = None
    takeoff_ground_m: float | None = None


class Mission(NamedTuple):
    """What a format writes: waypoints in flight order, a summary of the plan, and the conduct.

    `flight` counts from 1, of `flights` into which a plan is split.
    """

    waypoints: Waypoints
    summary: dict[str, Any]
    conduct: Conduct = Conduct()
    flight: int = 1
    flights: int = 1

    @property
    def has_place(self) -> bool:
        """Whether the waypoints have latitudes and longitudes."""
        return self.waypoints.latitude is not None

    def above_takeoff_m(self) -> Sequence[float]:
        """Height of each waypoint above the take-off.

        Where the ground's height is not known, it is taken for as high as the take-off.
        """
        ground, takeoff = self.waypoints.ground_m, self.conduct.takeoff_ground_m
        altitudes = self.waypoints.altitude_m
        if ground is None or takeoff is None:
            return altitudes
        return [up + below - takeoff for up, below in zip(altitudes, ground, strict=True)]


def split(whole: Mission, ranges: Sequence[tuple[int, int]]) -> tuple[Mission, ...]:
    """A mission a flight, from the first and the last waypoint of each."""
    return tuple(
        whole._replace(
            waypoints=whole.waypoints[first : last + 1], flight=number, flights=len(ranges)
        )
        for number, (first, last) in enumerate(ranges, 1)
    )


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


def placed(waypoints: Waypoints, origin: tuple[float, float] | None) -> Waypoints:
    """Waypoints with latitudes and longitudes where a place is given for their east and north."""
    if origin is None:
        return waypoints
    from aosplan.geodesy import to_wgs84

    latitudes, longitudes = to_wgs84(origin, waypoints.east_m, waypoints.north_m)
    return replace(waypoints, latitude=latitudes, longitude=longitudes)
