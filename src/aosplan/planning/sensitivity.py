"""The sensitivity of a plan: its change if the scene differs from the assumed scene.

Density, occluder size and heights are changed by -20 % and by +20 %, one quantity at a time. For
each changed scene there are two results: the visibility with the planned grid, and the grid that
would be planned for the changed scene. The change depends on the description of the scene:

- *A uniform volume*: D, o, or base and thickness are changed, and p is computed by Eq. 1. If the
  scene is described by p, changes of size and height do not change p, and a change of density
  changes D.
- *Layers*: D_j, o_j, or the heights of all slices are changed. If D_j are changed and the scene has
  a measured p, this p changes by the same factor as the p of independent slices.
- *Voxels*: for density, a fifth of the occupied voxels of every slice is removed, or the same
  number is added beside occupied voxels of the same slice.  These voxels are drawn at random with a
  seed.  A change of size stretches all clumps and gaps of the plot.  A change of height moves all
  voxels above the focal plane.  Both are computed as a change of altitude, because the result
  depends only on camera offset x height / (altitude x size).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import InfeasibleError, RequestError
from aosplan.planning.solved_plan import Memo, best_alternative, problem_of
from aosplan.scenes.density import slice_density
from aosplan.scenes.scene import LayeredScene, UniformScene

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.planning.resolve import PlanInputs
    from aosplan.planning.solved_plan import SolvedPlan
    from aosplan.scenes.scene import Scene
    from aosplan.scenes.voxels import VoxelVolume
    from aosplan.solver.problem import Problem

FACTORS = (0.8, 1.2)
QUANTITIES = ("density", "occluder_size", "height")

SEED = 1
"""Random seed of the voxels that are removed or added."""


class Change(NamedTuple):
    """One change of a scene, and its effect on a plan.

    `visibility` and `normalized` describe the planned grid in the changed scene. `samples` and
    `baseline_m` describe the grid that would be planned for the changed scene. If a value does not
    exist, it is None, and `reason` gives the reason.
    """

    quantity: str
    factor: float
    visibility: float | None
    normalized: float | None
    samples: int | None
    baseline_m: float | None
    reason: str | None


def changes_of(solved: SolvedPlan) -> Iterator[Change]:
    """All changes of a scene, and the effect of each on a solution."""
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
    """The problem for a changed scene; None if nothing is hidden in this scene.

    Raises
    ------
    RequestError
        If the changed scene is not possible.
    """
    higher = factor if quantity == "height" else 1.0
    loaded = inputs.loaded
    above = loaded.scene.canopy_top_m - inputs.focal_height_m
    if above * higher >= inputs.altitude_m:
        raise RequestError(
            f"the canopy would reach {above * higher:.4g} m, which is as high as the cameras"
        )
    if inputs.model == "measured":
        if quantity == "density":
            if loaded.volume is None:
                raise RequestError("a correlogram has no voxels that could be removed or added")
            loaded = replace(
                loaded, volume=with_density_factor(loaded.volume, factor), correlogram=None
            )
        else:
            scale = factor if quantity == "occluder_size" else 1.0 / factor
            inputs = inputs._replace(altitude_m=inputs.altitude_m * scale)
    else:
        loaded = replace(loaded, scene=changed(loaded.scene, quantity, factor))
    posed = problem_of(inputs._replace(loaded=loaded), Memo())
    return None if posed is None else posed[0]


def changed(scene: Scene, quantity: str, factor: float) -> Scene:
    """A scene in which one of the quantities is multiplied by a factor.

    Parameters
    ----------
    scene
        A uniform or layered scene.
    quantity
        ``density``, ``occluder_size`` or ``height``.
    factor
        Factor, greater than 0.

    Raises
    ------
    RequestError
        If a density would be 1 or more.
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


def with_density_factor(volume: VoxelVolume, factor: float) -> VoxelVolume:
    """Multiply the number of occupied voxels in every slice of a volume by a factor.

    The voxels are drawn at random with a seed.  If the factor is less than 1, occupied voxels are
    removed.  If the factor is greater than 1, empty voxels beside occupied voxels are filled.  If
    there are too few such voxels, all of them are filled.
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
    return volume.of_voxels(occupied)
