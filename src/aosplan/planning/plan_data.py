"""`PlanData`: the values of a plan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from aosplan.mission.mission import FlightSettings, Waypoints
from aosplan.models.equations import aperture
from aosplan.models.uniform import UniformModel

if TYPE_CHECKING:
    from aosplan.camera.camera import Camera
    from aosplan.camera.disparity import CoverageBaseline
    from aosplan.messages import Limit, Message
    from aosplan.models.detection import Detection
    from aosplan.models.ground_visibility import GroundVisibility
    from aosplan.models.measured import NoiseExpectation
    from aosplan.models.uncertainty import Uncertainty
    from aosplan.planning.confidence import Confidence
    from aosplan.planning.guided_result import GuidedResult
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.resolve import PlanInputs
    from aosplan.planning.route import Route
    from aosplan.planning.sensitivity import Change
    from aosplan.planning.sites import Layout
    from aosplan.planning.within_result import WithinResult
    from aosplan.scenes.scene import Scene
    from aosplan.scenes.voxels import VoxelVolume
    from aosplan.solver.problem import GridKind, Problem, Requirement
    from aosplan.solver.solution import Solution


@dataclass(frozen=True)
class PlanData:
    """The values of a plan: the flight and the prediction.

    Attributes
    ----------
    inputs
        The resolved request, with the heading of the plan.
    solution
        Pattern, baseline and prediction, and the limits that determined them.
    grid
        Kind of grid: the requested kind, or the best one.
    problem
        The problem that was solved; None for a scene without occluders.
    coverage
        The baseline of the coverage rule, and the occluder that determines it; None for a scene
        without occluders.
    route
        Waypoints in flight order, settings of the flight, and the flights of each battery.
    layout
        The sites, and their coverage of an area or integrals along a line.
    confidence
        Standard errors and sensitivity of the prediction.
    detection
        Probability of detection of the target; None without a target to find.
    within
        Result of a search within a time, or None.
    guided
        How guided positions were chosen, or None.
    notices
        Warnings of single stages of the planning, such as the readers of files, the model and the
        area.
    warnings
        All warnings: the notices, and warnings about the finished plan.
    """

    inputs: PlanInputs
    solution: Solution
    grid: GridKind
    problem: Problem | None
    coverage: CoverageBaseline | None
    route: Route
    layout: Layout
    confidence: Confidence
    detection: Detection | None = None
    within: WithinResult | None = None
    guided: GuidedResult | None = None
    ground: GroundVisibility | None = None
    notices: tuple[Message, ...] = ()
    warnings: tuple[Message, ...] = ()

    @property
    def request(self) -> PlanRequest:
        """The request, with all values that determined the plan."""
        return self.inputs.request

    @property
    def scene(self) -> Scene:
        """The scene, with heights above ground."""
        return self.inputs.loaded.scene

    @property
    def volume(self) -> VoxelVolume | None:
        """The voxels of a scene from a point cloud, with heights above ground."""
        return self.inputs.loaded.volume

    @property
    def camera(self) -> Camera:
        """The camera."""
        return self.inputs.camera

    @property
    def altitude_m(self) -> float:
        """Altitude above the focal plane."""
        return self.inputs.altitude_m

    @property
    def model(self) -> str:
        """Name of the visibility model."""
        return self.inputs.model

    @property
    def one_photo(self) -> float:
        """Visibility in a single photo from above the middle of the grid or of the target area."""
        if self.guided is not None:
            return self.guided.one_photo
        return 1.0 if self.problem is None else self.problem.model.transparency

    @property
    def reading(self) -> str | None:
        """How the uniform model treats the volume; None for other models.

        ``rule``: with a single d̂, at the height that determines the coverage rule. This is used
        for baselines of at least the baseline of the rule. ``slices``: as slices that are one
        occluder thick. This is used for smaller baselines.
        """
        if self.model != "uniform" or self.problem is None:
            return None
        model = self.problem.model
        assert isinstance(model, UniformModel)
        grid = self.solution.pattern, self.solution.baseline_m
        return "slices" if model.counts_slices(*grid) else "rule"

    @property
    def edges(self) -> str | None:
        """Targets that are counted: ``interior`` (targets whose rays stay on the plot) or
        ``wrapped`` (all targets).
        """
        if self.model != "measured":
            return None
        model = self.problem and self.problem.model
        of_grid = getattr(model, "edges_of", None)
        if of_grid is None:  # Nothing is hidden, or the model is a correlogram.
            return str(getattr(model, "edges", "wrapped"))
        edges: str = of_grid(self.solution.pattern, self.solution.baseline_m)
        return edges

    @property
    def requirement(self) -> Requirement:
        """The target visibility."""
        return self.inputs.requirement

    @property
    def heading_deg(self) -> float:
        """Direction of the flight lines, clockwise from true north: the requested direction, or the
        best one.
        """
        return self.inputs.heading_deg

    @property
    def approximation(self) -> str | None:
        """The approximation that is used instead of the exact model (``correlogram``), or None."""
        return "correlogram" if self.model == "measured" and self.volume is None else None

    @property
    def uncertainty(self) -> Uncertainty | None:
        """Standard errors of the prediction; None if they are not known."""
        return self.confidence.uncertainty

    @property
    def uncertainty_reason(self) -> str:
        """Reason why the standard errors are not known; empty if they are known."""
        return self.confidence.uncertainty_reason

    @property
    def noise(self) -> NoiseExpectation | None:
        """The expectation of the measured model over position noise, or None."""
        return self.confidence.noise

    @property
    def sensitivity(self) -> tuple[Change, ...]:
        """Effect on the plan if the scene differs from the assumed scene; empty unless
        requested.
        """
        return self.confidence.sensitivity

    @property
    def origin(self) -> tuple[float, float] | None:
        """Latitude and longitude of the origin of east and north; None if the plan has no
        location.
        """
        return self.layout.origin

    @property
    def extent_m(self) -> tuple[float, float]:
        """Size of the grid along and across the heading [m]."""
        x, y = self.solution.pattern.extent
        return x * self.solution.baseline_m, y * self.solution.baseline_m

    @property
    def aperture_m(self) -> float:
        """Aperture [m] by Eq. 5 for the planned number of samples; for guided positions, the longer
        side of the rectangle around them.
        """
        if self.guided is not None:
            return max(self.extent_m)
        return float(aperture(self.solution.pattern.samples, self.solution.baseline_m))

    @property
    def common_footprint_m(self) -> tuple[float, float]:
        """Size of the ground that all samples see, along and across the heading [m].

        It is negative if the samples do not have any ground in common.
        """
        footprint = self.camera.footprint_m(self.altitude_m)
        return footprint[0] - self.extent_m[0], footprint[1] - self.extent_m[1]

    @property
    def waypoints(self) -> Waypoints:
        """All waypoints, in flight order."""
        return self.route.waypoints

    @property
    def limits(self) -> tuple[Limit, ...]:
        """The limits that determined the solution and the speed of the flight."""
        return self.solution.limits + self.route.limits

    @property
    def settings(self) -> FlightSettings:
        """Settings of the flight through the waypoints."""
        flight, timing = self.inputs.flight, self.route.timing
        drone = flight.drone
        latitude, longitude = self.route.takeoff or (None, None)
        return FlightSettings(
            trigger=flight.trigger,
            speed_mps=timing.speed_mps,
            transit_mps=timing.transit.speed_mps,
            hold_s=timing.hold_s,
            spacing_m=self.solution.baseline_m if timing.fly_through else 0.0,
            yaw_deg=self.heading_deg % 360.0,
            altitude_frame=flight.altitude_frame,
            autopilot=flight.autopilot or (drone.autopilot if drone else None),
            camera_control=flight.camera_control,
            drone=flight.drone_name,
            payload=flight.payload,
            takeoff_latitude=latitude,
            takeoff_longitude=longitude,
            takeoff_ground_m=self.route.takeoff_ground_m,
            height_datum=self.route.datum,
            most_waypoints=drone.most_waypoints if drone else None,
            file_waypoints=flight.file_waypoints,
            mission_formats=drone.mission_formats if drone else None,
        )
