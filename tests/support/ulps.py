"""Tables of exact values and difficult arguments for tests of the equations."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import strategies as st

from aosplan.models.equations import (
    mean_squared_error,
    normalized_visibility,
    visibility,
    visibility_shortfall,
)

near = partial(pytest.approx, abs=0.0)


# --- Arguments of the property tests -------------------------------------------------------

LARGEST_SIDE = 10**6

sides = st.one_of(
    st.integers(1, 40), st.integers(1, LARGEST_SIDE), st.sampled_from([1, 2, LARGEST_SIDE])
)


@st.composite
def breakpoints(draw):
    """Values of d̂ at and next to 1/k.  At 1/k, the number of neighbours that share an occluder
    changes.
    """
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
    """Arrays of p, rows, columns and d̂ with the same distribution as the arguments of the property
    tests.
    """
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


def computed_values(density, rows, columns, dhat, **transparent):
    return (
        visibility(density, rows, columns, dhat, **transparent),
        mean_squared_error(density, rows, columns, dhat, **transparent),
        normalized_visibility(rows, columns, dhat),
        visibility_shortfall(rows, columns, dhat),
    )


# --- Outside the domain --------------------------------------------------------------------

NAN = math.nan
