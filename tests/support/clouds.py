"""Writes point clouds to files for tests, and computes their voxels by brute force."""

import numpy as np
import pytest

from aosplan.errors import RequestError
from aosplan.scenes.files.point_cloud import read_voxels

laspy = pytest.importorskip("laspy")


def write_cloud(
    path, xyz, kind=2, *, point_format=6, scale=0.001, offset=0.0, withheld=0, crs="EPSG:32633"
):
    """Write a LAS or LAZ file.  `crs` is a coordinate reference system for pyproj, or None."""
    header = laspy.LasHeader(point_format=point_format)
    header.scales = np.broadcast_to(scale, 3).astype(float)
    header.offsets = np.broadcast_to(offset, 3).astype(float)
    if crs is not None:
        header.add_crs(pytest.importorskip("pyproj").CRS.from_user_input(crs))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = xyz
    cloud.classification = np.broadcast_to(kind, len(xyz[0])).astype(np.uint8)
    cloud.withheld = np.broadcast_to(withheld, len(xyz[0])).astype(np.uint8)
    cloud.write(str(path))
    return path


def slope(x, y):
    return 50.0 + 0.2 * x - 0.1 * y


def stand(seed=0, width=20.1, depth=12.1, count=6000):
    """Points in a rectangle on a slope.  Half of the points are ground, and half are canopy at 3 to
    9 m.

    No point is close to a face of a voxel of 0.25 m. Rounding therefore does not move a point to
    another voxel.
    """
    rng = np.random.default_rng(seed)
    within = rng.uniform(0.03, 0.22, (3, count))
    x = 0.25 * rng.integers(0, int(width / 0.25), count) + within[0]
    y = 0.25 * rng.integers(0, int(depth / 0.25), count) + within[1]
    x[:4], y[:4] = [0.0, width, 0.0, width], [0.0, 0.0, depth, depth]
    kind = np.where(np.arange(count) < count // 2, 2, 5)
    height = np.where(kind == 2, 0.0, 0.25 * rng.integers(12, 36, count) + within[2])
    return np.stack([x, y, slope(x, y) + height]), kind


def patched(path, position, data):
    content = bytearray(path.read_bytes())
    content[position : position + len(data)] = data
    path.write_bytes(content)
    return path


def refusal(path, **given):
    """The error for a file.  The message has to name the file."""
    with pytest.raises(RequestError) as caught:
        read_voxels(path, **given)
    assert str(path) in caught.value.message
    assert "\n" not in caught.value.message
    return caught.value
