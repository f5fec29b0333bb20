"""Samples and baselines of whole columns, within bounds or at fixed values.

The answers of `aosplan.solver.solve_monotone` for the uniform model and the fewest samples, and its refusals.
Where nothing keeps neighbours from sharing no occluder V̂ = 1 - 1/N, and every quantity is an array
over just the axes on which it depends (`_free`); else all scenarios of a kind of grid take the
solver's steps together (`_bound`).
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.grid.patterns import MOST_SITES, too_many_sites
from aosplan.models.model import Prediction
from aosplan.solver import refusals
from aosplan.solver.problem import TOLERANCE
from aosplan.solver.solve_monotone import SEARCHED_FRAMES, SEARCHED_SAMPLES
from aosplan.sweeps.status import INFEASIBLE, INVALID
from aosplan.sweeps.vectorized import grids
from aosplan.sweeps.vectorized.inputs import MOST_COUNTED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.sweeps.status import RowStatuses
    from aosplan.sweeps.vectorized.inputs import Target

    Counts = NDArray[np.int64]
    Floats = NDArray[np.float64]


class Asked(NamedTuple):
    """What is asked of scenarios, columns that broadcast to a block's shape; None: not bounded.

    `sound` where there is something to solve.
    """

    sound: Any
    grid: Any
    target: Target
    density: Any
    transparency: Any
    unit_m: Any
    baseline_m: Any = None
    samples: Any = None
    max_aperture_m: Any = None
    max_samples: Any = None

    @property
    def fixed(self) -> bool:
        """Whether nothing is left to solve for."""
        return self.baseline_m is not None and self.samples is not None

    def value(self, shortfall: Any) -> Any:
        """What a shortfall makes of the quantity that is asked for."""
        predicted = Prediction(self.density, self.transparency, shortfall)
        return predicted.normalized if self.target.symbol == "V̂" else predicted.expected


class Answer(NamedTuple):
    """Samples, baselines and shortfalls; where a scenario was refused or left they mean nothing.

    `required` is nan where no number of samples does, or where it was not counted.
    """

    samples: Any
    baseline_m: Any
    shortfall: Any
    required: Any


def answer(asked: Asked, statuses: RowStatuses, *, count_required: bool) -> Answer:
    """The answers to what is asked; what cannot be met is refused as the solver does.

    The samples that are `required` at each baseline take the longest to count.
    """
    target = asked.target
    if not asked.fixed:
        _refuse_hopeless(asked, statuses)
    counted = np.clip(target.fewest, 1, MOST_SITES)
    if asked.baseline_m is None and not _narrowed(asked, counted):
        return _free(asked, counted, statuses)
    return _bound(asked, statuses, count_required=count_required)


def _refuse_hopeless(asked: Asked, statuses: RowStatuses) -> None:
    """Refuse targets that no number of samples reaches, or more than one plan may have."""
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
            lambda value, samples: too_many_sites(
                f"{refusals.target_text(symbol, value)} needs", samples
            ),
            value,
            fewest,
        )
    else:
        statuses.defer(many)


def _lines(grid: str, samples: Counts) -> tuple[Counts, Counts]:
    """Samples of the smallest patterns with so many, and their longer sides in baselines."""
    rows, columns = grids.frame(grid, grids.index_of(grid, samples))
    longer = np.maximum(rows, columns) - 1
    return samples if grid == "trimmed" else rows * columns, longer


def _by_kind(function: Any, grid: Any, samples: Any) -> Any:
    """A function of a kind of grid and of samples, for kinds by scenario."""
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


def _narrowed(asked: Asked, counted: Any) -> bool:
    """Whether a bound on the aperture binds anywhere."""
    if asked.max_aperture_m is None:
        return False
    wanted = counted if asked.samples is None else asked.samples
    _, longer = _by_kind(_lines, asked.grid, np.clip(wanted, 1, MOST_SITES))
    return bool(np.any(longer * asked.unit_m > asked.max_aperture_m))


def _free(asked: Asked, counted: Any, statuses: RowStatuses) -> Answer:
    """Neighbours share no occluder: as many samples as the target takes, each for itself."""
    symbol, value, _, fewest = asked.target
    wanted = counted if asked.samples is None else asked.samples
    samples, _ = _by_kind(_lines, asked.grid, wanted)
    statuses.defer(asked.sound & (samples > MOST_SITES))
    shortfall = 1.0 / samples
    if asked.samples is not None:
        _refuse_missed(asked, asked.sound & (samples < fewest), shortfall, asked.unit_m, statuses)
    elif asked.max_samples is not None:
        most = asked.max_samples
        best, _ = _by_kind(_largest, asked.grid, most)
        statuses.refuse(
            INFEASIBLE,
            asked.sound & (samples > most),
            partial(_beyond_max_samples, symbol),
            value,
            samples,
            most,
            asked.value(1.0 / best),
            best,
            asked.unit_m,
        )
    return Answer(samples, asked.unit_m, shortfall, fewest)


def _largest(grid: str, most: Any) -> tuple[Any, Any]:
    """Samples of the largest pattern of a kind with at most so many, and its place."""
    index = grids.index_of(grid, most)
    rows, columns = grids.frame(grid, index)
    index = index - ((rows * columns > most) & (grid != "trimmed"))
    rows, columns = grids.frame(grid, index)
    return most if grid == "trimmed" else rows * columns, index


def _refuse_missed(
    asked: Asked, missed: Any, shortfall: Any, widest_m: Any, statuses: RowStatuses
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


class _Rows(NamedTuple):
    """Scenarios by columns of shape (n,); bounds that are not given are None."""

    most: Any
    fewest: Any
    unit_m: Any
    baseline_m: Any
    samples: Any
    max_aperture_m: Any
    max_samples: Any


class _Found(NamedTuple):
    """Answers of some rows, and for the refused ones the best within the bounds, shape (n,).

    `samples` may be `grids.NONE` or `grids.UNKNOWN`.
    """

    samples: Counts
    baseline_m: Floats
    shortfall: Floats
    best_samples: Any = 0
    best_baseline_m: Any = np.nan
    best_shortfall: Any = np.nan


def _bound(asked: Asked, statuses: RowStatuses, *, count_required: bool) -> Answer:
    """Answers where neighbours may share occluders, all scenarios of a kind of grid at once."""
    target = asked.target
    parts = (
        target.most,
        target.fewest,
        asked.unit_m,
        asked.baseline_m,
        asked.samples,
        asked.max_aperture_m,
        asked.max_samples,
    )
    given = [part for part in (*parts, asked.grid, asked.sound) if part is not None]
    shape = np.broadcast_shapes(*map(np.shape, given))

    def flat(part: Any) -> Any:
        return None if part is None else np.broadcast_to(part, shape).reshape(-1)

    every, kinds, sound = _Rows(*map(flat, parts)), flat(asked.grid), flat(asked.sound)
    if not asked.fixed:
        sound = sound & (every.fewest > 0) & (every.fewest <= MOST_SITES)
    if asked.samples is not None:
        sound = sound & (every.samples <= MOST_SITES)
    count = len(kinds)
    samples = np.full(count, grids.UNKNOWN)
    required = np.full(count, grids.UNKNOWN if count_required else grids.NONE)
    best = np.zeros(count, dtype=np.int64)
    baseline, shortfall, best_baseline, best_shortfall = np.full((4, count), np.nan)
    for kind in sorted(set(asked.grid.flat)):
        rows = np.flatnonzero(sound & (kinds == kind))
        part = _Rows(*(None if column is None else column[rows] for column in every))
        found = _solved(kind, part)
        samples[rows], baseline[rows], shortfall[rows] = found[:3]
        best[rows], best_baseline[rows], best_shortfall[rows] = found[3:]
        if count_required:
            required[rows] = _required(kind, part, found)
    answered = Answer(*(part.reshape(shape) for part in (samples, baseline, shortfall, required)))
    reached = best.reshape(shape), best_baseline.reshape(shape), best_shortfall.reshape(shape)
    _judge(asked, answered, reached, statuses)
    none = answered.required == grids.NONE
    return answered._replace(
        samples=np.maximum(answered.samples, 1),
        required=np.where(none, np.nan, answered.required) if none.any() else answered.required,
    )


def _required(kind: str, part: _Rows, found: _Found) -> Counts:
    """Fewest samples of rectangles that need not be whole, or of lines, at the baselines found."""
    counted = "line" if kind == "line" else "trimmed"
    if kind == counted and part.baseline_m is not None and part.samples is None:
        return found.samples
    required = np.full(len(found.samples), grids.UNKNOWN)
    rows = np.flatnonzero(found.samples > 0)
    dhat = found.baseline_m[rows] / part.unit_m[rows]
    required[rows] = grids.fewest(counted, part.most[rows], part.fewest[rows], dhat)
    return required


def _solved(kind: str, part: _Rows) -> _Found:
    if part.samples is None and part.baseline_m is not None:
        samples = grids.fewest(kind, part.most, part.fewest, dhat := part.baseline_m / part.unit_m)
        told = np.maximum(samples, 1)
        return _Found(samples, part.baseline_m, grids.shortfalls(kind, told, dhat))
    if part.samples is None:
        return _fewest_within(kind, part)
    samples, longer = _lines(kind, part.samples)
    baseline = part.baseline_m
    if baseline is None:
        baseline = _widest_m(part, longer)
    shortfall = grids.shortfalls(kind, samples, baseline / part.unit_m)
    return _Found(
        np.where(np.isnan(shortfall) | (samples > MOST_SITES), grids.UNKNOWN, samples),
        baseline,
        shortfall,
    )


def _widest_m(part: _Rows, longer: Counts, rows: Any = slice(None)) -> Floats:
    """Widest baseline worth trying for patterns of a size, or that the aperture leaves them."""
    unit: Floats = part.unit_m[rows]
    with np.errstate(divide="ignore"):
        widest: Floats = np.minimum(unit, part.max_aperture_m[rows] / longer)
    return widest


def _fewest_within(kind: str, part: _Rows) -> _Found:
    """The fewest samples within an aperture: the first frame whose densest pattern does."""
    count = len(part.most)
    limit = (
        np.maximum(SEARCHED_SAMPLES, 4 * part.fewest)
        if part.max_samples is None
        else part.max_samples
    )
    samples = np.full(count, grids.NONE)
    baseline, shortfall = np.full((2, count), np.nan)
    index, chosen = grids.index_of(kind, part.fewest), np.arange(count)
    for _ in range(SEARCHED_FRAMES):
        rows, columns = grids.frame(kind, index[chosen])
        whole = rows * columns
        least = grids.least_of(index[chosen]) if kind == "trimmed" else whole
        within = least <= limit[chosen]
        chosen, rows, columns, whole = (each[within] for each in (chosen, rows, columns, whole))
        if not len(chosen):
            break
        widest = _widest_m(part, np.maximum(rows, columns) - 1, chosen)
        dhat = widest / part.unit_m[chosen]
        most = np.minimum(whole, limit[chosen])
        reached = grids.shortfalls(kind, most, dhat)
        met = (reached <= part.most[chosen]) | np.isnan(reached)
        hit = chosen[met]
        least = np.minimum(np.maximum(least[within][met], part.fewest[hit]), most[met])
        found = grids.fewest_within(kind, part.most[hit], least, most[met], dhat[met])
        found[np.isnan(reached[met])] = grids.UNKNOWN
        samples[hit], baseline[hit] = found, widest[met]
        shortfall[hit] = grids.shortfalls(kind, np.maximum(found, 1), dhat[met])
        chosen = chosen[~met]
        index[chosen] += 1
    best = np.zeros(count, dtype=np.int64)
    best_baseline, best_shortfall = np.full((2, count), np.nan)
    lost = np.flatnonzero(samples == grids.NONE)
    if len(lost):
        best[lost], best_baseline[lost], best_shortfall[lost] = _best_within(kind, part, lost)
        samples[lost[best[lost] == grids.UNKNOWN]] = grids.UNKNOWN
    return _Found(samples, baseline, shortfall, best, best_baseline, best_shortfall)


def _best_within(kind: str, part: _Rows, lost: NDArray[np.intp]) -> tuple[Counts, Floats, Floats]:
    """The patterns of the least shortfall that the bounds allow: samples, baselines, shortfalls."""
    limit = (
        np.full(len(lost), SEARCHED_SAMPLES) if part.max_samples is None else part.max_samples[lost]
    )
    samples = np.full(len(lost), grids.UNKNOWN)
    baseline, shortfall = np.full(len(lost), np.nan), np.full(len(lost), np.inf)
    last = grids.index_of(kind, limit).max()
    for index in range(1, int(min(last, SEARCHED_FRAMES)) + 1):
        place = np.array([index])
        ((rows,), (columns,)) = grids.frame(kind, place)
        least = grids.least_of(place)[0] if kind == "trimmed" else rows * columns
        open_ = np.flatnonzero(least <= limit)
        widest = _widest_m(part, np.array(max(rows, columns) - 1), lost[open_])
        most = np.minimum(rows * columns, limit[open_])
        reached = grids.shortfalls(kind, most, widest / part.unit_m[lost[open_]])
        # What cannot be told stays so: no shortfall is less than nan.
        better = (reached < shortfall[open_]) | np.isnan(reached)
        hit = open_[better]
        samples[hit], baseline[hit], shortfall[hit] = most[better], widest[better], reached[better]
    samples[np.isnan(shortfall)] = grids.UNKNOWN
    return samples, baseline, shortfall


def _judge(asked: Asked, found: Answer, best: tuple[Any, Any, Any], statuses: RowStatuses) -> None:
    """Refuse what the bounds exclude, and leave what is not known here."""
    if asked.samples is None and asked.baseline_m is None:
        _judge_aperture(asked, found, best, statuses)
    elif asked.samples is None:
        _judge_baseline(asked, found, statuses)
    elif asked.baseline_m is None:
        missed = (found.samples > 0) & ~(found.shortfall <= asked.target.most)
        _refuse_missed(asked, missed, found.shortfall, found.baseline_m, statuses)
    lost = (found.samples < 1) | (found.required == grids.UNKNOWN) | np.isnan(found.shortfall)
    statuses.defer(asked.sound & lost)


def _judge_baseline(asked: Asked, found: Answer, statuses: RowStatuses) -> None:
    symbol, value, _, _ = asked.target
    most = MOST_SITES if asked.max_samples is None else asked.max_samples
    none = found.samples == grids.NONE
    statuses.refuse(
        INFEASIBLE,
        none | (found.samples > most),
        lambda value, baseline, samples: refusals.beyond_baseline(
            symbol, value, baseline, samples, bounded=asked.max_samples is not None
        ),
        value,
        asked.baseline_m,
        np.maximum(found.samples, 0),
    )
    if asked.max_aperture_m is None:
        return
    _, longer = _by_kind(_lines, asked.grid, np.maximum(found.samples, 1))
    extent = longer * asked.baseline_m
    statuses.refuse(
        INFEASIBLE,
        (found.samples > 0) & (extent > asked.max_aperture_m * (1.0 + TOLERANCE)),
        partial(refusals.beyond_aperture, symbol),
        value,
        asked.baseline_m,
        found.samples,
        extent,
        asked.max_aperture_m,
    )


def _judge_aperture(
    asked: Asked, found: Answer, best: tuple[Any, Any, Any], statuses: RowStatuses
) -> None:
    symbol, value, _, fewest = asked.target
    samples, baseline, shortfall = best
    told = asked.value(shortfall), samples, baseline
    refused = found.samples == grids.NONE
    if asked.max_samples is not None:
        needed, _ = _by_kind(_lines, asked.grid, np.clip(fewest, 1, MOST_SITES))
        statuses.refuse(
            INFEASIBLE,
            refused & (asked.max_samples < needed),
            partial(_beyond_max_samples, symbol),
            value,
            needed,
            asked.max_samples,
            *told,
        )
    bounds = [bound for bound in (asked.max_aperture_m, asked.max_samples) if bound is not None]
    statuses.refuse(
        INFEASIBLE,
        refused,
        lambda value, reached, samples, baseline, aperture, most=None: refusals.beyond_bounds(
            symbol, value, aperture, most, refusals.best_text(symbol, reached, samples, baseline)
        ),
        value,
        *told,
        *bounds,
    )
