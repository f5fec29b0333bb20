"""Results of an order by gain: the probability of success over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.flight.track import Track

if TYPE_CHECKING:
    from aosplan.planning.route import Route

CURVE_POINTS = 40
"""Approximate number of points of the curves in documents."""

Curve = tuple[tuple[float, float], ...]


class GainPoint(NamedTuple):
    """Time since the first take-off, and the probability of success until then."""

    time_s: float
    success: float


class GainResult(NamedTuple):
    """How a flight in the order of gain finds the target.

    Attributes
    ----------
    probability_of_area
        Probability that the target is in the area (POA).
    mean_s, usual_mean_s
        Mean time from take-off until the target is found, if it is found: in the order of the plan,
        and in the shortest order.
    usual_success
        Probability of success of the shortest order within the same time.
    flights
        For each flight, the time since the first take-off at which it lands, and the probability of
        success until then.
    curve, usual_curve
        Time and probability of success at the ends of the lines, in the order of the plan and in the
        shortest order.
    photos, all_photos
        Number of photos of the plan, and of a flight over the whole area.
    """

    probability_of_area: float
    mean_s: float
    usual_mean_s: float
    usual_success: float
    flights: tuple[GainPoint, ...]
    curve: Curve
    usual_curve: Curve
    photos: int
    all_photos: int

    @property
    def success(self) -> float:
        """Probability of success of all flights (POS)."""
        return self.flights[-1].success

    @property
    def is_part(self) -> bool:
        """Whether the time is too short for the whole area."""
        return self.photos < self.all_photos

    def document(self) -> dict[str, Any]:
        """``gain`` of a plan's JSON document."""
        before = [0.0, *(flight.success for flight in self.flights)]
        return {
            "probability_of_area": self.probability_of_area,
            "probability_of_success": self.success,
            "mean_time_s": self.mean_s,
            "shortest_order": {
                "probability_of_success": self.usual_success,
                "mean_time_s": self.usual_mean_s,
                "curve": thinned(self.usual_curve),
            },
            "flights": [
                {
                    "landed_s": flight.time_s,
                    "probability_of_success": flight.success - earlier,
                    "cumulative_probability_of_success": flight.success,
                }
                for flight, earlier in zip(self.flights, before, strict=False)
            ],
            "curve": thinned(self.curve),
            "photos": self.photos,
            "photos_of_whole_area": self.all_photos,
        }


def thinned(curve: Curve) -> list[list[float]]:
    """Some points of a curve, including its first and last one."""
    step = max(len(curve) // CURVE_POINTS, 1)
    kept = [*curve[:-1:step], *curve[-1:]]
    return [[time_s, success] for time_s, success in kept]


def photo_times_s(route: Route, origin: tuple[float, float] | None) -> list[float]:
    """Time since the first take-off at which each photo of a route is taken."""
    ways, timing = route.waypoints, route.timing
    photo = ways.photo or [True] * len(ways)
    ground = ways.ground_m or [0.0] * len(ways)
    up = [above + below for above, below in zip(ways.altitude_m, ground, strict=True)]
    home = ways.east_m[0], ways.north_m[0]
    if route.takeoff is not None and origin is not None:
        from aosplan.geodesy import to_local

        (east,), (north,) = to_local(origin, [route.takeoff[0]], [route.takeoff[1]])
        home = east, north
    found, done_s = [], 0.0
    for flight in route.flights:
        part = slice(flight.first, flight.last + 1)
        track = Track(ways.east_m[part], ways.north_m[part], up[part], photo[part])
        climb_m = flight.climb_m
        first_m = up[flight.first] - (route.takeoff_ground_m or 0.0)
        out_s = (
            timing.transit.leg_s(0.0, 0.0, climb_m)
            + timing.transit.leg_s(0.0, 0.0, climb_m - first_m)
            + timing.transit.leg_s(track.east_m[0] - home[0], track.north_m[0] - home[1])
        )
        times = track.times_s(timing)
        found += [done_s + out_s + t for t, taken in zip(times, track.photo, strict=True) if taken]
        done_s += flight.time_s
    return found
