"""The correlogram compared with the exact predictions that it approximates."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.forests import STANDS, clumped_forest
from support.paths import CLOUDS

from aosplan.grid.patterns import Pattern, local_sites, pattern_for
from aosplan.models.correlogram import CorrelogramModel
from aosplan.models.measured import MeasuredModel
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.voxels import VoxelVolume

DATA = CLOUDS
BASELINES_M = (0.5, 1.0, 2.0, 3.5, 5.0)
SAMPLES = (4, 13, 25, 49, 100)


@pytest.fixture(scope="module")
def forest():
    return clumped_forest(STANDS["spruce"], side_m=16.0, voxel_m=0.5)


@pytest.fixture(scope="module")
def table(forest):
    return correlogram(forest)


# --- Accuracy --------------------------------------------------------------------------------


def assert_stands_in(volume):
    """Check that V̂ is within 0.015 and V within 0.006 of the exact values, at 50 m and for two
    headings.
    """
    table = correlogram(volume)
    for heading in (0.0, 25.0):
        exact = MeasuredModel(volume, 50.0, heading_deg=heading)
        quick = CorrelogramModel(table, 50.0, heading_deg=heading)
        for baseline in BASELINES_M:
            for samples in SAMPLES:
                pattern = pattern_for("trimmed", samples)
                want, got = exact.predict(pattern, baseline), quick.predict(pattern, baseline)
                case = heading, baseline, samples
                assert got.normalized == pytest.approx(want.normalized, abs=0.015), case
                assert got.expected == pytest.approx(want.expected, abs=0.006), case
                assert got.density == pytest.approx(want.density, abs=0.005), case


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name == "open_pine" else [pytest.mark.slow])
        for name in STANDS
    ],
)
def test_the_correlogram_approximates_predictions_for_generated_forests(name):
    assert_stands_in(clumped_forest(STANDS[name]))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "voxel_m"), [("UAS_Clip", 0.25), ("pine_plot", 0.1)])
def test_the_correlogram_approximates_predictions_for_real_stands(name, voxel_m):
    pytest.importorskip("laspy")
    pytest.importorskip("CSF")
    path = DATA / f"{name}.laz"
    if not path.is_file():
        pytest.skip("the real point clouds are not at hand")
    from aosplan.scenes.files.point_cloud import read_voxels

    assert_stands_in(read_voxels(str(path), voxel_m=voxel_m, min_height_m=0.5))


# --- Content of the tables -------------------------------------------------------------------


def test_correlogram_tables_have_the_documented_lags_and_directions(table):
    assert table.lags.shape == (15,)
    assert table.lags[0] == pytest.approx(0.01, rel=1e-12)
    assert table.lags[2::2] == pytest.approx(2.0 * table.lags[:-2:2], rel=1e-12)
    assert table.directions_deg.tolist() == [22.5 * i for i in range(8)]
    assert table.rho.shape == table.density_by_offset.shape == (8, 15)
    assert (np.abs(table.rho) <= 1.0).all()
    assert ((table.density_by_offset > 0.0) & (table.density_by_offset <= 1.0)).all()


@pytest.mark.parametrize(("direction", "lag"), [(0, 3), (3, 8), (6, 0)])
def test_an_entry_is_the_mean_over_pairs_about_the_middle(forest, table, direction, lag):
    altitude = 40.0
    model = MeasuredModel(forest, altitude)
    angle = np.radians(table.directions_deg[direction])
    apart = altitude * table.lags[lag] * np.array([np.sin(angle), np.cos(angle)])
    across = 0.5 * np.array([apart[1], -apart[0]])
    middles = [(0.0 * apart, 2), (across, 2), (-across, 2), (0.5 * apart, 1), (-0.5 * apart, 1)]
    total = 0.0
    for middle, weight in middles:
        # The positions are computed exactly as in the table, because even a difference of 1e-9 m
        # may change the rounding to whole targets.
        pair = [middle - 0.5 * apart, middle + 0.5 * apart]
        (p, both), (_, q) = model.joint_density(pair)
        total += weight * (both - p * q) / math.sqrt(p * (1 - p) * q * (1 - q))
    assert table.rho[direction, lag] == pytest.approx(total / 8.0, abs=1e-3)


def test_densities_are_means_of_opposite_views(forest, table):
    model = MeasuredModel(forest, 40.0)
    assert table.density == model.density
    offset = 40.0 * table.lags[7]
    to_north, to_south = (
        model.predict_positions([(0.0, sign * offset)]).density for sign in (1, -1)
    )
    assert to_north != to_south
    assert table.density_by_offset[0, 7] == pytest.approx(0.5 * (to_north + to_south), rel=1e-12)


def test_lookups_equal_the_tables_at_their_knots(table):
    lags, directions = np.meshgrid(table.lags, table.directions_deg)
    for turn in (0.0, 180.0, -360.0):
        places = lags.ravel(), directions.ravel() + turn
        assert table.correlation_at(*places) == pytest.approx(table.rho.ravel(), abs=1e-9)
        densities = table.density_by_offset.ravel()
        assert table.density_at(*places) == pytest.approx(densities, abs=1e-9)
    nowhere, anywhere = np.zeros(3), np.array([0.0, 50.0, 170.0])
    assert table.correlation_at(nowhere, anywhere) == pytest.approx([1.0] * 3, abs=1e-12)
    assert table.density_at(nowhere, anywhere) == pytest.approx([table.density] * 3, abs=1e-12)
    far = table.correlation_at(np.array([9.0]), np.array([45.0]))
    assert far == pytest.approx(table.rho[2, -1:], abs=1e-12)


@given(lag=st.floats(0.0, 2.0), direction=st.floats(-720.0, 720.0))
def test_lookups_stay_within_the_tables(table, lag, direction):
    found = table.correlation_at(np.array([lag]), np.array([direction]))[0]
    assert table.rho.min() - 1e-12 <= found <= 1.0 + 1e-12
    opposite = table.correlation_at(np.array([lag]), np.array([direction + 180.0]))[0]
    assert opposite == pytest.approx(found, abs=1e-9)


def test_the_document_is_plain(table):
    document = table.to_document()
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert set(document) == {"lags", "directions_deg", "rho", "reach"}
    assert len(document["rho"]) == 8
    assert document["rho"][2][5] == table.rho[2, 5]


@pytest.mark.parametrize("fill", [None, False, True])
def test_correlograms_of_full_and_empty_stands_are_valid(fill):
    shape = (0 if fill is None else 4, 5, 6)
    table = correlogram(VoxelVolume(np.full(shape, bool(fill)), 1.0))
    json.dumps(table.to_document(), allow_nan=False)
    prediction = CorrelogramModel(table, 50.0).predict(Pattern(2, 3), 2.0)
    assert prediction.density == float(bool(fill))
    assert prediction.expected == 1.0 - float(bool(fill))


# --- Predictions -----------------------------------------------------------------------------


@given(
    rows=st.integers(1, 5),
    columns=st.integers(1, 6),
    row_pitch=st.sampled_from([1.0, 4.0]),
    removed=st.sets(st.tuples(st.integers(0, 4), st.integers(0, 5)), max_size=4),
    baseline=st.floats(0.0, 6.0),
    heading=st.floats(-400.0, 400.0),
)
def test_a_pattern_is_the_mean_over_all_its_pairs(
    table, rows, columns, row_pitch, removed, baseline, heading
):
    inside = sorted((row, column) for row, column in removed if row < rows and column < columns)
    pattern = Pattern(rows, columns, row_pitch, tuple(inside[: rows * columns - 1]))
    by_lattice = CorrelogramModel(table, 50.0, heading_deg=heading).predict(pattern, baseline)
    sites = np.column_stack(local_sites(pattern, baseline, heading))
    by_pairs = CorrelogramModel(table, 50.0).predict_positions(sites)
    assert by_lattice == pytest.approx(by_pairs, rel=1e-9)


def test_the_result_depends_only_on_slopes(table):
    near, far = CorrelogramModel(table, 40.0), CorrelogramModel(table, 80.0)
    pattern = pattern_for("trimmed", 20)
    assert far.predict(pattern, 3.0) == pytest.approx(near.predict(pattern, 1.5), rel=1e-12)


def test_the_correlogram_has_the_properties_that_the_solver_needs(forest, table):
    quick, exact = CorrelogramModel(table, 50.0), MeasuredModel(forest, 50.0)
    assert (quick.density, quick.transparency) == (exact.density, exact.transparency)
    assert quick.widest_aperture_m == pytest.approx(exact.widest_aperture_m, rel=1e-12)
    assert quick.independent_baseline_m == quick.widest_aperture_m
    assert quick.rule_baseline_m is None
    assert not quick.rises_with_baseline
    assert quick.name == "correlogram"
    single = quick.predict(Pattern(1, 1), 2.0)
    assert single == pytest.approx((exact.density, exact.transparency, 1.0), rel=1e-12)


def test_a_raised_focal_plane_cuts_the_stand(forest):
    cut = VoxelVolume(forest.occupied[6:], 0.5)
    assert (correlogram(forest, focal_height_m=3.0).rho == correlogram(cut).rho).all()
