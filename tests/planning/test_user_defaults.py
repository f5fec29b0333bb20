"""The user's own defaults: tests of the values that are used, and of options that override them."""

import json
import os
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.flight.drones import DRONES
from aosplan.planning.option_relations import IS_THE_ONLY, RELATIONS
from aosplan.planning.request import PlanRequest, request_from
from aosplan.planning.user_defaults import find_defaults, usual_path

MINE = 'drone = "dji-m30t"\naltitude = 50\ntakeoff = [48.0, 14.0]\nhold = 2\n'


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty folder as the current one and as the user's home."""
    monkeypatch.chdir(tmp_path)
    for name in ("XDG_CONFIG_HOME", "AOSPLAN_DEFAULTS", "APPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path


@pytest.fixture
def mine(folder):
    """The file with the user's own defaults, at its usual place."""
    path = folder / ".config" / "aosplan" / "defaults.toml"
    path.parent.mkdir(parents=True)
    path.write_text(MINE)
    return path


@pytest.fixture
def request_of(capsys):
    """A function that plans with --json and returns the request."""

    def execute(*arguments):
        status = run(["plan", *map(str, arguments), "--json"])
        out, err = capsys.readouterr()
        assert status == 0, err
        return json.loads(out)["request"]

    return execute


def refused(capsys, *arguments):
    assert run(["plan", *map(str, arguments)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    return err


# The place of the file


@pytest.mark.parametrize(
    ("environment", "platform", "path"),
    [
        ({"HOME": "/u"}, "linux", "/u/.config/aosplan/defaults.toml"),
        ({"HOME": "/u"}, "darwin", "/u/.config/aosplan/defaults.toml"),
        ({"HOME": "/u", "XDG_CONFIG_HOME": "/c"}, "linux", "/c/aosplan/defaults.toml"),
        ({"HOME": "/u", "XDG_CONFIG_HOME": "rel"}, "linux", "/u/.config/aosplan/defaults.toml"),
        ({"HOME": "/u", "XDG_CONFIG_HOME": ""}, "linux", "/u/.config/aosplan/defaults.toml"),
        ({"APPDATA": "/a", "HOME": "/u"}, "win32", "/a/aosplan/defaults.toml"),
        ({}, "linux", ""),
        ({}, "win32", ""),
    ],
)
def test_the_usual_place(environment, platform, path):
    assert usual_path(environment, platform) == path


def test_without_a_file_of_defaults_no_defaults_are_taken(request_of):
    assert (
        request_of("--altitude", 40)
        == PlanRequest(altitude=40, model="uniform", rays="nadir").document()
    )


def test_with_user_defaults_a_plan_needs_one_short_command(mine, request_of):
    found = request_of("--origin", "48,14")
    assert found["drone"] == "dji-m30t"
    assert found["camera"] == "dji-m30t-thermal"
    assert found["altitude"] == 50
    assert found["takeoff"] == [48.0, 14.0]
    assert (found["hold"], found["speed"]) == (2, DRONES["dji-m30t"].speed_mps)


def test_a_named_defaults_file_is_used_before_the_usual_one(mine, folder, request_of, monkeypatch):
    (folder / "a.toml").write_text("altitude = 31\n")
    (folder / "b.toml").write_text("altitude = 32\n")
    monkeypatch.setenv("AOSPLAN_DEFAULTS", "a.toml")
    assert request_of()["altitude"] == 31
    assert request_of("--defaults", "b.toml")["altitude"] == 32
    monkeypatch.setenv("AOSPLAN_DEFAULTS", "none")
    assert "drone" not in request_of("--altitude", 40)
    monkeypatch.delenv("AOSPLAN_DEFAULTS")
    assert "drone" not in request_of("--altitude", 40, "--defaults", "none")


def test_a_named_file_that_is_not_there_is_an_error(capsys, monkeypatch):
    assert "--defaults: there is no file 'x.toml'" in refused(
        capsys, "--altitude", 40, "--defaults=x.toml"
    )
    monkeypatch.setenv("AOSPLAN_DEFAULTS", "y.toml")
    assert "AOSPLAN_DEFAULTS: there is no file 'y.toml'" in refused(capsys, "--altitude", 40)
    monkeypatch.setenv("AOSPLAN_DEFAULTS", "")
    with pytest.raises(RequestError):
        find_defaults(None)


# Overriding


@pytest.mark.parametrize(
    ("arguments", "name", "gone"),
    [
        (("--gsd", "0.08"), "gsd", ("altitude",)),
        (("--target-size", "2", "--target-pixels", "20"), "target_size", ("altitude",)),
        (("--visibility", "0.6"), "visibility", ("vhat",)),
        (("--fov", "60", "--image-width", "640", "--image-height", "512"), "fov", ("camera",)),
        (
            ("--density", "0.01", "--occluder-size", "0.2", "--volume-height", "9"),
            "density",
            ("scene",),
        ),
    ],
)
def test_a_flag_replaces_the_whole_alternative(folder, request_of, arguments, name, gone):
    (folder / "d.toml").write_text(
        'altitude = 50\nvhat = 0.9\ncamera = "dji-m3t-wide"\nscene = "savanna"\n'
    )
    found = request_of("--defaults", "d.toml", *arguments)
    assert name in found
    assert not {*gone} & set(found)


def test_a_drone_on_the_line_brings_its_own_camera_and_speeds(folder, request_of):
    (folder / "d.toml").write_text(
        'altitude = 50\ndrone = "dji-m30t"\ncamera = "dji-m30t-wide"\nspeed = 3\nclimb = 1\n'
    )
    mine = request_of("--defaults", "d.toml")
    assert (mine["camera"], mine["speed"], mine["climb"]) == ("dji-m30t-wide", 3, 1)
    other = request_of("--defaults", "d.toml", "--drone", "dji-m3e")
    assert (other["camera"], other["speed"]) == ("dji-m3e-wide", DRONES["dji-m3e"].speed_mps)
    both = request_of("--defaults", "d.toml", "--drone", "dji-m3e", "--speed", "4")
    assert both["speed"] == 4


def test_a_request_file_overrides_defaults_and_flags_override_both(mine, folder, request_of):
    (folder / "r.toml").write_text("altitude = 60\nhold = 3\n")
    assert request_of("r.toml")["altitude"] == 60
    assert request_of("r.toml")["drone"] == "dji-m30t"
    assert request_of("r.toml", "--hold", "4")["hold"] == 4


@pytest.mark.parametrize("whole", [True, False])
def test_an_earlier_result_uses_no_user_defaults(mine, folder, capsys, whole):
    line = ["plan", "--altitude", "40", "--defaults", "none", "--json"]
    assert run(line) == 0
    first = json.loads(capsys.readouterr().out)
    (folder / "p.json").write_text(json.dumps(first if whole else first["request"]))
    assert run(["plan", "p.json", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == first


def test_defaults_that_do_not_apply_are_left_out(folder, request_of):
    (folder / "d.toml").write_text(
        'altitude = 50\ntakeoff = [48, 14]\nterrain = "none.tif"\nterrain_tolerance = 2\n'
        "exposure_time = 0.02\nmax_blur = 2\nlanes = 4\nlane_pitch = 3\n"
    )
    plain = request_of("--defaults", "d.toml")
    assert not {"takeoff", "terrain", "exposure_time", "max_blur", "lanes"} & set(plain)
    passing = request_of("--defaults", "d.toml", "--trigger", "distance", "--grid", "lanes")
    assert (passing["max_blur"], passing["exposure_time"], passing["lanes"]) == (2, 0.02, 4)


def test_files_named_in_defaults_are_found_beside_them(folder, request_of):
    (folder / "sub").mkdir()
    camera = {"focal_length_mm": 9.1, "sensor_width_mm": 7.68, "sensor_height_mm": 6.144}
    camera |= {"name": "mine", "image_width_px": 640, "image_height_px": 512}
    (folder / "sub" / "cam.json").write_text(json.dumps(camera))
    (folder / "sub" / "d.toml").write_text('altitude = 50\ncamera = "cam.json"\n')
    assert request_of("--defaults", "sub/d.toml")["camera"] == str(folder / "sub" / "cam.json")


# Errors in the file


@pytest.mark.parametrize(
    "text",
    [
        "altitude = 50\ngsd = 0.1\n",
        'scene = "savanna"\ndensity = 0.1\n',
        "volume_height = 3\n",
        'drone = "dji-m3"\n',
        "speed = -1\n",
        'altitude = "high"\n',
        "takeof = [48, 14]\n",
        "takeoff = [148, 14]\n",
        "[aosplan]\naltitude = 3\n",
        "altitude = \n",
        "speed = nan\n",
    ],
)
def test_errors_name_the_file(folder, capsys, text):
    (folder / "d.toml").write_text(text)
    err = refused(capsys, "--altitude", 40, "--defaults", "d.toml", "--origin", "48,14")
    assert "d.toml" in err.splitlines()[0]


def test_a_folder_in_place_of_a_file_is_refused(folder, capsys):
    assert "no file" in refused(capsys, "--altitude", 40, "--defaults", ".")


# Cost


def test_without_a_defaults_file_only_one_path_is_checked(folder):
    code = (
        "import sys\n"
        "looks = []\n"
        "sys.addaudithook(lambda event, args: looks.append(args[0]) if event == 'open' else None)\n"
        "from aosplan.cli.app import run\n"
        "assert run(['plan', '--altitude', '40', '--quiet']) == 0\n"
        "print([l for l in looks if 'defaults.toml' in str(l)], 'pydantic' in sys.modules,\n"
        "      'tomllib' in sys.modules)\n"
    )
    clean = {k: v for k, v in os.environ.items() if k != "AOSPLAN_DEFAULTS"} | {"HOME": str(folder)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=clean, capture_output=True, text=True, check=True
    )
    assert done.stdout == "[] False False\n"


# Several layers of values

VALUES = {
    "altitude": 40.0,
    "gsd": 0.05,
    "vhat": 0.9,
    "visibility": 0.5,
    "scene": "savanna",
    "camera": "dji-m3t-wide",
    "drone": "dji-m3e",
    "speed": 3.0,
    "hold": 2.0,
    "trigger": "distance",
    "max_blur": 2.0,
    "grid": "lanes",
    "lanes": 4,
    "origin": (48.0, 14.0),
    "takeoff": (48.0, 14.0),
    "flight_time": 20.0,
}
layers = st.sets(st.sampled_from(sorted(VALUES)))


def consistent(names):
    same = ({each.option for each in rule.given} for rule in RELATIONS if rule.verb == IS_THE_ONLY)
    if any(len(names & options) > 1 for options in same):
        return False
    try:
        PlanRequest(
            **({"altitude": 40} if "gsd" not in names else {}) | {n: VALUES[n] for n in names}
        )
    except RequestError:
        return False
    return True


@given(own=layers, asked=layers)
def test_user_defaults_never_contradict_the_requested_options(own, asked):
    asked = {name: VALUES[name] for name in asked}
    if not consistent(set(asked)) or not consistent(own):
        return
    own = {name: VALUES[name] for name in own}
    if not {"altitude", "gsd"} & {*own, *asked}:
        asked["altitude"] = 40.0
    found = request_from({}, overrides=asked, defaults=own, defaults_where="d.toml")
    for name, value in asked.items():
        assert getattr(found, name) == value
    alone = {n for n in own if n not in asked and getattr(found, n) != own[n]}
    # A default is not used if it contradicts an option, or if it needs another option that is not
    # given.
    contradicted = {"altitude", "gsd", "vhat", "visibility", "camera", "speed", "flight_time"}
    unpaired = {"takeoff", "max_blur", "lanes"}
    assert alone <= contradicted | unpaired
