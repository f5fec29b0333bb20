"""Solution of uniform scenarios with array operations on whole columns.

A block of scenarios needs only a few array operations.  Every quantity is an array over only the
axes on which it depends.  The steps and their order are those of `aosplan.planning.planner`: checks
(`aosplan.sweeps.block`), inputs (`aosplan.sweeps.vectorized.inputs`), samples and baselines
(`aosplan.sweeps.vectorized.samples`), flights (`aosplan.sweeps.vectorized.flights`).
`aosplan.sweeps.solve_rows` solves the scenarios that this module cannot solve.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.camera.disparity import (
    covered_height_m,
    disparity_px,
    no_coverage_text,
    unit_baseline_m,
)
from aosplan.grid.patterns import MOST_SITES
from aosplan.models.equations import sampled_side
from aosplan.models.model import Prediction, contrast_squared
from aosplan.solver import refusals
from aosplan.sweeps.block import DEFERRED, INFEASIBLE, INVALID, OK, RowStatuses
from aosplan.sweeps.solve_rows import NOT_OF_CLEAR_VIEWS, RESULTS
from aosplan.sweeps.vectorized.flights import flights, smallest_grids
from aosplan.sweeps.vectorized.inputs import (
    GRIDS,
    aircraft_columns,
    altitude_columns,
    column,
    scene_columns,
    solvable_as_columns,
    target_columns,
)
from aosplan.sweeps.vectorized.samples import RequirementColumns, SolvedSamples, solve_samples

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from aosplan.sweeps.block import Block
    from aosplan.sweeps.vectorized.flights import GridColumns
    from aosplan.sweeps.vectorized.inputs import CameraColumns, SceneColumns

    Columns = Mapping[str, NDArray[Any]]


class SolvedColumns(NamedTuple):
    """Results of a block by name, and the status of each scenario.

    The results broadcast to the shape of the block.  They are not valid for scenarios that were
    refused or deferred.
    """

    columns: dict[str, NDArray[Any]]
    statuses: RowStatuses

    @property
    def holds(self) -> NDArray[np.bool_]:
        """Mask of the scenarios whose results are valid."""
        return np.asarray(self.statuses.status == OK)

    @property
    def left(self) -> NDArray[np.bool_]:
        """Mask of the scenarios that have to be solved individually."""
        return np.asarray(self.statuses.status == DEFERRED)


class _Rule(NamedTuple):
    """Result of the coverage rule: the height of the occluder that determines the baseline, and the
    baseline.
    """

    height_m: Any
    unit_m: Any


def solve_columns(
    block: Block, folder: str = "", results: Sequence[str] = RESULTS
) -> SolvedColumns | None:
    """Solve the scenarios of a block with array operations; None if its options do not allow this.

    Parameters
    ----------
    block
        The scenarios.
    folder
        Folder in which files of the scenarios are looked for first.
    results
        Results to compute.  Quantities that no result needs are skipped.
    """
    mask = solvable_as_columns(block)
    if mask is None:
        return None
    given, statuses = block.columns, RowStatuses(block.shape)
    with np.errstate(all="ignore"):
        aircraft, scene = aircraft_columns(given, folder), scene_columns(given, folder)
        camera = aircraft.camera
        statuses.defer(~(mask & aircraft.known & scene.known))
        altitude = altitude_columns(given, camera)
        focal = camera.focal_length_px
        if "samples" in given and "max_samples" in given:
            statuses.refuse(
                INVALID,
                given["samples"] > given["max_samples"],
                refusals.samples_beyond_bound,
                given["samples"],
                given["max_samples"],
            )
        _refuse_altitudes(given, scene, altitude, statuses)
        rule = _rule(given, scene, altitude, focal)
        _refuse_scenes(given, scene, rule, statuses)
        sound = ~scene.clear & np.isfinite(rule.unit_m) & (rule.unit_m > 0.0)
        statuses.defer(~sound & ~scene.clear)
        sound = np.True_ if sound.all() else sound
        grid = column(given, "grid")
        grid = np.where(np.isin(grid.astype(str), GRIDS), grid, "trimmed").astype(object)
        target = target_columns(given, scene)
        found = solve_samples(
            RequirementColumns(
                sound,
                grid,
                target,
                scene.density,
                scene.transparency,
                rule.unit_m,
                given.get("baseline"),
                given.get("samples"),
                given.get("max_aperture"),
                given.get("max_samples"),
                _ground(given, camera, altitude),
            ),
            statuses,
        )
        found = found._replace(samples=_of_plans(found.samples, statuses))
        cleared = bool(np.any(scene.clear))
        if cleared:
            statuses.defer(scene.clear & (given.get("samples", 1) > MOST_SITES))
            found = _with_clear_views(given, scene.clear, found)
        grids = smallest_grids(np.minimum(found.samples, MOST_SITES), grid)
        columns = _results(grids, found, rule, scene, camera, altitude)
        if not {"flight_length_m", "flight_time_s"}.isdisjoint(results):
            length, time = flights(grids, found.baseline_m, aircraft)
            columns |= {"flight_length_m": length, "flight_time_s": time}
        if cleared:
            for name in NOT_OF_CLEAR_VIEWS:
                columns[name] = np.where(scene.clear, np.nan, columns[name])
    return SolvedColumns(columns, statuses)


def _ground(given: Columns, camera: CameraColumns, altitude: Any) -> tuple[Any, Any]:
    """Largest extents of a grid along x and y for which one pixel of common ground remains."""
    lifted = given.get("allow_no_common_ground", np.array(False))
    pixel = camera.gsd_m(altitude)
    x, y = (side - np.minimum(pixel, 0.5 * side) for side in camera.footprint_m(altitude))
    free = lifted.astype(bool)
    return np.where(free, np.inf, x), np.where(free, np.inf, y)


def _refuse_altitudes(
    given: Columns, scene: SceneColumns, altitude: Any, statuses: RowStatuses
) -> None:
    """Refuse altitudes that are within the canopy, or whose distance to the canopy is less than the
    clearance.
    """
    clearance = column(given, "clearance")
    top = scene.canopy_top_m - column(given, "focal_height")
    dense, is_given = ~scene.empty, "altitude" in given
    statuses.refuse(
        INVALID,
        dense & ~(altitude > top),
        partial(refusals.within_canopy, given=is_given),
        altitude,
        top,
    )
    statuses.refuse(
        INVALID,
        dense & ~(altitude >= top + clearance),
        partial(refusals.below_clearance, given=is_given),
        altitude,
        top,
        clearance,
    )


def _rule(given: Columns, scene: SceneColumns, altitude: Any, focal: Any) -> _Rule:
    """The smallest baseline at which the required share of the occluders has d̂ >= 1."""
    coverage = column(given, "coverage")
    height = covered_height_m(scene.bottom_m, scene.top_m, coverage)
    return _Rule(height, unit_baseline_m(scene.occluder_size_m, height, altitude, focal, np))


def _refuse_scenes(given: Columns, scene: SceneColumns, rule: _Rule, statuses: RowStatuses) -> None:
    """Refuse scenes that transmit nothing, and scenes with occluders on the focal plane."""
    statuses.refuse(
        INVALID,
        ~scene.clear & ((scene.transparency == 0.0) | (scene.density >= 1.0)),
        refusals.opaque_scene,
        scene.name,
    )
    statuses.refuse(
        INFEASIBLE,
        ~scene.clear & (rule.height_m <= 0.0),
        no_coverage_text,
        column(given, "coverage"),
    )


def _of_plans(samples: Any, statuses: RowStatuses) -> Any:
    """Numbers of samples.  For refused scenarios they may be very large and are replaced by 1."""
    if not statuses.texts:
        return samples
    sound = statuses.status == OK
    shape = (1,) * (sound.ndim - np.ndim(samples)) + np.shape(samples)
    shared = tuple(axis for axis, size in enumerate(shape) if size == 1)
    return np.where(sound.any(axis=shared, keepdims=True), samples, 1)


def _with_clear_views(given: Columns, clear: Any, found: SolvedSamples) -> SolvedSamples:
    """Results in which scenarios without hidden ground have one sample, or the requested number of
    samples.
    """
    wanted = given.get("samples", np.int64(1))
    samples = np.where(clear, wanted, found.samples)
    return SolvedSamples(
        samples,
        np.where(clear, given.get("baseline", np.float64(0.0)), found.baseline_m),
        np.where(clear, np.nan, found.shortfall),
        np.where(clear, 1, found.required),
    )


def _results(
    grids: GridColumns,
    found: SolvedSamples,
    rule: _Rule,
    scene: SceneColumns,
    camera: CameraColumns,
    altitude: Any,
) -> dict[str, Any]:
    p: Any = np.where(scene.clear, 0.0, scene.density)
    t: Any = np.where(scene.clear, 1.0, scene.transparency)
    baseline, samples = found.baseline_m, grids.samples
    predicted = Prediction(p, t, found.shortfall)
    focal, height = camera.focal_length_px, rule.height_m
    contrast = np.sqrt(contrast_squared(p, t, found.shortfall))
    footprint_x, footprint_y = camera.footprint_m(altitude)
    return {
        "altitude_m": altitude,
        "baseline_m": baseline,
        "samples": samples,
        "samples_required": found.required,
        "aperture_m": sampled_side(samples, np) * baseline,
        "grid_rows": grids.rows,
        "grid_columns": grids.columns,
        "grid_extent_x_m": grids.x * baseline,
        "grid_extent_y_m": grids.y * baseline,
        "visibility_density": p,
        "visibility_minimum": predicted.minimum,
        "visibility_maximum": predicted.maximum,
        "visibility_expected": np.where(scene.clear, 1.0, predicted.expected),
        "visibility_normalized": predicted.normalized,
        "visibility_shortfall": found.shortfall,
        "visibility_effective_samples": 1.0 / found.shortfall,
        "visibility_contrast": np.where(np.isfinite(contrast), contrast, np.nan),
        "disparity_normalized": baseline / rule.unit_m,
        "disparity_pixels": disparity_px(baseline, height, altitude, focal),
        "camera_gsd_m": camera.gsd_m(altitude),
        "camera_footprint_x_m": footprint_x,
        "camera_footprint_y_m": footprint_y,
    }
