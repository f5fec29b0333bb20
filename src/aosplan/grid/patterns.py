"""Patterns of sites.  The unit of length is the baseline.

There are three kinds of patterns: a rectangle of rows and columns, from which a few sites may be
removed; a spiral (`aosplan.grid.spiral`); and sites at chosen places of a lattice. The columns of a
rectangle follow each other along the heading (x), and the rows across the heading (y). The distance
between neighbouring columns is 1 baseline. The distance between neighbouring rows is `row_pitch`
baselines.

A *frame* is a rectangle, together with the range of sample counts for which a kind of grid uses
this rectangle. Frames are ordered by increasing number of samples. A solver is fast because it
tests frames instead of every sample count.
"""

from __future__ import annotations

import heapq
import math
from collections import Counter
from functools import lru_cache
from itertools import count, pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.grid.spiral import Spiral
from aosplan.numerics import heading_axis, turned

if TYPE_CHECKING:
    from collections.abc import Iterator

LATTICES = ("trimmed", "rectangle", "square", "line", "lanes")
"""Kinds of grid with sites in rows and columns."""

GRIDS = (*LATTICES, "spiral")
"""All kinds of grid by name."""

NARROWEST_TURNS = 2.0
"""Smallest allowed distance between a spiral's turns, in baselines. At this or a larger distance,
each additional sample reduces the shortfall of V.
"""

MOST_SITES = 5_000_000
"""Largest number of sites. It is limited because all waypoints of a plan are in memory."""


class Pattern(NamedTuple):
    """A rectangle of sites, except the sites in `removed`, which are tuples (row, column)."""

    rows: int
    columns: int
    row_pitch: float = 1.0
    removed: tuple[tuple[int, int], ...] = ()

    @property
    def samples(self) -> int:
        """Number N of sites."""
        return self.rows * self.columns - len(self.removed)

    @property
    def extent(self) -> tuple[float, float]:
        """Size along x and y, in baselines."""
        return self.columns - 1.0, (self.rows - 1) * self.row_pitch

    @property
    def longer_side(self) -> float:
        """The larger of the two extents, in baselines."""
        return max(self.extent)

    @property
    def pitch(self) -> tuple[float, float]:
        """Distances between neighbouring sites along x and y, in baselines."""
        return 1.0, self.row_pitch

    @property
    def nearest(self) -> float:
        """Smallest distance between two sites, in baselines. The distance of two sites is defined
        as the larger of their distances along x and y.
        """
        return min(1.0, self.row_pitch)

    def sites(self) -> Iterator[tuple[int, int]]:
        """The sites as (row, column) in flight order: every other line is flown in reverse."""
        gone = set(self.removed)
        for row in range(self.rows):
            columns = range(self.columns) if row % 2 == 0 else range(self.columns - 1, -1, -1)
            for column in columns:
                if (row, column) not in gone:
                    yield row, column

    def offsets(self) -> Iterator[tuple[float, float]]:
        """The sites as (x, y) from the centre of the rectangle, in baselines and in flight order."""
        middle_x, middle_y = 0.5 * (self.columns - 1), 0.5 * (self.rows - 1)
        for row, column in self.sites():
            yield column - middle_x, (row - middle_y) * self.row_pitch

    def steps(self) -> Counter[tuple[float, float]]:
        """Steps along x and y from site to site in flight order, in baselines, and their counts.

        If no sites of a line are removed, its steps are counted without a loop over its sites.
        """
        gone: dict[int, set[int]] = {}
        for row, column in self.removed:
            gone.setdefault(row, set()).add(column)
        counts: Counter[tuple[float, float]] = Counter()
        last: tuple[int, int] | None = None
        for row in range(self.rows):
            way = 1 if row % 2 == 0 else -1
            if row not in gone:
                first, to = (0, self.columns - 1)[::way]
                if self.columns > 1:
                    counts[float(way), 0.0] += self.columns - 1
            else:
                kept = [column for column in range(self.columns) if column not in gone[row]][::way]
                if not kept:
                    continue
                first, to = kept[0], kept[-1]
                counts.update((float(b - a), 0.0) for a, b in pairwise(kept))
            if last is not None:
                counts[float(first - last[1]), (row - last[0]) * self.row_pitch] += 1
            last = row, to
        return counts


