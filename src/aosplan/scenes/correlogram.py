"""The correlogram: a table of a few hundred numbers that describes a stand, for fast searches.

Exact predictions (`aosplan.models.measured`) compute every view of every candidate. A search can
use an approximation instead, which needs two functions. ρ(Δ) is the correlation, over targets, of
being hidden in two views whose cameras are Δ apart. p(c) is the share of targets that are hidden in
a view from the offset c. The approximation is

    p̄ = mean of p(c) over the sites,   K ≈ mean of ρ(Δ) over all ordered pairs of sites.

Both functions are stored as tables by direction and lag.  The lag is the distance Δ, or the length
of the offset c, divided by the altitude.  The tables are computed for telecentric views and are
valid for every altitude. p̄ has to be the mean over the actual sites, because p increases with the
offset.

**Lags** grow by a factor of √2, and directions are 22.5° apart. Real stands do not need such a fine
table. It was chosen because a single polar lattice of 273 views contains the pairs of views for all
entries.

**Pairs.** The correlation of two views that are Δ apart decreases as the pair moves away from
nadir. An entry of ρ is therefore a mean over five positions of the middle of the pair in a square
aperture: at nadir; at Δ/2 on both sides of nadir, perpendicular to Δ; and at Δ/2 on both sides of
nadir, along Δ. The last two positions have half the weight, because an aperture has fewer pairs
there.

The error of V̂ was measured with two point clouds and nineteen generated stands. For square grids
within the reach of the plot, with b/h = 0.01 … 0.1 and N = 4 … 100, the error is at most 0.016. If
p is above 0.98, only a few gaps remain, and the error is at most 0.045. Lanes and lines have other
distributions of pairs. Their error is at most 0.02, or 0.06 in sparse stands with a few trees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.scenes.hidden_counts import popcount
from aosplan.scenes.occlusion import PlotWindow
from aosplan.scenes.sampled_targets import occlusion_of
from aosplan.scenes.voxels import FACE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.scenes.occlusion import Words
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

INTERIOR = 0.2, 0.4, 0.6, 0.8, 1.0
"""Widths of apertures, as shares of the reach. For each width, there is a correlogram of the
targets from which all rays to the aperture stay on the plot. The model interpolates between these
widths.
"""

LAGS = 15
SMALLEST_LAG = 0.01
DIRECTIONS = 8
"""Number of directions in half a circle. It is a multiple of 4. Each direction therefore has other
directions at 45° and at 90° to it.
"""


@dataclass(frozen=True, eq=False)
class Correlogram:
    """Tables, by direction and lag, of the correlation of two views and of the share of targets
    that are hidden in one view.

    Parameters
    ----------
    lags
        Shape (L,), increasing: distance between two cameras, or offset of a camera from its
        target, divided by the altitude above the focal plane.
    directions_deg
        Shape (D,), clockwise from north, equally spaced from 0 to below 180.  Opposite directions
        have equal values.
    rho
        Shape (D, L): correlation ρ between two views.
    density_by_offset
        Shape (D, L): share of targets that are hidden in a view from an offset, averaged over the
        two opposite offsets.
    density
        Share of targets that are hidden in the nadir view.
    reach
        Largest lag for which the plot is large enough.  At this lag, the rays of two views are half
        the width of the plot apart at the top of the canopy.
    interior
        Correlograms of the targets whose rays to an aperture all stay on the plot, for the widths
        in `INTERIOR`; empty if they are not known.
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
        """Targets that are counted: ``interior`` for those whose rays stay on the plot, or
        ``wrapped`` for all targets.
        """
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
        """Correlation ρ of pairs of views.  Beyond the last lag, the value at the last lag is
        used.
        """
        return self._at(self._rho_by_lag, lag, direction_deg)

    def density_at(self, lag: Floats, direction_deg: Floats) -> Floats:
        """Share p of the targets that are hidden in views from offsets. Beyond the last lag, the
        value at the last lag is used.
        """
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

    The tables of the correlogram itself count all targets; the plot is treated as periodic.
    `interior` has one correlogram for each width in `INTERIOR`. It counts only the targets whose
    rays to an aperture of this width all stay on the plot.

    Parameters
    ----------
    volume
        The voxels of the plot.
    targets_per_voxel, focal_height_m
        As in `aosplan.scenes.occlusion.Occlusion`.
    """
    top_m = max(volume.canopy_top_m - focal_height_m, 0.0)
    # The altitude only has to be above the canopy, because views at the same lag are equal for all
    # altitudes.
    altitude_m = 2.0 * top_m + 1.0
    occlusion = occlusion_of(
        volume, altitude_m, targets_per_voxel=targets_per_voxel, focal_height_m=focal_height_m
    )
    # The lattice has all directions of the full circle. It has two more lags below the smallest
    # one, for views at Δ/2 and Δ/√2 from nadir.
    lags: Floats = SMALLEST_LAG * np.exp2(0.5 * np.arange(-2, LAGS))
    turns = np.arange(2 * DIRECTIONS) * (math.pi / DIRECTIONS)
    unit = np.column_stack([np.sin(turns), np.cos(turns)])
    offsets = unit[:, np.newaxis] * lags[:, np.newaxis]
    masks = occlusion.masks(np.vstack([[(0.0, 0.0)], altitude_m * offsets.reshape(-1, 2)]))
    lattice = _Views(masks[:1], masks[1:].reshape(len(turns), len(lags), -1), offsets)
    reach = 0.5 * min(volume.size_m) / top_m if top_m else np.inf

    def table(margin: int, aperture: float) -> Correlogram:
        """The correlogram of the targets that are at least `margin` voxels from the edges, from
        pairs of views within an aperture.
        """
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
    if 2 * margins[-1] >= min(volume.occupied.shape[1:]):  # The plot has only a few voxels.
        return whole
    return replace(whole, interior=tuple(map(table, margins, apertures)))


class _Views(NamedTuple):
    """Views of a polar lattice.  They are the mask of the nadir view, and the masks and offsets of
    the other views by direction and lag.
    """

    nadir: Words
    masks: Words
    offsets: Floats

    def tables(self, inside: Words, aperture: float) -> tuple[Floats, Floats]:
        """Tables for the targets in a mask: ρ by direction and lag, and p by direction (full
        circle) and lag.

        Pairs with a view outside of the aperture are not counted, unless all pairs of an entry have
        such a view.
        """
        targets = int(popcount(inside))
        rho = np.empty((DIRECTIONS, LAGS))
        for ahead in range(DIRECTIONS):
            behind, diagonal = ahead + DIRECTIONS, DIRECTIONS // 4
            pairs = (
                (2.0, (behind, 2), (ahead, 2)),
                # If the centre of the pair is Δ/2 to the side, both views are Δ/√2 from nadir, in
                # directions at 45° to Δ.
                (2.0, (behind + diagonal, 1), (ahead - diagonal, 1)),
                (2.0, (behind - diagonal, 1), (ahead + diagonal, 1)),
                (1.0, None, (ahead, 0)),
                (1.0, None, (behind, 0)),
            )
            total, weights, among = np.zeros(LAGS), np.zeros(LAGS), np.zeros(LAGS)
            for weight, one, other in pairs:
                first = self.nadir if one is None else self._at(self.masks, *one)
                alike = _correlation(first & inside, self._at(self.masks, *other) & inside, targets)
                # Both views have the same distance from nadir, or the first view is at nadir.
                spread = np.abs(self._at(self.offsets, *other)).max(axis=1)
                counts = weight * (spread <= 0.5 * aperture * (1.0 + FACE))
                total += weight / 8.0 * alike
                among += counts * alike
                weights += counts
            rho[ahead] = np.divide(among, weights, out=total, where=weights > 0.0)
        return rho, popcount(self.masks[:, 2:] & inside) / targets

    def _at(self, views: Any, turn: int, steps: int) -> Any:
        """Views in a direction, at the lags of the table divided by √2 to the power of `steps`."""
        return views[turn % len(views), 2 - steps : views.shape[1] - steps]


def _correlation(one: Words, other: Words, targets: int) -> Floats:
    """Correlation of two views over the targets, for each pair of views."""
    p, q = popcount(one) / targets, popcount(other) / targets
    covariance = popcount(one & other) / targets - p * q
    spread = np.sqrt(p * (1.0 - p) * q * (1.0 - q))
    # If all targets or no targets are hidden in a view, the correlation is set to 0.
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
    """Slope at an end point. It is the slope of the parabola through the last three points, and is
    limited so that the spline is monotone.
    """
    tangent = ((2.0 * step + next_step) * slope - step * next_slope) / (step + next_step)
    turned = np.sign(tangent) != np.sign(slope)
    steep = (np.sign(slope) != np.sign(next_slope)) & (np.abs(tangent) > 3.0 * np.abs(slope))
    bounded: Floats = np.where(turned, 0.0, np.where(steep, 3.0 * slope, tangent))
    return bounded
