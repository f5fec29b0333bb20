"""Noise patterns: pixels are compared with values computed by hand, and visibility with the paper's
equations.
"""

import hashlib
import math

import numpy as np
import pytest
from reference import exact

from aosplan.errors import RequestError
from aosplan.simulation.forests import generator
from aosplan.simulation.moments import estimate
from aosplan.simulation.noise_patterns import (
    NoisePattern,
    blocked_views,
    counts_of,
    grid_shifts,
    noise_pattern,
)


def test_a_view_is_the_pattern_shifted_pixel_by_pixel():
    rng = np.random.default_rng(1)
    pattern = NoisePattern(rng.random((9, 9)) < 0.5, 2.5, (1.3, 0.4))
    view = pattern.view((6, 5), (3.7, 0.9))
    for row in range(6):
        for column in range(5):
            y = math.floor((row + 0.5 + 1.3 + 0.9) / 2.5)
            x = math.floor((column + 0.5 + 0.4 + 3.7) / 2.5)
            assert view[row, column] == pattern.cells[y, x]


@pytest.mark.parametrize("reach", [(0.0, 0.0), (17.2, 3.1), (0.3, 60.0)])
def test_a_noise_pattern_covers_all_its_views(reach):
    for seed in range(50):
        pattern = noise_pattern(generator(seed), 0.5, 3.3, (11, 7), reach)
        assert pattern.view((11, 7), reach).shape == (11, 7)


def test_views_are_counted_and_only_differences_of_shifts_matter():
    shifts = grid_shifts(2, 3, 1.5)
    blocked = blocked_views(generator(5), 0.4, 5, shifts, (20, 30))
    moved = blocked_views(generator(5), 0.4, 5, shifts - (100.25, 7.5), (20, 30))
    assert np.array_equal(blocked, moved)
    views = counts_of(blocked, 6)
    assert views == (6, 600, int(blocked.sum()), int((blocked.astype(int) ** 2).sum()))


def noise_estimate(density, size, rows, columns, dhat, seed, patterns=60):
    shifts = grid_shifts(rows, columns, dhat * size)
    return estimate(
        [
            counts_of(
                blocked_views(generator(seed, i), density, size, shifts, (90, 90)), rows * columns
            )
            for i in range(patterns)
        ]
    )


@pytest.mark.parametrize(
    ("density", "side", "dhat", "size"),
    [
        (0.25, 10, 0.2, 5),  # the paper's Fig. 4
        (0.25, 10, 0.6, 5),
        (0.25, 10, 1.0, 5),
        (0.25, 10, 1.4, 5),
        (0.5, 5, 0.37, 5),  # shifts by fractions of a pixel
        (0.75, 3, 0.8, 4.6),
        (0.5, 2, 0.0, 5),
        (0.9, 7, 1.0, 3),
    ],
)
def test_averaged_patterns_have_the_papers_visibility(density, side, dhat, size):
    found = noise_estimate(density, size, side, side, dhat, seed=7)
    shift = round(dhat * size, 12) / size
    truth = float(exact.visibility_as_printed(density, side, shift))
    assert abs(found.density - density) < 4 * found.density_standard_error
    assert abs(found.expected - truth) < 4 * found.expected_standard_error
    vhat = 1 - float(exact.double_sum(side, shift)) / side**4
    assert abs(found.normalized - vhat) < 4 * found.normalized_standard_error
    assert found.normalized_standard_error < 0.01


def test_z_scores_of_many_seeds_are_those_of_honest_standard_errors():
    truth = 1 - float(exact.double_sum(3, 0.5)) / 3**4
    z = []
    for seed in range(120):
        shifts = grid_shifts(3, 3, 2.0)
        samples = [
            counts_of(blocked_views(generator(seed, i), 0.4, 4, shifts, (40, 40)), 9)
            for i in range(20)
        ]
        found = estimate(samples)
        z.append((found.normalized - truth) / found.normalized_standard_error)
    assert abs(np.mean(z)) < 0.4
    assert np.std(z) == pytest.approx(math.sqrt(19 / 17), rel=0.25)


def test_a_pattern_is_the_same_on_every_platform():
    blocked = blocked_views(generator(2026, 3), 0.3, 5, grid_shifts(3, 3, 4.0), (64, 64))
    digest = hashlib.sha256(blocked.astype("<i4").tobytes()).hexdigest()
    assert digest[:16] == "4340396ecd0b0013"


@pytest.mark.parametrize(
    ("density", "size", "named"), [(-0.1, 5, "density"), (1.1, 5, "density"), (0.5, 0, "occluder")]
)
def test_numbers_outside_their_domain_are_named(density, size, named):
    with pytest.raises(RequestError, match=named):
        noise_pattern(generator(1), density, size, (5, 5))
