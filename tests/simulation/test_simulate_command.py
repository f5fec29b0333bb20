"""``aosplan simulate`` on the command line: documents, pictures, and refusals."""

import io
import json
import sys
from functools import partial

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from PIL import Image
from support.paths import CLOUDS

from aosplan.cli.app import run
from aosplan.cli.schema import json_schema

pytestmark = pytest.mark.usefixtures("folder")

QUICK = ["--altitude", "60", "--vhat", "0.85", "--density", "0.05"]
QUICK += ["--occluder-size", "0.5", "--volume-height", "8", "--samples", "9", "--baseline", "16"]
COARSE = ["--precision", "0.1"]


@pytest.fixture
def command(command):
    """A function that runs the command and returns its status, stdout and stderr."""
    return partial(command, "simulate", *QUICK, *COARSE)


def test_the_document_contains_the_plan_and_its_simulation(command, capsys):
    status, out, err = command("--json", "--seed", "7")
    assert (status, err) == (0, "")
    document = json.loads(out)
    Draft202012Validator(json_schema("simulation")).validate(document)
    Draft202012Validator(json_schema("plan")).validate(document)
    assert run(["plan", *QUICK, "--json"]) == 0
    planned = json.loads(capsys.readouterr().out)
    assert {name: document[name] for name in planned} == planned
    assert document["seed"] == 7
    assert document["views"] == document["samples"] == 9
    assert document["targets"] > 1000
    assert document["agree"] is True
    assert document["view"] == "perspective"
    assert set(document["predicted"]) == {"density", "expected", "normalized"}
    assert len(document["simulated"]) == 6


def test_a_document_is_the_same_each_time_and_plans_the_same_again(command, folder):
    _, out, _ = command("--json")
    assert command("--json")[1] == out
    assert command("--json", "--seed", "2")[1] != out
    (folder / "again.json").write_text(out)
    assert command("again.json", "--json")[1] == out


def test_every_option_has_an_effect(command):
    base = json.loads(command("--json")[1])
    for arguments, name in (
        (("--view", "telecentric"), "view"),
        (("--forest", "noise"), "forest"),
        (("--seed", "3"), "seed"),
        (("--precision", "0.01"), "precision"),
    ):
        changed = json.loads(command("--json", *arguments)[1])
        assert changed[name] != base[name]
        assert changed["simulated"] != base["simulated"] or name == "precision"
    fine = ("--forest", "noise", "--precision", "0.002", "--json")
    free = json.loads(command(*fine)[1])
    status, out, err = command(*fine, "--max-targets", "2000000")
    assert json.loads(out)["targets"] <= 2_000_000 < free["targets"]
    assert status == 0
    assert err.startswith("warning: the simulation stopped after ")
    assert "the standard errors are still above 0.002" in " ".join(err.split())


def test_the_table_shows_planned_predicted_and_simulated_values(command):
    status, out, err = command()
    assert (status, err) == (0, "")
    assert "planned" in out
    assert "Predicted and simulated agree." in out
    assert max(map(len, out.splitlines())) <= 80
    status, out, _ = command("--forest", "clumped", "--precision", "0.01")
    assert status == 0
    assert "Predicted and simulated disagree:" in out
    assert command("--quiet")[1:] == ("", "")


def test_pictures_are_written_with_their_similarity(command, folder):
    arguments = ("--picture", "a.png", "--occlusion-map", "b.png", "--json")
    status, out, _ = command(*arguments)
    assert status == 0
    similarity = json.loads(out)["similarity"]
    assert 0 < similarity["single"] < similarity["integral"] < 1
    panels, seen = (np.asarray(Image.open(folder / name)) for name in ("a.png", "b.png"))
    assert panels.shape == (seen.shape[0], 3 * seen.shape[1] + 8, 3)
    first = (folder / "a.png").read_bytes()
    status, _, err = command(*arguments)
    assert status == 2
    assert err.startswith("error: output 'a.png' exists")
    assert command(*arguments, "--force")[0] == 0
    assert (folder / "a.png").read_bytes() == first


