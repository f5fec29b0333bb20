"""Plans that are fitted to one half of a plot and evaluated on the other half.

    python benchmarks/cross_validation.py [CLOUD.laz ...]

For each half of each plot (west, east, south, north), plans with at most 49 samples are made with
the measured model: for the best contrast and for the best visibility, as a trimmed grid and as
three lanes. Each plan is evaluated on the opposite half, together with the plan of the paper. The
paper's plan has the baseline at which 98 % of the occluders of the fitted half have d̂ >= 1. It is
the largest trimmed grid with this baseline whose path is not longer than the path of the fitted
plan.

Generated stands are always used.  Point clouds are used in addition if they are given.  It takes a
minute or two per stand, prints a table, and writes it to benchmarks/results/.
"""

from __future__ import annotations

import argparse
import csv
import statistics
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import matplotlib as mpl
import numpy as np

from aosplan.camera.disparity import coverage_baseline
from aosplan.flight.kinematics import path_of
from aosplan.grid.patterns import Pattern, pattern_for
from aosplan.models.correlogram import CorrelogramModel
from aosplan.models.measured import MeasuredModel
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.occluder_statistics import layered_scene
from aosplan.solver.problem import Bounds, GridKind, Problem, Requirement
from aosplan.solver.solve import solve

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.models.model import Prediction
    from aosplan.scenes.voxels import VoxelVolume

mpl.use("Agg")
from matplotlib import pyplot as plt

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests"))
from support.forests import STANDS, clumped_forest  # noqa: E402 (its folder has to be on the path first)

ALTITUDE_M = 50.0
SAMPLES = 49
FOCAL_LENGTH_PX = 1e6
"""This focal length is so large that no occluder is smaller than a pixel."""

TARGET = Requirement("normalized", Fraction(98, 100))


class Judged(NamedTuple):
    """A fitted plan and the paper's plan with the same path length, both evaluated on the other
    half.
    """

    stand: str
    fitted_on: str
    objective: str
    grid: str
    path_m: float
    samples: int
    baseline_m: float
    visibility: float
    normalized: float
    contrast: float
    rule_samples: int
    rule_baseline_m: float
    rule_visibility: float
    rule_normalized: float
    rule_contrast: float


