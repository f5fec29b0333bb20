"""The plan: from a request to waypoints, in one pass of frozen values."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from aosplan.messages import Message
from aosplan.planning.inputs import scene_of
from aosplan.planning.plan_warnings import with_warnings
from aosplan.planning.result import Plan
from aosplan.planning.sensitivity import Doubts, doubts_of
from aosplan.planning.setup import draft_of, route_of
from aosplan.planning.sites import layout_of, ways_in_zones
from aosplan.solver.alternatives import Alternative, other_heading

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from aosplan.planning.inputs import ResolvedScene
    from aosplan.planning.request import PlanRequest
    from aosplan.solver.problem import OnTrial, Problem
    from aosplan.solver.solution import Solution

SATURATED = 0.98
"""Mean share of the ground that views hide, from which on a prediction hangs on few gaps."""


def plan(
    request: PlanRequest,
    *,
    folder: str = "",
    progress: Callable[[int, int], None] | None = None,
    on_trial: OnTrial | None = None,
    found: ResolvedScene | None = None,
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
    found
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

    def scene(request: PlanRequest) -> ResolvedScene:
        return found or scene_of(request, folder=folder, progress=progress)

    draft = draft_of(request, scene=scene, folder=folder, on_trial=on_trial)
    task, solution, problem = draft.task, draft.solution, draft.problem
    headed, altitude, found = task.request, task.altitude_m, draft.found
    notices = found.warnings
    doubts = Doubts(uncertainty_reason="nothing is hidden")
    if problem is not None:
        doubts = doubts_of(task, found, problem, solution)
        if task.model == "measured":
            notices += tuple(_doubts(found, problem, solution, altitude))
            if request.heading != "best" and (
                word := other_heading(Alternative(problem, solution))
            ):
                notices += (Message("heading", word),)
    layout = layout_of(headed, draft.area, solution, problem, task.camera, altitude)
    route = route_of(draft, layout, folder)
    notices += layout.notices + tuple(ways_in_zones(headed, draft.area, route))
    detection = None
    if headed.find is not None:
        from aosplan.planning.detection import detection_of, detection_warnings

        grid = solution.pattern, solution.baseline_m, draft.heading_deg
        detection = detection_of(headed, found, task.model, altitude, *grid)
        notices += tuple(
            detection_warnings(detection, headed, solution.pattern.samples, task.gsd_m)
        )
    planned = Plan(
        request=_completed(draft.request, task.model, found),
        scene=found.scene,
        camera=task.camera,
        altitude_m=altitude,
        model=task.model,
        solution=solution,
        grid=draft.grid,
        heading_deg=draft.heading_deg,
        problem=problem,
        coverage=draft.coverage,
        route=route,
        layout=layout,
        volume=found.volume,
        approximation="correlogram" if task.model == "measured" and found.volume is None else None,
        **doubts._asdict(),
        detection=detection,
        notices=notices,
    )
    return with_warnings(planned)


def _doubts(
    found: ResolvedScene, problem: Problem, solution: Solution, altitude_m: float
) -> Iterator[Message]:
    """Yield what a reader of a measured prediction should know."""
    if found.volume is None:
        yield Message(
            "correlogram_approximation",
            "predicted from the scene's correlogram, an approximation (of V̂, mostly within 0.02); "
            "the voxels in a .npz give the exact prediction",
        )
    density = solution.prediction.density
    if density > SATURATED and "saturated" not in {code for code, _ in found.warnings}:
        yield Message(
            "saturated",
            f"the views hide {density:.1%} of the ground on average: what they show hangs on a few "
            "gaps; read the cloud with smaller voxels, or keep the aperture smaller",
        )
    extent_m = max(solution.pattern.extent) * solution.baseline_m
    if extent_m > problem.model.widest_aperture_m * (1.0 + 1e-9):
        shear_m = 0.5 * extent_m / problem.model.widest_aperture_m
        yield Message(
            "small_plot",
            f"the plot is smaller than twice the shear of this aperture: {extent_m:.4g} m at "
            f"{altitude_m:.4g} m move the canopy's top by {shear_m:.2g} of the plot, and beyond a "
            "half its wrapped copies count twice; keep the aperture within "
            f"{problem.model.widest_aperture_m:.4g} m, or measure a larger plot",
        )


def _completed(request: PlanRequest, model: str, found: ResolvedScene) -> PlanRequest:
    """The request with the defaults that depend on its scene."""
    filled: dict[str, Any] = {"model": model, **found.reading}
    if model == "measured":
        filled["view"] = request.view or "telecentric"
    else:
        filled["rays"] = request.rays or "nadir"
    return replace(request, **filled)
