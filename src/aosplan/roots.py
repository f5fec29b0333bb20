"""Root finding for conditions that, once true, stay true."""

from __future__ import annotations

from itertools import count
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


def smallest_root(excess: Callable[[float], float], low: float, high: float) -> float:
    """Smallest number in [low, high] at which a function that never rises is at most 0.

    `excess(high)` must be.  The Illinois method (Dowell and Jarratt, 1971), every fourth step a
    bisection; the result is on the right side, and its neighbour below is not, but for rounding.
    """
    above, below = excess(low), excess(high)
    if above <= 0.0:
        return low
    for step in count(1):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        guess = high - below * (high - low) / (below - above) if below < 0.0 else middle
        if step % 4 == 0 or not low < guess < high:
            guess = middle
        value = excess(guess)
        # An end that stays twice counts half as much, so that it moves the next time.
        if value <= 0.0:
            above, high, below = (0.5 * above if guess != middle else above), guess, value
        else:
            below, low, above = (0.5 * below if guess != middle else below), guess, value
    return high


def smallest_whole(holds: Callable[[int], bool], low: int, high: int) -> int:
    """Smallest whole number in [low, high] at which a condition holds; `holds(high)` is true."""
    while low < high:
        middle = (low + high) // 2
        if holds(middle):
            high = middle
        else:
            low = middle + 1
    return high
