"""Predictions for slanted rays, compared with rays cast through leaves, and with enumeration."""

import math

import numpy as np
import pytest

from aosplan.models.area_rays import cubes, leaves, slanted
from aosplan.scenes.presets import find_preset_scene
from aosplan.scenes.scene import Layer, LayeredScene
from aosplan.simulation.leaf_stands import LeafStand

FOREST = find_preset_scene("paper-forest")


def random_leaves(rng, count):
    """Round leaves of random direction, anywhere in a volume of 8 x 8 x 6 m."""
    normal = rng.standard_normal((3, count))
    normal /= np.sqrt((normal**2).sum(axis=0))
    centre = rng.random((3, count)) * [[8.0], [8.0], [6.0]]
    centre[2] += 2.0
    return LeafStand(8.0, centre, normal, 0.1)


@pytest.mark.slow
def test_leaves_of_random_direction_hide_by_the_length_of_a_ray():
    """For rays cast through discs, ln T of slanted rays is ln T of vertical rays times the secant
    of the angle from the vertical.
    """
    rng = np.random.default_rng(7)
    ground = rng.random((2, 60_000)) * 8.0
    depth = {}
    for slope in ((0.0, 0.0), (0.6, 0.0), (0.5, 0.7)):
        hits = []
        for _ in range(3):
            stand = random_leaves(rng, 2400)
            along = np.repeat(np.array(slope)[:, np.newaxis], ground.shape[1], axis=1)
            hits.append(np.mean(stand.first_hits(ground, along) > 0.0))
        depth[slope] = -math.log1p(-np.mean(hits))
    # There are 2400 leaves on 64 m². The mean shadow of a leaf is half its area.
    assert depth[0.0, 0.0] == pytest.approx(2400 / 64 * 0.5 * math.pi * 0.01, rel=0.03)
    straight = LayeredScene("leaves", (Layer(2.0, 8.0, -math.expm1(-depth[0.0, 0.0]), 6.0),))
    for slope, found in depth.items():
        assert -leaves(straight)(*map(abs, slope)) == pytest.approx(found, rel=0.03)


def test_cubes_show_their_side_faces():
    straight, slanting = (float(cubes(FOREST)(np.float64(x), np.float64(0.2))) for x in (0.0, 0.3))
    top = float(cubes(FOREST)(np.float64(0.0), np.float64(0.0)))
    assert straight == pytest.approx(1.2 * top, rel=1e-2)
    assert slanting == pytest.approx(1.5 * top, rel=1e-2)


@pytest.mark.parametrize("occluders", [cubes, leaves])
def test_a_prediction_is_the_mean_over_targets_and_views(occluders):
    positions = np.array([(x, y) for x in (-4.0, 0.0, 4.0) for y in (-3.0, 3.0)])
    found = slanted(0.2, occluders(FOREST), positions, (0.0, 0.0), 40.0, "telecentric")
    clear = np.exp([float(occluders(FOREST)(abs(x) / 40.0, abs(y) / 40.0)) for x, y in positions])
    p = 1.0 - clear
    assert found.density == pytest.approx(p.mean(), rel=1e-12)
    expected = 1.0 - p.mean() ** 2 - 0.2 * (p * clear).mean()
    assert found.expected == pytest.approx(expected, rel=1e-12)
    wide = slanted(0.2, occluders(FOREST), positions, (20.0, 10.0), 40.0, "perspective")
    assert wide.density > found.density
