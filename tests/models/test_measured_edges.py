"""The prediction for targets whose rays stay on a plot does not depend on the surroundings of the
plot.
"""

from dataclasses import replace

import numpy as np
import pytest
from support.forests import STANDS, clumped_forest

from aosplan.errors import RequestError
from aosplan.grid.patterns import pattern_for
from aosplan.models.interior_surrogate import SHARES, InteriorSurrogate
from aosplan.models.measured import MeasuredModel
from aosplan.scenes.correlogram import INTERIOR, correlogram
from aosplan.scenes.occluder_statistics import thin_rim

ALTITUDE_M = 50.0


@pytest.fixture(scope="module")
def stand():
    return clumped_forest(STANDS["spruce"], side_m=36.0, voxel_m=0.5)


@pytest.fixture(scope="module")
def plot(stand):
    return replace(stand, occupied=stand.occupied[:, 20:56, 16:52])


@pytest.mark.parametrize("view", ["telecentric", "perspective"])
def test_interior_targets_do_not_depend_on_the_surroundings_of_the_plot(stand, plot, view):
    pattern, baseline = pattern_for("trimmed", 9), 6.0
    inside = MeasuredModel(plot, ALTITUDE_M, edges="interior", view=view)
    sites = inside.sites_m(pattern, baseline) + np.array([1.7, -0.9])
    window = inside.interior(sites)
    if view == "perspective":
        assert window is None  # All cameras are above the plot, so all rays stay on it.
        return
    k = inside.occlusion.targets_per_voxel
    whole = MeasuredModel(stand, ALTITUDE_M)
    hidden = whole.occlusion.unpack(whole.occlusion.masks(sites)).mean(axis=0)
    rows = slice(20 * k + window.row, 20 * k + window.row + window.rows)
    columns = slice(16 * k + window.column, 16 * k + window.column + window.columns)
    share = hidden[rows, columns]
    found = inside.predict_positions(sites)
    assert found.density == pytest.approx(share.mean(), rel=1e-12)
    assert found.expected == pytest.approx(1.0 - (share**2).mean(), rel=1e-12)
    # The periodic plot gives another result, because its copies differ from the true surroundings.
    wrapped = MeasuredModel(plot, ALTITUDE_M).predict_positions(sites)
    assert abs(wrapped.expected - found.expected) > 1e-4


def test_the_interior_window_has_the_largest_possible_size(plot):
    model = MeasuredModel(plot, ALTITUDE_M, edges="interior")
    window = model.interior([(-6.0, 0.0), (9.0, 3.0)])
    rise = plot.canopy_top_m / ALTITUDE_M
    pitch = plot.voxel_m / model.occlusion.targets_per_voxel
    width, depth = plot.size_m
    for first, count, low, high, size in (
        (window.column, window.columns, 6.0, 9.0, width),
        (window.row, window.rows, 0.0, 3.0, depth),
    ):
        assert first * pitch >= low * rise > first * pitch - plot.voxel_m or low == first == 0
        left = size - (first + count) * pitch
        assert left + 1e-9 >= high * rise > left - plot.voxel_m


def test_with_too_few_interior_targets_auto_uses_all_and_interior_is_refused(plot):
    pattern = pattern_for("trimmed", 9)
    auto = MeasuredModel(plot, ALTITUDE_M, edges="auto")
    assert auto.edges_of(pattern, 2.0) == "interior"
    assert auto.edges_of(pattern, 30.0) == "wrapped"
    assert auto.predict(pattern, 30.0) == MeasuredModel(plot, ALTITUDE_M).predict(pattern, 30.0)
    with pytest.raises(RequestError, match="--edges interior"):
        MeasuredModel(plot, ALTITUDE_M, edges="interior").predict(pattern, 60.0)
    assert auto.interior_prediction(pattern, 60.0) is None


def test_a_clipped_rim_does_not_change_interior_predictions(plot):
    clipped = plot.occupied.copy()
    for side in (np.s_[:, :4], np.s_[:, -4:], np.s_[:, :, :4], np.s_[:, :, -4:]):
        clipped[side] = False
    pattern = pattern_for("trimmed", 4)
    models = [
        MeasuredModel(replace(plot, occupied=each), ALTITUDE_M, edges=edges)
        for edges in ("interior", "wrapped")
        for each in (plot.occupied, clipped)
    ]
    full, thin, wrapped, thin_wrapped = (model.predict(pattern, 3.0).density for model in models)
    assert wrapped - thin_wrapped > 2 * (full - thin) > 0


