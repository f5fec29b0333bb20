"""Solution of scenarios one by one, if the vectorized solver cannot solve them.

Scenarios with the same scene and altitude are solved one after the other, even if they are not
neighbours.  They share the results of models: views of voxels, correlograms, and predictions.  For
each scenario, only the grid and the length and time of the flight are computed.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.camera.disparity import disparity_px
from aosplan.errors import InfeasibleError, RequestError
from aosplan.flight.kinematics import path_of
from aosplan.models.equations import aperture
from aosplan.planning.aircraft import with_drone_file
from aosplan.planning.loaded_scene import LoadedScene, load_scene
from aosplan.planning.options import OPTIONS
from aosplan.planning.request import PlanRequest
from aosplan.planning.resolve import resolve_inputs
from aosplan.planning.route import timing_at_baseline
from aosplan.planning.sites import layout_of, route_of, ways_in_zones
from aosplan.planning.solved_plan import Memo, solve_inputs

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from aosplan.flight.kinematics import Path
    from aosplan.grid.patterns import AnyPattern
    from aosplan.planning.resolve import PlanInputs
    from aosplan.planning.solved_plan import SolvedPlan
    from aosplan.sweeps.block import Block

WHOLE = ("samples", "samples_required", "grid_rows", "grid_columns")
"""Results that are whole numbers."""

NOT_OF_CLEAR_VIEWS = (
    "visibility_normalized",
    "visibility_shortfall",
    "visibility_effective_samples",
    "visibility_contrast",
    "disparity_normalized",
    "disparity_pixels",
)
"""Results that are not defined for a scene without occluders."""

RESULTS = (
    "altitude_m",
    "baseline_m",
    "samples",
    "samples_required",
    "aperture_m",
    "grid_rows",
    "grid_columns",
    "grid_extent_x_m",
    "grid_extent_y_m",
    "visibility_density",
    "visibility_minimum",
    "visibility_maximum",
    "visibility_expected",
    *NOT_OF_CLEAR_VIEWS,
    "camera_gsd_m",
    "camera_footprint_x_m",
    "camera_footprint_y_m",
    "flight_length_m",
    "flight_time_s",
)
"""Names of the results.  Each is a number of a plan's JSON document."""

DETECTION = ("detection_probability", "detection_unseen")
"""Names of the additional results of scenarios with a target to find."""

SCENE = (*(option.name for option in OPTIONS if option.panel == "Scene"), "model")
"""Options that determine how a scene is read."""

GEOMETRY = (
    *(option.name for option in OPTIONS if option.panel in ("Altitude", "Scene", "Camera")),
    *("model", "view", "rays", "hold_error", "drone"),
)
"""Options that determine the model.  Scenarios with equal values of these options are solved
together.
"""

MOST_SCENES = 16
"""Largest number of scenes that are stored.  It is small, because voxels may need much memory."""

_scenes: dict[tuple[Any, ...], LoadedScene] = {}


class Outcome(NamedTuple):
    """Status and reason of a scenario, and its results by name."""

    status: str
    reason: str = ""
    results: Mapping[str, float] = {}


def solve_rows(
    block: Block, rows: NDArray[np.intp], folder: str, results: Sequence[str] = RESULTS
) -> list[Outcome]:
    """Solve some scenarios of a block.  The outcomes are in the order of the scenarios.

    Parameters
    ----------
    block, rows
        The block, and indices of the scenarios in it.
    folder
        Folder in which files are looked for first.
    results
        Results to compute.
    """
    values = [block.request_values(row) for row in rows.tolist()]
    alike: dict[tuple[Any, ...], list[int]] = {}
    for place, each in enumerate(values):
        alike.setdefault(tuple(each.get(name) for name in GEOMETRY), []).append(place)
    outcomes: dict[int, Outcome] = {}
    for places in alike.values():
        # Each group of scenarios has a new memo, because stored views need much memory.
        memo = Memo()
        for place in places:
            outcomes[place] = solve_row(values[place], folder, results, memo)
    return [outcomes[place] for place in range(len(values))]


def solve_row(
    values: Mapping[str, Any],
    folder: str,
    results: Sequence[str] = RESULTS,
    memo: Memo | None = None,
) -> Outcome:
    """Solve one scenario.  If the scenario has no solution, the outcome has the reason, and no
    error is raised.
    """
    try:
        request = PlanRequest(**with_drone_file(values, folder))
        if request.searches:
            return Outcome("invalid", "a sweep does not search for the fastest flight over an area")
        inputs = resolve_inputs(request, folder=folder, load=partial(scene_for, folder=folder))
        solved = solve_inputs(
            inputs,
            memo=memo,
            count_required="samples_required" in results,
            seek_remedy=False,  # The result does not have a column for hints.
        )
        found = _results(solved, *_flight(solved))
        if inputs.find is not None and not set(DETECTION).isdisjoint(results):
            found |= _detection(solved)
        return Outcome("ok", "", found)
    except InfeasibleError as error:
        return Outcome("infeasible", error.message)
    except RequestError as error:
        return Outcome("invalid", error.message)


