"""`plan`: tests of its results, of all names in its JSON, and of requests that are planned again."""

import csv
import io
import json
import math
import re

import pytest
import tomli_w
from support.command_line import AREAS, FIELD, LENS, UNIFORM, check_refusal, extent, loads, process

import aosplan

# The requirements


def test_a_plan_at_40_m_for_98_percent_has_50_samples(plan_of):
    result = plan_of("--vhat", "0.98")
    assert result["baseline_m"] == pytest.approx(2.80, rel=0.005)
    assert result["samples"] == 50
    assert result["aperture_m"] == pytest.approx(17.0, abs=0.05)


def test_the_table_shows_the_same_numbers(command):
    status, out, err = command("plan", "--altitude", "40", "--vhat", "0.98")
    assert (status, err) == (0, "")
    for text in ("b = 2.80 m", "N = 50", "a = 17.0 m", "V̂ = 98.0 %"):
        assert text in out


def test_a_plan_at_50_m_has_a_baseline_of_3_5_m(document):
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
def test_a_saved_result_as_request_gives_the_same_plan(folder, document, arguments, whole):
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


def test_files_named_in_a_request_are_found_in_its_folder(folder, document):
    (folder / "sub").mkdir()
    (folder / "sub" / "stand.toml").write_text(
        'name = "beside"\ndensity = 0.01\noccluder_size_m = 0.2\n'
        "volume_base_m = 2\nvolume_height_m = 9\n"
    )
    (folder / "sub" / "r.toml").write_text('altitude = 40\nscene = "stand.toml"\n')
    assert document("plan", "sub/r.toml")["scene"]["name"] == "beside"


def test_a_camera_file_named_in_a_request_is_found_in_its_folder(folder, document):
    (folder / "sub").mkdir()
    camera = {"name": "beside", "focal_length_mm": 9.1, "sensor_width_mm": 7.68}
    camera |= {"sensor_height_mm": 6.144, "image_width_px": 640, "image_height_px": 512}
    (folder / "sub" / "own.toml").write_text(tomli_w.dumps(camera))
    (folder / "sub" / "r.toml").write_text('altitude = 40\ncamera = "own.toml"\n')
    assert document("plan", "sub/r.toml")["camera"]["name"] == "beside"


# Areas


def test_an_area_gives_the_location_in_every_format(folder, command):
    line = ["plan", "--altitude", "40", "--vhat", "0.9", *FIELD, "--heading", "auto", "--quiet"]
    assert command(*line, "--out", "a.csv", "--out", "a.geojson")[0] == 0
    rows = list(csv.DictReader(io.StringIO((folder / "a.csv").read_text())))
    features = json.loads((folder / "a.geojson").read_text())["features"]
    assert len(features) == len(rows) + 1
    assert all(48.329 < float(row["latitude"]) < 48.333 for row in rows)


@pytest.mark.slow
def test_a_saved_plan_over_an_area_as_request_gives_the_same_plan(folder, document):
    line = ["--vhat", "0.9", *FIELD, "--clear", str(AREAS / "meadow.kml"), "--heading", "auto"]
    first = document("plan", "--altitude", "40", *line, "--no-fly", str(AREAS / "mast.geojson"))
    (folder / "again.json").write_text(json.dumps(first))
    assert document("plan", "again.json") == first


def test_area_files_named_in_a_request_are_found_in_its_folder(folder, document):
    (folder / "sub").mkdir()
    (folder / "sub" / "field.geojson").write_bytes((AREAS / "field.geojson").read_bytes())
    (folder / "sub" / "r.toml").write_text('altitude = 40\nvhat = 0.9\narea = "field.geojson"\n')
    assert document("plan", "sub/r.toml")["area"]["sites"] > 1000


