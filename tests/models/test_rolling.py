"""Predictions for the integral images along a line that is longer than one integral image."""

import math

import numpy as np
import pytest

import aosplan
from aosplan import PlanRequest
from aosplan.errors import RequestError
from aosplan.models.rolling import continuous_of
from aosplan.models.uniform import UniformModel

LONG_LINE = {"altitude": 40, "grid": "line", "allow_no_common_ground": True}
"""A line of 50 photos with a length of 137.2 m.  It is longer than an image, which is 27 m long."""


def test_a_line_may_be_longer_than_its_integral():
    plan = aosplan.plan(PlanRequest(**LONG_LINE, line_length=500, heading=90))
    b = plan.solution.baseline_m
    assert len(plan.waypoints) == math.floor(500 / b) + 1
    assert plan.route.length_m == pytest.approx((len(plan.waypoints) - 1) * b)
    assert plan.document()["samples"] == 50
    east = np.array(plan.waypoints.east_m)
    assert np.diff(east) == pytest.approx(b)
    assert east[0] + east[-1] == pytest.approx(0.0, abs=1e-9)


def test_integrals_of_a_long_line_equal_lines_of_the_same_number_of_photos():
    plan = aosplan.plan(PlanRequest(**LONG_LINE, model="layered", speed=4))
    table = plan.layout.continuous.document()
    b = plan.solution.baseline_m
    for row in table["by_samples"]:
        alone = aosplan.plan(
            PlanRequest(**LONG_LINE, model="layered", baseline=b, samples=row["samples"])
        )
        assert row["normalized"] == pytest.approx(alone.solution.prediction.normalized, rel=1e-9)
        assert row["expected"] == pytest.approx(alone.solution.prediction.expected, rel=1e-9)
        assert row["length_m"] == pytest.approx((row["samples"] - 1) * b)
        assert row["duration_s"] == pytest.approx(row["length_m"] / 4)
    assert [row["speed_mps"] for row in table["by_speed"]] == [1, 2, 4, 5, 10, 15]
    assert all(
        row["interval_s"] == pytest.approx(b / row["speed_mps"]) for row in table["by_speed"]
    )


def test_a_camera_that_is_too_slow_spreads_its_photos():
    model = UniformModel(0.567, 0.433, 2.8)
    table = continuous_of(model, 50, 1.4, speed_mps=5.0, shortest_interval_s=0.7)
    assert table.fastest_mps == pytest.approx(2.0)
    for row in table.by_speed:
        assert row.spacing_m == pytest.approx(max(1.4, 0.7 * row.speed_mps))
        assert row.interval_s >= 0.7 * (1 - 1e-12)
        assert row.length_m == pytest.approx(49 * row.spacing_m)
    slow, *_, fast = table.by_speed
    assert slow.normalized < fast.normalized == pytest.approx(0.98)


def test_a_line_shorter_than_its_integral_is_an_error():
    with pytest.raises(
        RequestError, match="shorter than an integral, which needs 50 photos over 137"
    ) as caught:
        aosplan.plan(PlanRequest(**LONG_LINE, line_length=100))
    length = float(caught.value.hint.split()[1])
    assert len(aosplan.plan(PlanRequest(**LONG_LINE, line_length=length)).waypoints) >= 50
