"""The route: from a plan's sites to waypoints with turns, heights and flights.

Sites come in flight order, east and north of the origin.  Flying through adds the points at which
the drone turns, terrain those that keep it above the ground, and a battery's time cuts the whole
into flights.
"""

from __future__ import annotations

import math
from contextlib import nullcontext
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from aosplan.batteries import Flight, Home, flights_of
from aosplan.errors import RequestError
from aosplan.flight import Timing, steady, wind_mps
from aosplan.mission import Waypoints, placed
from aosplan.problem import Limit
from aosplan.request import find_drone
from aosplan.resolve import located
from aosplan.track import Track
from aosplan.trigger import Bound, Ground, Sites, blur_speed_mps, slowest, with_turns

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.request import PlanRequest
    from aosplan.terrain import Terrain

T = TypeVar("T")


class Route(NamedTuple):
    """Waypoints in flight order, how they are flown, and the flights they are split into.

    `length_m` and `time_s` count from the first photo to the last, whatever lies between;
    `hump_m` and `dip_m` say how much nearer to the ground, and farther from it, the ways between
    waypoints come than their ends, and `lowest_way_m` how near the ways from the take-off and back
    come to it, on the level of the waypoint where they end.  Heights of the ground count from
    `datum`.
    """

    waypoints: Waypoints
    timing: Timing
    flights: tuple[Flight, ...]
    length_m: float
    time_s: float
    limits: tuple[Limit, ...] = ()
    takeoff_ground_m: float | None = None
    hump_m: float = 0.0
    dip_m: float = 0.0
    lowest_way_m: float | None = None
    datum: str | None = None

    @property
    def total_time_s(self) -> float:
        """Time of all flights, each with its take-off and return."""
        return math.fsum(flight.time_s for flight in self.flights)


def timing_of(request: PlanRequest, gsd_m: float) -> tuple[Timing, Limit | None]:
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
            f"the ground moves {request.max_blur:g} px during {request.exposure_time:g} s of "
            "exposure, as much as --max-blur allows"
        )
        blurred = blur_speed_mps(gsd_m, request.max_blur, request.exposure_time)
        bounds.append(Bound(blurred, text))
    speed, limit = slowest(request.speed, bounds)
    timing = Timing(
        speed_mps=speed,
        acceleration_mps2=request.acceleration,
        hold_s=0.0 if through else request.hold,
        climb_mps=request.climb,
        fly_through=through,
        interval_s=(request.photo_interval or 0.0) if through else 0.0,
    )
    if request.wind_speed:
        assert request.wind_from is not None  # the request has checked it
        assert request.airspeed is not None
        wind = wind_mps(request.wind_speed, request.wind_from, request.heading_deg)
        timing = timing._replace(wind=wind, airspeed_mps=request.airspeed)
        timing.ground_speed_mps(1.0, 0.0)  # where the wind is too strong, say so at once
    return timing, limit


def flown(request: PlanRequest, gsd_m: float, baseline_m: float) -> tuple[Timing, Limit | None]:
    """How a plan is flown once its baseline is known, and what bound the speed.

    The axes are east and north.
    """
    asked = request.speed
    assert asked is not None  # the request has filled it in
    timing, limit = timing_of(request, gsd_m)
    bounds = [Bound(limit.value, limit.message)] if limit else []
    spaced = timing.at(baseline_m) if baseline_m else timing
    text = (
        f"the camera takes a photo each {timing.interval_s:g} s at most, {baseline_m:.4g} m apart"
    )
    bounds.append(Bound(spaced.speed_mps, text))
    blown = steady(spaced, ((1.0, 0.0), (-1.0, 0.0)))
    bounds.append(Bound(blown.speed_mps, "against the wind the drone is no faster"))
    _, ruling = slowest(asked, bounds)
    if timing.fly_through and ruling is None:
        ruling = Limit(
            "speed_mps", asked, asked, "photos are taken in passing at the speed asked for"
        )
    if request.wind_speed:
        assert request.wind_from is not None
        north, east = wind_mps(request.wind_speed, request.wind_from)
        blown = blown._replace(wind=(east, north))
    return blown, ruling


