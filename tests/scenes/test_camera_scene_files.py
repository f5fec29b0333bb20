"""Camera and scene files: valid files are read, and errors give their place."""

import copy
import json
import math

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st
from support.tables import CAMERA, LAYER, LAYERED, UNIFORM, read_scene, refusal

from aosplan.camera.camera_file import read_camera
from aosplan.camera.presets import CAMERAS, find_camera
from aosplan.cli.app import run
from aosplan.scenes.files.scene_schema import SceneDocument
from aosplan.scenes.files.toml_file import is_sound
from aosplan.scenes.presets import SCENES, find_preset_scene
from aosplan.scenes.scene import LayeredScene, UniformScene

# Cameras


def test_a_camera_file_is_a_camera(written):
    camera = read_camera(written(CAMERA))
    assert {name: getattr(camera, name) for name in CAMERA} == CAMERA
    assert camera.focal_length_px == pytest.approx(9.1 * 640 / 7.68)


@pytest.mark.parametrize("word", ["title", "source", "assumed"])
def test_a_camera_file_may_name_its_source(written, word):
    assert getattr(read_camera(written(CAMERA | {word: "a datasheet"})), word) == "a datasheet"


@pytest.mark.parametrize("name", CAMERA)
def test_a_missing_name_of_a_camera_is_named(written, name):
    path = written({key: value for key, value in CAMERA.items() if key != name})
    assert refusal(read_camera, path).message == f"'{path}': {name}: field required"


@pytest.mark.parametrize("name", CAMERA)
@pytest.mark.parametrize("value", [[1], {"a": 1}, "wide" * 20])
def test_a_wrong_type_in_a_camera_is_named(written, name, value):
    if name == "name" and isinstance(value, str):
        pytest.skip("text is a name")
    error = refusal(read_camera, written(CAMERA | {name: value}))
    assert name in error.message


@pytest.mark.parametrize("name", [name for name in CAMERA if name != "name"])
@pytest.mark.parametrize("value", [0, -1, 10**400], ids=["0", "-1", "401 digits"])
def test_a_camera_has_positive_numbers(written, name, value):
    error = refusal(read_camera, written(CAMERA | {name: value}))
    assert name in error.message


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_camera_in_toml_has_finite_numbers(tmp_path, value):
    path = tmp_path / "c.toml"
    path.write_text(tomli_w.dumps(CAMERA | {"focal_length_mm": value}))
    assert "focal_length_mm" in refusal(read_camera, str(path)).message


def test_a_width_of_half_a_pixel_is_refused(written):
    assert (
        "image_width_px" in refusal(read_camera, written(CAMERA | {"image_width_px": 0.5})).message
    )


def test_an_unknown_name_in_a_camera_gets_the_nearest(written):
    path = written(CAMERA | {"focal_lenght_mm": 9})
    error = refusal(read_camera, path)
    assert error.message == f"'{path}': unknown name 'focal_lenght_mm'"
    assert error.hint == "did you mean focal_length_mm?"


@pytest.mark.parametrize("name", CAMERAS)
def test_presets_written_as_files_are_the_same_cameras(written, name):
    preset = find_camera(name)
    table = {key: getattr(preset, key) for key in (*CAMERA, "title", "source", "assumed")}
    assert read_camera(written(table)) == preset


# Scenes


def test_a_uniform_scene_file_is_a_uniform_scene(written):
    scene = read_scene(written(UNIFORM))
    assert isinstance(scene, UniformScene)
    assert scene.integrated_density == pytest.approx(1 - (1 - 0.0095) ** 87.5, rel=1e-12)
    assert scene.canopy_top_m == 20.0


def test_a_scene_file_may_give_the_integrated_density_instead(written):
    table = {k: v for k, v in UNIFORM.items() if k != "density"} | {"integrated_density": 0.567}
    assert read_scene(written(table)).integrated_density == 0.567


def test_a_layered_scene_file_is_a_layered_scene(written):
    scene = read_scene(written(LAYERED))
    assert isinstance(scene, LayeredScene)
    assert [layer._asdict() for layer in scene.layers] == LAYERED["layers"]
    assert scene.integrated_density == pytest.approx(1 - 0.9**2, rel=1e-12)


def test_whole_numbers_are_accepted_for_metres(written):
    assert read_scene(written(UNIFORM | {"volume_base_m": 2})).volume_base_m == 2.0


@pytest.mark.parametrize("name", UNIFORM)
def test_a_missing_name_of_a_scene_is_named(written, name):
    error = refusal(read_scene, written({k: v for k, v in UNIFORM.items() if k != name}))
    assert name in error.message


@pytest.mark.parametrize("name", LAYER)
def test_a_missing_name_of_a_layer_is_named_with_its_place(written, name):
    layers = [LAYER, {k: v for k, v in LAYER.items() if k != name}]
    path = written(LAYERED | {"layers": layers})
    assert refusal(read_scene, path).message == f"'{path}': layers.1.{name}: field required"


def test_an_unknown_name_in_a_layer_gets_the_nearest(written):
    path = written(LAYERED | {"layers": [LAYER | {"top": 3.0}]})
    error = refusal(read_scene, path)
    assert error.message == f"'{path}': unknown name 'layers.0.top'"
    assert error.hint == "did you mean top_m?"


