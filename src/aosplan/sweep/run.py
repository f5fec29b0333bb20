"""A sweep to a file, part by part: resumable, and the same bytes however it was run.

Each block of scenarios becomes a part in a folder beside the result, under its final name only
when it is whole, and a line in the folder's journal.  When all parts are there they are joined, and
the folder goes.  Parts depend on nothing but the sweep, so neither interruptions nor workers
change the result.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from itertools import islice
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan import __version__
from aosplan.errors import RequestError, SurroundingsError
from aosplan.quantities import nearest_hint
from aosplan.sweep.frame import input_column, solve_block
from aosplan.sweep.scenarios import polars

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    import polars as pl

    from aosplan.sweep.scenarios import Crossing, Table

SUFFIXES = (".csv", ".parquet", ".jsonl")
"""Endings of a result."""

JOURNAL = "journal.jsonl"


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

    @property
    def names(self) -> list[str]:
        """Columns of the result."""
        return [*map(input_column, self.scenarios.names), *self.results, "status", "reason"]

    def fingerprint(self) -> str:
        """A text that differs where any row might."""
        digest = hashlib.sha256(repr((__version__, self[1:])).encode())
        for name, values in self.scenarios.values.items():
            digest.update(name.encode())
            digest.update(repr(values.tolist()).encode())
        return digest.hexdigest()

    def frame(self, index: int) -> pl.DataFrame:
        """What is kept of one block."""
        block = self.scenarios.block(index)
        return self.kept(solve_block(block, self.scenarios.names, self.results, self.folder))

    def kept(self, frame: pl.DataFrame) -> pl.DataFrame:
        """The rows of a frame that the conditions keep, in order."""
        pl = polars()
        if self.where is not None:
            try:
                frame = frame.filter(pl.sql_expr(self.where))
            except pl.exceptions.PolarsError as error:
                raise RequestError(
                    f"--where {self.where}: {str(error).splitlines()[0]}",
                    f"a condition such as 'samples <= 49'; columns: {', '.join(self.names)}",
                ) from None
        return self.best_of(frame)

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


def check(sweep: Sweep) -> None:
    """Refuse conditions on columns that the result does not have.

    Raises
    ------
    RequestError
        Where `best` or `per` names an unknown column, or `where` is no condition.
    """
    named = [("--best", sweep.best.lstrip("-"))] if sweep.best else []
    for option, name in named + [("--per", name) for name in sweep.per]:
        if name not in sweep.names:
            raise RequestError(
                f"{option} names '{name}', which is no column of the result",
                nearest_hint(name, sweep.names) or f"columns: {', '.join(sweep.names)}",
            )
    sweep.kept(polars().DataFrame(schema=dict(solve_first(sweep).schema)))


def solve_first(sweep: Sweep) -> pl.DataFrame:
    """The first scenario alone, for its columns."""
    block = sweep.scenarios.block(0)
    columns = {
        name: column[tuple(slice(1) for _ in column.shape)]
        for name, column in block.columns.items()
    }
    single = block._replace(columns=columns, shape=(1,) * len(block.shape))
    return solve_block(single, sweep.scenarios.names, sweep.results, sweep.folder)


class Parts:
    """The folder of a sweep's parts, and its journal of those that are whole."""

    def __init__(self, out: str, sweep: Sweep) -> None:
        self.out = out
        self.folder = f"{out}.parts"
        self.suffix = os.path.splitext(out)[1].lower()
        # The best rows of the parts are compared once more, so they keep their types.
        self.part_suffix = self.suffix if sweep.best is None else ".parquet"
        self.fingerprint = sweep.fingerprint()
        self.done: dict[int, int] = {}

    def start(self, *, resume: bool, force: bool) -> None:
        """Make the folder, or take up what lies in it.

        Raises
        ------
        RequestError
            Where there are parts that are not to be resumed, or belong to another sweep.
        """
        if os.path.isdir(self.folder):
            if resume:
                self._take_up()
                return
            if not force:
                raise RequestError(
                    f"'{self.folder}' holds parts of an interrupted sweep",
                    "--resume goes on with it, --force begins again",
                )
            shutil.rmtree(self.folder)
        os.makedirs(self.folder)
        self._note({"fingerprint": self.fingerprint})

    def _take_up(self) -> None:
        path = os.path.join(self.folder, JOURNAL)
        try:
            with open(path, encoding="utf-8") as file:
                # The last line may have been cut short with the run.
                lines = [line for line in file if line.endswith("\n")]
            notes = [json.loads(line) for line in lines]
        except (OSError, ValueError):
            notes = []
        if not notes or notes[0].get("fingerprint") != self.fingerprint:
            raise RequestError(
                f"'{self.folder}' holds parts of another sweep",
                "give the same file, options and version, or --force to begin again",
            )
        for note in notes[1:]:
            place = self.path(note["part"])
            if os.path.isfile(place) and os.path.getsize(place) == note["bytes"]:
                self.done[note["part"]] = note["rows"]

    def path(self, index: int) -> str:
        """File of a part."""
        return os.path.join(self.folder, f"{index:08d}{self.part_suffix}")

    def add(self, index: int, rows: int) -> None:
        """Note that a part is whole."""
        self._note({"part": index, "rows": rows, "bytes": os.path.getsize(self.path(index))})
        self.done[index] = rows

    def _note(self, note: dict[str, Any]) -> None:
        with open(os.path.join(self.folder, JOURNAL), "a", encoding="utf-8") as file:
            file.write(json.dumps(note) + "\n")
            file.flush()
            os.fsync(file.fileno())

    def join(self, sweep: Sweep, count: int) -> str:
        """Join all parts into one file beside the result; its temporary name."""
        whole = os.path.join(self.folder, f"whole{self.suffix}")
        paths = [self.path(index) for index in range(count)]
        if sweep.best is not None:
            pl = polars()
            write_frame(sweep.best_of(pl.concat([pl.read_parquet(path) for path in paths])), whole)
        elif self.suffix == ".parquet":
            _join_parquet(paths, whole)
        else:
            _join_text(paths, whole, header=self.suffix == ".csv")
        return whole

    def remove(self) -> None:
        """Remove the folder."""
        shutil.rmtree(self.folder)


