"""Eq. 1 to 5, compared with exact arithmetic, with published values, and with each other."""

import csv
import math
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from reference import exact, make_tables
from support.ulps import (
    LARGEST_SIDE,
    computed_values,
    densities,
    disparities,
    grids,
    near,
    sides,
    spread,
)

from aosplan.models.equations import (
    aperture,
    line_shortfall,
    mean_squared_error,
    normalized_visibility,
    required_samples,
    visibility,
    visibility_limits,
    visibility_shortfall,
)
from aosplan.scenes.density import integrated_density, slice_density, transparency

ULPS = 8
"""Accuracy of Eq. 2 to 4, in units in the last place of the exact value."""

TABLES = Path(make_tables.__file__).parent


def table(name):
    with (TABLES / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def column(rows, name):
    return [float.fromhex(row[name]) for row in rows]


def exact_values(density, rows, columns, dhat, transparent=None):
    """V, 1 - V, V̂ and 1 - V̂ as fractions."""
    p = Fraction(density) if transparent is None else 1 - Fraction(transparent)
    shortfall = exact.grid_shortfall(rows, columns, 1.0 if math.isinf(dhat) else dhat)
    v = exact.visibility(p, shortfall)
    return v, 1 - v, 1 - shortfall, shortfall


# --- The reference itself ------------------------------------------------------------------


def test_the_tables_are_what_their_generator_makes():
    for name, text in make_tables.tables().items():
        assert (TABLES / name).read_text(encoding="utf-8") == text, name


@pytest.mark.parametrize("dhat", [0.0, 0.01, 0.1, 1 / 7, 0.3, 0.4999, 0.5, 0.77, 1.0, 3.0])
def test_the_papers_double_sum_is_the_square_of_its_one_dimensional_sum(dhat):
    for side in range(1, 13):
        assert exact.double_sum(side, dhat) == (side**2 * exact.appendix_sum(side, dhat)) ** 2


@given(samples=st.integers(1, 300), dhat=disparities.filter(math.isfinite))
def test_sums_of_powers_equal_the_appendix_summed_term_by_term(samples, dhat):
    assert exact.line_shortfall(samples, dhat) == exact.appendix_sum(samples, dhat)


# --- Eq. 2 to 4: accuracy ------------------------------------------------------------------


def test_eq_2_agrees_with_the_paper_as_printed():
    for row in table("eq2.csv"):
        given_t = (
            {"transparency": float.fromhex(row["transparency"])} if row["transparency"] else {}
        )
        arguments = (
            float.fromhex(row["density"]),
            int(row["rows"]),
            int(row["columns"]),
            float.fromhex(row["dhat"]),
        )
        names = "visibility", "mean_squared_error", "normalized_visibility", "visibility_shortfall"
        for name, value in zip(names, computed_values(*arguments, **given_t), strict=True):
            assert exact.ulps(value, Fraction(row[name])) <= ULPS, (name, arguments, given_t)


@settings(max_examples=300)
@given(density=densities, grid=grids)
@example(density=0.1, grid=(19, 19, 0.19535276310658553))
@example(density=0.3, grid=(78982, 78982, 0.4414068951515152))
@example(density=0.3, grid=(4, 17080, 5.8551437437789105e-05))
@example(density=1e-300, grid=(LARGEST_SIDE, LARGEST_SIDE, 1.0))
def test_v_and_vhat_and_their_complements_are_within_8_ulp_of_exact_arithmetic(density, grid):
    values = computed_values(density, *grid)
    for value, reference in zip(values, exact_values(density, *grid), strict=True):
        assert exact.ulps(value, reference) <= ULPS


@pytest.mark.parametrize(
    ("density", "side", "dhat"),
    [
        (7.379400928050507e-05, 73, 0.014758059876807398),
        (0.0004411080086249292, 127_459, 1.1727738064907312e-05),
        (0.0015317011429244497, 6, 0.23319273939779162),
        (1.1224527578898253e-07, 88, 0.9998717430166095),
        (2.129239068897007e-07, 714_099, 6.996442653059599e-06),
        (0.019796945886073895, 17_752, 6.000397688535082e-05),
        (0.3, 695_660, 6.884624297578392e-06),
        (0.007517852780000112, 792_999, 1.0937126223406864e-06),
        (0.014422571290178487, 6, 0.14352941354775078),
    ],
)
def test_arguments_found_by_search_to_be_the_worst_keep_8_ulp(density, side, dhat):
    """For arguments at which all rounding errors have the same sign, the error is at most 8 ulp."""
    values = computed_values(density, side, side, dhat)
    for value, reference in zip(values, exact_values(density, side, side, dhat), strict=True):
        assert exact.ulps(value, reference) <= ULPS


def test_arrays_are_within_8_ulp_of_exact_arithmetic():
    arguments = spread(4000, seed=1)
    found = np.transpose(computed_values(*arguments))
    for values, *scalars in zip(found, *(array.tolist() for array in arguments), strict=True):
        for value, reference in zip(values, exact_values(*scalars), strict=True):
            assert exact.ulps(value, reference) <= ULPS, scalars


@given(samples=sides, dhat=disparities)
def test_the_shortfall_of_a_line_is_within_8_ulp_of_exact_arithmetic(samples, dhat):
    reference = exact.line_shortfall(samples, min(dhat, 2.0))
    assert exact.ulps(line_shortfall(samples, dhat), reference) <= ULPS
    assert exact.ulps(visibility_shortfall(1, samples, dhat), reference) <= ULPS


@given(transparent=st.floats(-300.0, -15.0).map(lambda e: 10.0**e), grid=grids)
def test_transparency_keeps_digits_if_the_density_rounds_to_1(transparent, grid):
    values = computed_values(1.0 - transparent, *grid, transparency=transparent)
    for value, reference in zip(
        values, exact_values(None, *grid, transparent=transparent), strict=True
    ):
        assert exact.ulps(value, reference) <= ULPS


def test_transparency_may_be_an_array():
    lost = np.array([1e-30, 1e-200])
    assert visibility(1.0, 7, 7, 1.0, transparency=lost).tolist() == [
        visibility(1.0, 7, 7, 1.0, transparency=float(value)) for value in lost
    ]
    assert np.all(visibility(1.0, 7, 7, 1.0, transparency=lost) > lost)


def test_no_term_of_eq_2_jumps_at_a_breakpoint():
    """Values on both sides of d̂ = 1/k are accurate, and values at neighbouring floats differ by a
    few ulp.
    """
    for k in (1, 2, 3, 7, 49, 999, 12345, 10**6):
        at = 1.0 / k
        for side in (2, 3, k, k + 1, k + 2, 10**6):
            around = [
                visibility_shortfall(side, side, dhat)
                for dhat in (math.nextafter(at, 0.0), at, math.nextafter(at, 2.0))
            ]
            assert max(around) - min(around) <= 2 * ULPS * math.ulp(max(around)), (k, side)


@given(density=densities)
def test_the_limits_are_within_2_ulp(density):
    p = Fraction(density)
    minimum, maximum = visibility_limits(density)
    assert exact.ulps(minimum, 1 - p) <= 2
    assert exact.ulps(maximum, 1 - p**2) <= 2


# --- Eq. 2 to 4: shape ---------------------------------------------------------------------


def not_above(low, high, units=ULPS):
    """Whether `low` is at most `high`, within the accuracy of both."""
    return low <= high + units * math.ulp(high)


@given(density=densities, grid=grids)
def test_visibility_lies_between_one_sample_and_infinitely_many(density, grid):
    v, error, vhat, shortfall = computed_values(density, *grid)
    minimum, maximum = visibility_limits(density)
    assert 0.0 <= v <= 1.0
    assert 0.0 <= error <= 1.0
    assert not_above(minimum, v)
    assert not_above(v, maximum)
    assert 0.0 <= vhat <= 1.0
    assert 0.0 < shortfall <= 1.0
    assert not_above(1.0 / (grid[0] * grid[1]), shortfall)


@given(density=densities, grid=grids, more=st.integers(1, 1000))
def test_visibility_rises_with_the_number_of_samples(density, grid, more):
    rows, columns, dhat = grid
    fewer = computed_values(density, rows, columns, dhat)
    for wider in ((rows, columns + more), (rows + more, columns)):
        v, error, vhat, shortfall = computed_values(density, *wider, dhat)
        assert not_above(fewer[0], v)
        assert not_above(error, fewer[1])
        assert not_above(fewer[2], vhat)
        assert not_above(shortfall, fewer[3])


@given(density=densities, grid=grids, factor=st.floats(1.0, 3.0))
def test_visibility_rises_with_disparity(density, grid, factor):
    rows, columns, dhat = grid
    less = computed_values(density, rows, columns, dhat)
    v, error, vhat, shortfall = computed_values(density, rows, columns, dhat * factor)
    assert not_above(less[0], v)
    assert not_above(error, less[1])
    assert not_above(less[2], vhat)
    assert not_above(shortfall, less[3])


@given(density=densities, grid=grids, step=st.floats(0.0, 1.0))
def test_visibility_falls_with_density(density, grid, step):
    denser = density + (1.0 - density) * step
    assert not_above(visibility(denser, *grid), visibility(density, *grid))
    assert not_above(mean_squared_error(density, *grid), mean_squared_error(denser, *grid))


@given(grid=grids, beyond=st.floats(1.0, 1e300))
def test_beyond_a_disparity_of_1_nothing_is_gained(grid, beyond):
    rows, columns, _ = grid
    assert visibility_shortfall(rows, columns, beyond) == visibility_shortfall(rows, columns, 1.0)
    assert exact.ulps(visibility_shortfall(rows, columns, beyond), Fraction(1, rows * columns)) <= 2


@given(density=densities, samples=sides)
def test_eq_3_is_eq_2_from_a_disparity_of_1_on(density, samples):
    p = Fraction(density)
    printed = 1 - p**2 - p * (1 - p) / samples
    assert exact.ulps(visibility(density, 1, samples, 1.0), printed) <= ULPS


@given(density=densities, rows=sides, columns=sides)
def test_without_disparity_many_samples_equal_one_sample(density, rows, columns):
    assert visibility(density, rows, columns, 0.0) == visibility_limits(density)[0]
    assert normalized_visibility(rows, columns, 0.0) == 0.0
    assert visibility_shortfall(rows, columns, 0.0) == 1.0


@given(density=densities, dhat=disparities)
def test_a_single_sample_sees_what_is_not_hidden(density, dhat):
    assert visibility(density, 1, 1, dhat) == 1.0 - density
    assert normalized_visibility(1, 1, dhat) == 0.0


@given(grid=grids)
def test_normalized_visibility_is_visibility_between_its_limits(grid):
    minimum, maximum = visibility_limits(0.5)
    between = (visibility(0.5, *grid) - minimum) / (maximum - minimum)
    assert normalized_visibility(*grid) == pytest.approx(between, rel=0.0, abs=1e-14)


def test_the_gain_is_largest_at_a_density_of_one_half():
    p = np.linspace(0.0, 1.0, 1001)
    minimum, maximum = visibility_limits(p)
    assert p[np.argmax(maximum - minimum)] == 0.5


@given(grid=grids, density=densities)
def test_rows_and_columns_may_be_exchanged(grid, density):
    rows, columns, dhat = grid
    values = computed_values(density, rows, columns, dhat)
    turned = computed_values(density, columns, rows, dhat)
    for one, other in zip(values, turned, strict=True):
        assert abs(one - other) <= ULPS * math.ulp(one)


# --- Eq. 1 ---------------------------------------------------------------------------------


def eq_1_bound(row):
    """The bound is 8 + 2 |ln T| units, because the relative error of T is |ln T| times the relative
    error of the exponent.
    """
    return 8.0 + 2.0 * abs(float(mpmath.log(mpmath.mpf(row["transparency"]))))


def eq_1_rows(*, hard):
    rows = table("eq1.csv")
    found = [
        (row["slice_density"], row["volume_height"], row["occluder_size"])
        in make_tables.HARD_TRANSPARENCIES
        for row in rows
    ]
    return [row for row, is_hard in zip(rows, found, strict=True) if is_hard == hard]


def arguments_of(row):
    return tuple(
        float.fromhex(row[name]) for name in ("slice_density", "volume_height", "occluder_size")
    )


def test_p_of_eq_1_is_within_8_ulp_of_50_digits():
    rows = eq_1_rows(hard=False) + eq_1_rows(hard=True)
    together = integrated_density(*np.transpose([arguments_of(row) for row in rows]))
    for row, in_array in zip(rows, together, strict=True):
        for value in (integrated_density(*arguments_of(row)), in_array):
            assert exact.ulps(value, Fraction(row["density"])) <= 8, row


def test_transparency_of_eq_1_is_within_8_plus_2_ln_t_ulp_of_50_digits():
    rows = eq_1_rows(hard=False)
    together = transparency(*np.transpose([arguments_of(row) for row in rows]))
    for row, in_array in zip(rows, together, strict=True):
        for value in (transparency(*arguments_of(row)), in_array):
            assert exact.ulps(value, Fraction(row["transparency"])) <= eq_1_bound(row), row


def test_transparency_keeps_that_accuracy_where_all_roundings_point_the_same_way():
    rows = eq_1_rows(hard=True)
    assert len(rows) == len(make_tables.HARD_TRANSPARENCIES)
    together = transparency(*np.transpose([arguments_of(row) for row in rows]))
    for row, in_array in zip(rows, together, strict=True):
        for value in (transparency(*arguments_of(row)), in_array):
            assert exact.ulps(value, Fraction(row["transparency"])) <= eq_1_bound(row), row


shares = st.one_of(st.floats(0.0, 1.0), st.floats(-300.0, 0.0).map(lambda e: 10.0**e))
ratios = st.floats(-6.0, 6.0).map(lambda exponent: 10.0**exponent)


@given(share=shares, ratio=ratios, size=st.floats(1e-3, 1e3))
def test_the_sum_of_p_and_transparency_is_1(share, ratio, size):
    p = integrated_density(share, ratio * size, size)
    t = transparency(share, ratio * size, size)
    assert 0.0 <= p <= 1.0
    assert 0.0 <= t <= 1.0
    assert p + t == near(1.0, rel=1e-15)


@given(share=shares, ratio=ratios, factor=st.floats(1.0, 2.0))
def test_p_rises_with_density_and_with_height(share, ratio, factor):
    p = integrated_density(share, ratio, 1.0)
    assert not_above(p, integrated_density(share, ratio * factor, 1.0))
    assert not_above(p, integrated_density(min(share * factor, 1.0), ratio, 1.0))


@given(share=st.floats(1e-6, 0.9), ratio=st.floats(1e-3, 10.0))
def test_slice_density_inverts_eq_1(share, ratio):
    p = integrated_density(share, ratio, 1.0)
    # D can be recovered from p with as many digits as 1 - p has.
    lost = 1e-15 / transparency(share, ratio, 1.0)
    assert slice_density(p, ratio, 1.0) == near(share, rel=1e-14 + 2 * lost / share)
    assert integrated_density(slice_density(p, ratio, 1.0), ratio, 1.0) == near(p, rel=1e-14)


def test_slice_density_is_within_8_ulp_of_50_digits():
    source = np.random.default_rng(6)
    p = np.concatenate([source.random(300), 10 ** source.uniform(-300, 0, 300)])
    ratio = 10 ** source.uniform(-2, 6, p.size)
    with mpmath.workdps(50):
        for density, height, in_array in zip(
            p.tolist(), ratio.tolist(), slice_density(p, ratio, 1.0), strict=True
        ):
            log_q = mpmath.log1p(-mpmath.mpf(density)) / mpmath.mpf(height)
            reference = Fraction(mpmath.nstr(-mpmath.expm1(log_q), 30))
            for value in (slice_density(density, height, 1.0), in_array):
                assert exact.ulps(value, reference) <= 8, (density, height)


def test_empty_and_solid_volumes_are_clear_and_opaque():
    for of_eq_1 in (integrated_density, transparency):
        clear = 0.0 if of_eq_1 is integrated_density else 1.0
        for arguments in ((0.0, 20.0, 0.2), (0.5, 0.0, 0.2), (1.0, 0.0, 0.2), (0.0, 1e300, 1e-300)):
            assert of_eq_1(*arguments) == clear
            assert of_eq_1(*map(np.array, arguments)) == clear
        for arguments in (
            (1.0, 20.0, 0.2),
            (0.5, 1e300, 1e-300),
            (0.5, math.inf, 0.2),
            (1.0, 1e-200, 1e200),
        ):
            assert of_eq_1(*arguments) == 1.0 - clear
            assert of_eq_1(*map(np.array, arguments)) == 1.0 - clear
    assert slice_density(0.0, 20.0, 0.2) == 0.0
    assert slice_density(1.0, 20.0, 0.2) == 1.0


# --- Numbers in the paper ------------------------------------------------------------------


def test_98_percent_need_50_samples():
    """Section II and Fig. 5b: 50 samples reach V̂ = 98 % at any density."""
    assert required_samples("98%") == 50
    assert normalized_visibility(5, 10, 1.0) == 0.98


def test_the_aperture_of_50_samples_is_6_1_baselines():
    """Section III and Fig. 7a: the aperture of 50 samples is 6.1 baselines."""
    assert round(aperture(50, 1.0), 1) == 6.1


def test_a_density_of_0_95_percent_integrates_to_56_7_percent():
    """Section III: for l/o = 87.69, a density D = 0.95 % gives p = 56.7 %."""
    ratio = math.log1p(-0.567) / math.log1p(-0.0095)
    assert ratio == near(87.69, rel=1e-4)
    assert integrated_density(0.0095, ratio, 1.0) == near(0.567, rel=1e-14)
    assert slice_density(0.567, ratio, 1.0) == near(0.0095, rel=1e-14)


def test_the_limits_at_56_7_percent():
    minimum, maximum = visibility_limits(0.567)
    assert minimum == near(0.433, rel=1e-14)
    assert maximum == near(0.678511, rel=1e-14)
    assert visibility(0.567, 5, 10, 1.0) == near(0.433 + 0.98 * 0.567 * 0.433, rel=1e-14)


def test_the_apertures_of_fig_9_are_one_pitch_larger_than_eq_5():
    """At b = 2.8 m, the paper has 14 m for 25 samples and 19.6 m for 49 samples.  These values are
    √N b, but aosplan uses Eq. 5.
    """
    for samples, printed in ((25, 14.0), (49, 19.6)):
        assert math.sqrt(samples) * 2.8 == near(printed, rel=1e-15)
        assert aperture(samples, 2.8) == near(printed - 2.8, rel=1e-15)
