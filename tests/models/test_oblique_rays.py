"""Slanted rays, compared with their definition, and with random cubes that are not on a grid."""

import math
from functools import partial

import numpy as np
import pytest

from aosplan.grid.patterns import Pattern, pattern_for
from aosplan.grid.spiral import Spiral
from aosplan.models.layered import LayeredModel
from aosplan.models.layered_pairs import Slices
from aosplan.models.layered_slanted import SlantedRays
from aosplan.models.oblique_rays import ray_lengths
from aosplan.models.uniform import UniformModel
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.scenes.scene import Layer

near = partial(pytest.approx, abs=0.0)
LAYERS = [Layer(1.0, 1.5, 0.2, 0.3), Layer(4.0, 5.0, 0.4, 0.5), Layer(9.0, 12.0, 0.3, 0.2)]
PATTERNS = [
    Pattern(1, 1),
    Pattern(4, 5),
    pattern_for("trimmed", 11),
    Pattern(1, 8),
    Pattern(3, 4, 4.0),
]


def test_ray_lengths_have_known_values():
    assert ray_lengths(30.0, 40.0, 50.0, "oblique") == near(math.sqrt(2.0), rel=1e-15)
    assert ray_lengths(-30.0, 40.0, 50.0, "cubes") == near(2.4, rel=1e-15)
    assert ray_lengths(-30.0, 40.0, 50.0, "nadir") == 1.0
    x = np.linspace(-80.0, 80.0, 9)
    # The length is 1/cos of the angle from the vertical.
    expected = 1.0 / np.cos(np.arctan2(np.abs(x), 50.0))
    assert ray_lengths(x, 0.0, 50.0, "oblique") == near(expected, rel=1e-14)


def by_definition(layers, altitude, pattern, baseline, kind):
    """p̄ and K from the probabilities of every pair and slice."""
    middle = 0.5 * (pattern.columns - 1), 0.5 * (pattern.rows - 1) * pattern.row_pitch
    places = [
        ((column - middle[0]) * baseline, (row * pattern.row_pitch - middle[1]) * baseline)
        for row, column in pattern.sites()
    ]
    lengths = [float(ray_lengths(x, y, altitude, kind)) for x, y in places]

    def both_clear(i, k):
        result = 1.0
        for layer in layers:
            q = 1.0 - layer.density
            far = layer.occluder_size_m * altitude / layer.height_m
            apart = [abs(a - b) for a, b in zip(places[i], places[k], strict=True)]
            tau = math.prod(max(0.0, 1.0 - a / far) for a in apart)
            both = lengths[i] + lengths[k]
            shorter = min(lengths[i], lengths[k])
            result *= q**both + tau * (q ** (both - shorter) - q**both)
        return result

    count = range(len(places))
    clear = [math.prod((1.0 - s.density) ** e for s in layers) for e in lengths]
    p = 1.0 - math.fsum(clear) / len(places)
    joint = math.fsum(1.0 - clear[i] - clear[k] + both_clear(i, k) for i in count for k in count)
    return p, (joint / len(places) ** 2 - p * p) / (p * (1.0 - p))


@pytest.mark.parametrize("kind", ["nadir", "oblique", "cubes"])
@pytest.mark.parametrize("baseline", [0.3, 1.5, 9.0])
@pytest.mark.parametrize("pattern", PATTERNS, ids=lambda pattern: f"{pattern.samples}")
def test_predictions_follow_from_the_pairs(kind, baseline, pattern):
    model = LayeredModel(LAYERS, 20.0, rays=kind)
    found = model.predict(pattern, baseline)
    p, shortfall = by_definition(LAYERS, 20.0, pattern, baseline, kind)
    assert found.density == near(p, rel=1e-12)
    assert found.transparency == near(1.0 - p, rel=1e-12)
    assert found.shortfall == near(shortfall, rel=1e-7)
    slab = [Layer(9.0, 11.0, 0.6, 0.5)]
    uniform = UniformModel(0.6, 0.4, 1.0, rays=kind, altitude_m=20.0)
    found = uniform.predict(pattern, baseline)
    p, shortfall = by_definition(slab, 20.0, pattern, baseline, kind)
    assert found.density == near(p, rel=1e-12)
    assert found.shortfall == near(shortfall, rel=1e-11)


@pytest.mark.parametrize("kind", ["oblique", "cubes"])
@pytest.mark.parametrize("hold_error", [0.0, 0.5])
def test_scattered_samples_give_the_same_sum_as_a_lattice(kind, hold_error):
    lattice = Pattern(4, 5)
    points = 1.5 * np.array(list(lattice.offsets()))
    layered = LayeredModel(LAYERS, 20.0, rays=kind, hold_error_m=hold_error)
    deviation = math.sqrt(2.0) * hold_error
    scattered = SlantedRays(Slices(LAYERS, 20.0), 20.0, kind, deviation).predict_at(points)
    assert scattered == near(layered.predict(lattice, 1.5), rel=1e-9)
    spiral = Spiral(9, 2.0)
    slab = LayeredModel([Layer(9.0, 11.0, 0.6, 0.5)], 20.0, rays=kind, hold_error_m=hold_error)
    uniform = UniformModel(0.6, 0.4, 1.0, hold_error, kind, 20.0)
    assert uniform.predict(spiral, 0.7) == near(slab.predict(spiral, 0.7), rel=1e-9)


def test_one_sample_and_a_high_flight_are_those_of_nadir_rays():
    for kind in ("oblique", "cubes"):
        uniform = UniformModel(0.6, 0.4, 1.0, rays=kind, altitude_m=20.0)
        assert uniform.predict(Pattern(1, 1), 3.0).shortfall == near(1.0, rel=1e-14)
        assert uniform.predict(Pattern(1, 1), 3.0).density == near(0.6, rel=1e-14)
        high = uniform._replace(altitude_m=1e9).predict(Pattern(5, 6), 0.4)
        nadir = UniformModel(0.6, 0.4, 1.0).predict(Pattern(5, 6), 0.4)
        assert high == near(nadir, rel=1e-7)


