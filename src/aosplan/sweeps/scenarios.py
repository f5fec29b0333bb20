"""Scenarios of a sweep: all combinations of lists and ranges (a *crossing*), or the rows of a
table.

Both are divided into blocks. A block consists of columns of parsed option values, which broadcast
against each other. Each column of a crossing has its own axis. A quantity that depends on few
options is therefore computed only a few times.
"""

from __future__ import annotations

import csv
import io
import math
import os
import sys
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.errors import RequestError, SurroundingsError, needs_extra
from aosplan.files import decoding, read_bytes, read_start, read_table, text_of
from aosplan.planning.options import BY_NAME, GUIDED
from aosplan.sweeps.block import Block
from aosplan.units import nearest_hint, number, shown, whole

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

ROWS_A_BLOCK = 1 << 18
"""Number of scenarios that are evaluated and written at once. They need tens of megabytes of
memory.
"""

ROWS_ALONE = 1 << 10
"""Number of scenarios of a block in which all scenarios are solved one by one. An interruption
loses the work on at most one block, and a worker gets one block at a time.
"""

SPREADSHEETS = (".xlsx", ".xlsm", ".xls", ".ods")

MOST_HEADER = 1 << 16
"""Longest header of a CSV file [bytes].  A header with all options needs 2 % of this."""

ROOM_OCTETS, THREAD_OCTETS = 1_250_000_000, 50_000_000
"""Address space that polars reserves for a block, and in addition for each thread [bytes]."""

PLAIN_CELLS = 2_000_000
"""A Parquet file may have this number of cells, whatever its size."""

CELLS_A_BYTE = 100
"""Parquet files with more cells may have at most this number of cells per byte."""

MOST_VALUES = 10_000_000
"""Largest number of values of a range or list."""


def _parsed(name: str, value: Any, place: str) -> Any:
    """A value of an option, parsed as in `plan`.  Values that request a search for the best flight
    in a given time are refused.
    """
    found = BY_NAME[name].parse(value, place)
    if (name, found) == ("grid", GUIDED):
        raise RequestError(
            f"{place} guided is not possible, because a sweep does not choose positions for one place",
            "use aosplan plan --grid guided for a single request",
        )
    if (
        name == "within"
        or (name, found) in _SEARCHED
        or (name == "altitude" and isinstance(found, str))
    ):
        raise RequestError(
            f"{place} {shown(value)} is not possible, because a sweep cannot search for plans within "
            "a time",
            "use aosplan plan --within for a single request; a sweep with find computes the "
            "probability of detection of each row",
        )
    return found


_SEARCHED = (("optimize", "detection"), ("trigger", "best"))
"""Options and values that request a search for the best flight in a given time."""


@dataclass(frozen=True)
class _Scenarios:
    """The swept options with their values.

    `alone` is the share of the scenarios that have to be solved one by one. The larger this share
    is, the smaller the blocks are.
    """

    values: dict[str, NDArray[Any]]
    alone: float = 0.0

    @property
    def names(self) -> list[str]:
        """The options that are swept, in order."""
        return list(self.values)

    @cached_property
    def _kinds(self) -> dict[str, frozenset[type]]:
        return _kinds(self.values)


