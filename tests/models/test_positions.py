"""The shortfall of any set of sites, compared with the exact sum over all pairs."""

import math
from fractions import Fraction
from functools import partial

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from reference import exact

from aosplan.grid.pair_offsets import counted_by_transform, counted_directly, offset_counts
from aosplan.grid.patterns import Pattern, pattern_for
from aosplan.models import positions as sites_module
from aosplan.models.equations import visibility_shortfall
from aosplan.models.positions import lattice_shortfall, pattern_shortfall, positions_shortfall

near = partial(pytest.approx, abs=0.0)
"""`approx` without its absolute tolerance of 1e-12."""

ACCURACY = 1e-13
"""Relative accuracy of a shortfall that is summed over pairs."""

disparities = st.one_of(
    st.floats(1e-6, 1.2),
    st.integers(1, 40).map(lambda k: 1.0 / k),
    st.sampled_from([1e-300, 0.5, 1.0, math.nextafter(1.0, 0.0), 3.0, 1e300]),
)


def scattered(count, seed, size=10.0):
    return np.random.default_rng(seed).uniform(-size / 2, size / 2, (count, 2))


def exact_shortfall(positions, spacing):
    return float(exact.pair_sum(positions.tolist(), spacing))


# --- Patterns ------------------------------------------------------------------------------


@st.composite
def patterns(draw):
    """A rectangle from which some, but not all, sites are removed."""
    rows, columns = draw(st.integers(1, 8)), draw(st.integers(1, 8))
    everywhere = [(row, column) for row in range(rows) for column in range(columns)]
    removed = draw(st.lists(st.sampled_from(everywhere), unique=True, max_size=rows * columns - 1))
    row_pitch = draw(st.sampled_from([1.0, 1.0, 2.5, 4.0]))
    return Pattern(rows, columns, row_pitch, tuple(sorted(removed)))


