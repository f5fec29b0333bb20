"""The trade-off: baseline, visibility, extent and flight time for each number of samples.

A row is a pattern at the smallest baseline that meets the target.  If no baseline meets the target,
the row has the baseline with the best value.  If the objective is maximised, the row always has the
best baseline.

A row is on the Pareto front if no other row that meets the target dominates it. A row dominates
another row if it is at least as good in samples, extent and flight time, and better in one of
these. If the objective is maximised, its value is compared too, and all rows are included in the
comparison.

For models whose visibility increases with the baseline, there is a row for every number of samples.
For spirals above 64 samples, there are only rows for the sample counts of whole rectangles. For the
measured model, there is a row for the densest pattern of each rectangle, and rows for lines, lanes
and spirals with the same sample counts. The baselines of these rows are found by the scan of
`aosplan.solver.solve_by_scan`, whose step is halved `REFINEMENTS` times.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.flight.kinematics import Path, path_of
from aosplan.models.equations import aperture
from aosplan.solver.solution import BEST
from aosplan.solver.solve_monotone import SEARCHED_SAMPLES

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from aosplan.grid.patterns import AnyPattern
    from aosplan.models.model import Prediction
    from aosplan.solver.problem import Problem
    from aosplan.solver.solution import Solution

REFINEMENTS = 4
"""Number of times that the step of a scan is halved.  The error of baselines is then at most 1
%.
"""

MEASURED_SAMPLES = 100
"""For a measured stand, rows have at most this number of samples, unless the request gives a larger
number.
"""


class TradeoffRow(NamedTuple):
    """One pattern at one baseline."""

    problem: Problem
    pattern: AnyPattern
    baseline_m: float
    prediction: Prediction
    chosen: bool = False
    front: bool = False

    @property
    def meets(self) -> bool:
        """Whether the row meets the target."""
        return self.problem.requirement.is_met(self.prediction)

    @property
    def path(self) -> Path:
        """The path from the first site to the last."""
        return path_of(self.pattern, self.problem.timing)

    @property
    def time_s(self) -> float:
        """Flight time."""
        return self.path.time_s(self.baseline_m, self.problem.timing)

    def document(self) -> dict[str, Any]:
        """The row as plain values."""
        from aosplan.models.model import prediction_document

        pattern, baseline = self.pattern, self.baseline_m
        shown = prediction_document(self.prediction)
        names = ("density", "expected", "normalized", "effective_samples", "contrast")
        return {
            "grid": self.problem.grid.name,
            "samples": pattern.samples,
            "rows": pattern.rows,
            "columns": pattern.columns,
            "baseline_m": baseline,
            "aperture_m": float(aperture(pattern.samples, baseline)),
            "extent_x_m": pattern.extent[0] * baseline,
            "extent_y_m": pattern.extent[1] * baseline,
            "pitch_y_m": pattern.pitch[1] * baseline,
            "length_m": self.path.length_m(baseline, self.problem.timing),
            "time_s": self.time_s,
            **{name: shown[name] for name in names},
            "meets": self.meets,
            "front": self.front,
            "chosen": self.chosen,
        }


def tradeoff(problems: Sequence[Problem], chosen: Problem, solution: Solution) -> list[TradeoffRow]:
    """Rows of all kinds of grid, including the row of the plan.  Within each kind, they are ordered
    by number of samples.

    Parameters
    ----------
    problems
        One problem for each kind of grid.
    chosen, solution
        The problem that the plan has solved, and its solution.
    """
    picked = TradeoffRow(chosen, *solution[:3], chosen=True)
    rows = []
    for problem in problems:
        most = _most(problem, solution.pattern.samples)
        found = (
            _rising(problem, most) if problem.model.rises_with_baseline else _scanned(problem, most)
        )
        own = problem.grid == chosen.grid
        kept = [row for row in found if not (own and row.pattern == picked.pattern)]
        rows += sorted([*kept, *([picked] if own else [])], key=lambda row: row.pattern.samples)
    return _with_front(rows)


def _most(problem: Problem, chosen: int) -> int:
    bounds = problem.bounds
    if bounds.max_samples is not None:
        return bounds.max_samples
    least = SEARCHED_SAMPLES if problem.model.rises_with_baseline else MEASURED_SAMPLES
    return max(least, min(2 * chosen, 2 * SEARCHED_SAMPLES))


def _rising(problem: Problem, most: int) -> Iterator[TradeoffRow]:
    """One row for every number of samples, for models whose visibility increases with
    the baseline.
    """
    bounds, grid = problem.bounds, problem.grid
    last = None
    counts = _counts(problem, most) if bounds.samples is None else [bounds.samples]
    for samples in counts:
        pattern = grid.pattern(samples)
        if pattern == last or (bounds.samples is None and pattern.samples > most):
            continue
        last = pattern
        baseline = bounds.baseline_m
        if baseline is None and problem.objective not in BEST:
            baseline = problem.smallest_baseline_m(pattern)
        if baseline is None:
            baseline = problem.widest_m(pattern)
        yield TradeoffRow(problem, pattern, baseline, problem.model.predict(pattern, baseline))


def _counts(problem: Problem, most: int) -> Iterator[int]:
    """The sample counts that have a row.

    These are all counts.  For spirals above 64 samples, they are only the counts of whole
    rectangles.
    """
    from aosplan.solver.solve_by_scan import THINNED_FROM

    for samples in range(1, most + 1):
        side = math.isqrt(samples)
        whole = samples in (side * side, side * (side + 1))
        if whole or samples <= THINNED_FROM or problem.grid.name != "spiral":
            yield samples


def _scanned(problem: Problem, most: int) -> Iterator[TradeoffRow]:
    """One row for each densest pattern.

    The baseline of a row is found with the fast surrogate and then checked with the model.
    """
    from aosplan.solver.solve_by_scan import Candidate, Scan

    if problem.bounds.samples is None:
        problem = problem._replace(bounds=problem.bounds._replace(max_samples=most))
    scan = Scan(problem)
    for pattern, _ in scan.families(thinned=True, thinned_from=0):
        found: Candidate | None = None
        if problem.objective not in BEST:
            found = scan.until_margins_hold(
                partial(Scan.smallest, pattern=pattern, halvings=REFINEMENTS)
            )
        if found is None:
            hopes = [Candidate(pattern, baseline) for baseline in scan.baselines_m(pattern)]
            found = max(hopes, key=scan.optimistic_value, default=None)
        if found is not None:
            yield TradeoffRow(problem, found.pattern, found.baseline_m, scan.predict(found))


def _with_front(rows: list[TradeoffRow]) -> list[TradeoffRow]:
    """The same rows, with a mark on the rows of the Pareto front."""
    best = bool(rows) and rows[0].problem.objective in BEST

    def measures(row: TradeoffRow) -> tuple[float, ...]:
        extent = row.pattern.longer_side * row.baseline_m
        values = {"visibility": -row.prediction.expected, "contrast": -row.prediction.contrast}
        gained = (values[row.problem.objective],) if best else ()
        return (float(row.pattern.samples), extent, row.time_s, *gained)

    rated = sorted((measures(row), index) for index, row in enumerate(rows) if best or row.meets)
    front: list[tuple[float, ...]] = []
    marked = set()
    # In this order, every row is before the rows that it dominates.
    for measured, index in rated:
        if not any(all(map(float.__le__, other, measured)) for other in front):
            front.append(measured)
            marked.add(index)
    return [row._replace(front=index in marked) for index, row in enumerate(rows)]
