# ruff: noqa: ARG005 (an effect compares a result with the default, or does not need it)
"""The command line, held against the contract line by line.

Most tests run the commands in this process; a few start a real one, for pipes, encodings and
terminals.  Every output goes to `tmp_path`.
"""

import csv
import io
import json
import math
import os
import pty
import re
import shlex
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest
import tomli_w

import aosplan
from aosplan.cli.app import COMMANDS, run
from aosplan.cli.output import print_json
from aosplan.options import OPTIONS
from aosplan.presets.cameras import CAMERAS
from aosplan.presets.scenes import SCENES

UNIFORM = ["--occluder-size", "0.2", "--volume-height", "18"]
LENS = ["--focal-length", "9.1", "--sensor-width", "7.68", "--image-width", "640"]
LENS = [*LENS, "--image-height", "512"]


STEMS = ["--stems-per-hectare", "400", "--crown-diameter", "5", "--leaf-area-index", "1e5"]
STEMS = [*STEMS, "--volume-height", "10", "--volume-base", "6"]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty folder that is the current one: no test leaves anything elsewhere."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def command(capsys):
    """A function that runs a command line: its status, stdout and stderr."""

    def execute(*arguments):
        status = run([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return status, out, err

    return execute


@pytest.fixture
def document(command):
    """A function that runs a command line with --json: its document."""

    def execute(*arguments):
        status, out, err = command(*arguments, "--json")
        assert status == 0, err
        return loads(out)

    return execute


@pytest.fixture
def plan_of(document):
    """A function that plans at 40 m with more options: the document."""
    return lambda *arguments: document("plan", "--altitude", 40, *arguments)


def loads(text):
    """One JSON document, and no constant that JSON does not have."""

    def refuse(constant):
        raise AssertionError(constant)

    return json.loads(text, parse_constant=refuse)


def process(*arguments, cwd=None, stdin="", **environment):
    """A real process, with no colour and no encoding but what is asked for."""
    cleared = ("NO_COLOR", "FORCE_COLOR", "PYTHONIOENCODING", "PYTHONUTF8", "COLUMNS", "LC_ALL")
    kept = {name: value for name, value in os.environ.items() if name not in cleared}
    return subprocess.run(
        [sys.executable, "-m", "aosplan", *arguments],
        input=stdin.encode(),
        capture_output=True,
        check=False,
        cwd=cwd,
        env=kept | environment,
        timeout=60,
    )


def check_refusal(status, out, err, expected=2):
    """One `error:` line, at most one `hint:`, and nothing else anywhere."""
    assert status == expected
    assert out == ""
    lines = err.split("\n")
    assert lines.pop() == ""
    assert 1 <= len(lines) <= 2, err
    assert re.match(r"error: \S", lines[0])
    assert all(re.match(r"hint: \S", line) for line in lines[1:])
    assert all(line.isprintable() for line in lines)
    assert all(len(line) < 500 for line in lines)


# What the issue asks for


def test_forty_metres_and_98_percent(plan_of):
    result = plan_of("--vhat", "0.98")
    assert result["baseline_m"] == pytest.approx(2.80, rel=0.005)
    assert result["samples"] == 50
    assert result["aperture_m"] == pytest.approx(17.0, abs=0.05)


def test_the_table_shows_the_same_numbers(command):
    status, out, err = command("plan", "--altitude", "40", "--vhat", "0.98")
    assert (status, err) == (0, "")
    for text in ("b = 2.80 m", "N = 50", "a = 17.0 m", "V̂ = 98.0 %"):
        assert text in out


def test_fifty_metres_ask_for_three_and_a_half(document):
    assert document("plan", "--altitude", 50)["baseline_m"] == pytest.approx(3.5, rel=0.005)


@pytest.mark.parametrize(
    "arguments",
    [
        ["--altitude", "40"],
        ["--gsd", "0.05", "--vhat", "0.95", "--grid", "lanes"],
        ["--altitude", "40", "--visibility", "60%", "--origin=-33.86,151.21", "--heading", "33"],
        ["--altitude", "40", "--density", "0.01", *UNIFORM, *LENS, "--coverage", "0.9"],
        ["--altitude", "40", "--model", "layered", "--optimize", "aperture"],
        ["--altitude", "40", "--grid", "best", "--lanes", "best", "--heading", "best"],
        ["--altitude", "40", "--vhat", "0.98000000000000000001"],
    ],
    ids=" ".join,
)
@pytest.mark.parametrize("whole", [True, False])
def test_a_result_fed_back_gives_the_same_plan(folder, document, arguments, whole):
    first = document("plan", *arguments)
    (folder / "again.json").write_text(json.dumps(first if whole else first["request"]))
    assert document("plan", "again.json") == first


def test_a_request_as_toml_gives_the_same_plan(folder, document):
    first = document("plan", "--altitude", "40", "--origin", "48.3,14.3")
    (folder / "again.toml").write_text(tomli_w.dumps(first["request"]))
    assert document("plan", "again.toml") == first


def test_a_request_on_stdin_gives_the_same_plan():
    direct = process("plan", "--altitude", "40", "--json")
    piped = process("plan", "-", "--json", stdin="altitude = 40\n")
    assert piped.returncode == 0
    assert piped.stdout == direct.stdout


def test_flags_override_a_request_file(folder, document):
    (folder / "r.toml").write_text('altitude = 40\nvhat = "90%"\nscene = "savanna"\n')
    result = document("plan", "r.toml", "--gsd", "0.1", "--vhat", "0.95")
    assert result["camera"]["gsd_m"] == pytest.approx(0.1)
    assert result["samples"] == 20
    assert result["scene"]["name"] == "savanna"


def test_files_that_a_request_names_are_looked_for_beside_it(folder, document):
    (folder / "sub").mkdir()
    (folder / "sub" / "stand.toml").write_text(
        'name = "beside"\ndensity = 0.01\noccluder_size_m = 0.2\n'
        "volume_base_m = 2\nvolume_height_m = 9\n"
    )
    (folder / "sub" / "r.toml").write_text('altitude = 40\nscene = "stand.toml"\n')
    assert document("plan", "sub/r.toml")["scene"]["name"] == "beside"


def test_a_camera_that_a_request_names_is_looked_for_beside_it(folder, document):
    (folder / "sub").mkdir()
    camera = {"name": "beside", "focal_length_mm": 9.1, "sensor_width_mm": 7.68}
    camera |= {"sensor_height_mm": 6.144, "image_width_px": 640, "image_height_px": 512}
    (folder / "sub" / "own.toml").write_text(tomli_w.dumps(camera))
    (folder / "sub" / "r.toml").write_text('altitude = 40\ncamera = "own.toml"\n')
    assert document("plan", "sub/r.toml")["camera"]["name"] == "beside"


# Every option of plan, and what it does


def hidden(result):
    return result["scene"]["integrated_density"]


def extent(result):
    return max(result["grid"]["extent_m"])


AREAS = Path(__file__).parent / "areas"
FIELD = ["--area", str(AREAS / "field.geojson")]


EFFECTS = {
    "altitude": (
        ["--altitude", "50"],
        lambda r, d: math.isclose(r["baseline_m"] / d["baseline_m"], 1.25),
    ),
    "gsd": (["--gsd", "0.1"], lambda r, d: math.isclose(r["camera"]["gsd_m"], 0.1)),
    "target_size": (
        ["--target-size", "2", "--target-pixels", "20"],
        lambda r, d: math.isclose(r["camera"]["gsd_m"], 0.1),
    ),
    "target_pixels": (
        ["--target-size", "2", "--target-pixels", "40"],
        lambda r, d: math.isclose(r["camera"]["gsd_m"], 0.05),
    ),
    "focal_height": (
        ["--focal-height", "1"],
        lambda r, d: r["waypoints"][0]["altitude_m"] == 41.0 and r["altitude_m"] == 40.0,
    ),
    "vhat": (["--vhat", "90%"], lambda r, d: r["samples"] == 10),
    "visibility": (
        ["--visibility", "0.6"],
        lambda r, d: (
            r["visibility"]["expected"] >= 0.6
            and r["visibility"]["target_quantity"] == "visibility"
        ),
    ),
    "scene": (["--scene", "savanna"], lambda r, d: r["scene"]["name"] == "savanna"),
    "density": (
        ["--density", "0.01", *UNIFORM],
        lambda r, d: math.isclose(r["visibility"]["density"], 1 - 0.99**90),
    ),
    "integrated_density": (
        ["--integrated-density", "30%", *UNIFORM],
        lambda r, d: r["visibility"]["density"] == 0.3,
    ),
    "occluder_size": (
        ["--density", "0.01", "--occluder-size", "0.4", "--volume-height", "18"],
        # b = o h/H with the 2 % quantile of height at 2 + 0.02 x 18 m.
        lambda r, d: math.isclose(r["baseline_m"], 0.4 * 40 / 2.36),
    ),
    "volume_height": (
        ["--density", "0.01", "--occluder-size", "0.2", "--volume-height", "8"],
        lambda r, d: r["scene"]["canopy_top_m"] == 10.0,
    ),
    "volume_base": (
        ["--density", "0.01", *UNIFORM, "--volume-base", "5"],
        lambda r, d: math.isclose(r["baseline_m"], 0.2 * 40 / 5.36),
    ),
    "stems_per_hectare": (
        [*STEMS, "--stems-per-hectare", "600"],
        # Dense leaves: what is seen lies between the crowns.
        lambda r, d: math.isclose(hidden(r), 1 - math.exp(-0.06 * math.pi * 6.25), rel_tol=1e-6),
    ),
    "crown_diameter": (
        [*STEMS, "--crown-diameter", "8"],
        lambda r, d: math.isclose(hidden(r), 1 - math.exp(-0.04 * math.pi * 16), rel_tol=1e-6),
    ),
    "leaf_area_index": (
        [*STEMS, "--leaf-area-index", "1e-6"],
        # Thin leaves: Beer-Lambert with G = 1/2, whatever the crowns.
        lambda r, d: math.isclose(hidden(r), 0.5e-6, rel_tol=1e-5),
    ),
    "camera": (
        ["--camera", "dji-m3t-wide"],
        lambda r, d: (
            r["camera"]["name"] == "dji-m3t-wide" and r["camera"]["gsd_m"] < d["camera"]["gsd_m"]
        ),
    ),
    "focal_length": (
        [*LENS, "--focal-length", "18.2"],
        lambda r, d: math.isclose(2 * r["camera"]["gsd_m"], d["camera"]["gsd_m"]),
    ),
    "sensor_width": (
        [*LENS, "--sensor-width", "15.36"],
        lambda r, d: math.isclose(r["camera"]["gsd_m"], 2 * d["camera"]["gsd_m"]),
    ),
    "sensor_height": (
        [*LENS, "--sensor-height", "3"],
        lambda r, d: math.isclose(r["camera"]["footprint_m"][0], 40 * 3 / 9.1),
    ),
    "fov": (
        ["--fov", "90", "--image-width", "640", "--image-height", "320"],
        lambda r, d: r["camera"]["footprint_m"] == pytest.approx([40, 80]),
    ),
    "image_width": (
        [*LENS, "--image-width", "1280"],
        lambda r, d: math.isclose(2 * r["camera"]["gsd_m"], d["camera"]["gsd_m"]),
    ),
    "image_height": (
        [*LENS, "--image-height", "320"],
        # Square pixels: half as many along the heading as across it.
        lambda r, d: math.isclose(2 * r["camera"]["footprint_m"][0], r["camera"]["footprint_m"][1]),
    ),
    "coverage": (
        ["--coverage", "50%"],
        # The middle of the paper's forest is at (2.506 + 20.044) / 2 m.
        lambda r, d: math.isclose(r["baseline_m"], 0.2 * 40 / 11.275, rel_tol=1e-4),
    ),
    "model": (["--model", "layered"], lambda r, d: r["visibility"]["model"] == "layered"),
    "optimize": (
        ["--optimize", "aperture"],
        lambda r, d: extent(r) < extent(d) and r["samples"] > d["samples"],
    ),
    "max_aperture": (
        ["--max-aperture", "18.5"],
        lambda r, d: extent(r) <= 18.5 < extent(d) and r["visibility"]["normalized"] >= 0.98,
    ),
    "max_samples": (
        ["--optimize", "aperture", "--max-samples", "60"],
        lambda r, d: 50 < r["samples"] <= 60,
    ),
    "baseline": (
        ["--baseline", "2"],
        lambda r, d: r["baseline_m"] == 2.0 and r["visibility"]["normalized"] >= 0.98,
    ),
    "samples": (["--samples", "60"], lambda r, d: r["samples"] == 60),
    "grid": (["--grid", "line"], lambda r, d: r["grid"]["rows"] == 1 and r["samples"] == 50),
    "lanes": (
        ["--grid", "lanes", "--lanes", "5"],
        lambda r, d: r["grid"]["rows"] == 5 and r["samples"] % 5 == 0,
    ),
    "lane_pitch": (
        ["--grid", "spiral", "--lane-pitch", "2"],
        lambda r, d: r["grid"]["pitch_m"][1] == 2 * r["grid"]["pitch_m"][0],
    ),
    "origin": (
        ["--origin", "48.3358,14.3261"],
        lambda r, d: (
            abs(r["waypoints"][0].get("latitude", 0) - 48.3358) < 1e-3
            and abs(r["waypoints"][0]["longitude"] - 14.3261) < 1e-3
        ),
    ),
    "heading": (
        ["--heading", "90"],
        lambda r, d: r["waypoints"][0]["east_m"] == pytest.approx(d["waypoints"][0]["north_m"]),
    ),
    "line_length": (
        ["--grid", "line", "--line-length", "400"],
        lambda r, d: len(r["waypoints"]) == 143 and r["samples"] == 50,  # 142 legs of 2.8 m
    ),
    "area": (FIELD, lambda r, d: r.get("area", {}).get("covered_share") == 1.0),
    "clear": (
        [*FIELD, "--clear", str(AREAS / "meadow.kml")],
        lambda r, d: "area" in r and 0.3 < r["area"]["clear_m2"] / r["area"]["area_m2"] < 0.5,
    ),
    "no_fly": (
        [*FIELD, "--no-fly", str(AREAS / "mast.geojson")],
        lambda r, d: "area" in r and r["area"]["sites_in_no_fly"] > 0,
    ),
    "buffer": (
        [*FIELD, "--no-fly", str(AREAS / "mast.geojson"), "--buffer", "20"],
        lambda r, d: "area" in r and r["area"]["sites_in_no_fly"] > 100,
    ),
    "max_sites": (
        [*FIELD, "--max-sites", "7777"],
        lambda r, d: r["request"].get("max_sites") == 7777,
    ),
    "speed": (
        ["--speed", "1"],
        # Legs are longer than v²/a = 0.5 m, so each takes L/v + v/a.
        lambda r, d: math.isclose(r["flight"]["time_s"], r["flight"]["length_m"] + 49 / 2 + 50),
    ),
    "acceleration": (
        ["--acceleration", "8"],
        # At twice the acceleration's root, legs from stop to stop take half the time.
        lambda r, d: math.isclose(
            r["flight"]["time_s"] - 50,
            sum(
                2 * math.sqrt(leg / 8) if leg < 25 / 8 else leg / 5 + 5 / 8
                for leg in legs_of(r["waypoints"])
            ),
        ),
    ),
    "hold": (
        ["--hold", "3"],
        lambda r, d: math.isclose(r["flight"]["time_s"] - d["flight"]["time_s"], 100),
    ),
    "hold_error": (
        ["--hold-error", "0.5"],
        lambda r, d: r["baseline_m"] == d["baseline_m"] and r["samples"] > d["samples"],
    ),
    "rays": (
        ["--rays", "oblique"],
        lambda r, d: r["visibility"]["density"] > d["visibility"]["density"] + 0.005,
    ),
    "sensitivity": (
        ["--sensitivity"],
        lambda r, d: r["sensitivity"] is not None and len(r["sensitivity"]) == 6,
    ),
    "drone": (
        ["--drone", "ardupilot-copter"],
        lambda r, d: r["flight"].get("drone") == "ardupilot-copter" and r["request"]["speed"] == 10,
    ),
    "climb": (
        ["--climb", "1"],
        # 40 m up and as much down, each with a second or three of ramps.
        lambda r, d: math.isclose(
            r["flight"]["total_time_s"] - d["flight"]["total_time_s"],
            2 * (40 / 1 + 1 / 2) - 2 * (40 / 3 + 3 / 2),
        ),
    ),
    "trigger": (
        ["--trigger", "distance"],
        lambda r, d: (
            r["flight"]["spacing_m"] == r["baseline_m"]
            and sum(w.get("photo", True) for w in r["waypoints"]) == 50 < len(r["waypoints"])
        ),
    ),
    "max_blur": (
        ["--trigger", "distance", "--max-blur", "0.5"],
        lambda r, d: math.isclose(r["flight"]["speed_mps"], 0.5 * r["camera"]["gsd_m"] / 0.01),
    ),
    "exposure_time": (
        ["--trigger", "distance", "--exposure-time", "0.05"],
        lambda r, d: math.isclose(r["flight"]["speed_mps"], r["camera"]["gsd_m"] / 0.05),
    ),
    "photo_interval": (
        ["--trigger", "distance", "--photo-interval", "2"],
        lambda r, d: math.isclose(r["flight"]["speed_mps"], r["baseline_m"] / 2),
    ),
    "wind_speed": (
        ["--wind-speed", "14", "--wind-from", "0"],
        # Northward legs have 15 - 14 m/s left, the others what they had.
        lambda r, d: r["flight"]["time_s"] > d["flight"]["time_s"] + 10,
    ),
    "wind_from": (
        ["--wind-speed", "14", "--wind-from", "90"],
        # Across the lines it takes their 5 m/s from √(15² - 14²) = 5.4, against it 1 is left.
        lambda r, d: 0 < r["flight"]["time_s"] - d["flight"]["time_s"] < 10,
    ),
    "airspeed": (
        ["--wind-speed", "14", "--wind-from", "0", "--airspeed", "14.5"],
        lambda r, d: r["flight"]["time_s"] > d["flight"]["time_s"] + 50,
    ),
    "takeoff": (
        ["--origin", "48,14", "--takeoff", "48,14.01"],
        # 0.01 degrees of longitude are 746 m there.
        lambda r, d: r["flight"]["flights"][0]["length_m"] > 1400 + r["flight"]["length_m"],
    ),
    "flight_time": (
        ["--flight-time", "2"],
        lambda r, d: (
            len(r["flight"]["flights"]) > 1
            and all(flight["time_s"] <= 120 for flight in r["flight"]["flights"])
        ),
    ),
    "resume_at": (
        ["--resume-at", "20"],
        lambda r, d: (
            [w["north_m"] for w in r["waypoints"]] == [w["north_m"] for w in d["waypoints"][20:]]
            and r["waypoints"][0]["index"] == 0
        ),
    ),
    "altitude_frame": (
        ["--altitude-frame", "terrain"],
        lambda r, d: r["flight"]["altitude_frame"] == "terrain",
    ),
    "clearance": (
        ["--altitude", "21", "--clearance", "0.5"],
        lambda r, d: r["altitude_m"] == 21.0,
    ),
    "autopilot": (
        ["--autopilot", "ardupilot"],
        lambda r, d: r["flight"].get("autopilot") == "ardupilot",
    ),
    "payload": (
        ["--payload", "dji-h20t"],
        lambda r, d: r["flight"].get("payload") == "dji-h20t",
    ),
}

CLOUD_ONLY = ("voxel", "ground", "min_height", "crown_base", "view")
TERRAIN = ("terrain", "terrain_tolerance")
"""Tested where there is a terrain, in test_terrain.py."""


def legs_of(waypoints):
    places = [(w["east_m"], w["north_m"]) for w in waypoints]
    return [math.dist(*pair) for pair in pairwise(places)]


def test_an_area_gives_the_place_and_goes_into_every_format(folder, command):
    line = ["plan", "--altitude", "40", "--vhat", "0.9", *FIELD, "--heading", "auto", "--quiet"]
    assert command(*line, "--out", "a.csv", "--out", "a.geojson")[0] == 0
    rows = list(csv.DictReader(io.StringIO((folder / "a.csv").read_text())))
    features = json.loads((folder / "a.geojson").read_text())["features"]
    assert len(features) == len(rows) + 1
    assert all(48.329 < float(row["latitude"]) < 48.333 for row in rows)


def test_a_plan_over_an_area_fed_back_is_the_same(folder, document):
    line = ["--vhat", "0.9", *FIELD, "--clear", str(AREAS / "meadow.kml"), "--heading", "auto"]
    first = document("plan", "--altitude", "40", *line, "--no-fly", str(AREAS / "mast.geojson"))
    (folder / "again.json").write_text(json.dumps(first))
    assert document("plan", "again.json") == first


def test_areas_that_a_request_names_are_looked_for_beside_it(folder, document):
    (folder / "sub").mkdir()
    (folder / "sub" / "field.geojson").write_bytes((AREAS / "field.geojson").read_bytes())
    (folder / "sub" / "r.toml").write_text('altitude = 40\nvhat = 0.9\narea = "field.geojson"\n')
    assert document("plan", "sub/r.toml")["area"]["sites"] > 1000


def test_the_table_tells_of_the_area(command):
    status, out, err = command("plan", "--altitude", "40", "--vhat", "0.9", *FIELD)
    assert (status, err) == (0, "")
    assert re.search(r"Area +4\.\d+ ha, 100 % of it covered from \d+ sites", out)
    assert "add --out" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*FIELD, "--origin", "48,14"], "--origin and --area say the same thing twice"),
        (["--clear", "x.kml"], "--clear without --area"),
        (["--no-fly", "x.kml"], "--no-fly without --area"),
        (["--max-sites", "5"], "--max-sites without --area"),
        ([*FIELD, "--buffer", "5"], "--buffer without --no-fly"),
        ([*FIELD, "--buffer", "-5", "--no-fly", "x"], "--buffer '-5' is below zero"),
        (["--heading", "auto"], "--heading auto needs --area"),
        (["--heading", "along"], "--heading 'along' is not a finite number"),
        ([*FIELD, "--max-sites", "5"], "the area needs at least"),
        (["--line-length", "100"], "--line-length with --grid trimmed"),
        ([*FIELD, "--grid", "line", "--line-length", "100"], "contradict each other"),
        (["--grid", "line", "--lane-pitch", "4"], "--lane-pitch with --grid line"),
        ([*FIELD, "--grid", "line", "--lane-pitch", "0.5"], "--lane-pitch 0.5 is below 1"),
        (["--area", "none.geojson"], "no file 'none.geojson'"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_options_of_areas_that_do_not_fit_are_one_error(command, arguments, message):
    refused = command("plan", "--altitude", "40", *arguments)
    check_refusal(*refused)
    assert message in refused[2]


def test_every_option_has_its_effect_tested():
    assert {*EFFECTS, *CLOUD_ONLY, *TERRAIN} == {option.name for option in OPTIONS}


@pytest.mark.parametrize("name", EFFECTS)
def test_options_have_their_effect(document, name):
    arguments, holds = EFFECTS[name]
    altitude = (
        []
        if {"altitude", "gsd", "target_size", "target_pixels", "clearance"} & {name}
        else [
            "--altitude",
            "40",
        ]
    )
    default = document("plan", "--altitude", "40")
    result = document("plan", *altitude, *arguments)
    assert holds(result, default)
    assert not holds(default, default)


@pytest.mark.parametrize(
    ("flag", "value"), [("--voxel", "0.5"), ("--ground", "class"), ("--min-height", "1")]
)
def test_options_of_point_clouds_are_refused_for_other_scenes(command, flag, value):
    refused = command("plan", "--altitude", "40", flag, value)
    check_refusal(*refused)
    assert f"{flag} goes with a point cloud" in refused[2]


@pytest.mark.parametrize(
    ("kind", "rows", "columns", "samples", "required"),
    [
        ("trimmed", 7, 8, 50, 50),
        ("rectangle", 7, 8, 56, 50),
        ("square", 8, 8, 64, 50),
        ("line", 1, 50, 50, 50),
        ("lanes", 3, 17, 51, 51),  # lanes come whole
        ("spiral", 1, 50, 50, 50),  # one line of sites, wound up
    ],
)
def test_grids_hold_at_least_the_samples_required(plan_of, kind, rows, columns, samples, required):
    result = plan_of("--grid", kind)
    assert (result["grid"]["kind"], result["samples"]) == (kind, samples)
    assert (result["grid"]["rows"], result["grid"]["columns"]) == (rows, columns)
    assert result["samples_required"] == required
    assert len(result["waypoints"]) == samples


@pytest.mark.parametrize("objective", ["samples", "aperture", "time"])
def test_objectives_are_the_best_of_all(plan_of, objective):
    measure = {
        "samples": lambda r: r["samples"],
        # The least extent within the 1 % that buys fewer samples.
        "aperture": lambda r: extent(r) / 1.01,
        "time": lambda r: r["flight"]["time_s"],
    }[objective]
    best = measure(plan_of("--optimize", objective))
    for other in ("samples", "aperture", "time"):
        assert best <= measure(plan_of("--optimize", other)) * (1 + 1e-12)


def test_no_occluders_is_one_sample_and_a_warning(command):
    line = ["plan", "--altitude", "40", "--density", "0", *UNIFORM]
    status, out, err = command(*line, "--json")
    result = loads(out)
    assert status == 0
    assert result["samples"] == 1
    assert err.startswith("warning: ")
    assert [warning["code"] for warning in result["warnings"]] == ["no_occluders"]


@pytest.mark.parametrize("flag", ["--density", "--integrated-density"])
def test_nothing_but_occluders_is_an_error(command, flag):
    refused = command("plan", "--altitude", "40", flag, "1", *UNIFORM)
    check_refusal(*refused)
    assert "density" in refused[2]


def test_a_missed_target_is_a_warning_where_both_unknowns_are_fixed(command):
    status, out, err = command("plan", "--altitude=40", "--samples=9", "--baseline=1", "--json")
    assert status == 0
    assert loads(out)["warnings"][0]["code"] == "target_missed"
    assert err.startswith("warning: V̂ = 0.98 is missed")


def test_limits_say_what_bound_the_result(plan_of):
    result = plan_of("--samples", "60", "--baseline", "2")
    limits = {limit["quantity"]: limit for limit in result["limits"]}
    assert limits["samples"]["value"] == limits["samples"]["bound"] == 60
    assert limits["baseline_m"]["value"] == limits["baseline_m"]["bound"] == 2.0
    assert all(limit["message"] for limit in result["limits"])


# JSON of plan, name by name

NAMES = {
    "schema": int,
    "version": str,
    "request": dict,
    "baseline_m": float,
    "samples": int,
    "samples_required": int,
    "aperture_m": float,
    "limits": list,
    "warnings": list,
    "waypoints": list,
}
PARTS = {
    "grid": {"rows", "columns", "extent_m", "pitch_m"},
    "visibility": {
        "density",
        "minimum",
        "maximum",
        "expected",
        "normalized",
        "shortfall",
        "effective_samples",
        "contrast",
        "target",
        "target_quantity",
        "model",
        "view",
    },
    "disparity": {"normalized", "pixels", "occluder_pixels"},
    "camera": {"gsd_m", "footprint_m", "common_footprint_m"},
    "flight": {"length_m", "time_s"},
}


def test_the_json_of_a_plan_has_the_names_of_the_contract(plan_of):
    result = plan_of("--origin", "48,14")
    for name, kind in NAMES.items():
        assert type(result[name]) is kind, name
    for name, inner in PARTS.items():
        assert inner <= set(result[name]), name
    assert result["schema"] == 1
    assert result["version"] == aosplan.__version__
    for limit in result["limits"]:
        assert set(limit) == {"quantity", "value", "bound", "message"}
    for waypoint in result["waypoints"]:
        assert set(waypoint) == {
            "index",
            "east_m",
            "north_m",
            "altitude_m",
            "latitude",
            "longitude",
        }


def test_without_a_place_waypoints_have_no_coordinates(plan_of):
    for waypoint in plan_of()["waypoints"]:
        assert set(waypoint) == {"index", "east_m", "north_m", "altitude_m"}


def test_the_numbers_of_a_plan_agree_with_each_other(plan_of):
    result = plan_of("--samples", "30", "--baseline", "1.7")
    v = result["visibility"]
    p = v["density"]
    assert v["minimum"] == pytest.approx(1 - p)
    assert v["maximum"] == pytest.approx(1 - p * p)
    assert v["expected"] == pytest.approx(
        v["minimum"] + (v["maximum"] - v["minimum"]) * v["normalized"]
    )
    assert v["shortfall"] == pytest.approx(1 - v["normalized"])
    assert v["effective_samples"] == pytest.approx(1 / v["shortfall"])
    assert v["contrast"] == pytest.approx(math.sqrt(v["effective_samples"] * (1 - p) / p))
    assert result["aperture_m"] == pytest.approx((math.sqrt(30) - 1) * 1.7)
    common = [
        f - e
        for f, e in zip(result["camera"]["footprint_m"], result["grid"]["extent_m"], strict=True)
    ]
    assert result["camera"]["common_footprint_m"] == pytest.approx(common)


# Errors

BAD = """
plan
plan --altitude
plan --altitude 0
plan --altitude -5
plan --altitude nan
plan --altitude inf
plan --altitude 1e400
plan --altitude forty
plan --altitude 131ft
plan --altitude ''
plan --altitude 1_000
plan --altitude 20
plan --altitude 40 --gsd 0.05
plan --altitude 40 --target-size 1.8
plan --altitude 40 --focal-height -1
plan --gsd 0.001
plan --target-size 1.8
plan --target-pixels 20
plan --altitude 40 --vhat 98
plan --altitude 40 --vhat 1
plan --altitude 40 --vhat 100%
plan --altitude 40 --vhat -0.1
plan --altitude 40 --vhat nan
plan --altitude 40 --vhat 0,98
plan --altitude 40 --vhat ''
plan --altitude 40 --vhat 0.9999999
plan --altitude 40 --vhat 0.98 --visibility 0.6
plan --altitude 40 --visibility 0.68
plan --altitude 40 --visibility 60
plan --altitude 40 --scene paper-forrest
plan --altitude 40 --scene missing.toml
plan --altitude 40 --scene missing.laz
plan --altitude 40 --scene .
plan --altitude 40 --scene ''
plan --altitude 40 --density 0.01
plan --altitude 40 --density 0.01 --occluder-size 0.2
plan --altitude 40 --density 1.5 --occluder-size 0.2 --volume-height 18
plan --altitude 40 --density 1 --occluder-size 0.2 --volume-height 18
plan --altitude 40 --integrated-density 57 --occluder-size 0.2 --volume-height 18
plan --altitude 40 --density 0.01 --occluder-size 0.2 --volume-height 18 --volume-base 30
plan --altitude 40 --density 0.01 --occluder-size 0.2 --volume-height 9 --volume-base 0 --coverage 1
plan --altitude 40 --scene savanna --density 0.1
plan --altitude 40 --occluder-size 0.3
plan --altitude 40 --camera dji-m3
plan --altitude 40 --camera missing.json
plan --altitude 40 --focal-length 9
plan --altitude 40 --fov 60
plan --altitude 40 --fov 180 --image-width 640 --image-height 512
plan --altitude 40 --fov 60 --image-width 640.5 --image-height 512
plan --altitude 40 --coverage 0
plan --altitude 40 --coverage 2
plan --altitude 40 --model fancy
plan --altitude 40 --optimize money
plan --altitude 40 --max-aperture 5
plan --altitude 40 --max-samples 20
plan --altitude 40 --max-samples 20 --optimize aperture
plan --altitude 40 --baseline 0
plan --altitude 40 --baseline 0.0001
plan --altitude 40 --baseline 2 --max-samples 60
plan --altitude 40 --baseline 2 --max-aperture 5
plan --altitude 40 --samples 49
plan --altitude 40 --samples 0
plan --altitude 40 --samples 50.5
plan --altitude 40 --samples 10000000
plan --altitude 40 --samples 60 --max-samples 50
plan --altitude 40 --grid circle
plan --altitude 40 --lanes 3
plan --altitude 40 --grid spiral --lanes 3
plan --altitude 40 --grid spiral --lane-pitch 1.5
plan --altitude 40 --grid spiral --trigger distance
plan --altitude 40 --heading worst
tradeoff --altitude 40 --out table.txt
tradeoff --altitude 40 --density 0 --occluder-size 0.2 --volume-height 9
tradeoff --altitude 40 --vhat 0.98 --max-samples 20
plan --altitude 40 --grid lanes --lane-pitch 0.5
plan --altitude 40 --origin 48
plan --altitude 40 --origin 120,14
plan --altitude 40 --origin 14,200
plan --altitude 40 --origin x,y
plan --altitude 40 --heading north
plan --altitude 40 --speed 0
plan --altitude 40 --acceleration 0
plan --altitude 40 --hold -1
plan --altitude 40 --drone dji-m3
plan --altitude 40 --drone ''
plan --altitude 40 --climb 0
plan --altitude 40 --trigger time
plan --altitude 40 --max-blur 1
plan --altitude 40 --exposure-time 0.01
plan --altitude 40 --trigger distance --max-blur 0
plan --altitude 40 --trigger distance --acceleration 1e-9
plan --altitude 40 --trigger distance --exposure-time 5ms
plan --altitude 40 --trigger distance --photo-interval -1
plan --altitude 40 --wind-speed 5
plan --altitude 40 --wind-from 90
plan --altitude 40 --wind-speed 15 --wind-from 0
plan --altitude 40 --wind-speed 99 --wind-from 45 --trigger distance
plan --altitude 40 --wind-speed 5 --wind-from 0 --airspeed 4
plan --altitude 40 --takeoff 48,14
plan --altitude 40 --origin 48,14 --takeoff 48
plan --altitude 40 --origin 48,14 --takeoff=-48,14
plan --altitude 40 --origin 48,14 --takeoff 50,14 --flight-time 30
plan --altitude 40 --flight-time 0
plan --altitude 40 --flight-time 0.1
plan --altitude 40 --trigger distance --flight-time 0.7
plan --altitude 40 --resume-at 50
plan --altitude 40 --resume-at -1
plan --altitude 40 --resume-at 1.5
plan --altitude 40 --clearance -1
plan --altitude 40 --clearance 20
plan --altitude 40 --terrain dem.tif
plan --altitude 40 --terrain-tolerance 1
plan --altitude 40 --origin 48,14 --terrain missing.tif
plan --altitude 40 --origin 48,14 --terrain .
plan --altitude 40 --origin 48,14 --terrain /vsicurl/https://localhost/dem.tif
plan --altitude 40 --defaults missing.toml
plan --altitude 40 --defaults ''
drones extra
plan --altitude 40 --out plan.geojson
plan --altitude 40 --out plan.txt
plan --altitude 40 --out plan
plan --altitude 40 --out nofolder/plan.csv
plan --altitude 40 --out .
plan --altitude 40 --out -
plan --altitude 40 --out csv:
plan --altitude 40 --out ''
plan --altitude 40 --out a.csv --out a.csv
plan --altitude 40 --out a.csv --out ./a.csv
plan --altitude 40 --out csv:- --json
plan --altitude 40 --format csv
plan --altitude 40 --format cvs --out a.txt
plan --altitude 40 --format csv --out a.txt --out b.txt
plan --altitude 40 --bogus
plan --altitude 40 extra.toml more.toml
plan missing.toml
plan .
plan --altitude 40 --quiet=yes
plna
--bogus
--json
visibility
visibility --density 0.5
visibility --density 0.5 --samples 50
visibility --density 50 --samples 50 --dhat 1
visibility --density 0.5 --samples 0 --dhat 1
visibility --density 0.5 --samples 50 --dhat -1
visibility --density 0.5 --samples 50 --dhat nan
visibility --density 0.5 --grid 7 --dhat 1
visibility --density 0.5 --grid 7x0 --dhat 1
visibility --density 0.5 --grid 7x8 --samples 56 --dhat 1
visibility --density 0.5 --slice-density 0.1 --samples 50 --dhat 1
visibility --slice-density 0.1 --samples 50 --dhat 1
visibility --density 0.5 --height-ratio 9 --samples 50 --dhat 1
visibility --density 0.5 --positions missing.csv --spacing 1
visibility --density 0.5 --positions missing.csv
visibility --density 0.5 --samples 9 --dhat 1 --heading 30
visibility --density 0.5 --samples 50 --dhat 1 --spacing 1
scene
scene nope
scene missing.toml
scene paper-forest --save x.txt
scene paper-forest --save nofolder/x.toml
scene paper-forest --voxel 1
export
export missing.json
export missing.json --out a.csv
schema plane
cameras extra
""".strip().splitlines()


@pytest.mark.parametrize("line", BAD)
def test_a_bad_command_line_is_one_error_and_writes_nothing(folder, command, line):
    check_refusal(*command(*shlex.split(line)))
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("line", "value", "place"),
    [
        ("plan --altitude forty", "forty", "--altitude"),
        ("plan --altitude 40 --vhat 98", "98", "--vhat"),
        ("plan --altitude 40 --scene paper-forrest", "paper-forrest", "scene"),
        ("plan --altitude 40 --origin 120,14", "120,14", "--origin"),
        ("plan --altitude 15", "15", "altitude"),
        ("plan --altitude 40 --samples 49", "49", "--samples"),
        ("plan --altitude 40 --max-aperture 5", "5", "--max-aperture"),
        ("plan --altitude 40 --out plan.txt", "plan.txt", "output"),
        ("visibility --density 50 --samples 50 --dhat 1", "50", "--density"),
    ],
)
def test_errors_name_the_offending_value_and_where_it_stands(command, line, value, place):
    _, _, err = command(*shlex.split(line))
    error = err.splitlines()[0]
    assert value in error
    assert place in error


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("plan --altitude 40 --vhat 98", "98%"),
        ("plan --altitude 131ft", "39.9288 m"),
        ("plan --altitude 40 --scene paper-forrest", "did you mean paper-forest?"),
        ("plan --altitude 40 --camera dji-m3t-termal", "did you mean dji-m3t-thermal?"),
        ("plan --altitude 40 --model layerd", "did you mean layered?"),
        ("plan --altitude 40 --out g.geojson", "--origin LAT,LON"),
        ("plna", "plan"),
        ("plan --altitude 15", "20.04"),
        ("plan --altitude 40 --max-aperture 5", "--max-aperture"),
        ("plan --altitude 40 --samples 49", "50"),
        ("plan --altitude 40 --visibility 0.68", "0.6785"),
    ],
)
def test_errors_with_a_remedy_have_a_hint(command, line, hint):
    _, _, err = command(*shlex.split(line))
    assert hint in err.splitlines()[1].removeprefix("hint: ")