def halves(volume: VoxelVolume) -> Iterator[tuple[str, VoxelVolume, VoxelVolume]]:
    """For each half: its name, its volume, and the volume of the opposite half."""
    _, rows, columns = volume.occupied.shape
    west, east = np.split(volume.occupied, [columns // 2], axis=2)
    south, north = np.split(volume.occupied, [rows // 2], axis=1)
    for name, one, other in (
        ("west", west, east),
        ("east", east, west),
        ("south", south, north),
        ("north", north, south),
    ):
        yield name, *(replace(volume, occupied=half.copy()) for half in (one, other))


def fitted(volume: VoxelVolume, objective: str, grid: str) -> tuple[Pattern, float]:
    """The best plan for a half."""
    solution = solve(
        Problem(
            model=MeasuredModel(volume, ALTITUDE_M),
            requirement=TARGET,
            grid=GridKind(grid),
            bounds=Bounds(max_samples=SAMPLES),
            objective=objective,
            surrogate=CorrelogramModel(correlogram(volume), ALTITUDE_M),
        )
    )
    return solution.pattern, solution.baseline_m


def rule_of(volume: VoxelVolume, path_m: float) -> tuple[Pattern, float]:
    """The paper's plan for a half, with as many samples as fit into a path of a given length."""
    slabs = layered_scene(volume, "half").slabs()
    # The coverage rule treats each voxel as an occluder.
    slabs = tuple(slab._replace(occluder_size_m=volume.voxel_m) for slab in slabs)
    baseline = coverage_baseline(slabs, ALTITUDE_M, FOCAL_LENGTH_PX, 0.98).baseline_m
    samples = 1
    while path_of(pattern_for("trimmed", samples + 1)).length_m(baseline) <= path_m:
        samples += 1
    return pattern_for("trimmed", samples), baseline


def judge(name: str, volume: VoxelVolume) -> Iterator[Judged]:
    for half, here, there in halves(volume):
        truth = MeasuredModel(there, ALTITUDE_M)
        for objective in ("contrast", "visibility"):
            for grid in ("trimmed", "lanes"):
                pattern, baseline = fitted(here, objective, grid)
                path = path_of(pattern).length_m(baseline)
                rule, rule_baseline = rule_of(here, path)
                yield Judged(
                    name,
                    half,
                    objective,
                    grid,
                    path,
                    pattern.samples,
                    baseline,
                    *_numbers(truth.predict(pattern, baseline)),
                    rule.samples,
                    rule_baseline,
                    *_numbers(truth.predict(rule, rule_baseline)),
                )


def _numbers(prediction: Prediction) -> tuple[float, float, float]:
    return prediction.expected, prediction.normalized, prediction.contrast


def stands(clouds: list[str], min_height_m: float) -> Iterator[tuple[str, VoxelVolume]]:
    for name, stand in STANDS.items():
        yield f"generated {name}", clumped_forest(stand, side_m=36.0)
    for cloud in clouds:
        from aosplan.scenes.files.point_cloud import read_voxels

        yield Path(cloud).stem, read_voxels(cloud, min_height_m=min_height_m)


def draw(rows: list[Judged], path: Path) -> None:
    """Draw the result of each plan on the half to which it was not fitted."""
    figure, panels = plt.subplots(1, 2, figsize=(10, 4.8), layout="constrained")
    for panel, name in zip(panels, ("contrast", "visibility"), strict=True):
        for stand, mark in zip(dict.fromkeys(row.stand for row in rows), "os^Dv<>", strict=False):
            chosen = [row for row in rows if (row.stand, row.objective) == (stand, name)]
            panel.loglog(
                [getattr(row, f"rule_{name}") for row in chosen],
                [getattr(row, name) for row in chosen],
                mark,
                mfc="none",
                label=stand,
            )
        ends = panel.get_xlim()
        panel.plot(ends, ends, "k:", lw=1, label="no gain")
        panel.set(
            xlabel=f"{name} of the 98 % rule, on the other half, same path length",
            ylabel=f"{name} of the fitted plan, on the other half",
        )
        panel.grid(visible=True, which="major", alpha=0.3)
    panels[0].legend(fontsize=8)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clouds", nargs="*", help=".las or .laz files")
    parser.add_argument("--min-height", type=float, default=2.0, help="metres")
    options = parser.parse_args()
    rows: list[Judged] = []
    for name, volume in stands(options.clouds, options.min_height):
        for row in judge(name, volume):
            rows.append(row)
            print(
                f"{row.stand:20} {row.fitted_on:6} {row.objective:11} {row.grid:8}"
                f"{row.path_m:7.1f} m  N {row.samples:3} b {row.baseline_m:5.2f}  "
                f"V {row.visibility:.3f} V̂ {row.normalized:.3f} CNR {row.contrast:.2f}   rule: "
                f"N {row.rule_samples:3} b {row.rule_baseline_m:5.2f}  V {row.rule_visibility:.3f} "
                f"V̂ {row.rule_normalized:.3f} CNR {row.rule_contrast:.2f}",
                flush=True,
            )
    for stand in dict.fromkeys(row.stand for row in rows):
        for objective in ("contrast", "visibility"):
            chosen = [row for row in rows if (row.stand, row.objective) == (stand, objective)]
            gains = [
                getattr(row, objective) / max(getattr(row, f"rule_{objective}"), 1e-12)
                for row in chosen
            ]
            print(
                f"{stand:20} {objective:11} held-out gain over the rule: median "
                f"{statistics.median(gains):.2f}, least {min(gains):.2f}, most {max(gains):.2f}"
            )
    results = HERE / "results"
    results.mkdir(exist_ok=True)
    with open(results / "cross_validation.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(Judged._fields)
        writer.writerows(rows)
    draw(rows, results / "cross_validation.png")


if __name__ == "__main__":
    main()
