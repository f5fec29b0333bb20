"""The route of a plan: adds turns, heights and flights to its sites.

Sites are given in flight order, east and north of the origin. If photos are taken while flying, the
points at which the drone turns are added. If there is a terrain file, points that keep the drone
above the ground are added. If the route takes longer than the flight time of a battery, it is split
into flights.
"""

from __future__ import annotations

import math
from contextlib import nullcontext
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from aosplan.errors import RequestError
from aosplan.flight.batteries import Flight, TakeoffPoint, flights_of
from aosplan.flight.kinematics import SpeedBound, Timing, lowest_bound, steady, wind_mps
from aosplan.flight.track import FlightPoints, Ground, Track, with_turns
from aosplan.geodesy import FARTHEST_M, to_local, to_wgs84
from aosplan.messages import Limit
from aosplan.mission.mission import LEAST_CLIMB_M, Waypoints, placed, way_height_m

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.flight.drones import DronePreset
    from aosplan.flight.terrain import Terrain

T = TypeVar("T")

LEAST_RUN_IN_M = 1.0
"""Shortest run-in. Autopilots refuse legs that are too short: DJI documents a minimum of half a
metre.
"""

LONGEST_RUN_IN_M = 1000.0
"""Longest accepted run-in. If a longer run-in is needed, the plan is refused."""


class Route(NamedTuple):
    """Waypoints in flight order, the settings of the flight, and the flights into which they are
    split.

    `length_m` and `time_s` are the length and the time of the path from the first photo to the
    last. `closer_by_m` and `farther_by_m` describe the height above ground between two waypoints.
    They are the largest amounts by which it is below and above the height at these waypoints.
    `highest_way_m` is the greatest height above ground on the paths from the take-off point and
    back to it. Heights of the ground are above `datum`. `wind_delay_s` has two times: the time that
    the wind adds to `time_s`, and the time that it adds to all flights from take-off to landing. It
    is None without wind.

    The take-off point is None if nothing depends on it.
    """

    waypoints: Waypoints
    timing: Timing
    flights: tuple[Flight, ...]
    length_m: float
    time_s: float
    limits: tuple[Limit, ...] = ()
    takeoff: tuple[float, float] | None = None
    takeoff_ground_m: float | None = None
    closer_by_m: float = 0.0
    farther_by_m: float = 0.0
    highest_way_m: float | None = None
    datum: str | None = None
    wind_delay_s: tuple[float, float] | None = None

    @property
    def total_time_s(self) -> float:
        """Time of all flights, from take-off to landing."""
        return math.fsum(flight.time_s for flight in self.flights)


class Wind(NamedTuple):
    """Wind speed, the direction from which the wind comes, and the highest airspeed of the
    drone.
    """

    speed_mps: float
    from_deg: float
    airspeed_mps: float


class FlightInputs(NamedTuple):
    """Settings of the flight, including all defaults.

    `speed_mps` is the requested speed.  `speed_bounds` are upper limits of the speed that do not
    depend on the baseline.  `drone_name` is the name in the request, `drone` is the preset of the
    drone, and `terrain` is the path of the terrain file.  A value is None if the request does not
    give it and it is not known.
    """

    trigger: str
    speed_mps: float
    speed_bounds: tuple[SpeedBound, ...]
    transit_mps: float
    acceleration_mps2: float
    climb_mps: float
    hold_s: float
    photo_interval_s: float | None
    wind: Wind | None
    takeoff: tuple[float, float] | None
    flight_time_min: float | None
    file_waypoints: int | None
    resume_at: int | None
    clearance_m: float
    terrain: str | None
    terrain_units: str | None
    terrain_tolerance_m: float
    altitude_frame: str
    autopilot: str | None
    camera_control: str | None
    payload: str | None
    drone_name: str | None
    drone: DronePreset | None

    @property
    def bound(self) -> SpeedBound | None:
        """The lowest limit of the speed that does not depend on the baseline, or None."""
        return lowest_bound(self.speed_mps, self.speed_bounds)

    def timing(self, heading_deg: float) -> Timing:
        """Speeds and times, if the baseline is not yet known. The axes are along a heading and to
        its right.

        Raises
        ------
        InfeasibleError
            If the wind is too strong.
        """
        through, bound = self.trigger == "distance", self.bound
        timing = Timing(
            speed_mps=bound.speed_mps if bound else self.speed_mps,
            acceleration_mps2=self.acceleration_mps2,
            hold_s=0.0 if through else self.hold_s,
            climb_mps=self.climb_mps,
            fly_through=through,
            interval_s=(self.photo_interval_s or 0.0) if through else 0.0,
            least_run_in_m=LEAST_RUN_IN_M,
            transit_mps=self.transit_mps,
        )
        if self.wind is not None:
            wind = wind_mps(self.wind.speed_mps, self.wind.from_deg, heading_deg)
            timing = timing._replace(wind=wind, airspeed_mps=self.wind.airspeed_mps)
            timing.ground_speed_mps(1.0, 0.0)  # This raises an error if the wind is too strong.
        return timing


