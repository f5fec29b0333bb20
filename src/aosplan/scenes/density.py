"""Integrated density, transparency and slice density: Eq. 1 of the paper and its inverse."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from aosplan.numerics import SCALARS, elementwise

if TYPE_CHECKING:
    from aosplan.numerics import Floats


def integrated_density(slice_density: Floats, volume_height: Floats, occluder_size: Floats) -> Any:
    """Share p = 1 - (1 - D)^(l/o) of the target that one sample does not see (Eq. 1).

    Parameters
    ----------
    slice_density
        D, share of each slice that is filled with occluders, 0 to 1.
    volume_height
        l, thickness of the volume [m], at least 0.
    occluder_size
        o, edge length of an occluder [m], above 0.

    Returns
    -------
    float or ndarray
        p, accurate also for very small values; nan outside the domain.  If p is so close to 1
        that it loses digits, use `transparency`.

    References
    ----------
    Kurmi, Schedl and Bimber (2019), Eq. 1.

    Examples
    --------
    >>> round(integrated_density(0.0095, 17.54, 0.20), 3)
    0.567
    """
    return elementwise(_integrated_density, slice_density, volume_height, occluder_size)


def transparency(slice_density: Floats, volume_height: Floats, occluder_size: Floats) -> Any:
    """Share T = (1 - D)^(l/o) = 1 - p of the target that one sample sees (from Eq. 1).

    Parameters and domain are those of `integrated_density`.
    """
    return elementwise(_transparency, slice_density, volume_height, occluder_size)


def slice_density(integrated: Floats, volume_height: Floats, occluder_size: Floats) -> Any:
    """Density D of each slice, for a given integrated density p. This is Eq. 1, solved for D.

    Parameters
    ----------
    integrated
        p, 0 to 1.
    volume_height, occluder_size
        l and o [m], both above 0.
    """
    return elementwise(_slice_density, integrated, volume_height, occluder_size)


def density_of_part(density: Any, part_m: Any, whole_m: Any, xp: Any = SCALARS) -> Any:
    """Integrated density of a part of a volume with the integrated density p (from Eq. 1).

    Takes floats, or arrays with numpy as `xp`.  `part_m` and `whole_m` are thicknesses.
    """
    return -xp.expm1(xp.log1p(-density) * part_m / whole_m)


def _log_transparency(xp: Any, d: Any, height: Any, o: Any) -> tuple[Any, Any, Any]:
    """log T = (l/o) log(1 - D) as a sum of two floats, and whether the arguments are in the domain
    of Eq. 1.

    The relative error of T is |log T| times the relative error of log T.  The second float
    therefore contains the rounding errors of the quotient and of the product.
    """
    log_q = xp.log1p(-d)
    ratio = height / o
    remainder = (height - ratio * o) - _product_error(ratio, o)
    high = ratio * log_q
    low = _product_error(ratio, log_q) + remainder / o * log_q
    # An empty volume is transparent, whatever D and l/o are. This case is treated separately,
    # because 0 times infinity would give nan. If the correction overflows, it is not needed.
    filled = (height > 0.0) & (d > 0.0)
    valid = (d >= 0.0) & (d <= 1.0) & (height >= 0.0) & (o > 0.0)
    # A solid slice has log T = -inf, even if l/o is rounded to 0.
    high = xp.where(d < 1.0, high, -math.inf)
    return xp.where(filled, high, 0.0), xp.where(filled & (abs(low) < 1.0), low, 0.0), valid


def _product_error(x: Any, y: Any) -> Any:
    """Exact rounding error of x * y: x y = fl(x y) + error (Dekker 1971)."""
    # The factor 2^27 + 1 splits a 53-bit significand into two halves.
    x_high = x * 134217729.0 - (x * 134217729.0 - x)
    y_high = y * 134217729.0 - (y * 134217729.0 - y)
    x_low, y_low = x - x_high, y - y_high
    return ((x_high * y_high - x * y) + x_high * y_low + x_low * y_high) + x_low * y_low


def _integrated_density(xp: Any, d: Any, height: Any, o: Any) -> tuple[Any, Any]:
    log_t, rest, valid = _log_transparency(xp, d, height, o)
    # The subtraction from 0.0 avoids p = -0.0 for D = 0.
    return 0.0 - (xp.expm1(log_t) + xp.exp(log_t) * rest), valid


def _transparency(xp: Any, d: Any, height: Any, o: Any) -> tuple[Any, Any]:
    log_t, rest, valid = _log_transparency(xp, d, height, o)
    t = xp.exp(log_t)
    # If T is small, |log T| is large, and an error in its last digit changes T noticeably. The
    # power (1 - D)^(l/o) does not have this error. In the following, 1 - D is exactly q + lost, and
    # l/o is ratio + remainder.
    q = 1.0 - d
    lost = (1.0 - q) - d
    ratio = height / o
    remainder = ((height - ratio * o) - _product_error(ratio, o)) / o
    small = (log_t < -1.0) & (log_t > -800.0)
    base = xp.where(small, q, 1.0)
    correction = xp.where(small, ratio * (lost / base) + remainder * xp.log1p(base - 1.0), 0.0)
    return xp.where(small, base**ratio * xp.exp(correction), t + t * rest), valid


def _slice_density(xp: Any, p: Any, height: Any, o: Any) -> tuple[Any, Any]:
    valid = (p >= 0.0) & (p <= 1.0) & (height > 0.0) & (o > 0.0)
    return 0.0 - xp.expm1(xp.log1p(-p) * (o / height)), valid
