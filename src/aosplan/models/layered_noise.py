"""Expected values of the covariance of two samples over the noise of their positions.

The covariance f(x, y) of two samples that are (x, y) apart is a product over slices. Its mean over
Gaussian noise has no closed form. However, f is even along both axes, zero beyond the largest reach
Δ_j of the slices, and smooth between two reaches. The axes are therefore divided into a few panels,
and the values F of f at the nodes of the panels are computed once for all plans. Within each panel,
f is interpolated by Lagrange polynomials ℓ_a. With the position noise η, the expected value is then
bilinear in F:

    E[f(|x + η|, |y + η'|)] = w(x)ᵀ F w(y),   w_a(x) = E[ℓ_a(|x + η|)].

The weights w are integrals of a polynomial times a Gaussian. They are computed for each axis
separately.

A panel that contains the reach of a slice is split there. Other panels are split in the middle.
This is repeated until the interpolation of f along an axis has an error below `TOLERANCE` times
f(0, 0). The error is tested along the axes, because f is steepest there. The relative error of K is
about as large.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from aosplan.models.position_noise import NEGLIGIBLE

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

TOLERANCE = 1e-4
"""Largest error of the interpolation along an axis, relative to f(0, 0)."""

NODES = 6
"""Number of nodes of a panel."""

MOST_PANELS = 200

QUADRATURE = 40
"""Number of points of the Gauss-Legendre rule for an interval of seventeen standard deviations of a
Gaussian.

For a panel that is at most one and a half standard deviations wide, a quarter of these points is
enough.
"""


class BlurredTable:
    """A function of two distances whose expected value over noise can be computed.

    Parameters
    ----------
    function
        The function f(x, y). It takes two arrays of distances [m] of equal shape, at least 0. It is
        symmetric, and 0 beyond the largest reach.
    reaches_m
        Distances at which the slope of f jumps.
    """

    def __init__(self, function: Callable[[Floats, Floats], Floats], reaches_m: Floats) -> None:
        self._panels = _panels(lambda x: function(x, np.zeros_like(x)), np.unique(reaches_m))
        nodes, _ = _rule(NODES)
        low, high = self._panels[:, :1], self._panels[:, 1:]
        points = (low + (high - low) * nodes).ravel()
        upper = np.triu_indices(len(points))
        values = function(points[upper[0]], points[upper[1]])
        self._table = np.zeros((len(points), len(points)))
        self._table[upper] = values
        self._table.T[upper] = values

    def blurred(self, x_m: Floats, y_m: Floats, deviation_m: float) -> Floats:
        """Expected values of f if the distances between the samples of a pair are uncertain along
        both axes.

        Parameters
        ----------
        x_m, y_m
            Mean distances along both axes, at least 0.
        deviation_m
            Standard deviation of the distance between two samples, σ√2, greater than 0.

        Returns
        -------
        ndarray
            Expected values for all combinations, shape (y, x).
        """
        along_y, along_x = (self._weights(at, deviation_m) for at in (y_m, x_m))
        result: Floats = along_y @ self._table @ along_x.T
        return result

    def blurred_pairs(self, x_m: Floats, y_m: Floats, deviation_m: float) -> Floats:
        """Expected values of f for pairs (x, y) of distances, shape (pairs,)."""
        along_y, along_x = (self._weights(at, deviation_m) for at in (y_m, x_m))
        result: Floats = np.einsum("pn,pn->p", along_y @ self._table, along_x)
        return result

    def _weights(self, at_m: Floats, deviation_m: float) -> Floats:
        """Weights w for the distances, shape (distances, nodes)."""
        low, high = self._panels.T
        weights = np.zeros((len(at_m), len(low), NODES))
        for centre in (at_m[:, np.newaxis], -at_m[:, np.newaxis]):
            start = np.maximum(low, centre - NEGLIGIBLE * deviation_m)
            width = np.minimum(high, centre + NEGLIGIBLE * deviation_m) - start
            narrow = width <= 1.5 * deviation_m
            for met, (points, shares) in (
                ((width > 0.0) & narrow, _rule(QUADRATURE // 4)),
                (~narrow, _rule(QUADRATURE)),
            ):
                distance, panel = np.nonzero(met)
                place = start[met, np.newaxis] + width[met, np.newaxis] * points
                z = (place - centre[distance]) / deviation_m
                density = np.exp(-0.5 * z * z) / (np.sqrt(2.0 * np.pi) * deviation_m)
                within = (place - low[panel, np.newaxis]) / (high - low)[panel, np.newaxis]
                mass = density * shares * width[met, np.newaxis]
                weights[distance, panel] += np.einsum("pq,pqn->pn", mass, _basis(within))
        return weights.reshape(len(at_m), -1)


def _panels(profile: Callable[[Floats], Floats], reaches_m: Floats) -> Floats:
    """Intervals in which the interpolation of a profile has an error below `TOLERANCE`, shape
    (panels, 2).
    """
    allowed = TOLERANCE * float(profile(np.zeros(1))[0])
    nodes, _ = _rule(NODES)
    checks = np.linspace(0.0, 1.0, 4 * NODES + 1)
    between = _basis(checks)
    waiting = [(0.0, float(reaches_m[-1]))]
    done: list[tuple[float, float]] = []
    while waiting:
        low, high = waiting.pop(0)
        interpolated = between @ profile(low + (high - low) * nodes)
        error = np.abs(interpolated - profile(low + (high - low) * checks)).max()
        if error <= allowed or len(waiting) + len(done) >= MOST_PANELS:
            done.append((low, high))
            continue
        inside = reaches_m[(reaches_m > low) & (reaches_m < high)]
        middle = float(inside[len(inside) // 2]) if inside.size else 0.5 * (low + high)
        waiting += [(low, middle), (middle, high)]
    return np.array(sorted(done))


@lru_cache
def _rule(count: int) -> tuple[Floats, Floats]:
    """Points and weights of a Gauss-Legendre rule on [0, 1]."""
    points, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (points + 1.0), 0.5 * weights


def _basis(within: Floats) -> Floats:
    """Values of the Lagrange polynomials of a panel at positions in [0, 1].  The last axis has the
    length `NODES`.
    """
    nodes, _ = _rule(NODES)
    basis = np.ones((*within.shape, NODES))
    for node, other in permutations(range(NODES), 2):
        basis[..., node] *= (within - nodes[other]) / (nodes[node] - nodes[other])
    return basis
