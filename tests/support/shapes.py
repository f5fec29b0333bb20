"""Random areas for tests: convex and ragged outlines, holes, several parts, slivers, and very small
parts.
"""

import math

import numpy as np
import shapely
from hypothesis import strategies as st


@st.composite
def outlines(draw, least_m=1.0, most_m=60.0):
    """One polygon near the origin: a star with random rays, a triangle, or a thin strip."""
    size = draw(st.floats(least_m, most_m))
    x, y = draw(st.floats(-most_m, most_m)), draw(st.floats(-most_m, most_m))
    turn = draw(st.floats(0.0, 2 * math.pi))
    kind = draw(st.sampled_from(["star", "convex", "strip"]))
    if kind == "strip":
        width = draw(st.floats(0.01, 1.0))
        points = np.array([(-size, 0), (size, 0), (size, width), (-size, width)])
    else:
        corners = draw(st.integers(3, 12))
        angles = np.arange(corners) / corners * 2 * math.pi
        rays = size * np.array(
            draw(st.lists(st.floats(0.2, 1.0), min_size=corners, max_size=corners))
        )
        points = np.column_stack([rays * np.cos(angles), rays * np.sin(angles)])
    turned = points @ np.array(
        [[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]]
    ) + (x, y)
    polygon = shapely.Polygon(turned)
    return shapely.convex_hull(polygon) if kind == "convex" else polygon


@st.composite
def areas(draw, **sizes):
    """A multipolygon of one to three outlines, possibly with holes."""
    whole = shapely.union_all(draw(st.lists(outlines(**sizes), min_size=1, max_size=3)))
    for hole in draw(st.lists(outlines(**sizes), max_size=2)):
        rest = shapely.difference(whole, hole)
        if rest.area > 0.5 and rest.is_valid:
            whole = rest
    parts = shapely.get_parts(shapely.get_parts(whole))
    parts = [part for part in parts if part.geom_type == "Polygon" and part.area > 0.005]
    return shapely.multipolygons(parts)


def points_in(shape, count, rng):
    """Points of a shape: its corners, points on its border, and random points."""
    corners = shapely.get_coordinates(shape)
    border = shapely.line_interpolate_point(
        shape.boundary, rng.uniform(0, 1, count), normalized=True
    )
    low, high = corners.min(axis=0), corners.max(axis=0)
    random = rng.uniform(low, high, (8 * count, 2))
    inside = random[shapely.contains_xy(shape, random[:, 0], random[:, 1])][:count]
    return np.concatenate([corners, shapely.get_coordinates(border), inside])
