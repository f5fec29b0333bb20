"""The distribution of the seen share of a target, over all places and directions of the target.

The seen share s is the share of the target that a photo sees, averaged over the photos.  The mean
of s is the transparency T.  The variance of s is the mean of Q - T² over the pairs of photos and
the pairs of points of the target (`aosplan.models.window_pairs`).  The distribution is close to a
beta distribution with an atom at zero.  The atom represents the places at which no photo sees any
part of the target.

- *One slice*: the atom is E[p^K], where K is the number of different occluder cells that the rays
  of the target meet.  The expectation E is over phases of the cells and directions of the target.
- *Several slices*: the atom is the value of the beta distribution function at 1/(N n). Here N is
  the number of photos, and n is the area of the target divided by the area of a square cell with
  the side `CELL_M`.

The atom does not change the mean and the variance of the whole distribution.  P(s >= x) mostly
agrees with simulated slices to within 0.02 (`benchmarks/detection.py`).

The measured model does not use the beta distribution.  It counts the shares (`SeenShare.counted`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.models.target_window import points_of, rotation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.models.target_window import Target
    from aosplan.scenes.scene import Layer

    Floats = NDArray[np.float64]

SHARES = (0.01, 0.1, 0.25, 0.5)
"""Shares s. For each s, the reported value is the probability that at least s is seen."""

UNSEEN = 0.01
"""Seen share below which almost nothing of a target is seen."""

CELL_M = 0.1
"""Side of a cell of the target, for the atom of several slices."""

PHASES = 64
"""Number of phases and directions over which the atom of one slice is averaged."""

NODES = 320
"""Number of nodes that represent the distribution in sums."""


class SeenShare(NamedTuple):
    """Distribution of the seen share s of a target.

    Attributes
    ----------
    mean, variance
        Mean and variance of s.
    nodes, weights
        Shares and their probabilities.  Expected values are sums over these nodes.
    atom
        Probability that nothing is seen, which is the weight of the first node.
    alpha, beta
        Parameters of the beta distribution of the other places; ``nan`` for a counted distribution.
    """

    mean: float
    variance: float
    nodes: Floats
    weights: Floats
    atom: float
    alpha: float
    beta: float

    @classmethod
    def of_moments(
        cls, mean: float, variance: float, atom: float | None, looks: float
    ) -> SeenShare:
        """The distribution with a given mean, variance and atom.

        Parameters
        ----------
        mean, variance
            Mean and variance of s; 0 < mean < 1.
        atom
            P(s = 0), or None for the value of the beta distribution function at 1/`looks`.
        looks
            Number of photos times number of cells of the target.
        """
        from scipy.special import betainc

        # The upper limit is the variance of a share that is always either 0 or 1. The lower limit
        # is smaller than rounding errors.
        variance = min(max(variance, 1e-12), (1.0 - 1e-9) * mean * (1.0 - mean))
        alpha, beta = _shape(mean, variance)
        if atom is None:
            atom = float(betainc(alpha, beta, min(1.0 / looks, 1.0)))
        # The atom and the rest of the distribution together have the given mean and variance. The
        # atom is limited, so that the rest has a positive variance.
        square = variance + mean * mean
        atom = min(max(atom, 0.0), max(1.0 - mean * mean / square * (1.0 + 1e-6), 0.0))
        rest_mean = mean / (1.0 - atom)
        alpha, beta = _shape(rest_mean, max(square / (1.0 - atom) - rest_mean**2, 1e-12))
        # The nodes are densest at both ends, because the density may be infinite there.
        edges = np.sin(0.5 * math.pi * np.linspace(0.0, 1.0, NODES)) ** 2
        below = betainc(alpha, beta, edges)
        moment = rest_mean * betainc(alpha + 1.0, beta, edges)
        share = np.diff(below)
        middle = 0.5 * (edges[1:] + edges[:-1])
        nodes = np.where(share > 1e-14, np.diff(moment) / np.maximum(share, 1e-14), middle)
        return cls(
            mean,
            variance,
            np.concatenate([[0.0], np.clip(nodes, 0.0, 1.0)]),
            np.concatenate([[atom], (1.0 - atom) * share]),
            atom,
            alpha,
            beta,
        )

    @classmethod
    def counted(cls, shares: Floats) -> SeenShare:
        """The distribution of counted shares, which are all equally likely.  The array may have any
        shape.
        """
        found = np.sort(shares.ravel())
        edges = np.linspace(0, len(found), NODES + 1).round().astype(np.intp)
        # The sorted shares are divided into parts of equal weight. Each node is the mean of its
        # part.
        sums = np.concatenate([[0.0], np.cumsum(found)])
        count = np.diff(edges)
        used = count > 0
        nodes = (np.diff(sums[edges]))[used] / count[used]
        return cls(
            float(found.mean()),
            float(found.var()),
            nodes,
            count[used] / len(found),
            float((found <= 0.0).mean()),
            math.nan,
            math.nan,
        )

    def at_least(self, share: float) -> float:
        """P(s >= share) for a share above 0."""
        if math.isnan(self.alpha):
            return float(self.weights[self.nodes >= share].sum())
        from scipy.special import betaincc

        return (1.0 - self.atom) * float(betaincc(self.alpha, self.beta, share))

    def quantile(self, probability: float) -> float:
        """The share that is exceeded with probability 1 - `probability`."""
        if math.isnan(self.alpha):
            index = int(np.searchsorted(np.cumsum(self.weights), probability))
            return float(self.nodes[min(index, len(self.nodes) - 1)])
        from scipy.special import betaincinv

        if probability <= self.atom:
            return 0.0
        return float(
            betaincinv(self.alpha, self.beta, (probability - self.atom) / (1.0 - self.atom))
        )

    def document(self) -> dict[str, Any]:
        """The object ``detection.seen_share`` of a plan's JSON document."""
        return {
            "mean": self.mean,
            "p05": self.quantile(0.05),
            "median": self.quantile(0.5),
            "p95": self.quantile(0.95),
            "at_least": {f"{share:g}": self.at_least(share) for share in SHARES},
        }


