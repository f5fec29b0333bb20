"""Views of a place, compared with a ray caster in plain numpy."""

import numpy as np
import pytest

from aosplan.errors import RequestError
from aosplan.models.place import Ground, PlaceModel, PlaceViews, joint_density, prediction_of
from aosplan.scenes.plot_frame import PlotFrame
from aosplan.scenes.voxels import VoxelVolume

ALTITUDE_M, VOXEL_M = 20.0, 0.5


def volume(seed=1, rows=40, columns=48):
    """Crowns that consist of cubes, at heights from 2 to 8 m above a plot of 24 x 20 m."""
    rng = np.random.default_rng(seed)
    occupied = np.zeros((16, rows, columns), dtype=bool)
    occupied[4:] = rng.random((12, rows, columns)) < 0.05
    occupied[4:10, 14:24, 10:22] |= rng.random((6, 10, 12)) < 0.4
    return VoxelVolume(occupied, VOXEL_M)


def disc(radius_m, middle=(0.0, 0.0)):
    middle = np.array(middle)
    low, high = (middle - radius_m).tolist(), (middle + radius_m).tolist()
    return Ground(
        tuple(low), tuple(high), lambda points: np.hypot(*(points - middle).T) <= radius_m
    )


def is_hidden(stand, target, camera):
    """Whether a ray meets a cube. The ray is cut at all faces that it crosses, and each piece
    between two cuts is tested.
    """
    slices, rows, columns = stand.occupied.shape
    start = np.array([*target, 0.0])
    way = np.array([*camera, ALTITUDE_M]) - start
    half = np.array([0.5 * columns, 0.5 * rows, 0.0]) * VOXEL_M
    cuts = [0.0, slices * VOXEL_M / ALTITUDE_M]
    for axis in range(3):
        if way[axis]:
            faces = np.arange(-200, 201) * VOXEL_M - half[axis]
            at = (faces - start[axis]) / way[axis]
            cuts += at[(at > 0.0) & (at < cuts[1])].tolist()
    cuts = np.unique(cuts)
    middles = start + 0.5 * (cuts[:-1] + cuts[1:])[:, np.newaxis] * way
    column, row, level = np.floor((middles + half) / VOXEL_M).astype(int).T
    return bool(stand.occupied[level, row % rows, column % columns].any())


def test_shares_are_those_of_rays_cast_one_by_one():
    stand, rng = volume(), np.random.default_rng(2)
    views = PlaceViews(stand, ALTITUDE_M, disc(1.5))
    cameras = rng.uniform(-6.0, 6.0, (12, 2))
    found = views.hidden(cameras)
    expected = np.array(
        [[is_hidden(stand, target, camera) for target in views.targets_m] for camera in cameras]
    )
    # The place is neither open nor completely hidden.
    assert expected.mean() == pytest.approx(0.6, abs=0.25)
    # For a ray through the corner of a slice, the model may choose the wrong one of two cubes.
    assert (found == expected).mean() > 0.97
    assert found.mean(axis=1) == pytest.approx(expected.mean(axis=1), abs=0.03)


def test_targets_are_spread_evenly_over_the_place():
    views = PlaceViews(volume(), ALTITUDE_M, disc(6.0))
    assert 1000 < len(views.targets_m) <= 4200
    assert np.hypot(*views.targets_m.T).max() <= 6.0
    assert views.targets_m.mean(axis=0) == pytest.approx([0.0, 0.0], abs=0.1)


def test_moving_place_and_stand_together_changes_no_prediction():
    stand, cells = volume(), (3, -4)
    moved = stand.of_voxels(np.roll(stand.occupied, cells, axis=(1, 2)))
    by = np.array([cells[1], cells[0]]) * VOXEL_M
    cameras = np.random.default_rng(4).uniform(-5.0, 5.0, (20, 2))
    here = PlaceViews(stand, ALTITUDE_M, disc(1.5)).hidden(cameras)
    there = PlaceViews(moved, ALTITUDE_M, disc(1.5, by)).hidden(cameras + by)
    # A position on the face of a cube may be rounded to either side.
    assert (here == there).mean() > 0.999


def test_the_prediction_counts_joint_occlusion():
    hidden = np.random.default_rng(5).random((7, 300)) < 0.6
    share = hidden.mean(axis=0)
    found = prediction_of(hidden)
    assert found.density == pytest.approx(share.mean(), abs=1e-15)
    assert found.expected == pytest.approx(1.0 - (share**2).mean(), abs=1e-14)
    assert joint_density(hidden).mean() == pytest.approx((share**2).mean(), abs=1e-15)


def test_rotating_plot_and_positions_together_changes_no_prediction():
    stand, turn = volume(), 30.0
    views = PlaceViews(stand, ALTITUDE_M, disc(1.5))
    straight, turned = (PlaceModel(views, PlotFrame(4.0, -2.0, deg)) for deg in (0.0, turn))
    sites = np.random.default_rng(6).uniform(-4.0, 4.0, (9, 2))
    angle = np.radians(turn)
    # The number of rows increases in the direction 30 degrees east of north.
    rows, columns = (np.sin(angle), np.cos(angle)), (np.cos(angle), -np.sin(angle))
    away = sites[:, :1] * np.array(columns) + sites[:, 1:] * np.array(rows)
    middle = np.array([4.0, -2.0])
    one, other = straight.predict_positions(sites + middle), turned.predict_positions(away + middle)
    assert other == pytest.approx(one, abs=1e-9)


def test_rays_stay_on_the_plot_up_to_the_edge():
    stand = volume()
    views = PlaceViews(stand, ALTITUDE_M, disc(1.0))
    rise = stand.canopy_top_m / ALTITUDE_M
    edge = (12.0 - 1.0 * (1.0 - rise)) / rise
    stays = views.stays_on_plot(np.array([[edge - 0.01, 0.0], [edge + 0.01, 0.0]]))
    assert stays.tolist() == [True, False]


def test_a_place_beside_the_plot_is_refused():
    with pytest.raises(RequestError, match=r"reaches 0\.5 m beyond the edge of the scene"):
        PlaceViews(volume(), ALTITUDE_M, disc(2.0, (10.5, 0.0)))
