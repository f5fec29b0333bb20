"""How far the two halves of a plot differ, in standard errors that their predictions state:

    python benchmarks/uncertainty.py [CLOUD.laz ...]

Each plot is cut into a western and an eastern half, and into a southern and a northern one.  49
photos are predicted on both by the measured model, and the differences of p̄, V and V̂ are held
against the root of the sum of the squares of both stated errors: of differences as a normal
distribution has them, 68 % are within one of these, and 95 % within two.  Generated stands, whose
trees are Poisson in number, of 24 m and 48 m; and clouds where given.  The last columns are the
mean sizes of what was stated and of what was found.  Half a minute; prints a table and writes it
to benchmarks/results/.

Limits: halves of one plot are neighbours, and more alike than two plots of a forest; and the clouds
are two plots, a handful of differences that are not independent of each other.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aosplan.grid.patterns import Pattern
from aosplan.models.measured import MeasuredModel
from aosplan.models.uncertainty import of_targets

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.scenes.voxels import VoxelVolume

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests"))
from support.forests import STANDS, clumped_forest  # noqa: E402 (its folder has to be on the path first)

ALTITUDE_M = 50.0
BASELINES_M = (1.0, 2.0, 3.5)
SEEDS = 10
SEED = 1
QUANTITIES = ("density", "expected", "normalized")


def halves(volume: VoxelVolume) -> Iterator[tuple[VoxelVolume, VoxelVolume]]:
    """West and east, south and north; of an odd number of cells the last is left out."""
    for axis in (2, 1):
        half = volume.occupied.shape[axis] // 2
        parts = np.split(volume.occupied, [half, 2 * half], axis=axis)[:2]
        one, other = (replace(volume, occupied=part.copy()) for part in parts)
        yield one, other


def differences(volume: VoxelVolume) -> Iterator[list[tuple[float, float]]]:
    """Difference and its stated error, quantity by quantity, for each cut and baseline."""
    for baseline in BASELINES_M:
        plan = Pattern(7, 7), baseline
        for pair in halves(volume):
            models = [MeasuredModel(half, ALTITUDE_M, targets_per_voxel=2) for half in pair]
            found = [model.predict(*plan) for model in models]
            stated = [of_targets(model.hidden_share(*plan), 2) for model in models]
            yield [
                (
                    abs(getattr(found[0], name) - getattr(found[1], name)),
                    math.hypot(*(getattr(each, name) or 0.0 for each in stated)),
                )
                for name in QUANTITIES
            ]


def generated(side_m: float) -> Iterator[VoxelVolume]:
    """Stands of all kinds, with numbers of trees by chance."""
    rng = np.random.default_rng(SEED)
    for stand in STANDS.values():
        for seed in range(SEEDS):
            trees = max(int(rng.poisson(stand.trees * (side_m / 24.0) ** 2)), 1)
            own = stand._replace(seed=1000 * stand.seed + seed, trees=trees)
            yield clumped_forest(own, side_m=side_m, voxel_m=0.5)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clouds", nargs="*", metavar="CLOUD.laz")
    stands: dict[str, Iterator[VoxelVolume]] = {
        f"generated, {side:g} m": generated(side) for side in (24.0, 48.0)
    }
    for cloud in parser.parse_args().clouds:
        from aosplan.scenes.files.point_cloud import read_voxels

        stands[Path(cloud).stem] = iter([read_voxels(cloud, voxel_m=0.25)])
    header = ["stand", "quantity", "differences", "within_1", "within_2", "stated", "found"]
    rows = [header]
    for name, volumes in stands.items():
        all_found = [each for volume in volumes for each in differences(volume)]
        for index, quantity in enumerate(QUANTITIES):
            difference, stated = np.array([each[index] for each in all_found]).T
            rows.append(
                [
                    name,
                    quantity,
                    str(len(difference)),
                    f"{np.mean(difference <= stated):.2f}",
                    f"{np.mean(difference <= 2.0 * stated):.2f}",
                    f"{math.sqrt(np.mean(stated**2)):.4f}",
                    f"{math.sqrt(np.mean(difference**2)):.4f}",
                ]
            )
    widths = [max(len(row[column]) for row in rows) for column in range(len(header))]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)))
    with (HERE / "results" / "uncertainty.csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    main()
