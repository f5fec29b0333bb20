"""Writes simulated laser scans of stands with known leaves as point clouds."""

import numpy as np

from support.clouds import laspy


def write_scan(path, scan, *, calibrated=True, crs=None, corner=(0.0, 0.0)):
    """Write the returns of a scan, with intensities in proportion to energy or all equal.

    `crs` is a coordinate reference system, and `corner` the south-western corner of the plot in it.
    """
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [0.001] * 3, [*corner, 0.0]
    if crs is not None:
        header.add_crs(crs)
    cloud = laspy.LasData(header)
    x, y, z = scan.xyz_m
    cloud.x, cloud.y, cloud.z = x + corner[0], y + corner[1], z
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
