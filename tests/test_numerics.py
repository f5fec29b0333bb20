"""Kernels for floats and arrays, and searches for roots."""

import math

import numpy as np
import pytest

from aosplan.numerics import heading_axis, smallest, smallest_root, turned


@pytest.mark.parametrize(
    ("heading_deg", "east", "north"), [(0.0, 0.0, 1.0), (90.0, 1.0, 0.0), (-450.0, -1.0, 0.0)]
)
def test_x_runs_along_the_heading_and_y_to_its_right(heading_deg, east, north):
    axis = heading_axis(heading_deg)
    assert axis == pytest.approx((east, north), abs=1e-15)
    assert turned(2.0, 0.0, axis) == pytest.approx((2.0 * east, 2.0 * north), abs=1e-15)
    assert turned(0.0, 2.0, axis) == pytest.approx((2.0 * north, -2.0 * east), abs=1e-15)


def test_turning_twice_gives_back_the_positions_as_floats_and_as_arrays():
    axis = heading_axis(33.0)
    east, north = np.array([3.0, -1.0]), np.array([0.5, 70.0])
    x, y = turned(east, north, axis)
    assert [turned(*each, axis) for each in zip(east, north, strict=True)] == [
        *zip(x, y, strict=True)
    ]
    assert turned(x, y, axis) == (pytest.approx(east), pytest.approx(north))
    assert np.hypot(x, y) == pytest.approx(np.hypot(east, north))
    assert x[0] == pytest.approx(
        math.hypot(3.0, 0.5) * math.cos(math.atan2(3.0, 0.5) - math.radians(33.0))
    )


FALLING = {
    "saturating": (lambda b: 0.9 - (1.0 - math.exp(-5.0 * b)), 0.0, 100.0),
    "a straight line": (lambda b: 3.0 - 7.0 * b, 0.0, 1.0),
    "flat to the ninth order": (lambda b: -((b - 0.3) ** 9), -1.0, 7.0),
    "a step": (lambda b: 1.0 if b < math.pi else -1e-300, 0.0, 1e6),
    "0 from the root on": (lambda b: max(0.7 - b, 0.0), 0.0, 50.0),
    "at the lower end": (lambda b: 5e-324 - b, 0.0, 2.8),
}


@pytest.mark.parametrize("name", FALLING)
def test_the_smallest_root_is_that_of_bisection_in_fewer_evaluations(name):
    function, low, high = FALLING[name]
    asked = []

    def excess(at):
        asked.append(at)
        return function(at)

    root = smallest_root(excess, low, high)
    assert root == smallest(lambda at: function(at) <= 0.0, low, high)
    assert function(math.nextafter(root, -math.inf)) > 0.0
    smooth = name in ("saturating", "a straight line")  # Bisection takes more than 50 evaluations.
    assert len(asked) <= (25 if smooth else 200)
