"""Start-up time of whole processes, divided by the start-up time of Python.  The results are
medians of one run.

Run: python benchmarks/start_up.py [--repeats 25]

On a busy machine, processes wait for the processor.  The result therefore has the number of
processes that were running or waiting.  The saved scenes contain a generated clumped stand of 24 m;
they are written as by ``aosplan scene --save``.  It writes benchmarks/results/start_up.csv.
Install aosplan as a user does (``pip install .``), because an editable install with
PYTHONDONTWRITEBYTECODE compiles every module at every start.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

RESULTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "results")
AOSPLAN = [sys.executable, "-m", "aosplan"]
PLAN = [*AOSPLAN, "plan", "--altitude", "40", "--vhat", "0.98"]
SAVED = [*AOSPLAN, "plan", "--altitude", "50", "--vhat", "0.8", "--json", "--scene"]

COMMANDS = {
    "plan --json": ([*PLAN, "--json"], 10),
    "plan --json with a place": ([*PLAN, "--json", "--origin", "48.3358,14.3261"], 18),
    "plan, table": (PLAN, 14),
    "plan --json over an area": ([*PLAN, "--json", "--area", "area.geojson"], 33),
    "--help": ([*AOSPLAN, "--help"], 7),
    "plan --help": ([*AOSPLAN, "plan", "--help"], 12),
    "import aosplan": ([sys.executable, "-c", "import aosplan"], 1.2),
    "plan from saved .toml": ([*SAVED, "stand.toml"], 25),
    "plan from saved .toml, layered": ([*SAVED, "stand.toml", "--model", "layered"], 25),
    "plan from saved .npz": ([*SAVED, "stand.npz"], 25),
}
BARE = [sys.executable, "-c", "pass"]


def seconds(command: list[str], folder: str) -> float:
    start = time.perf_counter()
    subprocess.run(
        command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=folder
    )
    return time.perf_counter() - start


def save_stand(folder: str) -> None:
    """Write a stand as .npz, and convert it to .toml."""
    sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "tests"))
    from support.forests import STANDS, clumped_forest

    from aosplan.scenes.files.voxel_file import VoxelStand, stand_npz

    with open(os.path.join(folder, "voxels.npz"), "wb") as file:
        file.write(stand_npz(VoxelStand.of(clumped_forest(STANDS["spruce"]))))
    ring = [[14.0, 48.0], [14.0006, 48.0], [14.0006, 48.0004], [14.0, 48.0004], [14.0, 48.0]]
    with open(os.path.join(folder, "area.geojson"), "w", encoding="utf-8") as file:
        json.dump({"type": "Polygon", "coordinates": [ring]}, file)
    for name in ("stand.npz", "stand.toml"):
        save = [*AOSPLAN, "scene", "voxels.npz", "--save", name, "--quiet"]
        subprocess.run(save, check=True, cwd=folder)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=25)
    repeats = parser.parse_args().repeats
    times: dict[str, list[float]] = {name: [] for name in ("bare", *COMMANDS)}
    with tempfile.TemporaryDirectory() as folder:
        save_stand(folder)
        loads = []
        # The commands are measured in turn, because changes of the load then affect all of them
        # equally.
        for _ in range(repeats):
            loads.append(os.getloadavg()[0])
            times["bare"].append(seconds(BARE, folder))
            for name, (command, _) in COMMANDS.items():
                times[name].append(seconds(command, folder))
    bare = statistics.median(times["bare"])
    lines = ["command,milliseconds,times_bare_python,limit"]
    print(f"{'command':30} {'ms':>7} {'x bare':>7} {'limit':>6}   (bare {1e3 * bare:.1f} ms)")
    for name, (_, limit) in COMMANDS.items():
        median = statistics.median(times[name])
        print(f"{name:30} {1e3 * median:7.1f} {median / bare:7.1f} {limit:6g}")
        lines.append(f"{name},{1e3 * median:.2f},{median / bare:.2f},{limit}")
    waiting = statistics.median(loads)
    print(f"{waiting:.1f} processes ran or waited, of {os.cpu_count()} that can run")
    lines.append(f"processes that ran or waited,,{waiting:.2f},")
    os.makedirs(RESULTS, exist_ok=True)
    with open(os.path.join(RESULTS, "start_up.csv"), "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
