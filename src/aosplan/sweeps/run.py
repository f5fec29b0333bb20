"""A sweep to a file, part by part: resumable, and the same bytes however it was run.

Each block of scenarios becomes a part (`aosplan.sweeps.parts`).  When all are there they are joined,
or are the result themselves (`aosplan.sweeps.parquet_folder`).  They depend on nothing but the sweep, so
neither interruptions nor workers, of this machine or of a cluster (`aosplan.sweeps.cluster`), change
the result.
"""

from __future__ import annotations

import contextlib
import hashlib
import re
import signal
import sys
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from multiprocessing import active_children, get_context
from threading import current_thread, main_thread
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan import __version__
from aosplan.errors import AosplanError, RequestError, SurroundingsError
from aosplan.sweeps.aggregate import (
    kept,
    start_gathering,
)
from aosplan.sweeps.block_frame import (
    forget_files,
    input_column,
    solve_block,
)
from aosplan.sweeps.input_files import checksums
from aosplan.sweeps.parquet_folder import (
    Partitions,
    is_folder,
)
from aosplan.sweeps.parts import (
    Part,
    Parts,
    write_frame,
)
from aosplan.sweeps.scenarios import polars
from aosplan.units import nearest_hint

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator

    import polars as pl
    from numpy.typing import NDArray

    from aosplan.sweeps.aggregate import (
        Gather,
        Gathered,
        Gathering,
    )
    from aosplan.sweeps.scenarios import (
        Crossing,
        Table,
    )

SUFFIXES = (".csv", ".parquet", ".jsonl")
"""Endings of a result."""

OF_SEVERAL_ROWS = re.compile(
    r"\b(?:over\b|(?:array_agg|avg|corr|count|covar\w*|dense_rank|first|first_value|group_concat|"
    r"lag|last|last_value|lead|listagg|max|median|min|quantile_\w+|rank|row_number|std\w*|string_agg|"
    r"sum|total|var\w*)\s*\()",
    re.IGNORECASE,
)
"""Words of the columnar library's SQL that look at other rows too."""


class Sweep(NamedTuple):
    """What is swept and what is kept of it.

    `where` is an SQL condition on the columns of the result; `best` a column, the largest value of which is kept for each
    group of rows with the same values of `per`; a minus before it keeps the smallest.
    """

    scenarios: Crossing | Table
    results: tuple[str, ...]
    folder: str = ""
    where: str | None = None
    best: str | None = None
    per: tuple[str, ...] = ()
    gather: Gather | None = None

    @property
    def names(self) -> list[str]:
        """Columns of the result."""
        return [*map(input_column, self.scenarios.names), *self.results, "status", "reason"]

    def fingerprint(self) -> str:
        """A text that differs where any row might."""
        versions = __version__, np.__version__, polars().__version__
        digest = hashlib.sha256(repr((versions, self[1:])).encode())
        for name, values in self.scenarios.values.items():
            digest.update(f"{name} {values.dtype}".encode())
            told = values.dtype == object
            digest.update(repr(values.tolist()).encode() if told else values.tobytes())
        digest.update(repr(checksums(self.scenarios.values, self.folder)).encode())
        return digest.hexdigest()

    def part(self, index: int) -> tuple[pl.DataFrame, Gathered | None]:
        """What is kept of one block, and what is gathered from it."""
        block = self.scenarios.block(index)
        needed = () if self.gather is None else self.gather.outline.needed
        results = tuple(dict.fromkeys((*self.results, *needed)))
        frame = solve_block(block, self.scenarios.names, results, self.folder)
        if self.gather is None:
            return self.kept(frame), None
        rows = self._rows(frame)
        gathered = self.gather.of(self.results, block, frame, rows)
        shown = frame.select(self.names)
        return self.best_of(shown if len(rows) == frame.height else shown[rows]), gathered

    def kept(self, frame: pl.DataFrame) -> pl.DataFrame:
        """The rows of a frame that the conditions keep, in order."""
        return self.best_of(self._filtered(frame))

    def _rows(self, frame: pl.DataFrame) -> NDArray[np.intp]:
        """Places of the rows for which the condition holds."""
        if self.where is None:
            return np.arange(frame.height)
        rows = self._filtered(frame.with_row_index("_row")).get_column("_row").to_numpy()
        return rows.astype(np.intp)

    def _filtered(self, frame: pl.DataFrame) -> pl.DataFrame:
        """The rows for which the condition holds, in order."""
        if self.where is None:
            return frame
        pl = polars()
        try:
            condition = pl.sql_expr(self.where)
            if several := _of_several_rows(self.where):
                raise RequestError(
                    f"--where {self.where}: {several} looks at several rows, and the condition is "
                    "asked of each alone",
                    "--best keeps the row with the most of a column; filter the result for the rest",
                )
            return frame.filter(condition)
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
            raise RequestError(
                f"--where {self.where}: {str(error).splitlines()[0]}",
                f"a condition such as 'samples <= 49'; columns: {', '.join(self.names)}",
            ) from None

    def best_of(self, frame: pl.DataFrame) -> pl.DataFrame:
        """The best row of each group, in the order of the rows; of several equal ones the first."""
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
    """The first word of a condition whose answer would change with the rows of a part, or nothing."""
    code = re.sub(r"'(?:[^']|'')*'|\"(?:[^\"]|\"\")*\"", "''", where)
    found = OF_SEVERAL_ROWS.search(code)
    return "" if found is None else found[0].rstrip("( \t\n").upper()


