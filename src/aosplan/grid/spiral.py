"""Double spirals: sites on one line that winds inwards and out again.  The unit of length is the
baseline.

Two arms of an Archimedean spiral meet in the centre. Rotating one arm by half a turn gives the
other arm. The distance between turns is constant. The drone flies inwards along one arm and
outwards along the other, on a straight line from site to site. Consecutive sites are one baseline
apart. The centre of the sites is the centre of the spiral for every number of sites. The sites of a
spiral are also sites of every longer spiral, if the two numbers of sites differ by an even number.
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

    At its centre the spiral runs along x, the heading, and then turns to the right.
    """

    samples: int
    turn_pitch: float = 4.0

    @property
    def rows(self) -> int:
        """The number of rows, which is 1 because all sites of a spiral are on a single line."""
        return 1

    @property
    def columns(self) -> int:
        """The number of sites of the spiral, which are all on a single line."""
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
        """Smallest distance between two sites, in baselines.

        The distance of two sites is the larger of their distances along x and y. The result is at
        most 1, and it is at least 0.7 if turns are 2 baselines apart or more. It is usually less
        than 1 because neighbouring sites are not aligned with the axes.
        """
        return self._arm.reach[self.samples // 2][2]

    def offsets(self) -> Iterator[tuple[float, float]]:
        """The sites as (x, y) from the centre, in baselines and in flight order."""
        arm = self._arm.sites[: self.samples // 2]
        yield from ((-x, -y) for x, y in reversed(arm))
        if self.samples % 2:
            yield 0.0, 0.0
        yield from arm

    def steps(self) -> Counter[tuple[float, float]]:
        """Steps along x and y from site to site, in baselines, and the number of times that each
        step occurs.
        """
        return Counter((to_x - x, to_y - y) for (x, y), (to_x, to_y) in pairwise(self.offsets()))

    @property
    def _arm(self) -> Arm:
        """The outward arm, extended to the number of sites that the spiral has."""
        arm = _arm(self.turn_pitch, self.samples % 2 == 1)
        arm.extend(self.samples // 2)
        return arm


class Arm:
    """The sites of one arm of a spiral, computed as far as needed.

    If there is a site at the centre, the first site of the arm is one baseline from the centre;
    otherwise it is half a baseline from the centre.  `reach[n]` has the largest |x|, the largest
    |y| and the smallest distance of the first n sites.
    """

    def __init__(self, turn_pitch: float, *, from_middle: bool) -> None:
        self.sites: list[tuple[float, float]] = []
        self.reach = [(0.0, 0.0, 1.0)]
        self._growth = turn_pitch / math.pi  # radius divided by angle, for each arm
        self._angle = (1.0 if from_middle else 0.5) / self._growth
        self._cells = {(0, 0): [(0.0, 0.0)]} if from_middle else {}

    def extend(self, samples: int) -> None:
        """Extend the arm to a number of sites."""
        while len(self.sites) < samples:
            radius = self._growth * self._angle
            x, y = radius * math.cos(self._angle), radius * math.sin(self._angle)
            most_x, most_y, least = self.reach[-1]
            least = min(least, self._least_distance(x, y), self._least_distance(-x, -y))
            self.reach.append((max(most_x, abs(x)), max(most_y, abs(y)), least))
            self.sites.append((x, y))
            self._angle = self._next_angle()

    def _next_angle(self) -> float:
        """Angle of the next site, which is one baseline from the last site.

        Let r and R be the radii of the two sites, and Δ the angle between them. The equation r² +
        R² - 2 r R cos(Δ) = 1 is solved by Newton's method.
        """
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
        """Smallest distance from (x, y) to the earlier sites. The distance is the larger of the
        distances along x and y.

        Only sites in neighbouring unit cells are compared, so the result is exact if it is below 1.
        """
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
