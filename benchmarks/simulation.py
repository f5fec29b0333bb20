"""The simulator compared with Embree, and its scaling:  python benchmarks/simulation.py [CLOUD.laz]

1.  The simulator and Embree are compared for the voxels of one stand, with 49 views from 50 m that
    are 1 to 3.5 m apart, in one thread. The results are the rays per second; the error of V
    relative to Embree with 7 x 7 targets per voxel (root mean square over three baselines and two
    headings); and the time of Embree for the same error, divided by the time of the simulator.
    Without Embree
   (``pip install embreex``), this part is left out.
2.  Time and memory for increasing numbers of targets, views and slices, up to 10⁴ x 10⁴ targets.
   Each simulation runs in a separate process.

It takes some minutes, prints tables, and writes them to benchmarks/results/ together with figures.
"""

import argparse
import csv
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "tests")]
from measured import ALTITUDE_M, Occluded, rays_of  # noqa: E402
from support.forests import STANDS, clumped_forest  # noqa: E402 (their folders have to be on the path)

from aosplan.grid.patterns import Pattern, local_sites  # noqa: E402
from aosplan.scenes.voxels import VoxelVolume  # noqa: E402
from aosplan.simulation.forests import generator  # noqa: E402
from aosplan.simulation.moments import estimate  # noqa: E402
from aosplan.simulation.voxel_views import VoxelViews  # noqa: E402

mpl.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402

PATTERN = Pattern(7, 7)
FLIGHTS = ((1.0, 0.0), (1.0, 30.0), (2.0, 0.0), (2.0, 30.0), (3.5, 0.0), (3.5, 30.0))
"""Pairs of baseline [m] and heading [deg].  The time is measured for the fifth pair."""

SETTINGS = {"aosplan": (1, 2, 3, 4, 6), "Embree": (0.25, 0.5, 1, 2, 4)}
TRUTH = 7
RUNS = 3


class Row(NamedTuple):
    """One method at one number of targets per voxel along an axis."""

    stand: str
    view: str
    method: str
    targets_per_voxel: float
    seconds: float
    rays_per_second: float
    error_v: float


class Growth(NamedTuple):
    """One size of a simulation of a uniform forest."""

    varied: str
    targets: int
    views: int
    slices: int
    seconds: float
    rays_per_second: float
    volume_mb: float
    added_mb: float


def best_time(call: Callable[[], object]) -> float:
    """Shortest processor time [s] of several calls.  Other processes do not count."""
    times = []
    for _ in range(RUNS):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return min(times)


def sites(baseline_m: float, heading_deg: float, pattern: Pattern = PATTERN) -> np.ndarray:
    return np.column_stack(local_sites(pattern, baseline_m, heading_deg))


# --- Against Embree ------------------------------------------------------------------------


def by_aosplan(volume: VoxelVolume, view: str, per_voxel: int):
    def visibility(flight: tuple[float, float]) -> tuple[float, int]:
        views = VoxelViews(volume, ALTITUDE_M, view=view, targets_per_voxel=per_voxel)
        counts = views.counts(sites(*flight))
        return estimate([counts], one_plot=True).expected, counts.views * counts.targets

    return visibility


def by_embree(occluded: Occluded, volume: VoxelVolume, view: str, per_voxel: float):
    _, rows, columns = volume.occupied.shape
    along = [(np.arange(int(n * per_voxel)) + 0.5) / per_voxel for n in (columns, rows)]
    x, y = (axis.ravel() * volume.voxel_m for axis in np.meshgrid(*along))
    rays = np.zeros((x.size, 6), dtype=np.float32)
    rays[:, 0], rays[:, 1], rays[:, 5] = x, y, ALTITUDE_M
    width, depth = volume.size_m

    def visibility(flight: tuple[float, float]) -> tuple[float, int]:
        count = np.zeros(x.size)
        for east, north in sites(*flight).tolist():
            rays[:, 3] = east if view == "telecentric" else 0.5 * width + east - x
            rays[:, 4] = north if view == "telecentric" else 0.5 * depth + north - y
            count += occluded(rays)
        mean = count / PATTERN.samples
        return 1.0 - float((mean * mean).mean()), x.size * PATTERN.samples

    return visibility


