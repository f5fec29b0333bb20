"""PlanRequest: tests of the relations between options, and of options that override files."""

import math
import re
from dataclasses import fields

import pytest

from aosplan.errors import RequestError
from aosplan.planning.option_relations import RANGE, RELATIONS, SEARCH
from aosplan.planning.options import DEFAULTS
from aosplan.planning.request import BY_NAME, OPTIONS, PlanRequest, request_from
from aosplan.scenes.files.canopy_raster import CROWN_BASE
from aosplan.scenes.files.point_cloud import DEFAULT_VOXEL_M
from aosplan.scenes.pulses.realise import LEAF_M

UNIFORM = {"density": 0.01, "occluder_size": 0.2, "volume_height": 18}
LENS = {"focal_length": 9.1, "sensor_width": 7.68, "image_width": 640, "image_height": 512}
FOV = {"fov": 60, "image_width": 640, "image_height": 512}


def refusal(**values):
    try:
        PlanRequest(**values)
    except RequestError as error:
        return error
    pytest.fail(f"a request of {', '.join(values)} is accepted")


def test_options_and_fields_are_the_same_names_in_the_same_order():
    assert [option.name for option in OPTIONS] == [field.name for field in fields(PlanRequest)]


def test_flags_are_names_with_hyphens():
    assert BY_NAME["max_aperture"].flag == "--max-aperture"


def test_relations_name_options_that_exist():
    named = {each.option for rule in RELATIONS for each in (*rule.given, *rule.others)}
    assert named <= {*BY_NAME, SEARCH, RANGE}


def test_a_request_with_only_an_altitude_has_the_documented_defaults():
    request = PlanRequest(altitude=40)
    assert request.document() == {
        "altitude": 40.0,
        "focal_height": 0.0,
        "vhat": 0.98,
        "scene": "paper-forest",
        "camera": "dji-m3t-thermal",
        "coverage": 0.98,
        "optimize": "samples",
        "sensitivity": False,
        "allow_no_common_ground": False,
        "grid": "trimmed",
        "heading": 0.0,
        "speed": 5.0,
        "transit_speed": 5.0,
        "acceleration": 2.0,
        "climb": 3.0,
        "hold": 1.0,
        "trigger": "stop",
        "altitude_frame": "takeoff",
        "clearance": 2.0,
        "hold_error": 0.0,
    }


def test_text_is_read_as_on_the_command_line():
    written = PlanRequest(altitude="40 m", vhat="98%", samples="50", origin="48.5,14.25")
    assert written == PlanRequest(altitude=40, vhat=0.98, samples=50, origin=(48.5, 14.25))


def test_requests_are_frozen():
    with pytest.raises(AttributeError):
        PlanRequest(altitude=40).altitude = 50


@pytest.mark.parametrize("value", [{"a": 1}, ""], ids=["table", "empty text"])
def test_every_option_refuses_a_table_and_empty_text(value):
    wrong = {
        option.name: error.message
        for option in OPTIONS
        if option.name not in (error := refusal(**{"altitude": 40, option.name: value})).message
    }
    assert wrong == {}


@pytest.mark.parametrize(
    "value",
    [True, False, math.nan, math.inf, "nan", "-inf", pytest.param(10**400, id="401 digits")],
)
def test_no_number_may_be_a_boolean_infinite_or_too_long(value):
    numbers = [option.name for option in OPTIONS if option.kind not in ("text", "flag")]
    assert len(numbers) > 50
    wrong = {
        name: error.message
        for name in numbers
        if not (error := refusal(**{"altitude": 40, name: value})).message.startswith(name)
    }
    assert wrong == {}


@pytest.mark.parametrize("heading", [1e-15, -1e-130, "1e-12"])
def test_tiny_headings_from_rounding_are_accepted(heading):
    assert PlanRequest(altitude=40, heading=heading).heading == float(heading)


