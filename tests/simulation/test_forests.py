"""Random forests: tests of densities, sizes of occluders, stands that match a density, and
limits.
"""

import hashlib
import math
from itertools import pairwise

import numpy as np
import pytest

from aosplan.errors import RequestError
from aosplan.scenes.scene import Layer
from aosplan.simulation import forests
from aosplan.simulation.forests import clumped_forest, generator, layered_forest, uniform_forest


def test_samples_of_a_seed_differ_and_come_back():
    first, again, other, seed = (
        generator(*key).random(4).tolist() for key in ((1, 0), (1, 0), (1, 1), (2, 0))
    )
    assert first == again
    assert first != other
    assert first != seed


def test_a_uniform_forest_has_its_slice_density_in_every_slice():
    volume = uniform_forest(generator(1), 0.1, 0.25, 2.0, 10.0, (40.0, 30.0))
    assert volume.occupied.shape == (144, 360, 480)  # three voxels along the edge of a cube
    cubes = volume.slice_densities.reshape(48, 3)
    assert not cubes[:8].any()
    assert (cubes == cubes[:, :1]).all()
    error = math.sqrt(0.1 * 0.9 / (120 * 160))
    assert np.abs(cubes[8:] - 0.1).max() < 4.5 * error
    assert abs(cubes[8:].mean() - 0.1) < 4 * error / math.sqrt(40)


def test_a_uniform_forest_hides_the_share_of_equation_1():
    # A ray passes each of l/o slices with probability 1 - D.
    hidden = [
        uniform_forest(generator(2, i), 0.02, 0.5, 1.0, 14.75, (30.0, 30.0)).column_occupancy
        for i in range(30)
    ]
    expected = 1 - 0.98**29.5
    assert abs(np.mean(hidden) - expected) < 4 * np.std(hidden, ddof=1) / math.sqrt(30)


def lag_correlation(volume, level, lag, axis):
    plane = np.moveaxis(volume.occupied[level].astype(float), axis, 0)
    plane -= plane.mean()
    return (plane[lag:] * plane[: len(plane) - lag]).mean() / plane.var()


@pytest.mark.parametrize("axis", [0, 1])
def test_occluders_of_a_layer_have_their_size_and_its_triangle(axis):
    layers = [Layer(0.0, 0.5, 0.3, 0.5), Layer(4.0, 6.0, 0.3, 2.0)]
    lags = np.arange(0, 18, 3)
    found = []
    for i in range(12):
        volume = layered_forest(generator(3, i), layers, (100.0, 100.0))
        assert volume.voxel_m == pytest.approx(0.5 / 3)
        found.append([lag_correlation(volume, 25, lag, axis) for lag in lags])
    mean, error = np.mean(found, axis=0), np.std(found, axis=0, ddof=1) / math.sqrt(12)
    triangle = np.maximum(1 - lags / 12, 0)
    assert (np.abs(mean - triangle) <= 4.5 * error + 1e-12).all()


def test_a_thick_layer_is_several_slices_that_together_block_its_share():
    layer = Layer(2.0, 6.0, 0.6, 0.5)
    hidden = []
    for i in range(20):
        volume = layered_forest(generator(4, i), [layer], (40.0, 40.0))
        assert not volume.occupied[:12].any()
        cubes = volume.occupied[12:36].reshape(8, 3, -1)
        assert (cubes == cubes[:, :1]).all()
        assert all((one != other).any() for one, other in pairwise(cubes[:, 0]))
        hidden.append(volume.column_occupancy)
    assert abs(np.mean(hidden) - 0.6) < 4 * np.std(hidden, ddof=1) / math.sqrt(20)


@pytest.mark.parametrize("size", [1.0, 1.2, 1.9, 2.5, 3.0, 3.5, 7.3])
def test_planes_of_any_cell_size_have_that_integral_range(size):
    # The correlations of voxels at all whole lags add up to the size.
    width = forests.cell_width(size)
    lags = np.arange(-10, 11)
    assert np.maximum(1 - np.abs(lags) / width, 0).sum() == pytest.approx(size, rel=1e-9)


