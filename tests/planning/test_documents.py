"""Documents from files: valid documents are read, errors give their place, and schemas are
valid.
"""

import json
from functools import cache

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator, ValidationError
from support.tables import CAMERA, LAYER, LAYERED, UNIFORM, printed, read_scene, refusal

from aosplan.camera.camera_file import read_camera
from aosplan.cli.schema import DOCUMENTS, json_schema
from aosplan.errors import AosplanError, RequestError
from aosplan.planning.options import OPTIONS
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest, request_from
from aosplan.planning.request_file import read_request
from aosplan.planning.saved_plan import read_mission
from aosplan.scenes.presets import SCENES


@cache
def plan_json():
    return json.dumps(plan(PlanRequest(altitude=40, origin=(48.3, 14.3))).document())


# Requests


def test_a_request_file_contains_options(written):
    table = {"altitude": 40, "vhat": "98%", "origin": [48.3, 14.3], "samples": 60, "grid": "line"}
    request = request_from(read_request(written(table)))
    assert request == PlanRequest(
        altitude=40, vhat=0.98, origin=(48.3, 14.3), samples=60, grid="line"
    )


@pytest.mark.parametrize("value", ["48.3,14.3", [48.3, 14.3]])
def test_a_place_in_a_file_is_text_or_a_pair(written, value):
    values = read_request(written({"altitude": 40, "origin": value}))
    assert request_from(values).origin == (48.3, 14.3)


@pytest.mark.parametrize("value", [[48.3], [48.3, 14.3, 300.0], [48.3, [1]], 48.3, "48.3"])
def test_a_place_in_a_file_has_two_numbers(written, value):
    path = written({"altitude": 40, "origin": value})
    assert "origin" in refusal(lambda path: request_from(read_request(path)), path).message


def test_an_earlier_result_is_a_request_file(tmp_path):
    path = tmp_path / "plan.json"
    path.write_text(plan_json())
    again = plan(request_from(read_request(str(path))))
    assert json.dumps(again.document()) == plan_json()


@pytest.mark.parametrize("option", OPTIONS, ids=lambda option: option.name)
@pytest.mark.parametrize("value", [[[1]], {"a": 1}])
def test_a_wrong_type_in_a_request_names_the_option(written, option, value):
    path = written({"altitude": 40} | {option.name: value})

    def read(path):
        return request_from(read_request(path), where=path)

    assert option.name in refusal(read, path).message


@pytest.mark.parametrize(
    ("name", "nearest"),
    [
        ("altitud", "altitude"),
        ("max-samples", "max_samples"),
        ("Vhat", "vhat"),
        ("camra", "camera"),
    ],
)
def test_an_unknown_name_in_a_request_gets_the_nearest(written, name, nearest):
    path = written({"altitude": 40, name: 1})
    error = refusal(read_request, path)
    assert error.message == f"'{path}': unknown name '{name}'"
    assert error.hint == f"did you mean {nearest}?"


def test_a_request_of_another_schema_is_refused(tmp_path):
    path = tmp_path / "later.json"
    path.write_text(json.dumps(json.loads(plan_json()) | {"schema": 2}))
    refusal(read_request, str(path))


# Saved plans


def test_a_saved_plan_is_its_mission(tmp_path):
    path = tmp_path / "plan.json"
    path.write_text(plan_json())
    made = plan(PlanRequest(altitude=40, origin=(48.3, 14.3))).mission()
    read = read_mission(str(path))
    assert read.waypoints == made.waypoints
    assert read.summary == json.loads(json.dumps(made.summary))


PLAN_NAMES = [
    "schema",
    "version",
    "request",
    "baseline_m",
    "samples",
    "samples_required",
    "aperture_m",
    "grid",
    "visibility",
    "disparity",
    "camera",
    "flight",
    "waypoints",
    "limits",
    "warnings",
]


@pytest.mark.parametrize("name", PLAN_NAMES)
def test_a_missing_name_of_a_saved_plan_is_named(tmp_path, name):
    path = tmp_path / "plan.json"
    path.write_text(json.dumps({k: v for k, v in json.loads(plan_json()).items() if k != name}))
    assert name in refusal(read_mission, str(path)).message