@pytest.mark.parametrize("name", ["altitude", "samples", "vhat", "origin"])
def test_an_integer_too_long_to_print_is_refused_like_any_other(name):
    # Python refuses to convert integers with more than 4300 digits to text.
    value = (10**5000, 1) if name == "origin" else 10**5000
    assert name in refusal(**({"altitude": 40} | {name: value})).message


# Options that determine the altitude


def test_an_altitude_is_needed():
    error = refusal()
    assert error.message == "no altitude is given"
    assert "--altitude M" in error.hint
    assert "--gsd M" in error.hint


@pytest.mark.parametrize(
    "values", [{"altitude": 40}, {"gsd": 0.05}, {"target_size": 1.8, "target_pixels": 20}]
)
def test_each_way_of_giving_an_altitude_is_enough(values):
    PlanRequest(**values)


@pytest.mark.parametrize(
    ("values", "flags"),
    [
        ({"altitude": 40, "gsd": 0.05}, ("--altitude", "--gsd")),
        ({"altitude": 40, "target_size": 1.8, "target_pixels": 9}, ("--altitude", "--target-size")),
        ({"gsd": 0.05, "target_size": 1.8, "target_pixels": 9}, ("--gsd", "--target-size")),
        ({"altitude": 40, "target_pixels": 9}, ("--altitude", "--target-pixels")),
        ({"altitude": 40, "vhat": 0.9, "visibility": 0.5}, ("--vhat", "--visibility")),
        ({"altitude": 40, "scene": "savanna", "density": 0.1}, ("--scene", "--density")),
        (
            {"altitude": 40, "scene": "savanna", "integrated_density": 0.1},
            ("--scene", "--integrated-density"),
        ),
        ({"altitude": 40, "scene": "savanna", "volume_base": 1}, ("--scene", "--volume-base")),
        ({"altitude": 40, "scene": "savanna", "volume_height": 9}, ("--scene", "--volume-height")),
        (
            {"altitude": 40, "density": 0.1, "integrated_density": 0.1},
            ("--density", "--integrated-density"),
        ),
        ({"altitude": 40, **UNIFORM, "voxel": 0.2}, ("--density", "--voxel")),
        ({"altitude": 40, **UNIFORM, "ground": "auto"}, ("--density", "--ground")),
        ({"altitude": 40, **UNIFORM, "min_height": 1}, ("--density", "--min-height")),
        ({"altitude": 40, "camera": "x", "fov": 60}, ("--camera", "--fov")),
        ({"altitude": 40, "camera": "x", "focal_length": 9}, ("--camera", "--focal-length")),
        ({"altitude": 40, "camera": "x", "image_width": 9}, ("--camera", "--image-width")),
        ({"altitude": 40, "camera": "x", "sensor_height": 9}, ("--camera", "--sensor-height")),
        ({"altitude": 40, **LENS, "fov": 60}, ("--focal-length", "--fov")),
        ({"altitude": 40, **FOV, "sensor_width": 7}, ("--fov", "--sensor-width")),
        ({"altitude": 40, **FOV, "sensor_height": 7}, ("--fov", "--sensor-height")),
    ],
)
def test_contradictions_name_both_options(values, flags):
    error = refusal(**values)
    assert all(flag in error.message for flag in flags)
    assert error.hint == "give only one of them"


