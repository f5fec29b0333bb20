"""The layered model: slices that block independently, each with its own kind of occluder.

Two samples see the same point through slice j with probability q_j² + D_j q_j τ_j, where
q_j = 1 - D_j and τ_j is the overlap of the slice's occluders between the two views: the
product of the triangles max(0, 1 - |Δ| H_j/(h o_j)) along both axes.  Slices being
independent, the covariance of two samples is

    Cov = Π (q_j² + D_j q_j τ_j) - Π q_j² = T² (exp Σ log(1 + τ_j D_j/q_j) - 1),

and the shortfall its mean over all ordered pairs of samples, over p T.  One slice gives back
Eq. 2.  A lattice needs each distinct offset once; slices without occluders and offsets that
no slice reaches are skipped.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.models import Prediction
from aosplan.models.sites import offset_counts
from aosplan.pattern import Pattern, Sites
from aosplan.spiral import Spiral

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from aosplan.scene import Layer

TERMS_AT_ONCE = 1_000_000
"""Offsets times slices evaluated at a time."""


class LayeredModel:
    """Independent slices seen from one altitude.

    Parameters
    ----------
    layers
        Slices with heights above the focal plane, each placed at its middle height.
    altitude_m
        Above the focal plane and above every slice.
    focal_length_px
        Where given, occluders count as at least one pixel large.
    """

    name = "layered"
    rule_baseline_m = None
    widest_aperture_m = math.inf
    rises_with_baseline = True

    def __init__(
        self, layers: Sequence[Layer], altitude_m: float, focal_length_px: float | None = None
    ) -> None:
        filled = [layer for layer in layers if layer.density > 0.0]
        density = np.array([layer.density for layer in filled])
        height = np.array([layer.height_m for layer in filled])
        size = np.array([layer.occluder_size_m for layer in filled])
        if focal_length_px is not None:
            size = np.maximum(size, (altitude_m - height) / focal_length_px)
        with np.errstate(divide="ignore"):
            self._log_transparency = float(np.log1p(-density).sum())
            self._filled = density
            self._odds = density / (1.0 - density)
            self._reach_m = size * altitude_m / height

    @property
    def density(self) -> float:
        """p of independent slices, 1 - Π q_j."""
        return -math.expm1(self._log_transparency)

    @property
    def transparency(self) -> float:
        """Π q_j."""
        if -self._log_transparency < len(self._filled):
            return math.exp(self._log_transparency)
        # A logarithm of some size loses more digits than so many factors; q + lost is 1 - D, exactly.
        q = 1.0 - self._filled
        lost = (1.0 - q) - self._filled
        return float(q.prod()) * math.exp(float((lost / q).sum()))

    @property
    def independent_baseline_m(self) -> float:
        """Baseline at which even the lowest slice's occluders have d̂ = 1."""
        return float(self._reach_m.max(initial=0.0))

    def predict(self, pattern: Sites, baseline_m: float) -> Prediction:
        """Density and shortfall of a pattern flown at a baseline."""
        reach = self.independent_baseline_m
        if isinstance(pattern, Spiral):
            apart = baseline_m * pattern.nearest >= reach * (1.0 - 1e-15)
            shortfall = (
                1.0 / pattern.samples
                if apart
                else self.positions_shortfall(baseline_m * np.array(list(pattern.offsets())))
            )
            return Prediction(self.density, self.transparency, shortfall)
        baseline_m = min(baseline_m, 1e300)  # infinity times no offset would be nan
        reach_x = _reach(pattern.columns, baseline_m, reach)
        reach_y = _reach(pattern.rows, baseline_m * pattern.row_pitch, reach)
        offsets_x = baseline_m * np.arange(reach_x + 1)
        offsets_y = baseline_m * pattern.row_pitch * np.arange(reach_y + 1)
        pairs = _quadrant_counts(pattern, reach_y, reach_x)
        covariance = self._covariance(offsets_x, offsets_y)
        shortfall = float((pairs * covariance).sum()) / pattern.samples**2
        return Prediction(self.density, self.transparency, shortfall)

    def positions_shortfall(self, positions: ArrayLike) -> float:
        """Shortfall 1 - V̂ of samples at any positions, shape (N, 2), metres; costs N²."""
        points = np.asarray(positions, dtype=np.float64)
        count, reach = len(points), self.independent_baseline_m
        block = max(1, TERMS_AT_ONCE // count)
        pairs = 0.0
        for start in range(0, count, block):
            x, y = np.abs(points[start:, None] - points[None, start : start + block]).T
            near = np.triu((x < reach) & (y < reach), 1)  # each pair once, the later site second
            pairs += float(self._pair_covariance(x[near], y[near]).sum())
        return (count + 2.0 * pairs) / count**2

    def _covariance(self, offsets_x: NDArray[Any], offsets_y: NDArray[Any]) -> NDArray[np.float64]:
        """Cov/(p T) at every crossing of the offsets, shape (y, x)."""
        y, x = np.meshgrid(offsets_y, offsets_x, indexing="ij")
        return self._pair_covariance(x.ravel(), y.ravel()).reshape(y.shape)

    def _pair_covariance(
        self, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Cov/(p T) of pairs (x, y) apart.

        (T/p) (exp Σ log(1 + τ_j D_j/q_j) - 1), or where most is hidden, and this would multiply the
        roundings of large logarithms, the same as (exp Σ log(1 - D_j (1 - τ_j)) - T)/p.
        """
        result = np.empty(len(x))
        block = max(1, TERMS_AT_ONCE // max(len(self._odds), 1))
        p, t = self.density, self.transparency
        scale = t / p if p > 0.0 else 0.0
        for start in range(0, len(x), block):
            part = slice(start, start + block)
            tau = np.maximum(1.0 - x[part, None] / self._reach_m, 0.0)
            tau *= np.maximum(1.0 - y[part, None] / self._reach_m, 0.0)
            if p > 0.5:
                clear = np.exp(np.log1p((tau - 1.0) * self._filled).sum(axis=1))
                result[part] = np.maximum(clear - t, 0.0) / p
            else:
                result[part] = scale * np.expm1(np.log1p(tau * self._odds).sum(axis=1))
        return result


def layered_visibility(
    layers: Iterable[Layer | Mapping[str, float] | Sequence[float]],
    altitude: float,
    rows: int,
    columns: int,
    baseline: float,
) -> float:
    """Visibility V of a rows x columns grid over independent slices.

    Parameters
    ----------
    layers
        `Layer` values, or mappings with its names, or its four numbers in order: bottom and
        top above the focal plane [m], share of the slice that blocks, occluder size [m].
    altitude
        h above the focal plane [m], above every layer.
    rows, columns
        Whole numbers from 1.
    baseline
        b between neighbours on both axes [m].

    Returns
    -------
    float
        V; ``nan`` where an argument is outside its domain.
    """
    prediction = _prediction(layers, altitude, rows, columns, baseline)
    return math.nan if prediction is None else prediction.expected


def layered_shortfall(
    layers: Iterable[Layer | Mapping[str, float] | Sequence[float]],
    altitude: float,
    rows: int,
    columns: int,
    baseline: float,
) -> float:
    """Shortfall 1 - V̂ of a rows x columns grid over independent slices.

    Parameters and domain as in `layered_visibility`.
    """
    prediction = _prediction(layers, altitude, rows, columns, baseline)
    return math.nan if prediction is None else prediction.shortfall


def _prediction(
    layers: Iterable[Any], altitude: float, rows: int, columns: int, baseline: float
) -> Prediction | None:
    """The prediction of a rectangle; None where an argument is outside its domain."""
    model = _model(layers, altitude)
    if model is None or not _counts(rows, columns) or not baseline >= 0.0:
        return None
    return model.predict(Pattern(int(rows), int(columns)), baseline)


def _model(layers: Iterable[Any], altitude: float) -> LayeredModel | None:
    from aosplan.scene import Layer

    slices = [Layer(**layer) if isinstance(layer, Mapping) else Layer(*layer) for layer in layers]
    inside = all(
        0.0 <= layer.density < 1.0
        and layer.occluder_size_m > 0.0
        and 0.0 <= layer.height_m < altitude < math.inf
        for layer in slices
    )
    return LayeredModel(slices, altitude) if inside and slices else None


def _counts(*counts: float) -> bool:
    return all(1 <= count < math.inf and count == int(count) for count in counts)


def _reach(count: int, pitch_m: float, reach_m: float) -> int:
    """Largest offset, in pitches, that shares an occluder."""
    if pitch_m * (count - 1) < reach_m:
        return count - 1
    return max(math.ceil(reach_m / pitch_m) - 1, 0) if pitch_m > 0.0 else count - 1


def _quadrant_counts(pattern: Pattern, reach_y: int, reach_x: int) -> NDArray[np.float64]:
    """Ordered pairs of sites by offset, those of mirrored offsets added up: shape (y, x).

    The covariance is the same in all four quadrants.
    """
    if pattern.removed:
        mask = np.ones((pattern.rows, pattern.columns), dtype=bool)
        mask[tuple(np.transpose(pattern.removed))] = False
        full = offset_counts(mask, reach_y, reach_x)
        rows = full[reach_y:] + np.vstack([np.zeros_like(full[:1]), full[:reach_y][::-1]])
        left = np.hstack([np.zeros_like(rows[:, :1]), rows[:, :reach_x][:, ::-1]])
        quadrant: NDArray[np.float64] = rows[:, reach_x:] + left
        return quadrant
    along_y = pattern.rows - np.arange(reach_y + 1.0)
    along_x = pattern.columns - np.arange(reach_x + 1.0)
    along_y[1:] *= 2.0
    along_x[1:] *= 2.0
    return np.outer(along_y, along_x)
