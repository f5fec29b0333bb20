"""Returns of laser pulses: the points of LAS and LAZ files with their return numbers and times."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.scenes.files.las import PointFile

    Floats = NDArray[np.float64]

NOISE_CLASSES = (7, 18)


class Returns(NamedTuple):
    """Returns in the order of their files; each array has length n.

    Attributes
    ----------
    xyz_m
        Shape (3, n): coordinates relative to the plot's origin.
    number, total
        Return number, and number of returns of the pulse.
    line
        Flight line: the point source ID of the file.
    time_s
        GPS time [s], or the index in the file if the files have no times.
    intensity
        Intensity as in the file.
    raw
        Shape (3, n): coordinates as integers of the file, to find exact duplicates.
    """

    xyz_m: Floats
    number: NDArray[np.uint8]
    total: NDArray[np.uint8]
    line: NDArray[np.int32]
    time_s: Floats
    intensity: NDArray[np.float32]
    raw: NDArray[np.int32]

    def take(self, which: NDArray[np.intp] | NDArray[np.bool_]) -> Returns:
        """Some of the returns, by index or by mask."""
        return Returns(
            self.xyz_m[:, which],
            self.number[which],
            self.total[which],
            self.line[which],
            self.time_s[which],
            self.intensity[which],
            self.raw[:, which],
        )


AROUND_M = 15.0
"""Width of a margin around the plot.  Returns in the margin are kept, because their pulses may
cross the edge of the plot.
"""

BLOCK = 1024
"""If records do not have times, this number of consecutive records is kept or left out together."""


def read_returns(
    files: Sequence[PointFile],
    origin_m: Floats,
    size_m: tuple[float, float] | None = None,
    share: float = 1.0,
) -> tuple[Returns, bool]:
    """Read the returns of a plot, without noise: the returns of all its pulses, or of a random
    share of its pulses.

    Parameters
    ----------
    files
        Files of one stand, read in this order.
    origin_m
        Shape (3,): origin of the coordinates, which is the corner of the plot.
    size_m
        Size of the plot along x and y; None for a plot that contains all returns.
    share
        Share of the pulses whose returns are kept, 0 to 1.

    Returns
    -------
    tuple
        The returns, and whether their times are GPS times.
    """
    parts: list[Returns] = []
    timed = True
    read = 0
    for file in files:
        for chunk in file.pulse_chunks():
            kept = ~chunk.withheld
            for noise in NOISE_CLASSES:
                kept &= chunk.kind != noise
            xyz = chunk.raw * file.scales_m[:, np.newaxis]
            xyz += (file.offsets_m - origin_m)[:, np.newaxis]
            times = chunk.time_s
            if times is None:
                timed = False
                times = np.arange(read, read + kept.size, dtype=np.float64)
            if size_m is not None:
                for axis, length in enumerate(size_m):
                    kept &= (xyz[axis] >= -AROUND_M) & (xyz[axis] <= length + AROUND_M)
            if share < 1.0:
                kept &= _drawn(times if timed else np.floor(times / BLOCK), share)
            read += kept.size
            part = Returns(
                xyz, chunk.number, chunk.total, chunk.line, times, chunk.intensity, chunk.raw
            )
            parts.append(part if kept.all() else part.take(kept))
    joined = Returns(*(np.concatenate(each, axis=-1) for each in zip(*parts, strict=True)))
    if timed and joined.time_s.size and np.ptp(joined.time_s) == 0.0:
        timed = False
        joined = joined._replace(time_s=np.arange(joined.time_s.size, dtype=np.float64))
    return joined, timed


def _drawn(times: Floats, share: float) -> NDArray[np.bool_]:
    """Mask of the returns of a random share of the pulses.  Returns with the same time are kept or
    left out together.
    """
    key = times.view(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    key ^= key >> np.uint64(32)
    key *= np.uint64(0xD6E8FEB86659FD93)
    drawn: NDArray[np.bool_] = key >> np.uint64(32) < np.uint64(share * 2.0**32)
    return drawn
