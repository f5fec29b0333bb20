"""Run time and error of all methods to compute V̂:  python benchmarks/every_way.py [CLOUD.laz]

V̂ is computed for 49 views that are 1 m or 2.8 m apart, with targets at the centre of the aperture,
from 40 m above

- a uniform scene, the paper's forest,
- a layered scene, `examples/stand.toml`,
- a real stand from the point cloud, or generated trees if no cloud is given. The methods are the
  uniform model, the layered model, the measured model, and the simulation. For the first two
  scenes, the measured model uses one random plot. The simulation has several numbers of volumes, or
  of targets for the real stand. The error is the larger of the errors at the two baselines. For
  simulations, it is the root mean square over seeds. The reference is a simulation with many more
  volumes. Its standard error is drawn as a dotted line. For the real stand, the reference is
  computed from all voxels, with 12 x 12 targets each. Times are for one prediction with the scene
  in memory. They are processor times, and the median of three runs.

It takes some minutes, prints a table, and writes it to benchmarks/results/ together with a figure.
"""

import argparse
import csv
import statistics
import sys
import time
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np

from aosplan import PlanRequest, plan
from aosplan.camera.disparity import coverage_baseline
from aosplan.grid.patterns import Pattern, local_sites
from aosplan.models.layered import LayeredModel
from aosplan.models.measured import MeasuredModel
from aosplan.models.uniform import UniformModel
from aosplan.planning.result import Plan
from aosplan.scenes.occluder_statistics import layered_scene
from aosplan.scenes.voxels import VoxelVolume
from aosplan.simulation.compare import Settings, simulate
from aosplan.simulation.forests import generator, layered_forest
from aosplan.simulation.moments import estimate
from aosplan.simulation.voxel_views import VoxelViews, blocks

mpl.use("Agg")
from matplotlib import pyplot as plt

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests"))
from support.forests import STANDS, clumped_forest  # noqa: E402 (its folder has to be on the path first)

ALTITUDE_M = 40.0
PATTERN = Pattern(7, 7)
BASELINES_M = (1.0, 2.8)
PLOT_M = (30.0, 30.0)
VOLUMES = (4, 16, 64)
SEEDS = 4
TRUTH_VOLUMES = 240
TRUTH_SEED = 10_001


class Row(NamedTuple):
    """One method to compute V̂ of one scene."""

    scene: str
    method: str
    setting: str
    seconds: float
    error_vhat: float


def median_time(call: Callable[[], object]) -> float:
    times = []
    for _ in range(3):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return statistics.median(times)


def plans(scene: str | None) -> list[Plan]:
    flight = {"altitude": ALTITUDE_M, "samples": 49, "scene": scene, "model": "layered"}
    return [plan(PlanRequest(baseline=b, camera="dji-m3t-wide", **flight)) for b in BASELINES_M]


def models(scene, focal_px: float):
    """The predictions of models that use only a scene's statistics, each as a function of the
    baseline.
    """
    rule = coverage_baseline(scene.slabs(), ALTITUDE_M, focal_px, 0.98)
    uniform = UniformModel(scene.integrated_density, scene.transparency, rule.baseline_m)
    layered = LayeredModel(scene.slices(), ALTITUDE_M)
    return {
        "uniform": lambda b: uniform.predict(PATTERN, b).normalized,
        "layered": lambda b: layered.predict(PATTERN, b).normalized,
    }


def measured(volume: VoxelVolume, per_voxel: int = 4):
    def predict(baseline_m: float) -> float:
        model = MeasuredModel(volume, ALTITUDE_M, targets_per_voxel=per_voxel)
        return model.predict(PATTERN, baseline_m).normalized

    return predict


def experiment(made: Plan, seed: int):
    return simulate(made, Settings(seed, 1.0, view="telecentric")).experiment


def generated(name: str, made: list[Plan]) -> tuple[list[Row], float]:
    """Rows for a scene that is described by statistics, and the standard error of the reference."""
    truth, floor = [], 0.0
    for each in made:
        samples = experiment(each, TRUTH_SEED).samples()
        found = estimate(list(islice(samples, TRUTH_VOLUMES)))
        truth.append(found.normalized)
        floor = max(floor, found.normalized_standard_error)
    scene = made[0].scene
    rows = []

    def add(method: str, setting: str, predict: Callable[[float], float]) -> None:
        errors = [abs(predict(b) - v) for b, v in zip(BASELINES_M, truth, strict=True)]
        seconds = median_time(lambda: predict(BASELINES_M[1]))
        rows.append(shown(Row(name, method, setting, seconds, max(errors))))

    for method, predict in models(scene, made[0].camera.focal_length_px).items():
        add(method, "", predict)
    plot = layered_forest(generator(1), scene.slices(), PLOT_M)
    add("measured", "a plot of 30 m", measured(plot, 2))
    for volumes in VOLUMES:
        squares, times = np.zeros(2), []
        for seed in range(SEEDS):
            for i, each in enumerate(made):
                samples = experiment(each, seed).samples()
                start = time.process_time()
                found = estimate(list(islice(samples, volumes)))
                times.append(time.process_time() - start)
                squares[i] += (found.normalized - truth[i]) ** 2 / SEEDS
        error = float(np.sqrt(squares.max()))
        seconds = statistics.median(times[1 :: len(made)])
        rows.append(shown(Row(name, "simulation", f"{volumes} volumes", seconds, error)))
    return rows, floor


