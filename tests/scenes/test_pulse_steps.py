"""The steps from pulses to attenuation.  Each step is compared with known results."""

import numpy as np
import pytest

from aosplan.errors import RequestError
from aosplan.scenes.pulses import attenuation, clean, grouping, realise, sensor_track, trace
from aosplan.scenes.pulses.returns import Returns
from aosplan.scenes.pulses.trajectory import read_trajectory


def returns_of(xyz, number, total, *, line=0, time_s=None, intensity=1.0):
    xyz = np.asarray(xyz, dtype=np.float64).reshape(-1, 3).T
    count = xyz.shape[1]
    return Returns(
        xyz,
        np.asarray(number, dtype=np.uint8),
        np.asarray(total, dtype=np.uint8),
        np.broadcast_to(np.asarray(line, dtype=np.int32), count).copy(),
        np.zeros(count) if time_s is None else np.asarray(time_s, dtype=np.float64),
        np.broadcast_to(np.asarray(intensity, dtype=np.float32), count).copy(),
        np.round(xyz * 1000).astype(np.int32),
    )


def flat(rows, columns, voxel_m, slices, cut_m=0.0):
    ground = np.zeros((rows + 1, columns + 1), dtype=np.float32)
    return trace.VoxelGrid(ground, voxel_m, slices, cut_m, (columns * voxel_m, rows * voxel_m))


def test_exact_duplicates_are_removed_and_the_order_is_kept():
    one = returns_of([[1, 2, 3], [4, 5, 6], [1, 2, 3], [1, 2, 3]], [1, 1, 1, 2], [2, 1, 2, 2])
    kept = clean.without_duplicates(one)
    # The last point has the same position but another return number.
    assert kept.xyz_m[0].tolist() == [1, 4, 1]
    assert kept.number.tolist() == [1, 1, 2]


def test_lines_are_cut_at_pauses_and_dropped_without_low_returns():
    xyz = np.zeros((6, 3))
    found = returns_of(xyz, [1] * 6, [1] * 6, line=[7, 7, 7, 3, 3, 3], time_s=[0, 1, 60, 0, 1, 2])
    split = clean.split_lines(found, timed=True)
    assert split.line.tolist() == [1, 1, 2, 0, 0, 0]
    low = np.array([False, True, False, False, False, True])
    assert clean.lines_with_ground(split, low).tolist() == [True, True, False, True, True, True]


def test_pulses_are_grouped_by_order_and_return_number():
    number = [1, 2, 1, 1, 2, 3, 2, 3, 1, 3]
    total = [2, 2, 1, 3, 3, 3, 3, 3, 2, 3]
    found, pulses, share = grouping.grouped(
        returns_of(np.zeros((10, 3)), number, total), timed=False
    )
    members = [found.number[i:k].tolist() for i, k in zip(pulses.first, pulses.stop, strict=True)]
    # A pulse is complete if it has its last return, even if its first return was clipped. The
    # return (1 of 2) alone is not complete. The return (3 of 3) alone is complete.
    assert members == [[1, 2], [1], [1, 2, 3], [2, 3], [3]]
    assert share == pytest.approx(5 / 6)


def test_shuffled_files_are_put_into_the_order_of_time():
    rng = np.random.default_rng(3)
    number, total = np.tile([1, 2, 3], 500), np.full(1500, 3)
    time_s = np.repeat(np.arange(500) * 1e-3, 3)
    order = rng.permutation(1500)
    shuffled = returns_of(np.zeros((1500, 3)), number, total, time_s=time_s).take(order)
    _, pulses, share = grouping.grouped(shuffled, timed=True)
    assert (len(pulses), share) == (500, 1.0)


