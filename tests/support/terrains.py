"""Rasters of ground heights for tests, and flights over this ground."""

import numpy as np
from pyproj import Transformer

from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest

LINZ = (48.3358, 14.3261)
UTM = Transformer.from_crs("EPSG:4326", "EPSG:32633", always_xy=True)
EAST, NORTH = UTM.transform(LINZ[1], LINZ[0])
SIZE = 400
"""Number of pixels along a raster's side."""


def saved(path, heights, *, crs="EPSG:32633", transform=None, pixel=1.0, nodata=None, unit=""):
    """Write a GeoTIFF that is centred at LINZ."""
    import rasterio
    from rasterio.transform import from_origin

    rows, columns = heights.shape
    if transform is None:
        west, top = EAST - 0.5 * columns * pixel, NORTH + 0.5 * rows * pixel
        transform = from_origin(west, top, pixel, pixel)
    profile = {"driver": "GTiff", "width": columns, "height": rows, "count": 1}
    with rasterio.open(
        path, "w", dtype=heights.dtype, crs=crs, transform=transform, nodata=nodata, **profile
    ) as raster:
        raster.write(heights, 1)
        if unit:
            raster.units = [unit]
    return str(path)


def surface(function, pixel=1.0, size=SIZE):
    """Heights at the centres of pixels.  They are computed by a function of the metres from the
    middle.
    """
    middle = (np.arange(size) - 0.5 * (size - 1)) * pixel
    return function(middle[None, :], -middle[:, None]).astype(np.float32)


def slope(x, y):
    return 300.0 + 0.2 * x - 0.1 * y


def hills(x, y):
    return 300.0 + 12.0 * np.sin(x / 17.0) * np.cos(y / 23.0)


def planned(**values):
    """A plan at 40 m at LINZ."""
    return plan(PlanRequest(**({"altitude": 40, "origin": LINZ} | values)))
