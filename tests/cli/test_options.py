# ruff: noqa: ARG005 (an effect compares a result with the default, or does not need it)
"""The effect of every option of `plan`, with one entry in `EFFECTS` for each."""

import math
from itertools import pairwise

import pytest
from support.command_line import (
    AREAS,
    FIELD,
    LENS,
    UNIFORM,
    check_refusal,
    extent,
    loads,
    process,
)

from aosplan.planning.options import OPTIONS

PERSON = ["--find", "person", "--contrast", "1", "--canopy-offset", "0", "--crown-share", "0"]
"""Options for a person with an explicit signature.  They are replaced by options that come later on
the command line.
"""

STEMS = ["--stems-per-hectare", "400", "--crown-diameter", "5", "--leaf-area-index", "1e5"]
STEMS = [*STEMS, "--volume-height", "10", "--volume-base", "6"]


def hidden(result):
    return result["scene"]["integrated_density"]


def legs_of(waypoints):
    places = [(w["east_m"], w["north_m"]) for w in waypoints]
    return [math.dist(*pair) for pair in pairwise(places)]


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
    "find": (
        ["--find", "2x1"],
        lambda r, d: "detection" in r and r["detection"]["target_m"] == [1.0, 2.0],
    ),
    "signature": (
        ["--find", "person", "--signature", "colour"],
        lambda r, d: "detection" in r and r["detection"]["assumed"] == "colour",
    ),
    "contrast": (
        [*PERSON, "--contrast", "-1"],
        lambda r, d: "detection" in r and r["detection"]["contrast"] == -1.0,
    ),
    "canopy_offset": (
        [*PERSON, "--canopy-offset", "-1.5"],
        lambda r, d: "detection" in r and r["detection"]["canopy_offset"] == -1.5,
    ),
    "crown_share": (
        [*PERSON, "--crown-share", "90%"],
        # Clutter at the scale of crowns hides a person.
        lambda r, d: "detection" in r and r["detection"]["probability"] < 0.7,
    ),
    "false_alarms": (
        ["--find", "person", "--false-alarms", "10"],
        lambda r, d: "detection" in r and r["detection"]["false_alarms_per_hectare"] == 10.0,
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
        # The footprint limits the baseline, which would be b = o h/H = 6.8 m.
        lambda r, d: 3.8 < r["baseline_m"] < 0.4 * 40 / 2.36,
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
        # With dense leaves, only the gaps between crowns are visible.
        lambda r, d: math.isclose(hidden(r), 1 - math.exp(-0.06 * math.pi * 6.25), rel_tol=1e-6),
    ),
    "crown_diameter": (
        [*STEMS, "--crown-diameter", "8"],
        lambda r, d: math.isclose(hidden(r), 1 - math.exp(-0.04 * math.pi * 16), rel_tol=1e-6),
    ),
    "leaf_area_index": (
        [*STEMS, "--leaf-area-index", "1e-6"],
        # With thin leaves, Beer-Lambert with G = 1/2 holds for any crowns.
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
        # Pixels are square, and there are half as many along the heading as across it.
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
    "within": (
        ["--optimize", "visibility", "--within", "2"],
        lambda r, d: "within" in r and r["flight"]["total_time_s"] <= 120.0,
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
    "grid": (
        ["--grid", "line", "--vhat", "0.9"],
        lambda r, d: r["grid"]["rows"] == 1 and r["samples"] == 10,
    ),
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
        ["--grid", "line", "--vhat", "0.9", "--line-length", "400"],
        lambda r, d: len(r["waypoints"]) == 143 and r["samples"] == 10,  # 142 legs of 2.8 m
    ),
    "area": (FIELD, lambda r, d: r.get("area", {}).get("covered_share") == 1.0),
    "around": (
        ["--around", str(AREAS / "spots.geojson")],
        lambda r, d: 620 < r.get("area", {}).get("area_m2", 0) < 640,
    ),
    "around_radius": (
        ["--around", str(AREAS / "spots.geojson"), "--around-radius", "5"],
        lambda r, d: 155 < r.get("area", {}).get("area_m2", 0) < 160,
    ),
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
        # Time of a leg from stop to stop. On short legs, the drone does not reach the speed of 5
        # m/s.
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
    "allow_no_common_ground": (
        ["--allow-no-common-ground", "--vhat", "0.999"],
        lambda r, d: r["samples"] == 1000 and min(r["camera"]["common_footprint_m"]) < 0,
    ),
    "sensitivity": (
        ["--sensitivity"],
        lambda r, d: r["sensitivity"] is not None and len(r["sensitivity"]) == 6,
    ),
    "drone": (
        ["--drone", "ardupilot-copter", "--camera", "dji-m3t-thermal"],
        lambda r, d: r["flight"].get("drone") == "ardupilot-copter" and r["request"]["speed"] == 10,
    ),
    "climb": (
        ["--climb", "1"],
        # The climb and the descent of 40 m each take h/v + v/a.
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
        # On northward legs, the ground speed is 15 - 14 = 1 m/s. The speed on other legs does not
        # change.
        lambda r, d: r["flight"]["time_s"] > d["flight"]["time_s"] + 10,
    ),
    "wind_from": (
        ["--wind-speed", "14", "--wind-from", "90"],
        # Along the lines, the ground speed can be √(15² - 14²) = 5.4 m/s, which is enough. Against
        # the wind, it is 1 m/s.
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
    "file_waypoints": (
        ["--file-waypoints", "500"],
        lambda r, d: r["flight"].get("file_waypoints") == 500,
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
    "transit_speed": (
        ["--transit-speed", "8", "--grid", "lanes", "--trigger", "distance"],
        lambda r, d: r["flight"]["transit_mps"] == 8.0 and d["flight"]["transit_mps"] == 5.0,
    ),
    "camera_control": (
        ["--autopilot", "px4", "--camera-control", "outputs"],
        lambda r, d: r["flight"].get("camera_control") == "outputs",
    ),
    "payload": (
        ["--payload", "dji-h20t"],
        lambda r, d: r["flight"].get("payload") == "dji-h20t",
    ),
}

CLOUD_ONLY = (
    "voxel",
    "ground",
    "min_height",
    "units",
    "crop",
    "opacity",
    "leaf_size",
    "trajectory",
    "crown_base",
    "view",
    "edges",
)
TERRAIN = ("terrain", "terrain_units", "terrain_tolerance")
"""These options are tested in test_terrain.py, because they need a terrain file."""

GAIN = ("order", "poa")
"""These options are tested in test_gain_order.py, because they need a prior."""


def test_every_option_has_its_effect_tested():
    assert {*EFFECTS, *CLOUD_ONLY, *TERRAIN, *GAIN} == {option.name for option in OPTIONS}


@pytest.fixture(scope="module")
def default():
    """The document of a plan whose only option is the altitude."""
    return loads(process("plan", "--altitude", "40", "--json").stdout)


@pytest.mark.parametrize("name", EFFECTS)
def test_each_option_has_its_expected_effect(document, default, name):
    arguments, holds = EFFECTS[name]
    altitude = (
        []
        if {"altitude", "gsd", "target_size", "target_pixels", "clearance"} & {name}
        else [
            "--altitude",
            "40",
        ]
    )
    result = document("plan", *altitude, *arguments)
    assert holds(result, default)
    assert not holds(default, default)


@pytest.mark.parametrize(
    ("flag", "value"),
    [("--voxel", "0.5"), ("--ground", "class"), ("--min-height", "1"), ("--units", "ft")],
)
def test_options_of_point_clouds_are_refused_for_other_scenes(command, flag, value):
    refused = command("plan", "--altitude", "40", flag, value)
    check_refusal(*refused)
    assert f"{flag} needs a point cloud" in refused[2]