def check(sweep: Sweep) -> None:
    """Refuse conditions on columns that the result does not have, and look at files anew.

    Raises
    ------
    RequestError
        Where `best` or `per` names an unknown column, `best` one of words, or `where` is no
        condition.
    """
    named = [("--best", sweep.best.lstrip("-"))] if sweep.best else []
    for option, name in named + [("--per", name) for name in sweep.per]:
        if name not in sweep.names:
            raise RequestError(
                f"{option} names '{name}', which is no column of the result",
                nearest_hint(name, sweep.names) or f"columns: {', '.join(sweep.names)}",
            )
    forget_files()
    schema = dict(solve_first(sweep).schema)
    if sweep.best and not schema[sweep.best.lstrip("-")].is_numeric():
        raise RequestError(
            f"--best {sweep.best}: '{sweep.best.lstrip('-')}' holds words, of which none is the most",
            f"--best with a column of numbers, such as {sweep.results[0]}" if sweep.results else "",
        )
    sweep.kept(polars().DataFrame(schema=schema))


def solve_first(sweep: Sweep) -> pl.DataFrame:
    """The first scenario alone, for its columns."""
    block = sweep.scenarios.block(0)
    columns = {
        name: column[tuple(slice(1) for _ in column.shape)]
        for name, column in block.columns.items()
    }
    single = block._replace(columns=columns, shape=(1,) * len(block.shape))
    return solve_block(single, sweep.scenarios.names, sweep.results, sweep.folder)


