"""What becomes of a plan where the scene is not as it was thought to be.

Density, occluder size and heights are each taken 20 % less and 20 % more, one at a time.  Of each
such scene there are two answers: what the planned grid shows of it, and what would be planned.

What a change means follows from how the scene is described:

- *a uniform volume*: D, o, or its base and thickness; what follows from them by Eq. 1 follows (where
  p is given, it stays, but for a change of density, which is one of D).
- *layers*: D_j, o_j, or the heights of all slices; p as measured changes with the D_j as the p of
  independent slices does.
- *voxels*: for density, a fifth of the occupied voxels of every slice is taken away, or as many are
  added beside occupied ones of the same slice, by a seeded draw.  Size is that of all clumps and
  gaps, as if the plot were stretched, and heights are those of all voxels above the focal plane:
  since only camera offset x height / (altitude x size) counts, either is a change of altitude.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import InfeasibleError, RequestError
from aosplan.models.model import Prediction
from aosplan.planning.solved_plan import Memo, best_alternative, problem_of
from aosplan.scenes.density import slice_density
from aosplan.scenes.scene import LayeredScene, UniformScene

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.models.measured import Flown, MeasuredModel
    from aosplan.models.uncertainty import Uncertainty
    from aosplan.planning.resolve import PlanInputs
    from aosplan.planning.solved_plan import SolvedPlan
    from aosplan.scenes.scene import Scene
    from aosplan.scenes.voxels import VoxelVolume
    from aosplan.solver.problem import Problem
    from aosplan.solver.solution import Solution

FACTORS = (0.8, 1.2)
QUANTITIES = ("density", "occluder_size", "height")

SEED = 1
"""Seed of the voxels that are taken away or added."""


class Change(NamedTuple):
    """One change of a scene, and what it does to a plan.

    `visibility` and `normalized` are those of the planned grid, `samples` and `baseline_m` what
    would be planned; None where there is no such number, and then the `reason`.
    """

    quantity: str
    factor: float
    visibility: float | None
    normalized: float | None
    samples: int | None
    baseline_m: float | None
    reason: str | None


def changes_of(solved: SolvedPlan) -> Iterator[Change]:
    """All changes of a scene, and what each does to a solution."""
    inputs, solution = solved.inputs, solved.solution
    for quantity in QUANTITIES:
        for factor in FACTORS:
            try:
                posed = _posed(inputs, quantity, factor)
            except RequestError as error:
                yield Change(quantity, factor, None, None, None, None, error.message)
                continue
            if posed is None:
                reason = "nothing is hidden"
                yield Change(quantity, factor, 1.0, None, 1, 0.0, reason)
                continue
            shown = posed.model.predict(solution.pattern, solution.baseline_m)
            try:
                answer = best_alternative(inputs, posed).solution
            except InfeasibleError as error:
                yield Change(
                    quantity, factor, shown.expected, shown.normalized, None, None, error.message
                )
                continue
            yield Change(
                quantity,
                factor,
                shown.expected,
                shown.normalized,
                answer.pattern.samples,
                answer.baseline_m,
                None,
            )


def _posed(inputs: PlanInputs, quantity: str, factor: float) -> Problem | None:
    """The problem that a changed scene poses, or None where nothing is left to hide anything.

    Raises
    ------
    RequestError
        Where there is no such scene.
    """
    higher = factor if quantity == "height" else 1.0
    loaded = inputs.loaded
    above = loaded.scene.canopy_top_m - inputs.focal_height_m
    if above * higher >= inputs.altitude_m:
        raise RequestError(f"the canopy would reach {above * higher:.4g} m, up to the cameras")
    if inputs.model == "measured":
        if quantity == "density":
            if loaded.volume is None:
                raise RequestError("a correlogram has no voxels to take away or to add")
            loaded = replace(loaded, volume=thinned(loaded.volume, factor), correlogram=None)
        else:
            scale = factor if quantity == "occluder_size" else 1.0 / factor
            inputs = inputs._replace(altitude_m=inputs.altitude_m * scale)
    else:
        loaded = replace(loaded, scene=changed(loaded.scene, quantity, factor))
    posed = problem_of(inputs._replace(loaded=loaded), Memo())
    return None if posed is None else posed[0]


def changed(scene: Scene, quantity: str, factor: float) -> Scene:
    """A scene with one of its quantities multiplied.

    Parameters
    ----------
    scene
        Uniform, or layers.
    quantity
        ``density``, ``occluder_size`` or ``height``.
    factor
        Above 0.

    Raises
    ------
    RequestError
        Where a density would be 1 or more.
    """
    if isinstance(scene, UniformScene):
        return _changed_volume(scene, quantity, factor)
    return _changed_layers(scene, quantity, factor)


def _changed_volume(scene: UniformScene, quantity: str, factor: float) -> UniformScene:
    if quantity == "height":
        return replace(
            scene,
            volume_base_m=scene.volume_base_m * factor,
            volume_height_m=scene.volume_height_m * factor,
        )
    if quantity == "occluder_size":
        return replace(scene, occluder_size_m=scene.occluder_size_m * factor)
    density = scene.density
    if density is None:
        height, size = scene.volume_height_m, scene.occluder_size_m
        density = float(slice_density(scene.integrated_density, height, size))
    return replace(scene, density=_below_one(density * factor), given_integrated_density=None)


def _changed_layers(scene: LayeredScene, quantity: str, factor: float) -> LayeredScene:
    if quantity == "height":
        layers = tuple(
            layer._replace(bottom_m=layer.bottom_m * factor, top_m=layer.top_m * factor)
            for layer in scene.layers
        )
        return replace(scene, layers=layers)
    if quantity == "occluder_size":
        layers = tuple(
            layer._replace(occluder_size_m=layer.occluder_size_m * factor) for layer in scene.layers
        )
        voxel = None if scene.voxel_m is None else scene.voxel_m * factor
        return replace(scene, layers=layers, voxel_m=voxel)
    layers = tuple(
        layer._replace(density=_below_one(layer.density * factor)) for layer in scene.layers
    )
    return replace(scene, layers=layers).with_density_of(scene)


def _below_one(density: float) -> float:
    if density >= 1.0:
        raise RequestError(f"a slice would have density {density:.4g}")
    return density


def thinned(volume: VoxelVolume, factor: float) -> VoxelVolume:
    """A volume with a factor as many occupied voxels in every slice, by a seeded draw.

    Below 1 some are taken away, whichever; above 1 some of the empty voxels beside an occupied one
    are filled, or all of them where they are too few.
    """
    import numpy as np

    rng = np.random.default_rng(SEED)
    occupied = volume.occupied.copy()
    for plane in occupied:
        filled = np.flatnonzero(plane)
        count = round(len(filled) * abs(factor - 1.0))
        if factor < 1.0:
            plane.flat[rng.choice(filled, count, replace=False)] = False
            continue
        beside = np.zeros_like(plane)
        for axis in (0, 1):
            for step in (-1, 1):
                beside |= np.roll(plane, step, axis=axis)
        free = np.flatnonzero(beside & ~plane)
        plane.flat[rng.choice(free, min(count, len(free)), replace=False)] = True
    return replace(volume, occupied=occupied, bounds=None)


class Confidence(NamedTuple):
    """How far a prediction can be trusted.

    Attributes
    ----------
    uncertainty
        Standard errors of the prediction; None if nothing is known of them.
    uncertainty_reason
        Why nothing is known of them, or empty.
    flown
        The expectation over position noise of the measured model, or None.
    sensitivity
        How the plan changes if the scene differs from what was assumed, if asked for.
    """

    uncertainty: Uncertainty | None = None
    uncertainty_reason: str = ""
    flown: Flown | None = None
    sensitivity: tuple[Change, ...] = ()


def confidence_of(solved: SolvedPlan) -> Confidence:
    """The confidence in a solution: standard errors, and the sensitivity if it was asked for."""
    if solved.problem is None:
        return Confidence(uncertainty_reason="nothing is hidden")
    changes = tuple(changes_of(solved)) if solved.inputs.wants_sensitivity else ()
    if solved.inputs.model == "measured":
        known, flown = _measured(solved.problem, solved.solution, solved.inputs.edges)
    else:
        known, flown = _of_statistics(solved.inputs, solved.solution), None
    if isinstance(known, str):
        return Confidence(None, known, flown, changes)
    return Confidence(known, "", flown, changes)


def _measured(
    problem: Problem, solution: Solution, edges: str
) -> tuple[Uncertainty | str, Flown | None]:
    from aosplan.models.measured import MeasuredModel
    from aosplan.models.uncertainty import UNIFORM, of_targets, with_doubt

    model, plan = problem.model, (solution.pattern, solution.baseline_m)
    if not isinstance(model, MeasuredModel):
        return "the saved scene holds no parts of the plot to compare", None
    errors = of_targets(model.hidden_share(*plan), model.occlusion.targets_per_voxel)
    errors = _with_opacity(errors, model, solution)
    if edges != "wrapped" and model.edges_of(*plan) == "wrapped":
        inside = model.interior_prediction(*plan)
        if inside is not None:
            errors = with_doubt(errors, solution.prediction, inside, UNIFORM, "edges")
    return errors, model.flown(*plan) if model.hold_error_m > 0.0 else None


def _with_opacity(errors: Uncertainty, model: MeasuredModel, solution: Solution) -> Uncertainty:
    """Standard errors with the doubt about the opacity of a point cloud."""
    from aosplan.models.uncertainty import OCTAVE, UNIFORM, with_opacity

    volume = model.volume
    if volume.opacity is None or not volume.occupied.any():
        return errors
    sites = model.sites_m(solution.pattern, solution.baseline_m)
    if volume.bounds is not None:
        bounds = (
            model.of_volume(replace(volume, occupied=bound, bounds=None)) for bound in volume.bounds
        )
        dense, thin = (bound.predict_positions(sites) for bound in bounds)
        return with_opacity(errors, dense, thin, UNIFORM)
    try:
        coarse = model.of_volume(coarsened(volume)).predict_positions(sites)
    except RequestError:  # larger voxels would reach the cameras
        return errors
    return with_opacity(errors, model.predict_positions(sites), coarse, OCTAVE)


def coarsened(volume: VoxelVolume) -> VoxelVolume:
    """A volume of voxels of twice the size: occupied if one of the eight within is."""
    import numpy as np

    occupied = volume.occupied
    for axis in range(3):
        starts = np.arange(0, occupied.shape[axis], 2)
        occupied = np.logical_or.reduceat(occupied, starts, axis=axis)
    return replace(volume, occupied=occupied, voxel_m=2.0 * volume.voxel_m)


def _of_statistics(inputs: PlanInputs, solution: Solution) -> Uncertainty | str:
    loaded = inputs.loaded
    if loaded.volume is None:
        if loaded.kind == "cloud":
            return "the saved scene holds no parts of the plot to compare"
        return "the scene is given by its numbers, which are taken as exact"

    from aosplan.models.uncertainty import of_parts, quarters
    from aosplan.scenes.occluder_statistics import layered_scene

    predictions = []
    try:
        for quarter in quarters(loaded.volume):
            part = layered_scene(quarter, loaded.scene.name)
            if isinstance(loaded.scene, LayeredScene):  # its voxels may count as other occluders
                part = replace(part, voxel_m=loaded.scene.voxel_m)
            posed = problem_of(
                inputs._replace(loaded=replace(loaded, scene=part, volume=quarter)), Memo()
            )
            predictions.append(
                Prediction(0.0, 1.0, 1.0 / solution.pattern.samples)
                if posed is None
                else posed[0].model.predict(solution.pattern, solution.baseline_m)
            )
    except RequestError as error:
        return f"a quarter of the plot cannot be predicted: {error.message}"
    return of_parts(predictions) if predictions else "the plot is too small to be quartered"
