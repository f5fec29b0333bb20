"""The order in which sites are flown. Sites are flown in parallel lines along the better axis; the
lines are connected, and the order is improved.

The sites of a lattice form *lines*.  A line is a run of neighbours along one axis that no zone
interrupts.  Each line is flown from one end to the other.  The next line is the line with the
nearest end.  If every row is a single line, the result is a boustrophedon.  Both axes are tried,
and the faster one is used.  If there are at most `MOST_IMPROVED` sites, the order is then improved
by 2-opt and Or-opt moves.  The length of the minimum spanning tree is a lower bound of the length
of every order.
"""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.areas.nearest import Nearest

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from aosplan.areas.cell_runs import Whole
    from aosplan.areas.no_fly import NoFlyZones
    from aosplan.flight.kinematics import Timing

    Points = NDArray[np.float64]

MOST_IMPROVED = 5_000
"""Tours with more sites than this are not improved."""

NEIGHBOURS = 8
"""Number of nearest sites that a move considers as the next site."""

LONGEST_PIECE = 3
"""Largest number of consecutive sites that an Or-opt move takes to another position in the tour."""


class Tour(NamedTuple):
    """An order of sites: their indices, and the axis along which lines are flown."""

    order: NDArray[np.intp]
    axis: str


def tour_of(cells: Whole, stride: int, points: Points, timing: Timing, zones: NoFlyZones) -> Tour:
    """An order in which all sites are flown once.

    Parameters
    ----------
    cells
        Shape (n,): number row · stride + column of each site, increasing.
    stride
        Stride of the numbers.
    points
        Shape (n, 2): positions of the sites [m].
    timing
        How the drone flies.  If it flies through its sites, lines along the heading are not
        interrupted.
    zones
        No-fly zones in the same coordinates.  No site is in a zone.

    Returns
    -------
    Tour
        The faster order: lines along the heading or lines across it.  The order is improved if
        there are few sites.
    """
    rows, columns = np.divmod(cells, stride)
    found = []
    leg_s = timing.leg_s
    axes = [("along", rows, columns), ("across", columns, rows)]
    for axis, line, place in axes[:1] if timing.fly_through else axes:
        order = _by_lines(line, place, points, zones)
        found.append((total(points[order], leg_s, zones), axis, order))
    _, axis, order = min(found, key=lambda candidate: candidate[0])
    if 3 < len(order) <= MOST_IMPROVED and not timing.fly_through:
        order = _improved(order, points, leg_s, zones)
    return Tour(order, axis)


def total(
    points: Points, measure: Callable[[float], float], zones: NoFlyZones | None = None
) -> float:
    """Sum of `measure` over the lengths of the legs from point to point, including detours around
    zones.
    """
    lengths = np.hypot(*np.diff(points, axis=0).T)
    if zones:
        for leg in np.flatnonzero(zones.cross(points[:-1], points[1:])):
            lengths[leg] = zones.length_m(points[leg], points[leg + 1])
    # The legs of a lattice have few different lengths. `measure` is called once for each length.
    _, group, counts = np.unique(np.round(lengths, 9), return_inverse=True, return_counts=True)
    means = np.bincount(group, lengths) / counts if len(lengths) else lengths
    return math.fsum(
        measure(mean) * count for mean, count in zip(means.tolist(), counts.tolist(), strict=True)
    )


