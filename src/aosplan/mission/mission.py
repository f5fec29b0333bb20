"""Missions: waypoints in flight order, and flight settings. All file formats are written from
missions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, NamedTuple, overload

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


LEVEL_M = 0.01
"""Heights that differ by less than this are treated as equal."""

LEAST_LEG_M = 0.5
"""Shortest leg that DJI's flight controllers accept."""

FRAMES = ("takeoff", "terrain")
"""Reference of the heights in a file: the take-off point, or the ground in the terrain data of the
autopilot.
"""


class Waypoint(NamedTuple):
    """One position of a flight.

    `east_m` and `north_m` are relative to the centre of the grid and refer to true north.
    `altitude_m` is above the ground at this position.  Latitude and longitude are WGS 84 degrees,
    or None if the plan has no location.  `ground_m` is the height of the ground above sea level, or
    None if this height is not known.  If `photo` is False, no photo is taken at this position.
    """

    index: int  # type: ignore[assignment]  # hides tuple.index, which nobody calls
    east_m: float
    north_m: float
    altitude_m: float
    latitude: float | None = None
    longitude: float | None = None
    ground_m: float | None = None
    photo: bool = True


@dataclass(frozen=True, repr=False)
class Waypoints(Sequence[Waypoint]):
    """Waypoints in flight order, as one column per field of `Waypoint`.

    A column is None if all waypoints have the default of that field.  A mission may have a million
    waypoints, and columns take less memory than tuples.  Iteration gives `Waypoint` values, which
    pandas and polars accept as rows.  `columns` gives a dictionary of the columns.
    ``GeoDataFrame.from_features`` of GeoPandas reads the points.
    """

    east_m: Sequence[float]
    north_m: Sequence[float]
    altitude_m: Sequence[float]
    latitude: Sequence[float] | None = None
    longitude: Sequence[float] | None = None
    ground_m: Sequence[float] | None = None
    photo: Sequence[bool] | None = None

    def __repr__(self) -> str:
        return f"<{len(self)} waypoints: {', '.join(self.columns())}>"

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """A GeoJSON FeatureCollection of points: longitude, latitude, height above the ground.

        Raises
        ------
        RequestError
            If the waypoints have no latitudes and longitudes.
        """
        if self.latitude is None or self.longitude is None:
            raise RequestError(
                "waypoints without a location have no geographic coordinates",
                "give the plan origin=(LAT, LON) or area=FILE, or use east_m and north_m",
            )
        columns = self.columns()
        names = [name for name in columns if name not in ("latitude", "longitude")]
        return {
            "type": "FeatureCollection",
            "features": [
                {
                    "type": "Feature",
                    "id": str(index),
                    "geometry": {
                        "type": "Point",
                        "coordinates": (
                            self.longitude[index],
                            self.latitude[index],
                            self.altitude_m[index],
                        ),
                    },
                    "properties": {"index": index, **{n: columns[n][index] for n in names}},
                }
                for index in range(len(self))
            ],
        }

    def document(self) -> list[dict[str, Any]]:
        """One row for each waypoint, in flight order."""
        names, columns = zip(*self.columns().items(), strict=True)
        return [
            {"index": index} | dict(zip(names, row, strict=True))
            for index, row in enumerate(zip(*columns, strict=True))
        ]

    def __len__(self) -> int:
        return len(self.east_m)

    def __iter__(self) -> Iterator[Waypoint]:
        return (self[index] for index in range(len(self)))

    @overload
    def __getitem__(self, place: int) -> Waypoint: ...

    @overload
    def __getitem__(self, place: slice) -> Waypoints: ...

    def __getitem__(self, place: int | slice) -> Waypoint | Waypoints:
        """One waypoint, or the columns of a slice."""
        if isinstance(place, slice):
            return Waypoints(**{name: column[place] for name, column in self.columns().items()})
        index = range(len(self))[place]
        return Waypoint(index, **{name: column[index] for name, column in self.columns().items()})

    def columns(self) -> dict[str, Sequence[Any]]:
        """The columns that are not None, by name."""
        named = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: column for name, column in named.items() if column is not None}

    @classmethod
    def of(cls, rows: Iterable[Waypoint]) -> Waypoints:
        """Make columns from single waypoints. If a field is None in the first waypoint, its column
        is left out.
        """
        names = Waypoint._fields[1:]
        columns = dict(
            zip(names, map(list, zip(*(row[1:] for row in rows), strict=True)), strict=True)
        )
        kept = {name: column for name, column in columns.items() if column[0] is not None}
        if all(kept["photo"]):
            del kept["photo"]
        return cls(**kept)


