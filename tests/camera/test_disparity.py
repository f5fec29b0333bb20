"""Disparities and the baseline of the coverage rule, compared with explicit sets of occluders."""

import math
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aosplan.camera.disparity import (
    Slab,
    baseline_curve,
    baseline_for_disparity_px,
    coverage_baseline,
    coverage_share,
    disparity_px,
    occluder_px,
)
from aosplan.errors import InfeasibleError
from aosplan.scenes.density import integrated_density
from aosplan.scenes.presets import SCENES

near = partial(pytest.approx, abs=0.0)
"""Approximate equality by relative error only.  The default of `approx` also accepts an absolute
error of 1e-12.
"""

SHARP = 1e9
"""A focal length [px] at which no occluder is smaller than a pixel."""

altitudes = st.floats(25.0, 200.0)
heights = st.floats(0.1, 20.0)
sizes = st.floats(0.01, 2.0)
coverages = st.one_of(st.floats(0.01, 0.999), st.just(0.98))


@st.composite
def stacks(draw, most=5):
    """Slabs above each other with gaps, all below 25 m."""
    slabs, bottom = [], 0.0
    for _ in range(draw(st.integers(1, most))):
        bottom += draw(st.floats(0.05, 2.0))
        top = bottom + draw(st.floats(0.1, 2.5))
        slabs.append(Slab(bottom, top, draw(sizes), draw(st.floats(0.05, 5.0))))
        bottom = top
    return tuple(slabs)


def needed_baseline(slab, height, altitude, focal_length):
    """Baseline at which an occluder has d̂ = 1.  It is o h/H, where o is at least the size of a
    pixel at the occluder.
    """
    size = np.maximum(slab.occluder_size_m, (altitude - height) / focal_length)
    return size * altitude / height


def occluders(slabs, altitude, focal_length, count):
    """The baseline that each of many evenly distributed occluders needs, and its share of all
    occluders.
    """
    spread = (np.arange(count) + 0.5) / count
    needed = [
        needed_baseline(
            slab, slab.bottom_m + spread * (slab.top_m - slab.bottom_m), altitude, focal_length
        )
        for slab in slabs
    ]
    weights = np.repeat([slab.weight for slab in slabs], count)
    return np.concatenate(needed), weights / weights.sum()


# --- Closed forms --------------------------------------------------------------------------


@given(size=sizes, height=heights, altitude=altitudes, baseline=st.floats(0.01, 50.0))
def test_normalised_disparity_is_b_times_height_over_altitude_times_size(
    size, height, altitude, baseline
):
    dhat = disparity_px(baseline, height, altitude, SHARP) / occluder_px(
        size, height, altitude, SHARP
    )
    assert dhat == near(baseline * height / (altitude * size), rel=1e-13)


@given(height=heights, altitude=altitudes, baseline=st.floats(0.01, 50.0))
def test_disparity_is_the_difference_of_two_projections(height, altitude, baseline):
    found = disparity_px(baseline, height, altitude, 3000.0)
    printed = 3000.0 * baseline * (1.0 / (altitude - height) - 1.0 / altitude)
    assert found == near(printed, rel=1e-9)
    assert baseline_for_disparity_px(found, height, altitude, 3000.0) == near(baseline, rel=1e-13)


def test_a_point_on_the_focal_plane_does_not_move():
    assert disparity_px(3.0, 0.0, 50.0, 3000.0) == 0.0


def test_an_occluder_is_at_least_one_pixel_large():
    assert occluder_px(0.2, 10.0, 50.0, 2000.0) == near(10.0, rel=1e-15)
    assert occluder_px(0.02, 10.0, 50.0, 2000.0) == near(1.0, rel=1e-15)
    assert occluder_px(0.0002, 10.0, 50.0, 2000.0) == 1.0


# --- The coverage rule ---------------------------------------------------------------------