@pytest.mark.parametrize(
    ("values", "missing"),
    [
        ({"target_size": 1.8}, "--target-pixels"),
        ({"target_pixels": 20}, "--target-size"),
        ({"altitude": 40, "density": 0.01}, "--occluder-size"),
        ({"altitude": 40, "density": 0.01, "occluder_size": 0.2}, "--volume-height"),
        ({"altitude": 40, "integrated_density": 0.5, "volume_height": 9}, "--occluder-size"),
        ({"altitude": 40, "volume_height": 9}, "--density"),
        ({"altitude": 40, "volume_base": 9}, "--density"),
        ({"altitude": 40, "focal_length": 9}, "--sensor-width"),
        ({"altitude": 40, "focal_length": 9, "sensor_width": 7}, "--image-width"),
        (
            {"altitude": 40, "focal_length": 9, "sensor_width": 7, "image_width": 640},
            "--image-height",
        ),
        ({"altitude": 40, "fov": 60}, "--image-width"),
        ({"altitude": 40, "fov": 60, "image_width": 640}, "--image-height"),
        ({"altitude": 40, "image_width": 640}, "--focal-length"),
        ({"altitude": 40, "sensor_width": 7}, "--focal-length"),
        ({"altitude": 40, "sensor_height": 7}, "--focal-length"),
    ],
)
def test_a_missing_partner_is_named(values, missing):
    error = refusal(**values)
    assert missing in f"{error.message} {error.hint}"


@pytest.mark.parametrize(
    "values", [{"altitude": 40, "fov": 60}, {"altitude": 40, **LENS, "image_width": None}]
)
def test_an_incomplete_camera_has_a_hint(values):
    assert refusal(**values).hint


def test_the_default_base_of_a_uniform_scene_is_two_metres():
    assert PlanRequest(altitude=40, **UNIFORM).volume_base == 2.0
    assert PlanRequest(altitude=40, **UNIFORM, volume_base=0).volume_base == 0.0


def test_the_base_that_was_assumed_is_in_the_document():
    assert PlanRequest(altitude=40, **UNIFORM).document()["volume_base"] == 2.0


def test_a_uniform_scene_removes_the_preset_scene():
    assert PlanRequest(altitude=40, **UNIFORM).scene is None


@pytest.mark.parametrize("values", [LENS, FOV, LENS | {"sensor_height": 6.1}])
def test_a_camera_given_by_numbers_removes_the_preset_camera(values):
    assert PlanRequest(altitude=40, **values).camera is None


@pytest.mark.parametrize("fov", [180, 180.0001, 360])
def test_a_field_of_view_stays_below_180(fov):
    assert "fov" in refusal(altitude=40, **(FOV | {"fov": fov})).message


def test_a_visibility_removes_the_default_vhat():
    request = PlanRequest(altitude=40, visibility=0.5)
    assert request.vhat is None
    assert request.visibility == 0.5


@pytest.mark.parametrize("name", ["vhat", "visibility"])
@pytest.mark.parametrize(
    ("value", "hint"),
    [
        ("98", "write 98%"),
        (98, "write 98%"),
        (50.0, "write 50%"),
        ("1", "no finite number of photos reaches 1; give a target such as 0.98"),
        (1, "no finite number of photos reaches 1; give a target such as 0.98"),
        ("100%", "no finite number of photos reaches 1; give a target such as 0.98"),
        ("-0.1", "give a target between 0 and 1, such as 0.98 or 98%"),
        ("120%", "give a target between 0 and 1, such as 0.98 or 98%"),
        ("98m", "give a share such as 0.98 or 98%"),
        ("0,98", "give a share such as 0.98 or 98%"),
    ],
)
def test_targets_that_are_no_share_below_1_get_a_hint(name, value, hint):
    error = refusal(altitude=40, **{name: value})
    assert error.message.startswith(f"{name} '{value}' is not a")
    assert error.hint == hint


def test_empty_targets_are_quoted_once():
    assert refusal(altitude=40, vhat="").message == "vhat '' is not a number"


@pytest.mark.parametrize("value", ["0.9_8", "9_8%"])
def test_underscores_in_targets_are_refused_as_in_every_other_number(value):
    refusal(altitude=40, vhat=value)


def test_percent_and_share_are_the_same_request():
    assert PlanRequest(altitude=40, vhat="98%") == PlanRequest(altitude=40, vhat=0.98)


@pytest.mark.parametrize(
    "text", ["0.99999999999999999999", "0.98000000000000000001", "99.99999999999999999999%"]
)
def test_a_target_with_more_digits_than_a_float_keeps_them(text):
    assert PlanRequest(altitude=40, vhat=text).vhat == text


