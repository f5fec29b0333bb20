"""Covariance of pairs of slanted rays through slices, interpolated over the length of the rays.

The covariance of two rays increases nearly exponentially with the relative length e of the shorter
ray.  The logarithm of the covariance is therefore interpolated over e by a Chebyshev polynomial.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.models.layered_pairs import LARGEST_LOG, RayPairs, Slices
from aosplan.models.oblique_rays import bundle, predict_scattered

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from aosplan.grid.patterns import Pattern
    from aosplan.models.model import Prediction

    Floats = NDArray[np.float64]

LENGTHS = 5
"""Number of ray lengths between which the covariance is interpolated."""

LARGEST_SLANT = 30.0
"""Slanted rays are neglected if the logarithm of a ratio is larger than this. The ratio is the
transparency of a nadir ray divided by that of the slanted ray.
"""


class SlantedRays:
    """Predictions with slanted rays (`aosplan.models.oblique_rays`).

    Parameters
    ----------
    slices
        The slices.
    altitude_m
        Altitude above the focal plane.
    kind
        ``oblique`` or ``cubes``.
    deviation_m
        Standard deviation of the distance between two samples along an axis.
    """

    def __init__(self, slices: Slices, altitude_m: float, kind: str, deviation_m: float) -> None:
        self._slices, self._deviation_m = slices, deviation_m
        self._rays = altitude_m, kind, slices.log_transparency
        self._pairs: dict[float, RayPairs] = {}

    def predict(
        self, pattern: Pattern, baseline_m: float, offsets_x_m: Floats, offsets_y_m: Floats
    ) -> Prediction:
        """Prediction for a lattice. `offsets_x_m` and `offsets_y_m` are the offsets along each axis
        at which the covariance is not 0.
        """
        rays = bundle(pattern, baseline_m, *self._rays)
        shared = self._along(
            rays.longest, lambda pairs: pairs.at_crossings(offsets_x_m, offsets_y_m)
        )
        reach = len(offsets_y_m) - 1, len(offsets_x_m) - 1
        return rays.predict(reach, lambda dy, dx, lengths: shared(np.s_[:, dy, dx], lengths))

    def predict_at(self, points_m: Floats) -> Prediction:
        """Prediction for samples at any positions from the centre, shape (N, 2)."""

        def shared(x: Floats, y: Floats, shorter: Floats) -> Floats:
            longest = float(shorter.max(initial=1.0))
            return self._along(longest, lambda pairs: pairs.at(x, y))(np.s_[:], shorter)

        return predict_scattered(points_m, *self._rays, shared)

    def _along(
        self, longest: float, evaluated: Callable[[RayPairs], Floats]
    ) -> Callable[[Any, Floats], Floats]:
        """P(both clear)/(T_i T_k) - 1, as a function of the indices of pairs and of the lengths of
        their rays. P(both clear) is the probability that nothing blocks either of the two rays.

        Parameters
        ----------
        longest
            Length of the longest ray.
        evaluated
            Function that returns the values of all pairs for one length, as an array. The first
            argument of the returned function is an index into such an array.
        """
        # The width of the interval is a power of two times 0.1. The same tables of noise can then
        # be used for many apertures. Rays that are much longer than the shortest ray are neglected,
        # because they transmit very little.
        longest = min(longest, 1.0 - LARGEST_SLANT / min(self._slices.log_transparency, -1e-9))
        half = 0.05 * 2.0 ** max(math.ceil(math.log2((longest - 1.0) / 0.1 + 1e-300)), 0)
        places = np.cos(np.pi * (np.arange(LENGTHS) + 0.5) / LENGTHS)
        lengths = (1.0 + half * (1.0 + places)).tolist()
        logs = np.array([np.log1p(evaluated(self._pairs_of(length))) for length in lengths])
        # The nodes x_k are the zeros of the Chebyshev polynomial T_n. The coefficients of the
        # interpolating polynomial are c_j = (2/n) Σ_k f(x_k) T_j(x_k), and half of this for j = 0.
        sums = np.polynomial.chebyshev.chebvander(places, LENGTHS - 1).T * (2.0 / LENGTHS)
        sums[0] *= 0.5
        series = np.tensordot(sums, logs, axes=1)

        def shared(which: Any, at: Floats) -> Floats:
            place: Floats = np.minimum((at - 1.0) / half - 1.0, 1.0)
            log = np.polynomial.chebyshev.chebval(place, series[which], tensor=False)
            return np.asarray(np.expm1(np.minimum(log, LARGEST_LOG)))

        return shared

    def _pairs_of(self, length: float) -> RayPairs:
        """Pairs of rays of a given length, with their table of noise."""
        if length not in self._pairs:
            # The stored tables are for the lengths of another aperture.
            if len(self._pairs) >= LENGTHS:
                self._pairs.clear()

            def sharp(x: Floats, y: Floats) -> Floats:
                return self._slices.slanted_covariance(length, x, y)

            self._pairs[length] = RayPairs(sharp, self._slices.reach_m, self._deviation_m)
        return self._pairs[length]
