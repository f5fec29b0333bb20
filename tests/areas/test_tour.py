"""Tours visit all sites once and enter no zone, and no tour is shorter than its lower bound."""

import heapq
import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from support.shapes import outlines

from aosplan.areas.area import MARGIN_M
from aosplan.areas.no_fly import NoFlyZones
from aosplan.areas.tour import shortest_m, total, tour_of
from aosplan.errors import RequestError
from aosplan.flight.kinematics import Timing

STRIDE = 40
LENGTHS = SimpleNamespace(leg_s=float, fly_through=False)
"""Timing of a drone whose flight time equals the length of its path."""

NOTHING = NoFlyZones(shapely.MultiPolygon())
PITCHES = st.sampled_from([(1.0, 1.0), (1.0, 4.0), (3.0, 1.0), (2.0, 2.5)])
cells = st.sets(st.tuples(st.integers(0, 12), st.integers(0, 12)), min_size=1, max_size=60)


def numbered(places, pitch):
    """The numbers of the cells in increasing order, and the positions of the cells."""
    numbers = np.array(sorted(row * STRIDE + column + 5 for row, column in places), np.int64)
    rows, columns = np.divmod(numbers, STRIDE)
    return numbers, np.column_stack([columns * pitch[0], rows * pitch[1]])


def flown(numbers, points, zones=NOTHING, timing=LENGTHS):
    tour = tour_of(numbers, STRIDE, points, timing, zones)
    assert sorted(tour.order.tolist()) == list(range(len(numbers)))
    return tour


def spanning_tree_m(points):
    """Length of the minimum spanning tree, by Prim's algorithm over all pairs."""
    left = np.ones(len(points), bool)
    nearest = np.full(len(points), math.inf)
    nearest[0] = whole = 0.0
    for _ in points:
        node = int(np.argmin(np.where(left, nearest, math.inf)))
        whole += nearest[node]
        left[node] = False
        nearest = np.minimum(nearest, np.hypot(*(points - points[node]).T))
    return whole


def best_m(points):
    """Length of the shortest order (Held and Karp)."""
    count = len(points)
    apart = np.hypot(*(points[:, None] - points[None]).T)
    best = {(1 << k, k): 0.0 for k in range(count)}
    for size in range(2, count + 1):
        for chosen in itertools.combinations(range(count), size):
            mask = sum(1 << k for k in chosen)
            for last in chosen:
                rest = mask & ~(1 << last)
                best[mask, last] = min(best[rest, k] + apart[k, last] for k in chosen if k != last)
    return min(best[(1 << count) - 1, k] for k in range(count))


# Without zones


@settings(max_examples=30)
@given(cells, PITCHES)
def test_all_sites_are_flown_once_and_never_below_the_bound(places, pitch):
    numbers, points = numbered(places, pitch)
    tour = flown(numbers, points)
    length = total(points[tour.order], float)
    bound = shortest_m(numbers, STRIDE, points)
    assert bound == pytest.approx(spanning_tree_m(points), rel=1e-9)
    assert length >= bound * (1 - 1e-12)
    assert length <= 3.0 * bound + 1e-9


@settings(max_examples=25)
@given(st.sets(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=2, max_size=8), PITCHES)
def test_small_tours_are_near_the_best_of_all_orders(places, pitch):
    numbers, points = numbered(places, pitch)
    length = total(points[flown(numbers, points).order], float)
    best = best_m(points)
    assert shortest_m(numbers, STRIDE, points) <= best * (1 + 1e-12)
    assert best * (1 - 1e-12) <= length <= best * 1.35


def test_small_tours_are_mostly_the_best():
    rng = np.random.default_rng(11)
    ratios = []
    for _ in range(40):
        places = {tuple(place) for place in rng.integers(0, 9, (9, 2)).tolist()}
        numbers, points = numbered(places, (1.0, 1.0))
        ratios.append(total(points[flown(numbers, points).order], float) / best_m(points))
    assert np.mean(ratios) < 1.04


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (6, 7), (30, 20)])
def test_the_tour_of_a_rectangle_has_the_shortest_possible_length(shape):
    places = itertools.product(range(shape[0]), range(shape[1]))
    numbers, points = numbered(places, (2.0, 2.0))
    tour = flown(numbers, points)
    assert total(points[tour.order], float) == pytest.approx(2.0 * (shape[0] * shape[1] - 1))


