"""Counts of hidden targets in the bit masks of `aosplan.scenes.occlusion`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.scenes.occlusion import Words

TARGETS_AT_ONCE = 1 << 24
"""Number of targets that are unpacked at once, summed over all views.  It is 2^24, because float32
counts exactly up to this number.
"""

BYTE_COUNTS = np.unpackbits(np.arange(256, dtype=np.uint8)[:, np.newaxis], axis=1).sum(
    axis=1, dtype=np.uint8
)


def popcount(words: Words) -> NDArray[np.int64]:
    """Number of set bits along the last axis."""
    if hasattr(np, "bitwise_count"):
        bits = np.bitwise_count(words)
    else:  # NumPy 1 does not have bitwise_count.
        bits = BYTE_COUNTS[np.ascontiguousarray(words).view(np.uint8)]
    return np.asarray(bits.sum(axis=-1, dtype=np.int64))


class HiddenCount:
    """Number of views in which each target is hidden, stored as binary digits.

    Let c be the number of views in which a target is hidden. Plane i contains bit i of c for every
    target. A view is added with a few operations on words. Σ c is computed from the number of set
    bits in each plane, and Σ c² from the number of bits that are set in both planes of a pair.
    """

    def __init__(self, words: int) -> None:
        self.views = 0
        self._words = words
        self._planes: list[Words] = []

    def add(self, mask: Words) -> None:
        """Add a view, shape (words,)."""
        self.views += 1
        if self.views.bit_length() > len(self._planes):
            self._planes.append(np.zeros(self._words, dtype=np.uint64))
        carry = mask
        for plane in self._planes:
            overflow = plane & carry
            np.bitwise_xor(plane, carry, out=plane)
            carry = overflow

    @property
    def planes(self) -> Words:
        """Binary digits of the counts as masks, beginning with the lowest digit, shape (digits,
        words).
        """
        return np.stack(self._planes)

    def moments(self) -> tuple[int, int]:
        """Exact values of Σ c and Σ c² over all targets."""
        joint = [[int(popcount(one & other)) for other in self._planes] for one in self._planes]
        squares = sum(bits << (i + k) for i, row in enumerate(joint) for k, bits in enumerate(row))
        return sum(row[i] << i for i, row in enumerate(joint)), squares


def joint_counts(masks: Words) -> NDArray[np.int64]:
    """Number of targets that are hidden in both views of a pair, for every pair, shape (N, N).

    Parameters
    ----------
    masks
        Shape (N, words), as `Occlusion.masks` returns them.
    """
    octets = masks.view(np.uint8)
    counts = np.zeros((len(masks), len(masks)), dtype=np.int64)
    step = max(TARGETS_AT_ONCE // (8 * max(len(masks), 1)), 1)
    for start in range(0, octets.shape[1], step):
        # A matrix product is faster here than operations on bits.
        bits = np.unpackbits(octets[:, start : start + step], axis=1).astype(np.float32)
        counts += (bits @ bits.T).astype(np.int64)
    return counts
