"""A Dask cluster for tests.  Its scheduler and workers are processes."""

import json
import os
import subprocess
import sys
import time

CAMPAIGN = """
[sweep]
altitude = { start = 10, stop = 120, count = 45 }
vhat = { start = 0.5, stop = 0.95, count = 20 }
optimize = "time"
"""
PARTS, ROWS = 23, 900
"""Number of parts and number of rows of the test sweep.  A row takes about a millisecond."""


class Cluster:
    """A scheduler and its workers, each in its own process."""

    def __init__(self, folder):
        self.folder = folder
        self.workers = []
        file = folder / "scheduler.json"
        self.scheduler = self._start("scheduler", "--port", "0", "--scheduler-file", file)
        self.address = wait_for(lambda: read_address(file), 300)

    def _start(self, kind, *arguments, environment=None, before=()):
        common = ["--host", "127.0.0.1", "--no-dashboard", "--dashboard-address", "127.0.0.1:0"]
        log = (self.folder / f"{kind}-{time.monotonic_ns()}.log").open("w")
        with log:
            return subprocess.Popen(
                [*before, sys.executable, "-m", "dask", kind, *common, *map(str, arguments)],
                stdout=log,
                stderr=log,
                env=os.environ | (environment or {}),
            )

    def add_worker(self, *arguments, **settings):
        options = ["--nthreads", 1, "--no-nanny", "--memory-limit", 0, "--death-timeout", 300]
        place = ["--local-directory", self.folder / "workers"]
        worker = self._start("worker", self.address, *options, *place, *arguments, **settings)
        self.workers.append(worker)
        return worker

    def crew(self, count):
        """Start or stop workers until their number is `count`."""
        for worker in self.workers[count:]:
            end(worker)
        del self.workers[count:]
        while len(self.workers) < count:
            self.add_worker()
        self.await_threads(count)

    def await_threads(self, count):
        from distributed import Client

        with Client(self.address, set_as_default=False, timeout=300) as client:
            wait_for(lambda: len(client.nthreads()) == count, 300)

    def end(self):
        for process in [*self.workers, self.scheduler]:
            end(process)


def end(process):
    process.kill()
    process.wait(timeout=30)


def read_address(file):
    try:
        return json.loads(file.read_text())["address"]
    except (OSError, ValueError):
        return None


def wait_for(condition, seconds):
    until = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < until, "waited for too long"
        time.sleep(0.02)
    return found


def assert_error(capsys, *words):
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2, lines
    assert lines[0].startswith("error: ")
    assert lines[1].startswith("hint: ")
    for word in words:
        assert word in "\n".join(lines)
