"""Like other files, drone files are looked for in the folder of the file that names them."""

import json
from pathlib import Path

import pytest

import aosplan
from aosplan.cli.app import run

DRONE = """title = "Ours"
speed_mps = 6.5
acceleration_mps2 = 2.0
climb_mps = 2.0
airspeed_mps = 14.0
camera = "lens.toml"
autopilot = "px4"
"""
LENS = """name = "lens"
focal_length_mm = 9.0
sensor_width_mm = 7.68
sensor_height_mm = 6.144
image_width_px = 640
image_height_px = 512
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a drone, its camera and a request.  The current folder is a different one."""
    place = tmp_path / "missions"
    place.mkdir()
    (place / "ours.toml").write_text(DRONE)
    (place / "lens.toml").write_text(LENS)
    (place / "request.toml").write_text('altitude = 40\ndrone = "ours.toml"\n')
    away = tmp_path / "away"
    away.mkdir()
    monkeypatch.chdir(away)
    monkeypatch.setenv("HOME", str(away))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    return place


def test_drone_files_of_a_request_file_are_found_beside_it(folder, capsys):
    assert run(["plan", str(folder / "request.toml"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["flight"]["transit_mps"] == 6.5
    assert found["flight"]["autopilot"] == "px4"


def test_drone_files_of_the_defaults_are_found_beside_them(folder, capsys, monkeypatch):
    monkeypatch.setenv("AOSPLAN_DEFAULTS", str(folder / "request.toml"))
    assert run(["plan", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["flight"]["transit_mps"] == 6.5


def test_drone_files_of_a_sweep_are_found_beside_it(folder):
    (folder / "sweep.toml").write_text('[sweep]\ndrone = ["ours.toml", "dji-m3t"]\naltitude = 40\n')
    assert run(["sweep", str(folder / "sweep.toml"), "--out", "rows.csv", "--quiet"]) == 0
    assert Path("rows.csv").read_text().count(",ok,") == 2


def test_drone_files_given_in_python_are_found(folder):
    found = aosplan.plan(altitude=40, drone="ours.toml", folder=folder)
    assert found.settings.transit_mps == 6.5
    # A `Plan` has the folder of its files.
    again = aosplan.plan(found, vhat=0.9)
    assert again.camera.focal_length_mm == 9.0
    assert again.solution.pattern.samples < found.solution.pattern.samples
    of_file = aosplan.plan(folder / "request.toml")
    assert aosplan.plan(of_file).document()["request"] == of_file.document()["request"]


@pytest.mark.slow
def test_a_plan_keeps_the_folder_of_its_area(folder):
    side = [[14.3261, 48.3358], [14.3266, 48.3358], [14.3266, 48.3361], [14.3261, 48.3358]]
    (folder / "field.json").write_text(json.dumps({"type": "Polygon", "coordinates": [side]}))
    (folder / "area.toml").write_text('altitude = 60\narea = "field.json"\n')
    found = aosplan.plan(folder / "area.toml")
    assert aosplan.plan(found).waypoints == found.waypoints
    assert aosplan.tradeoff(found, vhat=0.5).rows
