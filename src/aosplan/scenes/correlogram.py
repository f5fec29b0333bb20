"""The correlogram: a stand in a table of a few hundred numbers, to search with.

Exact predictions (`aosplan.models.measured`) need each view of each candidate.  A search can do
with ρ(Δ), the correlation of what two views hide whose cameras are Δ apart, and with p(c), the
share that a view from offset c hides:

    p̄ = mean of p(c) over the sites,   K ≈ mean of ρ(Δ) over all ordered pairs of sites.

Both are tables over direction and lag = distance/altitude, telecentric, and good for any
altitude.  p has to be the mean at the actual sites: it rises with the offset.

**Lags** grow by √2, and directions lie 22.5° apart, finer than a stand asks for.  The pairs
behind one entry then all are pairs of views on one polar lattice, and 273 views give the table.

**Pairs.**  Two views Δ apart are less alike the farther off nadir they are, so an entry is a mean
over where in a square aperture such a pair may lie: symmetric about the middle, a half of Δ off
to either side across, and, with half the weight since there is less room, along Δ.

For grids as wide as they are long, within the plot's reach, b/h = 0.01 … 0.1 and N = 4 … 100,
V̂ is within 0.016 of the exact one (two clouds and nineteen generated stands), or 0.045 where
all that is left to see hangs on a few gaps (p above 0.98).  Lanes and lines, whose pairs lie
differently, are off by up to 0.02, in sparse stands of a few trees by up to 0.06.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.cubics import monotone_cubics
from aosplan.grid.spiral import Spiral
from aosplan.models.memo import remembered
from aosplan.models.model import Prediction
from aosplan.models.positions import offset_counts
from aosplan.scenes.occlusion import (
    Occlusion,
    popcount,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from aosplan.grid.patterns import (
        Pattern,
        Sites,
    )
    from aosplan.models.memo import Known
    from aosplan.scenes.occlusion import Words
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

LAGS = 15
SMALLEST_LAG = 0.01
DIRECTIONS = 8
"""Over the half circle; a multiple of 4, for those at 45° and 90° to each to be among them."""
NOISE_POINTS = 4
"""Points of the rule along an axis that blurs a table."""


@dataclass(frozen=True, eq=False)
class Correlogram:
    """How alike views are, and how much each hides, by direction and lag.

    Parameters
    ----------
    lags
        Shape (L,), rising: distance between two cameras, or offset of one from its target, over
        the altitude above the focal plane.
    directions_deg
        Shape (D,), clockwise from north, evenly from 0 to below 180; the opposite direction is
        the same.
    rho
        Shape (D, L): correlation of what two views hide.
    density_by_offset
        Shape (D, L): share that a view from an offset hides, mean of both opposite offsets.
    density
        Share that the nadir view hides.
    reach
        Largest lag of which the plot can tell something: there the rays of two views are half a
        plot apart at the canopy's top.
    """

    lags: Floats
    directions_deg: Floats
    rho: Floats
    density_by_offset: Floats
    density: float
    reach: float

    def to_document(self) -> dict[str, Any]:
        """The correlogram as plain values; the densities stand beside it, not in it."""
        return {
            "lags": self.lags.tolist(),
            "directions_deg": self.directions_deg.tolist(),
            "rho": self.rho.tolist(),
            "reach": self.reach,
        }

    def correlation_at(self, lag: Floats, direction_deg: Floats) -> Floats:
        """ρ of pairs; beyond the last lag, that of the last."""
        return self._at(self._rho_by_lag, lag, direction_deg)

    def density_at(self, lag: Floats, direction_deg: Floats) -> Floats:
        """p of views from offsets; beyond the last lag, that of the last."""
        return self._at(self._density_by_lag, lag, direction_deg)

    @cached_property
    def _knots(self) -> Floats:
        return self._stretched(np.append(0.0, self.lags))

    @cached_property
    def _rho_by_lag(self) -> Floats:
        return self._along_lags(1.0, self.rho)

    @cached_property
    def _density_by_lag(self) -> Floats:
        return self._along_lags(self.density, self.density_by_offset)

    def _along_lags(self, centre: float, table: Floats) -> Floats:
        """Monotone cubics through the middle and the rows of a table: shape (4, L, D)."""
        rows = np.column_stack([np.full(len(table), centre), table])
        return monotone_cubics(self._knots, rows.T)

    def _stretched(self, lag: Floats) -> Floats:
        """Lags on a scale on which the table is smooth: as they are near 0, then logarithmic."""
        stretched: Floats = np.log1p(np.minimum(lag, self.lags[-1]) / self.lags[0])
        return stretched

    def _at(self, cubics: Floats, lag: Floats, direction_deg: Floats) -> Floats:
        stretched = self._stretched(lag)
        piece = np.searchsorted(self._knots[1:-1], stretched, side="right")
        beyond = stretched - self._knots[piece]
        count = len(self.directions_deg)
        place = np.mod(direction_deg, 180.0) * (count / 180.0)
        below = place.astype(np.intp)
        lower, upper = (
            ((third * beyond + second) * beyond + first) * beyond + start
            for third, second, first, start in (
                cubics[:, piece, direction % count] for direction in (below, below + 1)
            )
        )
        between: Floats = lower + (place - below) * (upper - lower)
        return between


def correlogram(
    volume: VoxelVolume, *, targets_per_voxel: int = 4, focal_height_m: float = 0.0
) -> Correlogram:
    """Measure the correlogram of a volume, telecentric, the plot wrapped.

    Parameters
    ----------
    volume
        What stands on the plot.
    targets_per_voxel, focal_height_m
        As in `aosplan.scenes.occlusion.Occlusion`.
    """
    top_m = max(volume.canopy_top_m - focal_height_m, 0.0)
    altitude_m = 2.0 * top_m + 1.0  # any altitude shows the same at the same lags
    occlusion = Occlusion(
        volume, altitude_m, targets_per_voxel=targets_per_voxel, focal_height_m=focal_height_m
    )
    # All directions, and two lags below the table's: half of a lag, and half of it times √2.
    lags: Floats = SMALLEST_LAG * np.exp2(0.5 * np.arange(-2, LAGS))
    turns = np.arange(2 * DIRECTIONS) * (math.pi / DIRECTIONS)
    unit = np.column_stack([np.sin(turns), np.cos(turns)])
    offsets_m = altitude_m * unit[:, np.newaxis] * lags[:, np.newaxis]
    masks = occlusion.masks(np.vstack([[(0.0, 0.0)], offsets_m.reshape(-1, 2)]))
    nadir, masks = masks[:1], masks[1:].reshape(len(turns), len(lags), -1)
    density = popcount(masks[:, 2:]) / occlusion.targets

    def views(turn: int, steps: int) -> Words:
        """Views in a direction, at so many lags below each of the table's."""
        return masks[turn % len(turns), 2 - steps : len(lags) - steps]

    rho = np.empty((DIRECTIONS, LAGS))
    for ahead in range(DIRECTIONS):
        behind, diagonal = ahead + DIRECTIONS, DIRECTIONS // 4
        about = (
            (views(behind, 2), views(ahead, 2)),
            # With the middle half of Δ off to a side, either view is Δ/√2 off, at 45°.
            (views(behind + diagonal, 1), views(ahead - diagonal, 1)),
            (views(behind - diagonal, 1), views(ahead + diagonal, 1)),
        )
        along = (nadir, views(ahead, 0)), (nadir, views(behind, 0))
        weighted = [(2.0, pair) for pair in about] + [(1.0, pair) for pair in along]
        rho[ahead] = sum(
            weight * _correlation(*pair, occlusion.targets) for weight, pair in weighted
        )
    return Correlogram(
        lags=lags[2:],
        directions_deg=np.degrees(turns[:DIRECTIONS]),
        rho=rho / 8.0,
        density_by_offset=0.5 * (density[:DIRECTIONS] + density[DIRECTIONS:]),
        density=float(popcount(nadir)[0]) / occlusion.targets,
        reach=float(min(0.5 * min(volume.size_m) / top_m if top_m else np.inf, lags[-1])),
    )