def test_far_apart_samples_can_need_fewer_than_their_number():
    # Views with different densities vary less about their own means, so K is below 1/N.
    found = UniformModel(0.6, 0.4, 1.0, rays="oblique", altitude_m=20.0).predict(Pattern(4, 4), 9.0)
    _, shortfall = by_definition([Layer(9, 11, 0.6, 0.5)], 20.0, Pattern(4, 4), 9.0, "oblique")
    assert found.shortfall == near(shortfall, rel=1e-12)
    assert found.shortfall < 1.0 / 16.0
    assert found.expected < UniformModel(0.6, 0.4, 1.0).predict(Pattern(4, 4), 9.0).expected


def test_fully_hidden_views_are_treated_as_independent():
    for model in (
        UniformModel(0.6, 0.4, 1.0, rays="oblique", altitude_m=20.0),
        LayeredModel(LAYERS, 20.0, rays="cubes"),
    ):
        found = model.predict(Pattern(2, 2), 1e9)
        assert found == (1.0, 0.0, 0.25)


# --- Random cubes ----------------------------------------------------------------------------

SIDE, EDGE, BASE, DEPTH, ALTITUDE = 12.0, 0.5, 3.0, 5.0, 20.0


def hidden(rng, rate, cameras, targets):
    """Mask of the targets that cubes of a Poisson process hide from each camera, shape (views,
    targets).

    The centres of the cubes fill a slab.  The plot is periodic, and each target is at the centre of
    the aperture.
    """
    cubes = rng.uniform(0.0, SIDE, (rng.poisson(rate * SIDE**2 * DEPTH), 2))
    middle = rng.uniform(BASE, BASE + DEPTH, len(cubes))
    at = rng.uniform(0.0, SIDE, (targets, 2))
    found = np.zeros((len(cameras), targets), dtype=bool)
    for view, camera in enumerate(cameras):
        # A ray is inside a cube at the heights at which all three of its coordinates are inside the
        # cube.
        low = np.tile(middle - 0.5 * EDGE, (targets, 1))
        high = low + EDGE
        for axis in range(2):
            slope = camera[axis] / ALTITUDE
            crossing = at[:, axis : axis + 1] + slope * middle
            apart = (cubes[:, axis] - crossing + 0.5 * SIDE) % SIDE - 0.5 * SIDE
            if slope == 0.0:
                low = np.where(np.abs(apart) < 0.5 * EDGE, low, np.inf)
                continue
            heights = middle + (apart + np.array([[[-0.5]], [[0.5]]]) * EDGE) / slope
            low = np.maximum(low, heights.min(axis=0))
            high = np.minimum(high, heights.max(axis=0))
        found[view] = (low < high).any(axis=1)
    return found


@pytest.mark.parametrize("baseline", [pytest.param(1.0, marks=pytest.mark.slow), 3.0])
def test_cubes_at_random_show_what_is_predicted(baseline):
    rate = 0.9 / (EDGE**2 * DEPTH)  # A nadir ray is clear with the probability exp(-0.9).
    pattern = Pattern(3, 4)
    cameras = [((c - 1.5) * baseline, (r - 1.0) * baseline) for r, c in pattern.sites()]
    rng = np.random.default_rng(5)
    seen = [hidden(rng, rate, cameras, 100) for _ in range(25)]
    slices = 50
    layers = [
        Layer(
            BASE + DEPTH * k / slices,
            BASE + DEPTH * (k + 1) / slices,
            -math.expm1(-0.9 / slices),
            EDGE,
        )
        for k in range(slices)
    ]
    model = LayeredModel(layers, ALTITUDE, rays="cubes")
    found = model.predict(pattern, baseline)
    density = [views.mean() for views in seen]
    expected = [1.0 - (views.mean(axis=0) ** 2).mean() for views in seen]
    for values, predicted, slack in (
        (density, found.density, 0.0),
        # The model is only approximate for pairs of rays with different slopes.
        (expected, found.expected, 0.003),
    ):
        error = np.std(values, ddof=1) / math.sqrt(len(values))
        assert 0.0 < error < 0.008
        assert abs(np.mean(values) - predicted) < 4.0 * error + slack
    nadir = LayeredModel(layers, ALTITUDE).predict(pattern, baseline)
    if baseline == 3.0:  # The sides of the cubes hide a considerable share.
        error = np.std(density, ddof=1) / math.sqrt(len(density))
        assert np.mean(density) - nadir.density > 4.0 * error


# --- Plans -----------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["uniform", "layered"])
def test_a_plan_with_oblique_rays_meets_its_target(model):
    straight = plan(PlanRequest(altitude=40, vhat=0.95, model=model))
    slanted = plan(PlanRequest(altitude=40, vhat=0.95, model=model, rays="oblique"))
    found = slanted.solution.prediction
    assert slanted.solution.met
    assert found.normalized >= 0.95 * (1 - 1e-12)
    assert found.density > straight.solution.prediction.density
    assert found.expected < straight.solution.prediction.expected


def test_wide_apertures_give_a_warning():
    def codes(**options):
        return [m.code for m in plan(PlanRequest(altitude=40, **options)).warnings]

    assert "oblique_rays" not in codes()
    assert "oblique_rays" in codes(baseline=6, samples=100)
    assert "oblique_rays" not in codes(baseline=6, samples=100, rays="oblique")
    assert "oblique_rays" not in codes(baseline=6, samples=1)
