"""The layered model compared with exact sums, exact enumeration, and simulated volumes."""

import math
from fractions import Fraction
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import exact

from aosplan.grid.patterns import Pattern, pattern_for
from aosplan.models import layered as layered_module
from aosplan.models import layered_pairs as pairs_module
from aosplan.models.equations import visibility, visibility_shortfall
from aosplan.models.layered import LayeredModel, layered_shortfall, layered_visibility
from aosplan.models.positions import pattern_shortfall, positions_shortfall
from aosplan.scenes.presets import SCENES
from aosplan.scenes.scene import Layer, UniformScene

near = partial(pytest.approx, abs=0.0)
"""`approx` without its absolute tolerance of 1e-12."""


@st.composite
def stacks(draw, most=4):
    """A stack of slices below 50 m."""
    layers, bottom = [], 0.0
    for _ in range(draw(st.integers(1, most))):
        bottom += draw(st.floats(0.0, 3.0))
        top = bottom + draw(st.floats(0.05, 5.0))
        density = draw(st.one_of(st.floats(1e-6, 0.99), st.floats(1e-300, 1e-6)))
        layers.append(Layer(bottom, top, density, draw(st.floats(0.02, 5.0))))
        bottom = top
    return tuple(layers)


def positions(pattern, baseline):
    """Sites in metres, as fractions that are exactly equal to the floats of the model."""
    b = Fraction(baseline)
    return [(column * b, row * b * Fraction(pattern.row_pitch)) for row, column in pattern.sites()]


# --- One slice -----------------------------------------------------------------------------


@given(
    density=st.floats(1e-9, 0.999),
    rows=st.integers(1, 12),
    columns=st.integers(1, 12),
    dhat=st.floats(0.0, 1.5),
)
def test_one_slice_agrees_with_eq_2(density, rows, columns, dhat):
    # Occluders of 0.5 m at the middle of 4 m to 6 m, seen from 40 m, have d̂ = 1 at 4 m.
    layers = [Layer(4.0, 6.0, density, 0.5)]
    baseline = 4.0 * dhat
    assert layered_visibility(layers, 40.0, rows, columns, baseline) == near(
        visibility(density, rows, columns, dhat), rel=1e-12
    )
    assert layered_shortfall(layers, 40.0, rows, columns, baseline) == near(
        visibility_shortfall(rows, columns, dhat), rel=1e-12
    )


@pytest.mark.parametrize("dhat", [0.05, 1 / 3, 0.6, 1.0, 2.0])
def test_one_slice_is_the_uniform_model_for_every_trimmed_grid(dhat):
    model = LayeredModel([Layer(4.0, 6.0, 0.3, 0.5)], 40.0)
    assert model.independent_baseline_m == 4.0
    for samples in range(1, 60):
        pattern = pattern_for("trimmed", samples)
        shortfall = model.predict(pattern, 4.0 * dhat).shortfall
        assert shortfall == near(pattern_shortfall(pattern, dhat), rel=1e-12), samples


def test_slices_with_equal_disparity_equal_one_slice():
    """Slices with the same ratio of size to height have the same disparity, and K = 1/N at d̂ =
    1.
    """
    apart = [Layer(height, height, 0.2, 0.05 * height) for height in (2.0, 4.0, 8.0)]
    samples = pattern_for("trimmed", 20)
    mixed = LayeredModel(apart, 40.0).predict(samples, 1.0)
    # K is less than in the uniform model, because two occluders may hide a target.
    assert mixed.density == near(1 - 0.8**3, rel=1e-15)
    assert mixed.shortfall < pattern_shortfall(samples, 0.5)
    assert LayeredModel(apart, 40.0).predict(samples, 2.0).shortfall == near(1 / 20, rel=1e-12)


# --- Comparison with exact sums ------------------------------------------------------------