@lru_cache(maxsize=1024)
def _lattice(pattern: Pattern) -> tuple[Floats, Floats, Floats]:
    """Sites of a pattern, and offsets between them with their numbers of pairs, in pitches.

    An offset and its opposite are alike: one half of them does, the middle counting half.
    """
    mask = np.ones((pattern.rows, pattern.columns), dtype=np.bool_)
    mask[tuple(np.array(pattern.removed, dtype=np.intp).reshape(-1, 2).T)] = False
    last = np.array([pattern.rows - 1, pattern.columns - 1])
    pairs = offset_counts(mask, *last.tolist())
    pairs[last[0] + 1 :] = pairs[last[0], last[1] + 1 :] = 0.0
    pairs[tuple(last)] *= 0.5
    return np.argwhere(mask) - 0.5 * last, np.argwhere(pairs) - last, pairs[pairs > 0.0]


def _correlation(one: Words, other: Words, targets: int) -> Floats:
    """Correlation of what views hide, pair by pair."""
    p, q = popcount(one) / targets, popcount(other) / targets
    covariance = popcount(one & other) / targets - p * q
    spread = np.sqrt(p * (1.0 - p) * q * (1.0 - q))
    # A view that hides all or nothing is like no other.
    return np.divide(covariance, spread, where=spread > 0.0, out=np.zeros_like(covariance))