@pytest.mark.parametrize(
    ("line", "keep"),
    [
        ("plan --altitude 40 --max-aperture 5", []),
        ("plan --altitude 40 --max-aperture 5 --max-samples 60", ["--max-samples", "60"]),
        ("plan --altitude 40 --max-aperture 5 --grid square", ["--grid", "square"]),
        ("plan --altitude 40 --max-aperture 5 --model layered", ["--model", "layered"]),
    ],
)
def test_the_aperture_that_a_hint_names_is_enough(command, line, keep):
    _, _, err = command(*shlex.split(line))
    aperture = re.search(r"--max-aperture ([0-9.e+]+) is enough", err.splitlines()[1])[1]
    status, _, err = command("plan", "--altitude", "40", "--max-aperture", aperture, *keep)
    assert status == 0, err


def test_the_samples_that_a_hint_names_are_enough(command):
    line = "plan --altitude 40 --max-aperture 5 --max-samples 20"
    _, _, err = command(*shlex.split(line))
    allowed = re.search(r"allow (\d+) samples", err.splitlines()[1])
    if allowed:
        line = f"plan --altitude 40 --max-aperture 5 --max-samples {allowed[1]}"
        status, _, err = command(*shlex.split(line))
        assert status == 0, err


def test_a_hint_never_asks_for_more_than_one_plan_may_have(command):
    _, _, err = command("plan", "--altitude", "40", "--vhat", "0.9999999")
    assert "is enough, with 10000000 samples" not in err


