"""Clutter in the integral image from the part of the radiance that whole crowns have in common.

Crowns are described by a field of radiances along the ground with the correlation ρ(r) = exp(-r²/(2
L²)). A ray from camera c to ground point t that ends in the canopy at height H shows the field at t
(1 - H/h) + c H/h. Two such rays end at independent heights H and H'. They show the field at two
points whose offset is the offset of the targets plus d = c H/h - c' H'/h. A wide aperture and a
deep canopy spread each crown over the ground, which reduces its clutter.

The mean of a covariance K(d) over all pairs of photos and over all pairs of heights is an integral
of its spectrum,

    ∫∫ |φ(k)|² K̂(k) dk/(2π)²,   φ(k) = Σ_H P(H) (1/N) Σ_c exp(i k·c H/h).

K̂ is a Gaussian, multiplied by the spectra of the detector's window and box.  The window is
approximated by a Gaussian, because it is small compared with a crown.  The box has its exact shape
and is parallel to the axes.  The integral is computed by the trapezoidal rule.  The error of this
rule is negligible if the period 2π/dk, for a step dk, is larger than the largest d plus the reach
of K.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from aosplan.scenes.integral_image import CROWN_LENGTH_M

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.models.target_window import Kernels, Target

    Floats = NDArray[np.float64]

HIGHEST = 5.0
"""Product of the highest wave number and the length L of the crowns. A share of 1e-6 of the
spectrum is above this wave number.
"""

REACH = 6.0
"""Distance, divided by the length L of the crowns, beyond which the covariance of the field is
negligible.
"""

HEIGHTS = 32
"""Largest number of heights at which rays end.  If there are more, neighbouring heights are
merged.
"""


def crown_covariances(
    sites_m: Floats,
    heights_m: Floats,
    ends: Floats,
    altitude_m: float,
    target: Target,
    kernels: Kernels,
) -> tuple[Floats, Floats]:
    """Covariances of the field of crowns, for pairs of rays that both end in the canopy.

    Parameters
    ----------
    sites_m
        Horizontal positions of the cameras relative to the target, shape (N, 2).
    heights_m, ends
        Heights at which rays end, and their probabilities.
    altitude_m
        Altitude of the cameras above the targets.
    target, kernels
        The target, with the size of its window and box, and the steps of the kernels.

    Returns
    -------
    window, box
        Shapes (4,) and (2,), in the order of the kernels.
    """
    near = 1.0 - float(ends @ heights_m) / altitude_m
    heights_m, ends = _grouped(heights_m, ends)
    slopes = heights_m / altitude_m
    half = 0.5 * near * target.box_m
    # The next lines compute the largest distance between two points of the field, along the longer
    # axis.
    ends_m = [sites_m * slope for slope in (slopes.min(), slopes.max())]
    apart_m = float(np.ptp(np.concatenate(ends_m), axis=0).max())
    step = 2.0 * math.pi / (apart_m + 2.0 * half + REACH * CROWN_LENGTH_M)
    count = math.ceil(HIGHEST / (CROWN_LENGTH_M * step))
    k = step * np.arange(-count, count + 1.0)
    power = np.abs(_characteristic(sites_m, slopes, ends, k)) ** 2
    field = CROWN_LENGTH_M * step / math.sqrt(2.0 * math.pi) * _blurred(k, CROWN_LENGTH_M**2)
    # Second moment, per axis, of the offset between two points of the window: without a shift, and
    # with a shift.
    pair = near**2 * (target.width_m**2 + target.length_m**2) / 12.0
    moved = pair + 0.5 * (near * kernels.step_m) ** 2
    inside = np.sinc(k * half / math.pi)
    kept = [_blurred(k, spread) for spread in (pair, moved, moved, pair)]
    kept += [_blurred(k, 0.5 * pair) * inside, inside**2]
    spectra = field * np.array(kept)
    # Non-negative wave numbers along x are sufficient, because |φ(k)|² = |φ(-k)|².
    along_x = spectra[:, count:] * np.where(k[count:] > 0.0, 2.0, 1.0)
    found = ((spectra @ power) * along_x).sum(axis=1)
    return found[:4], found[4:]


def _grouped(heights_m: Floats, ends: Floats) -> tuple[Floats, Floats]:
    """At most `HEIGHTS` heights and their probabilities.  If there are more heights, neighbours are
    merged.
    """
    starts = np.arange(0, len(ends), math.ceil(len(ends) / HEIGHTS))
    share = np.add.reduceat(ends, starts)
    return np.add.reduceat(ends * heights_m, starts) / share, share


def _characteristic(
    sites_m: Floats, slopes: Floats, ends: Floats, k: Floats
) -> NDArray[np.complex128]:
    """φ at all wave numbers along y (rows) and at the non-negative wave numbers along x
    (columns).
    """
    (x, column), (y, row) = (np.unique(axis, return_inverse=True) for axis in sites_m.round(6).T)
    middle = len(k) // 2
    if len(x) + len(y) <= len(sites_m):
        # On a grid, with or without gaps, the cameras have only a few different coordinates. The
        # waves of each height are therefore summed over the cameras of each column of the grid
        # first.
        cameras = np.zeros((len(y), len(x)))
        np.add.at(cameras, (row, column), 1.0 / len(sites_m))
        waves_x, waves_y = (_waves(k[middle:], slopes[:, None] * axis) for axis in (x, y))
        waves_y = (ends[:, None] * waves_y) @ cameras
    else:
        places = sites_m * slopes[:, None, None]
        waves_x, waves_y = (_waves(k[middle:], places[..., axis]) for axis in (0, 1))
        waves_y = waves_y * (ends[:, None] / len(sites_m))
    along_x, along_y = (waves.reshape(middle + 1, -1) for waves in (waves_x, waves_y))
    # The waves of negative wave numbers are the conjugate ones.
    found: NDArray[np.complex128] = np.vstack([along_y[:0:-1].conj(), along_y]) @ along_x.T
    return found


def _waves(k: Floats, places_m: Floats) -> NDArray[np.complex128]:
    """exp(i k s) at places s, with the wave numbers along the first axis."""
    waves: NDArray[np.complex128] = np.exp(1j * k[:, None, None] * places_m)
    return waves


def _blurred(k: Floats, variance: float) -> Floats:
    """Spectrum of a Gaussian with the given variance and the integral 1."""
    left: Floats = np.exp(-0.5 * k**2 * variance)
    return left
