"""A faster approximation of the measured model, by a correlogram."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from aosplan.grid.pair_offsets import offset_counts
from aosplan.grid.patterns import Scattered, local_sites
from aosplan.grid.spiral import Spiral
from aosplan.models.memo import remembered
from aosplan.models.model import Prediction

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from aosplan.grid.patterns import AnyPattern, Pattern
    from aosplan.models.memo import Known
    from aosplan.scenes.correlogram import Correlogram

    Floats = NDArray[np.float64]


NOISE_POINTS = 4
"""Number of quadrature points per axis for the mean of a table over position noise."""


@lru_cache(maxsize=1024)
def _lattice(pattern: Pattern) -> tuple[Floats, Floats, Floats]:
    """Sites of a pattern, the different offsets between them, and the number of pairs with each
    offset. Lengths are in pitches.

    An offset and its opposite are equivalent, so only one of them is returned.  The number of pairs
    with offset 0 is divided by 2.
    """
    mask = np.ones((pattern.rows, pattern.columns), dtype=np.bool_)
    mask[tuple(np.array(pattern.removed, dtype=np.intp).reshape(-1, 2).T)] = False
    last = np.array([pattern.rows - 1, pattern.columns - 1])
    pairs = offset_counts(mask, *last.tolist())
    pairs[last[0] + 1 :] = pairs[last[0], last[1] + 1 :] = 0.0
    pairs[tuple(last)] *= 0.5
    return np.argwhere(mask) - 0.5 * last, np.argwhere(pairs) - last, pairs[pairs > 0.0]


class CorrelogramModel:
    """Predictions from a correlogram for views from one altitude.

    Parameters
    ----------
    correlogram
        The correlogram of the stand.
    altitude_m
        Altitude above the focal plane.
    heading_deg
        Heading of the patterns, clockwise from the correlogram's north.
    hold_error_m
        Standard deviation, per axis, of the positions around their sites. If it is greater than 0,
        p and ρ are means over these random errors.
    """

    name = "correlogram"
    edges = "wrapped"
    rule_baseline_m = None
    rises_with_baseline = False

    def __init__(
        self,
        correlogram: Correlogram,
        altitude_m: float,
        *,
        heading_deg: float = 0.0,
        hold_error_m: float = 0.0,
    ) -> None:
        self.correlogram = correlogram
        self.altitude_m = altitude_m
        self.heading_deg = heading_deg
        self.hold_error_m = hold_error_m
        self._spirals: dict[tuple[float, float, float, bool], tuple[Floats, Floats]] = {}
        self._predictions: Known = {}

    @property
    def density(self) -> float:
        """Density p of a single nadir sample."""
        return self.correlogram.density

    @property
    def transparency(self) -> float:
        """Transparency 1 - p of a single nadir sample."""
        return 1.0 - self.density

    @property
    def independent_baseline_m(self) -> float:
        """Largest distance [m] between two views for which the plot is large enough."""
        return self.correlogram.reach * self.altitude_m

    @property
    def sharp_baseline_m(self) -> float:
        """The same distance as `independent_baseline_m`."""
        return self.independent_baseline_m

    @property
    def widest_aperture_m(self) -> float:
        """The same distance as `independent_baseline_m`."""
        return self.independent_baseline_m

    @remembered
    def predict(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """Density and shortfall of a pattern that is flown with a baseline.

        Each distinct offset of a lattice is looked up once in the correlogram. Each pair of sites
        of a spiral is looked up once for all spirals with the same baseline.
        """
        if isinstance(pattern, Spiral):
            return self._predict_spiral(pattern, baseline_m)
        if isinstance(pattern, Scattered):
            return self.predict_positions(
                np.column_stack(local_sites(pattern, baseline_m, self.heading_deg))
            )
        # Rows follow each other to the right of the heading, and columns along the heading. For the
        # heading 0, these directions are east and north.
        pitch_m = baseline_m * pattern.row_pitch, baseline_m
        sites, apart, pairs = _lattice(pattern)
        return self._prediction(sites * pitch_m, apart * pitch_m, pairs, self.heading_deg)

    def _predict_spiral(self, spiral: Spiral, baseline_m: float) -> Prediction:
        """Prediction for a spiral. All spirals use the same cumulative sums over the sites, from
        the centre outwards.
        """
        even = spiral.samples % 2 == 0
        key = spiral.turn_pitch, baseline_m, self.heading_deg, even
        if len(self._spirals.get(key, ((),))[0]) < spiral.samples:
            count = (2 << (spiral.samples // 2).bit_length()) + (not even)
            x, y = baseline_m * np.array(list(Spiral(count, spiral.turn_pitch).offsets())).T
            outward = np.argsort(np.abs(np.arange(count) - 0.5 * (count - 1)), kind="stable")
            sites_m = np.column_stack([y, x])[outward]
            hidden = self._expected(
                self.correlogram.density_at, sites_m, self.heading_deg, self.hold_error_m
            )
            later, earlier = np.tril_indices(count, -1)
            apart_m = sites_m[later] - sites_m[earlier]
            pair_error_m = math.sqrt(2.0) * self.hold_error_m
            rho = self._expected(
                self.correlogram.correlation_at, apart_m, self.heading_deg, pair_error_m
            )
            alike = np.bincount(later, rho, count).astype(np.float64)
            self._spirals[key] = np.cumsum(hidden), np.cumsum(alike)
        hidden_sum, alike_sum = (float(sums[spiral.samples - 1]) for sums in self._spirals[key])
        density = hidden_sum / spiral.samples
        shortfall = (spiral.samples + 2.0 * alike_sum) / spiral.samples**2
        return Prediction(density, 1.0 - density, max(shortfall, 0.0))

    def at_best(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """The same as `predict`, because `predict` is fast enough."""
        return self.predict(pattern, baseline_m)

    def predict_positions(self, positions_m: ArrayLike) -> Prediction:
        """Density and shortfall of samples at any known positions.  The computing time increases as
        N².

        Parameters
        ----------
        positions_m
            Shape (N, 2), N >= 1: metres east and north of the centre.
        """
        points = np.asarray(positions_m, dtype=np.float64)
        alike = 0.0
        for place in range(1, len(points)):
            alike += float(self.correlation(*(points[:place] - points[place]).T).sum())
        density = float(self.hidden_at(points).mean())
        shortfall = (len(points) + 2.0 * alike) / len(points) ** 2
        return Prediction(density, 1.0 - density, max(shortfall, 0.0))

    def hidden_at(self, positions_m: ArrayLike) -> Floats:
        """p of views at known positions, shape (N,).  Positions are in metres east and north of the
        centre.
        """
        points = np.asarray(positions_m, dtype=np.float64)
        return self._expected(self.correlogram.density_at, points, 0.0, 0.0)

    def correlation(self, x_m: Floats, y_m: Floats) -> Floats:
        """ρ of two views that are offset from each other to the east and to the north."""
        lag, direction_deg = self._polar(np.column_stack([x_m, y_m]), 0.0)
        return np.where(lag > 0.0, self.correlogram.correlation_at(lag, direction_deg), 1.0)

    def _prediction(
        self, sites_m: Floats, apart_m: Floats, pairs: Floats, heading_deg: float
    ) -> Prediction:
        """The prediction: the mean of p over the sites, and the mean of ρ over the offsets. Offsets
        are weighted by their numbers of pairs.
        """
        tables = self.correlogram
        density = float(
            self._expected(tables.density_at, sites_m, heading_deg, self.hold_error_m).mean()
        )
        pair_error_m = math.sqrt(2.0) * self.hold_error_m
        rho = self._expected(tables.correlation_at, apart_m, heading_deg, pair_error_m)
        rho[~apart_m.any(axis=1)] = 1.0  # This is the pair of a view with itself.
        return Prediction(density, 1.0 - density, max(float(rho @ pairs / pairs.sum()), 0.0))

    def _expected(
        self,
        table: Callable[[Floats, Floats], Floats],
        offsets_m: Floats,
        heading_deg: float,
        deviation_m: float,
    ) -> Floats:
        """Expected values of a table for uncertain offsets, by Gauss-Hermite quadrature along both
        axes.
        """
        if deviation_m == 0.0:
            return table(*self._polar(offsets_m, heading_deg))
        points, weights = np.polynomial.hermite_e.hermegauss(NOISE_POINTS)
        shares = np.outer(weights, weights).ravel() / weights.sum() ** 2
        missed_m = deviation_m * np.array([(x, y) for x in points for y in points])
        around = (offsets_m[np.newaxis] + missed_m[:, np.newaxis]).reshape(-1, 2)
        entries = table(*self._polar(around, heading_deg)).reshape(len(shares), -1)
        expected: Floats = shares @ entries
        return expected

    def _polar(self, offsets_m: Floats, heading_deg: float) -> tuple[Floats, Floats]:
        """Lags and directions of offsets. Each offset has two components: to the right of a
        heading, and along the heading.
        """
        right, along = offsets_m.T / self.altitude_m
        return np.hypot(right, along), np.degrees(np.arctan2(right, along)) + heading_deg