@pytest.mark.parametrize(("gain", "plausible"), [(1.0, True), (0.3, False)])
def test_intensities_are_energies_only_if_they_add_up(gain, plausible):
    """Intensities are energies if the returns of a pulse share its energy, but not if weak returns
    are amplified.
    """
    rng = np.random.default_rng(5)
    share = rng.uniform(0.2, 0.8, 600)
    energy = np.concatenate([np.ones(600), np.column_stack([share, 1 - share]).ravel()])
    low = np.concatenate([np.arange(600) % 2 == 0, np.tile([False, True], 600)])
    number = np.concatenate([np.ones(600), np.tile([1, 2], 600)])
    total = np.concatenate([np.ones(600), np.full(1200, 2)])
    intensity = np.where(low, 900.0, 400.0) * energy**gain
    found = returns_of(np.zeros((1800, 3)), number, total, intensity=intensity)
    _, pulses, _ = grouping.grouped(found, timed=False)
    energies = grouping.intensity_energies(found, pulses, low)
    assert (energies is not None) is plausible
    if energies is not None:
        assert energies == pytest.approx(energy, abs=1e-6)


def test_wide_beams_without_single_returns_from_the_canopy_are_calibrated():
    """In foliage, a wide beam has several returns.  The intensity of the canopy is then known from
    the pulses that also reach the ground.
    """
    rng = np.random.default_rng(6)
    share = rng.uniform(0.2, 0.8, 600)
    energy = np.concatenate([np.ones(600), np.column_stack([share, 1 - share]).ravel()])
    low = np.concatenate([np.ones(600, np.bool_), np.tile([False, True], 600)])
    number = np.concatenate([np.ones(600), np.tile([1, 2], 600)])
    total = np.concatenate([np.ones(600), np.full(1200, 2)])
    intensity = np.where(low, 900.0, 400.0) * energy
    found = returns_of(np.zeros((1800, 3)), number, total, intensity=intensity)
    _, pulses, _ = grouping.grouped(found, timed=False)
    assert grouping.intensity_energies(found, pulses, low) == pytest.approx(energy, abs=1e-6)


def flown_pulses(rng, count=400, noise_m=0.01):
    """Pulses of two returns from a moving sensor, and the positions of the sensor."""
    time_s = np.sort(rng.uniform(100.0, 103.0, count))
    sensor = np.array([[-20.0], [5.0], [90.0]]) + np.array([[1.0], [8.0], [0.3]]) * (time_s - 100)
    low = np.stack([*rng.uniform(0, 25, (2, count)), rng.uniform(0, 3, count)])
    share = rng.uniform(0.05, 0.2, count)
    high = low + (sensor - low) * share
    xyz = np.stack([high, low], axis=2).reshape(3, -1).T
    xyz = xyz + noise_m * rng.standard_normal(xyz.shape)
    return returns_of(
        xyz, np.tile([1, 2], count), np.full(2 * count, 2), time_s=np.repeat(time_s, 2)
    ), sensor


def test_the_sensor_track_is_found_despite_outlier_pulses():
    rng = np.random.default_rng(11)
    found, sensor = flown_pulses(rng)
    wild = rng.choice(800, 60, replace=False)
    found.xyz_m[:, wild] += rng.uniform(-2, 2, (3, 60))
    _, pulses, _ = grouping.grouped(found, timed=True)
    at = sensor_track.fitted(found, pulses)
    assert at is not None
    missed = at.at(found.time_s[pulses.first]) - sensor
    # An error of 0.01 m over distances of 5 to 20 m is about 0.1° per pulse. 340 pulses determine
    # the position of the sensor.
    assert np.abs(missed).max() < 1.0
    assert 0.01 < at.residual_deg < 0.2


