"""Maps of camera positions at flight altitude, with the share of a target area that each one sees.

Such a map shows the reciprocal visibility of Nathan, Strand, Shutin and Bimber (2024, arXiv
2402.06991), averaged over the target area. Its value at a position is the share of the points of
the area that have a free line of sight to the position.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.areas.geotiff import geotiff_bytes
from aosplan.areas.ground_cells import SIDES_M, GroundCells
from aosplan.areas.photo_sets import along_and_across
from aosplan.geodesy import local_crs
from aosplan.models.place import PlaceViews
from aosplan.planning.target_area import located_stand, target_area_of
from aosplan.scenes.plot_frame import plot_frame

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.planning.result import Plan

    Floats = NDArray[np.float64]

MOST_POSITIONS = 2500
"""Approximate largest number of camera positions of a map."""

FINEST_M = 0.5


class ReciprocalMap(NamedTuple):
    """The share of a target area that is seen from each camera position.

    Attributes
    ----------
    cells
        Cells of camera positions. `inside` selects the positions whose photo shows the middle of
        the area and whose lines of sight to the area stay above the plot.
    origin
        Latitude and longitude of the origin of the cells.
    altitude_m
        Altitude of the cameras above the focal plane.
    target_area_m2, targets
        Size of the target area, and the number of points in it that are tested.
    transparency
        Share of these points that each position sees, from 0 to 1, shape (cells,); nan for cells
        that are not `inside`.
    """

    cells: GroundCells
    origin: tuple[float, float]
    altitude_m: float
    target_area_m2: float
    targets: int
    transparency: Floats

    @property
    def best(self) -> tuple[float, float, float]:
        """The position that sees the largest share of the area: metres east and north of the
        origin, and the share.
        """
        index = int(np.nanargmax(self.transparency))
        east, north = self.cells.middles_m[index].tolist()
        return east, north, float(self.transparency[index])

    def document(self) -> dict[str, Any]:
        """The map as plain values, ``reciprocal_map`` in a plan's JSON document."""
        known = self.transparency[self.cells.inside_rows]
        east_m, north_m, most = self.best
        return {
            "target_area_m2": self.target_area_m2,
            "targets": self.targets,
            "altitude_m": self.altitude_m,
            "cell_m": self.cells.cell_m,
            "positions": len(known),
            "mean": float(known.mean()),
            "most": most,
            "best_east_m": east_m,
            "best_north_m": north_m,
        }

    def geotiff(self) -> bytes:
        """A GeoTIFF with one band: the mean transparency between each position and the target area.

        Raises
        ------
        MissingExtraError
            If rasterio is not installed.
        """
        return geotiff_bytes(
            self.cells.raster(self.transparency)[np.newaxis],
            (self.cells.left_m, self.cells.top_m),
            self.cells.cell_m,
            local_crs(*self.origin),
            ["share of the target area that a camera here sees"],
        )


def reciprocal_map(plan: Plan) -> ReciprocalMap:
    """Compute the share of a plan's target area that is seen from each camera position.

    The target area is the area of the plan, or the disc around its origin.

    Raises
    ------
    RequestError
        If the scene has no voxels or no location, or does not cover the target area.
    """
    inputs = plan.inputs
    volume = located_stand(inputs, "a reciprocal map")
    area = target_area_of(inputs)
    frame = plot_frame(volume, area.origin)
    views = PlaceViews(
        volume, inputs.altitude_m, area.on(frame), focal_height_m=inputs.focal_height_m
    )
    footprint = 0.5 * np.array(inputs.footprint_m)
    low, high = area.corners_m.min(axis=0), area.corners_m.max(axis=0)
    middle = 0.5 * (low + high)
    cells = _cells(middle, float(np.hypot(*footprint)))
    away = np.abs(along_and_across(cells.middles_m - middle, inputs.heading_deg))
    shown = (away <= footprint).all(axis=1)
    on_plot = frame.onto_plot(cells.middles_m)
    inside = shown & views.stays_on_plot(on_plot)
    seen = np.full(len(inside), np.nan)
    seen[inside] = 1.0 - views.hidden(on_plot[inside]).mean(axis=1)
    return ReciprocalMap(
        cells._replace(inside=inside.reshape(cells.inside.shape)),
        area.origin,
        inputs.altitude_m,
        area.area_m2,
        len(views.targets_m),
        seen,
    )


def _cells(middle_m: Floats, reach_m: float) -> GroundCells:
    """Square cells around a point. The point is the centre of one of the cells."""
    wanted = max(2.0 * reach_m / math.sqrt(2.0 * MOST_POSITIONS), FINEST_M)
    side = next((side for side in SIDES_M if side >= wanted), wanted)
    count = math.ceil(reach_m / side)
    east, north = middle_m.tolist()
    return GroundCells(
        east - (count + 0.5) * side,
        north + (count + 0.5) * side,
        side,
        np.ones((2 * count + 1, 2 * count + 1), np.bool_),
    )
