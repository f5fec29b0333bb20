"""Samples and baselines of whole columns, for scenarios in which neighbours do not share occluders
and therefore V̂ = 1 - 1/N.

Results and error messages are the same as in `aosplan.solver.solve_monotone`, for the uniform model
and with the smallest number of samples as the objective. Every quantity is an array over only the
axes on which it depends. Some scenarios are deferred and solved individually, because the model
uses slices for them (`aosplan.models.uniform`). Their baseline is smaller than the baseline of the
coverage rule, either because it is given or because the extent of the grid is limited.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.grid.patterns import MOST_SITES, index_by_side, rectangle_at, too_many_sites
from aosplan.models.model import Prediction
from aosplan.solver import refusals
from aosplan.solver.problem import TOLERANCE, target_text
from aosplan.sweeps.block import INFEASIBLE, INVALID
from aosplan.sweeps.vectorized.inputs import MOST_COUNTED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.sweeps.block import RowStatuses
    from aosplan.sweeps.vectorized.inputs import TargetColumns

    Counts = NDArray[np.int64]
    Floats = NDArray[np.float64]


class RequirementColumns(NamedTuple):
    """The requirements of scenarios, as columns that broadcast to the shape of a block.  None means
    no limit.

    `sound` is true for scenarios that can be solved.  `ground_m` is the largest extent of the grid
    along x and y for which all samples still see common ground.
    """

    sound: Any
    grid: Any
    target: TargetColumns
    density: Any
    transparency: Any
    unit_m: Any
    baseline_m: Any = None
    samples: Any = None
    max_aperture_m: Any = None
    max_samples: Any = None
    ground_m: tuple[Any, Any] = (np.inf, np.inf)

    @property
    def fixed(self) -> bool:
        """Whether both baseline and number of samples are given."""
        return self.baseline_m is not None and self.samples is not None

    def value(self, shortfall: Any) -> Any:
        """Value of the target's quantity for a given shortfall."""
        predicted = Prediction(self.density, self.transparency, shortfall)
        return predicted.normalized if self.target.symbol == "V̂" else predicted.expected


class SolvedSamples(NamedTuple):
    """Samples, baselines and shortfalls.  They are not valid for scenarios that were refused or
    deferred.

    `required` is nan if no number of samples is enough.
    """

    samples: Any
    baseline_m: Any
    shortfall: Any
    required: Any


def solve_samples(asked: RequirementColumns, statuses: RowStatuses) -> SolvedSamples:
    """Samples and baselines that meet the requirements of all rows.

    Rows without a solution get the same error message as in the solver.
    """
    symbol, value, _, fewest = asked.target
    if not asked.fixed:
        _refuse_hopeless(asked, statuses)
    wanted = np.clip(fewest, 1, MOST_SITES) if asked.samples is None else asked.samples
    samples, *sides = _by_kind(_lines, asked.grid, wanted)
    statuses.defer(asked.sound & (samples > MOST_SITES))
    baseline = asked.unit_m if asked.baseline_m is None else asked.baseline_m
    _defer_bound(asked, samples, sides, baseline, statuses)
    shortfall = 1.0 / samples
    if asked.fixed:
        reached = (fewest > 0) & (fewest <= MOST_SITES)
        return SolvedSamples(samples, baseline, shortfall, np.where(reached, fewest, np.nan))
    if asked.samples is not None:
        _refuse_missed(asked, asked.sound & (samples < fewest), shortfall, baseline, statuses)
    elif asked.max_samples is not None:
        most = asked.max_samples
        over = asked.sound & (samples > most)
        if asked.baseline_m is not None:
            statuses.defer(over)
        best, _ = _by_kind(_largest, asked.grid, most)
        statuses.refuse(
            INFEASIBLE,
            over,
            partial(_beyond_max_samples, symbol),
            value,
            samples,
            most,
            asked.value(1.0 / best),
            best,
            asked.unit_m,
        )
    return SolvedSamples(samples, baseline, shortfall, fewest)


