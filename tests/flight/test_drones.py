"""Drones by name have complete data with sources, and change a plan as they should."""

import json

import pytest

from aosplan.camera.presets import CAMERAS
from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.flight.drones import DRONES
from aosplan.mission import dji_models as dji
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest


@pytest.mark.parametrize("name", DRONES)
def test_every_drone_preset_is_complete_and_has_a_source(name):
    drone = DRONES[name]
    assert drone.title
    assert drone.source
    assert "assumed" in drone.assumed or drone.endurance_min is None
    assert drone.camera is None or drone.camera in CAMERAS
    assert 0.0 < drone.speed_mps <= drone.airspeed_mps < 30.0
    assert 0.5 <= drone.acceleration_mps2 <= 5.0
    assert 1.0 <= drone.climb_mps <= 10.0
    assert drone.endurance_min is None or 15.0 <= drone.endurance_min <= 60.0
    assert drone.photo_interval_s is None or 0.5 <= drone.photo_interval_s <= 5.0
    assert drone.most_waypoints is None or drone.most_waypoints >= 99


@pytest.mark.parametrize("name", DRONES)
def test_a_drone_sets_camera_and_speeds_unless_flags_override_them(name):
    drone = DRONES[name]
    request = PlanRequest(
        altitude=40, drone=name, camera=None if drone.camera else "flir-vue-pro-640-9mm"
    )
    assert request.camera == (drone.camera or "flir-vue-pro-640-9mm")
    assert (request.speed, request.acceleration) == (drone.speed_mps, drone.acceleration_mps2)
    assert (request.climb, request.airspeed) == (drone.climb_mps, drone.airspeed_mps)
    own = PlanRequest(
        altitude=40, drone=name, camera="dji-m3t-wide", speed=1, acceleration=1, climb=1
    )
    assert (own.camera, own.speed, own.acceleration, own.climb) == ("dji-m3t-wide", 1, 1, 1)
    lens = PlanRequest(altitude=40, drone=name, fov=60, image_width=640, image_height=512)
    assert lens.camera is None
    settings = plan(request).settings
    assert (settings.drone, settings.most_waypoints) == (name, drone.most_waypoints)


@pytest.mark.parametrize("name", [name for name in DRONES if DRONES[name].camera is None])
def test_a_drone_without_a_known_camera_asks_for_one(name):
    with pytest.raises(
        RequestError, match=f"the camera of the drone {name} is not known"
    ) as caught:
        PlanRequest(altitude=40, drone=name)
    assert "--camera NAME or FILE" in caught.value.hint


def test_every_drone_that_flies_dji_files_is_listed():
    assert set(dji.DRONES) <= set(DRONES)


def test_the_speed_is_limited_to_the_top_speed_of_the_drone():
    result = plan(PlanRequest(altitude=40, drone="dji-mini-3-pro", speed=14))
    assert result.settings.speed_mps == 10.0
    (limit,) = [limit for limit in result.limits if limit.quantity == "speed_mps"]
    assert limit.value == limit.bound == 10.0
    assert "DJI Mini 3 Pro" in limit.message
    assert "instead of the requested 14 m/s" in limit.message


def test_a_camera_too_slow_for_short_stops_is_a_warning():
    result = plan(PlanRequest(altitude=40, drone="dji-m3t", hold=0, baseline=0.5, samples=9))
    (warning,) = [warning for warning in result.warnings if warning.code == "photo_interval"]
    # A leg of 0.5 m from stop to stop takes one second at 2 m/s², but the camera needs two seconds.
    assert "give --hold 1" in warning.message
    held = plan(PlanRequest(altitude=40, drone="dji-m3t", hold=1, baseline=0.5, samples=9))
    assert "photo_interval" not in {warning.code for warning in held.warnings}


def test_a_flight_longer_than_the_battery_is_a_warning():
    values = {"altitude": 40, "drone": "dji-m3t", "samples": 900, "baseline": 3}
    whole = plan(PlanRequest(**values, flight_time=60))
    assert "battery" in {warning.code for warning in whole.warnings}
    assert len(whole.route.flights) == 1
    # The default flight time is two thirds of the 45 minutes in still air.
    split = plan(PlanRequest(**values))
    assert split.request.flight_time == 30.0
    assert (
        max(flight.time_s for flight in split.route.flights)
        <= 1800.0
        < whole.route.flights[0].time_s
    )
    assert "battery" not in {warning.code for warning in split.warnings}
    # The numbers of waypoints continue in the files of later flights.
    assert [m.first_index for m in split.missions()] == [f.first for f in split.route.flights]


def test_the_list_of_drones_can_be_printed_as_json(capsys):
    assert run(["drones", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [drone["name"] for drone in listed] == list(DRONES)
    assert all(drone["source"] and drone["assumed"] for drone in listed)


def test_the_list_of_drones_can_be_printed_as_a_table(capsys):
    assert run(["drones"]) == 0
    out = capsys.readouterr().out
    assert all(name in out for name in DRONES)
    assert max(map(len, out.splitlines())) <= 80


@pytest.mark.parametrize("name", DRONES)
def test_a_plan_says_which_values_of_its_drone_and_camera_are_unconfirmed(name):
    drone = DRONES[name]
    camera = drone.camera or "sony-a6000-16mm"
    values = {"altitude": 40, "drone": name, "camera": camera, "samples": 9, "baseline": 1}
    found = plan(PlanRequest(**values)).warnings
    said = " ".join(warning.message for warning in found if warning.code == "unconfirmed_values")
    for assumed in (drone.assumed, CAMERAS[camera].assumed):
        for clause in assumed.split("; "):
            assert (clause in said) == ("unconfirmed" in clause)
