"""Solution of problems. If several problems differ in the kind of grid or in the heading, the best
of their solutions is chosen.

`solve` passes a problem to the solver that suits its model and objective: `solve_monotone` or
`solve_by_scan`.  These solvers determine the number of samples.

The problem is solved for each kind of grid. The objective then selects the best of these solutions.
If several solutions are equal within the slack of the objective, the solution with the fewest
samples is selected. Among those with equal numbers of samples, the one with the shortest flight
time is selected. A solution whose samples do not have any ground in common is selected only if this
is true of all solutions.
"""

from __future__ import annotations

import math
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import InfeasibleError
from aosplan.flight.kinematics import path_of
from aosplan.grid.patterns import NARROWEST_TURNS
from aosplan.messages import Limit
from aosplan.solver.problem import GridKind, Problem
from aosplan.solver.solution import BEST, Solution, solution_limits
from aosplan.solver.solve_monotone import APERTURE_SLACK, solve_monotone

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

COMPARED = ("trimmed", "lanes", "spiral", "line")
"""Kinds that ``--grid best`` compares.  Trimmed grids include whole rectangles and squares."""

LANES = (2, 3, 4, 5)
"""Numbers of lanes that are compared."""

LANE_PITCHES = (1.5, 2.0, 3.0, 4.0, 6.0)
"""Pitches of lanes, and of the turns of spirals, that are compared."""

HEADING_STEP_DEG = 5.0
"""Step of the headings that a surrogate compares. The headings are within half a circle, because a
rotation by 180 degrees does not change a grid.
"""

HEADINGS_JUDGED, HEADINGS_APART_DEG = 3, 15.0
"""Number of headings that the model compares after the surrogate, and smallest difference between
two of these headings.
"""

FIRST_HEADINGS_DEG = (0.0, 90.0, 45.0, 135.0)
"""Headings at which a search for the best heading begins. If no grid meets the target at a heading,
the next heading is tried.
"""

HEADING_MATTERS = 0.03
"""Smallest gain of normalised visibility for which a notice about a better heading is given."""

MEASURES = {
    "samples": "number of samples",
    "aperture": "extent [m]",
    "time": "flight time [s]",
    "visibility": "visibility",
    "contrast": "contrast",
}
"""Quantities that the objectives compare."""


class Alternative(NamedTuple):
    """A problem and its solution."""

    problem: Problem
    solution: Solution

    @property
    def measure(self) -> float:
        """Value of the objective.  The last two objectives in `MEASURES` are maximised."""
        pattern, baseline, prediction = self.solution[:3]
        return {
            "samples": lambda: float(pattern.samples),
            "aperture": lambda: pattern.longer_side * baseline,
            "time": lambda: self.time_s,
            "visibility": lambda: prediction.expected,
            "contrast": lambda: prediction.contrast,
        }[self.problem.objective]()

    @property
    def time_s(self) -> float:
        """Flight time."""
        path = path_of(self.solution.pattern, self.problem.timing)
        return path.time_s(self.solution.baseline_m, self.problem.timing)

    def has_ground(self, footprint_m: tuple[float, float], *, over_area: bool = False) -> bool:
        """Whether all samples see some common ground.  Over an area, this ground has to be a whole
        cell between sites.
        """
        pattern, baseline = self.solution[:2]
        cell = pattern.pitch if over_area else (0.0, 0.0)
        sides = zip(pattern.extent, cell, footprint_m, strict=True)
        if over_area:  # This is the same rule as in `aosplan.areas.survey`.
            return all(
                (side + more) * baseline <= size * (1.0 + 1e-9) for side, more, size in sides
            )
        return all(side * baseline < size for side, _, size in sides)