@pytest.mark.parametrize("name", [name for name in UNIFORM if name != "name"])
@pytest.mark.parametrize("value", [[1], {"a": 1}, "95%"])
def test_a_wrong_type_in_a_scene_is_named(written, name, value):
    assert name in refusal(read_scene, written(UNIFORM | {name: value})).message


@pytest.mark.parametrize("name", LAYER)
@pytest.mark.parametrize("value", [[1], "x", -1, 10**400], ids=["list", "text", "-1", "401 digits"])
def test_a_wrong_value_in_a_layer_is_named_with_its_place(written, name, value):
    error = refusal(read_scene, written(LAYERED | {"layers": [LAYER | {name: value}]}))
    assert name in error.message
    assert "layers.0" in error.message or "layer 0" in error.message


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"density": 95.0}, "density 95 is not between 0 and 1"),
        ({"density": -0.1}, "density -0.1 is not between 0 and 1"),
        ({"occluder_size_m": 0.0}, "occluder_size_m 0 is not"),
        ({"volume_height_m": -1.0}, "volume_height_m -1 is not"),
        ({"volume_base_m": -1.0}, "volume_base_m -1 is not"),
        ({"integrated_density": 0.5}, "exactly one of density and integrated_density"),
    ],
)
def test_a_wrong_number_in_a_scene_names_the_scene(written, change, words):
    error = refusal(read_scene, written(UNIFORM | change))
    assert error.message.startswith("scene 'stand'")
    assert words in error.message


@pytest.mark.parametrize(
    ("layers", "words"),
    [
        ([], "has no layers"),
        ([LAYER | {"top_m": 2.0}], "layer 0: top_m 2 is not above bottom_m 2"),
        ([LAYER, LAYER], "layer 1: bottom_m 2 is below the top of the layer before it, 2.5"),
        ([LAYER | {"density": 1.5}], "layer 0: density 1.5 is not between 0 and 1"),
        ([LAYER | {"bottom_m": -1.0}], "layer 0: bottom_m -1 is not"),
        ([LAYER | {"occluder_size_m": 0.0}], "layer 0: occluder_size_m 0 is not"),
    ],
)
def test_a_wrong_layer_is_named(written, layers, words):
    assert words in refusal(read_scene, written({"name": "stand", "layers": layers})).message


def test_a_scene_is_uniform_or_layered_not_both(written):
    # It would be ambiguous which of the two densities is used.
    refusal(read_scene, written(UNIFORM | LAYERED))


@pytest.mark.parametrize("name", SCENES)
def test_presets_written_by_scene_save_are_the_same_scenes(tmp_path, name, capsys):
    path = tmp_path / "saved.toml"
    assert run(["scene", name, "--save", str(path), "--quiet"]) == 0
    assert read_scene(str(path)) == find_preset_scene(name)


def test_a_layered_scene_is_saved_and_read_back(tmp_path, capsys):
    path, saved = tmp_path / "in.toml", tmp_path / "out.toml"
    path.write_text(tomli_w.dumps(LAYERED | {"title": "A stand", "voxel_m": 0.25}))
    assert run(["scene", str(path), "--save", str(saved), "--quiet"]) == 0
    assert read_scene(str(saved)) == read_scene(str(path))


def test_the_output_of_scene_is_a_scene_file(tmp_path, capsys):
    # A scene file may contain layers in the form that `aosplan scene` prints.
    assert run(["scene", "paper-forest", "--json"]) == 0
    path = tmp_path / "printed.json"
    path.write_text(capsys.readouterr().out)
    printed, preset = read_scene(str(path)), find_preset_scene("paper-forest")
    assert printed.slices() == preset.slices()
    assert printed.integrated_density == pytest.approx(preset.integrated_density, rel=1e-12)


MUTANTS = [None, True, 1, 2.5, -1, 10**400, math.inf, "1", [], [1.0], [[0.5]], {}, [{}], [LAYER]]
RELATIONS = {"lags": [0.1], "directions_deg": [0.0], "rho": [[0.5]], "reach": 0.3}
SEEDS = [UNIFORM, LAYERED, LAYERED | {"correlogram": RELATIONS, "density_by_offset": [[0.4]]}]


@given(st.data())
def test_tables_accepted_by_is_sound_are_valid_for_pydantic(data):
    table = json.loads(json.dumps(data.draw(st.sampled_from(SEEDS))))
    for _ in range(data.draw(st.integers(0, 2))):
        inner = [table, *table.get("layers", [])[:1], table.get("correlogram", table)]
        place = data.draw(st.sampled_from([part for part in inner if isinstance(part, dict)]))
        names = [*place, *SceneDocument.model_fields, "titel", "schema"]
        mutant = copy.deepcopy(data.draw(st.sampled_from(MUTANTS)))  # changed by later mutations
        place[data.draw(st.sampled_from(names))] = mutant
        table = {name: value for name, value in table.items() if value is not None}
        if not isinstance(table.get("layers", []), list):
            break
        if not all(isinstance(layer, dict) for layer in table.get("layers", [])):
            break
    if is_sound(table):
        assert SceneDocument.model_validate(table).model_dump(exclude_unset=True) == table


@pytest.mark.parametrize("table", SEEDS)
def test_plain_scene_files_are_accepted_by_is_sound(table):
    assert is_sound(table)
    assert not is_sound(table | {"titel": "x"})
