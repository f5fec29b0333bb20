"""Monotone cubics compared with scipy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from aosplan.scenes.correlogram import monotone_cubics

values = st.floats(-10.0, 10.0) | st.integers(-2, 2).map(float)


@given(st.data(), st.integers(2, 12), st.integers(1, 3))
def test_the_coefficients_are_those_of_scipy(data, count, columns):
    steps = data.draw(st.lists(st.floats(0.01, 5.0), min_size=count, max_size=count))
    x = np.cumsum(steps)
    rows = st.lists(values, min_size=columns, max_size=columns)
    y = np.array(data.draw(st.lists(rows, min_size=count, max_size=count)))
    ours = monotone_cubics(x, y)
    with np.errstate(all="ignore"):
        theirs = PchipInterpolator(x, y)
    between = np.linspace(x[0], x[-1], 50)
    piece = np.searchsorted(x[1:-1], between, side="right")
    s = (between - x[piece])[:, np.newaxis]
    c = ours[:, piece]
    found = ((c[0] * s + c[1]) * s + c[2]) * s + c[3]
    assert np.allclose(found, theirs(between), rtol=1e-9, atol=1e-9)


def test_interpolated_values_stay_between_their_neighbours():
    y = np.array([0.0, 0.0, 1.0, 1.0, 0.2])
    c = monotone_cubics(np.arange(5.0), y)
    s = np.linspace(0.0, 1.0, 101)[:, np.newaxis]
    between = ((c[0] * s + c[1]) * s + c[2]) * s + c[3]
    assert (between >= np.minimum(y[:-1], y[1:]) - 1e-12).all()
    assert (between <= np.maximum(y[:-1], y[1:]) + 1e-12).all()


@pytest.mark.parametrize("count", [2, 3])
def test_few_points_on_a_line_are_the_line(count):
    x = np.arange(count) * 1.5
    c = monotone_cubics(x, 2.0 * x + 1.0)
    assert np.allclose(c[:2], 0.0)
    assert np.allclose(c[2], 2.0)
