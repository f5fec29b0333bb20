"""Positions along one axis of a plot at which the rays of perspective views meet slices."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


class Axis(NamedTuple):
    """Targets and cameras along one axis.  The unit of all distances is the spacing of targets.

    Attributes
    ----------
    target
        Shape (count,): positions of targets relative to the plot's centre.
    camera
        Shape (cameras, 1): positions of cameras relative to the plot's centre.
    plot
        Number of targets along the plot.
    altitude
        Altitude of the cameras.
    """

    target: Floats
    camera: Floats
    plot: int
    altitude: float

    @classmethod
    def along(
        cls, camera_m: Floats, pitch_m: float, altitude_m: float, plot: int, first: int, count: int
    ) -> Axis:
        """An axis of `count` targets that are `pitch_m` apart, beginning with the target
        `first`.
        """
        target = np.arange(first, first + count, dtype=np.float64) + (0.5 - 0.5 * plot)
        return cls(target, camera_m[:, np.newaxis] / pitch_m, plot, altitude_m / pitch_m)

    @property
    def size(self) -> int:
        """Number of rays: number of cameras times number of targets."""
        return self.target.size * self.camera.size

    @property
    def slant(self) -> Floats:
        """Tangents of the angles of rays, projected on this axis, shape (cameras, count)."""
        return (self.camera - self.target) / self.altitude

    @property
    def slope(self) -> Floats:
        """Positions of the cameras divided by the altitude, shape (cameras,)."""
        return self.camera[:, 0] / self.altitude

    def met(self, heights: Floats) -> NDArray[np.intp]:
        """The columns of targets above which the rays are at the given heights, shape (heights,
        cameras, count).

        Parameters
        ----------
        heights
            Heights divided by the altitude, each from 0 to below 1.

        Returns
        -------
        ndarray
            Numbers of columns. On the plot, they are from 0 to ``plot - 1``. Beyond its ends, they
            are negative or at least `plot`.
        """
        height = heights[:, np.newaxis, np.newaxis]
        place = self.target * (1.0 - height) + (self.camera * height + 0.5 * self.plot)
        columns: NDArray[np.intp] = np.floor(place).astype(np.intp)
        return columns
