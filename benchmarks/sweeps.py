"""Rate of sweeps:  python benchmarks/sweeps.py [--most 8] [--part growth|kinds|summary|workers]

The results are scenarios per second of processor time on one core, for the best of three runs.
There are four parts:

- **growth**: 10³ to 10^most uniform scenarios of a TOML crossing.  They are computed in memory (b,
  N, V and V̂ as whole columns), written to Parquet as by `aosplan sweep`, and computed with a
  `--where` that keeps no scenario.  Each measurement runs in a process with one thread, whose peak
  memory is measured.  For comparison, there is the paper's Eq. 2 as a double sum, vectorised with
  NumPy over scenarios, and one `aosplan.plan` per scenario;
- **kinds**: data frames of scenarios in which bounds take effect, that have no solution, that use
  layers, or that use voxels.  For comparison, there is one `aosplan.plan` per scenario;
- **summary**: the time of `--summary` with and without a file, from 10⁶ scenarios on;
- **workers**: the same sweep with one worker and with two workers.  The results are the elapsed
  time, which is meaningful only on an idle machine, the total processor time, and the load of the
  machine at the end.

It prints tables, and writes them to benchmarks/results/sweeps*.csv together with a figure of the
growth.
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
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from aosplan.errors import AosplanError
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.sweeps.scenarios import ScenarioProduct, column_of, read_crossing
from aosplan.sweeps.solve_block import USUAL, solve_block
from aosplan.sweeps.vectorized.solve_columns import solve_columns

mpl.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).parent
if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

KEPT = ("baseline_m", "samples", "visibility_expected", "visibility_normalized")

MOST_STORED = 10**8
"""Largest number of scenarios that are written to a file, because more would fill a disk."""

WRITE = """
import os, resource, sys, time
from aosplan.cli.app import run
def taken():
    own, others = os.times()[:2], os.times()[2:4]
    return sum(own) + sum(others)
start, clock = taken(), time.perf_counter()
assert run(["sweep", *sys.argv[1:], "--quiet", "--force"]) == 0
own, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
print(taken() - start, time.perf_counter() - clock, own.ru_maxrss / 1024, others.ru_maxrss / 1024)
"""

DENSE = "density = { start = 0.001, stop = 0.02, count = 5, spacing = 'log' }\n"


def campaign(folder: Path, power: int, more: str = DENSE) -> Path:
    """A crossing of 10^power scenarios.  The altitude varies slowest."""
    path = folder / f"campaign_{power}.toml"
    path.write_text(
        "[sweep]\n"
        f"altitude = {{ start = 45, stop = 120, count = {10 ** (power - 2)} }}\n"
        "vhat = [0.9, '95%', 0.97, 0.98, 0.99]\n"
        f"{more}"
        "occluder_size = [0.1, 0.2, 0.4, 0.5]\n"
        "volume_height = 20\n",
        encoding="utf-8",
    )
    return path


def in_memory(crossing: ScenarioProduct) -> None:
    for index in range(crossing.blocks):
        block = crossing.block(index)
        solved = solve_columns(block, results=KEPT)
        assert solved is not None
        assert solved.holds.all()
        for name in KEPT:
            np.broadcast_to(solved.columns[name], block.shape).reshape(-1)


def double_sum(crossing: ScenarioProduct) -> None:
    """V for 7 x 7 samples at each scenario's p and at d̂ = 1, by Eq. 2 in the form of the paper."""
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


def row_by_row(crossing: ScenarioProduct, most: int = 2000) -> int:
    """Plan evenly spaced scenarios of a crossing one by one, and return their number."""
    block = crossing.block(0)
    chosen = np.unique(np.linspace(0, block.rows - 1, min(block.rows, most)).astype(int))
    for row in chosen.tolist():
        try:
            plan(PlanRequest(**block.request_values(row)))
        except AosplanError:  # A scenario without a solution is also counted.
            continue
    return len(chosen)


def seconds(work: Callable[[], object], times: int = 3) -> float:
    found = []
    for _ in range(times):
        start = time.process_time()
        work()
        found.append(time.process_time() - start)
    return min(found)


def swept(*arguments: str, times: int = 1) -> tuple[float, float, float]:
    """Processor time, elapsed time and peak memory [MB] of a sweep in its own process."""
    environment = os.environ | {"POLARS_MAX_THREADS": "1"}
    command = [sys.executable, "-c", WRITE, *arguments]
    found = [
        tuple(map(float, subprocess.check_output(command, env=environment).split()))
        for _ in range(times)
    ]
    return (
        min(each[0] for each in found),
        min(each[1] for each in found),
        max(max(each[2:]) for each in found),
    )


