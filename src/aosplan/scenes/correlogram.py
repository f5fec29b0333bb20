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
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.scenes.occlusion import popcount
from aosplan.scenes.sampled_targets import views_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.scenes.occlusion import Words
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

LAGS = 15
SMALLEST_LAG = 0.01
DIRECTIONS = 8
"""Over the half circle; a multiple of 4, for those at 45° and 90° to each to be among them."""


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
    volume: VoxelVolume, *, targets_per_voxel: int | None = None, focal_height_m: float = 0.0
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
    occlusion = views_of(
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


def _correlation(one: Words, other: Words, targets: int) -> Floats:
    """Correlation of what views hide, pair by pair."""
    p, q = popcount(one) / targets, popcount(other) / targets
    covariance = popcount(one & other) / targets - p * q
    spread = np.sqrt(p * (1.0 - p) * q * (1.0 - q))
    # A view that hides all or nothing is like no other.
    return np.divide(covariance, spread, where=spread > 0.0, out=np.zeros_like(covariance))


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
