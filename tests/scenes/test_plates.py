"""Rays through plates, compared with counts of cells, and with Beer's law for the path length."""

import numpy as np
import pytest

from aosplan.scenes.hidden_counts import popcount
from aosplan.scenes.occlusion import Occlusion
from aosplan.scenes.voxels import VoxelVolume


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
