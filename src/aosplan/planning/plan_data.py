"""The values of a plan."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from aosplan.flight.drones import find_drone
from aosplan.mission.mission import FlightSettings, Waypoints
from aosplan.models.equations import aperture

if TYPE_CHECKING:
    from aosplan.camera.camera import Camera
    from aosplan.camera.disparity import CoverageBaseline
    from aosplan.messages import Limit, Message
    from aosplan.models.detection import Detection
    from aosplan.models.measured import Flown
    from aosplan.models.uncertainty import Uncertainty
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.route import Route
    from aosplan.planning.sensitivity import Change
    from aosplan.planning.sites import Layout
    from aosplan.scenes.scene import Scene
    from aosplan.scenes.voxels import VoxelVolume
    from aosplan.solver.problem import GridKind, Problem
    from aosplan.solver.solution import Solution


@dataclass(frozen=True)
class PlanData:
    """What to fly, and what it will show: the values, without what can be made of them.

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
    detection
        How likely what is looked for is found, or None.
    notices
        Messages of the readers of the scene, and of its model.
    warnings
        All that the user should know: the notices, and what will not work as wished.
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
    volume: VoxelVolume | None = field(default=None, repr=False, compare=False)
    approximation: str | None = None
    uncertainty: Uncertainty | None = None
    uncertainty_reason: str = ""
    flown: Flown | None = None
    sensitivity: tuple[Change, ...] = ()
    detection: Detection | None = None
    notices: tuple[Message, ...] = ()
    warnings: tuple[Message, ...] = ()

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
    def settings(self) -> FlightSettings:
        """How the waypoints are flown."""
        request, timing = self.request, self.route.timing
        drone = None if request.drone is None else find_drone(request.drone)
        latitude, longitude = self.route.takeoff or (None, None)
        return FlightSettings(
            trigger=request.trigger,
            speed_mps=timing.speed_mps,
            hold_s=timing.hold_s,
            spacing_m=self.solution.baseline_m if timing.fly_through else 0.0,
            yaw_deg=self.heading_deg % 360.0,
            altitude_frame=request.altitude_frame,
            autopilot=request.autopilot or (drone.autopilot if drone else None),
            camera_control=request.camera_control,
            drone=request.drone,
            payload=request.payload,
            takeoff_latitude=latitude,
            takeoff_longitude=longitude,
            takeoff_ground_m=self.route.takeoff_ground_m,
            takeoff_ellipsoid_m=(
                self.route.takeoff_ground_m if self.route.datum == "ellipsoid" else None
            ),
            most_waypoints=drone.most_waypoints if drone else None,
        )