@given(
    bottom=heights,
    thickness=st.floats(0.1, 20.0),
    size=sizes,
    above=st.floats(1.0, 100.0),
    share=coverages,
)
def test_the_baseline_of_one_slab_follows_from_the_height_above_which_the_share_lies(
    bottom, thickness, size, above, share
):
    altitude = bottom + thickness + above
    slab = Slab(bottom, bottom + thickness, size, 1.0)
    found = coverage_baseline((slab,), altitude, SHARP, share)
    height = bottom + (1.0 - share) * thickness
    assert found.baseline_m == near(size * altitude / height, rel=1e-12)
    assert found.height_m == near(height, rel=1e-12)
    assert found.occluder_size_m == size


@pytest.mark.parametrize(("altitude", "baseline"), [(50.0, 3.5), (40.0, 2.8), (100.0, 7.0)])
def test_the_papers_forest_has_the_papers_baselines(altitude, baseline):
    """The baseline for 98 % of the occluders is 3.5 m at an altitude of 50 m, and 2.8 m at 40 m."""
    preset = SCENES["paper-forest"]
    base, height = preset.volume_base_m, preset.volume_height_m
    slab = Slab(base, base + height, preset.occluder_size_m, 1.0)
    found = coverage_baseline((slab,), altitude, 3000.0, 0.98)
    assert found.baseline_m == near(baseline, rel=1e-13)
    assert coverage_share((slab,), altitude, 3000.0, baseline) == near(0.98, rel=1e-12)


def test_the_papers_forest_has_the_papers_densities():
    """D = 0.95 % gives p = 56.7 %, for occluders of 0.2 m in a volume from 2.506 m to 20.04 m."""
    preset = SCENES["paper-forest"]
    height, size = preset.volume_height_m, preset.occluder_size_m
    assert integrated_density(0.0095, height, size) == near(preset.integrated_density, rel=1e-12)
    assert preset.integrated_density == 0.567
    assert preset.volume_base_m == pytest.approx(2.506, abs=0.0005)
    assert preset.volume_base_m + height == pytest.approx(20.04, abs=0.005)


@given(
    slabs=stacks(),
    altitude=altitudes,
    share=coverages,
    focal_length=st.sampled_from([SHARP, 3000.0, 400.0, 60.0]),
)
def test_the_baseline_is_a_quantile_of_the_baselines_of_single_occluders(
    slabs, altitude, share, focal_length
):
    found = coverage_baseline(slabs, altitude, focal_length, share).baseline_m
    needed, shares = occluders(slabs, altitude, focal_length, count=20_000)
    order = np.argsort(needed)
    needed, covered = needed[order], np.cumsum(shares[order])
    # Every slab has 20 000 occluders, so the share has an error of 1/20 000.
    below, above = np.searchsorted(covered, (share - 1e-4, share + 1e-4))
    assert needed[max(below - 1, 0)] <= found * (1 + 1e-9)
    assert found * (1 - 1e-9) <= needed[min(above + 1, len(needed) - 1)]


@given(
    slabs=stacks(),
    altitude=altitudes,
    baseline=st.floats(0.01, 200.0),
    focal_length=st.sampled_from([SHARP, 3000.0, 60.0]),
)
def test_the_coverage_share_equals_a_count_of_single_occluders(
    slabs, altitude, baseline, focal_length
):
    needed, shares = occluders(slabs, altitude, focal_length, count=5000)
    counted = shares[needed <= baseline].sum()
    found = coverage_share(slabs, altitude, focal_length, baseline)
    assert found == pytest.approx(counted, abs=len(slabs) / 5000)


@given(slabs=stacks(), altitude=altitudes, share=coverages)
def test_the_baseline_is_the_smallest_that_covers_the_share(slabs, altitude, share):
    found = coverage_baseline(slabs, altitude, 3000.0, share).baseline_m
    assert coverage_share(slabs, altitude, 3000.0, found) >= share * (1 - 1e-12)
    assert coverage_share(slabs, altitude, 3000.0, found * (1 - 1e-9)) < share