def speed_bounds(
    drone: DronePreset | None, blur: tuple[float, float] | None, gsd_m: float
) -> tuple[SpeedBound, ...]:
    """The limits of the speed that do not depend on the baseline: the top speed of the drone, and
    the speed that the largest allowed motion blur permits.

    If photos are taken while flying, `blur` has the largest motion blur [px] and the exposure time
    t [s].  At a speed v, the ground moves by v t / GSD pixels during an exposure.
    """
    bounds = []
    if drone is not None:
        text = f"the {drone.title} does not fly missions at a higher speed"
        bounds.append(SpeedBound(drone.airspeed_mps, text))
    if blur is not None:
        text = (
            f"the ground moves {blur[0]:g} px during --exposure-time {blur[1]:g} s, as much as "
            "--max-blur allows"
        )
        bounds.append(SpeedBound(blur[0] * gsd_m / blur[1], text))
    return tuple(bounds)


def timing_at_baseline(
    flight: FlightInputs, heading_deg: float, baseline_m: float
) -> tuple[Timing, Limit | None]:
    """Speeds and times for a known baseline, and the limit of the speed that applies.

    The axes are east and north.
    """
    asked = flight.speed_mps
    timing, bound = flight.timing(heading_deg), flight.bound
    bounds = [bound] if bound else []
    spaced = timing.at(baseline_m) if baseline_m else timing
    text = (
        f"the camera needs {timing.interval_s:g} s between photos, which are "
        f"{baseline_m:.4g} m apart"
    )
    bounds.append(SpeedBound(spaced.speed_mps, text))
    blown = steady(spaced, ((1.0, 0.0), (-1.0, 0.0)))
    bounds.append(SpeedBound(blown.speed_mps, "the wind limits the speed over ground"))
    bound, limit = lowest_bound(asked, bounds), None
    if blown.run_in_m > LONGEST_RUN_IN_M:
        raise RequestError(
            f"--trigger distance at {blown.speed_mps:.4g} m/s and "
            f"{timing.acceleration_mps2:.4g} m/s² needs a run-in of "
            f"{blown.run_in_m:.4g} m before each line",
            "give a smaller --speed or a larger --acceleration, or --trigger stop",
        )
    if bound is not None:
        message = (
            f"{bound.message}, so the speed is {bound.speed_mps:.3g} m/s instead of the "
            f"requested {asked:.3g} m/s"
        )
        limit = Limit("speed_mps", bound.speed_mps, bound.speed_mps, message)
    elif timing.fly_through:
        message = "photos are taken while flying at the requested speed"
        limit = Limit("speed_mps", asked, asked, message)
    if flight.wind is not None:
        north, east = wind_mps(flight.wind.speed_mps, flight.wind.from_deg)
        blown = blown._replace(wind=(east, north))
    return blown, limit


