"""Formulas that work on floats and on arrays.

Each formula is written once, as a kernel: a function that uses only arithmetic operators and the
functions of a namespace `xp`. For floats, `xp` is `SCALARS`, which uses `math`. A plain command
therefore does not import numpy. For arrays, `xp` is numpy, and the kernel is applied to blocks that
fit the processor's cache.
"""

from __future__ import annotations

import math
from itertools import count
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    Floats = float | NDArray[np.float64]
    """A float, or an array of floats."""

BLOCK = 8192
"""Number of elements of a block. Each operand then takes 64 KiB, and the temporary arrays of a
kernel fit into the L2 cache.
"""


class _Scalars:
    """The numpy functions that the kernels use, implemented for floats."""

    minimum = staticmethod(min)
    maximum = staticmethod(max)
    floor = staticmethod(math.floor)
    exp = staticmethod(math.exp)
    expm1 = staticmethod(math.expm1)
    sqrt = staticmethod(math.sqrt)
    tan = staticmethod(math.tan)
    radians = staticmethod(math.radians)

    @staticmethod
    def log1p(x: float) -> float:
        return math.log1p(x) if x > -1.0 else -math.inf

    @staticmethod
    def where(condition: object, yes: float, no: float) -> float:
        return yes if condition else no


SCALARS = _Scalars()


def elementwise(kernel: Callable[..., Any], *arguments: Any) -> Any:
    """Apply a kernel to floats directly, or to broadcast arrays block by block.

    Parameters
    ----------
    kernel
        ``kernel(xp, *arguments)`` returns ``(value, valid)``: the value of the formula, and whether
        the arguments are in the domain of the formula.
    arguments
        Floats, or anything that numpy can broadcast.

    Returns
    -------
    float or ndarray
        The value if the arguments are in the domain, and ``nan`` otherwise.
    """
    if all(isinstance(argument, (float, int)) for argument in arguments):
        try:
            if any(map(math.isnan, arguments)):
                return math.nan
            value, valid = kernel(SCALARS, *map(float, arguments))
        except (
            ZeroDivisionError,
            OverflowError,
            ValueError,
        ):  # In these cases, numpy returns inf or nan, which are not valid either.
            return math.nan
        return float(value) if valid else math.nan

    import numpy as np

    arrays = [np.asarray(argument) for argument in arguments]
    options: dict[str, Any] = {
        "flags": ["external_loop", "buffered", "zerosize_ok"],
        "op_flags": [["readonly"]] * len(arrays) + [["writeonly", "allocate"]],
        "op_dtypes": [np.float64] * (len(arrays) + 1),
        "casting": "same_kind",
        "buffersize": BLOCK,
    }
    iterator: Any = np.nditer([*arrays, None], **options)
    with iterator, np.errstate(all="ignore"):
        for *block, result in iterator:
            value, valid = kernel(np, *block)
            result[...] = value
            if not np.all(valid):
                result[~np.broadcast_to(valid, result.shape)] = np.nan
        return iterator.operands[-1][()]


def triangle(distance: Any, xp: Any = SCALARS) -> Any:
    """Overlap max(0, 1 - |u|) of two intervals of length 1 whose centres are u apart."""
    return xp.maximum(1.0 - abs(distance), 0.0)


def heading_axis(heading_deg: float) -> tuple[float, float]:
    """East and north components of the unit vector along a heading.  The heading is clockwise from
    true north.
    """
    heading = math.radians(math.fmod(heading_deg, 360.0))
    return math.sin(heading), math.cos(heading)


def turned(first: Any, second: Any, axis: tuple[float, float]) -> tuple[Any, Any]:
    """Convert between (east, north) and (x along a heading, y to its right).

    Both conversions are the same reflection, because a reflection is its own inverse.

    Parameters
    ----------
    first, second
        East and north, or x and y, as floats or arrays.
    axis
        Result of `heading_axis` for the heading.
    """
    east, north = axis
    return first * east + second * north, first * north - second * east


def smallest(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Smallest number in [low, high] for which a condition is true.

    If the condition is true for a number, it must be true for all larger numbers. `holds(high)`
    must be true. The bisection continues to the last bit of the float. The condition is true for
    the result.
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
    """Smallest number in [low, high] at which a monotone decreasing function is at most 0.

    `excess(high)` must be at most 0. This is the Illinois method (Dowell and Jarratt, 1971) with
    two additions. If four steps have not made the interval eight times narrower, a bisection
    follows. If the root is within rounding errors of an end of the interval, the next step is to
    the neighbouring float. The function is at most 0 at the result, and above 0 at the next smaller
    float, except for rounding errors.
    """
    above, below = excess(low), excess(high)
    if above <= 0.0:
        return low
    width, moved, beside_end = high - low, 0, False
    for step in count(1):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        guess = high - below * (high - low) / (below - above)
        if low < guess < high:
            beside_end = False
        elif beside_end:  # The function is 0 at this end and at the neighbouring float.
            guess, beside_end = middle, False
        else:
            guess = math.nextafter(low, high) if guess <= low else math.nextafter(high, low)
            beside_end = True
        if step % 4 == 0:
            guess = middle if high - low > 0.125 * width else guess
            width = high - low
        value = excess(guess)
        # If an end is kept twice, the value at this end is halved. The next step then moves this
        # end.
        if value <= 0.0:
            above *= 0.5 if moved == 1 else 1.0
            high, below, moved = guess, value, 1
        else:
            below *= 0.5 if moved == -1 else 1.0
            low, above, moved = guess, value, -1
    return high


def smallest_whole(holds: Callable[[int], bool], low: int, high: int) -> int:
    """Smallest whole number in [low, high] for which a monotone condition is true; `holds(high)`
    must be true.
    """
    while low < high:
        middle = (low + high) // 2
        if holds(middle):
            high = middle
        else:
            low = middle + 1
    return high
