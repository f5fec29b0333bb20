"""A sweep: its scenarios, its results, and conditions that select the rows to keep."""

from __future__ import annotations

import hashlib
import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan import __version__
from aosplan.errors import RequestError
from aosplan.sweeps.input_files import checksums
from aosplan.sweeps.scenarios import polars
from aosplan.sweeps.solve_block import forget_files, input_column, solve_block
from aosplan.units import nearest_hint

if TYPE_CHECKING:
    import polars as pl
    from numpy.typing import NDArray

    from aosplan.sweeps.scenarios import ScenarioProduct, ScenarioTable
    from aosplan.sweeps.summary import Aggregates, AggregationPlan


SUFFIXES = (".csv", ".parquet", ".jsonl")
"""Extensions of result files."""

OF_SEVERAL_ROWS = re.compile(
    r"\b(?:over\b|(?:array_agg|avg|corr|count|covar\w*|dense_rank|first|first_value|group_concat|"
    r"lag|last|last_value|lead|listagg|max|median|min|quantile_\w+|rank|row_number|std\w*|string_agg|"
    r"sum|total|var\w*)\s*\()",
    re.IGNORECASE,
)
"""Keywords of polars' SQL whose result depends on other rows."""


class Sweep(NamedTuple):
    """The scenarios of a sweep, and the rows to keep.

    `where` is an SQL condition on the columns of the result. `best` is a column. In each group of
    rows with the same values of `per`, only the row with the largest value of this column is kept.
    If the name starts with a minus, the row with the smallest value is kept.
    """

    scenarios: ScenarioProduct | ScenarioTable
    results: tuple[str, ...]
    folder: str = ""
    where: str | None = None
    best: str | None = None
    per: tuple[str, ...] = ()
    gather: AggregationPlan | None = None

    @property
    def names(self) -> list[str]:
        """Columns of the result."""
        return [*map(input_column, self.scenarios.names), *self.results, "status", "reason"]

    def fingerprint(self) -> str:
        """A checksum of everything on which the rows depend."""
        versions = __version__, np.__version__, polars().__version__
        digest = hashlib.sha256(repr((versions, self[1:])).encode())
        for name, values in self.scenarios.values.items():
            digest.update(f"{name} {values.dtype}".encode())
            told = values.dtype == object
            digest.update(repr(values.tolist()).encode() if told else values.tobytes())
        digest.update(repr(checksums(self.scenarios.values, self.folder)).encode())
        return digest.hexdigest()

    def part(self, index: int) -> tuple[pl.DataFrame, Aggregates | None]:
        """The rows to keep of one block, and its summary."""
        block = self.scenarios.block(index)
        needed = () if self.gather is None else self.gather.grouping.needed
        results = tuple(dict.fromkeys((*self.results, *needed)))
        frame = solve_block(block, self.scenarios.names, results, self.folder)
        if self.gather is None:
            return self.kept(frame), None
        rows = self._rows(frame)
        gathered = self.gather.of(self.results, block, frame, rows)
        shown = frame.select(self.names)
        return self.best_of(shown if len(rows) == frame.height else shown[rows]), gathered

    def kept(self, frame: pl.DataFrame) -> pl.DataFrame:
        """The rows of a frame that meet the conditions, in order."""
        return self.best_of(self._filtered(frame))

    def _rows(self, frame: pl.DataFrame) -> NDArray[np.intp]:
        """Indices of the rows that meet the condition."""
        if self.where is None:
            return np.arange(frame.height)
        rows = self._filtered(frame.with_row_index("_row")).get_column("_row").to_numpy()
        return rows.astype(np.intp)

    def _filtered(self, frame: pl.DataFrame) -> pl.DataFrame:
        """The rows that meet the condition, in order."""
        if self.where is None:
            return frame
        pl = polars()
        try:
            condition = pl.sql_expr(self.where)
            if several := _of_several_rows(self.where):
                raise RequestError(
                    f"--where {self.where}: {several} needs several rows, but the condition "
                    "can use only the values of one row",
                    "--best keeps the row with the largest value of a column; for other "
                    "selections, filter the result",
                )
            return frame.filter(condition)
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
            raise RequestError(
                f"--where {self.where}: {str(error).splitlines()[0]}",
                "give a condition such as 'samples <= 49'; the columns are "
                f"{', '.join(self.names)}",
            ) from None

    def best_of(self, frame: pl.DataFrame) -> pl.DataFrame:
        """The best row of each group, in the order of the rows. If several rows are equally good,
        the first of them is returned.
        """
        if self.best is None:
            return frame
        pl = polars()
        column = self.best.lstrip("-")
        rank = pl.col(column) if self.best.startswith("-") else -pl.col(column)
        ranked = frame.with_row_index("_row").filter(pl.col(column).is_not_null())
        ranked = ranked.sort(rank, "_row")
        first = (
            ranked.unique(list(self.per), keep="first", maintain_order=True)
            if self.per
            else ranked.head(1)
        )
        return first.sort("_row").drop("_row")


def _of_several_rows(where: str) -> str:
    """The first keyword of a condition whose result depends on other rows; empty if there is no
    such keyword.
    """
    code = re.sub(r"'(?:[^']|'')*'|\"(?:[^\"]|\"\")*\"", "''", where)
    found = OF_SEVERAL_ROWS.search(code)
    return "" if found is None else found[0].rstrip("( \t\n").upper()


def check(sweep: Sweep) -> None:
    """Refuse conditions on columns that the result does not have, and clear stored content of
    files.

    Raises
    ------
    RequestError
        If `best` or `per` names an unknown column, `best` names a text column, or `where` is not
        a valid condition.
    """
    named = [("--best", sweep.best.lstrip("-"))] if sweep.best else []
    for option, name in named + [("--per", name) for name in sweep.per]:
        if name not in sweep.names:
            raise RequestError(
                f"{option} names '{name}', which is not a column of the result",
                nearest_hint(name, sweep.names) or f"columns: {', '.join(sweep.names)}",
            )
    forget_files()
    schema = dict(solve_first(sweep).schema)
    if sweep.best and not schema[sweep.best.lstrip("-")].is_numeric():
        raise RequestError(
            f"--best {sweep.best}: '{sweep.best.lstrip('-')}' contains text, so it has no maximum",
            f"give --best with a column of numbers, such as {sweep.results[0]}"
            if sweep.results
            else "",
        )
    sweep.kept(polars().DataFrame(schema=schema))


def solve_first(sweep: Sweep) -> pl.DataFrame:
    """Solve only the first scenario, to find the columns of the result."""
    block = sweep.scenarios.block(0)
    columns = {
        name: column[tuple(slice(1) for _ in column.shape)]
        for name, column in block.columns.items()
    }
    single = block._replace(columns=columns, shape=(1,) * len(block.shape))
    return solve_block(single, sweep.scenarios.names, sweep.results, sweep.folder)
