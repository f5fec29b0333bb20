"""Prior of the target's position: a raster of probabilities, as search teams make them.

Only the ratios of the raster's values matter, because the values are divided by their sum.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.errors import RequestError, needs_extra

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.areas.ground_cells import GroundCells

    Floats = NDArray[np.float64]

MOST_PIXELS = 25_000_000

CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))


def prior_shares(cells: GroundCells, origin: tuple[float, float], path: str) -> Floats:
    """For each cell of the ground, the probability that the target is in this cell.

    Parameters
    ----------
    cells
        The cells.
    origin
        Latitude and longitude of their origin.
    path
        Path of the prior: a raster with one band of values that are at least 0, and with a
        coordinate reference system.

    Returns
    -------
    shares
        Shape (cells,); 0 for cells outside the ground of interest.  The sum is the probability that
        the target is on this ground (POA).

    Raises
    ------
    RequestError
        If the raster cannot be read, if it has no location, if its values cannot be probabilities,
        or if they are 0 on the ground of interest.
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
    change = transformer(local_crs(*origin), crs)
    inside = np.flatnonzero(cells.inside_rows)
    east, north = cells.middles_m[inside].T
    x, y = change.transform(east, north)
    column, row = (np.asarray(each) for each in ~transform * (np.asarray(x), np.asarray(y)))
    rows, columns = values.shape
    known = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    column, row = column[known].astype(np.int64), row[known].astype(np.int64)
    # Each cell gets the share of a pixel's probability that corresponds to its share of the pixel's
    # area.
    back = transformer(crs, local_crs(*origin))
    part = cells.cell_m**2 / _areas(transform, back, column, row)
    shares = np.zeros(cells.inside.size)
    shares[inside[known]] = values[row, column] * part
    total = float(shares.sum())
    if not total > 0.0:
        raise RequestError(
            f"raster {path} has no probability on the ground of the plan",
            "check its coordinate system and its extent, for example with gdalinfo",
        )
    shares *= 1.0 / max(total, 1.0)
    return shares


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
    values[np.isnan(values)] = 0.0
    least, total = float(values.min()), float(values.sum())
    if least < 0.0 or not np.isfinite(total):
        wrong = least if least < 0.0 else float(values.max())
        raise RequestError(f"raster {path} contains {wrong:g}, which is not a probability")
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