@given(slabs=stacks(), altitude=altitudes, share=coverages)
def test_the_occluder_that_determines_the_baseline_has_disparity_one(slabs, altitude, share):
    baseline, height, size = coverage_baseline(slabs, altitude, 3000.0, share)
    assert any(
        slab.bottom_m <= height <= slab.top_m and size == slab.occluder_size_m for slab in slabs
    )
    dhat = disparity_px(baseline, height, altitude, 3000.0) / occluder_px(
        size, height, altitude, 3000.0
    )
    assert dhat == near(1.0, rel=1e-9)


@given(
    bottom=heights,
    thickness=st.floats(0.1, 20.0),
    size=sizes,
    share=coverages,
    cuts=st.lists(st.floats(0.01, 0.99), min_size=1, max_size=9, unique=True),
)
def test_cutting_a_slab_into_many_changes_no_baseline(bottom, thickness, size, share, cuts):
    edges = [bottom, *(bottom + cut * thickness for cut in sorted(cuts)), bottom + thickness]
    pieces = tuple(Slab(low, high, size, high - low) for low, high in pairwise(edges) if high > low)
    altitude = bottom + thickness + 10.0
    whole = (Slab(bottom, bottom + thickness, size, 3.0),)
    for focal_length in (SHARP, 50.0):
        one = coverage_baseline(whole, altitude, focal_length, share)
        many = coverage_baseline(pieces, altitude, focal_length, share)
        assert many.baseline_m == near(one.baseline_m, rel=1e-10)
        assert many.height_m == near(one.height_m, rel=1e-10)


@given(slabs=stacks(), altitude=altitudes, share=coverages, factor=st.floats(1.0, 4.0))
def test_a_larger_share_needs_a_wider_baseline(slabs, altitude, share, factor):
    more = min(share * factor, 1.0)
    narrow = coverage_baseline(slabs, altitude, 3000.0, share).baseline_m
    wide = coverage_baseline(slabs, altitude, 3000.0, more).baseline_m
    assert narrow <= wide * (1 + 1e-12)


@given(slabs=stacks(), altitude=altitudes, share=coverages, factor=st.floats(0.01, 100.0))
def test_only_the_proportions_of_the_weights_matter(slabs, altitude, share, factor):
    scaled = tuple(slab._replace(weight=slab.weight * factor) for slab in slabs)
    assert coverage_baseline(scaled, altitude, 3000.0, share).baseline_m == near(
        coverage_baseline(slabs, altitude, 3000.0, share).baseline_m, rel=1e-9
    )


@given(slabs=stacks(), altitude=altitudes, share=coverages)
def test_order_of_slabs_does_not_matter(slabs, altitude, share):
    assert coverage_baseline(slabs[::-1], altitude, 3000.0, share).baseline_m == near(
        coverage_baseline(slabs, altitude, 3000.0, share).baseline_m, rel=1e-12
    )


@given(slabs=stacks(), altitude=altitudes, share=coverages)
def test_the_camera_does_not_matter_until_occluders_are_smaller_than_a_pixel(
    slabs, altitude, share
):
    enough = altitude / min(slab.occluder_size_m for slab in slabs)
    sharp = coverage_baseline(slabs, altitude, SHARP, share)
    assert coverage_baseline(slabs, altitude, enough, share).baseline_m == near(
        sharp.baseline_m, rel=1e-12
    )
    assert coverage_baseline(slabs, altitude, 10.0, share).baseline_m >= sharp.baseline_m * (
        1 - 1e-12
    )


def test_occluders_below_one_pixel_need_a_disparity_of_one_pixel():
    """Occluders of 1 cm at a height of 10 m, seen from 50 m with 2000 px: a pixel is 2 cm there."""
    slab = (Slab(10.0 - 1e-9, 10.0 + 1e-9, 0.01, 1.0),)
    found = coverage_baseline(slab, 50.0, 2000.0, 0.98)
    assert found.baseline_m == near(0.02 * 50.0 / 10.0, rel=1e-8)
    assert disparity_px(found.baseline_m, found.height_m, 50.0, 2000.0) == near(1.0, rel=1e-12)


