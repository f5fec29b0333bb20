"""What is flown beyond the grid that was solved for: an area, or one long line."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import InfeasibleError, RequestError
from aosplan.files import located
from aosplan.flight.photo_trigger import Sites
from aosplan.grid.patterns import Pattern, check_size, local_sites
from aosplan.messages import Message

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.areas.area import Area
    from aosplan.areas.survey import Survey
    from aosplan.camera.camera import Camera
    from aosplan.grid.spiral import Spiral
    from aosplan.models.rolling import Continuous
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.route import Route
    from aosplan.solver.problem import Problem
    from aosplan.solver.solution import Solution


class Layout(NamedTuple):
    """Sites in flight order, and what they show.

    Attributes
    ----------
    sites
        Metres east and north of the origin.
    origin
        Latitude and longitude; None without a place.
    survey
        What the sites cover, where an area is given.
    continuous
        What a line flown on and on shows, where the grid is one.
    area
        What is covered, and where not to fly.
    """

    sites: Sites
    origin: tuple[float, float] | None
    survey: Survey | None = None
    continuous: Continuous | None = None
    area: Area | None = None

    @property
    def notices(self) -> tuple[Message, ...]:
        """What the area's files, and its no-fly zones, had to say."""
        return self.survey.notices if self.survey is not None else ()


def over_area(request: PlanRequest, folder: str) -> tuple[PlanRequest, Area | None]:
    """The area of a request, if it has one, and the request with its heading resolved.

    Files are looked for in `folder` first.
    """
    if request.area is None:
        return request, None
    from aosplan.areas.area import long_side_deg, read_area

    area = read_area(
        located(request.area, folder),
        clear=request.clear and located(request.clear, folder),
        no_fly=request.no_fly and located(request.no_fly, folder),
        buffer_m=request.buffer or 0.0,
    )
    if request.heading == "auto":
        request = replace(request, heading=long_side_deg(area.whole))
    return request, area


def layout_of(
    request: PlanRequest,
    area: Area | None,
    solution: Solution,
    problem: Problem | None,
    camera: Camera,
    altitude_m: float,
) -> Layout:
    """The sites of a solution: one grid, one line, or as many as an area takes."""
    continuous = continuous_for(request, solution, problem)
    if area is not None:
        survey = survey_for(request, area, solution, camera, altitude_m)
        return Layout(survey.sites_flown, survey.origin, survey, continuous, area)
    pattern = flown_pattern(request, solution)
    east, north = local_sites(pattern, solution.baseline_m, request.heading_deg)
    return Layout(Sites(east, north, [True] * len(east)), request.origin, None, continuous)


def survey_for(
    request: PlanRequest, area: Area, solution: Solution, camera: Camera, altitude_m: float
) -> Survey:
    """The flight over an area with the grid of a solution."""
    from aosplan.areas.survey import survey_of
    from aosplan.planning.route import flown

    footprint = camera.footprint_m(altitude_m)
    pattern = solution.pattern
    assert isinstance(pattern, Pattern)  # over an area no spiral is asked for, nor compared
    if request.grid == "line" and solution.baseline_m > 0.0:
        # Each line serves all the ground beside it that its images show.
        widest = footprint[1] / solution.baseline_m
        asked = request.lane_pitch if isinstance(request.lane_pitch, float) else widest
        pattern = pattern._replace(row_pitch=min(asked, widest))
    assert request.max_sites is not None  # the request has filled it in
    return survey_of(
        area,
        pattern,
        baseline_m=solution.baseline_m,
        heading_deg=request.heading_deg,
        footprint_m=footprint,
        max_sites=request.max_sites,
        timing=flown(request, camera.gsd_m(altitude_m), solution.baseline_m)[0],
    )


def ways_in_zones(request: PlanRequest, area: Area | None, route: Route) -> Iterator[Message]:
    """Warnings of ways to the sites and back that pass through no-fly zones.

    Raises
    ------
    InfeasibleError
        Where the drone does on its way from site to site: run-ins of lines that are flown
        through do not go around zones.
    """
    if area is None or request.no_fly is None:
        return
    import numpy as np

    from aosplan.areas.no_fly import NoFlyZones
    from aosplan.geodesy import to_local

    zones = NoFlyZones(area.keep_out)
    points = np.column_stack([route.waypoints.east_m, route.waypoints.north_m])
    crossing = int(zones.cross(points[:-1], points[1:]).sum())
    if crossing:
        raise InfeasibleError(
            f"{crossing} of the ways between lines that are flown through would pass through "
            "no-fly zones",
            "--trigger stop goes around them",
        )
    if request.takeoff is None:
        return
    takeoff = np.column_stack(to_local(area.origin, [request.takeoff[0]], [request.takeoff[1]]))
    ends = points[[place for flight in route.flights for place in (flight.first, flight.last)]]
    through = int(zones.cross(np.broadcast_to(takeoff, ends.shape), ends).sum())
    if through or zones.inside(takeoff)[0]:
        yield Message(
            "way_through_zone",
            f"{through} of the {len(ends)} straight ways from the take-off to a flight and back "
            "pass through a no-fly zone: choose another --takeoff, or fly them by hand",
        )


def flown_pattern(request: PlanRequest, solution: Solution) -> Pattern | Spiral:
    """The pattern that is flown where no area is given: the grid, or a longer line.

    Raises
    ------
    RequestError
        Where the line is shorter than one integral.
    """
    if request.line_length is None or solution.baseline_m == 0.0:
        return solution.pattern
    photos = int(request.line_length / solution.baseline_m * (1.0 + 1e-12)) + 1
    check_size(photos, "the line has")
    if photos < solution.pattern.samples:
        needed = (solution.pattern.samples - 1) * solution.baseline_m
        raise RequestError(
            f"--line-length {request.line_length:g} is shorter than one integral, "
            f"{solution.pattern.samples} photos over {needed:.4g} m",
            f"--line-length {math.ceil(needed)} is enough",
        )
    return Pattern(1, photos)


def continuous_for(
    request: PlanRequest, solution: Solution, problem: Problem | None
) -> Continuous | None:
    """What a line shows that is flown on and on; None for other grids."""
    if request.grid != "line" or problem is None:
        return None
    from aosplan.models.rolling import continuous_of

    assert request.speed is not None  # the request has filled it in
    return continuous_of(
        problem.model,
        solution.pattern.samples,
        solution.baseline_m,
        speed_mps=request.speed,
        shortest_interval_s=request.photo_interval,
        photos=None if request.line_length is None else flown_pattern(request, solution).samples,
    )
