"""The hint of a plan that takes hours suggests a flight that takes less time."""

import re

import pytest
from support.command_line import FIELD

from aosplan import PlanRequest, plan
from aosplan.errors import RequestError


def flown(text, **values):
    """The plan with the options in a hint."""
    given = dict(re.findall(r"--([a-z-]+) ([\w.]+)", text.split(" reaches")[0]))
    names = {name.replace("-", "_"): value for name, value in given.items()}
    return plan(PlanRequest(**values, **names))


def test_the_cheaper_flight_takes_the_time_in_its_hint():
    values = {"altitude": 40, "area": FIELD[1], "drone": "dji-m3t", "vhat": 0.9, "hold": 4}
    long = plan(PlanRequest(**values))
    (warning,) = [each for each in long.warnings if each.code == "cheaper_flight"]
    minutes = int(re.search(r"in (\d+) min", warning.message)[1])
    short = flown(warning.message, **values)
    assert short.route.total_time_s < 0.7 * long.route.total_time_s
    assert short.route.total_time_s == pytest.approx(60.0 * minutes, abs=61.0)
    assert short.solution.prediction.normalized > 0.9 - 1e-3


def test_the_error_for_too_many_sites_suggests_a_cheaper_flight():
    values = {"altitude": 40, "area": FIELD[1], "drone": "dji-m3t", "max_sites": 1000, "vhat": 0.9}
    with pytest.raises(RequestError, match="more than the 1000") as refused:
        plan(PlanRequest(**values))
    assert flown(refused.value.hint, **values).layout.survey.sites <= 1000


def test_short_flights_have_no_warning_about_cheaper_flights():
    short = plan(
        PlanRequest(
            altitude=40, area=FIELD[1], drone="dji-m3t", vhat=0.9, grid="line", trigger="distance"
        )
    )
    assert "cheaper_flight" not in {each.code for each in short.warnings}
