"""Writes a stand of trees as a point cloud.  The stand is the same in every run.

    python examples/tutorial/make_stand.py stand.laz

The stand is 40 x 40 m large.  Its trees are up to 20 m high, and its ground is a gentle slope, whose
points are classified.  There are 40 points per square metre of ground, and one point in each cube of 0.25 m that contains leaves or
wood.  The script needs the extra lidar.
"""

import sys

import laspy
import numpy as np
from pyproj import CRS

from aosplan.simulation.forests import clumped_forest, generator

SIDE_M, VOXEL_M = 40.0, 0.25
GROUND, TREES = 2, 5


def slope_m(x, y):
    """Height of the ground."""
    return 420.0 + 0.05 * x - 0.03 * y


def stand(seed=7):
    """Points (N, 3) [m] and their classes."""
    rng = generator(seed)
    volume = clumped_forest(rng, 0.55, VOXEL_M, 2.5, 17.5, (SIDE_M, SIDE_M))
    z, y, x = np.nonzero(volume.occupied)
    trees = (np.stack([x, y, z]) + rng.uniform(0.1, 0.9, (3, len(x)))) * VOXEL_M
    ground = np.vstack([rng.uniform(0.0, SIDE_M, (2, round(40 * SIDE_M**2))), np.zeros((1, round(40 * SIDE_M**2)))])  # fmt: skip
    points = np.hstack([ground, trees]).T
    points[:, 2] += slope_m(points[:, 0], points[:, 1])
    return points, np.repeat([GROUND, TREES], [ground.shape[1], trees.shape[1]])


def write(path):
    """Write the stand and return the number of its points."""
    points, kinds = stand()
    header = laspy.LasHeader(point_format=6)
    header.scales, header.offsets = [0.001] * 3, [0.0] * 3
    header.add_crs(CRS.from_wkt('LOCAL_CS["stand",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]'))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    cloud.classification = kinds.astype(np.uint8)
    cloud.write(path)
    return len(points)


if __name__ == "__main__":
    count = write(sys.argv[1])
    print(f"Wrote {sys.argv[1]}: {count} points")
