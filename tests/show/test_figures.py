"""Figures: their numbers are compared with the numbers of the plan and the scene, and their texts
are tested.
"""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from approved.make import paper_forest, planned, shown, stand

from aosplan import PlanRequest, plan
from aosplan.camera.disparity import coverage_share
from aosplan.planning.loaded_scene import LoadedScene
from aosplan.scenes.scene import Layer, LayeredScene
from aosplan.scenes.voxels import VoxelVolume
from aosplan.show.figures.canvas import FigureStyle, drawn
from aosplan.show.figures.correlogram import correlations_of
from aosplan.show.figures.coverage_curve import curve_of
from aosplan.show.figures.density import density_of
from aosplan.show.figures.draw import KINDS
from aosplan.show.figures.grid import grid_of, nice_length_m, numbered
from aosplan.show.figures.visibility import visibility_of

# The numbers


def test_the_curves_of_visibility_are_the_models_own():
    result, found = planned(), shown("visibility")
    model, grid = result.problem.model, result.problem.grid
    for curve in found.by_samples:
        for n, normalized, expected in zip(*curve[1:], strict=True):
            told = model.predict(grid.pattern(int(n)), curve.fixed)
            assert (told.normalized, told.expected) == (normalized, expected)
    for curve in found.by_baseline:
        for b, normalized, expected in zip(*curve[1:], strict=True):
            told = model.predict(grid.pattern(int(curve.fixed)), b)
            assert (told.normalized, told.expected) == (normalized, expected)


def test_the_first_curves_pass_through_the_plan():
    found = shown("visibility")
    by_samples, by_baseline = found.by_samples[0], found.by_baseline[0]
    assert by_samples.fixed == found.baseline_m
    assert by_samples.normalized[by_samples.x.index(found.samples)] == found.normalized
    assert by_baseline.fixed == found.samples
    assert by_baseline.expected[by_baseline.x.index(found.baseline_m)] == found.expected


def test_the_points_of_a_tradeoff_are_its_rows():
    rows = [row.document() for row in planned(max_samples=80).tradeoff()]
    points = shown("tradeoff").points
    assert len(points) == len(rows)
    for point, row in zip(points, rows, strict=True):
        told = (row["samples"], row["baseline_m"], row["time_s"], row["front"], row["chosen"])
        assert told == (point.samples, point.baseline_m, point.time_s, point.front, point.chosen)
        assert point.extent_m == max(row["extent_x_m"], row["extent_y_m"])


def test_the_hidden_share_is_counted_ray_by_ray():
    occupied = np.zeros((4, 2, 3), dtype=np.bool_)
    occupied[1, 0, 0] = occupied[3, 0, 0] = occupied[2, 1, 2] = True
    volume = VoxelVolume(occupied, 0.5)
    from aosplan.scenes.occluder_statistics import layered_scene

    found = density_of(LoadedScene(layered_scene(volume, "x"), "cloud", volume=volume))
    assert found.bottom_m == (0.5, 1.0, 1.5)
    assert found.density == pytest.approx((1 / 6, 1 / 6, 1 / 6))
    assert found.measured == pytest.approx((2 / 6, 2 / 6, 1 / 6))
    assert found.independent == pytest.approx((1 - (5 / 6) ** 3, 1 - (5 / 6) ** 2, 1 / 6))


def test_the_layers_of_a_uniform_scene_hide_its_density():
    found = density_of(paper_forest())
    assert found.independent[0] == pytest.approx(paper_forest().scene.integrated_density, rel=1e-12)
    assert found.measured is None


def test_the_baseline_curve_has_the_wanted_share_at_its_ratio():
    found = shown("baseline-curve")
    share = coverage_share(paper_forest().scene.slabs(), 1e6, math.inf, found.ratio * 1e6)
    assert share == pytest.approx(0.98, rel=1e-9)
    # The uniform volume in closed form: heights above o/(b/h), from 2.506 to 20.046 m.
    o, base, height = 0.2, paper_forest().scene.volume_base_m, paper_forest().scene.volume_height_m
    o = paper_forest().scene.occluder_size_m
    for ratio, told in found.knots:
        assert told == pytest.approx((base + height - o / ratio) / height, abs=0.02)


