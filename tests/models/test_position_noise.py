"""The model of position noise, compared with quadrature and with random positions, and the effect
of this noise on plans.
"""

import math
from functools import partial
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest
from scipy import integrate
from support.forests import STANDS, clumped_forest

from aosplan.camera.presets import find_camera
from aosplan.grid.patterns import Pattern, frame_at, pattern_for
from aosplan.grid.spiral import Spiral
from aosplan.models.correlogram import CorrelogramModel
from aosplan.models.layered import LayeredModel
from aosplan.models.layered_pairs import RayPairs, Slices
from aosplan.models.measured import MeasuredModel
from aosplan.models.position_noise import blurred_overlap, blurred_shortfall, scattered_shortfall
from aosplan.models.positions import pattern_shortfall, positions_shortfall
from aosplan.models.uniform import UniformModel
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.presets import find_preset_scene
from aosplan.scenes.scene import Layer

near = partial(pytest.approx, abs=0.0)
PATTERNS = [
    Pattern(1, 1),
    Pattern(7, 7),
    pattern_for("trimmed", 50),
    pattern_for("trimmed", 11),
    Pattern(1, 23),
    Pattern(3, 9, 4.0),
    Pattern(4, 4, removed=tuple((row, column) for row in range(1, 4) for column in range(4))),
]
LAYERS = [Layer(1.0, 1.5, 0.2, 0.3), Layer(4.0, 5.0, 0.4, 0.5), Layer(9.0, 12.0, 0.3, 0.2)]


def triangle_by_quadrature(distance, spread):
    """E[max(0, 1 - |u + ς Z|)], computed from its definition."""
    u, s = mp.mpf(distance), mp.mpf(spread)
    low, high = -u - 9 * s, -u + 9 * s
    kinks = sorted({low, high, *(x for x in (-1 - u, -u, 1 - u) if -9 * s < x < 9 * s)})
    kinks = [x for x in kinks if -9 * s <= x <= 9 * s] or [-9 * s, 9 * s]
    kinks = sorted({-9 * s, 9 * s, *kinks})
    return mp.quad(lambda x: max(0, 1 - abs(u + x)) * mp.npdf(x, 0, s), kinks)


@pytest.mark.parametrize("spread", [1e-3, 0.05, 0.43, 0.99, 1.01, 3.0, 40.0])
@pytest.mark.parametrize("distance", [0.0, 0.3, 1.0, 1.2, 2.5])
def test_the_blurred_triangle_is_an_expectation(distance, spread):
    expected = triangle_by_quadrature(distance, spread)
    assert abs(blurred_overlap(distance, spread) - float(expected)) < 4e-16


def second_difference(distance, spread):
    """The same value in closed form, with enough digits to allow for cancellation."""
    with mp.workdps(80):
        u, s = mp.mpf(distance), mp.mpf(spread)
        return float(
            sum(
                weight * ((u + k) * mp.ncdf((u + k) / s) + s * mp.npdf((u + k) / s))
                for k, weight in ((-1, 1), (0, -2), (1, 1))
            )
        )


def test_the_blurred_triangle_keeps_its_digits_everywhere():
    rng = np.random.default_rng(3)
    spread = 10.0 ** rng.uniform(-4, 3, 300)
    distance = rng.uniform(0.0, 1.0 + 6.0 * spread)
    expected = np.array([second_difference(u, s) for u, s in zip(distance, spread, strict=True)])
    found = blurred_overlap(distance, spread)
    assert np.abs(found - expected).max() < 4e-16
    wide = spread > 1.0
    assert np.abs(found / expected - 1.0)[wide].max() < 2e-14
    single = [
        blurred_overlap(u, s) for u, s in zip(distance.tolist(), spread.tolist(), strict=True)
    ]
    assert np.abs(found - single).max() < 4e-16


