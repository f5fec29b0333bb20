"""Writing of GeoTIFFs with float32 bands."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.errors import needs_extra

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


def geotiff_bytes(
    bands: NDArray[Any],
    corner_m: tuple[float, float],
    cell_m: float,
    crs: str | None,
    names: Sequence[str] = (),
) -> bytes:
    """A north-up GeoTIFF of float32 values, with nan for missing values.

    Parameters
    ----------
    bands
        Shape (bands, rows, columns), with the northernmost row first.
    corner_m
        Map coordinates of the outer corner of the north-western pixel.
    cell_m
        Side of a pixel, in units of the coordinate system.
    crs
        Coordinate reference system in any form that PROJ reads, or None.
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
    _, rows, columns = np.shape(bands)
    with warnings.catch_warnings(), MemoryFile() as memory:
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with (
            rasterio.Env(GTIFF_REPORT_COMPD_CS=True),
            memory.open(
                driver="GTiff",
                width=columns,
                height=rows,
                count=len(bands),
                dtype="float32",
                crs=crs,
                transform=rasterio.Affine(cell_m, 0.0, corner_m[0], 0.0, -cell_m, corner_m[1]),
                nodata=float("nan"),
                compress="deflate",
            ) as file,
        ):
            file.write(np.asarray(bands, dtype=np.float32))
            for index, name in enumerate(names, 1):
                file.set_band_description(index, name)
        content: bytes = memory.read()
    return content
