"""From voxels to the numbers of the models: density and occluder size, slice by slice.

What a slice shows from above is a random mask: a voxel is occupied or not.  Its density D is the
occupied share.  Its occluder size o is the integral range: a slice of cubes of edge o placed at
random has the correlation (1 - |x|/o)+ (1 - |y|/o)+, which integrates over the plane to o², so
the root of that integral is o, whatever the shape of the clumps.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.scenes.scene import Layer, LayeredScene

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.scenes.voxels import VoxelVolume


ANGLES_DEG = (10.0, 20.0, 30.0, 40.0)
VIEWS_AN_ANGLE = 8

FEW_CELLS = 1_000_000
"""Cells of a slice up to which its integral range is taken from all pairs of them."""

SAMPLED_CELLS = 1_000_000
"""Cells in the windows from which a larger slice's near lags are taken."""

BLOCKS, LEAST_BLOCK, MOST_BLOCK = 256, 8, 16
"""A larger slice has about so many blocks along its longer side, of so many cells (8 or 16)."""

NEAR_BLOCKS = 4
"""Lags nearer than so many blocks are taken cell by cell,"""

WINDOW_BLOCKS = 32
"""in windows of so many blocks."""


def layered_scene(volume: VoxelVolume, name: str) -> LayeredScene:
    """Describe a volume by a layer for each slice that holds anything.

    Parameters
    ----------
    volume
        Of at least one cell of ground.
    name
        How the output calls the scene.

    Returns
    -------
    LayeredScene
        Its density is the column occupancy, since the slices of a stand are not independent.
        Bare ground has one layer, of density 0.
    """
    voxel, slice_m = volume.voxel_m, volume.slice_height_m
    layers = [
        Layer(
            # The cut may lie within the lowest slice.
            max(k * slice_m, volume.min_height_m),
            (k + 1) * slice_m,
            float(density),
            integral_range(volume.occupied[k]) * voxel,
        )
        for k, density in enumerate(volume.slice_densities)
        if density > 0.0
    ]
    if not layers:
        base = volume.min_height_m
        layers = [Layer(base, base + slice_m, 0.0, slice_m)]
    return LayeredScene(
        name=name,
        layers=tuple(layers),
        measured_density=volume.column_occupancy,
        voxel_m=slice_m,
        source=volume.source,
    )


def densities_off_nadir(volume: VoxelVolume) -> list[list[float]]:
    """Density of views off nadir: pairs of an angle [deg] and p, the mean over directions.

    A few views only; the correlogram (`aosplan.scenes.correlogram`) has many.
    """
    from aosplan.scenes.occlusion import popcount
    from aosplan.scenes.sampled_targets import views_of

    altitude_m = 2.0 * volume.canopy_top_m + 1.0  # any altitude shows the same
    occlusion = views_of(volume, altitude_m)
    turns = np.arange(VIEWS_AN_ANGLE) * (2.0 * np.pi / VIEWS_AN_ANGLE)
    unit = np.column_stack([np.sin(turns), np.cos(turns)])
    pairs = [[0.0, volume.column_occupancy]]
    for angle in ANGLES_DEG:
        hidden = popcount(occlusion.masks(altitude_m * np.tan(np.radians(angle)) * unit))
        pairs.append([angle, float(hidden.mean()) / occlusion.targets])
    return pairs


def integral_range(mask: NDArray[np.bool_]) -> float:
    """Integral range of a mask that wraps around at its edges, in cells.

    The correlation is averaged over rings of lags one cell wide and summed from lag 0 up to
    the first ring where it is not positive, half the shorter side at most: beyond lies noise,
    and over all lags the sum is 0 by construction.  Independent cells give 1, blocks of k x k
    cells k, both a few per cent too large.

    Parameters
    ----------
    mask
        Shape (rows, columns), at least one cell set.

    Returns
    -------
    float
        1 or little less at the least; a full mask is one occluder as large as its shorter side.
    """
    density = np.count_nonzero(mask) / mask.size
    if density == 1.0:
        return float(min(mask.shape))
    if mask.size > FEW_CELLS and min(mask.shape) >= WINDOW_BLOCKS * MOST_BLOCK:
        return _sampled_range(mask, density)
    from scipy import fft  # for the many slices of a stand twice as fast as numpy's

    area, _ = correlation_range(mask.astype(np.float32) - np.float32(density), fft)
    return float(np.sqrt(area))


