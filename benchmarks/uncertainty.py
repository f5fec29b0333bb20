"""Differences between parts of a plot, divided by the standard errors of their predictions.

    python benchmarks/uncertainty.py [CLOUD.laz ...]

Each plot is cut into two halves (west and east, and south and north) and into four quarters. Grids
of 9, 25 and 49 photos are predicted for all parts by the measured model, telecentric and in
perspective. The difference of p̄, V and V̂ between two parts is divided by its standard error. This
standard error is the root of the sum of the squares of the standard errors of both parts. Only the
contribution `plot` of the standard errors is used, because both parts have the same error of
opacity. If differences are normally distributed, 68 % of these ratios are within 1, and 95 % are
within 2.  Grids whose rays cross more than half of a part are left out.

The plots are generated stands of 24 m and 48 m whose numbers of trees are Poisson distributed, and
clouds if they are given.  Each cloud is used with the opacity from its pulses, if it has pulses,
and with opaque voxels.  The columns *stated* and *found* are the root mean squares of the predicted
standard errors and of the differences.  It takes two minutes of processor time, prints a table, and writes it to
benchmarks/results/.

The last rows have the mean shares of each real plot and of both plots, and the range in which these
shares vary by chance.  The range contains 95 % of the shares of plots whose quarters differ by
normally distributed amounts, if all standard errors are exact.  All differences of a plot come from
its four quarters, so that the range is wide.

This benchmark has limits.  Parts of one plot are neighbours, and are more similar than two plots of
a forest.  Two clouds are only two plots, and the differences of several grids between the same two
parts are similar.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aosplan.grid.patterns import Pattern
from aosplan.models.measured import MeasuredModel
from aosplan.models.uncertainty import of_apertures, of_targets

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.scenes.occlusion import ViewKind
    from aosplan.scenes.voxels import VoxelVolume

    Predicted = list[tuple[float, float]] | None

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests"))
from support.forests import STANDS, clumped_forest  # noqa: E402 (its folder has to be on the path first)

GRIDS = ((45.0, 3, 1.0), (45.0, 5, 2.0), (70.0, 7, 1.0), (70.0, 7, 2.0))
"""Altitude [m], photos along a side, and baseline [m]."""

VIEWS = ("telecentric", "perspective")
SEEDS = 4
SEED = 1
MOST_HIDDEN = 0.97
"""Largest share of hidden columns. Clouds with a larger share have only a few gaps and are left
out.
"""

QUANTITIES = ("density", "expected", "normalized")

DRAWS = 20_000
"""Number of random plots from which the range of shares by chance is computed."""


def pairs(volume: VoxelVolume) -> Iterator[tuple[str, VoxelVolume, VoxelVolume]]:
    """All pairs of halves and of quarters of a plot.  A last odd row or column is left out."""
    rows, columns = (cells // 2 for cells in volume.occupied.shape[1:])

    def part(rows: slice, columns: slice) -> VoxelVolume:
        return replace(volume, occupied=volume.occupied[:, rows, columns].copy(), bounds=None)

    south, north, all_rows = slice(0, rows), slice(rows, 2 * rows), slice(0, 2 * rows)
    west, east, all_columns = slice(0, columns), slice(columns, 2 * columns), slice(0, 2 * columns)
    yield "halves", part(all_rows, west), part(all_rows, east)
    yield "halves", part(south, all_columns), part(north, all_columns)
    quarters = [part(along, across) for along in (south, north) for across in (west, east)]
    for one, other in combinations(quarters, 2):
        yield "quarters", one, other


def predicted(part: VoxelVolume, view: ViewKind, grid: tuple[float, int, float]) -> Predicted:
    """p̄, V and V̂ of a part, and their standard errors; None if the part is too small for a grid."""
    altitude, side, baseline = grid
    model = MeasuredModel(part, altitude, view=view, targets_per_voxel=1)
    if (side - 1) * baseline > model.widest_aperture_m:
        return None
    plan = Pattern(side, side), baseline
    found = model.predict(*plan)
    if view == "perspective":
        stated = of_apertures(model.hidden_at_places(*plan))
    else:
        stated = of_targets(model.hidden_share(*plan))
    return [(getattr(found, name), getattr(stated, name) or 0.0) for name in QUANTITIES]


def differences(volume: VoxelVolume) -> Iterator[tuple[str, str, list[tuple[float, float]]]]:
    """For each grid: the view, the kind of parts, and for each quantity the difference and its
    standard error.
    """
    cut = list(pairs(volume))
    for view in VIEWS:
        for grid in GRIDS:
            known = {id(part): predicted(part, view, grid) for _, *both in cut for part in both}
            for kind, one, other in cut:
                first, second = known[id(one)], known[id(other)]
                if first is not None and second is not None:
                    yield (
                        view,
                        kind,
                        [
                            (abs(a - b), math.hypot(error, its_error))
                            for (a, error), (b, its_error) in zip(first, second, strict=True)
                        ],
                    )


def generated(side_m: float) -> Iterator[VoxelVolume]:
    """Stands of all kinds with random numbers of trees."""
    rng = np.random.default_rng(SEED)
    for stand in STANDS.values():
        for seed in range(SEEDS):
            trees = max(int(rng.poisson(stand.trees * (side_m / 24.0) ** 2)), 1)
            own = stand._replace(seed=1000 * stand.seed + seed, trees=trees)
            yield clumped_forest(own, side_m=side_m, voxel_m=0.5)


def read(cloud: str) -> Iterator[tuple[str, VoxelVolume]]:
    """A cloud with the opacity from its pulses, if it has pulses, and with opaque voxels of two
    sizes.
    """
    from aosplan.scenes.files.point_cloud import read_voxels

    volume = read_voxels(cloud, voxel_m=0.25, opacity="auto")
    if volume.bounds is not None:
        yield f"{Path(cloud).stem}, pulses", volume
    for voxel_m in (0.1, 0.25):
        volume = read_voxels(cloud, voxel_m=voxel_m, opacity="voxels")
        yield f"{Path(cloud).stem}, voxels of {voxel_m:g} m", volume


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clouds", nargs="*", metavar="CLOUD.laz")
    stands = {f"generated, {side:g} m": list(generated(side)) for side in (24.0, 48.0)}
    stands |= {
        name: [volume]
        for cloud in parser.parse_args().clouds
        for name, volume in read(cloud)
        if volume.column_occupancy < MOST_HIDDEN
    }
    found: dict[tuple[str, str, str, str], list[tuple[float, float]]] = {}
    for name, volumes in stands.items():
        for volume in volumes:
            for view, kind, by_quantity in differences(volume):
                for quantity, pair in zip(QUANTITIES, by_quantity, strict=True):
                    found.setdefault((name, view, kind, quantity), []).append(pair)
    rows = [[*key, *shares(values), "", ""] for key, values in found.items()]
    rows += [*by_plot(rows), *together(rows)]  # They are computed from the rows of single readings.
    header = [
        "stand",
        "view",
        "parts",
        "quantity",
        "differences",
        "within_1",
        "within_2",
        "stated",
        "found",
        "chance_1",
        "chance_2",
    ]
    table = [header, *rows]
    widths = [max(len(row[column]) for row in table) for column in range(len(header))]
    for row in table:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)))
    with (HERE / "results" / "uncertainty.csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(table)


def chance(plots: int) -> list[str]:
    """Ranges of the mean shares within one and within two standard errors.  Each range contains 95
    % of the results for a number of plots whose quarters are independent and normally distributed.
    """
    south_west, south_east, north_west, north_east = quarters = np.random.default_rng(
        SEED
    ).standard_normal((4, DRAWS, plots))
    halves = (
        0.5 * (south_west + north_west - south_east - north_east),
        0.5 * (south_west + south_east - north_west - north_east),
    )
    pairs = [(one - other) / math.sqrt(2.0) for one, other in combinations(quarters, 2)]
    ranges = []
    for most in (1.0, 2.0):
        shares = [np.mean([np.abs(each) <= most for each in kind], 0) for kind in (halves, pairs)]
        low, high = np.quantile(np.mean(shares, axis=(0, 2)), (0.025, 0.975))
        ranges.append(f"{low:.2f} to {high:.2f}")
    return ranges


def of_plots(rows: list[list[str]], view: str, quantity: str) -> dict[str, list[list[str]]]:
    """The rows of each real plot."""
    plots: dict[str, list[list[str]]] = {}
    for row in rows:
        plot = row[0].split(",")[0]
        if plot != "generated" and (row[1], row[3]) == (view, quantity):
            plots.setdefault(plot, []).append(row)
    return plots


def mean_row(name: str, view: str, quantity: str, plots: list[list[list[str]]]) -> list[str]:
    """Mean shares of plots, with equal weights for plots and for the rows of each."""
    means = [np.mean([np.mean([float(row[i]) for row in each]) for each in plots]) for i in (5, 6)]
    count = sum(int(row[4]) for each in plots for row in each)
    shown = (f"{mean:.2f}" for mean in means)
    return [name, view, "all", quantity, str(count), *shown, "", "", *chance(len(plots))]


def by_plot(rows: list[list[str]]) -> list[list[str]]:
    """Mean shares of each real plot."""
    return [
        mean_row(f"{plot}, all", view, quantity, [own])
        for view in VIEWS
        for quantity in QUANTITIES
        for plot, own in of_plots(rows, view, quantity).items()
    ]


def together(rows: list[list[str]]) -> list[list[str]]:
    """Mean shares of the real plots.  Each plot has the same weight, regardless of the number of
    ways in which it was read.
    """
    return [
        mean_row("real plots", view, quantity, list(plots.values()))
        for view in VIEWS
        for quantity in QUANTITIES
        if (plots := of_plots(rows, view, quantity))
    ]


def shares(pairs: list[tuple[float, float]]) -> list[str]:
    """Number of differences, their shares within one and two standard errors, and the root mean
    squares of the standard errors and of the differences.
    """
    difference, stated = np.array(pairs).T
    return [
        str(len(difference)),
        f"{np.mean(difference <= stated):.2f}",
        f"{np.mean(difference <= 2.0 * stated):.2f}",
        f"{math.sqrt(np.mean(stated**2)):.4f}",
        f"{math.sqrt(np.mean(difference**2)):.4f}",
    ]


if __name__ == "__main__":
    main()
