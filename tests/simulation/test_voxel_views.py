"""Counts of hidden targets do not depend on tiles and windows, and agree with known models."""

import numpy as np
import pytest

from aosplan.grid.patterns import Pattern, local_sites, pattern_for
from aosplan.scenes.occlusion import Occlusion, PlotWindow
from aosplan.scenes.scene import Layer
from aosplan.simulation import voxel_views as voxels
from aosplan.simulation.forests import clumped_forest, generator, layered_forest, uniform_forest
from aosplan.simulation.moments import estimate
from aosplan.simulation.voxel_views import VoxelViews, blocks, tiles

VIEWS = ("telecentric", "perspective")


def sites(samples, baseline_m):
    return np.column_stack(local_sites(pattern_for("trimmed", samples), baseline_m, 0.0))


@pytest.fixture(scope="module")
def stand():
    return clumped_forest(generator(1), 0.6, 0.5, 2.0, 12.0, (21.0, 16.5))


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("window", [(0, 0, 132, 168), (5, 13, 60, 70), (131, 160, 1, 8)])
def test_a_window_shows_the_same_targets_as_the_whole_plot(stand, view, window):
    positions = [(0.0, 0.0), (3.1, -2.2), (-9.0, 14.0)]
    whole = Occlusion(stand, 30.0, view=view)
    part = Occlusion(stand, 30.0, view=view, window=PlotWindow(*window))
    row, column, rows, columns = window
    seen = whole.unpack(whole.masks(positions))
    assert (whole.rows, whole.columns) == (132, 168)
    assert seen.any()
    expected = seen[:, row : row + rows, column : column + columns]
    assert np.array_equal(part.unpack(part.masks(positions)), expected)


@pytest.mark.parametrize("view", VIEWS)
def test_counts_do_not_depend_on_tiles_and_batches(stand, view, monkeypatch):
    positions = sites(12, 1.7)
    window = PlotWindow(3, 7, 101, 150)
    whole = VoxelViews(stand, 30.0, view=view, window=window)
    counts, blocked = whole.counts(positions), whole.blocked_views(positions)
    monkeypatch.setattr(voxels, "TILE_TARGETS", 900)
    monkeypatch.setattr(voxels, "BATCH_OCTETS", 2000)
    pieces = VoxelViews(stand, 30.0, view=view, window=window)
    assert pieces.counts(positions) == counts
    assert np.array_equal(pieces.blocked_views(positions), blocked)


def test_images_and_counts_are_the_same_experiment(stand):
    experiment = VoxelViews(stand, 30.0)
    counts = experiment.counts(sites(9, 2.0))
    blocked = experiment.blocked_views(sites(9, 2.0)).astype(int)
    assert counts == (9, blocked.size, blocked.sum(), (blocked**2).sum())


@pytest.mark.parametrize("most", [1, 63, 64, 1000, 10**6])
def test_tiles_cover_a_window_once(most):
    window = PlotWindow(2, 3, 45, 131)
    seen = np.zeros((50, 140), dtype=int)
    for row, column, rows, columns in tiles(window, most):
        assert rows * columns <= max(most, 64)
        seen[row : row + rows, column : column + columns] += 1
    assert (seen[2:47, 3:134] == 1).all()
    assert seen.sum() == 45 * 131


def test_blocks_cover_a_window_once():
    seen = np.zeros((20, 20), dtype=int)
    for row, column, rows, columns in blocks(PlotWindow(1, 2, 13, 5), 4, 7):
        seen[row : row + rows, column : column + columns] += 1
    assert (seen[1:14, 2:7] == 1).all()
    assert seen.sum() == 13 * 5


def middle(volume, size_m):
    _, rows, columns = volume.occupied.shape
    across, along = (int(length / volume.voxel_m) * 4 for length in size_m)
    return PlotWindow((4 * rows - along) // 2, (4 * columns - across) // 2, along, across)


def simulated(make, altitude_m, positions, view, samples, size_m):
    counts = []
    for i in range(samples):
        volume = make(generator(11, i))
        window = middle(volume, size_m)
        counts.append(VoxelViews(volume, altitude_m, view=view, window=window).counts(positions))
    return estimate(counts)


def slanted_density(transparency, altitude_m, positions):
    """Mean over cameras of the share of targets that cubes hide, which is 1 - T^(1 + |tan x| + |tan
    y|).
    """
    return (1 - transparency ** (1 + np.abs(positions).sum(axis=1) / altitude_m)).mean()


def test_cubes_hide_what_slanted_rays_meet():
    # The paper's volume has p = 1 - (1 - D)^(l/o) for vertical rays.
    positions = sites(9, 5.0)
    found = simulated(
        lambda rng: uniform_forest(rng, 0.01, 0.25, 2.0, 10.0, (20.0, 20.0)),
        *(40.0, positions, "telecentric", 8, (14.0, 14.0)),
    )
    expected = slanted_density(0.99**40, 40.0, positions)
    assert 8 * found.density_standard_error < expected - (1 - 0.99**40)
    assert abs(found.density - expected) < 4 * found.density_standard_error


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("baseline_m", [0.6, 3.0])
def test_independent_slices_have_the_covariances_that_design_gives_them(view, baseline_m):
    layers = [
        Layer(2.0, 2.5, 0.15, 0.5),
        Layer(5.0, 6.0, 0.1, 1.0),
        Layer(8.0, 8.5, 0.2, 0.5),
        Layer(11.0, 12.5, 0.15, 1.5),
    ]
    pattern = Pattern(4, 4)
    positions = np.column_stack(local_sites(pattern, baseline_m, 0.0))
    found = simulated(
        lambda rng: layered_forest(rng, layers, (24.0, 24.0)),
        *(60.0, positions, view, 60, (12.0, 12.0)),
    )
    # K is computed from a product over slices for each pair of views (section 4.1 of the
    # derivation).
    apart = np.abs(positions[:, None] - positions[None])
    both, clear = 1.0, 1.0
    for layer in layers:
        reach = layer.occluder_size_m * 60.0 / layer.height_m
        tau = np.maximum(1 - apart / reach, 0).prod(axis=2)
        both = both * ((1 - layer.density) ** 2 + layer.density * (1 - layer.density) * tau)
        clear *= 1 - layer.density
    shortfall = (both - clear**2).mean() / (clear * (1 - clear))
    # Oblique rays and the thickness of cubes change K by up to one per cent, as documented.
    slack = 4 * found.normalized_standard_error + 0.01 * shortfall
    assert abs(1 - found.normalized - shortfall) < slack
    assert found.normalized_standard_error < 0.02
