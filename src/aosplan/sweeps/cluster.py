"""Solution of the parts of a sweep by the workers of a Dask cluster.

A task contains the scenarios of one block.  It writes one part into a folder that the workers and
this machine share.  The file gets its final name only when it is complete.  If the cluster runs a
task twice, the same bytes are written twice.  Only a few tasks per thread are submitted at a time.

The run stops with an error if the result could differ or if the run would never end. This is the
case if versions differ, if a worker does not see a file, if there are no workers, or if the
scheduler does not respond.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import os
import pickle
import platform
import queue
import re
import shutil
import time
import uuid
import warnings
from functools import lru_cache
from importlib.metadata import version
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import AosplanError, RequestError, SurroundingsError, needs_extra
from aosplan.sweeps.input_files import named_files
from aosplan.sweeps.parts import solve_part
from aosplan.sweeps.scenarios import SingleBlock
from aosplan.sweeps.solve_block import forget_files

if TYPE_CHECKING:
    from collections.abc import Generator, Iterable, Iterator

    from aosplan.sweeps.parts import Part, Parts
    from aosplan.sweeps.scenarios import ScenarioProduct, ScenarioTable
    from aosplan.sweeps.sweep import Sweep

ADDRESS = re.compile(r"((tcp|tls|ws|wss|ucx)://)?(\[[0-9a-fA-F:.]+\]|[^\s/:]+):\d{1,5}")

CONNECT_S = 10.0
"""Time limit for the first answer of a scheduler."""

ANSWER_S = 60.0
"""Time limit for later answers of a scheduler.  It is longer, because the scheduler may be busy."""

FETCH_S = 1.0
"""Time to wait for a finished task before the cluster is checked again."""

NO_WORKERS_S = 60.0
"""Time for which a sweep waits if there is no worker."""

TASKS_A_THREAD = 3
"""Number of tasks per thread of the cluster.  One task is running, and the others are waiting."""

PACKAGES = ("aosplan", "numpy", "polars", "scipy")
"""Packages on whose versions the bytes of a part depend."""

RESUME = "finished parts are kept; --resume continues the sweep"


class PartTask(NamedTuple):
    """A task for a worker: one block, and the path of its part.

    Attributes
    ----------
    sweep
        The sweep with only the scenarios of the block.
    part, path
        Index and file name of the part.
    folder
        Folder of the incomplete part. Each run has a new folder, because tasks of an earlier run
        must not write to it.
    files
        Files of the scenarios, with their sizes.
    """

    sweep: Sweep
    part: int
    path: str
    folder: str
    files: tuple[tuple[str, int], ...]


def solved_by(address: str, sweep: Sweep, parts: Parts, left: Iterable[int]) -> Generator[Part]:
    """Let a cluster write parts, and yield the parts as they are completed.

    Parameters
    ----------
    address
        Address of the scheduler.
    sweep, parts
        The sweep, and its parts.  The folder of the parts has the same path on all workers.
    left
        Indices of the parts to write.

    Raises
    ------
    RequestError
        If the address is not valid, or if a file of the scenarios cannot be found by its full path.
    SurroundingsError
        If the cluster cannot continue, because there is no scheduler, no worker or no shared
        folder, or because a worker cannot write or has different versions.
    MissingExtraError
        If Dask is not installed.
    """
    folder = os.path.join(os.path.abspath(parts.folder), f"writing-{uuid.uuid4().hex}")
    files = files_of(sweep)
    with _connected(address) as client:
        check_versions(client)
        os.mkdir(folder)
        count = sweep.scenarios.blocks - len(parts.done)
        tasks = (
            PartTask(
                sweep._replace(scenarios=single_block(sweep.scenarios, index)),
                index,
                os.path.abspath(parts.path(index)),
                folder,
                files,
            )
            for index in left
        )
        try:
            yield from _written(client, tasks, count)
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def single_block(scenarios: ScenarioProduct | ScenarioTable, index: int) -> SingleBlock:
    """The scenarios of one block, without the others."""
    block = scenarios.block(index)
    return SingleBlock(block.columns, only=block)


def files_of(sweep: Sweep) -> tuple[tuple[str, int], ...]:
    """Files that the scenarios use, with their sizes.  Workers check these sizes.

    Raises
    ------
    RequestError
        If a file is found only in the current folder, because workers do not share this folder.
    """
    files: set[str] = set()
    for named in named_files(sweep.scenarios.values, sweep.folder):
        files.update(named.files)
        if not os.path.isabs(named.found):
            raise RequestError(
                f"{named.option} '{named.value}' is a file of the current folder, which workers do "
                "not share",
                "put this file into the folder that contains the sweep's file, or give its full "
                "path",
            )
    return tuple((file, os.path.getsize(file)) for file in sorted(files))


# --- Functions that run on a worker ---


def write_part(versions: dict[str, str], pickled: bytes) -> Part:
    """Write the part of one task.

    Raises
    ------
    SurroundingsError
        If this worker cannot write the part, or if it has other versions than the sending machine.
    """
    if (here := own_versions()) != versions:
        raise SurroundingsError(_difference(_place(), here, versions), _SAME_VERSIONS)
    task: PartTask = pickle.loads(pickled)  # noqa: S301 (from the client, which tells workers what to run)
    if not os.path.isdir(task.folder):
        raise SurroundingsError(
            f"{_place()} does not see the folder '{os.path.dirname(task.folder)}'",
            "give --out as a path that this machine and all workers see under the same name",
        )
    _begin(task.folder, task.files)
    try:
        return solve_part(task.sweep, task.part, task.path, task.folder)
    except AosplanError as error:
        raise SurroundingsError(f"{_place()}: {error.message}", error.hint) from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise SurroundingsError(
            f"{_place()} cannot write '{error.filename or task.path}': {reason}",
            f"make sure that the worker can write there; {RESUME}",
        ) from None


@lru_cache(maxsize=16)
def _begin(_folder: str, files: tuple[tuple[str, int], ...]) -> None:
    """Check the files and clear stored content, because files may have changed.  This is done once
    for each run.
    """
    forget_files()
    for file, size in files:
        if not os.path.isfile(file) or os.path.getsize(file) != size:
            raise SurroundingsError(
                f"{_place()} does not have the file '{file}', or has another file with this path",
                "give files of scenarios with a path that all workers see under the same name",
            )


def _place() -> str:
    """Name of this worker, with its address."""
    try:
        return f"worker {dask().get_worker().address}"
    except ValueError:
        return "worker"


def own_versions() -> dict[str, str]:
    """Versions on which the bytes of a part depend."""
    return {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}}


def _difference(place: str, there: dict[str, str], here: dict[str, str]) -> str:
    """Message about the first difference of versions."""
    name = next(name for name in here if there.get(name) != here[name])
    found = f"has {name} {there[name]}" if there.get(name) else f"has no {name}"
    return f"{place} {found}, this machine {here[name]}"


_SAME_VERSIONS = "all machines of a cluster need the same versions: pip install 'aosplan[cluster]'"


# --- Functions that run on this machine ---


def dask() -> Any:
    """Dask's library for clusters (distributed).

    Raises
    ------
    MissingExtraError
        If distributed is not installed.
    """
    with needs_extra("a sweep on a cluster", "cluster"):
        import distributed
    return distributed


@contextlib.contextmanager
def _connected(address: str) -> Iterator[Any]:
    """A client of a scheduler.  Messages of the library are suppressed and replaced by one
    error.
    """
    if not ADDRESS.fullmatch(address):
        raise RequestError(
            f"--scheduler '{address}' is not an address",
            "give an address such as 10.0.0.5:8786 or tcp://head:8786",
        )
    library = dask()
    from dask import config

    given = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        # The scheduler is tested first, because a client that cannot connect prints another error
        # when it is deleted.
        asyncio.run(_ask(address))
        # Warnings are suppressed. Large blocks of a table are intended, and for different versions
        # there is already an error.
        with (
            config.set({"distributed.admin.large-graph-warning-threshold": "1GiB"}),
            warnings.catch_warnings(action="ignore"),
        ):
            client = library.Client(address, timeout=CONNECT_S, set_as_default=False)
            try:
                yield client
            finally:
                with contextlib.suppress(TimeoutError, OSError):
                    client.close(timeout=5.0)
    finally:
        logging.disable(given)


async def _ask(address: str) -> None:
    """Refuse an address at which no scheduler answers."""
    library = dask()
    arguments = library.Security().get_connection_args("client")
    try:
        async with asyncio.timeout(CONNECT_S):
            async with library.rpc(address, connection_args=arguments, timeout=CONNECT_S) as there:
                answer = await there.identity()
    except (OSError, ValueError, TimeoutError) as error:
        raise SurroundingsError(
            f"no scheduler answers at '{address}' within {CONNECT_S:.0f} s",
            "`dask scheduler` starts one and prints its address",
        ) from error
    if answer.get("type") != "Scheduler":
        raise RequestError(
            f"the process at '{address}' is not a scheduler, but a "
            f"{str(answer.get('type')).lower()}",
            "give the address that `dask scheduler` prints",
        )


def check_versions(client: Any) -> None:
    """Refuse a cluster whose workers would write different bytes or cannot write."""
    here = own_versions()
    found = client.get_versions(packages=list(PACKAGES))
    places = {"the scheduler": found["scheduler"]}
    places |= {f"worker {address}": answer for address, answer in found["workers"].items()}
    for place, answer in places.items():
        python = ".".join(answer["host"]["python"].split(".")[:3])
        there = answer["packages"] | {"python": python}
        if any(there.get(name) != here[name] for name in here):
            raise SurroundingsError(_difference(place, there, here), _SAME_VERSIONS)


def _written(client: Any, tasks: Iterator[PartTask], count: int) -> Iterator[Part]:
    """Yield `count` parts as they are written.  A few tasks per thread are submitted at a time."""
    versions = own_versions()
    run = uuid.uuid4().hex
    running: dict[Any, int] = {}
    finished: queue.SimpleQueue[Any] = queue.SimpleQueue()
    crew = _Crew(client)
    try:
        while count:
            for task in islice(tasks, max(TASKS_A_THREAD * crew.threads() - len(running), 0)):
                future = client.submit(
                    write_part,
                    versions,
                    pickle.dumps(task),
                    key=f"aosplan-{run}-{task.part}",
                    pure=False,
                )
                running[future] = task.part
                future.add_done_callback(finished.put)
            try:
                future = finished.get(timeout=1.0)
            except queue.Empty:
                continue
            part = result_of(future, running[future])
            if part is None:
                finished.put(future)
                continue
            del running[future]
            yield part
            count -= 1
    finally:
        with contextlib.suppress(Exception):  # The scheduler may no longer exist.
            client.cancel(list(running), force=True)


class _Crew:
    """The number of threads of a cluster, which is updated at most once per second."""

    def __init__(self, client: Any) -> None:
        self.client = client
        self.count = 0
        self.counted_s = -math.inf
        self.last_seen_s = time.monotonic()

    def threads(self) -> int:
        """Number of threads.

        Raises
        ------
        SurroundingsError
            If the scheduler no longer exists, or if there has been no worker for too long.
        """
        now_s = time.monotonic()
        if now_s < self.counted_s + 1.0:
            return self.count
        try:
            found = self.client.sync(self.client.scheduler.ncores, callback_timeout=ANSWER_S)
        except (OSError, AttributeError, ValueError, RuntimeError):
            raise _lost() from None
        self.count, self.counted_s = sum(found.values()), time.monotonic()
        if self.count:
            self.last_seen_s = self.counted_s
        elif self.counted_s > self.last_seen_s + NO_WORKERS_S:
            raise SurroundingsError(
                f"the scheduler has had no worker for {NO_WORKERS_S:.0f} s",
                f"`dask worker ADDRESS` starts one; {RESUME}",
            )
        return self.count


def _lost() -> SurroundingsError:
    return SurroundingsError("the connection to the scheduler is lost", RESUME)


def result_of(future: Any, index: int) -> Part | None:
    """The part of a finished task; None if the part is not available, because the cluster runs the
    task again.
    """
    try:
        part: Part = future.result(timeout=FETCH_S)
    except Exception as found:  # noqa: BLE001 (whatever a task can raise, told below)
        error = found
    else:
        return part
    if future.status != "error":  # The connection failed, and not the task.
        if isinstance(error, TimeoutError):
            return None
        raise _lost()
    if isinstance(error, AosplanError):
        raise error
    if isinstance(error, dask().KilledWorker):
        raise SurroundingsError(
            f"part {index} of the sweep: every worker that started it died",
            f"the memory may be too small, and workers with fewer threads need less; {RESUME}",
        )
    raise SurroundingsError(
        f"part {index} of the sweep failed on a worker: {type(error).__name__}: {error}", RESUME
    )