@pytest.mark.parametrize(
    "line",
    [
        "plan --altitude 1e308",
        "plan --altitude 1e160",
        "plan --gsd 1e300",
        "plan --target-size 1e300 --target-pixels 1e-300",
        "plan --altitude 1e308 --focal-height 1e308",
        "plan --altitude 40 --focal-height 1e308",
        "plan --altitude 40 --speed 1e300",
        "plan --altitude 40 --speed 1e200 --optimize time",
        "plan --altitude 40 --speed 1e-300",
        "plan --altitude 40 --acceleration 1e-300",
        "plan --altitude 40 --hold 1e308",
        "plan --altitude 40 --hold 1e308 --optimize time",
        "plan --altitude 40 --baseline 1e308 --samples 4",
        "plan --altitude 40 --baseline 1e-320 --samples 4",
        "plan --altitude 40 --baseline 1e-320",
        "plan --altitude 40 --max-aperture 1e-300",
        "plan --altitude 40 --max-aperture 1e300",
        "plan --altitude 40 --coverage 1e-300",
        "plan --altitude 40 --heading 1e300",
        "plan --altitude 40 --grid lanes --lanes 9007199254740992",
        "plan --altitude 40 --grid lanes --lane-pitch 1e300",
        "plan --altitude 40 --grid lanes --lane-pitch 1e308",
        "plan --altitude 40 --fov 1e-300 --image-width 1 --image-height 1",
        "plan --altitude 40 --fov 179.9999999999 --image-width 1 --image-height 1",
        "plan --altitude 40 --fov 60 --image-width 9007199254740992 --image-height 1",
        "plan --altitude 40 --focal-length 1e-300 --sensor-width 1e300 --image-width 1"
        " --image-height 1",
        "plan --altitude 40 --focal-length 1e300 --sensor-width 1e-300 --image-width 1"
        " --image-height 1",
        "plan --altitude 40 --density 0.5 --occluder-size 1e-300 --volume-height 10",
        "plan --altitude 40 --density 0.1 --occluder-size 1e300 --volume-height 10",
        "plan --altitude 40 --density 1e-320 --occluder-size 1 --volume-height 10",
        "plan --altitude 40 --density 0.1 --occluder-size 1 --volume-height 1e-300",
        "plan --altitude 40 --integrated-density 0.9999999999999999 --occluder-size 1"
        " --volume-height 9",
        "visibility --density 0.5 --samples 50 --dhat 1e-320",
        "visibility --density 0.5 --samples 50 --dhat 1e308",
        "visibility --density 1e-320 --samples 50 --dhat 1",
        "visibility --density 0.5 --grid 9007199254740992x9007199254740992 --dhat 1e-9",
        "visibility --slice-density 0.5 --height-ratio 1e308 --samples 9 --dhat 1",
        "visibility --slice-density 1 --height-ratio 0 --samples 9 --dhat 1",
    ],
)
@pytest.mark.parametrize("output", [["--json"], []], ids=["json", "table"])
def test_absurd_numbers_never_end_in_a_traceback(command, line, output):
    # Anything that escapes fails the test by itself.
    status, out, err = command(*shlex.split(line), *output)
    if status != 0:
        check_refusal(status, out, err)
    elif output:
        loads(out)
    else:
        assert "nan" not in out.lower()
        assert not re.search(r"\binf\b", out)


