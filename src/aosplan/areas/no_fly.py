"""Shortest paths around no-fly zones.

The paths turn at the corners of slightly enlarged zones. Sites and legs keep a distance of at least
`MARGIN_M` / 2 from a zone, because mission files contain rounded coordinates.
"""

from __future__ import annotations

import heapq
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from aosplan.areas.area import MARGIN_M, grown
from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Points = NDArray[np.float64]

MOST_CORNERS = 5_000
"""Largest number of corners of all zones.  The search for a detour examines all corners."""


class NoFlyZones:
    """No-fly zones, and the shortest paths around them.

    Parameters
    ----------
    keep_out
        The zones with their buffer, in metres (shapely).

    Raises
    ------
    RequestError
        If the zones have more than `MOST_CORNERS` corners.
    """

    def __init__(self, keep_out: Any) -> None:
        self._wall = grown(keep_out, 0.5 * MARGIN_M)
        shapely.prepare(self._wall)
        self._is_empty = bool(self._wall.is_empty)
        self._bounds: list[float] = shapely.bounds(self._wall).tolist()
        self.corners = _corners(grown(keep_out, MARGIN_M))
        if len(self.corners) > MOST_CORNERS:
            raise RequestError(
                f"the no-fly zones have {len(self.corners)} corners, more than {MOST_CORNERS}",
                "keep only the zones near the area, or draw the zones with fewer corners",
            )
        self._seen: dict[int, tuple[NDArray[np.intp], NDArray[np.float64]]] = {}
        self._ways: dict[tuple[float, ...], list[tuple[float, float]] | None] = {}

    def __bool__(self) -> bool:
        """Whether there is at least one zone."""
        return not self._is_empty

    def inside(self, points: Points) -> NDArray[np.bool_]:
        """Whether each of the points, shape (n, 2), is in a zone."""
        hit: NDArray[np.bool_] = shapely.intersects_xy(self._wall, points[:, 0], points[:, 1])
        return hit

    def cross(self, start: Points, stop: Points) -> NDArray[np.bool_]:
        """Whether each leg passes through a zone. `start` and `stop` are the ends of the legs,
        shape (n, 2).
        """
        crossing = np.zeros(len(start), bool)
        if self._is_empty:
            return crossing
        x_low, y_low, x_high, y_high = self._bounds
        low, high = np.minimum(start, stop), np.maximum(start, stop)
        near = (
            (low[:, 0] <= x_high) & (high[:, 0] >= x_low)
            & (low[:, 1] <= y_high) & (high[:, 1] >= y_low)
        )  # fmt: skip
        legs = shapely.linestrings(np.stack([start[near], stop[near]], axis=1))
        crossing[near] = shapely.intersects(self._wall, legs)
        return crossing

    def crosses(self, start: Sequence[float], stop: Sequence[float]) -> bool:
        """Whether one leg passes through a zone.

        This is `cross` for a single leg. If the leg is clearly outside all zones, no arrays are
        used. This saves time, because many thousands of legs are tested one by one when a tour is
        improved.
        """
        x_low, y_low, x_high, y_high = self._bounds
        (ax, ay), (bx, by) = start, stop
        if (
            max(ax, bx) < x_low
            or min(ax, bx) > x_high
            or max(ay, by) < y_low
            or min(ay, by) > y_high
        ):
            return False
        return bool(shapely.intersects(self._wall, shapely.linestrings([start, stop])))

    def enclosures(self, points: Points) -> NDArray[np.int64]:
        """Index of the enclosed region that contains each point; -1 if the point is not enclosed.

        No path leaves an enclosed region.
        """
        rings = [
            shapely.Polygon(hole)
            for part in shapely.get_parts(self._wall)
            for hole in part.interiors
        ]
        found = np.full(len(points), -1, np.int64)
        # Larger regions are processed first. A point in nested regions therefore gets the index of
        # the smallest region.
        for index, ring in enumerate(sorted(rings, key=lambda ring: -ring.area)):
            shapely.prepare(ring)
            found[shapely.intersects_xy(ring, points[:, 0], points[:, 1])] = index
        return found

    def around(self, start: Points, stop: Points) -> list[tuple[float, float]] | None:
        """The corners at which the shortest path between two points turns; None if there is no
        path.

        The search is A* over the corners. Whether a leg between two corners crosses a zone is
        tested only if the search needs this leg.
        """
        key = (*start.tolist(), *stop.tolist())
        if key not in self._ways:
            self._ways[key] = self._search(start, stop)
        return self._ways[key]

    def length_m(self, start: Points, stop: Points) -> float:
        """Length of the shortest path between two points; inf if there is no path."""
        way = self.around(start, stop)
        if way is None:
            return math.inf
        points = np.array([start, *way, stop])
        return float(np.hypot(*np.diff(points, axis=0).T).sum())

    def _search(self, start: Points, stop: Points) -> list[tuple[float, float]] | None:
        count = len(self.corners)
        ahead = np.append(np.hypot(*(self.corners - stop).T), 0.0)
        to_stop = ~self.cross(self.corners, np.broadcast_to(stop, (count, 2)))
        best = {count + 1: 0.0}
        before: dict[int, int] = {}
        # The corners have the indices 0 … count - 1, the end has the index count, and the start
        # has count + 1.
        waiting = [(0.0, count + 1)]
        while waiting:
            _, node = heapq.heappop(waiting)
            if node == count:
                way: list[tuple[float, float]] = []
                while (node := before[node]) != count + 1:
                    way.append((float(self.corners[node, 0]), float(self.corners[node, 1])))
                return way[::-1]
            here = start if node > count else self.corners[node]
            others, lengths = self._visible(start) if node > count else self._neighbours(node)
            steps = list(zip(others.tolist(), lengths.tolist(), strict=True))
            if node < count and to_stop[node]:
                steps.append((count, float(ahead[node])))
            elif node > count and not self.cross(here[None], stop[None])[0]:
                steps.append((count, math.dist(start, stop)))
            for other, length in steps:
                whole = best[node] + length
                if whole < best.get(other, math.inf):
                    best[other], before[other] = whole, node
                    heapq.heappush(waiting, (whole + float(ahead[other]), other))
        return None

    def _neighbours(self, node: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        if node not in self._seen:
            self._seen[node] = self._visible(self.corners[node])
        return self._seen[node]

    def _visible(self, point: Points) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        lines = ~self.cross(np.broadcast_to(point, self.corners.shape), self.corners)
        seen = np.flatnonzero(lines)
        return seen, np.hypot(*(self.corners[seen] - point).T)


def _corners(shape: Any) -> Points:
    """The convex corners of a shape, shape (n, 2). A shortest path around the shape turns only at
    convex corners.
    """
    found = [np.empty((0, 2))]
    for part in shapely.get_parts(shape):
        for index, ring in enumerate((part.exterior, *part.interiors)):
            points = shapely.get_coordinates(ring)[:-1]
            towards, onwards = (
                points - np.roll(points, 1, axis=0),
                np.roll(points, -1, axis=0) - points,
            )
            turn = towards[:, 0] * onwards[:, 1] - towards[:, 1] * onwards[:, 0]
            zone_on_left = shapely.is_ccw(ring) == (index == 0)
            found.append(points[turn > 0.0 if zone_on_left else turn < 0.0])
    return np.concatenate(found)