def _shape(mean: float, variance: float) -> tuple[float, float]:
    """α and β of the beta distribution with a given mean and variance."""
    size = max(mean * (1.0 - mean) / variance - 1.0, 1e-9)
    return max(mean * size, 1e-9), max((1.0 - mean) * size, 1e-9)


def atom_of_slice(
    layer: Layer, altitude_m: float, sites_m: Floats, target: Target, *, rigid: bool
) -> float:
    """E[p^K], the probability that one slice hides a target in every photo.

    Parameters
    ----------
    layer
        The slice.
    altitude_m
        Altitude of the cameras.
    sites_m
        Camera positions, shape (N, 2).
    target
        Size of the target, which has a random place and direction.
    rigid
        As in `aosplan.models.window_pairs.WindowPairs`.
    """
    ratio = layer.height_m / altitude_m
    size = layer.occluder_size_m
    points = points_of(target, min(0.2 * size, 0.25 * target.width_m)) * (1.0 - ratio * rigid)
    # Equal offsets give the same view of the cells, so each offset is used once.
    offsets = np.unique(np.round(sites_m * ratio, 6), axis=0)
    rng = np.random.default_rng(1)
    found = 0.0
    for angle in ((np.arange(PHASES) + 0.5) * (math.pi / PHASES)).tolist():
        turned = points @ rotation(angle) + rng.random(2) * size
        cells = np.floor((turned[None] + offsets[:, None]) / size).astype(np.int64).reshape(-1, 2)
        keys = np.unique((cells[:, 0] << 32) + cells[:, 1])
        found += layer.density ** len(keys)
    return found / PHASES


def atom(
    layers: Sequence[Layer],
    altitude_m: float,
    sites_m: Floats,
    target: Target,
    *,
    rigid: bool = True,
) -> float | None:
    """The atom for one slice. For several slices the result is None, because the atom is then
    computed from the beta distribution.
    """
    if len(layers) > 1:
        return None
    return atom_of_slice(layers[0], altitude_m, sites_m, target, rigid=rigid)
