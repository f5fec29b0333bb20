"""The share of the targets of one place that cameras see through a stand with known voxels.

The voxels determine which of the targets a camera does not see (perspective views in
`aosplan.scenes.occlusion`). The share of the targets that a single position sees is its *reciprocal
visibility* (Nathan, Strand, Shutin and Bimber, 2024, arXiv 2402.06991). A set of N positions is
judged by its joint occlusion. Let h be the share of the positions that do not see a target. As in
`aosplan.models.measured`, p̄ is the mean of h over the targets, and the integral visibility is V =
1 - mean of h².
"""

from __future__ import annotations

import math
from copy import copy
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.grid.patterns import local_sites
from aosplan.models.model import Prediction
from aosplan.scenes.occlusion import Occlusion, PlotWindow

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from aosplan.grid.patterns import AnyPattern
    from aosplan.scenes.plot_frame import PlotFrame
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]
    Mask = NDArray[np.bool_]

MOST_TARGETS = 4096
"""Approximate largest number of targets of a place. The targets are spread evenly over
the place.
"""

AT_ONCE = 64
"""Number of cameras whose views are computed at once."""


class Ground(NamedTuple):
    """A part of the ground, given by a rectangle around it and a function that selects its points.

    Attributes
    ----------
    low_m, high_m
        Corners of the rectangle along x and y, from the middle of the plot.
    holds
        Function that takes points in the same coordinates, shape (n, 2), and returns a mask of the
        points that belong to the place, shape (n,).
    """

    low_m: tuple[float, float]
    high_m: tuple[float, float]
    holds: Callable[[Floats], Mask]


class PlaceViews:
    """Views of the targets of a place through a volume of voxels. All cameras have the same
    altitude.

    Parameters
    ----------
    volume
        The voxels of the plot.
    altitude_m
        Altitude of the cameras above the focal plane, above all voxels.
    ground
        The place; it has to be on the plot.
    focal_height_m
        Height of the focal plane above the ground.

    Raises
    ------
    RequestError
        If the place is not on the plot, or is smaller than a target.
    """

    def __init__(
        self,
        volume: VoxelVolume,
        altitude_m: float,
        ground: Ground,
        *,
        focal_height_m: float = 0.0,
    ) -> None:
        per_voxel = volume.targets_per_voxel
        pitch_m = volume.voxel_m / per_voxel
        middle = 0.5 * np.array(volume.size_m)
        low, high = np.array(ground.low_m), np.array(ground.high_m)
        if (low < -middle - 1e-9).any() or (high > middle + 1e-9).any():
            beyond_m = float(np.maximum(-middle - low, high - middle).max())
            raise RequestError(
                f"the target area reaches {beyond_m:.3g} m beyond the edge of the scene, which "
                f"measures {volume.size_m[0]:.4g} x {volume.size_m[1]:.4g} m",
                "choose a place that the point cloud covers, or a smaller area",
            )
        first = np.floor((low + middle) / pitch_m).astype(np.intp)
        counts = np.ceil((high + middle) / pitch_m).astype(np.intp) - first
        every = max(math.ceil(math.sqrt(float(np.prod(counts)) / MOST_TARGETS)), 1)
        column, row = first.tolist()
        columns, rows = counts.tolist()
        self._occlusion = Occlusion(
            volume,
            altitude_m,
            view="perspective",
            focal_height_m=focal_height_m,
            window=PlotWindow(row, column, rows, columns),
        )
        self._every = every
        x, y = (
            (start + np.arange(0, count, every) + 0.5) * pitch_m - half
            for start, count, half in zip(first, counts, middle, strict=True)
        )
        points = np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])
        self._inside = ground.holds(points)
        if not self._inside.any():
            raise RequestError(
                f"the target area is too small, because the points for which views are computed are "
                f"{pitch_m:.2g} m apart",
                "give a larger area",
            )
        self.targets_m = points[self._inside]
        self.pitch_m = every * pitch_m
        self._ground = low, high
        self._half_m = middle
        self._rise = max(volume.canopy_top_m - focal_height_m, 0.0) / altitude_m

    def hidden(self, positions_m: ArrayLike) -> Mask:
        """Mask of the targets that each camera does not see, shape (N, targets).

        Parameters
        ----------
        positions_m
            Positions of the cameras along x and y, relative to the middle of the plot, shape (N,
            2).
        """
        positions = np.asarray(positions_m, dtype=np.float64)
        found = np.empty((len(positions), len(self.targets_m)), dtype=np.bool_)
        # Cameras with the same x are computed together, because they use the same intermediate
        # results.
        order = np.lexsort((positions[:, 1], positions[:, 0]))
        for start in range(0, len(order), AT_ONCE):
            some = order[start : start + AT_ONCE]
            views = self._occlusion.unpack(self._occlusion.masks(positions[some]))
            thinned = views[:, :: self._every, :: self._every]
            found[some] = thinned.reshape(len(some), -1)[:, self._inside]
        return found

    def stays_on_plot(self, positions_m: Floats) -> Mask:
        """Whether all rays from the place to each position stay above the plot, shape (N,)."""
        low, high = (
            corner * (1.0 - self._rise) + positions_m * self._rise for corner in self._ground
        )
        within = (low >= -self._half_m - 1e-9) & (high <= self._half_m + 1e-9)
        return within[:, 0] & within[:, 1]


