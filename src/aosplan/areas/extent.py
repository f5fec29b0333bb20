"""Size of an area along and across a heading, and lower bounds for the number of sites that cover
it.

With these bounds, a search can skip grids that take too long to fly, without computing their sites.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely

from aosplan.numerics import heading_axis, turned

if TYPE_CHECKING:
    from aosplan.areas.area import Area

SLACK = 1e-6
"""The bounds are lowered by this share, because coordinates are rounded."""


class Extent(NamedTuple):
    """Size of an area.

    Attributes
    ----------
    area_m2
        Size of the area.
    along_m, across_m
        Length of the projection of the area on the heading, and on the direction across the
        heading.  Gaps between its parts are not included.
    """

    area_m2: float
    along_m: float
    across_m: float


def extent_of(area: Area, heading_deg: float) -> Extent:
    """Size of the part of an area that has canopy and is outside no-fly zones.

    Parameters
    ----------
    area
        The area.
    heading_deg
        Direction of the flight lines, clockwise from true north.
    """
    shape = area.canopy if area.keep_out.is_empty else area.canopy.difference(area.keep_out)
    axis = heading_axis(heading_deg)
    parts = [shapely.get_coordinates(part) for part in shapely.get_parts(shape)]
    sides = [turned(points[:, 0], points[:, 1], axis) for points in parts]
    along_m, across_m = (_length_m([side[place] for side in sides]) for place in (0, 1))
    return Extent(float(shape.area), along_m, across_m)


def least_lattice(
    extent: Extent, rows: int, columns: int, pitch_m: tuple[float, float]
) -> tuple[int, int]:
    """Lower bounds of the number of sites and of the number of lines, for a grid repeated over an
    area.

    By the rule of `aosplan.areas.coverage`, every point of the area is in the cell of one placement
    of the grid.  The cells of the sites therefore contain the Minkowski sum of the area and a
    rectangle.  The rectangle is ``columns - 1`` pitches long along the heading and ``rows - 1``
    pitches wide across it.  The area of the Minkowski sum is at least the sum of three terms: the
    area; the length of the rectangle times `across_m`; and the width of the rectangle times the sum
    of `along_m` and the length of the rectangle.

    Parameters
    ----------
    extent
        Size of the area along the heading and across it.
    rows, columns
        The rectangle of sites around each point, without removed sites.
    pitch_m
        Distance between neighbouring sites along the heading and across it.

    Returns
    -------
    sites, lines
        Lower bounds of the number of sites and of the number of lines, both at least 1.
    """
    x, y = pitch_m
    longer, wider = (columns - 1) * x, (rows - 1) * y
    along, across = extent.along_m + longer, extent.across_m
    least_m2 = extent.area_m2 + longer * across + wider * along
    lines = math.ceil(across / y * (1.0 - SLACK)) + rows - 1
    return max(math.ceil(least_m2 / (x * y) * (1.0 - SLACK)), 1), max(lines, 1)


def distance_m(area: Area, east_m: float, north_m: float) -> float:
    """Distance of a point from the area; 0 inside."""
    return float(shapely.distance(area.whole, shapely.Point(east_m, north_m)))


def _length_m(projections: list[Any]) -> float:
    """Length of the union of intervals.  Each interval is from the smallest to the largest number
    in one array.
    """
    total, reached = 0.0, -math.inf
    for low, high in sorted((float(np.min(each)), float(np.max(each))) for each in projections):
        total += max(high - max(low, reached), 0.0)
        reached = max(reached, high)
    return total