@settings(max_examples=60)
@given(
    layers=stacks(),
    samples=st.integers(1, 9),
    share=st.floats(0.01, 1.1),
    grid=st.sampled_from(["trimmed", "lanes"]),
)
def test_the_shortfall_equals_the_sum_over_all_pairs_and_slices(layers, samples, share, grid):
    model = LayeredModel(layers, 50.0)
    baseline = share * min(model.independent_baseline_m, 1e6)
    pattern = pattern_for(grid, samples, lanes=2, lane_pitch=2.5)
    density, shortfall = exact.layered_pair_sum(layers, 50.0, positions(pattern, baseline))
    prediction = model.predict(pattern, baseline)
    assert prediction.density == near(float(density), rel=1e-12)
    assert prediction.transparency == near(float(1 - density), rel=1e-12)
    assert prediction.shortfall == near(float(shortfall), rel=1e-12)
    assert prediction.expected == near(float(exact.visibility(density, shortfall)), rel=1e-12)


@settings(max_examples=30)
@given(layers=stacks(3), count=st.integers(1, 10), seed=st.integers(0, 10**6))
def test_scattered_positions_equal_the_sum_over_all_pairs_and_slices(layers, count, seed):
    points = np.random.default_rng(seed).uniform(-3.0, 3.0, (count, 2))
    _, shortfall = exact.layered_pair_sum(layers, 50.0, points.tolist())
    found = LayeredModel(layers, 50.0).positions_shortfall(points)
    assert found == near(float(shortfall), rel=1e-12)


def test_sites_given_as_positions_or_as_a_pattern_are_the_same():
    layers = [Layer(1.0, 3.0, 0.1, 0.2), Layer(4.0, 9.0, 0.4, 0.5), Layer(9.0, 12.0, 0.2, 0.1)]
    model = LayeredModel(layers, 50.0)
    for samples in (1, 7, 40, 53):
        pattern = pattern_for("trimmed", samples)
        points = np.array(positions(pattern, 0.7), dtype=float)
        assert model.positions_shortfall(points) == near(
            model.predict(pattern, 0.7).shortfall, rel=1e-12
        )


def test_one_slice_at_any_positions_is_the_uniform_sum():
    points = np.random.default_rng(1).uniform(-8.0, 8.0, (60, 2))
    model = LayeredModel([Layer(4.0, 6.0, 0.3, 0.5)], 40.0)
    assert model.positions_shortfall(points) == near(positions_shortfall(points, 4.0), rel=1e-12)


@pytest.mark.parametrize("terms_at_once", [1, 7, 1000])
def test_the_size_of_a_block_does_not_matter(monkeypatch, terms_at_once):
    layers = [Layer(1.0, 3.0, 0.1, 0.2), Layer(4.0, 9.0, 0.4, 0.5), Layer(9.0, 12.0, 0.2, 0.1)]
    points = np.random.default_rng(2).uniform(-3.0, 3.0, (25, 2))

    def found():
        model = LayeredModel(layers, 50.0)  # a new model without stored results
        return model.predict(Pattern(9, 11), 0.6).shortfall, model.positions_shortfall(points)

    at_once = found()
    monkeypatch.setattr(layered_module, "OFFSETS_AT_ONCE", terms_at_once)
    monkeypatch.setattr(pairs_module, "TERMS_AT_ONCE", terms_at_once)
    assert found() == near(at_once, rel=1e-14)


# --- Comparison with exact enumeration -----------------------------------------------------

ENUMERATED = [
    # These are the share and d̂ of every slice, followed by rows and columns.
    ([("1/3", "1/2")], (2, 2)),
    ([("1/3", "2/5")], (2, 3)),
    ([("9/10", "3/4")], (1, 5)),
    ([("1/4", "1/2"), ("1/5", "1/4")], (2, 2)),
    ([("1/4", "3/2"), ("1/5", "1/8"), ("1/2", "5/8")], (1, 3)),
    ([("1/4", "3/4"), ("2/3", "3/8"), ("1/10", "1/8")], (2, 2)),
    ([("1/4", "3/4"), ("1/2", "3/8")], (2, 3)),
    ([("1/10", "1/4"), ("1/10", "1/2"), ("1/10", "3/4"), ("1/10", "1")], (1, 4)),
]


