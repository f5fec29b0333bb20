"""The task: from a request and a scene to the problem that they pose the solver."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.choose import Choice, kinds, solve_best, solve_best_heading
from aosplan.errors import RequestError
from aosplan.geometry import CoverageBaseline, coverage_baseline
from aosplan.models.uniform import UniformModel
from aosplan.problem import Bounds, GridKind, Problem, Requirement
from aosplan.quantities import exact_share
from aosplan.route import timing_of

if TYPE_CHECKING:
    from aosplan.camera import Camera
    from aosplan.models import VisibilityModel
    from aosplan.request import PlanRequest
    from aosplan.resolve import ResolvedScene
    from aosplan.scene import Scene


class Task(NamedTuple):
    """What of a plan stays as it is whatever the scene: the request, and what it stands for."""

    request: PlanRequest
    model: str
    camera: Camera
    altitude_m: float
    gsd_m: float
    footprint_m: tuple[float, float]

    def choice(self, problem: Problem) -> Choice:
        """The best of the grids and headings that the request leaves open."""
        problems = [problem._replace(grid=kind) for kind in kinds_of(self.request)]
        best = solve_best_heading if self.request.heading == "best" else solve_best
        over_area = self.request.area is not None
        return best(problems, footprint_m=self.footprint_m, over_area=over_area)

    def problem_of(self, found: ResolvedScene) -> tuple[Problem, CoverageBaseline] | None:
        """The problem that a scene poses, and its coverage rule; None where nothing is hidden."""
        request, altitude = self.request, self.altitude_m
        above = found.scene.above(request.focal_height)
        density = above.integrated_density if above is not None else 0.0
        if above is None or density == 0.0:
            return None
        _check_density(above, density, request)
        coverage = coverage_baseline(
            above.slabs(), altitude, self.camera.focal_length_px, request.coverage
        )
        if self.model == "measured":
            return _measured_problem(request, found, altitude, self.gsd_m), coverage
        model = _model(self.model, above, altitude, self.camera, coverage, request)
        return _problem(request, model, self.gsd_m), coverage


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


def _model(
    name: str,
    above: Scene,
    altitude_m: float,
    camera: Camera,
    coverage: CoverageBaseline,
    request: PlanRequest,
) -> VisibilityModel:
    conduct: dict[str, Any] = {"hold_error_m": request.hold_error, "rays": request.rays or "nadir"}
    if name == "uniform":
        return UniformModel(
            above.integrated_density,
            above.transparency,
            coverage.baseline_m,
            altitude_m=altitude_m,
            **conduct,
        )
    from aosplan.models.layered import LayeredModel

    return LayeredModel(above.slices(), altitude_m, camera.focal_length_px, **conduct)


def _measured_problem(
    request: PlanRequest, found: ResolvedScene, altitude_m: float, gsd_m: float
) -> Problem:
    from aosplan.models.correlogram import CorrelogramModel, correlogram
    from aosplan.models.measured import MeasuredModel

    table, focal_height = found.correlogram, request.focal_height
    conduct: dict[str, Any] = {
        "heading_deg": request.heading_deg,
        "hold_error_m": request.hold_error,
    }
    if found.volume is None:
        assert table is not None  # the model was checked against the kind of scene
        if focal_height > 0.0 or request.view == "perspective":
            raise RequestError(
                f"scene '{request.scene}' holds a correlogram, which knows neither a raised focal "
                "plane nor the view perspective",
                "save the scene as .npz, with its voxels, or use --model layered",
            )
        return _problem(request, CorrelogramModel(table, altitude_m, **conduct), gsd_m)
    model = MeasuredModel(
        found.volume,
        altitude_m,
        view="perspective" if request.view == "perspective" else "telecentric",
        focal_height_m=focal_height,
        **conduct,
    )
    problem = _problem(request, model, gsd_m)
    if None not in (request.baseline, request.samples) and request.heading != "best":
        return problem  # nothing is searched
    if model.view == "perspective":  # the correlogram is telecentric; fewer targets do instead
        sparse = MeasuredModel(
            found.volume,
            altitude_m,
            view=model.view,
            targets_per_voxel=1,
            focal_height_m=focal_height,
            **conduct,
        )
        return problem._replace(sketch=sparse)
    if table is None or focal_height > 0.0:
        table = correlogram(found.volume, focal_height_m=focal_height)
    return problem._replace(sketch=CorrelogramModel(table, altitude_m, **conduct))


def _problem(request: PlanRequest, model: VisibilityModel, gsd_m: float) -> Problem:
    return Problem(
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
        timing=timing_of(request, gsd_m)[0],
    )
