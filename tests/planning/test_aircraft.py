"""Tests of drone, autopilot, camera trigger and payload of a request, and of contradictions between
them.
"""

import pytest

from aosplan import PlanRequest, plan
from aosplan.errors import RequestError
from aosplan.flight.drones import AUTOPILOTS, DRONES
from aosplan.planning.request import request_from

PLACE = (48.3358, 14.3261)


def request(**values):
    return PlanRequest(altitude=40, **values)


@pytest.mark.parametrize("name", DRONES)
def test_every_drone_has_an_autopilot(name):
    preset = DRONES[name]
    assert preset.autopilot in AUTOPILOTS
    maker = name.split("-")[0]
    assert maker not in AUTOPILOTS or preset.autopilot == maker


@pytest.mark.parametrize(
    ("drone", "autopilot"), [("ardupilot-copter", "ardupilot"), ("px4-multicopter", "px4")]
)
def test_the_drone_decides_the_autopilot(drone, autopilot):
    assert request(drone=drone, camera="sony-a6000-16mm").autopilot == autopilot


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (
            {"drone": "px4-multicopter", "autopilot": "ardupilot", "camera": "sony-a6000-16mm"},
            "contradicts --drone px4-multicopter",
        ),
        ({"drone": "dji-m3t", "autopilot": "px4"}, "which DJI's own autopilot flies"),
        (
            {"autopilot": "px4", "altitude_frame": "terrain"},
            "does not accept heights above terrain",
        ),
        (
            {"drone": "px4-multicopter", "altitude_frame": "terrain", "camera": "sony-a6000-16mm"},
            "PX4",
        ),
        ({"camera_control": "outputs"}, "can be used only with PX4"),
        ({"autopilot": "ardupilot", "camera_control": "mavlink"}, "can be used only with PX4"),
        ({"autopilot": "ardupilot", "hold": 0}, "whole seconds"),
        ({"autopilot": "px4", "hold": 0}, "does not stop"),
        ({"drone": "dji-m350", "payload": "dji-h20t", "camera": "dji-p1-35mm"}, "another payload"),
        ({"payload": "dji-h20", "camera": "dji-h20t-thermal"}, "another payload"),
        ({"drone": "dji-m3t", "payload": "dji-h30t"}, "does not carry dji-h30t"),
        ({"drone": "dji-m300", "payload": "dji-m30t"}, "does not carry dji-m30t"),
        ({"drone": "px4-multicopter", "payload": "dji-h20t"}, "does not carry dji-h20t"),
        ({"autopilot": "px4", "payload": "dji-h20t"}, "only drones of DJI carry this payload"),
        (
            {"drone": "dji-m300", "payload": "dji-h20n"},
            "the camera of the payload dji-h20n is not known",
        ),
    ],
)
def test_contradictory_aircraft_options_are_refused_with_a_remedy(values, words):
    with pytest.raises(RequestError, match=words) as caught:
        request(**values)
    assert caught.value.hint


@pytest.mark.parametrize(
    ("camera", "control"),
    [
        ("flir-vue-pro-640-13mm", "outputs"),
        ("sony-a6000-16mm", "outputs"),
        ("dji-xt2-640-13mm", "mavlink"),
    ],
)
def test_the_camera_decides_how_px4_triggers_it(camera, control):
    assert request(autopilot="px4", camera=camera).camera_control == control
    assert request(autopilot="ardupilot", camera=camera).camera_control is None


def test_a_payload_brings_its_camera():
    assert request(drone="dji-m350", payload="dji-h20t").camera == "dji-h20t-thermal"
    assert request(payload="dji-h20", camera="dji-h20t-wide").camera == "dji-h20t-wide"
    assert request(drone="dji-m300", payload="dji-h20").camera == "dji-h20t-wide"


def test_another_drone_drops_the_autopilot_and_payload_of_the_first():
    file = {"altitude": 40, "drone": "dji-m350", "payload": "dji-h20t"}
    assert request_from(file, overrides={"drone": "dji-m3t"}).payload is None
    saved = request(drone="px4-multicopter", camera="sony-a6000-16mm").document()
    again = request_from(
        saved, overrides={"drone": "ardupilot-copter", "camera": "sony-a6000-16mm"}
    )
    assert (again.autopilot, again.camera_control) == ("ardupilot", None)


def test_a_camera_of_another_drone_is_warned_of():
    codes = {one.code for one in plan(request(drone="dji-m3t", camera="dji-m30t-thermal")).warnings}
    assert "camera_of_another_drone" in codes
    codes = {one.code for one in plan(request(drone="dji-m30", camera="dji-m30t-wide")).warnings}
    assert "camera_of_another_drone" not in codes


@pytest.mark.parametrize(
    ("drone", "camera", "warned"),
    [
        ("dji-mini-4-pro", "dji-m3t-wide", True),
        ("parrot-anafi-usa", "dji-m3t-wide", True),
        ("autel-evo-max-4t", "autel-evo-max-4t-wide", False),
        ("dji-mavic-3-pro", "dji-mavic-3-wide", False),
        ("dji-m300", "sony-a7r-ii-35mm", False),
        ("px4-multicopter", "sony-a7r-ii-35mm", False),
    ],
)
def test_a_camera_that_the_drone_does_not_carry_gives_a_warning(drone, camera, warned):
    codes = {warning.code for warning in plan(request(drone=drone, camera=camera)).warnings}
    assert ("camera_of_another_drone" in codes) == warned
