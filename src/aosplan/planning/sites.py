"""The sites of a plan: one grid, a long line, or a grid that is repeated over an area."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import InfeasibleError, RequestError
from aosplan.flight.track import FlightPoints
from aosplan.grid.patterns import Pattern, check_size, local_sites
from aosplan.messages import Message
from aosplan.planning.route import build_route, timing_at_baseline

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.areas.area import Area
    from aosplan.areas.survey import Survey
    from aosplan.grid.patterns import AnyPattern
    from aosplan.models.rolling import Continuous
    from aosplan.planning.resolve import PlanInputs
    from aosplan.planning.route import Route
    from aosplan.planning.solved_plan import SolvedPlan
    from aosplan.solver.solution import Solution


class Layout(NamedTuple):
    """Sites in flight order, with the coverage of an area or the integrals along a line.

    Attributes
    ----------
    sites
        Metres east and north of the origin.
    origin
        Latitude and longitude; None if the plan has no location.
    survey
        Coverage of an area; None without an area.
    continuous
        The integrals along a continuous line; None for other grids.
    area
        The area and its no-fly zones.
    """

    sites: FlightPoints
    origin: tuple[float, float] | None
    survey: Survey | None = None
    continuous: Continuous | None = None
    area: Area | None = None

    @property
    def notices(self) -> tuple[Message, ...]:
        """Warnings about the files of the area and about no-fly zones."""
        return self.survey.notices if self.survey is not None else ()


def layout_of(solved: SolvedPlan) -> Layout:
    """The sites of a solution: one grid, one line, or all sites that the area needs."""
    inputs, solution = solved.inputs, solved.solution
    if solved.guided is not None:
        origin = inputs.origin if inputs.area is None else inputs.area.origin
        return Layout(solved.guided.sites, origin, area=inputs.area)
    continuous = _continuous_for(solved)
    if inputs.area is not None:
        survey = _survey_for(inputs, inputs.area, solution)
        return Layout(survey.sites_flown, survey.origin, survey, continuous, inputs.area)
    pattern = flown_pattern(inputs, solution)
    east, north = local_sites(pattern, solution.baseline_m, inputs.heading_deg)
    return Layout(FlightPoints(east, north, [True] * len(east)), inputs.origin, None, continuous)


def _survey_for(inputs: PlanInputs, area: Area, solution: Solution) -> Survey:
    """The flight over an area with the grid of a solution."""
    from aosplan.areas.survey import survey_of

    footprint, pattern = inputs.footprint_m, solution.pattern
    assert isinstance(pattern, Pattern)  # Spirals over an area have already been refused.
    if inputs.is_line and solution.baseline_m > 0.0:
        # The images of a line cover a strip of ground on both sides of it.
        widest = footprint[1] / solution.baseline_m
        pattern = pattern._replace(row_pitch=min(inputs.line_pitch or widest, widest))
    return survey_of(
        area,
        pattern,
        baseline_m=solution.baseline_m,
        heading_deg=inputs.heading_deg,
        footprint_m=footprint,
        max_sites=inputs.max_sites,
        timing=timing_at_baseline(inputs.flight, inputs.heading_deg, solution.baseline_m)[0],
    )


def route_of(inputs: PlanInputs, layout: Layout, baseline_m: float) -> Route:
    """The route through sites that are one baseline apart."""
    return build_route(
        inputs.flight,
        layout.sites,
        heading_deg=inputs.heading_deg,
        origin=layout.origin,
        altitude_m=inputs.altitude_m + inputs.focal_height_m,
        baseline_m=baseline_m,
        canopy_top_m=inputs.loaded.scene.canopy_top_m,
    )


def ways_in_zones(inputs: PlanInputs, route: Route) -> Iterator[Message]:
    """Warn if paths to the sites or back pass through no-fly zones.

    Raises
    ------
    InfeasibleError
        If a path between sites passes through a zone.  This may happen because the run-ins of lines
        that are flown through do not avoid zones.
    """
    area, takeoff_at = inputs.area, inputs.flight.takeoff
    if area is None or area.keep_out.is_empty:
        return
    import numpy as np

    from aosplan.areas.no_fly import NoFlyZones
    from aosplan.geodesy import to_local

    zones = NoFlyZones(area.keep_out)
    points = np.column_stack([route.waypoints.east_m, route.waypoints.north_m])
    crossing = int(zones.cross(points[:-1], points[1:]).sum())
    if crossing:
        raise InfeasibleError(
            f"{crossing} of the straight paths between lines would pass through no-fly zones",
            "give --trigger stop, with which the drone flies around the zones",
        )
    if takeoff_at is None:
        return
    takeoff = np.column_stack(to_local(area.origin, [takeoff_at[0]], [takeoff_at[1]]))
    ends = points[[place for flight in route.flights for place in (flight.first, flight.last)]]
    through = int(zones.cross(np.broadcast_to(takeoff, ends.shape), ends).sum())
    if through or zones.inside(takeoff)[0]:
        yield Message(
            "way_through_zone",
            f"{through} of the {len(ends)} straight paths from the take-off to a flight and "
            "back pass through a no-fly zone; give another --takeoff, or fly these paths by "
            "hand",
        )


def flown_pattern(inputs: PlanInputs, solution: Solution) -> AnyPattern:
    """The pattern of a plan without an area: the grid, or a line that is longer than one integral.

    Raises
    ------
    RequestError
        If the line is shorter than one integral.
    """
    length_m = inputs.line_length_m
    if length_m is None or solution.baseline_m == 0.0:
        return solution.pattern
    photos = int(length_m / solution.baseline_m * (1.0 + 1e-12)) + 1
    check_size(photos, "the line has")
    if photos < solution.pattern.samples:
        needed = (solution.pattern.samples - 1) * solution.baseline_m
        raise RequestError(
            f"--line-length {length_m:g} is shorter than an integral, which needs "
            f"{solution.pattern.samples} photos over {needed:.4g} m",
            f"--line-length {math.ceil(needed)} is enough",
        )
    return Pattern(1, photos)


def _continuous_for(solved: SolvedPlan) -> Continuous | None:
    """The integrals along a continuous line; None for other grids."""
    inputs, solution = solved.inputs, solved.solution
    if solved.problem is None or not inputs.is_line:
        return None
    from aosplan.models.rolling import continuous_of
    from aosplan.planning.route import timing_at_baseline

    return continuous_of(
        solved.problem.model,
        solution.pattern.samples,
        solution.baseline_m,
        speed_mps=timing_at_baseline(inputs.flight, inputs.heading_deg, solution.baseline_m)[
            0
        ].speed_mps,
        shortest_interval_s=inputs.flight.photo_interval_s,
        photos=None if inputs.line_length_m is None else flown_pattern(inputs, solution).samples,
    )
