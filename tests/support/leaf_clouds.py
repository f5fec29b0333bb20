"""Writes simulated laser scans of stands with known leaves as point clouds."""

import numpy as np

from support.clouds import laspy


def write_scan(path, scan, *, calibrated=True):
    """Write the returns of a scan.  Intensities are proportional to the energy, or all equal."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [0.001] * 3, [0.0] * 3
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = scan.xyz_m
    cloud.return_number = scan.number.astype(np.uint8)
    cloud.number_of_returns = scan.total.astype(np.uint8)
    cloud.point_source_id = scan.line.astype(np.uint16) + 1
    cloud.gps_time = scan.time_s
    cloud.classification = np.where(scan.on_ground, 2, 5).astype(np.uint8)
    # The ground reflects about twice as much as leaves.
    intensity = np.where(scan.on_ground, 20000, 9000) * scan.energy
    cloud.intensity = np.rint(intensity if calibrated else 0.0 * intensity).astype(np.uint16)
    cloud.write(str(path))
    return path
