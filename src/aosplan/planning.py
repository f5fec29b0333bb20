"""The plan: from a request to waypoints, in one pass of frozen values."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.answer import rounded_up
from aosplan.doubts import Doubts, doubts_of
from aosplan.errors import RequestError
from aosplan.geometry import CoverageBaseline, coverage_baseline
from aosplan.mission import Conduct, Mission, Waypoints, local_sites, split
from aosplan.models import Prediction
from aosplan.models.equations import aperture
from aosplan.models.uniform import UniformModel
from aosplan.problem import Bounds, GridKind, Limit, Problem, Requirement, Solution
from aosplan.quantities import exact_share
from aosplan.resolve import Message, altitude_of, camera_of, scene_of
from aosplan.route import Route, lay, timing_of
from aosplan.solve import solve

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from aosplan.camera import Camera
    from aosplan.models import VisibilityModel
    from aosplan.models.measured import Flown
    from aosplan.request import PlanRequest
    from aosplan.resolve import ResolvedScene
    from aosplan.scene import Scene
    from aosplan.sensitivity import Change
    from aosplan.uncertainty import Uncertainty
    from aosplan.voxels import VoxelVolume

MODEL_OF = {"uniform": "uniform", "layered": "layered", "cloud": "measured"}
"""The smallest model that fits a kind of scene."""

SATURATED = 0.98
"""Mean share of the ground that views hide, from which on a prediction hangs on few gaps."""


@dataclass(frozen=True)
class Plan:
    """What to fly, and what it will show.

    Attributes
    ----------
    request
        Everything that decided the plan.
    scene, camera
        What the request's names stand for; heights of the scene above ground.
    altitude_m
        Above the focal plane.
    model
        Name of the visibility model.
    solution
        Pattern, baseline, prediction and what bound them.
    coverage
        The coverage rule's baseline and deciding occluder; None for a scene without occluders.
    route
        Waypoints in flight order, how they are flown, and the flights of each battery.
    notices
        What the reading of the scene, and its model, had to say.
    volume
        The voxels of a scene that is a point cloud, heights above ground.
    approximation
        What stands in for the model's exact prediction (``correlogram``), or None.
    uncertainty
        Standard errors of the prediction; None where nothing is known of them.
    uncertainty_reason
        Why nothing is known of them, or empty.
    flown
        The expectation over position noise of the measured model, or None.
    sensitivity
        What becomes of the plan where the scene is not as it was thought to be, if asked for.
    """

    request: PlanRequest
    scene: Scene
    camera: Camera
    altitude_m: float
    model: str
    solution: Solution
    coverage: CoverageBaseline | None
    route: Route
    notices: tuple[Message, ...]
    volume: VoxelVolume | None = field(default=None, repr=False, compare=False)
    approximation: str | None = None
    uncertainty: Uncertainty | None = None
    uncertainty_reason: str = ""
    flown: Flown | None = None
    sensitivity: tuple[Change, ...] = ()

    @property
    def warnings(self) -> tuple[Message, ...]:
        """What the user should know: notices of the scene, and advice on the plan."""
        from aosplan.advice import advice

        return self.notices + tuple(advice(self))

    @property
    def extent_m(self) -> tuple[float, float]:
        """Size of the grid along and across the heading [m]."""
        x, y = self.solution.pattern.extent
        return x * self.solution.baseline_m, y * self.solution.baseline_m

    @property
    def aperture_m(self) -> float:
        """Eq. 5 with the samples planned [m]."""
        return float(aperture(self.solution.pattern.samples, self.solution.baseline_m))

    @property
    def common_footprint_m(self) -> tuple[float, float]:
        """Ground that all samples see, along and across the heading [m]; negative: none."""
        footprint = self.camera.footprint_m(self.altitude_m)
        return footprint[0] - self.extent_m[0], footprint[1] - self.extent_m[1]

    @property
    def waypoints(self) -> Waypoints:
        """All waypoints, in flight order."""
        return self.route.waypoints

    @property
    def limits(self) -> tuple[Limit, ...]:
        """What bound the result: the solution, and the speed of the flight."""
        return self.solution.limits + self.route.limits

    @property
    def conduct(self) -> Conduct:
        """How the waypoints are flown."""
        request, timing = self.request, self.route.timing
        latitude, longitude = request.takeoff or (None, None)
        return Conduct(
            trigger=request.trigger,
            speed_mps=timing.speed_mps,
            hold_s=timing.hold_s,
            spacing_m=self.solution.baseline_m if timing.fly_through else 0.0,
            yaw_deg=request.heading % 360.0,
            autopilot=request.autopilot,
            drone=request.drone,
            payload=request.payload,
            takeoff_latitude=latitude,
            takeoff_longitude=longitude,
            takeoff_ground_m=self.route.takeoff_ground_m,
        )

    def document(self) -> dict[str, Any]:
        """The plan as plain values: what ``plan --json`` prints."""
        from aosplan.summary import plan_document

        return plan_document(self)

    def mission(self) -> Mission:
        """The plan as formats take it."""
        document = self.document()
        del document["waypoints"]
        return Mission(self.waypoints, document, self.conduct)

    def missions(self) -> tuple[Mission, ...]:
        """A mission for each flight, in order; their waypoints together are the plan's."""
        return split(self.mission(), [flight[:2] for flight in self.route.flights])

    def write(
        self,
        path: str,
        *,
        format: str | None = None,  # noqa: A002 (the option's name)
        force: bool = False,
    ) -> list[str]:
        """Write the waypoints, whole or not at all.

        Parameters
        ----------
        path
            The ending decides the format, or a name before a colon: ``csv:grid.txt``.
        format
            Name of the format, whatever the ending.
        force
            Whether an existing file is overwritten.

        Returns
        -------
        paths
            What was written: `path`, or numbered files where one does not hold all.

        Raises
        ------
        RequestError
            Where the format is unknown or needs a place, the file exists, or the mission is
            beyond the limits of the format's target.
        SurroundingsError
            Where the file cannot be written.
        """
        from aosplan.export import choose, files
        from aosplan.files import write_all

        chosen, path = choose(str(path), format)
        contents = files(self.missions(), chosen, path)
        write_all(contents, force=force)
        return list(contents)


