"""The plan: from a request to waypoints, in one pass of frozen values."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from aosplan.errors import RequestError
from aosplan.geodesy import to_local
from aosplan.messages import Message
from aosplan.planning.ground import ground_of
from aosplan.planning.loaded_scene import load_scene
from aosplan.planning.plan_warnings import with_warnings
from aosplan.planning.resolve import resolve_inputs
from aosplan.planning.result import Plan
from aosplan.planning.sensitivity import confidence_of
from aosplan.planning.sites import layout_of, route_of, ways_in_zones
from aosplan.planning.solved_plan import solve_inputs
from aosplan.solver.alternatives import Alternative, other_heading

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from aosplan.models.detection import Detection
    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.resolve import PlanInputs
    from aosplan.planning.sites import Layout
    from aosplan.planning.solved_plan import SolvedPlan
    from aosplan.solver.problem import OnTrial

SCENE_NEARBY_M = 50_000.0
"""A scene that was measured farther from the plan is named: either place may be a mistake."""

EDGES_MATTER = 0.02
"""Difference of V or V̂ between the places whose rays stay on a plot and all of it that is worth a word."""

SATURATED = 0.98
"""Mean share of the ground that views hide, from which on a prediction hangs on few gaps."""


def plan(
    request: PlanRequest,
    *,
    folder: str = "",
    progress: Callable[[int, int], None] | None = None,
    on_trial: OnTrial | None = None,
    loaded: LoadedScene | None = None,
) -> Plan:
    """Solve a request: how many photos, how far apart, and where.

    Parameters
    ----------
    request
        What to plan.
    folder
        Where the request's file names are looked for before the current folder.
    progress
        Called with points read and points in all while a point cloud is read.
    on_trial
        Called while a search lasts, with the problem, a pattern and a baseline [m].
    loaded
        The request's scene, where it has been read before.

    Raises
    ------
    RequestError
        Where names, files or numbers are wrong together: an altitude below the canopy, say.
    InfeasibleError
        Where nothing meets the target.

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
    solved = solve_inputs(inputs, on_trial=on_trial)
    layout = _laid_out(solved, folder)
    route = route_of(solved.inputs, layout, solved.solution.baseline_m)
    detection: Detection | None = None
    found: tuple[Message, ...] = ()
    if inputs.find is not None:
        detection, found = _detection(solved)
    notices: tuple[Message, ...] = (
        *inputs.loaded.warnings,
        *_measured_notices(solved, compares_headings=inputs.compares_headings),
        *_elsewhere(inputs.loaded, layout.origin),
        *layout.notices,
        *ways_in_zones(solved.inputs, route),
        *found,
        *_long_flight(solved.inputs, folder, route.total_time_s),
    )
    return with_warnings(
        Plan(
            inputs=solved.inputs,
            solution=solved.solution,
            grid=solved.grid,
            problem=solved.problem,
            coverage=solved.coverage,
            route=route,
            layout=layout,
            confidence=confidence_of(solved),
            ground=ground_of(solved, layout),
            detection=detection,
            notices=notices,
        )
    )


def _laid_out(solved: SolvedPlan, folder: str) -> Layout:
    """The sites of a solution; of an area that takes too many, the hint names a cheaper way."""
    try:
        return layout_of(solved)
    except RequestError as error:
        inputs = solved.inputs
        if inputs.area is None or inputs.objective == "detection":
            raise
        from aosplan.planning.cheaper import cheaper_way

        way = cheaper_way(inputs.request, folder, inputs.loaded)
        if way is None:
            way = (
                f"{error.hint}; or --within MIN, which chooses the best for the time that there is"
            )
        raise RequestError(error.message, way) from None


def _long_flight(inputs: PlanInputs, folder: str, time_s: float) -> Iterator[Message]:
    """Yield the warning of an area that takes hours and need not."""
    if inputs.area is None or inputs.objective == "detection":
        return
    from aosplan.planning.cheaper import LONG_S, long_flight

    if time_s > LONG_S:
        yield from long_flight(inputs.request, folder, inputs.loaded, time_s)


def _searched(
    request: PlanRequest,
    *,
    folder: str,
    progress: Callable[[int, int], None] | None,
    loaded: LoadedScene | None,
) -> Plan:
    """The plan of what a search chooses."""
    from aosplan.planning.within import choose

    found = loaded or load_scene(request, folder=folder, progress=progress)
    chosen, answer = choose(request, folder=folder, load=lambda _: found)
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