def run(
    sweep: Sweep,
    out: str,
    *,
    resume: bool = False,
    force: bool = False,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> int:
    """Solve every scenario and write what is kept; the number of rows written.

    Parameters
    ----------
    sweep
        What to solve.
    out
        The result, a path that ends in one of `SUFFIXES`.
    resume, force
        Whether to go on with an interrupted run, or to overwrite what is there.
    workers
        Processes; with one, this one.
    progress
        Called with the number of scenarios done since the last call.

    Raises
    ------
    RequestError
        Where `Parts.start` refuses, or a scenario's file is wrong.
    SurroundingsError
        Where something cannot be written; what is done stays, for `resume`.
    """
    parts = Parts(out, sweep)
    parts.start(resume=resume, force=force)
    count = sweep.scenarios.blocks
    advance = progress or (lambda _: None)
    advance(sum(sweep.scenarios.block(index).rows for index in parts.done))
    left = (index for index in range(count) if index not in parts.done)
    try:
        for index, solved, rows in _solved(sweep, parts, left, workers):
            parts.add(index, rows)
            advance(solved)
        whole = parts.join(sweep, count)
        os.replace(whole, out)
    except OSError as error:
        raise SurroundingsError(
            f"cannot write '{error.filename or out}': {(error.strerror or str(error)).lower()}",
            "what is done is kept: make room, then --resume",
        ) from None
    parts.remove()
    return sum(parts.done.values())


def _solved(
    sweep: Sweep, parts: Parts, left: Iterable[int], workers: int
) -> Iterator[tuple[int, int, int]]:
    """Write parts as they come: place, scenarios solved and rows kept of each."""
    if workers == 1:
        for index in left:
            yield solve_part(sweep, index, parts.path(index))
        return
    waiting = iter(left)
    # Forked processes would share the locks of the columnar library's threads.
    context = get_context("spawn")
    with ProcessPoolExecutor(workers, context, _take, (sweep,)) as pool:
        running = {
            pool.submit(_part, index, parts.path(index)) for index in islice(waiting, 2 * workers)
        }
        try:
            while running:
                finished, running = wait(running, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield future.result()
                running |= {
                    pool.submit(_part, index, parts.path(index))
                    for index in islice(waiting, len(finished))
                }
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


_sweep: Sweep | None = None


def _take(sweep: Sweep) -> None:
    """Keep the sweep of a worker process, which is sent once."""
    global _sweep  # noqa: PLW0603 (a process of a pool has no other place)
    _sweep = sweep


def _part(index: int, path: str) -> tuple[int, int, int]:
    assert _sweep is not None  # every worker takes it at its start
    return solve_part(_sweep, index, path)


def solve_part(sweep: Sweep, index: int, path: str) -> tuple[int, int, int]:
    """Solve a block and write what is kept of it, whole or not at all."""
    frame = sweep.frame(index)
    write_frame(frame, path)
    return index, sweep.scenarios.block(index).rows, frame.height


def write_frame(frame: pl.DataFrame, path: str) -> None:
    """Write a frame in the format of the path's ending; the name appears when it is whole."""
    temporary = f"{path}.{os.getpid()}.tmp"
    try:
        if path.endswith(".parquet"):
            frame.write_parquet(temporary, compression="lz4")
        elif path.endswith(".csv"):
            frame.write_csv(temporary)
        else:
            frame.write_ndjson(temporary)
        os.replace(temporary, path)
    except BaseException:
        if os.path.exists(temporary):
            os.unlink(temporary)
        raise


def _join_parquet(paths: list[str], whole: str) -> None:
    if len(paths) == 1:
        os.replace(paths[0], whole)
        return
    pl = polars()
    # The row groups of the result are the parts.
    pl.scan_parquet(paths).sink_parquet(whole, compression="lz4", maintain_order=True)


def _join_text(paths: list[str], whole: str, *, header: bool) -> None:
    with open(whole, "wb") as target:
        for place, path in enumerate(paths):
            with open(path, "rb") as part:
                if header and place:
                    part.readline()
                shutil.copyfileobj(part, target, 1 << 20)