def shortest_m(cells: Whole, stride: int, points: Points) -> float:
    """Lower bound of the path length for any order of the sites: the length of their minimum
    spanning tree.

    Each edge of the tree connects either neighbours of the lattice or sites at the border of the
    set. A Delaunay triangulation contains all edges between border sites that the tree may need.
    """
    if len(cells) < 2:
        return 0.0
    start, stop, border = [], [], np.zeros(len(cells), bool)
    for step in (1, stride, stride + 1, stride - 1):
        at = np.searchsorted(cells, cells + step)
        there = cells[np.minimum(at, len(cells) - 1)] == cells + step
        start.append(np.flatnonzero(there))
        stop.append(at[there])
        border |= ~there
        border[np.setdiff1d(np.arange(len(cells)), at[there], assume_unique=True)] = True
    one, other = np.concatenate(start), np.concatenate(stop)
    if len(cells) <= MOST_IMPROVED and len(one):
        lengths = np.hypot(*(points[one] - points[other]).T)
        least = float(lengths.min())
        short = lengths <= least * (1.0 + 1e-9)
        # Direct neighbours of a lattice have the smallest distance of all pairs of sites.
        if _are_joined(one[short], other[short], len(cells)):
            return least * (len(cells) - 1)
    outer = np.flatnonzero(border)
    for one, other in _triangulated(points[outer]):
        start.append(outer[one])
        stop.append(outer[other])
    one, other = np.concatenate(start), np.concatenate(stop)
    lengths = np.hypot(*(points[one] - points[other]).T)
    # Most edges of a lattice have the smallest length. Edges of this length that connect two pieces
    # can always be part of a minimum spanning tree.
    least = float(lengths.min())
    short = lengths <= least * (1.0 + 1e-9)
    from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

    pieces, labels = connected_components(_graph(lengths, one, other, short, len(cells)))
    piece = labels.astype(np.int64)
    rest = ~short & (piece[one] != piece[other])
    joined = _graph(lengths, piece[one], piece[other], rest, pieces)
    return least * (len(cells) - pieces) + float(minimum_spanning_tree(joined).sum())


def _are_joined(one: Whole, other: Whole, size: int) -> bool:
    """Whether edges connect all nodes. SciPy has a function for this, but importing it would take
    longer.
    """
    above = list(range(size))

    def root(node: int) -> int:
        while above[node] != node:
            above[node] = above[above[node]]
            node = above[node]
        return node

    pieces = size
    for start, stop in zip(one.tolist(), other.tolist(), strict=True):
        first, last = root(start), root(stop)
        if first != last:
            above[first] = last
            pieces -= 1
    return pieces == 1


def _graph(lengths: Points, one: Whole, other: Whole, kept: NDArray[np.bool_], size: int) -> Any:
    """The graph of the kept edges.  If there are several edges between two nodes, it has the
    shortest one.
    """
    low, high = np.minimum(one, other)[kept], np.maximum(one, other)[kept]
    order = np.lexsort((lengths[kept], high, low))
    low, high, length = low[order], high[order], lengths[kept][order]
    first = np.append(True, (low[1:] != low[:-1]) | (high[1:] != high[:-1]))[: len(low)]
    # Older versions of SciPy accept only int32.
    places = low[first].astype(np.int32), high[first].astype(np.int32)
    from scipy.sparse import coo_array

    return coo_array((length[first], places), shape=(size, size)).tocsr()


