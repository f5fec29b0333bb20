"""Planning with Python: hints lead to valid plans, and grids have the described properties."""

import json
import math

import pytest
import tomli_w
from support.plans import places_of, planned

from aosplan import InfeasibleError, PlanRequest, RequestError, plan, required_samples
from aosplan.grid.patterns import GRIDS

UNIFORM = {"density": 0.01, "occluder_size": 0.2, "volume_height": 18.0}
NARROW = {"fov": 10.0, "image_width": 640, "image_height": 512}


def codes(result):
    return [warning.code for warning in result.warnings]


def message(result, code):
    (found,) = [warning.message for warning in result.warnings if warning.code == code]
    return found


# The paper


@pytest.mark.parametrize(("altitude", "baseline"), [(40, 2.8), (50, 3.5), (35, 2.45)])
def test_the_default_scene_has_the_baselines_of_the_paper(altitude, baseline):
    assert planned(altitude=altitude).solution.baseline_m == pytest.approx(baseline, rel=0.005)


@pytest.mark.parametrize(
    ("vhat", "samples"),
    [("0.8", 5), ("0.9", 10), (0.9, 10), ("95%", 20), (0.98, 50), ("0.999", 1000)],
)
def test_samples_are_equation_4_inverted(vhat, samples):
    result = planned(vhat=vhat, allow_no_common_ground=True)
    assert result.solution.pattern.samples == samples == required_samples(vhat)
    assert result.solution.samples_required == samples


def test_the_aperture_is_equation_5():
    result = planned()
    assert result.aperture_m == pytest.approx((math.sqrt(50) - 1) * 2.8, rel=1e-9)


def test_a_plan_is_frozen_and_the_same_every_time():
    assert planned().document() == planned().document()
    with pytest.raises(AttributeError):
        planned().altitude_m = 3


def test_a_plan_without_faults_has_no_warnings():
    assert codes(planned()) == []


# Hints


def test_a_grid_wider_than_the_footprint_is_warned_of():
    result = planned(grid="line", allow_no_common_ground=True)
    assert codes(result) == ["no_common_ground", "oblique_rays"]
    assert min(result.common_footprint_m) <= 0


def number_after(text, words):
    start = text.index(words) + len(words)
    return float(text[start:].split()[0].rstrip(","))


@pytest.mark.parametrize("grid", GRIDS)
def test_the_baseline_suggested_for_common_ground_gives_common_ground(grid):
    result = planned(samples=60, baseline=40, grid=grid)
    largest = number_after(message(result, "no_common_ground"), "baseline below ")
    assert min(planned(samples=60, baseline=0.999 * largest, grid=grid).common_footprint_m) > 0
    assert min(planned(samples=60, baseline=1.001 * largest, grid=grid).common_footprint_m) < 0


@pytest.mark.parametrize("grid", GRIDS)
def test_the_altitude_suggested_for_common_ground_gives_common_ground(grid):
    result = planned(samples=60, baseline=20, grid=grid)
    higher = number_after(message(result, "no_common_ground"), "above ")
    fixed = {"samples": 60, "baseline": 20, "grid": grid}
    assert min(planned(altitude=1.001 * higher, **fixed).common_footprint_m) > 0
    assert min(planned(altitude=0.999 * higher, **fixed).common_footprint_m) < 0


def test_common_ground_is_what_all_photos_see():
    result = planned(samples=20, baseline=3, heading=0)
    length, width = result.camera.footprint_m(40)
    # At the heading 0, the height of the image is along north and its width is along east.
    north = (
        min(n for _, n in places_of(result))
        + length / 2
        - (max(n for _, n in places_of(result)) - length / 2)
    )
    east = (
        min(e for e, _ in places_of(result))
        + width / 2
        - (max(e for e, _ in places_of(result)) - width / 2)
    )
    assert result.common_footprint_m == pytest.approx((north, east))


def test_a_heading_does_not_change_the_common_ground():
    assert planned(heading=33).common_footprint_m == planned().common_footprint_m


def test_occluders_below_one_pixel_give_a_warning_and_count_as_one_pixel():
    result = planned(altitude=300, allow_no_common_ground=True)
    assert "occluder_below_pixel" in codes(result)
    assert result.document()["disparity"]["occluder_pixels"] == 1.0
    assert result.document()["disparity"]["pixels"] == pytest.approx(1.0)


def test_occluders_are_resolved_below_the_altitude_in_the_warning():
    resolved = number_after(message(planned(altitude=300), "occluder_below_pixel"), "altitude of ")
    assert "occluder_below_pixel" not in codes(planned(altitude=0.999 * resolved))
    assert "occluder_below_pixel" in codes(planned(altitude=1.001 * resolved))