@pytest.mark.parametrize(("slices", "size"), ENUMERATED)
def test_every_state_of_a_tiny_volume_counted_out_gives_the_same_visibility(slices, size):
    """Enumeration uses only occupied and empty cells.  It uses neither covariances nor the
    independence of pairs.
    """
    exactly = [(Fraction(density), Fraction(dhat)) for density, dhat in slices]
    sites = [(row, column) for row in range(size[0]) for column in range(size[1])]
    density, seen = exact.enumerated_volume(exactly, sites)
    # The samples are 1 m apart at 64 m. An occluder of 1/4 m at a height of 16 d̂ metres has the
    # disparity d̂.
    layers = [
        Layer(16.0 * float(dhat), 16.0 * float(dhat), float(share), 0.25) for share, dhat in exactly
    ]
    assert layered_visibility(layers, 64.0, *size, 1.0) == near(float(seen), rel=1e-14)
    assert LayeredModel(layers, 64.0).density == near(float(density), rel=1e-14)
    if len(slices) == 1:
        share, dhat = map(float, exactly[0])
        assert visibility(share, *size, dhat) == near(float(seen), rel=1e-14)


def test_enumeration_and_the_sum_over_pairs_are_the_same_number():
    slices = [(Fraction(1, 4), Fraction(3, 4)), (Fraction(1, 2), Fraction(1, 8))]
    sites = [(0, 0), (0, 1), (1, 1)]
    density, seen = exact.enumerated_volume(slices, sites)
    layers = [(16 * dhat, 16 * dhat, share, Fraction(1, 4)) for share, dhat in slices]
    p, shortfall = exact.layered_pair_sum(layers, 64, [(x, y) for y, x in sites])
    assert density == p
    assert seen == exact.visibility(p, shortfall)


# --- Comparison with simulated volumes -----------------------------------------------------

SIXTY = [Layer(height, height, 0.012, 0.15) for height in np.linspace(0.25, 20.0, 60).tolist()]
"""Sixty slices of small occluders.  Their baselines for d̂ = 1 are very different."""


def simulate(layers, altitude, side, baseline, *, volumes, targets, seed):
    """Simulate X, which is the share of side x side views in which a target is hidden.

    Every slice is a periodic lattice of random cells with a random phase.  For rays to random
    targets, the cells on the rays are looked up.  Returns the estimates of E[X²] and of the
    variance of X about the density p of the cells, each as (mean, standard error).
    """
    rng = np.random.default_rng(seed)
    cells = 128
    c = baseline * np.arange(side)
    p = 1.0 - math.prod(1.0 - layer.density for layer in layers)
    squares, variances = [], []
    for _ in range(volumes):
        hidden = np.zeros((targets, side, side), dtype=bool)
        for layer in layers:
            occupied = rng.random((cells, cells)) < layer.density
            moved = c * layer.height_m / (altitude * layer.occluder_size_m)
            y, x = rng.uniform(0.0, cells, (2, targets, 1))
            row, column = (np.floor(at + moved).astype(int) % cells for at in (y, x))
            hidden |= occupied[row[:, :, None], column[:, None, :]]
        average = hidden.mean(axis=(1, 2))
        squares.append(np.mean(average**2))
        variances.append(np.mean((average - p) ** 2))
    return [
        (np.mean(found), np.std(found, ddof=1) / math.sqrt(volumes))
        for found in (squares, variances)
    ]


@pytest.mark.parametrize(
    ("baseline", "vhat"), [pytest.param(1.0, 0.938, marks=pytest.mark.slow), (3.5, 0.970)]
)
def test_a_simulated_volume_of_sixty_slices_shows_what_is_predicted(baseline, vhat):
    """The simulation agrees within its standard errors.  The uniform formula would give V̂ =
    0.980.
    """
    prediction = LayeredModel(SIXTY, 50.0).predict(Pattern(7, 7), baseline)
    assert prediction.normalized == pytest.approx(vhat, rel=0.0, abs=0.0005)
    (square, square_error), (variance, variance_error) = simulate(
        SIXTY, 50.0, 7, baseline, volumes=100, targets=200, seed=20
    )
    assert abs(1.0 - square - prediction.expected) <= 3.0 * square_error
    scale = prediction.density * prediction.transparency
    shortfall, error = variance / scale, variance_error / scale
    assert abs(shortfall - prediction.shortfall) <= 3.0 * error
    # The simulation is accurate enough to exclude the paper's 1/49.
    assert error < 0.002
    assert abs(shortfall - 1 / 49) > 4.0 * error


