"""Position noise: its effect on the shortfall.

The position of each photo has an independent Gaussian error with the standard deviation σ per axis.
The actual positions are known after the flight. Two samples whose sites are Δ apart are then Δ + η
apart, where η has the standard deviation σ√2 per axis. The expected overlap g of their occluders is
the triangle of Eq. 2, convolved with a Gaussian along each axis. A sample has all occluders in
common with itself. For N samples,

    K = (N + Σ g(Δx) g(Δy)) / N²,   with the sum over all ordered pairs of different samples.

Noise decreases the distance between neighbours as often as it increases it. If d̂ >= 1, neighbours
do not overlap at their sites. A larger distance changes nothing, but a smaller distance causes an
overlap. V̂ therefore decreases. If d̂ is much smaller, V̂ increases, because noise makes the
aperture larger. For a square of n x n sites at d̂ = 1, the decrease of V̂ to first order in s = σ/b
is 4 (n-1)/n³ e₁ e₀ + 4 (n-1)²/n⁴ e₁² where e₁ = s/√π and e₀ = 1 - 2 e₁. For 49 samples and s =
0.43, this is 0.0123, and the exact value is 0.0117.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from aosplan.numerics import SCALARS, elementwise, triangle

if TYPE_CHECKING:
    from collections.abc import Iterable

    from aosplan.grid.patterns import Pattern
    from aosplan.numerics import Floats

NEGLIGIBLE = 8.5
"""Number of standard deviations beyond which the contribution of a Gaussian is smaller than
rounding errors.
"""

HERMITE_TERMS = 20
"""Number of terms of the series for a spread above 1.  The terms decrease faster than 1/(2^m m!
m²).
"""


def blurred_overlap(distance: Floats, spread: Floats) -> Any:
    """Expected overlap E[max(0, 1 - |u + ς Z|)] of occluders at an uncertain distance.

    Z is a standard normal variable. With R(t) = E[max(0, ς Z - t)], the sum over the three corners
    of the triangle is g(u) = max(0, 1 - |u|) + R(|u + 1|) - 2 R(|u|) + R(|u - 1|). For ς > 1, these
    terms nearly cancel. A series of the Gaussian's derivatives is used instead: g(u) = Σ 2
    φ^(2m)(u/ς) / ((2m+2)! ς^(2m+1)).

    Parameters
    ----------
    distance
        u, distance along one axis divided by the occluders' reach Δ = o h/H.
    spread
        ς, standard deviation of u, at least 0.  For a pair of samples it is σ√2/Δ.

    Returns
    -------
    float or ndarray
        Overlap, with an error of a few 1e-16.

    Examples
    --------
    >>> blurred_overlap(0.25, 0.0), round(blurred_overlap(1.0, 0.1), 6)
    (0.75, 0.039894)
    """
    return elementwise(_blurred_overlap, distance, spread)


def _blurred_overlap(xp: Any, distance: Any, spread: Any) -> tuple[Any, Any]:
    u = abs(distance)
    narrow = xp.maximum(xp.minimum(spread, 1.0), 1e-300)
    corners = _excess(xp, u + 1.0, narrow) + _excess(xp, abs(u - 1.0), narrow)
    sharp = triangle(u, xp) + (corners - 2.0 * _excess(xp, u, narrow))
    wide = _wide(xp, u, xp.maximum(spread, 1.0))
    return xp.where(spread > 1.0, wide, xp.maximum(sharp, 0.0)), (spread >= 0.0) & (u < math.inf)


def _excess(xp: Any, t: Any, spread: Any) -> Any:
    """R(t) = E[max(0, ς Z - t)] for t >= 0."""
    z = xp.minimum(t / spread, 40.0)
    if xp is SCALARS:
        tail = math.erfc(z * math.sqrt(0.5))
    else:
        from scipy.special import erfc

        tail = erfc(z * math.sqrt(0.5))
    return spread * (_density(xp, z) - 0.5 * z * tail)


def _density(xp: Any, z: Any) -> Any:
    return xp.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)


def _wide(xp: Any, u: Any, spread: Any) -> Any:
    """The series for ς > 1. The Hermite polynomials of degree n are computed by recursion, divided
    by ς^n.
    """
    z = xp.minimum(u / spread, 40.0)
    even, odd = 1.0 + 0.0 * z, z / spread
    total, factor = even, 1.0
    for m in range(1, HERMITE_TERMS):
        even = (z * odd - (2 * m - 1) * even / spread) / spread
        odd = (z * even - 2 * m * odd / spread) / spread
        factor /= (2 * m + 1) * (2 * m + 2)
        total = total + factor * even
    return xp.maximum(total, 0.0) * _density(xp, z) / spread


def blurred_shortfall(pattern: Pattern, dhat: float, spread: float) -> float:
    """Expected shortfall 1 - V̂ of a pattern that is flown with position noise.

    The pairs are summed as in `aosplan.models.positions.pattern_shortfall`, but with the convolved
    triangle.

    Parameters
    ----------
    pattern
        The sites.
    dhat
        d̂ between neighbouring columns.
    spread
        ς = σ√2/Δ, above 0.
    """
    along_x = overlaps(pattern.columns, dhat, spread)
    along_y = overlaps(pattern.rows, dhat * pattern.row_pitch, spread)
    samples = pattern.samples
    # If most sites of a rectangle are removed, the subtraction would lose digits.
    if len(pattern.removed) > samples:
        pairs = _pair_sum(tuple(sorted(pattern.sites())), along_y, along_x)
    else:
        pairs = _line_sum(pattern.columns, along_x) * _line_sum(pattern.rows, along_y)
        if pattern.removed:
            lost = math.fsum(
                _from_one(row, pattern.rows, along_y) * _from_one(column, pattern.columns, along_x)
                for row, column in pattern.removed
            )
            pairs += _pair_sum(pattern.removed, along_y, along_x) - 2.0 * lost
    with_itself = 1.0 - along_x[0] * along_y[0]
    return (pairs + samples * with_itself) / samples**2


def scattered_shortfall(
    offsets: Iterable[tuple[float, float]], dhat: float, spread: float
) -> float:
    """Expected shortfall of sites that are not on a lattice, such as a spiral.  The computing time
    increases as N².

    Parameters
    ----------
    offsets
        Sites (x, y), in baselines.
    dhat, spread
        As in `blurred_shortfall`.
    """
    import numpy as np

    points = dhat * np.array(list(offsets))
    pairs = 0.0
    for index in range(1, len(points)):
        apart = blurred_overlap(np.abs(points[:index] - points[index]), spread)
        pairs += float(apart.prod(axis=1).sum())
    return (len(points) + 2.0 * pairs) / len(points) ** 2


def overlaps(count: int, dhat: float, spread: float) -> list[float]:
    """Overlaps of two sites on a line that are 0, 1, 2, … steps apart, up to the last overlap that
    is not negligible.

    Parameters
    ----------
    count
        Number of sites on the line.
    dhat
        d̂ between neighbours.
    spread
        ς of `blurred_overlap`; 0 without noise.
    """
    farthest = 1.0 + NEGLIGIBLE * spread
    reach = count - 1 if (count - 1) * dhat < farthest else int(farthest / dhat)
    return [blurred_overlap(step * dhat, spread) for step in range(reach + 1)]


def _line_sum(count: int, overlaps: list[float]) -> float:
    """Sum of the overlaps of all ordered pairs of a line, including each site with itself."""
    apart = ((count - step) * overlaps[step] for step in range(1, len(overlaps)))
    return count * overlaps[0] + 2.0 * math.fsum(apart)


def _from_one(index: int, count: int, overlaps: list[float]) -> float:
    """Sum of the overlaps of one site of a line with all sites, including itself."""
    before, after = overlaps[1 : index + 1], overlaps[1 : count - index]
    return overlaps[0] + math.fsum(before) + math.fsum(after)


def _pair_sum(
    sites: tuple[tuple[int, int], ...], along_y: list[float], along_x: list[float]
) -> float:
    """Sum of the overlaps of all ordered pairs of a sorted set of sites, including each site with
    itself.
    """
    half = 0.0
    for index, (row, column) in enumerate(sites):
        for other_row, other_column in sites[index + 1 :]:
            # The sites are sorted by row. If this site is too far away to overlap, all following
            # sites are too.
            if other_row - row >= len(along_y):
                break
            across = abs(other_column - column)
            if across < len(along_x):
                half += along_y[other_row - row] * along_x[across]
    return len(sites) * along_y[0] * along_x[0] + 2.0 * half