@pytest.mark.parametrize(
    ("samples", "most", "fits"), [(50, 50, True), (51, 50, False), (1, 1, True), (2, 1, False)]
)
def test_samples_stay_within_their_own_bound(samples, most, fits):
    values = {"altitude": 40, "samples": samples, "max_samples": most}
    if fits:
        assert PlanRequest(**values).samples == samples
    else:
        assert "--max-samples" in refusal(**values).message


def test_lane_options_have_defaults_only_for_lanes():
    lanes = PlanRequest(altitude=40, grid="lanes")
    assert (lanes.lanes, lanes.lane_pitch) == (3, 4.0)
    trimmed = PlanRequest(altitude=40)
    assert (trimmed.lanes, trimmed.lane_pitch) == (None, None)


@pytest.mark.parametrize("name", ["lanes", "lane_pitch"])
@pytest.mark.parametrize("grid", ["trimmed", "rectangle", "square", "line"])
def test_lane_options_go_with_lanes(grid, name):
    error = refusal(altitude=40, grid=grid, **{name: 3})
    assert BY_NAME[name].flag in error.message
    assert f"--grid {grid}" in error.message
    assert error.hint == "give --grid lanes, or leave the other options out"


def test_lanes_are_no_closer_than_samples_along_them():
    assert PlanRequest(altitude=40, grid="lanes", lane_pitch=1).lane_pitch == 1.0
    assert "--lane-pitch" in refusal(altitude=40, grid="lanes", lane_pitch=0.99).message


@pytest.mark.parametrize(
    ("name", "value", "hint"),
    [
        ("model", "layerd", "did you mean layered?"),
        ("optimize", "sample", "did you mean samples?"),
        ("grid", "rectangel", "did you mean rectangle?"),
        ("ground", "normalised", "did you mean normalized?"),
    ],
)
def test_unknown_words_get_the_nearest_known(name, value, hint):
    error = refusal(altitude=40, **{name: value})
    assert f"{name} '{value}'" in error.message
    assert error.hint == hint


# Files and options


def test_a_flag_overrides_the_file():
    request = request_from({"altitude": 40, "samples": 60}, overrides={"altitude": "50"})
    assert (request.altitude, request.samples) == (50.0, 60)


def test_a_flag_that_was_not_given_leaves_the_file_alone():
    request = request_from({"altitude": 40}, overrides={"altitude": None, "gsd": None})
    assert request.altitude == 40.0


@pytest.mark.parametrize(
    ("file", "flags", "gone"),
    [
        ({"altitude": 40}, {"gsd": 0.05}, ("altitude",)),
        ({"altitude": 40}, {"target_size": 1.8, "target_pixels": 9}, ("altitude",)),
        (
            {"target_size": 1.8, "target_pixels": 9},
            {"altitude": 40},
            ("target_size", "target_pixels"),
        ),
        ({"gsd": 0.05}, {"altitude": 40}, ("gsd",)),
        ({"altitude": 40, "vhat": 0.9}, {"visibility": 0.5}, ("vhat",)),
        ({"altitude": 40, "visibility": 0.5}, {"vhat": 0.9}, ("visibility",)),
        ({"altitude": 40, "scene": "savanna"}, UNIFORM, ("scene",)),
        ({"altitude": 40, "scene": "a.laz", "voxel": 0.2, "ground": "class"}, UNIFORM, ("voxel",)),
        ({"altitude": 40, **UNIFORM}, {"scene": "savanna"}, ("density", "volume_height")),
        ({"altitude": 40, **UNIFORM}, {"integrated_density": 0.5}, ("density",)),
        ({"altitude": 40, **LENS}, {"camera": "dji-m3t-thermal"}, ("focal_length", "image_width")),
        ({"altitude": 40, "camera": "dji-m3t-thermal"}, FOV, ("camera",)),
        ({"altitude": 40, **LENS}, {"fov": 60}, ("focal_length", "sensor_width")),
    ],
)
def test_a_flag_removes_contradicting_options_of_the_file(file, flags, gone):
    request = request_from(file, overrides=flags)
    document = request.document()
    assert not set(gone) & set(document)
    assert {name: document[name] for name in flags} == pytest.approx(flags)


