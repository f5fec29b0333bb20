"""The confidence in a prediction: standard errors, which are computed from differences between
parts of a plot.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import RequestError
from aosplan.models.model import Prediction
from aosplan.planning.solved_plan import Memo, problem_of
from aosplan.scenes.scene import LayeredScene

if TYPE_CHECKING:
    from aosplan.models.measured import MeasuredModel, NoiseExpectation
    from aosplan.models.uncertainty import Uncertainty
    from aosplan.planning.resolve import PlanInputs
    from aosplan.planning.sensitivity import Change
    from aosplan.planning.solved_plan import SolvedPlan
    from aosplan.scenes.voxels import VoxelVolume
    from aosplan.solver.problem import Problem
    from aosplan.solver.solution import Solution


class Confidence(NamedTuple):
    """The errors of a prediction, as far as they are known.

    Attributes
    ----------
    uncertainty
        Standard errors of the prediction; None if they are not known.
    uncertainty_reason
        Reason why the standard errors are not known; empty if they are known.
    noise
        The expectation of the measured model over position noise, or None.
    sensitivity
        Effect on the plan if the scene differs from the assumed scene; empty unless requested.
    """

    uncertainty: Uncertainty | None = None
    uncertainty_reason: str = ""
    noise: NoiseExpectation | None = None
    sensitivity: tuple[Change, ...] = ()


def confidence_of(solved: SolvedPlan) -> Confidence:
    """Standard errors of a solution, and its sensitivity if it is requested."""
    if solved.problem is None:
        return Confidence(uncertainty_reason="nothing is hidden")
    if solved.guided is not None:
        return Confidence(
            uncertainty_reason="standard errors can be computed for plots, but not for a single place"
        )
    changes: tuple[Change, ...] = ()
    if solved.inputs.wants_sensitivity:
        from aosplan.planning.sensitivity import changes_of

        changes = tuple(changes_of(solved))
    if solved.inputs.model == "measured":
        known, noise = _measured(solved.problem, solved.solution, solved.inputs.edges)
    else:
        known, noise = _of_statistics(solved.inputs, solved.solution), None
    if isinstance(known, str):
        return Confidence(None, known, noise, changes)
    return Confidence(known, "", noise, changes)


def _measured(
    problem: Problem, solution: Solution, edges: str
) -> tuple[Uncertainty | str, NoiseExpectation | None]:
    from aosplan.models.measured import MeasuredModel
    from aosplan.models.uncertainty import UNIFORM, of_apertures, of_targets, with_doubt

    model, plan = problem.model, (solution.pattern, solution.baseline_m)
    if not isinstance(model, MeasuredModel):
        return (
            "standard errors are computed from parts of the plot, which the saved scene does not contain",
            None,
        )
    if model.view == "perspective":
        errors = of_apertures(model.hidden_at_places(*plan))
    else:
        errors = of_targets(model.hidden_share(*plan), model.occlusion.targets_per_cell)
    errors = _with_opacity(errors, model, solution)
    if edges != "wrapped" and model.edges_of(*plan) == "wrapped":
        inside = model.interior_prediction(*plan)
        if inside is not None:
            errors = with_doubt(errors, solution.prediction, inside, UNIFORM, "edges")
    return errors, model.noise_expectation(*plan) if model.hold_error_m > 0.0 else None


def _with_opacity(errors: Uncertainty, model: MeasuredModel, solution: Solution) -> Uncertainty:
    """Standard errors with the uncertainty of the opacity of a point cloud."""
    from aosplan.models.uncertainty import (
        UNIFORM,
        of_clumps,
        of_voxel_size,
        with_doubt,
        with_part,
    )

    volume = model.volume
    if volume.opacity is None or not volume.occupied.any():
        return errors
    sites = model.sites_m(solution.pattern, solution.baseline_m)
    if volume.bounds is not None:
        bounds = (model.of_volume(volume.of_voxels(bound)) for bound in volume.bounds)
        dense, thin = (bound.predict_positions(sites) for bound in bounds)
        errors = with_part(errors, of_clumps((volume.opacity.pulses or 0) / volume.plot_area_m2))
        return with_doubt(errors, dense, thin, UNIFORM, "opacity")
    try:
        coarse = model.of_volume(coarsened(volume)).predict_positions(sites)
    except RequestError:  # Voxels of twice the size would reach the altitude of the cameras.
        return errors
    return with_part(errors, of_voxel_size(model.predict_positions(sites), coarse))


def coarsened(volume: VoxelVolume) -> VoxelVolume:
    """A volume of voxels of twice the size.  A large voxel is occupied if at least one of its eight
    small voxels is occupied.
    """
    occupied = volume.occupied
    for axis in range(3):
        along = occupied.swapaxes(0, axis)
        pairs = along[0::2].copy("K")
        pairs[: len(along) // 2] |= along[1::2]
        occupied = pairs.swapaxes(0, axis)
    return replace(volume.of_voxels(occupied), voxel_m=2.0 * volume.voxel_m)


def _of_statistics(inputs: PlanInputs, solution: Solution) -> Uncertainty | str:
    loaded = inputs.loaded
    if loaded.volume is None:
        if loaded.kind == "cloud":
            return "standard errors are computed from parts of the plot, which the saved scene does not contain"
        return "the numbers of the scene are assumed to be exact"

    from aosplan.models.uncertainty import of_parts, quarters
    from aosplan.scenes.occluder_statistics import layered_scene

    predictions = []
    try:
        for quarter in quarters(loaded.volume):
            part = layered_scene(quarter, loaded.scene.name)
            # The given size of the occluders may differ from the size of the voxels.
            if isinstance(loaded.scene, LayeredScene):
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
        return (
            f"no prediction is possible for one of the four quarters of the plot: {error.message}"
        )
    return (
        of_parts(predictions)
        if predictions
        else "the plot is too small to be divided into quarters"
    )