def against_embree(volume: VoxelVolume, name: str) -> list[Row]:
    reach_m = 0.8 * PATTERN.longer_side * max(FLIGHTS)[0] * volume.canopy_top_m / ALTITUDE_M
    occluded = rays_of(volume, reach_m)
    if occluded is None:
        return []
    rows = []
    print(f"{'view':12} {'method':8} {'k':>5} {'ms':>9} {'rays/s':>10} {'error of V':>10}")
    for view in ("telecentric", "perspective"):
        truth = [by_embree(occluded, volume, view, TRUTH)(each)[0] for each in FLIGHTS]
        for method, settings in SETTINGS.items():
            for per_voxel in settings:
                ask = (
                    by_aosplan(volume, view, int(per_voxel))
                    if method == "aosplan"
                    else by_embree(occluded, volume, view, per_voxel)
                )
                errors = [ask(each)[0] - v for each, v in zip(FLIGHTS, truth, strict=True)]
                error = float(np.sqrt(np.mean(np.square(errors))))
                rays = ask(FLIGHTS[4])[1]
                seconds = best_time(lambda ask=ask: ask(FLIGHTS[4]))
                row = Row(name, view, method, per_voxel, seconds, rays / seconds, error)
                rows.append(row)
                print(
                    f"{view:12} {method:8} {per_voxel:5g} {seconds * 1e3:9.1f} "
                    f"{row.rays_per_second:10.3g} {error:10.6f}",
                    flush=True,
                )
    return rows


def claims(rows: list[Row]) -> list[str]:
    """Sentences that summarize the table."""
    lines = []
    for view in ("telecentric", "perspective"):
        mine, other = (
            {row.targets_per_voxel: row for row in rows if (row.view, row.method) == (view, name)}
            for name in ("aosplan", "Embree")
        )
        lines.append(
            f"{view}, 4 x 4 targets a voxel: {mine[4].rays_per_second / 1e6:.0f} million rays/s, "
            f"{mine[4].rays_per_second / other[4].rays_per_second:.0f} times Embree's; "
            f"error of V {mine[4].error_v:.5f}"
        )
        # Single errors vary by chance. A line is therefore fitted to all points of Embree.
        fit = np.polyfit(*np.log([[row.error_v, row.seconds] for row in other.values()]).T, 1)
        for row in mine.values():
            seconds = float(np.exp(np.polyval(fit, np.log(row.error_v))))
            lines.append(
                f"  to an error of {row.error_v:.5f} ({row.targets_per_voxel:g} x "
                f"{row.targets_per_voxel:g}): {seconds / row.seconds:.1f} times less time"
            )
    return lines


# --- Growth --------------------------------------------------------------------------------


def megabytes() -> float:
    """Peak memory of this process.  `getrusage` is used only if /proc cannot be read, because its
    value for a child starts with the peak of the parent.
    """
    try:
        with open("/proc/self/status", encoding="ascii") as file:
            held = next(line for line in file if line.startswith("VmHWM"))
        return int(held.split()[1]) / 1024
    except OSError:
        scale = 1024 if sys.platform == "darwin" else 1
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 / scale


def measure(side: int, slices: int, views_side: int) -> dict[str, float]:
    """One simulation of side x side targets, in this process."""
    voxels = side // 4
    occupied = np.zeros((slices, voxels, voxels), dtype=bool)
    for plane in occupied:
        plane[...] = generator(2).random(plane.shape, dtype=np.float32) < 0.01
    volume = VoxelVolume(occupied, 1.0)
    before = megabytes()
    start = time.process_time()
    views = VoxelViews(volume, 2.5 * slices)
    counts = views.counts(sites(0.37 * slices / views_side, 0.0, Pattern(views_side, views_side)))
    seconds = time.process_time() - start
    return {
        "targets": counts.targets,
        "views": counts.views,
        "slices": slices,
        "seconds": seconds,
        "rays_per_second": counts.targets * counts.views / seconds,
        "volume_mb": occupied.nbytes / 2**20,
        "added_mb": max(megabytes() - before, 0.0),
    }


