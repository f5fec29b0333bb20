"""Notes about a file: absolute heights, settings that the file does not contain, and its
autopilot.
"""

import pytest
from support.flights import flown_in, grid

from aosplan.cli.app import run
from aosplan.mission.export import formats, notes

PLACE = {"takeoff_latitude": 48.0, "takeoff_longitude": 14.0, "takeoff_ground_m": 190.0}
LEVEL = [190.0] * 12
SLOPE = [200.0 + 3.0 * index for index in range(12)]


def said(name, *missions):
    return " ".join(notes([flown_in(each, name) for each in missions], formats()[name]))


@pytest.mark.parametrize("name", ["waypoints", "plan"])
@pytest.mark.parametrize("datum", ["ellipsoid", "EGM2008 height"])
def test_a_note_gives_the_height_of_home_and_its_datum(name, datum):
    found = said(name, grid(ground_m=LEVEL, autopilot="ardupilot", height_datum=datum, **PLACE))
    assert (
        f"the home position in the file is 190.0 m above {datum}, although the format expects the height above sea level"
    ) in found
    assert "RTL_ALT" not in found


@pytest.mark.parametrize("name", ["waypoints", "plan"])
def test_a_note_says_that_the_height_of_home_is_unknown(name):
    assert "not known, so the file contains 0" in said(name, grid(autopilot="ardupilot"))


@pytest.mark.parametrize("name", ["kmz", "dji-fly", "autel"])
def test_a_note_describes_the_takeoff_reference_point_if_it_is_written(name):
    ellipsoidal = grid(ground_m=SLOPE, height_datum="ellipsoid", **PLACE)
    assert (
        "take-off reference point is 190.0 m above the ellipsoid, as in the terrain file"
        in said(name, ellipsoidal)
    )
    assert "ellipsoid" not in said(name, grid(ground_m=SLOPE, height_datum="EGM96", **PLACE))


@pytest.mark.parametrize("name", ["csv", "geojson"])
def test_the_column_of_the_ground_has_its_datum(name):
    mission = grid(ground_m=SLOPE, height_datum="EGM96 height", **PLACE)
    assert "ground_m is relative to EGM96 height" in said(name, mission)
    assert not said(name, grid())


@pytest.mark.parametrize(
    ("name", "autopilot", "setting"),
    [
        ("waypoints", "ardupilot", "RTL_ALT"),
        ("plan", "ardupilot", "RTL_ALT"),
        ("plan", "px4", "RTL_RETURN_ALT"),
        ("parrot", "parrot", "return height"),
        ("litchi", "dji", "return height"),
    ],
)
def test_the_height_of_an_early_return_is_the_greatest_of_all_flights(name, autopilot, setting):
    low = grid(ground_m=LEVEL, autopilot=autopilot, **PLACE)
    high = grid(ground_m=SLOPE, autopilot=autopilot, transit_return_m=87.4, **PLACE)
    found = said(name, low, high)
    assert setting in found
    assert "88 m or more" in found


def test_litchi_is_set_to_the_transit_speed():
    assert "the cruising speed to 9.5 m/s" in said("litchi", grid(transit_mps=9.5))


def test_a_note_names_a_drone_not_known_to_fly_the_format(tmp_path, capsys):
    plan = ["plan", "--altitude", "40", "--origin", "48.3358,14.3261", "--vhat", "0.8"]
    out = f"litchi:{tmp_path / 'a.csv'}"
    assert run([*plan, "--drone", "dji-m3t", "--out", out]) == 0
    assert "it is not known whether the drone dji-m3t flies this format" in capsys.readouterr().err
    assert run([*plan, "--drone", "dji-air-2s", "--out", out, "--force"]) == 0
    assert "not known whether" not in capsys.readouterr().err


def test_a_note_names_legs_that_px4_may_reject():
    far = grid(autopilot="px4", takeoff_latitude=48.3458, takeoff_longitude=14.3261)
    assert "may reject legs of 11" in said("plan", far)
    near = grid(autopilot="px4", takeoff_latitude=48.3408, takeoff_longitude=14.3261)
    assert "may reject" not in said("plan", near)
    assert "may reject" not in said("waypoints", far._replace(settings=grid().settings))


@pytest.mark.parametrize("values", [{"trigger": "distance"}, {"camera_control": "outputs"}])
def test_a_note_describes_the_camera_trigger_of_px4(values):
    assert "TRIG_MODE" in said("plan", grid(autopilot="px4", **values))
    assert "TRIG_MODE" not in said("plan", grid(autopilot="px4"))
    assert "TRIG_MODE" not in said("plan", grid(autopilot="ardupilot"))


def test_a_note_names_drone_and_lens_of_a_wpml_route():
    assert "no drone is given, so the file is for the dji-m3t" in said("kmz", grid())
    own = grid(drone="dji-m3t")._replace(summary={"camera": {"name": "custom"}})
    assert (
        "the camera custom is not one of dji-m3t, so the file stores the photos of the "
        "drone's lens 'visable'" in said("kmz", own)
    )
    assert not said("kmz", grid(drone="dji-m3t"))