def kinds(
    grid: str,
    lanes: int | str | None = None,
    lane_pitch: float | str | None = None,
    *,
    spirals: bool = True,
) -> tuple[GridKind, ...]:
    """The kinds of grid to compare.  Each option is a value, or ``best`` for all its values.

    Spirals are compared only if `spirals` is true.
    """

    def all_of(name: str) -> Iterator[GridKind]:
        numbers = LANES if lanes == "best" and name == "lanes" else (count,)
        pitched = lane_pitch == "best" and name in ("lanes", "spiral")
        least = NARROWEST_TURNS if name == "spiral" else 1.0
        pitches = (
            [each for each in LANE_PITCHES if each >= least] if pitched else [max(pitch, least)]
        )
        return (GridKind(name, number, each) for number in numbers for each in pitches)

    count = 3 if lanes in (None, "best") else int(lanes)
    pitch = 4.0 if lane_pitch in (None, "best") else float(lane_pitch)
    compared = (name for name in COMPARED if spirals or name != "spiral")
    names = compared if grid == "best" else (grid,)
    return tuple(kind for name in names for kind in all_of(name))


def solve(problem: Problem) -> Solution:
    """Find the best baseline and the best number of samples for a problem.

    Raises
    ------
    InfeasibleError
        If no grid within the bounds meets the target.  The message gives the best value that is
        possible.
    RequestError
        If the solution has more sites than a plan may have.
    """
    rises, ground = problem.model.rises_with_baseline, problem.bounds.ground
    if rises and ground is not None and problem.objective == "samples":
        # The problem is first solved without the limit from the footprint. If the solution is
        # within this limit, no search of frames is needed.
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


def solve_best(
    problems: Sequence[Problem],
    *,
    footprint_m: tuple[float, float] = (math.inf, math.inf),
    over_area: bool = False,
) -> Alternative:
    """Solve problems that differ in their kind of grid or heading, and return the best solution by
    their objective.

    Parameters
    ----------
    problems
        The problems, at least one.
    footprint_m
        Size of the ground that a photo shows, along and across the heading.
    over_area
        Whether the grid is repeated over an area.  All samples then have to see a whole cell.

    Raises
    ------
    InfeasibleError
        If no problem has a solution. The message is the message for the first problem.
    """
    found: list[Alternative] = []
    failed: list[InfeasibleError] = []
    for problem in problems:
        try:
            found.append(Alternative(problem, solve(_no_worse(problem, found))))
        except InfeasibleError as error:
            failed.append(error)
    if not found:
        raise failed[0] if len(failed) == 1 else _none_of(problems, failed)
    grounded = [choice for choice in found if choice.has_ground(footprint_m, over_area=over_area)]
    best = _best(grounded or found)
    if len(problems) == 1:
        return best
    notes = {
        choice.problem.name: f"{choice.problem.name} {choice.measure:.4g}"
        + (
            " because no ground would be in all photos"
            if grounded and choice not in grounded
            else ""
        )
        for choice in found
        if choice is not best
    }
    return best._replace(solution=_with_reason(best, notes, problems))


def _no_worse(problem: Problem, found: Sequence[Alternative]) -> Problem:
    """The problem, with the number of samples limited to that of the best solution so far."""
    if problem.objective != "samples" or not found or problem.bounds.samples is not None:
        return problem
    fewest = min(choice.solution.pattern.samples for choice in found)
    most = problem.bounds.max_samples
    return problem._replace(
        bounds=problem.bounds._replace(max_samples=fewest if most is None else min(most, fewest))
    )


def _best(found: Sequence[Alternative]) -> Alternative:
    if len(found) == 1:
        return found[0]
    from aosplan.solver.solve_by_scan import near_best

    measures = [choice.measure for choice in found]
    objective = found[0].problem.objective
    if objective in BEST:
        near = [measure >= near_best(objective, max(measures)) for measure in measures]
    else:
        slack = APERTURE_SLACK if objective == "aperture" else 1.0 + 1e-12
        near = [measure <= min(measures) * slack for measure in measures]
    return min(
        (choice for choice, is_near in zip(found, near, strict=True) if is_near),
        key=lambda choice: (choice.solution.pattern.samples, choice.time_s),
    )