# Each of these once ran without end; a small machine needs a few seconds at most.
ENDLESS = """
plan --altitude 40 --visibility 0.678511
plan --altitude 40 --visibility 0.6785109999999
plan --altitude 40 --vhat 0.99999999999999999999999999
plan --altitude 40 --density 1e-9 --occluder-size 1e-9 --volume-height 10 --model layered
scene s.toml
""".strip().splitlines()

BOUNDED = (
    "import resource, sys\n"
    "resource.setrlimit(resource.RLIMIT_AS, (2 * 2**30, 2 * 2**30))\n"
    "from aosplan.cli.app import main\n"
    "main(sys.argv[1:])\n"
)


@pytest.mark.parametrize("line", ENDLESS)
def test_requests_beyond_any_plan_are_refused_in_finite_time(folder, line):
    (folder / "s.toml").write_text(
        'name = "fine"\ndensity = 1e-9\noccluder_size_m = 1e-9\n'
        "volume_base_m = 2.0\nvolume_height_m = 10.0\n"
    )
    try:
        done = subprocess.run(
            [sys.executable, "-c", BOUNDED, *shlex.split(line)],
            capture_output=True,
            check=False,
            text=True,
            timeout=10,
        )
    except subprocess.TimeoutExpired:
        pytest.fail("ran without end")
    check_refusal(done.returncode, done.stdout, done.stderr)


