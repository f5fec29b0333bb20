"""Shortfall of any set of sample positions in the uniform model.

Two samples that are (Δx, Δy) apart share occluders. The share of an occluder that both views have
in common is τ = max(0, 1 - |Δx|/Δ) max(0, 1 - |Δy|/Δ), a product of two triangles. Δ = o h/H is the
offset at which an occluder moves by its own size. The shortfall of N samples is the mean of τ over
all N² ordered pairs, K = ΣΣ τ / N² (Kurmi et al. 2019, appendix, for any positions instead of a
grid). Only pairs of samples that are closer than Δ along both axes are computed, because τ is 0 for
all other pairs.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from aosplan.grid.pair_offsets import offset_counts
from aosplan.grid.patterns import Pattern
from aosplan.models.equations import line_shortfall
from aosplan.numerics import SCALARS

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from aosplan.grid.patterns import AnyPattern

PAIRS_AT_ONCE = 2_000_000
"""Largest number of pairs of neighbours that are stored at once (24 bytes each)."""


def pattern_shortfall(pattern: AnyPattern, dhat: float, spread: float = 0.0) -> float:
    """Shortfall 1 - V̂ of a pattern whose neighbouring columns are d̂ apart.

    The sum over the pairs of a rectangle is a product of sums along both axes. For each removed
    site, the pairs with this site are subtracted. Their sum is also a product of two sums. Pairs of
    two removed sites have then been subtracted twice, so they are added once. For a spiral, the sum
    is over all pairs.

    Parameters
    ----------
    pattern
        The sites.
    dhat
        d̂ between neighbouring columns, or between neighbouring sites of a spiral.  Between rows of
        a lattice, d̂ is `pattern.row_pitch` times as large.
    spread
        ς of `aosplan.models.position_noise.blurred_overlap`, if positions are uncertain.
    """
    if spread > 0.0:
        from aosplan.models.position_noise import blurred_shortfall, scattered_shortfall

        if not isinstance(pattern, Pattern):
            return scattered_shortfall(pattern.offsets(), dhat, spread)
        return blurred_shortfall(pattern, dhat, spread)
    samples = pattern.samples
    if not isinstance(pattern, Pattern):
        # A tolerance is needed, because d̂ may be rounded.
        if dhat * pattern.nearest > 1.0 - 1e-15:
            return 1.0 / samples
        upward = sorted((y, x) for x, y in pattern.offsets())
        return _pair_sum(tuple(upward), dhat, dhat) / samples**2
    dhat_y = dhat * pattern.row_pitch
    if (dhat >= 1.0 or pattern.columns == 1) and (dhat_y >= 1.0 or pattern.rows == 1):
        return 1.0 / samples
    whole = line_shortfall(pattern.columns, dhat) * line_shortfall(pattern.rows, dhat_y)
    if not pattern.removed:
        return float(whole)
    # If most sites of a rectangle are removed, the subtraction would lose digits.
    if len(pattern.removed) > samples:
        return _pair_sum(tuple(sorted(pattern.sites())), dhat_y, dhat) / samples**2
    total = whole * (pattern.rows * pattern.columns) ** 2
    lost = math.fsum(
        line_overlaps(row, pattern.rows, dhat_y) * line_overlaps(column, pattern.columns, dhat)
        for row, column in pattern.removed
    )
    counted_twice = _pair_sum(pattern.removed, dhat_y, dhat)
    return float(total - 2.0 * lost + counted_twice) / samples**2


def line_overlaps(index: Any, count: int, dhat: Any, xp: Any = SCALARS) -> Any:
    """Sum of max(0, 1 - |i - index| d̂) over the sites i = 0 … count - 1 of a line."""
    return 1.0 + _one_side(index, dhat, xp) + _one_side(count - 1 - index, dhat, xp)


def _one_side(neighbours: Any, dhat: Any, xp: Any) -> Any:
    within = xp.floor(1.0 / xp.maximum(dhat, 1e-300))
    reach = xp.where(neighbours * dhat <= 1.0, neighbours, within)
    return reach * (1.0 - 0.5 * dhat * (reach + 1.0))


def _pair_sum(sites: tuple[tuple[float, float], ...], dhat_y: float, dhat_x: float) -> float:
    """ΣΣ τ over all ordered pairs of a sorted set of sites."""
    if len(sites) > 2000:
        import numpy as np

        spaced = np.asarray(sites, dtype=float) * (dhat_y, dhat_x)
        return positions_shortfall(spaced, 1.0) * len(sites) ** 2
    return len(sites) + 2.0 * math.fsum(_shares(sites, dhat_y, dhat_x))


def _shares(
    sites: tuple[tuple[float, float], ...], dhat_y: float, dhat_x: float
) -> Iterator[float]:
    """The values of τ that are not 0, for all pairs of a sorted set of sites.  Each pair is
    included once.
    """
    for index, (row, column) in enumerate(sites):
        for other_row, other_column in sites[index + 1 :]:
            y = 1.0 - (other_row - row) * dhat_y
            # The sites are sorted by row. If this site is too far away to overlap, all following
            # sites are too.
            if y <= 0.0:
                break
            x = 1.0 - abs(other_column - column) * dhat_x
            if x > 0.0:
                yield x * y


def positions_shortfall(positions: ArrayLike, spacing: float) -> float:
    """Shortfall 1 - V̂ of samples at any positions, such as a curved flight or recorded positions.

    Parameters
    ----------
    positions
        Shape (N, 2): coordinates [m] along the two axes of the occluders.
    spacing
        Δ = o h/H, offset [m] at which an occluder moves by its own size, greater than 0.

    Returns
    -------
    float
        K, between 1/N and 1; ``nan`` without positions, or if the spacing is not positive or a
        position is not finite.

    Notes
    -----
    A k-d tree finds the pairs within reach, in blocks of limited memory.  10⁵ positions with 500
    neighbours each take seconds.

    Examples
    --------
    >>> positions_shortfall([[0.0, 0.0], [3.0, 0.0]], 2.0)
    0.5
    """
    import numpy as np

    points = np.asarray(positions, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"positions have shape {points.shape}, not (N, 2)")
    count = len(points)
    if count == 0 or not spacing > 0.0 or not np.isfinite(points).all():
        return math.nan
    if math.isinf(spacing):
        return 1.0
    from scipy.spatial import cKDTree

    # Coordinates are relative to the mean of the positions, because large coordinates would lose
    # digits.
    with np.errstate(over="ignore"):
        points = (points - points.mean(axis=0)) / spacing
    points = np.clip(points, -1e300, 1e300)
    tree = cKDTree(points)
    neighbours = tree.query_ball_point(points, 1.0, p=np.inf, return_length=True)
    # The positions are sorted in the order of the tree, in which neighbours in space are close to
    # each other. The positions of a block are therefore close together.
    order = np.asarray(tree.indices)
    pending = np.cumsum(neighbours[order])
    total = 0.0
    start = 0
    while start < count:
        done = pending[start - 1] if start else 0
        stop = max(int(np.searchsorted(pending, done + PAIRS_AT_ONCE, "right")), start + 1)
        block = points[order[start:stop]]
        total += _block_sum(block, tree, points)
        start = stop
    return total / count**2


def _block_sum(block: NDArray[np.float64], tree: Any, points: NDArray[np.float64]) -> float:
    """Sum of τ between the positions of a block and all positions, for a spacing of 1."""
    import numpy as np
    from scipy.spatial import cKDTree

    pairs = cKDTree(block).sparse_distance_matrix(tree, 1.0, p=np.inf, output_type="ndarray")
    apart = np.abs(block[pairs["i"]] - points[pairs["j"]])
    return float(np.prod(1.0 - apart, axis=1).sum())


def lattice_shortfall(mask: ArrayLike, dhat_x: float, dhat_y: float | None = None) -> float:
    """Shortfall 1 - V̂ of the sites of a lattice that a mask selects.

    Parameters
    ----------
    mask
        Shape (rows, columns); true for each lattice point that is a sample.
    dhat_x, dhat_y
        d̂ between neighbouring columns and between neighbouring rows, greater than 0.  By default,
        `dhat_y` equals `dhat_x`.

    Returns
    -------
    float
        K; ``nan`` for an empty mask, or if d̂ is not positive.
    """
    import numpy as np

    dhat_y = dhat_x if dhat_y is None else dhat_y
    chosen = np.asarray(mask, dtype=bool)
    if chosen.ndim != 2:
        raise ValueError(f"mask has shape {chosen.shape}, not (rows, columns)")
    count = int(np.count_nonzero(chosen))
    if count == 0 or not (dhat_x > 0.0 and dhat_y > 0.0):
        return math.nan
    # For d̂ > 1 the overlap is 0, as for d̂ = 1.
    dhat_x, dhat_y = min(dhat_x, 1.0), min(dhat_y, 1.0)
    reach_y = _reach(chosen.shape[0], dhat_y)
    reach_x = _reach(chosen.shape[1], dhat_x)
    pairs = offset_counts(chosen, reach_y, reach_x)
    weights_y = 1.0 - dhat_y * np.abs(np.arange(-reach_y, reach_y + 1))
    weights_x = 1.0 - dhat_x * np.abs(np.arange(-reach_x, reach_x + 1))
    return float(np.maximum(weights_y, 0.0) @ pairs @ np.maximum(weights_x, 0.0)) / count**2


def _reach(count: int, dhat: float) -> int:
    return count - 1 if (count - 1) * dhat < 1.0 else max(math.ceil(1.0 / dhat) - 1, 0)
