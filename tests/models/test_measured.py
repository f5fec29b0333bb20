"""The measured model, compared with its definitions, with Eq. 2, with the layered model, and with
known values.
"""

import math

import numpy as np
import pytest
from support.forests import STANDS, clumped_forest
from support.paths import CLOUDS

from aosplan.errors import RequestError
from aosplan.grid.patterns import Pattern, local_sites, pattern_for
from aosplan.models import measured as measured_module
from aosplan.models.equations import visibility, visibility_shortfall
from aosplan.models.layered import LayeredModel
from aosplan.models.measured import MeasuredModel
from aosplan.scenes.scene import Layer
from aosplan.scenes.voxels import VoxelVolume

CLOUD = CLOUDS / "UAS_Clip.laz"


@pytest.fixture(scope="module")
def forest():
    return clumped_forest(STANDS["beech"], side_m=16.0, voxel_m=0.5)


def sites(pattern, baseline_m, heading_deg=0.0):
    return np.column_stack(local_sites(pattern, baseline_m, heading_deg))


# --- Definitions -----------------------------------------------------------------------------


@pytest.mark.parametrize("view", ["telecentric", "perspective"])
def test_a_prediction_is_the_mean_over_targets(forest, view):
    model = MeasuredModel(forest, 50.0, view=view)
    pattern = pattern_for("trimmed", 11)
    prediction = model.predict(pattern, 2.3)
    occlusion = model.occlusion
    views = occlusion.unpack(occlusion.masks(sites(pattern, 2.3))).reshape(11, -1)
    assert prediction.density == pytest.approx(views.mean(), rel=1e-14)
    assert prediction.transparency == pytest.approx(1.0 - views.mean(), rel=1e-14)
    square = (views.mean(axis=0) ** 2).mean()
    assert prediction.expected == pytest.approx(1.0 - square, rel=1e-13)
    spread = views.mean() * (1.0 - views.mean())
    assert prediction.shortfall == pytest.approx((square - views.mean() ** 2) / spread, rel=1e-12)


def test_subsets_follow_from_joint_densities(forest):
    model = MeasuredModel(forest, 50.0)
    lattice = sites(Pattern(5, 5), 1.5)
    joint = model.joint_density(lattice)
    assert (joint == joint.T).all()
    for chosen in ([7], [0, 4, 12, 20, 24], list(range(25))):
        prediction = model.predict_positions(lattice[chosen])
        part = joint[np.ix_(chosen, chosen)]
        assert prediction.density == pytest.approx(np.diag(part).mean(), rel=1e-13)
        assert prediction.expected == pytest.approx(1.0 - part.mean(), rel=1e-13)


@pytest.mark.parametrize("view", ["telecentric", "perspective"])
def test_one_view_has_the_visibility_of_one_view(forest, view):
    model = MeasuredModel(forest, 50.0, view=view)
    single = model.predict(Pattern(1, 1), 3.0)
    assert single.shortfall == pytest.approx(1.0, rel=1e-14)
    assert (single.density, single.transparency) == (model.density, model.transparency)
    if view == "telecentric":
        assert model.density == forest.column_occupancy
    elsewhere = model.predict_positions([(9.0, -4.0)])
    assert elsewhere.shortfall == pytest.approx(1.0, rel=1e-14)
    assert elsewhere.density > model.density


def test_views_from_one_place_equal_one_view(forest):
    model = MeasuredModel(forest, 50.0)
    same = model.predict(Pattern(4, 5), 0.0)
    assert same.shortfall == pytest.approx(1.0, rel=1e-14)
    assert same.density == model.density


@pytest.mark.parametrize(("fill", "density"), [(False, 0.0), (True, 1.0)])
def test_views_with_all_or_no_targets_hidden_are_treated_as_independent(fill, density):
    volume = VoxelVolume(np.full((4, 3, 5), fill), 1.0)
    prediction = MeasuredModel(volume, 20.0).predict(Pattern(2, 3), 1.0)
    assert prediction == (density, 1.0 - density, 1.0 / 6.0)
    assert prediction.expected == 1.0 - density