# Names from outside

NASTY = [
    "a\nb",
    "a\rb",
    "a\x1b[31mb",
    "a\u2028b",
    "a\u202eb",
    "a\x85b",
    "\x07",
    "a\tb",
    "wäld",
    "\udcff",
]


@pytest.mark.parametrize("name", NASTY, ids=ascii)
@pytest.mark.parametrize(
    "arguments",
    [
        ["plan", "--altitude", "40", "--scene", "{}"],
        ["plan", "--altitude", "40", "--scene", "{}.toml"],
        ["plan", "--altitude", "40", "--camera", "{}"],
        ["plan", "--altitude", "{}"],
        ["plan", "--altitude", "40", "--vhat", "{}"],
        ["plan", "--altitude", "40", "--grid", "{}"],
        ["plan", "--altitude", "40", "--origin", "{}"],
        ["plan", "--altitude", "40", "--out", "{}/a.csv"],
        ["plan", "--altitude", "40", "--out", "a.{}"],
        ["plan", "--altitude", "40", "--out", "a.txt", "--format", "{}"],
        ["plan", "{}.toml"],
        ["plan", "--{}"],
        ["{}"],
        ["schema", "{}"],
        ["visibility", "--density", "0.5", "--dhat", "1", "--grid", "{}"],
        ["visibility", "--density", "0.5", "--spacing", "1", "--positions", "{}"],
    ],
    ids=" ".join,
)
def test_nasty_names_do_not_break_the_one_line_of_an_error(command, arguments, name):
    check_refusal(*command(*(argument.format(name) for argument in arguments)))