def growth(folder: Path, most: int) -> None:
    """Rates for different numbers of scenarios."""
    rows = []
    for power in range(3, most + 1):
        path = campaign(folder, power)
        crossing = read_crossing(str(path))
        count = crossing.rows
        assert count == 10**power
        times = 3 if count <= 10**7 else 1
        memory = count / seconds(partial(in_memory, crossing), times)
        out = folder / "r.parquet"
        stored, peak, size = np.nan, np.nan, np.nan
        if count <= MOST_STORED:
            taken, _, peak = swept(str(path), "--out", str(out), times=times)
            stored, size = count / taken, out.stat().st_size / 1e6
            out.unlink()
        where = ("--where", "samples < 1")
        taken, _, lean = swept(str(path), "--out", str(out), *where, times=times)
        out.unlink()
        few = read_crossing(str(campaign(folder, min(power, 6))))
        summed = few.rows / seconds(partial(double_sum, few))
        start = time.process_time()
        planned = row_by_row(crossing) / (time.process_time() - start)
        rows.append((count, memory, stored, count / taken, summed, planned, peak, lean, size))
        print(
            f"10^{power}: in memory {memory:.3g} a second, to Parquet {stored:.3g}, none kept "
            f"{count / taken:.3g}, the double sum {summed:.3g}, plan {planned:.3g}; "
            f"{peak:.0f} and {lean:.0f} MB, a file of {size:.0f} MB",
            flush=True,
        )
    rates = ("in_memory", "to_parquet", "none_kept", "double_sum", "plan_a_row")
    names = ("scenarios", *(f"{name}_per_s" for name in rates))
    write("sweeps.csv", (*names, "peak_mb", "peak_none_kept_mb", "file_mb"), rows)
    draw(rates, rows)


def draw(rates: Sequence[str], rows: Sequence[tuple[float, ...]]) -> None:
    figure, axes = plt.subplots(figsize=(7, 4.2), layout="constrained")
    for place, name in enumerate(rates, 1):
        axes.loglog(
            [row[0] for row in rows],
            [row[place] for row in rows],
            "o-",
            label=name.replace("_", " "),
        )
    axes.set(xlabel="scenarios", ylabel="scenarios a second of one core")
    figure.legend(loc="outside right upper")
    axes.grid(alpha=0.3)
    figure.savefig(HERE / "results" / "sweeps.png", dpi=110, metadata={"Software": None})


def kinds_of(folder: Path) -> dict[str, dict[str, Iterable[Any]]]:
    """Crossings, by the property in which they differ from the plain crossing."""
    sys.path.insert(0, str(HERE.parent / "tests"))
    from support.forests import STANDS, clumped_forest

    from aosplan.scenes.files.voxel_file import VoxelStand, stand_npz

    stand = folder / "stand.npz"
    forest = clumped_forest(STANDS["beech"], side_m=30.0, voxel_m=0.25)
    stand.write_bytes(stand_npz(VoxelStand.of(forest)))
    uniform: dict[str, Iterable[Any]] = {
        "altitude": np.linspace(45.0, 120.0, 500),
        "vhat": [0.9, 0.95, 0.97, 0.98, 0.99],
        "density": np.geomspace(0.001, 0.02, 5),
        "occluder_size": [0.1, 0.2, 0.4, 0.5],
        "volume_height": [20.0],
    }
    absolute = {name: values for name, values in uniform.items() if name != "vhat"}
    targets = np.linspace(0.5, 0.9, 40)
    layered = {"altitude": [40.0, 60.0], "model": ["layered"]}
    measured = {"altitude": [40.0, 60.0], "scene": [str(stand)]}
    return {
        "plain": uniform,
        "an aperture that binds somewhere": uniform | {"max_aperture": [40.0]},
        "an aperture that few targets bear": uniform | {"max_aperture": [10.0]},
        "too few samples": uniform | {"max_samples": [9]},
        "absolute visibility": absolute | {"visibility": [0.3, 0.5, 0.7, 0.9]},
        "a fixed baseline": uniform | {"baseline": [2.5]},
        "both fixed": uniform | {"baseline": [2.5], "samples": [49]},
        "within the canopy": uniform | {"altitude": np.linspace(1.0, 20.0, 500)},
        "nothing hidden": uniform | {"density": [0.0] * 5},
        "lanes": {"altitude": np.linspace(40.0, 120.0, 500), "grid": ["lanes"]},
        "least time": {"altitude": np.linspace(40.0, 120.0, 50), "optimize": ["time"]},
        "layers, targets": layered | {"vhat": targets},
        "layers, samples": layered | {"baseline": [2.0], "samples": range(1, 101)},
        "layers, targets at a baseline": layered | {"baseline": [2.0], "vhat": targets},
        "voxels, targets": measured | {"vhat": np.linspace(0.5, 0.7, 10)},
        "voxels, samples": measured | {"baseline": [1.0], "samples": range(1, 41)},
        "voxels, objectives": measured
        | {"vhat": [0.6], "optimize": ["samples", "aperture", "time"]},
    }


