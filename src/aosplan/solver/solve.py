"""The solution of a problem, by the solver that its model and its objective admit."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.solver.solve_monotone import solve_monotone

if TYPE_CHECKING:
    from aosplan.solver.problem import Problem
    from aosplan.solver.solution import Solution


def solve(problem: Problem) -> Solution:
    """Baseline and number of samples that meet a target best.

    Raises
    ------
    InfeasibleError
        If nothing within the bounds meets the target; the message says what is reachable.
    RequestError
        If the answer has more sites than one plan may have.
    """
    if not problem.model.rises_with_baseline or problem.objective in ("visibility", "contrast"):
        from aosplan.solver.solve_by_scan import solve_by_scan

        return solve_by_scan(problem)
    return solve_monotone(problem)
