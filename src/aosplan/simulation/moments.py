"""Visibility and its standard errors, computed from counts of hidden targets.

For each target, a simulation counts the number c of blocked views among its N views.  X = c/N is
the integral image of a black target below white occluders.  There are R samples of the forest:
independent volumes, patterns, or blocks of one plot.  Each has the mean x_r of X and the mean m_r
of X².  Then

    p = mean x,   V = 1 - mean m,   V̂ = 1 - K,   K = (m - p²)/(p - p²).

Standard errors are computed from the variation between samples. The targets of one volume are not
independent, because they are below the same trees. For K, the derivatives with respect to p and m
are used. p² is estimated from pairs of different samples, p² = (R p̄² - mean x²)/(R - 1). The
square of the mean p̄ is not used, because it is too large by the variance of p̄, and V̂ would then
be too large.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence


class Counts(NamedTuple):
    """Exact sums Σ c and Σ c² over the targets of one sample.  For a target, c of the `views` views
    are blocked.
    """

    views: int
    targets: int
    hidden: int
    squares: int

    @property
    def density(self) -> float:
        """Mean of X."""
        return self.hidden / (self.views * self.targets)

    @property
    def mean_square(self) -> float:
        """Mean of X², which is 1 - V."""
        return self.squares / (self.views**2 * self.targets)

    def __add__(self, other: object) -> Counts:
        """Sums over the targets of both samples."""
        assert isinstance(other, Counts)
        assert other.views == self.views
        return Counts(
            self.views,
            self.targets + other.targets,
            self.hidden + other.hidden,
            self.squares + other.squares,
        )


class Estimate(NamedTuple):
    """Density p, visibility V and normalised visibility V̂, each with its standard error.

    V̂ is nan if nothing or everything is hidden.  A standard error is infinite if there are too few
    samples.
    """

    density: float
    expected: float
    normalized: float
    density_standard_error: float
    expected_standard_error: float
    normalized_standard_error: float


def estimate(samples: Sequence[Counts], *, one_plot: bool = False) -> Estimate:
    """Visibility from the counts of several samples of a forest.

    Parameters
    ----------
    samples
        The samples, at least one.  They are independent.
    one_plot
        Whether the samples are the blocks of one plot.  In this case the estimate is exactly the
        result for all targets, and p² is the square of the mean of all targets.  The standard error
        is only approximate: blocks of one plot are not completely independent, and below one
        aperture their distributions differ.
    """
    weights = np.array([sample.targets for sample in samples], dtype=np.float64)
    weights /= weights.mean()
    x = np.array([sample.density for sample in samples])
    m = np.array([sample.mean_square for sample in samples])
    count = len(samples)
    p, square = float((weights * x).mean()), float((weights * m).mean())
    p_squared = p * p
    if not one_plot and count > 1:
        p_squared = (count * p * p - float((weights * x * x).mean())) / (count - 1)
    spread = p - p_squared
    x_error, m_error = (_standard_error(weights * (v - mean)) for v, mean in ((x, p), (m, square)))
    if not spread > 0.0:
        return Estimate(p, 1.0 - square, math.nan, x_error, m_error, math.nan)
    shortfall = (square - p_squared) / spread
    slope = -(2.0 * p + shortfall * (1.0 - 2.0 * p)) / spread
    changes = weights * ((m - square) / spread + slope * (x - p))
    return Estimate(p, 1.0 - square, 1.0 - shortfall, x_error, m_error, _standard_error(changes))


def _standard_error(changes: np.ndarray) -> float:
    """Standard error of a mean, computed from the contribution of each sample."""
    count = len(changes)
    if count < 2:
        return math.inf
    return math.sqrt(float((changes * changes).sum()) / (count - 1) / count)