def kinds(folder: Path) -> None:
    """Rates of data frames that are solved together as arrays, or row by row with shared models,
    compared with `plan`.
    """
    rows = []
    for name, axes in kinds_of(folder).items():
        values = {
            option: column_of(
                [each.item() if isinstance(each, np.generic) else each for each in axis]
            )
            for option, axis in axes.items()
        }
        crossing = ScenarioProduct(values)
        block = crossing.block(0)
        solved = solve_columns(block)
        alone = 1.0 if solved is None else float(solved.left.mean())
        slow = alone > 0.0

        def frames(block: Any = block, crossing: ScenarioProduct = crossing) -> None:
            solve_block(block, crossing.names, USUAL)

        rate = block.rows / seconds(frames, 1 if slow else 3)
        most = 8 if "voxels" in name else 200
        start = time.process_time()
        planned = row_by_row(crossing, most) / (time.process_time() - start)
        rows.append((name, block.rows, alone, rate, planned, rate / planned))
        print(
            f"{name}: {rate:.3g} a second, plan {planned:.3g}, {rate / planned:.3g} times; "
            f"{alone:.0%} of {block.rows} by rows",
            flush=True,
        )
    names = ("kind", "scenarios", "share_by_rows", "per_s", "plan_a_row_per_s", "ratio")
    write("sweeps_kinds.csv", names, rows)


def summaries(folder: Path, most: int) -> None:
    """Compare rates and memory of sweeps with a summary and of sweeps whose rows are stored."""
    rows = []
    out = folder / "r.parquet"
    stored = ("--out", str(out))
    for power in range(6, most + 1):
        path, count = str(campaign(folder, power)), 10**power
        found = [
            swept(path, *line, times=3 if power < 8 else 1)
            for line in (stored, (*stored, "--summary"), ("--summary",))
        ]
        out.unlink()
        rates = [count / taken for taken, _, _ in found]
        rows.append((count, *rates, *(peak for _, _, peak in found)))
        print(
            f"10^{power}: stored {rates[0]:.3g} a second, and summarised {rates[1]:.3g}, summarised "
            f"alone {rates[2]:.3g}; {', '.join(f'{peak:.0f}' for _, _, peak in found)} MB",
            flush=True,
        )
    kinds = ("stored", "stored_and_summarised", "summarised")
    names = (*(f"{kind}_per_s" for kind in kinds), *(f"{kind}_peak_mb" for kind in kinds))
    write("sweeps_summary.csv", ("scenarios", *names), rows)


def workers(folder: Path) -> None:
    """Elapsed time with one worker and with two workers."""
    rows = []
    sweeps = {
        "10^7 uniform scenarios": campaign(folder, 7),
        "10^4 scenarios of layers": campaign(
            folder, 4, "density = { start = 0.001, stop = 0.02, count = 5 }\nmodel = 'layered'\n"
        ),
    }
    for name, path in sweeps.items():
        for count in (1, 2):
            out = folder / "r.parquet"
            spent, clock, peak = swept(str(path), "--out", str(out), "--workers", str(count))
            out.unlink()
            rows.append((name, count, clock, spent, peak, os.getloadavg()[0]))
            print(
                f"{name}, {count} workers: {clock:.1f} s by the clock, {spent:.1f} s of processors, "
                f"{peak:.0f} MB",
                flush=True,
            )
    names = ("sweep", "workers", "clock_s", "processors_s", "peak_mb", "load")
    write("sweeps_workers.csv", names, rows)


def write(name: str, names: Sequence[str], rows: Sequence[tuple[Any, ...]]) -> None:
    with open(HERE / "results" / name, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        for row in rows:
            writer.writerow([each if isinstance(each, str) else f"{each:.4g}" for each in row])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--most", type=int, default=8, help="power of ten")
    parser.add_argument("--part", choices=("growth", "kinds", "summary", "workers"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR")) as name:
        folder = Path(name)
        if options.part in (None, "growth"):
            growth(folder, options.most)
        if options.part in (None, "kinds"):
            kinds(folder)
        if options.part in (None, "summary"):
            summaries(folder, options.most)
        if options.part in (None, "workers"):
            workers(folder)


if __name__ == "__main__":
    main()