class CorrelogramModel:
    """What a correlogram says of views from one altitude.

    Parameters
    ----------
    correlogram
        Of the stand.
    altitude_m
        Above the focal plane.
    heading_deg
        Of the patterns, clockwise from the correlogram's north.
    hold_error_m
        Standard deviation of the positions about their sites, per axis: p and ρ are means over
        what it makes of the offsets.
    """

    name = "correlogram"
    rule_baseline_m = None
    rises_with_baseline = False

    def __init__(
        self,
        correlogram: Correlogram,
        altitude_m: float,
        *,
        heading_deg: float = 0.0,
        hold_error_m: float = 0.0,
    ) -> None:
        self.correlogram = correlogram
        self.altitude_m = altitude_m
        self.heading_deg = heading_deg
        self.hold_error_m = hold_error_m
        self._spirals: dict[tuple[float, float, float, bool], tuple[Floats, Floats]] = {}
        self._predictions: Known = {}

    @property
    def density(self) -> float:
        """p of a single nadir sample."""
        return self.correlogram.density

    @property
    def transparency(self) -> float:
        """1 - p of a single nadir sample."""
        return 1.0 - self.density

    @property
    def independent_baseline_m(self) -> float:
        """Widest distance [m] between two views of which the plot can tell something."""
        return self.correlogram.reach * self.altitude_m

    @property
    def sharp_baseline_m(self) -> float:
        """The same distance."""
        return self.independent_baseline_m

    @property
    def widest_aperture_m(self) -> float:
        """The same distance."""
        return self.independent_baseline_m

    @remembered
    def predict(self, pattern: Sites, baseline_m: float) -> Prediction:
        """Density and shortfall of a pattern flown at a baseline.

        Each distinct offset of a lattice is looked up once, and each pair of a spiral's sites
        once for all spirals of the same baseline.
        """
        if isinstance(pattern, Spiral):
            return self._predict_spiral(pattern, baseline_m)
        # Rows lie to the right of the heading, columns along it, as east and north of a compass.
        pitch_m = baseline_m * pattern.row_pitch, baseline_m
        sites, apart, pairs = _lattice(pattern)
        return self._prediction(sites * pitch_m, apart * pitch_m, pairs, self.heading_deg)

    def _predict_spiral(self, spiral: Spiral, baseline_m: float) -> Prediction:
        """From sums that grow with the sites, from the middle outward: each spiral's are there."""
        even = spiral.samples % 2 == 0
        key = spiral.turn_pitch, baseline_m, self.heading_deg, even
        if len(self._spirals.get(key, ((),))[0]) < spiral.samples:
            count = (2 << (spiral.samples // 2).bit_length()) + (not even)
            x, y = baseline_m * np.array(list(Spiral(count, spiral.turn_pitch).offsets())).T
            outward = np.argsort(np.abs(np.arange(count) - 0.5 * (count - 1)), kind="stable")
            sites_m = np.column_stack([y, x])[outward]
            hidden = self._expected(
                self.correlogram.density_at, sites_m, self.heading_deg, self.hold_error_m
            )
            later, earlier = np.tril_indices(count, -1)
            apart_m = sites_m[later] - sites_m[earlier]
            pair_error_m = math.sqrt(2.0) * self.hold_error_m
            rho = self._expected(
                self.correlogram.correlation_at, apart_m, self.heading_deg, pair_error_m
            )
            alike = np.bincount(later, rho, count).astype(np.float64)
            self._spirals[key] = np.cumsum(hidden), np.cumsum(alike)
        hidden_sum, alike_sum = (float(sums[spiral.samples - 1]) for sums in self._spirals[key])
        density = hidden_sum / spiral.samples
        shortfall = (spiral.samples + 2.0 * alike_sum) / spiral.samples**2
        return Prediction(density, 1.0 - density, max(shortfall, 0.0))

    def at_best(self, pattern: Sites, baseline_m: float) -> Prediction:
        """The prediction itself."""
        return self.predict(pattern, baseline_m)

    def predict_positions(self, positions_m: ArrayLike) -> Prediction:
        """Density and shortfall of samples at any known positions; takes time by N².

        Parameters
        ----------
        positions_m
            Shape (N, 2), N from 1: east and north of the middle.
        """
        points = np.asarray(positions_m, dtype=np.float64)
        alike = 0.0
        for place in range(1, len(points)):
            alike += float(self.correlation(*(points[:place] - points[place]).T).sum())
        density = float(self.hidden_at(points).mean())
        shortfall = (len(points) + 2.0 * alike) / len(points) ** 2
        return Prediction(density, 1.0 - density, max(shortfall, 0.0))

    def hidden_at(self, positions_m: ArrayLike) -> Floats:
        """p of views at known positions, shape (N,), east and north of the middle."""
        points = np.asarray(positions_m, dtype=np.float64)
        return self._expected(self.correlogram.density_at, points, 0.0, 0.0)

    def correlation(self, x_m: Floats, y_m: Floats) -> Floats:
        """ρ of two views by their offset to the east and to the north."""
        lag, direction_deg = self._polar(np.column_stack([x_m, y_m]), 0.0)
        return np.where(lag > 0.0, self.correlogram.correlation_at(lag, direction_deg), 1.0)

    def _prediction(
        self, sites_m: Floats, apart_m: Floats, pairs: Floats, heading_deg: float
    ) -> Prediction:
        """Means of p over the sites, and of ρ over the distances with their numbers of pairs."""
        tables = self.correlogram
        density = float(
            self._expected(tables.density_at, sites_m, heading_deg, self.hold_error_m).mean()
        )
        pair_error_m = math.sqrt(2.0) * self.hold_error_m
        rho = self._expected(tables.correlation_at, apart_m, heading_deg, pair_error_m)
        rho[~apart_m.any(axis=1)] = 1.0  # a view and itself
        return Prediction(density, 1.0 - density, max(float(rho @ pairs / pairs.sum()), 0.0))

    def _expected(
        self,
        table: Callable[[Floats, Floats], Floats],
        offsets_m: Floats,
        heading_deg: float,
        deviation_m: float,
    ) -> Floats:
        """Entries of a table at uncertain offsets, by a Gauss-Hermite rule along both axes."""
        if deviation_m == 0.0:
            return table(*self._polar(offsets_m, heading_deg))
        points, weights = np.polynomial.hermite_e.hermegauss(NOISE_POINTS)
        shares = np.outer(weights, weights).ravel() / weights.sum() ** 2
        missed_m = deviation_m * np.array([(x, y) for x in points for y in points])
        around = (offsets_m[np.newaxis] + missed_m[:, np.newaxis]).reshape(-1, 2)
        entries = table(*self._polar(around, heading_deg)).reshape(len(shares), -1)
        expected: Floats = shares @ entries
        return expected

    def _polar(self, offsets_m: Floats, heading_deg: float) -> tuple[Floats, Floats]:
        """Lags and directions of offsets to the right of a heading and along it."""
        right, along = offsets_m.T / self.altitude_m
        return np.hypot(right, along), np.degrees(np.arctan2(right, along)) + heading_deg