def test_a_gap_between_slabs_needs_no_coverage():
    slabs = (Slab(1.0, 2.0, 0.2, 1.0), Slab(5.0, 10.0, 0.2, 1.0))
    # The upper slab is covered at baselines of at least 0.2 · 50/5. For any larger share, the
    # baseline has to cover the top of the lower slab, too.
    assert coverage_baseline(slabs, 50.0, SHARP, 0.5).baseline_m == near(2.0, rel=1e-12)
    just_more = coverage_baseline(slabs, 50.0, SHARP, 0.5 + 1e-9)
    assert just_more.baseline_m == near(5.0, rel=1e-8)
    assert just_more.height_m == near(2.0, rel=1e-8)


def test_slabs_without_thickness_are_covered_one_after_the_other():
    thin = (Slab(2.0, 2.0, 0.2, 1.0), Slab(5.0, 5.0, 0.3, 1.0), Slab(10.0, 10.0, 0.2, 2.0))
    for share, baseline in (
        (0.5, 1.0),
        (0.4, 1.0),
        (0.75, 3.0),
        (0.6, 3.0),
        (0.98, 5.0),
        (1.0, 5.0),
    ):
        assert coverage_baseline(thin, 50.0, SHARP, share).baseline_m == near(baseline, rel=1e-9)
    assert coverage_baseline(thin[:1], 50.0, SHARP, 0.3).baseline_m == near(5.0, rel=1e-12)
    close = (Slab(5.0, 5.0, 0.2, 1.0), Slab(5.02, 5.02, 0.2, 1.0))
    assert coverage_baseline(close, 50.0, SHARP, 0.5).height_m == 5.02
    assert coverage_baseline(close, 50.0, SHARP, 0.51).height_m == 5.0


def test_full_coverage_is_possible_if_no_occluder_is_on_the_focal_plane():
    for slabs in (
        (Slab(1.0, 3.0, 0.2, 1.0),),
        (Slab(1.0, 2.0, 0.2, 1.0), Slab(2.0, 3.0, 0.2, 1.0)),
    ):
        assert coverage_baseline(slabs, 50.0, SHARP, 1.0).baseline_m == near(10.0, rel=1e-12)


@pytest.mark.parametrize(
    "slabs",
    [
        (Slab(0.0, 10.0, 0.2, 1.0),),
        (Slab(0.0, 5.0, 0.2, 1.0), Slab(5.0, 10.0, 0.2, 1.0)),
        (Slab(0.0, 0.5, 0.1, 0.01), Slab(3.0, 5.0, 0.2, 1.0), Slab(5.0, 10.0, 0.2, 1.0)),
    ],
    ids=["one slab", "two slabs", "three slabs"],
)
def test_occluders_on_the_focal_plane_cannot_all_be_covered(slabs):
    with pytest.raises(InfeasibleError, match="focal plane") as caught:
        coverage_baseline(slabs, 50.0, SHARP, 1.0)
    assert "--coverage" in caught.value.hint
    assert math.isfinite(coverage_baseline(slabs, 50.0, SHARP, 0.98).baseline_m)


def test_at_tiny_baselines_no_occluder_is_covered():
    slab = (Slab(1.0, 3.0, 0.2, 1.0),)
    assert coverage_share(slab, 50.0, SHARP, 0.0) == 0.0
    assert coverage_share(slab, 50.0, SHARP, 1e-3) == 0.0
    assert coverage_share(slab, 50.0, SHARP, 1e9) == 1.0


def test_the_curve_of_very_many_slabs_has_some_of_its_knots(monkeypatch):
    slabs = [Slab(2.0 + 0.1 * i, 2.1 + 0.1 * i, 0.2, 1.0) for i in range(100)]
    whole = baseline_curve(slabs)
    monkeypatch.setattr("aosplan.camera.disparity.MOST_SHARES", 1500)
    some = baseline_curve(slabs)
    assert 10 <= len(some) <= 16
    assert set(some) <= set(whole)
    assert some[-1] == whole[-1]
