"""Processor time and error of the models for one stand:  python benchmarks/measured.py [CLOUD.laz]

V and V̂ are computed for 49 views that are 2 m or 3.5 m apart, from 50 m above a stand of voxels,
by

- the measured model with 1 x 1 to 8 x 8 targets per voxel, for both kinds of view, and with larger
  voxels;
- the correlogram (the table is computed once, before the predictions), also with fewer lags and
  directions;
- the layered model, and the uniform model with the stand's p at d̂ = 1;
- Embree with 1 x 1 to 4 x 4 targets per voxel, if its binding is installed (``pip install embreex``).

Each result is compared with Embree with 8 x 8 targets per voxel.  Without Embree, it is compared with
the measured model with 12 x 12 targets per voxel.  All methods run in one thread.  Without a cloud, the
stand is generated.  It takes some minutes of processor time, prints a table, and writes it to
benchmarks/results/ together with a figure.
"""

import argparse
import csv
import importlib
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np

from aosplan.grid.patterns import Pattern, local_sites
from aosplan.models.correlogram import CorrelogramModel
from aosplan.models.equations import visibility_shortfall
from aosplan.models.layered import LayeredModel
from aosplan.models.measured import MeasuredModel
from aosplan.models.model import Prediction
from aosplan.scenes.correlogram import Correlogram, correlogram
from aosplan.scenes.occluder_statistics import layered_scene
from aosplan.scenes.voxels import VoxelVolume

mpl.use("Agg")
from matplotlib import pyplot as plt

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests"))
from support.forests import STANDS, clumped_forest  # noqa: E402 (its folder has to be on the path first)

ALTITUDE_M = 50.0
PATTERN = Pattern(7, 7)
BASELINES_M = (2.0, 3.5)
VIEWS = ("telecentric", "perspective")
RUNS = 5


class Row(NamedTuple):
    """One method: time of a prediction, time of the preparation, and largest errors."""

    method: str
    setting: str
    view: str
    seconds: float
    preparation_s: float
    error_v: float
    error_vhat: float


Predictor = Callable[[float], Prediction]
"""A prediction as a function of the baseline."""

Occluded = Callable[[np.ndarray], np.ndarray]
"""Which rays, of shape (n, 6) with starts and directions, meet an occluder."""


# --- Embree --------------------------------------------------------------------------------


