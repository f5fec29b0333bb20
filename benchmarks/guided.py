"""Guided positions and plain grids with the same flight time, judged with other data than those
from which they were chosen.

    python benchmarks/guided.py UAS_Clip.laz

Plans with ``--grid guided`` are made above discs of ground, for each of two limits of the time from
take-off to landing and with photos 0.7 s apart while flying. Each plan is compared with its own
plain grids: lanes, a single line, squares and trimmed grids, with photos at stops and while flying.
Their rows, columns and spacings are chosen with the same half of the pulses. The plans are judged
with

- *half*: the other half of the pulses, as in the plan itself;
- *line*: for plans with the pulses of a single flight line, the stand from the other flight line;
- *leaves*: for scans of generated stands, rays that are cast through their leaves.

`offered` is true if the plan has guided positions, and false if they were refused because they are
not better than the plain grids. `own` is the prediction of the plan itself, and `least` is the
prediction with dense foliage wherever no pulse has passed. *Found* is the share of targets of
contrast 2 that the detector of `aosplan simulate` finds in a simulated integral image of the
judging stand. The best plain grid is chosen afterwards with the judging data, which favours the
plain grids.  `results/guided.csv` has a row for each plan, and `results/guided_summary.csv` has the
mean differences with standard errors over the discs.
"""

from __future__ import annotations

import csv
import math
import os
import sys
import tempfile
from pathlib import Path
from unittest.mock import patch

import numpy as np
from pyproj import CRS

os.environ["AOSPLAN_CACHE"] = "0"
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.leaf_clouds import write_scan

from aosplan.errors import InfeasibleError
from aosplan.geodesy import to_wgs84
from aosplan.models.place import PlaceModel, PlaceViews
from aosplan.planning import guided
from aosplan.planning.loaded_scene import load_scene
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.planning.target_area import target_area_of
from aosplan.scenes.integral_image import (
    TEXTURE,
    TEXTURE_LENGTH_M,
    CanopyRadiance,
    gaussian_field,
    integrate_planes,
    planes_of_volume,
)
from aosplan.scenes.matched_window import MatchedWindow
from aosplan.scenes.plot_frame import plot_frame
from aosplan.scenes.pulses import fit
from aosplan.simulation.leaf_stands import crowned_stand, laser_scan

RESULTS = Path(__file__).parent / "results"
ALTITUDE_M = 50.0
MINUTES = (2.0,)
CONTRAST, CANOPY, KEPT, LEVEL = 2.0, CanopyRadiance(-1.0, 0.2), 0.86, 4.3
DISCS = (
    *((at, 2.0) for at in ((0, 0), (3, 3), (-4, 2), (4, -3), (-3, -4), (0, 4), (0, -4))),
    *((at, 4.0) for at in ((0, 0), (2, -3))),
)
"""Centres relative to the middle of the plot (east, north), and radii [m]."""

FEWER = (((0, 0), 2.0), ((3, 3), 2.0), ((-3, 2), 2.0), ((0, -1), 4.0))
COLUMNS = (
    "stand", "judge", "disc", "minutes", "offered", "photos", "time_s", "own_guided", "own_plain",
    "least_guided", "least_plain", "guided", "plain", "plain_kind", "found_guided", "found_plain", "by_leaves_guided", "by_leaves_plain",
)  # fmt: skip


def planned(loaded, at, radius_m, minutes):
    """A guided plan, and whether it was accepted."""
    offered, refuses = [], guided._check_better  # noqa: SLF001

    def check(result, expected):
        try:
            refuses(result, expected)
        except InfeasibleError:
            offered.append(False)
        else:
            offered.append(True)

    with patch.object(guided, "_check_better", check):
        origin = away(loaded.volume.place, at)
        request = PlanRequest(
            altitude=ALTITUDE_M,
            scene="stand.laz",
            origin=origin,
            around_radius=radius_m,
            grid="guided",
            within=minutes,
            photo_interval=0.7,
        )
        return plan(request, loaded=loaded), offered[0]


def away(place, at):
    """Latitude and longitude of a point east and north of a place."""
    (latitude,), (longitude,) = to_wgs84(place, [float(at[0])], [float(at[1])])
    return latitude, longitude


