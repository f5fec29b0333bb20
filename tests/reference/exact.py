"""The paper's statistics in exact rational arithmetic, written from the text of the paper only.

This module does not import aosplan, and its results are not rounded.  Arguments are the exact
values of floats, and results are fractions.  The paper's sums are added term by term.  Only
`line_shortfall` uses formulas for sums of powers, so that it can be used for millions of samples.
It is compared with the printed sums in a test.

Source: Kurmi, Schedl and Bimber (2019), Eq. 2 (`double_sum`), the appendix in one dimension
(`appendix_sum`), and the covariances of the appendix for any positions (`pair_sum`).  Volumes of
independent slices are computed by two methods.  `layered_pair_sum` uses covariances.
`enumerated_volume` lists every state of every cell and does not use covariances.
"""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import pairwise, product

ONE = Fraction(1)
ZERO = Fraction(0)


# --- Accuracy ------------------------------------------------------------------------------


def ulps(value: float, exact: Fraction) -> float:
    """Distance of a float from an exact value, in units in the last place of that value.

    For subnormal values, the unit is the smallest float.  The distance is infinite if the float is
    not finite.
    """
    if not math.isfinite(value):
        return math.inf
    return float(abs(Fraction(float(value)) - exact) / Fraction(math.ulp(float(exact))))


# --- Eq. 2 and the appendix ----------------------------------------------------------------


def double_sum(side: int, dhat: float | Fraction) -> Fraction:
    """The bracket of Eq. 2 as the paper prints it, N + 4 ΣΣ …, for N = side²."""
    d = Fraction(dhat)
    # The terms are multiplied by the square of the denominator of d̂, because adding whole numbers
    # is fast.
    step, unit = d.numerator, d.denominator
    total = 0
    for i in range(1, side):
        for j in range(side):
            total += (side - i) * (side - j) * max(0, unit - i * step) * max(0, unit - j * step)
    return side**2 + Fraction(4 * total, unit**2)


def visibility_as_printed(density: float | Fraction, side: int, dhat: float) -> Fraction:
    """V by Eq. 2 as the paper prints it, for side x side samples."""
    p, n = Fraction(density), side**2
    return 1 - p**2 - p * (1 - p) / n**2 * double_sum(side, dhat)


def appendix_sum(samples: int, dhat: float | Fraction) -> Fraction:
    """The bracket of the appendix in one dimension, N + 2 Σ …, divided by N²: K of a line."""
    d = Fraction(dhat)
    step, unit = d.numerator, d.denominator
    total = 0
    for i in range(1, samples + 1):
        if i * step >= unit:
            break  # From here on, Max(0, …) is 0.
        total += (samples - i) * (unit - i * step)
    return (samples + Fraction(2 * total, unit)) / samples**2


def line_shortfall(samples: int, dhat: float | Fraction) -> Fraction:
    """`appendix_sum`, with the formulas for 1 + 2 + … + m and 1 + 4 + … + m²."""
    d = Fraction(dhat)
    m = samples - 1 if d == 0 else min(samples - 1, math.floor(1 / d))
    first, second = Fraction(m * (m + 1), 2), Fraction(m * (m + 1) * (2 * m + 1), 6)
    total = samples * m - (1 + samples * d) * first + d * second
    return (samples + 2 * total) / samples**2


def grid_shortfall(rows: int, columns: int, dhat: float | Fraction) -> Fraction:
    """K of a grid.  The bracket of Eq. 2 divided by N² is the product of one factor for each
    axis.
    """
    return line_shortfall(rows, dhat) * line_shortfall(columns, dhat)


def visibility(density: float | Fraction, shortfall: Fraction) -> Fraction:
    """V = 1 - p² - p (1-p) K."""
    p = Fraction(density)
    return 1 - p**2 - p * (1 - p) * shortfall


# --- Any positions -------------------------------------------------------------------------


def triangle(offset: Fraction, reach: Fraction) -> Fraction:
    """Max(0, 1 - |offset|/reach): the overlap of two samples along one axis."""
    return max(ZERO, 1 - abs(offset) / reach)


def pair_sum(
    positions: Iterable[Sequence[float]],
    reach_x: float | Fraction,
    reach_y: float | Fraction | None = None,
) -> Fraction:
    """K of samples at any positions (x, y), by adding up every ordered pair."""
    points = [(Fraction(x), Fraction(y)) for x, y in positions]
    across = Fraction(reach_x)
    along = across if reach_y is None else Fraction(reach_y)
    total = sum(
        (
            triangle(x - other_x, across) * triangle(y - other_y, along)
            for x, y in points
            for other_x, other_y in points
        ),
        ZERO,
    )
    return total / len(points) ** 2