def scene_for(request: PlanRequest, folder: str) -> LoadedScene:
    """The scene of a request.  It is read once for all rows with the same scene."""
    key = (folder, *(getattr(request, name) for name in SCENE))
    found = _scenes.get(key)
    if found is None:  # Another thread may have read the same scene in the meantime.
        if len(_scenes) >= MOST_SCENES:
            _scenes.clear()
        found = load_scene(request, folder=folder)
        if (
            found.volume is not None
            and found.correlogram is None
            and request.model in (None, "measured")
        ):
            from aosplan.scenes.correlogram import correlogram

            found = replace(found, correlogram=correlogram(found.volume))
        _scenes[key] = found
    return found


def forget_scenes() -> None:
    """Clear the stored scenes."""
    _scenes.clear()


def _results(solved: SolvedPlan, length_m: float, time_s: float) -> dict[str, float]:
    """The numbers of a solved plan, with the names in `RESULTS`.  A number that does not exist is
    nan.
    """
    inputs, solution, rule = solved.inputs, solved.solution, solved.coverage
    pattern, baseline, shown = solution.pattern, solution.baseline_m, solution.prediction
    camera, altitude = inputs.camera, inputs.altitude_m
    footprint, required = inputs.footprint_m, solution.samples_required
    clear = shown.density == 0.0
    pixels = (
        math.nan
        if rule is None
        else disparity_px(baseline, rule.height_m, altitude, camera.focal_length_px)
    )
    return {
        "altitude_m": altitude,
        "baseline_m": baseline,
        "samples": pattern.samples,
        "samples_required": math.nan if required is None else required,
        "aperture_m": float(aperture(pattern.samples, baseline)),
        "grid_rows": _number(pattern.rows),
        "grid_columns": _number(pattern.columns),
        "grid_extent_x_m": pattern.extent[0] * baseline,
        "grid_extent_y_m": pattern.extent[1] * baseline,
        "visibility_density": shown.density,
        "visibility_minimum": shown.minimum,
        "visibility_maximum": shown.maximum,
        "visibility_expected": shown.expected,
        "visibility_normalized": math.nan if clear else shown.normalized,
        "visibility_shortfall": math.nan if clear else shown.shortfall,
        "visibility_effective_samples": math.nan if clear else _finite(shown.effective_samples),
        "visibility_contrast": math.nan if clear else _finite(shown.contrast),
        "disparity_normalized": math.nan if rule is None else baseline / rule.baseline_m,
        "disparity_pixels": pixels,
        "camera_gsd_m": camera.gsd_m(altitude),
        "camera_footprint_x_m": footprint[0],
        "camera_footprint_y_m": footprint[1],
        "flight_length_m": length_m,
        "flight_time_s": time_s,
    }


def _detection(solved: SolvedPlan) -> dict[str, float]:
    from aosplan.planning.plan_detection import detection_of

    inputs, solution = solved.inputs, solved.solution
    found = detection_of(inputs, solution.pattern, solution.baseline_m)
    return dict(zip(DETECTION, (found.probability, found.unseen), strict=True))


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _finite(value: float) -> float:
    return value if math.isfinite(value) else math.nan


def _flight(solved: SolvedPlan) -> tuple[float, float]:
    """Length [m] and time [s] of a flight from the first photo to the last."""
    inputs, baseline = solved.inputs, solved.solution.baseline_m
    if _is_plain(inputs):
        path = _path(solved.solution.pattern)
        timing, _ = timing_at_baseline(inputs.flight, inputs.heading_deg, baseline)
        return path.length_m(baseline), path.time_s(baseline, timing)
    route = route_of(inputs, layout_of(solved), baseline)
    list(ways_in_zones(inputs, route))  # This raises an error if a line passes through a zone.
    return route.length_m, route.time_s


def _is_plain(inputs: PlanInputs) -> bool:
    """Whether a flight consists only of the pattern, with a stop at every site."""
    flight = inputs.flight
    extras = (
        inputs.area,
        inputs.line_length_m,
        flight.wind,
        flight.terrain,
        flight.takeoff,
        flight.flight_time_min,
        flight.resume_at,
    )
    return flight.trigger == "stop" and all(extra is None for extra in extras)


@lru_cache(maxsize=4096)
def _path(pattern: AnyPattern) -> Path:
    """The legs of a pattern that is flown with a stop at every site, without wind."""
    return path_of(pattern)