def test_the_blurred_triangle_without_noise_is_the_triangle():
    distance = np.linspace(-2.0, 2.0, 41)
    sharp = np.maximum(1.0 - np.abs(distance), 0.0)
    assert np.abs(blurred_overlap(distance, 0.0) - sharp).max() < 1e-300
    assert math.isnan(blurred_overlap(0.5, -1.0))
    assert math.isnan(blurred_overlap(math.inf, 0.5))
    assert blurred_overlap(1.0, 1e-9) == near(1e-9 / math.sqrt(2 * math.pi), rel=1e-6)


@pytest.mark.parametrize("pattern", PATTERNS, ids=lambda pattern: f"{pattern.samples}")
@pytest.mark.parametrize("spread", [0.02, 0.6, 2.5])
@pytest.mark.parametrize("dhat", [0.07, 0.5, 1.0, 1.7])
def test_a_pattern_is_the_mean_over_its_pairs(pattern, spread, dhat):
    sites = list(pattern.sites())
    known = {}

    def overlap(apart):
        if apart not in known:
            known[apart] = second_difference(apart, spread)
        return known[apart]

    total = len(sites) + math.fsum(
        overlap(abs(a[0] - b[0]) * dhat * pattern.row_pitch) * overlap(abs(a[1] - b[1]) * dhat)
        for a in sites
        for b in sites
        if a != b
    )
    assert blurred_shortfall(pattern, dhat, spread) == near(total / len(sites) ** 2, rel=1e-12)
    assert pattern_shortfall(pattern, dhat, spread) == blurred_shortfall(pattern, dhat, spread)


def test_position_noise_reduces_vhat_by_the_known_amount():
    # V̂ of 7 x 7 samples at d̂ = 1, s = σ/b = 0.43: 0.980 -> 0.968 (0.9673 by its linear form).
    model = UniformModel(0.567, 0.433, 2.8, hold_error_m=0.43 * 2.8)
    assert model.predict(Pattern(7, 7), 2.8).normalized == pytest.approx(0.96787, abs=5e-6)
    for s in (1e-5, 0.05):
        e1, e0 = s / math.sqrt(math.pi), 1.0 - 2.0 * s / math.sqrt(math.pi)
        linear = 4 * 6 / 7**3 * e1 * e0 + 4 * 6**2 / 7**4 * e1**2
        noisy = blurred_shortfall(Pattern(7, 7), 1.0, s * math.sqrt(2.0))
        assert noisy - 1 / 49 == near(linear, rel=1e-8 if s < 0.01 else 1e-9)


def in_standard_errors(values, expected):
    error = np.std(values, ddof=1) / math.sqrt(len(values))
    assert 0.0 < error < 4e-3 * expected
    assert abs(np.mean(values) - expected) < 4.0 * error


@pytest.mark.parametrize("hold_error", [0.2, 1.0])
def test_the_expectation_is_that_over_flights(hold_error):
    rng = np.random.default_rng(4)
    pattern = pattern_for("trimmed", 18)
    at = np.array(list(pattern.sites()), dtype=float)
    uniform = UniformModel(0.6, 0.4, 1.3, hold_error_m=hold_error)
    flights = [1.1 * at + hold_error * rng.standard_normal(at.shape) for _ in range(2500)]
    in_standard_errors(
        [positions_shortfall(flight, 1.3) for flight in flights[:1500]],
        uniform.predict(pattern, 1.1).shortfall,
    )
    layered = LayeredModel(LAYERS, 30.0, hold_error_m=hold_error)
    exactly = LayeredModel(LAYERS, 30.0)
    in_standard_errors(
        [exactly.positions_shortfall(flight) for flight in flights],
        layered.predict(pattern, 1.1).shortfall,
    )


