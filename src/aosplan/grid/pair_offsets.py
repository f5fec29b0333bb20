"""Counts of pairs of sites on a lattice by their offset."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from aosplan.grid.patterns import Pattern

    Counts = NDArray[np.float64]


def offset_counts(mask: NDArray[np.bool_], reach_y: int, reach_x: int) -> Counts:
    """Number of ordered pairs of sites at each offset of a lattice.

    Parameters
    ----------
    mask
        Shape (rows, columns); true for each lattice point that is a site.
    reach_y, reach_x
        Largest offsets to count.  They are smaller than the number of rows and the number of
        columns.

    Returns
    -------
    ndarray
        Shape (2 reach_y + 1, 2 reach_x + 1), whole numbers; offset (0, 0) is in the middle.
    """
    offsets = (reach_y + 1) * (2 * reach_x + 1)
    transformed = (mask.shape[0] + reach_y) * (mask.shape[1] + reach_x)
    # Approximate times of the two methods in microseconds, from measurements.
    if offsets * (5.0 + mask.size / 4000.0) <= 80.0 + 0.05 * transformed:
        return counted_directly(mask, reach_y, reach_x)
    return counted_by_transform(mask, reach_y, reach_x)


def counted_directly(mask: NDArray[np.bool_], reach_y: int, reach_x: int) -> Counts:
    """`offset_counts` by comparing the mask with a shifted copy of itself for each offset."""
    import numpy as np

    rows, columns = mask.shape
    counts = np.zeros((2 * reach_y + 1, 2 * reach_x + 1))
    for dy in range(reach_y + 1):
        for dx in range(-reach_x, reach_x + 1):
            here = mask[: rows - dy, max(0, -dx) : columns - max(0, dx)]
            there = mask[dy:, max(0, dx) : columns + min(0, dx)]
            found = np.count_nonzero(here & there)
            counts[reach_y + dy, reach_x + dx] = found
            counts[reach_y - dy, reach_x - dx] = found
    return counts


def counted_by_transform(mask: NDArray[np.bool_], reach_y: int, reach_x: int) -> Counts:
    """`offset_counts` by a Fourier transform, which gives the counts of all offsets together."""
    import numpy as np

    shape = _fast_length(mask.shape[0] + reach_y), _fast_length(mask.shape[1] + reach_x)
    spectrum = np.fft.rfft2(mask.astype(np.float64), shape)
    pairs: Counts = np.rint(np.fft.irfft2(spectrum.real**2 + spectrum.imag**2, shape))
    wanted_y = np.arange(-reach_y, reach_y + 1) % shape[0]
    wanted_x = np.arange(-reach_x, reach_x + 1) % shape[1]
    return pairs[np.ix_(wanted_y, wanted_x)]


def _fast_length(least: int) -> int:
    """The smallest number of the form 2^k or 3 · 2^k that is at least `least`. Transforms of such
    lengths are fast.
    """
    power = 1 << (least - 1).bit_length()
    return 3 * power // 4 if 3 * power // 4 >= least and power >= 4 else power


def quadrant_counts(pattern: Pattern, reach_y: int, reach_x: int) -> Counts:
    """Number of ordered pairs of sites by offset, shape (reach_y + 1, reach_x + 1).

    The counts of an offset and of its mirror images are added up. These sums are sufficient for a
    quantity that is equal in all four quadrants.
    """
    import numpy as np

    if pattern.removed:
        mask = np.ones((pattern.rows, pattern.columns), dtype=bool)
        mask[tuple(np.transpose(pattern.removed))] = False
        full = offset_counts(mask, reach_y, reach_x)
        rows = full[reach_y:] + np.vstack([np.zeros_like(full[:1]), full[:reach_y][::-1]])
        left = np.hstack([np.zeros_like(rows[:, :1]), rows[:, :reach_x][:, ::-1]])
        quadrant: Counts = rows[:, reach_x:] + left
        return quadrant
    along_y = pattern.rows - np.arange(reach_y + 1.0)
    along_x = pattern.columns - np.arange(reach_x + 1.0)
    along_y[1:] *= 2.0
    along_x[1:] *= 2.0
    return np.outer(along_y, along_x)
