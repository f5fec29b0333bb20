"""`Plan`: the values of a plan, its JSON document (schema 1), and its files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from aosplan import __version__
from aosplan.camera.disparity import disparity_document
from aosplan.errors import RequestError
from aosplan.messages import SCHEMA
from aosplan.mission.mission import FlightSettings, FlightShare, Mission, Waypoints, split
from aosplan.models.equations import aperture
from aosplan.models.model import prediction_document
from aosplan.models.uniform import UniformModel
from aosplan.scenes.scene import scene_document

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.camera.camera import Camera
    from aosplan.camera.disparity import CoverageBaseline
    from aosplan.messages import Limit, Message
    from aosplan.mission.mission import Waypoints
    from aosplan.models.detection import Detection
    from aosplan.models.ground_visibility import GroundVisibility
    from aosplan.models.measured import NoiseExpectation
    from aosplan.models.uncertainty import Uncertainty
    from aosplan.planning.confidence import Confidence
    from aosplan.planning.gain_result import GainResult
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
    from aosplan.solver.tradeoff import TradeoffRow


@dataclass(frozen=True)
class Plan:
    """A plan: the flight and the prediction.

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
        Result of a search within a given time, or None.
    guided
        How guided positions were chosen, or None.
    gain
        Result of an order by gain, or None.
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
    gain: GainResult | None = None
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
    def disparity(self) -> dict[str, float | None]:
        """Disparity and size of the occluder that determines the coverage rule, as plain values."""
        focal_length_px = self.camera.focal_length_px
        return disparity_document(
            self.coverage, self.solution.baseline_m, self.altitude_m, focal_length_px
        )

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

    def document(self) -> dict[str, Any]:
        """The plan as plain values: the output of ``plan --json``."""
        return plan_document(self)

    def tradeoff(self) -> list[TradeoffRow]:
        """Cost and benefit of each number of samples, for every kind of grid of the request.

        Raises
        ------
        RequestError
            If no occluder is above the focal plane. There is no trade-off in this case.
        """
        from aosplan.solver.tradeoff import tradeoff

        if self.inputs.objective == "detection":
            raise RequestError(
                "a trade-off is not possible with --optimize detection, because it needs a target and "
                "one of the objectives samples, aperture and time",
                "aosplan plan --within MIN shows plans for several flight times; aosplan tradeoff "
                "--find person shows the probability of detection of every row",
            )
        if self.guided is not None:
            raise RequestError(
                "a trade-off is not possible with --grid guided, because its positions are chosen for "
                "one place",
                "aosplan plan shows the plain grids that take the same time",
            )
        if self.problem is None:
            raise RequestError(
                "no occluder is above the focal plane, so one photo shows everything"
            )
        problems = [self.problem._replace(grid=kind) for kind in self.inputs.grids]
        return tradeoff(problems, self.problem, self.solution)

    def tradeoff_document(self, rows: Sequence[TradeoffRow]) -> dict[str, Any]:
        """Rows of `tradeoff` as plain values: the output of ``tradeoff --json``.

        If the plan has a target to find, each row has the probability of its detection, or None if
        detection was not counted for the row.
        """
        documents = [row.document() for row in rows]
        if self.inputs.find is not None:
            from aosplan.planning.plan_detection import detections_of_rows

            asked = [(row.pattern, row.baseline_m, row.front or row.chosen) for row in rows]
            found = detections_of_rows(self.inputs, asked)
            for document, detection in zip(documents, found, strict=True):
                document["detection"] = None if detection is None else detection.probability
        return {
            "schema": SCHEMA,
            "version": __version__,
            "request": self.request.document(),
            "rows": documents,
        }

    def mission(self) -> Mission:
        """The mission, from which files are written."""
        document = self.document()
        del document["waypoints"]
        return Mission(self.waypoints, document, self.settings)

    def missions(self) -> tuple[Mission, ...]:
        """One mission for each flight, in order.  Together, they have all waypoints of the plan."""
        return split(
            self.mission(),
            [
                FlightShare(flight.first, flight.last, flight.climb_m, flight.return_m)
                for flight in self.route.flights
            ],
        )

    def write(
        self,
        path: str,
        *,
        format: str | None = None,  # noqa: A002 (the option's name)
        force: bool = False,
    ) -> list[str]:
        """Write the waypoints to a file, completely or not at all.

        Parameters
        ----------
        path
            Path of the output.  The extension selects the format.  A format name before a colon
            overrides the extension: ``csv:grid.txt``.
        format
            Name of the format; it overrides the extension.
        force
            Whether an existing file is overwritten.

        Returns
        -------
        paths
            The files that were written: `path`, or several numbered files if one file cannot
            contain all waypoints.

        Raises
        ------
        RequestError
            If the format is unknown, if the format needs a location that the plan does not have, if
            the file exists and `force` is false, or if the mission exceeds the limits of the
            program that reads the format.
        SurroundingsError
            If the file cannot be written.
        """
        from aosplan.files import write_all
        from aosplan.mission.export import choose_format, mission_files

        chosen, path = choose_format(str(path), format)
        contents = mission_files(self.missions(), chosen, path)
        write_all(contents, force=force)
        return list(contents)