def clipped(stand, cells):
    """A stand without the voxels that are close to its edges.  It resembles a cloud from which
    trees at the edge were removed.
    """
    occupied = np.zeros_like(stand.occupied)
    inside = np.s_[:, cells:-cells, cells:-cells]
    occupied[inside] = stand.occupied[inside]
    return replace(stand, occupied=occupied)


def test_interior_correlograms_do_not_depend_on_the_rim(stand):
    whole, thin = correlogram(stand), correlogram(clipped(stand, 4))
    assert len(whole.interior) == len(INTERIOR)
    assert whole.density - thin.density > 0.03
    # At 45 degrees, both components stay within the aperture.
    near = whole.lags <= 0.5 * whole.reach
    one, other = whole.interior[-1], thin.interior[-1]
    assert one.density == other.density
    assert (one.density_by_offset[:, near] == other.density_by_offset[:, near]).all()
    assert (one.rho[:, near] == other.rho[:, near]).all()
    assert (whole.rho != thin.rho).any()


def test_an_interior_density_is_the_mean_over_its_targets(stand):
    """For the widest aperture, the targets in the central quarter of the plot are counted.  Their
    density in the nadir view is their share of hidden columns.
    """
    table = correlogram(stand)
    rows, columns = stand.hidden_columns.shape
    middle = stand.hidden_columns[rows // 4 : -(rows // 4), columns // 4 : -(columns // 4)]
    assert table.interior[-1].density == pytest.approx(middle.mean(), rel=1e-12)


def test_the_surrogate_is_near_the_interior_prediction(stand):
    thin = clipped(stand, 3)
    exact = MeasuredModel(thin, ALTITUDE_M, edges="auto")
    quick = InteriorSurrogate(correlogram(thin), ALTITUDE_M)
    wrapped = MeasuredModel(thin, ALTITUDE_M)
    nearer = 0
    for samples in (4, 9, 25):
        for share in (0.15, 0.4, 0.7, 0.95):
            pattern = pattern_for("trimmed", samples)
            baseline = share * exact.widest_aperture_m / pattern.longer_side
            assert exact.edges_of(pattern, baseline) == "interior"
            found, guess = exact.predict(pattern, baseline), quick.predict(pattern, baseline)
            assert guess.density == pytest.approx(found.density, abs=0.02)
            assert guess.shortfall == pytest.approx(found.shortfall, abs=0.05)
            off = abs(wrapped.predict(pattern, baseline).density - found.density)
            nearer += abs(guess.density - found.density) < off
    assert nearer >= 11
    single = quick.predict(pattern_for("trimmed", 1), 0.0)
    assert single.density == correlogram(thin).density


def test_between_the_tables_the_surrogate_is_continuous(stand):
    quick = InteriorSurrogate(correlogram(stand), ALTITUDE_M)
    pattern = pattern_for("square", 9)
    for share in SHARES[1:-1]:
        at = share * quick.widest_aperture_m / pattern.longer_side
        below, above = (quick.predict(pattern, at * (1.0 + step)) for step in (-1e-9, 1e-9))
        assert above == pytest.approx(below, abs=1e-6)


@pytest.mark.parametrize("heading", [0.0, 30.0, 45.0])
def test_searched_grids_are_narrow_enough_for_the_plot(stand, heading):
    model = MeasuredModel(stand, ALTITUDE_M, edges="auto", heading_deg=heading)
    pattern = pattern_for("square", 9)
    widest = model.widest_aperture_m / pattern.longer_side
    assert model.edges_of(pattern, widest) == "interior"


def test_a_thin_rim_is_reported():
    dense = STANDS["spruce"]._replace(trees=3 * STANDS["spruce"].trees)
    stand = clumped_forest(dense, side_m=36.0, voxel_m=0.5)
    assert thin_rim(stand) is None
    rim, middle = thin_rim(clipped(stand, 3))
    columns = clipped(stand, 3).hidden_columns
    assert middle == columns[4:-4, 4:-4].mean()
    ring = np.ones_like(columns)
    ring[4:-4, 4:-4] = False
    assert rim == pytest.approx(columns[ring].mean(), rel=1e-12)
    assert rim < middle - 0.1
    bare = replace(stand, occupied=np.zeros_like(stand.occupied))
    assert thin_rim(bare) is None
    assert thin_rim(replace(stand, occupied=stand.occupied[:, :6, :6])) is None