def test_empty_layers_make_bare_ground():
    volume = layered_forest(generator(1), [Layer(1.0, 2.0, 0.0, 0.5)], (5.0, 5.0))
    assert volume.canopy_top_m == 0.0


@pytest.mark.parametrize("density", [0.02, 0.567, pytest.param(0.95, marks=pytest.mark.slow)])
def test_a_clumped_stand_hides_the_requested_share(density):
    hidden = [
        clumped_forest(generator(5, i), density, 0.25, 2.5, 17.5, (30.0, 30.0)).column_occupancy
        for i in range(12)
    ]
    # The expected density of a stand matches. The difference is due only to the random choice of
    # leaves.
    assert np.std(hidden) < 0.01
    assert abs(np.mean(hidden) - density) < 0.004


def test_a_clumped_stand_is_within_its_heights_and_is_clumped():
    volume = clumped_forest(generator(6), 0.6, 0.25, 3.0, 15.0, (30.0, 30.0))
    levels = np.flatnonzero(volume.slice_densities)
    assert levels[0] >= 11
    assert volume.canopy_top_m <= 18.0 + 0.25
    # Independent slices with these densities would hide much more.
    independent = 1 - np.prod(1 - volume.slice_densities)
    assert independent > 0.68


def test_a_stand_without_density_is_bare_ground():
    assert clumped_forest(generator(1), 0.0, 0.5, 2.0, 10.0, (9.0, 9.0)).canopy_top_m == 0.0


def test_forests_stay_within_their_bound_of_voxels(monkeypatch):
    monkeypatch.setattr(forests, "MOST_VOXELS", 1 << 12)
    for make in (
        lambda: uniform_forest(generator(1), 0.1, 0.01, 2.0, 10.0, (9.0, 9.0)),
        lambda: layered_forest(generator(1), [Layer(1.0, 9.0, 0.4, 0.01)], (9.0, 9.0)),
        lambda: clumped_forest(generator(1), 0.4, 0.01, 2.0, 10.0, (9.0, 9.0)),
    ):
        volume = make()
        assert volume.occupied.size < 1.5 * (1 << 12)
        assert volume.voxel_m > 0.5
        assert volume.occupied.any()


def test_coarser_voxels_hide_the_same_share(monkeypatch):
    monkeypatch.setattr(forests, "MOST_VOXELS", 1 << 16)
    hidden = [
        uniform_forest(generator(8, i), 0.01, 0.1, 2.0, 10.0, (30.0, 30.0)).column_occupancy
        for i in range(20)
    ]
    assert abs(np.mean(hidden) - (1 - 0.99**100)) < 4 * np.std(hidden, ddof=1) / math.sqrt(20)


@pytest.mark.parametrize(
    ("make", "digest"),
    [
        (lambda rng: uniform_forest(rng, 0.05, 0.5, 2.0, 10.0, (12.0, 9.0)), "f0d5526dc1bd737c"),
        (
            lambda rng: layered_forest(rng, [Layer(1.0, 4.0, 0.3, 0.7)], (12.0, 9.0)),
            "c446e7edcbad8266",
        ),
        (lambda rng: clumped_forest(rng, 0.5, 0.5, 2.0, 10.0, (12.0, 9.0)), "caea477278104bb1"),
    ],
    ids=["uniform", "layered", "clumped"],
)
def test_a_seed_grows_the_same_forest_everywhere(make, digest):
    bits = np.packbits(make(generator(2026)).occupied).tobytes()
    assert hashlib.sha256(bits).hexdigest()[:16] == digest


def test_numbers_outside_their_domain_are_named():
    with pytest.raises(RequestError, match="slice density"):
        uniform_forest(generator(1), 1.5, 0.5, 2.0, 10.0, (9.0, 9.0))
    with pytest.raises(RequestError, match="density 1"):
        clumped_forest(generator(1), 1.0, 0.5, 2.0, 10.0, (9.0, 9.0))
