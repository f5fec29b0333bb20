"""If a line is too long for a battery, the hint has values of options that make the line short
enough.
"""

import math
import re

import pytest
from support.command_line import FIELD

from aosplan.errors import InfeasibleError
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest

LINE = {"altitude": 60.0, "drone": "dji-m3t", "trigger": "distance", "grid": "line", "vhat": 0.9}
LINE |= {"origin": (48.3, 14.3), "line_length": 900.0, "flight_time": 5.0}


def refused(**values):
    with pytest.raises(InfeasibleError) as caught:
        plan(PlanRequest(**(LINE | values)))
    return caught.value


def test_each_remedy_of_a_long_line_is_enough_by_its_number():
    error = refused()
    takes = float(re.search(r"back takes ([\d.]+) min", error.message)[1])
    longest = int(re.search(r"lines of at most (\d+) m", error.hint)[1])
    enough = plan(PlanRequest(**(LINE | {"flight_time": 1.001 * takes})))
    assert len(enough.route.flights) == 1
    assert refused(flight_time=0.999 * takes).hint
    # The stated length of the line includes the run-in, the run-out and the last photo.
    around = 2.0 * enough.route.timing.run_in_m + enough.solution.baseline_m
    shorter = plan(PlanRequest(**(LINE | {"line_length": longest - around})))
    assert max(flight.time_s for flight in shorter.route.flights) <= 300.0
    assert refused(line_length=1.3 * longest).hint
    assert plan(PlanRequest(**(LINE | {"trigger": "stop"}))).route.flights


def test_the_hint_for_a_long_line_gives_the_transit_time():
    error = refused(takeoff=(48.31, 14.3))
    minutes, level, speed = map(
        float,
        re.search(
            r"([\d.]+) min of this time are for the path from the take-off and back \(up to (\d+) m each\) at ([\d.]+) m/s",
            error.hint,
        ).groups(),
    )
    assert level == pytest.approx(1112.0, abs=900.0)
    assert speed == 10.0
    # This is the time for two paths of length `level` at `speed`, plus a climb and a descent.
    assert minutes * 60.0 >= 2.0 * (level - 900.0) / speed
    assert minutes * 60.0 <= 2.0 * (level / speed + speed / 2.0 + 60.0 / 6.0 + 3.0)


def test_an_area_beyond_the_flight_time_gives_the_reason():
    values = {"altitude": 60.0, "drone": "dji-m3t", "trigger": "distance", "area": FIELD[1]}
    with pytest.raises(InfeasibleError) as caught:
        plan(PlanRequest(**values, within=60.0, flight_time=1.0))
    assert "more than --flight-time 1" in caught.value.message
    assert re.search(r"[\d.]+ min of this time", caught.value.hint)


def test_the_fastest_grid_over_an_area_counts_the_area():
    values = {"altitude": 60.0, "area": FIELD[1], "optimize": "time", "trigger": "distance"}
    found = plan(PlanRequest(**values, grid="best", heading="auto"))
    assert "photo_interval_assumed" in {warning.code for warning in found.warnings}
    one = plan(PlanRequest(**values, grid="lanes", heading="auto", photo_interval=2.0))
    assert found.route.total_time_s < 0.7 * one.route.total_time_s
    assert found.solution.prediction.normalized >= 0.98
    (row,) = [row for row in found.within.rows if row.minutes == found.within.minutes]
    assert math.isclose(row.timed.time_s, found.route.total_time_s)
    assert -row.value == row.timed.time_s
