"""Warnings of a plan.  A warning includes a remedy if there is one."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, TypeVar

from aosplan.camera.disparity import baseline_for_disparity_px, disparity_px
from aosplan.geodesy import to_local
from aosplan.messages import Message
from aosplan.solver.solution import BEST
from aosplan.solver.solve import Alternative, other_heading

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.camera.camera import Camera
    from aosplan.models.model import Prediction
    from aosplan.planning.guided_result import GuidedResult
    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.planning.result import Plan
    from aosplan.planning.route import FlightInputs
    from aosplan.planning.solved_plan import SolvedPlan
    from aosplan.solver.problem import Problem

    AnyPlan = TypeVar("AnyPlan", bound=Plan)


OBLIQUE_DENSITY = 0.02
"""Largest increase of the density by slanted rays that does not cause a warning."""

SCENE_NEARBY_M = 50_000.0
"""If a scene is farther from the plan than this, there is a warning, because one of the two
locations may be wrong.
"""

HIGHEST_M = 120.0
"""Largest height above ground that the European open category and many other rules allow."""


def with_warnings(plan: AnyPlan) -> AnyPlan:
    """The plan with all its warnings: the notices that it already has, and the warnings of
    `plan_warnings`.
    """
    return replace(plan, warnings=(*plan.notices, *plan_warnings(plan)))


def plan_warnings(plan: Plan) -> Iterator[Message]:
    """Warnings of a plan, each with its remedy."""
    if plan.coverage is None:
        yield Message(
            "no_occluders",
            "no occluder is above the focal plane, so a single photo shows everything",
        )
    if not plan.solution.met and plan.inputs.objective not in BEST:
        yield _missed(plan)
    if min(plan.common_footprint_m) <= 0.0 and plan.guided is None:
        yield _no_common_ground(plan)
    if plan.coverage is not None and plan.guided is None:
        yield from _pixels(plan)
    yield from _thick_layers(plan)
    yield from _flying(plan)
    yield from _camera_of_another_drone(plan.inputs.flight, plan.camera)
    yield from _unconfirmed(plan.inputs.flight, plan.camera)
    yield from _oblique_rays(plan)
    measured_stand = getattr(plan.scene, "voxel_m", None) is not None
    if measured_stand and plan.model != "measured" and plan.coverage is not None:
        yield Message(
            "independent_occluders",
            f"the {plan.model} model assumes independent occluders, but the occluders of a "
            "real stand are clumped, so the predicted visibility is an upper bound",
        )


def scene_elsewhere(loaded: LoadedScene, origin: tuple[float, float] | None) -> Iterator[Message]:
    """Warn if the scene was measured far from the origin of the plan."""
    place = None if loaded.volume is None else loaded.volume.place
    if place is None or origin is None:
        return
    (east_m,), (north_m,) = to_local(origin, [place[0]], [place[1]])
    apart_m = math.hypot(east_m, north_m)
    if apart_m > SCENE_NEARBY_M:
        yield Message(
            "scene_elsewhere",
            f"the scene was measured {apart_m / 1000.0:.3g} km away, at "
            f"{place[0]:.4f},{place[1]:.4f}; if it should be the forest at the place of the plan, "
            "check --origin or --area",
        )


def _camera_of_another_drone(flight: FlightInputs, camera: Camera) -> Iterator[Message]:
    """Warn if the drone does not carry the camera."""
    from aosplan.camera.presets import CAMERAS

    name, drone = flight.drone_name, flight.drone
    if name is None or drone is None or drone.camera is None or camera.name not in CAMERAS:
        return
    from aosplan.mission.dji_models import DRONES
    from aosplan.planning.aircraft import camera_fits_payload

    known = DRONES.get(name)
    if known is None:
        carried = camera.name.startswith(
            drone.camera.removesuffix("-wide").removesuffix("-thermal")
        )
    else:
        carried = known.payload is None or camera_fits_payload(camera.name, known.payload)
    if not carried:
        yield Message(
            "camera_of_another_drone",
            f"--camera {camera.name} is not the camera of --drone {name}: the plan is for "
            "the given camera, but the drone carries another one",
        )


def _unconfirmed(flight: FlightInputs, camera: Camera) -> Iterator[Message]:
    """Warn if a value of a preset is not confirmed by a second source."""
    drone = flight.drone
    for what, assumed in (
        (f"--drone {flight.drone_name}", drone.assumed if drone else ""),
        (f"--camera {camera.name}", camera.assumed),
    ):
        clauses = [clause for clause in assumed.split("; ") if "unconfirmed" in clause]
        if clauses:
            yield Message(
                "unconfirmed_values",
                f"{what}: {'; '.join(clauses)}; compare these values with the specification "
                "of the manufacturer",
            )


def _missed(plan: Plan) -> Message:
    requirement = plan.requirement
    prediction = plan.solution.prediction
    reached = requirement.value_of(prediction)
    required = plan.solution.samples_required
    remedy = (
        f"at this baseline, {required} photos would reach it"
        if required is not None
        else "at this baseline, no number of photos reaches it"
    )
    return Message(
        "target_missed",
        f"{requirement} is missed: N = {plan.solution.pattern.samples} with b = "
        f"{plan.solution.baseline_m:.4g} m reaches {reached:.4g}; {remedy}",
    )


def _no_common_ground(plan: Plan) -> Message:
    footprint, extent = plan.camera.footprint_m(plan.altitude_m), plan.extent_m
    sides = plan.solution.pattern.extent
    largest = min(size / side for size, side in zip(footprint, sides, strict=True) if side > 0.0)
    higher = plan.altitude_m * max(
        length / size for length, size in zip(extent, footprint, strict=True)
    )
    return Message(
        "no_common_ground",
        f"no ground is in all photos, because the footprint is {footprint[0]:.4g} x "
        f"{footprint[1]:.4g} m and the grid {extent[0]:.4g} x {extent[1]:.4g} m; give a "
        f"baseline below {largest:.4g} m, fly this grid above {higher:.4g} m, or use a wider "
        "camera",
    )


def _pixels(plan: Plan) -> Iterator[Message]:
    coverage = plan.coverage
    assert coverage is not None  # The caller has checked that there are occluders.
    focal = plan.camera.focal_length_px
    height, size = coverage.height_m, coverage.occluder_size_m
    if focal * size < plan.altitude_m - height:
        resolved = focal * size + height
        yield Message(
            "occluder_below_pixel",
            f"an occluder of {size:.3g} m at {height:.3g} m covers "
            f"{focal * size / (plan.altitude_m - height):.2g} pixels, so it is treated as if it "
            f"were one pixel wide; photos resolve it below an altitude of {resolved:.4g} m, or "
            "with a longer lens",
        )
    if plan.solution.pattern.samples == 1:
        return
    disparity = disparity_px(plan.solution.baseline_m, height, plan.altitude_m, focal)
    if disparity < 1.0 - 1e-9:
        smallest = baseline_for_disparity_px(1.0, height, plan.altitude_m, focal)
        yield Message(
            "disparity_below_pixel",
            f"the lowest occluders move by {disparity:.2g} pixels between neighbouring "
            "photos, which is too little; a movement of one pixel needs a baseline of "
            f"{smallest:.4g} m, or a longer lens",
        )


def _oblique_rays(plan: Plan) -> Iterator[Message]:
    """Warn if slanted rays cross much more foliage than the nadir rays of the model."""
    if plan.inputs.rays != "nadir" or plan.coverage is None:
        return
    # For sites that are spread evenly, the mean of sec θ is about 1 + (x² + y²)/(24 h²).
    x, y = plan.extent_m
    longer = 1.0 + (x * x + y * y) / (24.0 * plan.altitude_m**2)
    density = plan.solution.prediction.density
    slanted = 1.0 - plan.solution.prediction.transparency**longer
    if slanted - density > OBLIQUE_DENSITY:
        angle = math.degrees(math.atan2(math.hypot(x, y), 2.0 * plan.altitude_m))
        yield Message(
            "oblique_rays",
            f"the outer photos look {angle:.0f}° off nadir, so their rays cross more foliage: p is "
            f"about {slanted:.3g} on average, not {density:.3g}; --rays oblique includes "
            "this effect",
        )


def _thick_layers(plan: Plan) -> Iterator[Message]:
    if plan.model != "layered":
        return
    thick = [s for s in plan.scene.slices() if s.top_m - s.bottom_m > 2.0 * s.occluder_size_m + 0.5]
    if thick:
        worst = max(thick, key=lambda layer: layer.top_m - layer.bottom_m)
        yield Message(
            "thick_layer",
            f"layers are much thicker than their occluders (number of such layers: {len(thick)}; "
            f"the thickest is {worst.top_m - worst.bottom_m:.3g} m thick, with occluders of "
            f"{worst.occluder_size_m:.3g} m); each "
            "layer is treated as if it were at its middle height, so thinner layers give a "
            "better prediction",
        )


def _flying(plan: Plan) -> Iterator[Message]:
    """Warnings about the flight: photo interval, battery, legal height, and paths to the sites and
    back.
    """
    route, flight = plan.route, plan.inputs.flight
    timing, interval = route.timing, flight.photo_interval_s
    pace = timing.hold_s + timing.leg_s(plan.solution.baseline_m)
    if (
        interval
        and not timing.fly_through
        and pace < interval
        and plan.solution.pattern.samples > 1
    ):
        yield Message(
            "photo_interval",
            f"the time between photos is {pace:.3g} s, but the camera needs "
            f"{interval:g} s: give --hold {timing.hold_s + interval - pace:.3g}",
        )
    photo = plan.waypoints.photo or ()
    if sum(photo) > 1 and not any(one and other for one, other in pairwise(photo)):
        yield Message(
            "photos_alone",
            "no two sites are on one line along the heading, so each photo needs a run-in "
            "and a run-out of its own; give --trigger stop for this grid",
        )
    endurance = flight.drone.endurance_min if flight.drone else None
    longest = max(flight.time_s for flight in route.flights) / 60.0
    if endurance is not None and longest > endurance:
        yield Message(
            "battery",
            f"a flight takes {longest:.3g} min, but a new battery of this drone lasts only "
            f"{endurance:g} min in still air: give --flight-time MIN to split it",
        )
    if route.takeoff_ground_m is not None and flight.takeoff is None:
        yield Message(
            "takeoff_assumed",
            "heights are relative to the take-off point; it is assumed to be below the first "
            f"waypoint, where the ground is {route.takeoff_ground_m:.1f} m above "
            f"{route.datum}; take off there, or give --takeoff LAT,LON",
        )
    highest = plan.altitude_m + plan.inputs.focal_height_m + route.farther_by_m
    if highest > HIGHEST_M:
        yield Message(
            "above_120_m",
            f"the flight reaches {highest:.4g} m above ground; many countries allow at most "
            f"{HIGHEST_M:g} m",
        )
    if route.highest_way_m is not None and max(highest, HIGHEST_M) < route.highest_way_m:
        climb = max(max(flight.climb_m, flight.return_m) for flight in route.flights)
        yield Message(
            "transit_above_120_m",
            f"on the path from the take-off or back, the drone flies {climb:.4g} m above the "
            f"take-off, to clear canopy and terrain, and reaches {route.highest_way_m:.4g} m "
            f"above the ground below; many countries allow at most {HIGHEST_M:g} m; take off "
            "elsewhere, or fly around the high ground",
        )


EDGES_MATTER = 0.02
"""Smallest difference of V or V̂ between the interior of a plot and the whole plot that causes a
warning.
"""

SATURATED = 0.98
"""If the mean share of the ground that a view does not see is above this, the prediction depends on
a few gaps.
"""


def measured_warnings(solved: SolvedPlan, *, compares_headings: bool) -> Iterator[Message]:
    """Yield warnings about the limits of a prediction by the measured model.

    `compares_headings` is true if the best heading was searched for.
    """
    inputs, problem, solution = solved.inputs, solved.problem, solved.solution
    if problem is None:
        return
    if inputs.loaded.volume is None:
        yield Message(
            "correlogram_approximation",
            "the prediction uses the correlogram of the scene, which is an approximation "
            "(the error of V̂ is mostly below 0.02); with a .npz, which contains the voxels, "
            "the prediction is exact",
        )
    yield from _edges_of_plot(solved, problem)
    density = solution.prediction.density
    if density > SATURATED and "saturated" not in {code for code, _ in inputs.loaded.warnings}:
        yield Message(
            "saturated",
            f"on average, a photo does not see {density:.1%} of the ground, so the result "
            "depends on a few gaps; read the cloud with smaller voxels, or plan a smaller "
            "grid (--max-aperture)",
        )
    extent_m = max(solution.pattern.extent) * solution.baseline_m
    if extent_m > problem.model.independent_baseline_m * (1.0 + 1e-9):
        shear_m = 0.5 * extent_m / problem.model.independent_baseline_m
        yield Message(
            "small_plot",
            f"the plot is too small for a grid of {extent_m:.4g} m, so the same trees are counted "
            "twice: from the first photo to the last, the top of the canopy moves by "
            f"{shear_m:.2g} of the width of the plot at an altitude of {inputs.altitude_m:.4g} m, "
            "but it may move by at most one half; give --max-aperture "
            f"{problem.model.independent_baseline_m:.4g}, or measure a larger plot",
        )
    if not compares_headings and (word := other_heading(Alternative(problem, solution))):
        yield Message("heading", word)


def _edges_of_plot(solved: SolvedPlan, problem: Problem) -> Iterator[Message]:
    """Warn if the prediction depends on the repetition of the plot, unless the request asks for
    this repetition.
    """
    from aosplan.models.measured import MeasuredModel

    solution = solved.solution
    model, grid = problem.model, (solution.pattern, solution.baseline_m)
    if solved.inputs.edges == "wrapped" or not isinstance(model, MeasuredModel):
        return
    if model.edges_of(*grid) != "wrapped":
        return
    inside = model.interior_prediction(*grid)
    if inside is None:
        yield Message(
            "edges_wrapped",
            "for every place of the plot, at least one ray to this grid leaves the plot, so "
            "the plot is repeated beyond its edges, where it may have few points; measure a "
            "larger plot, or plan a smaller grid (--max-aperture)",
        )
    elif abs(inside.normalized - solution.prediction.normalized) > EDGES_MATTER or (
        abs(inside.expected - solution.prediction.expected) > EDGES_MATTER
    ):
        yield Message(
            "edges_wrapped",
            "some rays to this grid leave the plot, so the plot is repeated beyond its edges, which "
            "differ from its middle; for all targets, "
            f"V̂ = {solution.prediction.normalized:.3g} and V = {solution.prediction.expected:.3g}; "
            f"for targets whose rays stay on the plot, V̂ = {inside.normalized:.3g} and "
            f"V = {inside.expected:.3g}; --edges interior counts only these targets",
        )


BY_CHANCE = 0.05
"""A warning is given if the values of V from the two halves of the pulses differ by at
least this.
"""


def guided_warnings(guided: GuidedResult, prediction: Prediction) -> Iterator[Message]:
    """Yield warnings for the user of guided positions."""
    if guided.chosen_expected - prediction.expected > BY_CHANCE:
        yield Message(
            "guided_by_chance",
            f"V is {guided.chosen_expected:.3g} with the half of the pulses that was used to choose the "
            f"positions, but {prediction.expected:.3g} with the other half, because the cloud has "
            "few pulses; a denser point cloud gives better positions",
        )
