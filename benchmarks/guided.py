"""Positions that are chosen with one half of the pulses of a stand and evaluated with the other
half.

    python benchmarks/guided.py CLOUD.laz [random|lines]

The pulses of a cloud are divided into halves, at random or by flight line.  Each half gives a
separate stand.  With the first stand, positions above a square of ground are chosen from a lattice
of 1 m.  They are the positions with the highest mean probability of detection, which follows from
the share of the square that each position sees.  The choice is greedy and is improved by exchanges.
The positions are evaluated with the second stand and compared with square grids of the same number
of photos.  Flight times are for stops of one second, in the order of a short path.  The table is
written to benchmarks/results/guided_{random,lines}.csv.  It takes half an hour.
"""

from __future__ import annotations

import csv
import itertools
import math
import sys
from pathlib import Path
from unittest.mock import patch

import numpy as np
from scipy.ndimage import uniform_filter
from scipy.special import ndtr

from aosplan.scenes.files.point_cloud import read_voxels
from aosplan.scenes.integral_image import (
    TEXTURE,
    TEXTURE_LENGTH_M,
    CanopyRadiance,
    gaussian_field,
    integrate_planes,
    planes_of_volume,
)
from aosplan.scenes.matched_window import MatchedWindow
from aosplan.scenes.occlusion import Occlusion, PlotWindow
from aosplan.scenes.pulses import fit, realise

RESULTS = Path(__file__).parent / "results"
ALTITUDE_M, REACH_M = 50.0, 10.0
CONTRAST, CANOPY, KEPT = 2.0, CanopyRadiance(-1.0, 0.2), 0.86
LEVEL = 4.3
"""Threshold in standard deviations of the detector's output."""

SPREAD = 0.5
"""Standard deviation of the detector's output for one photo that the choice assumes."""

SQUARES = (((0, 0), 4.0), ((3, 3), 4.0), ((-4, 2), 4.0), ((0, 0), 8.0), ((2, -3), 8.0))
"""Squares of ground that are searched [m]: the middle, east and north of the middle of the plot,
and the side.
"""


def half_of(path, how, half):
    """The stand from one half of the pulses.  Its opaque cells are drawn with a separate seed."""
    every, realised = fit.sound_beams, realise.realised

    def some(*given, **named):
        beams, grid = every(*given, **named)
        line = beams.returns.line[beams.pulses.first]
        if how == "lines":
            lines, counts = np.unique(line, return_counts=True)
            return beams.take(line == lines[np.argsort(-counts)[half]]), grid
        drawn = np.random.default_rng(7).random(len(line)) < 0.5
        return beams.take(drawn == bool(half)), grid

    def own(*given):
        return realised(*given, seed=100 + half)

    with (
        patch.object(fit, "sound_beams", some),
        patch.object(fit.realise, "realised", own),
        patch.object(fit, "FEWEST_A_M2", 5),
    ):
        return read_voxels(path, opacity="pulses", min_height_m=0.5)


