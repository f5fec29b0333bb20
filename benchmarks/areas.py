"""Time to plan an area as a function of its number of sites, and length of its flight divided by a
lower bound of this length.

    python benchmarks/areas.py
    python benchmarks/areas.py --sites 1e2 1e4 1e6 --runs 5

Each area is a disc, a comb of sixteen strips, or a disc with a no-fly zone in it. Its size is
chosen so that it needs about the given number of sites. Sites are 2.8 m apart, and each aperture
has 50 sites. Rows are written to results/areas.csv. Each row has four medians of times in seconds:
to read the file, to find the sites, to order the sites, and to compute a lower bound of the length
for any order. It also has the length of the flight divided by this bound, and the share of the area
that is covered.
"""

from __future__ import annotations

import argparse
import csv
import math
import tempfile
import time
from pathlib import Path
from statistics import median

import matplotlib as mpl
import numpy as np
import shapely

from aosplan.areas import survey
from aosplan.areas.area import read_area
from aosplan.flight.kinematics import Timing
from aosplan.geodesy import to_wgs84
from aosplan.grid.patterns import pattern_for

mpl.use("agg")
import matplotlib.pyplot as plt

RESULTS = Path(__file__).parent / "results"
PITCH_M = 2.8
PLACE = (48.3, 14.3)


def shape_of(kind: str, sites: float) -> object:
    """An area [m] that needs about the given number of sites."""
    # The sites cover a disc that is larger by half a window on all sides.
    radius = max(math.sqrt(sites / math.pi) * PITCH_M - 10.0, 2.0)
    if kind != "comb":
        return shapely.Point(0, 0).buffer(radius, quad_segs=64)
    side = radius * math.sqrt(math.pi)
    back = shapely.box(0, 0, side, side / 20)
    teeth = [shapely.box(side * k / 16, 0, side * (k + 0.5) / 16, side * 1.6) for k in range(16)]
    return shapely.union_all([back, *teeth])


def write(shape: object, path: Path) -> str:
    """Write a shape as GeoJSON.  Its origin is at a given place."""

    def on_earth(points: np.ndarray) -> np.ndarray:
        latitudes, longitudes = to_wgs84(PLACE, *points.T.tolist())
        return np.column_stack([longitudes, latitudes])

    path.write_text(shapely.to_geojson(shapely.transform(shape, on_earth)))
    return str(path)


def measured(path: str, no_fly: str | None, runs: int) -> tuple[dict[str, float], survey.Survey]:
    """Median seconds of each step, and the survey."""
    spent: dict[str, list[float]] = {}

    def timed(name: str, function: object) -> object:
        def run(*arguments: object, **options: object) -> object:
            start = time.perf_counter()
            result = function(*arguments, **options)
            spent.setdefault(name, []).append(time.perf_counter() - start)
            return result

        return run

    inner = {"order_s": "tour_of", "bound_s": "shortest_m"}
    kept = {name: getattr(survey, name) for name in inner.values()}
    for label, name in inner.items():
        setattr(survey, name, timed(label, kept[name]))
    for _ in range(runs):
        area = timed("read_s", read_area)(path, no_fly=no_fly, buffer_m=5.0)
        result = timed("plan_s", survey.survey_of)(
            area,
            pattern_for("trimmed", 50),
            baseline_m=PITCH_M,
            heading_deg=30.0,
            footprint_m=(27.0, 33.8),
            max_sites=5_000_000,
            timing=Timing(),
        )
    for name, function in kept.items():
        setattr(survey, name, function)
    return {name: median(seconds) for name, seconds in spent.items()}, result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sites", type=float, nargs="+", default=[1e2, 1e3, 1e4, 1e5, 1e6])
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for kind in ("disc", "comb", "no-fly"):
            for wanted in options.sites:
                shape = shape_of(kind, wanted)
                path = write(shape, Path(folder) / "area.geojson")
                zone = None
                if kind == "no-fly":
                    size = math.sqrt(shape.area) / 6
                    zone = write(shapely.box(0, 0, size, size), Path(folder) / "zone.geojson")
                seconds, result = measured(path, zone, options.runs)
                rest = seconds["plan_s"] - sum(seconds[name] for name in ("order_s", "bound_s"))
                row = {
                    "area": kind,
                    "sites": result.sites,
                    "read_s": seconds["read_s"],
                    "sites_s": rest,
                    "order_s": seconds["order_s"],
                    "bound_s": seconds["bound_s"],
                    "total_s": seconds["read_s"] + seconds["plan_s"],
                    "us_per_site": 1e6 * seconds["plan_s"] / result.sites,
                    "over_bound": result.length_m / result.shortest_m,
                    "covered_share": result.covered_share,
                }
                rows.append(row)
                print(
                    {k: v if isinstance(v, str) else float(f"{v:.4g}") for k, v in row.items()},
                    flush=True,
                )
    with (RESULTS / "areas.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: v if isinstance(v, str) else f"{v:.5g}" for k, v in row.items()})
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    for kind in ("disc", "comb", "no-fly"):
        own = [row for row in rows if row["area"] == kind]
        axes.loglog([r["sites"] for r in own], [r["total_s"] for r in own], "o-", label=kind)
    ends = np.array([min(r["sites"] for r in rows), max(r["sites"] for r in rows)], float)
    axes.loglog(ends, rows[-1]["total_s"] * ends / ends[1], "k:", label="proportional")
    axes.set(xlabel="sites", ylabel="seconds, file to waypoints")
    axes.legend()
    figure.savefig(RESULTS / "areas.png", dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