class ScenarioProduct(_Scenarios):
    """All combinations of the values of the axes.  The last axis varies fastest."""

    @property
    def rows(self) -> int:
        """Number of scenarios."""
        return math.prod(len(axis) for axis in self.values.values())

    @cached_property
    def _steps(self) -> list[int]:
        """Number of values of each axis in a block.  It is 1 for the first axes, a part of the
        values for one axis, and all values for the last axes.
        """
        steps, room = [], _room(self.alone)
        for axis in reversed(self.values.values()):
            steps.append(min(len(axis), room))
            room = max(room // len(axis), 1)
        return steps[::-1]

    @cached_property
    def _cuts(self) -> tuple[int, ...]:
        """Number of blocks along each axis."""
        sizes = [len(axis) for axis in self.values.values()]
        return tuple(-(-size // step) for size, step in zip(sizes, self._steps, strict=True))

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return math.prod(self._cuts)

    def block(self, index: int) -> Block:
        """The block with an index.  Together, the blocks contain each scenario once, in order."""
        columns, shape, start = {}, [], 0
        for axis, (name, values) in enumerate(self.values.items()):
            index_along = index // math.prod(self._cuts[axis + 1 :]) % self._cuts[axis]
            low = index_along * self._steps[axis]
            part = values[low : low + self._steps[axis]]
            start = start * len(values) + low
            shape.append(len(part))
            columns[name] = part.reshape(
                [-1 if at == axis else 1 for at in range(len(self.values))]
            )
        return Block(start, tuple(shape), columns, self._kinds)


class ScenarioTable(_Scenarios):
    """One scenario per row.  The columns have equal length.  If a row does not give an option, its
    value is None.
    """

    @property
    def rows(self) -> int:
        """Number of scenarios."""
        return len(next(iter(self.values.values())))

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return -(-self.rows // _room(self.alone))

    def block(self, index: int) -> Block:
        """The block with an index."""
        room = _room(self.alone)
        start = index * room
        part = slice(start, min(start + room, self.rows))
        columns = {name: values[part] for name, values in self.values.items()}
        return Block(start, (part.stop - start,), columns, self._kinds)


@dataclass(frozen=True)
class SingleBlock(ScenarioTable):
    """Scenarios of which only a single block is known."""

    only: Block = field(kw_only=True)

    def block(self, index: int) -> Block:  # noqa: ARG002 (there is one)
        """The only block."""
        return self.only


def _kinds(columns: Mapping[str, NDArray[Any]]) -> dict[str, frozenset[type]]:
    """For each column of objects, the types of its values other than None."""
    return {
        name: frozenset(map(type, column.flat)) - {type(None)}
        for name, column in columns.items()
        if column.dtype == object
    }


def _room(alone: float) -> int:
    """Number of scenarios of a block.  It depends on the share of scenarios that are solved one by
    one.
    """
    room = ROWS_A_BLOCK if alone * ROWS_A_BLOCK <= ROWS_ALONE else round(ROWS_ALONE / alone)
    return min(room, ROWS_A_BLOCK)


def read_crossing(path: str) -> ScenarioProduct:
    """Read the crossing in a TOML or JSON file: the entries of its table ``sweep``, in the order of
    the file.

    Each entry is a value, a list of values, a range
    ``{ start, stop, count, spacing = "linear" or "log" }``, or a file with one value per line,
    ``{ file = "altitudes.txt" }``.

    Raises
    ------
    RequestError
        If a name is unknown, if a value is not valid, or if an axis has no values.  The message
        gives the place.
    """
    table = read_table(path)
    sweep = table.get("sweep")
    if not isinstance(sweep, dict):
        raise RequestError(
            f"'{path}' has no table [sweep]", "the keys of this table are options of `plan`"
        )
    return crossing_of(sweep, f"'{path}': ", os.path.dirname(path))


def crossing_of(sweep: Mapping[str, Any], where: str = "", folder: str = "") -> ScenarioProduct:
    """The crossing of options, given by name in the format of `read_crossing`.

    Parameters
    ----------
    sweep
        The values of each option.
    where
        Prefix of messages.
    folder
        Folder in which files of values and of scenes are looked for.
    """
    if not sweep:
        raise RequestError(f"{where}[sweep] is empty, so there are no scenarios")
    axes = {}
    for name, given in sweep.items():
        place = f"{where}{name}"
        if name not in BY_NAME:
            raise RequestError(f"{where}unknown name '{name}'", nearest_hint(name, BY_NAME))
        values = _values(given, place, folder, pair=BY_NAME[name].kind == "pair")
        if not values:
            raise RequestError(f"{place} has no values, so there are no scenarios")
        axes[name] = column_of([_parsed(name, value, place) for value in values])
    return ScenarioProduct(axes, share_alone(axes, folder))


def read_scenarios(path: str) -> ScenarioProduct | ScenarioTable:
    """Read the scenarios of a file: a table (``.csv``, ``.parquet``), or a crossing."""
    suffix = os.path.splitext(path)[1].lower()
    if suffix in SPREADSHEETS:
        raise RequestError(f"'{path}' is a spreadsheet", "save its table as CSV or Parquet")
    return read_rows(path) if suffix in (".csv", ".parquet") else read_crossing(path)


def read_rows(path: str) -> ScenarioTable:
    """Read the scenarios of a CSV or Parquet file, one per row.  An empty cell means that an option
    is not given.

    Raises
    ------
    RequestError
        If a column is not an option, or if a cell is not a valid value of it.  The message gives
        row and column.
    """
    pl = polars()
    as_text = path.lower().endswith(".csv")
    _check_start(path, as_text=as_text)
    with decoding("table of scenarios", path):
        # Brackets in a file name are escaped, because polars would read them as a pattern.
        if as_text:
            wide = read_start(path, 2) in (b"\xff\xfe", b"\xfe\xff")
            source = io.BytesIO(text_of(read_bytes(path), path).encode()) if wide else path
            frame = _without_blanks(pl.read_csv(source, infer_schema=False, glob=False))
        else:
            _check_size(pl.scan_parquet(path, glob=False), path)
            frame = pl.read_parquet(path, glob=False)
    if not frame.height or not frame.width:
        raise RequestError(f"'{path}' has no rows, so there are no scenarios")
    _check_names(frame.columns, path)
    values = {name: _parsed_column(frame, name, path) for name in frame.columns}
    return ScenarioTable(values, share_alone(values, os.path.dirname(path)))


def share_alone(values: Mapping[str, NDArray[Any]], folder: str) -> float:
    """Approximate share of the scenarios that the vectorized solver cannot solve."""
    from aosplan.sweeps.vectorized.inputs import known_share

    shares = (known_share(name, column, folder) for name, column in values.items())
    return 1.0 - math.prod(shares)


def _check_start(path: str, *, as_text: bool) -> None:
    """Check the first bytes and refuse files that are not tables, before a library reads them."""
    start = read_start(path, MOST_HEADER)
    if start.startswith(b"PK\x03\x04"):
        raise RequestError(f"'{path}' is a spreadsheet", "save its table as CSV or Parquet")
    if not as_text:
        return
    wide = start.startswith((b"\xff\xfe", b"\xfe\xff"))
    text = start.decode("utf-16" if wide else "utf-8-sig", errors="replace")
    line = text.partition("\n")[0].rstrip("\r")
    if len(start) == MOST_HEADER and "\n" not in start.decode("latin-1"):
        raise RequestError(f"'{path}': its header is longer than {MOST_HEADER} bytes")
    header = next(csv.reader([line]), [])
    while len(header) > 1 and not header[-1].strip():
        header.pop()  # A comma at the end of the header gives an empty last column.
    for other, title in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and other in line:
            raise RequestError(
                f"'{path}': its columns are separated by {title}",
                "save it with commas between columns, and with decimal points in numbers",
            )
    _check_names(header, path)


def _without_blanks(frame: Any) -> Any:
    """A table without the empty rows and trailing columns that spreadsheets add."""
    pl = polars()
    blank = pl.all().is_null() | (pl.all().str.strip_chars() == "")
    frame = frame.filter(~pl.all_horizontal(blank))
    names = list(frame.columns)
    while len(names) > 1 and (not names[-1].strip() or names[-1].startswith("_duplicated_")):
        if not frame.select(pl.col(names[-1]).fill_null("").str.strip_chars().eq("").all()).item():
            break
        names.pop()
    return frame.select(names)


def _check_size(frame: Any, path: str) -> None:
    """Refuse a Parquet file with too many cells for its size.

    Parquet stores long runs of one value in a few bytes. A small file can therefore have very many
    cells.
    """
    columns = len(frame.collect_schema())
    rows = frame.select(polars().len()).collect().item()
    stored = os.path.getsize(path)
    if rows * columns > max(PLAIN_CELLS, CELLS_A_BYTE * stored):
        raise RequestError(
            f"'{path}' declares {rows} rows, more than its {stored} bytes can hold",
            "write the options as lists in a TOML file with a table [sweep], which takes "
            "less space",
        )


def _check_names(names: Sequence[str], path: str) -> None:
    """Refuse columns that are not options, or that occur twice."""
    for place, name in enumerate(names):
        if name not in BY_NAME:
            hint = nearest_hint(name, BY_NAME) or (
                "`aosplan plan --help-all` lists the options; write underscores instead of hyphens"
            )
            if name.startswith("__index_level_"):
                hint = (
                    "this column is the index of pandas; write the file with "
                    "to_parquet(index=False)"
                )
            raise RequestError(f"'{path}': column {shown(name)} is not an option of plan", hint)
        if name in names[:place]:
            raise RequestError(f"'{path}' has two columns '{name}'", "give only one of them")


def _parsed_column(frame: Any, name: str, path: str) -> NDArray[Any]:
    """The parsed values of a column.  Each distinct value is parsed once."""
    series = frame.get_column(name)
    # Lists, such as a location, are converted to the text that a CSV file would have.
    if series.dtype.is_nested():
        series = series.map_elements(_cell, return_dtype=polars().String)
    distinct = series.unique(maintain_order=True)
    parsed: list[Any] = []
    for value in distinct.to_list():
        if value is None or value == "":
            parsed.append(None)
            continue
        try:
            parsed.append(_parsed(name, value, f"'{path}', column '{name}':"))
        except RequestError as error:
            row = series.eq_missing(value).arg_max() + 1
            raise RequestError(f"{error.message} (row {row})", error.hint) from None
    places = series.replace_strict(distinct, list(range(len(parsed))), return_dtype=polars().UInt32)
    column: NDArray[Any] = column_of(parsed)[places.to_numpy()]
    return column


def _cell(value: Any) -> str:
    plain = value.to_list() if hasattr(value, "to_list") else value
    return ",".join(map(str, plain)) if isinstance(plain, list) else str(plain)


def _values(given: Any, place: str, folder: str, *, pair: bool) -> list[Any]:
    if isinstance(given, dict):
        return _range(given, place, folder)
    if isinstance(given, list) and not (pair and given and isinstance(given[0], (int, float))):
        return given
    return [given]


def _range(given: Mapping[str, Any], place: str, folder: str) -> list[Any]:
    known = {"file"} if "file" in given else {"start", "stop", "count", "spacing"}
    for name in given:
        if name not in known:
            raise RequestError(f"{place}: unknown name '{name}'", nearest_hint(name, known))
    if "file" in given:
        return _lines(os.path.join(folder, str(given["file"])))
    for name in ("start", "stop", "count"):
        if name not in given:
            raise RequestError(
                f"{place}: a range lacks {name}", "{ start = 20, stop = 120, count = 50 }"
            )
    start, stop = (number(given[name], f"{place}.{name}") for name in ("start", "stop"))
    count = whole(given["count"], f"{place}.count")
    if count > MOST_VALUES:
        raise RequestError(f"{place}.count {count} is more than {MOST_VALUES}")
    spacing = given.get("spacing", "linear")
    if spacing == "linear":
        return [float(value) for value in np.linspace(start, stop, count)]
    if spacing != "log":
        raise RequestError(f"{place}.spacing {shown(spacing)} is neither linear nor log")
    if start <= 0.0 or stop <= 0.0:
        raise RequestError(
            f"{place}: a logarithmic range from {start:g} to {stop:g} is not possible"
        )
    values = np.geomspace(start, stop, count)
    return [float(value) for value in values]


def polars() -> Any:
    """The library polars.

    Raises
    ------
    MissingExtraError
        If polars is not installed.
    SurroundingsError
        If a memory limit is too low for polars.  Without this check, the process would end without
        a message.
    """
    if "polars" not in sys.modules:
        _check_room()
    with needs_extra("a sweep", "sweep"):
        import polars as pl
    return pl


def _check_room() -> None:
    """Refuse to start if a memory limit (``ulimit -v``) leaves too little address space."""
    try:
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        with open("/proc/self/statm", encoding="ascii") as file:
            used = int(file.read().split()[0]) * resource.getpagesize()
    except (ImportError, AttributeError, OSError):  # Only Linux tells the program this limit.
        return
    needed = ROOM_OCTETS + THREAD_OCTETS * (os.cpu_count() or 1)
    if limit != resource.RLIM_INFINITY and limit - used < needed:
        raise SurroundingsError(
            "not enough memory for a sweep: the limit leaves "
            f"{max(limit - used, 0) // 10**6} MB of address space, but a sweep needs "
            f"{needed // 10**6} MB",
            "give a higher limit with ulimit -v",
        )


def _lines(path: str) -> list[str]:
    from aosplan.files import read_bytes

    text = read_bytes(path).decode("utf-8-sig", errors="replace")
    return [line.strip() for line in text.splitlines() if line.strip()]


def column_of(values: Sequence[Any]) -> NDArray[Any]:
    """Values as an array.  Floats and integers are stored as numbers, and all other values as
    objects.
    """
    if all(type(value) is int for value in values):
        return np.array(values, dtype=np.int64)
    if all(isinstance(value, float) for value in values):
        return np.array(values, dtype=np.float64)
    column = np.empty(len(values), dtype=object)
    column[:] = values
    return column