class Scattered(NamedTuple):
    """Sites as (x, y) in baselines from the origin of a plan, in flight order; at least one."""

    places: tuple[tuple[float, float], ...]

    @property
    def samples(self) -> int:
        """Number N of sites."""
        return len(self.places)

    @property
    def rows(self) -> int:
        """1, because the sites are flown as a single sequence."""
        return 1

    @property
    def columns(self) -> int:
        """Number of sites, because they are flown as a single sequence."""
        return self.samples

    @property
    def pitch(self) -> tuple[float, float]:
        """Pitch of the lattice along x and y, in baselines."""
        return 1.0, 1.0

    @property
    def extent(self) -> tuple[float, float]:
        """Size of the rectangle around the sites, along x and y, in baselines."""
        x, y = zip(*self.places, strict=True)
        return max(x) - min(x), max(y) - min(y)

    @property
    def longer_side(self) -> float:
        """The larger of the two extents, in baselines."""
        return max(self.extent)

    @property
    def nearest(self) -> float:
        """Least distance between two sites of the lattice, in baselines."""
        return 1.0

    def offsets(self) -> Iterator[tuple[float, float]]:
        """The sites as (x, y) from the origin, in baselines and in flight order."""
        yield from self.places

    def steps(self) -> Counter[tuple[float, float]]:
        """Steps along x and y from site to site, in baselines, and the number of times that each
        step occurs.
        """
        return Counter((to_x - x, to_y - y) for (x, y), (to_x, to_y) in pairwise(self.places))


AnyPattern = Pattern | Spiral | Scattered
"""A pattern of any kind."""


class Frame(NamedTuple):
    """A rectangle and a range of sample counts.  A kind of grid uses the rectangle for all counts
    from `fewest` to `most`.
    """

    rows: int
    columns: int
    row_pitch: float
    fewest: int
    most: int

    def pattern(self, samples: int) -> Pattern:
        """The pattern of this frame with a given number of samples."""
        surplus = self.rows * self.columns - samples
        return Pattern(self.rows, self.columns, self.row_pitch, _trimmed(self, surplus))

    @property
    def rectangle(self) -> Pattern:
        """The rectangle without removed sites."""
        return Pattern(self.rows, self.columns, self.row_pitch)

    @property
    def extent(self) -> tuple[float, float]:
        """Size of the rectangle along x and y, in baselines."""
        return self.rectangle.extent

    @property
    def longer_side(self) -> float:
        """The longer side of the rectangle, in baselines."""
        return self.rectangle.longer_side

    @property
    def pitch(self) -> tuple[float, float]:
        """Distances between neighbouring sites along x and y, in baselines."""
        return self.rectangle.pitch

    @property
    def nearest(self) -> float:
        """Smallest distance between two sites of the rectangle, as defined by `Pattern.nearest`."""
        return self.rectangle.nearest

    @property
    def whole(self) -> Pattern:
        """The pattern of this frame with the largest number of samples."""
        return self.pattern(self.most)


class SpiralFrame(NamedTuple):
    """A frame that contains one spiral, with a single sample count."""

    fewest: int
    turn_pitch: float

    @property
    def most(self) -> int:
        """The largest sample count, which is also the smallest."""
        return self.fewest

    @property
    def extent(self) -> tuple[float, float]:
        """Size along x and y, in baselines."""
        return self.whole.extent

    @property
    def longer_side(self) -> float:
        """The longer side, in baselines."""
        return self.whole.longer_side

    @property
    def pitch(self) -> tuple[float, float]:
        """Distances between neighbours along and across the spiral, in baselines."""
        return self.whole.pitch

    @property
    def nearest(self) -> float:
        """Smallest distance between two sites of the spiral, as defined by `Spiral.nearest`."""
        return self.whole.nearest

    @property
    def whole(self) -> Spiral:
        """The spiral."""
        return Spiral(self.fewest, self.turn_pitch)

    def pattern(self, samples: int) -> Spiral:
        """The spiral.  `samples` must be the sample count of this spiral."""
        assert samples == self.fewest
        return self.whole


AnyFrame = Frame | SpiralFrame


def frames(grid: str, *, lanes: int = 3, lane_pitch: float = 4.0) -> Iterator[AnyFrame]:
    """Infinite sequence of the frames of a kind of grid, by increasing number of samples.

    - ``trimmed``: every count. The rectangle is the smallest one of r x r or r x (r+1) sites that
      has at least this number of sites
    - ``rectangle``: the same rectangles without removed sites
    - ``square``: n x n sites
    - ``line``: one row
    - ``lanes``: `lanes` rows that are `lane_pitch` baselines apart
    - ``spiral``: every count, with turns that are `lane_pitch` baselines apart
    """
    for index in count(1):
        yield frame_at(grid, index, lanes=lanes, lane_pitch=lane_pitch)


