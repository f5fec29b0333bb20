"""Integral images as georeferenced GeoTIFF files with float32 bands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aosplan.areas import geotiff

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.postflight.integral.focal_plane import Raster
    from aosplan.postflight.integral.georeference import Georeference


def integral_geotiff(
    bands: NDArray[Any],
    raster: Raster,
    georeference: Georeference | None,
    names: Sequence[str] = (),
) -> bytes:
    """A GeoTIFF of float32 values, with nan for missing values.

    Parameters
    ----------
    bands
        Shape (bands, rows, columns).
    raster
        Extent and pixel size of the image.
    georeference
        Location of the world.  If it is None, the file has the coordinates of the world and no
        coordinate reference system.
    names
        Descriptions of the bands.

    Raises
    ------
    MissingExtraError
        If rasterio is not installed.
    """
    x_m, y_m = (0.0, 0.0) if georeference is None else (georeference.x_m, georeference.y_m)
    return geotiff.geotiff_bytes(
        bands,
        (raster.left_m + x_m, raster.top_m + y_m),
        raster.gsd_m,
        None if georeference is None else georeference.crs,
        names,
    )