def lattice_pair_sum(
    sites: Iterable[tuple[int, int]], dhat_x: float, dhat_y: float | None = None
) -> Fraction:
    """`pair_sum` of lattice sites (row, column), with pairs counted by offset."""
    chosen = list(sites)
    step_x = Fraction(dhat_x)
    step_y = step_x if dhat_y is None else Fraction(dhat_y)
    pairs = Counter((abs(r - s), abs(c - d)) for r, c in chosen for s, d in chosen)
    total = sum(
        count * max(ZERO, 1 - down * step_y) * max(ZERO, 1 - right * step_x)
        for (down, right), count in pairs.items()
    )
    return Fraction(total) / len(chosen) ** 2


# --- Independent slices --------------------------------------------------------------------


def layered_pair_sum(
    layers: Iterable[Sequence[float]],
    altitude: float,
    positions: Iterable[Sequence[float]],
) -> tuple[Fraction, Fraction]:
    """p and K of samples over slices (bottom, top, density, occluder size).

    K is the sum of Cov = Π (q² + D q τ) - Π q² over all ordered pairs, divided by N² p (1 - p).
    """
    slices = [
        (
            Fraction(density),
            Fraction(size) * Fraction(altitude) / ((Fraction(bottom) + Fraction(top)) / 2),
        )
        for bottom, top, density, size in layers
    ]
    points = [(Fraction(x), Fraction(y)) for x, y in positions]
    clear = math.prod((1 - density for density, _ in slices), start=ONE)
    total = ZERO
    for x, y in points:
        for other_x, other_y in points:
            both = ONE
            for density, reach in slices:
                tau = triangle(x - other_x, reach) * triangle(y - other_y, reach)
                both *= (1 - density) ** 2 + density * (1 - density) * tau
            total += both - clear**2
    return 1 - clear, total / (len(points) ** 2 * (1 - clear) * clear)


def enumerated_volume(
    slices: Iterable[tuple[Fraction, Fraction]], sites: Sequence[tuple[int, int]]
) -> tuple[Fraction, Fraction]:
    """p and V of a tiny volume, by listing every state of every cell that a view can meet.

    A slice is a lattice of independent cells, which are occupied or empty.  Its phase relative to
    the target is uniformly distributed.  From one view to the next, the slice moves by d̂ cells.

    Parameters
    ----------
    slices
        Share of occupied cells and d̂ of every slice.
    sites
        Views as (row, column) of a lattice.
    """
    # The probability of every set of views that see an occluder. A set is stored as bits.
    blocked = {0: ONE}
    for density, dhat in slices:
        merged: Counter[int] = Counter()
        one_slice = _blocked_by(density, dhat, sites)
        for (before, first), (now, second) in product(blocked.items(), one_slice.items()):
            merged[before | now] += first * second
        blocked = merged
    hidden = sum(share for views, share in blocked.items() if views & 1)
    error = sum(
        share * Fraction(views.bit_count(), len(sites)) ** 2 for views, share in blocked.items()
    )
    return Fraction(hidden), 1 - Fraction(error)


def _blocked_by(
    density: Fraction, dhat: Fraction, sites: Sequence[tuple[int, int]]
) -> dict[int, Fraction]:
    """For every set of views, the probability that one slice blocks exactly these views."""
    result: Counter[int] = Counter()
    rows = _phases(dhat, {row for row, _ in sites})
    columns = _phases(dhat, {column for _, column in sites})
    for (phase_y, share_y), (phase_x, share_x) in product(rows, columns):
        views_of_cell: Counter[tuple[int, int]] = Counter()
        for bit, (row, column) in enumerate(sites):
            cell = math.floor(phase_y + row * dhat), math.floor(phase_x + column * dhat)
            views_of_cell[cell] |= 1 << bit
        for state in product((False, True), repeat=len(views_of_cell)):
            views = 0
            share = share_y * share_x
            for occupied, seen_by in zip(state, views_of_cell.values(), strict=True):
                share *= density if occupied else 1 - density
                views |= seen_by if occupied else 0
            result[views] += share
    return result


def _phases(dhat: Fraction, steps: set[int]) -> list[tuple[Fraction, Fraction]]:
    """Middles and widths of intervals of the phase.  Within an interval, every view stays in the
    same cell.
    """
    edges = sorted({ZERO, ONE, *((-step * dhat) % 1 for step in steps)})
    return [((low + high) / 2, high - low) for low, high in pairwise(edges)]
