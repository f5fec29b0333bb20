"""Flight time: legs from stop to stop with bounded acceleration, and a hold at each site."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from aosplan.pattern import Pattern


class Timing(NamedTuple):
    """How a drone flies between photos: cruise speed, acceleration, and stop at each site."""

    speed_mps: float = 5.0
    acceleration_mps2: float = 2.0
    hold_s: float = 1.0

    def leg_s(self, length_m: float) -> float:
        """Time from stop to stop: a trapezoid of speed, or a triangle where the leg is short."""
        if length_m >= self.speed_mps**2 / self.acceleration_mps2:
            return length_m / self.speed_mps + self.speed_mps / self.acceleration_mps2
        return 2.0 * math.sqrt(length_m / self.acceleration_mps2)


class Path(NamedTuple):
    """Legs of a flight over a pattern: lengths in baselines, with how often each occurs."""

    legs: tuple[tuple[float, int], ...]
    samples: int

    def length_m(self, baseline_m: float) -> float:
        """Length of the path from the first site to the last."""
        return baseline_m * math.fsum(length * count for length, count in self.legs)

    def time_s(self, baseline_m: float, timing: Timing) -> float:
        """Time from the first site to the last, with a hold at each."""
        legs = (timing.leg_s(length * baseline_m) * count for length, count in self.legs)
        return self.samples * timing.hold_s + math.fsum(legs)


def path_of(pattern: Pattern) -> Path:
    """The legs of a pattern in flight order."""
    legs = Counter(
        math.hypot(to[1] - start[1], (to[0] - start[0]) * pattern.row_pitch)
        for start, to in pairwise(pattern.sites())
    )
    return Path(tuple(sorted(legs.items())), pattern.samples)