def test_lengths_in_voxels_are_those_of_the_path():
    rng = np.random.default_rng(2)
    grid = flat(20, 30, 0.25, 40)
    start, end = rng.uniform(-1, 9, (3, 200)), rng.uniform(-1, 9, (3, 200))
    paths = trace.Paths(np.arange(200), start, end, np.ones(200), np.ones(200))
    total = np.zeros(200)
    for part in trace.lengths_in_voxels(paths, grid):
        total += np.bincount(part.piece, part.length_m, 200)
    # Brute force: the share of many points along each path that are in the volume.
    steps = (np.arange(20_000) + 0.5) / 20_000
    for k in range(200):
        x, y, z = start[:, k, np.newaxis] + (end - start)[:, k, np.newaxis] * steps
        inside = (x >= 0) & (x < 7.5) & (y >= 0) & (y < 5) & (z >= 0) & (z < 10)
        length = np.linalg.norm(end[:, k] - start[:, k])
        assert total[k] == pytest.approx(inside.mean() * length, abs=2e-3)


def test_each_length_is_credited_to_its_voxel():
    grid = flat(4, 4, 0.5, 4)
    start, end = np.array([[0.1], [0.6], [1.9]]), np.array([[1.3], [0.6], [0.1]])
    paths = trace.Paths(np.zeros(1, np.intp), start, end, np.ones(1), np.ones(1))
    (part,) = trace.lengths_in_voxels(paths, grid)
    by_cell = np.zeros(grid.shape)
    np.add.at(by_cell.reshape(-1), part.cell, part.length_m)
    steps = (np.arange(200_000) + 0.5) / 200_000
    x, _, z = start + (end - start) * steps
    brute = np.zeros(grid.shape)
    np.add.at(brute, ((z / 0.5).astype(int), 1, (x / 0.5).astype(int)), 1.0)
    brute *= np.linalg.norm(end - start) / 200_000
    assert by_cell == pytest.approx(brute, abs=1e-4)


