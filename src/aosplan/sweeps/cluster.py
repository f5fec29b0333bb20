"""Parts of a sweep solved by the workers of a Dask cluster.

A task carries the scenarios of one block and writes one part, under its final name only when it is
whole, into a folder that the workers and this machine share.  A task that the cluster runs twice
writes the same bytes twice.  The scheduler sees only tasks under way, a few for each thread.

Whatever would change a byte, or would never end, ends the run with one error: other versions, files
that a worker does not see, no workers, a scheduler that is gone.
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
from aosplan.sweeps.block_frame import forget_files
from aosplan.sweeps.input_files import named_files
from aosplan.sweeps.scenarios import Single
from aosplan.sweeps.solve_part import solve_part

if TYPE_CHECKING:
    from collections.abc import Generator, Iterable, Iterator

    from aosplan.sweeps.parts import Part, Parts
    from aosplan.sweeps.scenarios import Crossing, Table
    from aosplan.sweeps.sweep import Sweep

ADDRESS = re.compile(r"((tcp|tls|ws|wss|ucx)://)?(\[[0-9a-fA-F:.]+\]|[^\s/:]+):\d{1,5}")

CONNECT_S = 10.0
"""How long a scheduler may take to answer at first."""

ANSWER_S = 60.0
"""How long a scheduler may take to answer later, when it is busy."""

FETCH_S = 1.0
"""How long a finished task is waited for before the cluster is looked at again."""

NO_WORKERS_S = 60.0
"""How long a sweep goes on without a worker."""

TASKS_A_THREAD = 3
"""Tasks under way for each thread of the cluster: one runs, the others wait beside it."""

PACKAGES = ("aosplan", "numpy", "polars", "scipy")
"""Packages on whose versions the bytes of a part depend."""

RESUME = "finished parts are kept; --resume continues the sweep"


class Task(NamedTuple):
    """What a worker is told: one block, and where its part goes.

    Attributes
    ----------
    sweep
        The sweep, with the scenarios of the block alone.
    part, path
        Place and file of the part.
    folder
        Where the part lies until it is whole; made for this run, so that a task of an earlier one
        cannot write to it.
    files
        Files of the scenarios, and their sizes.
    """

    sweep: Sweep
    part: int
    path: str
    folder: str
    files: tuple[tuple[str, int], ...]


def solved_by(address: str, sweep: Sweep, parts: Parts, left: Iterable[int]) -> Generator[Part]:
    """Have parts written by a cluster, and hand them out as they come.

    Parameters
    ----------
    address
        Of the scheduler.
    sweep, parts
        What is solved, and where it goes: a folder that the workers see under the same name.
    left
        Places of the parts to write.

    Raises
    ------
    RequestError
        If the address is none, or a file of the scenarios is not found by its full name.
    SurroundingsError
        If the cluster cannot go on: no scheduler, no workers, other versions, nothing shared,
        a worker that cannot write.
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
            Task(
                sweep._replace(scenarios=alone(sweep.scenarios, index)),
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


def alone(scenarios: Crossing | Table, index: int) -> Single:
    """The scenarios of one block."""
    block = scenarios.block(index)
    return Single(block.columns, only=block)


def files_of(sweep: Sweep) -> tuple[tuple[str, int], ...]:
    """Files that the scenarios name, and their sizes, so that workers can be asked for them.

    Raises
    ------
    RequestError
        If a file is found in the current folder alone, which workers do not share.
    """
    files: set[str] = set()
    for named in named_files(sweep.scenarios.values, sweep.folder):
        files.update(named.files)
        if not os.path.isabs(named.found):
            raise RequestError(
                f"{named.option} '{named.value}' is a file of the current folder, which workers do "
                "not share",
                "put it beside the sweep's file, or give its full name",
            )
    return tuple((file, os.path.getsize(file)) for file in sorted(files))


# On a worker


def write_part(versions: dict[str, str], pickled: bytes) -> Part:
    """Write the part of one task.

    Raises
    ------
    SurroundingsError
        If this worker cannot write it, or would write other bytes than others.
    """
    if (here := own_versions()) != versions:
        raise SurroundingsError(_difference(_place(), here, versions), _SAME_VERSIONS)
    task: Task = pickle.loads(pickled)  # noqa: S301 (from the client, which tells workers what to run)
    if not os.path.isdir(task.folder):
        raise SurroundingsError(
            f"{_place()} does not see the folder '{os.path.dirname(task.folder)}'",
            "--out has to be a path that this machine and all workers see under the same name",
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
            f"{RESUME} once it can be written",
        ) from None


@lru_cache(maxsize=16)
def _begin(_folder: str, files: tuple[tuple[str, int], ...]) -> None:
    """Look at files anew, once for each run: a worker may know them as they were for another."""
    forget_files()
    for file, size in files:
        if not os.path.isfile(file) or os.path.getsize(file) != size:
            raise SurroundingsError(
                f"{_place()} does not see the file '{file}' as this machine does",
                "files of scenarios need a path that all workers see under the same name",
            )


def _place() -> str:
    """The worker itself, by its address."""
    try:
        return f"worker {dask().get_worker().address}"
    except ValueError:
        return "worker"


def own_versions() -> dict[str, str]:
    """Versions on which the bytes of a part depend."""
    return {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}}


