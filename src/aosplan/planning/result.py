"""`Plan`: the values of a plan, its JSON document (schema 1), and its files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aosplan import __version__
from aosplan.camera.disparity import disparity_px, occluder_px
from aosplan.errors import RequestError
from aosplan.messages import SCHEMA
from aosplan.mission.mission import FlightShare, Mission, split
from aosplan.models.model import prediction_document
from aosplan.planning.plan_data import PlanData

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.mission.mission import Waypoints
    from aosplan.models.measured import NoiseExpectation
    from aosplan.scenes.scene import Scene
    from aosplan.solver.tradeoff import TradeoffRow


class Plan(PlanData):
    """A plan: the flight and the prediction.

    Attributes are those of `aosplan.planning.plan_data.PlanData`.
    """

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
                "a trade-off needs a target and the objective samples, aperture or time, not "
                "--optimize detection",
                "plan --within MIN shows the plans for half the time and twice the time; "
                "tradeoff --find person shows the probability of detection of every row",
            )
        if self.guided is not None:
            raise RequestError(
                "--grid guided has no trade-off: its positions are chosen for one place",
                "plan shows the plain grids of the same time",
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


def plan_document(plan: PlanData) -> dict[str, Any]:
    """All values of a plan as dictionaries, lists, text and finite numbers."""
    solution, camera, altitude = plan.solution, plan.camera, plan.altitude_m
    pattern, baseline = solution.pattern, solution.baseline_m
    requirement, inputs = plan.requirement, plan.inputs
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
        "disparity": disparity_document(plan),
        "camera": {
            "name": camera.name,
            "gsd_m": camera.gsd_m(altitude),
            "footprint_m": list(camera.footprint_m(altitude)),
            "common_footprint_m": list(plan.common_footprint_m),
        },
        "flight": flight_document(plan),
        "height": height_document(plan),
        **({} if plan.layout.survey is None else {"area": plan.layout.survey.document()}),
        **(
            {}
            if plan.layout.continuous is None
            else {"continuous": plan.layout.continuous.document()}
        ),
        **({} if plan.detection is None else {"detection": plan.detection.document()}),
        **({} if plan.within is None else {"within": plan.within.document()}),
        **({} if plan.guided is None else {"guided": plan.guided.document()}),
        "limits": [limit._asdict() for limit in plan.limits],
        "sensitivity": [change._asdict() for change in plan.sensitivity] or None,
        "warnings": [warning._asdict() for warning in plan.warnings],
        "waypoints": waypoints_document(plan.waypoints),
    }


def flight_document(plan: PlanData) -> dict[str, Any]:
    """The path from the first photo to the last, the settings of the flight, and each flight.

    Length and time of a flight, and the total time, are from take-off to landing.
    """
    route = plan.route
    return {
        "length_m": route.length_m,
        "time_s": route.time_s,
        **_given(plan.settings._asdict()),
        "acceleration_mps2": route.timing.acceleration_mps2,
        "climb_mps": route.timing.climb_mps,
        "run_in_m": route.timing.run_in_m,
        "total_time_s": route.total_time_s,
        "flights": [flight._asdict() for flight in route.flights],
    }


def height_document(plan: PlanData) -> dict[str, Any]:
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


def waypoints_document(waypoints: Waypoints) -> list[dict[str, Any]]:
    """One row for each waypoint, in flight order."""
    names, columns = zip(*waypoints.columns().items(), strict=True)
    return [
        {"index": index} | dict(zip(names, row, strict=True))
        for index, row in enumerate(zip(*columns, strict=True))
    ]


def _noise_document(noise: NoiseExpectation) -> dict[str, float]:
    """Expectation over position noise: the number of simulated flights, and the standard errors."""
    values = noise._asdict()
    del values["prediction"]
    return values


def scene_document(scene: Scene) -> dict[str, Any]:
    """Name, kind, source and main numbers of a scene."""
    return {
        "name": scene.name,
        "kind": scene.kind,
        "title": scene.title,
        "source": scene.source,
        "assumed": scene.assumed,
        "integrated_density": scene.integrated_density,
        "canopy_top_m": scene.canopy_top_m,
    }


def disparity_document(plan: PlanData) -> dict[str, float | None]:
    """Disparity and size of the occluder that determines the coverage rule.  The size is at least
    one pixel.
    """
    coverage = plan.coverage
    if coverage is None:
        return {"normalized": None, "pixels": None, "occluder_pixels": None}
    focal, altitude = plan.camera.focal_length_px, plan.altitude_m
    return {
        "normalized": plan.solution.baseline_m / coverage.baseline_m,
        "pixels": disparity_px(plan.solution.baseline_m, coverage.height_m, altitude, focal),
        "occluder_pixels": occluder_px(
            coverage.occluder_size_m, coverage.height_m, altitude, focal
        ),
    }


def _given(values: dict[str, Any]) -> dict[str, Any]:
    return {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in values.items()
        if value is not None
    }
