"""Time to compute the statistics of a national tile by its size, and the error of sampled targets.

    python benchmarks/scene_tiles.py
    python benchmarks/scene_tiles.py --tiles 250:5e5 500:2e6 1000:2e7 --runs 3

It writes tiles of crowns over rolling ground to a temporary folder, as LAZ, and prints a row for
each.  The columns are the seconds that ``laspy`` takes to read x, y and z of all points
(``metres``); seconds and peak memory of the whole command ``aosplan scene TILE --json``, including
its start, without the cache; and the same with a crop of 200 m.  Seconds are processor time, the
medians of separate processes on one core that run in turn.

A second table compares a sample of about a million targets with all targets of the 500 m tile, for
twelve views up to 30° off nadir.  It has the largest and the root mean square difference of the
share of targets that two views both hide, over all pairs of views, and the difference of V of these
twelve photos.

It writes benchmarks/results/scene_tiles.csv and benchmarks/results/scene_sample.csv.
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
OURS = "import sys; from aosplan.cli.app import run; sys.exit(run(['scene', *sys.argv[1:], '--json', '--quiet']))"
USED = """
import resource
used = resource.getrusage(resource.RUSAGE_SELF)
print(used.ru_utime + used.ru_stime, used.ru_maxrss, file=sys.stderr)
"""


def write_tile(path: Path, points: int, side_m: float) -> None:
    """Write crowns with a radius of 3 m and a height of 20 m, one tree per 72 m², strip by strip."""
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
    """Processor seconds and peak memory [MB] of a script in its own process."""
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
    """Differences between a sample of the targets of a tile and all of them."""
    from aosplan.scenes.files.point_cloud import read_voxels
    from aosplan.scenes.occlusion import Occlusion, joint_counts
    from aosplan.scenes.sampled_targets import SampledOcclusion

    volume = read_voxels(str(path))
    everything = Occlusion(volume, 100.0)
    rng = np.random.default_rng(1)
    turn, slope = rng.uniform(0.0, 2.0 * np.pi, 12), np.tan(np.radians(rng.uniform(0.0, 30.0, 12)))
    positions = 100.0 * slope[:, np.newaxis] * np.column_stack([np.sin(turn), np.cos(turn)])
    joint = joint_counts(everything.masks(positions)) / everything.targets
    rows = []
    for sample in (100_000, 300_000, 1_000_000):
        sampled = SampledOcclusion(everything, volume, sample)
        error = joint_counts(sampled.masks(positions)) / sampled.targets - joint
        rows.append(
            [
                str(everything.targets),
                str(sampled.targets),
                f"{np.abs(error).max():.5f}",
                f"{np.sqrt((error**2).mean()):.5f}",
                f"{abs(error.mean()):.5f}",
                f"{1.0 - joint.mean():.3f}",
            ]
        )
    return rows


def write_table(name: str, header: list[str], rows: list[list[str]]) -> None:
    """Write a table of results."""
    with (RESULTS / name).open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tiles", nargs="+", default=["250:5e5", "500:2e6", "1000:2e7"])
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    header = [
        "side_m",
        "points",
        "metres_s",
        "scene_s",
        "to_metres",
        "peak_mb",
        "crop_s",
        "crop_mb",
    ]
    print(" ".join(f"{name:>9}" for name in header))
    rows: list[list[str]] = []
    with tempfile.TemporaryDirectory() as folder:
        for tile in options.tiles:
            side, points = (int(float(part)) for part in tile.split(":"))
            path = Path(folder) / f"{side}.laz"
            # A child starts with its parent's peak memory, so another process writes.
            writer = multiprocessing.get_context("spawn").Process(
                target=write_tile, args=(path, points, side)
            )
            writer.start()
            writer.join()
            low_x, low_y = EAST + side / 2.0 - 100.0, NORTH + side / 2.0 - 100.0
            crop = f"{low_x},{low_y},{low_x + 200.0},{low_y + 200.0}"
            runs: list[list[tuple[float, float]]] = [[], [], []]
            for _ in range(options.runs):  # in turn, so that changes of the load affect all alike
                runs[0].append(measured(METRES, str(path)))
                runs[1].append(measured(OURS, str(path)))
                runs[2].append(measured(OURS, str(path), "--crop", crop))
            metres, scene, part = (median(seconds for seconds, _ in each) for each in runs)
            peak, part_peak = (max(megabytes for _, megabytes in each) for each in runs[1:])
            numbers = f"{metres:.2f}", f"{scene:.2f}", f"{scene / metres:.2f}", f"{peak:.0f}"
            rows.append([str(side), str(points), *numbers, f"{part:.2f}", f"{part_peak:.0f}"])
            print(" ".join(f"{cell:>9}" for cell in rows[-1]), flush=True)
        write_table("scene_tiles.csv", header, rows)
        sampled = Path(folder) / f"{SAMPLED_SIDE_M}.laz"
        if sampled.is_file():
            header = ["targets", "sample", "largest_j", "rms_j", "of_v", "v"]
            rows = sample_rows(sampled)
            print(" ".join(f"{name:>9}" for name in header))
            for row in rows:
                print(" ".join(f"{cell:>9}" for cell in row))
            write_table("scene_sample.csv", header, rows)


if __name__ == "__main__":
    main()