def real(name: str, volume: VoxelVolume, focal_px: float) -> tuple[list[Row], float]:
    """Rows for a stand with known voxels."""
    sites = {b: np.column_stack(local_sites(PATTERN, b, 0.0)) for b in BASELINES_M}
    truth = [measured(volume, 12)(b) for b in BASELINES_M]
    rows = []

    def add(method: str, setting: str, predict: Callable[[float], float]) -> None:
        errors = [abs(predict(b) - v) for b, v in zip(BASELINES_M, truth, strict=True)]
        seconds = median_time(lambda: predict(BASELINES_M[1]))
        rows.append(shown(Row(name, method, setting, seconds, max(errors))))

    for method, predict in models(layered_scene(volume, name), focal_px).items():
        add(method, "", predict)
    for per_voxel in (1, 2, 4):
        add("measured", f"{per_voxel} x {per_voxel} a voxel", measured(volume, per_voxel))
    plot = VoxelViews(volume, ALTITUDE_M, view="telecentric")
    for parts in (4, 2, 1):
        part = plot.within(blocks(plot.window, parts, parts)[0])

        def simulated(baseline_m: float, part: VoxelViews = part) -> float:
            return estimate([part.counts(sites[baseline_m])], one_plot=True).normalized

        label = "all targets" if parts == 1 else f"1/{parts**2} of the targets"
        add("simulation", label, simulated)
    return rows, 0.0


def shown(row: Row) -> Row:
    print(
        f"{row.scene:20} {row.method:11} {row.setting:20} {row.seconds * 1e3:10.3f} ms "
        f"{row.error_vhat:9.5f}",
        flush=True,
    )
    return row


def draw(panels_of: dict[str, tuple[list[Row], float]], path: Path) -> None:
    figure, panels = plt.subplots(1, 3, figsize=(15, 4.8), sharey=True, layout="constrained")
    colours = {"uniform": "C3", "layered": "C2", "measured": "C0", "simulation": "C1"}
    for panel, (name, (rows, floor)) in zip(panels, panels_of.items(), strict=True):
        for method, colour in colours.items():
            chosen = [row for row in rows if row.method == method]
            points = [(row.seconds, max(row.error_vhat, 1e-5)) for row in chosen]
            panel.loglog(*zip(*points, strict=True), "o-", c=colour, label=method)
            for row, point in zip(chosen, points, strict=True):
                apart = (4, -10) if method == "simulation" else (4, 5)
                panel.annotate(
                    row.setting, point, textcoords="offset points", xytext=apart, fontsize=7
                )
        if floor:
            panel.axhline(floor, ls=":", c="0.5")
        panel.set(title=name, xlabel="run time of a prediction [s]")
        panel.grid(visible=True, which="major", alpha=0.3)
        panel.margins(x=0.25)
    panels[0].set(ylabel="error of V̂")
    panels[0].legend(fontsize=9)
    figure.suptitle("Every way to V̂: 49 views, 1 and 2.8 m apart, 40 m up")
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cloud", nargs="?", help="a .las or .laz file; generated without")
    options = parser.parse_args()
    if options.cloud:
        from aosplan.scenes.files.point_cloud import read_voxels

        volume, name = read_voxels(options.cloud, min_height_m=0.5), Path(options.cloud).stem
    else:
        volume, name = clumped_forest(STANDS["spruce"]), "generated spruce"
    uniform = plans(None)
    layered = plans(str(HERE.parent / "examples" / "stand.toml"))
    panels = {
        "uniform scene": generated("uniform scene", uniform),
        "layered scene": generated("layered scene", layered),
        name: real(name, volume, uniform[0].camera.focal_length_px),
    }
    (HERE / "results").mkdir(exist_ok=True)
    with open(HERE / "results" / "every_way.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(Row._fields)
        for rows, _ in panels.values():
            writer.writerows(
                [*row[:3], f"{row.seconds:.4g}", f"{row.error_vhat:.4g}"] for row in rows
            )
    draw(panels, HERE / "results" / "every_way.png")


if __name__ == "__main__":
    main()
