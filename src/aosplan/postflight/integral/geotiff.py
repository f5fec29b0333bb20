"""Integral images as GeoTIFF: float32 bands in their place on earth."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from aosplan.errors import needs_extra

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.postflight.integral.focal_plane import Raster
    from aosplan.postflight.integral.georeference import Georeference


def geotiff_bytes(
    bands: NDArray[np.float64],
    raster: Raster,
    georeference: Georeference | None,
    names: Sequence[str] = (),
) -> bytes:
    """A GeoTIFF of float32, nan where there is no value.

    Parameters
    ----------
    bands
        Shape (bands, rows, columns).
    raster
        Where its pixels lie.
    georeference
        Where the world lies; without it, coordinates are those of the world and there is no
        coordinate system.
    names
        Descriptions of the bands.

    Raises
    ------
    MissingExtraError
        If rasterio is not installed.
    """
    with needs_extra("writing a GeoTIFF", "raster"):
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning
        from rasterio.io import MemoryFile
    x_m, y_m = (0.0, 0.0) if georeference is None else (georeference.x_m, georeference.y_m)
    corner = rasterio.Affine(
        raster.gsd_m, 0.0, raster.left_m + x_m, 0.0, -raster.gsd_m, raster.top_m + y_m
    )
    with warnings.catch_warnings(), MemoryFile() as memory:
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with (
            rasterio.Env(GTIFF_REPORT_COMPD_CS=True),
            memory.open(
                driver="GTiff",
                width=raster.columns,
                height=raster.rows,
                count=len(bands),
                dtype="float32",
                crs=None if georeference is None else georeference.crs,
                transform=corner,
                nodata=float("nan"),
                compress="deflate",
            ) as file,
        ):
            file.write(np.asarray(bands, dtype=np.float32))
            for index, name in enumerate(names, 1):
                file.set_band_description(index, name)
        content: bytes = memory.read()
    return content
