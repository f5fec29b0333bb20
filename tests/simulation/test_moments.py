"""Visibility and its standard errors from counts, compared with enumeration and with the variation
over many seeds.
"""

import math

import numpy as np
import pytest

from aosplan.simulation.moments import Counts, estimate


def counts(blocked, views):
    blocked = np.asarray(blocked, dtype=np.int64).ravel()
    return Counts(views, blocked.size, int(blocked.sum()), int((blocked**2).sum()))


def test_counts_add_up_as_their_targets_do():
    rng = np.random.default_rng(1)
    one, other = rng.integers(0, 8, 30), rng.integers(0, 8, 11)
    assert counts(one, 7) + counts(other, 7) == counts(np.concatenate([one, other]), 7)


def test_density_and_visibility_are_the_means_of_x_and_its_square():
    blocked = np.array([0, 1, 4, 4, 2])
    found = estimate([counts(blocked, 4)], one_plot=True)
    x = blocked / 4
    assert found.density == pytest.approx(x.mean())
    assert found.expected == pytest.approx(1 - (x**2).mean())
    assert found.normalized == pytest.approx(1 - x.var() / (x.mean() * (1 - x.mean())))


def test_blocks_of_one_plot_give_what_all_its_targets_give():
    rng = np.random.default_rng(2)
    parts = [rng.integers(0, 10, size) for size in (40, 7, 100)]
    whole = estimate([counts(np.concatenate(parts), 9)], one_plot=True)
    found = estimate([counts(part, 9) for part in parts], one_plot=True)
    assert found[:3] == pytest.approx(whole[:3])


def test_a_single_sample_has_no_standard_error():
    assert estimate([counts([0, 1], 2)])[3:] == (math.inf, math.inf, math.inf)


@pytest.mark.parametrize("blocked", [[0, 0, 0], [3, 3, 3]])
def test_nothing_or_everything_hidden_has_no_normalised_visibility(blocked):
    found = estimate([counts(blocked, 3)] * 3)
    assert math.isnan(found.normalized)
    assert math.isnan(found.normalized_standard_error)
    assert found.expected == (1.0 if blocked[0] == 0 else 0.0)


def beta_samples(rng, number, views, targets):
    """Samples with different densities, for which K over all samples is known exactly.

    Each sample has its own hidden share P, with mean 0.3 and variance 0.01.  Its targets are
    blocked independently in each view.  E[X²] = E[P²] + E[P(1 - P)]/N.
    """
    p, variance = 0.3, 0.01
    common = p * (1 - p) / variance - 1
    shares = rng.beta(p * common, (1 - p) * common, number)
    samples = [counts(rng.binomial(views, share, targets), views) for share in shares]
    square = variance + p**2
    mean_square = square + (p - square) / views
    return samples, (p, 1 - mean_square, 1 - (mean_square - p**2) / (p * (1 - p)))


@pytest.mark.parametrize("number", [16, 64])
def test_standard_errors_are_calibrated_for_different_samples(number):
    rng = np.random.default_rng(3)
    z = []
    for _ in range(800):
        samples, truth = beta_samples(rng, number, 5, 50)
        found = estimate(samples)
        z.append([(found[i] - truth[i]) / found[3 + i] for i in range(3)])
    z = np.array(z)
    # Student's t distribution with number - 1 degrees of freedom has this standard deviation.
    expected = math.sqrt((number - 1) / (number - 3))
    # The tolerance allows for the skewness of ratios. A bias would be larger.
    assert np.abs(z.mean(axis=0)).max() < 0.4
    assert z.std(axis=0) == pytest.approx(expected, rel=0.16)
    assert (np.abs(z) > 4).mean() < 0.01


def test_the_estimate_of_vhat_from_few_samples_is_unbiased():
    rng = np.random.default_rng(4)
    found, plain = [], []
    for _ in range(3000):
        samples, truth = beta_samples(rng, 3, 5, 50)
        found.append(estimate(samples).normalized)
        plain.append(estimate(samples, one_plot=True).normalized)
    error = np.std(found) / math.sqrt(len(found))
    # The square of the mean has a bias of many standard errors. The sum over pairs has no bias.
    assert abs(np.mean(plain) - truth[2]) > 8 * error
    assert abs(np.mean(found) - truth[2]) < 4 * error