def build_route(
    flight: FlightInputs,
    sites: FlightPoints,
    *,
    heading_deg: float,
    origin: tuple[float, float] | None,
    altitude_m: float,
    baseline_m: float,
    canopy_top_m: float = 0.0,
) -> Route:
    """The route of a plan.

    Parameters
    ----------
    flight
        Settings of the flight.
    sites
        Sites in flight order, relative to the origin.
    heading_deg
        Direction of the flight lines, clockwise from true north.
    origin
        Latitude and longitude [deg]; None if the plan has no location.
    altitude_m
        Height of every site above the ground.
    baseline_m
        Distance between neighbouring sites.
    canopy_top_m
        Height of the canopy above ground.

    Raises
    ------
    RequestError
        If the terrain file does not cover the route, or if the waypoint to resume at does not
        exist.
    InfeasibleError
        If the wind is too strong, or if one battery is not enough for the flight to a site.
    """
    timing, limit = timing_at_baseline(flight, heading_deg, baseline_m)

    def sites_from(photo: int) -> FlightPoints:
        """The sites from a given photo to the last one, with the points at which the
        drone turns.
        """
        first = [place for place, taken in enumerate(sites.photo) if taken][photo] if photo else 0
        left = FlightPoints(sites.east_m[first:], sites.north_m[first:], sites.photo[first:])
        if not timing.fly_through:
            return left
        run_in = timing.run_in_m
        return with_turns(left, spacing_m=baseline_m, run_in_m=run_in, heading_deg=heading_deg)

    terrain = None
    if flight.terrain is not None:
        from aosplan.flight.terrain import Terrain

        terrain = Terrain(flight.terrain, flight.terrain_units)
    with terrain or nullcontext():
        # Between sites, the path may be closer to the ground than at the sites, but not closer to
        # the canopy than the clearance.
        tolerance = min(flight.terrain_tolerance_m, altitude_m - canopy_top_m - flight.clearance_m)
        ground = _grounded(sites_from(0), terrain, origin, tolerance)
        takeoff = _takeoff(flight, ground, terrain, origin)
        if flight.resume_at:
            done = _photos_before(ground.sites, flight.resume_at)
            ground = _grounded(sites_from(done), terrain, origin, tolerance)
        up = [altitude_m + height for height in ground.heights_m]
        track = Track(ground.sites.east_m, ground.sites.north_m, up, ground.sites.photo)
        battery_s = math.inf if flight.flight_time_min is None else 60.0 * flight.flight_time_min
        least_m = canopy_top_m + flight.clearance_m
        takeoff, lowest = _safe_ways(track, takeoff, terrain, origin, least_m)
        flights = flights_of(track, timing, takeoff, battery_s)
        # The position of the take-off point is part of the plan if heights depend on it, or if
        # there are several flights.
        known = flight.takeoff
        if (
            known is None
            and origin is not None
            and (terrain or len(flights) > 1 or flight.resume_at)
        ):
            (latitude,), (longitude,) = to_wgs84(origin, [takeoff.east_m], [takeoff.north_m])
            known = latitude, longitude
    length_m, time_s = _first_photo_to_last(track, timing)
    delay_s = None
    if flight.wind is not None:
        calm, _ = timing_at_baseline(flight._replace(wind=None), heading_deg, baseline_m)
        in_calm_s = sum(each.time_s for each in flights_of(track, calm, takeoff, battery_s))
        delay_s = (
            time_s - _first_photo_to_last(track, calm)[1],
            sum(each.time_s for each in flights) - in_calm_s,
        )
    return Route(
        placed(_waypoints(ground, altitude_m, flights, known=terrain is not None), origin),
        timing,
        _counted(flights),
        length_m,
        time_s,
        limits=(limit,) if limit else (),
        takeoff=known,
        takeoff_ground_m=takeoff.up_m if terrain else None,
        closer_by_m=ground.closer_by_m,
        farther_by_m=ground.farther_by_m,
        highest_way_m=_highest_way_m(flights, takeoff, lowest) if terrain else None,
        datum=terrain.datum if terrain else None,
        wind_delay_s=delay_s,
    )


def _grounded(
    sites: FlightPoints,
    terrain: Terrain | None,
    origin: tuple[float, float] | None,
    tolerance_m: float,
) -> Ground:
    if terrain is None:
        return Ground(sites, [0.0] * len(sites.photo))
    from aosplan.flight.terrain import follow

    assert origin is not None  # `PlanRequest` has checked that a plan with terrain has a location.
    return follow(terrain, sites, origin, tolerance_m=tolerance_m)


