"""The order of a flight over an area by the gain of the probability of success per minute
(``--order gain``).

The sites of the usual order are divided into blocks.  A block consists of some consecutive lines,
or of parts of such lines.  Several divisions are tried.  `aosplan.planning.block_order` finds
orders of the blocks for each division.  The orders are compared with their exact flight times, and
the usual order is kept if none is better.  With a longest time, the lines that do not fit into it
are left out.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.areas.no_fly import NoFlyZones
from aosplan.areas.survey import routed
from aosplan.errors import InfeasibleError
from aosplan.flight.kinematics import lines_of
from aosplan.flight.track import FlightPoints, Track, with_turns
from aosplan.numerics import heading_axis
from aosplan.planning.block_order import BlockOrder, Blocks, Ways
from aosplan.planning.gain_places import GainPlaces, prior_of
from aosplan.planning.gain_result import GainPoint, GainResult, photo_times_s
from aosplan.planning.sites import route_of, ways_in_zones
from aosplan.planning.within_shapes import last_number

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from aosplan.areas.survey import Survey
    from aosplan.planning.block_order import Order
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.resolve import PlanInputs
    from aosplan.planning.result import Plan
    from aosplan.planning.route import Route
    from aosplan.planning.within import WholeFlight

    Floats = NDArray[np.float64]
    Whole = NDArray[np.int64]

BANDS = (1, 2, 3, 4)
"""Numbers of bands across the lines into which the area is divided.  Lines end at the bands."""

BLOCKS = (8, 16)
"""Approximate numbers of blocks."""

IMPROVED = 2
"""Number of divisions whose orders are improved, and whose flight times are computed exactly."""

SLACK = 1.1
"""Factor by which the bound of the probability of success is multiplied. It is needed because some
places are in more photos than a grid has.
"""


class _Flown(NamedTuple):
    """An order of the photos, its route, its value as in `BlockOrder.value`, and the probability of
    success at the beginning and end of each line.
    """

    photos: Whole
    route: Route
    value: tuple[float, float]
    curve: tuple[tuple[float, float], ...]


class _Search(NamedTuple):
    """The photos of each block, the search for an order, and the orders with which the search
    begins.
    """

    division: list[Whole]
    search: BlockOrder
    orders: list[Order]

    @property
    def value(self) -> tuple[float, float]:
        """Value of the first order."""
        return self.search.value(self.orders[0])

    def photos(self, order: Order) -> Whole:
        """The photos in flight order, for an order of the blocks."""
        return np.concatenate([self.division[block][:: 1 - 2 * way] for block, way in order])


def most_success(
    inputs: PlanInputs, flights: Sequence[WholeFlight], longest_s: float
) -> Iterator[tuple[float, PlanRequest]]:
    """Yield, for each flight over the whole area, a bound of the probability of success of its
    first part.

    A flight that takes the time T sees at most the share t / T of the area within the time t.  The
    bound assumes that this is the part of the area in which the target is most probable.

    Parameters
    ----------
    inputs
        The inputs of a plan over the area.
    flights
        Flights over the whole area.
    longest_s
        Longest time, from take-off to landing.
    """
    cells, shares = prior_of(inputs)
    falling = np.sort(shares[cells.inside_rows])[::-1]
    for flight in flights:
        part = math.ceil(min(longest_s / flight.time_s, 1.0) * len(falling))
        yield SLACK * flight.probability * float(falling[:part].sum()), flight.request


class GainOrder:
    """The best order of a plan over an area.

    Parameters
    ----------
    made
        A plan with a target to find and a prior of its position.
    longest_s
        Longest time of all flights, from take-off to landing.

    Raises
    ------
    RequestError
        If the prior cannot be read, or is 0 over the area.
    InfeasibleError
        If no line can be flown within the time.
    """

    def __init__(self, made: Plan, longest_s: float = math.inf) -> None:
        area, survey = made.layout.area, made.layout.survey
        assert area is not None  # `PlanRequest` has checked that the plan has an area.
        assert survey is not None
        self._made, self._area, self._survey, self._longest_s = made, area, survey, longest_s
        flight = made.inputs.flight._replace(resume_at=None)
        self._inputs = made.inputs._replace(flight=flight)
        sites = made.layout.sites
        points = np.column_stack([sites.east_m, sites.north_m])
        self._points_m = points[np.asarray(sites.photo, dtype=bool)]
        self._all = np.arange(len(self._points_m))
        self._gains = GainPlaces(made, self._points_m, self._lines_of(self._all))
        self._usual = self._flown(self._all)
        searches = [
            self._search(self._divided(bands, blocks)) for bands in BANDS for blocks in BLOCKS
        ]
        self._searches = sorted(searches, key=lambda each: each.value, reverse=True)
        built = self._searches[0].photos(self._searches[0].orders[0])
        self._best = max(self._usual, self._flown(built), key=lambda flown: flown.value)
        if not len(self._best.photos):
            lines = self._lines_of(self._all)
            least_s = min(self._route(line).total_time_s for line in lines)
            raise InfeasibleError(
                f"no line can be flown within {longest_s / 60.0:.4g} min, from take-off to landing",
                f"--within {math.ceil(least_s / 6.0) / 10.0:g} is enough for one of them",
            )

    @property
    def success(self) -> float:
        """Probability of success before the order is improved."""
        return self._best.value[0]

    def plan(self) -> Plan:
        """The plan with its lines in this order, and with the results of the order."""
        improved = [
            self._flown(each.photos(each.search.best(each.orders)))
            for each in self._searches[:IMPROVED]
        ]
        best = max([self._best, *improved], key=lambda flown: flown.value)
        made = self._made
        sites = self._path(best.photos)
        layout = made.layout._replace(sites=sites, survey=self._survey_of(best, sites))
        route = route_of(made.inputs, layout, made.solution.baseline_m)
        notices = (*made.notices, *ways_in_zones(made.inputs, route))
        return replace(
            made, layout=layout, route=route, gain=self._result(best, self._usual), notices=notices
        )

    def _path(self, photos: Whole) -> FlightPoints:
        """The points of a path through photos and around no-fly zones."""
        points, taken = routed(self._points_m[photos], NoFlyZones(self._area.keep_out))
        return FlightPoints(points[:, 0].tolist(), points[:, 1].tolist(), taken)

    def _route(self, photos: Whole) -> Route:
        layout = self._made.layout._replace(sites=self._path(photos))
        return route_of(self._inputs, layout, self._made.solution.baseline_m)

    def _flown(self, photos: Whole) -> _Flown:
        """An order of photos with its exact times.  Lines at its end for which the time is too
        short are left out.
        """
        lines = self._lines_of(photos)
        route = self._route(photos)
        if route.total_time_s > self._longest_s:
            number = last_number(
                len(lines),
                lambda count: (
                    self._route(np.concatenate(lines[:count])).total_time_s <= self._longest_s
                ),
            )
            if not number:
                return _Flown(photos[:0], route, (-1.0, 0.0), ())
            lines = lines[:number]
            photos = np.concatenate(lines)
            route = self._route(photos)
        times = photo_times_s(route, self._made.origin)
        success = self._gains.places.success(np.cumsum(self._gains.counts(lines), axis=0))
        last, before, missing_s, first = float(success[-1]), (0.0, 0.0), 0.0, 0
        curve = [(0.0, 0.0)]
        for line, high in zip(lines, success.tolist(), strict=True):
            begun_s, ended_s = times[first], times[first + len(line) - 1]
            time_s, low = before
            missing_s += (begun_s - time_s) * (last - low)
            missing_s += (ended_s - begun_s) * (last - 0.5 * (low + high))
            before = ended_s, high
            curve += [(begun_s, low), before]
            first += len(line)
        mean_s = missing_s / last if last > 0.0 else before[0]
        return _Flown(photos, route, (last, -mean_s), tuple(curve))

    def _survey_of(self, flown: _Flown, sites: FlightPoints) -> Survey:
        """The survey with the lines that are flown."""
        length_m = float(np.hypot(np.diff(sites.east_m), np.diff(sites.north_m)).sum())
        survey = self._survey._replace(sites_flown=sites, length_m=length_m)
        if len(flown.photos) == len(self._all):
            return survey
        share, fewest = self._gains.covered(flown.photos)
        return survey._replace(
            sites=len(flown.photos),
            covered_share=share * survey.covered_share,
            fewest_looks=None if survey.fewest_looks is None else fewest,
            # Every leg is at least as long as the smaller pitch.
            shortest_m=(len(flown.photos) - 1) * min(survey.pitch_m),
        )

    def _result(self, best: _Flown, usual: _Flown) -> GainResult:
        found, done_s = [], 0.0
        ways = best.route.waypoints
        taken = np.cumsum(ways.photo or [True] * len(ways))
        for flight in best.route.flights:
            done_s += flight.time_s
            success = self._gains.success(best.photos[: int(taken[flight.last])])
            found.append(GainPoint(done_s, success))
        return GainResult(
            probability_of_area=self._gains.area_probability,
            mean_s=-best.value[1],
            usual_mean_s=-usual.value[1],
            usual_success=max(usual.value[0], 0.0),
            flights=tuple(found),
            curve=best.curve,
            usual_curve=usual.curve,
            photos=len(best.photos),
            all_photos=len(self._all),
        )

    # --- Blocks ---

    @property
    def _course(self) -> tuple[float, float]:
        """Direction of the lines, as a unit vector east and north."""
        turn = 0.0 if self._survey.axis == "along" else 90.0
        return heading_axis(self._made.heading_deg + turn)

    def _lines_of(self, photos: Whole) -> list[Whole]:
        """The photos of each straight line, in their order."""
        spacing = self._survey.pitch_m[0 if self._survey.axis == "along" else 1]
        flown = [(east, north) for east, north in self._points_m[photos].tolist()]
        return [
            photos[line.first : line.last + 1] for line in lines_of(flown, spacing, self._course)
        ]

    def _divided(self, bands: int, blocks: int) -> list[Whole]:
        """The photos of each block, in their order. A block consists of some lines of one band."""
        along = self._points_m @ np.array(self._course)
        low, high = float(along.min()), float(along.max())
        band = np.minimum(((along - low) / max(high - low, 1e-9) * bands).astype(int), bands - 1)
        found = []
        for number in range(bands):
            lines = self._lines_of(np.flatnonzero(band == number))
            each = max(math.ceil(len(lines) * bands / blocks), 1)
            found += [
                np.concatenate(lines[first : first + each]) for first in range(0, len(lines), each)
            ]
        return found

    def _search(self, division: list[Whole]) -> _Search:
        """The search for an order of some blocks."""
        known = [self._block(photos) for photos in division]
        blocks = Blocks(
            self._gains.counts(division),
            np.array([times for times, _ in known]),
            np.array([ends for _, ends in known]),
        )
        search = BlockOrder(self._gains.places, blocks, self._ways(), self._longest_s)
        return _Search(division, search, search.built(tuple((b, 0) for b in range(len(division)))))

    def _block(self, photos: Whole) -> tuple[list[float], list[Floats]]:
        """Time of a block in both directions, and its ends."""
        times, ends = [], []
        for way in (photos, photos[::-1]):
            points = self._turned(way)
            track = Track(points.east_m, points.north_m, [0.0] * len(points.photo), points.photo)
            times.append(
                track.times_s(self._made.route.timing)[-1] + self._made.route.timing.hold_s
            )
            ends.append(np.array([points.east_m[0], points.north_m[0]]))
        return times, ends

    def _turned(self, photos: Whole) -> FlightPoints:
        """The points of a path through photos, with the turns of lines that are flown through."""
        east, north = self._points_m[photos].T.tolist()
        points = FlightPoints(east, north, [True] * len(east))
        if not self._made.route.timing.fly_through:
            return points
        return with_turns(
            points,
            spacing_m=self._made.solution.baseline_m,
            run_in_m=self._made.route.timing.run_in_m,
            heading_deg=self._made.heading_deg,
        )

    def _ways(self) -> Ways:
        timing, flight = self._made.route.timing, self._inputs.flight
        flown = timing.transit if timing.fly_through else timing
        home = None
        if flight.takeoff is not None:
            from aosplan.geodesy import to_local

            (east,), (north,) = to_local(
                self._area.origin, [flight.takeoff[0]], [flight.takeoff[1]]
            )
            home = east, north
        up_m = self._made.altitude_m + self._made.inputs.focal_height_m
        minutes = flight.flight_time_min
        return Ways(
            lambda start, stop: flown.leg_s(stop[0] - start[0], stop[1] - start[1]),
            timing.transit.leg_s(0.0, 0.0, up_m),
            home,
            math.inf if minutes is None else 60.0 * minutes,
        )
