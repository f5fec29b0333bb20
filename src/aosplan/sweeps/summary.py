"""Summary of the results of a sweep, computed while it runs, without storing rows.

Each part is summarised separately, and the summaries are added. The addition is exact. The result
therefore does not depend on the order and the size of the parts. Counts are integers. Sums are also
integers, in units of the smallest float (`exact_sum`). An extreme is a value and the first row that
has this value. Medians are computed from counts in fixed bins, as in HdrHistogram. They are
approximate, with a relative error of at most `MEDIAN_ERROR`.
"""

from __future__ import annotations

import math
import re
from fractions import Fraction
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.sweeps.block import STATUSES
from aosplan.sweeps.grouping import scenario
from aosplan.sweeps.scenarios import polars
from aosplan.sweeps.solve_rows import WHOLE
from aosplan.sweeps.verify import RowSample, SamplingPlan, draw_rows

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import polars as pl
    from numpy.typing import NDArray

    from aosplan.sweeps.block import Block
    from aosplan.sweeps.grouping import Grouping, InputGroups
    from aosplan.sweeps.scenarios import ScenarioProduct, ScenarioTable

MOST_REASONS = 100
"""Largest number of kinds of reasons; the first kinds in alphabetical order are kept."""

BITS = 8
"""Number of leading bits of a float's fraction that determine its bin."""

MOST_BINS = 1 << 14
"""Largest range of bins that is counted in an array."""

MEDIAN_ERROR = 2.0 ** -(BITS + 1)
"""Largest relative error of an approximate median; integers below 512 are exact."""

_SMALLEST = 1074
"""Every float is a multiple of 2 ** -1074."""

_NUMBER = re.compile(r"(?<![\w.'-])-?\d+(\.\d+)?(e[+-]?\d+)?(?![\w'])")

Extreme = tuple[float, int]
"""A value, and the first row that has it."""


class ResultSummary(NamedTuple):
    """One result over the kept rows: number of rows that have this result, sum, and extremes."""

    known: int = 0
    total: int = 0
    least: Extreme | None = None
    most: Extreme | None = None

    def __add__(self, other: object) -> ResultSummary:
        """The summary over the rows of both summaries."""
        assert isinstance(other, ResultSummary)
        return ResultSummary(
            self.known + other.known,
            self.total + other.total,
            min((e for e in (self.least, other.least) if e), default=None),
            min((e for e in (self.most, other.most) if e), key=_downwards, default=None),
        )

    @property
    def mean(self) -> float | None:
        """The correctly rounded mean."""
        return float(Fraction(self.total, self.known << _SMALLEST)) if self.known else None


def _downwards(extreme: Extreme) -> tuple[float, int]:
    return -extreme[0], extreme[1]


class GroupSummary(NamedTuple):
    """Scenarios with one value of an input: counts, best value and bins of the objective."""

    scenarios: int = 0
    rows: int = 0
    met: int = 0
    best: float | None = None
    bins: Mapping[int, int] = {}

    def joined(self, other: GroupSummary, *, most: bool) -> GroupSummary:
        """The summary over the scenarios of both groups."""
        found = [best for best in (self.best, other.best) if best is not None]
        return GroupSummary(
            self.scenarios + other.scenarios,
            self.rows + other.rows,
            self.met + other.met,
            (max if most else min)(found, default=None),
            _added(self.bins, other.bins),
        )


def _added(first: Mapping[Any, int], second: Mapping[Any, int]) -> dict[Any, int]:
    return {key: first.get(key, 0) + second.get(key, 0) for key in chain(first, second)}


class Reason(NamedTuple):
    """A kind of reason: the number of scenarios with it, and the first of these scenarios."""

    scenarios: int
    row: int
    text: str

    def __add__(self, other: object) -> Reason:
        """The sum of two counts of the same kind of reason."""
        assert isinstance(other, Reason)
        first = min(self, other, key=lambda reason: reason.row)
        return Reason(self.scenarios + other.scenarios, first.row, first.text)


