"""Attenuation of each voxel, estimated from intercepted energy and path lengths, and its scale
factor.

For each voxel, I is the energy that is intercepted in the voxel. L is the sum, over the pulses, of
weight times path length in the voxel. The maximum likelihood estimate of the attenuation λ [1/m] is
I/L. This estimate is uncertain if few rays cross the voxel. It is therefore shrunk towards the
attenuation λ_parent of the block of 2 x 2 x 2 voxels that contains the voxel: λ = (I + a)/(L +
a/λ_parent). The attenuation of a block is shrunk in the same way, towards the attenuation of a
larger block. The largest blocks are at most 4 m wide. They are shrunk towards the attenuation of
their whole layer.

Shrinkage moves a little attenuation from crowns into the gaps beside them. In a single voxel, the
effect is negligible. However, a gap extends from the ground to the top, and all its voxels together
predict more interception than was measured. All λ of a column are therefore multiplied by a factor.
This factor is the sum of I over the voxels of the column, divided by the sum of λ L over these
voxels. In the same way, this factor is shrunk towards the factors of larger square blocks of
columns. Without the factor, the contrast between crowns and gaps would be too low, and the
correlation of views would be lower than below real leaves.

The strengths of both shrinkages are chosen such that each half of the pulses predicts the other
half as well as possible.

Both shrinkages make crowns and gaps too similar, so that the predicted transmissions of columns
differ too little. The λ of each column are therefore multiplied by a power of its optical depth D,
D^(γ - 1). The mean transmission that is computed from these λ also differs slightly from the
measured transmission, because leaves are clumped within voxels and λ is uncertain. A scale factor
for all λ corrects the mean. The contrast γ and the scale are found by cross-fitting: the
transmission of each quarter of the pulses is predicted with the λ from the other three quarters.
For each γ, the scale makes the mean of these predictions equal to the measured mean. The γ with the
largest likelihood is used. If there are few pulses, γ is shrunk towards 1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Singles = NDArray[np.float32]

COARSEST_M = 4.0
STRENGTHS = (0.1, 0.2, 0.3, 0.4, 0.6)
"""Possible strengths of the shrinkage of voxels, from which one is chosen."""

COLUMN_STRENGTHS = (3.0, 0.3, 1.0, 10.0, 30.0)
"""Possible strengths of the shrinkage of the factors of columns. The first one is used while the
strength for voxels is chosen.
"""

SCALES = (0.02, 50.0)

CONTRASTS = (0.9, 1.0, 1.1, 1.2, 1.3, 1.4)
"""Exponents γ for which the likelihood is computed."""

LEAST_CONTRAST = 1.0
"""Smallest exponent that is used. If λ is very uncertain, a smaller exponent would predict single
pulses better, but columns would then be too similar.
"""

OTHER_CONTRAST = 1.2
"""Optical depths are computed for this exponent and for the exponent 1."""

CONTRAST_SPREAD = 0.1
"""Standard deviation of the contrast γ among different stands.  If there are few pulses, the
contrast is therefore close to 1.
"""

JUDGING_PULSES = 50_000
"""Largest number of pulses that are used to find the contrast."""


class VoxelSums(NamedTuple):
    """Intercepted energy [pulses] and sum of weight times path length [m] of each voxel.  Both
    arrays have the same shape.
    """

    intercepted: Singles
    path_m: Singles


class Strengths(NamedTuple):
    """Weights, as numbers of pulses, of the larger block in the estimates of voxels and columns."""

    voxel: float
    column: float


def total(parts: Sequence[VoxelSums]) -> VoxelSums:
    """Add up the sums of several parts of the pulses."""
    intercepted, path_m = (np.sum(each, axis=0) for each in zip(*parts, strict=True))
    return VoxelSums(intercepted, path_m)


def attenuation(sums: VoxelSums, strengths: Strengths, voxel_m: float) -> Singles:
    """λ [1/m] of each voxel, shrunk through the pyramid and multiplied by the factor of its column.

    Parameters
    ----------
    sums
        Sums of shape (slices, rows, columns).
    strengths
        Strengths of both shrinkages.
    voxel_m
        Edge of a voxel.
    """
    rate = _pyramid(sums, strengths.voxel, voxel_m)
    columns = VoxelSums(
        sums.intercepted.sum(axis=0, keepdims=True),
        np.einsum("kij,kij->ij", rate, sums.path_m)[np.newaxis],
    )
    rate *= _pyramid(columns, strengths.column, voxel_m)
    return rate


def contrasted(rate: Singles, contrast: float, voxel_m: float) -> Singles:
    """λ, multiplied by D^(γ - 1), where D is the optical depth of the column.

    Parameters
    ----------
    rate
        λ [1/m] of shape (slices, rows, columns).
    contrast
        The exponent γ.
    voxel_m
        Edge of a voxel.
    """
    depth = rate.sum(axis=0) * np.float32(voxel_m)
    found: Singles = rate * np.maximum(depth, np.float32(1e-9)) ** np.float32(contrast - 1.0)
    return found


def _pyramid(sums: VoxelSums, strength: float, voxel_m: float) -> Singles:
    """I/L of each voxel, shrunk towards the values of larger and larger blocks."""
    levels = [sums]
    edge_m = voxel_m
    while 2.0 * edge_m <= COARSEST_M * 1.001:
        levels.append(VoxelSums(*(_halved(each) for each in levels[-1])))
        edge_m *= 2.0
    total_i, total_l = (float(each.sum(dtype=np.float64)) for each in sums)
    overall = total_i / total_l if total_l > 0.0 else 0.0
    layers = VoxelSums(*(each.sum(axis=(1, 2), keepdims=True) for each in levels[-1]))
    parent = _shrunk(layers, np.full(layers.path_m.shape, overall, np.float32), strength)
    for level in reversed(levels):
        parent = _shrunk(level, _grown(parent, level.path_m.shape), strength)
    return parent


def _shrunk(sums: VoxelSums, parent: Singles, strength: float) -> Singles:
    """The estimate (I + a)/(L + a/λ_parent), or 0 if λ_parent is 0."""
    above = (sums.intercepted + np.float32(strength)) * parent
    rate: Singles = above / np.maximum(sums.path_m * parent + np.float32(strength), 1e-30)
    return rate


def _halved(values: Singles) -> Singles:
    """Sums over blocks of 2 x 2 x 2; odd sizes are padded with zeros."""
    for axis in range(3):
        if values.shape[axis] % 2:
            pad = [(0, 0)] * 3
            pad[axis] = (0, 1)
            values = np.pad(values, pad)
        even, odd = [slice(None)] * 3, [slice(None)] * 3
        even[axis], odd[axis] = slice(0, None, 2), slice(1, None, 2)
        values = values[tuple(even)] + values[tuple(odd)]
    return values


def _grown(values: Singles, shape: tuple[int, ...]) -> Singles:
    """The value of each block, repeated for each of its voxels."""
    for axis, length in enumerate(shape):
        if values.shape[axis] == 1 and axis > 0:
            continue
        values = np.repeat(values, 2, axis=axis)[
            tuple(slice(0, length) if k == axis else slice(None) for k in range(3))
        ]
    return values


def best_strengths(halves: tuple[VoxelSums, VoxelSums], voxel_m: float) -> Strengths:
    """Find the strengths of the two shrinkages with which each half of the pulses predicts the
    other half best.

    The log-likelihood of a half is Σ I log λ - L λ, as for a Poisson process along the paths of its
    pulses.
    """

    def likelihood(strengths: Strengths) -> float:
        total = 0.0
        for one, other in (halves, halves[::-1]):
            rate = attenuation(one, strengths, voxel_m)
            hit = other.intercepted > 0.0
            total += float(
                (other.intercepted[hit] * np.log(np.maximum(rate[hit], 1e-9))).sum(dtype=np.float64)
            )
            total -= float(np.einsum("ijk,ijk->", other.path_m, rate, dtype=np.float64))
        return total

    column = COLUMN_STRENGTHS[0]
    voxel = max(STRENGTHS, key=lambda each: likelihood(Strengths(each, column)))
    column = max(COLUMN_STRENGTHS, key=lambda each: likelihood(Strengths(voxel, each)))
    return Strengths(voxel, column)


def scale_for(depths: Floats, gap: float) -> float:
    """Factor by which optical depths have to be multiplied so that their mean transmission equals a
    gap fraction.

    Parameters
    ----------
    depths
        Optical depths of pulses, shape (P,).
    gap
        Mean transmission of the pulses, 0 to 1.
    """
    low, high = np.log(SCALES)
    for _ in range(50):
        middle = 0.5 * (low + high)
        if float(np.exp(-np.exp(middle) * depths).mean()) > gap:
            low = middle
        else:
            high = middle
    return float(np.exp(0.5 * (low + high)))


def depths_at(contrast: float, depths: Floats) -> Floats:
    """Optical depths of pulses for a contrast, shape (P,).

    The depths are interpolated between two contrasts, because the logarithm of a depth is nearly a
    linear function of the contrast.

    Parameters
    ----------
    contrast
        The exponent γ.
    depths
        Shape (2, P): optical depths for the contrasts 1 and `OTHER_CONTRAST`.
    """
    share = (contrast - 1.0) / (OTHER_CONTRAST - 1.0)
    plain, other = np.maximum(depths, 1e-12)
    found: Floats = plain * (other / plain) ** share
    return found


def best_contrast(depths: Floats, passed: Floats) -> float:
    """The most likely contrast, given the transmissions of pulses and the spread of contrasts.

    Parameters
    ----------
    depths
        Optical depths as in `depths_at`, from λ that do not depend on these pulses.
    passed
        Shape (P,): measured share of the energy of each pulse that reaches the ground, 0 to 1.

    Returns
    -------
    float
        The contrast, between `LEAST_CONTRAST` and the last of `CONTRASTS`.
    """
    every = -(-passed.size // JUDGING_PULSES)
    depths, passed = depths[:, ::every], passed[::every]
    gap = float(passed.mean())

    def likelihood(contrast: float) -> float:
        of_pulses = depths_at(contrast, depths)
        depth = np.maximum(of_pulses * scale_for(of_pulses, gap), 1e-9)
        of_data = ((1.0 - passed) * np.log(-np.expm1(-depth)) - passed * depth).sum()
        return float(of_data) - 0.5 * ((contrast - 1.0) / CONTRAST_SPREAD) ** 2

    values = np.array([likelihood(each) for each in CONTRASTS])
    best = int(np.argmax(values))
    if best in (0, len(values) - 1):
        return max(CONTRASTS[best], LEAST_CONTRAST)
    # The maximum of the parabola through the best value and its neighbours.
    before, here, after = values[best - 1 : best + 2]
    step = CONTRASTS[best] - CONTRASTS[best - 1]
    moved = 0.5 * step * float((after - before) / (2.0 * here - before - after))
    return max(CONTRASTS[best] + moved, LEAST_CONTRAST)