def test_names_in_files_cannot_steer_the_terminal(folder, command):
    (folder / "s.toml").write_text(
        'name = "x\\ny"\ntitle = "\\u001b[31mred\\u001b]0;owned\\u0007"\ndensity = 0.01\n'
        "occluder_size_m = 0.2\nvolume_base_m = 2\nvolume_height_m = 18\n"
    )
    for arguments in (["plan", "--altitude", "40", "--scene", "s.toml"], ["scene", "s.toml"]):
        status, out, err = command(*arguments)
        assert (status, err) == (0, "")
        assert all(line.isprintable() for line in out.split("\n"))


def test_a_warning_stays_one_line_whatever_a_file_says(folder, command):
    (folder / "s.toml").write_text(
        'name = "x\\ny"\ndensity = 0\noccluder_size_m = 0.2\nvolume_base_m = 2\n'
        "volume_height_m = 18\n"
    )
    _, _, err = command("plan", "--altitude", "40", "--scene", "s.toml", "--json")
    assert [line.partition(": ")[0] for line in err.splitlines()] == ["warning"]


# Outputs


def test_out_writes_and_says_so(folder, command):
    status, out, err = command(
        "plan", "--altitude=40", "--origin=48,14", "--out=a.csv", "--out=b.geojson"
    )
    assert (status, err) == (0, "")
    assert "Wrote a.csv, b.geojson" in out
    assert {path.name for path in folder.iterdir()} == {"a.csv", "b.geojson"}


def test_out_with_json_prints_one_document_and_writes(folder, document):
    result = document("plan", "--altitude", "40", "--out", "a.csv")
    rows = list(csv.DictReader(io.StringIO((folder / "a.csv").read_text())))
    assert len(rows) == result["samples"]


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_json_with_what_is_no_number_is_not_printed(capsys, value):
    with pytest.raises(ValueError, match="not JSON compliant"):
        print_json({"a": value})
    assert capsys.readouterr().out == ""


def test_a_dash_is_stdout_and_nothing_else_is_on_it(command):
    for arguments in (["--out", "csv:-"], ["--out", "-", "--format", "csv"]):
        status, out, err = command("plan", "--altitude", "40", *arguments)
        assert (status, err) == (0, "")
        rows = list(csv.DictReader(io.StringIO(out)))
        assert len(rows) == 50
        assert set(rows[0]) == {"index", "east_m", "north_m", "altitude_m"}


def test_warnings_stay_out_of_stdout(command):
    status, out, err = command("plan", "--altitude", "40", "--grid", "line", "--out", "csv:-")
    assert status == 0
    assert out.count("\n") == 51
    assert err.startswith("warning: no ground is seen by all samples")


def test_an_existing_output_stays_unless_forced(folder, command):
    (folder / "a.csv").write_text("old")
    check_refusal(*command("plan", "--altitude", "40", "--out", "a.csv"))
    assert (folder / "a.csv").read_text() == "old"
    status, _, _ = command("plan", "--altitude", "40", "--out", "a.csv", "--force")
    assert status == 0
    assert (folder / "a.csv").read_text().startswith("index,")


def test_one_existing_output_keeps_all_others_from_being_written(folder, command):
    (folder / "b.csv").write_text("old")
    check_refusal(*command("plan", "--altitude", "40", "--out", "a.csv", "--out", "b.csv"))
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"b.csv": "old"}


def test_one_file_is_not_written_twice_under_two_names(folder, command):
    arguments = ["--out", "csv:a", "--out", "geojson:./a", "--force", "--origin=48,14"]
    check_refusal(*command("plan", "--altitude", "40", *arguments))
    assert list(folder.iterdir()) == []


def test_special_files_are_never_replaced(folder, command):
    # --force once put an ordinary file where a device was, for everybody on the machine.
    os.mkfifo("pipe")
    status, _, err = command("plan", "--altitude", "40", "--out", "csv:pipe", "--force")
    assert status in (1, 2), err
    assert (folder / "pipe").is_fifo()


def test_an_infeasible_plan_leaves_no_file(folder, command):
    check_refusal(
        *command("plan", "--altitude", "40", "--max-aperture", "5", "--out", "a.csv", "--force")
    )
    assert list(folder.iterdir()) == []


def test_a_full_disk_is_status_1_and_leaves_nothing(folder, command, monkeypatch):
    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    failed = command("plan", "--altitude", "40", "--out", "a.csv")
    check_refusal(*failed, expected=1)
    assert "a.csv" in failed[2]
    assert "no space left" in failed[2]
    assert list(folder.iterdir()) == []


