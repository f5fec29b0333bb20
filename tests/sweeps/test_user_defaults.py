"""The user's own defaults are used in sweeps, in which scenarios override them, and in
trade-offs.
"""

import json
import os

import pytest

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.planning.request import request_from
from aosplan.sweeps.grouping import scenario
from aosplan.sweeps.scenarios import ScenarioProduct, ScenarioTable, column_of
from aosplan.sweeps.user_defaults import with_defaults

pytest.importorskip("polars")

DEFAULTS = 'altitude = 50\ndrone = "dji-m30t"\nspeed = 3\n'


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("AOSPLAN_DEFAULTS", raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "settings"))
    (tmp_path / "settings" / "aosplan").mkdir(parents=True)
    return tmp_path


@pytest.fixture
def mine(folder):
    path = folder / "settings" / "aosplan" / "defaults.toml"
    path.write_text(DEFAULTS)
    return path


def rows_of(*arguments):
    assert run(["sweep", *arguments, "--out", "r.jsonl", "--force", "--quiet"]) == 0
    with open("r.jsonl", encoding="utf-8") as lines:
        return [json.loads(line) for line in lines]


@pytest.mark.usefixtures("mine")
def test_a_sweep_takes_the_defaults_of_options_that_it_does_not_name(folder):
    (folder / "s.toml").write_text("[sweep]\nvhat = [0.5, 0.8]\n")
    rows = rows_of("s.toml")
    assert [(row["altitude"], row["drone"], row["speed"]) for row in rows] == [
        (50.0, "dji-m30t", 3.0)
    ] * 2
    (folder / "other.toml").write_text("altitude = 70\n")
    assert [row["altitude"] for row in rows_of("s.toml", "--defaults", "other.toml")] == [70.0] * 2
    assert run(["sweep", "s.toml", "--defaults", "none", "--out", "n.csv", "--quiet"]) == 0
    assert "no altitude is given" in (folder / "n.csv").read_text()


@pytest.mark.usefixtures("mine")
def test_a_row_has_the_numbers_of_plan(folder, capsys):
    (folder / "s.toml").write_text("[sweep]\ngsd = [0.05, 0.06]\nvhat = 0.8\n")
    for row in rows_of("s.toml"):
        assert run(["plan", "--gsd", str(row["gsd"]), "--vhat", "0.8", "--json"]) == 0
        planned = json.loads(capsys.readouterr().out)
        assert row["flight_time_s"] == pytest.approx(planned["flight"]["time_s"], rel=1e-12)
        assert row["camera_gsd_m"] == pytest.approx(planned["camera"]["gsd_m"], rel=1e-12)
        assert "altitude" not in row


@pytest.mark.usefixtures("mine")
def test_a_trade_off_uses_defaults_as_plan_does(capsys):
    for line in (["tradeoff", "--max-samples", "9"], ["plan"]):
        assert run([*line, "--vhat", "0.8", "--json"]) == 0
        request = json.loads(capsys.readouterr().out)["request"]
        assert (request["altitude"], request["drone"], request["speed"]) == (50.0, "dji-m30t", 3.0)
    assert run(["tradeoff", "--vhat", "0.8", "--defaults", "none"]) == 2
    assert "no altitude is given" in capsys.readouterr().err


OWN = {
    "altitude": 50.0,
    "camera": "dji-h20t-thermal",
    "lanes": 5,
    "grid": "lanes",
    "speed": 4.0,
    "density": 0.01,
    "occluder_size": 0.3,
    "volume_height": 12.0,
}
ROWS = [
    {"vhat": 0.8},
    {"vhat": 0.8, "altitude": 60.0},
    {"gsd": 0.05},
    {"grid": "square"},
    {"grid": "lanes", "drone": "dji-m30t"},
    {"scene": "conifer-forest"},
    {"fov": 50.0, "image_width": 640, "image_height": 512},
    {"vhat": 0.8, "altitude": 61.0},
    {"target_size": 0.5, "target_pixels": 10.0, "speed": 9.0},
]


def test_every_row_of_a_table_is_the_request_that_plan_would_make():
    names = list(dict.fromkeys(name for row in ROWS for name in row))
    table = ScenarioTable({name: column_of([row.get(name) for row in ROWS]) for name in names})
    filled = with_defaults(table, OWN, "d.toml")
    for place, row in enumerate(ROWS):
        expected = request_from(row, defaults=OWN)
        found = {
            name: value for name, value in scenario(filled, place).items() if value is not None
        }
        assert request_from(found) == expected


@pytest.mark.parametrize("row", ROWS)
def test_every_row_of_a_crossing_is_the_request_that_plan_would_make(row):
    crossing = ScenarioProduct({name: column_of([value]) for name, value in row.items()})
    filled = with_defaults(crossing, OWN, "d.toml")
    assert filled.rows == 1
    assert request_from(scenario(filled, 0)) == request_from(row, defaults=OWN)


def test_defaults_that_go_with_some_rows_of_a_crossing_are_refused():
    crossing = ScenarioProduct({"grid": column_of(["trimmed", "lanes"])})
    with pytest.raises(
        RequestError, match=r"'d.toml': lanes cannot be combined with all values of grid"
    ) as caught:
        with_defaults(crossing, OWN, "d.toml")
    assert "--defaults none" in caught.value.hint


def test_wrong_defaults_are_errors(folder, capsys):
    (folder / "s.toml").write_text("[sweep]\naltitude = 40\n")
    (folder / "d.toml").write_text("altitude = 50\ngsd = 0.05\n")
    line = ["sweep", "s.toml", "--out", "r.csv", "--defaults"]
    assert run([*line, "d.toml"]) == 2
    assert "error: 'd.toml': " in capsys.readouterr().err
    assert run([*line, "missing.toml"]) == 2
    assert "--defaults: there is no file 'missing.toml'" in capsys.readouterr().err
    assert "r.csv" not in os.listdir()
