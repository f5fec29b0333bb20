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
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.scenes.hidden_counts import popcount
from aosplan.scenes.occlusion import PlotWindow
from aosplan.scenes.sampled_targets import views_of
from aosplan.scenes.voxels import FACE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.scenes.occlusion import Words
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

INTERIOR = 0.2, 0.4, 0.6, 0.8, 1.0
"""Widths of apertures as shares of the reach, for each of which the targets are counted from which all
rays to the aperture stay on the plot.  For other widths a model interpolates."""

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
    interior
        Correlograms of the targets from which all rays to an aperture stay on the plot, for the widths
        `INTERIOR`; empty if they are not known.
    """

    lags: Floats
    directions_deg: Floats
    rho: Floats
    density_by_offset: Floats
    density: float
    reach: float
    interior: tuple[Correlogram, ...] = ()

    @property
    def edges(self) -> str:
        """Targets that count: ``interior``, whose rays stay on the plot, or all: ``wrapped``."""
        return "interior" if self.interior else "wrapped"

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
    """Compute the correlogram of a volume from telecentric views.

    Its own tables count all targets, and the plot is periodic.  Those in `interior` count the targets
    from which all rays to an aperture stay on the plot, one for each width in `INTERIOR`.

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
    offsets = unit[:, np.newaxis] * lags[:, np.newaxis]
    masks = occlusion.masks(np.vstack([[(0.0, 0.0)], altitude_m * offsets.reshape(-1, 2)]))
    lattice = _Views(masks[:1], masks[1:].reshape(len(turns), len(lags), -1), offsets)
    reach = 0.5 * min(volume.size_m) / top_m if top_m else np.inf

    def table(margin: int, aperture: float) -> Correlogram:
        """The correlogram of targets so many voxels from the edges, from pairs within an aperture."""
        width = margin * occlusion.targets_per_voxel
        rows, columns = occlusion.rows - 2 * width, occlusion.columns - 2 * width
        inside = occlusion.mask_of(PlotWindow(width, width, rows, columns))
        rho, density = lattice.tables(inside, aperture)
        return Correlogram(
            lags=lags[2:],
            directions_deg=np.degrees(turns[:DIRECTIONS]),
            rho=rho,
            density_by_offset=0.5 * (density[:DIRECTIONS] + density[DIRECTIONS:]),
            density=float(popcount(lattice.nadir & inside)[0]) / int(popcount(inside)),
            reach=float(min(reach, lags[-1])),
        )

    whole = table(0, math.inf)
    if not top_m:
        return whole
    apertures = [share * reach for share in INTERIOR]
    margins = [math.ceil(0.5 * each * top_m / volume.voxel_m - FACE) for each in apertures]
    if 2 * margins[-1] >= min(volume.occupied.shape[1:]):  # a plot of a few voxels
        return whole
    return replace(whole, interior=tuple(map(table, margins, apertures)))


class _Views(NamedTuple):
    """Views of a polar lattice: the nadir view, and masks and offsets by direction and lag."""

    nadir: Words
    masks: Words
    offsets: Floats

    def tables(self, inside: Words, aperture: float) -> tuple[Floats, Floats]:
        """ρ by direction and lag, and p by all directions and lag, of the targets in a mask.

        Pairs with a view outside of the aperture do not count, unless all pairs of an entry are.
        """
        targets = int(popcount(inside))
        rho = np.empty((DIRECTIONS, LAGS))
        for ahead in range(DIRECTIONS):
            behind, diagonal = ahead + DIRECTIONS, DIRECTIONS // 4
            pairs = (
                (2.0, (behind, 2), (ahead, 2)),
                # If the centre of the pair is Δ/2 to the side, both views are Δ/√2 from nadir, at 45°.
                (2.0, (behind + diagonal, 1), (ahead - diagonal, 1)),
                (2.0, (behind - diagonal, 1), (ahead + diagonal, 1)),
                (1.0, None, (ahead, 0)),
                (1.0, None, (behind, 0)),
            )
            total, weights, among = np.zeros(LAGS), np.zeros(LAGS), np.zeros(LAGS)
            for weight, one, other in pairs:
                first = self.nadir if one is None else self._at(self.masks, *one)
                alike = _correlation(first & inside, self._at(self.masks, *other) & inside, targets)
                # Both views are as far from nadir, or one of them is at nadir.
                spread = np.abs(self._at(self.offsets, *other)).max(axis=1)
                counts = weight * (spread <= 0.5 * aperture * (1.0 + FACE))
                total += weight / 8.0 * alike
                among += counts * alike
                weights += counts
            rho[ahead] = np.divide(among, weights, out=total, where=weights > 0.0)
        return rho, popcount(self.masks[:, 2:] & inside) / targets

    def _at(self, views: Any, turn: int, steps: int) -> Any:
        """Views in a direction at the table's lags divided by √2 to the power of `steps`."""
        return views[turn % len(views), 2 - steps : views.shape[1] - steps]


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