def edited(change):
    document = json.loads(plan_json())
    change(document)
    return document


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (lambda d: d.update(schema=2), "schema"),
        (lambda d: d.update(waypoints=[]), "waypoints"),
        (lambda d: d.update(waypoints={}), "waypoints"),
        (lambda d: d["waypoints"][3].pop("east_m"), "waypoints.3.east_m"),
        (lambda d: d["waypoints"][3].update(latitude=91), "waypoints.3.latitude"),
        (lambda d: d["waypoints"][3].update(longitude=-181), "waypoints.3.longitude"),
        (lambda d: d["waypoints"][3].update(extra=1), "waypoints.3.extra"),
        (lambda d: d["waypoints"][3].pop("latitude"), "waypoints"),
        (lambda d: d["waypoints"][0].pop("longitude"), "waypoints"),
        (lambda d: d["waypoints"].pop(3), "waypoints"),
        (lambda d: d["waypoints"].reverse(), "waypoints"),
        (lambda d: d["waypoints"].append(d["waypoints"][-1]), "waypoints"),
        (lambda d: d["grid"].update(extent_m=[1]), "grid.extent_m"),
        (lambda d: d["visibility"].update(target_quantity="v"), "visibility.target_quantity"),
    ],
)
def test_a_damaged_plan_is_refused_at_its_place(tmp_path, change, place):
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(edited(change)))
    assert place in refusal(read_mission, str(path)).message


def test_names_that_later_versions_add_to_a_plan_are_kept(tmp_path):
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(edited(lambda d: d.update(weather="fine"))))
    assert read_mission(str(path)).summary["weather"] == "fine"


# Schemas


@pytest.mark.parametrize("name", DOCUMENTS)
def test_schemas_are_valid(name):
    schema = json_schema(name)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    Draft202012Validator.check_schema(schema)


@pytest.mark.parametrize("name", DOCUMENTS)
def test_schemas_refuse_other_documents(name):
    validator = Draft202012Validator(json_schema(name))
    assert not validator.is_valid([])
    assert not validator.is_valid({"schema": 2, "nonsense": True})


def test_an_unknown_schema_gets_the_nearest():
    with pytest.raises(RequestError, match="unknown document 'scen'") as caught:
        json_schema("scen")
    assert caught.value.hint == "did you mean scene?"


def check(name, document):
    Draft202012Validator(json_schema(name)).validate(document)


@pytest.mark.parametrize(
    "arguments",
    [
        ("--altitude", "40"),
        ("--altitude", "40", "--origin", "48.3,14.3", "--heading", "30"),
        ("--altitude", "40", "--density", "0", "--occluder-size", "1", "--volume-height", "9"),
        ("--altitude", "40", "--samples", "4", "--baseline", "1e-6"),
        ("--altitude", "40", "--samples", "1", "--baseline", "1"),
        ("--altitude", "40", "--visibility", "0.6"),
        ("--altitude", "40", "--model", "layered", "--optimize", "aperture"),
        ("--altitude", "40", "--grid", "lanes", "--optimize", "time"),
        ("--altitude", "40", "--vhat", "0.99999999999999999", "--samples", "4", "--baseline", "1"),
    ],
    ids=" ".join,
)
def test_plans_match_their_schema(capsys, arguments):
    document = printed(capsys, "plan", *arguments)
    check("plan", document)
    check("request", document["request"])
    assert set(PLAN_NAMES) <= set(document)


@pytest.mark.parametrize(
    "arguments",
    [
        ("--density", "0.567", "--samples", "50", "--dhat", "1"),
        ("--density", "0", "--samples", "50", "--dhat", "1"),
        ("--density", "1", "--grid", "7x8", "--dhat", "0.3"),
        ("--slice-density", "0.0095", "--height-ratio", "87.69", "--grid", "7x8", "--dhat", "0"),
    ],
    ids=" ".join,
)
def test_the_calculator_matches_its_schema(capsys, arguments):
    check("visibility", printed(capsys, "visibility", *arguments))


@pytest.mark.parametrize("name", SCENES)
def test_scene_statistics_match_their_schema(capsys, name):
    check("statistics", printed(capsys, "scene", name))


@pytest.mark.parametrize("table", [UNIFORM, LAYERED, UNIFORM | {"title": "x"}])
def test_scene_files_match_their_schema(table):
    check("scene", table)
    with pytest.raises(ValidationError):
        check("scene", table | {"added": 1})


