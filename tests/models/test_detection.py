"""Detection, compared with numbers of the design document, with random points, and with random
windows and cells.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.paths import SHARED

from aosplan.errors import RequestError
from aosplan.grid.patterns import Pattern, local_sites, pattern_for
from aosplan.models.clutter import independent_windows
from aosplan.models.counted_detection import count_detection, tail_level
from aosplan.models.crown_clutter import crown_covariances
from aosplan.models.detection import PERSON, DetectionModel, Signature
from aosplan.models.measured import MeasuredModel
from aosplan.models.plot_interior import PlotInterior, counted_part
from aosplan.models.seen_share import SeenShare
from aosplan.models.target_window import Target, kernels, points_of, rotation
from aosplan.models.window_pairs import WindowPairs
from aosplan.scenes.files.point_cloud import read_voxels
from aosplan.scenes.integral_image import CROWN_LENGTH_M, gaussian_field
from aosplan.scenes.matched_window import MatchedWindow
from aosplan.scenes.scene import Layer
from aosplan.scenes.voxels import VoxelVolume
from aosplan.simulation.forests import clumped_forest, generator

SLICE_OF = 1.0 - 0.1 ** (1 / 20)
TWENTY = tuple(Layer(k - 0.01, k + 0.01, SLICE_OF, 0.25) for k in range(1, 21))
ONE = (Layer(11.99, 12.01, 0.9, 0.25),)
COARSE = (Layer(11.99, 12.01, 0.9, 0.5),)


def detection(layers, samples, baseline_m, signature=(5.0, 0.0, 0.0), altitude_m=50.0, **how):
    model = DetectionModel(layers, altitude_m, PERSON, Signature(*signature), **how)
    return model.predict(pattern_for("trimmed", samples), baseline_m)


# --- The window's kernels ---------------------------------------------------------------------


@pytest.mark.parametrize("target", [PERSON, Target(2.0, 2.0), Target(0.3, 4.0)])
def test_kernels_have_the_moments_of_drawn_pairs_of_points(target):
    """For two random points of a rectangle, E|δ|² is (w² + l²)/6.  It is larger if one of the
    points is in a shifted rectangle or in the box.
    """
    made = kernels(target, 0.2)
    square = np.add.outer(made.fine_m**2, made.fine_m**2)
    expected = (target.width_m**2 + target.length_m**2) / 6.0
    assert float((made.window[0] * square).sum()) == pytest.approx(expected, rel=0.02)
    moved = expected + made.step_m**2
    for index in (1, 2):
        assert float((made.window[index] * square).sum()) == pytest.approx(moved, rel=0.02)
    square = np.add.outer(made.coarse_m**2, made.coarse_m**2)
    mixed = (target.width_m**2 + target.length_m**2) / 12.0 + target.box_m**2 / 6.0
    assert float((made.box[0] * square).sum()) == pytest.approx(mixed, rel=0.02)
    assert float((made.box[1] * square).sum()) == pytest.approx(target.box_m**2 / 3.0, rel=0.02)


# --- The pairs of rays, compared with random slices ---------------------------------------------


def test_shared_occluders_of_pairs_of_rays_equal_those_in_random_slices():
    """For one offset on the ground and one offset of the cameras, Q and C agree with 20,000 random
    stacks.
    """
    layers = (Layer(3.0, 5.0, 0.3, 0.4), Layer(7.0, 9.0, 0.1, 0.3), Layer(9.0, 13.0, 0.5, 0.8))
    altitude, ground, camera = 40.0, np.array([0.15, -0.1]), np.array([0.6, 0.4])
    rng = np.random.default_rng(3)
    count = 20_000
    both, same = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
    open_pair = np.ones(count, dtype=bool)
    for layer in reversed(layers):
        ratio = layer.height_m / altitude
        apart = (ground * (1.0 - ratio) + camera * ratio) / layer.occluder_size_m
        phase = rng.random((count, 2))
        one_cell = (np.floor(phase) == np.floor(phase + apart)).all(axis=1)
        first = rng.random(count) < layer.density
        second = np.where(one_cell, first, rng.random(count) < layer.density)
        same |= open_pair & one_cell & first
        open_pair &= ~first & ~second
    both = open_pair
    pairs = WindowPairs(layers, altitude, PERSON)
    # The lattice contains the simulated offset and its mirror images, like the lattice of the
    # integrals.
    found_both, found_same = (
        found[1, 0] for found in pairs.maps(np.array([ground[0], ground[1]]), camera[0], camera[1])
    )
    for drawn, predicted in ((both, found_both), (same, found_same)):
        error = math.sqrt(predicted * (1.0 - predicted) / count)
        assert abs(drawn.mean() - predicted) < 4.0 * error


def test_the_variance_of_the_seen_share_is_that_of_drawn_windows():
    """The variance agrees with the variance of random windows below one slice of random cells, for
    converging rays.
    """
    layer, altitude, target = Layer(9.99, 10.01, 0.6, 0.3), 40.0, PERSON
    pattern, baseline = Pattern(2, 3), 1.1
    sites = baseline * np.array(list(pattern.offsets()))
    rng = np.random.default_rng(4)
    ratio = layer.height_m / altitude
    points = points_of(target, 0.05) * (1.0 - ratio)
    shares = []
    for _ in range(3000):
        turned = points @ rotation(rng.random() * math.pi) + 5.0 + rng.random(2)
        cells = np.floor((turned[None] + ratio * sites[:, None]) / layer.occluder_size_m).astype(
            int
        )
        hidden = rng.random((40, 40)) < layer.density
        shares.append(1.0 - hidden[cells[..., 1], cells[..., 0]].mean())
    shares = np.array(shares)
    model = DetectionModel([layer], altitude, target)
    seen = model.predict(pattern, baseline).seen
    squares = (shares - shares.mean()) ** 2
    error = squares.std() / math.sqrt(len(shares))
    assert abs(squares.mean() - seen.variance) < 4.0 * error + 0.01 * seen.variance
    assert abs(shares.mean() - seen.mean) < 4.0 * shares.std() / math.sqrt(len(shares))
    for share in (0.25, 0.5):
        assert abs((shares >= share).mean() - seen.at_least(share)) < 0.05


# --- The design's figures ---------------------------------------------------------------------


def test_single_slice_seen_share():
    """Section 4.8, parallel rays: var_s is 0.005755, and P(s >= 0.1) is 0.469 within 0.05."""
    seen = detection(COARSE, 9, 2.0, rigid=False).seen
    assert seen.variance == pytest.approx(0.005755, rel=0.01)
    assert seen.at_least(0.1) == pytest.approx(0.469, abs=0.05)


@pytest.mark.parametrize(
    ("layers", "samples", "found", "clutter", "level"),
    [
        (ONE, 49, {2.0: 0.102, 5.0: 0.954, 10.0: 1.0}, 0.0649, 4.28),
        (TWENTY, 9, {2.0: 0.011, 5.0: 0.556, 10.0: 0.974}, 0.0933, 4.80),
    ],
)
def test_detection_agrees_with_the_values_of_the_design_document(
    layers, samples, found, clutter, level
):
    """Section 4.8: without the box mean, the share of targets that are found at three contrasts is
    within 0.018 of the design's values.
    """
    predicted = detection(layers, samples, 2.0, rigid=False, local=False)
    assert predicted.deviation == pytest.approx(clutter, rel=0.021)
    assert predicted.threshold / predicted.deviation == pytest.approx(level, rel=0.02)
    curve = dict(predicted.curve)
    for contrast, share in found.items():
        assert abs(curve[contrast] - share) < 0.05 + 2 * 0.018


# --- Necessary properties ----------------------------------------------------------------------


def test_a_table_of_offsets_agrees_with_the_integrals():
    exact = DetectionModel(TWENTY, 50.0, PERSON, Signature(3.0, -1.0, 0.3))
    table = DetectionModel(TWENTY, 50.0, PERSON, Signature(3.0, -1.0, 0.3)).for_search()
    for samples, baseline in ((9, 0.7), (25, 2.0), (30, 4.0)):
        pattern = pattern_for("trimmed", samples)
        one, other = exact.predict(pattern, baseline), table.predict(pattern, baseline)
        assert other.seen.variance == pytest.approx(one.seen.variance, rel=0.03)
        assert other.deviation == pytest.approx(one.deviation, rel=0.02)
        assert other.probability == pytest.approx(one.probability, abs=0.02)


def test_lattice_sites_given_as_positions_have_the_same_detection():
    model = DetectionModel(ONE, 50.0)
    pattern = pattern_for("trimmed", 14)
    lattice = model.predict(pattern, 1.5)
    positions = 1.5 * np.array(list(pattern.offsets()))
    scattered = model.predict_positions(positions)
    assert scattered.seen.variance == pytest.approx(lattice.seen.variance, rel=1e-9)
    assert scattered.probability == pytest.approx(lattice.probability, rel=1e-9)
    assert model.probability_at(positions) == scattered.probability
    assert model.probability(pattern, 1.5) == lattice.probability


def test_detection_increases_with_contrast_and_false_alarms():
    lone = detection(TWENTY, 25, 2.0)
    values = [share for _, share in lone.curve]
    assert values == sorted(values)
    assert values[0] < 0.01
    assert values[-1] > 0.9
    lax = detection(TWENTY, 25, 2.0, false_alarms=100.0)
    assert lax.threshold < lone.threshold
    assert lax.probability > lone.probability


def test_cold_and_warm_targets_have_the_same_detection():
    warm = detection(TWENTY, 16, 2.0, (3.0, -1.0, 0.2))
    cold = detection(TWENTY, 16, 2.0, (-3.0, 1.0, 0.2))
    assert cold.probability == pytest.approx(warm.probability, rel=1e-12)
    assert [c for c, _ in cold.curve] == sorted(-c for c, _ in warm.curve)


def test_clutter_at_crown_scale_hides_a_person():
    """If half of the variance of the clutter is at the scale of crowns, a target that was found
    with high probability is no longer found.
    """
    own = detection(TWENTY, 25, 2.0, (5.0, 0.0, 0.0), local=False)
    crowns = detection(TWENTY, 25, 2.0, (5.0, 0.0, 0.5), local=False)
    assert own.probability > 0.75
    assert crowns.probability < 0.05
    # Subtracting the box mean removes part of the clutter of crowns.
    assert detection(TWENTY, 25, 2.0, (5.0, 0.0, 0.5)).probability > crowns.probability


def test_crowns_have_the_covariance_of_drawn_fields():
    """The means of smooth random fields over window and box have the predicted covariance, for one
    photo and slice.
    """
    target, altitude, height = PERSON, 40.0, 10.0
    made = kernels(target, 0.3)
    window, box = crown_covariances(
        np.zeros((1, 2)), np.array([height]), np.array([1.0]), altitude, target, made
    )
    # Projected on the ground, the length of a crown is 1 m/(1 - H/h).
    shape, pitch = (480, 480), 0.1
    detector = MatchedWindow((target.width_m, target.length_m), shape, (pitch, pitch))
    found = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        field = gaussian_field(rng, shape, pitch, CROWN_LENGTH_M / (1.0 - height / altitude))
        around = detector.box_mean(field)
        means = np.array(detector.means(field))
        found.append([(means**2).mean(), (means * around).mean(), (around**2).mean()])
    predicted = [window[0], *box]
    error = np.std(found, axis=0, ddof=1) / math.sqrt(len(found))
    assert (np.abs(np.mean(found, axis=0) - predicted) < 4.0 * error + 0.01).all()
    assert (error < 0.03).all()


@pytest.mark.parametrize("kind", ["grid", "gaps", "scattered"])
def test_crowns_of_a_pattern_are_summed_over_all_its_pairs(kind):
    """The covariances equal sums over all pairs of photos and heights.  The mean over the box is
    computed by quadrature.
    """
    altitude, heights = 40.0, np.array([3.0, 9.0, 16.0])
    ends, made = np.array([0.2, 0.5, 0.3]), kernels(PERSON, 0.3)
    x, y = np.meshgrid([0.0, 5.0, 10.0], [-2.0, 1.5])
    sites = np.column_stack([x.ravel(), y.ravel()])
    if kind == "gaps":
        sites = np.delete(sites, 4, axis=0)
    if kind == "scattered":
        sites = sites + np.random.default_rng(1).normal(0.0, 2.0, sites.shape)
    window, box = crown_covariances(sites, heights, ends, altitude, PERSON, made)
    near = 1.0 - ends @ heights / altitude
    pair = near**2 * (PERSON.width_m**2 + PERSON.length_m**2) / 12.0
    nodes, weights = np.polynomial.legendre.leggauss(40)
    side, weights = 0.5 * near * PERSON.box_m * nodes, 0.5 * weights
    places = (sites[:, None] * (heights / altitude)[:, None]).reshape(-1, 2)
    share = np.tile(ends, len(sites)) / len(sites)
    apart = places[:, None] - places
    shares = np.outer(share, share)

    def mean(variance, offsets, weights):
        """The mean of the correlation over the offsets.  The correlation is a Gaussian that is
        widened by a given variance.
        """
        wide = CROWN_LENGTH_M**2 + variance
        field = np.exp(-0.5 * (apart[..., None] + offsets) ** 2 / wide) @ weights
        return CROWN_LENGTH_M**2 / wide * float((shares * field.prod(axis=2)).sum())

    one = np.zeros(1), np.ones(1)
    moved = pair + 0.5 * (near * made.step_m) ** 2
    two = np.subtract.outer(side, side).ravel(), np.outer(weights, weights).ravel()
    wanted = [mean(spread, *one) for spread in (pair, moved, moved, pair)]
    assert window == pytest.approx(wanted, rel=1e-5)
    wanted = [mean(0.5 * pair, side, weights), mean(0.0, *two)]
    assert box == pytest.approx(wanted, rel=1e-5)


def test_detection_is_certain_if_points_are_nearly_always_seen():
    thin = (Layer(9.9, 10.1, 1e-6, 0.2),)
    found = detection(thin, 9, 2.0)
    assert found.probability == pytest.approx(1.0, abs=1e-3)
    assert found.unseen == pytest.approx(0.0, abs=1e-3)


# --- Distributions ------------------------------------------------------------------------------


@pytest.mark.parametrize(("mean", "variance", "atom"), [(0.1, 0.006, 0.11), (0.6, 0.05, 0.0)])
def test_a_distribution_keeps_its_moments(mean, variance, atom):
    seen = SeenShare.of_moments(mean, variance, atom, 1000.0)
    assert seen.weights.sum() == pytest.approx(1.0, abs=1e-9)
    assert seen.weights @ seen.nodes == pytest.approx(mean, rel=1e-6)
    assert seen.weights @ seen.nodes**2 - mean**2 == pytest.approx(variance, rel=1e-3)
    assert seen.at_least(1e-12) == pytest.approx(1.0 - atom, abs=1e-3)
    for part in (0.3, 0.5, 0.95):
        assert 1.0 - seen.at_least(seen.quantile(part)) == pytest.approx(part, abs=1e-6)


def test_a_counted_distribution_has_the_counted_shares():
    shares = np.random.default_rng(5).beta(0.5, 2.0, 100_000)
    seen = SeenShare.counted(shares)
    assert seen.mean == pytest.approx(shares.mean())
    assert seen.weights @ seen.nodes == pytest.approx(shares.mean(), rel=1e-9)
    for share in (0.01, 0.1, 0.5):
        assert seen.at_least(share) == pytest.approx((shares >= share).mean(), abs=1 / 160)


def test_the_number_of_independent_windows_increases_with_the_level():
    few, many = (independent_windows(level, 3.0) for level in (3.0, 5.0))
    # χ(u)/Φ̄(u) increases nearly as u³.
    assert many / few == pytest.approx((5.0 / 3.0) ** 3, rel=0.15)
    assert independent_windows(4.0, 6.0) == pytest.approx(2.0 * independent_windows(4.0, 3.0))


@pytest.mark.parametrize("number", [0.3, 3.0, 500.0])
def test_an_exponential_tail_is_followed_beyond_the_highest_peaks(number):
    """If the heights of 20,000 peaks above 2 are exponentially distributed with the scale 0.1, n
    peaks are expected to exceed 2 + 0.1 ln(20,000/n).
    """
    rng = np.random.default_rng(6)
    drawn = [
        tail_level(np.sort(2.0 + 0.1 * rng.exponential(size=20_000))[::-1], number)
        for _ in range(60)
    ]
    expected = 2.0 + 0.1 * math.log(20_000 / number)
    # The mean height of the n-th peak is about 0.1/(2 n) above this level, which is 0.002 for 30
    # peaks.
    assert abs(np.mean(drawn) - expected) < 4.0 * np.std(drawn) / math.sqrt(60) + 0.002


# --- Voxels -------------------------------------------------------------------------------------


@pytest.mark.parametrize("slice_m", [None, 0.8])
def test_seen_shares_counted_in_voxels_equal_the_measured_model(slice_m):
    """The visible shares that are counted for detection agree with the measured model, for cubes
    and for plates in thicker slices.
    """
    volume = clumped_forest(generator(3), 0.7, 0.4, 2.0, 8.0, (24.0, 24.0))
    volume = replace(volume, slice_m=slice_m)
    sites = 1.5 * np.array(list(Pattern(3, 3).offsets()))
    found = count_detection(volume, sites, 40.0, PERSON, Signature(8.0, 0.0, 0.0), false_alarms=1.0)
    seen = MeasuredModel(volume, 40.0).predict_positions(sites)
    assert found.seen.mean == pytest.approx(seen.transparency, abs=0.01)
    # The visible share varies less among windows than among points. The variance of s is therefore
    # bounded by V = 1 - E[X²].
    points = 1.0 - seen.expected - seen.density**2
    assert 0.3 * points < found.seen.variance < points
    assert 0.0 < found.probability < 1.0
    assert 0.0 < found.standard_error < 0.2


def rimmed(side=60, rim=12):
    """A stand whose canopy is dense in the middle and missing at the rim of the plot."""
    occupied = np.zeros((20, side, side), dtype=bool)
    rng = np.random.default_rng(5)
    occupied[12:, rim:-rim, rim:-rim] = rng.random((8, side - 2 * rim, side - 2 * rim)) < 0.15
    return VoxelVolume(occupied, 0.4, slice_m=0.4)


@pytest.mark.slow
def test_only_places_whose_rays_stay_on_the_plot_are_counted():
    """Detection is counted at the same places as in the measured model."""
    volume, look = rimmed(), Signature(1.5, 0.0, 0.0)
    sites = 4.0 * np.array(list(Pattern(3, 3).offsets()))
    common = (volume, sites, 40.0, PERSON, look)
    for edges in ("auto", "interior", "wrapped"):
        found = count_detection(*common, false_alarms=100.0, edges=edges)
        seen = MeasuredModel(volume, 40.0, edges=edges).predict_positions(sites)
        assert found.seen.mean == pytest.approx(seen.transparency, abs=0.01)
    inside = count_detection(*common, false_alarms=100.0, edges="auto")
    assert inside.probability < found.probability - 0.01
    # If the interior is too small, all places are counted, with a larger standard error.
    sites = sites * 8.5
    common = (volume, sites, 40.0, PERSON, look)
    whole, inside, auto = (
        count_detection(*common, false_alarms=100.0, edges=edges)
        for edges in ("wrapped", "interior", "auto")
    )
    assert auto.probability == whole.probability
    doubt = abs(whole.probability - inside.probability) / math.sqrt(12.0)
    assert auto.standard_error == pytest.approx(math.hypot(whole.standard_error, doubt))
    with pytest.raises(RequestError, match="--edges interior"):
        count_detection(volume, sites * 2.0, 40.0, PERSON, look, false_alarms=1.0, edges="interior")


def test_the_interior_of_a_map_is_that_of_the_plot():
    """The interior has the correct place in maps of any cell size, and is cut at the correct sides."""
    volume = VoxelVolume(np.ones((10, 30, 40), dtype=bool), 0.5)
    inside, _ = counted_part(volume, 20.0, np.array([[0.0, 0.0], [8.0, 4.0]]), "auto")
    # Rays to the east lean by 8 x 5/20 = 2 m at the canopy top, those to the north by 1 m.
    assert inside == PlotInterior(0, 0, 28, 36)
    fine = np.arange(60 * 80.0).reshape(60, 80)
    assert (inside.of(fine, volume) == fine[:56, :72]).all()


def test_in_an_empty_stand_every_target_is_found():
    volume = VoxelVolume(np.zeros((4, 60, 60), dtype=bool), 0.4)
    found = count_detection(
        volume, np.zeros((1, 2)), 40.0, PERSON, Signature(3.0, 0.0, 0.0), false_alarms=1.0
    )
    assert found.seen.mean == pytest.approx(1.0)
    assert found.probability > 0.999


@pytest.mark.slow
@pytest.mark.skipif(not SHARED.exists(), reason="the real clouds are not here")
@pytest.mark.parametrize(
    ("samples", "baseline", "shares", "errors", "mean", "deviation"),
    [
        (25, 2.0, (0.537, 0.330, 0.128), (0.026, 0.017, 0.038), 0.213, 0.245),
        (49, 3.5, (0.621, 0.243, 0.051), (0.030, 0.050, 0.021), 0.175, 0.149),
    ],
)
def test_seen_share_below_a_real_stand(samples, baseline, shares, errors, mean, deviation):
    """Section 4.8: the cloud UAS_Clip with voxels of 0.25 m above a height of 0.5 m, in telecentric
    views from 50 m over the periodic plot.
    """
    volume = read_voxels(
        (str(SHARED / "data" / "UAS_Clip.laz"),), voxel_m=0.25, ground="auto", min_height_m=0.5
    )
    sites = np.column_stack(local_sites(pattern_for("trimmed", samples), baseline, 0.0))
    found = count_detection(
        volume, sites, 50.0, PERSON, Signature(5.0, 0.0, 0.0), false_alarms=1.0
    ).seen
    assert found.mean == pytest.approx(mean, abs=0.002)
    assert math.sqrt(found.variance) == pytest.approx(deviation, abs=0.002)
    for at, share, error in zip((0.1, 0.25, 0.5), shares, errors, strict=True):
        assert abs(found.at_least(at) - share) < error
