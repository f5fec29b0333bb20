"""Where the rays of perspective views meet slices, along one axis of a plot."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


class Axis(NamedTuple):
    """Targets and cameras along one axis, with distances in targets.

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
        """An axis of `count` targets from `first` on, which are `pitch_m` apart."""
        target = np.arange(first, first + count, dtype=np.float64) + (0.5 - 0.5 * plot)
        return cls(target, camera_m[:, np.newaxis] / pitch_m, plot, altitude_m / pitch_m)

    @property
    def size(self) -> int:
        """Number of rays: the targets for each camera."""
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
        """Columns of targets in which rays are at some heights, shape (heights, cameras, count).

        Parameters
        ----------
        heights
            Heights divided by the altitude, each from 0 to below 1.

        Returns
        -------
        ndarray
            Columns from 0 on within the plot, and negative or higher ones beyond its ends.
        """
        height = heights[:, np.newaxis, np.newaxis]
        place = self.target * (1.0 - height) + (self.camera * height + 0.5 * self.plot)
        columns: NDArray[np.intp] = np.floor(place).astype(np.intp)
        return columns
