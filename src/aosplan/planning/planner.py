"""`plan` runs all stages from a request to waypoints, in order. Each stage returns a value that
cannot be changed.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from aosplan.errors import InfeasibleError, RequestError
from aosplan.models.ground_visibility import ground_visibility
from aosplan.planning.confidence import confidence_of
from aosplan.planning.loaded_scene import load_scene
from aosplan.planning.options import GAIN
from aosplan.planning.plan_warnings import (
    guided_warnings,
    measured_warnings,
    scene_elsewhere,
    with_warnings,
)
from aosplan.planning.resolve import resolve_inputs
from aosplan.planning.result import Plan
from aosplan.planning.sites import layout_of, route_of, ways_in_zones
from aosplan.planning.solved_plan import solve_inputs

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.messages import Message
    from aosplan.models.detection import Detection
    from aosplan.models.ground_visibility import GroundVisibility
    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.sites import Layout
    from aosplan.planning.solved_plan import SolvedPlan
    from aosplan.planning.within_result import WithinResult
    from aosplan.solver.problem import OnTrial


def plan(
    request: PlanRequest,
    *,
    folder: str = "",
    progress: Callable[[int, int], None] | None = None,
    on_trial: OnTrial | None = None,
    loaded: LoadedScene | None = None,
) -> Plan:
    """Plan the number of photos, the distance between them, and their positions.

    Parameters
    ----------
    request
        The request.
    folder
        Folder in which the files of the request are looked for before the current folder.
    progress
        Function that is called with the number of points read and the total, while a point cloud is
        read.
    on_trial
        Function that is called during a search with the problem, a pattern and a baseline [m].
    loaded
        The scene of the request, if it has been read before.

    Raises
    ------
    RequestError
        If a name, file or number is not valid, or if two options contradict each other.  An example
        is an altitude below the top of the canopy.
    InfeasibleError
        If no grid meets the target.

    Examples
    --------
    >>> from aosplan import PlanRequest, plan
    >>> grid = plan(PlanRequest(altitude=40, vhat=0.98))
    >>> grid.solution.pattern.samples, round(grid.solution.baseline_m, 2)
    (50, 2.8)
    """
    if request.searches:
        return _searched(request, folder=folder, progress=progress, loaded=loaded)
    inputs = resolve_inputs(
        request, folder=folder, load=None if loaded is None else lambda _: loaded, progress=progress
    )
    if inputs.is_guided:
        from aosplan.planning.guided import solve_guided

        solved = solve_guided(inputs)
    else:
        solved = solve_inputs(inputs, on_trial=on_trial)
    layout = _laid_out(solved, folder)
    route = route_of(solved.inputs, layout, solved.solution.baseline_m)
    notices: list[Message] = [*inputs.loaded.warnings]
    if inputs.model == "measured" and solved.guided is None:
        notices += measured_warnings(solved, compares_headings=inputs.compares_headings)
    notices += [*scene_elsewhere(inputs.loaded, layout.origin), *layout.notices]
    notices += ways_in_zones(solved.inputs, route)
    detection: Detection | None = None
    if inputs.find is not None:
        from aosplan.planning.plan_detection import detection_of, detection_warnings

        pattern, baseline_m = solved.solution.pattern, solved.solution.baseline_m
        detection = detection_of(solved.inputs, pattern, baseline_m)
        notices += detection_warnings(detection, solved.inputs, pattern.samples)
    if solved.guided is not None:
        notices += guided_warnings(solved.guided, solved.solution.prediction)
    elif inputs.area is not None and inputs.objective != "detection":
        from aosplan.planning.cheaper_flight import long_flight

        notices += long_flight(inputs.request, folder, inputs.loaded, route.total_time_s)
    made = Plan(
        inputs=solved.inputs,
        solution=solved.solution,
        grid=solved.grid,
        problem=solved.problem,
        coverage=solved.coverage,
        route=route,
        layout=layout,
        confidence=confidence_of(solved),
        ground=_ground_of(solved, layout),
        detection=detection,
        guided=solved.guided,
        notices=tuple(notices),
    )
    if request.order == GAIN:
        from aosplan.planning.gain_order import GainOrder

        made = GainOrder(made).plan()
    return with_warnings(made)


def _ground_of(solved: SolvedPlan, layout: Layout) -> GroundVisibility | None:
    """Visibility over the ground of a plan; None if nothing is hidden, if the samples have no
    ground in common, or if the plan is for a single place.

    For a single grid, the ground is the part that all samples see. For a single line, it is the
    swath. Over an area, it is one cell between sites, because every place has a grid whose middle
    is at most half a pitch away.
    """
    inputs, problem, solution = solved.inputs, solved.problem, solved.solution
    if problem is None or solved.guided is not None:
        return None
    sides = zip(inputs.footprint_m, solution.pattern.extent, strict=True)
    x, y = (size - side * solution.baseline_m for size, side in sides)
    if layout.survey is not None:
        pitch_x, pitch_y = layout.survey.pitch_m
        x, y = min(x, pitch_x), min(y, pitch_y)
    return ground_visibility(
        problem.model,
        solution.prediction,
        solution.pattern,
        solution.baseline_m,
        altitude_m=inputs.altitude_m,
        size_m=(x, y),
    )


def _laid_out(solved: SolvedPlan, folder: str) -> Layout:
    """Lay out the sites of a solution.

    If an area needs too many sites, the hint of the error describes a cheaper flight.
    """
    try:
        return layout_of(solved)
    except RequestError as error:
        inputs = solved.inputs
        if inputs.area is None or inputs.objective == "detection":
            raise
        from aosplan.planning.cheaper_flight import cheaper_way

        way = cheaper_way(inputs.request, folder, inputs.loaded)
        if way is None:
            way = (
                f"{error.hint}; or --within MIN, which chooses the best plan for the available time"
            )
        raise RequestError(error.message, way) from None


def _searched(
    request: PlanRequest,
    *,
    folder: str,
    progress: Callable[[int, int], None] | None,
    loaded: LoadedScene | None,
) -> Plan:
    """Search within a given time, and plan with the options that the search chooses."""
    from aosplan.planning.within import choose_flight

    found = loaded or load_scene(request, folder=folder, progress=progress)
    if request.order == GAIN:
        result, answer = _part_by_gain(request, folder, found)
    else:
        chosen, answer = choose_flight(request, folder=folder, load=lambda _: found)
        result = plan(chosen, folder=folder, loaded=found)
    limits = answer.limits(result.route.total_time_s)
    solution = result.solution._replace(limits=limits)
    return replace(
        result,
        solution=solution,
        within=answer,
        notices=(*result.notices, *answer.notices),
        warnings=(*result.warnings, *answer.notices),
    )


def _part_by_gain(
    request: PlanRequest, folder: str, found: LoadedScene
) -> tuple[Plan, WithinResult]:
    """The flight with the highest probability of success within a given time.

    It is a flight over the whole area, or the first part of a longer flight with a higher
    probability of detection at each place.  Longer flights that cannot have a higher probability
    are not planned.
    """
    from aosplan.planning.gain_order import GainOrder, most_success
    from aosplan.planning.within import choose_flights

    flights, inputs, answer = choose_flights(request, folder=folder, load=lambda _: found)
    longest_s = math.inf if request.within is None else 60.0 * request.within
    bounds = most_success(inputs, flights, longest_s)
    best: GainOrder | None = None
    refused: InfeasibleError | None = None
    for bound, chosen in sorted(bounds, key=lambda each: each[0], reverse=True):
        if best is not None and bound <= best.success:
            break
        made = plan(chosen.filled({"order": None}), folder=folder, loaded=found)
        try:
            order = GainOrder(made, longest_s)
        except InfeasibleError as error:
            refused = refused or error
            continue
        if best is None or order.success > best.success:
            best = order
    if best is None:
        assert refused is not None
        raise refused
    return with_warnings(best.plan()), answer
