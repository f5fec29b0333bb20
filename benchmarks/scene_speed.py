"""How fast a point cloud becomes voxels, against merely decoding it.

    python benchmarks/scene_speed.py
    python benchmarks/scene_speed.py --points 1e6 5e6 2e7 --side 150 --format 6 --ground filter

Writes clouds of a sloping stand (half ground, half crowns) to a temporary folder, as LAZ and as
LAS, and prints a row for each: seconds to go through its chunks with laspy, seconds of
`aosplan.lidar.read_voxels`, their ratio, and the peak memory of the latter.  Every run is a
process of its own; times leave out starting Python and importing libraries, and are medians.
"""

import argparse
import multiprocessing
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

import laspy
import numpy as np

BARE = """
import sys, time, laspy
start = time.perf_counter()
with laspy.open(sys.argv[1]) as reader:
    for chunk in reader.chunk_iterator(1_000_000):
        chunk.x, chunk.y, chunk.z
print(time.perf_counter() - start, 0)
"""
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
    x, y = np.sort(rng.uniform(0.0, side_m, points)), rng.uniform(0.0, side_m, points)
    gap = np.abs(np.sin(np.pi * x / 6.0) * np.sin(np.pi * y / 6.0)) < 0.4
    canopy = ~gap & (rng.random(points) < 0.8)
    height = np.where(canopy, 6.0 + 14.0 * rng.random(points), 0.0)
    header = laspy.LasHeader(point_format=point_format)
    header.scales, header.offsets = np.full(3, 0.001), np.array([4e5, 5e6, 0.0])
    cloud = laspy.LasData(header)
    cloud.x, cloud.y = 4e5 + x, 5e6 + y
    cloud.z = 500.0 + 0.2 * x + height + rng.normal(0.0, 0.01, points)
    cloud.classification = np.where(canopy, 5, 2).astype(np.uint8)
    cloud.intensity = rng.integers(0, 65535, points).astype(np.uint16)
    if "gps_time" in cloud.point_format.dimension_names:
        cloud.gps_time = np.arange(points) * 1e-6
    cloud.write(str(path))


def measured(script: str, *arguments: str) -> tuple[float, float]:
    """Run a script; return the seconds and megabytes that it prints."""
    run = subprocess.run(
        [sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=True
    )
    seconds, megabytes = run.stdout.split()
    return float(seconds), float(megabytes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=float, nargs="+", default=[1e6, 5e6, 1e7])
    parser.add_argument("--side", type=float, default=100.0, help="metres")
    parser.add_argument("--format", type=int, default=6, help="point format of LAS")
    parser.add_argument("--ground", default="auto")
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()

    print(f"{'points':>10} {'file':>5} {'bare s':>8} {'ours s':>8} {'ratio':>6} {'peak MB':>8}")
    with tempfile.TemporaryDirectory() as folder:
        for points in map(int, options.points):
            for suffix in ("laz", "las"):
                path = Path(folder) / f"stand.{suffix}"
                # A process hands its peak memory down to its children: let another one write.
                writer = multiprocessing.get_context("spawn").Process(
                    target=write_stand, args=(path, points, options.side, options.format)
                )
                writer.start()
                writer.join()
                bare = median(measured(BARE, str(path))[0] for _ in range(options.runs))
                runs = [measured(OURS, str(path), options.ground) for _ in range(options.runs)]
                ours, megabytes = median(run[0] for run in runs), max(run[1] for run in runs)
                print(
                    f"{points:10d} {suffix:>5} {bare:8.3f} {ours:8.3f} {ours / bare:6.2f} "
                    f"{megabytes:8.0f}",
                    flush=True,
                )
                path.unlink()


if __name__ == "__main__":
    main()
