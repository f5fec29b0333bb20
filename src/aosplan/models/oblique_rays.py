"""Slanted rays: the number of occluders that they meet, and the effect on a prediction.

The target is below the centre of the aperture.  The sample at (x, y) sees it along a ray with tan
θx = x/h and tan θy = y/h.  If a nadir ray passes a slice with probability q, the slanted ray passes
it with probability q^e.  Here e is the relative length of the ray.  It depends on the kind of rays:

- *oblique*: e = sec θ = √(1 + tan² θ), for occluders that look the same from all sides
  (Beer-Lambert);
- *cubes*: e = 1 + |tan θx| + |tan θy|, for cubes that are aligned with both axes and show their
  side faces, such as voxels.

The transparency T_i = Π q^e_i of sample i is the product over all slices.  It differs between
samples, and p̄ = 1 - mean T_i.  As in the measured model, V = 1 - mean J_ik and K = (mean J_ik -
p̄²)/(p̄ (1 - p̄)), where J_ik is the share of the target that neither sample i nor sample k sees.

**Assumption** for two rays of different lengths: in each slice, a share τ of the occluders on the
shorter ray is also on the longer ray. The rays have no other occluders in common. Both rays then
pass the slice with probability q^(e_i + e_k) (1 + τ (q^-min(e_i, e_k) - 1)). Equal rays have all
occluders in common (τ = 1), and distant rays have no occluder in common (τ = 0). For nadir rays the
formula becomes q²
+ D q τ, with D = 1 - q.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.models.model import Prediction

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from aosplan.grid.patterns import Pattern

    Floats = NDArray[np.float64]


def ray_lengths(x_m: Any, y_m: Any, altitude_m: float, kind: str) -> Any:
    """Relative length e of the rays to samples at (x, y) from the centre.  A nadir ray has e = 1.

    Parameters
    ----------
    x_m, y_m
        Coordinates along both axes of the pattern.
    altitude_m
        h, altitude above the focal plane.
    kind
        ``nadir``, ``oblique`` or ``cubes``.
    """
    tan_x, tan_y = np.abs(x_m) / altitude_m, np.abs(y_m) / altitude_m
    if kind == "cubes":
        return 1.0 + tan_x + tan_y
    slope = np.hypot(tan_x, tan_y)
    return np.sqrt(1.0 + slope * slope) if kind == "oblique" else np.ones_like(slope)


def hidden_shares(
    positions_m: ArrayLike, altitude_m: float, kind: str, log_transparency: float
) -> Floats:
    """Share p of the target that each sample does not see, shape (N,).

    `positions_m` has the shape (N, 2) and is relative to the centre.  The other parameters are
    those of `bundle`.
    """
    x, y = np.asarray(positions_m, dtype=np.float64).T
    hidden: Floats = -np.expm1(ray_lengths(x, y, altitude_m, kind) * log_transparency)
    return hidden


class RayBundle(NamedTuple):
    """The rays from a target to all sites of a pattern, on the pattern's lattice.

    `lengths` and `transparency` have the shape (rows, columns).  At lattice points without a site,
    the transparency is 0.
    """

    lengths: Floats
    transparency: Floats
    density: float
    samples: int

    @property
    def longest(self) -> float:
        """Length of the longest ray."""
        return float(self.lengths.max())

    def predict(
        self, reach: tuple[int, int], shared: Callable[[int, int, Floats], Any]
    ) -> Prediction:
        """Prediction from the covariances of pairs of rays.

        Parameters
        ----------
        reach
            Largest offsets in rows and columns at which rays share an occluder.
        shared
            ``shared(rows apart, columns apart, lengths)`` returns P(both clear)/(T_i T_k) - 1 for
            pairs of rays. P(both clear) is the probability that nothing blocks either ray.
            `lengths` has the length of the shorter ray of each pair.
        """
        t, e = self.transparency, self.lengths
        rows, columns = t.shape
        total = float((t * t * shared(0, 0, e)).sum())
        for dy in range(reach[0] + 1):
            for dx in range(-reach[1] if dy else 1, reach[1] + 1):
                here = np.s_[: rows - dy, max(0, -dx) : columns - max(0, dx)]
                there = np.s_[dy:, max(0, dx) : columns + min(0, dx)]
                both = t[here] * t[there]
                if both.any():
                    common = shared(dy, abs(dx), np.minimum(e[here], e[there]))
                    total += 2.0 * float((both * common).sum())
        clear = float(t.sum()) / self.samples
        spread = self.density * clear
        # If the target is completely visible or completely hidden, the views are treated as
        # independent.
        shortfall = total / (self.samples**2 * spread) if spread > 0.0 else 1.0 / self.samples
        return Prediction(self.density, clear, shortfall)


def predict_scattered(
    points_m: Floats,
    altitude_m: float,
    kind: str,
    log_transparency: float,
    shared: Callable[[Floats, Floats, Floats], Floats],
) -> Prediction:
    """Prediction for samples that are not on a lattice.  The computing time increases as N².

    Parameters
    ----------
    points_m
        Shape (N, 2), relative to the centre.
    altitude_m, kind, log_transparency
        As in `bundle`.
    shared
        ``shared(x, y, lengths)`` returns P(both clear)/(T_i T_k) - 1 for pairs of rays, as in
        `RayBundle.predict`. `x` and `y` are the distances along both axes, and `lengths` has the
        length of the shorter ray of each pair.
    """
    lengths = ray_lengths(points_m[:, 0], points_m[:, 1], altitude_m, kind)
    t = np.exp(lengths * log_transparency)
    later, earlier = np.tril_indices(len(t), -1)
    x, y = np.abs(points_m[later] - points_m[earlier]).T
    common = shared(x, y, np.minimum(lengths[later], lengths[earlier]))
    hidden = -np.expm1(lengths * log_transparency)
    total = float((t * hidden).sum()) + 2.0 * float((t[later] * t[earlier] * common).sum())
    p, clear, count = float(hidden.mean()), float(t.mean()), len(t)
    return Prediction(p, clear, total / (count**2 * p * clear) if p * clear > 0.0 else 1.0 / count)


def bundle(
    pattern: Pattern, baseline_m: float, altitude_m: float, kind: str, log_transparency: float
) -> RayBundle:
    """The rays of a pattern that is flown with a baseline.

    Parameters
    ----------
    pattern, baseline_m
        The pattern, and the distance between its columns.
    altitude_m, kind
        As in `ray_lengths`.
    log_transparency
        Logarithm of a nadir ray's transparency.
    """
    x = (np.arange(pattern.columns) - 0.5 * (pattern.columns - 1)) * baseline_m
    y = (np.arange(pattern.rows) - 0.5 * (pattern.rows - 1)) * (baseline_m * pattern.row_pitch)
    lengths = ray_lengths(x[np.newaxis, :], y[:, np.newaxis], altitude_m, kind)
    there = np.ones(lengths.shape)
    there[tuple(np.array(pattern.removed, dtype=np.intp).reshape(-1, 2).T)] = 0.0
    hidden = float((there * -np.expm1(lengths * log_transparency)).sum()) / pattern.samples
    return RayBundle(lengths, there * np.exp(lengths * log_transparency), hidden, pattern.samples)