@pytest.mark.parametrize("hold_error", [0.05, 0.8, 6.0])
def test_blurred_slices_are_integrals(hold_error):
    model = LayeredModel(LAYERS, 30.0, hold_error_m=hold_error)
    deviation = math.sqrt(2.0) * hold_error
    odds = [layer.density / (1.0 - layer.density) for layer in LAYERS]
    reach = [layer.occluder_size_m * 30.0 / layer.height_m for layer in LAYERS]

    def covariance(y, x):
        terms = (
            1.0 + odd * max(0.0, 1.0 - abs(x) / far) * max(0.0, 1.0 - abs(y) / far)
            for odd, far in zip(odds, reach, strict=True)
        )
        return math.prod(terms) - 1.0

    def density(x, middle):
        z = (x - middle) / deviation
        return math.exp(-0.5 * z * z) / (math.sqrt(2.0 * math.pi) * deviation)

    # Simpson's rule is used on panels between the kinks. The panels are small compared with the
    # noise.
    def axis(middle):
        kinks = sorted({0.0, *reach, *(-far for far in reach)})
        low, high = middle - 9.0 * deviation, middle + 9.0 * deviation
        ends = [low, *(k for k in kinks if low < k < high), high]
        return [np.linspace(a, b, 121) for a, b in pairwise(ends)]

    def expected(x0, y0):
        total = 0.0
        for x in axis(x0):
            for y in axis(y0):
                tau = [
                    np.outer(np.maximum(1 - np.abs(y) / f, 0), np.maximum(1 - np.abs(x) / f, 0))
                    for f in reach
                ]
                product = (
                    np.prod([1.0 + o * t for o, t in zip(odds, tau, strict=True)], axis=0) - 1.0
                )
                weight = np.outer([density(v, y0) for v in y], [density(v, x0) for v in x])
                along_x = integrate.simpson(product * weight, x=x, axis=1)
                total += integrate.simpson(along_x, x=y)
        return total

    assert covariance(0.0, 0.0) == pytest.approx(math.prod(1 + o for o in odds) - 1)
    offsets = np.array([0.0, 0.7, 2.1])
    slices = Slices(LAYERS, 30.0)
    pairs = RayPairs(slices.covariance, slices.reach_m, math.sqrt(2.0) * hold_error)
    found = pairs.at_crossings(offsets, offsets[:2])
    found = found * model.density / model.transparency
    for row, y in enumerate(offsets[:2].tolist()):
        for column, x in enumerate(offsets.tolist()):
            wanted = covariance(0.0, 0.0) if x == y == 0.0 else expected(x, y)
            assert found[row, column] == pytest.approx(wanted, abs=3e-6 * covariance(0.0, 0.0))


def test_one_blurred_slice_is_the_uniform_model():
    layered = LayeredModel([Layer(9.0, 11.0, 0.4, 0.5)], 50.0, hold_error_m=0.7)
    uniform = UniformModel(0.4, 0.6, 2.5, hold_error_m=0.7)
    for pattern in PATTERNS:
        for baseline in (0.2, 1.0, 2.5, 4.0):
            assert layered.predict(pattern, baseline).shortfall == near(
                uniform.predict(pattern, baseline).shortfall, rel=1e-10
            )
    assert layered.independent_baseline_m == near(uniform.independent_baseline_m, rel=1e-14)


def models(hold_error):
    return (
        UniformModel(0.567, 0.433, 2.8, hold_error_m=hold_error),
        LayeredModel(LAYERS, 30.0, hold_error_m=hold_error),
    )