@pytest.mark.parametrize("kept", ["scene", "camera"])
def test_a_complete_request_can_be_overridden_by_a_preset(kept):
    # The occluder size in the file belongs to a uniform scene, not to a preset.
    file = PlanRequest(altitude=40, **UNIFORM, **LENS).document()
    preset = {"scene": "savanna", "camera": "dji-m3t-wide"}[kept]
    request = request_from(file, overrides={kept: preset})
    assert getattr(request, kept) == preset
    if kept == "scene":
        assert request.occluder_size is None


def test_flags_contradict_each_other_even_over_a_file():
    with pytest.raises(RequestError, match="have the same meaning"):
        request_from({"altitude": 40}, overrides={"altitude": 50, "gsd": 0.05})


def test_a_file_that_contradicts_itself_is_refused():
    with pytest.raises(RequestError, match="have the same meaning"):
        request_from({"altitude": 40, "gsd": 0.05})


def test_values_of_a_file_are_named_with_the_file_and_flags_as_flags():
    with pytest.raises(RequestError, match=r"^altitude in r\.toml '-1' is not above zero"):
        request_from({"altitude": -1}, where="r.toml")
    with pytest.raises(RequestError, match=r"^--altitude '-1' is not above zero"):
        request_from({"altitude": 5}, overrides={"altitude": "-1"}, where="r.toml")


@pytest.mark.parametrize(
    ("name", "nearest"),
    [
        ("altitud", "altitude"),
        ("max-samples", "max_samples"),
        ("Vhat", "vhat"),
        ("scenes", "scene"),
    ],
)
def test_unknown_options_get_the_nearest_known(name, nearest):
    with pytest.raises(RequestError) as caught:
        request_from({"altitude": 40, name: 1}, where="r.toml")
    assert caught.value.message == f"unknown option {name} in r.toml"
    assert caught.value.hint == f"did you mean {nearest}?"


def test_grid_lanes_in_a_file_can_be_overridden_by_another_grid():
    # Another grid also replaces the lane options in the file.
    file = PlanRequest(altitude=40, grid="lanes").document()
    assert request_from(file, overrides={"grid": "trimmed"}).grid == "trimmed"


def test_help_shows_the_defaults_that_a_request_takes():
    shown = {option.name: option.help for option in OPTIONS}
    for name, value in DEFAULTS.items():
        if name != "altitude_frame":  # The default is the first allowed value.
            text = value if isinstance(value, str) else f"{value:g}"
            assert re.search(rf"\[{text}[],;]", shown[name]), name
    assert shown["voxel"].endswith(f"[{DEFAULT_VOXEL_M:g}]")
    assert shown["leaf_size"].endswith(f"[{LEAF_M:g}]")
    assert shown["crown_base"].endswith(f"[{CROWN_BASE:g}]")
    assert not [name for name, text in shown.items() if "[default" in text]


@pytest.mark.parametrize(
    ("given", "objective", "vhat"),
    [
        ({}, "samples", 0.98),
        ({"find": "person"}, "samples", 0.98),
        ({"within": 5.0}, "visibility", 0.0),
        ({"within": 5.0, "find": "person"}, "detection", 0.0),
        ({"within": 5.0, "find": "person", "vhat": 0.9}, "samples", 0.9),
        ({"within": 5.0, "visibility": 0.3}, "samples", None),
        ({"within": 5.0, "find": "person", "optimize": "contrast"}, "contrast", 0.0),
    ],
)
def test_the_default_objective_depends_on_the_time_and_the_target(given, objective, vhat):
    request = PlanRequest(altitude=40.0, **given)
    assert (request.optimize, request.vhat) == (objective, vhat)
