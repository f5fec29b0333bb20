"""Clutter from radiances that whole crowns have in common, in the integral image.

Crowns are described by a field of radiances along the ground with the correlation
ρ(r) = exp(-r²/(2 L²)).  A ray from camera c to ground point t that ends in the canopy at height H
shows the field at t (1 - H/h) + c H/h.  Two such rays end at independent heights H and H'.  They
show the field at points that are d = c H/h - c' H'/h apart, in addition to the offset of their
targets.  A wide aperture and a deep canopy spread each crown over the ground, which reduces its
clutter.

The means over the detector's window and box use a Gaussian for the window, which is small compared
with a crown, and the exact shape of the box, which is parallel to the axes.  d is sampled from the
photos and from the heights at which rays end.
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

DRAWN = 4096
"""Number of pairs of rays that are sampled."""

SEED = 1


def crown_covariances(
    sites_m: Floats,
    heights_m: Floats,
    ends: Floats,
    altitude_m: float,
    target: Target,
    kernels: Kernels,
) -> tuple[Floats, Floats]:
    """Covariances of the crowns' field for two rays that both end in the canopy.

    Parameters
    ----------
    sites_m
        Camera positions, shape (N, 2).
    heights_m, ends
        Heights at which rays end, and their probabilities.
    altitude_m
        Altitude of the cameras.
    target, kernels
        The window, and the kernels with their steps.

    Returns
    -------
    window, box
        Shapes (4,) and (2,), in the order of the kernels.
    """
    rng = np.random.default_rng(SEED)
    places = []
    for _ in (0, 1):
        sites = sites_m[rng.integers(0, len(sites_m), DRAWN)]
        heights = heights_m[rng.choice(len(heights_m), DRAWN, p=ends)]
        places.append(sites * (heights / altitude_m)[:, None])
    apart = places[0] - places[1]
    near = 1.0 - float(ends @ heights_m) / altitude_m
    # Second moments along an axis: of the offset of two points of the window, and with a shift.
    pair = near**2 * (target.width_m**2 + target.length_m**2) / 12.0
    moved = pair + 0.5 * (near * kernels.step_m) ** 2
    length = CROWN_LENGTH_M

    def gaussian(spread: float) -> float:
        """Mean of ρ over the sampled offsets and a Gaussian with a variance per axis."""
        wide = length**2 + spread
        return float((length**2 / wide * np.exp(-0.5 * (apart**2).sum(axis=1) / wide)).mean())

    half = 0.5 * near * target.box_m
    wide = math.sqrt(length**2 + 0.5 * pair)
    mixed = _over_box(apart, wide, half) * length / wide
    both = _over_two_boxes(apart, length, half)
    window = np.array([gaussian(pair), gaussian(moved), gaussian(moved), gaussian(pair)])
    return window, np.array([mixed.prod(axis=1).mean(), both.prod(axis=1).mean()])


def _over_box(apart: Floats, spread: float, half: float) -> Floats:
    """Mean of exp(-x²/(2 spread²)) over an interval around each offset."""
    from scipy.special import ndtr

    area: Floats = ndtr((apart + half) / spread) - ndtr((apart - half) / spread)
    return area * (math.sqrt(2.0 * math.pi) * spread / (2.0 * half))


def _over_two_boxes(apart: Floats, spread: float, half: float) -> Floats:
    """Mean of exp(-x²/(2 spread²)) over the offsets between points of two equal intervals."""
    from scipy.special import ndtr

    def integral(x: Floats) -> Floats:
        """Second antiderivative of exp(-x²/(2 s²))/(√(2 π) s)."""
        value: Floats = x * ndtr(x / spread) + spread / math.sqrt(2.0 * math.pi) * np.exp(
            -0.5 * (x / spread) ** 2
        )
        return value

    side = 2.0 * half
    second = integral(apart + side) - 2.0 * integral(apart) + integral(apart - side)
    scale = math.sqrt(2.0 * math.pi) * spread / side**2
    found: Floats = second * scale
    return found
