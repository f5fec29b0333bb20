"""Visibility over the ground of a plan, compared with rays and with quadrature."""

import math

import numpy as np
import pytest
from support.forests import STANDS, clumped_forest
from support.plans import planned

from aosplan.grid.patterns import pattern_for
from aosplan.models.ground_visibility import followed, measured_at, of_statistics, over_ground
from aosplan.models.measured import MeasuredModel
from aosplan.models.model import Prediction


def test_quadrature_is_exact_for_polynomials_of_the_fifth_degree():
    found = over_ground(
        (4.0, 6.0), lambda x, y: (0.25 + x**4 * y**2 / 1e3, 1.0 + x**5 + y**4 / 1e3)
    )
    mean_x4, mean_y2, mean_y4 = 2.0**4 / 5, 3.0**2 / 3, 3.0**4 / 5
    assert found.density == pytest.approx(0.25 + mean_x4 * mean_y2 / 1e3, rel=1e-12)
    assert found.expected == pytest.approx(1.0 + mean_y4 / 1e3, rel=1e-12)
    assert found.worst_expected == pytest.approx(1.0 - 32.0 + 81.0 / 1e3, rel=1e-12)


def test_slanted_leaves_hide_what_monte_carlo_finds():
    """The stand is one layer of leaves of random direction, which is independent for each sample (K
    = 1/N).
    """
    rng = np.random.default_rng(3)
    sites = followed(pattern_for("trimmed", 12), 4.0)
    p, altitude, place = 0.6, 20.0, (3.0, -5.0)
    at = of_statistics(Prediction(p, 1 - p, 1 / 12), sites, altitude)
    path = [math.dist((*site, altitude), (*place, 0.0)) / altitude for site in sites]
    # The number of leaves on a ray has a Poisson distribution. Its mean is proportional to the
    # length of the ray.
    draws = rng.poisson(-math.log(1 - p) * np.array(path), (200_000, 12)) > 0
    shares = draws.mean(axis=1)
    hidden, visible = at(*place)
    assert abs(hidden - shares.mean()) < 4 * shares.std() / math.sqrt(200_000)
    # K times the mean of p_i (1 - p_i) is the variance of the mean of independent samples.
    squares = 1 - shares**2
    assert abs(visible - squares.mean()) < 4 * squares.std() / math.sqrt(200_000)


def test_the_sites_used_for_a_large_grid_are_few_and_spread_over_it():
    sites = np.array(followed(pattern_for("trimmed", 10_000), 1.0))
    assert len(sites) <= 1024
    assert np.allclose(sites.mean(axis=0), 0.0, atol=1.0)
    assert np.ptp(sites, axis=0).min() > 95
    assert len(np.unique(sites[:, 0])) > 90


def test_mean_visibility_over_the_common_ground_is_below_that_at_its_middle():
    result = planned()
    ground = result.ground
    assert ground.size_m == pytest.approx(result.common_footprint_m)
    assert ground.worst_expected < ground.expected < result.solution.prediction.expected
    assert ground.density > result.solution.prediction.density
    assert planned(grid="line", allow_no_common_ground=True).ground is None


def test_targets_beside_the_middle_use_positions_shifted_to_the_other_side():
    volume = clumped_forest(STANDS[next(iter(STANDS))])
    model = MeasuredModel(volume, 40.0, heading_deg=90.0)
    pattern = pattern_for("trimmed", 6)
    at = measured_at(model, pattern, 2.0)
    middle = model.predict(pattern, 2.0)
    assert at(0.0, 0.0) == (middle.density, middle.expected)
    # At heading 90° the x axis points east, and y points south.
    sites = model.sites_m(pattern, 2.0) - np.array([3.03, -1.57])
    aside = model.predict_positions(sites)
    assert at(3.03, 1.57) == pytest.approx((aside.density, aside.expected), rel=1e-12)
    sparse = model.beside_the_middle(10)
    assert sparse.occlusion.targets < model.occlusion.targets