def test_the_table_describes_the_area(command):
    status, out, err = command("plan", "--altitude", "40", "--vhat", "0.9", *FIELD)
    assert status == 0
    assert re.fullmatch(r"warning: the flights take \d+ min in total; --trigger distance .*\n", err)
    assert re.search(r"Area +4\.\d+ ha, 100 % of it covered from [\d,]+ sites", out)
    assert "add --out" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*FIELD, "--origin", "48,14"], "--origin and --area have the same meaning"),
        (["--clear", "x.kml"], "--clear needs --area"),
        (["--no-fly", "x.kml"], "--no-fly needs --area"),
        (["--max-sites", "5"], "--max-sites needs --area"),
        ([*FIELD, "--buffer", "5"], "--buffer needs --no-fly"),
        ([*FIELD, "--buffer", "-5", "--no-fly", "x"], "--buffer '-5' is below zero"),
        (["--heading", "auto"], "--heading auto needs --area"),
        (["--heading", "along"], "--heading 'along' is not a finite number"),
        ([*FIELD, "--max-sites", "5"], "the area needs at least"),
        (["--line-length", "100"], "--line-length cannot be used with --grid trimmed"),
        ([*FIELD, "--grid", "line", "--line-length", "100"], "contradict each other"),
        (["--grid", "line", "--lane-pitch", "4"], "--lane-pitch cannot be used with --grid line"),
        ([*FIELD, "--grid", "line", "--lane-pitch", "0.5"], "--lane-pitch 0.5 is below 1"),
        (["--area", "none.geojson"], "no file 'none.geojson'"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_contradictory_options_of_areas_give_one_error(command, arguments, message):
    refused = command("plan", "--altitude", "40", *arguments)
    check_refusal(*refused)
    assert message in refused[2]


# Grids, objectives and limits


@pytest.mark.parametrize(
    ("kind", "rows", "columns", "samples", "required"),
    [
        ("trimmed", 7, 8, 50, 50),
        ("rectangle", 7, 8, 56, 50),
        ("square", 8, 8, 64, 50),
        ("line", 1, 50, 50, 50),
        ("lanes", 3, 17, 51, 51),  # Lanes are always complete.
        ("spiral", 1, 50, 50, 50),  # a single path of sites, like a line
    ],
)
def test_grids_have_at_least_the_required_samples(plan_of, kind, rows, columns, samples, required):
    result = plan_of("--grid", kind, "--allow-no-common-ground")
    assert (result["grid"]["kind"], result["samples"]) == (kind, samples)
    assert (result["grid"]["rows"], result["grid"]["columns"]) == (rows, columns)
    assert result["samples_required"] == required
    assert len(result["waypoints"]) == samples


@pytest.mark.parametrize("objective", ["samples", "aperture", "time"])
def test_each_objective_gives_the_smallest_value_of_its_quantity(plan_of, objective):
    measure = {
        "samples": lambda r: r["samples"],
        # The extent is at most 1 % larger than the smallest one. This is accepted to save samples.
        "aperture": lambda r: extent(r) / 1.01,
        "time": lambda r: r["flight"]["time_s"],
    }[objective]
    best = measure(plan_of("--optimize", objective))
    for other in ("samples", "aperture", "time"):
        assert best <= measure(plan_of("--optimize", other)) * (1 + 1e-12)


def test_without_occluders_the_plan_has_one_sample_and_a_warning(command):
    line = ["plan", "--altitude", "40", "--density", "0", *UNIFORM]
    status, out, err = command(*line, "--json")
    result = loads(out)
    assert status == 0
    assert result["samples"] == 1
    assert err.startswith("warning: ")
    assert [warning["code"] for warning in result["warnings"]] == ["no_occluders"]


@pytest.mark.parametrize("flag", ["--density", "--integrated-density"])
def test_a_scene_of_density_one_is_refused(command, flag):
    refused = command("plan", "--altitude", "40", flag, "1", *UNIFORM)
    check_refusal(*refused)
    assert "density" in refused[2]


def test_a_missed_target_is_a_warning_if_samples_and_baseline_are_fixed(command):
    status, out, err = command("plan", "--altitude=40", "--samples=9", "--baseline=1", "--json")
    assert status == 0
    assert loads(out)["warnings"][0]["code"] == "target_missed"
    assert err.startswith("warning: V̂ = 0.98 is missed")


def test_limits_name_the_bounds_that_determined_the_result(plan_of):
    result = plan_of("--samples", "60", "--baseline", "2")
    limits = {limit["quantity"]: limit for limit in result["limits"]}
    assert limits["samples"]["value"] == limits["samples"]["bound"] == 60
    assert limits["baseline_m"]["value"] == limits["baseline_m"]["bound"] == 2.0
    assert all(limit["message"] for limit in result["limits"])


def test_the_best_grid_is_named_with_its_reason(plan_of):
    result = plan_of("--grid", "best", "--optimize", "time")
    assert result["grid"]["kind"] in {"trimmed", "lanes", "spiral", "line"}
    assert result["request"]["grid"] == "best"
    reason = result["limits"][-1]
    assert reason["quantity"] == "choice"
    assert "has the best flight time" in reason["message"]


# Names in the JSON of plan

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


def test_without_a_location_waypoints_have_no_coordinates(plan_of):
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


@pytest.mark.parametrize("name", ["x" * 10_000, "x y " * 3000, "ü" * 500])
def test_very_long_names_are_shortened_in_tables(folder, command, name):
    camera = {"name": name, "focal_length_mm": 9.1, "sensor_width_mm": 7.68}
    camera |= {"sensor_height_mm": 6.144, "image_width_px": 640, "image_height_px": 512}
    (folder / "c.json").write_text(json.dumps(camera))
    status, out, err = command("plan", "--altitude", "40", "--camera", "c.json")
    assert (status, err) == (0, "")
    assert len(out.splitlines()) < 40
    assert max(map(len, out.splitlines())) <= 80
