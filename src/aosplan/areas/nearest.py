"""Search for nearest points.

Up to `MOST_COMPARED` points are compared directly. For more points, a tree of SciPy is used. For
fewer points, the tree is not used, because importing it takes longer than the rest of a plan over a
small area.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Points = NDArray[np.float64]

MOST_COMPARED = 3_000
"""Largest number of points that are compared without a tree."""

PLACES_AT_ONCE = 256


class Nearest:
    """A set of points, in which the points nearest to a place can be found.

    Parameters
    ----------
    points
        Shape (n, 2) [m].
    """

    def __init__(self, points: Points) -> None:
        self.points = points
        self._tree: Any = None
        if len(points) > MOST_COMPARED:
            from scipy.spatial import cKDTree

            self._tree = cKDTree(points)

    def to(self, places: Points, count: int) -> NDArray[np.intp]:
        """Indices of the nearest points to each place, shape (m, count), in order of distance.

        Parameters
        ----------
        places
            Shape (m, 2) [m].
        count
            Number of points to find, at most the number of all points.
        """
        if self._tree is not None:
            found = np.asarray(self._tree.query(places, count)[1], np.intp)
            return found.reshape(len(places), count)
        parts = [
            self._compared(places[start : start + PLACES_AT_ONCE], count)
            for start in range(0, len(places), PLACES_AT_ONCE)
        ]
        return np.concatenate(parts)

    def _compared(self, places: Points, count: int) -> NDArray[np.intp]:
        off = places[:, None, :] - self.points[None, :, :]
        distances = off[..., 0] * off[..., 0] + off[..., 1] * off[..., 1]
        if count < len(self.points):
            near = np.argpartition(distances, count - 1, axis=1)[:, :count]
            near.sort(axis=1)  # Points at equal distances are ordered by their index.
        else:
            near = np.broadcast_to(np.arange(count), distances.shape)
        order = np.argsort(np.take_along_axis(distances, near, axis=1), axis=1, kind="stable")
        nearest: NDArray[np.intp] = np.take_along_axis(near, order, axis=1)
        return nearest
