"""Writes a laser scan of a small stand with a location.  The scan is the same in every run.

    python examples/tutorial/make_scan.py scan.laz

A drone's laser scanner flies over 16 x 16 m of trees up to 9 m high, in three lines.  The pulses have
up to five returns, and the cloud is in UTM zone 33 north.  The script needs the extra lidar.
"""

import sys

import laspy
import numpy as np
from pyproj import CRS

from aosplan.simulation.leaf_stands import crowned_stand, laser_scan

SIDE_M, CORNER_M = 16.0, (450_000.0, 5_353_000.0)
GROUND, TREES = 2, 5


def write(path, seed=3):
    """Write the scan and return the number of its points."""
    rng = np.random.default_rng(seed)
    stand = crowned_stand(rng, SIDE_M, leaf_area_index=2.5, crowns=14, base_m=3.0, top_m=9.0)
    scan = laser_scan(rng, stand, pulses_a_m2=120.0)
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [0.001] * 3, [*CORNER_M, 0.0]
    header.add_crs(CRS.from_epsg(32633))
    cloud = laspy.LasData(header)
    x, y, z = scan.xyz_m
    cloud.x, cloud.y, cloud.z = x + CORNER_M[0], y + CORNER_M[1], z
    cloud.return_number = scan.number.astype(np.uint8)
    cloud.number_of_returns = scan.total.astype(np.uint8)
    cloud.point_source_id = scan.line.astype(np.uint16) + 1
    cloud.gps_time = scan.time_s
    cloud.classification = np.where(scan.on_ground, GROUND, TREES).astype(np.uint8)
    cloud.intensity = np.rint(np.where(scan.on_ground, 20000, 9000) * scan.energy).astype(np.uint16)
    cloud.write(path)
    return len(z)


if __name__ == "__main__":
    count = write(sys.argv[1])
    print(f"Wrote {sys.argv[1]}: {count} points")
