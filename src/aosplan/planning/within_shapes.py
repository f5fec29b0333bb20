"""Shapes of grids, the ways to fly them, and their flight times.

A *shape* is a grid in units of the altitude: rows, columns, and the spacings along and across lines
divided by the altitude.  A *way* is a trigger, an altitude and a heading with which a shape can be
flown.  See `aosplan.planning.within`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import InfeasibleError, RequestError
from aosplan.grid.patterns import Pattern
from aosplan.models.model import Prediction
from aosplan.planning.least_time import FlownLines, least_time_s
from aosplan.planning.resolve import resolve_inputs
from aosplan.planning.sites import layout_of, route_of, ways_in_zones
from aosplan.planning.solved_plan import SolvedPlan
from aosplan.solver.problem import GridKind
from aosplan.solver.solution import Solution

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from aosplan.areas.extent import Extent
    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.resolve import PlanInputs

ALTITUDES = 4
"""Number of altitudes that are tried within a range, including its ends."""

HEADINGS_AT_PLACE = (0.0, 45.0, 90.0, 135.0)
"""Headings that are compared for a grid at one place if there is wind."""


class Shape(NamedTuple):
    """A grid in units of the altitude: rows, columns, and spacings along and across lines."""

    rows: int
    columns: int
    along: float
    across: float

    @property
    def samples(self) -> int:
        """Number of photos around each point."""
        return self.rows * self.columns

    @property
    def pattern(self) -> Pattern:
        """The grid in units of its baseline."""
        return Pattern(self.rows, self.columns, self.across / self.along if self.rows > 1 else 1.0)


class Way(NamedTuple):
    """A way to fly a shape.  `away_m` is the smallest distance from the take-off point."""

    inputs: PlanInputs
    heading_deg: float
    extent: Extent | None
    away_m: float

    @property
    def altitude_m(self) -> float:
        """Altitude above the focal plane."""
        return self.inputs.altitude_m


class FlownShape(NamedTuple):
    """A shape, the way in which it takes the least time, and that time."""

    shape: Shape
    way: Way
    least_s: float


class TimedFlight(NamedTuple):
    """A candidate whose flight was planned completely: photos, flights, and the time from take-off
    to landing.
    """

    candidate: FlownShape
    sites: int
    flights: int
    time_s: float


def ways_of(
    request: PlanRequest, folder: str, load: Callable[[PlanRequest], LoadedScene]
) -> Iterator[Way]:
    """All ways to fly that a request allows."""
    triggers = ("distance", "stop") if request.trigger == "best" else (request.trigger,)
    altitudes = list(_altitudes(request))
    refused: RequestError | InfeasibleError | None = None
    some = False
    for altitude in altitudes:
        for trigger in triggers:
            values: dict[str, Any] = {} if altitude is None else {"altitude": altitude}
            if trigger == "stop":
                values |= {"max_blur": None, "exposure_time": None}
            if request.heading == "best":
                values["heading"] = 0.0
            fixed = replace(
                request, within=None, grid="line", lanes=None, lane_pitch=None, trigger=trigger,
                optimize="samples", **values,
            )  # fmt: skip
            try:
                inputs = resolve_inputs(fixed, folder=folder, load=load)
                for way in _headed(inputs, is_open=request.heading == "best"):
                    some = True
                    yield way
            except (RequestError, InfeasibleError) as error:
                refused = error
    if not some and refused is not None:
        raise refused


def _headed(inputs: PlanInputs, *, is_open: bool) -> Iterator[Way]:
    """Ways that differ in their heading."""
    for heading in _headings(inputs) if is_open else (inputs.heading_deg,):
        turned = inputs.at_heading(heading)
        if inputs.area is None:
            yield Way(turned, heading, None, _away_m(turned))
            continue
        from aosplan.areas.extent import extent_of

        yield Way(turned, heading, extent_of(inputs.area, heading), _away_m(turned))


def _headings(inputs: PlanInputs) -> Iterable[float]:
    if inputs.area is None:
        return HEADINGS_AT_PLACE if inputs.flight.wind is not None else (0.0,)
    from aosplan.areas.area import long_side_deg

    longer = long_side_deg(inputs.area.whole)
    return longer, (longer + 90.0) % 180.0


def _away_m(inputs: PlanInputs) -> float:
    """Smallest horizontal distance from the take-off point to the area or to the ground of a
    grid.
    """
    takeoff = inputs.flight.takeoff
    origin = inputs.origin if inputs.area is None else inputs.area.origin
    if takeoff is None or origin is None:
        return 0.0
    from aosplan.geodesy import to_local

    (east,), (north,) = to_local(origin, [takeoff[0]], [takeoff[1]])
    if inputs.area is None:
        return max(math.hypot(east, north) - math.hypot(*inputs.footprint_m), 0.0)
    from aosplan.areas.extent import distance_m

    return distance_m(inputs.area, east, north)


def _altitudes(request: PlanRequest) -> Iterator[float | None]:
    """Altitudes to try, beginning with the highest; None if the request gives the resolution
    instead.
    """
    if not isinstance(request.altitude, str):
        yield request.altitude
        return
    low, high = altitude_range(request.altitude)
    if request.baseline is not None:
        raise RequestError(
            f"--altitude {request.altitude} cannot be used with --baseline "
            f"{request.baseline:g}, because the baseline is chosen for each altitude",
            "give one --altitude, or leave --baseline out",
        )
    for step in range(ALTITUDES):
        yield high * (low / high) ** (step / (ALTITUDES - 1))


def altitude_range(text: str) -> tuple[float, float]:
    """Lowest and highest altitude [m] of a range, from the text in a `PlanRequest`."""
    low, high = (float(part) for part in text.split(".."))
    return low, high


def shape_time_s(shape: Shape, way: Way) -> float:
    """Shortest time of a shape that is flown in a way; infinite if this is not possible."""
    altitude_m = way.altitude_m
    x, y = shape.along * altitude_m, shape.across * altitude_m
    flight = way.inputs.flight
    if way.extent is not None:
        from aosplan.areas.extent import least_lattice

        lattice = FlownLines(*least_lattice(way.extent, shape.rows, shape.columns, (x, y)), (x, y))
    else:
        run_m = 0.0
        if flight.trigger == "distance":
            run_m = flight.timing(way.heading_deg).at(x).run_in_m
        back = (shape.columns - 1) * x + 2.0 * run_m if shape.rows % 2 else 0.0
        level_m = math.hypot(back, (shape.rows - 1) * y)
        lattice = FlownLines(shape.samples, shape.rows, (x, y), level_m)
    try:
        return least_time_s(
            flight,
            lattice,
            heading_deg=way.heading_deg,
            altitude_m=altitude_m + way.inputs.focal_height_m,
            away_m=way.away_m,
        )
    except InfeasibleError:  # the wind is too strong
        return math.inf


def lay_out(candidate: FlownShape) -> TimedFlight:
    """Plan the flight of a candidate completely, with its route.

    Raises
    ------
    RequestError
        If the flight has too many sites, or if the terrain file does not cover it.
    InfeasibleError
        If it cannot be flown.
    """
    shape, way = candidate.shape, candidate.way
    baseline_m = shape.along * way.altitude_m
    pitch = max(shape.across / shape.along, 1.0)
    line = shape.rows == 1
    kind = GridKind("line") if line else GridKind("lanes", shape.rows, pitch)
    inputs = way.inputs._replace(grids=(kind,), line_pitch=pitch)
    solution = Solution(shape.pattern, baseline_m, Prediction(0.0, 1.0, 0.0), None, (), True)
    layout = layout_of(SolvedPlan(inputs, None, None, solution, kind))
    route = route_of(inputs, layout, baseline_m)
    list(ways_in_zones(inputs, route))
    return TimedFlight(candidate, sum(layout.sites.photo), len(route.flights), route.total_time_s)


def request_for(request: PlanRequest, candidate: FlownShape) -> PlanRequest:
    """The request for a candidate, with values for all options."""
    shape, way = candidate.shape, candidate.way
    values: dict[str, Any] = {"max_blur": None, "exposure_time": None}
    if way.inputs.flight.trigger == "distance":
        values = {}
    pitched = shape.rows > 1 or request.area is not None
    return replace(
        request,
        within=None,
        altitude=way.altitude_m,
        gsd=None,
        target_size=None,
        target_pixels=None,
        trigger=way.inputs.flight.trigger,
        heading=way.heading_deg,
        grid="line" if shape.rows == 1 else "lanes",
        lanes=None if shape.rows == 1 else shape.rows,
        lane_pitch=max(shape.across / shape.along, 1.0) if pitched else None,
        baseline=shape.along * way.altitude_m,
        samples=shape.samples,
        max_samples=None,
        **values,
    )


def last_number(most: int, holds: Callable[[int], bool]) -> int:
    """The largest number up to `most` for which a condition is true; 0 if there is no such number.

    The condition is true up to some number, and false for all larger numbers.
    """
    low, high = 0, most + 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