def test_the_heading_turns_the_pattern(forest):
    pattern = Pattern(2, 5, row_pitch=2.0, removed=((0, 1),))
    turned = MeasuredModel(forest, 50.0, heading_deg=37.0)
    assert turned.predict(pattern, 1.7) == MeasuredModel(forest, 50.0).predict_positions(
        sites(pattern, 1.7, 37.0)
    )
    assert turned.predict(pattern, 1.7) != MeasuredModel(forest, 50.0).predict(pattern, 1.7)
    # North is the direction in which the number of rows increases. If walls run north, views from a
    # line to the north are similar.
    walls = np.zeros((10, 20, 20), dtype=bool)
    walls[:, :, ::5] = True
    along, across = (
        MeasuredModel(VoxelVolume(walls, 1.0), 50.0, heading_deg=heading).predict(Pattern(1, 5), 8)
        for heading in (0.0, 90.0)
    )
    assert along.shortfall == pytest.approx(1.0, rel=1e-12)
    assert across.shortfall < 0.7


def test_the_focal_plane_may_be_raised(forest):
    cut = VoxelVolume(forest.occupied[6:], 0.5)
    pattern = pattern_for("trimmed", 9)
    raised = MeasuredModel(forest, 40.0, focal_height_m=3.0)
    assert raised.predict(pattern, 2.0) == MeasuredModel(cut, 40.0).predict(pattern, 2.0)


# --- Memory ----------------------------------------------------------------------------------


def test_caching_views_does_not_change_results(forest, monkeypatch):
    patterns = [(pattern_for("trimmed", count), 1.5) for count in (4, 9, 16, 9, 25)]
    fresh = [MeasuredModel(forest, 50.0).predict(*plan) for plan in patterns]
    kept = MeasuredModel(forest, 50.0)
    assert [kept.predict(*plan) for plan in patterns] == fresh
    monkeypatch.setattr(measured_module, "CACHE_OCTETS", 5 * 8 * kept.occlusion.words)
    small = MeasuredModel(forest, 50.0)
    assert [small.predict(*plan) for plan in patterns] == fresh
    assert len(small._masks) == 5


def test_kept_views_are_not_computed_again(forest, monkeypatch):
    model = MeasuredModel(forest, 50.0)
    computed = []
    masks = model.occlusion.masks
    monkeypatch.setattr(model.occlusion, "masks", lambda new: computed.extend(new) or masks(new))
    model.predict(Pattern(3, 3), 2.0)
    model.predict(Pattern(5, 5), 2.0)
    model.predict_positions([(0.0, 0.0), (-0.0, 2.0), (0.5, 0.5), (0.5, 0.5)])
    assert len(computed) == 25 + 1


# --- Properties that the solver uses ---------------------------------------------------------


def test_the_width_of_the_plot_limits_the_aperture(forest):
    model = MeasuredModel(forest, 50.0)
    # Rays from both ends are half a plot apart at the top.
    apart = model.widest_aperture_m * forest.canopy_top_m / 50.0
    assert apart == pytest.approx(0.5 * 16.0, rel=1e-12)
    assert model.independent_baseline_m == model.widest_aperture_m
    assert model.rule_baseline_m is None
    assert not model.rises_with_baseline
    assert model.name == "measured"
    bare = MeasuredModel(VoxelVolume(np.zeros((0, 3, 4), dtype=bool), 1.0), 50.0)
    assert bare.widest_aperture_m == math.inf
    assert (bare.density, bare.transparency) == (0.0, 1.0)


def test_visibility_has_a_maximum_at_a_finite_baseline():
    model = MeasuredModel(clumped_forest(STANDS["spruce"]), 50.0, targets_per_voxel=2)
    found = [model.predict(Pattern(7, 7), baseline) for baseline in (0.5, 2.5, 5.0, 8.0)]
    values = [prediction.expected for prediction in found]
    assert values[0] < values[1] > values[2] > values[3]
    assert found[3].normalized > found[1].normalized
    assert found[3].density > found[1].density


def test_an_altitude_below_the_canopy_is_refused(forest):
    with pytest.raises(RequestError, match="is not above the canopy"):
        MeasuredModel(forest, forest.canopy_top_m)


# --- Against the other models ----------------------------------------------------------------
#
# If views shift by whole targets, and a slice is thin compared with its height, each ray meets one cell of the slice. The expected values for single slices and for independent slices are then exactly those of Eq. 2 and of the layered model.


