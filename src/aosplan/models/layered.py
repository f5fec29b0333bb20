"""The layered model: independent slices, each with its own kind of occluder.

Two samples see the same point through slice j with probability q_j² + D_j q_j τ_j.  Here D_j is the
density of slice j, and q_j = 1 - D_j. τ_j is the overlap of the slice's occluders between the two
views.  It is the product of the triangles max(0, 1 - |Δ| H_j/(h o_j)) along both axes, where Δ is
the offset of the samples.  Because slices are independent, the covariance of two samples is

    Cov = Π (q_j² + D_j q_j τ_j) - Π q_j² = T² (exp Σ log(1 + τ_j D_j/q_j) - 1).

The shortfall is the mean of Cov over all ordered pairs of samples, divided by p T.  For a single
slice this is Eq. 2.  In a lattice, each distinct offset is computed once.  Empty slices and offsets
beyond the reach of all slices are skipped.

Slanted rays (`aosplan.models.oblique_rays`) pass slice j with probability q_j^e instead of q_j,
where e is their relative length.  Position noise (`aosplan.models.layered_noise`) replaces Cov by
its expected value over the noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.grid.pair_offsets import quadrant_counts
from aosplan.grid.patterns import AnyPattern, Pattern
from aosplan.models.layered_pairs import RayPairs, Slices
from aosplan.models.memo import remembered
from aosplan.models.model import Prediction
from aosplan.models.position_noise import NEGLIGIBLE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from aosplan.models.layered_slanted import SlantedRays
    from aosplan.models.memo import Known
    from aosplan.scenes.scene import Layer

    Floats = NDArray[np.float64]


GROUPS = 64
"""Number of groups of offsets along an axis, for the lower bound of the shortfall."""

OFFSETS_AT_ONCE = 1_000_000
"""Number of offsets between known positions that are evaluated together."""

COUNTS_KEPT = 1 << 14
"""Largest number of offsets for which the counts of pairs of a pattern are stored."""


class LayeredModel:
    """Independent slices seen from one altitude.

    Parameters
    ----------
    layers
        Slices with heights above the focal plane.  The occluders of a slice are at its middle
        height.
    altitude_m
        Altitude above the focal plane.  It has to be above every slice.
    focal_length_px
        If given, occluders are treated as at least one pixel large.
    hold_error_m
        Standard deviation, per axis, of the positions around their sites.
    rays
        ``nadir``, ``oblique`` or ``cubes`` (`aosplan.models.oblique_rays`).
    """

    name = "layered"
    heading_deg = None
    rule_baseline_m = None
    widest_aperture_m = math.inf

    def __init__(
        self,
        layers: Sequence[Layer],
        altitude_m: float,
        focal_length_px: float | None = None,
        *,
        hold_error_m: float = 0.0,
        rays: str = "nadir",
    ) -> None:
        self.altitude_m = altitude_m
        self.hold_error_m = hold_error_m
        self.rays = rays
        self._slices = Slices(layers, altitude_m, focal_length_px)
        self._pairs = self._pairs_within(hold_error_m)
        self._predictions: Known = {}

    def _pairs_within(self, hold_error_m: float) -> RayPairs:
        """Pairs of nadir rays for sample positions with a standard deviation of `hold_error_m`
        around their sites.
        """
        deviation_m = math.sqrt(2.0) * hold_error_m
        return RayPairs(self._slices.covariance, self._slices.reach_m, deviation_m)

    def _slanted(self, hold_error_m: float) -> SlantedRays:
        from aosplan.models.layered_slanted import SlantedRays

        deviation_m = math.sqrt(2.0) * hold_error_m
        return SlantedRays(self._slices, self.altitude_m, self.rays, deviation_m)

    @cached_property
    def _noisy_slanted(self) -> SlantedRays:
        return self._slanted(self.hold_error_m)

    @property
    def density(self) -> float:
        """Density p = 1 - Π q_j of independent slices."""
        return self._slices.hidden

    @property
    def transparency(self) -> float:
        """Transparency Π q_j of independent slices."""
        return self._slices.transparency

    @property
    def independent_baseline_m(self) -> float:
        """Smallest baseline at which K = 1/N. With position noise, K = 1/N is true within rounding
        errors.
        """
        return self._reach_within(self.hold_error_m)

    def _reach_within(self, hold_error_m: float) -> float:
        lowest = self.sharp_baseline_m
        return lowest + NEGLIGIBLE * math.sqrt(2.0) * hold_error_m if lowest else 0.0

    @property
    def sharp_baseline_m(self) -> float:
        """Baseline at which even the occluders of the lowest slice have d̂ = 1."""
        return float(self._slices.reach_m.max(initial=0.0))

    @property
    def rises_with_baseline(self) -> bool:
        """Whether the visibility never decreases with the baseline. This is true for nadir rays;
        `aosplan.models.uniform` gives the reason.
        """
        return self.rays == "nadir"

    @remembered
    def predict(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """Density and shortfall of a pattern flown at a baseline."""
        reach = self.independent_baseline_m
        if not isinstance(pattern, Pattern):
            apart = baseline_m * pattern.nearest >= reach * (1.0 - 1e-15)
            if apart and self.rays == "nadir":
                return Prediction(self.density, self.transparency, 1.0 / pattern.samples)
            points = baseline_m * np.array(list(pattern.offsets()))
            return self._predict_at(points, self.hold_error_m)
        # The product of infinity and an offset of 0 would be nan.
        baseline_m = min(baseline_m, 1e300)
        reach_x = _reach(pattern.columns, baseline_m, reach)
        reach_y = _reach(pattern.rows, baseline_m * pattern.row_pitch, reach)
        offsets_x: Floats = baseline_m * np.arange(reach_x + 1.0)
        offsets_y: Floats = baseline_m * pattern.row_pitch * np.arange(reach_y + 1.0)
        if self.rays != "nadir":
            return self._noisy_slanted.predict(pattern, baseline_m, offsets_x, offsets_y)
        few = (reach_y + 1) * (reach_x + 1) <= COUNTS_KEPT
        pairs = (_kept_counts if few else quadrant_counts)(pattern, reach_y, reach_x)
        covariance = self._pairs.at_crossings(offsets_x, offsets_y)
        shortfall = float((pairs * covariance).sum()) / pattern.samples**2
        return Prediction(self.density, self.transparency, shortfall)

    def at_best(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """A fast upper bound of the visibility with nadir rays. The computing time does not depend
        on N.

        Offsets are grouped, and each group is evaluated at its largest offset. The covariance of a
        pair decreases with the offset, so the result is an upper bound of the visibility.
        """
        if not isinstance(pattern, Pattern) or pattern.removed or pattern.samples <= GROUPS**2:
            return self.predict(pattern, baseline_m)
        pitch_y, reach = baseline_m * pattern.row_pitch, self.independent_baseline_m
        far_x, weight_x = _groups(pattern.columns, _reach(pattern.columns, baseline_m, reach))
        far_y, weight_y = _groups(pattern.rows, _reach(pattern.rows, pitch_y, reach))
        shared = self._pairs.at_crossings(baseline_m * far_x, pitch_y * far_y)
        least = float(weight_y @ shared @ weight_x) / pattern.samples**2
        return Prediction(self.density, self.transparency, max(least, 1.0 / pattern.samples))

    def predict_positions(self, positions_m: ArrayLike) -> Prediction:
        """Density and shortfall of samples at known positions from the centre, shape (N, 2)."""
        return self._predict_at(np.asarray(positions_m, dtype=np.float64), hold_error_m=0.0)

    def _predict_at(self, points: Floats, hold_error_m: float) -> Prediction:
        if self.rays != "nadir":
            return self._slanted(hold_error_m).predict_at(points)
        pairs, reach = self._pairs_within(hold_error_m), self._reach_within(hold_error_m)
        return Prediction(self.density, self.transparency, _shortfall_at(points, pairs, reach))

    def positions_shortfall(self, sites_m: ArrayLike) -> float:
        """Shortfall 1 - V̂ of nadir samples flown at any sites, shape (N, 2).  The computing time
        increases as N².
        """
        points = np.asarray(sites_m, dtype=np.float64)
        return _shortfall_at(points, self._pairs, self.independent_baseline_m)

    def hidden_at(self, positions_m: ArrayLike) -> Floats:
        """p of samples at known positions, shape (N,). Its values differ, because a more slanted
        ray meets more occluders.
        """
        from aosplan.models.oblique_rays import hidden_shares

        log_transparency = self._slices.log_transparency
        return hidden_shares(positions_m, self.altitude_m, self.rays, log_transparency)

    def correlation(self, x_m: Floats, y_m: Floats) -> Floats:
        """Correlation Cov/(p T) of two nadir samples as a function of their offset along both
        axes.
        """
        return self._slices.covariance(np.abs(x_m), np.abs(y_m))


def _shortfall_at(points: Floats, pairs: RayPairs, reach_m: float) -> float:
    """Shortfall 1 - V̂ of nadir samples at exact positions [m], shape (N, 2).  The computing time
    increases as N².
    """
    count = len(points)
    block = max(1, OFFSETS_AT_ONCE // count)
    total = 0.0
    for start in range(0, count, block):
        x, y = np.abs(points[start:, None] - points[None, start : start + block]).T
        # Each pair is used once. The second site of a pair is the site that comes later.
        near = np.triu((x < reach_m) & (y < reach_m), 1)
        total += float(pairs.at(x[near], y[near]).sum())
    return (count + 2.0 * total) / count**2


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
        `Layer` values, mappings with the names of its fields, or sequences of its four numbers.
        These are bottom and top above the focal plane [m], share of the slice that blocks rays, and
        occluder size [m].
    altitude
        h above the focal plane [m], above every layer.
    rows, columns
        Whole numbers, at least 1.
    baseline
        b, distance between neighbours along both axes [m].

    Returns
    -------
    float
        Visibility V; ``nan`` if an argument is outside its domain.
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

    The parameters and their domain are those of `layered_visibility`.
    """
    prediction = _prediction(layers, altitude, rows, columns, baseline)
    return math.nan if prediction is None else prediction.shortfall