def joint_density(hidden: Mask) -> Floats:
    """J, the share of targets that are hidden in both views of a pair, for all pairs, shape (N, N).
    `hidden` has the shape (N, targets).
    """
    shares = hidden.astype(np.float32)
    # The sums are whole numbers that single precision represents exactly.
    joint: Floats = (shares @ shares.T).astype(np.float64) / hidden.shape[1]
    return joint


def prediction_of(hidden: Mask) -> Prediction:
    """p̄ and the shortfall of the views of a place. `hidden` has the shape (N, targets).

    If all targets are visible in all views, or hidden in all views, the views are treated as
    independent.
    """
    counts = hidden.sum(axis=0, dtype=np.int64)
    views, targets = hidden.shape
    total, squares = int(counts.sum()), int((counts * counts).sum())
    clear = views * targets - total
    shortfall = (targets * squares - total**2) / (total * clear) if total and clear else 1.0 / views
    return Prediction(total / (views * targets), clear / (views * targets), shortfall)


class PlaceModel:
    """Predictions for cameras at known positions above one place, by the measured model.

    It has the methods of `aosplan.models.model.VisibilityModel`.  Positions are metres east and
    north of the plan's origin.
    """

    name = "measured"
    edges = "interior"
    rises_with_baseline = False
    rule_baseline_m = None
    independent_baseline_m = sharp_baseline_m = widest_aperture_m = math.inf

    def __init__(self, views: PlaceViews, frame: PlotFrame, heading_deg: float = 0.0) -> None:
        self._views, self._frame, self.heading_deg = views, frame, heading_deg

    @property
    def density(self) -> float:
        """Density p of a single photo that is taken above the origin."""
        return self.predict_positions([(0.0, 0.0)]).density

    @property
    def transparency(self) -> float:
        """Transparency 1 - p of a single photo that is taken above the origin."""
        return self.predict_positions([(0.0, 0.0)]).transparency

    def at_heading(self, heading_deg: float) -> PlaceModel:
        """The same model for patterns at another heading."""
        turned = copy(self)
        turned.heading_deg = heading_deg
        return turned

    def predict(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """Density and shortfall of a pattern that is flown with a baseline."""
        return self.predict_positions(
            np.column_stack(local_sites(pattern, baseline_m, self.heading_deg))
        )

    at_best = predict

    def predict_positions(self, positions_m: ArrayLike) -> Prediction:
        """Density and shortfall of samples at known positions, shape (N, 2)."""
        return prediction_of(self._hidden(positions_m))

    def hidden_at(self, positions_m: ArrayLike) -> Floats:
        """Share of the place that a sample at each position does not see, shape (N,)."""
        shares: Floats = self._hidden(positions_m).mean(axis=1)
        return shares

    def unseen_share(self, positions_m: ArrayLike) -> float:
        """Share of the place that no sample sees."""
        return float(self._hidden(positions_m).all(axis=0).mean())

    def correlation(self, x_m: Floats, y_m: Floats) -> Floats:
        """Correlation between the sample above the origin and samples at offsets east and north of
        it.
        """
        offsets = np.column_stack([np.ravel(x_m), np.ravel(y_m)])
        hidden = self._hidden(np.vstack([np.zeros((1, 2)), offsets])).astype(np.float64)
        first, others = hidden[0], hidden[1:]
        spread = first.std() * others.std(axis=1)
        covariance = (others * first).mean(axis=1) - others.mean(axis=1) * first.mean()
        known: Floats = covariance / np.where(spread > 0.0, spread, 1.0)
        return known.reshape(np.shape(x_m))

    def _hidden(self, positions_m: ArrayLike) -> Mask:
        return self._views.hidden(self._frame.onto_plot(np.asarray(positions_m, dtype=np.float64)))
