"""Time to convert a point cloud to voxels, relative to the time to read it.

    python benchmarks/scene_speed.py
    python benchmarks/scene_speed.py --points 1e6 5e6 2e7 --side 150 --format 6 --ground filter

It writes clouds of a stand on a slope (half ground, half crowns) to a temporary folder, as LAZ and
as LAS, and prints a row for each.  The columns are the seconds to read all chunks with laspy
(``chunks``); the seconds with x, y and z of every point as arrays of metres in addition
(``metres``); the seconds of `aosplan.scenes.files.point_cloud.read_voxels`; its ratio to both; and
its peak memory.  Each run is a process of its own.  Times are medians without the start of Python
and imports.  For an uncompressed file, ``chunks`` is just a copy of its bytes.

It writes benchmarks/results/scene_speed.csv.
"""

import argparse
import csv
import multiprocessing
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path
from statistics import median

import laspy
import numpy as np

RESULTS = Path(__file__).parent / "results" / "scene_speed.csv"
STRIP_POINTS = 2_000_000

CHUNKS = """
import sys, time, laspy
start = time.perf_counter()
with laspy.open(sys.argv[1]) as reader:
    for chunk in reader.chunk_iterator(1_000_000):
        pass
print(time.perf_counter() - start, 0)
"""
METRES = CHUNKS.replace("pass", "[axis.scaled_array() for axis in (chunk.x, chunk.y, chunk.z)]")
OURS = """
import resource, sys, time, laspy, scipy.spatial
from aosplan.lidar import read_voxels
start = time.perf_counter()
read_voxels(sys.argv[1], ground=sys.argv[2])
seconds = time.perf_counter() - start
print(seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def write_stand(path: Path, points: int, side_m: float, point_format: int) -> None:
    """Write crowns of 6 m over a slope of 20 %, scanned strip by strip."""
    rng = np.random.default_rng(points)
    header = laspy.LasHeader(point_format=point_format)
    header.scales, header.offsets = np.full(3, 0.001), np.array([4e5, 5e6, 0.0])
    strips = np.linspace(0.0, side_m, max(points // STRIP_POINTS, 1) + 1)
    with laspy.open(str(path), mode="w", header=header) as file:
        for west, east in pairwise(strips):
            count = points // (len(strips) - 1)
            x, y = np.sort(rng.uniform(west, east, count)), rng.uniform(0.0, side_m, count)
            gap = np.abs(np.sin(np.pi * x / 6.0) * np.sin(np.pi * y / 6.0)) < 0.4
            canopy = ~gap & (rng.random(count) < 0.8)
            height = np.where(canopy, 6.0 + 14.0 * rng.random(count), 0.0)
            cloud = laspy.ScaleAwarePointRecord.zeros(count, header=header)
            cloud.x, cloud.y = 4e5 + x, 5e6 + y
            cloud.z = 500.0 + 0.2 * x + height + rng.normal(0.0, 0.01, count)
            cloud.classification = np.where(canopy, 5, 2).astype(np.uint8)
            cloud.intensity = rng.integers(0, 65535, count).astype(np.uint16)
            if "gps_time" in cloud.point_format.dimension_names:
                cloud.gps_time = x
            file.write_points(cloud)


def measured(script: str, *arguments: str) -> tuple[float, float]:
    """Run a script; return the seconds and megabytes that it prints."""
    run = subprocess.run(
        [sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=True
    )
    seconds, megabytes = run.stdout.split()
    return float(seconds), float(megabytes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=float, nargs="+", default=[1e6, 1e7, 5e7])
    parser.add_argument("--side", type=float, default=100.0, help="metres")
    parser.add_argument("--format", type=int, default=6, help="point format of LAS")
    parser.add_argument("--ground", default="auto")
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()

    header = [
        "points",
        "file",
        "chunks_s",
        "metres_s",
        "ours_s",
        "to_chunks",
        "to_metres",
        "peak_mb",
    ]
    print(" ".join(f"{name:>9}" for name in header))
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for points in map(int, options.points):
            for suffix in ("laz", "las"):
                path = Path(folder) / f"stand.{suffix}"
                # A child starts with its parent's peak memory, so another process writes.
                writer = multiprocessing.get_context("spawn").Process(
                    target=write_stand, args=(path, points, options.side, options.format)
                )
                writer.start()
                writer.join()
                runs: dict[str, list[tuple[float, float]]] = {CHUNKS: [], METRES: [], OURS: []}
                # in turn, so that changes of the load affect all alike
                for _ in range(options.runs):
                    for script, times in runs.items():
                        times.append(measured(script, str(path), options.ground))
                chunks, metres, ours = (median(s for s, _ in times) for times in runs.values())
                peak = max(megabytes for _, megabytes in runs[OURS])
                numbers = (chunks, metres, ours, ours / chunks, ours / metres)
                rows.append([points, suffix, *(f"{n:.3f}" for n in numbers), f"{peak:.0f}"])
                print(" ".join(f"{cell:>9}" for cell in rows[-1]), flush=True)
                path.unlink()
    with RESULTS.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


if __name__ == "__main__":
    main()
