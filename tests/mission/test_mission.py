"""Waypoints: flight order, axes and heading."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aosplan.grid.patterns import LATTICES, local_sites, pattern_for
from aosplan.mission.mission import Mission, Waypoints, placed

kinds = st.sampled_from(LATTICES)


def positions(kind, samples, baseline=1.0, heading=0.0):
    east, north = local_sites(pattern_for(kind, samples), baseline, heading)
    return list(zip(east, north, strict=True))


@pytest.mark.parametrize(
    ("heading", "along", "right"),
    [(0, (0, 1), (1, 0)), (90, (1, 0), (0, -1)), (180, (0, -1), (-1, 0)), (270, (-1, 0), (0, 1))],
)
def test_x_runs_along_the_heading_and_y_to_its_right(heading, along, right):
    pattern = pattern_for("rectangle", 6)
    assert (pattern.rows, pattern.columns) == (2, 3)
    sites = dict(zip(pattern.sites(), positions("rectangle", 6, 2.0, heading), strict=True))
    step_x = [b - a for a, b in zip(sites[0, 0], sites[0, 1], strict=True)]
    step_y = [b - a for a, b in zip(sites[0, 0], sites[1, 0], strict=True)]
    assert step_x == pytest.approx([2.0 * value for value in along], abs=1e-12)
    assert step_y == pytest.approx([2.0 * value for value in right], abs=1e-12)


def test_a_heading_of_30_degrees_is_east_of_north():
    # At a heading of 30 degrees: sin 30 = 1/2 to the east, cos 30 to the north.
    start, stop = positions("line", 2, 10.0, 30.0)
    assert stop[0] - start[0] == pytest.approx(5.0, abs=1e-12)
    assert stop[1] - start[1] == pytest.approx(10.0 * math.sqrt(3) / 2, abs=1e-12)


def test_the_longer_side_lies_along_the_heading():
    for samples in range(1, 60):
        for kind in ("trimmed", "rectangle"):
            pattern = pattern_for(kind, samples)
            assert pattern.columns - pattern.rows in (0, 1)


def test_lines_are_flown_there_and_back():
    order = list(pattern_for("rectangle", 12).sites())
    assert order == [
        *((0, column) for column in (0, 1, 2, 3)),
        *((1, column) for column in (3, 2, 1, 0)),
        *((2, column) for column in (0, 1, 2, 3)),
    ]


@given(kind=kinds, samples=st.integers(1, 300))
def test_every_site_is_flown_once(kind, samples):
    pattern = pattern_for(kind, samples)
    order = list(pattern.sites())
    assert len(order) == len(set(order)) == pattern.samples
    assert pattern.samples == samples or kind != "trimmed"
    assert all(0 <= row < pattern.rows and 0 <= col < pattern.columns for row, col in order)


@given(kind=kinds, samples=st.integers(2, 300))
def test_neighbours_in_a_line_are_one_baseline_apart(kind, samples):
    pattern = pattern_for(kind, samples)
    places = positions(kind, samples, 2.5, 33.0)
    for (one, start), (other, stop) in pairwise(zip(pattern.sites(), places, strict=True)):
        if one[0] == other[0]:
            assert math.dist(start, stop) == pytest.approx(2.5, rel=1e-9)


@given(samples=st.integers(1, 300), heading=st.floats(-1e4, 1e4), baseline=st.floats(0.01, 100))
def test_whole_grids_are_centred(samples, heading, baseline):
    places = positions("rectangle", samples, baseline, heading)
    for axis in (0, 1):
        assert math.fsum(place[axis] for place in places) == pytest.approx(
            0.0, abs=1e-9 * baseline * len(places)
        )


@given(samples=st.integers(1, 300))
def test_trimmed_grids_keep_their_centroid_within_a_third_of_a_pitch(samples):
    places = positions("trimmed", samples)
    centroid = [math.fsum(place[axis] for place in places) / samples for axis in (0, 1)]
    assert math.hypot(*centroid) <= 1 / 3 + 1e-12


@given(kind=kinds, samples=st.integers(1, 100), heading=st.floats(-720, 720))
def test_a_heading_only_turns_the_grid(kind, samples, heading):
    plain, turned = positions(kind, samples), positions(kind, samples, 1.0, heading)
    for one, other in zip(plain, turned, strict=True):
        assert math.hypot(*other) == pytest.approx(math.hypot(*one), abs=1e-9)
        if math.hypot(*one) > 0.1:
            turn = math.atan2(*other) - math.atan2(*one) - math.radians(heading)
            assert math.cos(turn) == pytest.approx(1.0, abs=1e-9)


@given(heading=st.floats(0, 359.9), turns=st.integers(-3, 3))
def test_headings_that_differ_by_whole_turns_give_the_same_positions(heading, turns):
    one, other = (
        positions("trimmed", 7, 2.8, heading),
        positions("trimmed", 7, 2.8, heading + 360.0 * turns),
    )
    for start, stop in zip(one, other, strict=True):
        assert stop == pytest.approx(start, abs=1e-9)


@given(kind=kinds, samples=st.integers(1, 60), heading=st.sampled_from([0, 90, 180, 270, 360, 45]))
def test_positions_have_no_negative_zero(kind, samples, heading):
    for place in positions(kind, samples, 2.8, heading):
        assert all(value != 0.0 or math.copysign(1.0, value) == 1.0 for value in place)


def test_lanes_are_their_pitch_apart():
    pattern = pattern_for("lanes", 9, lanes=3, lane_pitch=4.0)
    east, north = local_sites(pattern, 2.0, 0.0)
    assert sorted({round(e, 9) for e in east}) == [-8.0, 0.0, 8.0]
    assert sorted({round(n, 9) for n in north}) == [-2.0, 0.0, 2.0]


def waypoints_of(pattern, baseline_m, *, heading_deg, altitude_m, origin):
    east, north = local_sites(pattern, baseline_m, heading_deg)
    return placed(Waypoints(east, north, [altitude_m] * len(east)), origin)


def test_waypoints_are_numbered_in_flight_order():
    waypoints = waypoints_of(
        pattern_for("trimmed", 50), 2.8, heading_deg=0.0, altitude_m=40.0, origin=None
    )
    assert [waypoint.index for waypoint in waypoints] == list(range(50))
    assert {waypoint.altitude_m for waypoint in waypoints} == {40.0}


@pytest.mark.parametrize("origin", [None, (48.0, 14.0)])
def test_a_location_adds_coordinates_and_does_not_change_metres(origin):
    pattern = pattern_for("trimmed", 7)
    plain = waypoints_of(pattern, 2.8, heading_deg=20.0, altitude_m=40.0, origin=None)
    placed = waypoints_of(pattern, 2.8, heading_deg=20.0, altitude_m=40.0, origin=origin)
    assert [waypoint[:4] for waypoint in placed] == [waypoint[:4] for waypoint in plain]
    assert Mission(placed, {}).has_place == (origin is not None)
    assert all((waypoint.latitude is None) == (origin is None) for waypoint in placed)


def test_north_and_east_of_the_plan_are_north_and_east_on_earth():
    waypoints = waypoints_of(
        pattern_for("square", 9), 2.8, heading_deg=0.0, altitude_m=40.0, origin=(48.0, 14.0)
    )
    for waypoint in waypoints:
        assert math.copysign(1, waypoint.latitude - 48.0) == math.copysign(
            1, waypoint.north_m
        ) or waypoint.north_m == pytest.approx(0.0)
        assert math.copysign(1, waypoint.longitude - 14.0) == math.copysign(
            1, waypoint.east_m
        ) or waypoint.east_m == pytest.approx(0.0)
