"""Time to compute flights from sites: turns, heights above terrain, times and batteries.

    python benchmarks/routes.py
    python benchmarks/routes.py --sites 1e3 1e5 1e6

It plans routes over square grids with sites 2.8 m apart. For each kind of route, it prints the
microseconds per site, and this time divided by the time for the positions alone. It also prints the
growth k: compared with the previous grid, the time has increased as sites^k. The terrain is a
raster of hills with pixels of 1 m, written to a temporary folder. Times are medians of several runs
in one process, and do not include imports.

It writes benchmarks/results/routes.csv.
"""

import argparse
import csv
import math
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np
import rasterio
from pyproj import Transformer
from rasterio.transform import from_origin

from aosplan.flight.track import FlightPoints
from aosplan.grid.patterns import local_sites, pattern_for
from aosplan.planning.request import PlanRequest
from aosplan.planning.resolve import resolve_inputs
from aosplan.planning.route import build_route

RESULTS = Path(__file__).parent / "results" / "routes.csv"
ORIGIN = (48.3358, 14.3261)
BASELINE_M = 2.8

KINDS = {
    "stop": {},
    "in passing": {"trigger": "distance"},
    "batteries": {"flight_time": 25},
    "placed": {"origin": ORIGIN},
    "terrain": {"origin": ORIGIN, "terrain": "hills.tif"},
}


def write_hills(path: Path, side_m: int) -> None:
    """Write a raster of hills that are 12 m high and about 100 m long."""
    to_metres = Transformer.from_crs("EPSG:4326", "EPSG:32633", always_xy=True)
    east, north = to_metres.transform(ORIGIN[1], ORIGIN[0])
    x = np.arange(side_m, dtype=np.float32)
    heights = 300.0 + 12.0 * np.sin(x[None, :] / 17.0) * np.cos(x[:, None] / 23.0)
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        width=side_m,
        height=side_m,
        count=1,
        dtype="float32",
        crs="EPSG:32633",
        transform=from_origin(east - side_m / 2, north + side_m / 2, 1.0, 1.0),
        tiled=True,
    ) as raster:
        raster.write(heights.astype(np.float32), 1)


def seconds(work, runs: int) -> float:
    """Median time of some work."""
    found = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        found.append(time.perf_counter() - start)
    return median(found)


def rows_for(counts: list[int], folder: str):
    """A row for each kind of route and each number of sites."""
    before: dict[str, tuple[int, float]] = {}
    for count in counts:
        pattern, runs = pattern_for("square", count), 5 if count <= 10_000 else 3
        east, north = local_sites(pattern, BASELINE_M, 30.0)
        bare = seconds(lambda: local_sites(pattern, BASELINE_M, 30.0), runs)  # noqa: B023
        sites = FlightPoints(east, north, [True] * len(east))
        for kind, options in KINDS.items():
            request = PlanRequest(altitude=40, heading=30, **options)
            inputs = resolve_inputs(request, folder=folder)

            def work():
                build_route(
                    inputs.flight,  # noqa: B023
                    sites,  # noqa: B023
                    heading_deg=30.0,
                    origin=inputs.origin,  # noqa: B023
                    altitude_m=40.0,
                    baseline_m=BASELINE_M,
                )

            work()  # The first run imports modules and is not measured.
            taken = seconds(work, runs)
            earlier = before.get(kind)
            growth = (
                math.log(taken / earlier[1]) / math.log(len(east) / earlier[0]) if earlier else None
            )
            before[kind] = len(east), taken
            yield {
                "route": kind,
                "sites": len(east),
                "us_per_site": round(1e6 * taken / len(east), 2),
                "over_sites_alone": round(taken / bare, 1),
                "growth": "" if growth is None else round(growth, 2),
            }


def main() -> None:
    """Measure, print and save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sites", type=float, nargs="+", default=[1e3, 1e4, 1e5])
    counts = [int(count) for count in parser.parse_args().sites]
    with tempfile.TemporaryDirectory() as folder:
        write_hills(Path(folder) / "hills.tif", int(math.sqrt(2 * max(counts)) * BASELINE_M) + 200)
        rows = []
        for row in rows_for(counts, folder):
            rows.append(row)
            print("  ".join(f"{name} {value}" for name, value in row.items()), flush=True)
    with RESULTS.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