def test_simulated_volumes_of_few_thick_slices_show_what_is_predicted():
    layers = [Layer(2.0, 4.0, 0.2, 0.3), Layer(9.0, 11.0, 0.3, 0.5)]
    for baseline in (0.4, 1.3):
        prediction = LayeredModel(layers, 40.0).predict(Pattern(4, 4), baseline)
        (square, square_error), (variance, variance_error) = simulate(
            layers, 40.0, 4, baseline, volumes=100, targets=400, seed=5
        )
        scale = prediction.density * prediction.transparency
        assert abs(1.0 - square - prediction.expected) <= 3.0 * square_error
        assert abs(variance / scale - prediction.shortfall) <= 3.0 * variance_error / scale


# --- Published and design figures ----------------------------------------------------------


def paper_forest():
    preset = SCENES["paper-forest"]
    return UniformScene(
        "paper-forest",
        None,
        preset.occluder_size_m,
        preset.volume_base_m,
        preset.volume_height_m,
        preset.integrated_density,
    )


def test_the_papers_forest_is_cut_into_slices_one_occluder_thick():
    scene = paper_forest()
    layers = scene.slices()
    assert len(layers) == 88  # l/o = 87.69
    assert layers[0].bottom_m == pytest.approx(2.506, abs=0.0005)
    assert layers[-1].top_m == pytest.approx(20.04, abs=0.005)
    assert LayeredModel(layers, 50.0).transparency == near(1 - 0.567, rel=1e-13)


@pytest.mark.parametrize(
    ("samples", "baseline", "extent"),
    [
        (56, "1.906", "13.3"),
        (64, "1.455", "10.2"),
        (81, "1.09", "8.7"),
        (100, "0.903", "8.1"),
        (144, None, "7.68"),
        (900, None, "7.51"),
    ],
)
def test_98_percent_in_layers_of_the_papers_forest_needs_these_baselines(samples, baseline, extent):
    """The smallest baseline, found by bisection, equals the value in the design document. The
    paper's rule gives 3.5 m.
    """
    model = LayeredModel(paper_forest().slices(), 50.0)
    pattern = pattern_for("trimmed", samples)
    low, high = 0.0, 3.5
    for _ in range(40):
        middle = (low + high) / 2
        enough = model.predict(pattern, middle).shortfall <= 0.02
        low, high = (low, middle) if enough else (middle, high)
    assert is_written(high * pattern.longer_side, extent)
    assert baseline is None or is_written(high, baseline)


def is_written(value, text):
    """Whether a value equals a printed number within one unit of its last digit."""
    return abs(value - float(text)) < 10.0 ** -len(text.partition(".")[2])


def test_the_papers_baseline_has_lower_visibility_in_layers_than_in_one_volume():
    model = LayeredModel(paper_forest().slices(), 50.0)
    prediction = model.predict(Pattern(7, 8), 3.5)
    assert 1 / 56 < prediction.shortfall < 0.02


# --- Other results of the model ------------------------------------------------------------


@given(layers=stacks(), samples=st.integers(1, 30), share=st.floats(0.0, 1.2))
def test_the_shortfall_lies_between_one_over_the_samples_and_one(layers, samples, share):
    model = LayeredModel(layers, 50.0)
    baseline = share * min(model.independent_baseline_m, 1e6)
    shortfall = model.predict(pattern_for("trimmed", samples), baseline).shortfall
    assert 1.0 / samples * (1 - 1e-12) <= shortfall <= 1.0 + 1e-12


@given(layers=stacks(), factor=st.floats(1.0, 2.0))
def test_a_larger_baseline_never_reduces_visibility(layers, factor):
    model = LayeredModel(layers, 50.0)
    pattern = pattern_for("trimmed", 13)
    for share in (0.01, 0.1, 0.5):
        baseline = share * min(model.independent_baseline_m, 1e6)
        narrow = model.predict(pattern, baseline).shortfall
        wide = model.predict(pattern, baseline * factor).shortfall
        assert wide <= narrow * (1 + 1e-12)


