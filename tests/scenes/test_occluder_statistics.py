"""Layers and occluder sizes of a voxel volume."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.forests import STANDS, clumped_forest
from support.paths import CLOUDS

from aosplan.camera.disparity import coverage_baseline
from aosplan.scenes import occluder_statistics
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.occluder_statistics import densities_off_nadir, integral_range, layered_scene
from aosplan.scenes.voxels import VoxelVolume

DATA = CLOUDS


def blocks(rng, size, density, cells=192):
    """A mask of blocks of size x size cells that are occupied at random, with a random phase."""
    coarse = rng.random((cells // size, cells // size)) < density
    mask = np.kron(coarse, np.ones((size, size))) > 0
    return np.roll(mask, rng.integers(0, size, 2), axis=(0, 1))


def volume(occupied, **given):
    return VoxelVolume(np.asarray(occupied, dtype=bool), **({"voxel_m": 0.5} | given))


# --- Occluder size ---


@pytest.mark.parametrize("density", [0.001, 0.01, 0.1, 0.5, 0.9])
def test_independent_cells_are_one_cell_large(density):
    rng = np.random.default_rng(1)
    ranges = [integral_range(rng.random((108, 104)) < density) for _ in range(40)]
    assert np.mean(ranges) == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("size", [2, 4, 8])
@pytest.mark.parametrize("density", [0.02, 0.1, 0.5])
def test_the_measured_size_of_blocks_is_their_true_size(size, density):
    rng = np.random.default_rng(size)
    ranges = [integral_range(blocks(rng, size, density)) for _ in range(40)]
    assert np.mean(ranges) == pytest.approx(size, rel=0.09)


def test_the_measured_size_of_one_block_on_an_empty_plot_is_its_true_size():
    mask = np.zeros((64, 80), dtype=bool)
    mask[10:16, 20:26] = True
    assert integral_range(mask) == pytest.approx(6.0, rel=0.02)


def test_a_clump_across_the_edge_counts_as_one():
    mask = np.zeros((40, 60), dtype=bool)
    mask[5:10, 20:25] = True
    across = np.roll(mask, (-7, 37), axis=(0, 1))
    assert integral_range(across) == pytest.approx(integral_range(mask), rel=1e-5)


def test_oblong_clumps_have_the_size_of_their_area():
    mask = np.zeros((128, 128), dtype=bool)
    mask[20:22, 30:38] = True
    assert integral_range(mask) == pytest.approx(4.0, rel=0.02)


def test_a_full_slice_is_one_occluder_as_large_as_the_plot():
    assert integral_range(np.ones((7, 12), dtype=bool)) == 7.0


@pytest.mark.parametrize("shape", [(1, 2), (1, 50), (50, 1), (2, 2), (3, 3)])
def test_narrow_plots_have_a_size_too(shape):
    mask = np.zeros(shape, dtype=bool)
    mask[0, 0] = True
    assert integral_range(mask) == pytest.approx(1.0, abs=0.15)


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 12))
def test_every_mask_has_a_size_within_the_plot(seed, rows, columns):
    rng = np.random.default_rng(seed)
    mask = rng.random((rows, columns)) < rng.random()
    mask[rng.integers(rows), rng.integers(columns)] = True
    assert 0.5 < integral_range(mask) <= max(rows, columns)


@given(st.integers(0, 2**32 - 1))
def test_a_mask_and_its_complement_have_the_same_size(seed):
    mask = np.random.default_rng(seed).random((16, 20)) < 0.3
    assert integral_range(mask) == pytest.approx(integral_range(~mask), rel=1e-3)


# --- Layers ---


def test_layers_are_the_slices_with_occupied_voxels():
    occupied = np.zeros((6, 4, 5))
    occupied[2, 0, 0] = 1
    occupied[3, :2] = 1
    occupied[5, 3, 4] = 1
    scene = layered_scene(volume(occupied, min_height_m=1.0, source="a.laz"), "stand")
    assert [layer[:3] for layer in scene.layers] == [
        (1.0, 1.5, 0.05),
        (1.5, 2.0, 0.5),
        (2.5, 3.0, 0.05),
    ]
    assert (scene.name, scene.source, scene.voxel_m) == ("stand", "a.laz", 0.5)
    assert scene.measured_density == scene.integrated_density == 11 / 20
    assert scene.canopy_top_m == 3.0


def test_occluder_sizes_are_in_metres():
    occupied = np.stack([blocks(np.random.default_rng(2), 4, 0.1) for _ in range(20)])
    scene = layered_scene(volume(occupied, voxel_m=0.25), "blocks")
    assert np.mean([layer.occluder_size_m for layer in scene.layers]) == pytest.approx(1.0, rel=0.1)


def test_the_lowest_layer_begins_at_the_cut():
    occupied = np.ones((3, 2, 2))
    occupied[0] = 0
    scene = layered_scene(volume(occupied, min_height_m=0.7), "stand")
    assert [layer[:2] for layer in scene.layers] == [(0.7, 1.0), (1.0, 1.5)]


@pytest.mark.parametrize("slices", [0, 5])
def test_bare_ground_is_a_scene_without_occluders(slices):
    scene = layered_scene(volume(np.zeros((slices, 3, 3)), min_height_m=2.0), "meadow")
    assert scene.integrated_density == 0.0
    assert scene.canopy_top_m == 0.0
    assert scene.slabs() == ()


# --- A real plot ---


@pytest.mark.parametrize(("cut", "baseline"), [(2.0, 4.0), (1.0, 5.9), (0.5, 7.6)])
def test_low_vegetation_determines_the_coverage_rule_on_a_real_plot(cut, baseline):
    pytest.importorskip("laspy")
    path = DATA / "UAS_Clip.laz"
    if not path.exists():
        pytest.skip("UAS_Clip.laz is not at hand")
    from aosplan.scenes.files.point_cloud import read_voxels

    scene = layered_scene(read_voxels(path, min_height_m=cut), "UAS")
    rule = coverage_baseline(scene.slabs(), 50.0, 1e5, 0.98)
    assert rule.baseline_m == pytest.approx(baseline, rel=0.04)


# --- Wide masks ---


def crowns(side, count, radius, seed=0):
    """A periodic mask of random discs, in which half of the cells are leafy."""
    rng = np.random.default_rng(seed)
    mask = np.zeros((side, side), dtype=bool)
    disc = np.hypot(*np.mgrid[-radius : radius + 1, -radius : radius + 1]) <= radius
    for at in rng.integers(0, side, (count, 2)):
        rows, columns = (np.arange(-radius, radius + 1) + at[:, None]) % side
        mask[np.ix_(rows, columns)] |= disc
    return mask & (rng.random(mask.shape) < 0.5)


@pytest.mark.parametrize("radius", [3, 12, 40])
def test_the_integral_range_of_a_wide_mask_is_that_of_all_its_pairs(monkeypatch, radius):
    mask = crowns(1040, 200_000 // radius**2, radius)
    monkeypatch.setattr(occluder_statistics, "FEW_CELLS", mask.size)
    whole = integral_range(mask)
    monkeypatch.setattr(occluder_statistics, "FEW_CELLS", 0)
    assert integral_range(mask) == pytest.approx(whole, rel=0.03)
    assert integral_range(mask) != whole


def test_near_lags_are_means_over_the_pairs_of_windows():
    mask = crowns(70, 20, 4)
    density = mask.mean()
    rings = occluder_statistics.near_rings(mask, density, 5, 70)
    want = np.zeros(9)
    for y in range(-4, 5):
        for x in range(-4, 5):
            one = mask[max(y, 0) : 70 + min(y, 0), max(x, 0) : 70 + min(x, 0)] - density
            other = mask[max(-y, 0) : 70 - max(y, 0), max(-x, 0) : 70 - max(x, 0)] - density
            want[round(math.hypot(x, y))] += (one * other).mean()
    np.testing.assert_allclose(rings, want[:5], atol=1e-5)


def test_block_sums_are_the_sums_of_whole_blocks():
    mask = np.random.default_rng(0).random((50, 43)) < 0.7
    for block in (8, 16):
        got = occluder_statistics.block_sums(mask, block)
        want = [
            [mask[y : y + block, x : x + block].sum() for x in range(0, 43 - block + 1, block)]
            for y in range(0, 50 - block + 1, block)
        ]
        np.testing.assert_array_equal(got, want)


# --- Off nadir ---


def test_densities_off_nadir_are_those_of_the_correlogram(monkeypatch):
    stand = clumped_forest(STANDS["beech"], side_m=12.0)
    pairs = densities_off_nadir(stand)
    assert pairs[0] == [0.0, stand.column_occupancy]
    table = correlogram(stand)
    for angle, density in pairs[1:]:
        lag, around = np.full(180, np.tan(np.radians(angle))), np.arange(180.0)
        assert density == pytest.approx(table.density_at(lag, around).mean(), abs=0.01)
    monkeypatch.setattr("aosplan.scenes.sampled_targets.FEW_TARGETS", 0)
    for sampled, whole in zip(densities_off_nadir(stand), pairs, strict=True):
        assert sampled == pytest.approx(whole, abs=0.005)


def test_bare_ground_hides_nothing_off_nadir():
    assert densities_off_nadir(volume(np.zeros((0, 3, 3))))[-1] == [40.0, 0.0]
