"""Drones, cameras and formats of other distributions, and drones from files."""

import json
import re
import sys

import pytest
from support.paths import ROOT

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.flight.drones import DRONES
from aosplan.flight.find import find_drone

PLAN = ["plan", "--altitude", "40", "--origin", "48.3358,14.3261", "--quiet"]
PAGE = (ROOT / "docs/howto/extend.md").read_text(encoding="utf-8")


def blocks(kind):
    return re.findall(rf"^```{kind}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


@pytest.fixture
def distribution(tmp_path, monkeypatch):
    """The distribution of the how-to page, installed on Python's path."""
    folder = tmp_path / "site"
    (folder / "team_aos").mkdir(parents=True)
    init, site_list = blocks("py")
    (folder / "team_aos/__init__.py").write_text(init)
    (folder / "team_aos/site_list.py").write_text(site_list)
    points = re.sub(r'\[project.entry-points."(.*?)"\]', r"[\1]", blocks("toml")[1])
    info = folder / "team_aos-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: team-aos\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(points.replace('"', ""))
    monkeypatch.syspath_prepend(str(folder))
    yield info
    for name in [name for name in sys.modules if name.startswith("team_aos")]:
        del sys.modules[name]


def test_a_distribution_adds_a_drone_a_camera_and_a_format(distribution, tmp_path, capsys):
    outs = [tmp_path / "grid.sites", tmp_path / "grid.txt"]
    line = [*PLAN, "--drone", "team-hexa", "--json"]
    assert run([*line, "--out", str(outs[0]), "--out", f"team-list:{outs[1]}"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["request"]["camera"] == "team-lens"
    assert document["camera"]["gsd_m"] == pytest.approx(40 * 7.68 / 640 / 9.0)
    lines = outs[0].read_text().splitlines()
    assert outs[0].read_bytes() == outs[1].read_bytes()
    found = [float(word) for each in lines for word in each.split()]
    ways = [(way["latitude"], way["longitude"]) for way in document["waypoints"]]
    assert found == pytest.approx([degrees for pair in ways for degrees in pair], abs=1e-8)


def test_names_of_distributions_that_are_not_installed_are_unknown(tmp_path, capsys):
    assert run([*PLAN, "--drone", "team-hexa"]) == 2
    assert "unknown drone 'team-hexa'" in capsys.readouterr().err
    assert run([*PLAN, "--out", f"team-list:{tmp_path / 'x'}"]) == 2
    assert run([*PLAN, "--out", str(tmp_path / "x"), "--format", "team-list"]) == 2
    assert "unknown format 'team-list'" in capsys.readouterr().err


def test_a_broken_distribution_is_named(distribution, capsys):
    (distribution / "entry_points.txt").write_text("[aosplan.drones]\nteam-hexa = team_aos:GONE\n")
    assert run([*PLAN, "--drone", "team-hexa"]) == 2
    said = capsys.readouterr().err
    assert "'team-hexa' of aosplan.drones (team_aos:GONE) cannot be loaded" in said
    assert "Traceback" not in said


def test_the_drone_file_in_the_how_to_page_can_be_used(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    path.write_text(blocks("toml")[0])
    drone = find_drone(str(path))
    assert (drone.speed_mps, drone.autopilot) == (6.0, "ardupilot")
    out = tmp_path / "g.waypoints"
    assert run([*PLAN, "--drone", str(path), "--out", str(out), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["request"]["camera"] == "flir-vue-pro-640-9mm"
    assert document["request"]["speed"] == 6.0
    assert out.exists()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("photo_interval_s = 1.0", "photo_s = 1.0", "unknown name 'photo_s'"),
        ("climb_mps = 2.0", "climb_mps = -2.0", "climb_mps"),
        ('autopilot = "ardupilot"', 'autopilot = "hal"', "autopilot"),
        ("airspeed_mps = 14.0", "", "airspeed_mps"),
    ],
)
def test_a_drone_file_with_a_fault_is_refused(tmp_path, old, new, words):
    path = tmp_path / "mine.toml"
    path.write_text(blocks("toml")[0].replace(old, new))
    with pytest.raises(RequestError) as caught:
        find_drone(str(path))
    assert words in caught.value.message


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        (["--camera", "dji-m3t"], "did you mean dji-m3t-thermal or dji-m3t-wide?"),
        (["--drone", "mavic3t"], "did you mean dji-m3t?"),
        (["--drone", "Mini 4 Pro"], "did you mean dji-mini-4-pro?"),
        (["--drone", "dji-phantom4pro"], "did you mean dji-phantom-4-pro?"),
        (["--origin", "47.15", "11.35"], "--origin LAT,11.35"),
    ],
)
def test_likely_mistakes_in_names_give_a_hint(line, hint, capsys):
    assert run(["plan", "--altitude", "40", *line]) == 2
    assert hint in capsys.readouterr().err


def test_built_in_names_read_no_metadata(monkeypatch):
    monkeypatch.setitem(sys.modules, "importlib.metadata", None)
    assert all(find_drone(name) is DRONES[name] for name in DRONES)
