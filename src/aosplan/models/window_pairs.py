"""Second moments of pairs of photos over the window of a target that is seen through independent
slices.

Consider two rays to points that are δ apart on the ground, from cameras that are Δ apart at the
altitude h.  In slice j, at the height H_j, the offset of the two rays is

    δ (1 - H_j/h) + Δ H_j/h.

The rays share an occluder of size o_j with probability τ_j, which is the product of the triangle
functions of this offset along x and along y.  With q_j = 1 - D_j, as in `aosplan.models.layered`:

- both rays are free with probability Q(δ, Δ) = Π_j (q_j² + D_j q_j τ_j);
- the first occluder of both rays is the same one with probability C(δ, Δ) = Σ_j [Π_above (q² + D q
  τ)] D_j τ_j;
- the covariance of the ground texture that both rays see is G = Q ρ_g(δ).

`WindowPairs` integrates Q - T², C and G over δ with each kernel of `aosplan.models.target_window`.
The integrals depend only on Δ. The moments of any pattern are therefore sums of the integrals over
its pairs of photos. For searches, `WindowPairs.tabulate` makes a table over Δ.

The logarithms of the factors are approximated by polynomials of τ, and τ is a product of a function
of x and a function of y.  Sums over slices are therefore matrix products.  For C, slices are
grouped into about `BLOCKS` blocks, and all slices of a block are treated as equal.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.models.target_window import Target, kernels
from aosplan.scenes.integral_image import TEXTURE_LENGTH_M

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.scenes.scene import Layer

    Floats = NDArray[np.float64]

BLOCKS = 8
"""Approximate number of blocks of slices. The share of the rays that have not yet been blocked is
updated after each block.
"""

MOST_SLICES = 160
"""Largest number of slices. If there are more slices than this, neighbouring slices are merged."""

SERIES = 6
"""Largest number of terms of the series for the logarithm."""

SMALLEST_TERM = 1e-6
"""Terms of the series below this value are neglected."""

LARGEST_ODDS = 0.35
"""Largest D/q for which the series is used.  The factors of denser slices are computed directly."""

FAR_M = 1e9
"""A distance between cameras that is beyond the reach of all slices."""

TABLE = 20
"""Number of entries of a table along each axis."""


class _Block(NamedTuple):
    """Neighbouring slices, as columns of shape (n, 1)."""

    density: Floats
    height: Floats
    size: Floats
    dense: bool


class Pairs(NamedTuple):
    """Integrals for camera offsets, shape (..., 3, kernels), with rows for Q - T², C and G.

    `window` has the integrals with the four window kernels. `box` has the integrals with the two
    box kernels.
    """

    window: Floats
    box: Floats


class WindowPairs:
    """Integrals over a target's window for slices seen from one altitude.

    Parameters
    ----------
    layers
        Slices, with heights above the ground on which the target lies.
    altitude_m
        Altitude of the cameras above this ground.  It has to be above every slice.
    target
        Size of the target.
    rigid
        Whether the rays from all points of the target converge at the camera (factor 1 - H/h), as
        in reality. Otherwise these rays are parallel, as in the telecentric views of
        `aosplan.scenes.occlusion`.
    """

    def __init__(
        self, layers: Sequence[Layer], altitude_m: float, target: Target, *, rigid: bool = True
    ) -> None:
        self.target = target
        self.altitude_m = altitude_m
        self.layers = merged(layers, MOST_SLICES)
        down = sorted(self.layers, key=lambda layer: -layer.height_m)
        density = np.array([layer.density for layer in down])
        self.transparency = float(np.exp(np.log1p(-density).sum()))
        self._scale = 1.0 / altitude_m if rigid else 0.0
        self._blocks = list(_blocks(down))
        met = density * np.cumprod(np.concatenate([[1.0], 1.0 - density[:-1]]))
        self.ends = met / met.sum()
        self.heights_m = np.array([layer.height_m for layer in down])
        sizes = np.array([layer.occluder_size_m for layer in down])
        seen = sizes / (1.0 - self.heights_m * self._scale)
        # The 10 % quantile of the sizes of occluders, projected on the ground and weighted by
        # density.
        order = np.argsort(seen)
        upto = np.cumsum(density[order]) / density.sum()
        self.kernels = kernels(target, round(float(seen[order][np.searchsorted(upto, 0.1)]), 2))
        self.reach_m = float(
            ((sizes + target.diagonal_m) * altitude_m / np.maximum(self.heights_m, 1e-3)).max()
        )
        self._known: dict[tuple[float, float], tuple[Floats, Floats]] = {}
        self._table: tuple[Floats, Floats] | None = None

    def at(self, x_m: Floats, y_m: Floats) -> Pairs:
        """Integrals for camera offsets along x and y, both of shape (n,)."""
        if self._table is not None:
            return self._looked_up(np.abs(x_m), np.abs(y_m))
        keys = np.round(np.abs(np.column_stack([x_m, y_m])), 9).tolist()
        found = [self._integrals(*key) for key in keys]
        return Pairs(np.array([each[0] for each in found]), np.array([each[1] for each in found]))

    def tabulate(self) -> None:
        """Compute a table, from which the integrals for all later offsets are interpolated.

        The table saves time if more than about `TABLE`² distinct offsets are needed, as in a search
        over baselines.
        """
        if self._table is not None:
            return
        nodes = self._nodes().tolist()
        # The integrals are means over directions, so x and y can be exchanged.
        found = [[self._integrals(max(x, y), min(x, y)) for x in nodes] for y in nodes]
        window = np.array([[each[0] for each in row] for row in found])
        box = np.array([[each[1] for each in row] for row in found])
        self._table = window, box

    @property
    def far(self) -> Pairs:
        """Integrals for cameras that are so far apart that their rays do not share occluders."""
        return Pairs(*self._integrals(FAR_M, FAR_M))

    @property
    def _bend(self) -> float:
        return math.asinh(self.reach_m / self._width_m) / (TABLE - 1)

    @property
    def _width_m(self) -> float:
        """Camera offset at which the highest slice moves by the target's width."""
        return self.target.width_m * self.altitude_m / float(self.heights_m.max())

    def _nodes(self) -> Floats:
        """Camera offsets of the table, which are denser near 0."""
        nodes: Floats = self._width_m * np.sinh(self._bend * np.arange(TABLE))
        return nodes

    def _looked_up(self, x_m: Floats, y_m: Floats) -> Pairs:
        from scipy.interpolate import RegularGridInterpolator

        assert self._table is not None
        # The interpolation is over the index of the nodes, because the integrals are smooth
        # functions of this index.
        places = [
            np.minimum(np.arcsinh(each / self._width_m) / self._bend, TABLE - 1.0)
            for each in (y_m, x_m)
        ]
        index = np.arange(TABLE, dtype=np.float64)
        window, box = (
            RegularGridInterpolator((index, index), table, method="linear")(np.column_stack(places))
            for table in self._table
        )
        return Pairs(window, box)

    def _integrals(self, x: float, y: float) -> tuple[Floats, Floats]:
        key = x, y
        if key not in self._known:
            made = self.kernels
            self._known[key] = (
                self._on(made.fine_m, made.window, x, y),
                self._on(made.coarse_m, made.box, x, y),
            )
        return self._known[key]

    def _on(self, axis: Floats, weights: Floats, x: float, y: float) -> Floats:
        """Integrals with the kernels on one lattice, shape (3, kernels)."""
        both, same = self.maps(axis, x, y)
        t = self.transparency
        texture = _gaussian(axis, TEXTURE_LENGTH_M)
        values = np.stack([both - t * t, same, both * np.outer(texture, texture)])
        found: Floats = values.reshape(3, -1) @ weights.reshape(len(weights), -1).T
        return found

    def maps(self, axis: Floats, x: float, y: float) -> tuple[Floats, Floats]:
        """Q and C on a lattice of offsets on the ground, for cameras that are (x, y) apart."""
        log_clear = np.zeros((len(axis), len(axis)))
        same = np.zeros_like(log_clear)
        for block in self._blocks:
            near = 1.0 - block.height * self._scale
            far = block.height / self.altitude_m
            along_x, along_y = (
                np.maximum(1.0 - np.abs(axis * near + at * far) / block.size, 0.0) for at in (x, y)
            )
            shared = (along_y * block.density).T @ along_x
            passed = _log_pair(block, along_x, along_y)
            count = len(block.density)
            first = np.exp(log_clear) * shared
            # Each slice of a block is seen through the slices of the block above it, which are
            # treated as equal to it.
            if count > 1:
                one = np.minimum(passed / count, -1e-12)
                first *= np.expm1(count * one) / (count * np.expm1(one))
            same += first
            log_clear += passed
        both: Floats = np.exp(log_clear)
        return both, same


