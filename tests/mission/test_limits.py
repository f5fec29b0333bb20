"""Limits of the number of items in a file: longer missions are split, or are refused with a message
that states the number.
"""

import itertools
import json
from dataclasses import replace

import pytest
from support.flights import READERS, commands_of, flown_in, grid, pairs, positions_of

from aosplan.errors import RequestError
from aosplan.mission.export import formats, mission_files, size_of
from aosplan.mission.format import Limits
from aosplan.mission.limits import limits_of, split_for_limits
from aosplan.mission.mission import Waypoints
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest


def limit_cases():
    for name, form in formats().items():
        for limits in form.limits:
            if limits.waypoints[1] is not None:
                most = limits.waypoints[1]
                marks = [pytest.mark.slow] if most > 10_000 and name == "kmz" else []
                yield pytest.param(name, limits.target, most, marks=marks)


@pytest.mark.parametrize(("name", "target", "most"), list(limit_cases()))
def test_no_file_has_more_waypoints_than_its_limit(name, target, most):
    autopilot = target if target in {"px4", "ardupilot"} else None
    size = size_of(formats()[name])
    # A file has items for home, take-off, speed, gimbal and return, and several items for each
    # site.
    each = {"px4": 3, "ardupilot": 3}.get(target, 1)
    fits = (most - (5 if each > 1 else 0)) // each
    for count in (fits, fits + 1, 2 * fits + 1) if most < 1000 else (fits + 1,):
        mission = grid(count, kind="line", autopilot=autopilot)
        pieces = split_for_limits(mission, formats()[name], size)
        sizes = [len(piece.waypoints) for piece in pieces]
        assert max(size(piece) for piece in pieces) <= most
        assert max(sizes) - min(sizes) <= 1
        assert len(sizes) == -(-count // fits)
        flown = [east for piece in pieces for east in piece.waypoints.east_m]
        assert flown == mission.waypoints.east_m
        if most < 1000:
            contents = mission_files(
                [flown_in(mission, name)], formats()[name], "a/grid.b"
            ).values()
            assert [len(READERS[name](content)) for content in contents] == sizes


def test_ardupilot_files_have_at_most_718_commands():
    for trigger, kind in itertools.product(("stop", "distance"), ("lanes", "spiral", "pairs")):
        mission = pairs(700) if kind == "pairs" else grid(711, kind=kind)
        mission = mission._replace(settings=mission.settings._replace(trigger=trigger))
        for content in mission_files([mission], formats()["waypoints"], "g.waypoints").values():
            assert len(commands_of(content.decode())) <= 718
        for content in mission_files([mission], formats()["plan"], "g.plan").values():
            assert len(json.loads(content)["mission"]["items"]) <= 500


def test_each_part_is_a_whole_mission_of_its_own():
    needed = mission_files([grid(300)], formats()["waypoints"], "grid.waypoints")
    assert list(needed) == ["grid-1.waypoints", "grid-2.waypoints"]
    for content in needed.values():
        rows = commands_of(content.decode())
        assert [row[3] for row in rows[:4]] == [16, 22, 178, 205]
        assert rows[-1][3] == 20
        assert rows[0][8:10] == rows[5][8:10]


def test_files_of_several_flights_are_numbered_consecutively():
    flights = [grid(120)._replace(flight=number, flights=2) for number in (1, 2)]
    needed = mission_files(flights, formats()["litchi"], "grid.csv")
    assert list(needed) == [f"grid-{number}.csv" for number in (1, 2, 3, 4)]
    assert flights[0].title == "120 photos over stand, flight 1 of 2"
    halves = split_for_limits(flights[1], formats()["litchi"], size_of(formats()["litchi"]))
    assert halves[0].title.endswith("flight 2 of 2, part 1 of 2")


def test_the_waypoint_limit_of_the_drone_applies_if_it_is_lower():
    needed = mission_files([grid(85, most_waypoints=40)], formats()["litchi"], "grid.csv")
    assert [len(READERS["litchi"](content)) for content in needed.values()] == [28, 28, 29]
    assert len(mission_files([grid(85, most_waypoints=40)], formats()["csv"], "grid.csv")) == 1


def test_several_files_do_not_fit_into_stdout():
    with pytest.raises(
        RequestError, match="needs 2 Litchi CSV files, but only one file can be written to stdout"
    ):
        mission_files([grid(100)], formats()["litchi"], "-")


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("kmz", {"samples": 1}, "needs 2 waypoints or more, and the mission has 1"),
        ("litchi", {"samples": 1}, "needs 2 waypoints or more"),
        ("kmz", {"baseline_m": 0.4}, "waypoints 1 and 2 are 0.4 m apart"),
        ("kmz", {"baseline_m": 2001.0}, "distances of 0.5 to 2000 m"),
        ("litchi", {"baseline_m": 0.49}, "0.49 m apart"),
        (
            "kmz",
            {"speed_mps": 15.5},
            "the speed is 15.5 m/s, but DJI WPML allows 0.1 to 15 m/s",
        ),
        ("litchi", {"speed_mps": 16.0}, "the speed is 16 m/s"),
        ("litchi", {"hold_s": 33.0}, "the hold is 33 s, but Litchi CSV allows 0 to 32 s"),
        (
            "litchi",
            {"altitude_m": 501.0},
            "the height is 501 m, but Litchi CSV allows -200 to 500 m",
        ),
        ("litchi", {"altitude_m": -201.0}, "the height is -201 m"),
        (
            "kmz",
            {"altitude_m": 1501.0},
            "the height is 1501 m, but DJI WPML allows at most 1500 m",
        ),
        ("waypoints", {"altitude_m": 1e6}, "the height is 1e+06 m"),
    ],
)
def test_limits_that_splitting_cannot_meet_give_an_error_with_the_number(name, values, words):
    with pytest.raises(RequestError) as caught:
        mission_files([grid(**values)], formats()[name], "grid")
    assert words in caught.value.message
    assert caught.value.hint