def test_layers_make_a_staircase_of_the_baseline_curve():
    layers = (Layer(2.0, 3.0, 0.1, 0.25), Layer(9.0, 11.0, 0.2, 0.5))
    found = curve_of(LayeredScene("two", layers), 0.98)
    assert found.stepped
    # The curve has the ratios o/H at the middles of layers, weighted by density times thickness.
    assert found.knots == (
        (pytest.approx(0.05), pytest.approx(0.8)),
        (pytest.approx(0.1), pytest.approx(1.0)),
    )
    assert found.ratio == pytest.approx(0.1)
    assert not shown("baseline-curve").stepped


def test_a_correlogram_is_the_scenes_own_or_that_of_its_voxels():
    from aosplan.scenes.correlogram import correlogram

    table = correlogram(stand().volume)
    told = shown("correlogram")
    assert told.rho == tuple(map(tuple, table.rho.tolist()))
    kept = replace(stand(), volume=None, correlogram=table)
    assert correlations_of(kept) == told


def test_the_footprint_of_a_grid_turns_with_the_heading():
    found = shown("grid")
    (x0, y0), (x1, y1), (x2, y2) = found.footprint[:3]
    across, along = math.hypot(x1 - x0, y1 - y0), math.hypot(x2 - x1, y2 - y1)
    assert (along, across) == pytest.approx(found.footprint_m)
    # The sides along the heading are 30° east of north.
    assert math.degrees(math.atan2(x1 - x2, y1 - y2)) == pytest.approx(30.0)
    way = math.degrees(
        math.atan2(found.east_m[1] - found.east_m[0], found.north_m[1] - found.north_m[0])
    )
    assert way == pytest.approx(30.0)
    # This is 1e-4 degrees of latitude.
    assert found.takeoff == pytest.approx((0.0, 11.12), abs=0.01)


def test_the_common_ground_is_inside_the_footprint_of_each_photo():
    found = grid_of(planned(heading=200.0))
    heading = math.radians(200.0)
    for east, north in zip(found.east_m, found.north_m, strict=True):
        for x, y in found.common:
            dx, dy = x - east, y - north
            along = dx * math.sin(heading) + dy * math.cos(heading)
            across = dx * math.cos(heading) - dy * math.sin(heading)
            assert abs(along) <= 0.5 * found.footprint_m[0] + 1e-9
            assert abs(across) <= 0.5 * found.footprint_m[1] + 1e-9


@pytest.mark.parametrize(("span", "length"), [(10, 2), (100, 20), (47, 10), (3, 0.5), (9000, 2000)])
def test_scale_bars_are_round(span, length):
    assert nice_length_m(span) == pytest.approx(length)


@pytest.mark.parametrize("count", [1, 2, 50, 999, 500_000])
@pytest.mark.parametrize("spacing_mm", [10.0, 4.6, 2.0, 0.01, 0.0])
def test_numbers_are_few_and_apart_and_name_both_ends(count, spacing_mm):
    found = numbered([(0, 0), (1, count - 1)] if count > 1 else [(0, 0)], spacing_mm)
    assert found[0] == 0
    assert found[-1] == count - 1
    assert found == sorted(set(found))
    if spacing_mm < 4.6:
        assert len(found) <= 22


# The texts


@pytest.mark.parametrize("kind", KINDS)
def test_a_description_has_the_figures_numbers(kind):
    text = shown(kind).description()
    assert text.startswith(shown(kind).title)
    assert text.endswith(".")
    assert len(re.findall(r"\d", text)) > 10
    assert "nan" not in text
    assert "None" not in text


def test_the_description_of_a_plan_names_its_limits():
    text = shown("visibility").description()
    assert "50 samples 2.8 m apart" in text
    assert "neighbouring photos already share no occluder" in text


@pytest.mark.parametrize("kind", KINDS)
def test_the_document_is_plain_json(kind):
    told = json.loads(json.dumps(shown(kind).document(), allow_nan=False))
    assert told


def test_figures_of_a_plan_with_a_maximised_objective_have_no_target():
    kind = KINDS["visibility"]
    for optimize, aimed in (("samples", True), ("visibility", False)):
        best = plan(PlanRequest(altitude=40, optimize=optimize, max_samples=60))
        found = visibility_of(best)
        assert ("target" in found.description()) == aimed
        words = [text.get_text() for text in drawn(kind, found, FigureStyle()).axes[0].texts]
        assert any(text.startswith("target") for text in words) == aimed