def _log_pair(block: _Block, along_x: Floats, along_y: Floats) -> Floats:
    """Logarithm of the probability that both rays of a pair pass a block."""
    odds = block.density / (1.0 - block.density)
    alone = 2.0 * float(np.log1p(-block.density).sum())
    if block.dense:
        tau = along_y[:, :, None] * along_x[:, None, :]
        dense: Floats = np.log1p(odds[:, :, None] * tau).sum(axis=0) + alone
        return dense
    found = np.full((along_y.shape[1], along_x.shape[1]), alone)
    power_x, power_y = odds * along_x, along_y
    largest = float(odds.max())
    for term in range(1, SERIES + 1):
        if largest**term < SMALLEST_TERM:
            break
        found += (power_y.T @ power_x) * ((-1.0) ** (term + 1) / term)
        power_x, power_y = power_x * odds * along_x, power_y * along_y
    return found


def _blocks(layers: Sequence[Layer]) -> list[_Block]:
    """Slices from the top down, merged into blocks.  Each dense slice is a separate block."""
    size = max(math.ceil(len(layers) / BLOCKS), 1)
    groups: list[list[Layer]] = []
    for layer in layers:
        dense = layer.density > LARGEST_ODDS / (1.0 + LARGEST_ODDS)
        if groups and not dense and len(groups[-1]) < size and not _is_dense(groups[-1]):
            groups[-1].append(layer)
        else:
            groups.append([layer])
    return [
        _Block(
            np.array([[layer.density] for layer in group]),
            np.array([[layer.height_m] for layer in group]),
            np.array([[layer.occluder_size_m] for layer in group]),
            _is_dense(group),
        )
        for group in groups
    ]


def _is_dense(group: Sequence[Layer]) -> bool:
    return group[0].density > LARGEST_ODDS / (1.0 + LARGEST_ODDS)


def _gaussian(offset: Floats, length: float) -> Floats:
    value: Floats = np.exp(-0.5 * (offset / length) ** 2)
    return value


def merged(layers: Sequence[Layer], most: int) -> tuple[Layer, ...]:
    """The slices that are not empty. If there are more than `most` of them, neighbouring slices are
    merged.
    """
    from aosplan.scenes.scene import Layer

    filled = [layer for layer in layers if layer.density > 0.0]
    group = max(math.ceil(len(filled) / most), 1)
    if group == 1:
        return tuple(filled)
    found = []
    for start in range(0, len(filled), group):
        part = filled[start : start + group]
        density = -math.expm1(math.fsum(math.log1p(-layer.density) for layer in part))
        size = sum(layer.occluder_size_m for layer in part) / len(part)
        found.append(Layer(part[0].bottom_m, part[-1].top_m, density, size))
    return tuple(found)