def lay(
    request: PlanRequest,
    east_m: Sequence[float],
    north_m: Sequence[float],
    *,
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
    east_m, north_m
        Sites in flight order, from the origin.
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

    def sites_from(first: int) -> Sites:
        east, north = list(east_m[first:]), list(north_m[first:])
        if not timing.fly_through:
            return Sites(east, north, [True] * len(east))
        run_in, heading = timing.run_in_m, request.heading_deg
        return with_turns(east, north, spacing_m=baseline_m, run_in_m=run_in, heading_deg=heading)

    terrain = None
    if request.terrain is not None:
        from aosplan.terrain import Terrain

        terrain = Terrain(located(request.terrain, folder))
    with terrain or nullcontext():
        # A way over the trees may sag only as far as the clearance lets it.
        tolerance = min(
            request.terrain_tolerance or 0.0, altitude_m - canopy_top_m - request.clearance
        )
        ground = _grounded(request, sites_from(0), terrain, tolerance)
        takeoff = _takeoff(request, ground, terrain)
        if request.resume_at:
            done = _photos_before(ground.sites, request.resume_at)
            ground = _grounded(request, sites_from(done), terrain, tolerance)
        up = [altitude_m + height for height in ground.heights_m]
        track = Track(ground.sites.east_m, ground.sites.north_m, up, ground.sites.photo)
        battery_s = math.inf if request.flight_time is None else 60.0 * request.flight_time
        flights = flights_of(track, timing, takeoff, battery_s)
        lowest = _lowest_way_m(request, track, flights, takeoff, terrain)
    return Route(
        _waypoints(request, ground, altitude_m, flights),
        timing,
        _counted(flights),
        *_first_photo_to_last(track, timing),
        limits=(limit,) if limit else (),
        takeoff_ground_m=takeoff.up_m if terrain else None,
        hump_m=ground.hump_m,
        dip_m=ground.dip_m,
        lowest_way_m=lowest,
        datum=terrain.datum if terrain else None,
    )


def _grounded(
    request: PlanRequest, sites: Sites, terrain: Terrain | None, tolerance_m: float
) -> Ground:
    if terrain is None:
        return Ground(sites, [0.0] * len(sites.photo))
    from aosplan.terrain import follow

    assert request.origin is not None  # the request has checked that terrain has a place
    return follow(terrain, sites, request.origin, tolerance_m=tolerance_m)


def _takeoff(request: PlanRequest, ground: Ground, terrain: Terrain | None) -> Home:
    """The take-off, or the ground below the first waypoint of the whole plan."""
    if request.takeoff is None:
        return Home(ground.sites.east_m[0], ground.sites.north_m[0], ground.heights_m[0])
    from aosplan.geodesy import FARTHEST_M, to_local

    assert request.origin is not None  # the request has checked that a take-off has a place
    latitude, longitude = request.takeoff
    (east,), (north,) = to_local(request.origin, [latitude], [longitude])
    if math.hypot(east, north) > FARTHEST_M:
        raise RequestError(
            f"--takeoff {latitude:g},{longitude:g} is {math.hypot(east, north) / 1000.0:.4g} km "
            "from the --origin"
        )
    if terrain is None:
        return Home(east, north, 0.0)
    from aosplan.terrain import heights_at

    return Home(east, north, float(heights_at(terrain, request.origin, [east], [north])[0]))


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
    request: PlanRequest,
    track: Track,
    flights: Sequence[Flight],
    takeoff: Home,
    terrain: Terrain | None,
) -> float | None:
    """Least height above ground on the ways from the take-off to the flights and back."""
    if terrain is None:
        return None
    from aosplan.terrain import highest_m

    assert request.origin is not None
    return min(
        track.up_m[place]
        - highest_m(
            terrain,
            request.origin,
            (takeoff.east_m, takeoff.north_m),
            (track.east_m[place], track.north_m[place]),
        )
        for flight in flights
        for place in (flight.first, flight.last)
    )


def _waypoints(
    request: PlanRequest, ground: Ground, altitude_m: float, flights: Sequence[Flight]
) -> Waypoints:
    """The waypoints that belong to a flight."""
    kept = [place for flight in flights for place in range(flight.first, flight.last + 1)]

    def column(values: Sequence[T]) -> list[T]:
        return list(values) if len(kept) == len(values) else [values[place] for place in kept]

    photo = column(ground.sites.photo)
    return placed(
        Waypoints(
            column(ground.sites.east_m),
            column(ground.sites.north_m),
            [altitude_m] * len(kept),
            ground_m=column(ground.heights_m) if request.terrain else None,
            photo=None if all(photo) else photo,
        ),
        request.origin,
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
