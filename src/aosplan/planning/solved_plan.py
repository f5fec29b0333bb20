"""`solve_inputs` makes a problem from the inputs of a plan, and solves it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.camera.disparity import CoverageBaseline, coverage_baseline
from aosplan.errors import RequestError
from aosplan.models.model import Prediction
from aosplan.models.uniform import UniformModel
from aosplan.scenes.scene import UniformScene
from aosplan.solver import refusals
from aosplan.solver.problem import GridKind, Problem
from aosplan.solver.solution import Solution
from aosplan.solver.solve import Alternative, solve_best, solve_best_heading

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.camera.disparity import Slab
    from aosplan.models.model import VisibilityModel
    from aosplan.planning.guided_result import GuidedResult
    from aosplan.planning.resolve import PlanInputs
    from aosplan.scenes.correlogram import Correlogram
    from aosplan.scenes.scene import Scene
    from aosplan.solver.problem import OnTrial


MOST_SLICES = 512
"""Largest number of slices of a uniform volume. More slices would change 1 - V̂ by 0.02 %."""


class Memo:
    """Stored results of functions, with the arguments as keys.

    Numbers and text are compared by value, and other arguments are compared by identity. An entry
    keeps its arguments in memory. Otherwise, another object could get the identity of a deleted
    argument.
    """

    def __init__(self) -> None:
        self._entries: dict[tuple[Any, ...], tuple[Any, ...]] = {}

    def __call__(self, make: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        """The result of a function for given arguments.  It is computed once."""
        key = (make, *map(_identity, arguments), *sorted(named.items()))
        if key not in self._entries:
            self._entries[key] = make(*arguments, **named), arguments
        return self._entries[key][0]


class SolvedPlan(NamedTuple):
    """The inputs of a plan, its problem and its solution.

    Attributes
    ----------
    inputs
        The inputs, with the heading of the plan.
    problem, coverage
        The problem, and the baseline of the coverage rule; None if nothing is hidden.
    solution, grid
        The solution, and its kind of grid.
    guided
        How guided positions were chosen; None for other grids.
    """

    inputs: PlanInputs
    problem: Problem | None
    coverage: CoverageBaseline | None
    solution: Solution
    grid: GridKind
    guided: GuidedResult | None = None


def solve_inputs(
    inputs: PlanInputs,
    *,
    on_trial: OnTrial | None = None,
    memo: Memo | None = None,
    count_required: bool = True,
    seek_remedy: bool = True,
) -> SolvedPlan:
    """Find the grid of a plan.

    Parameters
    ----------
    inputs
        The inputs of the plan.
    on_trial
        As in `aosplan.planning.planner.plan`.
    memo
        Stored results, which plans over the same scene share.
    count_required, seek_remedy
        Whether the smallest number of samples at the baseline of the solution is computed, and
        whether a remedy is computed if the target cannot be met. Each of these computations needs a
        search.

    Raises
    ------
    RequestError
        If the model cannot be used for the scene.
    InfeasibleError
        If no grid meets the target.
    """
    posed = problem_of(inputs, memo or Memo())
    if posed is None:
        grid, solution = _clear_view(inputs)
        return SolvedPlan(inputs.at_heading(inputs.heading_deg), None, None, solution, grid)
    problem, coverage = posed
    problem = problem._replace(
        on_trial=on_trial, count_required=count_required, seek_remedy=seek_remedy
    )
    problem, solution = best_alternative(inputs, problem)
    heading = problem.model.heading_deg
    flown = inputs.at_heading(inputs.heading_deg if heading is None else heading)
    return SolvedPlan(flown, problem, coverage, solution, problem.grid)


def best_alternative(inputs: PlanInputs, problem: Problem) -> Alternative:
    """The best solution for the grids and headings that the inputs allow."""
    problems = [problem._replace(grid=kind) for kind in inputs.grids]
    best = solve_best_heading if inputs.compares_headings else solve_best
    return best(problems, footprint_m=inputs.footprint_m, over_area=inputs.area is not None)


def problem_of(inputs: PlanInputs, memo: Memo) -> tuple[Problem, CoverageBaseline] | None:
    """The problem for a plan's inputs, and the baseline of the coverage rule; None if nothing is
    hidden.
    """
    above, coverage = coverage_of(inputs, memo)
    if above is None or coverage is None:
        return None
    if above.transparency == 0.0 or above.integrated_density >= 1.0:
        raise RequestError(
            refusals.opaque_scene(inputs.scene_name),
            "give a density below 1; for a point cloud, give a smaller --voxel or a larger "
            "--min-height",
        )
    if inputs.model == "measured":
        model, surrogate = _measured(inputs, memo)
    else:
        model, surrogate = _of_statistics(inputs, memo, above, coverage), None
    return problem_with(inputs, model, surrogate), coverage


def coverage_of(inputs: PlanInputs, memo: Memo) -> tuple[Scene | None, CoverageBaseline | None]:
    """The part of the scene above the focal plane, and the baseline of the coverage rule.  Both are
    None if nothing is hidden.
    """
    above, density = memo(_above, inputs.loaded.scene, inputs.focal_height_m)
    if above is None or density == 0.0:
        return None, None
    focal = inputs.camera.focal_length_px
    slabs = memo(_slabs, above)
    return above, memo(coverage_baseline, slabs, inputs.altitude_m, focal, inputs.coverage)


def problem_with(
    inputs: PlanInputs, model: VisibilityModel, surrogate: VisibilityModel | None = None
) -> Problem:
    """The problem for a plan's inputs with a given visibility model."""
    return Problem(
        model=model,
        requirement=inputs.requirement,
        grid=inputs.grids[0],
        bounds=inputs.bounds,
        objective=inputs.objective,
        timing=inputs.flight.timing(inputs.heading_deg),
        surrogate=surrogate,
    )