def model_of(volume, made):
    """Model that predicts with another volume for the target area of a plan."""
    area = target_area_of(made.inputs)
    frame = plot_frame(volume, area.origin)
    return PlaceModel(PlaceViews(volume, ALTITUDE_M, area.on(frame)), frame)


def sites_of(made):
    """Sites of a plan and of its plain grids, metres east and north of the origin, by name."""
    east, north = made.layout.sites.east_m, made.layout.sites.north_m
    found = {"guided": np.column_stack([east, north])}
    for each in made.guided.plain:
        # Rows are along the heading, which is north. Like the rows of the plan, they are at whole
        # metres.
        sites = np.array(list(each.pattern.offsets()))[:, ::-1] * each.pitch_m[0]
        found[f"{each.kind}, {each.trigger}"] = sites + 0.5 * (np.round(2 * sites[0]) % 2)
    return found


class Judge:
    """Share of targets found in a disc of one stand, from a simulated integral image."""

    def __init__(self, volume):
        self.planes = planes_of_volume(np.random.default_rng(1), volume, CANOPY)

    def __call__(self, sites, middle, radius_m):
        planes = [
            plane._replace(origin_m=tuple(np.array(plane.origin_m) - middle))
            for plane in self.planes
        ]
        size_m = 2.0 * radius_m + 8.0
        found = integrate_planes(planes, sites, ALTITUDE_M, (size_m,) * 2)
        window = MatchedWindow((0.5, 1.7), found.seen.shape, found.pitch_m)
        rng = np.random.default_rng(51)
        ground = gaussian_field(rng, found.seen.shape, found.pitch_m[0], TEXTURE_LENGTH_M) * TEXTURE
        plain = found.canopy + found.seen * ground
        around = window.box_mean(plain)
        edge = round(4.0 / found.pitch_m[0])
        inner = np.s_[:, edge:-edge, edge:-edge]
        level = LEVEL * (np.array(window.means(plain)) - around)[inner].std()
        share = np.clip(np.array(window.means(found.seen))[inner], 0.0, 1.0)
        covered = 0.85 / window.box_m**2 * np.array(window.means(found.seen * ground))
        base = (np.array(window.means(found.canopy)) - around + covered)[inner]
        return float((base + KEPT * CONTRAST * share > level).mean())


def by_leaves(stand, at, radius_m, sites, pitch_m=0.1):
    """V of a disc below known leaves, by casting rays through them."""
    line = np.arange(-radius_m, radius_m + 1e-9, pitch_m)
    offsets = np.stack(np.meshgrid(line, line)).reshape(2, -1)
    offsets = offsets[:, np.hypot(*offsets) <= radius_m]
    middle = np.array(at, dtype=float)[:, np.newaxis]
    hidden = np.zeros(offsets.shape[1])
    for site in sites:
        slope = (site[:, np.newaxis] - offsets) / ALTITUDE_M
        hidden += stand.first_hits(offsets + middle + 0.5 * stand.size_m, slope) > 0.0
    return 1.0 - float(((hidden / len(sites)) ** 2).mean())


def rows_of(name, judge, loaded, judging, discs, leaves=None):
    """Rows for one stand; `judging` is a volume, or None for the second half of the pulses."""
    volume = judging or loaded.volume.of_voxels(loaded.volume.halves[1].measured)
    detector = Judge(volume)
    for at, radius_m in discs:
        for minutes in MINUTES:
            made, offered = planned(loaded, at, radius_m, minutes)
            model, sites = model_of(volume, made), sites_of(made)
            values = {kind: model.predict_positions(each).expected for kind, each in sites.items()}
            own = values.pop("guided")
            kind = max(values, key=values.get)
            middle = plot_frame(volume, made.layout.origin).onto_plot(np.zeros((1, 2)))[0]
            found = [detector(sites[each], middle, radius_m) for each in ("guided", kind)]
            true = ["", ""]
            if leaves is not None:
                by_kind = {k: by_leaves(leaves, at, radius_m, each) for k, each in sites.items()}
                true = [by_kind.pop("guided"), max(by_kind.values())]
            yield (
                name, judge, f"{radius_m:g} m at {at[0]}, {at[1]}", minutes, int(offered),
                made.solution.pattern.samples, made.route.total_time_s,
                made.solution.prediction.expected, made.guided.plain[0].prediction.expected,
                made.guided.least_expected, made.guided.plain[0].least_expected, own, values[kind], kind, *found, *true,
            )  # fmt: skip