def plan(
    request: PlanRequest, *, folder: str = "", progress: Callable[[int, int], None] | None = None
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
    camera = camera_of(request, folder=folder)
    altitude = altitude_of(request, camera)
    gsd = camera.gsd_m(altitude)
    found = scene_of(request, folder=folder, progress=progress)
    scene, kind, notices = found.scene, found.kind, found.warnings
    model_name = request.model or MODEL_OF[kind]
    _check_model(model_name, kind, request)
    if scene.integrated_density > 0.0:
        _check_altitude(scene, altitude, request)
    task = Task(request, model_name, camera, altitude, gsd)
    posed = task.problem_of(found)
    coverage, doubts = None, Doubts(uncertainty_reason="nothing is hidden")
    if posed is None:
        solution = _clear_view(request)
    else:
        problem, coverage = posed
        solution = solve(problem)
        doubts = doubts_of(task, found, problem, solution)
        if model_name == "measured":
            notices += tuple(_doubts(found, problem, solution, altitude))
    route = lay(
        request,
        *local_sites(solution.pattern, solution.baseline_m, request.heading),
        altitude_m=altitude + request.focal_height,
        gsd_m=gsd,
        baseline_m=solution.baseline_m,
        canopy_top_m=scene.canopy_top_m,
        folder=folder,
    )
    return Plan(
        request=_completed(request, model_name, found),
        scene=scene,
        camera=camera,
        altitude_m=altitude,
        model=model_name,
        solution=solution,
        coverage=coverage,
        route=route,
        notices=notices,
        volume=found.volume,
        approximation="correlogram" if model_name == "measured" and found.volume is None else None,
        **doubts._asdict(),
    )


class Task(NamedTuple):
    """What of a plan stays as it is whatever the scene: the request, and what it stands for."""

    request: PlanRequest
    model: str
    camera: Camera
    altitude_m: float
    gsd_m: float

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


def _check_density(above: Scene, density: float, request: PlanRequest) -> None:
    if above.transparency == 0.0 or density >= 1.0:
        shown = above.name if request.scene is None else request.scene
        raise RequestError(
            f"scene '{shown}' has integrated density 1: no ray reaches the ground, and no "
            "number of photos shows what lies there",
            "a density below 1 is needed; for a point cloud, a smaller --voxel or a larger "
            "--min-height",
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


def _measured_problem(
    request: PlanRequest, found: ResolvedScene, altitude_m: float, gsd_m: float
) -> Problem:
    from aosplan.models.correlogram import CorrelogramModel, correlogram
    from aosplan.models.measured import MeasuredModel

    table, focal_height = found.correlogram, request.focal_height
    conduct: dict[str, Any] = {
        "heading_deg": request.heading,
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
    if model.view == "perspective" or None not in (request.baseline, request.samples):
        return problem  # the correlogram is telecentric; and with both fixed nothing is searched
    if table is None or focal_height > 0.0:
        table = correlogram(found.volume, focal_height_m=focal_height)
    return problem._replace(sketch=CorrelogramModel(table, altitude_m, **conduct))


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


def _problem(request: PlanRequest, model: VisibilityModel, gsd_m: float) -> Problem:
    return Problem(
        model=model,
        requirement=requirement_of(request),
        grid=_grid_of(request),
        bounds=Bounds(
            max_aperture_m=request.max_aperture,
            max_samples=request.max_samples,
            baseline_m=request.baseline,
            samples=request.samples,
        ),
        objective=request.optimize,
        timing=timing_of(request, gsd_m)[0],
    )


def _grid_of(request: PlanRequest) -> GridKind:
    return GridKind(request.grid, request.lanes or 3, request.lane_pitch or 4.0)


def _clear_view(request: PlanRequest) -> Solution:
    """One sample, or as many as were asked for, over a scene in which nothing is hidden."""
    pattern = _grid_of(request).pattern(request.samples or 1)
    return Solution(
        pattern=pattern,
        baseline_m=request.baseline or 0.0,
        prediction=Prediction(0.0, 1.0, 1.0 / pattern.samples),
        samples_required=1,
        limits=(),
        met=True,
    )


def _completed(request: PlanRequest, model: str, found: ResolvedScene) -> PlanRequest:
    """The request with the defaults that depend on its scene."""
    filled: dict[str, Any] = {"model": model, **found.reading}
    if model == "measured":
        filled["view"] = request.view or "telecentric"
    else:
        filled["rays"] = request.rays or "nadir"
    return replace(request, **filled)
