"""Density and occluder size of each slice of a voxel volume, for the models.

A slice is treated as a random mask of occupied and empty voxels.  The density D of a slice is its
occupied share.  The occluder size o of a slice is its integral range, for the following reason.
The mask of randomly placed cubes of edge o has the correlation (1 - |x|/o)+ (1 - |y|/o)+, and the
integral of this correlation over the plane is o².  For clumps of any shape, o is therefore the
square root of the integral of their correlation.
"""

from __future__ import annotations

import math
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
"""Number of cells of the largest slice whose integral range is computed from all pairs of cells."""

RIM_M = 2.0
"""Width of the rim of a plot that is compared with its middle."""

RIM_CELLS = 1000
"""Largest number of cells along a side of the part of a plot in which the size of its clumps is
measured.
"""

THIN_RIM = 0.1
"""Smallest difference of p between the middle of a plot and its rim that causes a warning."""

SAMPLED_CELLS = 1_000_000
"""If a slice has more cells, its near lags are computed from windows with this number of cells in
total.
"""

BLOCKS, LEAST_BLOCK, MOST_BLOCK = 256, 8, 16
"""Approximate number of blocks along the longer side of a larger slice; smallest and largest side
of a block, in cells.
"""

NEAR_BLOCKS = 4
"""Correlations at lags that are shorter than this number of blocks are computed from
single cells.
"""

WINDOW_BLOCKS = 32
"""Side, in blocks, of the windows from which near lags are computed."""