def _of_statistics(
    inputs: PlanInputs, memo: Memo, above: Scene, coverage: CoverageBaseline
) -> VisibilityModel:
    """The uniform or the layered model of a scene."""
    hold_error_m, rays = inputs.hold_error_m, inputs.rays or "nadir"
    focal = inputs.camera.focal_length_px
    common: dict[str, Any] = {"hold_error_m": hold_error_m, "rays": rays}
    if inputs.model == "uniform":

        def slices() -> VisibilityModel:
            """The volume as slices, which are made only if a prediction needs them."""
            made: VisibilityModel = memo(_sliced, above, inputs.altitude_m, focal, **common)
            return made

        return UniformModel(
            above.integrated_density,
            above.transparency,
            coverage.baseline_m,
            altitude_m=inputs.altitude_m,
            slices=slices,
            hold_error_m=hold_error_m,
            rays=rays,
        )
    model: VisibilityModel = memo(_layered, above, inputs.altitude_m, focal, **common)
    return model


def _measured(inputs: PlanInputs, memo: Memo) -> tuple[VisibilityModel, VisibilityModel | None]:
    """The measured model, and the surrogate for searches."""
    from aosplan.models.measured import MeasuredModel
    from aosplan.scenes.correlogram import correlogram

    altitude, volume, table = inputs.altitude_m, inputs.loaded.volume, inputs.loaded.correlogram
    focal_height = inputs.focal_height_m
    common: dict[str, Any] = {
        "heading_deg": inputs.heading_deg,
        "hold_error_m": inputs.hold_error_m,
    }
    if volume is None:
        # `resolve_inputs` has checked that the model can be used for this kind of scene.
        assert table is not None
        if focal_height > 0.0 or inputs.view == "perspective":
            raise RequestError(
                f"scene '{inputs.scene_name}' contains only a correlogram, which cannot be "
                "used with --focal-height or --view perspective",
                "save the scene as .npz, with its voxels, or use --model layered",
            )
        if inputs.edges == "interior" and table.edges != "interior":
            raise RequestError(
                f"--edges interior cannot be used, because scene '{inputs.scene_name}' was saved with "
                "--edges wrapped",
                "save it again with --edges auto, or leave out --edges",
            )
        return memo(_surrogate, table, inputs.edges, altitude, **common), None
    seen: dict[str, Any] = {"view": inputs.view, "focal_height_m": focal_height, **common}
    bounds, edges = inputs.bounds, inputs.edges
    if None not in (bounds.baseline_m, bounds.samples) and not inputs.compares_headings:
        return memo(MeasuredModel, volume, altitude, edges=edges, **seen), None
    model = memo(MeasuredModel, volume, altitude, edges=edges, **seen)
    # The correlogram cannot be used in perspective, because it is telecentric. A model with fewer
    # targets is used instead.
    if model.view == "perspective":
        if volume.targets_per_voxel == 1:
            return model, None
        sparse = memo(MeasuredModel, volume, altitude, edges=edges, targets_per_voxel=1, **seen)
        return model, sparse
    if table is None or focal_height > 0.0 or (edges != "wrapped" and table.edges == "wrapped"):
        table = memo(correlogram, volume, focal_height_m=focal_height)
    return model, memo(_surrogate, table, edges, altitude, **common)


def _surrogate(table: Correlogram, edges: str, altitude_m: float, **common: Any) -> VisibilityModel:
    """The surrogate from a correlogram, either for all targets or for the targets whose rays stay
    on the plot.
    """
    from aosplan.models.correlogram import CorrelogramModel
    from aosplan.models.interior_surrogate import InteriorSurrogate

    if edges == "wrapped" or table.edges == "wrapped":
        return CorrelogramModel(table, altitude_m, **common)
    return InteriorSurrogate(table, altitude_m, **common)


def _above(scene: Scene, height_m: float) -> tuple[Scene | None, float]:
    """The part of a scene above a height, and its density."""
    above = scene.above(height_m)
    return above, above.integrated_density if above is not None else 0.0


def _slabs(scene: Scene) -> tuple[Slab, ...]:
    return scene.slabs()


def _layered(
    above: Scene, altitude_m: float, focal_length_px: float, **common: Any
) -> VisibilityModel:
    from aosplan.models.layered import LayeredModel

    return LayeredModel(above.slices(), altitude_m, focal_length_px, **common)


def _sliced(
    above: Scene, altitude_m: float, focal_length_px: float, **common: Any
) -> VisibilityModel:
    """A uniform volume, or the slabs of another scene, as slices that are one occluder thick."""
    from aosplan.models.layered import LayeredModel

    layers = above.slices(MOST_SLICES) if isinstance(above, UniformScene) else above.slices()
    return LayeredModel(layers, altitude_m, focal_length_px, **common)


def _identity(argument: Any) -> Any:
    """The key of an argument: its value if it is a number or text, otherwise its identity."""
    return argument if isinstance(argument, (float, int, str)) else id(argument)


def _clear_view(inputs: PlanInputs) -> tuple[GridKind, Solution]:
    """The solution for a scene in which nothing is hidden: one sample, or the requested number of
    samples.
    """
    grid, bounds = inputs.grids[0], inputs.bounds
    pattern = grid.pattern(bounds.samples or 1)
    return grid, Solution(
        pattern=pattern,
        baseline_m=bounds.baseline_m or 0.0,
        prediction=Prediction(0.0, 1.0, 1.0 / pattern.samples),
        samples_required=1,
        limits=(),
        met=True,
    )
