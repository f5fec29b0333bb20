"""Targets whose rays stay on a plot: the surroundings of the plot do not affect their prediction."""

from dataclasses import replace

import numpy as np
import pytest
from support.forests import STANDS, clumped_forest

from aosplan.errors import RequestError
from aosplan.grid.patterns import pattern_for
from aosplan.models.measured import MeasuredModel

ALTITUDE_M = 50.0


@pytest.fixture(scope="module")
def stand():
    return clumped_forest(STANDS["spruce"], side_m=36.0, voxel_m=0.5)


@pytest.fixture(scope="module")
def plot(stand):
    return replace(stand, occupied=stand.occupied[:, 20:56, 16:52])


@pytest.mark.parametrize("view", ["telecentric", "perspective"])
def test_interior_targets_do_not_know_what_stands_around_the_plot(stand, plot, view):
    pattern, baseline = pattern_for("trimmed", 9), 6.0
    inside = MeasuredModel(plot, ALTITUDE_M, edges="interior", view=view)
    sites = inside.sites_m(pattern, baseline) + np.array([1.7, -0.9])
    window = inside.interior(sites)
    if view == "perspective":
        assert window is None  # all cameras are above the plot, so all rays stay on it
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


def test_the_window_is_as_large_as_it_may_be(plot):
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


def test_too_few_targets_are_all_of_them_or_none(plot):
    pattern = pattern_for("trimmed", 9)
    auto = MeasuredModel(plot, ALTITUDE_M, edges="auto")
    assert auto.edges_of(pattern, 2.0) == "interior"
    assert auto.edges_of(pattern, 30.0) == "wrapped"
    assert auto.predict(pattern, 30.0) == MeasuredModel(plot, ALTITUDE_M).predict(pattern, 30.0)
    with pytest.raises(RequestError, match="--edges interior"):
        MeasuredModel(plot, ALTITUDE_M, edges="interior").predict(pattern, 60.0)
    assert auto.interior_prediction(pattern, 60.0) is None


def test_a_clipped_rim_does_not_reach_the_interior(plot):
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