def _difference(place: str, there: dict[str, str], here: dict[str, str]) -> str:
    """In words, where versions differ."""
    name = next(name for name in here if there.get(name) != here[name])
    found = f"has {name} {there[name]}" if there.get(name) else f"has no {name}"
    return f"{place} {found}, this machine {here[name]}"


_SAME_VERSIONS = "all machines of a cluster need the same versions: pip install 'aosplan[cluster]'"


# On this machine


def dask() -> Any:
    """Dask's library for clusters.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    with needs_extra("a sweep on a cluster", "cluster"):
        import distributed
    return distributed


@contextlib.contextmanager
def _connected(address: str) -> Iterator[Any]:
    """A client of a scheduler; its library keeps silent, what it says is said in an error."""
    if not ADDRESS.fullmatch(address):
        raise RequestError(
            f"--scheduler '{address}' is not an address", "such as 10.0.0.5:8786 or tcp://head:8786"
        )
    library = dask()
    from dask import config

    given = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        # A failed client complains again when it is collected, so the scheduler is asked first.
        asyncio.run(_ask(address))
        # Blocks of a table may be large, and other versions are an error.
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
    """Refuse what is no scheduler."""
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
            f"at '{address}' is a {str(answer.get('type')).lower()}, not a scheduler",
            "`dask scheduler` prints its address",
        )


def check_versions(client: Any) -> None:
    """Refuse a cluster that would write other bytes, or none."""
    here = own_versions()
    found = client.get_versions(packages=list(PACKAGES))
    places = {"the scheduler": found["scheduler"]}
    places |= {f"worker {address}": answer for address, answer in found["workers"].items()}
    for place, answer in places.items():
        python = ".".join(answer["host"]["python"].split(".")[:3])
        there = answer["packages"] | {"python": python}
        if any(there.get(name) != here[name] for name in here):
            raise SurroundingsError(_difference(place, there, here), _SAME_VERSIONS)


def _written(client: Any, tasks: Iterator[Task], count: int) -> Iterator[Part]:
    """That many parts as they are written; a few tasks for each thread are under way."""
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
        with contextlib.suppress(Exception):  # the scheduler may have gone
            client.cancel(list(running), force=True)


class _Crew:
    """The threads of a cluster, counted every second."""

    def __init__(self, client: Any) -> None:
        self.client = client
        self.count = 0
        self.counted_s = -math.inf
        self.last_seen_s = time.monotonic()

    def threads(self) -> int:
        """How many there are.

        Raises
        ------
        SurroundingsError
            If there is no scheduler, or for long no worker.
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
    """What became of a task; nothing as yet where its worker died with it, and it is done again."""
    try:
        part: Part = future.result(timeout=FETCH_S)
    except Exception as found:  # noqa: BLE001 (whatever a task can raise, told below)
        error = found
    else:
        return part
    if future.status != "error":  # not the task's own, but of the way to it
        if isinstance(error, TimeoutError):
            return None
        raise _lost()
    if isinstance(error, AosplanError):
        raise error
    if isinstance(error, dask().KilledWorker):
        raise SurroundingsError(
            f"part {index} of the sweep: every worker that took it died",
            f"perhaps for lack of memory, of which workers with fewer threads take less; {RESUME}",
        )
    raise SurroundingsError(
        f"part {index} of the sweep failed on a worker: {type(error).__name__}: {error}", RESUME
    )
