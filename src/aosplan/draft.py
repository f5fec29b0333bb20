"""The draft of a plan: what is flown where, before waypoints, doubts and documents."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.models.model import Prediction
from aosplan.planning.inputs import (
    altitude_of,
    camera_of,
)
from aosplan.planning.route import (
    Route,
    lay,
)
from aosplan.planning.setup import (
    Task,
    kinds_of,
)
from aosplan.planning.sites import (
    Layout,
    over_area,
)
from aosplan.solver.problem import (
    GridKind,
    Problem,
    Solution,
)
from aosplan.solver.solution import rounded_up

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.areas.area import Area
    from aosplan.camera.disparity import CoverageBaseline
    from aosplan.planning.inputs import ResolvedScene
    from aosplan.planning.request import PlanRequest
    from aosplan.scenes.scene import Scene
    from aosplan.solver.problem import Trying

MODEL_OF = {"uniform": "uniform", "layered": "layered", "cloud": "measured"}
"""The smallest model that fits a kind of scene."""


class Draft(NamedTuple):
    """A request, what it stands for, and the grid that answers it.

    Attributes
    ----------
    request
        What was asked for, with the heading that an area decides.
    area
        The area, where one is given.
    found
        The scene.
    task
        What stays as it is whatever the scene; its request has the heading that is flown.
    problem, coverage
        What was solved, and the coverage rule; None where nothing is hidden.
    solution, grid, heading_deg
        The answer.
    """

    request: PlanRequest
    area: Area | None
    found: ResolvedScene
    task: Task
    problem: Problem | None
    coverage: CoverageBaseline | None
    solution: Solution
    grid: GridKind
    heading_deg: float


def draft_of(
    request: PlanRequest,
    *,
    scene: Callable[[PlanRequest], ResolvedScene],
    folder: str = "",
    trying: Trying | None = None,
    kept: dict[tuple[Any, ...], Any] | None = None,
    count_required: bool = True,
    seek_remedy: bool = True,
) -> Draft:
    """Solve a request.

    Parameters
    ----------
    request, folder, trying
        As of `aosplan.planning.planner.plan`.
    scene
        Finds the scene of a request.
    kept
        What other requests have made of the same scene, and where this one adds to it.
    count_required, seek_remedy
        Whether the fewest samples at the answer's baseline are wanted, and the hints of targets out
        of reach; each takes a search.

    Raises
    ------
    RequestError
        Where names, files or numbers are wrong together.
    InfeasibleError
        Where nothing meets the target.
    """
    camera = camera_of(request, folder=folder)
    altitude = altitude_of(request, camera)
    request, area = over_area(request, folder)
    found = scene(request)
    model = request.model or MODEL_OF[found.kind]
    _check_model(model, found.kind, request)
    if found.scene.integrated_density > 0.0:
        _check_altitude(found.scene, altitude, request)
    task = Task(
        request,
        model,
        camera,
        altitude,
        camera.gsd_m(altitude),
        camera.footprint_m(altitude),
        kept,
        count_required,
        seek_remedy,
    )
    posed = task.problem_of(found)
    if posed is None:
        grid, solution = _clear_view(request)
        problem, coverage, heading = None, None, request.heading_deg
    else:
        coverage = posed[1]
        problem, solution = task.choice(posed[0]._replace(trying=trying))
        grid, heading = problem.grid, getattr(problem.model, "heading_deg", request.heading_deg)
    if heading != request.heading:
        task = task._replace(request=replace(request, heading=heading))
    return Draft(request, area, found, task, problem, coverage, solution, grid, heading)


def route_of(draft: Draft, layout: Layout, folder: str = "") -> Route:
    """The route over the sites of a draft."""
    task = draft.task
    return lay(
        task.request,
        layout.sites,
        origin=layout.origin,
        altitude_m=task.altitude_m + task.request.focal_height,
        gsd_m=task.gsd_m,
        baseline_m=draft.solution.baseline_m,
        canopy_top_m=draft.found.scene.canopy_top_m,
        folder=folder,
    )


def _check_altitude(scene: Scene, altitude_m: float, request: PlanRequest) -> None:
    """Refuse an altitude within the canopy, or nearer to it than the clearance."""
    top = scene.canopy_top_m - request.focal_height
    lowest = top + request.clearance
    if altitude_m > top and altitude_m >= lowest:
        return
    origin = "" if request.altitude is not None else ", solved from the resolution,"
    stands = f"the canopy, whose top is {top:.6g} m above the focal plane"
    remedy = f"fly {rounded_up(lowest)} m or higher, {request.clearance:g} m above {top:.6g} m"
    if altitude_m <= top:
        raise RequestError(
            f"altitude {altitude_m:.6g} m{origin} is not above {stands}",
            remedy if request.clearance else f"fly higher than {top:.6g} m",
        )
    raise RequestError(
        f"altitude {altitude_m:.6g} m{origin} is less than --clearance {request.clearance:g} m "
        f"above {stands}",
        f"{remedy}; or give a smaller --clearance",
    )


def _check_model(name: str, kind: str, request: PlanRequest) -> None:
    if name == "measured" and kind != "cloud":
        raise RequestError(
            "--model measured needs the voxels of a point cloud",
            "give --scene FILE.laz, FILE.npz or what scene --save wrote, or another --model",
        )
    if request.view is not None and name != "measured":
        raise RequestError(f"--view {request.view} with --model {name}", "it goes with measured")
    if request.rays is not None and name == "measured":
        raise RequestError(
            f"--rays {request.rays} with --model measured",
            "it traces the rays as they are; --rays goes with uniform and layered",
        )


def _clear_view(request: PlanRequest) -> tuple[GridKind, Solution]:
    """One sample, or as many as were asked for, over a scene in which nothing is hidden."""
    grid = kinds_of(request)[0]
    pattern = grid.pattern(request.samples or 1)
    return grid, Solution(
        pattern=pattern,
        baseline_m=request.baseline or 0.0,
        prediction=Prediction(0.0, 1.0, 1.0 / pattern.samples),
        samples_required=1,
        limits=(),
        met=True,
    )
