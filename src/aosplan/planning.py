"""The plan: from a request to waypoints, in one pass of frozen values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError
from aosplan.flight import Timing
from aosplan.geometry import CoverageBaseline, coverage_baseline
from aosplan.mission import Conduct, Mission, Waypoints, waypoints_of
from aosplan.models import Prediction
from aosplan.models.equations import aperture
from aosplan.models.uniform import UniformModel
from aosplan.problem import Bounds, GridKind, Problem, Requirement, Solution
from aosplan.quantities import exact_share
from aosplan.resolve import VOXEL_SUFFIX, Message, altitude_of, camera_of, scene_of
from aosplan.solve import solve

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.camera import Camera
    from aosplan.models import VisibilityModel
    from aosplan.request import PlanRequest
    from aosplan.scene import Scene
    from aosplan.voxels import VoxelVolume

MODEL_OF = {"uniform": "uniform", "layered": "layered", "cloud": "measured"}
"""The smallest model that fits a kind of scene."""


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
    waypoints
        In flight order.
    notices
        What the reading of the scene had to say.
    """

    request: PlanRequest
    scene: Scene
    camera: Camera
    altitude_m: float
    model: str
    solution: Solution
    coverage: CoverageBaseline | None
    waypoints: Waypoints
    notices: tuple[Message, ...]

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
    def timing(self) -> Timing:
        """How the drone flies between sites."""
        return Timing(self.request.speed, self.request.acceleration, self.request.hold)

    @property
    def conduct(self) -> Conduct:
        """How the waypoints are flown."""
        request = self.request
        return Conduct(
            speed_mps=request.speed,
            hold_s=request.hold,
            yaw_deg=request.heading % 360.0,
            autopilot=request.autopilot,
            payload=request.payload,
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
        """The flights as formats take them, each from and back to the take-off."""
        return (self.mission(),)

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
    scene, kind, notices, volume = scene_of(request, folder=folder, progress=progress)
    above = scene.above(request.focal_height)
    density = above.integrated_density if above is not None else 0.0
    model_name = request.model or MODEL_OF[kind]
    _check_model(model_name, kind, request)
    if above is None or density == 0.0:
        coverage, solution = None, _clear_view(request)
    else:
        _check_density(above, density, request)
        _check_altitude(above, altitude, request)
        coverage = coverage_baseline(
            above.slabs(), altitude, camera.focal_length_px, request.coverage
        )
        if model_name == "measured":
            assert volume is not None  # the model was checked against the kind of scene
            solution = solve(_measured_problem(request, volume, altitude))
        else:
            model = _model(model_name, above, altitude, camera, coverage)
            solution = solve(_problem(request, model))
    return Plan(
        request=_completed(request, model_name, kind),
        scene=scene,
        camera=camera,
        altitude_m=altitude,
        model=model_name,
        solution=solution,
        coverage=coverage,
        waypoints=waypoints_of(
            solution.pattern,
            solution.baseline_m,
            heading_deg=request.heading,
            altitude_m=altitude + request.focal_height,
            origin=request.origin,
        ),
        notices=notices,
    )


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


def _check_altitude(above: Scene, altitude_m: float, request: PlanRequest) -> None:
    top = above.canopy_top_m
    if altitude_m <= top:
        origin = "" if request.altitude is not None else ", solved from the resolution,"
        raise RequestError(
            f"altitude {altitude_m:.6g} m{origin} is not above the canopy, whose top is {top:.6g} m "
            "above the focal plane",
            f"fly higher than {top:.6g} m",
        )


def _model(
    name: str, above: Scene, altitude_m: float, camera: Camera, coverage: CoverageBaseline
) -> VisibilityModel:
    if name == "uniform":
        return UniformModel(above.integrated_density, above.transparency, coverage.baseline_m)
    from aosplan.models.layered import LayeredModel

    return LayeredModel(above.slices(), altitude_m, camera.focal_length_px)


def _check_model(name: str, kind: str, request: PlanRequest) -> None:
    if name == "measured" and kind != "cloud":
        raise RequestError(
            "--model measured needs the voxels of a point cloud",
            "give --scene FILE.laz or FILE.npz, or another --model",
        )
    if request.view is not None and name != "measured":
        raise RequestError(f"--view {request.view} with --model {name}", "it goes with measured")


def _measured_problem(request: PlanRequest, volume: VoxelVolume, altitude_m: float) -> Problem:
    from aosplan.models.correlogram import CorrelogramModel, correlogram
    from aosplan.models.measured import MeasuredModel

    model = MeasuredModel(
        volume,
        altitude_m,
        heading_deg=request.heading,
        view="perspective" if request.view == "perspective" else "telecentric",
        focal_height_m=request.focal_height,
    )
    problem = _problem(request, model)
    if model.view == "perspective" or None not in (request.baseline, request.samples):
        return problem  # the correlogram is telecentric; and with both fixed nothing is searched
    table = correlogram(volume, focal_height_m=request.focal_height)
    return problem._replace(sketch=CorrelogramModel(table, altitude_m, heading_deg=request.heading))


def _problem(request: PlanRequest, model: VisibilityModel) -> Problem:
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
        timing=Timing(request.speed, request.acceleration, request.hold),
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


def _completed(request: PlanRequest, model: str, kind: str) -> PlanRequest:
    """The request with the defaults that depend on its scene."""
    filled: dict[str, Any] = {"model": model}
    if model == "measured":
        filled["view"] = request.view or "telecentric"
    if kind == "cloud" and not (request.scene or "").lower().endswith(VOXEL_SUFFIX):
        filled["voxel"] = request.voxel or 0.25
        filled["ground"] = request.ground or "auto"
        filled["min_height"] = 2.0 if request.min_height is None else request.min_height
    return replace(request, **filled)
