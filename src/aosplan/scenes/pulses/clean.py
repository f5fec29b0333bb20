"""Cleaning of returns: removes exact duplicates, and finds flight lines without ground."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.scenes.pulses.returns import Returns

LOW_SHARE = 0.005
"""The pulses of a flight line are assumed to reach the ground if at least this share of its last
returns is below the cut.
"""

LONGEST_PAUSE_S = 5.0
"""A flight line is split at each pause that is longer than this. A pause is a time without returns
from the stand.
"""


def without_duplicates(returns: Returns) -> Returns:
    """Returns without duplicates, in their order.

    Duplicates have the same coordinates, return number, flight line and time.  They occur in
    overlapping tiles and in files that were merged twice.
    """
    odd = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
    key = np.zeros(returns.number.size, dtype=np.uint64)
    for axis in range(3):
        key ^= returns.raw[axis].astype(np.int64).view(np.uint64) * odd[axis]
        key = _mixed(key)
    key ^= np.ascontiguousarray(returns.time_s).view(np.uint64)
    key = _mixed(key)
    key ^= returns.number.astype(np.uint64) | (returns.total.astype(np.uint64) << np.uint64(8))
    key ^= returns.line.astype(np.int64).view(np.uint64) << np.uint64(16)
    _, first = np.unique(_mixed(key), return_index=True)
    return returns if first.size == key.size else returns.take(np.sort(first))


def _mixed(key: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Mix the bits of keys (the finaliser of MurmurHash3). Different keys rarely give the same
    result.
    """
    key = (key ^ (key >> np.uint64(33))) * np.uint64(0xFF51AFD7ED558CCD)
    key = (key ^ (key >> np.uint64(33))) * np.uint64(0xC4CEB9FE1A85EC53)
    mixed: NDArray[np.uint64] = key ^ (key >> np.uint64(33))
    return mixed


def split_lines(returns: Returns, *, timed: bool) -> Returns:
    """Number the flight lines from 0, and split them at long pauses."""
    _, line = np.unique(returns.line, return_inverse=True)
    if not timed:
        return returns._replace(line=line.astype(np.int32))
    order = np.lexsort((returns.time_s, line))
    time_s, of = returns.time_s[order], line[order]
    begins = np.ones(order.size, dtype=np.bool_)
    begins[1:] = (np.diff(of) != 0) | (np.diff(time_s) > LONGEST_PAUSE_S)
    numbers = np.empty(order.size, dtype=np.int32)
    numbers[order] = np.cumsum(begins) - 1
    return returns._replace(line=numbers)


def lines_with_ground(returns: Returns, low: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mask of the returns in flight lines whose last returns reach the ground.

    If a cloud was clipped by height or by class, some lines do not have low returns. If these lines
    were used, every pulse in them would count as intercepted.
    """
    last = returns.number == returns.total
    lines = int(returns.line.max(initial=-1)) + 1
    reached = np.bincount(returns.line[last], low[last], lines)
    total = np.bincount(returns.line[last], minlength=lines)
    kept: NDArray[np.bool_] = (reached >= np.maximum(LOW_SHARE * total, 1.0))[returns.line]
    return kept