def seen_by(volume, positions, middle, side_m):
    """For each position, the share of each patch of 0.9 m that it sees, shape (positions,
    patches).
    """
    _, rows, columns = volume.occupied.shape
    count = round(side_m / volume.voxel_m)
    row, column = (
        (cells - count) // 2 + round(at / volume.voxel_m)
        for cells, at in ((rows, middle[1]), (columns, middle[0]))
    )
    window = PlotWindow(row, column, count, count)
    how = {"view": "perspective", "targets_per_voxel": 1, "window": window}
    occlusion = Occlusion(volume, ALTITUDE_M, **how)
    size = round(0.9 / volume.voxel_m)
    found = []
    for part in np.array_split(positions, math.ceil(len(positions) / 20)):
        for hidden in occlusion.unpack(occlusion.masks(part)):
            mean = uniform_filter(1.0 - hidden.astype(np.float32), size, mode="nearest")
            found.append(mean[size // 2 :: size, size // 2 :: size].ravel())
    return np.array(found)


def guided(shares, positions, count, apart_m=1.5):
    """Positions with the highest mean probability of detection over patches."""
    spread = SPREAD / math.sqrt(count)

    def value(total):
        return ndtr((KEPT * CONTRAST * total - LEVEL * spread) / spread).mean(axis=-1)

    near = np.linalg.norm(positions[:, None] - positions, axis=2) < apart_m - 1e-9
    chosen: list[int] = []
    for number in range(1, count + 1):
        values = value((shares[chosen].sum(axis=0) + shares) / number)
        if not chosen:
            values = shares.mean(axis=1)
        values[near[chosen].any(axis=0)] = -1.0
        chosen.append(int(np.argmax(values)))
    best = value(shares[chosen].mean(axis=0))
    for _, place in itertools.product(range(3), range(count)):
        rest = chosen[:place] + chosen[place + 1 :]
        values = value((shares[rest].sum(axis=0) + shares) / count)
        values[near[rest].any(axis=0)] = -1.0
        if values.max() > best + 1e-6:
            best, chosen[place] = values.max(), int(np.argmax(values))
    return positions[chosen]


class Judge:
    """Probability of detection in a square of one stand."""

    def __init__(self, volume, middle, side_m):
        self.middle, self.size_m = np.array(middle), side_m + 8.0
        planes = planes_of_volume(np.random.default_rng(1), volume, CANOPY)
        self.planes = [
            plane._replace(origin_m=tuple(np.array(plane.origin_m) - middle)) for plane in planes
        ]

    def __call__(self, sites):
        found = integrate_planes(self.planes, sites - self.middle, ALTITUDE_M, (self.size_m,) * 2)
        window = MatchedWindow((0.5, 1.7), found.seen.shape, found.pitch_m)
        rng = np.random.default_rng(51)
        ground = gaussian_field(rng, found.seen.shape, found.pitch_m[0], TEXTURE_LENGTH_M) * TEXTURE
        plain = found.canopy + found.seen * ground
        around = window.box_mean(plain)
        edge = round(4.0 / found.pitch_m[0])
        inner = np.s_[:, edge:-edge, edge:-edge]
        level = LEVEL * (np.array(window.means(plain)) - around)[inner].std()
        share = np.clip(np.array(window.means(found.seen))[inner], 0.0, 1.0)
        part = 0.85 / window.box_m**2
        covered = part * np.array(window.means(found.seen * ground))
        base = (np.array(window.means(found.canopy)) - around + covered)[inner]
        return float((base + KEPT * CONTRAST * share > level).mean()), float(share.mean())


def path_s(sites, hold_s=1.0, speed=5.0, acceleration=2.0):
    """Time of a path with stops at all sites.

    The path always goes to the nearest remaining site.  It is then improved by reversals.
    """
    apart = np.linalg.norm(sites[:, None] - sites, axis=2)
    short = 2.0 * np.sqrt(apart / acceleration)
    leg = np.where(apart < speed**2 / acceleration, short, apart / speed + speed / acceleration)
    times = []
    for start in range(0, len(sites), max(len(sites) // 4, 1)):
        order, left = [start], set(range(len(sites))) - {start}
        while left:
            order.append(min(left, key=lambda site: leg[order[-1], site]))
            left.remove(order[-1])
        better = True
        while better:
            better = False
            for i, j in itertools.combinations(range(len(order)), 2):
                other = order[:i] + order[i : j + 1][::-1] + order[j + 1 :]
                if leg[other[:-1], other[1:]].sum() < leg[order[:-1], order[1:]].sum() - 1e-9:
                    order, better = other, True
        times.append(leg[order[:-1], order[1:]].sum() + hold_s * len(order))
    return float(min(times))


def rows_of(path, how):
    """Rows of the table."""
    first, second = (half_of(path, how, half) for half in (0, 1))
    axis = np.arange(-REACH_M, REACH_M + 0.1)
    lattice = np.array(list(itertools.product(axis, axis)))
    for middle, side_m in SQUARES:
        shares = seen_by(first, lattice, middle, side_m + 1.0)
        judges = [Judge(volume, middle, side_m) for volume in (first, second)]
        for side in (3, 4, 5):
            line = np.arange(side) - 0.5 * (side - 1)
            unit = np.array(list(itertools.product(line, line)))
            ways = {f"grid, {b:g} m": unit * b + middle for b in (2.0, 3.5, 5.0)}
            ways["guided"] = guided(shares, lattice, side * side)
            for name, sites in ways.items():
                (chosen, _), (judged, seen) = (judge(sites) for judge in judges)
                where = f"{side_m:g} m around {middle[0]}, {middle[1]}"
                yield where, side * side, name, path_s(sites), chosen, judged, seen


def main():
    """Write the table."""
    path, how = sys.argv[1], (*sys.argv[2:], "random")[0]
    with (RESULTS / f"guided_{how}.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(
            ["ground", "photos", "positions", "time_s", "on_first", "on_second", "seen_on_second"]
        )
        for row in rows_of(path, how):
            shown = [f"{value:.3g}" if isinstance(value, float) else value for value in row]
            table.writerow(shown)
            file.flush()
            print(*shown, sep=", ", flush=True)


if __name__ == "__main__":
    main()