@given(layers=stacks(), samples=st.integers(2, 30))
def test_samples_share_occluders_only_below_the_independent_baseline(layers, samples):
    model = LayeredModel(layers, 50.0)
    pattern = pattern_for("trimmed", samples)
    independent = min(model.independent_baseline_m, 1e300)
    assert model.predict(pattern, independent).shortfall == near(1 / samples, rel=1e-12)
    assert model.predict(pattern, independent * 1e3).shortfall == near(1 / samples, rel=1e-12)
    if min(layer.density for layer in layers) > 1e-3:
        assert model.predict(pattern, independent * 0.99).shortfall > 1 / samples


def test_samples_at_one_place_equal_one_sample():
    layers = [Layer(1.0, 3.0, 0.1, 0.2), Layer(4.0, 9.0, 0.4, 0.5)]
    assert layered_shortfall(layers, 50.0, 7, 7, 0.0) == near(1.0, rel=1e-14)
    assert layered_visibility(layers, 50.0, 7, 7, 0.0) == near(0.9 * 0.6, rel=1e-14)


def test_an_occluder_smaller_than_a_pixel_counts_as_one_pixel():
    """For o = 1 cm at a height of 10 m and a camera at 50 m, a pixel is 40 m / 2000 px = 2 cm."""
    tiny, grown = Layer(10.0, 10.0, 0.2, 0.01), Layer(10.0, 10.0, 0.2, 0.02)
    with_camera = LayeredModel([tiny], 50.0, focal_length_px=2000.0)
    without = LayeredModel([grown], 50.0)
    assert with_camera.independent_baseline_m == without.independent_baseline_m == 0.1
    assert LayeredModel([grown], 50.0, focal_length_px=2500.0).independent_baseline_m == 0.1
    assert LayeredModel([tiny], 50.0).independent_baseline_m == 0.05


def test_slices_without_occluders_do_not_matter():
    layers = [Layer(1.0, 3.0, 0.1, 0.2), Layer(4.0, 9.0, 0.4, 0.5)]
    empty = [Layer(0.0, 1.0, 0.0, 5.0), *layers, Layer(9.0, 20.0, 0.0, 0.1)]
    for baseline in (0.0, 0.3, 2.0):
        assert layered_visibility(empty, 50.0, 5, 6, baseline) == layered_visibility(
            layers, 50.0, 5, 6, baseline
        )


def test_without_occluders_everything_is_visible():
    for baseline in (0.0, 1.0):
        assert layered_visibility([Layer(1.0, 3.0, 0.0, 0.2)], 50.0, 7, 7, baseline) == 1.0


def test_occluders_on_the_focal_plane_reduce_visibility_at_every_baseline():
    grass = [Layer(0.0, 0.0, 0.3, 0.1)]
    assert layered_shortfall(grass, 50.0, 7, 7, 100.0) == near(1.0, rel=1e-14)
    assert layered_visibility(grass, 50.0, 7, 7, 100.0) == near(0.7, rel=1e-14)


def test_order_of_slices_and_exchange_of_axes_do_not_matter():
    layers = [Layer(1.0, 3.0, 0.1, 0.2), Layer(4.0, 9.0, 0.4, 0.5), Layer(9.0, 12.0, 0.2, 0.1)]
    value = layered_shortfall(layers, 50.0, 4, 9, 0.7)
    assert layered_shortfall(layers[::-1], 50.0, 4, 9, 0.7) == near(value, rel=1e-13)
    assert layered_shortfall(layers, 50.0, 9, 4, 0.7) == near(value, rel=1e-13)


def test_lengths_may_all_be_scaled():
    layers = [Layer(1.0, 3.0, 0.1, 0.2), Layer(4.0, 9.0, 0.4, 0.5)]
    scaled = [Layer(8 * a, 8 * b, density, 8 * size) for a, b, density, size in layers]
    assert layered_visibility(scaled, 400.0, 5, 6, 8 * 0.7) == near(
        layered_visibility(layers, 50.0, 5, 6, 0.7), rel=1e-14
    )


