"""Blocks of scenarios as data frames: inputs, results, status and reason."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.errors import RequestError
from aosplan.sweeps.block import STATUSES, Block
from aosplan.sweeps.scenarios import column_of, polars
from aosplan.sweeps.solve_rows import DETECTION, RESULTS, WHOLE, forget_scenes, solve_rows
from aosplan.sweeps.vectorized import inputs
from aosplan.sweeps.vectorized.solve_columns import solve_columns
from aosplan.units import nearest_hint

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import polars as pl
    from numpy.typing import NDArray

USUAL = (
    "baseline_m",
    "samples",
    "aperture_m",
    "visibility_density",
    "visibility_expected",
    "visibility_normalized",
    "visibility_contrast",
    "camera_gsd_m",
    "flight_length_m",
    "flight_time_s",
)
"""Results that are written by default."""


def input_column(name: str) -> str:
    """Name of the column of an option.  It is the name of the option, unless a result has the same
    name.
    """
    return f"request_{name}" if name in RESULTS else name


def chosen_results(text: str | None, *, finds: bool = False) -> tuple[str, ...]:
    """The results that a text names: the default results, ``all``, or a list with commas.

    For sweeps that search for a target (`finds`), the default and ``all`` include the detection.

    Raises
    ------
    RequestError
        If a name is unknown.
    """
    if text is None:
        return USUAL + DETECTION * finds
    if text == "all":
        return RESULTS + DETECTION * finds
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    for name in names:
        known = RESULTS + DETECTION
        if name not in known:
            raise RequestError(f"--columns: unknown result '{name}'", nearest_hint(name, known))
    return names


def solve_block(
    block: Block, names: Sequence[str], results: Sequence[str], folder: str = ""
) -> pl.DataFrame:
    """Solve the scenarios of a block.  The frame has one row per scenario, in order.

    Parameters
    ----------
    block
        The scenarios.
    names
        Options to include.  They are columns of the block.
    results
        Names of the results to include, from `RESULTS` and `DETECTION`.
    folder
        Folder in which the files of the scenarios are looked for first.
    """
    pl = polars()
    numbers = {name: np.full(block.rows, np.nan) for name in results}
    status = np.zeros(block.rows, dtype=np.uint8)
    reason = np.full(block.rows, -1, dtype=np.int32)
    texts: list[str] = []
    for part, places in _alike(block):
        solved = solve_columns(part, folder, results)
        left: NDArray[np.intp]
        if solved is None:
            left = np.arange(part.rows)
        else:
            left = np.flatnonzero(solved.left)
            statuses, at = solved.statuses, slice(None) if places is None else places
            status[at] = statuses.status.reshape(-1)
            reason[at] = _moved(statuses.reason.reshape(-1), len(texts))
            texts += statuses.texts
            holds = solved.holds.reshape(-1)
            whole = places is None and holds.all()
            for name in solved.columns.keys() & set(results):
                column = np.broadcast_to(solved.columns[name], part.shape).reshape(-1)
                if whole:
                    numbers[name] = column
                else:
                    rows = np.flatnonzero(holds)
                    numbers[name][rows if places is None else places[rows]] = column[rows]
        for row, (state, why, found) in zip(
            left.tolist(), solve_rows(part, left, folder, results), strict=True
        ):
            place = row if places is None else int(places[row])
            status[place] = STATUSES.index(state)
            if why:
                reason[place] = len(texts)
                texts.append(why)
            for name in results:
                numbers[name][place] = found.get(name, np.nan)
    columns = [
        _input(pl, input_column(name), block.flat(name), block.kinds.get(name)) for name in names
    ]
    columns += [_result(pl, name, numbers[name]) for name in results]
    columns.append(_status(pl, status))
    columns.append(_reason(pl, reason, texts))
    return pl.DataFrame(columns)  # type: ignore[no-any-return]


def forget_files() -> None:
    """Clear stored content of files, because files may change while this process runs."""
    forget_scenes()
    inputs.forget_files()


def _moved(reason: NDArray[np.int32], by: int) -> NDArray[np.int32]:
    return np.where(reason < 0, reason, reason + by) if by else reason


def _status(pl: Any, status: NDArray[np.uint8]) -> Any:
    kinds = pl.Series(list(STATUSES), dtype=pl.Enum(list(STATUSES)))
    if status.any():
        return kinds.gather(status).alias("status")
    return pl.repeat(STATUSES[0], len(status), dtype=kinds.dtype, eager=True).alias("status")


def _reason(pl: Any, reason: NDArray[np.int32], texts: list[str]) -> Any:
    """The reason of each row from its index in `texts`; null if there is no reason."""
    if not texts:
        return pl.repeat(None, len(reason), dtype=pl.String, eager=True).alias("reason")
    told = pl.Series("reason", [*texts, None], dtype=pl.String)
    return told.gather(np.where(reason < 0, len(texts), reason))


def _alike(block: Block) -> Iterator[tuple[Block, NDArray[np.intp] | None]]:
    """Split a block into parts. The rows of a part give values for the same options. Each part has
    the indices of its rows; None means all rows.
    """
    holes = {
        name: np.array([value is None for value in column.flat])
        for name, column in block.columns.items()
        if column.dtype == object
    }
    holes = {name: hole for name, hole in holes.items() if hole.any()}
    if not holes:
        # If a column of numbers has missing values in other blocks, its type is object in this
        # block too.
        columns = {name: _narrowed(column) for name, column in block.columns.items()}
        yield block._replace(columns=columns), None
        return
    # Only tables have missing values, and their blocks have a single axis.
    patterns, places = np.unique(np.stack(list(holes.values())), axis=1, return_inverse=True)
    for index, pattern in enumerate(patterns.T):
        rows = np.flatnonzero(places.reshape(-1) == index)
        left_out = {name for name, missing in zip(holes, pattern, strict=True) if missing}
        columns = {
            name: _narrowed(column[rows])
            for name, column in block.columns.items()
            if name not in left_out
        }
        yield Block(block.start, (len(rows),), columns), rows


def _narrowed(column: NDArray[Any]) -> NDArray[Any]:
    if column.dtype != object:
        return column
    return column_of(list(column.flat)).reshape(column.shape)


def _input(pl: Any, name: str, values: NDArray[Any], kinds: frozenset[type] | None) -> Any:
    if values.dtype != object:
        return pl.Series(name, values)
    if kinds is None:
        kinds = frozenset(map(type, values.flat)) - {type(None)}
    if kinds <= {int, float}:
        return pl.Series(name, values.tolist(), dtype=pl.Float64 if float in kinds else pl.Int64)
    return pl.Series(name, [_text(value) for value in values.tolist()], dtype=pl.String)


def _text(value: Any) -> str | None:
    if value is None or isinstance(value, str):
        return value
    return ",".join(map(repr, value)) if isinstance(value, tuple) else repr(value)


def _result(pl: Any, name: str, values: NDArray[Any]) -> Any:
    if name in WHOLE:
        if values.dtype == np.int64:
            return pl.Series(name, values)
        return pl.Series(name, values, nan_to_null=True).cast(pl.Int64)
    return pl.Series(name, np.asarray(values, dtype=np.float64), nan_to_null=True)
