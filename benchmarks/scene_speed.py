"""Time to compute the statistics of a point cloud and a plan with it, by size of the cloud.

    python benchmarks/scene_speed.py
    python benchmarks/scene_speed.py --tiles 250:5e5 500:2e6 1000:2e7 --runs 3

It writes LAZ tiles of crowns over hilly ground to a temporary folder, and prints a row for each
tile.

One column has the seconds that ``laspy`` takes to read x, y and z of all points (``metres``). Other
columns have the seconds and the peak memory of the complete commands ``aosplan scene TILE --json``
and ``aosplan plan --scene TILE --json``, without the cache. The last columns are for the command
``aosplan scene`` with a crop of 200 m. Times are medians of processor time. Each run is a separate
process on one core.

A second table compares predictions for samples of the targets of the 500 m tile with predictions
for all its targets. It has the largest differences of p, V and V̂ among some plans at 60 m.

It writes benchmarks/results/scene_speed.csv and benchmarks/results/scene_sample.csv.
"""

import argparse
import csv
import multiprocessing
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

import laspy
import numpy as np

RESULTS = Path(__file__).parent / "results"
STRIP_POINTS = 1_000_000
EAST, NORTH = 4e5, 5e6
SAMPLED_SIDE_M = 500

METRES = """
import sys, laspy
with laspy.open(sys.argv[1]) as reader:
    for chunk in reader.chunk_iterator(1_000_000):
        [axis.scaled_array() for axis in (chunk.x, chunk.y, chunk.z)]
"""
OURS = "import sys; from aosplan.cli.app import run; sys.exit(run([*sys.argv[1:], '--json', '--quiet']))"
PLAN = ("plan", "--altitude", "60", "--vhat", "0.7", "--scene")
PLANS = ((4, 1.0), (4, 2.0), (9, 1.5), (16, 5.0), (25, 2.0), (36, 8.0))
"""Samples and baselines for which predictions are compared."""
USED = """
import resource
used = resource.getrusage(resource.RUSAGE_SELF)
print(used.ru_utime + used.ru_stime, used.ru_maxrss, file=sys.stderr)
"""


