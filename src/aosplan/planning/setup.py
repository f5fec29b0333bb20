"""The task: from a request and a scene to the problem that they pose the solver."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.camera.disparity import CoverageBaseline, coverage_baseline
from aosplan.errors import RequestError
from aosplan.models.model import Prediction
from aosplan.models.uniform import UniformModel
from aosplan.planning.inputs import altitude_of, camera_of
from aosplan.planning.route import Route, lay, timing_of
from aosplan.planning.sites import Layout, over_area
from aosplan.solver.alternatives import Alternative, kinds, solve_best, solve_best_heading
from aosplan.solver.problem import Bounds, GridKind, Problem, Requirement
from aosplan.solver.solution import Solution, rounded_up
from aosplan.units import exact_share

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.areas.area import Area
    from aosplan.camera.camera import Camera
    from aosplan.camera.disparity import Slab
    from aosplan.models.model import VisibilityModel
    from aosplan.planning.inputs import ResolvedScene
    from aosplan.planning.request import PlanRequest
    from aosplan.scenes.scene import Scene
    from aosplan.solver.problem import OnTrial


class Task(NamedTuple):
    """What of a plan stays as it is whatever the scene: the request, and what it stands for.

    `kept` has what earlier tasks over the very same scene have made of it, to be used again.
    `count_required` and `seek_remedy` are those of `aosplan.solver.problem.Problem`.
    """

    request: PlanRequest
    model: str
    camera: Camera
    altitude_m: float
    gsd_m: float
    footprint_m: tuple[float, float]
    kept: dict[tuple[Any, ...], Any] | None = None
    count_required: bool = True
    seek_remedy: bool = True

    def choice(self, problem: Problem) -> Alternative:
        """The best of the grids and headings that the request leaves open."""
        problems = [problem._replace(grid=kind) for kind in kinds_of(self.request)]
        best = solve_best_heading if self.request.heading == "best" else solve_best
        over_area = self.request.area is not None
        return best(problems, footprint_m=self.footprint_m, over_area=over_area)

    def problem_of(self, found: ResolvedScene) -> tuple[Problem, CoverageBaseline] | None:
        """The problem that a scene poses, and its coverage rule; None where nothing is hidden."""
        request, altitude, focal = self.request, self.altitude_m, self.camera.focal_length_px
        above, density = self._kept(_above, found.scene, request.focal_height)
        if above is None or density == 0.0:
            return None
        _check_density(above, density, request)
        slabs = self._kept(_slabs, above)
        coverage = self._kept(coverage_baseline, slabs, altitude, focal, request.coverage)
        if self.model == "measured":
            model, surrogate = self._measured(found)
        else:
            model, surrogate = self._model(above, coverage), None
        problem = Problem(
            model=model,
            requirement=requirement_of(request),
            grid=kinds_of(request)[0],
            bounds=Bounds(
                max_aperture_m=request.max_aperture,
                max_samples=request.max_samples,
                baseline_m=request.baseline,
                samples=request.samples,
            ),
            objective=request.optimize,
            timing=timing_of(request, self.gsd_m)[0],
            surrogate=surrogate,
            count_required=self.count_required,
            seek_remedy=self.seek_remedy,
        )
        return problem, coverage

    def _kept(self, make: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        """What a function makes of its arguments, made once where such things are kept."""
        if self.kept is None:
            return make(*arguments, **named)
        # Scenes and voxels are the same where they are the same object, which the entry keeps alive.
        key = (make, *map(_identity, arguments), *sorted(named.items()))
        if key not in self.kept:
            self.kept[key] = make(*arguments, **named), arguments
        return self.kept[key][0]

    def _model(self, above: Scene, coverage: CoverageBaseline) -> VisibilityModel:
        hold_error_m, rays = self.request.hold_error, self.request.rays or "nadir"
        if self.model == "uniform":
            return UniformModel(
                above.integrated_density,
                above.transparency,
                coverage.baseline_m,
                altitude_m=self.altitude_m,
                hold_error_m=hold_error_m,
                rays=rays,
            )
        focal = self.camera.focal_length_px
        model: VisibilityModel = self._kept(
            _layered, above, self.altitude_m, focal, hold_error_m=hold_error_m, rays=rays
        )
        return model

    def _measured(self, found: ResolvedScene) -> tuple[VisibilityModel, VisibilityModel | None]:
        """The measured model, and the surrogate to search with."""
        from aosplan.models.correlogram import CorrelogramModel
        from aosplan.models.measured import MeasuredModel
        from aosplan.scenes.correlogram import correlogram

        request, altitude, table = self.request, self.altitude_m, found.correlogram
        focal_height = request.focal_height
        common: dict[str, Any] = {
            "heading_deg": request.heading_deg,
            "hold_error_m": request.hold_error,
        }
        if found.volume is None:
            assert table is not None  # the model was checked against the kind of scene
            if focal_height > 0.0 or request.view == "perspective":
                raise RequestError(
                    f"scene '{request.scene}' holds a correlogram, which knows neither a raised "
                    "focal plane nor the view perspective",
                    "save the scene as .npz, with its voxels, or use --model layered",
                )
            return self._kept(CorrelogramModel, table, altitude, **common), None
        seen: dict[str, Any] = {
            "view": "perspective" if request.view == "perspective" else "telecentric",
            "focal_height_m": focal_height,
            **common,
        }
        model = self._kept(MeasuredModel, found.volume, altitude, **seen)
        if None not in (request.baseline, request.samples) and request.heading != "best":
            return model, None  # nothing is searched
        if model.view == "perspective":  # the correlogram is telecentric; fewer targets do instead
            sparse = self._kept(MeasuredModel, found.volume, altitude, targets_per_voxel=1, **seen)
            return model, sparse
        if table is None or focal_height > 0.0:
            table = self._kept(correlogram, found.volume, focal_height_m=focal_height)
        return model, self._kept(CorrelogramModel, table, altitude, **common)


def _above(scene: Scene, height_m: float) -> tuple[Scene | None, float]:
    """What stands above a height, and its density."""
    above = scene.above(height_m)
    return above, above.integrated_density if above is not None else 0.0


def _slabs(scene: Scene) -> tuple[Slab, ...]:
    return scene.slabs()


def _layered(
    above: Scene, altitude_m: float, focal_length_px: float, **common: Any
) -> VisibilityModel:
    from aosplan.models.layered import LayeredModel

    return LayeredModel(above.slices(), altitude_m, focal_length_px, **common)


def _identity(argument: Any) -> Any:
    """What tells arguments apart: numbers and text by their values, anything else by itself."""
    return argument if isinstance(argument, (float, int, str)) else id(argument)


def requirement_of(request: PlanRequest) -> Requirement:
    """The target of a request."""
    if request.visibility is not None:
        return Requirement("visibility", exact_share(request.visibility, "--visibility"))
    assert request.vhat is not None  # the request has filled it in
    return Requirement("normalized", exact_share(_as_written(request.vhat), "--vhat"))


def _as_written(share: float | str) -> str:
    # A float in a request is the nearest one to a decimal that was written.
    return share if isinstance(share, str) else repr(share)


def kinds_of(request: PlanRequest) -> tuple[GridKind, ...]:
    """The kinds of grid that a request leaves open."""
    spirals = request.trigger == "stop" and request.area is None
    return kinds(request.grid, request.lanes, request.lane_pitch, spirals=spirals)


def _check_density(above: Scene, density: float, request: PlanRequest) -> None:
    if above.transparency == 0.0 or density >= 1.0:
        shown = above.name if request.scene is None else request.scene
        raise RequestError(
            f"scene '{shown}' has integrated density 1: no ray reaches the ground, and no "
            "number of photos shows what lies there",
            "a density below 1 is needed; for a point cloud, a smaller --voxel or a larger "
            "--min-height",
        )


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
    on_trial: OnTrial | None = None,
    kept: dict[tuple[Any, ...], Any] | None = None,
    count_required: bool = True,
    seek_remedy: bool = True,
) -> Draft:
    """Solve a request.

    Parameters
    ----------
    request, folder, on_trial
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
        _check_altitude(found, altitude, request)
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
        problem, solution = task.choice(posed[0]._replace(on_trial=on_trial))
        grid, solved = problem.grid, problem.model.heading_deg
        heading = request.heading_deg if solved is None else solved
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


def _check_altitude(found: ResolvedScene, altitude_m: float, request: PlanRequest) -> None:
    """Refuse an altitude within the canopy, or nearer to it than the clearance."""
    top = found.scene.canopy_top_m - request.focal_height
    lowest = top + request.clearance
    if altitude_m > top and altitude_m >= lowest:
        return
    origin = "" if request.altitude is not None else ", solved from the resolution,"
    stands = f"the canopy, whose top is {top:.6g} m above the focal plane"
    remedy = f"fly {rounded_up(lowest)} m or higher, {request.clearance:g} m above {top:.6g} m"
    outliers = next((said for code, said in found.warnings if code == "points_far_above"), None)
    if outliers is not None:
        remedy = outliers
    if altitude_m <= top:
        raise RequestError(
            f"altitude {altitude_m:.6g} m{origin} is not above {stands}",
            remedy if request.clearance or outliers else f"fly higher than {top:.6g} m",
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
