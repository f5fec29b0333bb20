"""Counts the crossings of boundaries, up to a limit.

A boundary of n edges may cross itself n²/2 times, and an overlay creates a vertex at every
crossing.  An overlay of 12 kB of GeoJSON can take minutes, and an overlay of 80 kB can need
gigabytes of memory.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

MOST_PAIRS = 5_000_000
"""Largest number of pairs of neighbouring edges that are tested."""

PAIRS_AT_ONCE = 1_000_000


def cross_often(shapes: Sequence[Any], most: int) -> bool:
    """Whether the edges of shapes cross each other, or themselves, more often than a limit.

    The result is also true if there are too many pairs of neighbouring edges to count.

    Parameters
    ----------
    shapes
        Polygons or collections of polygons (shapely).
    most
        Limit of the number of crossings.
    """
    edges = np.concatenate([_edges(shape) for shape in shapes])
    if len(edges) * (len(edges) - 1) // 2 <= most:
        return False
    tree = shapely.STRtree(shapely.linestrings(edges))
    at_once = max(PAIRS_AT_ONCE // len(edges), 1)
    crossings = pairs = 0
    for start in range(0, len(edges), at_once):
        one, other = tree.query(tree.geometries[start : start + at_once])
        one += start
        later = other > one  # With this condition, each pair of edges is tested once.
        one, other = one[later], other[later]
        crossings += int(np.count_nonzero(_cross(edges[one], edges[other])))
        pairs += len(one)
        if crossings > most or pairs > MOST_PAIRS:
            return True
    return False


def _edges(shape: Any) -> Floats:
    """The two ends of each edge of the rings of a shape, shape (n, 2, 2)."""
    rings = shapely.get_rings(shapely.get_parts(shape))
    points, ring = shapely.get_coordinates(rings, return_index=True)
    inner = ring[1:] == ring[:-1]
    return np.stack([points[:-1][inner], points[1:][inner]], axis=1)


def _cross(one: Floats, other: Floats) -> NDArray[np.bool_]:
    """Whether the two edges of each pair cross.  Edges that only touch do not cross."""
    return _apart(one, other) & _apart(other, one)


def _apart(edge: Floats, other: Floats) -> NDArray[np.bool_]:
    """Whether the two ends of `other` are on opposite sides of `edge`."""
    along = edge[:, 1] - edge[:, 0]
    off = other - edge[:, :1]
    sides = along[:, None, 0] * off[..., 1] - along[:, None, 1] * off[..., 0]
    apart: NDArray[np.bool_] = sides[:, 0] * sides[:, 1] < 0.0
    return apart