def test_paths_end_at_hits_with_the_energy_that_is_left():
    """The pulse is vertical, with hits at 3 m and 1 m, and the ground rises to the east."""
    ground = np.tile(np.arange(9) * 0.1, (9, 1)).astype(np.float32)
    grid = trace.VoxelGrid(ground, 0.5, 10, 0.5, (4.0, 4.0))
    z = 0.1 * 2.2 / 0.5
    found = returns_of(
        [[2.2, 1.2, z + 3.0], [2.2, 1.2, z + 1.0], [2.2, 1.2, z]], [1, 2, 3], [3] * 3
    )
    _, pulses, _ = grouping.grouped(found, timed=False)
    up = np.array([[0.0], [0.0], [1.0]])
    energy = np.array([0.5, 0.3, 0.2])
    paths = trace.paths_to_hits(found, pulses, energy, up, grid)
    weighted = np.zeros(10)
    for part in trace.lengths_in_voxels(paths, grid):
        np.add.at(weighted, part.cell // 64, part.length_m * paths.weight[part.piece])
    expected = [0.0, 0.2 * 0.5, 0.5 * 0.5, *[0.5 * 0.5] * 3, *[0.5] * 4]
    assert weighted == pytest.approx(expected, abs=1e-5)


def test_the_pyramid_keeps_known_voxels_and_fills_unknown_ones():
    intercepted = np.zeros((16, 16, 16), np.float32)
    path = np.zeros_like(intercepted)
    intercepted[:, :, :8], path[:, :, :8] = 500.0, 1000.0
    rate = attenuation.attenuation(
        attenuation.VoxelSums(intercepted, path), attenuation.Strengths(0.3, 1.0), 0.25
    )
    assert rate[:, :, :8] == pytest.approx(0.5, rel=1e-3)
    # Voxels without pulses have the attenuation of the surrounding block.
    assert rate[:, :, 8:] == pytest.approx(0.5, rel=1e-3)


def test_one_level_of_shrinkage_equals_a_calculation_by_hand():
    """Two voxels of 4 m are side by side.  Their parent is the layer, and the parent of the layer
    is the volume.
    """
    sums = attenuation.VoxelSums(
        np.array([[[3.0, 0.0]]], np.float32), np.array([[[10.0, 2.0]]], np.float32)
    )
    a, overall = 0.4, 3.0 / 12.0
    layer = (3.0 + a) / (12.0 + a / overall)
    expected = [(3.0 + a) / (10.0 + a / layer), a / (2.0 + a / layer)]
    # The same shrinkage for columns, computed from the intercepted energy and from the energy that
    # these rates predict.
    predicted = [10.0 * expected[0], 2.0 * expected[1]]
    overall = 3.0 / sum(predicted)
    layer = (3.0 + 1.0) / (sum(predicted) + 1.0 / overall)
    factors = [(3.0 + 1.0) / (predicted[0] + 1.0 / layer), 1.0 / (predicted[1] + 1.0 / layer)]
    expected = [rate * factor for rate, factor in zip(expected, factors, strict=True)]
    strengths = attenuation.Strengths(a, 1.0)
    assert attenuation.attenuation(sums, strengths, 4.0)[0, 0] == pytest.approx(expected, rel=1e-5)


def test_gaps_from_the_ground_to_the_top_stay_open():
    """Columns without interception stay open, although they are beside columns of crowns, and
    although each column has few pulses.
    """
    rng = np.random.default_rng(2)
    crown = np.kron(rng.random((8, 8)) < 0.5, np.ones((4, 4)))
    path = np.full((32, 32, 32), 0.5, np.float32)
    intercepted = rng.poisson(0.2 * path * crown).astype(np.float32)
    rate = attenuation.attenuation(
        attenuation.VoxelSums(intercepted, path), attenuation.Strengths(0.3, 1.0), 0.25
    )
    depths = 0.25 * rate.sum(axis=0)
    assert depths[crown == 0.0].mean() < 0.02 * depths[crown > 0.0].mean()
    measured = 8.0 * intercepted[:, crown > 0.0].sum() / path[:, crown > 0.0].sum()
    assert depths[crown > 0.0].mean() == pytest.approx(measured, rel=0.02)


def test_the_scale_reproduces_the_gap_fraction():
    depths = np.random.default_rng(1).gamma(1.5, 1.0, 1000)
    scale = attenuation.scale_for(depths, 0.3)
    assert np.exp(-scale * depths).mean() == pytest.approx(0.3, abs=1e-9)


def test_realised_cells_have_the_density_of_their_attenuation():
    rate = np.zeros((4, 30, 40), np.float32)
    rate[1], rate[2] = 0.5, 3.0
    size_m = 20.0, 15.0
    some, more = realise.realised(rate, 0.5, 0.75, 0.1, size_m, (1.0, 2.0))
    assert some.shape == (4, 150, 200)
    assert not some[0].any()
    assert not some[3].any()
    assert not (some & ~more).any()
    error = 4.0 * 0.5 / np.sqrt(some[0].size)
    # The cut at 0.75 m leaves half of the second slice.
    for cells, scale in ((some, 1.0), (more, 2.0)):
        assert cells[1].mean() == pytest.approx(1 - np.exp(-0.25 * 0.5 * scale), abs=error)
        assert cells[2].mean() == pytest.approx(1 - np.exp(-0.5 * 3.0 * scale), abs=error)


def test_trajectories_are_read_and_interpolated(tmp_path):
    path = tmp_path / "track.csv"
    path.write_text("gps_time, x, y, z\n10,0,0,50\n12,8,2,52\n", encoding="utf-8")
    found = read_trajectory(str(path))
    assert found.at(np.array([11.0]))[:, 0].tolist() == [4.0, 1.0, 51.0]
    assert found.covers(np.array([9.0, 11.0])).tolist() == [False, True]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,x,y,z\n1,2,3,4\n", "no column 'gps_time'"),
        ("gps_time,x,y,z\n1,2,3\n", "line 2"),
        ("gps_time,x,y,z\n1,2,3,4\n", "fewer than two"),
        ("gps_time,x,y,z\n1,2,3,nan\n2,2,3,4\n", "fewer than two"),
        ("", "no column"),
    ],
)
def test_faults_in_a_trajectory_are_named(tmp_path, text, said):
    path = tmp_path / "track.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RequestError) as caught:
        read_trajectory(str(path))
    assert said in caught.value.message
    assert str(path) in caught.value.message


