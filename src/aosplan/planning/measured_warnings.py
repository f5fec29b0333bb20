"""Warnings of a plan whose visibility is predicted by the measured model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.messages import Message
from aosplan.models.measured import MeasuredModel
from aosplan.solver.solve import Alternative, other_heading

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.planning.solved_plan import SolvedPlan
    from aosplan.solver.problem import Problem

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
    yield from _edges(solved, problem)
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
            f"the plot is too small for a grid of {extent_m:.4g} m: between its first and "
            f"last photo, the top of the canopy shifts by {shear_m:.2g} of the plot at an "
            f"altitude of {inputs.altitude_m:.4g} m, and if it shifts by more than one half, "
            "the same trees count twice; give --max-aperture "
            f"{problem.model.independent_baseline_m:.4g}, or measure a larger plot",
        )
    if not compares_headings and (word := other_heading(Alternative(problem, solution))):
        yield Message("heading", word)


def _edges(solved: SolvedPlan, problem: Problem) -> Iterator[Message]:
    """Warn if the prediction depends on the repetition of the plot, unless the request asks for
    this repetition.
    """
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
            "rays to this grid leave the plot, which is repeated beyond its edges, and its "
            "edges differ from its middle: targets whose rays stay on the plot have V̂ = "
            f"{inside.normalized:.3g} and V = {inside.expected:.3g}, all targets have "
            f"{solution.prediction.normalized:.3g} and {solution.prediction.expected:.3g}; "
            "--edges interior counts only the targets whose rays stay on the plot",
        )