@pytest.mark.parametrize("which", [0, 1])
def test_zero_noise_does_not_change_the_prediction(which):
    exact = (UniformModel(0.567, 0.433, 2.8), LayeredModel(LAYERS, 30.0))[which]
    for pattern in PATTERNS:
        assert models(0.0)[which].predict(pattern, 1.1) == exact.predict(pattern, 1.1)
        slight = models(1e-7)[which].predict(pattern, 1.1).shortfall
        assert slight == near(exact.predict(pattern, 1.1).shortfall, rel=2e-5)


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("hold_error", [0.1, 0.7, 3.0])
def test_visibility_still_rises_with_the_baseline_and_the_samples(which, hold_error):
    model = models(hold_error)[which]
    assert model.rises_with_baseline
    top = model.independent_baseline_m
    for pattern in PATTERNS:
        found = [model.predict(pattern, share * top).shortfall for share in np.linspace(0, 1, 30)]
        assert all(later <= earlier * (1 + 1e-12) for earlier, later in pairwise(found))
        assert found[0] <= 1.0
        assert found[-1] == near(1.0 / pattern.samples, rel=1e-12)
        assert found[0] > found[-1] or pattern.samples == 1
    for baseline in (0.02 * top, 0.1 * top, 0.4 * top):
        whole = [
            model.predict(frame_at("trimmed", index).whole, baseline).shortfall
            for index in range(1, 20)
        ]
        assert whole == sorted(whole, reverse=True)
        for frame in (range(43, 50), range(50, 57)):
            within = [model.predict(pattern_for("trimmed", n), baseline).shortfall for n in frame]
            assert within == sorted(within, reverse=True)


def test_scattered_sites_are_summed_pair_by_pair():
    # Both methods give the same result for the offsets of a lattice.
    lattice = Pattern(4, 5)
    assert scattered_shortfall(lattice.offsets(), 0.8, 0.6) == near(
        blurred_shortfall(lattice, 0.8, 0.6), rel=1e-13
    )
    layered = LayeredModel(LAYERS, 30.0, hold_error_m=0.7)
    points = 1.1 * np.array(list(lattice.offsets()))
    assert layered.positions_shortfall(points) == near(
        layered.predict(lattice, 1.1).shortfall, rel=1e-12
    )
    spiral, rng = Spiral(11, 2.0), np.random.default_rng(9)
    at = 1.2 * np.array(list(spiral.offsets()))
    flights = [at + 0.4 * rng.standard_normal(at.shape) for _ in range(1500)]
    for noisy, shortfall in (
        (UniformModel(0.6, 0.4, 1.3, 0.4), lambda flight: positions_shortfall(flight, 1.3)),
        (
            LayeredModel(LAYERS, 30.0, hold_error_m=0.4),
            LayeredModel(LAYERS, 30.0).positions_shortfall,
        ),
    ):
        found = noisy.predict(spiral, 1.2).shortfall
        in_standard_errors([shortfall(flight) for flight in flights], found)


# --- Plans ---------------------------------------------------------------------------------


def test_a_plan_with_noise_meets_its_target_with_the_fewest_samples():
    found = plan(PlanRequest(altitude=40, hold_error=0.5)).solution
    unit = plan(PlanRequest(altitude=40)).solution.baseline_m
    assert found.baseline_m == unit
    # With one d̂ for all heights, 54 samples would be needed.
    camera = find_camera("dji-m3t-thermal")
    slices = find_preset_scene("paper-forest").slices()
    model = LayeredModel(slices, 40.0, camera.focal_length_px, hold_error_m=0.5)
    reaches = [
        count
        for count in range(50, found.pattern.samples + 1)
        if model.predict(pattern_for("trimmed", count), unit).shortfall <= 0.02 * (1 + 1e-12)
    ]
    assert reaches == [found.pattern.samples]
    assert found.samples_required == found.pattern.samples > 50
    assert found.met
    assert "--hold-error" in found.limits[0].message


@pytest.mark.parametrize("model", ["uniform", "layered"])
@pytest.mark.parametrize("optimize", ["samples", "aperture", "time"])
def test_every_objective_takes_noise_into_account(model, optimize):
    request = PlanRequest(altitude=40, model=model, optimize=optimize, vhat=0.95)
    noisy = PlanRequest(altitude=40, model=model, optimize=optimize, vhat=0.95, hold_error=0.6)
    without, held = plan(request), plan(noisy)
    assert held.solution.met
    assert held.solution.prediction.normalized >= 0.95 * (1 - 1e-12)
    measure = {
        "samples": lambda p: p.solution.pattern.samples,
        "aperture": lambda p: max(p.extent_m),
        "time": lambda p: p.document()["flight"]["time_s"],
    }[optimize]
    if optimize == "aperture":  # If sites are close together, the noise increases the aperture.
        assert measure(held) != measure(without)
    else:
        assert measure(held) > measure(without)


