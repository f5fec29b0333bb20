"""Each target in a sample has the same result as without sampling, and the sample is representative
of all targets of a large plot.
"""

import itertools

import numpy as np
import pytest
from support.forests import STANDS, clumped_forest

from aosplan.grid.patterns import pattern_for
from aosplan.models.measured import MeasuredModel
from aosplan.models.uncertainty import of_targets
from aosplan.scenes import sampled_targets
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.hidden_counts import joint_counts, popcount
from aosplan.scenes.occlusion import Occlusion, PlotWindow
from aosplan.scenes.sampled_targets import LATTICES, SampledOcclusion, occlusion_of
from aosplan.scenes.voxels import VoxelVolume


def random_volume(rows, columns, *, slices=9, slice_m=None, seed=0):
    rng = np.random.default_rng(seed)
    return VoxelVolume(rng.random((slices, rows, columns)) < 0.04, 0.5, slice_m=slice_m)


def sampled_bits(sampled, masks):
    """Masks as bits of shape (N, lattices, down, across), which is the layout of the class."""
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
    # These offsets are several times as large as the plot.
    positions[0], positions[1] = (0.0, 0.0), (90.0, -120.0)
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


def test_all_places_within_voxels_have_equal_weight():
    sampled = SampledOcclusion(Occlusion(random_volume(60, 60), 12.0), random_volume(60, 60), 100)
    for places in (sampled._within, sampled._first):
        assert len({tuple(place) for place in places.tolist()}) == LATTICES
    # The place of a lattice's first voxel is not correlated with the places of its targets in their
    # voxels.
    ranks = np.unique(sampled._first, return_inverse=True)[1].reshape(LATTICES, 2)
    for first, within in itertools.product(ranks.T, sampled._within.T):
        pairs = np.unique(np.column_stack([first, within]), axis=0, return_counts=True)
        assert len(pairs[0]) == LATTICES or abs(np.corrcoef(first, within)[0, 1]) < 0.5
    assert sampled._step % 2
    half = SampledOcclusion(Occlusion(random_volume(60, 60), 12.0), random_volume(60, 60), 14_400)
    assert half._step == 2
    assert half.targets == 14_400


def test_only_wide_plots_are_sampled(monkeypatch):
    volume = random_volume(40, 40)
    assert isinstance(occlusion_of(volume, 12.0), Occlusion)
    monkeypatch.setattr(sampled_targets, "FEW_TARGETS", 25_000)
    assert isinstance(occlusion_of(volume, 12.0), SampledOcclusion)
    assert occlusion_of(volume, 12.0).masks(np.empty((0, 2))).shape == (
        0,
        occlusion_of(volume, 12.0).words,
    )


def test_the_means_are_those_of_all_targets():
    volume = clumped_forest(STANDS["open_pine"], side_m=48.0)
    everything = Occlusion(volume, 80.0)
    sampled = SampledOcclusion(everything, volume, 30_000)
    positions = np.random.default_rng(1).uniform(-20.0, 20.0, (20, 2))
    want = joint_counts(everything.masks(positions)) / everything.targets
    got = joint_counts(sampled.masks(positions)) / sampled.targets
    # This would be the standard error of a share if the targets were random.
    error = np.sqrt(want * (1.0 - want) / sampled.targets)
    assert np.sqrt((((got - want) / error) ** 2).mean()) < 1.0
    assert np.abs(got - want).max() < 4.0 * error.max()