def test_no_permission_is_status_1(command, monkeypatch):
    def refuse(*arguments, **words):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.mkstemp", refuse)
    check_refusal(*command("plan", "--altitude", "40", "--out", "a.csv"), expected=1)


def test_ctrl_c_is_no_traceback(command, monkeypatch):
    def interrupt(handle):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    status, _, err = command("plan", "--altitude", "40", "--out", "a.csv")
    assert status == 130
    assert "Traceback" not in err


@pytest.mark.parametrize("more", [[], ["--grid", "line"], ["--out", "a.csv"]])
def test_quiet_says_nothing(command, more):
    assert command("plan", "--altitude", "40", "--quiet", *more) == (0, "", "")


def test_quiet_does_not_silence_json(command):
    status, out, err = command("plan", "--altitude", "40", "--grid", "line", "--json", "--quiet")
    assert (status, err) == (0, "")
    assert loads(out)["samples"] == 50


def test_quiet_does_not_silence_errors(command):
    check_refusal(*command("plan", "--altitude", "10", "--quiet"))


# The other commands


def test_the_calculator_computes_equation_2(document):
    result = document("visibility", "--density", "0.567", "--samples", "50", "--dhat", "1")
    v = result["visibility"]
    assert (result["schema"], result["samples"], result["dhat"]) == (1, 50, 1.0)
    assert v["normalized"] == pytest.approx(0.98)
    assert v["expected"] == pytest.approx(1 - 0.567**2 - 0.567 * 0.433 / 50)


def test_the_calculator_takes_slices(document):
    result = document(
        *shlex.split("visibility --slice-density 0.0095 --height-ratio 87.69 --grid 7x7 --dhat 1")
    )
    assert result["visibility"]["density"] == pytest.approx(0.567, abs=5e-4)


@pytest.mark.parametrize("grid", ["7x8", "7X8", "7×8"])
def test_the_calculator_takes_whole_grids(document, grid):
    result = document("visibility", "--density", "0.5", "--grid", grid, "--dhat", "0.25")
    assert result["samples"] == 56
    assert result["visibility"]["normalized"] < 1 - 1 / 56


def test_the_calculator_takes_the_waypoints_of_a_plan(folder, document, command):
    planned = document("plan", "--altitude", "40", "--baseline", "1.9", "--out", "a.csv")
    # The offset at which an occluder has moved by its own size is the optimal baseline.
    spacing = planned["baseline_m"] / planned["disparity"]["normalized"]
    density = planned["visibility"]["density"]
    line = ["visibility", "--positions", "a.csv", "--spacing", spacing, "--density", density]
    result = document(*line)
    assert result["samples"] == planned["samples"]
    # Positions in files are rounded to a tenth of a millimetre.
    assert result["visibility"]["normalized"] == pytest.approx(
        planned["visibility"]["normalized"], abs=1e-5
    )


@pytest.mark.parametrize(("heading", "ending"), [(30, "csv"), (-75.5, "geojson"), (360, "plan")])
def test_the_calculator_turns_the_waypoints_of_a_heading(folder, document, heading, ending):
    where = ["--origin", "48.3358,14.3261", f"--heading={heading}", "--out", f"a.{ending}"]
    planned = document("plan", "--altitude", "40", "--baseline", "1.9", *where)
    spacing = planned["baseline_m"] / planned["disparity"]["normalized"]
    line = ["visibility", "--positions", f"a.{ending}", "--spacing", spacing, "--density", "0.5"]
    wanted = pytest.approx(planned["visibility"]["normalized"], abs=1e-5)
    assert document(*line, f"--heading={heading}")["visibility"]["normalized"] == wanted
    assert (document(*line)["visibility"]["normalized"] == wanted) == (heading == 360)


def test_the_calculator_shows_no_number_where_nothing_is_hidden(command):
    # With p = 0, V̂ is 0/0; JSON says null.
    status, out, _ = command("visibility", "--density", "0", "--samples", "50", "--dhat", "1")
    assert status == 0
    assert "0.98" not in out


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("x,y\n0,0\n1\n", "line 3"),
        ("x,y\n0,a\n", "line 2"),
        ("x,y\n0,nan\n", "line 2"),
        ("x;y\n0;1\n", "has no columns"),
        ("", "has no columns"),
        ("x,y\n", "holds no positions"),
        ("x,y\n1e308,1e308\n-1e308,0\n", ""),
    ],
)
def test_bad_positions_are_refused_at_their_line(folder, command, content, words):
    (folder / "p.csv").write_text(content)
    refused = command("visibility", "--density", "0.5", "--positions", "p.csv", "--spacing", "1")
    check_refusal(*refused)
    assert words in refused[2]


@pytest.mark.parametrize("header", ["x,y", "east_m,north_m", "index,EAST_M , north_m", "y,x"])
def test_positions_are_found_by_their_columns(folder, document, header):
    row = {"x": "0", "y": "3", "east_m": "0", "north_m": "3", "index": "9"}
    names = [name.strip().lower() for name in header.split(",")]
    other = dict.fromkeys(names, "0")
    lines = [header, ",".join(row[n] for n in names), ",".join(other[n] for n in names)]
    (folder / "p.csv").write_text("\ufeff" + "\n".join(lines) + "\n\n", encoding="utf-8")
    result = document("visibility", "--density", "0.5", "--positions", "p.csv", "--spacing", "4")
    # Two samples three quarters of a spacing apart: K = (1 + 1/4) / 2.
    assert result["samples"] == 2
    assert result["visibility"]["shortfall"] == pytest.approx(0.625)


def test_scene_statistics_have_the_names_of_the_contract(document):
    result = document("scene", "paper-forest")
    assert result["schema"] == 1
    assert result["integrated_density"] == 0.567
    assert result["canopy_top_m"] == pytest.approx(20.044, abs=1e-3)
    names = {"bottom_m", "top_m", "density", "occluder_size_m"}
    assert all(set(layer) == names for layer in result["layers"])
    assert {"mean_density", "baseline_curve", "warnings"} <= set(result)
    clear = math.prod(1 - layer["density"] for layer in result["layers"])
    assert 1 - clear == pytest.approx(0.567)


def test_a_saved_scene_plans_like_the_scene_it_was_saved_from(folder, document, command):
    assert command("scene", "savanna", "--save", "s.toml", "--quiet") == (0, "", "")
    saved, preset = (
        document("plan", "--altitude=40", "--scene=s.toml"),
        document("plan", "--altitude=40", "--scene=savanna"),
    )
    for result in (saved, preset):
        del result["request"]["scene"]
    assert saved == preset


def test_a_saved_scene_is_not_overwritten_unless_forced(folder, command):
    (folder / "s.toml").write_text("old")
    check_refusal(*command("scene", "savanna", "--save", "s.toml"))
    assert (folder / "s.toml").read_text() == "old"
    assert command("scene", "savanna", "--save", "s.toml", "--quiet", "--force")[0] == 0


@pytest.mark.parametrize(("name", "known"), [("cameras", CAMERAS), ("scenes", SCENES)])
def test_presets_are_listed(command, document, name, known):
    assert [row["name"] for row in document(name)] == list(known)
    _, out, _ = command(name)
    assert all(preset in out for preset in known)


@pytest.mark.parametrize("name", ["cameras", "scenes", "formats"])
def test_tables_fit_in_80_columns(command, name):
    _, out, _ = command(name)
    assert max(map(len, out.splitlines())) <= 80


@pytest.mark.parametrize("scene", [*SCENES])
@pytest.mark.parametrize("camera", ["dji-m3t-thermal", max(CAMERAS, key=len)])
def test_plan_tables_fit_in_80_columns(command, scene, camera):
    line = ["plan", "--altitude", "90", "--scene", scene, "--camera", camera]
    _, out, _ = command(*line, "--origin", "48.3358,14.3261")
    assert max(map(len, out.splitlines())) <= 80
    assert all(line == line.rstrip() for line in out.splitlines())


def test_every_camera_and_scene_plans(document):
    for camera in CAMERAS:
        assert document("plan", "--altitude=90", f"--camera={camera}")["camera"]["name"] == camera
    for scene in SCENES:
        assert document("plan", "--altitude=90", f"--scene={scene}")["scene"]["name"] == scene


# Help


def test_help_lists_every_command(command):
    status, out, err = command("--help")
    assert (status, err) == (0, "")
    assert all(re.search(rf"^  {name} ", out, re.MULTILINE) for name in COMMANDS)
    assert command() == (status, out, err)


def test_summaries_in_the_list_are_whole(command):
    _, out, _ = command("--help")
    assert "..." not in out.partition("Commands:")[2]


