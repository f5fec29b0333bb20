"""Files of src/aosplan in which a function is called, for each of several trips from a request to a
result.

Run: python benchmarks/trips.py [--files TRIP] [--scene CLOUD.npz]

Each trip runs twice, and the second run counts, so that imports are left out.  "Changes" is the
number of calls of a function whose file is not the file of the previous call.  ``--files`` lists
the files of one trip in the order in which they are entered, with the functions that are called.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import sys
from typing import TYPE_CHECKING

import aosplan
from aosplan.cli.app import run
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.planning.resolve import resolve_inputs
from aosplan.planning.solved_plan import Memo, best_alternative, problem_of, solve_inputs

if TYPE_CHECKING:
    from collections.abc import Callable

SOURCE = os.path.dirname(aosplan.__file__) + os.sep


def command(*more: str) -> None:
    with contextlib.redirect_stdout(io.TextIOWrapper(io.BytesIO())):
        assert run(["plan", "--altitude", "40", "--vhat", "0.98", *more]) == 0


def trips(scene: str | None) -> dict[str, Callable[[], object]]:
    request = PlanRequest(altitude=40.0, vhat=0.98)
    inputs = resolve_inputs(request)
    posed = problem_of(inputs, Memo())
    assert posed is not None
    found: dict[str, Callable[[], object]] = {
        "command": command,
        "json": lambda: command("--json"),
        "python": lambda: aosplan.plan(altitude=40.0, vhat=0.98),
        "plan": lambda: plan(request),
        "resolve and solve": lambda: solve_inputs(resolve_inputs(request)),
        "solve": lambda: best_alternative(inputs, posed[0]),
        "sweep": lambda: aosplan.sweep({"altitude": [40.0], "vhat": [0.98]}),
    }
    if scene is not None:
        found["scene"] = lambda: aosplan.plan(scene=scene, altitude=60.0, vhat=0.8)
    return found


def followed(trip: Callable[[], object]) -> tuple[dict[str, list[str]], int]:
    """The functions that a trip calls, by file, and the number of changes of the file."""
    trip()
    entered: dict[str, list[str]] = {}
    changes, last = 0, ""

    def note(frame, event, _argument) -> None:
        nonlocal changes, last
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(SOURCE):
            name = code.co_filename.removeprefix(SOURCE)
            entered.setdefault(name, []).append(code.co_qualname)
            changes += name != last
            last = name

    sys.setprofile(note)
    try:
        trip()
    finally:
        sys.setprofile(None)
    return entered, changes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", metavar="TRIP")
    parser.add_argument("--scene", metavar="CLOUD.npz")
    options = parser.parse_args()
    print(f"{'trip':20} {'files':>5} {'changes':>7}")
    for name, trip in trips(options.scene).items():
        entered, changes = followed(trip)
        print(f"{name:20} {len(entered):5} {changes:7}")
        if name == options.files:
            for place, functions in entered.items():
                print(f"    {place}: {', '.join(dict.fromkeys(functions))}")


if __name__ == "__main__":
    main()
