"""Orders of blocks, compared with brute force over all orders and with a plain integration."""

import itertools
import math

import numpy as np
import pytest

from aosplan.planning.block_order import LEVELS, BlockOrder, Blocks, Places, Ways

OPTIMUM = 0.01
"""Largest accepted relative difference between the mean time that is found and the smallest one."""

SHORT = 0.04
"""Largest accepted relative difference between the probability of success within a given time that
is found and the largest one.
"""


def leg_s(start, stop):
    return math.dist(start, stop) / 5.0


def problem(seed, blocks=4, places=12, *, points=False, longest_s=math.inf, battery_s=math.inf):
    """Random blocks whose photos overlap, in a square of 200 m."""
    rng = np.random.default_rng(seed)
    counts = rng.poisson(rng.exponential(2.0, (blocks, places)))
    counts[0] += 1  # Each place is in at least one photo.
    ends = rng.uniform(0.0, 200.0, (blocks, 2, 2))
    if points:
        ends[:, 1] = ends[:, 0]
    found = np.linspace(0.0, 1.0, LEVELS + 1) ** 1.5
    return BlockOrder(
        Places(rng.exponential(1.0, places) / places, counts.sum(axis=0), found),
        Blocks(counts, np.repeat(rng.uniform(20.0, 90.0, (blocks, 1)), 2, axis=1), ends),
        Ways(leg_s, 10.0, (0.0, 0.0), battery_s),
        longest_s,
    )


def all_orders(search, *, both=True):
    size = len(search.blocks.counts)
    for order in itertools.permutations(range(size)):
        for ways in itertools.product((0, 1), repeat=size) if both else [(0,) * size]:
            yield tuple(zip(order, ways, strict=True))


def usual(search):
    return tuple((block, 0) for block in range(len(search.blocks.counts)))


def found_by(search):
    return search.best(search.built(usual(search)))


def integrated_s(search, order, step_s=0.01):
    """Mean time until the target is found, from a simulation in small steps of time."""
    photos = np.zeros(len(search.places.weights), dtype=np.int64)
    here, time_s, curve = (0.0, 0.0), search.ways.climb_s, [(0.0, 0.0)]

    def success():
        total = 0.0
        for place, weight in enumerate(search.places.weights):
            level = int(photos[place]) * LEVELS // int(search.places.photos[place])
            total += weight * search.places.found[min(level, LEVELS)]
        return total

    for block, way in order:
        time_s += math.dist(here, search.blocks.ends_m[block, way]) / 5.0
        curve.append((time_s, success()))
        time_s += search.blocks.time_s[block, way]
        photos += search.blocks.counts[block]
        curve.append((time_s, success()))
        here = search.blocks.ends_m[block, 1 - way]
    times, values = np.array(curve).T
    steps = np.arange(0.5 * step_s, times[-1], step_s)
    return step_s * float((1.0 - np.interp(steps, times, values) / values[-1]).sum())


def test_the_value_is_the_integral_over_time():
    search = problem(5)
    order = ((2, 1), (0, 0), (3, 0), (1, 1))
    success, minus_mean_s = search.value(order)
    assert success == pytest.approx(search.places.weights.sum())
    assert -minus_mean_s == pytest.approx(integrated_s(search, order), rel=1e-4)


@pytest.mark.parametrize("seed", range(6))
def test_orders_of_few_blocks_are_almost_the_best_of_all(seed):
    search = problem(seed)
    best_s = min(-search.value(order)[1] for order in all_orders(search))
    order = found_by(search)
    assert sorted(block for block, _ in order) == list(range(4))
    assert best_s <= -search.value(order)[1] <= best_s * (1.0 + OPTIMUM)
    assert search.value(order) >= search.value(usual(search))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_orders_of_seven_blocks_are_almost_the_best_of_all(seed):
    search = problem(seed, blocks=7, points=True)
    best_s = min(-search.value(order)[1] for order in all_orders(search, both=False))
    assert -search.value(found_by(search))[1] <= best_s * (1.0 + OPTIMUM)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_as_much_is_found_in_a_short_time_as_by_any_order(seed):
    search = problem(seed, blocks=7, points=True, longest_s=300.0)
    best = max(search.value(order)[0] for order in all_orders(search, both=False))
    order = found_by(search)
    assert 0.0 < search.value(order)[0] <= best * (1.0 + 1e-9)
    assert search.value(order)[0] >= best * (1.0 - SHORT)
    assert search.value(order)[0] < search.places.weights.sum()


def test_without_ways_the_order_is_by_gain_per_time():
    """Smith's rule, which is exact for independent blocks."""
    rng = np.random.default_rng(3)
    gains, times = rng.uniform(0.01, 0.1, 8), rng.uniform(10.0, 100.0, 8)
    search = BlockOrder(
        Places(gains, np.ones(8, dtype=np.int64), np.linspace(0.0, 1.0, LEVELS + 1)),
        Blocks(np.eye(8, dtype=np.int64), np.column_stack([times, times]), np.zeros((8, 2, 2))),
        Ways(leg_s, 0.0, (0.0, 0.0)),
    )
    order = search.built(usual(search))[0]
    assert [block for block, _ in order] == np.argsort(-gains / times).tolist()
    assert search.improved(order) == order


def test_a_new_battery_costs_the_way_back_and_out_again():
    search = problem(1, blocks=3, battery_s=140.0)
    plenty = problem(1, blocks=3)
    order = ((0, 0), (1, 0), (2, 0))
    here, used_s, total_s = None, 0.0, 0.0
    for block, way in order:
        start, stop = search.blocks.ends_m[block, way], search.blocks.ends_m[block, 1 - way]
        own_s = search.blocks.time_s[block, way]
        out_s, back_s = (10.0 + math.hypot(*point) / 5.0 for point in (start, stop))
        assert out_s + own_s + back_s <= 140.0 or block != order[0][0]
        leg = out_s if here is None else math.dist(here, start) / 5.0
        if here is not None and used_s + leg + own_s + back_s > 140.0:
            total_s += 10.0 + math.hypot(*here) / 5.0 + out_s + own_s
            used_s = out_s + own_s
        else:
            total_s += leg + own_s
            used_s += leg + own_s
        here = stop
    mean_s, in_one_flight_s = -search.value(order)[1], -plenty.value(order)[1]
    assert mean_s > in_one_flight_s
    ended_s = search._steps(order)[-1].ended_s
    assert ended_s == pytest.approx(total_s)
