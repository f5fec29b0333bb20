"""Spirals: tests of their sites, and of the properties that models and missions require of
patterns.
"""

import itertools
import math

import numpy as np
import pytest
from reference import exact
from support.forests import STANDS, clumped_forest

from aosplan.flight.kinematics import path_of
from aosplan.grid.patterns import local_sites, pattern_for
from aosplan.grid.spiral import Spiral
from aosplan.models.correlogram import CorrelogramModel
from aosplan.models.layered import LayeredModel
from aosplan.models.measured import MeasuredModel
from aosplan.models.positions import pattern_shortfall, positions_shortfall
from aosplan.models.uniform import UniformModel
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.scene import Layer
from aosplan.show.text.grid_drawing import grid_picture

COUNTS = (1, 2, 3, 4, 5, 12, 13, 50, 51, 200)
PITCHES = (1.0, 1.5, 2.0, 4.0, 6.5)

every = pytest.mark.parametrize(
    "spiral", [Spiral(n, pitch) for n in COUNTS for pitch in PITCHES], ids=str
)


@every
def test_consecutive_sites_of_a_spiral_are_one_baseline_apart(spiral):
    sites = list(spiral.offsets())
    assert len(set(sites)) == len(sites) == spiral.samples
    for here, there in itertools.pairwise(sites):
        assert math.dist(here, there) == pytest.approx(1.0, abs=1e-12)
    assert path_of(spiral).length_m(2.5) == pytest.approx(2.5 * (spiral.samples - 1), rel=1e-12)


@every
def test_sites_lie_on_two_arms_whose_turns_are_as_far_apart_as_asked(spiral):
    """For both arms, r = t θ/π.  They differ by half a turn, so that the distance between
    neighbouring arms is t.
    """
    sites = list(spiral.offsets())
    outward = sites[(spiral.samples + 1) // 2 :]
    turns, before = 0.0, 0.0
    for x, y in outward:
        angle = math.atan2(y, x)
        turns += math.remainder(angle - before, math.tau)
        before = angle
        if math.isclose(turns % math.tau, 0.0, abs_tol=1e-9):
            turns = round(turns / math.tau) * math.tau
        radius = math.hypot(x, y)
        apart = math.remainder(radius * math.pi / spiral.turn_pitch - angle, math.tau)
        assert apart == pytest.approx(0.0, abs=1e-9)
    radii = [math.hypot(*site) for site in outward]
    assert radii == sorted(radii)


@every
def test_a_spiral_is_point_symmetric_about_the_middle_of_its_extent(spiral):
    sites = list(spiral.offsets())
    for (x, y), (mirrored_x, mirrored_y) in zip(sites, reversed(sites), strict=True):
        assert (x, y) == pytest.approx((-mirrored_x, -mirrored_y), abs=1e-12)
    sizes = [max(site[axis] for site in sites) * 2.0 for axis in (0, 1)]
    assert spiral.extent == pytest.approx(sizes, abs=1e-12)
    assert spiral.longer_side == max(spiral.extent)


@every
def test_nearest_is_the_smallest_distance_of_two_sites(spiral):
    least = min(
        (max(map(abs, np.subtract(a, b))) for a, b in itertools.combinations(spiral.offsets(), 2)),
        default=1.0,
    )
    assert spiral.nearest == pytest.approx(min(least, 1.0), rel=1e-12)


def test_longer_spirals_contain_the_sites_of_shorter_ones():
    for samples in range(1, 40):
        shorter, longer = list(Spiral(samples).offsets()), list(Spiral(samples + 2).offsets())
        assert longer[1:-1] == shorter


@pytest.mark.parametrize("samples", COUNTS)
def test_the_uniform_model_is_exact_for_a_spiral(samples):
    for pitch in PITCHES:
        spiral = pattern_for("spiral", samples, lane_pitch=pitch)
        for dhat in (0.02, 0.3, 0.7, 0.99, 1.2) if samples < 100 else (0.7,):
            reference = exact.lattice_pair_sum(list(spiral.offsets()), dhat)
            assert pattern_shortfall(spiral, dhat) == pytest.approx(float(reference), rel=1e-12)
            scattered = positions_shortfall(list(spiral.offsets()), 1.0 / dhat)
            assert pattern_shortfall(spiral, dhat) == pytest.approx(scattered, rel=1e-11)


def test_samples_of_a_spiral_are_independent_from_the_independent_baseline_on():
    model = UniformModel(0.5, 0.5, 3.5)
    slices = LayeredModel([Layer(2, 3, 0.1, 0.3), Layer(9, 10, 0.2, 0.4)], 40.0)
    for spiral in (Spiral(50), Spiral(51, 2.0), Spiral(200, 1.0)):
        for each in (model, slices):
            apart = each.independent_baseline_m / spiral.nearest
            assert each.predict(spiral, apart).shortfall == 1.0 / spiral.samples
            assert each.predict(spiral, 0.99 * apart).shortfall > 1.0 / spiral.samples


def test_one_slice_is_the_uniform_model():
    layer = Layer(9.0, 9.0, 0.4, 0.5)
    slices = LayeredModel([layer], 45.0)
    uniform = UniformModel(0.4, 0.6, slices.independent_baseline_m)
    for spiral in (Spiral(2), Spiral(17, 1.5), Spiral(60, 4.0)):
        for baseline in (0.1, 1.0, 2.0, 2.6, 4.0):
            assert slices.predict(spiral, baseline).shortfall == pytest.approx(
                uniform.predict(spiral, baseline).shortfall, rel=1e-12
            )


def test_slices_multiply_over_every_pair_of_sites():
    layers = [Layer(2, 3, 0.1, 0.3), Layer(9, 10, 0.2, 0.4), Layer(12, 13, 0.3, 1.0)]
    model, spiral, baseline = LayeredModel(layers, 40.0), Spiral(23, 2.0), 0.9
    sites = np.array(list(spiral.offsets())) * baseline
    clear = 0.0
    for a, b in itertools.product(sites, sites):
        both = 1.0
        for layer in layers:
            share = np.maximum(1 - np.abs(a - b) * layer.height_m / 40.0 / layer.occluder_size_m, 0)
            through = 1.0 - layer.density
            both *= through**2 + layer.density * through * share.prod()
        clear += both - model.transparency**2
    expected = clear / (spiral.samples**2 * model.density * model.transparency)
    assert model.predict(spiral, baseline).shortfall == pytest.approx(expected, rel=1e-10)


def test_the_measured_model_uses_the_sites_of_a_spiral_that_are_flown():
    volume = clumped_forest(STANDS["beech"], side_m=16.0, voxel_m=0.5)
    model = MeasuredModel(volume, 40.0, heading_deg=33.0)
    surrogate = CorrelogramModel(correlogram(volume), 40.0, heading_deg=33.0)
    for spiral in (Spiral(1), Spiral(2), Spiral(9), Spiral(12, 2.0), Spiral(5)):
        flown = np.column_stack(local_sites(spiral, 1.3, 33.0))
        assert model.predict(spiral, 1.3) == model.predict_positions(flown)
        assert tuple(surrogate.predict(spiral, 1.3)) == pytest.approx(
            tuple(surrogate.predict_positions(flown)), rel=1e-9
        )


def test_the_drawing_of_a_spiral_shows_every_site():
    for pitch in (1.5, 2.0, 4.0):
        for samples in (2, 3, 20, 51):
            lines = grid_picture(Spiral(samples, pitch))[:-2]
            marks = [mark for line in lines for mark in line if not mark.isspace()]
            assert sorted(marks) == sorted(["▶", "■", *["●"] * (samples - 2)])