def test_lines_are_flown_along_the_axis_that_takes_less_time():
    # The faster direction is the one with fewer lines, although the steps between these are longer.
    wide, points = numbered(itertools.product(range(10), range(10)), (1.0, 4.0))
    assert flown(wide, points).axis == "along"
    tall, points = numbered(itertools.product(range(10), range(10)), (4.0, 1.0))
    assert flown(tall, points).axis == "across"


def test_tours_minimise_the_time_of_legs_and_not_their_length():
    numbers, points = numbered({(0, 0), (0, 1), (0, 9), (3, 0), (3, 9), (7, 7)}, (1.0, 1.0))
    timing = Timing(5.0, 2.0, 0.0)
    quick = timing.leg_s
    tour = flown(numbers, points, timing=timing)
    orders = itertools.permutations(range(len(points)))
    best = min(total(points[list(order)], quick) for order in orders)
    assert total(points[tour.order], quick) == pytest.approx(best, rel=1e-9)


def test_lines_flown_without_stops_remain_whole_and_along_the_heading():
    numbers, points = numbered(itertools.product(range(12), range(5)), (4.0, 1.0))
    tour = flown(numbers, points, timing=Timing(fly_through=True))
    assert tour.axis == "along"
    rows = numbers[tour.order] // STRIDE
    assert (np.diff(rows) != 0).sum() == 11


def test_tours_of_separate_islands_are_near_the_lower_bound():
    rng = np.random.default_rng(5)
    places = {
        (int(row) + dy, int(column) + dx)
        for row, column in rng.integers(0, 30, (12, 2))
        for dy in range(4) for dx in range(4)
    }  # fmt: skip
    numbers, points = numbered(places, (1.0, 1.0))
    length = total(points[flown(numbers, points).order], float)
    assert length < 1.35 * shortest_m(numbers, STRIDE, points)


