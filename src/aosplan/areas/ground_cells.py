"""The ground as cells of a north-up raster, in metres east and north of a plan's origin."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.areas.geotiff import geotiff_bytes
from aosplan.geodesy import local_crs
from aosplan.numerics import heading_axis, turned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

MOST_CELLS = 20_000
"""Approximate largest number of cells of a map. Smaller cells would not be visible."""

SIDES_M = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
"""Allowed lengths of the sides of a cell."""


class GroundCells(NamedTuple):
    """Cells of a raster.  `inside` selects the cells that belong to the ground of interest.

    Attributes
    ----------
    left_m, top_m
        Coordinates of the north-western outer corner.
    cell_m
        Side of a cell.
    inside
        Shape (rows, columns), with the northernmost row first: true for cells whose centre is on
        the ground of interest.
    """

    left_m: float
    top_m: float
    cell_m: float
    inside: NDArray[np.bool_]

    @property
    def middles_m(self) -> Floats:
        """East and north of the centres of all cells, row by row, shape (cells, 2)."""
        rows, columns = self.inside.shape
        east = self.left_m + (np.arange(columns) + 0.5) * self.cell_m
        north = self.top_m - (np.arange(rows) + 0.5) * self.cell_m
        return np.column_stack([np.tile(east, rows), np.repeat(north, columns)])

    @property
    def area_m2(self) -> float:
        """Area of the cells inside."""
        return float(self.inside.sum()) * self.cell_m**2

    @property
    def inside_rows(self) -> NDArray[np.bool_]:
        """`inside` of all cells, row by row, shape (cells,)."""
        return self.inside.ravel()

    def raster(self, values: NDArray[Any]) -> Floats:
        """Arrange the values of all cells in rows of the raster, with nan for cells outside."""
        return np.where(self.inside, np.reshape(values, self.inside.shape), np.nan)

    def geotiff(
        self, bands: Sequence[NDArray[Any]], names: Sequence[str], origin: tuple[float, float]
    ) -> bytes:
        """A GeoTIFF with values of all cells. `origin` is the latitude and longitude of the origin.

        Raises
        ------
        MissingExtraError
            If rasterio is not installed.
        """
        corner = self.left_m, self.top_m
        rasters = np.stack([self.raster(band) for band in bands])
        return geotiff_bytes(rasters, corner, self.cell_m, local_crs(*origin), names)


def side_m(area_m2: float, narrowest_m: float) -> float:
    """Choose the side of the cells so that the shorter side of an area is at least a few cells
    long.
    """
    wanted = max(math.sqrt(area_m2 / MOST_CELLS), SIDES_M[0])
    fitting = [side for side in SIDES_M if side >= wanted * (1.0 - 1e-9)]
    side = fitting[0] if fitting else wanted
    return min(side, max(narrowest_m / 4.0, SIDES_M[0]))


def cells_over(shape: Any, cell_m: float) -> GroundCells:
    """Cells over a shapely geometry. The coordinates of their corners are multiples of
    their side.
    """
    import shapely

    west, south, east, north = shapely.bounds(shape).tolist()
    left, top = math.floor(west / cell_m) * cell_m, math.ceil(north / cell_m) * cell_m
    columns = max(math.ceil((east - left) / cell_m), 1)
    rows = max(math.ceil((top - south) / cell_m), 1)
    cells = GroundCells(left, top, cell_m, np.ones((rows, columns), np.bool_))
    with np.errstate(divide="ignore", invalid="ignore"):  # GEOS leaves floating-point flags
        shapely.prepare(shape)
        inside = shapely.contains_xy(shape, *cells.middles_m.T)
    return cells._replace(inside=inside.reshape(rows, columns))


def footprints(points_m: Floats, footprint_m: tuple[float, float], heading_deg: float) -> Any:
    """The ground that photos show: the union of their footprints, as a shapely geometry.

    Parameters
    ----------
    points_m
        Positions of the photos, metres east and north, shape (N, 2).
    footprint_m
        Size of a photo on the ground, along the heading and across it.
    heading_deg
        Direction of the photos' upper side, clockwise from north.
    """
    import shapely

    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.5 * np.array(footprint_m)
    ring = np.column_stack(turned(corners[:, 0], corners[:, 1], heading_axis(heading_deg)))
    with np.errstate(divide="ignore", invalid="ignore"):  # GEOS leaves floating-point flags
        return shapely.union_all(shapely.polygons(points_m[:, None, :] + ring))
