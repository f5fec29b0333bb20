"""Eq. 1 to 5 with scalars, with arrays of every kind, and with values outside their domain."""

import math

import numpy as np
import pytest
from hypothesis import given
from support.ulps import NAN, computed_values, densities, grids, near, spread

from aosplan.models.equations import (
    aperture,
    baseline_for_aperture,
    line_shortfall,
    mean_squared_error,
    normalized_visibility,
    visibility,
    visibility_limits,
    visibility_shortfall,
)
from aosplan.scenes.density import integrated_density, slice_density, transparency

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


def test_rows_and_columns_as_one_object_give_the_same_result_to_1_ulp():
    """If `rows` and `columns` are the same object, a shorter formula is used, which gives the same
    result.
    """
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


def test_arrays_longer_than_a_block_are_computed_completely():
    side = np.arange(1, 30_001)
    assert visibility_shortfall(1, side, 1.0) == near(1.0 / side, rel=1e-15)
    grid = visibility_shortfall(side[:200, None], side[None, :200], 2.0)
    assert grid == near(1.0 / np.outer(side[:200], side[:200]), rel=1e-15)


def test_strided_and_reversed_arrays_give_correct_results():
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


def test_scalar_arguments_give_a_float():
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
    """The shorter formula, which is used if `rows` and `columns` are the same object, also checks
    the domain.
    """
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
