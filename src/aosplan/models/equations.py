"""Eq. 1 to 5 of Kurmi, Schedl and Bimber (2019), and their inverses.

=======  =======================  ======  ==========================================  =========
symbol   public name              unit    meaning                                     range
=======  =======================  ======  ==========================================  =========
D        slice_density            1       share of a slice filled with occluders      [0, 1]
l        volume_height            m       thickness of the occluder volume            >= 0
o        occluder_size            m       edge length of an occluder                  > 0
p        density                  1       integrated density: share of the target     [0, 1]
                                          hidden in one sample
T        transparency             1       1 - p                                       [0, 1]
n        rows, columns            1       samples along either axis of the grid       1, 2, …
N        samples                  1       rows x columns                              1, 2, …
d̂        dhat                     1       disparity between neighbours / projected    >= 0
                                          occluder size
κ        --                       1       share of one sample's variance that is      [1/n, 1]
                                          left after averaging a row of n
K        visibility_shortfall     1       the same for the grid: 1 - V̂                [1/N, 1]
V        visibility               1       1 - mean squared error of the average       [0, 1]
V̂        normalized_visibility    1       V between its limits at N = 1 and N = ∞     [0, 1)
b        baseline                 m       distance between neighbouring samples       > 0
a        aperture                 m       side of the sampled square                  >= 0
=======  =======================  ======  ==========================================  =========

The paper writes Eq. 2 as a double sum over the offsets of a square grid. Together with its factor
N, this double sum is the square of the one-dimensional sum in the appendix. The one-dimensional sum
is a cubic polynomial in the number of neighbours that overlap. The computing time of every function
here is therefore independent of N.

For scalar arguments, the result is a float. Arrays are broadcast. Outside the domain of a function,
its result is ``nan``.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError
from aosplan.numerics import SCALARS, elementwise, smallest
from aosplan.scenes.density import integrated_density, slice_density, transparency
from aosplan.units import exact_share

if TYPE_CHECKING:
    from collections.abc import Callable
    from decimal import Decimal

    from aosplan.numerics import Floats

__all__ = [
    "aperture",
    "baseline_for_aperture",
    "dhat_for_shortfall",
    "integrated_density",
    "line_shortfall",
    "mean_squared_error",
    "normalized_visibility",
    "required_samples",
    "required_samples_for_visibility",
    "slice_density",
    "transparency",
    "visibility",
    "visibility_limits",
    "visibility_shortfall",
]


# --- Eq. 2 to 4: visibility ---------------------------------------------------------------


def visibility(
    density: Floats,
    rows: Floats,
    columns: Floats,
    dhat: Floats,
    *,
    transparency: Floats | None = None,
) -> Any:
    """Visibility V of a rows x columns grid, Eq. 2 in closed form.

    V = 1 - E[X²], where X is the average of N samples that each hide a share p.  It is computed
    without cancellation as T (1 + p (1 - K)) with K from `visibility_shortfall`.  For d̂ >= 1 this
    is Eq. 3.

    Parameters
    ----------
    density
        p, integrated density of one sample, 0 to 1.
    rows, columns
        Whole numbers, at least 1; a line of samples has rows = 1.
    dhat
        d̂, disparity between neighbours divided by projected occluder size, at least 0.
    transparency
        T = 1 - p.  Give it if p is so close to 1 that 1 - p would lose digits.

    References
    ----------
    Kurmi, Schedl and Bimber (2019), Eq. 2 and 3 and appendix.

    Examples
    --------
    >>> round(visibility(0.567, 7, 7, 1.0), 4)
    0.6735
    """
    return _of_grid(
        lambda _, p, t, _k, rest: t * (1.0 + p * rest), density, transparency, rows, columns, dhat
    )


def mean_squared_error(
    density: Floats,
    rows: Floats,
    columns: Floats,
    dhat: Floats,
    *,
    transparency: Floats | None = None,
) -> Any:
    """Mean squared error 1 - V = p (p + T K) of the average.  It is accurate even if V is close to
    1.

    The parameters are those of `visibility`.  Source: Kurmi, Schedl and Bimber (2019), appendix.
    """

    def equation(xp: Any, p: Any, _t: Any, k: Any, rest: Any) -> Any:
        # p + T K is computed as K + p (1 - K), which avoids the rounding error of T.
        return p * xp.minimum(k + p * rest, 1.0)

    return _of_grid(equation, density, transparency, rows, columns, dhat)


def normalized_visibility(rows: Floats, columns: Floats, dhat: Floats) -> Any:
    """Normalised visibility V̂ = (V - Vmin)/(Vmax - Vmin) of a grid, which does not depend on p.

    For d̂ >= 1 this is Eq. 4, 1 - 1/N.  The parameters are those of `visibility`.  Very small
    values are accurate.  If V̂ is close to 1, `visibility_shortfall` has more significant digits.

    Examples
    --------
    >>> normalized_visibility(5, 10, 1.0)
    0.98
    """
    return elementwise(lambda xp, *grid: _shortfall(xp, *grid)[1:], dhat, *_sides(rows, columns))


def visibility_shortfall(rows: Floats, columns: Floats, dhat: Floats) -> Any:
    """Shortfall K = 1 - V̂ of a grid, compared with infinitely many photos.  It is accurate even if
    V̂ is close to 1.

    K = κ(rows, d̂) κ(columns, d̂) is the variance of the average divided by the variance of one
    sample. The parameters are those of `visibility`.
    """
    return elementwise(lambda xp, *grid: _shortfall(xp, *grid)[::2], dhat, *_sides(rows, columns))


def line_shortfall(samples: Floats, dhat: Floats) -> Any:
    """κ(n, d̂): shortfall 1 - V̂ of a single line of n samples.

    The shortfall of a grid with different pitches along its axes is the product of κ for both axes.
    Source: Kurmi, Schedl and Bimber (2019), appendix (1-D case), with the sum in closed form.
    """

    def kernel(xp: Any, n: Any, d: Any) -> tuple[Any, Any]:
        summed, _, valid = _line(xp, n, d)
        return summed / n, valid

    return elementwise(kernel, samples, dhat)


def visibility_limits(density: Floats) -> tuple[Any, Any]:
    """Visibility of one sample and of infinitely many samples: (Vmin, Vmax) = (1 - p, 1 - p²)."""
    minimum = elementwise(lambda _, p: (1.0 - p, (p >= 0.0) & (p <= 1.0)), density)
    maximum = elementwise(lambda _, p: ((1.0 - p) * (1.0 + p), (p >= 0.0) & (p <= 1.0)), density)
    return minimum, maximum


def _of_grid(
    equation: Callable[..., Any],
    density: Any,
    transparency: Any,
    rows: Any,
    columns: Any,
    dhat: Any,
) -> Any:
    """Evaluate, elementwise, an equation in the quantities p, T, K and 1 - K of a grid. The result
    is ``nan`` outside the domain.
    """

    def kernel(xp: Any, p: Any, t: Any, *grid: Any) -> tuple[Any, Any]:
        k, rest, valid = _shortfall(xp, *grid)
        return equation(xp, p, t, k, rest), valid & (p >= 0.0) & (p <= 1.0) & (t >= 0.0) & (
            t <= 1.0
        )

    if transparency is None:
        transparency = elementwise(lambda _, p: (1.0 - p, True), density)
    return elementwise(kernel, density, transparency, dhat, *_sides(rows, columns))


def _sides(rows: Any, columns: Any) -> tuple[Any, ...]:
    """Rows and columns of a grid.  For a square, only the rows are returned, so that κ is computed
    once.
    """
    return (rows,) if rows is columns else (rows, columns)


def _line(xp: Any, n: Any, d: Any) -> tuple[Any, Any, Any]:
    """n κ(n, d̂) of a line, 1 - κ, and whether the arguments are in the domain.

    m is the number of neighbours that a sample overlaps, and e = 1 - m d̂ is its overlap with the
    last of these neighbours. With the sum A = Σ (n-i) (1 - i d̂) of the appendix, n κ = (n + 2A)/n.
    The terms are arranged so that the error is at most three units in the last place. The same
    cubic polynomial in its plain form has an error of more than four units.
    """
    valid = (n >= 1.0) & (n < math.inf) & (n == xp.floor(n)) & (d >= 0.0)
    d = xp.minimum(d, 1.0)  # For d̂ > 1 the overlap is 0, as for d̂ = 1.
    others = n - 1.0
    m = xp.floor(xp.minimum(others, 1.0 / xp.maximum(d, 1e-300)))
    e = xp.maximum(1.0 - m * d, 0.0)
    summed = m + (m + 1.0) * (e - m / (3.0 * n) * (1.0 + 2.0 * e - d))
    # If all n samples overlap, 1 - κ is linear in d̂. The linear form is accurate even if κ is
    # close to 1.
    linear = d * (others * (n + 1.0) / (3.0 * n))
    overlapping = d * others <= 1.0
    summed = xp.where(overlapping, n * (1.0 - linear), summed)
    return summed, xp.where(overlapping, linear, 1.0 - summed / n), valid


def _shortfall(xp: Any, d: Any, rows: Any, columns: Any = None) -> tuple[Any, Any, Any]:
    """K = κ(rows) κ(columns), 1 - K, and whether the arguments are in the domain."""
    sum_y, rest_y, valid = _line(xp, rows, d)
    if columns is None:
        sum_x, rest_x, columns = sum_y, rest_y, rows
    else:
        sum_x, rest_x, valid_x = _line(xp, columns, d)
        valid = valid & valid_x
    # A single division by N has a smaller rounding error than one division for each axis.
    return sum_y * sum_x / (rows * columns), rest_x + sum_x / columns * rest_y, valid


def dhat_for_shortfall(
    shortfall: float, rows: int, columns: int, *, pitch_ratio: float = 1.0
) -> float:
    """Smallest d̂ at which a grid's shortfall 1 - V̂ is at most a target: Eq. 2 solved for d̂.

    Parameters
    ----------
    shortfall
        1 - V̂, above 0.
    rows, columns
        Whole numbers, at least 1.
    pitch_ratio
        Pitch between rows divided by pitch between columns, at least 1.

    Returns
    -------
    float
        d̂ in [0, 1]; ``nan`` if 1 - V̂ exceeds the target even at d̂ = 1.
    """

    def reached(dhat: float) -> float:
        return float(line_shortfall(columns, dhat) * line_shortfall(rows, pitch_ratio * dhat))

    if not reached(1.0) <= shortfall:
        # A tolerance is needed, because the caller may have rounded 1/N differently.
        return 1.0 if reached(1.0) <= shortfall * (1.0 + 1e-15) else math.nan
    return smallest(lambda dhat: reached(dhat) <= shortfall, 0.0, 1.0)


# --- Inverses of Eq. 4 and 5: number of samples and aperture ------------------------------


def required_samples(vhat: float | str | Decimal | Fraction) -> int:
    """Smallest number N of samples at d̂ >= 1 whose V̂ = 1 - 1/N reaches a target. This is the
    exact inverse of Eq. 4.

    Parameters
    ----------
    vhat
        Target V̂, at least 0 and below 1.  Text (``"0.98"``, ``"98%"``), `Decimal` and `Fraction`
        are exact.  A float has already been rounded.  If it is within one unit in the last place of
        1 - 1/k for some whole number k, 1 - 1/k is used instead.

    Raises
    ------
    RequestError
        If the target is not a number in [0, 1).

    Examples
    --------
    >>> required_samples("0.98"), required_samples(0.9), required_samples("0.999999")
    (50, 10, 1000000)
    """
    target = exact_share(vhat, "V̂")
    if not 0 <= target < 1:
        hint = (
            "no finite number of photos reaches 1; give a target such as 0.98 or 98%"
            if target == 1
            else f"write {vhat}%"
            if 1 < target <= 100 and not str(vhat).endswith("%")
            else "give a target between 0 and 1, such as 0.98 or 98%"
        )
        raise RequestError(f"V̂ = {vhat} is not a share below 1", hint)
    samples = 1 / (1 - target)
    if isinstance(vhat, float):
        nearest = Fraction(round(samples))
        if abs(1 - 1 / nearest - target) <= Fraction(math.ulp(vhat)):
            return int(nearest)
    return math.ceil(samples)


def required_samples_for_visibility(target: float, density: float) -> int | None:
    """Smallest number N of samples at d̂ >= 1 that reaches a visibility V. This is Eq. 3, solved
    for N.

    N = ⌈p T / (Vmax - V)⌉. The result is 1 if V <= Vmin. If V >= Vmax, no number of samples reaches
    V, and the result is None. If p = 0, one sample has V = 1, and the result is 1 for every target.
    """
    p = Fraction(density)
    gap = (1 - p * p) - Fraction(target)
    if Fraction(target) <= 1 - p:
        return 1
    if gap <= 0:
        return None
    return math.ceil(p * (1 - p) / gap)


def aperture(samples: Floats, baseline: Floats) -> Any:
    """Side a = (√N - 1) b of the sampled square [m], Eq. 5.

    The examples in the text of the paper (b = 2.8 m: 14 m for 25 samples, 19.6 m for 49 samples)
    are √N b, which is one pitch longer than the result of Eq. 5. Fig. 7 of the paper agrees with
    Eq. 5.

    Parameters
    ----------
    samples
        N, at least 1.
    baseline
        b [m], at least 0.

    Examples
    --------
    >>> round(aperture(50, 2.8), 1)
    17.0
    """
    return elementwise(
        lambda xp, n, b: (sampled_side(n, xp) * b, (n >= 1.0) & (b >= 0.0)), samples, baseline
    )


def sampled_side(samples: Any, xp: Any = SCALARS) -> Any:
    """√N - 1, the side of the sampled square in baselines.  It is accurate even if N is close to
    1.
    """
    return (samples - 1.0) / (xp.sqrt(samples) + 1.0)


def baseline_for_aperture(aperture: Floats, samples: Floats) -> Any:
    """Baseline b = a/(√N - 1) [m] for an aperture a with N > 1 samples: inverse of Eq. 5."""
    return elementwise(
        lambda xp, a, n: (a / sampled_side(n, xp), (n > 1.0) & (a >= 0.0)),
        aperture,
        samples,
    )