def test_a_hundred_thousand_sites_are_ordered_by_lines():
    numbers = np.arange(100_000, dtype=np.int64) // 250 * 300 + np.arange(100_000) % 250 + 10
    points = np.column_stack([numbers % 300, numbers // 300]).astype(float)
    tour = tour_of(numbers, 300, points, LENGTHS, NOTHING)
    assert total(points[tour.order], float) == pytest.approx(99_999.0)
    assert shortest_m(numbers, 300, points) == pytest.approx(99_999.0)


# With zones


@st.composite
def zones_and_sites(draw):
    zone = shapely.union_all(
        draw(st.lists(outlines(least_m=2.0, most_m=6.0), min_size=1, max_size=3))
    )
    zone = shapely.transform(zone, lambda points: points / 2.0 + 6.0)
    zones = NoFlyZones(zone)
    numbers, points = numbered(draw(cells), (1.0, 1.0))
    points = points - (5.0, 0.0)
    free = ~zones.inside(points)
    places = zones.enclosures(points)
    kept = free & (places == -1)
    return zone, zones, numbers[kept], points[kept]


@settings(max_examples=30)
@given(zones_and_sites())
def test_no_leg_enters_a_zone(drawn):
    zone, zones, numbers, points = drawn
    if len(numbers) < 1:
        return
    tour = flown(numbers, points, zones)
    ordered = points[tour.order]
    for start, stop in itertools.pairwise(ordered):
        if zones.cross(start[None], stop[None])[0]:
            way = np.array([start, *zones.around(start, stop), stop])
            assert shapely.distance(shapely.LineString(way), zone) >= 0.4 * MARGIN_M
        else:
            assert shapely.distance(shapely.LineString([start, stop]), zone) >= 0.4 * MARGIN_M


def around_on_a_raster(zone, start, stop, step=0.25, reach=14.0):
    """Length of the shortest path on a fine raster with moves in many directions (Dijkstra)."""
    count = round(2 * reach / step) + 1
    xs = -reach + np.arange(count) * step
    grid = np.stack(np.meshgrid(xs, xs, indexing="ij"), axis=-1)
    shapely.prepare(zone)
    blocked = shapely.intersects_xy(zone, grid[..., 0], grid[..., 1])
    moves = [(i, j) for i in range(-3, 4) for j in range(-3, 4) if math.gcd(i, j) == 1]
    begin, end = (tuple(np.rint((np.array(p) + reach) / step).astype(int)) for p in (start, stop))
    best, waiting = {begin: 0.0}, [(0.0, begin)]
    while waiting:
        length, (i, j) = heapq.heappop(waiting)
        if (i, j) == end:
            return length
        if length > best[i, j]:
            continue
        for di, dj in moves:
            k, m = i + di, j + dj
            inside = 0 <= k < count and 0 <= m < count and not blocked[k, m]
            new = length + step * math.hypot(di, dj)
            if inside and new < best.get((k, m), math.inf):
                line = shapely.LineString([grid[i, j], grid[k, m]])
                if not shapely.intersects(zone, line):
                    best[k, m] = new
                    heapq.heappush(waiting, (new, (k, m)))
    return math.inf


@pytest.mark.parametrize("seed", range(4))
def test_detours_around_zones_have_the_shortest_length(seed):
    rng = np.random.default_rng(seed)
    zone = shapely.union_all(
        [shapely.box(*c, *(c + rng.uniform(1, 5, 2))) for c in rng.uniform(-7, 3, (4, 2))]
    )
    start, stop = np.array([-10.0, -2.0]), np.array([10.0, 3.0])
    own = NoFlyZones(zone).length_m(start, stop)
    found = around_on_a_raster(zone, start, stop)
    # Paths on the raster are up to 1.4 % longer than straight paths, and do not keep a margin.
    assert found / 1.03 <= own <= found + 1.0


def test_a_detour_around_a_square_turns_at_its_corners():
    zones = NoFlyZones(shapely.box(-10, -10, 10, 10))
    start, stop = np.array([-30.0, 0.0]), np.array([30.0, 0.0])
    assert zones.length_m(start, stop) == pytest.approx(2 * math.hypot(20, 10) + 20, rel=0.01)
    assert len(zones.around(start, stop)) >= 2


def test_no_path_leaves_a_closed_ring():
    ring = shapely.Point(0, 0).buffer(10).difference(shapely.Point(0, 0).buffer(5))
    zones = NoFlyZones(ring)
    inner, outer = np.array([0.0, 0.0]), np.array([20.0, 0.0])
    assert zones.around(inner, outer) is None
    assert zones.length_m(inner, outer) == math.inf
    assert zones.enclosures(np.array([inner, outer])).tolist() == [0, -1]
    assert zones.around(outer, np.array([-20.0, 0.0])) is not None


def test_points_in_nested_rings_have_different_enclosures():
    rings = [
        shapely.Point(0, 0).buffer(r + 2).difference(shapely.Point(0, 0).buffer(r)) for r in (5, 20)
    ]
    zones = NoFlyZones(shapely.union_all(rings))
    places = zones.enclosures(np.array([[0.0, 0.0], [10.0, 0.0], [30.0, 0.0]]))
    assert len(set(places.tolist())) == 3
    assert places[2] == -1


def test_zones_with_very_many_corners_are_refused():
    angles = np.linspace(0, 2 * np.pi, 40_000, endpoint=False)
    radius = 5000.0 + 100.0 * (np.arange(40_000) % 2)
    spiky = shapely.Polygon(np.column_stack([radius * np.cos(angles), radius * np.sin(angles)]))
    with pytest.raises(RequestError, match="corners, more than"):
        NoFlyZones(spiky)