def growth() -> list[Growth]:
    cases = [("targets", side, 40, 7) for side in (500, 1000, 2000, 4000, 10_000)]
    cases += [("slices", 1000, slices, 7) for slices in (10, 20, 80, 160)]
    cases += [("views", 1000, 40, side) for side in (2, 4, 14, 28)]
    rows = []
    print(
        f"{'varied':8} {'targets':>10} {'views':>5} {'slices':>6} {'s':>7} {'rays/s':>9} {'MB':>6}"
    )
    for varied, *size in cases:
        arguments = [sys.executable, str(Path(__file__)), "--measure", *map(str, size)]
        done = subprocess.run(arguments, capture_output=True, text=True, check=True)
        row = Growth(varied=varied, **json.loads(done.stdout))
        rows.append(row)
        print(
            f"{varied:8} {row.targets:10} {row.views:5} {row.slices:6} {row.seconds:7.2f} "
            f"{row.rays_per_second:9.3g} {row.added_mb:6.0f}",
            flush=True,
        )
    return rows


def draw_rows(rows: list[Row], title: str, path: Path) -> None:
    figure, panel = plt.subplots(figsize=(6.5, 4.5), layout="constrained")
    for view, style in (("telecentric", "o-"), ("perspective", "s--")):
        for method, colour in (("aosplan", "C0"), ("Embree", "C1")):
            chosen = [row for row in rows if (row.view, row.method) == (view, method)]
            points = [(row.seconds, row.error_v) for row in chosen]
            label = f"{method}, {view}"
            panel.loglog(*zip(*points, strict=True), style, c=colour, label=label)
    panel.legend(fontsize=8)
    panel.set(
        xlabel="run time of 49 views [s]", ylabel="error of V (RMS over six flights)", title=title
    )
    panel.grid(visible=True, which="major", alpha=0.3)
    figure.savefig(path, dpi=110)


def draw_growth(sizes: list[Growth], path: Path) -> None:
    figure, panels = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for varied in ("targets", "views", "slices"):
        chosen = [row for row in sizes if row.varied == varied]
        chosen += [row for row in sizes if (row.targets, row.views, row.slices) == (10**6, 49, 40)]
        chosen.sort(key=lambda row: getattr(row, varied))
        numbers, seconds = zip(
            *((getattr(row, varied), row.seconds) for row in chosen), strict=True
        )
        panels[0].loglog(numbers, seconds, "o-", label=varied)
    panels[0].set(xlabel="number of the one that varies", ylabel="run time [s]")
    panels[0].set(title="perspective, 10⁶ targets, 49 views, 40 slices, but one")
    chosen = [row for row in sizes if row.varied == "targets"]
    targets = [row.targets for row in chosen]
    panels[1].loglog(targets, [row.added_mb for row in chosen], "o-", label="the simulation adds")
    panels[1].loglog(targets, [row.volume_mb for row in chosen], "s--", label="the volume itself")
    panels[1].set(xlabel="targets", ylabel="memory [MB]", title="49 views, 40 slices")
    for panel in panels:
        panel.legend(fontsize=8)
        panel.grid(visible=True, which="major", alpha=0.3)
    figure.savefig(path, dpi=110)


def write(name: str, kind: type, rows: list) -> None:
    with open(HERE / "results" / name, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(kind._fields)
        writer.writerows([f"{v:.6g}" if isinstance(v, float) else v for v in row] for row in rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cloud", nargs="?", help="a .las or .laz file; generated without")
    parser.add_argument("--measure", nargs=3, type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        print(json.dumps(measure(*options.measure)))
        return
    if options.cloud:
        from aosplan.scenes.files.point_cloud import read_voxels

        volume = read_voxels(options.cloud, voxel_m=0.25, min_height_m=0.5)
        name = Path(options.cloud).stem
    else:
        volume, name = clumped_forest(STANDS["spruce"]), "generated spruce"
    rows = against_embree(volume, name)
    said = claims(rows) if rows else []
    print("\n".join(said))
    sizes = growth()
    results = HERE / "results"
    results.mkdir(exist_ok=True)
    stem = f"simulation_{name.replace(' ', '_')}"
    if rows:
        write(f"{stem}.csv", Row, rows)
        (results / f"{stem}.txt").write_text("\n".join(said) + "\n", encoding="utf-8")
        draw_rows(rows, name, results / f"{stem}.png")
    write("simulation_growth.csv", Growth, sizes)
    draw_growth(sizes, results / "simulation_growth.png")


if __name__ == "__main__":
    main()