def plan_document(plan: Plan) -> dict[str, Any]:
    """All values of a plan as dictionaries, lists, text and finite numbers."""
    solution, camera, altitude = plan.solution, plan.camera, plan.altitude_m
    pattern, baseline = solution.pattern, solution.baseline_m
    requirement, inputs = plan.requirement, plan.inputs
    parts = (
        ("area", plan.layout.survey), ("continuous", plan.layout.continuous), ("gain", plan.gain),
        ("detection", plan.detection), ("within", plan.within), ("guided", plan.guided),
    )  # fmt: skip
    return {
        "schema": SCHEMA,
        "version": __version__,
        "request": (plan.request if plan.within is None else plan.within.asked).document(),
        "scene": scene_document(plan.scene),
        "altitude_m": altitude,
        "baseline_m": baseline,
        "samples": pattern.samples,
        "samples_required": solution.samples_required,
        "aperture_m": plan.aperture_m,
        "grid": {
            "kind": plan.grid.name,
            "rows": pattern.rows,
            "columns": pattern.columns,
            "extent_m": list(plan.extent_m),
            "heading_deg": plan.heading_deg,
            "pitch_m": [baseline * pitch for pitch in pattern.pitch],
        },
        "visibility": prediction_document(solution.prediction)
        | {
            "target": float(requirement.target),
            "target_quantity": requirement.quantity,
            "model": plan.model,
            "view": inputs.view,
            "approximation": plan.approximation,
            "rays": inputs.rays,
            "one_photo": plan.one_photo,
            "reading": plan.reading,
            "ground": None if plan.ground is None else plan.ground.document(),
            "edges": plan.edges,
            "uncertainty": None if plan.uncertainty is None else plan.uncertainty.document(),
            "uncertainty_reason": plan.uncertainty_reason or None,
            "noise": None if plan.noise is None else _noise_document(plan.noise),
        },
        "disparity": plan.disparity,
        "camera": {
            "name": camera.name,
            "gsd_m": camera.gsd_m(altitude),
            "footprint_m": list(camera.footprint_m(altitude)),
            "common_footprint_m": list(plan.common_footprint_m),
        },
        "flight": flight_document(plan),
        "height": height_document(plan),
        **{name: part.document() for name, part in parts if part is not None},
        "limits": [limit._asdict() for limit in plan.limits],
        "sensitivity": [change._asdict() for change in plan.sensitivity] or None,
        "warnings": [warning._asdict() for warning in plan.warnings],
        "waypoints": plan.waypoints.document(),
    }


def flight_document(plan: Plan) -> dict[str, Any]:
    """The path from the first photo to the last, the settings of the flight, and each flight.

    Length and time of a flight, and the total time, are from take-off to landing.
    """
    route = plan.route
    return {
        "length_m": route.length_m,
        "time_s": route.time_s,
        **{
            name: list(value) if isinstance(value, tuple) else value
            for name, value in plan.settings._asdict().items()
            if value is not None
        },
        "acceleration_mps2": route.timing.acceleration_mps2,
        "climb_mps": route.timing.climb_mps,
        "run_in_m": route.timing.run_in_m,
        "total_time_s": route.total_time_s,
        "flights": [flight._asdict() for flight in route.flights],
    }


def height_document(plan: Plan) -> dict[str, Any]:
    """The reference of each height in the document."""
    route = plan.route
    document: dict[str, Any] = {
        "altitude_m": f"above the focal plane, {plan.inputs.focal_height_m:g} m above ground",
        "waypoints.altitude_m": "above the ground below the waypoint",
        "canopy_top_m": "above ground",
        "clearance_m": plan.altitude_m + plan.inputs.focal_height_m - plan.scene.canopy_top_m,
    }
    if route.datum is None:
        return document | {"ground": "assumed to be level, at the height of the take-off"}
    return document | {
        "ground": "from the terrain file",
        "waypoints.ground_m": f"above {route.datum}",
        "flight.takeoff_ground_m": f"above {route.datum}",
        "nearest_m": plan.altitude_m + plan.inputs.focal_height_m - route.closer_by_m,
        "farthest_m": plan.altitude_m + plan.inputs.focal_height_m + route.farther_by_m,
    }


def _noise_document(noise: NoiseExpectation) -> dict[str, float]:
    """Expectation over position noise: the number of simulated flights, and the standard errors."""
    values = noise._asdict()
    del values["prediction"]
    return values
