"""Simulated searches: tests of radiances, of the detector, and of targets on open ground."""

import numpy as np
import pytest

from aosplan.scenes.integral_image import (
    CanopyRadiance,
    OccluderPlane,
    gaussian_field,
    integrate_planes,
    planes_of_layers,
)
from aosplan.scenes.matched_window import MatchedWindow, peaks
from aosplan.scenes.scene import Layer
from aosplan.simulation.search import TargetRadiance, search_layers

SITES = np.array([(x, y) for x in (-2.0, 0.0, 2.0) for y in (-2.0, 0.0, 2.0)])


def test_a_field_has_variance_one_and_the_stated_correlation():
    field = gaussian_field(np.random.default_rng(1), (400, 400), 0.1, 0.5)
    assert field.var() == pytest.approx(1.0, abs=0.05)
    shifted = (field * np.roll(field, 5, axis=1)).mean() / field.var()
    assert shifted == pytest.approx(np.exp(-0.5), abs=0.03)


def test_an_integral_sees_through_the_cells_that_its_rays_meet():
    """There is one occluder of 1 m at a height of 10 m.  In each photo from 40 m, it hides exactly
    the pixels whose rays meet it.
    """
    cells = np.full((40, 40), np.nan, dtype=np.float32)
    cells[20, 20] = 3.0  # The occluder extends from 0 to 1 m along both axes.
    plane = OccluderPlane(10.0, 1.0, (-20.0, -20.0), cells)
    sites = np.array([(0.0, 0.0), (4.0, 0.0)])
    found = integrate_planes([plane], sites, 40.0, (20.0, 20.0))
    x = np.array([(column + 0.5) / 200 * 20 - 10 for column in range(200)])
    row = int((0.5 + 10) / 20 * 200)  # y = 0.55, or 0.41 at the height of the occluder
    hidden = np.zeros(200)
    for site in (0.0, 4.0):
        at = 0.75 * x + 0.25 * site
        hidden += (at >= 0.0) & (at < 1.0)
    assert found.seen[row] == pytest.approx(1.0 - hidden / 2.0)
    assert found.canopy[row] == pytest.approx(3.0 * hidden / 2.0)
    parallel = integrate_planes([plane], sites[:1], 40.0, (20.0, 20.0), parallel=True)
    assert parallel.seen[row].sum() == pytest.approx(190.0)


def test_planes_of_layers_hide_their_share_and_spread_by_one():
    layers = [Layer(5.0, 5.2, 0.4, 0.2)]
    (plane,) = planes_of_layers(np.random.default_rng(2), layers, 60.0, CanopyRadiance(-1.0, 0.5))
    shown = plane.radiance[~np.isnan(plane.radiance)]
    assert np.isnan(plane.radiance).mean() == pytest.approx(0.6, abs=0.01)
    assert shown.mean() == pytest.approx(-1.0, abs=0.15)
    assert shown.var() == pytest.approx(1.0, abs=0.1)


def test_the_detector_answers_a_target_with_its_own_window():
    window = MatchedWindow((0.5, 1.7), (300, 300), (0.1, 0.1))
    image = np.zeros((300, 300))
    cover = window.cover(0.0)
    rows, columns = (count // 2 for count in cover.shape)
    image[150 - rows : 151 + rows, 150 - columns : 151 + columns] += 2.0 * cover
    output = window.output(image)
    assert np.unravel_index(output.argmax(), output.shape) == (150, 150)
    # The whole target is in the box. Pixels at the edges of the window are covered only partly.
    assert output.max() == pytest.approx(2.0 * (1.0 - 0.85 / 4.1**2), rel=0.05)
    assert peaks(output, (0.1, 0.1))[0] == output.max()


def test_over_open_ground_every_target_is_found_and_seen():
    found = search_layers(
        [Layer(9.9, 10.1, 1e-9, 0.2)],
        SITES,
        40.0,
        TargetRadiance(0.5, 1.7, 5.0, 0.0, 0.0),
        seed=1,
        index=0,
    )
    assert found.seen == pytest.approx(1.0)
    assert (found.outputs > found.peaks[0]).all()
    again = search_layers(
        [Layer(9.9, 10.1, 1e-9, 0.2)],
        SITES,
        40.0,
        TargetRadiance(0.5, 1.7, 5.0, 0.0, 0.0),
        seed=1,
        index=0,
    )
    assert (again.outputs == found.outputs).all()
