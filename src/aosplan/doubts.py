"""What a plan says against its own prediction: standard errors, and what if the scene were other."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from aosplan.models.measured import Flown
    from aosplan.models.uncertainty import Uncertainty
    from aosplan.planning.inputs import ResolvedScene
    from aosplan.planning.sensitivity import Change
    from aosplan.planning.setup import Task
    from aosplan.solver.problem import (
        Problem,
        Solution,
    )


class Doubts(NamedTuple):
    """Fields of a plan by the same names."""

    uncertainty: Uncertainty | None = None
    uncertainty_reason: str = ""
    flown: Flown | None = None
    sensitivity: tuple[Change, ...] = ()


def doubts_of(task: Task, found: ResolvedScene, problem: Problem, solution: Solution) -> Doubts:
    """Doubts about a solution: what is known at once, and the sensitivity where it is asked for."""
    changes: tuple[Change, ...] = ()
    if task.request.sensitivity:
        from aosplan.planning.sensitivity import changes_of

        changes = tuple(changes_of(task, found, solution))
    if task.model == "measured":
        known, flown = _measured(problem, solution)
    else:
        known, flown = _of_statistics(task, found, solution), None
    if isinstance(known, str):
        return Doubts(None, known, flown, changes)
    return Doubts(known, "", flown, changes)


def _measured(problem: Problem, solution: Solution) -> tuple[Uncertainty | str, Flown | None]:
    from aosplan.models.measured import MeasuredModel
    from aosplan.models.uncertainty import of_targets

    model, plan = problem.model, (solution.pattern, solution.baseline_m)
    if not isinstance(model, MeasuredModel):
        return "the saved scene holds no parts of the plot to compare", None
    errors = of_targets(model.hidden_share(*plan), model.occlusion.targets_per_voxel)
    return errors, model.flown(*plan) if model.hold_error_m > 0.0 else None


def _of_statistics(task: Task, found: ResolvedScene, solution: Solution) -> Uncertainty | str:
    from dataclasses import replace

    if found.volume is None:
        if found.kind == "cloud":
            return "the saved scene holds no parts of the plot to compare"
        return "the scene is given by its numbers, which are taken as exact"

    from aosplan.errors import RequestError
    from aosplan.models.model import Prediction
    from aosplan.models.uncertainty import (
        of_parts,
        quarters,
    )
    from aosplan.scenes.occluder_statistics import layered_scene
    from aosplan.scenes.scene import LayeredScene

    predictions = []
    try:
        for quarter in quarters(found.volume):
            part = layered_scene(quarter, found.scene.name)
            if isinstance(found.scene, LayeredScene):  # its voxels may count as other occluders
                part = replace(part, voxel_m=found.scene.voxel_m)
            posed = task.problem_of(found._replace(scene=part, volume=quarter))
            predictions.append(
                Prediction(0.0, 1.0, 1.0 / solution.pattern.samples)
                if posed is None
                else posed[0].model.predict(solution.pattern, solution.baseline_m)
            )
    except RequestError as error:
        return f"a quarter of the plot cannot be predicted: {error.message}"
    return of_parts(predictions) if predictions else "the plot is too small to be quartered"