@pytest.mark.parametrize(
    ("table", "name", "nearest"),
    [(UNIFORM, "titel", "title"), (LAYERED, "intergated_density", "integrated_density")],
)
def test_a_misspelt_name_of_a_scene_gets_the_nearest(written, table, name, nearest):
    path = written(table | {name: 0.5})
    error = refusal(read_scene, path)
    assert error.message == f"'{path}': unknown name '{name}'"
    assert error.hint == f"did you mean {nearest}?"


def test_camera_files_match_their_schema():
    check("camera", CAMERA)
    with pytest.raises(ValidationError):
        check("camera", CAMERA | {"focal_lenght_mm": 9})


def test_the_request_schema_has_every_option():
    assert set(json_schema("request")["properties"]) == {option.name for option in OPTIONS}


@pytest.mark.parametrize(
    "table", [{"altitude": True}, {"samples": 1.5}, {"scene": 3}, {"origin": [1]}, {"none": 1}]
)
def test_the_request_schema_refuses_what_the_program_refuses(tmp_path, table):
    assert not Draft202012Validator(json_schema("request")).is_valid(table)
    path = tmp_path / "r.json"
    path.write_text(json.dumps({"vhat": 0.5} | table))
    with pytest.raises(RequestError):
        request_from({"altitude": 40} | read_request(str(path)))


# Values that pydantic can convert to a number, but that are not allowed


def taken(read, write, tables):
    """Names of the tables that a reader accepts although it should refuse them."""
    names = []
    for name, table in tables.items():
        try:
            read(write(table))
        except RequestError:
            continue
        names.append(name)
    return names


@pytest.mark.parametrize("value", [True, "1"], ids=["true", "text"])
def test_no_number_of_a_camera_is_a_boolean_or_text(written, value):
    tables = {name: CAMERA | {name: value} for name in CAMERA if name != "name"}
    assert taken(read_camera, written, tables) == []


@pytest.mark.parametrize("value", [True, "0.5"], ids=["true", "text"])
def test_no_number_of_a_uniform_scene_is_a_boolean_or_text(written, value):
    tables = {name: UNIFORM | {name: value} for name in UNIFORM if name != "name"}
    assert taken(read_scene, written, tables) == []


@pytest.mark.parametrize("value", [True, "2.25"], ids=["true", "text"])
def test_no_number_of_a_layer_is_a_boolean_or_text(written, value):
    tables = {name: LAYERED | {"layers": [LAYER | {name: value}]} for name in LAYER}
    assert taken(read_scene, written, tables) == []


def test_no_number_of_a_request_is_a_boolean(written):
    numbers = [option for option in OPTIONS if option.kind != "flag"]
    tables = {option.name: {option.name: True} for option in numbers}
    assert taken(read_request, written, tables) == []


def test_no_number_of_a_saved_plan_is_a_boolean_or_text(tmp_path):
    def write(document):
        path = tmp_path / "plan.json"
        path.write_text(json.dumps(document))
        return str(path)

    tables = {
        f"{name} = {value!r}": edited(
            lambda d, name=name, value=value: d["waypoints"][3].update({name: value})
        )
        for name in ("east_m", "altitude_m", "latitude")
        for value in (True, "1.5")
    }
    assert taken(read_mission, write, tables) == []


# Random content

scalars = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(allow_nan=False), st.text(max_size=8)
)
trees = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["bottom_m", "top_m", "index", "x"]), inner, max_size=3)
    ),
    max_leaves=8,
)
READERS = {
    "camera": (read_camera, CAMERA),
    "scene": (read_scene, UNIFORM),
    "layers": (read_scene, LAYERED),
    "request": (read_request, {"altitude": 40, "origin": [1, 2], "request": {}}),
    "plan": (read_mission, {"schema": 1, "waypoints": [{"index": 0}], "grid": {}}),
}


@pytest.mark.parametrize("kind", READERS)
@given(data=st.data())
def test_any_table_is_read_or_refused(tmp_path_factory, kind, data):
    read, good = READERS[kind]
    if kind == "plan":
        good = json.loads(plan_json())
    changes = st.dictionaries(st.sampled_from(list(good)) | st.text(max_size=8), trees, max_size=3)
    table = good | data.draw(changes)
    for name in data.draw(st.lists(st.sampled_from(list(table)), max_size=2)):
        table.pop(name, None)
    path = tmp_path_factory.mktemp("any") / "file.json"
    path.write_text(json.dumps(table))
    try:
        read(str(path))
    except AosplanError as error:
        assert error.message  # noqa: PT017