@example(  # a rectangle with one remaining site
    pattern=Pattern(4, 4, 1.0, tuple((i // 4, i % 4) for i in range(15))), dhat=1e-06
)
@given(pattern=patterns(), dhat=st.one_of(disparities, st.just(0.0)))
def test_a_pattern_with_sites_missing_equals_the_sum_over_its_pairs(pattern, dhat):
    reference = exact.lattice_pair_sum(pattern.sites(), dhat, dhat * pattern.row_pitch)
    assert pattern_shortfall(pattern, dhat) == near(float(reference), rel=ACCURACY)


@pytest.mark.parametrize("dhat", [0.01, 1 / 7, 0.3, 0.5, 0.77])
def test_the_trimmed_grid_of_every_count_equals_the_sum_over_its_pairs(dhat):
    for samples in range(1, 65):
        pattern = pattern_for("trimmed", samples)
        reference = exact.lattice_pair_sum(pattern.sites(), dhat)
        assert pattern_shortfall(pattern, dhat) == near(float(reference), rel=ACCURACY), samples


@pytest.mark.parametrize("grid", ["trimmed", "rectangle", "square", "line", "lanes"])
def test_without_overlap_the_shortfall_is_one_over_the_samples_to_the_last_bit(grid):
    for samples in (*range(1, 60), 500, 2999):
        pattern = pattern_for(grid, samples)
        for dhat in (1.0, 1.5, 1e300, math.inf):
            assert pattern_shortfall(pattern, dhat) == 1.0 / pattern.samples


def test_lanes_far_apart_are_independent_of_each_other():
    for dhat in (0.25, 0.3, 0.9):
        lanes = Pattern(3, 20, row_pitch=4.0)
        alone = visibility_shortfall(1, 20, dhat)
        assert pattern_shortfall(lanes, dhat) == near(alone / 3, rel=ACCURACY)


@pytest.mark.parametrize(
    "dhat", [*(pytest.param(dhat, marks=pytest.mark.slow) for dhat in (0.003, 0.011)), 0.3]
)
def test_thousands_of_missing_sites_are_summed_as_precisely(dhat):
    """For more than 2000 missing sites, pairs are found with a spatial index."""
    chosen = np.random.default_rng(7).random((80, 90)) < 0.6
    missing = tuple((int(row), int(column)) for row, column in np.argwhere(~chosen))
    assert len(missing) > 2000
    for row_pitch in (1.0, 2.5):
        assert pattern_shortfall(Pattern(80, 90, row_pitch, missing), dhat) == near(
            lattice_shortfall(chosen, dhat, dhat * row_pitch), rel=ACCURACY
        )


# --- Scattered positions -------------------------------------------------------------------


@given(
    points=st.lists(
        st.tuples(st.floats(-20, 20, width=32), st.floats(-20, 20, width=32)),
        min_size=1,
        max_size=12,
    ),
    spacing=st.floats(0.5, 50.0),
)
def test_scattered_positions_equal_the_sum_over_their_pairs(points, spacing):
    reference = float(exact.pair_sum(points, spacing))
    assert positions_shortfall(points, spacing) == near(reference, rel=ACCURACY)


@pytest.mark.parametrize("spacing", [0.01, 0.9, 3.0, 12.0, 1000.0])
def test_many_close_positions_equal_the_sum_over_their_pairs(spacing):
    points = scattered(80, seed=1)
    assert positions_shortfall(points, spacing) == near(
        exact_shortfall(points, spacing), rel=ACCURACY
    )


def test_positions_on_a_lattice_are_a_grid():
    rows, columns = 6, 9
    y, x = np.divmod(np.arange(rows * columns), columns)
    for dhat in (0.07, 0.25, 0.4, 0.999, 1.0, 2.0):
        points = np.column_stack([x * dhat, y * dhat])
        assert positions_shortfall(points, 1.0) == near(
            visibility_shortfall(rows, columns, dhat), rel=1e-12
        )


def test_a_pair_of_positions_shares_the_product_of_two_triangles():
    assert positions_shortfall([[0.0, 0.0], [1.0, 0.0]], 2.0) == 0.75
    assert positions_shortfall([[0.0, 0.0], [1.0, -1.0]], 2.0) == 0.625
    assert positions_shortfall([[0.0, 0.0], [2.0, 0.0]], 2.0) == 0.5
    assert positions_shortfall([[0.0, 0.0], [1.9, 5.0]], 2.0) == 0.5
    assert positions_shortfall([[3.0, 4.0]], 2.0) == 1.0


@pytest.mark.parametrize("origin", [(1e7, -1e7), (6.4e6, 0.0), (0.25, 1e3)])
def test_positions_far_from_the_origin_lose_no_digits(origin):
    points = scattered(40, seed=2) + origin
    assert positions_shortfall(points, 3.0) == near(exact_shortfall(points, 3.0), rel=ACCURACY)


@given(seed=st.integers(0, 10**6), count=st.integers(1, 200), spacing=st.floats(0.1, 30.0))
def test_order_does_not_matter(seed, count, spacing):
    points = scattered(count, seed)
    shuffled = np.random.default_rng(seed).permutation(points)
    assert positions_shortfall(shuffled, spacing) == near(
        positions_shortfall(points, spacing), rel=ACCURACY
    )


@given(
    seed=st.integers(0, 10**6),
    shift=st.tuples(st.integers(-(2**20), 2**20), st.integers(-(2**20), 2**20)),
    exponent=st.integers(-30, 30),
)
def test_translation_mirrors_exchange_of_axes_and_scale_do_not_matter(seed, shift, exponent):
    # On a lattice of 2^-20, sums and products with these factors are exact.
    points = np.round(scattered(50, seed) * 2**20) / 2**20
    shortfall = positions_shortfall(points, 3.0)
    assert positions_shortfall(points + shift, 3.0) == near(shortfall, rel=ACCURACY)
    assert positions_shortfall(-points, 3.0) == near(shortfall, rel=ACCURACY)
    assert positions_shortfall(points[:, ::-1], 3.0) == near(shortfall, rel=ACCURACY)
    scale = 2.0**exponent
    assert positions_shortfall(points * scale, 3.0 * scale) == near(shortfall, rel=ACCURACY)


def test_each_duplicate_is_counted():
    points = scattered(30, seed=3)
    doubled = np.vstack([points, points])
    assert positions_shortfall(doubled, 2.0) == near(positions_shortfall(points, 2.0), rel=ACCURACY)
    uneven = np.vstack([points, points[:7], points[:2]])
    assert positions_shortfall(uneven, 2.0) == near(exact_shortfall(uneven, 2.0), rel=ACCURACY)
    assert positions_shortfall(np.ones((500, 2)), 2.0) == 1.0


def test_many_positions_at_few_places_are_weighed_by_their_numbers():
    counts = np.array([700, 200, 100])
    points = np.repeat([[0.0, 0.0], [1.0, 0.0], [50.0, 0.0]], counts, axis=0)
    expected = (np.sum(counts.astype(float) ** 2) + 2 * 0.5 * 700 * 200) / 1000**2
    assert positions_shortfall(points, 2.0) == near(expected, rel=ACCURACY)


@pytest.mark.parametrize("pairs_at_once", [1, 2, 7, 100, 1001])
def test_the_size_of_a_block_does_not_matter(monkeypatch, pairs_at_once):
    points = np.vstack([scattered(100, seed=4), np.zeros((20, 2))])
    whole = positions_shortfall(points, 1.5)
    assert whole == near(exact_shortfall(points, 1.5), rel=ACCURACY)
    monkeypatch.setattr(sites_module, "PAIRS_AT_ONCE", pairs_at_once)
    assert positions_shortfall(points, 1.5) == near(whole, rel=ACCURACY)


@given(seed=st.integers(0, 10**6), count=st.integers(1, 150), spacing=st.floats(0.01, 1e3))
def test_the_shortfall_lies_between_one_over_the_samples_and_one(seed, count, spacing):
    shortfall = positions_shortfall(scattered(count, seed), spacing)
    assert 1.0 / count * (1 - ACCURACY) <= shortfall <= 1.0 + ACCURACY


@given(seed=st.integers(0, 10**6), spacing=st.floats(0.1, 30.0), factor=st.floats(1.0, 3.0))
def test_the_shortfall_rises_with_the_reach_of_an_occluder(seed, spacing, factor):
    points = scattered(60, seed)
    assert positions_shortfall(points, spacing) <= positions_shortfall(points, spacing * factor) * (
        1 + ACCURACY
    )


def test_positions_may_be_lists_integers_or_rows_of_a_larger_array():
    points = np.arange(24).reshape(6, 4)
    reference = exact_shortfall(points[:, 1:3], 6.0)
    assert positions_shortfall(points[:, 1:3], 6.0) == near(reference, rel=ACCURACY)
    assert positions_shortfall(points[:, 1:3].tolist(), 6) == near(reference, rel=ACCURACY)


def test_positions_outside_the_domain_give_nan():
    points = [[0.0, 0.0], [1.0, 1.0]]
    for spacing in (0.0, -1.0, math.nan, -math.inf):
        assert math.isnan(positions_shortfall(points, spacing))
    for bad in (math.nan, math.inf):
        assert math.isnan(positions_shortfall([[0.0, 0.0], [bad, 1.0]], 1.0))
    assert math.isnan(positions_shortfall(np.zeros((0, 2)), 1.0))
    assert positions_shortfall(points, math.inf) == 1.0


def test_samples_far_apart_compared_with_the_spacing_are_independent():
    for spacing in (1e-9, 1e-300, 5e-324):
        assert positions_shortfall([[0.0, 0.0], [1e7, 1.0]], spacing) == 0.5


@pytest.mark.parametrize("shape", [(3,), (3, 3), (2, 2, 2), (0,)])
def test_positions_of_another_shape_are_refused(shape):
    with pytest.raises(ValueError, match=r"not \(N, 2\)"):
        positions_shortfall(np.zeros(shape), 1.0)


# --- Lattices ------------------------------------------------------------------------------


def masks(rows, columns, share, seed):
    mask = np.random.default_rng(seed).random((rows, columns)) < share
    mask[rows // 2, columns // 2] = True
    return mask


@given(
    rows=st.integers(1, 9),
    columns=st.integers(1, 9),
    share=st.floats(0.1, 1.0),
    seed=st.integers(0, 10**6),
    dhat_x=disparities,
    dhat_y=st.one_of(st.none(), disparities),
)
def test_a_mask_equals_the_sum_over_its_pairs(rows, columns, share, seed, dhat_x, dhat_y):
    mask = masks(rows, columns, share, seed)
    reference = exact.lattice_pair_sum(map(tuple, np.argwhere(mask).tolist()), dhat_x, dhat_y)
    assert lattice_shortfall(mask, dhat_x, dhat_y) == near(float(reference), rel=ACCURACY)


def test_a_full_mask_is_a_grid():
    for dhat in (1e-12, 0.1, 1 / 3, 0.8, 1.0, 5.0):
        assert lattice_shortfall(np.ones((7, 9)), dhat) == near(
            visibility_shortfall(7, 9, dhat), rel=ACCURACY
        )


@pytest.mark.parametrize("counted", [offset_counts, counted_directly, counted_by_transform])
@pytest.mark.parametrize(("rows", "columns"), [(1, 40), (40, 1), (17, 23), (32, 32), (3, 130)])
def test_direct_counts_of_offsets_equal_counts_by_a_transform(counted, rows, columns):
    mask = masks(rows, columns, 0.4, seed=5)
    reaches = [(rows - 1, columns - 1), (rows // 2, columns // 3), (0, columns - 1), (rows - 1, 0)]
    sites = np.argwhere(mask)
    apart = (sites[:, None] - sites[None, :]).reshape(-1, 2)
    for reach_y, reach_x in reaches:
        counts = counted(mask, reach_y, reach_x)
        assert counts.shape == (2 * reach_y + 1, 2 * reach_x + 1)
        expected = np.zeros(counts.shape)
        near_enough = (np.abs(apart[:, 0]) <= reach_y) & (np.abs(apart[:, 1]) <= reach_x)
        np.add.at(expected, tuple((apart[near_enough] + (reach_y, reach_x)).T), 1)
        assert np.array_equal(counts, expected)


def test_a_transform_of_a_large_lattice_counts_to_the_last_pair():
    mask = masks(300, 280, 0.5, seed=6)
    by_transform = counted_by_transform(mask, 12, 12)
    directly = counted_directly(mask, 12, 12)
    assert np.array_equal(by_transform, directly)
    assert by_transform[12, 12] == np.count_nonzero(mask)
    assert np.array_equal(by_transform, by_transform[::-1, ::-1])


def test_a_lattice_equals_its_sites_given_as_positions():
    mask = masks(25, 31, 0.3, seed=9)
    sites = np.argwhere(mask)[:, ::-1]
    assert lattice_shortfall(mask, 0.13, 0.29) == near(
        positions_shortfall(sites * (0.13, 0.29), 1.0), rel=ACCURACY
    )


def test_empty_rows_and_columns_around_a_mask_do_not_matter():
    mask = masks(6, 5, 0.6, seed=10)
    assert lattice_shortfall(np.pad(mask, 4), 0.17) == near(
        lattice_shortfall(mask, 0.17), rel=ACCURACY
    )


def test_masks_outside_the_domain_give_nan():
    mask = np.ones((3, 4), dtype=bool)
    for bad in (0.0, -0.1, math.nan, -math.inf):
        assert math.isnan(lattice_shortfall(mask, bad))
        assert math.isnan(lattice_shortfall(mask, 0.5, bad))
    assert math.isnan(lattice_shortfall(np.zeros((3, 4)), 0.5))
    assert math.isnan(lattice_shortfall(np.zeros((0, 4)), 0.5))


def test_a_mask_without_any_overlap_has_independent_samples():
    mask = np.ones((3, 4), dtype=bool)
    for dhat in (1.0, 1e300, math.inf):
        assert lattice_shortfall(mask, dhat) == near(1 / 12, rel=1e-15)


@pytest.mark.parametrize("shape", [(3,), (2, 2, 2)])
def test_a_mask_of_another_shape_is_refused(shape):
    with pytest.raises(ValueError, match=r"not \(rows, columns\)"):
        lattice_shortfall(np.ones(shape), 0.5)


def test_the_exact_sums_agree_with_each_other():
    """Both methods of the reference give the same sum as a count of offsets by hand."""
    sites = [(0, 0), (0, 1), (2, 1)]
    dhat = Fraction(1, 4)
    # The overlap is 3/4 for the offset (0, 1), 1/2 · 3/4 for (2, 1), and 1/2 for (2, 0). Each of
    # these is counted twice. Three pairs have the offset 0.
    by_hand = (3 + 2 * (Fraction(3, 4) + Fraction(3, 8) + Fraction(1, 2))) / 9
    assert exact.lattice_pair_sum(sites, dhat) == by_hand
    assert exact.pair_sum([(x, y) for y, x in sites], 1 / dhat) == by_hand