class Summary(NamedTuple):
    """Summary of some scenarios.

    `rows` is the number of rows that meet the sweep's condition.  `statuses` and `reasons` count
    all scenarios, by status and by kind of reason.  `columns` and `groups` are for the kept rows.
    """

    scenarios: int
    rows: int
    statuses: dict[str, int]
    reasons: dict[tuple[str, str], Reason]
    columns: dict[str, ResultSummary]
    groups: tuple[tuple[GroupSummary, ...], ...]

    def joined(self, other: Summary, *, most: bool) -> Summary:
        """The summary of the scenarios of both summaries."""
        reasons = dict(self.reasons)
        for kind, reason in other.reasons.items():
            reasons[kind] = reasons[kind] + reason if kind in reasons else reason
        return Summary(
            self.scenarios + other.scenarios,
            self.rows + other.rows,
            _added(self.statuses, other.statuses),
            # A kind that is dropped is preceded by `MOST_REASONS` kinds, here and in all later
            # sums.
            dict(sorted(reasons.items())[:MOST_REASONS]),
            {name: self.columns[name] + other.columns[name] for name in self.columns},
            tuple(
                tuple(a.joined(b, most=most) for a, b in zip(mine, theirs, strict=True))
                for mine, theirs in zip(self.groups, other.groups, strict=True)
            ),
        )

    def state(self) -> list[Any]:
        """The summary as plain values, to be stored in a file."""
        groups = [[[*group[:4], [*group.bins.items()]] for group in parts] for parts in self.groups]
        reasons = [[*kind, *reason] for kind, reason in self.reasons.items()]
        return [self.scenarios, self.rows, self.statuses, reasons, self.columns, groups]

    @classmethod
    def of_state(cls, state: list[Any]) -> Summary:
        """The inverse of `state`."""
        scenarios, rows, statuses, reasons, columns, groups = state
        return cls(
            scenarios,
            rows,
            statuses,
            {(status, kind): Reason(*rest) for status, kind, *rest in reasons},
            {
                name: ResultSummary(count, total, *(tuple(e) if e else None for e in extremes))
                for name, (count, total, *extremes) in columns.items()
            },
            tuple(
                tuple(GroupSummary._make([*rest, dict(bins)]) for *rest, bins in parts)
                for parts in groups
            ),
        )


def empty(grouping: Grouping, results: Sequence[str]) -> Summary:
    """A summary without scenarios, to which other summaries are added."""
    groups = tuple((GroupSummary(),) * groups.size for groups in grouping.groups)
    return Summary(
        0, 0, dict.fromkeys(STATUSES, 0), {}, dict.fromkeys(results, ResultSummary()), groups
    )


def summarised(
    grouping: Grouping,
    results: Sequence[str],
    block: Block,
    frame: pl.DataFrame,
    kept: NDArray[np.intp],
) -> Summary:
    """The summary of one block.

    Parameters
    ----------
    grouping
        Groups of the summary.
    results
        Results to summarise.  They are columns of the frame.
    block, frame
        The scenarios, and one row for each of them.
    kept
        Indices of the rows that meet the sweep's condition.
    """
    status = frame.get_column("status").to_physical().to_numpy()
    counts = np.bincount(status, minlength=len(STATUSES)).tolist()
    met = kept[status[kept] == 0]
    everything = len(met) == block.rows
    columns = {}
    for name in results:
        values = frame.get_column(name).to_numpy()
        columns[name] = _column(values if everything else values[met], met, block.start)
    values = frame.get_column(grouping.objective).to_numpy()
    rated = _rated(values if everything else values[met], met)
    grouped = tuple(
        _grouped(groups, block, kept, met, rated, most=grouping.most) for groups in grouping.groups
    )
    return Summary(
        block.rows,
        len(kept),
        dict(zip(STATUSES, counts, strict=True)),
        _reasons(frame, block.start) if counts[0] < block.rows else {},
        columns,
        grouped,
    )


def _column(values: NDArray[Any], rows: NDArray[np.intp], start: int) -> ResultSummary:
    known = np.isfinite(values)
    if not known.all():
        values, rows = values[known], rows[known]
    if not len(values):
        return ResultSummary()
    least, most = int(values.argmin()), int(values.argmax())
    return ResultSummary(
        len(values),
        exact_sum(values),
        (values[least].item(), start + int(rows[least])),
        (values[most].item(), start + int(rows[most])),
    )


