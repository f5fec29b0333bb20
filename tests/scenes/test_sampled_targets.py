"""A sample of a wide plot's targets has the same result for each target, and is representative."""

import numpy as np
import pytest
from support.forests import STANDS, clumped_forest

from aosplan.scenes import sampled_targets
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.occlusion import Occlusion, joint_counts
from aosplan.scenes.sampled_targets import LATTICES, SampledOcclusion, views_of
from aosplan.scenes.voxels import VoxelVolume


def random_volume(rows, columns, *, slices=9, slice_m=None, seed=0):
    rng = np.random.default_rng(seed)
    return VoxelVolume(rng.random((slices, rows, columns)) < 0.04, 0.5, slice_m=slice_m)


def sampled_bits(sampled, masks):
    """Shape (N, lattices, down, across), in the layout of the class."""
    octets = masks.view(np.uint8).reshape(len(masks), LATTICES, sampled._height, -1)
    return np.unpackbits(octets, axis=2, bitorder="little")


@pytest.mark.parametrize("slice_m", [None, 0.4])
@pytest.mark.parametrize("per_voxel", [1, 2, 4, 5])
@pytest.mark.parametrize(
    ("rows", "columns", "sample"), [(40, 70, 100), (33, 21, 400), (9, 90, 50), (40, 50, 2000)]
)
def test_each_target_sees_what_it_sees_among_all(rows, columns, sample, per_voxel, slice_m):
    volume = random_volume(rows, columns, slice_m=slice_m)
    everything = Occlusion(volume, 12.0, targets_per_voxel=per_voxel, focal_height_m=1.0)
    sampled = SampledOcclusion(everything, volume, sample)
    assert sampled.targets >= sample
    positions = np.random.default_rng(1).uniform(-15.0, 15.0, (12, 2))
    positions[0], positions[1] = (0.0, 0.0), (90.0, -120.0)  # farther than the plot, more than once
    want = everything.unpack(everything.masks(positions))
    got = sampled_bits(sampled, sampled.masks(positions))
    count, step = 0, sampled._step
    for lattice in range(LATTICES):
        x, y = (
            np.arange(first, length, step) * per_voxel + within
            for first, within, length in zip(
                sampled._first[lattice], sampled._within[lattice], (columns, rows), strict=True
            )
        )
        seen = got[:, lattice]
        np.testing.assert_array_equal(seen[:, : y.size, : x.size], want[:, y][:, :, x])
        assert not seen[:, y.size :].any()
        assert not seen[:, :, x.size :].any()
        count += x.size * y.size
    assert count == sampled.targets


def test_all_places_within_voxels_count_alike():
    sampled = SampledOcclusion(Occlusion(random_volume(60, 60), 12.0), random_volume(60, 60), 100)
    for axis in range(2):
        assert sorted(sampled._within[:, axis]) == [0, 1, 2, 3]
        assert len(set(sampled._first[:, axis])) == LATTICES
    assert sampled._step % 2
    half = SampledOcclusion(Occlusion(random_volume(60, 60), 12.0), random_volume(60, 60), 3600)
    assert half._step == 2
    assert half.targets == 3600


def test_only_wide_plots_are_sampled(monkeypatch):
    volume = random_volume(40, 40)
    assert isinstance(views_of(volume, 12.0), Occlusion)
    monkeypatch.setattr(sampled_targets, "FEW_TARGETS", 25_000)
    assert isinstance(views_of(volume, 12.0), SampledOcclusion)
    assert views_of(volume, 12.0).masks(np.empty((0, 2))).shape == (0, views_of(volume, 12.0).words)


def test_the_means_are_those_of_all_targets():
    volume = clumped_forest(STANDS["open_pine"], side_m=48.0)
    everything = Occlusion(volume, 80.0)
    sampled = SampledOcclusion(everything, volume, 30_000)
    positions = np.random.default_rng(1).uniform(-20.0, 20.0, (20, 2))
    want = joint_counts(everything.masks(positions)) / everything.targets
    got = joint_counts(sampled.masks(positions)) / sampled.targets
    # The standard error of a share of the same number of random targets.
    error = np.sqrt(want * (1.0 - want) / sampled.targets)
    assert np.sqrt((((got - want) / error) ** 2).mean()) < 1.0
    assert np.abs(got - want).max() < 4.0 * error.max()


def test_the_correlogram_of_a_sample_is_that_of_the_plot(monkeypatch):
    volume = clumped_forest(STANDS["spruce"], side_m=40.0)
    whole = correlogram(volume)
    monkeypatch.setattr(sampled_targets, "FEW_TARGETS", 0)
    sample = correlogram(volume)
    assert not np.array_equal(whole.rho, sample.rho)
    # of 0.1 million targets instead of a million
    assert np.abs(sample.rho - whole.rho).max() < 0.01
    assert np.abs(sample.density_by_offset - whole.density_by_offset).max() < 0.004
