"""Photos while flying: tests of the limit that determines the speed, and of the turning points."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aosplan.errors import RequestError
from aosplan.flight.track import FlightPoints, with_turns
from aosplan.grid.patterns import LATTICES
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest, request_from


def passing(**values):
    return plan(PlanRequest(**({"altitude": 40, "trigger": "distance"} | values)))


def ruling(result):
    (limit,) = [limit for limit in result.limits if limit.quantity == "speed_mps"]
    return limit


@pytest.mark.parametrize(
    ("values", "speed", "word"),
    [
        ({}, 5.0, "at the requested speed"),
        # 5.27 cm per pixel at 40 m: one pixel in 20 ms is 2.64 m/s.
        ({"exposure_time": 0.02}, 40 * 7.68 / 640 / 9.1 / 0.02, "--max-blur"),
        ({"exposure_time": 0.02, "max_blur": 0.5}, 20 * 7.68 / 640 / 9.1 / 0.02, "--max-blur"),
        # The limit is 2.8 m in 2 s.
        ({"photo_interval": 2}, 1.4, "the camera needs 2 s"),
        ({"photo_interval": 2, "exposure_time": 0.1}, 40 * 7.68 / 640 / 9.1 / 0.1, "--max-blur"),
        (
            {"speed": 20, "drone": "dji-mini-3-pro", "exposure_time": 1e-4, "photo_interval": 0.1},
            10.0,
            "Mini 3 Pro",
        ),
        # Against a wind of 13 m/s, the ground speed is 15 - 13 = 2 m/s.
        ({"wind_speed": 13, "wind_from": 180}, 2.0, "wind"),
        ({"wind_speed": 13, "wind_from": 0}, 2.0, "wind"),
        ({"wind_speed": 13, "wind_from": 0, "heading": 90}, 5.0, "at the requested speed"),
    ],
)
def test_the_limit_that_determines_the_speed_is_named(values, speed, word):
    result = passing(**values)
    assert result.settings.speed_mps == pytest.approx(speed, rel=1e-9)
    assert ruling(result).value == ruling(result).bound == pytest.approx(speed, rel=1e-9)
    assert word in ruling(result).message


@given(
    exposure=st.floats(1e-3, 0.1),
    blur=st.floats(0.1, 5.0),
    interval=st.floats(0.1, 5.0),
    wanted=st.floats(0.5, 20.0),
)
def test_no_photo_is_blurred_or_missed(exposure, blur, interval, wanted):
    result = passing(exposure_time=exposure, max_blur=blur, photo_interval=interval, speed=wanted)
    speed = result.settings.speed_mps
    slack = 1 + 1e-9
    assert speed * exposure / result.camera.gsd_m(40) <= blur * slack
    assert result.solution.baseline_m / speed >= interval / slack
    assert speed <= wanted * slack
    used = (
        speed * exposure / result.camera.gsd_m(40) / blur,
        interval * speed / result.solution.baseline_m,
        speed / wanted,
    )
    assert max(used) == pytest.approx(1.0)  # One of the limits is reached exactly.


@pytest.mark.parametrize("heading", [0.0, 57.0, 300.0])
@pytest.mark.parametrize("grid", LATTICES)
def test_photos_are_taken_at_sites_and_turns_are_beyond_the_line_ends(grid, heading):
    # With this number of photos, the line is longer than the footprint.
    asked = {"grid": grid, "heading": heading, "allow_no_common_ground": grid == "line"}
    stopping = plan(PlanRequest(altitude=40, **asked))
    result = passing(**asked)
    ways = list(result.waypoints)
    sites = [(w.east_m, w.north_m) for w in stopping.waypoints]
    assert [(w.east_m, w.north_m) for w in ways if w.photo] == sites
    along = math.sin(math.radians(heading)), math.cos(math.radians(heading))
    run_in = result.route.timing.run_in_m
    assert run_in == pytest.approx(5.0**2 / (2 * 2.0))
    for one, other in pairwise(ways):
        if one.photo == other.photo:
            continue
        step = other.east_m - one.east_m, other.north_m - one.north_m
        forth = step[0] * along[0] + step[1] * along[1]
        assert math.hypot(*step) == pytest.approx(run_in)
        assert abs(forth) == pytest.approx(run_in)
    assert not ways[0].photo
    assert not ways[-1].photo


def test_a_distance_trigger_takes_a_photo_at_every_site():
    result = passing(heading=57.0)
    spacing, ways = result.settings.spacing_m, list(result.waypoints)
    for one, other in pairwise(ways):
        if one.photo and other.photo:
            step = math.dist((one.east_m, one.north_m), (other.east_m, other.north_m))
            assert step == pytest.approx(spacing, rel=1e-9)


def test_one_site_alone_is_flown_through_along_the_heading():
    alone = FlightPoints([3.0], [4.0], [True])
    sites = with_turns(alone, spacing_m=0.0, run_in_m=2.0, heading_deg=90.0)
    assert sites.east_m == pytest.approx([1.0, 3.0, 5.0])
    assert sites.north_m == pytest.approx([4.0, 4.0, 4.0])
    assert sites.photo == [False, True, False]


def test_without_stops_there_are_no_holds_and_yaw_and_gimbal_are_fixed():
    settings = passing(heading=-30, hold=3).mission().settings
    assert settings.hold_s == 0.0
    assert settings.yaw_deg == 330.0
    assert settings.gimbal_pitch_deg == -90.0
    assert settings.trigger == "distance"


def test_motion_blur_does_not_limit_flights_with_stops():
    result = plan(PlanRequest(altitude=40))
    assert not [limit for limit in result.limits if limit.quantity == "speed_mps"]
    assert result.settings.spacing_m == 0.0
    assert result.waypoints.photo is None


def test_flying_without_stops_saves_time_with_a_fast_camera():
    assert passing().route.time_s < 0.5 * plan(PlanRequest(altitude=40)).route.time_s


def test_points_without_a_photo_stay_between_the_lines():
    east, north = [0.0, 2.0, 5.0, 2.0, 0.0], [0.0, 0.0, 3.0, 6.0, 6.0]
    way = FlightPoints(east, north, [True, True, False, True, True])
    found = with_turns(way, spacing_m=2.0, run_in_m=1.0, heading_deg=90.0)
    assert found.east_m == pytest.approx([-1, 0, 2, 3, 5, 3, 2, 0, -1])
    assert found.north_m == pytest.approx([0, 0, 0, 0, 3, 6, 6, 6, 6])
    assert [place for place, photo in enumerate(found.photo) if photo] == [1, 2, 6, 7]


def test_a_spiral_has_no_lines_to_fly_through():
    with pytest.raises(RequestError, match="no straight lines") as refused:
        passing(grid="spiral")
    assert "--trigger stop" in refused.value.hint
    best = passing(grid="best")
    assert best.solution.limits[-1].quantity == "choice"
    assert "spiral" not in best.solution.limits[-1].message


def test_a_requested_option_removes_a_conflicting_spiral_or_trigger_of_a_lower_layer():
    spiral = {"altitude": 40, "grid": "spiral", "lane_pitch": 5}
    assert request_from(spiral, overrides={"trigger": "distance"}).grid == "trimmed"
    passing_by = {"altitude": 40, "trigger": "distance", "max_blur": 2}
    assert request_from(passing_by, overrides={"grid": "spiral"}).trigger == "stop"


def test_a_grid_without_lines_is_a_warning():
    alone = passing(grid="lanes", samples=3, vhat=0.6)
    assert alone.solution.pattern.columns == 1
    assert "photos_alone" in {warning.code for warning in alone.warnings}
    for other in (passing(grid="lanes"), plan(PlanRequest(altitude=40, grid="lanes"))):
        assert "photos_alone" not in {warning.code for warning in other.warnings}