def frame_at(grid: str, index: int, *, lanes: int = 3, lane_pitch: float = 4.0) -> AnyFrame:
    """The frame of a kind of grid at an index of the sequence `frames`, counted from 1."""
    if grid == "spiral":
        return SpiralFrame(index, lane_pitch)
    if grid == "lanes":
        return Frame(lanes, index, lane_pitch, lanes * index, lanes * index)
    rows, columns = rectangle_at(grid, index)
    most = rows * columns
    fewest = most if grid != "trimmed" else (index // 2) * ((index - 1) // 2 + 1) + 1
    return Frame(rows, columns, 1.0, fewest, most)


def rectangle_at(grid: str, index: Any) -> tuple[Any, Any]:
    """Rows and columns of the frames at one index or at an array of indices. The kind of grid
    must not be ``lanes`` or ``spiral``.
    """
    if grid == "line":
        return 1, index
    if grid == "square":
        return index, index
    return (index + 1) // 2, index // 2 + 1


def pattern_for(grid: str, samples: int, *, lanes: int = 3, lane_pitch: float = 4.0) -> AnyPattern:
    """The smallest pattern of a kind that has at least the given number of samples.

    Trimmed grids and spirals have exactly this number.

    Raises
    ------
    RequestError
        If the pattern has more than `MOST_SITES` sites.
    """
    check_size(samples)
    index = index_for(grid, samples, lanes=lanes)
    frame = frame_at(grid, index, lanes=lanes, lane_pitch=lane_pitch)
    return frame.pattern(max(samples, frame.fewest))


def index_for(grid: str, samples: int, *, lanes: int = 3) -> int:
    """Index of the first frame of a kind of grid that has at least the given number of samples. The
    first index is 1.
    """
    if grid == "spiral":
        return samples
    if grid == "lanes":
        return -(-samples // lanes)
    return int(index_by_side(grid, samples, math.isqrt(samples)))


def index_by_side(grid: str, samples: Any, side: Any) -> Any:
    """The same as `index_for`, for one sample count or an array of sample counts. The kind of
    grid must not be ``lanes`` or ``spiral``.

    `side` is the integer part of the square root of `samples`.
    """
    if grid == "line":
        return samples
    beyond_square = samples > side * side
    if grid == "square":
        return side + beyond_square
    return 2 * side - 1 + beyond_square + (samples > side * (side + 1))


def check_size(samples: int, wanted: str = "the grid has") -> None:
    """Refuse a plan with more waypoints than fit in memory."""
    if samples > MOST_SITES:
        raise RequestError(too_many_sites(wanted, samples), "give a lower target, or fewer samples")


def too_many_sites(wanted: str, samples: int) -> str:
    """Error message for more sites than one plan may have."""
    return f"{wanted} {samples} samples, but a plan has at most {MOST_SITES}"


@lru_cache(maxsize=512)
def _trimmed(frame: Frame, surplus: int) -> tuple[tuple[int, int], ...]:
    """Sites to remove from a rectangle: point-symmetric pairs of sites, beginning with the pair
    that is farthest from the centre.

    Sites at equal distances are ordered by (row, column). If the surplus is odd, the last removed
    site has no partner. The search starts at the corners, and visits only removed sites and their
    neighbours.
    """
    if surplus <= 0:
        return ()
    rows, columns = frame.rows, frame.columns
    removed: dict[tuple[int, int], None] = {}
    for site in _outermost_first(rows, columns):
        if site in removed:
            continue
        removed[site] = None
        if len(removed) < surplus:
            removed[rows - 1 - site[0], columns - 1 - site[1]] = None
        if len(removed) >= surplus:
            break
    return tuple(sorted(removed))


def _outermost_first(rows: int, columns: int) -> Iterator[tuple[int, int]]:
    """Sites by decreasing distance from the centre; equal distances are ordered by (row, column).

    Distances are in half pitches and are compared by their squares, which are whole numbers. Equal
    distances are therefore recognised exactly. A site and its mirror images across both axes share
    one entry (u, v) of the heap, where u and v are their distances from the axes. After (u, v) is
    taken from the heap, (u, v - 2) is added to it. If v is at its maximum, (u - 2, v) is added too.
    """
    u_most, v_most = rows - 1, columns - 1
    heap = [(-(u_most**2 + v_most**2), u_most, v_most)]
    while heap:
        distance = heap[0][0]
        tied: set[tuple[int, int]] = set()
        while heap and heap[0][0] == distance:
            _, u, v = heapq.heappop(heap)
            for row in ((rows - 1 - u) // 2, (rows - 1 + u) // 2):
                for column in ((columns - 1 - v) // 2, (columns - 1 + v) // 2):
                    tied.add((row, column))
            if v >= 2:
                heapq.heappush(heap, (-(u**2 + (v - 2) ** 2), u, v - 2))
            if v == v_most and u >= 2:
                heapq.heappush(heap, (-((u - 2) ** 2 + v**2), u - 2, v))
        yield from sorted(tied)


def local_sites(
    pattern: AnyPattern, baseline_m: float, heading_deg: float
) -> tuple[list[float], list[float]]:
    """Sites of a pattern in flight order, as metres east and north of the rectangle's centre.

    x points along the heading and y to its right; columns are along x and rows along y.
    """
    axis = heading_axis(heading_deg)
    east, north = [], []
    for along, across in pattern.offsets():
        to_east, to_north = turned(along * baseline_m, across * baseline_m, axis)
        # Adding zero turns -0.0 into 0.0.
        east.append(to_east + 0.0)
        north.append(to_north + 0.0)
    return east, north