REFUSED = [
    (("--seed", "-1"), "--seed -1 is not a whole number"),
    (("--seed", "1.5"), "--seed 1.5 is not a whole number"),
    (("--seed", "9" * 30), "is not a whole number from 0"),
    (("--seed", "²"), "is not a whole number"),
    (("--precision", "0"), "--precision"),
    (("--precision", "nan"), "--precision"),
    (("--precision", "2"), "--precision 2"),
    (("--forest", "jungle"), "--forest"),
    (("--forest", "cloud"), "--forest cloud needs the voxels"),
    (("--max-targets", "0"), "--max-targets"),
    (("--view", "sideways"), "--view"),
    (("--picture", "a.jpg"), "'a.jpg' does not end in .png"),
    (("--picture", "none/a.png"), "there is no folder 'none'"),
    (("--picture", "a.png", "--occlusion-map", "./a.png"), "given twice"),
    (("--baseline", "60"), "no ground is in all photos"),
    (("--samples", "20000", "--baseline", "0.01"), "20000 samples"),
    (("--hold-error", "0.5"), "--hold-error 0.5"),
    (("--rays", "oblique"), "--rays oblique"),
]


@pytest.mark.parametrize(("arguments", "words"), REFUSED, ids=lambda value: str(value)[:40])
def test_wrong_simulate_options_give_one_error_line_and_no_files(command, folder, arguments, words):
    status, out, err = command(*arguments)
    assert (status, out) == (2, "")
    lines = [line for line in err.splitlines() if not line.startswith("warning: ")]
    assert lines[0].startswith("error: ")
    assert words in lines[0]
    assert len(lines) <= 2
    assert list(folder.iterdir()) == []


def test_without_the_extra_nothing_is_simulated_for_a_picture(command, monkeypatch):
    monkeypatch.setattr("aosplan.simulation.pictures.EXTRA_MODULES", ("no_such_module",))
    status, out, err = command("--picture", "a.png")
    assert (status, out) == (2, "")
    assert 'hint: pip install "aosplan[pictures]"' in err


def test_an_interruption_leaves_no_files(command, folder, monkeypatch):
    def interrupted(*_arguments, **_options):
        raise KeyboardInterrupt

    monkeypatch.setattr("aosplan.simulation.pictures.png", interrupted)
    status, out, _ = command("--picture", "a.png", "--json")
    assert (status, out) == (130, "")
    assert list(folder.iterdir()) == []


def test_progress_is_shown_on_a_terminal_only(command, monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    terminal = Terminal()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", terminal)
    status, out, _ = command("--forest", "noise", "--precision", "0.003")
    assert status == 0
    assert "simulating" in terminal.getvalue()
    assert "Predicted and simulated agree." in out


def test_bare_ground_can_be_simulated(command):
    status, out, _ = command("--density", "0", "--json")
    document = json.loads(out)
    assert status == 0
    Draft202012Validator(json_schema("simulation")).validate(document)
    assert document["agree"] is True
    assert document["simulated"]["normalized"] is None
    assert command("--density", "0")[0] == 0


CLOUD = CLOUDS / "UAS_Clip.laz"


@pytest.mark.skipif(not CLOUD.exists(), reason="the cloud is not at hand")
@pytest.mark.slow
def test_a_cloud_is_simulated_with_its_own_voxels(capsys):
    line = ["simulate", "--altitude", "50", "--scene", str(CLOUD), "--samples", "49"]
    line += ["--baseline", "3.5", "--min-height", "0.5", "--opacity", "voxels", "--json"]
    found = {}
    for view in ("telecentric", "perspective"):
        assert run([*line, "--view", view]) == 0
        found[view] = json.loads(capsys.readouterr().out)
        assert found[view]["agree"] is True
    # The known values in section 4.3 of the derivation.
    assert found["telecentric"]["simulated"]["expected"] == pytest.approx(0.2923, abs=0.003)
    assert found["telecentric"]["simulated"]["normalized"] == pytest.approx(0.820, abs=0.005)
    assert found["perspective"]["simulated"]["expected"] == pytest.approx(0.185, abs=0.003)
    assert found["perspective"]["simulated"]["normalized"] == pytest.approx(0.910, abs=0.005)
