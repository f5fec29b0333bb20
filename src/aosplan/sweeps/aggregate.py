"""Summary and sample of a sweep.  They are added up part by part, and stored in a file if the sweep
is interrupted.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from typing import TYPE_CHECKING

from aosplan.errors import RequestError
from aosplan.sweeps.parts import write_durably
from aosplan.sweeps.summary import Aggregates, AggregationPlan

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from aosplan.sweeps.parts import Part
    from aosplan.sweeps.sweep import Sweep

EVERY_S = 5.0
"""Seconds after which the file is written again."""


class Aggregation:
    """The summary and sample of the parts so far, and the file that stores them.

    The file is written at most every `EVERY_S` seconds, and also at an interruption.  A new file
    replaces the old file only when it is complete.
    """

    def __init__(
        self, gather: AggregationPlan, results: Sequence[str], path: str, fingerprint: str
    ) -> None:
        self.gather = gather
        self.path = path
        self.fingerprint = fingerprint
        self.done: set[int] = set()
        self.gathered = gather.nothing(results)
        self._written_s = time.monotonic()

    def start(self, *, resume: bool, force: bool) -> None:
        """Continue with the content of the file.

        Raises
        ------
        RequestError
            If the file exists and the run is not resumed, or if the file belongs to another sweep.
        """
        if not os.path.lexists(self.path):
            return
        if not resume:
            if force:
                os.unlink(self.path)
                return
            raise RequestError(
                f"'{self.path}' contains the results of an interrupted sweep",
                "--resume continues it, and --force starts again",
            )
        try:
            with open(self.path, encoding="utf-8") as file:
                found = json.load(file)
            if found["fingerprint"] == self.fingerprint:
                self.done = set(found["done"])
                self.gathered = Aggregates.of_state(found["gathered"])
                return
        except (OSError, ValueError, TypeError, LookupError):
            pass  # The file was not written by a sweep.
        raise RequestError(
            f"'{self.path}' contains the results of another sweep",
            "give the same file, options and version, or --force to start again",
        )

    def add(self, part: Part) -> None:
        """Add the result of a part, unless it has been added before."""
        if part.part in self.done:
            return
        assert part.gathered is not None  # A sweep with `gather` sets this attribute for each part.
        self.done.add(part.part)
        self.gathered = self.gather.joined(self.gathered, part.gathered)
        if time.monotonic() - self._written_s >= EVERY_S:
            self.write()

    def write(self) -> bool:
        """Write the file.  Returns whether this was possible."""
        self._written_s = time.monotonic()
        state = {
            "fingerprint": self.fingerprint,
            "done": sorted(self.done),
            "gathered": self.gathered.state(),
        }
        try:
            write_durably(json.dumps(state).encode(), self.path)
        except OSError:
            return False
        return True

    def remove(self) -> None:
        """Remove the file."""
        if os.path.lexists(self.path):
            os.unlink(self.path)


def start_aggregation(sweep: Sweep, path: str, *, resume: bool, force: bool) -> Aggregation:
    """The `Aggregation` of a sweep, with the content of the file of an interrupted run.

    Raises
    ------
    RequestError
        In the same cases as `Aggregation.start`.
    """
    assert sweep.gather is not None  # The caller has checked it.
    gathering = Aggregation(sweep.gather, sweep.results, path, sweep.fingerprint())
    gathering.start(resume=resume, force=force)
    return gathering


@contextlib.contextmanager
def kept(gathering: Aggregation | None) -> Iterator[None]:
    """Context manager that writes the file if its block does not complete."""
    try:
        yield
    except BaseException:
        if gathering is not None and gathering.done:
            gathering.write()
        raise