def _elsewhere(loaded: LoadedScene, origin: tuple[float, float] | None) -> Iterator[Message]:
    """Yield the warning of a scene that was measured far from where the plan is."""
    place = None if loaded.volume is None else loaded.volume.place
    if place is None or origin is None:
        return
    (east_m,), (north_m,) = to_local(origin, [place[0]], [place[1]])
    apart_m = math.hypot(east_m, north_m)
    if apart_m > SCENE_NEARBY_M:
        yield Message(
            "scene_elsewhere",
            f"the scene was measured {apart_m / 1000.0:.3g} km away, at {place[0]:.4f},"
            f"{place[1]:.4f}: check --origin or --area if the scene shows this place",
        )


def _detection(solved: SolvedPlan) -> tuple[Detection, tuple[Message, ...]]:
    """How likely it is that what is looked for is found, and warnings of that."""
    from aosplan.planning.detection import detection_of, detection_warnings

    inputs, solution = solved.inputs, solved.solution
    found = detection_of(inputs, solution.pattern, solution.baseline_m)
    return found, tuple(detection_warnings(found, inputs, solution.pattern.samples))


def _edges(solved: SolvedPlan) -> Iterator[Message]:
    """Yield what wrapping a plot does to a prediction, if it is not what was asked for."""
    from aosplan.models.measured import MeasuredModel

    problem, solution = solved.problem, solved.solution
    assert problem is not None  # the caller has checked
    model, grid = problem.model, (solution.pattern, solution.baseline_m)
    if solved.inputs.edges == "wrapped" or not isinstance(model, MeasuredModel):
        return
    if model.edges_of(*grid) != "wrapped":
        return
    inside = model.interior_prediction(*grid)
    if inside is None:
        yield Message(
            "edges_wrapped",
            "from every place of the plot some ray of this grid leaves it, so the plot is taken to repeat "
            "itself: a rim that was clipped thin counts as much as the stand; measure a larger plot, or "
            "keep the aperture smaller",
        )
    elif abs(inside.normalized - solution.prediction.normalized) > EDGES_MATTER or (
        abs(inside.expected - solution.prediction.expected) > EDGES_MATTER
    ):
        yield Message(
            "edges_wrapped",
            "rays of this grid leave the plot, which is taken to repeat itself, and its rim differs from its "
            f"middle: the places whose rays stay on the plot have V̂ = {inside.normalized:.3g} and V = "
            f"{inside.expected:.3g}, against {solution.prediction.normalized:.3g} and "
            f"{solution.prediction.expected:.3g}; --edges interior plans with those alone",
        )


def _measured_notices(solved: SolvedPlan, *, compares_headings: bool) -> Iterator[Message]:
    """Yield what a reader of a measured prediction should know."""
    inputs, problem, solution = solved.inputs, solved.problem, solved.solution
    if problem is None or inputs.model != "measured":
        return
    if inputs.loaded.volume is None:
        yield Message(
            "correlogram_approximation",
            "predicted from the scene's correlogram, an approximation (of V̂, mostly within 0.02); "
            "the voxels in a .npz give the exact prediction",
        )
    yield from _edges(solved)
    density = solution.prediction.density
    if density > SATURATED and "saturated" not in {code for code, _ in inputs.loaded.warnings}:
        yield Message(
            "saturated",
            f"the views hide {density:.1%} of the ground on average: what they show depends on a few "
            "gaps; read the cloud with smaller voxels, or keep the aperture smaller",
        )
    extent_m = max(solution.pattern.extent) * solution.baseline_m
    if extent_m > problem.model.widest_aperture_m * (1.0 + 1e-9):
        shear_m = 0.5 * extent_m / problem.model.widest_aperture_m
        yield Message(
            "small_plot",
            f"the plot is smaller than twice the shear of this aperture: {extent_m:.4g} m at "
            f"{inputs.altitude_m:.4g} m move the canopy's top by {shear_m:.2g} of the plot, and beyond a "
            "half its wrapped copies count twice; keep the aperture within "
            f"{problem.model.widest_aperture_m:.4g} m, or measure a larger plot",
        )
    if not compares_headings and (word := other_heading(Alternative(problem, solution))):
        yield Message("heading", word)
