"""Choosing views: against every choice there is, and against what a good choice must be."""

from itertools import combinations

import numpy as np
import pytest

from aosplan.errors import RequestError
from aosplan.models.sites import positions_shortfall
from aosplan.thin import correlations, exchanged, fewest_shared, shortfall, thin


def triangles(spacing):
    """Correlation of the uniform model."""

    def correlation(x, y):
        return np.maximum(1.0 - np.abs(x) / spacing, 0.0) * np.maximum(
            1.0 - np.abs(y) / spacing, 0.0
        )

    return correlation


@pytest.mark.parametrize("seed", range(12))
def test_choices_are_near_the_best_of_all_choices(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.0, 6.0, (11, 2))
    shared = correlations(points, triangles(3.0))
    for samples in (3, 5, 8):
        best = min(
            shortfall(shared, np.array(choice)) for choice in combinations(range(11), samples)
        )
        found = shortfall(shared, thin(points, samples, triangles(3.0)))
        assert best <= found * (1.0 + 1e-12)
        assert found <= best * 1.05


@pytest.mark.parametrize("seed", range(5))
def test_no_single_exchange_betters_a_choice(seed):
    rng = np.random.default_rng(seed)
    shared = correlations(rng.uniform(0.0, 8.0, (30, 2)), triangles(4.0))
    chosen = exchanged(shared, fewest_shared(shared, 9))
    left = [place for place in range(30) if place not in chosen]
    reached = shortfall(shared, chosen)
    for leaves in range(9):
        for enters in left:
            other = chosen.copy()
            other[leaves] = enters
            assert shortfall(shared, other) >= reached * (1.0 - 1e-9)


def test_the_shortfall_is_that_of_the_positions():
    points = np.random.default_rng(3).uniform(0.0, 30.0, (60, 2))
    chosen = thin(points, 20, triangles(5.0))
    shared = correlations(points, triangles(5.0))
    assert shortfall(shared, chosen) == pytest.approx(
        positions_shortfall(points[chosen], 5.0), rel=1e-12
    )


def test_views_a_spacing_apart_are_found_among_many():
    # A line of 400 views each half metre holds 41 views 5 m apart, which share nothing.
    points = np.column_stack([0.5 * np.arange(401), np.zeros(401)])
    chosen = thin(points, 41, triangles(5.0))
    assert shortfall(correlations(points, triangles(5.0)), chosen) == pytest.approx(1 / 41)


def test_all_views_are_all_views():
    points = np.random.default_rng(1).uniform(0, 9, (7, 2))
    assert thin(points, 7, triangles(1.0)).tolist() == list(range(7))


def test_views_at_one_place_are_as_good_as_one():
    points = np.zeros((5, 2))
    assert len(thin(points, 3, triangles(1.0))) == 3


def test_too_few_and_too_many_views_are_errors():
    with pytest.raises(RequestError, match="2 positions are fewer"):
        thin([[0, 0], [1, 1]], 3, triangles(1.0))
    with pytest.raises(RequestError, match="more than"):
        thin(np.zeros((9000, 2)), 3, triangles(1.0))
