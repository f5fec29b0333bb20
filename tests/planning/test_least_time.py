"""The shortest time in closed form, compared with complete routes."""

import math
from dataclasses import replace

import pytest
from support.command_line import FIELD

from aosplan import PlanRequest, plan
from aosplan.areas.area import read_area
from aosplan.areas.extent import extent_of, least_lattice
from aosplan.planning.least_time import FlownLines, least_time_s
from aosplan.planning.resolve import resolve_inputs

GRIDS = [(1, 8, 3.0), (2, 5, 4.0), (3, 4, 2.5), (4, 3, 1.5)]
"""Rows, columns and baseline [m] of grids.  Lanes are two baselines apart."""


def request_of(rows, columns, baseline, **values):
    if rows > 1:
        values |= {"grid": "lanes", "lanes": rows, "lane_pitch": 2.0}
    else:
        values |= {"grid": "line"}
    return PlanRequest(
        altitude=40.0, baseline=baseline, samples=rows * columns, drone="dji-m3t", **values
    )


@pytest.mark.parametrize("trigger", ["stop", "distance"])
@pytest.mark.parametrize(("rows", "columns", "baseline"), GRIDS)
def test_at_one_place_the_least_time_is_the_time_of_the_flight(rows, columns, baseline, trigger):
    request = request_of(rows, columns, baseline, trigger=trigger)
    route = plan(request).route
    flight = resolve_inputs(request).flight
    run = route.timing.run_in_m
    back = (columns - 1) * baseline + 2.0 * run if rows % 2 else 0.0
    lattice = FlownLines(
        rows * columns,
        rows,
        (baseline, 2.0 * baseline),
        math.hypot(back, (rows - 1) * 2.0 * baseline),
    )
    least = least_time_s(flight, lattice, heading_deg=0.0, altitude_m=40.0)
    assert least == pytest.approx(route.total_time_s, rel=1e-9)


@pytest.mark.parametrize(("trigger", "battery"), [("stop", 6.0), ("distance", None)])
@pytest.mark.parametrize(("rows", "columns", "baseline"), GRIDS)
def test_no_flight_over_an_area_takes_less_than_the_bound(
    rows, columns, baseline, trigger, battery
):
    request = request_of(
        rows, columns, baseline, trigger=trigger, area=FIELD[1], flight_time=battery
    )
    if rows == 1:
        request = replace(request, lane_pitch=2.0)
    planned = plan(request)
    extent = extent_of(read_area(FIELD[1]), 0.0)
    pitch = baseline, 2.0 * baseline
    lattice = FlownLines(*least_lattice(extent, rows, columns, pitch), pitch)
    least = least_time_s(planned.inputs.flight, lattice, heading_deg=0.0, altitude_m=40.0)
    assert 0.6 * planned.route.total_time_s <= least <= planned.route.total_time_s


def test_a_battery_too_small_for_the_transit_gives_an_infinite_time():
    flight = resolve_inputs(request_of(1, 8, 3.0, flight_time=0.1)).flight
    lattice = FlownLines(1000, 10, (3.0, 6.0))
    assert least_time_s(flight, lattice, heading_deg=0.0, altitude_m=120.0) == math.inf
