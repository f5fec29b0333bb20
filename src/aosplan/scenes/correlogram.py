"""The correlogram: a stand as a table of a few hundred numbers, for fast searches.

Exact predictions (`aosplan.models.measured`) compute every view of every candidate.  A search can
use an approximation instead.  It needs ρ(Δ), the correlation of the targets that two views hide
whose cameras are Δ apart, and p(c), the share of targets that a view from offset c hides:

    p̄ = mean of p(c) over the sites,   K ≈ mean of ρ(Δ) over all ordered pairs of sites.

Both are tables by direction and lag, which is distance divided by altitude.  They are computed for
telecentric views and are valid for every altitude.  p̄ has to be the mean over the actual sites,
because p increases with the offset.

**Lags** grow by a factor of √2, and directions are 22.5° apart, which is finer than stands require.
With this choice, all pairs of one entry are pairs of views on one polar lattice, so 273 views are
enough for the whole table.

**Pairs.**  The correlation of two views that are Δ apart decreases as the pair moves away from
nadir.  An entry is therefore a mean over five positions of the pair in a square aperture: at nadir,
Δ/2 away from it perpendicular to Δ on both sides, and Δ/2 away from it along Δ on both sides.  The
last two have half the weight, because fewer pairs fit into the aperture there.

For grids that are as wide as they are long, lie within the plot's reach, and have b/h = 0.01 … 0.1
and N = 4 … 100, V̂ is within 0.016 of the exact value (two point clouds and nineteen generated
stands).  If p is above 0.98, so that only a few gaps remain, the error is up to 0.045.  Lanes and
lines have other distributions of pairs; their error is up to 0.02, and up to 0.06 in sparse stands
with a few trees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.scenes.hidden_counts import popcount
from aosplan.scenes.sampled_targets import views_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.scenes.occlusion import Words
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

LAGS = 15
SMALLEST_LAG = 0.01
DIRECTIONS = 8
"""Number of directions in half a circle; a multiple of 4 includes those 45° and 90° from each
other.
"""


@dataclass(frozen=True, eq=False)
class Correlogram:
    """Correlation of views, and share of targets that a view hides, by direction and lag.

    Parameters
    ----------
    lags
        Shape (L,), increasing: distance between two cameras, or offset of a camera from its
        target, divided by the altitude above the focal plane.
    directions_deg
        Shape (D,), clockwise from north, equally spaced from 0 to below 180; opposite directions
        are equal.
    rho
        Shape (D, L): correlation of the targets that two views hide.
    density_by_offset
        Shape (D, L): share of targets that a view from an offset hides, averaged over the two
        opposite offsets.
    density
        Share of targets that the nadir view hides.
    reach
        Largest lag for which the plot is large enough: at this lag, the rays of two views are half
        a plot apart at the top of the canopy.
    """

    lags: Floats
    directions_deg: Floats
    rho: Floats
    density_by_offset: Floats
    density: float
    reach: float

    def to_document(self) -> dict[str, Any]:
        """The correlogram as plain values, without the density of the nadir view."""
        return {
            "lags": self.lags.tolist(),
            "directions_deg": self.directions_deg.tolist(),
            "rho": self.rho.tolist(),
            "reach": self.reach,
        }

    def correlation_at(self, lag: Floats, direction_deg: Floats) -> Floats:
        """Correlation ρ of pairs of views; beyond the last lag, the value at the last lag."""
        return self._at(self._rho_by_lag, lag, direction_deg)

    def density_at(self, lag: Floats, direction_deg: Floats) -> Floats:
        """Share p that views from offsets hide; beyond the last lag, the value at the last lag."""
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
        """Monotone cubic splines through the centre and the rows of a table: shape (4, L, D)."""
        rows = np.column_stack([np.full(len(table), centre), table])
        return monotone_cubics(self._knots, rows.T)

    def _stretched(self, lag: Floats) -> Floats:
        """Lags on a scale on which the table is smooth: linear near 0, then logarithmic."""
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
    """Compute the correlogram of a volume from telecentric views; the plot is periodic.

    Parameters
    ----------
    volume
        The voxels of the plot.
    targets_per_voxel, focal_height_m
        As in `aosplan.scenes.occlusion.Occlusion`.
    """
    top_m = max(volume.canopy_top_m - focal_height_m, 0.0)
    altitude_m = 2.0 * top_m + 1.0  # views at the same lag are the same for every altitude
    occlusion = views_of(
        volume, altitude_m, targets_per_voxel=targets_per_voxel, focal_height_m=focal_height_m
    )
    # All directions; two more lags, below the smallest one, for pairs at Δ/2 and Δ/√2.
    lags: Floats = SMALLEST_LAG * np.exp2(0.5 * np.arange(-2, LAGS))
    turns = np.arange(2 * DIRECTIONS) * (math.pi / DIRECTIONS)
    unit = np.column_stack([np.sin(turns), np.cos(turns)])
    offsets_m = altitude_m * unit[:, np.newaxis] * lags[:, np.newaxis]
    masks = occlusion.masks(np.vstack([[(0.0, 0.0)], offsets_m.reshape(-1, 2)]))
    nadir, masks = masks[:1], masks[1:].reshape(len(turns), len(lags), -1)
    density = popcount(masks[:, 2:]) / occlusion.targets

    def views(turn: int, steps: int) -> Words:
        """Views in a direction at the table's lags divided by √2 to the power of `steps`."""
        return masks[turn % len(turns), 2 - steps : len(lags) - steps]

    rho = np.empty((DIRECTIONS, LAGS))
    for ahead in range(DIRECTIONS):
        behind, diagonal = ahead + DIRECTIONS, DIRECTIONS // 4
        about = (
            (views(behind, 2), views(ahead, 2)),
            # If the centre of the pair is Δ/2 to the side, both views are Δ/√2 from nadir, at 45°.
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
    """Correlation of the targets that two views hide, for each pair of views."""
    p, q = popcount(one) / targets, popcount(other) / targets
    covariance = popcount(one & other) / targets - p * q
    spread = np.sqrt(p * (1.0 - p) * q * (1.0 - q))
    # If a view hides all targets or none, the correlation is set to 0.
    return np.divide(covariance, spread, where=spread > 0.0, out=np.zeros_like(covariance))


def monotone_cubics(x: Floats, y: Floats) -> Floats:
    """Coefficients of monotone piecewise cubics through points.

    Parameters
    ----------
    x
        Shape (n,), increasing, n >= 2.
    y
        Shape (n, ...): values at `x`.

    Returns
    -------
    ndarray
        Shape (4, n - 1, ...): between ``x[i]`` and ``x[i + 1]`` the value is c[0, i] s³ +
        c[1, i] s² + c[2, i] s + c[3, i], where s is the distance from ``x[i]``.
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
    """Tangent at an end point: that of the parabola through three points, limited to stay monotone."""
    tangent = ((2.0 * step + next_step) * slope - step * next_slope) / (step + next_step)
    turned = np.sign(tangent) != np.sign(slope)
    steep = (np.sign(slope) != np.sign(next_slope)) & (np.abs(tangent) > 3.0 * np.abs(slope))
    bounded: Floats = np.where(turned, 0.0, np.where(steep, 3.0 * slope, tangent))
    return bounded
