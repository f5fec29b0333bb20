"""Clutter of an integral image, and the threshold for a given false-alarm rate.

Radiances are in units of σ_c, the standard deviation between occluders.  The mean of the ground is
zero, the mean of the canopy is M, and the ground has a texture of standard deviation `TEXTURE`.  A
share of σ_c², the crown share, is common to whole crowns; the rest of σ_c² is independent for each
occluder.

The detector takes the mean over a window of the target's size and subtracts the mean of the box
around it.  The indices w and b stand for window and box.  A covariance component R contributes

    R_ww - 2 R_wb + R_bb

to the variance of this difference. Let T be the transparency of the canopy and s the seen share of
the window. For a window without a target, the difference between the means of window and box has
the mean M (1 - β) (T - s) and the variance sd²(s). Here β = S_wb/S_ww, where S is the covariance of
the seen share, is the part of s that the window has in common with the box. The contribution of the
canopy to sd² increases with 1 - s, and the contribution of the ground increases with s².

**False alarms.**  The detector evaluates every place in every direction.  For a Gaussian field, the number of peaks above u standard deviations equals the expected Euler characteristic (Adler 1981). Here the field depends on place and direction; the direction repeats after half a turn. In an area A, the Euler characteristic is

    χ(u) = A π √(λ_l λ_w λ_θ) (2π)^-2 (u² - 1) exp(-u²/2).

The λ are the variances of the field's derivatives along the window, across it, and with respect to
direction.  The number of independent windows is therefore n_w = `PEAKS` χ(u)/Φ̄(u), where Φ̄ is the
tail of the normal distribution.  The threshold u solves

    E_s Φ̄((u - M (1 - β) (T - s))/sd(s)) = F/n_w,

where F is the allowed number of false alarms.  `PEAKS` = 0.6 is fitted to simulations.  It is less
than 1, because an image with hard edges and pixels has fewer peaks than a smooth field.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.scenes.integral_image import TEXTURE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.models.seen_share import SeenShare
    from aosplan.models.target_window import Kernels
    from aosplan.models.window_pairs import Pairs

    Floats = NDArray[np.float64]

PEAKS = 0.6
"""Number of peaks above a high threshold, divided by the number for a smooth Gaussian field."""

HECTARE_M2 = 10_000.0

SEEN, OWN, GROUND, CROWN = range(4)
"""Rows of the integrals of `aosplan.models.window_pairs`, and the row that
`aosplan.models.crown_clutter` adds.
"""


class Radiances(NamedTuple):
    """Radiances that determine the clutter.

    Attributes
    ----------
    canopy_offset
        M, mean radiance of the canopy minus that of the ground, in units of σ_c.
    crown_share
        Share of σ_c² that is common to whole crowns.
    texture
        Standard deviation of the ground's texture, in units of σ_c.
    """

    canopy_offset: float
    crown_share: float
    texture: float = TEXTURE


class Clutter(NamedTuple):
    """Variance of the detector's output, divided into contributions.

    Attributes
    ----------
    transparency
        T, transparency.
    square
        E[s²], where s is the seen share.
    slope
        M (1 - β): decrease of the mean output per increase of s.
    canopy, ground
        Covariances of window and window, window and box, and box and box.
    rest
        Variance of the product of M and the seen share of the box, for a given s.
    roughness
        √(λ_l λ_w λ_θ) of the output divided by its standard deviation [1/m²].
    """

    transparency: float
    square: float
    slope: float
    canopy: tuple[float, float, float]
    ground: tuple[float, float, float]
    rest: float
    roughness: float

    def mean(self, share: Floats) -> Floats:
        """Mean of the output for a window without a target, for a given seen share."""
        return self.slope * (self.transparency - share)

    def deviation(self, share: Floats, *, target: bool = False) -> Floats:
        """Standard deviation of the output for a given seen share. A target hides the ground below
        it, which reduces the standard deviation.
        """
        ww, wb, bb = self.canopy
        hidden = (1.0 - share) / max(1.0 - self.transparency, 1e-12)
        variance = self.rest + hidden * (ww - 2.0 * wb) + bb
        ww, wb, bb = self.ground
        if not target:
            variance = variance + ww * share**2 / self.square
            variance -= 2.0 * wb * share / self.transparency
        variance = variance + bb
        deviation: Floats = np.sqrt(np.maximum(variance, 1e-12))
        return deviation

    def total_deviation(self, variance: float) -> float:
        """Standard deviation of the output over all places, for a given variance of s."""
        parts = [ww - 2.0 * wb + bb for ww, wb, bb in (self.canopy, self.ground)]
        return math.sqrt(max(sum(parts) + self.rest + self.slope**2 * variance, 1e-12))


def clutter_of(
    mean: Pairs,
    kernels: Kernels,
    transparency: float,
    radiances: Radiances,
    *,
    local: bool = True,
) -> Clutter:
    """Clutter from the means of the integrals over all pairs of photos.

    Parameters
    ----------
    mean
        Mean of `aosplan.models.window_pairs.Pairs` over all ordered pairs of photos, with the row
        for crowns.
    kernels
        Kernels of the integrals.
    transparency
        T, transparency of the canopy.
    radiances
        Radiances of ground and canopy.
    local
        Whether the detector subtracts the mean of the box.  Otherwise it subtracts the mean of the
        whole image.
    """
    m, x, g = radiances
    window, box = mean.window, mean.box if local else 0.0 * mean.box
    weights = np.array([m * m, 1.0 - x, g * g, x])
    fields = weights @ window
    variance = float(fields[0] + weights @ (box[:, 1] - 2.0 * box[:, 0]))
    canopy = [
        (1.0 - x) * float(own) + x * float(crown)
        for own, crown in zip(
            (window[OWN, 0], *box[OWN]), (window[CROWN, 0], *box[CROWN]), strict=True
        )
    ]
    ground = [g * g * float(part) for part in (window[GROUND, 0], *box[GROUND])]
    seen = max(float(window[SEEN, 0]), 1e-15)
    part = float(box[SEEN, 0]) / seen
    rest = m * m * max(float(box[SEEN, 1]) - part * float(box[SEEN, 0]), 0.0)
    return Clutter(
        transparency,
        transparency**2 + seen,
        m * (1.0 - part),
        (canopy[0], canopy[1], canopy[2]),
        (ground[0], ground[1], ground[2]),
        rest,
        _roughness(fields, variance, kernels),
    )


def _roughness(fields: Floats, variance: float, kernels: Kernels) -> float:
    """√(λ_l λ_w λ_θ). Each λ is computed from the decrease of the covariance over a small step."""
    steps = np.array([kernels.step_m, kernels.step_m, kernels.turn])
    drops = 2.0 * np.maximum(fields[0] - fields[1:], 1e-15) / steps**2
    return float(np.sqrt(np.prod(drops / max(variance, 1e-15))))


def independent_windows(level: float, roughness: float, area_m2: float = HECTARE_M2) -> float:
    """n_w, the number of independent windows in an area, for a level of u standard deviations."""
    from scipy.special import erfcx

    level = max(level, 1.5)  # At lower levels, χ differs from the number of peaks.
    # This is exp(-u²/2)/Φ̄(u), computed without overflow.
    ratio = 2.0 / float(erfcx(level / math.sqrt(2.0)))
    peaks = area_m2 * math.pi * roughness * (level * level - 1.0) / (2.0 * math.pi) ** 2
    return max(PEAKS * peaks * ratio, 1.0)


def threshold(clutter: Clutter, seen: SeenShare, false_alarms: float) -> float:
    """Threshold u at which the detector gives a certain number of false alarms per hectare.

    Parameters
    ----------
    clutter, seen
        Clutter and seen share of one plan over one scene.
    false_alarms
        Number of false alarms per hectare, above 0.
    """
    from scipy.optimize import brentq
    from scipy.special import ndtr

    deviation = clutter.total_deviation(seen.variance)
    mean, spread = clutter.mean(seen.nodes), clutter.deviation(seen.nodes)

    def surplus(level: float) -> float:
        wanted = false_alarms / independent_windows(level, clutter.roughness)
        passed = float(seen.weights @ ndtr((mean - level * deviation) / spread))
        return passed - wanted

    high = 8.0
    while surplus(high) > 0.0 and high < 1e3:
        high *= 2.0
    if surplus(0.0) <= 0.0 or surplus(high) > 0.0:
        return 0.0 if surplus(0.0) <= 0.0 else high * deviation
    return float(brentq(surplus, 0.0, high, xtol=1e-12)) * deviation
