"""The layered model: slices that block independently, each with its own kind of occluder.

Two samples see the same point through slice j with probability q_j² + D_j q_j τ_j, where
q_j = 1 - D_j and τ_j is the overlap of the slice's occluders between the two views: the
product of the triangles max(0, 1 - |Δ| H_j/(h o_j)) along both axes.  Slices being
independent, the covariance of two samples is

    Cov = Π (q_j² + D_j q_j τ_j) - Π q_j² = T² (exp Σ log(1 + τ_j D_j/q_j) - 1),

and the shortfall its mean over all ordered pairs of samples, over p T.  One slice gives back
Eq. 2.  A lattice needs each distinct offset once; slices without occluders and offsets that
no slice reaches are skipped.

Rays off nadir (`aosplan.models.oblique_rays`) pass each slice with q_j^e instead, and noise of the positions
(`aosplan.models.layered_noise`) is an expectation of Cov over what it makes of the offset.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import copy
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.grid.pair_offsets import offset_counts
from aosplan.grid.patterns import Pattern, Sites
from aosplan.grid.spiral import Spiral
from aosplan.models.layered_noise import BlurredTable
from aosplan.models.memo import remembered
from aosplan.models.model import Prediction
from aosplan.models.position_noise import NEGLIGIBLE
from aosplan.numerics import triangle

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from aosplan.models.memo import Known
    from aosplan.scenes.scene import Layer

    Floats = NDArray[np.float64]

TERMS_AT_ONCE = 1_000_000
"""Offsets times slices evaluated at a time."""

PAIRS_AT_ONCE = 2000
"""Pairs of scattered samples blurred at a time."""

LENGTHS = 5
"""Lengths of oblique rays between which what they share is interpolated."""

GROUPS = 64
"""Groups of offsets along an axis that a bound on the shortfall is taken from."""

COUNTS_KEPT = 1 << 14
"""Offsets up to which the numbers of a pattern's pairs are kept."""

LARGEST_SLANT = 30.0
"""Logarithm of the share that a slanted ray loses to a nadir one, from which on it counts as lost."""