def faces_of(volume: VoxelVolume, margin: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [m] and triangles of all faces that a ray can meet, including periodic copies."""
    occupied = np.pad(volume.occupied, ((0, 0), (margin, margin), (margin, margin)), mode="wrap")
    padded = np.pad(occupied, 1)
    corners = []
    for axis in range(3):
        across = [np.eye(3)[other] for other in range(3) if other != axis]
        square = np.array([0.0 * across[0], across[0], across[0] + across[1], across[1]])
        for side in (0, 1):
            beyond = np.roll(padded, 1 - 2 * side, axis=axis)[1:-1, 1:-1, 1:-1]
            cells = np.argwhere(occupied & ~beyond) + side * np.eye(3)[axis]
            corners.append(cells[:, None, :] + square)
    vertices = np.concatenate(corners).reshape(-1, 3)[:, ::-1] - (margin, margin, 0.0)
    first = 4 * np.arange(len(vertices) // 4)[:, None]
    triangles = np.concatenate([first + np.array(three) for three in ((0, 1, 2), (0, 2, 3))])
    return (vertices * volume.voxel_m).astype(np.float32), triangles.astype(np.uint32)


def rays_of(volume: VoxelVolume, reach_m: float) -> Occluded | None:
    """Whether each ray from the ground is occluded, by Embree; None if it is not installed.

    Parameters
    ----------
    volume
        The voxels; copies of the plot surround it as far as rays reach.
    reach_m
        Largest distance from the plot at which a ray leaves the canopy.
    """
    try:
        scenes, meshes = (
            importlib.import_module(f"embreex.{name}")
            for name in ("rtcore_scene", "mesh_construction")
        )
    except ImportError as error:
        print(f"without Embree: {error}", file=sys.stderr)
        return None
    scene = scenes.EmbreeScene()
    vertices, triangles = faces_of(volume, int(reach_m / volume.voxel_m) + 2)
    meshes.TriangleMesh(scene, vertices, triangles.astype(np.int32))

    def occluded(rays: np.ndarray) -> np.ndarray:
        starts, directions = (np.ascontiguousarray(half) for half in (rays[:, :3], rays[:, 3:]))
        return np.asarray(scene.run(starts, directions, query="OCCLUDED") >= 0)

    return occluded


def embree(volume: VoxelVolume) -> Callable[[str, int], Predictor] | None:
    """Predictors by kind of view and targets per voxel; None without Embree."""
    reach_m = 0.5 * PATTERN.longer_side * max(BASELINES_M) * volume.canopy_top_m / ALTITUDE_M
    occluded = rays_of(volume, reach_m)
    if occluded is None:
        return None

    def predictor(view: str, per_voxel: int) -> Predictor:
        _, rows, columns = volume.occupied.shape
        along = [(np.arange(n * per_voxel) + 0.5) / per_voxel for n in (columns, rows)]
        x, y = (axis.ravel() * volume.voxel_m for axis in np.meshgrid(*along))
        rays = np.zeros((x.size, 6), dtype=np.float32)
        rays[:, 0], rays[:, 1], rays[:, 5] = x, y, ALTITUDE_M

        def predict(baseline_m: float) -> Prediction:
            count = np.zeros(x.size)
            for east, north in zip(*local_sites(PATTERN, baseline_m, 0.0), strict=True):
                width, depth = volume.size_m
                rays[:, 3] = east if view == "telecentric" else 0.5 * width + east - x
                rays[:, 4] = north if view == "telecentric" else 0.5 * depth + north - y
                count += occluded(rays)
            mean = count / PATTERN.samples
            p = mean.mean()
            return Prediction(p, 1.0 - p, mean.var() / (p * (1.0 - p)))

        return predict

    return predictor


# --- aosplan -------------------------------------------------------------------------------


def measured(volume: VoxelVolume, view: str, per_voxel: int) -> Predictor:
    def predict(baseline_m: float) -> Prediction:
        # Each prediction uses a new model, so that no stored views are used again.
        model = MeasuredModel(volume, ALTITUDE_M, view=view, targets_per_voxel=per_voxel)
        return model.predict(PATTERN, baseline_m)

    return predict


def larger_voxels(volume: VoxelVolume, factor: int) -> VoxelVolume:
    """The same stand with voxels that are larger by a factor.  A large voxel is occupied if any of
    its parts is occupied.
    """
    pad = [(0, -size % factor) for size in volume.occupied.shape]
    blocks = np.pad(volume.occupied, pad)
    for axis in range(3):
        starts = np.arange(0, blocks.shape[axis], factor)
        blocks = np.logical_or.reduceat(blocks, starts, axis=axis)
    return VoxelVolume(blocks, volume.voxel_m * factor)


# --- The table -----------------------------------------------------------------------------


def best_time(call: Callable[[], object], runs: int = RUNS) -> float:
    times = []
    for _ in range(runs):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return min(times)


def compare(volume: VoxelVolume) -> list[Row]:
    rays = embree(volume)
    truth = {
        view: [
            (rays(view, 8) if rays else measured(volume, view, 12))(baseline)
            for baseline in BASELINES_M
        ]
        for view in VIEWS
    }
    rows: list[Row] = []

    def add(
        method: str,
        setting: str,
        view: str,
        predict: Predictor,
        preparation_s: float = 0.0,
        runs: int = RUNS,
    ) -> None:
        found = [predict(baseline) for baseline in BASELINES_M]
        seconds = best_time(lambda: predict(BASELINES_M[-1]), runs)
        pairs = list(zip(found, truth[view], strict=True))
        error_v = max(abs(one.expected - other.expected) for one, other in pairs)
        error_vhat = max(abs(one.normalized - other.normalized) for one, other in pairs)
        row = Row(method, setting, view, seconds, preparation_s, error_v, error_vhat)
        rows.append(row)
        print(
            f"{method:12} {setting:12} {view:12} {seconds * 1e3:10.3f} {preparation_s * 1e3:8.0f} "
            f"{error_v:8.4f} {error_vhat:8.4f}",
            flush=True,
        )

    print(f"{'method':12} {'setting':12} {'view':12} {'ms':>10} {'once ms':>8} {'V':>8} {'V̂':>8}")
    for view in VIEWS:
        for per_voxel in (1, 2, 3, 4, 6, 8):
            predict = measured(volume, view, per_voxel)
            add("measured", f"{per_voxel} x {per_voxel}", view, predict)
        for factor in (2, 4):
            coarse = larger_voxels(volume, factor)
            add("measured", f"{coarse.voxel_m:g} m", view, measured(coarse, view, 4))
        if rays:
            for per_voxel in (1, 2, 4):
                predict = rays(view, per_voxel)
                add("Embree", f"{per_voxel} x {per_voxel}", view, predict, runs=1)

    once = best_time(lambda: correlogram(volume))
    table = correlogram(volume)
    for by_lag, by_direction in ((4, 2), (2, 2), (2, 1), (1, 1)):
        fewer = thinned(table, by_lag, by_direction)
        quick = CorrelogramModel(fewer, ALTITUDE_M)
        shape = f"{len(fewer.lags)} x {len(fewer.directions_deg)}"
        add("correlogram", shape, "telecentric", partial(quick.predict, PATTERN), once)
    scene = layered_scene(volume, "stand")
    once = best_time(lambda: layered_scene(volume, "stand"))
    layers = LayeredModel(scene.slices(), ALTITUDE_M)
    add("layered", "", "telecentric", lambda b: layers.predict(PATTERN, b), once)
    p = volume.column_occupancy

    def uniform(_: float) -> Prediction:
        return Prediction(p, 1.0 - p, visibility_shortfall(PATTERN.rows, PATTERN.columns, 1.0))

    add("uniform", "", "telecentric", uniform)
    return rows


def thinned(table: Correlogram, by_lag: int, by_direction: int) -> Correlogram:
    """A correlogram with fewer lags, including the last one, and fewer directions."""
    lags = slice((len(table.lags) - 1) % by_lag, None, by_lag)
    return replace(
        table,
        lags=table.lags[lags],
        directions_deg=table.directions_deg[::by_direction],
        rho=table.rho[::by_direction, lags],
        density_by_offset=table.density_by_offset[::by_direction, lags],
    )


def draw(rows: list[Row], title: str, path: Path) -> None:
    figure, panels = plt.subplots(1, 2, figsize=(11, 4.5), sharex=True, layout="constrained")
    kinds = sorted({(row.method, row.view) for row in rows})
    for panel, error, name in zip(panels, ("error_v", "error_vhat"), ("V", "V̂"), strict=True):
        for method, view in kinds:
            chosen = [row for row in rows if (row.method, row.view) == (method, view)]
            # Larger voxels are a different stand, so the points of their results are not connected.
            line = [row for row in chosen if not row.setting.endswith("m")]
            style = "o-" if view == "telecentric" else "s--"
            points = [(row.seconds, getattr(row, error)) for row in line]
            (drawn,) = panel.loglog(*np.transpose(points), style, label=f"{method}, {view}")
            for row in chosen:
                at = row.seconds, getattr(row, error)
                if row not in line:
                    panel.plot(*at, style[0], mfc="none", c=drawn.get_color())
                if row not in line[1:-1]:
                    panel.annotate(
                        row.setting, at, textcoords="offset points", xytext=(5, 4), fontsize=8
                    )
        panel.set(
            xlabel="run time of a prediction of 49 views [s]", ylabel=f"largest error of {name}"
        )
        panel.grid(visible=True, which="major", alpha=0.3)
    panels[0].legend(fontsize=8, loc="lower left")
    figure.suptitle(title)
    figure.savefig(path, dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cloud", nargs="?", help="a .las or .laz file; generated without")
    parser.add_argument("--voxel", type=float, default=0.25, help="metres")
    parser.add_argument("--min-height", type=float, default=0.5, help="metres")
    options = parser.parse_args()
    if options.cloud:
        from aosplan.scenes.files.point_cloud import read_voxels

        volume = read_voxels(options.cloud, voxel_m=options.voxel, min_height_m=options.min_height)
        name = Path(options.cloud).stem
    else:
        volume, name = clumped_forest(STANDS["spruce"], voxel_m=options.voxel), "generated spruce"
    width, depth = volume.size_m
    title = f"{name}: {width:g} x {depth:g} m, voxels of {volume.voxel_m:g} m"
    print(title)
    rows = compare(volume)
    results = HERE / "results"
    results.mkdir(exist_ok=True)
    stem = f"measured_{name.replace(' ', '_')}"
    with open(results / f"{stem}.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(Row._fields)
        writer.writerows(rows)
    draw(rows, title, results / f"{stem}.png")


if __name__ == "__main__":
    main()
