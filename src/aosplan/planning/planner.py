"""The plan: from a request to waypoints, in one pass of frozen values."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from aosplan.doubts import Doubts, doubts_of
from aosplan.draft import draft_of, route_of
from aosplan.errors import RequestError
from aosplan.mission.mission import (
    Conduct,
    Mission,
    Waypoints,
    split,
)
from aosplan.models.equations import aperture
from aosplan.planning.inputs import (
    Message,
    scene_of,
)
from aosplan.planning.request import find_drone
from aosplan.planning.setup import kinds_of
from aosplan.planning.sites import (
    Layout,
    layout_of,
    ways_in_zones,
)
from aosplan.solver.alternatives import (
    Choice,
    other_heading,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from aosplan.camera.camera import Camera
    from aosplan.camera.disparity import CoverageBaseline
    from aosplan.models.measured import Flown
    from aosplan.models.uncertainty import Uncertainty
    from aosplan.planning.inputs import ResolvedScene
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.route import Route
    from aosplan.planning.sensitivity import Change
    from aosplan.scenes.scene import Scene
    from aosplan.scenes.voxels import VoxelVolume
    from aosplan.solver.problem import (
        GridKind,
        Limit,
        Problem,
        Solution,
        Trying,
    )
    from aosplan.solver.tradeoff import Row

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
    grid, heading_deg
        Kind of the grid, and direction of its flight lines clockwise from true north: those that
        were asked for, or the best.
    problem
        What was solved; None for a scene without occluders.
    coverage
        The coverage rule's baseline and deciding occluder; None for a scene without occluders.
    route
        Waypoints in flight order, how they are flown, and the flights of each battery.
    layout
        The sites, and what they show of an area, or along a line.
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
    grid: GridKind
    heading_deg: float
    problem: Problem | None
    coverage: CoverageBaseline | None
    route: Route
    layout: Layout
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
        from aosplan.planning.plan_warnings import advice

        return self.notices + tuple(advice(self))

    @property
    def origin(self) -> tuple[float, float] | None:
        """Latitude and longitude from which east and north count, or None without a place."""
        return self.layout.origin

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
        latitude, longitude = self.route.takeoff or (None, None)
        return Conduct(
            trigger=request.trigger,
            speed_mps=timing.speed_mps,
            hold_s=timing.hold_s,
            spacing_m=self.solution.baseline_m if timing.fly_through else 0.0,
            yaw_deg=self.heading_deg % 360.0,
            altitude_frame=request.altitude_frame,
            autopilot=request.autopilot,
            drone=request.drone,
            payload=request.payload,
            takeoff_latitude=latitude,
            takeoff_longitude=longitude,
            takeoff_ground_m=self.route.takeoff_ground_m,
            most_waypoints=find_drone(request.drone).most_waypoints if request.drone else None,
        )

    def document(self) -> dict[str, Any]:
        """The plan as plain values: what ``plan --json`` prints."""
        from aosplan.planning.document import plan_document

        return plan_document(self)

    def tradeoff(self) -> list[Row]:
        """What each number of samples takes and gives, for every kind of grid asked for.

        Raises
        ------
        RequestError
            Where nothing stands above the focal plane: there is nothing to trade.
        """
        from aosplan.solver.tradeoff import tradeoff

        if self.problem is None:
            raise RequestError("nothing stands above the focal plane: one photo shows everything")
        problems = [self.problem._replace(grid=kind) for kind in kinds_of(self.request)]
        return tradeoff(problems, self.problem, self.solution)

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
        from aosplan.files import write_all
        from aosplan.mission.export import (
            choose,
            files,
        )

        chosen, path = choose(str(path), format)
        contents = files(self.missions(), chosen, path)
        write_all(contents, force=force)
        return list(contents)


def plan(
    request: PlanRequest,
    *,
    folder: str = "",
    progress: Callable[[int, int], None] | None = None,
    trying: Trying | None = None,
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
    trying
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

    draft = draft_of(request, scene=scene, folder=folder, trying=trying)
    task, solution, problem = draft.task, draft.solution, draft.problem
    headed, altitude, found = task.request, task.altitude_m, draft.found
    notices = found.warnings
    doubts = Doubts(uncertainty_reason="nothing is hidden")
    if problem is not None:
        doubts = doubts_of(task, found, problem, solution)
        if task.model == "measured":
            notices += tuple(_doubts(found, problem, solution, altitude))
            if request.heading != "best" and (word := other_heading(Choice(problem, solution))):
                notices += (Message("heading", word),)
    layout = layout_of(headed, draft.area, solution, problem, task.camera, altitude)
    route = route_of(draft, layout, folder)
    notices += layout.notices + tuple(ways_in_zones(headed, draft.area, route))
    return Plan(
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
        notices=notices,
        volume=found.volume,
        approximation="correlogram" if task.model == "measured" and found.volume is None else None,
        **doubts._asdict(),
    )


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
