"""Blurred covariances: what two samples share, expected over the noise of their positions.

The layered model's covariance f(x, y) of two samples x, y apart is a product over slices, which no
formula blurs.  But it is even along both axes, vanishes beyond the reach of every slice, and is
smooth between the reaches Δ_j of single ones.  So it is kept as its values at the nodes of a few
panels, once for all plans, and interpolated by a polynomial ℓ on each; what noise makes of it then
is bilinear in that table F,

    E[f(|x + η|, |y + η'|)] = w(x)ᵀ F w(y),   w_a(x) = E[ℓ_a(|x + η|)],

and the weights w are integrals of polynomials against a Gaussian, one axis at a time.

Panels are halved at the reach of a slice, or in the middle where none lies within, until f along an
axis, where it is steepest, is interpolated to `TOLERANCE` of f(0, 0).  Blurred, and summed up to
K, that leaves about as much of K.
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
"""Error of the interpolation where it is worst, at the reach of some slice, relative to f(0, 0)."""

NODES = 6
"""Nodes of a panel."""

MOST_PANELS = 200

QUADRATURE = 40
"""Points of the Gauss-Legendre rule across the seventeen standard deviations of a Gaussian; a
quarter of them does for a panel of one and a half."""


class BlurredTable:
    """A function of two distances, ready to be blurred.

    Parameters
    ----------
    function
        f(x, y) of distances of equal shape, at least 0 [m]; symmetric, and 0 beyond the reaches.
    reaches_m
        Distances at which its slope jumps; the largest is where it ends.
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
        """Expected values where both distances of a pair have this standard deviation.

        Parameters
        ----------
        x_m, y_m
            Distances along either axis, at least 0.
        deviation_m
            Of the distance between two samples, above 0: σ√2.

        Returns
        -------
        ndarray
            Shape (y, x).
        """
        along_y, along_x = (self._weights(at, deviation_m) for at in (y_m, x_m))
        result: Floats = along_y @ self._table @ along_x.T
        return result

    def blurred_pairs(self, x_m: Floats, y_m: Floats, deviation_m: float) -> Floats:
        """The same for pairs of distances, shape (pairs,)."""
        along_y, along_x = (self._weights(at, deviation_m) for at in (y_m, x_m))
        result: Floats = np.einsum("pn,pn->p", along_y @ self._table, along_x)
        return result

    def _weights(self, at_m: Floats, deviation_m: float) -> Floats:
        """w of distances, shape (distances, nodes)."""
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
    """Ends of panels on which a profile is interpolated well, shape (panels, 2)."""
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
    """Lagrange polynomials of a panel's nodes at places in [0, 1], one more axis of `NODES`."""
    nodes, _ = _rule(NODES)
    basis = np.ones((*within.shape, NODES))
    for node, other in permutations(range(NODES), 2):
        basis[..., node] *= (within - nodes[other]) / (nodes[node] - nodes[other])
    return basis
