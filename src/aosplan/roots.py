"""Root finding for conditions that, once true, stay true."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


def smallest(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Smallest number in [low, high] at which a condition holds that, once true, stays true.

    `holds(high)` must be true.  Bisection to the last bit; the result is on the true side.
    """
    if holds(low):
        return low
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return high
        if holds(middle):
            high = middle
        else:
            low = middle


def smallest_whole(holds: Callable[[int], bool], low: int, high: int) -> int:
    """Smallest whole number in [low, high] at which a condition holds; `holds(high)` is true."""
    while low < high:
        middle = (low + high) // 2
        if holds(middle):
            high = middle
        else:
            low = middle + 1
    return high
