"""`cameras`, `scenes` and `formats` list every preset, and every preset can be used in a plan."""

import pytest

from aosplan.camera.presets import CAMERAS
from aosplan.scenes.presets import SCENES


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


def test_a_plan_can_be_computed_with_every_camera_and_scene(document):
    for camera in CAMERAS:
        assert document("plan", "--altitude=90", f"--camera={camera}")["camera"]["name"] == camera
    for scene in SCENES:
        assert document("plan", "--altitude=90", f"--scene={scene}")["scene"]["name"] == scene


@pytest.mark.parametrize(
    ("word", "names"),
    [
        ("spruce", {"conifer-forest", "dense-forest"}),
        ("Picea", {"conifer-forest", "dense-forest"}),
        ("beech", {"broadleaf-forest", "broadleaf-leafless"}),
        ("winter", {"broadleaf-leafless"}),
        ("rainforest", {"tropical-forest"}),
        ("pine", {"open-woodland", "boreal-pine", "plantation", "mixed-forest"}),
    ],
)
def test_scenes_are_found_by_species_and_kind(document, command, word, names):
    assert {scene["name"] for scene in document("scenes", word)} == names
    status, _, err = command("plan", "--altitude", "60", "--scene", word)
    assert status == 2
    assert names & set(err.splitlines()[1].rstrip("?").split())


def test_search_words_without_a_matching_scene_are_refused(command):
    status, out, err = command("scenes", "desert")
    assert (status, out) == (2, "")
    assert "no built-in scene is of the species or type 'desert'" in err