def test_neighbours_that_move_less_than_a_pixel_are_warned_of():
    result = planned(baseline=0.3, samples=50)
    assert "disparity_below_pixel" in codes(result)
    assert result.document()["disparity"]["pixels"] < 1


def test_the_baseline_in_the_warning_gives_a_disparity_of_one_pixel():
    said = message(planned(baseline=0.3, samples=50), "disparity_below_pixel")
    smallest = number_after(said, "needs a baseline of ")
    wider = planned(baseline=1.001 * smallest, samples=50)
    assert "disparity_below_pixel" not in codes(wider)
    assert wider.document()["disparity"]["pixels"] == pytest.approx(1.001, rel=1e-3)
    assert "disparity_below_pixel" in codes(planned(baseline=0.999 * smallest, samples=50))


def test_a_single_photo_gives_no_warning_about_disparity():
    assert "disparity_below_pixel" not in codes(planned(baseline=0.01, samples=1, vhat=0.1))
    assert "disparity_below_pixel" in codes(planned(baseline=0.01, samples=2, vhat=0.1))


def test_the_focal_length_in_the_warning_resolves_occluders():
    short = {"focal_length": 9.1, "sensor_width": 7.68, "image_width": 640, "image_height": 512}
    fixed = {"altitude": 300, "baseline": 1, "samples": 9}
    assert "occluder_below_pixel" in codes(planned(**fixed, **short))
    assert "occluder_below_pixel" not in codes(planned(**fixed, **(short | {"focal_length": 91})))


@pytest.mark.parametrize("grid", ["trimmed", "square", "line", "lanes"])
@pytest.mark.parametrize("baseline", [1.0, 2.0, 5.0])
def test_the_samples_in_the_warning_reach_the_missed_target(grid, baseline):
    result = planned(samples=9, baseline=baseline, grid=grid)
    assert not result.solution.met
    enough = result.solution.samples_required
    assert f"{enough} photos would reach it" in message(result, "target_missed")
    again = planned(samples=enough, baseline=baseline, grid=grid)
    assert again.solution.met
    assert "target_missed" not in codes(again)


def test_one_sample_fewer_than_required_misses_the_target():
    required = planned(samples=9, baseline=2.0).solution.samples_required
    assert not planned(samples=required - 1, baseline=2.0).solution.met


def test_the_warning_names_a_target_that_no_number_of_samples_reaches():
    result = planned(samples=9, baseline=1e-6)
    assert result.solution.samples_required is None
    assert "no number of photos reaches it" in message(result, "target_missed")


def test_the_warning_about_a_missed_absolute_visibility_gives_v():
    result = planned(samples=2, baseline=2, visibility=0.67)
    assert message(result, "target_missed").startswith("V = 0.67 is missed")


def test_every_warning_has_a_code_and_one_line():
    for result in (
        planned(samples=9, baseline=0.01, grid="line"),
        planned(altitude=1e5, samples=4, baseline=9),
    ):
        assert len(codes(result)) == len(set(codes(result))) > 1
        for warning in result.warnings:
            assert warning.code.isidentifier()
            assert warning.message.isprintable()


# Altitude and the canopy


@pytest.mark.parametrize("altitude", [0.1, 10.0, 20.0])
def test_altitudes_below_the_canopy_are_refused(altitude):
    with pytest.raises(RequestError, match="is not above the canopy") as caught:
        planned(altitude=altitude)
    lowest = float(caught.value.hint.split()[1])
    assert lowest == pytest.approx(20.044 + 2.0, abs=0.01)
    assert planned(altitude=lowest).altitude_m == lowest


def test_the_clearance_is_kept_above_the_canopy():
    top = planned().scene.canopy_top_m
    for clearance in (0.5, 2.0, 10.0):
        assert planned(altitude=1.0001 * (top + clearance), clearance=clearance).solution.met
        with pytest.raises(RequestError, match=f"less than --clearance {clearance:g} m above"):
            planned(altitude=0.9999 * (top + clearance), clearance=clearance)
    with pytest.raises(RequestError, match="is not above the canopy"):
        planned(altitude=top, clearance=0)


def test_the_clearance_counts_from_the_canopy_even_below_the_focal_plane():
    with pytest.raises(RequestError, match="less than --clearance 2 m"):
        planned(altitude=1.0, focal_height=20.5)
    assert planned(altitude=1.6, focal_height=20.5).altitude_m == 1.6


