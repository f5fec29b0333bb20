"""Opacity from pulses for several sizes of voxels, compared with rays that are cast through known
leaves.

``python benchmarks/opacity.py [CLOUD]`` writes ``results/opacity.csv``.  For generated stands, this
file has p̄ and V of nine views that are 2 m apart, from 50 m, computed with rays that are cast
through the leaves.  It also has predictions from simulated pulses with calibrated and with equal
energies, and from voxels that contain a point.  Wider stands are scanned with few pulses.  If a real cloud is given, the file has the same
predictions for 49 views of this cloud, without a reference.  The processor time is the time to read
the cloud and to fit the opacity.
"""

import csv
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.leaf_clouds import write_scan

from aosplan.models.measured import MeasuredModel
from aosplan.scenes.files.point_cloud import read_voxels
from aosplan.simulation.leaf_stands import crowned_stand, hidden_share, laser_scan

RESULTS = Path(__file__).parent / "results" / "opacity.csv"
COLUMNS = (
    "stand", "pulses_a_m2", "footprint_m", "voxel_m", "opacity", "density", "expected", "normalized",
    "true_density", "true_expected", "true_normalized", "cpu_s",
)  # fmt: skip
ALTITUDE_M = 50.0
CASES = ((1, 1.5, 100.0, 0.1), (2, 1.5, 250.0, 0.1), (3, 3.0, 250.0, 0.3), (4, 1.5, 400.0, 0.1))
"""Seed, leaf area index, pulses per square metre and footprint [m]."""
SPARSE = tuple(
    (seed, leaf_area_index, crowns, pulses)
    for seed, leaf_area_index, crowns in ((1, 1.5, 25), (2, 3.0, 25), (3, 3.0, 40), (4, 5.0, 60))
    for pulses in (1.0, 2.0, 5.0, 10.0, 30.0, 100.0)
)
"""Seed, leaf area index, number of crowns, and pulses per square metre of plots of 20 m."""


def grid(side):
    """Positions of a square grid of views that are 2 m apart."""
    line = (np.arange(side) - 0.5 * (side - 1)) * 2.0
    return np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)


def predicted(path, opacity, voxel_m, views):
    """p̄, V and V̂ of views over a cloud, and the processor time."""
    began = time.process_time()
    volume = read_voxels(path, opacity=opacity, voxel_m=voxel_m, min_height_m=0.5)
    spent = time.process_time() - began
    found = MeasuredModel(volume, ALTITUDE_M).predict_positions(views)
    return found.density, found.expected, found.normalized, spent


def generated(folder):
    """Rows of generated stands."""
    views = grid(3)
    for seed, leaf_area_index, pulses, footprint in CASES:
        rng = np.random.default_rng(seed)
        stand = crowned_stand(rng, 8.0, leaf_area_index=leaf_area_index, crowns=5)
        hidden = hidden_share(stand, ALTITUDE_M, views, 0.08)
        p, square = float(hidden.mean()), float((hidden**2).mean())
        truth = p, 1.0 - square, 1.0 - (square - p * p) / (p * (1.0 - p))
        scan = laser_scan(rng, stand, pulses_a_m2=pulses, footprint_m=footprint)
        name = f"leaves {seed}, LAI {leaf_area_index:g}"
        for calibrated in (True, False):
            path = write_scan(Path(folder) / "leaves.las", scan, calibrated=calibrated)
            for voxel_m in (0.15, 0.25, 0.5):
                *shown, spent = predicted(path, "pulses", voxel_m, views)
                kind = "pulses, intensity" if calibrated else "pulses, 1/n"
                yield name, pulses, footprint, voxel_m, kind, *shown, *truth, spent
        for voxel_m in (0.15, 0.25, 0.5):
            *shown, spent = predicted(path, "voxels", voxel_m, views)
            yield name, pulses, footprint, voxel_m, "voxels", *shown, *truth, spent


def sparse(folder):
    """Rows of generated stands with few pulses, whose footprint is 0.3 m."""
    views = grid(3)
    for seed, leaf_area_index, crowns, pulses in SPARSE:
        rng = np.random.default_rng(seed)
        stand = crowned_stand(rng, 20.0, leaf_area_index=leaf_area_index, crowns=crowns)
        hidden = hidden_share(stand, ALTITUDE_M, views, 0.15)
        p, square = float(hidden.mean()), float((hidden**2).mean())
        truth = p, 1.0 - square, 1.0 - (square - p * p) / (p * (1.0 - p))
        scan = laser_scan(rng, stand, pulses_a_m2=pulses, footprint_m=0.3)
        path = write_scan(Path(folder) / "sparse.las", scan, calibrated=False)
        name = f"leaves {seed}, LAI {leaf_area_index:g}, 20 m"
        for opacity, kind in (("auto", "auto, 1/n"), ("voxels", "voxels")):
            *shown, spent = predicted(path, opacity, 0.5, views)
            yield name, pulses, 0.3, 0.5, kind, *shown, *truth, spent


def real(path):
    """Rows of a real cloud."""
    for opacity in ("pulses", "voxels"):
        for voxel_m in (0.15, 0.25, 0.35, 0.5):
            *shown, spent = predicted(path, opacity, voxel_m, grid(7))
            yield Path(path).name, "", "", voxel_m, opacity, *shown, "", "", "", spent


def main():
    """Write the results."""
    with tempfile.TemporaryDirectory() as folder, RESULTS.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        rows = [
            *generated(folder),
            *sparse(folder),
            *(row for path in sys.argv[1:] for row in real(path)),
        ]
        for row in rows:
            shown = [f"{value:.4f}" if isinstance(value, float) else value for value in row]
            writer.writerow(shown)
            print(*shown, sep=", ")


if __name__ == "__main__":
    main()
