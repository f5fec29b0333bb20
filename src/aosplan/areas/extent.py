"""How large an area is along a heading and across it, and how many sites a grid over it takes.

These are lower bounds in closed form.  They let a search leave out grids that take too long without
laying out their sites.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely

if TYPE_CHECKING:
    from aosplan.areas.area import Area

SLACK = 1e-6
"""Relative: a bound is lowered by this for the rounding of coordinates."""


class Extent(NamedTuple):
    """Size of an area.

    Attributes
    ----------
    area_m2
        Its area.
    along_m, across_m
        Length of its projection onto the heading, and onto the direction across it, without gaps
        between its parts.
    """

    area_m2: float
    along_m: float
    across_m: float


def extent_of(area: Area, heading_deg: float) -> Extent:
    """Size of the part of an area that is under canopy and outside no-fly zones.

    Parameters
    ----------
    area
        The area.
    heading_deg
        Direction of the flight lines, clockwise from true north.
    """
    shape = area.canopy if area.keep_out.is_empty else area.canopy.difference(area.keep_out)
    heading = math.radians(heading_deg)
    sine, cosine = math.sin(heading), math.cos(heading)
    parts = [shapely.get_coordinates(part) for part in shapely.get_parts(shape)]
    along = [points @ (sine, cosine) for points in parts]
    across = [points @ (cosine, -sine) for points in parts]
    return Extent(float(shape.area), _length_m(along), _length_m(across))


def least_lattice(
    extent: Extent, rows: int, columns: int, pitch_m: tuple[float, float]
) -> tuple[int, int]:
    """Fewest sites, and fewest lines of sites, of a grid that is repeated over an area.

    Every point of the area lies in the cell of one placement of the grid, by the rule of
    `aosplan.areas.coverage`.  The cells of the sites contain the area, extended by a rectangle of
    ``columns - 1`` pitches along the heading and ``rows - 1`` pitches across it.  The area of that sum of two
    sets is at least the area, plus the rectangle's length times the extent across, plus its width
    times the extended extent along.

    Parameters
    ----------
    extent
        Size of the area along the heading and across it.
    rows, columns
        The rectangle of sites around each point, none of them left out.
    pitch_m
        Distance between neighbouring sites along the heading and across it.

    Returns
    -------
    sites, lines
        At least one of each.
    """
    x, y = pitch_m
    longer, wider = (columns - 1) * x, (rows - 1) * y
    along, across = extent.along_m + longer, extent.across_m
    least_m2 = extent.area_m2 + longer * across + wider * along
    lines = math.ceil(across / y * (1.0 - SLACK)) + rows - 1
    return max(math.ceil(least_m2 / (x * y) * (1.0 - SLACK)), 1), max(lines, 1)


def distance_m(area: Area, east_m: float, north_m: float) -> float:
    """Distance of a point from the area; nothing inside."""
    return float(shapely.distance(area.whole, shapely.Point(east_m, north_m)))


def _length_m(projections: list[Any]) -> float:
    """Length of the union of intervals, each from the least to the largest of some numbers."""
    total, reached = 0.0, -math.inf
    for low, high in sorted((float(np.min(each)), float(np.max(each))) for each in projections):
        total += max(high - max(low, reached), 0.0)
        reached = max(reached, high)
    return total