LARGEST_LOG = 700.0
"""Logarithm beyond which an exponential would be infinite; what it multiplies there is 0."""


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
    hold_error_m
        Standard deviation of the positions about their sites, per axis.
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
        self._tables: dict[float, BlurredTable] = {}
        self._predictions: Known = {}
        filled = [layer for layer in layers if layer.density > 0.0]
        density = np.array([layer.density for layer in filled])
        height = np.array([layer.height_m for layer in filled])
        size = np.array([layer.occluder_size_m for layer in filled])
        if focal_length_px is not None:
            size = np.maximum(size, (altitude_m - height) / focal_length_px)
        with np.errstate(divide="ignore"):
            self._filled = density
            self._odds = density / (1.0 - density)
            self._log_q = np.log1p(-density)
            self._log_transparency = float(self._log_q.sum())
            self._reach_m = size * altitude_m / height

    def at_heading(self, heading_deg: float) -> LayeredModel:  # noqa: ARG002 (the interface has it)
        """The model itself: slices are the same from every direction."""
        return self

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
        """Baseline from which K = 1/N; under noise, but for less than rounding."""
        lowest = self.sharp_baseline_m
        return lowest + NEGLIGIBLE * self._deviation_m if lowest else 0.0

    @property
    def sharp_baseline_m(self) -> float:
        """Baseline at which even the lowest slice's occluders have d̂ = 1."""
        return float(self._reach_m.max(initial=0.0))

    @property
    def rises_with_baseline(self) -> bool:
        """Not where rays may be oblique; see `aosplan.models.uniform`."""
        return self.rays == "nadir"

    @remembered
    def predict(self, pattern: Sites, baseline_m: float) -> Prediction:
        """Density and shortfall of a pattern flown at a baseline."""
        reach = self.independent_baseline_m
        if isinstance(pattern, Spiral):
            return self._predict_scattered(pattern, baseline_m)
        baseline_m = min(baseline_m, 1e300)  # infinity times no offset would be nan
        reach_x = _reach(pattern.columns, baseline_m, reach)
        reach_y = _reach(pattern.rows, baseline_m * pattern.row_pitch, reach)
        offsets_x: Floats = baseline_m * np.arange(reach_x + 1.0)
        offsets_y: Floats = baseline_m * pattern.row_pitch * np.arange(reach_y + 1.0)
        if self.rays != "nadir":
            return self._predict_oblique(pattern, baseline_m, offsets_x, offsets_y)
        few = (reach_y + 1) * (reach_x + 1) <= COUNTS_KEPT
        pairs = (_kept_counts if few else _quadrant_counts)(pattern, reach_y, reach_x)
        covariance = self._at_crossings(self._pair_covariance, 0.0, offsets_x, offsets_y)
        shortfall = float((pairs * covariance).sum()) / pattern.samples**2
        return Prediction(self.density, self.transparency, shortfall)

    def at_best(self, pattern: Sites, baseline_m: float) -> Prediction:
        """A prediction that is no worse than that of nadir rays, in a time that N does not change.

        What a pair shares falls with its distance, so offsets are taken in groups, and each group
        as if all of it lay where it is farthest.
        """
        if isinstance(pattern, Spiral) or pattern.removed or pattern.samples <= GROUPS**2:
            return self.predict(pattern, baseline_m)
        pitch_y, reach = baseline_m * pattern.row_pitch, self.independent_baseline_m
        far_x, weight_x = _groups(pattern.columns, _reach(pattern.columns, baseline_m, reach))
        far_y, weight_y = _groups(pattern.rows, _reach(pattern.rows, pitch_y, reach))
        shared = self._at_crossings(self._pair_covariance, 0.0, baseline_m * far_x, pitch_y * far_y)
        least = float(weight_y @ shared @ weight_x) / pattern.samples**2
        return Prediction(self.density, self.transparency, max(least, 1.0 / pattern.samples))

    def _predict_oblique(
        self, pattern: Pattern, baseline_m: float, offsets_x: Floats, offsets_y: Floats
    ) -> Prediction:
        from aosplan.models.oblique_rays import bundle

        rays = bundle(pattern, baseline_m, self.altitude_m, self.rays, self._log_transparency)
        lengths, along = self._lengths(rays.longest)
        logs = [
            np.log1p(
                self._at_crossings(partial(self._pair_shared, length), length, offsets_x, offsets_y)
            )
            for length in lengths.tolist()
        ]

        def shared(dy: int, dx: int, lengths: Floats) -> Floats:
            return along(np.array([log[dy, dx] for log in logs]), lengths)

        return rays.predict((len(offsets_y) - 1, len(offsets_x) - 1), shared)

    def _shared_pairs(self, x: Floats, y: Floats, shorter: Floats) -> Floats:
        """Expected P(both clear)/(T_i T_k) - 1 of pairs (x, y) apart, by their shorter rays."""
        lengths, along = self._lengths(float(shorter.max(initial=1.0)))
        logs = [
            np.log1p(self._expected(partial(self._pair_shared, length), length, x, y))
            for length in lengths.tolist()
        ]
        return along(np.array(logs), shorter)

    def _lengths(self, longest: float) -> tuple[Floats, Callable[[Floats, Floats], Floats]]:
        """Lengths of rays to know about, and how to go from them to others.

        The function takes logarithms at these lengths, shape (lengths, ...), and lengths.
        """
        # What is shared grows nearly as exp(e): its logarithm is interpolated along e.
        # Steps of the interval's width let tables of noise serve many apertures; and of rays much
        # longer than the shortest nothing is left that could matter.
        longest = min(longest, 1.0 - LARGEST_SLANT / min(self._log_transparency, -1e-9))
        half = 0.05 * 2.0 ** max(math.ceil(math.log2((longest - 1.0) / 0.1 + 1e-300)), 0)
        places = np.cos(np.pi * (np.arange(LENGTHS) + 0.5) / LENGTHS)
        lengths = 1.0 + half * (1.0 + places)

        def along(logs: Floats, at: Floats) -> Floats:
            series = np.polynomial.chebyshev.chebfit(places, logs, LENGTHS - 1)
            place: Floats = np.minimum((at - 1.0) / half - 1.0, 1.0)
            log = np.polynomial.chebyshev.chebval(place, series, tensor=False)
            common: Floats = np.expm1(np.minimum(log, LARGEST_LOG))
            return common

        return lengths, along

    def _predict_scattered(self, spiral: Spiral, baseline_m: float) -> Prediction:
        points = baseline_m * np.array(list(spiral.offsets()))
        if self.rays != "nadir":
            return self._predict_oblique_at(points)
        apart = baseline_m * spiral.nearest >= self.independent_baseline_m * (1.0 - 1e-15)
        shortfall = 1.0 / spiral.samples if apart else self.positions_shortfall(points)
        return Prediction(self.density, self.transparency, shortfall)

    def _predict_oblique_at(self, points: Floats) -> Prediction:
        from aosplan.models.oblique_rays import predict_scattered

        return predict_scattered(
            points, self.altitude_m, self.rays, self._log_transparency, self._shared_pairs
        )

    def predict_positions(self, positions_m: ArrayLike) -> Prediction:
        """Density and shortfall of samples at known positions, shape (N, 2), from the middle."""
        if self.hold_error_m > 0.0:
            sharp = copy(self)
            sharp.hold_error_m = 0.0
            return sharp.predict_positions(positions_m)
        points = np.asarray(positions_m, dtype=np.float64)
        if self.rays != "nadir":
            return self._predict_oblique_at(points)
        return Prediction(self.density, self.transparency, self.positions_shortfall(points))

    def hidden_at(self, positions_m: ArrayLike) -> Floats:
        """p of samples at known positions, shape (N,); rays off nadir pass more."""
        from aosplan.models.oblique_rays import hidden_shares

        return hidden_shares(positions_m, self.altitude_m, self.rays, self._log_transparency)

    def correlation(self, x_m: Floats, y_m: Floats) -> Floats:
        """Cov/(p T) of two nadir samples by their offset along either axis."""
        return self._pair_covariance(np.abs(x_m), np.abs(y_m))

    def positions_shortfall(self, positions: ArrayLike) -> float:
        """Shortfall 1 - V̂ of nadir samples at just these positions, shape (N, 2), metres; costs N²."""
        points = np.asarray(positions, dtype=np.float64)
        count, reach = len(points), self.independent_baseline_m
        block = max(1, TERMS_AT_ONCE // count)
        pairs = 0.0
        for start in range(0, count, block):
            x, y = np.abs(points[start:, None] - points[None, start : start + block]).T
            near = np.triu((x < reach) & (y < reach), 1)  # each pair once, the later site second
            pairs += float(self._expected(self._pair_covariance, 0.0, x[near], y[near]).sum())
        return (count + 2.0 * pairs) / count**2

    @property
    def _deviation_m(self) -> float:
        """Standard deviation of the distance of two samples along an axis."""
        return math.sqrt(2.0) * self.hold_error_m

    def _at_crossings(
        self,
        pairs: Callable[[Floats, Floats], Floats],
        key: float,
        offsets_x: Floats,
        offsets_y: Floats,
    ) -> Floats:
        """What pairs share at every crossing of the offsets, shape (y, x), expected under noise.

        `key` names the function of pairs, whose table of noise is kept.
        """
        if self.hold_error_m > 0.0 and self._filled.size:
            table = self._table(pairs, key)
            shared = table.blurred(offsets_x, offsets_y, self._deviation_m)
            # The first crossing is a sample and itself.
            shared[0, 0] = pairs(np.zeros(1), np.zeros(1))[0]
            return shared
        y, x = np.meshgrid(offsets_y, offsets_x, indexing="ij")
        return pairs(x.ravel(), y.ravel()).reshape(y.shape)

    def _table(self, pairs: Callable[[Floats, Floats], Floats], key: float) -> BlurredTable:
        if key not in self._tables:
            if len(self._tables) >= LENGTHS:  # a wider aperture has other lengths
                self._tables.clear()
            self._tables[key] = BlurredTable(pairs, self._reach_m)
        return self._tables[key]

    def _expected(
        self, pairs: Callable[[Floats, Floats], Floats], key: float, x: Floats, y: Floats
    ) -> Floats:
        """What pairs of different samples (x, y) apart share, expected under noise."""
        if self.hold_error_m == 0.0 or not self._filled.size:
            return pairs(x, y)
        table, deviation = self._table(pairs, key), self._deviation_m
        parts = range(0, len(x), PAIRS_AT_ONCE)
        blurred = [
            table.blurred_pairs(x[i : i + PAIRS_AT_ONCE], y[i : i + PAIRS_AT_ONCE], deviation)
            for i in parts
        ]
        return np.concatenate(blurred) if blurred else np.zeros(0)

    def _pair_covariance(self, x: Floats, y: Floats) -> Floats:
        """Cov/(p T) of pairs of nadir rays (x, y) apart.

        (T/p) (exp Σ log(1 + τ_j D_j/q_j) - 1), or where most is hidden, and this would multiply the
        roundings of large logarithms, the same as (exp Σ log(1 - D_j (1 - τ_j)) - T)/p.
        """
        p, t = self.density, self.transparency
        if p > 0.5:
            clear = np.exp(self._sums(lambda tau: np.log1p((tau - 1.0) * self._filled), x, y))
            covariance: Floats = np.maximum(clear - t, 0.0) / p
            return covariance
        scale = t / p if p > 0.0 else 0.0
        covariance = np.expm1(self._sums(lambda tau: np.log1p(tau * self._odds), x, y))
        return scale * covariance

    def _pair_shared(self, length: float, x: Floats, y: Floats) -> Floats:
        """Cov/T_e² = exp Σ log(1 + τ_j (q_j^-e - 1)) - 1 of pairs of rays of length e."""
        odds = np.expm1(np.minimum(-length * self._log_q, LARGEST_LOG))
        logs = self._sums(lambda tau: np.log1p(tau * odds), x, y)
        shared: Floats = np.expm1(np.minimum(logs, LARGEST_LOG))
        return shared

    def _sums(self, term: Callable[[Floats], Floats], x: Floats, y: Floats) -> Floats:
        """Sums over the slices of a function of τ_j, for pairs (x, y) apart."""
        result = np.empty(len(x))
        block = max(1, TERMS_AT_ONCE // max(len(self._filled), 1))
        for start in range(0, len(x), block):
            part = slice(start, start + block)
            tau = triangle(x[part, None] / self._reach_m, np)
            tau *= triangle(y[part, None] / self._reach_m, np)
            result[part] = term(tau).sum(axis=1)
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
    """Largest offset, in pitches, that shares an occluder."""
    if pitch_m * (count - 1) < reach_m:
        return count - 1
    return max(math.ceil(reach_m / pitch_m) - 1, 0) if pitch_m > 0.0 else count - 1


def _groups(count: int, reach: int) -> tuple[Floats, Floats]:
    """Farthest offsets of groups of pairs along a line, and their numbers of ordered pairs."""
    far = np.unique(np.linspace(0.0, reach, GROUPS).round())
    up_to = count + far * (2.0 * count - far - 1.0)  # ordered pairs no farther apart
    return far, np.diff(up_to, prepend=0.0)


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


_kept_counts = lru_cache(maxsize=256)(_quadrant_counts)
"""The same, kept for searches that ask at one baseline after another."""