def _takeoff(
    flight: FlightInputs,
    ground: Ground,
    terrain: Terrain | None,
    origin: tuple[float, float] | None,
) -> TakeoffPoint:
    """The take-off point.  If it is not given, it is on the ground below the first waypoint of the
    whole plan.
    """
    if flight.takeoff is None:
        return TakeoffPoint(ground.sites.east_m[0], ground.sites.north_m[0], ground.heights_m[0])
    # `PlanRequest` has checked that a plan with a take-off point has a location.
    assert origin is not None
    latitude, longitude = flight.takeoff
    (east,), (north,) = to_local(origin, [latitude], [longitude])
    if math.hypot(east, north) > FARTHEST_M:
        raise RequestError(
            f"--takeoff {latitude:g},{longitude:g} is {math.hypot(east, north) / 1000.0:.4g} km "
            "from the --origin"
        )
    if terrain is None:
        return TakeoffPoint(east, north, 0.0)
    from aosplan.flight.terrain import heights_at

    return TakeoffPoint(east, north, float(heights_at(terrain, origin, [east], [north])[0]))


def _photos_before(sites: FlightPoints, waypoint: int) -> int:
    done = sum(sites.photo[:waypoint])
    if done == sum(sites.photo):
        last = max(place for place, photo in enumerate(sites.photo) if photo)
        raise RequestError(
            f"--resume-at {waypoint} is after the last photo, which is at waypoint {last}",
            "waypoints are numbered from 0 over all flights of the plan",
        )
    return done


def _safe_ways(
    track: Track,
    takeoff: TakeoffPoint,
    terrain: Terrain | None,
    origin: tuple[float, float] | None,
    least_m: float,
) -> tuple[TakeoffPoint, list[float]]:
    """The take-off point with the heights of the paths to each waypoint, and the lowest ground
    below each path.

    The path to a waypoint is at the largest of three heights: the height of the waypoint; the
    highest ground below the path plus `least_m`; and the take-off point plus `LEAST_CLIMB_M`. The
    path back from any waypoint is at the largest height of all these paths.
    """
    if terrain is None:
        lowest = highest = [takeoff.up_m] * len(track.up_m)
    else:
        from aosplan.flight.terrain import ways_ground_m

        # `PlanRequest` has checked that a plan with terrain has a location.
        assert origin is not None
        start = takeoff.east_m, takeoff.north_m
        lowest, highest = ways_ground_m(terrain, origin, start, track.east_m, track.north_m)
    ways = [
        way_height_m(up, max(ground + least_m, takeoff.up_m + LEAST_CLIMB_M))
        for up, ground in zip(track.up_m, highest, strict=True)
    ]
    safe = max(ways)
    returns = [way_height_m(up, safe) for up in track.up_m]
    return takeoff._replace(ways_up_m=ways, returns_up_m=returns), lowest


def _highest_way_m(
    flights: Sequence[Flight], takeoff: TakeoffPoint, lowest: Sequence[float]
) -> float:
    """Largest height above ground on the paths from the take-off point to the flights and back."""
    return takeoff.up_m + max(
        max(flight.climb_m - lowest[flight.first], flight.return_m - lowest[flight.last])
        for flight in flights
    )


def _waypoints(
    ground: Ground, altitude_m: float, flights: Sequence[Flight], *, known: bool
) -> Waypoints:
    """The waypoints of all flights, with the height of the ground if it is known."""
    kept = [place for flight in flights for place in range(flight.first, flight.last + 1)]

    def column(values: Sequence[T]) -> list[T]:
        return list(values) if len(kept) == len(values) else [values[place] for place in kept]

    photo = column(ground.sites.photo)
    return Waypoints(
        column(ground.sites.east_m),
        column(ground.sites.north_m),
        [altitude_m] * len(kept),
        ground_m=column(ground.heights_m) if known else None,
        photo=None if all(photo) else photo,
    )


def _counted(flights: Sequence[Flight]) -> tuple[Flight, ...]:
    """The flights, with the indices that their waypoints have after other waypoints are
    left out.
    """
    counted, first = [], 0
    for flight in flights:
        last = first + flight.last - flight.first
        counted.append(flight._replace(first=first, last=last))
        first = last + 1
    return tuple(counted)


def _first_photo_to_last(track: Track, timing: Timing) -> tuple[float, float]:
    """Length and time from the first photo to the last, including the holds."""
    first = track.photo.index(True)
    last = len(track.photo) - 1 - track.photo[::-1].index(True)
    lengths, times = track.lengths_m, track.times_s(timing)
    return lengths[last] - lengths[first], times[last] - times[first] + timing.hold_s
