"""`solve`: hand a problem to the solver that suits it, `solve_monotone` or `solve_by_scan`.

Those two decide the number of samples.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from aosplan.errors import InfeasibleError
from aosplan.solver.solve_monotone import solve_monotone

if TYPE_CHECKING:
    from aosplan.solver.problem import Problem
    from aosplan.solver.solution import Solution


def solve(problem: Problem) -> Solution:
    """The baseline and the number of samples that are best for a problem.

    Raises
    ------
    InfeasibleError
        If nothing within the bounds meets the target; the message says what is reachable.
    RequestError
        If the answer has more sites than one plan may have.
    """
    rises, ground = problem.model.rises_with_baseline, problem.bounds.ground
    if rises and ground is not None and problem.objective == "samples":
        # If the footprint does not limit the solution, solving without it needs no search of frames.
        with suppress(InfeasibleError):
            free = problem.bounds._replace(ground=None)
            found = _solve(problem._replace(bounds=free, seek_remedy=False))
            if ground.allows(found.pattern, found.baseline_m):
                return found
    return _solve(problem)


def _solve(problem: Problem) -> Solution:
    if not problem.model.rises_with_baseline or problem.objective in ("visibility", "contrast"):
        from aosplan.solver.solve_by_scan import solve_by_scan

        return solve_by_scan(problem)
    return solve_monotone(problem)
