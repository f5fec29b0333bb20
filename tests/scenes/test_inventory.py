"""Inventories: the closed form is compared with random crowns and with numerical integrals."""

import math

import mpmath
import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.scenes.files.toml_file import read_scene_file
from aosplan.scenes.inventory import crown_absorption, inventory_scene

STAND = {
    "stems_per_hectare": 400.0,
    "crown_diameter_m": 5.0,
    "leaf_area_index": 3.0,
    "volume_base_m": 6.0,
    "volume_height_m": 10.0,
}


def scene(**change):
    return inventory_scene("stand", **(STAND | change))


def thrown(seed, *, stems_per_hectare, crown_diameter_m, leaf_area_index, **lengths):
    """The share of vertical rays that random crowns block: its mean and standard error over plots.

    The optical depth of a ray is the sum over crowns of half the leaf density times the path in the
    crown.
    """
    rng = np.random.default_rng(seed)
    side, radius, half = 100.0, crown_diameter_m / 2, lengths["volume_height_m"] / 2
    volume = 4.0 / 3.0 * math.pi * radius**2 * half
    leaf_density = leaf_area_index / (stems_per_hectare / 1e4 * volume)
    hidden = []
    for _ in range(60):
        trees = rng.uniform(0.0, side, (rng.poisson(stems_per_hectare * side**2 / 1e4), 2))
        rays = rng.uniform(0.0, side, (400, 2))
        apart = np.abs(rays[:, None] - trees[None])
        apart = np.minimum(apart, side - apart)
        inside = np.clip(1.0 - (apart**2).sum(axis=2) / radius**2, 0.0, None)
        path = (2.0 * half * np.sqrt(inside)).sum(axis=1)
        hidden.append(1.0 - np.exp(-0.5 * leaf_density * path).mean())
    return np.mean(hidden), np.std(hidden, ddof=1) / math.sqrt(len(hidden))


@pytest.mark.parametrize(
    ("seed", "change"),
    [
        (1, {}),
        (2, {"leaf_area_index": 0.8, "stems_per_hectare": 150.0}),
        (3, {"leaf_area_index": 6.0, "crown_diameter_m": 3.0, "stems_per_hectare": 900.0}),
        (4, {"volume_height_m": 3.0, "crown_diameter_m": 8.0, "stems_per_hectare": 80.0}),
    ],
)
def test_random_crowns_hide_the_share_of_the_inventory_scene(seed, change):
    share, error = thrown(seed, **(STAND | change))
    assert error < 0.01
    assert scene(**change).integrated_density == pytest.approx(share, abs=4.0 * error)


@pytest.mark.parametrize("depth", [0.0, 1e-9, 0.03, 0.5, 0.999, 1.0, 1.001, 3.0, 40.0, 1e4])
def test_the_absorption_of_a_crown_equals_its_integral(depth):
    with mpmath.workdps(40):
        passed = mpmath.quad(
            lambda w: 2 * w * mpmath.exp(-mpmath.mpf(depth) * w), [0, min(1, 30 / (depth + 1)), 1]
        )
        assert crown_absorption(depth) == pytest.approx(float(1 - passed), rel=1e-13)


def test_thin_leaves_obey_beer_lambert_and_dense_ones_leave_the_gaps():
    assert scene(leaf_area_index=1e-7).integrated_density == pytest.approx(0.5e-7, rel=1e-6)
    cover = 1.0 - math.exp(-0.04 * math.pi * 2.5**2)
    assert scene(leaf_area_index=1e6).integrated_density == pytest.approx(cover, rel=1e-9)


def test_slices_share_the_leaves_as_an_ellipsoid_does():
    stand = scene(occluder_size_m=0.5)
    assert [stand.layers[0].bottom_m, stand.layers[-1].top_m] == [6.0, 16.0]
    depths = [-math.log1p(-layer.density) for layer in stand.layers]
    heights = np.linspace(-1.0, 1.0, 2001)
    # Cross-sections at many heights are added slice by slice.
    middles = 0.5 * (heights[1:] + heights[:-1])
    shares = (1.0 - middles**2).reshape(20, 100).sum(axis=1)
    assert np.allclose(np.array(depths) / sum(depths), shares / shares.sum(), rtol=1e-5)