def test_wrongly_grouped_pulses_do_not_change_the_sensor_track():
    """The returns of such pulses are far apart. A least-squares fit to all pulses would therefore
    be wrong.
    """
    rng = np.random.default_rng(12)
    found, sensor = flown_pulses(rng)
    wrong = rng.choice(400, 60, replace=False)
    found.xyz_m[:, 2 * wrong] = rng.uniform([[0], [0], [10]], [[25], [25], [20]], (3, 60))
    _, pulses, _ = grouping.grouped(found, timed=True)
    at = sensor_track.fitted(found, pulses)
    assert at is not None
    assert np.abs(at.at(found.time_s[pulses.first]) - sensor).max() < 1.0


@pytest.mark.parametrize("contrast", [1.07, 1.25])
def test_the_contrast_is_found_from_pulses_that_were_not_used(contrast):
    """The true optical depths are a power of the predicted ones, whose scale is wrong as well."""
    rng = np.random.default_rng(8)
    plain = rng.gamma(0.5, 2.0, 40_000)
    passed = (rng.standard_exponential(plain.size) > 0.8 * plain**contrast).astype(np.float64)
    depths = np.stack([plain, 0.7 * plain**attenuation.OTHER_CONTRAST])
    found = attenuation.best_contrast(depths, passed)
    assert found == pytest.approx(contrast, abs=0.03)
    scaled = attenuation.depths_at(found, depths)
    scaled *= attenuation.scale_for(scaled, float(passed.mean()))
    assert np.exp(-scaled).mean() == pytest.approx(passed.mean(), abs=1e-6)
    # In clear and in dense columns, too, the transmission is the measured one.
    for part in (plain < 0.05, plain > 1.5):
        error = np.sqrt(passed[part].var() / np.count_nonzero(part))
        assert abs(np.exp(-scaled[part]).mean() - passed[part].mean()) < 3.0 * error + 0.003


def test_the_contrast_of_noisy_depths_is_not_below_1():
    rng = np.random.default_rng(9)
    true = np.full(2000, 1.0)
    noisy = true * rng.lognormal(0.0, 1.0, true.size)
    passed = (rng.standard_exponential(true.size) > true).astype(np.float64)
    depths = np.stack([noisy, noisy**attenuation.OTHER_CONTRAST])
    assert attenuation.best_contrast(depths, passed) == 1.0


def test_contrast_multiplies_columns_by_a_power_of_their_depth():
    rate = np.array([[[1.0, 0.0, 4.0]], [[3.0, 0.0, 4.0]]], dtype=np.float32)
    found = attenuation.contrasted(rate, 1.5, 0.5)
    assert found[:, 0, 0] == pytest.approx(np.array([1.0, 3.0]) * np.sqrt(2.0), rel=1e-6)
    assert (found[:, 0, 1] == 0.0).all()
    assert found[:, 0, 2] == pytest.approx(np.array([8.0, 8.0]), rel=1e-6)


@pytest.mark.parametrize(
    ("size_m", "slices", "voxel_m", "leaf_m"),
    [
        ((27.0, 27.0), 100, 0.25, 0.0625),
        ((27.0, 27.0), 100, 0.15, 0.05),
        ((8.0, 8.0), 40, 0.25, 0.03125),
        ((2.0, 2.0), 40, 0.25, 0.03125),
        ((200.0, 200.0), 60, 0.5, 0.5 / 6),
        ((300.0, 300.0), 400, 0.25, 0.3),
    ],
)
def test_voxels_are_whole_numbers_of_cells(size_m, slices, voxel_m, leaf_m):
    found = realise.leaf_size_for(size_m, slices, voxel_m)
    assert found == pytest.approx(leaf_m)
    assert size_m[0] * size_m[1] * slices / found**2 <= realise.MOST_CELLS * (1 + 1e-9)
