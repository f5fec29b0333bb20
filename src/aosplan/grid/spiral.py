"""Spirals: sites along one line that winds inward and out again, before metres enter.

Two arms of an Archimedean spiral meet in the middle, each the other turned by half a circle; their
turns lie an even distance apart.  The drone flies in along one and out along the other, straight
from site to site, each one baseline from the one before.  The middle of the sites is that of
the spiral, whatever their number, and a spiral is part of each longer one by an even number.
"""

from __future__ import annotations

import math
from collections import Counter
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator


class Spiral(NamedTuple):
    """The innermost sites of a double spiral whose turns are `turn_pitch` baselines apart.

    It passes its middle along x, the heading, and then turns to the right.
    """

    samples: int
    turn_pitch: float = 4.0

    @property
    def rows(self) -> int:
        """One: a spiral is a single line of sites, wound up."""
        return 1

    @property
    def columns(self) -> int:
        """All the sites of that line."""
        return self.samples

    @property
    def pitch(self) -> tuple[float, float]:
        """Distances between neighbours along the line and across it, in baselines."""
        return 1.0, self.turn_pitch

    @property
    def extent(self) -> tuple[float, float]:
        """Size of the rectangle around the sites, along x and y, in baselines."""
        x, y, _ = self._arm.reach[self.samples // 2]
        return 2.0 * x, 2.0 * y

    @property
    def longer_side(self) -> float:
        """The larger of the two extents, in baselines."""
        return max(self.extent)

    @property
    def nearest(self) -> float:
        """Least distance of two sites, the larger of those along x and y, in baselines.

        At most 1, and with turns 2 baselines apart or more at least 0.7: neighbours lie askew.
        """
        return self._arm.reach[self.samples // 2][2]

    def offsets(self) -> Iterator[tuple[float, float]]:
        """The sites as (x, y) from the middle, in baselines and flight order."""
        arm = self._arm.sites[: self.samples // 2]
        yield from ((-x, -y) for x, y in reversed(arm))
        if self.samples % 2:
            yield 0.0, 0.0
        yield from arm

    def steps(self) -> Counter[tuple[float, float]]:
        """Ways along x and y from site to site, in baselines, and how often each."""
        return Counter((to_x - x, to_y - y) for (x, y), (to_x, to_y) in pairwise(self.offsets()))

    @property
    def _arm(self) -> Arm:
        """The outward arm, long enough for the spiral."""
        arm = _arm(self.turn_pitch, self.samples % 2 == 1)
        arm.extend(self.samples // 2)
        return arm


class Arm:
    """One arm of a spiral as far as it was asked for, and what its first sites have in common.

    The first site lies a baseline from the middle, where there is one in the middle, else half.
    `reach` holds, for each number of sites, the largest |x| and |y|, and the least distance.
    """

    def __init__(self, turn_pitch: float, *, from_middle: bool) -> None:
        self.sites: list[tuple[float, float]] = []
        self.reach = [(0.0, 0.0, 1.0)]
        self._growth = turn_pitch / math.pi  # radius over angle: the other arm lies between turns
        self._angle = (1.0 if from_middle else 0.5) / self._growth
        self._cells = {(0, 0): [(0.0, 0.0)]} if from_middle else {}

    def extend(self, samples: int) -> None:
        """Wind on to a number of sites."""
        while len(self.sites) < samples:
            radius = self._growth * self._angle
            x, y = radius * math.cos(self._angle), radius * math.sin(self._angle)
            most_x, most_y, least = self.reach[-1]
            least = min(least, self._least_distance(x, y), self._least_distance(-x, -y))
            self.reach.append((max(most_x, abs(x)), max(most_y, abs(y)), least))
            self.sites.append((x, y))
            self._angle = self._next_angle()

    def _next_angle(self) -> float:
        """Angle of the site a baseline on: r² + R² - 2 r R cos(Δ) = 1, by Newton's method."""
        start, growth = self._angle, self._growth
        here = growth * start
        angle = start + 1.0 / math.hypot(growth, here)
        for _ in range(20):
            there, cosine = growth * angle, math.cos(angle - start)
            excess = here * here + there * there - 2.0 * here * there * cosine - 1.0
            slope = 2.0 * growth * (there - here * cosine)
            slope += 2.0 * here * there * math.sin(angle - start)
            step = excess / slope
            angle -= step
            if abs(step) <= 1e-15 * angle:
                break
        return angle

    def _least_distance(self, x: float, y: float) -> float:
        """Least distance to the sites so far, the larger of both axes; those within 1 are seen."""
        column, row = math.floor(x), math.floor(y)
        around = (
            site
            for across in (row - 1, row, row + 1)
            for along in (column - 1, column, column + 1)
            for site in self._cells.get((across, along), ())
        )
        least = min((max(abs(x - at[0]), abs(y - at[1])) for at in around), default=1.0)
        self._cells.setdefault((row, column), []).append((x, y))
        return least


@lru_cache(maxsize=64)
def _arm(turn_pitch: float, from_middle: bool) -> Arm:  # noqa: FBT001
    return Arm(turn_pitch, from_middle=from_middle)