def _defer_bound(
    asked: RequirementColumns, samples: Any, sides: Any, baseline_m: Any, statuses: RowStatuses
) -> None:
    """Defer scenarios whose neighbours share occluders, or whose grid exceeds a limit."""
    several = asked.sound & (samples > 1)
    if asked.baseline_m is not None:
        statuses.defer(several & (baseline_m < asked.unit_m))
    bounds = () if asked.fixed else asked.ground_m
    for side, ground in zip(sides, bounds, strict=False):
        statuses.defer(several & (side * baseline_m > ground * (1.0 - TOLERANCE)))
    if asked.max_aperture_m is not None and not asked.fixed:
        statuses.defer(several & (np.maximum(*sides) * baseline_m > asked.max_aperture_m))


def _refuse_hopeless(asked: RequirementColumns, statuses: RowStatuses) -> None:
    """Refuse targets that cannot be reached, or that need more samples than a plan may have."""
    symbol, value, _, fewest = asked.target
    t, p = asked.transparency, asked.density
    statuses.refuse(
        INFEASIBLE,
        asked.sound & (fewest == 0),
        partial(refusals.beyond_scene, symbol),
        value,
        t,
        t * (1.0 + p),
    )
    many = asked.sound & (fewest > MOST_SITES)
    if asked.max_samples is None:
        statuses.defer(asked.sound & (fewest >= MOST_COUNTED))
        statuses.refuse(
            INVALID,
            many,
            lambda value, samples: too_many_sites(f"{target_text(symbol, value)} needs", samples),
            value,
            fewest,
        )
    else:
        statuses.defer(many)


def _lines(grid: str, samples: Counts) -> tuple[Counts, Counts, Counts]:
    """For each given number of samples, the smallest pattern with at least this number: its number
    of samples, and its sides along x and y in baselines.
    """
    rows, columns = rectangle_at(grid, _index_for(grid, samples))
    return samples if grid == "trimmed" else rows * columns, columns - 1, rows - 1


def _index_for(grid: str, samples: Counts) -> Counts:
    """The same as `aosplan.grid.patterns.index_for`, for an array of sample counts."""
    side = np.floor(np.sqrt(samples.astype(float))).astype(np.int64)
    # The integer part of a floating-point root may be too small by one.
    side += (side + 1) ** 2 <= samples
    side -= side**2 > samples
    return np.asarray(index_by_side(grid, samples, side))


def _by_kind(function: Any, grid: Any, samples: Any) -> Any:
    """Evaluate a function of the kind of grid and the samples.  The kind of grid may differ between
    scenarios.
    """
    shape = np.broadcast_shapes(np.shape(grid), np.shape(samples))
    result: Any = None
    for kind in sorted(set(grid.flat)):
        found = [np.broadcast_to(part, shape) for part in function(kind, samples)]
        result = (
            found
            if result is None
            else [np.where(grid == kind, new, old) for new, old in zip(found, result, strict=True)]
        )
    return result


def _largest(grid: str, most: Any) -> tuple[Any, Any]:
    """Number of samples of the largest pattern of a kind with at most `most` samples, and index of
    this pattern.
    """
    index = _index_for(grid, most)
    rows, columns = rectangle_at(grid, index)
    index = index - ((rows * columns > most) & (grid != "trimmed"))
    rows, columns = rectangle_at(grid, index)
    return most if grid == "trimmed" else rows * columns, index


def _refuse_missed(
    asked: RequirementColumns, missed: Any, shortfall: Any, widest_m: Any, statuses: RowStatuses
) -> None:
    symbol, value, _, _ = asked.target
    statuses.refuse(
        INFEASIBLE,
        missed,
        partial(refusals.beyond_samples, symbol),
        value,
        asked.samples,
        asked.value(shortfall),
        widest_m,
    )


def _beyond_max_samples(symbol: str, target: float, needed: int, most: int, *best: Any) -> str:
    return refusals.beyond_max_samples(
        symbol, target, needed, most, refusals.best_text(symbol, *best)
    )