def exact_sum(values: NDArray[Any]) -> int:
    """The exact sum of an array, in units of 2 ** -1074.

    Parameters
    ----------
    values
        At least one finite number.  Absolute values are below 1e280.

    Notes
    -----
    The leading bits of all numbers are summed without rounding error.  The same is done with the
    remainders, until all remainders are zero.  Source: Rump, Ogita and Oishi, "Accurate
    floating-point summation part I", SIAM J.  Sci.  Comput. 31 (2008), algorithm 3.2
    (ExtractVector).
    """
    if values.dtype.kind in "iu":
        # The sums of the upper and lower halves of the integers of a part are below 2 ** 63.
        high, low = values >> 32, values & 0xFFFFFFFF
        return ((int(high.sum()) << 32) + int(low.sum())) << _SMALLEST
    total, rest = 0, values
    # The absolute value of each remainder is at most half a unit in the last place of `around`.
    room = 2.0 ** (len(values) + 1).bit_length()
    around = room * 2.0 ** math.frexp(max(float(values.max()), -float(values.min())))[1]
    while rest.any():
        leading = (rest + around) - around
        total += _whole(float(leading.sum()))
        rest = rest - leading
        around = max(around * room * 2.0**-53, 2.0**-1022)
    return total


def _whole(value: float) -> int:
    above, below = value.as_integer_ratio()
    return (above << _SMALLEST) // below


class _Rated(NamedTuple):
    """Values of the objective, their rows, and indices of their bins in `distinct`."""

    values: NDArray[np.float64]
    rows: NDArray[np.intp]
    bins: NDArray[np.int64]
    distinct: NDArray[np.int64]


def _rated(values: NDArray[Any], rows: NDArray[np.intp]) -> _Rated:
    values = values.astype(np.float64)
    known = np.isfinite(values)
    if not known.all():
        values, rows = values[known], rows[known]
    bins = bins_of(values)
    low, high = (int(bins.min()), int(bins.max())) if len(bins) else (0, 0)
    if high - low < MOST_BINS:
        return _Rated(values, rows, bins - low, np.arange(low, high + 1))
    distinct, places = np.unique(bins, return_inverse=True)
    return _Rated(values, rows, places, distinct)


def _grouped(
    groups: InputGroups,
    block: Block,
    kept: NDArray[np.intp],
    met: NDArray[np.intp],
    rated: _Rated,
    *,
    most: bool,
) -> tuple[GroupSummary, ...]:
    """The groups of one input, for one block."""
    places = np.broadcast_to(groups.places(block.columns[groups.name]), block.shape).reshape(-1)
    everything = np.bincount(places, minlength=groups.size)
    counts = [
        (
            everything
            if len(part) == block.rows
            else np.bincount(places[part], minlength=groups.size)
        )
        for part in (kept, met)
    ]
    own = places if len(rated.rows) == block.rows else places[rated.rows]
    size = len(rated.distinct)
    table = np.bincount(own * size + rated.bins, minlength=groups.size * size)
    table = table.reshape(groups.size, size)
    # Bins are in the order of their values. The best value is therefore in the last or in the first
    # occupied bin.
    last = size - 1 - (table[:, ::-1] > 0).argmax(axis=1) if most else (table > 0).argmax(axis=1)
    nearest = np.flatnonzero(rated.bins == last[own])
    best = np.full(groups.size, -math.inf if most else math.inf)
    (np.maximum if most else np.minimum).at(best, own[nearest], rated.values[nearest])
    found = []
    for place, row in enumerate(table):
        filled = np.flatnonzero(row)
        bins = dict(zip(rated.distinct[filled].tolist(), row[filled].tolist(), strict=True))
        numbers = [int(part[place]) for part in (everything, *counts)]
        found.append(GroupSummary._make([*numbers, best[place].item() if bins else None, bins]))
    return tuple(found)