def _prediction(
    layers: Iterable[Any], altitude: float, rows: int, columns: int, baseline: float
) -> Prediction | None:
    """The prediction for a rectangle; None if an argument is outside its domain."""
    model = _model(layers, altitude)
    if model is None or not _counts(rows, columns) or not baseline >= 0.0:
        return None
    return model.predict(Pattern(int(rows), int(columns)), baseline)


def _model(layers: Iterable[Any], altitude: float) -> LayeredModel | None:
    from aosplan.scenes.scene import Layer

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
    """Largest offset, in pitches, at which two samples share an occluder."""
    if pitch_m * (count - 1) < reach_m:
        return count - 1
    return max(math.ceil(reach_m / pitch_m) - 1, 0) if pitch_m > 0.0 else count - 1


def _groups(count: int, reach: int) -> tuple[Floats, Floats]:
    """Largest offset of each group of pairs along a line, and the number of ordered pairs in each
    group.
    """
    far = np.unique(np.linspace(0.0, reach, GROUPS).round())
    # For each distance: the number of ordered pairs whose distance is at most this large.
    up_to = count + far * (2.0 * count - far - 1.0)
    return far, np.diff(up_to, prepend=0.0)


_kept_counts = lru_cache(maxsize=256)(quadrant_counts)
"""`quadrant_counts` with stored results, for searches that test several baselines with the same
pattern.
"""
