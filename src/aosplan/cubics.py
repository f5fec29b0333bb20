"""Cubics through points that rise and fall only where the points do.

The method of Fritsch and Butland (1984, SIAM J. Sci. Stat. Comput. 5, 300-304) with one-sided
ends as in Moler's *Numerical Computing with Matlab*: what `scipy.interpolate.PchipInterpolator`
gives, in a file of its own because importing that takes longer than a whole plan.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def monotone_cubics(x: Floats, y: Floats) -> Floats:
    """Coefficients of piecewise cubics through points.

    Parameters
    ----------
    x
        Shape (n,), rising, n from 2.
    y
        Shape (n, ...): values at `x`.

    Returns
    -------
    ndarray
        Shape (4, n - 1, ...): between ``x[i]`` and ``x[i + 1]`` the value is c[0, i] s³ + c[1, i]
        s² + c[2, i] s + c[3, i] with s the distance from ``x[i]``.
    """
    step = np.diff(x).reshape(-1, *(1,) * (y.ndim - 1))
    slope = np.diff(y, axis=0) / step
    tangent = np.empty_like(y)
    if len(x) == 2:
        tangent[:] = slope
    else:
        before, after = slope[:-1], slope[1:]
        near, far = 2.0 * step[1:] + step[:-1], step[1:] + 2.0 * step[:-1]
        turns = before * after <= 0.0
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            mean = (near + far) / (near / before + far / after)
        tangent[1:-1] = np.where(turns, 0.0, mean)
        tangent[0] = _end(step[0], step[1], slope[0], slope[1])
        tangent[-1] = _end(step[-1], step[-2], slope[-1], slope[-2])
    bend = (tangent[:-1] + tangent[1:] - 2.0 * slope) / step
    return np.stack([bend / step, (slope - tangent[:-1]) / step - bend, tangent[:-1], y[:-1]])


def _end(step: Floats, next_step: Floats, slope: Floats, next_slope: Floats) -> Floats:
    """Tangent at an end: of the parabola through three points, where that is monotone."""
    tangent = ((2.0 * step + next_step) * slope - step * next_slope) / (step + next_step)
    turned = np.sign(tangent) != np.sign(slope)
    steep = (np.sign(slope) != np.sign(next_slope)) & (np.abs(tangent) > 3.0 * np.abs(slope))
    bounded: Floats = np.where(turned, 0.0, np.where(steep, 3.0 * slope, tangent))
    return bounded
