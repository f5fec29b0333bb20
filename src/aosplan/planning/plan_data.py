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
    """The values of a plan: what is flown and what it is predicted to show.

    Attributes
    ----------
    inputs
        The resolved request, at the heading that is flown.
    solution
        Pattern, baseline and prediction, with the limits that determined them.
    grid
        Kind of the grid: the requested one, or the best.
    problem
        The problem that was solved; None for a scene without occluders.
    coverage
        The coverage rule's baseline and deciding occluder; None for a scene without occluders.
    route
        Waypoints in flight order, how they are flown, and the flights of each battery.
    layout
        The sites, and what they show of an area or along a line.
    confidence
        Standard errors and sensitivity of the prediction.
    detection
        Probability of detection of the target to find, or None.
    within
        Result of a search within a time, or None.
    notices
        Warnings of the stages of the plan: the readers of its files, its model and its area.
    warnings
        All warnings: the notices, and those about the finished plan.
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
    ground: GroundVisibility | None = None
    notices: tuple[Message, ...] = ()
    warnings: tuple[Message, ...] = ()

    @property
    def request(self) -> PlanRequest:
        """The request with all values that decided the plan."""
        return self.inputs.request

    @property
    def scene(self) -> Scene:
        """The scene; heights above ground."""
        return self.inputs.loaded.scene

    @property
    def volume(self) -> VoxelVolume | None:
        """The voxels of a scene that is a point cloud, heights above ground."""
        return self.inputs.loaded.volume

    @property
    def camera(self) -> Camera:
        """The camera."""
        return self.inputs.camera

    @property
    def altitude_m(self) -> float:
        """Above the focal plane."""
        return self.inputs.altitude_m

    @property
    def model(self) -> str:
        """Name of the visibility model."""
        return self.inputs.model

    @property
    def one_photo(self) -> float:
        """Visibility in a single photo from above the middle of the grid."""
        return 1.0 if self.problem is None else self.problem.model.transparency

    @property
    def reading(self) -> str | None:
        """How the uniform model computes the volume, or None for other models.

        ``rule``: with d̂ at the height that decides the coverage rule, for baselines of at least that
        rule.  ``slices``: as slices that are one occluder thick, for smaller baselines.
        """
        if self.model != "uniform" or self.problem is None:
            return None
        model = self.problem.model
        assert isinstance(model, UniformModel)
        grid = self.solution.pattern, self.solution.baseline_m
        return "slices" if model.counts_slices(*grid) else "rule"

    @property
    def edges(self) -> str | None:
        """Targets that count: ``interior`` (those whose rays stay on the plot) or ``wrapped`` (all)."""
        if self.model != "measured":
            return None
        model = self.problem and self.problem.model
        of_grid = getattr(model, "edges_of", None)
        if of_grid is None:  # nothing is hidden, or a correlogram
            return str(getattr(model, "edges", "wrapped"))
        edges: str = of_grid(self.solution.pattern, self.solution.baseline_m)
        return edges

    @property
    def requirement(self) -> Requirement:
        """The target."""
        return self.inputs.requirement

    @property
    def heading_deg(self) -> float:
        """Direction of the flight lines, clockwise from true north: the requested one, or the best."""
        return self.inputs.heading_deg

    @property
    def approximation(self) -> str | None:
        """The approximation that is used instead of the exact model (``correlogram``), or None."""
        return "correlogram" if self.model == "measured" and self.volume is None else None

    @property
    def uncertainty(self) -> Uncertainty | None:
        """Standard errors of the prediction; None if nothing is known of them."""
        return self.confidence.uncertainty

    @property
    def uncertainty_reason(self) -> str:
        """Why nothing is known of the standard errors, or empty."""
        return self.confidence.uncertainty_reason

    @property
    def flown(self) -> NoiseExpectation | None:
        """The expectation over position noise of the measured model, or None."""
        return self.confidence.flown

    @property
    def sensitivity(self) -> tuple[Change, ...]:
        """How the plan changes if the scene differs from what was assumed; empty unless requested."""
        return self.confidence.sensitivity

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
        """Aperture [m] by Eq. 5 for the planned number of samples."""
        return float(aperture(self.solution.pattern.samples, self.solution.baseline_m))

    @property
    def common_footprint_m(self) -> tuple[float, float]:
        """Size of the ground that all samples see, along and across the heading [m].

        It is negative if there is no such ground.
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
        """How the waypoints are flown."""
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