def test_a_fixed_number_of_samples_may_go_wider_than_the_rule():
    rule = plan(PlanRequest(altitude=40)).solution.baseline_m
    found = plan(PlanRequest(altitude=40, hold_error=1.0, samples=52)).solution
    assert found.met
    assert rule < found.baseline_m < 2.0 * rule
    assert found.prediction.shortfall == near(0.02, rel=1e-9)


# --- The measured model --------------------------------------------------------------------


@pytest.fixture(scope="module")
def forest():
    return clumped_forest(STANDS["beech"], side_m=16.0, voxel_m=0.5)


def test_measured_expectations_are_means_over_flights(forest):
    pattern = pattern_for("trimmed", 11)
    noisy = MeasuredModel(forest, 50.0, hold_error_m=0.8)
    exact = MeasuredModel(forest, 50.0)
    flown = noisy.noise_expectation(pattern, 1.5)
    assert (flown.flights, flown.seed) == (37, 1)
    flights = [exact.predict_positions(at) for at in noisy.flights_m(pattern, 1.5)]
    assert flown.prediction.expected == near(np.mean([f.expected for f in flights]), rel=1e-12)
    assert flown.prediction.density == near(np.mean([f.density for f in flights]), rel=1e-12)
    assert flown.expected_error == near(
        np.std([f.expected for f in flights], ddof=1) / math.sqrt(37), rel=1e-12
    )
    assert noisy.predict(pattern, 1.5) == flown.prediction
    assert exact.predict(pattern, 1.5) != flown.prediction
    # Results with other random numbers agree within the standard errors.
    rng = np.random.default_rng(12)
    sites = exact.sites_m(pattern, 1.5)
    others = [
        exact.predict_positions(sites + 0.8 * rng.standard_normal(sites.shape)) for _ in range(120)
    ]
    for name, error in (
        ("expected", flown.expected_error),
        ("normalized", flown.normalized_error),
        ("density", flown.density_error),
    ):
        values = [getattr(each, name) for each in others]
        both = math.hypot(error, np.std(values, ddof=1) / math.sqrt(120))
        assert abs(getattr(flown.prediction, name) - np.mean(values)) < 4.0 * both
        assert 0.0 < error < 0.01


def test_random_position_errors_are_the_same_for_every_plan(forest):
    model = MeasuredModel(forest, 50.0, hold_error_m=0.8)
    small, large = (next(model.flights_m(pattern_for("trimmed", n), 1.0)) for n in (9, 9))
    assert (small == large).all()
    near_by = next(model.flights_m(Pattern(3, 3), 1.0 + 1e-9))
    assert np.abs(near_by - small).max() < 1e-8


def test_the_surrogate_of_a_noisy_stand_is_near_its_model(forest):
    table = correlogram(forest)
    for hold_error in (0.3, 1.5):
        model = MeasuredModel(forest, 50.0, hold_error_m=hold_error)
        surrogate = CorrelogramModel(table, 50.0, hold_error_m=hold_error)
        for baseline in (0.8, 2.0):
            exact, quick = (each.predict(Pattern(6, 6), baseline) for each in (model, surrogate))
            assert quick.normalized == pytest.approx(exact.normalized, abs=0.025)
            assert quick.density == pytest.approx(exact.density, abs=0.01)
    assert CorrelogramModel(table, 50.0, hold_error_m=0.0).predict(
        Pattern(6, 6), 1.0
    ) == CorrelogramModel(table, 50.0).predict(Pattern(6, 6), 1.0)
