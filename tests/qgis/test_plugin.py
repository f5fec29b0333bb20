"""The QGIS plugin makes the same plans as the command line."""

import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from functools import cache
from pathlib import Path

import pytest

import aosplan

ROOT = Path(__file__).parents[2]
FIELD = ROOT / "examples" / "field.geojson"
PACKAGE = ROOT / "qgis" / "package.py"


@cache
def python_of_qgis():
    """The Python interpreter with QGIS: the interpreter that the variable QGIS_PYTHON names, or
    else Debian's.
    """
    candidate = os.environ.get("QGIS_PYTHON", "/usr/bin/python3")
    if shutil.which(candidate) is None:
        return None
    found = subprocess.run([candidate, "-c", "import qgis.core"], capture_output=True, check=False)
    return candidate if found.returncode == 0 else None


@pytest.fixture(scope="module")
def plugin(tmp_path_factory):
    """The packaged plugin."""
    folder = tmp_path_factory.mktemp("plugin")
    subprocess.run([sys.executable, PACKAGE, folder], check=True, capture_output=True)
    return folder / "aosplan_qgis.zip"


@pytest.fixture
def run(plugin):
    """Run the plugin's algorithm in QGIS."""
    if python_of_qgis() is None:
        pytest.skip("no QGIS")

    def result(**parameters):
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        made = subprocess.run(
            [
                python_of_qgis(),
                Path(__file__).with_name("run_plugin.py"),
                plugin,
                json.dumps(parameters),
            ],
            env=os.environ
            | {"QT_QPA_PLATFORM": "offscreen", "PATH": path, "PYTHONPATH": "/unused"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert made.returncode == 0, made.stderr
        return json.loads(made.stdout.splitlines()[-1])

    return result


def planned(*arguments):
    command = [sys.executable, "-m", "aosplan", "plan", *map(str, arguments), "--json"]
    return json.loads(subprocess.run(command, capture_output=True, check=True).stdout)


def test_the_zip_has_the_version_of_the_package_and_the_same_bytes_each_time(plugin, tmp_path):
    subprocess.run([sys.executable, PACKAGE, tmp_path], check=True, capture_output=True)
    assert (tmp_path / plugin.name).read_bytes() == plugin.read_bytes()
    with zipfile.ZipFile(plugin) as archive:
        assert {Path(name).parent.name for name in archive.namelist()} == {"aosplan_qgis"}
        metadata = archive.read("aosplan_qgis/metadata.txt").decode()
    assert re.search(r"^version=(.*)$", metadata, re.MULTILINE)[1] == aosplan.__version__


@pytest.mark.slow
def test_layers_are_those_of_the_plan_over_an_area(run, tmp_path):
    made = run(
        AREA=str(FIELD),
        ALTITUDE="40",
        VHAT=0.9,
        DRONE="dji-m3t",
        HEADING="30",
        FIND="person",
        SITES="memory:",
        PATH="memory:",
        FOOTPRINTS="memory:",
        DETECTION=str(tmp_path / "pod.tif"),
        MISSION=str(tmp_path / "m.csv"),
        REPORT=str(tmp_path / "r.html"),
    )
    plan = planned(
        "--area",
        FIELD,
        "--altitude",
        40,
        "--vhat",
        0.9,
        "--drone",
        "dji-m3t",
        "--heading",
        30,
        "--find",
        "person",
    )
    assert made["parameters"]["DRONE"] == "enum"
    assert len(made["SITES"]) == len(plan["waypoints"])
    for site, waypoint in zip(made["SITES"], plan["waypoints"], strict=True):
        place = (waypoint["longitude"], waypoint["latitude"], waypoint["altitude_m"])
        assert site["shape"]["coordinates"] == pytest.approx(place, abs=1e-11)
        assert site["index"] == waypoint["index"]
    flights = plan["flight"]["flights"]
    assert [line["photos"] for line in made["PATH"]] == [flight["samples"] for flight in flights]
    assert made["SITES"][flights[0]["last"]]["flight"] == 1
    assert made["SITES"][flights[1]["first"]]["flight"] == 2
    along, across = plan["camera"]["footprint_m"]
    for footprint in made["FOOTPRINTS"]:
        assert footprint["area_m2"] == pytest.approx(along * across, rel=1e-5)
    # The first side of the footprint is across the flight lines, from left to right. The flight
    # lines point 30° east of north.
    west, south = made["FOOTPRINTS"][0]["shape"]["coordinates"][0][0]
    east, right = made["FOOTPRINTS"][0]["shape"]["coordinates"][0][3]
    assert east > west
    assert right < south
    assert (tmp_path / "pod.tif").exists()
    assert (tmp_path / "r.html").exists()
    assert len(list(tmp_path.glob("m-*.csv"))) == len(flights)
    for warning in plan["warnings"]:
        assert f"warning: {warning['message']}" in made["log"]


@pytest.mark.slow
def test_an_error_is_the_text_of_the_program(run):
    made = run(ORIGIN="14.3,48.3 [EPSG:4326]", ALTITUDE="-4", SITES="memory:", PATH="memory:")
    assert made["error"].startswith("error: --altitude '-4' is not above zero")
    assert "SITES" not in made


@pytest.mark.slow
def test_turns_are_on_the_path_but_are_not_sites(run):
    made = run(
        ORIGIN="14.3,48.3 [EPSG:4326]",
        VHAT=0.9,
        OPTIONS="--trigger distance",
        SITES="memory:",
        PATH="memory:",
        FOOTPRINTS="memory:",
    )
    plan = planned(
        "--origin", "48.3,14.3", "--altitude", 40, "--vhat", 0.9, "--trigger", "distance"
    )
    photos = [waypoint["index"] for waypoint in plan["waypoints"] if waypoint["photo"]]
    assert [site["index"] for site in made["SITES"]] == photos
    assert [footprint["index"] for footprint in made["FOOTPRINTS"]] == photos
    assert len(made["PATH"][0]["shape"]["coordinates"]) == len(plan["waypoints"]) > len(photos)
