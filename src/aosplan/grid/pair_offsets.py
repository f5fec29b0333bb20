"""Counts of pairs of sites on a lattice by their offset."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


DIRECT_PAIRS = 4_000_000
"""Largest product of lattice offsets and sites for which direct counting is faster than a Fourier
transform.
"""


def offset_counts(mask: NDArray[np.bool_], reach_y: int, reach_x: int) -> NDArray[np.float64]:
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
    import numpy as np

    rows, columns = mask.shape
    offsets = (reach_y + 1) * (2 * reach_x + 1)
    if offsets * mask.size <= DIRECT_PAIRS or offsets <= 4:
        counts = np.zeros((2 * reach_y + 1, 2 * reach_x + 1))
        for dy in range(reach_y + 1):
            for dx in range(-reach_x, reach_x + 1):
                here = mask[: rows - dy, max(0, -dx) : columns - max(0, dx)]
                there = mask[dy:, max(0, dx) : columns + min(0, dx)]
                found = np.count_nonzero(here & there)
                counts[reach_y + dy, reach_x + dx] = found
                counts[reach_y - dy, reach_x - dx] = found
        return counts
    from scipy import fft

    shape = (
        fft.next_fast_len(rows + reach_y, real=True),
        fft.next_fast_len(columns + reach_x, real=True),
    )
    spectrum = fft.rfft2(mask.astype(np.float64), shape)
    pairs: NDArray[np.float64] = np.rint(fft.irfft2(np.abs(spectrum) ** 2, shape))
    wanted_y = np.arange(-reach_y, reach_y + 1) % shape[0]
    wanted_x = np.arange(-reach_x, reach_x + 1) % shape[1]
    return pairs[np.ix_(wanted_y, wanted_x)]
