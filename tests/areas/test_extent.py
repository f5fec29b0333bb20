"""Lower bounds of the number of sites that an area needs, compared with complete surveys."""

import numpy as np
import pytest
import shapely

from aosplan.areas.area import Area
from aosplan.areas.extent import distance_m, extent_of, least_lattice
from aosplan.areas.survey import survey_of
from aosplan.flight.kinematics import Timing
from aosplan.grid.patterns import Pattern

NOTHING = shapely.Polygon()


def area_of(shape):
    return Area((48.0, 14.0), shape, shape, NOTHING, NOTHING, 0.0, ())


def random_shape(rng):
    """One or two polygons, convex or not."""
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, rng.integers(4, 9)))
    radii = rng.uniform(20.0, 90.0, len(angles))
    points = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
    shape = shapely.Polygon(points).buffer(1.0)
    if rng.random() < 0.3:
        shape = shape.union(shapely.box(150.0, 10.0, 190.0, 60.0))
    return shape


def test_the_extent_of_a_rectangle_is_that_of_its_sides():
    area = area_of(shapely.box(-50.0, -20.0, 50.0, 20.0))
    assert extent_of(area, 90.0) == pytest.approx((4000.0, 100.0, 40.0))
    assert extent_of(area, 0.0) == pytest.approx((4000.0, 40.0, 100.0))


def test_the_extent_excludes_gaps_between_parts_and_no_fly_zones():
    parts = shapely.union(shapely.box(0, 0, 10, 10), shapely.box(30, 0, 40, 10))
    assert extent_of(area_of(parts), 90.0) == pytest.approx((200.0, 20.0, 10.0))
    zoned = area_of(shapely.box(0, 0, 40, 10))._replace(keep_out=shapely.box(30, -5, 50, 20))
    assert extent_of(zoned, 90.0) == pytest.approx((300.0, 30.0, 10.0))


def test_surveys_have_at_least_the_lower_bound_of_sites_and_usually_few_more():
    rng = np.random.default_rng(20261201)
    ratios = []
    for _ in range(60):
        area = area_of(random_shape(rng))
        rows, columns = int(rng.integers(1, 5)), int(rng.integers(1, 9))
        pitch, heading = float(rng.uniform(1.0, 3.0)), float(rng.uniform(0.0, 180.0))
        baseline = float(rng.uniform(2.0, 6.0))
        found = survey_of(
            area,
            Pattern(rows, columns, pitch),
            baseline_m=baseline,
            heading_deg=heading,
            footprint_m=(1e3, 1e3),
            max_sites=100_000,
            timing=Timing(fly_through=True),
        )
        sites, lines = least_lattice(
            extent_of(area, heading), rows, columns, (baseline, baseline * pitch)
        )
        assert sites <= found.sites
        assert lines <= found.sites
        ratios.append(found.sites / sites)
    assert np.median(ratios) < 1.25


def test_the_distance_from_an_area_is_zero_inside():
    area = area_of(shapely.box(0.0, 0.0, 10.0, 10.0))
    assert distance_m(area, 5.0, 5.0) == 0.0
    assert distance_m(area, 13.0, 14.0) == 5.0
