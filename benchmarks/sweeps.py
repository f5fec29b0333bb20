"""Rate of sweeps:  python benchmarks/sweeps.py [--most 7]

Uniform scenarios from a TOML crossing, 10³ to 10^most of them:

- in memory: b, N, V and V̂ of each as whole columns;
- to Parquet, as `aosplan sweep` writes it, in a process of one thread;
- the paper's Eq. 2 as a double sum, vectorised with NumPy over scenarios;
- `aosplan.plan` once a scenario.

Scenarios a second by one core, the best of three; memory of the process that writes.  Prints a table and
writes it to benchmarks/results/sweeps.csv.
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aosplan.planning import plan
from aosplan.request import PlanRequest
from aosplan.sweep.columns import solve_columns
from aosplan.sweep.scenarios import read_crossing

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.sweep.scenarios import Crossing

HERE = Path(__file__).parent
KEPT = ("baseline_m", "samples", "visibility_expected", "visibility_normalized")

WRITE = """
import resource, sys, time
from aosplan.cli.app import run
start = time.process_time()
assert run(["sweep", sys.argv[1], "--out", sys.argv[2], "--quiet", "--force"]) == 0
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(time.process_time() - start, peak)
"""


def campaign(folder: Path, power: int) -> Path:
    """A crossing of 10^power scenarios, altitude the slowest."""
    path = folder / f"campaign_{power}.toml"
    path.write_text(
        "[sweep]\n"
        f"altitude = {{ start = 45, stop = 120, count = {10 ** (power - 2)} }}\n"
        "vhat = [0.9, '95%', 0.97, 0.98, 0.99]\n"
        "density = { start = 0.001, stop = 0.02, count = 5, spacing = 'log' }\n"
        "occluder_size = [0.1, 0.2, 0.4, 0.5]\n"
        "volume_height = 20\n",
        encoding="utf-8",
    )
    return path


def in_memory(crossing: Crossing) -> None:
    for index in range(crossing.blocks):
        block = crossing.block(index)
        solved = solve_columns(block)
        assert solved is not None
        for name in KEPT:
            np.broadcast_to(solved.columns[name], block.shape).reshape(-1)


def double_sum(crossing: Crossing) -> None:
    """V of Eq. 2 for 7 x 7 samples at each scenario's p and d̂ = 1, as the paper writes it."""
    i, j = np.meshgrid(np.arange(7.0), np.arange(7.0), indexing="ij")
    for index in range(crossing.blocks):
        block = crossing.block(index)
        p = block.flat("density") * 20.0
        dhat = np.ones(block.rows)
        for start in range(0, block.rows, 16384):
            part = dhat[start : start + 16384, None, None]
            pairs = (
                (7.0 - i) * (7.0 - j) * np.maximum(1 - i * part, 0) * np.maximum(1 - j * part, 0)
            )
            pairs *= np.where(i > 0, 2.0, 1.0) * np.where(j > 0, 2.0, 1.0)
            shortfall = pairs.sum(axis=(1, 2)) / 49.0**2
            density = p[start : start + 16384]
            _ = 1.0 - density * (density + (1.0 - density) * shortfall)


def row_by_row(crossing: Crossing) -> None:
    block = crossing.block(0)
    for row in range(min(block.rows, 2000)):
        plan(PlanRequest(**block.request_values(row)))


def seconds(work: Callable[[], None]) -> float:
    found = []
    for _ in range(3):
        start = time.process_time()
        work()
        found.append(time.process_time() - start)
    return min(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--most", type=int, default=7, help="power of ten")
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for power in range(3, options.most + 1):
            path = campaign(Path(folder), power)
            crossing = read_crossing(str(path))
            assert crossing.rows == 10**power
            memory = crossing.rows / seconds(partial(in_memory, crossing))
            command = [sys.executable, "-c", WRITE, str(path), str(Path(folder) / "r.parquet")]
            environment = os.environ | {"POLARS_MAX_THREADS": "1"}
            written = [
                tuple(map(float, subprocess.check_output(command, env=environment).split()))
                for _ in range(3)
            ]
            paper = min(crossing.rows, 10**6)
            few = read_crossing(str(campaign(Path(folder), round(np.log10(paper)))))
            summed = few.rows / seconds(partial(double_sum, few))
            planned = min(crossing.rows, 2000) / seconds(partial(row_by_row, crossing))
            rate = crossing.rows / min(taken for taken, _ in written)
            peak = max(peak for _, peak in written)
            rows.append((10**power, memory, rate, summed, planned, peak))
            print(
                f"10^{power}: in memory {memory:.3g} a second, to Parquet {rate:.3g}, the double "
                f"sum {summed:.3g}, plan {planned:.3g}; {peak:.0f} MB",
                flush=True,
            )
    with open(HERE / "results" / "sweeps.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        names = ("in_memory", "to_parquet", "double_sum", "plan_a_row")
        writer.writerow(("scenarios", *(f"{name}_per_s" for name in names), "peak_mb"))
        writer.writerows(tuple(f"{value:.4g}" for value in row) for row in rows)


if __name__ == "__main__":
    main()
