"""Clutter of an integral image, and the threshold that a false-alarm rate sets.

Radiances count in units of σ_c, the standard deviation between occluders.  The ground's mean is
zero, the canopy's is M, and the ground has a texture of `TEXTURE`.  A share of σ_c² is common to
whole crowns (crown share), the rest is each occluder's own.

The detector takes the mean over a window of the target's size and subtracts the mean of the box
around it.  With w and b for window and box, a covariance component R contributes

    R_ww - 2 R_wb + R_bb

to the variance of the difference.  Of a place where the seen share is s, the difference has the mean M (1 - β) (T - s),
β = S_wb/S_ww being the part of s that the box shares, and the variance sd²(s): what canopy
contributes grows with 1 - s, what ground contributes with s².

**False alarms.**  The detector looks at every place in every direction.  The number of peaks of a
Gaussian field above u standard deviations is its expected Euler characteristic (Adler 1981), here
over place and direction, which repeats after half a turn:

    χ(u) = A π √(λ_l λ_w λ_θ) (2π)^-2 (u² - 1) exp(-u²/2),

λ being the variances of the field's derivatives along the window, across it, and by direction.  So
n_w = `PEAKS` χ(u)/Φ̄(u) windows are independent, and the threshold solves

    E_s Φ̄((u - M (1 - β) (T - s))/sd(s)) = F/n_w.

`PEAKS` = 0.6 is fitted to simulations: hard edges and a lattice of pixels have fewer peaks.
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
"""Peaks above a high threshold over those of a smooth Gaussian field."""

HECTARE_M2 = 10_000.0

SEEN, OWN, GROUND, CROWN = range(4)
"""Rows of the integrals of `aosplan.models.window_pairs`, and that of the crowns below them (`aosplan.models.crown_clutter`)."""


class Radiances(NamedTuple):
    """What clutter is made of.

    Attributes
    ----------
    canopy_offset
        M, the canopy's mean over the ground's, in units of σ_c.
    crown_share
        Share of σ_c² that whole crowns have in common.
    texture
        Of the ground, in units of σ_c.
    """

    canopy_offset: float
    crown_share: float
    texture: float = TEXTURE


class Clutter(NamedTuple):
    """Variances of a detector's output, by what they come from.

    Attributes
    ----------
    transparency
        T.
    square
        E[s²].
    slope
        M (1 - β): how far the mean of the output falls when s rises by one.
    canopy, ground
        Covariances of window with window, window with box, and box with box.
    rest
        Variance of M times what the box sees, given s.
    roughness
        √(λ_l λ_w λ_θ) of the output in units of its standard deviation [1/m²].
    """

    transparency: float
    square: float
    slope: float
    canopy: tuple[float, float, float]
    ground: tuple[float, float, float]
    rest: float
    roughness: float

    def mean(self, share: Floats) -> Floats:
        """Mean of the output where a share of the window is seen, and no target lies."""
        return self.slope * (self.transparency - share)

    def deviation(self, share: Floats, *, target: bool = False) -> Floats:
        """Standard deviation of the output by the seen share; a target covers the ground below it."""
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
        """Standard deviation over all places, s having this variance."""
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
    """Clutter from the integrals' means over all pairs of photos.

    Parameters
    ----------
    mean
        Mean of `aosplan.models.window_pairs.Pairs` over all ordered pairs of photos, and the row of
        the crowns.
    kernels
        Those of the integrals.
    transparency
        T.
    radiances
        What the clutter is made of.
    local
        Whether the detector subtracts the mean of the box; if not, that of the whole image.
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
    """√(λ_l λ_w λ_θ), each λ from how much a covariance falls over a small step."""
    steps = np.array([kernels.step_m, kernels.step_m, kernels.turn])
    drops = 2.0 * np.maximum(fields[0] - fields[1:], 1e-15) / steps**2
    return float(np.sqrt(np.prod(drops / max(variance, 1e-15))))


def independent_windows(level: float, roughness: float, area_m2: float = HECTARE_M2) -> float:
    """n_w: windows of an area that are as good as independent at a level of u standard deviations."""
    from scipy.special import erfcx

    level = max(level, 1.5)  # below, the Euler characteristic does not count peaks
    # exp(-u²/2)/Φ̄(u), without the exponentials.
    ratio = 2.0 / float(erfcx(level / math.sqrt(2.0)))
    peaks = area_m2 * math.pi * roughness * (level * level - 1.0) / (2.0 * math.pi) ** 2
    return max(PEAKS * peaks * ratio, 1.0)


def threshold(clutter: Clutter, seen: SeenShare, false_alarms: float) -> float:
    """u, the output above which there are so many false alarms a hectare.

    Parameters
    ----------
    clutter, seen
        Of one plan over one scene.
    false_alarms
        A hectare, above 0.
    """
    from scipy.special import ndtr

    deviation = clutter.total_deviation(seen.variance)
    mean, spread = clutter.mean(seen.nodes), clutter.deviation(seen.nodes)

    def surplus(level: float) -> float:
        wanted = false_alarms / independent_windows(level, clutter.roughness)
        passed = float(seen.weights @ ndtr((mean - level * deviation) / spread))
        return passed - wanted

    low, high = 0.0, 8.0
    while surplus(high) > 0.0 and high < 1e3:
        high *= 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if surplus(middle) > 0.0 else (low, middle)
    return 0.5 * (low + high) * deviation