def write_tile(path: Path, points: int, side_m: float) -> None:
    """Write crowns with a radius of 3 m and a height of 20 m, strip by strip.  There is one tree
    per 72 m².
    """
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(points)
    header = laspy.LasHeader(point_format=6)
    header.scales, header.offsets = np.full(3, 0.001), np.array([EAST, NORTH, 0.0])
    trees = int(side_m**2 / 72.0)
    stems = rng.uniform(0.0, side_m, (trees, 2))
    height = rng.normal(20.0, 4.0, trees).clip(6.0, 34.0)
    radius = rng.normal(3.0, 0.6, trees).clip(1.2, 5.0)
    index = cKDTree(stems)
    strips = max(points // STRIP_POINTS, 1)
    count = points // strips
    with laspy.open(str(path), mode="w", header=header) as file:
        for strip in range(strips):
            x = np.sort(rng.uniform(strip, strip + 1, count)) * (side_m / strips)
            y = rng.uniform(0.0, side_m, count)
            away, tree = index.query(np.column_stack([x, y]), distance_upper_bound=5.0)
            tree = np.minimum(tree, trees - 1)
            share = away / radius[tree]
            canopy = (share < 1.0) & (rng.random(count) < 0.75)
            below = 1.0 - 0.6 * rng.random(count) ** 1.5
            above = height[tree] * below * np.sqrt(1.0 - 0.5 * np.minimum(share, 1.0) ** 2)
            cloud = laspy.ScaleAwarePointRecord.zeros(count, header=header)
            cloud.x, cloud.y = EAST + x, NORTH + y
            ground = 300.0 + 0.08 * x + 10.0 * np.sin(y / 90.0) + rng.normal(0.0, 0.03, count)
            cloud.z = ground + np.where(canopy, above, 0.0)
            cloud.classification = np.where(canopy, 5, 2).astype(np.uint8)
            cloud.return_number = cloud.number_of_returns = np.ones(count, np.uint8)
            cloud.gps_time = x
            file.write_points(cloud)


def measured(script: str, *arguments: str) -> tuple[float, float]:
    """Processor seconds and peak memory [MB] of a script that runs in a separate process."""
    single = dict.fromkeys(
        ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS", "MKL_NUM_THREADS"), "1"
    )
    guarded = f"try:\n    exec({script!r})\nexcept SystemExit as end:\n    assert not end.code\n"
    run = subprocess.run(
        [sys.executable, "-c", f"import sys\n{guarded}{USED}", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        check=True,
        env={**os.environ, **single, "AOSPLAN_CACHE": "0"},
    )
    seconds, kilobytes = run.stderr.splitlines()[-1].split()
    return float(seconds), float(kilobytes) / 1024.0


def sample_rows(path: Path) -> list[list[str]]:
    """Differences between predictions from samples of the targets of a tile and predictions from
    all targets.
    """
    from aosplan.grid.patterns import pattern_for
    from aosplan.models.measured import MeasuredModel
    from aosplan.scenes.files.point_cloud import read_voxels
    from aosplan.scenes.occlusion import Occlusion
    from aosplan.scenes.sampled_targets import SampledOcclusion

    volume = read_voxels(str(path))
    everything = Occlusion(volume, 60.0)
    model = MeasuredModel(volume, 60.0, edges="auto")

    def predictions(occlusion: Occlusion | SampledOcclusion) -> np.ndarray:
        known = model.wrapped()
        known.edges, known.occlusion, known._masks = "auto", occlusion, {}  # noqa: SLF001
        found = [known.predict(pattern_for("trimmed", n), b) for n, b in PLANS]
        return np.array([(each.density, each.expected, each.normalized) for each in found])

    truth = predictions(everything)
    rows = []
    for sample in (100_000, 300_000, 1_000_000):
        sampled = SampledOcclusion(everything, volume, sample)
        worst = np.abs(predictions(sampled) - truth).max(axis=0)
        rows.append(
            [str(everything.targets), str(sampled.targets), *(f"{error:.5f}" for error in worst)]
        )
    return rows


def cells_of(seconds: float, megabytes: float) -> tuple[str, str]:
    """Text of seconds and megabytes for the table."""
    return f"{seconds:.2f}", f"{megabytes:.0f}"


def write_table(name: str, header: list[str], rows: list[list[str]]) -> None:
    """Write a table of results."""
    with (RESULTS / name).open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tiles", nargs="+", default=["250:5e5", "500:2e6", "1000:2e7"])
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    names = "side_m points metres_s scene_s to_metres scene_mb plan_s plan_mb crop_s crop_mb"
    header = names.split()
    print(" ".join(f"{name:>9}" for name in header))
    rows: list[list[str]] = []
    with tempfile.TemporaryDirectory() as folder:
        for tile in options.tiles:
            side, points = (int(float(part)) for part in tile.split(":"))
            path = Path(folder) / f"{side}.laz"
            # The tiles are written by another process, because the peak memory of a child process
            # starts with the peak memory of its parent.
            writer = multiprocessing.get_context("spawn").Process(
                target=write_tile, args=(path, points, side)
            )
            writer.start()
            writer.join()
            low_x, low_y = EAST + side / 2.0 - 100.0, NORTH + side / 2.0 - 100.0
            crop = f"{low_x},{low_y},{low_x + 200.0},{low_y + 200.0}"
            commands = [
                [METRES, str(path)],
                [OURS, "scene", str(path)],
                [OURS, *PLAN, str(path)],
                [OURS, "scene", str(path), "--crop", crop],
            ]
            runs: list[list[tuple[float, float]]] = [[] for _ in commands]
            # The measurements are interleaved, so that changes of the load affect all of them
            # equally.
            for _ in range(options.runs):
                for command, found in zip(commands, runs, strict=True):
                    found.append(measured(*command))
            metres, *ours = (median(seconds for seconds, _ in each) for each in runs)
            peaks = [max(megabytes for _, megabytes in each) for each in runs[1:]]
            cells = [text for pair in zip(ours, peaks, strict=True) for text in cells_of(*pair)]
            cells.insert(1, f"{ours[0] / metres:.2f}")
            rows.append([str(side), str(points), f"{metres:.2f}", *cells])
            print(" ".join(f"{cell:>9}" for cell in rows[-1]), flush=True)
        write_table("scene_speed.csv", header, rows)
        sampled = Path(folder) / f"{SAMPLED_SIDE_M}.laz"
        if sampled.is_file():
            header = ["targets", "sample", "of_p", "of_v", "of_vhat"]
            rows = sample_rows(sampled)
            print(" ".join(f"{name:>9}" for name in header))
            for row in rows:
                print(" ".join(f"{cell:>9}" for cell in row))
            write_table("scene_sample.csv", header, rows)


if __name__ == "__main__":
    main()