def bins_of(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Bin of each number.

    The bin consists of the sign, the exponent and the first `BITS` bits of the fraction.  Bins have
    the same order as the numbers.
    """
    bits = (values + 0.0).view(np.int64)
    magnitude = (bits & np.int64(2**63 - 1)) >> (52 - BITS)
    return np.where(bits < 0, -magnitude, magnitude)


def value_of(at: int, *, whole: bool) -> float:
    """The middle of a bin.  For whole numbers, it is rounded down."""
    edges = np.array([abs(at), abs(at) + 1], dtype=np.int64) << (52 - BITS)
    low, high = edges.view(np.float64).tolist()
    middle = math.copysign(low + (high - low) / 2.0, at) if at else 0.0
    return math.floor(middle) if whole else middle


def _reasons(frame: pl.DataFrame, start: int) -> dict[tuple[str, str], Reason]:
    pl = polars()
    unmet = frame.with_row_index("_row").filter(pl.col("reason").is_not_null())
    found: dict[tuple[str, str], Reason] = {}
    table = unmet.group_by("status", "reason").agg(pl.len(), pl.col("_row").min())
    for status, text, count, row in table.iter_rows():
        kind = (status, _NUMBER.sub("#", text))
        reason = Reason(count, start + row, text)
        found[kind] = found[kind] + reason if kind in found else reason
    return dict(sorted(found.items())[:MOST_REASONS])


def summary_document(
    summary: Summary, grouping: Grouping, scenarios: ScenarioProduct | ScenarioTable
) -> dict[str, Any]:
    """A summary as plain values, with rows counted from 1 and described by their inputs."""

    def named(row: int) -> dict[str, Any]:
        return {"row": row + 1, "request": scenario(scenarios, row)}

    def extreme(name: str, found: Extreme | None) -> dict[str, Any] | None:
        return {"value": _own(name, found[0]), **named(found[1])} if found else None

    told = sum(reason.scenarios for reason in summary.reasons.values())
    unmet = sum(count for status, count in summary.statuses.items() if status != "ok")
    return {
        "scenarios": summary.scenarios,
        "rows": summary.rows,
        "statuses": summary.statuses,
        "reasons": [
            {"status": status, "reason": kind, "count": reason.scenarios}
            | {"first": {"reason": reason.text, **named(reason.row)}}
            for (status, kind), reason in sorted(
                summary.reasons.items(), key=lambda item: (-item[1].scenarios, item[0])
            )
        ],
        "other_reasons": unmet - told,
        "results": {
            name: {
                "count": column.known,
                "mean": column.mean,
                "minimum": extreme(name, column.least),
                "maximum": extreme(name, column.most),
            }
            for name, column in summary.columns.items()
        },
        "objective": {
            "column": grouping.objective,
            "best": "most" if grouping.most else "least",
            "median_error": MEDIAN_ERROR,
        },
        "inputs": [
            {"name": groups.name, "groups": list(_shown(groups, parts, grouping))}
            for groups, parts in zip(grouping.groups, summary.groups, strict=True)
        ],
        "fixed": dict(grouping.fixed),
    }


def _shown(
    groups: InputGroups, parts: Sequence[GroupSummary], grouping: Grouping
) -> Iterable[dict[str, Any]]:
    for label, group in zip(groups.labels(), parts, strict=True):
        if group.scenarios:
            yield label | {
                "scenarios": group.scenarios,
                "rows": group.rows,
                "met": group.met,
                "met_share": group.met / group.rows if group.rows else None,
                "best": _own(grouping.objective, group.best),
                "approximate_median": _median(group.bins, whole=grouping.objective in WHOLE),
            }


def _own(name: str, value: float | None) -> float | None:
    """A value in the type of its result; columns with missing values store integers as floats."""
    return int(value) if value is not None and name in WHOLE else value


def _median(bins: Mapping[int, int], *, whole: bool) -> float | None:
    """The median; for an even number of values, the lower of the two middle values."""
    left = (sum(bins.values()) + 1) // 2
    for at, count in sorted(bins.items()):
        left -= count
        if left <= 0:
            return value_of(at, whole=whole)
    return None


class Aggregates(NamedTuple):
    """The summary and the drawn sample of some parts."""

    summary: Summary
    draw: RowSample

    def state(self) -> list[Any]:
        """Summary and sample as plain values, to be stored in a file."""
        return [self.summary.state(), self.draw.state()]

    @classmethod
    def of_state(cls, state: list[Any]) -> Aggregates:
        """The inverse of `state`."""
        return cls(Summary.of_state(state[0]), RowSample.of_state(state[1]))


class AggregationPlan(NamedTuple):
    """The aggregates to compute: a summary and, if requested, a sample of rows to simulate."""

    grouping: Grouping
    drawing: SamplingPlan | None = None

    def nothing(self, results: Sequence[str]) -> Aggregates:
        """The aggregates of no part."""
        return Aggregates(empty(self.grouping, results), RowSample())

    def of(
        self,
        results: Sequence[str],
        block: Block,
        frame: pl.DataFrame,
        kept: NDArray[np.intp],
    ) -> Aggregates:
        """The aggregates of one part: a block, one row per scenario, and indices of kept rows."""
        return Aggregates(
            summarised(self.grouping, results, block, frame, kept),
            RowSample() if self.drawing is None else draw_rows(self.drawing, block, frame, kept),
        )

    def joined(self, first: Aggregates, second: Aggregates) -> Aggregates:
        """The aggregates of the parts of both arguments."""
        rows = 0 if self.drawing is None else self.drawing.rows
        return Aggregates(
            first.summary.joined(second.summary, most=self.grouping.most),
            first.draw.joined(second.draw, rows=rows),
        )
