"""Voxel volumes, and the sorting of points into them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aosplan.errors import RequestError
from aosplan.scenes import voxels
from aosplan.scenes.voxels import VoxelVolume, cells_along, fill, fits, footprint, too_many_voxels


def volume(occupied, **given):
    return VoxelVolume(np.asarray(occupied, dtype=bool), **({"voxel_m": 0.5} | given))


def flat(rows, columns, z=0.0):
    return np.full((rows + 1, columns + 1), z, dtype=np.float32)


def block(*points):
    return np.array(points, dtype=np.float64).T


def test_size_and_density_follow_from_the_shape():
    plot = volume(np.zeros((3, 4, 6)), points=120)
    assert plot.size_m == (3.0, 2.0)
    assert plot.plot_area_m2 == 6.0
    assert plot.points_per_m2 == 20.0


def test_column_occupancy_counts_columns_and_not_voxels():
    occupied = np.zeros((3, 2, 2))
    occupied[:, 0, 0] = 1
    occupied[2, 1, 1] = 1
    plot = volume(occupied)
    assert plot.column_occupancy == 0.5
    assert plot.slice_densities.tolist() == [0.25, 0.25, 0.5]


def test_canopy_top_is_the_upper_face_of_the_highest_occupied_voxel():
    occupied = np.zeros((5, 1, 2))
    occupied[2, 0, 1] = 1
    assert volume(occupied).canopy_top_m == 1.5


@pytest.mark.parametrize("slices", [0, 4])
def test_bare_ground_has_no_canopy(slices):
    plot = volume(np.zeros((slices, 2, 3)))
    assert (plot.canopy_top_m, plot.column_occupancy) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("occupied", "given", "named"),
    [
        (np.zeros((1, 2), dtype=bool), {}, "shape"),
        (np.zeros((1, 0, 2), dtype=bool), {}, "shape"),
        (np.zeros((1, 2, 2)), {}, "float64"),
        (np.zeros((1, 2, 2), dtype=bool), {"voxel_m": 0.0}, "voxel_m 0"),
        (np.zeros((1, 2, 2), dtype=bool), {"voxel_m": math.nan}, "voxel_m nan"),
        (np.zeros((1, 2, 2), dtype=bool), {"min_height_m": -1.0}, "min_height_m -1"),
    ],
)
def test_invalid_volumes_are_refused_by_name(occupied, given, named):
    with pytest.raises(RequestError, match=f"'plot.laz'.*{named}"):
        VoxelVolume(occupied, **({"voxel_m": 0.5, "source": "plot.laz"} | given))


def test_a_point_fills_the_voxel_that_contains_it():
    occupied = fill([block((2.5, 1.5, 3.5))], flat(2, 4), 0.0, 0.25, "cloud")
    assert occupied.shape == (4, 2, 4)
    assert np.argwhere(occupied).tolist() == [[3, 1, 2]]


def test_a_point_on_a_face_belongs_to_the_voxel_above_it_in_spite_of_rounding():
    east = 0.29 / 0.01
    assert east < 29.0
    occupied = fill([block((east, 0.0, east))], flat(1, 40), 0.0, 0.01, "cloud")
    assert np.argwhere(occupied).tolist() == [[29, 0, 29]]


def test_heights_count_from_a_tilted_ground():
    rows, columns = 3, 5
    y, x = np.mgrid[0 : rows + 1, 0 : columns + 1]
    ground = (7.0 + 0.5 * x - 0.25 * y).astype(np.float32)
    rng = np.random.default_rng(1)
    east, north, height = rng.uniform(0, [[columns], [rows], [6.0]], (3, 400))
    z = 7.0 + 0.5 * east - 0.25 * north + height
    occupied = fill([np.stack([east, north, z])], ground, 0.0, 1.0, "cloud")
    expected = np.zeros((6, rows, columns), dtype=bool)
    expected[height.astype(int), north.astype(int), east.astype(int)] = True
    assert (occupied == expected).all()


def test_ground_is_bilinear_within_a_cell():
    ground = np.array([[0.0, 4.0], [2.0, 10.0]], dtype=np.float32)
    surface = (0.75 * 0.25) * 4.0 + (0.25 * 0.75) * 2.0 + (0.75 * 0.75) * 10.0
    for height, level in ((0.01, 0), (0.99, 0), (1.01, 1)):
        occupied = fill([block((0.75, 0.75, surface + height))], ground, 0.0, 1.0, "cloud")
        assert occupied.shape == (level + 1, 1, 1)


def test_points_below_the_cut_are_dropped_and_points_at_it_are_not():
    points = block((0.5, 0.5, 7.99), (1.5, 0.5, 8.0), (2.5, 0.5, -3.0))
    occupied = fill([points], flat(1, 3), 8.0, 0.25, "cloud")
    assert np.argwhere(occupied).tolist() == [[8, 0, 1]]


def test_without_points_above_the_cut_there_are_no_slices():
    assert fill([block((0.5, 0.5, 1.0))], flat(2, 2), 2.0, 1.0, "cloud").shape == (0, 2, 2)
    assert fill([], flat(2, 2), 2.0, 1.0, "cloud").shape == (0, 2, 2)


@given(st.randoms(use_true_random=False), st.integers(1, 6))
def test_the_order_of_points_and_their_blocks_does_not_matter(random, pieces):
    rng = np.random.default_rng(random.randrange(2**32))
    points = rng.uniform(0, [[4], [3], [9]], (3, 40))
    whole = fill([points], flat(3, 4), 0.0, 1.0, "cloud")
    shuffled = points[:, rng.permutation(40)]
    parts = np.array_split(shuffled, pieces, axis=1)
    assert (fill(parts, flat(3, 4), 0.0, 1.0, "cloud") == whole).all()


def test_a_stand_too_high_for_its_voxels_is_refused_with_a_possible_size(monkeypatch):
    monkeypatch.setattr(voxels, "MAX_VOXELS", 1000)
    points = [block((0.5, 0.5, 30.0)), block((0.5, 0.5, 99.5)), block((0.5, 0.5, 3.0))]
    with pytest.raises(RequestError, match=r"cloud needs too many voxels of 0.25 m") as caught:
        fill(points, flat(4, 4), 0.0, 0.25, "cloud")
    assert "1 x 1 x 25 m" in caught.value.message
    size = float(caught.value.hint.split()[2])
    assert fits((1.0, 1.0, 25.0), size)
    assert not fits((1.0, 1.0, 25.0), size / 1.3)


def test_a_line_of_points_includes_cells_for_both_ends():
    assert cells_along(0.0, 0.25) == 1
    assert cells_along(0.24, 0.25) == 1
    assert cells_along(0.25, 0.25) == 2
    assert cells_along(0.3, 0.1) == 4


@given(
    st.tuples(*[st.floats(0.0, 1e5)] * 3),
    st.one_of(st.floats(1e-9, 0.05), st.just(5e-324)),
)
def test_the_size_that_is_hinted_at_always_fits(size, voxel_m):
    error = too_many_voxels(size, voxel_m, "cloud")
    assert fits(size, float(error.hint.split()[2]))


# --- Footprint ---


@pytest.mark.parametrize("reach", [1, 2, 5, 7])
def test_a_full_plot_is_covered_for_every_size_of_squares(reach):
    assert footprint(np.ones((31, 44), dtype=bool), reach) == 1.0


def test_the_covered_share_of_a_disc_is_correct_except_for_its_rim():
    y, x = np.mgrid[:400, :400] - 199.5
    disc = np.hypot(x, y) < 200.0
    assert footprint(disc, 1) == pytest.approx(np.pi / 4, abs=0.001)
    sparse = disc & (np.random.default_rng(0).random(disc.shape) < 0.05)
    assert footprint(sparse, 18) == pytest.approx(np.pi / 4, abs=0.06)


def test_ground_enclosed_by_points_is_covered_and_a_bay_is_not():
    ring = np.ones((20, 20), dtype=bool)
    ring[5:15, 5:15] = False
    assert footprint(ring, 1) == 1.0
    ring[:5, 5:15] = False
    assert footprint(ring, 1) == pytest.approx(1.0 - 150 / 400)


def test_a_square_cut_by_the_rim_counts_in_proportion_to_its_rest():
    touched = np.zeros((4, 10), dtype=bool)
    touched[:, 8:] = True
    assert footprint(touched, 4) == pytest.approx(0.2)


def test_a_typical_part_has_the_density_of_the_plot():
    rng = np.random.default_rng(3)
    share = np.linspace(0.1, 0.9, 60)  # The canopy becomes denser towards the east.
    volume = VoxelVolume(rng.random((1, 40, 60)) < share, 0.5, x_min_m=7.0)
    part = volume.typical_part((10.0, 30.0))
    assert part.size_m == (10.0, 20.0)
    assert part.x_min_m == pytest.approx(7.0 + 10.0, abs=2.0)
    assert part.column_occupancy == pytest.approx(volume.column_occupancy, abs=0.02)
    start = round((part.x_min_m - 7.0) / 0.5)
    assert (part.occupied == volume.occupied[:, :, start : start + 20]).all()
    assert volume.typical_part((30.0, 20.0)) is volume