def _with_reason(best: Alternative, notes: dict[str, str], problems: Sequence[Problem]) -> Solution:
    """The best solution, with an additional limit that names the alternatives with which it was
    compared.
    """
    objective = best.problem.objective
    hopeless = [p.name for p in problems if p.name not in (best.problem.name, *notes)]
    message = f"{best.problem.name} has the best {MEASURES[objective]}, {best.measure:.4g}"
    if notes:
        message += f"; {_some(list(notes.values()))}"
    if hopeless:
        message += f"; {_some(hopeless)} cannot be better"
    limit = Limit("choice", best.measure, best.measure, message)
    # Bounds that were only added for the comparison are not reported to the user as limits.
    limits = solution_limits(best.problem, best.solution)
    return best.solution._replace(limits=(*limits, limit))


def _some(texts: Sequence[str]) -> str:
    """The first four texts, and the number of further texts."""
    more = f" and {len(texts) - 4} more" if len(texts) > 4 else ""
    return ", ".join(texts[:4]) + more


def _none_of(problems: Sequence[Problem], failed: Sequence[InfeasibleError]) -> InfeasibleError:
    others = _some([problem.name for problem in problems[1:]])
    return InfeasibleError(f"{failed[0].message}; {others} do not reach it either", failed[0].hint)


def headings_worth_a_look(problem: Problem, solution: Solution) -> list[tuple[float, float]]:
    """The best headings [deg] for a solution, each with its V̂, according to the surrogate.  The
    best heading is the first.

    The headings are within half a circle and at least `HEADINGS_APART_DEG` apart.
    """
    count = round(180.0 / HEADING_STEP_DEG)
    rated = sorted(
        (
            problem.turned(HEADING_STEP_DEG * step)
            .surrogate_prediction(solution.pattern, solution.baseline_m)
            .shortfall,
            HEADING_STEP_DEG * step,
        )
        for step in range(count)
    )
    kept: list[tuple[float, float]] = []
    for shortfall, heading in rated:
        apart = (abs((heading - other + 90.0) % 180.0 - 90.0) for other, _ in kept)
        if all(each >= HEADINGS_APART_DEG for each in apart):
            kept.append((heading, 1.0 - shortfall))
    return kept[:HEADINGS_JUDGED]


def other_heading(chosen: Alternative) -> str:
    """Text of a notice that another heading is better. It is None if there is no correlogram with
    which headings can be compared.
    """
    problem, solution = chosen
    pattern, baseline = solution[:2]
    surrogate = problem.surrogate or problem.model
    if surrogate.name != "correlogram" or pattern.samples == 1:
        return ""
    heading, then = headings_worth_a_look(problem, solution)[0]
    gain = then - surrogate.predict(pattern, baseline).normalized
    if gain < HEADING_MATTERS:
        return ""
    return (
        f"at --heading {heading:g}, V̂ of this grid would be about {gain:.2f} higher; "
        "--heading best chooses the best heading"
    )


def solve_best_heading(
    problems: Sequence[Problem],
    *,
    footprint_m: tuple[float, float] = (math.inf, math.inf),
    over_area: bool = False,
) -> Alternative:
    """Solve problems at several headings, and return the best solution.

    First, the problems are solved at the first heading of `FIRST_HEADINGS_DEG` that has a solution.
    Second, the surrogate compares all headings for the best of these solutions.  Third, its kind of
    grid is solved with the model at the best headings, and the objective selects one of these
    solutions.
    """
    best = partial(solve_best, footprint_m=footprint_m, over_area=over_area)
    first = _first_heading(problems, best)
    here = first.problem.model.heading_deg
    if here is None or first.solution.pattern.samples == 1:
        return first
    others = [heading for heading, _ in headings_worth_a_look(first.problem, first.solution)]
    turned = [first.problem.turned(heading) for heading in dict.fromkeys([here, *others])]
    return best(turned)


def _first_heading(
    problems: Sequence[Problem], best: Callable[[Sequence[Problem]], Alternative]
) -> Alternative:
    """The best solution at the first heading at which any of the problems has a solution."""
    failed: list[InfeasibleError] = []
    for heading in FIRST_HEADINGS_DEG:
        try:
            return best([each.turned(heading) for each in problems])
        except InfeasibleError as error:
            failed.append(error)
            if problems[0].model.heading_deg is None:
                break
    raise failed[0]
