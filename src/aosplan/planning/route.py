"""The route: from a plan's sites to waypoints with turns, heights and flights.

Sites come in flight order, east and north of the origin.  Flying through adds the points at which
the drone turns, terrain those that keep it above the ground, and a battery's time cuts the whole
into flights.
"""

from __future__ import annotations

import math
from contextlib import nullcontext
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from aosplan.errors import RequestError
from aosplan.files import located
from aosplan.flight.batteries import Flight, Home, flights_of
from aosplan.flight.drones import find_drone
from aosplan.flight.kinematics import Timing, steady, wind_mps
from aosplan.flight.photo_trigger import Bound, Ground, Sites, blur_speed_mps, ruling, with_turns
from aosplan.flight.track import Track
from aosplan.geodesy import FARTHEST_M, to_local, to_wgs84
from aosplan.messages import Limit
from aosplan.mission.mission import Waypoints, placed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.flight.terrain import Terrain
    from aosplan.planning.request import PlanRequest

T = TypeVar("T")

LEAST_RUN_IN_M = 1.0
"""Autopilots take no shorter legs: half a metre, says DJI."""

LONGEST_RUN_IN_M = 1000.0
"""Nobody flies farther only to be at speed."""


class Route(NamedTuple):
    """Waypoints in flight order, how they are flown, and the flights they are split into.

    `length_m` and `time_s` count from the first photo to the last, whatever lies between;
    `closer_by_m` and `farther_by_m` say how much nearer to the ground, and farther from it, the ways between
    waypoints come than their ends, and `lowest_way_m` how near the ways from the take-off and back
    come to it, on the level of the waypoint where they end.  Heights of the ground count from
    `datum`.  The take-off is None where nothing depends on it.
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
    lowest_way_m: float | None = None
    datum: str | None = None

    @property
    def total_time_s(self) -> float:
        """Time of all flights, each with its take-off and return."""
        return math.fsum(flight.time_s for flight in self.flights)


def timing_of(request: PlanRequest, gsd_m: float) -> tuple[Timing, Bound | None]:
    """How a request is flown, and what bound its speed before the baseline is known.

    The axes are along the heading and to its right.
    """
    assert request.speed is not None  # the request has filled these in
    assert request.acceleration is not None
    assert request.climb is not None
    through = request.trigger == "distance"
    bounds = []
    if request.drone is not None:
        drone = find_drone(request.drone)
        text = f"the fastest that the {drone.title} flies in missions"
        bounds.append(Bound(drone.airspeed_mps, text))
    if through:
        assert request.max_blur is not None
        assert request.exposure_time is not None
        text = (
            f"the ground moves {request.max_blur:g} px during --exposure-time "
            f"{request.exposure_time:g} s, as much as --max-blur allows"
        )
        blurred = blur_speed_mps(gsd_m, request.max_blur, request.exposure_time)
        bounds.append(Bound(blurred, text))
    bound = ruling(request.speed, bounds)
    timing = Timing(
        speed_mps=bound.speed_mps if bound else request.speed,
        acceleration_mps2=request.acceleration,
        hold_s=0.0 if through else request.hold,
        climb_mps=request.climb,
        fly_through=through,
        interval_s=(request.photo_interval or 0.0) if through else 0.0,
        least_run_in_m=LEAST_RUN_IN_M,
    )
    if request.wind_speed:
        assert request.wind_from is not None  # the request has checked it
        assert request.airspeed is not None
        wind = wind_mps(request.wind_speed, request.wind_from, request.heading_deg)
        timing = timing._replace(wind=wind, airspeed_mps=request.airspeed)
        timing.ground_speed_mps(1.0, 0.0)  # where the wind is too strong, say so at once
    return timing, bound


def flown(request: PlanRequest, gsd_m: float, baseline_m: float) -> tuple[Timing, Limit | None]:
    """How a plan is flown once its baseline is known, and what bound the speed.

    The axes are east and north.
    """
    asked = request.speed
    assert asked is not None  # the request has filled it in
    timing, bound = timing_of(request, gsd_m)
    bounds = [bound] if bound else []
    spaced = timing.at(baseline_m) if baseline_m else timing
    text = (
        f"the camera takes a photo each {timing.interval_s:g} s at most, {baseline_m:.4g} m apart"
    )
    bounds.append(Bound(spaced.speed_mps, text))
    blown = steady(spaced, ((1.0, 0.0), (-1.0, 0.0)))
    bounds.append(Bound(blown.speed_mps, "against the wind the drone is no faster"))
    bound, limit = ruling(asked, bounds), None
    if blown.run_in_m > LONGEST_RUN_IN_M:
        raise RequestError(
            f"--trigger distance at {blown.speed_mps:.4g} m/s and {timing.acceleration_mps2:.4g} "
            f"m/s² takes a run-in of {blown.run_in_m:.4g} m to each line",
            "give a smaller --speed or a larger --acceleration, or --trigger stop",
        )
    if bound is not None:
        message = f"{bound.message} ({bound.speed_mps:.3g} m/s, not the {asked:.3g} asked for)"
        limit = Limit("speed_mps", bound.speed_mps, bound.speed_mps, message)
    elif timing.fly_through:
        message = "photos are taken in passing at the speed asked for"
        limit = Limit("speed_mps", asked, asked, message)
    if request.wind_speed:
        assert request.wind_from is not None
        north, east = wind_mps(request.wind_speed, request.wind_from)
        blown = blown._replace(wind=(east, north))
    return blown, limit


def lay(
    request: PlanRequest,
    sites: Sites,
    *,
    origin: tuple[float, float] | None,
    altitude_m: float,
    gsd_m: float,
    baseline_m: float,
    canopy_top_m: float = 0.0,
    folder: str = "",
) -> Route:
    """The route of a plan.

    Parameters
    ----------
    request
        How to fly.
    sites
        In flight order, from the origin.
    origin
        Latitude and longitude [deg], or None without a place.
    altitude_m
        Of every site above the ground.
    gsd_m, baseline_m
        Ground sampling distance in the focal plane, and spacing of the sites.
    canopy_top_m
        Height of the canopy above ground.
    folder
        Where the terrain's file is looked for first.

    Raises
    ------
    RequestError
        Where the terrain does not cover the route, or there is no waypoint to resume at.
    InfeasibleError
        Where the wind is too strong, or a battery too small for any site.
    """
    timing, limit = flown(request, gsd_m, baseline_m)

    def sites_from(photo: int) -> Sites:
        """The way from a photo on, with the points at which it turns."""
        first = [place for place, taken in enumerate(sites.photo) if taken][photo] if photo else 0
        left = Sites(sites.east_m[first:], sites.north_m[first:], sites.photo[first:])
        if not timing.fly_through:
            return left
        run_in, heading = timing.run_in_m, request.heading_deg
        return with_turns(left, spacing_m=baseline_m, run_in_m=run_in, heading_deg=heading)

    terrain = None
    if request.terrain is not None:
        from aosplan.flight.terrain import Terrain

        terrain = Terrain(located(request.terrain, folder), request.terrain_units)
    with terrain or nullcontext():
        # A way over the trees may sag only as far as the clearance lets it.
        tolerance = min(
            request.terrain_tolerance or 0.0, altitude_m - canopy_top_m - request.clearance
        )
        ground = _grounded(sites_from(0), terrain, origin, tolerance)
        takeoff = _takeoff(request, ground, terrain, origin)
        if request.resume_at:
            done = _photos_before(ground.sites, request.resume_at)
            ground = _grounded(sites_from(done), terrain, origin, tolerance)
        up = [altitude_m + height for height in ground.heights_m]
        track = Track(ground.sites.east_m, ground.sites.north_m, up, ground.sites.photo)
        battery_s = math.inf if request.flight_time is None else 60.0 * request.flight_time
        flights = flights_of(track, timing, takeoff, battery_s)
        lowest = _lowest_way_m(track, flights, takeoff, terrain, origin)
        # Where heights or several flights depend on the take-off, it is said where that is.
        known = request.takeoff
        if known is None and origin is not None and (terrain or len(flights) > 1):
            (latitude,), (longitude,) = to_wgs84(origin, [takeoff.east_m], [takeoff.north_m])
            known = latitude, longitude
    return Route(
        placed(_waypoints(ground, altitude_m, flights, known=terrain is not None), origin),
        timing,
        _counted(flights),
        *_first_photo_to_last(track, timing),
        limits=(limit,) if limit else (),
        takeoff=known,
        takeoff_ground_m=takeoff.up_m if terrain else None,
        closer_by_m=ground.closer_by_m,
        farther_by_m=ground.farther_by_m,
        lowest_way_m=lowest,
        datum=terrain.datum if terrain else None,
    )


def _grounded(
    sites: Sites,
    terrain: Terrain | None,
    origin: tuple[float, float] | None,
    tolerance_m: float,
) -> Ground:
    if terrain is None:
        return Ground(sites, [0.0] * len(sites.photo))
    from aosplan.flight.terrain import follow

    assert origin is not None  # the request has checked that terrain has a place
    return follow(terrain, sites, origin, tolerance_m=tolerance_m)


def _takeoff(
    request: PlanRequest,
    ground: Ground,
    terrain: Terrain | None,
    origin: tuple[float, float] | None,
) -> Home:
    """The take-off, or the ground below the first waypoint of the whole plan."""
    if request.takeoff is None:
        return Home(ground.sites.east_m[0], ground.sites.north_m[0], ground.heights_m[0])
    assert origin is not None  # the request has checked that a take-off has a place
    latitude, longitude = request.takeoff
    (east,), (north,) = to_local(origin, [latitude], [longitude])
    if math.hypot(east, north) > FARTHEST_M:
        raise RequestError(
            f"--takeoff {latitude:g},{longitude:g} is {math.hypot(east, north) / 1000.0:.4g} km "
            "from the --origin"
        )
    if terrain is None:
        return Home(east, north, 0.0)
    from aosplan.flight.terrain import heights_at

    return Home(east, north, float(heights_at(terrain, origin, [east], [north])[0]))


def _photos_before(sites: Sites, waypoint: int) -> int:
    done = sum(sites.photo[:waypoint])
    if done == sum(sites.photo):
        last = max(place for place, photo in enumerate(sites.photo) if photo)
        raise RequestError(
            f"--resume-at {waypoint} leaves nothing to fly: the last photo is at waypoint {last}",
            "waypoints count from 0, over all flights of the plan",
        )
    return done


def _lowest_way_m(
    track: Track,
    flights: Sequence[Flight],
    takeoff: Home,
    terrain: Terrain | None,
    origin: tuple[float, float] | None,
) -> float | None:
    """Least height above ground on the ways from the take-off to the flights and back."""
    if terrain is None:
        return None
    from aosplan.flight.terrain import highest_m

    assert origin is not None  # as above
    return min(
        track.up_m[place]
        - highest_m(
            terrain,
            origin,
            (takeoff.east_m, takeoff.north_m),
            (track.east_m[place], track.north_m[place]),
        )
        for flight in flights
        for place in (flight.first, flight.last)
    )


def _waypoints(
    ground: Ground, altitude_m: float, flights: Sequence[Flight], *, known: bool
) -> Waypoints:
    """The waypoints that belong to a flight, with the ground's height where that is known."""
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
    """Flights by the places of their waypoints among those that are kept."""
    counted, first = [], 0
    for flight in flights:
        last = first + flight.last - flight.first
        counted.append(flight._replace(first=first, last=last))
        first = last + 1
    return tuple(counted)


def _first_photo_to_last(track: Track, timing: Timing) -> tuple[float, float]:
    """Length and time from the first photo to the last, the holds included."""
    first = track.photo.index(True)
    last = len(track.photo) - 1 - track.photo[::-1].index(True)
    lengths, times = track.lengths_m, track.times_s(timing)
    return lengths[last] - lengths[first], times[last] - times[first] + timing.hold_s