def _sampled_range(mask: NDArray[np.bool_], density: float) -> float:
    """Integral range of a wide mask: near lags from windows of it, far ones from its blocks' means.

    The first rings are those of `integral_range`, as pairs of cells within windows spread over
    the mask have them.  Farther off the correlation is smooth, and each lag between blocks stands
    for all lags between their cells.
    """
    block = LEAST_BLOCK if max(mask.shape) < 2 * LEAST_BLOCK * BLOCKS else MOST_BLOCK
    near = block * NEAR_BLOCKS - block // 2
    variance = density * (1.0 - density)
    rings = near_rings(mask, density, near, WINDOW_BLOCKS * block) / variance
    ends = np.flatnonzero(rings <= 0.0)
    if ends.size:
        return float(np.sqrt(rings[: ends[0]].sum()))
    from scipy import fft

    shares = block_sums(mask, block) / np.float32(block * block)
    rows, columns = shares.shape
    shares -= shares.mean()
    spectrum = fft.rfft2(shares)
    covariance = fft.irfft2(spectrum.real**2 + spectrum.imag**2, s=shares.shape) / shares.size
    far = np.bincount(_rings(rows, columns), covariance.ravel()) * (block * block / variance)
    far = far[NEAR_BLOCKS : min(rows, columns) // 2 + 1]
    ends = np.flatnonzero(far <= 0.0)
    return float(np.sqrt(rings.sum() + far[: ends[0] if ends.size else len(far)].sum()))


def near_rings(
    mask: NDArray[np.bool_], density: float, near: int, side: int
) -> NDArray[np.float64]:
    """Covariance of cells summed over rings of lags from 0 to below `near`, shape (near,).

    It is that of pairs within square windows, as many as make `SAMPLED_CELLS`.
    """
    from scipy import fft

    rows, columns = mask.shape
    count = max(SAMPLED_CELLS // side**2, 1)
    # On a plane that is wider than deep more of them lie along its width.
    across = min(max(round(np.sqrt(count * columns / rows)), 1), columns // side)
    down = min(max(round(count / across), 1), rows // side)
    size = fft.next_fast_len(side + near, real=True)
    windows = np.zeros((down * across, size, size), dtype=np.float32)
    south = np.linspace(0, rows - side, down + 2).astype(int)[1:-1]
    west = np.linspace(0, columns - side, across + 2).astype(int)[1:-1]
    for number, (y, x) in enumerate((y, x) for y in south for x in west):
        windows[number, :side, :side] = mask[y : y + side, x : x + side]
        windows[number, :side, :side] -= np.float32(density)
    spectrum = fft.rfft2(windows)
    power = (spectrum.real**2 + spectrum.imag**2).sum(axis=0)
    lag = np.concatenate([np.arange(near), np.arange(-near + 1, 0)])
    sums = fft.irfft2(power, s=(size, size))[np.ix_(lag, lag)]
    overlap = (side - np.abs(lag)).astype(np.float64)
    covariance = sums / (len(windows) * overlap[:, np.newaxis] * overlap)
    ring = np.rint(np.hypot(lag[:, np.newaxis], lag)).astype(np.intp)
    return np.bincount(ring.ravel(), covariance.ravel())[:near].astype(np.float64)


def block_sums(mask: NDArray[np.bool_], block: int) -> NDArray[np.float32]:
    """Number of set cells of each whole block of block x block cells, a multiple of 8."""
    rows, columns = (length // block * block for length in mask.shape)
    octets = np.ascontiguousarray(mask[:rows, :columns]).view(np.uint8)
    # Eight cells are added at a time: a word of eight octets, none of which overflows.
    words = octets.view(np.uint64).reshape(rows // block, block, columns // 8).sum(axis=1)
    cells = words.view(np.uint8).reshape(len(words), columns // block, block)
    sums: NDArray[np.float32] = cells.sum(axis=2, dtype=np.float32)
    return sums


def correlation_range(field: NDArray[np.floating], fft: Any = np.fft) -> tuple[float, int]:
    """Integral of the correlation of a wrapped field of mean 0, in cells, and the lags in it.

    As far as in `integral_range`, whose square it is for a mask.

    Parameters
    ----------
    field
        Shape (rows, columns), not 0 everywhere.
    fft
        Module of the transforms: ``numpy.fft``, or ``scipy.fft``, whose import takes longer than
        a plan.
    """
    rows, columns = field.shape
    spectrum = fft.rfft2(field)
    power = spectrum.real**2 + spectrum.imag**2
    covariance = fft.irfft2(power, s=field.shape)
    ring = _rings(rows, columns)
    totals = np.bincount(ring, covariance.ravel() / covariance[0, 0])
    totals = totals[: min(rows, columns) // 2 + 1]
    ends = np.flatnonzero(totals <= 0.0)
    end = int(ends[0]) if ends.size else len(totals)
    return float(totals[:end].sum()), int(np.count_nonzero(ring < end))


@lru_cache(maxsize=1)
def _rings(rows: int, columns: int) -> NDArray[np.intp]:
    """Ring, the rounded length, of every lag of a wrapped mask, shape (rows * columns,)."""
    y, x = (np.minimum(np.arange(n), n - np.arange(n)) for n in (rows, columns))
    return np.rint(np.hypot(y[:, np.newaxis], x)).astype(np.intp).ravel()
