"""Rays through plates, compared with counts of cells, and with Beer's law for the path length."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aosplan.scenes.hidden_counts import popcount
from aosplan.scenes.occlusion import Occlusion
from aosplan.scenes.voxels import VoxelVolume


@cache
def plates(slices=200, density=0.005, cells=400, seed=1):
    occupied = np.random.default_rng(seed).random((slices, cells, cells)) < density
    return VoxelVolume(occupied, 0.1, slice_m=0.1)


def test_straight_down_each_slice_is_met_once():
    volume = plates()
    hidden = popcount(Occlusion(volume, 100.0).masks([(0.0, 0.0)]))[0]
    assert hidden == volume.occupied.any(axis=0).sum() * volume.targets_per_voxel**2


@pytest.mark.parametrize("offset", [(30.0, 0.0), (0.0, -57.7), (40.0, 40.0), (-80.0, 30.0)])
def test_telecentric_rays_obey_beers_law(offset):
    volume = plates()
    view = Occlusion(volume, 100.0)
    clear = 1.0 - popcount(view.masks([offset]))[0] / view.targets
    secant = np.sqrt(1.0 + (offset[0] ** 2 + offset[1] ** 2) / 100.0**2)
    expected = (1.0 - 0.005) ** (200 * secant)
    # The plot has 160 000 columns of cells, each with one ray.
    assert clear == pytest.approx(expected, abs=4.0 * np.sqrt(expected * (1 - expected) / 160_000))


def test_perspective_rays_obey_beers_law():
    volume = plates()
    view = Occlusion(volume, 100.0, view="perspective")
    camera = np.array([50.0, -20.0])
    clear = 1.0 - popcount(view.masks([camera]))[0] / view.targets
    line = (np.arange(400) + 0.5) * 0.1 - 20.0
    x, y = camera[0] - line, (camera[1] - line)[:, np.newaxis]
    # The path lengths of both axes are added.
    secant = np.sqrt(1.0 + (x / 100) ** 2) + np.sqrt(1.0 + (y / 100) ** 2) - 1.0
    expected = ((1.0 - 0.005) ** (200 * secant)).mean()
    # Rays converge towards the camera. At a height of 20 m, they meet a share of 0.8² of the cells.
    assert clear == pytest.approx(
        expected, abs=5.0 * np.sqrt(expected * (1 - expected) / (0.64 * 160_000))
    )


def test_perspective_and_telecentric_agree_far_away():
    volume = plates(slices=50, density=0.02, cells=128)
    far = 1e7
    one = Occlusion(volume, far).masks([(0.0, 0.0)])
    other = Occlusion(volume, far, view="perspective").masks([(0.0, 0.0)])
    assert (one == other).all()


@given(
    st.tuples(st.integers(1, 15), st.integers(1, 9), st.integers(1, 40)),
    st.integers(1, 3),
    st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)),
    st.integers(0, 1000),
)
def test_perspective_rays_meet_the_plates_in_the_middle_of_slices(shape, per_voxel, camera, seed):
    # The slices are 20 m thick, below cameras at 400 m. Rays are scaled by up to a factor of four.
    # They are so steep that they meet second plates in less than one of a hundred slices.
    occupied = np.random.default_rng(seed).random(shape) < 0.1
    volume = VoxelVolume(occupied, 0.25, slice_m=20.0)
    view = Occlusion(volume, 400.0, view="perspective", targets_per_voxel=per_voxel)
    got = view.unpack(view.masks([camera]))[0]
    want = np.zeros_like(got)
    sure = np.ones_like(got)
    lines = []
    for count, position in zip(shape[:0:-1], camera, strict=True):
        target = (np.arange(count * per_voxel) + 0.5) * (0.25 / per_voxel)
        lines.append((target, 0.125 * count + position, count))
    for level, plane in enumerate(occupied):
        share = (20.0 * level + 10.0) / 400.0
        places = [(target + (above - target) * share) / 0.25 for target, above, _ in lines]
        column, row = (
            np.floor(place).astype(int) % count
            for place, (_, _, count) in zip(places, lines, strict=True)
        )
        want |= plane[row[:, np.newaxis], column]
        at_edge = [np.abs(place - np.rint(place)) < 1e-9 for place in places]
        sure &= ~(at_edge[1][:, np.newaxis] | at_edge[0])
    assert got[want & sure].all()
    assert (got & ~want & sure).sum() <= 0.01 * got.size + 8
