"""Prior of the target's position: a raster of probabilities, as search teams make them.

Only the ratios of the raster's values matter, because they are divided by their sum.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.errors import RequestError, needs_extra
from aosplan.maps.detection_map import SearchSuccess

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.maps.detection_map import DetectionMap

    Floats = NDArray[np.float64]

MOST_PIXELS = 25_000_000

CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))


def success_of(found: DetectionMap, path: str) -> SearchSuccess:
    """Compute the probability of success of a search, with a prior from a GeoTIFF.

    Parameters
    ----------
    found
        Map of the probability of detection.
    path
        Path of the prior: a raster with one band of values that are at least 0, and with a
        coordinate reference system.

    Raises
    ------
    RequestError
        If the raster cannot be read, if it has no location, or if its values cannot be
        probabilities.
    MissingExtraError
        If rasterio is not installed.
    """
    from aosplan.geodesy import local_crs

    with needs_extra("reading the raster of --poa", "raster"):
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning, RasterioError
    from aosplan.crs import crs_of_wkt, transformer
    from aosplan.files import read_start, reading

    read_start(path, 1)
    with warnings.catch_warnings(), reading(path, "raster"):
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        try:
            with rasterio.open(path, driver="GTiff") as raster:
                values, transform = _values(raster, path), raster.transform
                crs = crs_of_wkt(raster.crs.to_wkt(), f"raster {path}")
        except RasterioError as error:
            raise RequestError(f"raster {path} cannot be read: {error}") from None
    change = transformer(local_crs(*found.origin), crs)
    inside = found.cells.inside_rows
    east, north = found.cells.middles_m[inside].T
    x, y = change.transform(east, north)
    column, row = (np.asarray(each) for each in ~transform * (np.asarray(x), np.asarray(y)))
    rows, columns = values.shape
    known = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    column, row = column[known].astype(np.int64), row[known].astype(np.int64)
    # Each cell gets the share of a pixel's probability that corresponds to its share of the pixel's
    # area.
    back = transformer(crs, local_crs(*found.origin))
    part = found.cells.cell_m**2 / _areas(transform, back, column, row)
    share = np.zeros(len(east))
    share[known] = values[row, column] * part
    share *= 1.0 / max(float(share.sum()), 1.0)
    return SearchSuccess(float(share.sum()), float(share @ found.probability[inside]))


def _values(raster: Any, path: str) -> Floats:
    """The values of a raster divided by their sum."""
    if raster.crs is None:
        raise RequestError(
            f"raster {path} has no coordinate system, so its position is unknown",
            "add one, for example with gdal_translate -a_srs",
        )
    if raster.count != 1:
        raise RequestError(
            f"raster {path} has {raster.count} bands, but a prior has only one",
            "select the band with gdal_translate -b",
        )
    if raster.width * raster.height > MOST_PIXELS:
        raise RequestError(
            f"raster {path} has {raster.width} x {raster.height} pixels, which are too many "
            "to read",
            "crop it to the search area, or use larger pixels",
        )
    values = raster.read(1, masked=True).astype(np.float64).filled(0.0)
    values = np.nan_to_num(values, nan=0.0)
    least, total = float(values.min()), float(values.sum())
    if least < 0.0 or not np.isfinite(total):
        raise RequestError(f"raster {path} contains {least:g}, which is not a probability")
    if total == 0.0:
        raise RequestError(
            f"raster {path} is zero everywhere, so there is no place at which the target is "
            "expected"
        )
    shares: Floats = values / total
    return shares


def _areas(transform: Any, change: Any, column: Any, row: Any) -> Floats:
    """Areas of pixels in square metres, in the local frame."""
    corners = [
        change.transform(*(transform * (column + across, row + down))) for across, down in CORNERS
    ]
    x, y = (np.array([np.asarray(corner[axis]) for corner in corners]) for axis in (0, 1))
    after = np.roll(np.arange(4), -1)
    area: Floats = 0.5 * np.abs((x * y[after] - x[after] * y).sum(axis=0))
    return area