def assert_expected(values, expected):
    """Check that a mean is within four standard errors of its expected value, and that the standard
    errors are small.
    """
    error = np.std(values, ddof=1) / math.sqrt(len(values))
    assert 0.0 < error < 0.002
    assert abs(np.mean(values) - expected) < 4.0 * error


@pytest.mark.parametrize(("rows", "columns"), [(1, 5), (3, 3), (3, 5)])
@pytest.mark.parametrize("dhat", [0.25, 0.75, 1.25])
def test_one_slice_agrees_with_eq_2(rows, columns, dhat):
    rng = np.random.default_rng(8)
    density, level, cells = 0.4, 199, 60 * 50
    found = []
    for _ in range(30):
        occupied = np.zeros((level + 1, 60, 50), dtype=bool)
        occupied[level] = rng.random((60, 50)) < density
        model = MeasuredModel(VoxelVolume(occupied, 1.0), 1000.0)
        baseline = dhat * 1000.0 / (level + 0.5)
        found.append(model.predict(Pattern(rows, columns), baseline))
    expected = visibility(density, rows, columns, dhat)
    assert_expected([prediction.expected for prediction in found], expected)
    # K is relative to p of the plot itself, and this p varies between plots. Its variation is a
    # share 1/cells of the variance.
    shortfall = (visibility_shortfall(rows, columns, dhat) - 1.0 / cells) / (1.0 - 1.0 / cells)
    assert_expected([prediction.shortfall for prediction in found], shortfall)


@pytest.mark.parametrize("targets_per_voxel", [2, 4])
def test_independent_slices_are_the_layered_model(targets_per_voxel):
    rng = np.random.default_rng(9)
    slices = {12: 0.2, 37: 0.35, 62: 0.1}
    altitude = 1000.0
    # The rays of neighbouring views are one, three and five targets apart.
    baseline = altitude / (targets_per_voxel * 12.5)
    pattern = Pattern(5, 3)
    layers = [Layer(level, level + 1.0, density, 1.0) for level, density in slices.items()]
    expected = LayeredModel(layers, altitude).predict(pattern, baseline).expected
    values = []
    for _ in range(40):
        occupied = np.zeros((63, 50, 60), dtype=bool)
        for level, density in slices.items():
            occupied[level] = rng.random((50, 60)) < density
        model = MeasuredModel(
            VoxelVolume(occupied, 1.0), altitude, targets_per_voxel=targets_per_voxel
        )
        values.append(model.predict(pattern, baseline).expected)
    assert_expected(values, expected)


# --- Known values ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def conifers():
    """A point cloud of a mixed conifer stand from a drone, 27 m x 26 m."""
    pytest.importorskip("laspy")
    if not CLOUD.is_file():
        pytest.skip("the real point clouds are not at hand")
    from aosplan.scenes import voxels
    from aosplan.scenes.files import point_cloud

    # The other programs also counted the last cells, which are only partly filled.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(voxels, "without_ragged_cells", lambda occupied, *_: occupied)
        return point_cloud.read_voxels(str(CLOUD), voxel_m=0.25, min_height_m=0.5)


def test_the_measured_density_of_conifers_has_the_known_value(conifers):
    assert MeasuredModel(conifers, 50.0).density == pytest.approx(0.769, abs=0.0005)


@pytest.mark.parametrize(
    ("view", "baseline", "density", "v", "vhat"),
    [
        ("telecentric", 2.0, 0.797, 0.3105, 0.668),
        ("telecentric", 3.5, 0.826, 0.2923, 0.820),
        ("perspective", 2.0, 0.905, 0.169, 0.877),
        ("perspective", 3.5, 0.897, 0.185, 0.910),
    ],
)
def test_measured_predictions_for_conifers_have_known_values(
    conifers, view, baseline, density, v, vhat
):
    # These values were computed from the same cloud by other programs, with other interpolations of
    # the ground.
    found = MeasuredModel(conifers, 50.0, view=view).predict(Pattern(7, 7), baseline)
    assert found.density == pytest.approx(density, abs=0.002)
    assert found.expected == pytest.approx(v, abs=0.001)
    assert found.normalized == pytest.approx(vhat, abs=0.001)