@pytest.mark.parametrize("per_voxel", [1, 4])
@pytest.mark.parametrize("window", [None, (8, 16, 88, 52), (12, 20, 120, 160)])
def test_targets_in_a_window_and_cells(per_voxel, window):
    volume = random_volume(40, 61)
    everything = Occlusion(volume, 12.0, targets_per_voxel=per_voxel)
    sampled = SampledOcclusion(everything, volume, 700)
    scale = per_voxel / 4.0
    inside = window and PlotWindow(*(int(number * scale) for number in window))
    masks = sampled.masks([(1.5, -2.0), (0.0, 4.0)])
    mask = np.full(sampled.words, ~np.uint64(0)) if inside is None else sampled.mask_of(inside)
    bits = sampled_bits(sampled, masks & mask)
    x, y = (
        (sampled._first[:, axis, None] + sampled._step * np.arange(size)) * per_voxel
        + sampled._within[:, axis, None]
        for axis, size in enumerate((bits.shape[3], bits.shape[2]))
    )
    row, column, rows, columns = inside or (0, 0, everything.rows, everything.columns)
    east = (x >= column) & (x < column + columns)
    north = (y >= row) & (y < row + rows)
    which = north[:, :, None] & east[:, None, :]
    np.testing.assert_array_equal(bits, sampled_bits(sampled, masks) * which)
    if inside is not None:
        assert sampled.targets_in(inside) == which.sum() == popcount(mask)
    # Each cell contains one target of each lattice. If the targets of a cell are sorted by their
    # place in the cell, they are in the order of the lattices.
    cells = sampled.unpack(masks, inside)
    size = sampled._step * per_voxel
    first = -(-row // size), -(-column // size)
    down, across = (row + rows) // size - first[0], (column + columns) // size - first[1]
    assert cells.shape == (2, 4 * down, 4 * across)
    assert down > 0 < across
    for lattice, (j, i) in enumerate(np.ndindex(4, 4)):
        want = sampled_bits(sampled, masks)[:, lattice, first[0] :, first[1] :]
        np.testing.assert_array_equal(cells[:, j::4, i::4], want[:, :down, :across])


@pytest.mark.parametrize("edges", ["wrapped", "interior"])
@pytest.mark.parametrize("baseline_m", [0.5, 1.5, 4.0])
def test_a_plan_on_a_sample_is_predicted_as_on_all_targets(edges, baseline_m):
    volume = clumped_forest(STANDS["open_pine"], side_m=48.0)
    pattern = pattern_for("trimmed", 4)
    every = MeasuredModel(volume, 80.0, edges=edges)
    sample = MeasuredModel(volume, 80.0, edges=edges)
    sample.occlusion = SampledOcclusion(every.occlusion, volume, 120_000)
    want, got = every.predict(pattern, baseline_m), sample.predict(pattern, baseline_m)
    # The sample is a fifth of all targets. The standard errors are computed as for the same number
    # of random targets.
    error = np.sqrt(want.density * want.transparency / sample.occlusion.targets)
    assert abs(got.density - want.density) < 3.0 * error
    assert abs(got.expected - want.expected) < 3.0 * error
    assert abs(got.normalized - want.normalized) < 3.0 * error / want.density / want.transparency
    known, found = (
        of_targets(model.hidden_share(pattern, baseline_m), model.occlusion.targets_per_cell)
        for model in (every, sample)
    )
    for name in ("density", "expected", "normalized"):
        assert getattr(found, name) == pytest.approx(getattr(known, name), rel=0.1)


def test_wide_plots_have_fewer_targets_in_perspective(monkeypatch):
    volume = clumped_forest(STANDS["open_pine"], side_m=24.0)
    cameras = np.random.default_rng(2).uniform(-5.0, 5.0, (6, 2))
    every = occlusion_of(volume, 80.0, view="perspective")
    monkeypatch.setattr(sampled_targets, "FEW_TARGETS", every.targets // 4)
    fewer = occlusion_of(volume, 80.0, view="perspective")
    assert fewer.targets == every.targets // 4
    want = joint_counts(every.masks(cameras)) / every.targets
    assert np.abs(joint_counts(fewer.masks(cameras)) / fewer.targets - want).max() < 0.004


@pytest.mark.slow
def test_the_correlogram_of_a_sample_is_that_of_the_plot(monkeypatch):
    volume = clumped_forest(STANDS["spruce"], side_m=40.0)
    whole = correlogram(volume)
    monkeypatch.setattr(sampled_targets, "FEW_TARGETS", 0)
    monkeypatch.setattr(sampled_targets, "SAMPLE", 100_000)
    sample = correlogram(volume)
    assert not np.array_equal(whole.rho, sample.rho)
    # The sample has 0.1 million targets instead of a million.
    assert np.abs(sample.rho - whole.rho).max() < 0.01
    assert np.abs(sample.density_by_offset - whole.density_by_offset).max() < 0.004