def layered_scene(volume: VoxelVolume, name: str) -> LayeredScene:
    """Describe a volume by one layer for each slice that has occupied voxels.

    Parameters
    ----------
    volume
        A volume with at least one cell of ground.
    name
        Name of the scene in the output.

    Returns
    -------
    LayeredScene
        A scene.  Its measured density is the column occupancy, because the slices of a stand are
        not independent.  Bare ground has one layer of density 0.
    """
    voxel, slice_m = volume.voxel_m, volume.slice_height_m
    layers = [
        Layer(
            # The minimum height may be within the lowest slice.
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
    """Density of views off nadir: pairs of an angle [deg] and p, averaged over directions.

    Only a few views are computed.  The correlogram (`aosplan.scenes.correlogram`) has many more.
    """
    from aosplan.scenes.hidden_counts import popcount
    from aosplan.scenes.sampled_targets import occlusion_of

    altitude_m = 2.0 * volume.canopy_top_m + 1.0  # The result does not depend on the altitude.
    occlusion = occlusion_of(volume, altitude_m)
    turns = np.arange(VIEWS_AN_ANGLE) * (2.0 * np.pi / VIEWS_AN_ANGLE)
    unit = np.column_stack([np.sin(turns), np.cos(turns)])
    pairs = [[0.0, volume.column_occupancy]]
    for angle in ANGLES_DEG:
        hidden = popcount(occlusion.masks(altitude_m * np.tan(np.radians(angle)) * unit))
        pairs.append([angle, float(hidden.mean()) / occlusion.targets])
    return pairs


def thin_rim(volume: VoxelVolume) -> tuple[float, float] | None:
    """p of vertical rays along the rim of a plot, and in its middle; None if the rim is not less
    dense than the middle.

    The rim is less dense if the difference of p is larger than `THIN_RIM` and larger than its
    standard error. The width of the rim is `RIM_M`, or an eighth of the width of a small plot. A
    plot that was clipped out of a cloud often lacks crowns of trees whose stems are outside of it.
    """
    hidden = volume.hidden_columns
    rows, columns = hidden.shape
    width = min(math.ceil(RIM_M / volume.voxel_m), min(rows, columns) // 8)
    if width == 0 or not 0.0 < volume.column_occupancy < 1.0:
        return None
    middle = hidden[width:-width, width:-width]
    inside = float(middle.mean())
    rim = (np.count_nonzero(hidden) - np.count_nonzero(middle)) / (hidden.size - middle.size)
    step = -(-max(rows, columns) // RIM_CELLS)
    part = hidden[::step, ::step]
    clump = step * math.sqrt(correlation_range(part - part.mean())[0])
    # If the rim is narrower than a clump, the number of clumps in it is its length divided by the
    # size of a clump.
    shares = clump**2 / middle.size + clump * min(clump, width) / (hidden.size - middle.size)
    p = volume.column_occupancy
    error = math.sqrt(p * (1.0 - p) * shares)
    return (float(rim), inside) if inside - rim > max(THIN_RIM, error) else None


def integral_range(mask: NDArray[np.bool_]) -> float:
    """Integral range of a periodic mask, in cells.

    The correlation is averaged over rings of lags that are one cell wide. The rings are summed from
    lag 0 to the first ring whose mean is not positive, but at most to half of the shorter side.
    Correlations at larger lags are noise, and the sum over all lags is always 0. The result is 1
    for independent cells, and k for blocks of k x k cells; both are a few per cent too large.

    Parameters
    ----------
    mask
        Shape (rows, columns), with at least one cell set.

    Returns
    -------
    float
        The range, which is at least 1 except for sampling errors.  A full mask is treated as one
        occluder that is as large as its shorter side.
    """
    density = np.count_nonzero(mask) / mask.size
    if density == 1.0:
        return float(min(mask.shape))
    if mask.size > FEW_CELLS and min(mask.shape) >= WINDOW_BLOCKS * MOST_BLOCK:
        return _sampled_range(mask, density)
    # scipy.fft is twice as fast as numpy.fft, which matters because a stand has many slices.
    from scipy import fft

    area, _ = correlation_range(mask.astype(np.float32) - np.float32(density), fft)
    return float(np.sqrt(area))


def _sampled_range(mask: NDArray[np.bool_], density: float) -> float:
    """Integral range of a large mask. Near lags are computed from windows, and far lags from the
    means of blocks.

    At small lags, the correlations are computed from pairs of cells within windows that are spread
    over the mask, on the same rings as in `integral_range`. At larger lags, the correlation is
    smooth. The correlation of two blocks is therefore used instead of the correlations of their
    cells.
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
    """Covariance of cells, summed over rings of lags from 0 to below `near`; shape (near,).

    It is computed from pairs within square windows with `SAMPLED_CELLS` cells in total.
    """
    from scipy import fft

    rows, columns = mask.shape
    count = max(SAMPLED_CELLS // side**2, 1)
    # A plot with more columns than rows has more windows along its rows.
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
    """Number of set cells in each complete block of block x block cells; `block` is a multiple of
    8.
    """
    rows, columns = (length // block * block for length in mask.shape)
    octets = np.ascontiguousarray(mask[:rows, :columns]).view(np.uint8)
    # Eight cells are added at once, as the eight octets of a 64-bit integer. No octet overflows.
    words = octets.view(np.uint64).reshape(rows // block, block, columns // 8).sum(axis=1)
    cells = words.view(np.uint8).reshape(len(words), columns // block, block)
    sums: NDArray[np.float32] = cells.sum(axis=2, dtype=np.float32)
    return sums


def correlation_range(field: NDArray[np.floating], fft: Any = np.fft) -> tuple[float, int]:
    """Integral of the correlation of a periodic field of mean 0, in cells, and the number of lags
    that the integral includes.

    The lags are limited as in `integral_range`.  For a mask, the integral is the square of the
    integral range.

    Parameters
    ----------
    field
        Shape (rows, columns), not 0 everywhere.
    fft
        Module with the transforms: ``numpy.fft`` or ``scipy.fft``.  Importing ``scipy.fft`` takes
        longer than a whole plan.
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
    """Index of the ring of every lag of a periodic mask, shape (rows * columns,).  The index is the
    rounded length of the lag.
    """
    y, x = (np.minimum(np.arange(n), n - np.arange(n)) for n in (rows, columns))
    return np.rint(np.hypot(y[:, np.newaxis], x)).astype(np.intp).ravel()