def test_the_fast_bound_is_near_and_not_below_the_prediction():
    layers = [Layer(1.0, 3.0, 0.1, 0.2), Layer(4.0, 9.0, 0.4, 0.5)]
    for hold_error in (0.0, 0.3):
        model = LayeredModel(layers, 50.0, hold_error_m=hold_error)
        for pattern in (Pattern(90, 91), Pattern(1, 5000), Pattern(70, 80, 4.0), Pattern(3, 4)):
            for baseline in (0.001, 0.05, 0.4, 20.0):
                found = model.predict(pattern, baseline)
                bound = model.at_best(pattern, baseline)
                assert bound[:2] == found[:2]
                assert bound.shortfall <= found.shortfall * (1.0 + 1e-12)
                assert bound.shortfall >= 1.0 / pattern.samples
                if baseline < 0.1:
                    assert bound.shortfall > 0.8 * found.shortfall


# --- Arguments -----------------------------------------------------------------------------


def test_layers_may_be_layers_mappings_or_plain_numbers_from_any_iterable():
    layers = [Layer(1.0, 3.0, 0.1, 0.2), Layer(4.0, 9.0, 0.4, 0.5)]
    value = layered_visibility(layers, 50.0, 5, 6, 0.7)
    for other in (
        [layer._asdict() for layer in layers],
        [tuple(layer) for layer in layers],
        [list(layer) for layer in layers],
        [layers[0], tuple(layers[1])],
        np.array(layers),
        iter(layers),
    ):
        assert layered_visibility(other, 50.0, 5, 6, 0.7) == value
    assert layered_visibility(layers, 50, 5.0, np.int64(6), 0.7) == value
    assert type(value) is float


GOOD = {
    "layers": [Layer(1.0, 3.0, 0.1, 0.2)],
    "altitude": 50.0,
    "rows": 5,
    "columns": 6,
    "baseline": 0.7,
}


@pytest.mark.parametrize("function", [layered_visibility, layered_shortfall])
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("layers", []),
        ("layers", [Layer(1.0, 3.0, -0.1, 0.2)]),
        ("layers", [Layer(1.0, 3.0, 1.0, 0.2)]),
        ("layers", [Layer(1.0, 3.0, 1.1, 0.2)]),
        ("layers", [Layer(1.0, 3.0, math.nan, 0.2)]),
        ("layers", [Layer(1.0, 3.0, 0.1, 0.0)]),
        ("layers", [Layer(1.0, 3.0, 0.1, -1.0)]),
        ("layers", [Layer(1.0, 3.0, 0.1, math.nan)]),
        ("layers", [Layer(-3.0, 1.0, 0.1, 0.2)]),
        ("layers", [Layer(math.nan, 3.0, 0.1, 0.2)]),
        ("layers", [Layer(40.0, 60.0, 0.1, 0.2)]),
        ("layers", [Layer(1.0, 3.0, 0.1, 0.2), Layer(3.0, 5.0, 1.5, 0.2)]),
        ("altitude", 2.0),
        ("altitude", 0.0),
        ("altitude", -50.0),
        ("altitude", math.nan),
        ("altitude", math.inf),
        ("rows", 0),
        ("rows", -1),
        ("rows", 2.5),
        ("rows", math.nan),
        ("rows", math.inf),
        ("columns", 0),
        ("columns", 2.5),
        ("columns", math.nan),
        ("columns", math.inf),
        ("baseline", -0.1),
        ("baseline", math.nan),
    ],
)
def test_outside_the_domain_every_argument_gives_nan_and_no_warning(function, name, value):
    assert math.isfinite(function(**GOOD))
    assert math.isnan(function(**(GOOD | {name: value})))


@pytest.mark.parametrize("function", [layered_visibility, layered_shortfall])
def test_an_infinite_baseline_gives_nan_or_the_limit_without_a_warning(function):
    value = function(**(GOOD | {"baseline": math.inf}))
    assert math.isnan(value) or value == near(function(**(GOOD | {"baseline": 1e9})), rel=1e-12)