def test_an_inventory_without_leaves_hides_nothing():
    assert scene(leaf_area_index=0.0).integrated_density == 0.0


@given(st.floats(1e-6, 1e9), st.floats(1e-6, 1e9), st.floats(0.0, 1e9), st.floats(1e-6, 1e9))
def test_any_inventory_gives_a_share_between_0_and_1(stems, crown, leaves, size):
    stand = scene(
        stems_per_hectare=stems,
        crown_diameter_m=crown,
        leaf_area_index=leaves,
        occluder_size_m=size,
    )
    assert 0.0 <= stand.integrated_density <= 1.0
    assert len(stand.layers) <= 500


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("stems_per_hectare", 0.0),
        ("crown_diameter_m", -1.0),
        ("leaf_area_index", -0.1),
        ("volume_height_m", 0.0),
        ("volume_base_m", -1.0),
        ("occluder_size_m", 0.0),
        ("leaf_area_index", math.nan),
    ],
)
def test_a_number_outside_its_domain_is_named(name, value):
    with pytest.raises(RequestError, match="scene 'stand'"):
        scene(**{name: value})


def test_an_inventory_states_its_assumptions():
    assert "G = 0.5" in scene().assumed
    assert "from 6 to 16 m" in scene().assumed
    assert "Nilson" in scene().source


def test_options_and_a_file_give_the_same_plan(tmp_path):
    path = tmp_path / "stand.toml"
    path.write_text(tomli_w.dumps({"name": "custom", **STAND}))
    by_file = plan(PlanRequest(altitude=50, scene=str(path)))
    names = {name.removesuffix("_m"): value for name, value in STAND.items()}
    by_options = plan(PlanRequest(altitude=50, **names))
    assert by_options.solution == by_file.solution
    assert by_options.model == "layered"
    assert by_options.scene == by_file.scene == read_scene_file(str(path)).scene
    again = plan(PlanRequest(**by_options.request.document()))
    assert again.document() == by_options.document()


def test_an_inventory_is_shown_and_saved_by_the_command_line(tmp_path, capsys):
    path = tmp_path / "saved.toml"
    options = [
        part
        for name, value in STAND.items()
        for part in (f"--{name.removesuffix('_m').replace('_', '-')}", str(value))
    ]
    assert run(["scene", *options, "--save", str(path)]) == 0
    assert "p = 47.1 %" in capsys.readouterr().out
    saved = read_scene_file(str(path)).scene
    assert saved.integrated_density == pytest.approx(scene().integrated_density, rel=1e-12)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({k: v for k, v in STAND.items() if k != "leaf_area_index"}, "lacks leaf_area_index"),
        (STAND | {"density": 0.1}, "stems and crowns and density"),
        (STAND | {"layers": []}, "has layers and stems_per_hectare"),
        (STAND | {"crown_diametre_m": 3.0}, "unknown name 'crown_diametre_m'"),
    ],
)
def test_a_file_that_is_half_an_inventory_is_named(tmp_path, table, said):
    path = tmp_path / "stand.toml"
    path.write_text(tomli_w.dumps({"name": "stand", **table}))
    with pytest.raises(RequestError, match=said):
        read_scene_file(str(path))


@pytest.mark.parametrize("missing", ["crown_diameter", "leaf_area_index", "volume_height"])
def test_half_an_inventory_on_the_command_line_is_named(missing):
    names = {name.removesuffix("_m"): value for name, value in STAND.items()}
    del names[missing]
    with pytest.raises(RequestError, match=f"needs --{missing.replace('_', '-')}"):
        PlanRequest(altitude=40, **names)
    with pytest.raises(RequestError, match="needs a density or --stems-per-hectare"):
        PlanRequest(altitude=40, crown_diameter=5.0)