def _triangulated(points: Points) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Ends of the edges of a Delaunay triangulation. If all points are on a line, these are the
    ends of the segments between neighbouring points.
    """
    middle = points.mean(axis=0)
    spread = np.linalg.svd(points - middle, full_matrices=False)
    if len(points) < 4 or spread[1][1] <= 1e-9 * spread[1][0]:
        along = np.argsort((points - middle) @ spread[2][0])
        if len(points) == 3 and spread[1][1] > 1e-9 * spread[1][0]:
            return [(along[[0, 1, 0]], along[[1, 2, 2]])]
        return [(along[:-1], along[1:])]
    from scipy.spatial import Delaunay

    corners = Delaunay(points).simplices.astype(np.int64)
    return [(corners[:, k], corners[:, k - 1]) for k in range(3)]


# Lines


def _by_lines(line: Whole, place: Whole, points: Points, zones: NoFlyZones) -> NDArray[np.intp]:
    """Sites in the order of lines.  After each line comes the line whose end is nearest."""
    order = np.lexsort((place, line))
    apart = (np.diff(line[order]) != 0) | (np.diff(place[order]) != 1)
    if zones:
        joined = np.flatnonzero(~apart)
        apart[joined] = zones.cross(points[order[joined]], points[order[joined + 1]])
    first = np.append(0, np.flatnonzero(apart) + 1)
    last = np.append(first[1:], len(order)) - 1
    ends = np.concatenate([points[order[first]], points[order[last]]])
    pieces = [
        order[first[index] : last[index] + 1][:: 1 if forwards else -1]
        for index, forwards in _linked(ends, zones)
    ]
    return np.concatenate(pieces)


def _linked(ends: Points, zones: NoFlyZones) -> list[tuple[int, bool]]:
    """Lines in an order in which each is followed by the line with the nearest end, and whether
    each is flown forwards.

    `ends` has the first points of all lines, followed by their last points.
    """
    count = len(ends) // 2
    left = np.ones(2 * count, bool)
    way: list[tuple[int, bool]] = []
    entry = 0
    names = np.arange(2 * count)
    tree = Nearest(ends)
    while True:
        line = entry % count
        way.append((line, entry < count))
        left[[line, line + count]] = False
        if len(way) == count:
            return way
        if 2 * (count - len(way)) < 0.5 * len(names):
            names = np.flatnonzero(left)
            tree = Nearest(ends[names])
        entry = _nearest(ends[line + count if entry < count else line], tree, names, left, zones)


def _nearest(
    here: Points, tree: Nearest, names: NDArray[np.intp], left: NDArray[np.bool_], zones: NoFlyZones
) -> int:
    """The nearest remaining end of a line. Among the few nearest ends, an end with a direct path
    outside all zones is preferred.
    """
    wanted = 16
    while True:
        found = tree.to(here[None], min(wanted, len(names)))[0]
        free = names[found][left[names[found]]]
        if len(free) or wanted >= len(names):
            break
        wanted *= 4
    if zones and len(free) > 1:
        targets = tree.points[np.searchsorted(names, free)]
        clear = free[~zones.cross(np.broadcast_to(here, targets.shape), targets)]
        free = clear if len(clear) else free
    return int(free[0])


# Improvement


class _Circle:
    """A tour, its costs, and moves that improve it.

    An artificial site connects the end of the tour with its start. The time between it and every
    other site is 0.
    """

    def __init__(
        self,
        order: NDArray[np.intp],
        points: Points,
        leg_s: Callable[[float], float],
        zones: NoFlyZones,
    ) -> None:
        self.points = points
        self.nowhere = len(order)
        self.tour: list[int] = [*order.tolist(), self.nowhere]
        self.place = [0] * len(self.tour)
        for place, site in enumerate(self.tour):
            self.place[site] = place
        self.xy = points.tolist()
        self.leg_s = leg_s
        self.zones = zones
        self.known: dict[tuple[int, int], float] = {}

    def cost(self, one: int, other: int) -> float:
        """Time from one site to another, including detours around zones; 0 to or from the
        artificial site.
        """
        if self.nowhere in (one, other):
            return 0.0
        if self.zones:
            key = (one, other) if one < other else (other, one)
            if key not in self.known:
                start, stop = self.xy[key[0]], self.xy[key[1]]
                if self.zones.crosses(start, stop):
                    length = self.zones.length_m(self.points[key[0]], self.points[key[1]])
                else:
                    length = math.dist(start, stop)
                self.known[key] = self.leg_s(length)
            return self.known[key]
        return self.leg_s(math.dist(self.xy[one], self.xy[other]))

    def after(self, site: int) -> int:
        """The next site of the tour."""
        return self.tour[(self.place[site] + 1) % len(self.tour)]

    def before(self, site: int) -> int:
        """The previous site of the tour."""
        return self.tour[self.place[site] - 1]

    def reverse(self, first: int, last: int) -> None:
        """Reverse the part of the tour from one site to another. The rest of the tour may be
        reversed instead, which gives the same closed tour.
        """
        size = len(self.tour)
        i, j = self.place[first], self.place[last]
        inner = (j - i) % size + 1
        if 2 * inner > size:
            i, j, inner = (j + 1) % size, (i - 1) % size, size - inner
        for _ in range(inner // 2):
            one, other = self.tour[i], self.tour[j]
            self.tour[i], self.place[other] = other, i
            self.tour[j], self.place[one] = one, j
            i, j = (i + 1) % size, (j - 1) % size

    def two_opt(self, site: int, near: list[int]) -> list[int]:
        """Replace two legs, one of them at `site`, by two faster legs.  Returns the sites whose
        legs have changed.
        """
        for step in (self.after, self.before):
            following = step(site)
            old = self.cost(site, following)
            for other in near:
                new = self.cost(site, other)
                if new >= old:
                    break
                beyond = step(other)
                if other == following or beyond == site:
                    continue
                gain = old + self.cost(other, beyond) - new - self.cost(following, beyond)
                if gain > 1e-9:
                    if step == self.after:
                        self.reverse(following, other)
                    else:
                        self.reverse(other, following)
                    return [site, following, other, beyond]
        return []

    def or_opt(self, site: int, near: list[int]) -> list[int]:
        """Move up to three sites, beginning with `site`, to a faster position.  Returns the sites
        whose legs have changed.
        """
        for step, back in ((self.after, self.before), (self.before, self.after)):
            last = site
            outside = back(site)
            for _ in range(LONGEST_PIECE):
                if last == self.nowhere:
                    break
                beyond = step(last)
                if beyond == outside:
                    break
                closing = self.cost(outside, site) + self.cost(last, beyond)
                closing -= self.cost(outside, beyond)
                piece = self._piece(site, last, step)
                for other in near:
                    joined = self.cost(site, other)
                    if joined >= closing:
                        break
                    if other in piece:
                        continue
                    # `site` is placed next to `other`, and `last` next to a neighbour of `other`.
                    for side in (self.after, self.before):
                        next_to = side(other)
                        if next_to in piece:
                            continue
                        gain = closing + self.cost(other, next_to)
                        gain -= joined + self.cost(last, next_to)
                        if gain > 1e-9:
                            self._move(piece, other, next_to)
                            return [site, last, outside, beyond, other, next_to]
                last = beyond
        return []

    def _piece(self, site: int, last: int, step: Callable[[int], int]) -> list[int]:
        piece = [site]
        while piece[-1] != last:
            piece.append(step(piece[-1]))
        return piece

    def _move(self, piece: list[int], other: int, next_to: int) -> None:
        """Insert a piece between two neighbours, with its first site next to `other`."""
        taken = set(piece)
        rest = [site for site in self.tour if site not in taken]
        row = piece if self.after(other) == next_to else piece[::-1]
        at = rest.index(other if row is piece else next_to) + 1
        self.tour = rest[:at] + row + rest[at:]
        for place, site in enumerate(self.tour):
            self.place[site] = place


def _improved(
    order: NDArray[np.intp], points: Points, leg_s: Callable[[float], float], zones: NoFlyZones
) -> NDArray[np.intp]:
    """Improve a tour until no 2-opt or Or-opt move among near neighbours makes it faster."""
    circle = _Circle(order, points, leg_s, zones)
    found = Nearest(points).to(points, min(NEIGHBOURS + 1, len(points)))
    near = [[other for other in row if other != site] for site, row in enumerate(found.tolist())]
    waiting = deque(order.tolist())
    queued = set(waiting)
    while waiting:
        site = waiting.popleft()
        queued.discard(site)
        touched = circle.two_opt(site, near[site]) or circle.or_opt(site, near[site])
        for other in touched:
            if other != circle.nowhere and other not in queued:
                waiting.append(other)
                queued.add(other)
    start = circle.place[circle.nowhere] + 1
    return np.array(circle.tour[start:] + circle.tour[: start - 1], np.intp)
