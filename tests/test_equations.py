"""Eq. 1 to 5 against exact arithmetic, published values and each other."""

import csv
import math
from decimal import Decimal
from fractions import Fraction
from functools import partial
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from reference import exact, make_tables

from aosplan.errors import RequestError
from aosplan.models.equations import (
    aperture,
    baseline_for_aperture,
    dhat_for_shortfall,
    integrated_density,
    line_shortfall,
    mean_squared_error,
    normalized_visibility,
    required_samples,
    required_samples_for_visibility,
    slice_density,
    transparency,
    visibility,
    visibility_limits,
    visibility_shortfall,
)

near = partial(pytest.approx, abs=0.0)
"""Equal to a relative accuracy, and to nothing else: `approx` alone lets 1e-12 pass."""

ULPS = 8
"""Accuracy of Eq. 2 to 4, in units in the last place of the exact value."""

TABLES = Path(make_tables.__file__).parent


def table(name):
    with (TABLES / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def column(rows, name):
    return [float.fromhex(row[name]) for row in rows]


# --- What the properties are drawn from ----------------------------------------------------

LARGEST_SIDE = 10**6

sides = st.one_of(
    st.integers(1, 40), st.integers(1, LARGEST_SIDE), st.sampled_from([1, 2, LARGEST_SIDE])
)


@st.composite
def breakpoints(draw):
    """1/k, where a neighbour falls out of reach, and the floats on both sides of it."""
    at = 1.0 / draw(st.integers(1, LARGEST_SIDE))
    return draw(st.sampled_from([math.nextafter(at, 0.0), at, math.nextafter(at, 2.0)]))


disparities = st.one_of(
    st.floats(0.0, 1.1),
    st.floats(-300.0, 300.0).map(lambda exponent: 10.0**exponent),
    st.floats(-8.0, 0.0).map(lambda exponent: 10.0**exponent),
    breakpoints(),
    st.floats(0.0, 2.3e-308),
    st.sampled_from([0.0, 5e-324, 1e-300, 1.0, 1e300, math.inf]),
)
densities = st.one_of(
    st.floats(0.0, 1.0),
    st.floats(-300.0, 0.0).map(lambda exponent: 10.0**exponent),
    st.floats(-16.0, 0.0).map(lambda exponent: 1.0 - 10.0**exponent),
    st.sampled_from([0.0, 1e-300, 0.5, 0.567, 1.0 - 1e-16, 1.0]),
)
grids = st.tuples(sides, sides, disparities)


def spread(count, seed):
    """The same mixture as arrays: p, rows, columns, d̂."""
    rng = np.random.default_rng(seed)

    def mixed(*kinds):
        return np.choose(rng.integers(0, len(kinds), count), kinds)

    rows, columns = (
        mixed(
            rng.integers(1, 41, count),
            (10 ** rng.uniform(0, 6, count)).astype(int),
            np.full(count, LARGEST_SIDE),
        )
        for _ in range(2)
    )
    at_kink = 1.0 / (10 ** rng.uniform(0, 6, count)).astype(int)
    at_edge = 1.0 / np.maximum(columns - 1.0, 1.0)
    dhat = mixed(
        rng.uniform(0.0, 1.1, count),
        10 ** rng.uniform(-8, 0, count),
        10 ** rng.uniform(-300, 300, count),
        np.nextafter(at_kink, rng.integers(0, 2, count) * 2.0),
        at_kink,
        np.nextafter(at_edge, rng.integers(0, 2, count) * 2.0),
    )
    density = mixed(
        rng.random(count),
        10 ** rng.uniform(-300, 0, count),
        1.0 - 10 ** rng.uniform(-16, 0, count),
    )
    return density, rows, columns, dhat


def exact_values(density, rows, columns, dhat, transparent=None):
    """V, 1 - V, V̂ and 1 - V̂ as fractions."""
    p = Fraction(density) if transparent is None else 1 - Fraction(transparent)
    shortfall = exact.grid_shortfall(rows, columns, 1.0 if math.isinf(dhat) else dhat)
    v = exact.visibility(p, shortfall)
    return v, 1 - v, 1 - shortfall, shortfall


def computed_values(density, rows, columns, dhat, **transparent):
    return (
        visibility(density, rows, columns, dhat, **transparent),
        mean_squared_error(density, rows, columns, dhat, **transparent),
        normalized_visibility(rows, columns, dhat),
        visibility_shortfall(rows, columns, dhat),
    )


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


@settings(max_examples=2000)
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
    """Where every rounding on the way points to the same side."""
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
def test_transparency_carries_the_digits_of_a_density_that_rounds_to_1(transparent, grid):
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
    """Both sides of d̂ = 1/k are right, and one ulp apart in d̂ they are that close in V̂."""
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
    """Whether low <= high, to the accuracy that both have."""
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
def test_without_disparity_many_samples_are_worth_one(density, rows, columns):
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


# --- Scalars and arrays --------------------------------------------------------------------


def test_scalars_and_arrays_give_the_same_to_1_ulp():
    arguments = spread(3000, seed=2)
    arrays = computed_values(*arguments)
    scalars = np.array(
        [computed_values(*one) for one in zip(*map(np.ndarray.tolist, arguments), strict=True)]
    )
    for array, alone in zip(arrays, scalars.T, strict=True):
        assert np.all(np.abs(array - alone) <= np.spacing(alone))


def test_scalars_and_arrays_of_the_other_equations_give_the_same_to_1_ulp():
    rng = np.random.default_rng(3)
    samples = rng.integers(2, 10**6, 500)
    metres = 10 ** rng.uniform(-3, 3, 500)
    for function, arguments in (
        (aperture, (samples, metres)),
        (baseline_for_aperture, (metres, samples)),
        (line_shortfall, (samples, rng.random(500))),
    ):
        together = function(*arguments)
        alone = [function(*one) for one in zip(*map(np.ndarray.tolist, arguments), strict=True)]
        assert np.all(np.abs(together - alone) <= np.spacing(together)), function.__name__


def test_squares_given_twice_or_by_one_name_give_the_same_to_1_ulp():
    """`rows is columns` takes a shorter way."""
    _, side, _, dhat = spread(2000, seed=4)
    for one, other in (
        (visibility(0.5, side, side, dhat), visibility(0.5, side, side.copy(), dhat)),
        (visibility_shortfall(side, side, dhat), visibility_shortfall(side, side.copy(), dhat)),
        (normalized_visibility(side, side, dhat), normalized_visibility(side, side.copy(), dhat)),
    ):
        assert np.all(np.abs(one - other) <= 2 * np.spacing(other))


def test_shapes_broadcast():
    p = np.linspace(0.1, 0.9, 5)[:, None, None]
    side = np.array([2, 5, 9])[:, None]
    dhat = np.linspace(0.0, 1.2, 4)
    together = visibility(p, side, side, dhat)
    assert together.shape == (5, 3, 4)
    for i, j, k in np.ndindex(together.shape):
        alone = visibility(float(p[i, 0, 0]), int(side[j, 0]), int(side[j, 0]), float(dhat[k]))
        assert together[i, j, k] == alone


def test_arrays_longer_than_a_block_are_whole():
    side = np.arange(1, 30_001)
    assert visibility_shortfall(1, side, 1.0) == near(1.0 / side, rel=1e-15)
    grid = visibility_shortfall(side[:200, None], side[None, :200], 2.0)
    assert grid == near(1.0 / np.outer(side[:200], side[:200]), rel=1e-15)


def test_strided_and_reversed_arrays_are_read_where_they_lie():
    dhat = np.linspace(0.0, 1.0, 20_001)
    whole = visibility(0.5, 7, 7, dhat)
    assert np.array_equal(visibility(0.5, 7, 7, dhat[::-3]), whole[::-3])
    assert np.array_equal(visibility(0.5, 7, 7, np.asfortranarray(np.tile(dhat, (3, 1)))[1]), whole)


def test_arguments_are_not_changed():
    arrays = [array.astype(float) for array in spread(100, seed=5)]
    for array in arrays:
        array.flags.writeable = False
    copies = [array.copy() for array in arrays]
    computed_values(*arrays)
    for array, copy in zip(arrays, copies, strict=True):
        assert np.array_equal(array, copy)


@pytest.mark.parametrize(
    "empty", [np.array([]), np.zeros((0, 3)), np.zeros((3, 0)), []], ids=["0", "0x3", "3x0", "list"]
)
def test_empty_arrays_give_empty_arrays(empty):
    shape = np.shape(empty)
    assert visibility(empty, 3, 3, 0.5).shape == shape
    assert visibility_shortfall(3, 3, empty).shape == shape
    assert integrated_density(empty, 3.0, 0.2).shape == shape
    assert aperture(empty, 1.0).shape == shape


@pytest.mark.parametrize("kind", [int, float, np.int64, np.int32, np.uint8, np.float64, np.float32])
def test_whole_numbers_of_every_kind_count_samples(kind):
    value = visibility(0.5, kind(7), kind(9), kind(1))
    assert value == visibility(0.5, 7, 9, 1.0)
    assert np.ndim(value) == 0
    assert isinstance(value, float)


def test_arrays_of_whole_numbers_lists_and_0_d_arrays_are_taken():
    assert visibility(0.5, np.array([7, 9], dtype=np.int16), 7, 1).tolist() == [
        visibility(0.5, 7, 7, 1.0),
        visibility(0.5, 9, 7, 1.0),
    ]
    assert visibility(0.5, 7, 7, [0.5, 1.0]).shape == (2,)
    zero_d = visibility(np.array(0.5), 7, 7, np.array(1.0))
    assert np.ndim(zero_d) == 0
    assert float(zero_d) == visibility(0.5, 7, 7, 1.0)


def test_scalars_in_give_a_float():
    for value in (
        *computed_values(0.5, 7, 7, 1.0),
        *visibility_limits(0.5),
        integrated_density(0.01, 20, 1),
        transparency(0.01, 20, 1),
        slice_density(0.5, 20, 1),
        line_shortfall(7, 1),
        aperture(49, 2.8),
        baseline_for_aperture(17.0, 49),
    ):
        assert type(value) is float


# --- Outside the domain --------------------------------------------------------------------

NAN = math.nan
OUTSIDE = {
    visibility: [
        (NAN, -0.1, -5e-324, 1.0 + 2**-52, 2, math.inf, -math.inf),
        (NAN, 0, -1, 0.5, 2.5, math.inf, -math.inf),
        (NAN, 0, -1, 0.5, 2.5, math.inf, -math.inf),
        (NAN, -0.1, -5e-324, -math.inf),
    ],
    normalized_visibility: [
        (NAN, 0, -1, 0.5, 2.5, math.inf, -math.inf),
        (NAN, 0, -1, 0.5, 2.5, math.inf, -math.inf),
        (NAN, -0.1, -5e-324, -math.inf),
    ],
    line_shortfall: [(NAN, 0, -1, 0.5, 2.5, math.inf), (NAN, -0.1, -math.inf)],
    visibility_limits: [(NAN, -0.1, 1.1, math.inf)],
    integrated_density: [
        (NAN, -0.1, 1.1, math.inf),
        (NAN, -1.0, -math.inf),
        (NAN, 0.0, -1.0, -math.inf),
    ],
    slice_density: [
        (NAN, -0.1, 1.1, math.inf),
        (NAN, 0.0, -1.0, -math.inf),
        (NAN, 0.0, -1.0, -math.inf),
    ],
    aperture: [(NAN, 0, 0.5, -1), (NAN, -1.0)],
    baseline_for_aperture: [(NAN, -1.0), (NAN, 0, 1, 0.5, -1)],
}
OUTSIDE[mean_squared_error] = OUTSIDE[visibility]
OUTSIDE[visibility_shortfall] = OUTSIDE[normalized_visibility]
OUTSIDE[transparency] = OUTSIDE[integrated_density]
INSIDE = {
    visibility: (0.5, 7, 8, 0.5),
    mean_squared_error: (0.5, 7, 8, 0.5),
    normalized_visibility: (7, 8, 0.5),
    visibility_shortfall: (7, 8, 0.5),
    line_shortfall: (7, 0.5),
    visibility_limits: (0.5,),
    integrated_density: (0.01, 20.0, 0.2),
    transparency: (0.01, 20.0, 0.2),
    slice_density: (0.5, 20.0, 0.2),
    aperture: (49, 2.8),
    baseline_for_aperture: (17.0, 49),
}
CASES = [
    pytest.param(function, place, value, id=f"{function.__name__}-{place}-{value}")
    for function, places in OUTSIDE.items()
    for place, values in enumerate(places)
    for value in values
]


@pytest.mark.parametrize(("function", "place", "value"), CASES)
def test_outside_the_domain_every_argument_gives_nan_and_no_warning(function, place, value):
    arguments = list(INSIDE[function])
    fine = np.ravel(function(*arguments))
    assert not np.any(np.isnan(fine))
    with np.errstate(all="raise"):
        arguments[place] = value
        assert np.all(np.isnan(function(*arguments))), "as a scalar"
        arguments[place] = np.array(
            [INSIDE[function][place], value, INSIDE[function][place]], float
        )
        for result, alone in zip(np.atleast_2d(function(*arguments)), fine, strict=True):
            assert result == near([alone, NAN, alone], rel=1e-15, nan_ok=True), "in an array"


def test_squares_outside_the_domain_give_nan():
    """`rows is columns` takes a shorter way."""
    for side in (NAN, 0, 2.5, math.inf):
        for value in (side, np.array([side, 7.0])):
            for result in (
                visibility(0.5, value, value, 0.5),
                mean_squared_error(0.5, value, value, 0.5),
                normalized_visibility(value, value, 0.5),
                visibility_shortfall(value, value, 0.5),
            ):
                assert math.isnan(np.ravel(result)[0])


@pytest.mark.parametrize("value", [NAN, -0.1, 1.5, math.inf])
def test_a_transparency_outside_its_domain_gives_nan(value):
    for function in (visibility, mean_squared_error):
        assert math.isnan(function(0.5, 7, 7, 1.0, transparency=value))
        with np.errstate(all="raise"):
            both = function(0.5, 7, 7, 1.0, transparency=np.array([value, 0.5]))
        assert math.isnan(both[0])
        assert both[1] == function(0.5, 7, 7, 1.0)


def test_whole_numbers_too_large_for_a_float_give_nan():
    assert math.isnan(visibility(0.5, 10**400, 10**400, 1.0))


@given(density=densities, grid=grids)
def test_inside_the_domain_nothing_is_nan_and_nothing_warns(density, grid):
    with np.errstate(all="raise"):
        assert np.all(np.isfinite(computed_values(density, *grid)))
        for values in computed_values(*(np.array([value]) for value in (density, *grid))):
            assert np.all(np.isfinite(values))


# --- Eq. 1 ---------------------------------------------------------------------------------


def eq_1_bound(row):
    """8 + 2 |ln T| units: a relative error of the exponent grows with the exponent."""
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
def test_p_and_transparency_make_1(share, ratio, size):
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
    # p holds D to as many digits as 1 - p has left.
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


# --- Inverses of Eq. 2 and 5 ---------------------------------------------------------------


@given(
    rows=st.integers(1, 60),
    columns=st.integers(1, 60),
    share=st.floats(0.0, 1.0),
    pitch_ratio=st.floats(1.0, 8.0),
)
def test_dhat_for_shortfall_is_the_smallest_that_reaches_it(rows, columns, share, pitch_ratio):
    def shortfall(dhat):
        return line_shortfall(columns, dhat) * line_shortfall(rows, pitch_ratio * dhat)

    least = shortfall(1.0)
    target = least + (1.0 - least) * share
    dhat = dhat_for_shortfall(target, rows, columns, pitch_ratio=pitch_ratio)
    assert 0.0 <= dhat <= 1.0
    assert shortfall(dhat) <= target
    assert dhat == 0.0 or shortfall(math.nextafter(dhat, 0.0)) > target


def test_dhat_for_shortfall_inverts_eq_2():
    for side in (2, 5, 7, 30):
        for dhat in (0.05, 0.3, 0.5, 0.77, 1.0):
            found = dhat_for_shortfall(visibility_shortfall(side, side, dhat), side, side)
            assert found == near(dhat, rel=1e-13)


def test_a_shortfall_that_no_disparity_reaches_has_no_dhat():
    assert math.isnan(dhat_for_shortfall(1 / 49 * (1 - 1e-9), 7, 7))
    assert dhat_for_shortfall(1 / 49 * (1 + 1e-9), 7, 7) == near(1.0, rel=1e-6)
    assert math.isnan(dhat_for_shortfall(NAN, 7, 7))
    assert dhat_for_shortfall(1.0, 7, 7) == 0.0


@given(samples=st.integers(2, 10**12), baseline=st.floats(1e-6, 1e6))
def test_baseline_for_aperture_inverts_eq_5(samples, baseline):
    side = aperture(samples, baseline)
    assert baseline_for_aperture(side, samples) == near(baseline, rel=4e-16)
    with mpmath.workdps(40):
        reference = (mpmath.sqrt(samples) - 1) * mpmath.mpf(baseline)
        assert side == near(float(reference), rel=5e-16)


def test_one_sample_has_no_aperture():
    assert aperture(1, 2.8) == 0.0
    assert math.isnan(baseline_for_aperture(0.0, 1))


# --- Eq. 4 backwards -----------------------------------------------------------------------


@st.composite
def decimals(draw):
    """A decimal below 1 as people write it, with the whole numbers it is made of."""
    places = draw(st.integers(1, 30))
    digits = draw(
        st.one_of(
            st.integers(0, 10**places - 1),
            st.integers(1, min(1000, 10**places)).map(lambda n: 10**places - n),
        )
    )
    return f"0.{digits:0{places}d}", digits, 10**places


@given(written=decimals())
def test_required_samples_is_exact_for_what_is_written(written):
    text, digits, whole = written
    fewest = -(-whole // (whole - digits))  # ⌈1/(1 - digits/whole)⌉ in whole numbers
    assert required_samples(text) == fewest
    assert required_samples(Decimal(text)) == fewest
    assert required_samples(Fraction(digits, whole)) == fewest
    assert required_samples(f" {text}e2% ") == fewest


@given(target=st.fractions(0, 1).filter(lambda share: share < 1))
def test_required_samples_is_the_fewest_of_eq_4(target):
    samples = required_samples(target)
    assert 1 - Fraction(1, samples) >= target
    assert samples == 1 or 1 - Fraction(1, samples - 1) < target


@given(samples=st.integers(1, 10**30))
def test_required_samples_inverts_eq_4_for_fractions(samples):
    assert required_samples(1 - Fraction(1, samples)) == samples


def test_required_samples_inverts_eq_4_for_every_float_to_a_million():
    wrong = [k for k in range(1, 10**6 + 1) if required_samples(1.0 - 1.0 / k) != k]
    assert wrong == []


@given(target=st.floats(0.0, 1.0 - 1e-6))
def test_a_float_snaps_to_a_whole_number_of_samples_within_1_ulp_only(target):
    samples = required_samples(target)
    unit = Fraction(math.ulp(target))
    assert 1 - Fraction(1, samples) >= Fraction(target) - unit
    assert samples == 1 or 1 - Fraction(1, samples - 1) < Fraction(target)


@pytest.mark.parametrize("samples", [2, 3, 10, 50, 100, 1000, 12_345])
def test_a_float_further_than_1_ulp_above_asks_for_one_sample_more(samples):
    target = 1.0 - 1.0 / samples
    for _ in range(3):
        target = math.nextafter(target, 1.0)
    assert required_samples(target) == samples + 1


@pytest.mark.parametrize(
    ("target", "samples"),
    [
        (0, 1),
        (0.0, 1),
        ("0", 1),
        ("1e-400", 2),
        ("0.5", 2),
        (0.5, 2),
        ("0.8", 5),
        (0.8, 5),
        ("0.9", 10),
        (0.9, 10),
        ("0.98", 50),
        ("98%", 50),
        ("98 %", 50),
        (" .98 ", 50),
        ("9.8e-1", 50),
        (0.98, 50),
        (Decimal("0.98"), 50),
        (Fraction(49, 50), 50),
        ("0.980000000000000001", 51),
        ("0.99", 100),
        (0.99, 100),
        (0.999, 1000),
        ("0.999999", 10**6),
        (0.999999, 10**6),
        ("0." + "9" * 50, 10**50),
    ],
)
def test_required_samples_of_known_targets(target, samples):
    assert required_samples(target) == samples


@pytest.mark.parametrize(
    "target",
    [
        1,
        1.0,
        "1",
        "100%",
        1.5,
        98,
        "98",
        "150%",
        -0.1,
        "-1%",
        NAN,
        math.inf,
        "nan",
        "inf",
        "1e999999999",
        "",
        " ",
        "%",
        "abc",
        "0.9.8",
        "9" * 500,
        None,
        [],
        1j,
        Decimal("NaN"),
    ],
    ids=repr,
)
def test_a_target_that_is_no_share_below_1_is_refused_in_one_sentence_with_a_hint(target):
    with pytest.raises(RequestError) as caught:
        required_samples(target)
    assert "V̂" in caught.value.message
    assert "\n" not in caught.value.message
    assert len(caught.value.message) < 100
    assert caught.value.hint


def test_a_percentage_without_its_sign_is_told_where_the_sign_goes():
    for target in (98, "98", 98.0, Decimal(98)):
        with pytest.raises(RequestError) as caught:
            required_samples(target)
        assert required_samples(caught.value.hint.removeprefix("write ")) == 50


def test_the_hint_for_more_than_100_percent_can_be_followed():
    with pytest.raises(RequestError) as caught:
        required_samples("150%")
    assert "%%" not in caught.value.hint


# --- Eq. 3 backwards -----------------------------------------------------------------------


@given(target=st.floats(0.0, 1.0), density=st.floats(0.0, 1.0))
def test_required_samples_for_visibility_is_the_fewest_of_eq_3(target, density):
    samples = required_samples_for_visibility(target, density)
    p, wanted = Fraction(density), Fraction(target)

    def reached(n):
        return 1 - p**2 - p * (1 - p) / n

    if samples is None:
        assert wanted >= 1 - p**2
    else:
        assert reached(samples) >= wanted
        assert samples == 1 or reached(samples - 1) < wanted


def test_visibility_that_one_sample_has_needs_one_and_beyond_the_limit_nothing_helps():
    assert required_samples_for_visibility(0.5, 0.5) == 1
    assert required_samples_for_visibility(0.0, 1.0) == 1
    assert required_samples_for_visibility(1.0, 0.0) == 1
    assert required_samples_for_visibility(0.75, 0.5) is None
    assert required_samples_for_visibility(math.nextafter(0.75, 0.0), 0.5) is not None
    assert required_samples_for_visibility(0.1, 1.0) is None


def test_required_samples_for_visibility_at_round_targets():
    assert required_samples_for_visibility(0.625, 0.5) == 2
    assert required_samples_for_visibility(0.6875, 0.5) == 4
    assert required_samples_for_visibility(0.6735, 0.567) == 49
    assert required_samples_for_visibility(0.678, 0.567) == 481


# --- What the paper prints -----------------------------------------------------------------


def test_98_percent_need_50_samples():
    """Section II and Fig. 5b: 98 % correlate to 50 samples, whatever the density."""
    assert required_samples("98%") == 50
    assert normalized_visibility(5, 10, 1.0) == 0.98


def test_the_aperture_of_50_samples_is_6_1_baselines():
    """Section III and Fig. 7a."""
    assert round(aperture(50, 1.0), 1) == 6.1


def test_a_density_of_0_95_percent_integrates_to_56_7_percent():
    """Section III: D = 0.95 %, p = 56.7 %; the height over occluder size that gives them."""
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
    """14 m for 25 samples and 19.6 m for 49 at b = 2.8 m are √N b; Eq. 5 is followed."""
    for samples, printed in ((25, 14.0), (49, 19.6)):
        assert math.sqrt(samples) * 2.8 == near(printed, rel=1e-15)
        assert aperture(samples, 2.8) == near(printed - 2.8, rel=1e-15)