def loaded_with(path, line=None):
    """The scene of a cloud with both halves of its pulses: of all pulses, or of the pulses of one
    flight line.
    """
    every = fit.sound_beams

    def some(*given, **named):
        beams, grid = every(*given, **named)
        if line is None:
            return beams, grid
        of = beams.returns.line[beams.pulses.first]
        numbers, counts = np.unique(of, return_counts=True)
        return beams.take(of == numbers[np.argsort(-counts)[line]]), grid

    with patch.object(fit, "sound_beams", some):
        request = PlanRequest(
            altitude=ALTITUDE_M, scene=str(path), origin=(0.0, 0.0), grid="guided",
            opacity="pulses", min_height=0.5,
        )  # fmt: skip
        return load_scene(request)


def cases(paths):
    """Arguments of `rows_of`."""
    for path in paths:
        name = Path(path).stem
        yield name, "half", loaded_with(path), None, DISCS
        lines = [loaded_with(path, line) for line in (0, 1)]
        for one, other in (lines, lines[::-1]):
            yield f"{name}, one line", "line", one, other.volume, DISCS
    for seed, leaf_area_index in ((1, 1.5), (2, 2.5), (3, 3.5)):
        rng = np.random.default_rng(seed)
        stand = crowned_stand(
            rng, 20.0, leaf_area_index=leaf_area_index, crowns=32, base_m=4.0, top_m=16.0
        )
        scan = laser_scan(rng, stand, pulses_a_m2=200.0)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "leaves.las"
            write_scan(path, scan, crs=CRS.from_epsg(32633), corner=(500_000.0, 5_200_000.0))
            loaded = loaded_with(path)
        yield f"leaves {seed}, LAI {leaf_area_index:g}", "half", loaded, None, FEWER, stand


def summary(rows):
    """Mean differences between guided positions and the best plain grid."""
    groups = {}
    for row in rows:
        named = dict(zip(COLUMNS, row, strict=True))
        for offered in ("all", "offered") if named["offered"] else ("all",):
            groups.setdefault((named["stand"], named["judge"], offered), []).append(named)
    for key, found in groups.items():
        gains = np.array([each["guided"] - each["plain"] for each in found])
        discs = sorted({each["disc"] for each in found})
        means = np.array(
            [
                np.mean([g for g, each in zip(gains, found, strict=True) if each["disc"] == d])
                for d in discs
            ]
        )
        error = means.std(ddof=1) / math.sqrt(len(means)) if len(means) > 1 else math.nan
        detected = np.mean([each["found_guided"] - each["found_plain"] for each in found])
        true = [each["by_leaves_guided"] for each in found]
        gain_by_leaves = (
            np.mean([each["by_leaves_guided"] - each["by_leaves_plain"] for each in found])
            if "" not in true
            else ""
        )
        yield (
            *key, len(gains), int((gains > 0.0).sum()), gains.mean(), error, gains.min(), detected,
            gain_by_leaves,
        )  # fmt: skip


def main():
    """Write the tables."""

    def shown(row):
        return [f"{value:.4g}" if isinstance(value, float) else value for value in row]

    rows = []
    with (RESULTS / "guided.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for case in cases(sys.argv[1:]):
            for row in rows_of(*case):
                rows.append(row)
                table.writerow(shown(row))
                file.flush()
                print(*shown(row), sep=", ", flush=True)
    with (RESULTS / "guided_summary.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(
            ["stand", "judge", "plans", "number", "better", "mean_gain", "standard_error",
             "least_gain", "mean_gain_found", "mean_gain_by_leaves"]
        )  # fmt: skip
        for row in summary(rows):
            table.writerow(shown(row))


if __name__ == "__main__":
    main()