def test_an_altitude_in_the_canopy_computed_from_the_resolution_is_explained():
    with pytest.raises(RequestError, match="computed from the resolution"):
        plan(PlanRequest(gsd=0.02))


def test_the_canopy_counts_from_the_focal_plane():
    # The top of the forest, at 20.04 m, is 15.04 m above a focal plane at 5 m.
    assert planned(altitude=17.05, focal_height=5).altitude_m == 17.05
    with pytest.raises(RequestError, match=r"top is 15\.044 m above the focal plane"):
        planned(altitude=15, focal_height=5)


@pytest.mark.parametrize("gsd", [0.03, 0.05, 0.1])
def test_the_altitude_is_solved_from_the_wanted_resolution(gsd):
    result = plan(PlanRequest(gsd=gsd))
    assert result.camera.gsd_m(result.altitude_m) == pytest.approx(gsd, rel=1e-12)
    assert result.altitude_m == pytest.approx(gsd * 9.1 * 640 / 7.68, rel=1e-12)


def test_a_target_and_its_pixels_are_a_resolution():
    by_target = plan(PlanRequest(target_size=1.8, target_pixels=36))
    by_gsd = plan(PlanRequest(gsd=0.05))
    assert by_target.altitude_m == pytest.approx(by_gsd.altitude_m, rel=1e-12)
    assert by_target.solution.baseline_m == pytest.approx(by_gsd.solution.baseline_m, rel=1e-12)


def test_the_altitude_that_was_solved_makes_the_same_plan_when_given():
    solved = plan(PlanRequest(gsd=0.05))
    given_ = planned(altitude=solved.altitude_m)
    assert given_.solution == solved.solution
    assert given_.waypoints == solved.waypoints


# A raised focal plane


def test_the_focal_height_adds_to_the_altitude_of_the_waypoints():
    result = planned(focal_height=1.5)
    assert result.altitude_m == 40
    assert {w.altitude_m for w in result.waypoints} == {41.5}


def test_a_focal_plane_inside_the_canopy_leaves_the_occluders_above_it():
    low, high = (planned(focal_height=height, vhat=0.9, **UNIFORM) for height in (0, 11))
    whole, half = low.solution.prediction.density, high.solution.prediction.density
    # Half of the volume is above 11 m. The transparency of this half is the square root of the
    # transparency of the whole volume.
    assert 1 - half == pytest.approx(math.sqrt(1 - whole), rel=1e-12)


def test_a_focal_plane_below_the_canopy_lowers_every_occluder():
    # The 2 % quantile of the heights of occluders is 2.36 m, which is 1.36 m above a plane at 1 m.
    low, high = (planned(focal_height=height, vhat=0.9, **UNIFORM) for height in (0, 1))
    assert low.solution.baseline_m == pytest.approx(0.2 * 40 / 2.36, rel=1e-12)
    assert high.solution.baseline_m == pytest.approx(0.2 * 40 / 1.36, rel=1e-12)
    assert high.solution.prediction.density == low.solution.prediction.density


@pytest.mark.parametrize("height", [20.0, 25.0])
def test_above_the_canopy_a_single_photo_shows_everything(height):
    result = planned(focal_height=height, **UNIFORM)
    assert result.solution.pattern.samples == 1
    assert codes(result) == ["no_occluders"]
    assert result.solution.prediction.expected == 1.0


# Density 0 and 1


@pytest.mark.parametrize("name", ["density", "integrated_density"])
def test_density_zero_gives_one_sample_a_warning_and_no_undefined_numbers(name):
    result = planned(occluder_size=0.2, volume_height=18, **{name: 0})
    document = result.document()
    assert (document["samples"], document["samples_required"]) == (1, 1)
    assert codes(result) == ["no_occluders"]
    assert document["visibility"]["expected"] == 1.0
    assert document["visibility"]["normalized"] is None
    assert document["disparity"] == {"normalized": None, "pixels": None, "occluder_pixels": None}
    assert [(w.east_m, w.north_m) for w in result.waypoints] == [(0.0, 0.0)]
    json.dumps(document, allow_nan=False)


def test_density_zero_keeps_a_fixed_number_of_samples():
    result = planned(density=0, occluder_size=0.2, volume_height=18, samples=9, baseline=2)
    assert result.solution.pattern.samples == 9
    assert result.solution.baseline_m == 2