def examples_of(text):
    joined = text.partition("Examples:\n")[2].replace("\\\n", " ")
    return [line.strip() for line in joined.splitlines() if line.strip()]


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_every_command_has_two_examples(command, name):
    status, out, err = command(name, "--help")
    assert (status, err) == (0, "")
    examples = examples_of(out)
    assert len(examples) == 2
    assert all(example.startswith(f"aosplan {name}") for example in examples)
    assert max(map(len, out.splitlines())) <= 88


@pytest.mark.parametrize("name", COMMANDS)
def test_examples_that_need_no_file_run(folder, command, name):
    _, out, _ = command(name, "--help")
    for example in examples_of(out):
        arguments = shlex.split(example.partition(" > ")[0])[1:]
        if not re.search(r"\.(laz|json|toml)\b", " ".join(arguments)):
            status, printed, err = command(*arguments)
            assert (status, err) == (0, "")
            assert printed


def test_examples_of_export_run(folder, command):
    _, out, _ = command("plan", "--altitude", "40", "--origin", "48,14", "--json")
    (folder / "plan.json").write_text(out)
    _, text, _ = command("export", "--help")
    for example in examples_of(text):
        assert command(*shlex.split(example)[1:])[0] == 0


def test_help_of_plan_names_every_option_once(command):
    _, out, _ = command("plan", "--help")
    for option in OPTIONS:
        assert len(re.findall(rf"^  {option.flag} ", out, re.MULTILINE)) == 1


def test_version(command):
    assert command("--version") == (0, f"aosplan {aosplan.__version__}\n", "")


# Real processes


def test_the_module_runs():
    done = process("--version")
    assert done.returncode == 0
    assert done.stdout.decode() == f"aosplan {aosplan.__version__}\n"


def test_a_real_process_exits_with_the_status():
    done = process("plan", "--altitude", "10")
    check_refusal(done.returncode, done.stdout.decode(), done.stderr.decode())


@pytest.mark.parametrize(
    "environment",
    [
        {"PYTHONIOENCODING": "ascii"},
        {"PYTHONIOENCODING": "latin-1"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    ],
    ids=["ascii", "latin-1", "C"],
)
def test_a_terminal_without_unicode_gets_plain_text(environment, folder):
    for arguments in (["plan", "--altitude", "40"], ["plan", "--help"], ["cameras"], ["scenes"]):
        done = process(*arguments, **environment)
        assert (done.returncode, done.stderr) == (0, b"")
    done = process("plan", "--altitude", "40", "--samples", "5", **environment)
    check_refusal(done.returncode, done.stdout.decode(), done.stderr.decode("latin-1"))


def test_json_is_utf_8_whatever_the_terminal():
    plain = process("plan", "--altitude", "40", "--json", PYTHONIOENCODING="ascii")
    assert plain.stdout == process("plan", "--altitude", "40", "--json").stdout
    assert "d̂ ≥ 1" in process("schema", "request", PYTHONIOENCODING="ascii").stdout.decode()


def test_a_pipe_gets_no_colour():
    for arguments in (["plan", "--altitude", "40"], ["cameras"], ["plan", "--help"]):
        done = process(*arguments, TERM="xterm-256color")
        assert b"\x1b" not in done.stdout + done.stderr


def on_a_terminal(*arguments, **environment):
    """What a process writes to a terminal."""
    parent, child = pty.openpty()
    kept = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR")}
    with subprocess.Popen(
        [sys.executable, "-m", "aosplan", *arguments],
        stdin=subprocess.DEVNULL,
        stdout=child,
        stderr=child,
        env=kept | {"TERM": "xterm-256color"} | environment,
    ) as running:
        os.close(child)
        parts = []
        while True:
            try:
                part = os.read(parent, 65536)
            except OSError:  # the other end has gone
                break
            if not part:
                break
            parts.append(part)
        os.close(parent)
        running.wait(timeout=60)
    return b"".join(parts).decode()


def test_no_color_is_respected_on_a_terminal():
    colour = re.compile(r"\x1b\[[0-9;]*(3[0-7]|4[0-7]|38|48|9[0-7])[0-9;]*m")
    for arguments in (["plan", "--altitude", "40"], ["cameras"]):
        assert not colour.search(on_a_terminal(*arguments, NO_COLOR="1"))


def test_a_terminal_gets_the_same_words_as_a_pipe():
    shown = re.sub(r"\x1b\[[0-9;]*m", "", on_a_terminal("cameras"))
    piped = process("cameras").stdout.decode()
    assert [line.rstrip() for line in shown.splitlines()] == piped.splitlines()


def test_a_plan_without_a_point_cloud_shows_no_bar_on_a_terminal():
    shown = re.sub(r"\x1b\[[0-9;]*m", "", on_a_terminal("plan", "--altitude", "40"))
    assert "\x1b" not in shown
    assert "reading points" not in shown


@pytest.mark.parametrize("arguments", [["--json"], ["--out", "csv:-"]])
def test_a_reader_that_goes_away_is_no_traceback(arguments):
    line = ["plan", "--altitude", "40", "--vhat", "0.9998", "--quiet", *arguments]
    with subprocess.Popen(
        [sys.executable, "-m", "aosplan", *line], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as running:
        assert running.stdout.readline()
        running.stdout.close()
        err = running.stderr.read()
        assert running.wait(timeout=60) in (0, 1)
    assert err == b""


@pytest.mark.parametrize("arguments", [[], ["--json"], ["--out", "csv:-"]])
def test_a_closed_stdout_is_no_traceback(arguments):
    line = shlex.join([sys.executable, "-m", "aosplan", "plan", "--altitude", "40", *arguments])
    done = subprocess.run(
        ["sh", "-c", f"exec {line} >&-"], capture_output=True, check=False, text=True, timeout=60
    )
    assert "Traceback" not in done.stderr
    assert done.returncode in (0, 1)


def test_a_full_stdout_is_status_1_and_one_line(folder):
    # No byte fits into the file: what a full disk does, without a device in any test.
    line = shlex.join([sys.executable, "-m", "aosplan", "plan", "--altitude", "40", "--json"])
    done = subprocess.run(
        ["sh", "-c", f"ulimit -f 0; exec {line} > out.json"],
        capture_output=True,
        check=False,
        text=True,
        timeout=60,
    )
    check_refusal(done.returncode, done.stdout, done.stderr, expected=1)
    assert (folder / "out.json").read_bytes() == b""


# The trade-off


def test_the_trade_off_is_one_table_in_three_forms(folder, document, command):
    line = ["tradeoff", "--altitude", "40", "--vhat", "0.9", "--max-samples", "30"]
    rows = document(*line, "--optimize", "aperture")["rows"]
    assert [row["samples"] for row in rows] == list(range(1, 31))
    chosen = document("plan", *line[1:], "--optimize", "aperture")
    (own,) = (row for row in rows if row["chosen"])
    assert (own["samples"], own["baseline_m"]) == (chosen["samples"], chosen["baseline_m"])
    assert own["time_s"] == pytest.approx(chosen["flight"]["time_s"], rel=1e-12)
    assert [own["extent_x_m"], own["extent_y_m"]] == chosen["grid"]["extent_m"]
    for name in ("table.csv", "table.json", "table.jsonl"):
        status, _, err = command(*line, "--optimize", "aperture", "--out", name)
        assert (status, err) == (0, "")
    assert loads((folder / "table.json").read_text())["rows"] == rows
    lines = (folder / "table.jsonl").read_text().splitlines()
    assert [loads(line) for line in lines] == rows
    with open(folder / "table.csv", newline="") as file:
        table = list(csv.DictReader(file))
    assert [set(row) for row in table] == [set(row) for row in rows]
    for cells, row in zip(table, rows, strict=True):
        assert float(cells["baseline_m"]) == row["baseline_m"]
        assert cells["meets"] == str(row["meets"]).lower()


def test_the_trade_off_shows_the_front_and_the_plan_on_a_terminal(command):
    status, out, err = command("tradeoff", "--altitude", "40", "--grid", "best")
    assert (status, err) == (0, "")
    assert all(len(line) <= 80 for line in out.splitlines())
    assert sum("◀" in line for line in out.splitlines()) == 2  # the plan, and the note


def test_the_best_grid_is_named_with_its_reason(plan_of):
    result = plan_of("--grid", "best", "--optimize", "time")
    assert result["grid"]["kind"] in {"trimmed", "lanes", "spiral", "line"}
    assert result["request"]["grid"] == "best"
    reason = result["limits"][-1]
    assert reason["quantity"] == "choice"
    assert "is the best by flight time" in reason["message"]