def run(
    sweep: Sweep,
    out: str,
    *,
    resume: bool = False,
    force: bool = False,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[int, Gathering | None]:
    """Solve every scenario and write what is kept; how many rows, and what was gathered.

    Parameters
    ----------
    sweep
        What to solve.
    out
        The result, a path that ends in one of `SUFFIXES`, or a folder
        (`aosplan.sweeps.parquet_folder.is_folder`).
    resume, force
        Whether to go on with an interrupted run, or to overwrite what is there.
    workers
        Processes; with one, this one.
    scheduler
        Address of a Dask cluster that solves in place of this machine.
    progress
        Called with the number of scenarios done since the last call.

    Raises
    ------
    RequestError
        Where `Parts.start` refuses, or a scenario's file is wrong.
    SurroundingsError
        Where something cannot be written, or a worker dies; what is done stays, for `resume`.
    """
    parts = Partitions(out, sweep) if is_folder(out) else Parts(out, sweep)
    parts.start(resume=resume, force=force)
    gathering = None
    if sweep.gather is not None:
        gathering = start_gathering(
            sweep, f"{out.rstrip('/')}.gathered", resume=resume, force=force
        )
        parts.done = {index: part for index, part in parts.done.items() if index in gathering.done}
    count = sweep.scenarios.blocks
    advance = progress or (lambda _: None)
    advance(sum(sweep.scenarios.block(index).rows for index in parts.done))
    left = (index for index in range(count) if index not in parts.done)
    try:
        if scheduler is None:
            solved = _solved(sweep, parts, left, workers)
        else:
            from aosplan.sweeps.cluster import solved_by

            solved = solved_by(scheduler, sweep, parts, left)
        with contextlib.closing(solved), kept(gathering):
            for part in solved:
                if gathering is not None:
                    gathering.add(part)
                parts.add(part)
                advance(sweep.scenarios.block(part.part).rows)
        parts.put(parts.join(sweep, count), resume=resume, force=force)
    except AosplanError:
        if not parts.done:
            parts.discard()
        raise
    except OSError as error:
        raise SurroundingsError(
            f"cannot write '{error.filename or out}': {(error.strerror or str(error)).lower()}",
            "what is done is kept: make room, then --resume",
        ) from None
    parts.remove()
    return sum(part.rows for part in parts.done.values()), gathering


def gather(
    sweep: Sweep,
    path: str,
    *,
    resume: bool = False,
    force: bool = False,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> Gathering:
    """Solve every scenario and keep no row, only what is gathered on the way.

    Parameters
    ----------
    sweep
        What to solve; it says what to gather.
    path
        File that keeps what was gathered where this is interrupted, or takes long; the caller
        removes it.
    resume, force, workers, progress
        As for `run`.

    Raises
    ------
    RequestError
        Where `Gathering.start` refuses, or a scenario's file is wrong.
    """
    gathering = start_gathering(sweep, path, resume=resume, force=force)
    advance = progress or (lambda _: None)
    advance(sum(sweep.scenarios.block(index).rows for index in gathering.done))
    left = (index for index in range(sweep.scenarios.blocks) if index not in gathering.done)
    with kept(gathering), contextlib.closing(_solved(sweep, None, left, workers)) as solved:
        for part in solved:
            gathering.add(part)
            advance(sweep.scenarios.block(part.part).rows)
    return gathering


def _solved(
    sweep: Sweep, parts: Parts | None, left: Iterable[int], workers: int
) -> Generator[Part]:
    """Solve parts on this machine, write them unless None, and hand them out as they come."""
    _end_waits()

    def path(index: int) -> str | None:
        return None if parts is None else parts.path(index)

    if workers == 1:
        for index in left:
            yield solve_part(sweep, index, path(index))
        return
    waiting = iter(left)
    others = set(active_children())
    # Forked processes would share the locks of the columnar library's threads.
    context = get_context("spawn")
    with (
        contextlib.ExitStack() as afterwards,
        ProcessPoolExecutor(workers, context, _take, (sweep,)) as pool,
    ):
        try:
            with _interrupted_later():  # a half-started process would complain
                running = {
                    pool.submit(_part, index, path(index)) for index in islice(waiting, 2 * workers)
                }
            while running:
                finished, running = wait(running, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield future.result()
                running |= {
                    pool.submit(_part, index, path(index))
                    for index in islice(waiting, len(finished))
                }
        except BaseException as error:
            if parts is not None:
                afterwards.callback(parts.drop_begun)
            pool.shutdown(wait=False, cancel_futures=True)
            for process in set(active_children()) - others:
                process.terminate()  # what it is at is not yet a part
            if isinstance(error, BrokenProcessPool):
                raise SurroundingsError(
                    "a worker process died, perhaps for lack of memory",
                    "what is done is kept: --resume goes on with it, --workers 1 takes the least",
                ) from None
            raise


def _end_waits() -> None:
    if sys.platform != "win32":
        # The columnar library's handler lets waits go on after Ctrl-C; they have to end.
        signal.siginterrupt(signal.SIGINT, True)


@contextlib.contextmanager
def _interrupted_later() -> Iterator[None]:
    """Put Ctrl-C off until the end of the block."""
    heeded = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not heeded or current_thread() is not main_thread():
        yield
        return
    came: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if came:
        raise KeyboardInterrupt


_sweep: Sweep | None = None


def _take(sweep: Sweep) -> None:
    """Keep the sweep of a worker process, which is sent once; Ctrl-C is the first process's."""
    global _sweep  # noqa: PLW0603 (a process of a pool has no other place)
    _sweep = sweep
    polars()  # brings a handler of its own
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _part(index: int, path: str | None) -> Part:
    assert _sweep is not None  # every worker takes it at its start
    return solve_part(_sweep, index, path)


def solve_part(sweep: Sweep, index: int, path: str | None, folder: str | None = None) -> Part:
    """Solve a block and write what is kept of it, in `folder` until it is whole; None: nowhere."""
    frame, gathered = sweep.part(index)
    size, checksum = (0, "") if path is None else write_frame(frame, path, folder)
    return Part(index, frame.height, size, checksum, gathered)