@pytest.mark.parametrize(
    "values",
    [
        {"integrated_density": 1},
        {"density": 1},
        {"density": 0.9999999, "occluder_size": 0.01},
    ],
)
def test_full_density_is_an_error(values):
    with pytest.raises(RequestError, match="no ray reaches the ground"):
        planned(**({"occluder_size": 0.2, "volume_height": 18} | values))


def test_a_tiny_gap_is_enough_to_plan():
    result = planned(integrated_density=1 - 1e-12, occluder_size=0.2, volume_height=18)
    assert result.solution.prediction.minimum == pytest.approx(1e-12, rel=1e-3)
    assert result.solution.met


# Layered scenes


@pytest.fixture
def layered_file(tmp_path):
    """A stand of forty thin layers as a file."""
    layers = [
        {
            "bottom_m": 2 + 0.2 * index,
            "top_m": 2.2 + 0.2 * index,
            "density": 0.01 + 0.0005 * index,
            "occluder_size_m": 0.2,
        }
        for index in range(40)
    ]
    path = tmp_path / "stand.toml"
    path.write_text(tomli_w.dumps({"name": "stand", "layers": layers}))
    return path


def test_layers_are_planned_with_the_layered_model(layered_file):
    result = planned(scene=str(layered_file))
    assert result.model == "layered"
    assert result.request.model == "layered"
    clear = math.prod(1 - (0.01 + 0.0005 * index) for index in range(40))
    assert result.solution.prediction.density == pytest.approx(1 - clear, rel=1e-9)
    assert result.solution.met


def test_layers_may_be_planned_with_the_uniform_model(layered_file):
    result = planned(scene=str(layered_file), model="uniform")
    assert result.model == "uniform"
    assert result.solution.pattern.samples == 50


def test_a_layered_plan_meets_its_target_and_a_smaller_baseline_misses_it(layered_file):
    result = planned(scene=str(layered_file))
    pattern, baseline = result.solution.pattern, result.solution.baseline_m
    fixed = {"scene": str(layered_file), "samples": pattern.samples}
    assert planned(**fixed, baseline=baseline).solution.met
    assert not planned(**fixed, baseline=0.999 * baseline).solution.met


def test_layers_much_thicker_than_their_occluders_are_warned_of(tmp_path):
    path = tmp_path / "thick.toml"
    layer = {"bottom_m": 2.0, "top_m": 9.0, "density": 0.3, "occluder_size_m": 0.2}
    path.write_text(tomli_w.dumps({"name": "thick", "layers": [layer]}))
    assert "thick_layer" in codes(planned(scene=str(path)))
    assert "thick_layer" not in codes(planned(scene=str(path), model="uniform"))


def test_layers_without_density_hide_nothing(tmp_path):
    path = tmp_path / "bare.toml"
    layer = {"bottom_m": 2.0, "top_m": 9.0, "density": 0.0, "occluder_size_m": 0.2}
    path.write_text(tomli_w.dumps({"name": "bare", "layers": [layer]}))
    assert codes(planned(scene=str(path))) == ["no_occluders"]


def test_a_measured_density_without_dense_layers_is_refused(tmp_path):
    path = tmp_path / "odd.toml"
    layer = {"bottom_m": 2.0, "top_m": 9.0, "density": 0.0, "occluder_size_m": 0.2}
    table = {"name": "odd", "integrated_density": 0.5, "layers": [layer]}
    path.write_text(tomli_w.dumps(table))
    with pytest.raises(RequestError):
        planned(scene=str(path))


@pytest.mark.parametrize(
    "change",
    [
        {"density": 5e-324},
        {"bottom_m": 0.0, "top_m": 1e-320},
        {"occluder_size_m": 1e-300},
        {"occluder_size_m": 1e300},
        {"bottom_m": 0.0},
        {"density": 1 - 1e-16},
    ],
    ids=str,
)
@pytest.mark.parametrize("model", ["uniform", "layered"])
def test_absurd_layers_are_planned_or_refused(tmp_path, change, model):
    path = tmp_path / "absurd.toml"
    layer = {"bottom_m": 2.0, "top_m": 2.2, "density": 0.3, "occluder_size_m": 0.2} | change
    path.write_text(tomli_w.dumps({"name": "absurd", "layers": [layer]}))
    try:
        result = planned(scene=str(path), model=model)
    except (RequestError, InfeasibleError):
        return
    json.dumps(result.document(), allow_nan=False)


def test_the_error_for_an_unreachable_target_gives_the_reachable_value():
    with pytest.raises(InfeasibleError) as caught:
        planned(max_samples=20)
    assert "at least 50 samples" in caught.value.message
    assert caught.value.hint
