"""Time and memory to write ten thousand waypoints in each format, also with GDAL.

Run: python benchmarks/exports.py [--waypoints 10000] [--repeats 3]

It writes benchmarks/results/exports.csv.  Each measurement runs in its own process.  Seconds are
medians of processor time, from waypoints in memory to closed files.  For comparison, GDAL (through
pyogrio) writes the features and properties that it has read from the file of aosplan.  The limit is
one second per format.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time

RESULTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "results")
FORMATS = ("csv", "geojson", "kml", "waypoints", "plan", "litchi", "kmz")
LIMIT_S = 1.0
"""Longest time that a format may take."""


def mission_of(count: int):
    from aosplan.grid.patterns import local_sites, pattern_for
    from aosplan.mission.mission import FlightSettings, Mission, Waypoints, placed

    east, north = local_sites(pattern_for("rectangle", count), 2.8, 30.0)
    ways = placed(Waypoints(east, north, [40.0] * len(east)), (48.3358, 14.3261))
    return Mission(ways[:count], {"camera": {"name": "dji-m3t-thermal"}}, FlightSettings())


def ours(name: str, count: int, folder: str) -> tuple[float, int, int]:
    """Seconds, number of files and number of bytes if aosplan writes the format."""
    import numpy  # noqa: F401, ICN001 (loaded before the clock starts, as GDAL is)

    from aosplan.mission.export import formats, mission_files

    mission = mission_of(count)
    start = time.process_time()
    contents = mission_files([mission], formats()[name], os.path.join(folder, f"ours.{name}"))
    for path, content in contents.items():
        with open(path, "wb") as file:
            file.write(content)
    seconds = time.process_time() - start
    return seconds, len(contents), sum(map(len, contents.values()))


def gdal(name: str, count: int, folder: str) -> tuple[float, int, int]:
    """Seconds, number of files and number of bytes if GDAL writes the features that it has read
    from the file of aosplan.
    """
    import warnings

    import numpy as np
    from pyogrio import raw

    path = os.path.join(folder, f"ours.{name}")  # This is the file that `ours` has written.
    out = os.path.join(folder, f"gdal.{name}")
    warnings.simplefilter("ignore")
    os.environ["OGR_GEOJSON_MAX_OBJ_SIZE"] = "0"
    if name == "geojson":
        driver, options = "GeoJSON", {"layer_options": {"COORDINATE_PRECISION": "10"}}
        meta, _, geometry, fields = raw.read(path)
        names = list(meta["fields"])
    else:
        driver, options = "KML", {"dataset_options": {"ALTITUDEMODE": "relativeToGround"}}
        # The two layers are the path and the sites.
        layers = [raw.read(path, layer=layer) for layer in (1, 0)]
        geometry = np.concatenate([layer[2] for layer in layers])
        names = ["Name"]  # This is the only property in the file of aosplan.
        values = [layer[3][list(layer[0]["fields"]).index("Name")] for layer in layers]
        fields = [np.concatenate(values)]
    assert len(geometry) == count + 1
    start = time.process_time()
    raw.write(
        out, geometry, fields, names, driver=driver, geometry_type="Unknown", crs="EPSG:4326",
        **options,
    )  # fmt: skip
    return time.process_time() - start, 1, os.path.getsize(out)


def measure(who: str, name: str, count: int, folder: str) -> list[float]:
    """One measurement in a new process: seconds, files, bytes, and peak memory in megabytes."""
    command = [sys.executable, __file__, "--one", who, name, str(count), folder]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return [float(value) for value in done.stdout.split()]


def one(who: str, name: str, count: str, folder: str) -> None:
    if who == "nothing":
        mission_of(int(count))
        values = (0.0, 0, 0)
    else:
        values = {"ours": ours, "gdal": gdal}[who](name, int(count), folder)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(*values, peak)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--waypoints", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--one", nargs=4, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        one(*given.one)
        return
    count = given.waypoints
    lines = ["writer,format,waypoints,seconds,files,megabytes,peak_megabytes,times_ours,limit_s"]
    print(f"{count} waypoints; the mission alone takes", end=" ")
    with tempfile.TemporaryDirectory() as folder:
        print(f"{measure('nothing', '', count, folder)[3]:.0f} MB")
        print(f"{'':16} {'s':>7} {'files':>6} {'MB':>7} {'peak MB':>8} {'x ours':>7} {'limit':>6}")
        for name in FORMATS:
            base = 0.0
            for who in ("ours", "gdal") if name in {"geojson", "kml"} else ("ours",):
                runs = [measure(who, name, count, folder) for _ in range(given.repeats)]
                seconds = statistics.median(run[0] for run in runs)
                _, files, size, peak = runs[0]
                base = base or seconds
                print(
                    f"{who:5} {name:10} {seconds:7.2f} {files:6.0f} {size / 1e6:7.1f} {peak:8.0f} "
                    f"{seconds / base:7.1f} {LIMIT_S:6.1f}"
                )
                lines.append(
                    f"{who},{name},{count},{seconds:.3f},{files:.0f},{size / 1e6:.1f},{peak:.0f},"
                    f"{seconds / base:.2f},{LIMIT_S}"
                )
    os.makedirs(RESULTS, exist_ok=True)
    with open(os.path.join(RESULTS, "exports.csv"), "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
