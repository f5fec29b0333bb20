"""Execution of a sweep, which writes the result part by part and can be resumed.

Each block of scenarios becomes a part (`aosplan.sweeps.parts`).  When all parts are complete, they
are joined into one file, or their folder is the result (`aosplan.sweeps.parquet_folder`).  The
parts depend only on the sweep.  Interruptions do not change the result.  The number of workers, on
this machine or on a cluster (`aosplan.sweeps.cluster`), does not change it either.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from multiprocessing import active_children, get_context, parent_process
from threading import Thread, current_thread, main_thread
from typing import TYPE_CHECKING

from aosplan.errors import AosplanError, SurroundingsError
from aosplan.files import is_locked
from aosplan.sweeps.aggregate import kept, start_aggregation
from aosplan.sweeps.parquet_folder import Partitions, is_folder
from aosplan.sweeps.parts import Part, Parts, solve_part
from aosplan.sweeps.scenarios import polars

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator

    from aosplan.sweeps.aggregate import Aggregation
    from aosplan.sweeps.sweep import Sweep

MOST_WINDOWS_WORKERS = 61
"""Largest number of processes of a pool on Windows. Windows can wait for at most 63 handles, and
two of them are needed by the pool itself.
"""


def run(
    sweep: Sweep,
    out: str,
    *,
    resume: bool = False,
    force: bool = False,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[int, Aggregation | None]:
    """Solve every scenario and write the rows to keep.  Returns the number of these rows, and the
    summary.

    Parameters
    ----------
    sweep
        The sweep to solve.
    out
        Path of the result.  It has one of the extensions `SUFFIXES`, or it is a folder
        (`aosplan.sweeps.parquet_folder.is_folder`).
    resume, force
        Whether an interrupted run is continued, and whether an existing result is overwritten.
    workers
        Number of processes.  With 1, only the current process is used.
    scheduler
        Address of a Dask cluster that solves the scenarios instead of this machine.
    progress
        Function that is called with the number of scenarios that have been solved since its last
        call.

    Raises
    ------
    RequestError
        In the same cases as `Parts.start`, or if a file of a scenario is not valid.
    SurroundingsError
        If a file cannot be written, or if a worker is terminated.  Complete parts remain for
        `resume`.
    """
    parts = Partitions(out, sweep) if is_folder(out) else Parts(out, sweep)
    with parts.alone():
        return _run(sweep, parts, out, resume, force, workers, scheduler, progress)


def _run(
    sweep: Sweep,
    parts: Parts,
    out: str,
    resume: bool,  # noqa: FBT001
    force: bool,  # noqa: FBT001
    workers: int,
    scheduler: str | None,
    progress: Callable[[int], None] | None,
) -> tuple[int, Aggregation | None]:
    parts.start(resume=resume, force=force)
    gathering = None
    if sweep.gather is not None:
        gathering = start_aggregation(
            sweep, f"{out.rstrip(f'/{os.sep}')}.gathered", resume=resume, force=force
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
            "finished parts are kept; "
            + (
                "close the program that has it open, then run the sweep again with --resume"
                if is_locked(error)
                else "free some space, then run the sweep again with --resume"
            ),
        ) from None
    parts.remove()
    return sum(part.rows for part in parts.done.values()), gathering


def summarise(
    sweep: Sweep,
    path: str,
    *,
    resume: bool = False,
    force: bool = False,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> Aggregation:
    """Solve every scenario without writing rows, and return the summary.

    Parameters
    ----------
    sweep
        The sweep to solve.  Its attribute `gather` is set.
    path
        File that stores the summary if the run is interrupted or takes long.  The caller has to
        remove it.
    resume, force, workers, progress
        As in `run`.

    Raises
    ------
    RequestError
        In the same cases as `Aggregation.start`, or if a file of a scenario is not valid.
    """
    gathering = start_aggregation(sweep, path, resume=resume, force=force)
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
    """Solve parts on this machine and yield them when they are complete.  If `parts` is given, they
    are written.
    """
    _end_waits()

    def path(index: int) -> str | None:
        return None if parts is None else parts.path(index)

    if workers == 1:
        for index in left:
            yield solve_part(sweep, index, path(index))
        return
    waiting = iter(left)
    others = set(active_children())
    # Processes are not forked, because they would inherit locks of the threads of polars.
    context = get_context("spawn")
    with (
        contextlib.ExitStack() as afterwards,
        ProcessPoolExecutor(workers_of(workers), context, _take, (sweep,)) as pool,
    ):
        try:
            # Interruptions are deferred, because Python would print an exception if an interruption
            # occurred while a process starts.
            with _interrupted_later():
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
                # The process is terminated. The part that it was writing is incomplete.
                process.terminate()
            if isinstance(error, BrokenProcessPool):
                raise SurroundingsError(
                    "a worker process died; the memory may be too small",
                    "finished parts are kept; --resume continues the sweep, and --workers 1 "
                    "needs the least memory",
                ) from None
            raise


def workers_of(asked: int) -> int:
    """Number of processes of a pool: the requested number, but at most `MOST_WINDOWS_WORKERS` on
    Windows.
    """
    return min(asked, MOST_WINDOWS_WORKERS) if sys.platform == "win32" else asked


def _end_waits() -> None:
    if sys.platform != "win32":
        # The signal handler of polars makes the system restart interrupted calls. Here, Ctrl-C has
        # to end such calls.
        signal.siginterrupt(signal.SIGINT, True)


@contextlib.contextmanager
def _interrupted_later() -> Iterator[None]:
    """Context manager that defers Ctrl-C until the end of its block."""
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
    """Store the sweep in a worker process.  Ctrl-C is ignored, because the first process handles
    it.
    """
    global _sweep  # noqa: PLW0603 (a process of a pool has no other place)
    _sweep = sweep
    Thread(target=_end_with_parent, daemon=True).start()
    polars()  # polars is imported first, because it installs a signal handler.
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _end_with_parent() -> None:
    """End this process when its parent process has ended, even if the parent was killed."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _part(index: int, path: str | None) -> Part:
    assert _sweep is not None  # It was set when the worker started.
    return solve_part(_sweep, index, path)
