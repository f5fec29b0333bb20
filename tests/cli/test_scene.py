"""`scene` gives the statistics of a scene, and saves the scene."""

import math

import pytest
from support.command_line import check_refusal


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


def test_a_saved_scene_gives_the_same_plan_as_its_source(folder, document, command):
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


def test_a_scene_is_saved_under_every_given_name(folder, command):
    assert command("scene", "savanna", "--save", "a.toml", "--save", "b.toml", "--quiet")[0] == 0
    assert (folder / "a.toml").read_bytes() == (folder / "b.toml").read_bytes() != b""
    (folder / "b.toml").unlink()
    # The first file exists already, and the second is given twice.
    for again in ("a.toml", "./b.toml"):
        refused = command("scene", "paper-forest", "--save", "b.toml", "--save", again)
        check_refusal(*refused)
        assert not (folder / "b.toml").exists()
