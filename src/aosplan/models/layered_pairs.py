"""Covariance of two rays through independent slices.

`Slices` computes the covariance for exact positions.  `RayPairs` computes its expected value for
uncertain positions.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from aosplan.models.layered_noise import BlurredTable

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from aosplan.scenes.scene import Layer

    Floats = NDArray[np.float64]

TERMS_AT_ONCE = 65_536
"""Largest product of offsets and slices that are evaluated at once.  It takes half a megabyte,
which fits the L2 cache.
"""

PAIRS_AT_ONCE = 2000
"""Number of pairs of scattered samples for which expected values are computed at once."""

SPARSE = 1e-17
"""Density below which the covariance equals the mean of the overlaps within floating-point
precision.
"""

LARGEST_LOG = 700.0
"""Exponents are limited to this value, so that the exponential does not overflow. Results with
larger exponents do not matter, because they are multiplied by 0.
"""


class Slices:
    """The slices that contain occluders, seen from one altitude.

    Parameters
    ----------
    layers
        Slices with heights above the focal plane.
    altitude_m
        Altitude above the focal plane.  It has to be above every slice.
    focal_length_px
        If given, occluders are treated as at least one pixel large.

    Attributes
    ----------
    density
        D_j, share of each slice that is filled with occluders.
    reach_m
        Δ_j = o_j h/H_j, the offset of two samples at which an occluder moves by its own size.
    log_transparency
        Σ log(1 - D_j).
    """

    def __init__(
        self, layers: Sequence[Layer], altitude_m: float, focal_length_px: float | None = None
    ) -> None:
        filled = [layer for layer in layers if layer.density > 0.0]
        self.density = np.array([layer.density for layer in filled])
        height = np.array([layer.height_m for layer in filled])
        size = np.array([layer.occluder_size_m for layer in filled])
        if focal_length_px is not None:
            size = np.maximum(size, (altitude_m - height) / focal_length_px)
        with np.errstate(divide="ignore"):
            self._odds = self.density / (1.0 - self.density)
            self._log_q = np.log1p(-self.density)
            self.log_transparency = float(self._log_q.sum())
            self.reach_m = size * altitude_m / height

    @property
    def hidden(self) -> float:
        """p, share of the target that a nadir ray does not see."""
        return -math.expm1(self.log_transparency)

    @property
    def transparency(self) -> float:
        """Π q_j, share of the target that a nadir ray sees."""
        if -self.log_transparency < len(self.density):
            return math.exp(self.log_transparency)
        # The factors are multiplied, because the exponential of a large sum of logarithms has a
        # larger error. q + lost is exactly 1 - D.
        q = 1.0 - self.density
        lost = (1.0 - q) - self.density
        return float(q.prod()) * math.exp(float((lost / q).sum()))

    def covariance(self, x: Floats, y: Floats) -> Floats:
        """Cov/(p T) of pairs of nadir rays whose samples are (x, y) apart.

        It is (T/p) (exp Σ log(1 + τ_j D_j/q_j) - 1). If nearly all of the target is hidden, the
        logarithms are large, and this formula increases their rounding errors. In this case, the
        covariance is computed as (exp Σ log(1 - D_j (1 - τ_j)) - T)/p. The difference would lose
        digits only if T were large, but here T is small.
        """
        p, t = self.hidden, self.transparency
        if p > 0.9:
            clear = np.exp(self._sums(lambda tau: np.log1p((tau - 1.0) * self.density), x, y))
            return np.asarray(np.maximum(clear - t, 0.0) / p)
        if 0.0 < p < SPARSE:
            # `share` is the contribution of each slice to p, divided by p. It is used because t/p
            # could overflow.
            share = self.density / p
            return self._sums(lambda tau: tau * share, x, y)
        scale = t / p if p > 0.0 else 0.0
        shared = scale * np.expm1(self._sums(lambda tau: np.log1p(tau * self._odds), x, y))
        # Because of rounding, a correlation could exceed 1.
        return np.asarray(np.minimum(shared, 1.0))

    def slanted_covariance(self, length: float, x: Floats, y: Floats) -> Floats:
        """Cov/T_e² = exp Σ log(1 + τ_j (q_j^-e - 1)) - 1 of pairs of slanted rays, both of relative
        length e.
        """
        odds = np.expm1(np.minimum(-length * self._log_q, LARGEST_LOG))
        logs = self._sums(lambda tau: np.log1p(tau * odds), x, y)
        return np.asarray(np.expm1(np.minimum(logs, LARGEST_LOG)))

    def _sums(self, term: Callable[[Floats], Floats], x: Floats, y: Floats) -> Floats:
        """Sums of a function of τ_j over the slices, for pairs that are (x, y) apart."""
        result = np.empty(len(x))
        block = max(1, TERMS_AT_ONCE // max(len(self.density), 1))
        for start in range(0, len(x), block):
            part = slice(start, start + block)
            tau = _overlaps(x[part, None] / self.reach_m)
            tau *= _overlaps(y[part, None] / self.reach_m)
            result[part] = term(tau).sum(axis=1)
        return result


def _overlaps(distance: Floats) -> Floats:
    """The same as `aosplan.numerics.triangle` for an array.  The array is overwritten."""
    np.abs(distance, out=distance)
    np.subtract(1.0, distance, out=distance)
    return np.maximum(distance, 0.0, out=distance)


class RayPairs:
    """Expected covariance of pairs of rays with position noise, as a function of the offset between
    the two samples.

    Parameters
    ----------
    sharp
        Covariance as a function of the distances x and y along both axes [m], of shape (pairs,).
    reach_m
        Distances at which the slope of the covariance jumps.  Beyond the largest distance, the
        covariance is 0.
    deviation_m
        Standard deviation of the distance between two different samples along an axis.
    """

    def __init__(
        self, sharp: Callable[[Floats, Floats], Floats], reach_m: Floats, deviation_m: float
    ) -> None:
        self._sharp, self._reach_m, self._deviation_m = sharp, reach_m, deviation_m

    @cached_property
    def _table(self) -> BlurredTable | None:
        noisy = self._deviation_m > 0.0 and self._reach_m.size
        return BlurredTable(self._sharp, self._reach_m) if noisy else None

    def at(self, x: Floats, y: Floats) -> Floats:
        """Expected covariances of pairs of different samples that are (x, y) apart,
        shape (pairs,).
        """
        if self._table is None:
            return self._sharp(x, y)
        parts = (slice(i, i + PAIRS_AT_ONCE) for i in range(0, len(x), PAIRS_AT_ONCE))
        blurred = [self._table.blurred_pairs(x[i], y[i], self._deviation_m) for i in parts]
        return np.concatenate(blurred) if blurred else np.zeros(0)

    def at_crossings(self, x: Floats, y: Floats) -> Floats:
        """Expected covariances for all combinations of the offsets, shape (y, x). The first value
        is that of a sample with itself.
        """
        if self._table is None:
            along_y, along_x = np.meshgrid(y, x, indexing="ij")
            return self._sharp(along_x.ravel(), along_y.ravel()).reshape(along_y.shape)
        shared = self._table.blurred(x, y, self._deviation_m)
        shared[0, 0] = self._sharp(np.zeros(1), np.zeros(1))[0]
        return shared
