"""The coverage rule, compared with direct counts over all points, sites and images."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from support.shapes import areas, points_in

from aosplan.areas.cell_runs import CellRuns, runs_of, united
from aosplan.areas.coverage import (
    CellLattice,
    centred_lattice,
    image_cells,
    overlapped_cells,
    seen_cells,
    site_counts,
    sites_for,
    sites_seeing,
    window_of,
)
from aosplan.errors import RequestError
from aosplan.grid.patterns import Pattern, pattern_for

whole_numbers = st.sets(st.integers(-50, 50), max_size=40)


def spans(numbers):
    return runs_of(np.array(sorted(numbers), np.int64))


# Cell runs behave as sets


@given(whole_numbers)
def test_cell_runs_contain_exactly_the_numbers_they_were_made_from(numbers):
    runs = spans(numbers)
    assert set(runs.numbers().tolist()) == numbers
    assert runs.size == len(numbers)
    assert (runs.stop > runs.start).all()
    assert (runs.start[1:] > runs.stop[:-1]).all()
    every = np.arange(-55, 56)
    assert set(every[runs.holds(every)].tolist()) == numbers


@given(whole_numbers, whole_numbers)
def test_without_gives_the_difference_of_two_sets_of_runs(one, other):
    assert set(spans(one).without(spans(other)).numbers().tolist()) == one - other


@given(
    whole_numbers,
    st.lists(st.tuples(st.integers(-9, 9), st.integers(0, 4)), min_size=1, max_size=4),
)
def test_dilated_runs_contain_all_sums_of_their_elements(numbers, runs):
    runs = [(first, first + more) for first, more in runs]
    sums = {n + k for n in numbers for first, last in runs for k in range(first, last + 1)}
    assert set(spans(numbers).dilated(runs).numbers().tolist()) == sums


@given(st.lists(st.tuples(st.integers(-30, 30), st.integers(1, 9)), max_size=12))
def test_runs_are_united_in_any_order(runs):
    start = np.array([first for first, _ in runs], np.int64)
    stop = start + np.array([length for _, length in runs], np.int64)
    expected = {n for first, length in runs for n in range(first, first + length)}
    assert set(united(start, stop).numbers().tolist()) == expected


# Cells that a shape overlaps


def lattice_for(shape, window, margin=0):
    return centred_lattice(shape, shape, window, margin)


@settings(max_examples=15)
@given(areas(), st.floats(0.7, 9.0), st.floats(0.7, 9.0))
def test_overlapped_cells_are_those_that_the_shape_overlaps(shape, x_pitch, y_pitch):
    lattice = lattice_for(shape, window_of(Pattern(1, 1), (x_pitch, y_pitch)))
    found = set(overlapped_cells(shape, lattice).numbers().tolist())
    rows = math.ceil((shape.bounds[3] - shape.bounds[1]) / y_pitch) + 2
    every = np.arange(-lattice.stride, rows * lattice.stride)
    boxes = lattice.boxes(CellRuns(every, every + 1))
    shapely.prepare(shape)
    for number, box in zip(every.tolist(), boxes, strict=True):
        # If the shape touches the cell within a millionth of a pitch, both results are accepted.
        if shapely.intersects(shape, shapely.buffer(box, -1e-6 * min(x_pitch, y_pitch))):
            assert number in found
        elif not shapely.intersects(shape, shapely.buffer(box, 1e-6 * min(x_pitch, y_pitch))):
            assert number not in found


@pytest.mark.parametrize(("size", "cells"), [(28.0, 100), (28.000001, 121), (27.999999, 100)])
def test_an_area_of_whole_cells_overlaps_only_these_cells(size, cells):
    shape = shapely.multipolygons([shapely.box(0, 0, size, size)])
    lattice = lattice_for(shape, window_of(pattern_for("square", 49), (2.8, 2.8)))
    assert overlapped_cells(shape, lattice).size == cells


def test_the_lattice_is_centred():
    shape = shapely.multipolygons([shapely.box(3, 7, 103, 50)])
    window = window_of(pattern_for("trimmed", 50), (2.8, 2.8))
    lattice = lattice_for(shape, window, 5)
    placed = lattice.middles(overlapped_cells(shape, lattice).numbers())
    low, high = placed.min(axis=0), placed.max(axis=0)
    assert (low + high) / 2 == pytest.approx([53.0, 28.5], abs=1e-9)


def test_lattices_with_too_many_cells_to_number_are_refused():
    specks = shapely.multipolygons(
        [shapely.box(0, 0, 1e-3, 1e-3), shapely.box(3e4, 3e4, 30000.001, 30000.001)]
    )
    with pytest.raises(RequestError, match="too large for sites"):
        lattice_for(specks, window_of(Pattern(1, 1), (1e-6, 1e-6)))


# The rule


def count_in_rectangles(sites, points, size):
    """Number of sites inside or on the border of the rectangle around each point.  The coverage
    rule is defined by this number.
    """
    apart = np.abs(sites[None, :, :] - points[:, None, :])
    return (apart <= np.array(size) / 2 * (1 + 1e-7)).all(axis=2).sum(axis=1)


def planned(shape, pattern, pitch):
    window = window_of(pattern, pitch)
    lattice = lattice_for(shape, window, window.columns)
    placements = overlapped_cells(shape, lattice)
    sites = sites_for(placements, window, lattice.stride)
    at_sites = lattice.moved(-0.5 * (window.columns - 1), -0.5 * (window.rows - 1))
    return window, lattice, placements, sites, at_sites


kinds = st.sampled_from(["trimmed", "rectangle", "square", "line", "lanes"])


@settings(max_examples=30)
@given(areas(), kinds, st.integers(1, 60), st.floats(1.0, 7.0), st.integers(0, 2**32))
@example(shapely.multipolygons([shapely.box(0, 0, 56, 28)]), "trimmed", 50, 2.8, 1)
def test_every_point_has_all_sites_in_its_rectangle(shape, kind, samples, baseline, seed):
    pattern = pattern_for(kind, samples)
    pitch = (baseline, baseline * pattern.row_pitch)
    window, lattice, placements, sites, at_sites = planned(shape, pattern, pitch)
    assert window.samples == pattern.samples
    places = at_sites.middles(sites.numbers())
    points = points_in(shape, 40, np.random.default_rng(seed))
    counted = count_in_rectangles(places, points, window.size_m)
    assert (counted >= pattern.samples).all()
    own = site_counts(sites.numbers(), placements.numbers(), window, lattice.stride)
    assert own.min() >= pattern.samples
    # No site is superfluous: each site is in the pattern of at least one cell that the area
    # overlaps.
    assert len(set(sites.numbers().tolist())) == sites.size
    middles = lattice.middles(placements.numbers())
    wanted = {
        (round(x / pitch[0] * 2), round(y / pitch[1] * 2))
        for mx, my in middles
        for row, column in pattern.sites()
        for x, y in [
            (
                mx + (column - 0.5 * (pattern.columns - 1)) * pitch[0],
                my + (row - 0.5 * (pattern.rows - 1)) * pitch[1],
            )
        ]
    } if len(middles) < 400 else None  # fmt: skip
    if wanted is not None:
        assert len(wanted) == sites.size


@settings(max_examples=20)
@given(areas(), st.integers(1, 60), st.floats(1.0, 7.0), st.integers(0, 2**32))
def test_site_counts_equal_a_direct_count_after_sites_are_removed(shape, samples, baseline, seed):
    pattern = pattern_for("trimmed", samples)
    window, lattice, placements, sites, at_sites = planned(shape, pattern, (baseline, baseline))
    rng = np.random.default_rng(seed)
    left = sites.numbers()[rng.random(sites.size) < 0.8]
    middles = lattice.middles(placements.numbers())[:200]
    jitter = rng.uniform(-0.499, 0.499, middles.shape) * baseline
    own = site_counts(left, placements.numbers(), window, lattice.stride)[:200]
    places = at_sites.middles(left)
    assert np.array_equal(own, count_in_rectangles(places, middles + jitter, window.size_m))


def test_every_point_of_a_cell_sees_the_whole_trimmed_pattern():
    # Every point is seen from exactly the sites of the pattern. The test is stricter than a
    # comparison of the number of sites.
    pattern = pattern_for("trimmed", 50)
    shape = shapely.multipolygons([shapely.Point(0, 0).buffer(9.0)])
    _, lattice, placements, sites, _ = planned(shape, pattern, (2.8, 2.8))
    own = set(sites.numbers().tolist())
    for placement in placements.numbers().tolist():
        assert {placement + row * lattice.stride + column for row, column in pattern.sites()} <= own


# Areas that need one view


@given(st.floats(1.0, 90.0), st.floats(1.0, 9.0))
def test_only_cells_completely_inside_an_image_count_as_seen(footprint, pitch):
    if footprint < pitch:
        return
    (columns, _) = image_cells((footprint, footprint), (pitch, pitch))
    assert columns % 2 == 1
    assert columns * pitch <= footprint * (1 + 1e-8)
    assert (columns + 2) * pitch > footprint * (1 - 1e-8)


cells = st.sets(st.tuples(st.integers(0, 25), st.integers(0, 25)), min_size=1, max_size=80)
images = st.tuples(st.sampled_from([1, 3, 5, 7]), st.sampled_from([1, 3, 5]))


@given(cells, images)
def test_seen_cells_are_the_cells_around_sites(places, image):
    stride = 60
    sites = spans({row * stride + column + 10 for row, column in places})
    seen = set(seen_cells(sites, image, stride).numbers().tolist())
    width, height = image
    expected = {
        (row + dy) * stride + column + 10 + dx
        for row, column in places
        for dy in range(-(height // 2), height // 2 + 1)
        for dx in range(-(width // 2), width // 2 + 1)
    }
    assert seen == expected


@given(cells, images)
def test_few_sites_see_all_cells(places, image):
    stride = 60
    wanted = spans({row * stride + column + 10 for row, column in places})
    sites = sites_seeing(wanted, image, stride)
    assert len(set(sites.tolist())) == len(sites)
    assert wanted.without(seen_cells(runs_of(sites), image, stride)).size == 0
    # Each site was chosen for a cell that no earlier site sees.
    assert len(sites) <= wanted.size


def test_a_rectangle_needs_no_more_images_than_fit_into_it():
    stride = 100
    wanted = spans({row * stride + column for row in range(15) for column in range(10, 38)})
    assert len(sites_seeing(wanted, (7, 5), stride)) == 4 * 3


def test_a_lattice_gives_the_positions_of_its_cells():
    lattice = CellLattice((10.0, -5.0), (2.0, 3.0), 50)
    assert lattice.middles(np.array([0, 51])).tolist() == [[11.0, -3.5], [13.0, -0.5]]
    (box,) = lattice.boxes(CellRuns(np.array([51]), np.array([54])))
    assert box.bounds == (12.0, -2.0, 18.0, 1.0)
