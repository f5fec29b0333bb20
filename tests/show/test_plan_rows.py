"""Tests of the rows about the flight in a plan's summary."""

import re

import pytest

from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.show.text.plan_rows import flight_rows

HERE = {"altitude": 40.0, "origin": (48.3358, 14.3261), "drone": "dji-m3t"}


def wind_row(values, **wind):
    return dict(flight_rows(plan(PlanRequest(**HERE, **values, **wind))))["Wind"]


@pytest.mark.parametrize(
    ("values", "longer"),
    [
        ({"takeoff": (48.34, 14.3261)}, (False, True)),
        ({"grid": "line", "samples": 9, "baseline": 30.0}, (True, True)),
    ],
)
def test_the_wind_row_says_how_much_longer_the_flight_takes(values, longer):
    row = wind_row(values, wind_speed=9.0, wind_from=0.0)
    photos, flights = map(int, re.findall(r"(\d+) s longer", row))
    calm, blown = (
        plan(PlanRequest(**HERE, **values, **wind)).route
        for wind in ({}, {"wind_speed": 9.0, "wind_from": 0.0})
    )
    assert photos == round(blown.time_s - calm.time_s)
    assert flights == round(blown.total_time_s - calm.total_time_s)
    assert (photos > 0, flights > 0) == longer


def test_the_wind_row_says_that_nothing_changes():
    assert "no longer" in wind_row({}, wind_speed=3.0, wind_from=0.0)