class FlightSettings(NamedTuple):
    """Settings of the flight, which a format needs in addition to the waypoints.

    - The yaw of the drone is fixed for the whole flight, clockwise from true north.
    - `trigger`: with ``stop`` the drone holds at each site and takes a photo; with ``distance`` it
      flies on, and the camera takes a photo every `spacing_m`.
    - Latitude, longitude and height above sea level of the take-off point are None if they are not
      known.
    - `height_datum`: the vertical datum of the ground heights, if the terrain file names it
      (``ellipsoid``: the WGS 84 ellipsoid).
    - `altitude_frame`: ``takeoff`` for heights above the take-off point, or ``terrain`` for heights
      above the ground in the terrain data of the autopilot.
    - `most_waypoints`: largest number of waypoints that the drone accepts in one file, if it is
      known; `file_waypoints`: the largest number that the user gives.
    - `mission_formats`: formats that the drone flies, if they are known.
    - `transit_mps`: speed to, from and between lines; if it is None, it equals the speed between
      photos.
    - `transit_climb_m`, `transit_return_m`: heights above the take-off point on the way to the
      first waypoint and on the way back from any waypoint; if they are None, the height of the
      highest waypoint is used.
    - `camera_control`: how PX4 triggers the camera: with the commands of MAVLink's camera protocol
      (``mavlink``), or with PX4's own outputs.
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
    altitude_frame: str = "takeoff"
    most_waypoints: int | None = None
    camera_control: str | None = None
    height_datum: str | None = None
    file_waypoints: int | None = None
    mission_formats: tuple[str, ...] | None = None
    transit_mps: float | None = None
    transit_climb_m: float | None = None
    transit_return_m: float | None = None


class Mission(NamedTuple):
    """The content of a mission file: waypoints in flight order, a summary of the plan, and flight
    settings.

    A plan has `flights` flights, and `flight` is the number of this flight, counted from 1. A
    flight that is too long for one file is split into `parts` files, and `part` is the number of
    this file, counted from 1. `first_index` is the index that the first waypoint has in the whole
    plan, counted from 0.
    """

    waypoints: Waypoints
    summary: dict[str, Any]
    settings: FlightSettings = FlightSettings()
    flight: int = 1
    flights: int = 1
    part: int = 1
    parts: int = 1
    first_index: int = 0

    @property
    def title(self) -> str:
        """A one-line description of the mission; it may contain any characters."""
        scene = self.summary.get("scene")
        name = scene.get("name") if isinstance(scene, dict) else None
        photos = len(self.waypoints) if self.waypoints.photo is None else sum(self.waypoints.photo)
        return (
            f"{photos} photos"
            + (f" over {name}" if name else "")
            + (f", flight {self.flight} of {self.flights}" if self.flights > 1 else "")
            + (f", part {self.part} of {self.parts}" if self.parts > 1 else "")
        )

    @property
    def has_place(self) -> bool:
        """Whether the waypoints have latitude and longitude."""
        return self.waypoints.latitude is not None

    def above_takeoff_m(self) -> Sequence[float]:
        """Height of each waypoint above the take-off point.

        If the height of the ground is not known, the ground is assumed to be as high as the
        take-off point.
        """
        ground, takeoff = self.waypoints.ground_m, self.settings.takeoff_ground_m
        altitudes = self.waypoints.altitude_m
        if ground is None or takeoff is None:
            return altitudes
        return [up + below - takeoff for up, below in zip(altitudes, ground, strict=True)]

    def flown_m(self) -> Sequence[float]:
        """Height of each waypoint in the altitude frame of `FlightSettings`."""
        terrain = self.settings.altitude_frame == "terrain"
        return self.waypoints.altitude_m if terrain else self.above_takeoff_m()

    def climb_m(self) -> float:
        """Height above the take-off point at which the drone flies to its first waypoint."""
        climb = self.settings.transit_climb_m
        # A later part of a flight starts at another waypoint. The height of the transit therefore
        # has to be safe for all waypoints.
        return self.return_m() if climb is None or self.part > 1 else climb

    def return_m(self) -> float:
        """Height above the take-off point at which the drone returns from any waypoint."""
        highest = max(*self.above_takeoff_m(), LEAST_CLIMB_M)
        return max(self.settings.transit_return_m or 0.0, highest)

    @property
    def transit_mps(self) -> float:
        """Speed to, from and between lines."""
        return self.settings.transit_mps or self.settings.speed_mps

    def home(self) -> tuple[float, float]:
        """Latitude and longitude of the take-off point. If the take-off point is not known, the
        first waypoint is used.
        """
        settings, ways = self.settings, self.waypoints
        assert ways.latitude is not None  # The formats that use this property require a location.
        assert ways.longitude is not None
        if settings.takeoff_latitude is None or settings.takeoff_longitude is None:
            return ways.latitude[0], ways.longitude[0]
        return settings.takeoff_latitude, settings.takeoff_longitude


def check_hold(autopilot: str | None, hold_s: float) -> None:
    """Refuse a hold that the autopilot would ignore or shorten.

    Raises
    ------
    RequestError
        If the hold for ArduPilot is not a whole number of seconds of at least 1, or if the hold for
        PX4 is shorter than `PX4_LEAST_HOLD_S`.  AP_Mission stores whole seconds, and ArduCopter
        does not stop at a waypoint without a hold.
    """
    if autopilot == "ardupilot" and (hold_s < 1.0 or hold_s != math.floor(hold_s)):
        raise RequestError(
            f"--hold {hold_s:g} s is not possible, because ArduPilot holds only for whole seconds and "
            "does not stop at waypoints with a hold of 0",
            f"give --hold {max(1, math.ceil(hold_s))}, or --trigger distance for "
            "photos while flying",
        )
    if autopilot == "px4" and hold_s < PX4_LEAST_HOLD_S:
        raise RequestError(
            f"--hold {hold_s:g} s is not possible, because PX4 does not stop at waypoints with a hold of 0",
            f"give --hold {PX4_LEAST_HOLD_S:g} or longer, or --trigger distance for "
            "photos while flying",
        )


PX4_LEAST_HOLD_S = 0.2
"""Shortest hold for PX4.  PX4 stops for any hold greater than zero, but half of the hold has to be
longer than the shutter lag.
"""

LEAST_CLIMB_M = 5.0
"""Lowest height above the take-off point at which a drone starts its horizontal flight."""

STRAIGHT = 0.02
"""Relative tolerance for the direction and the spacing of the legs of a line."""


def photo_lines(mission: Mission) -> list[tuple[int, int]]:
    """First and last waypoint of each straight line on which the camera is triggered by distance.

    Every waypoint with a photo is on exactly one line.  On a line, photos are one spacing apart and
    the course does not change.  Between the photos, the line may have waypoints without a photo.  A
    line may consist of a single waypoint.
    """
    ways, spacing = mission.waypoints, mission.settings.spacing_m
    photo = ways.photo or [True] * len(ways)
    found: list[tuple[int, int]] = []
    along: tuple[float, float] | None = None
    for index, (east, north) in enumerate(zip(ways.east_m, ways.north_m, strict=True)):
        if not photo[index]:
            continue
        if found:
            last = found[-1][1]
            step = (east - ways.east_m[last], north - ways.north_m[last])
            length = math.hypot(*step)
            flown = sum(
                math.hypot(
                    ways.east_m[k + 1] - ways.east_m[k], ways.north_m[k + 1] - ways.north_m[k]
                )
                for k in range(last, index)
            )
            if flown - length < STRAIGHT * spacing and abs(length - spacing) < STRAIGHT * spacing:
                course = (step[0] / length, step[1] / length)
                if along is None or math.dist(course, along) < STRAIGHT:
                    found[-1] = (found[-1][0], index)
                    along = along or course
                    continue
        found.append((index, index))
        along = None
    return found


class FlightShare(NamedTuple):
    """The part of a mission that belongs to one flight: first and last waypoint, and transit
    heights.
    """

    first: int
    last: int
    climb_m: float | None = None
    return_m: float | None = None


def split(whole: Mission, shares: Sequence[FlightShare]) -> tuple[Mission, ...]:
    """Split a mission into one mission per flight."""
    return tuple(
        whole._replace(
            waypoints=whole.waypoints[share.first : share.last + 1],
            settings=whole.settings._replace(
                transit_climb_m=share.climb_m, transit_return_m=share.return_m
            ),
            flight=number,
            flights=len(shares),
            first_index=share.first,
        )
        for number, share in enumerate(shares, 1)
    )


def way_height_m(waypoint_m: float, least_m: float) -> float:
    """Height of the horizontal part of the transit to a waypoint, or back from a waypoint [m].

    If the transit has to be above the waypoint, the vertical leg between them is at least
    `LEAST_LEG_M` long.
    """
    if least_m <= waypoint_m + LEVEL_M:
        return waypoint_m
    return max(least_m, waypoint_m + LEAST_LEG_M)


def placed(waypoints: Waypoints, origin: tuple[float, float] | None) -> Waypoints:
    """Add latitudes and longitudes to waypoints, if the location of their origin is given."""
    if origin is None:
        return waypoints
    from aosplan.geodesy import to_wgs84

    latitudes, longitudes = to_wgs84(origin, waypoints.east_m, waypoints.north_m)
    return replace(waypoints, latitude=latitudes, longitude=longitudes)