def test_turning_points_on_their_neighbours_are_left_out_of_files_that_are_flown():
    east = [-0.4, 0.0, 3.0, 6.0, 6.3, 9.0, 9.4]
    photo = [False, True, True, True, False, True, False]
    ways = Waypoints(east, [0.0] * 7, [40.0] * 7, east, [1e-4 * x for x in east], photo=photo)
    mission = grid(trigger="distance")._replace(waypoints=ways)
    for name, form in formats().items():
        (content,) = mission_files([flown_in(mission, name)], form, "g").values()
        found = [place[0] for place in positions_of(name, [content])]
        # The trigger is on at 0 and off at the turn after 9; otherwise there is a stop at each
        # site.
        flown = [0.0, 9.4] if "distance" in form.triggers else [0.0, 3.0, 6.0, 9.0]
        assert found == pytest.approx(flown if form.flown_by else east, abs=1e-6), name


def test_one_waypoint_is_enough_for_formats_without_a_lower_limit():
    for name in ("waypoints", "plan", "kml", "geojson", "csv"):
        assert len(positions_of(name, mission_files([grid(1)], formats()[name], "g").values())) == 1


def test_limits_follow_the_autopilot():
    form = formats()["plan"]
    assert limits_of(grid(), form).target == "px4"
    assert limits_of(grid(autopilot="ardupilot"), form).target == "ardupilot"


def test_every_limit_names_its_source():
    for form in formats().values():
        for limits in form.limits:
            assert bool(limits.source) == (limits != Limits())


def test_a_number_of_waypoints_that_the_user_gives_replaces_the_known_limit():
    request = PlanRequest(
        altitude=60, samples=200, baseline=3, origin=(48.0, 14.0), grid="rectangle"
    )
    known = mission_files(plan(request).missions(), formats()["litchi"], "g.csv")
    given = replace(request, file_waypoints=10_000)
    assert len(known) == 3
    assert len(mission_files(plan(given).missions(), formats()["litchi"], "g.csv")) == 1
