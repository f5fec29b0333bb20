"""Areas in metres: tests of sizes at any place on earth, of simplification, and of errors."""

import json
import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod, Transformer

from aosplan.areas import area as area_module
from aosplan.areas.area import FARTHEST_M, grown, long_side_deg, polygons_of, read_area
from aosplan.errors import RequestError
from aosplan.geodesy import to_local, to_wgs84

GEOD = Geod(ellps="WGS84")


@pytest.fixture
def file(tmp_path):
    """A function that writes polygons (lists of rings) to a GeoJSON file and returns its path."""

    def write(*polygons, name="area.geojson"):
        path = tmp_path / name
        path.write_text(json.dumps({"type": "MultiPolygon", "coordinates": polygons}))
        return str(path)

    return write


def rectangle(west, south, east, north):
    return [[west, south], [east, south], [east, north], [west, north], [west, south]]


def around(latitude, longitude, sides=8, radius_m=500.0):
    """A regular polygon around a place, made of geodesics.  A polygon that crosses the antimeridian
    is not split there.
    """
    azimuths = np.arange(sides) * 360.0 / sides
    lon, lat, _ = GEOD.fwd([longitude] * sides, [latitude] * sides, azimuths, [radius_m] * sides)
    ring = [[round(x, 12), round(y, 12)] for x, y in zip(lon, lat, strict=True)]
    return [*ring, ring[0]]


PLACES = [
    (48.3358, 14.3261),
    (0.0, 0.0),
    (12.0, 180.0),
    (-16.5, -179.999),
    (52.0, 179.9999),
    (78.2, 15.6),
    (-77.85, 166.67),
    (-33.87, 151.2),
]


@pytest.mark.parametrize("place", PLACES)
def test_areas_have_the_size_on_the_ellipsoid(file, place):
    ring = around(*place)
    area = read_area(file([ring]))
    # The edges of the reference are geodesics, but the edges of the area are straight in degrees.
    # At 78°, they differ by 5 mm.
    expected = abs(GEOD.polygon_area_perimeter(*zip(*ring, strict=True))[0])
    assert area.whole.area == pytest.approx(expected, rel=1e-4)
    assert area.radius_m == pytest.approx(500.0, abs=0.05)


def test_areas_with_short_edges_are_exact_to_nine_digits(file):
    ring = around(48.3, 14.3, sides=64)
    expected = abs(GEOD.polygon_area_perimeter(*zip(*ring, strict=True))[0])
    assert read_area(file([ring])).whole.area == pytest.approx(expected, rel=1e-9, abs=0)


@pytest.mark.parametrize("latitude", [89.99, -89.99])
def test_a_ring_around_a_pole_contains_the_pole(file, latitude):
    ring = [[longitude, latitude] for longitude in (-180, -120, -60, 0, 60, 120, -180)]
    area = read_area(file([ring]))
    assert abs(area.origin[0]) == pytest.approx(90.0, abs=1e-6)
    # An edge between two meridians follows the parallel, which is a circle.
    radius = GEOD.inv(0, math.copysign(90, latitude), 0, latitude)[2]
    assert area.whole.area == pytest.approx(math.pi * radius**2, rel=1e-4)


def test_the_parts_of_an_area_cut_at_the_antimeridian_are_joined(file):
    halves = file(
        [rectangle(179.995, 10.0, 180.0, 10.01)], [rectangle(-180.0, 10.0, -179.995, 10.01)]
    )
    whole = read_area(file([rectangle(179.995, 10.0, -179.995, 10.01)], name="whole.geojson"))
    area = read_area(halves)
    assert area.whole.area == pytest.approx(whole.whole.area, rel=1e-9)
    assert abs(area.origin[1]) == pytest.approx(180.0, abs=1e-6)
    assert len(shapely.get_parts(area.whole)) == 1


@pytest.mark.parametrize("latitude", [48.0, 70.0, -85.0])
def test_long_edges_follow_parallels_of_latitude(file, latitude):
    half = math.degrees(15_000 / (6.371e6 * math.cos(math.radians(latitude))))
    area = read_area(file([rectangle(-half, latitude, half, latitude + 0.01)]))
    east, north = shapely.get_coordinates(area.whole).T
    dense = shapely.LinearRing(np.column_stack([east, north]))
    longitudes = np.linspace(-half, half, 3001)
    points = to_local(area.origin, [latitude] * 3001, longitudes.tolist())
    gap = shapely.distance(dense, shapely.points(np.column_stack(points))).max()
    assert gap < 1.05 * area_module.BEND_M


@given(
    st.floats(-90, 90), st.floats(-180, 180), st.floats(-20_000, 20_000), st.floats(-20_000, 20_000)
)
def test_to_local_inverts_to_wgs84(latitude, longitude, east, north):
    lat, lon = to_wgs84((latitude, longitude), [east], [north])
    (x,), (y,) = to_local((latitude, longitude), lat, lon)
    assert (x, y) == pytest.approx((east, north), abs=1e-5)


def test_the_error_of_the_local_frame_is_at_most_the_stated_error(file):
    # The error is largest at the rim, for two neighbours whose connection is perpendicular to the
    # direction to the centre.
    area = read_area(file([around(48.3, 14.3, sides=32, radius_m=19_900.0)]))
    assert 1e-6 < area.projection_error < 1.7e-6
    north = [19_900.0] * 2
    lat, lon = to_wgs84(area.origin, [-50.0, 50.0], north)
    true = GEOD.inv(lon[0], lat[0], lon[1], lat[1])[2]
    assert abs(true / 100.0 - 1.0) <= area.projection_error * 1.05
    assert abs(true / 100.0 - 1.0) >= area.projection_error * 0.9


def test_the_origin_of_an_area_is_the_centre_of_its_bounds(file):
    ring = around(48.3, 14.3)
    points = np.column_stack(
        to_local(read_area(file([ring])).origin, *zip(*[p[::-1] for p in ring], strict=True))
    )
    assert points.min(axis=0) + points.max(axis=0) == pytest.approx([0.0, 0.0], abs=1e-3)


def test_areas_beyond_twenty_kilometres_are_refused(file):
    assert read_area(file([around(10, 20, radius_m=FARTHEST_M * 0.99)])).radius_m < FARTHEST_M
    with pytest.raises(RequestError, match=r"reaches 20.2 km from its middle, more than the 20 km"):
        read_area(file([around(10, 20, radius_m=FARTHEST_M * 1.01)]))
    with pytest.raises(RequestError, match="more than the 20 km"):
        read_area(file([around(10, 20)], [around(11, 20)]))
    with pytest.raises(RequestError, match="more than the 20 km"):
        read_area(file([around(10, 20)], [around(-10, -160)]))


# Invalid outlines


@pytest.mark.parametrize(
    ("polygon", "why"),
    [
        ([[[0, 0], [0.01, 0.01], [0.01, 0], [0, 0.01], [0, 0]]], "the outline crosses itself near latitude 0.005000, longitude 0.005000"),
        ([rectangle(0, 0, 0.01, 0.01), rectangle(0.02, 0, 0.03, 0.01)], "hole lies outside shell"),
        ([rectangle(0, 0, 0.01, 0.01), rectangle(0.005, 0.005, 0.02, 0.008)], "crosses itself"),
        ([[[0, 0], [0.01, 0], [0.02, 0], [0, 0]]], "has no area"),
        ([[[0, 0], [0, 0], [0, 0], [0, 0]]], "has no area"),
    ],
)  # fmt: skip
def test_invalid_outlines_are_refused_with_the_place_of_the_fault(file, polygon, why):
    path = file(polygon)
    with pytest.raises(RequestError) as caught:
        read_area(path)
    assert why in caught.value.message
    assert path in caught.value.message


def test_spikes_and_touching_rings_are_accepted(file):
    spike = [[0, 0], [0.01, 0], [0.01, 0.01], [0.005, 0.01], [0.005, 0.02], [0.005, 0.01], [0, 0.01], [0, 0]]  # fmt: skip
    plain = read_area(file([rectangle(0, 0, 0.01, 0.01)])).whole.area
    assert read_area(file([spike])).whole.area == pytest.approx(plain, rel=1e-9)
    # A corner of the hole is on an edge of the outer ring, except for differences by rounding.
    third = [[0, 0], [0.01, 0.007], [0.003, 0.02], [0, 0]]
    hole = [[0.01 / 3, 0.007 / 3], [0.004, 0.006], [0.003, 0.006], [0.01 / 3, 0.007 / 3]]
    assert read_area(file([third, hole])).whole.area < read_area(file([third])).whole.area


def test_polygons_that_overlap_are_united(file):
    area = read_area(file([rectangle(0, 0, 0.01, 0.01)], [rectangle(0.005, 0, 0.015, 0.01)]))
    alone = read_area(file([rectangle(0, 0, 0.015, 0.01)], name="alone.geojson"))
    assert area.whole.area == pytest.approx(alone.whole.area, rel=1e-9)


def test_polygons_without_an_area_are_left_out_with_a_warning(tmp_path):
    shapes = [
        {"type": "Polygon", "coordinates": [rectangle(0, 0, 0.01, 0.01)]},
        {"type": "Point", "coordinates": [0, 0]},
    ]
    path = tmp_path / "mixed.geojson"
    path.write_text(json.dumps({"type": "GeometryCollection", "geometries": shapes}))
    (notice,) = read_area(str(path)).notices
    assert notice.code == "ignored_geometry"
    assert "1 Point" in notice.message


# Clear parts and no-fly zones


def test_clear_parts_and_canopy_together_are_the_area(file):
    path = file([rectangle(0, 0, 0.01, 0.01)])
    clear = file([rectangle(0.006, -0.01, 0.02, 0.02)], name="clear.geojson")
    area = read_area(path, clear=clear)
    assert area.canopy.area / area.whole.area == pytest.approx(0.6, rel=1e-6)
    assert area.canopy.area + area.clear.area == pytest.approx(area.whole.area, rel=1e-12)
    assert shapely.intersection(area.canopy, area.clear).area == pytest.approx(0.0, abs=1e-6)


@given(st.floats(0.01, 500.0))
def test_a_buffer_is_at_least_the_given_distance_and_hardly_more(distance):
    shape = shapely.Polygon([(0, 0), (100, 5), (60, 40), (90, 90), (10, 80)])
    outside = shapely.get_coordinates(grown(shape, distance))
    apart = shapely.distance(shape, shapely.points(outside))
    assert apart.min() >= distance * (1 - 1e-9)
    assert apart.max() <= distance * 1.03
    along = shapely.segmentize(grown(shape, distance).exterior, distance / 50 + 0.5)
    nearest = shapely.distance(shape, shapely.points(shapely.get_coordinates(along))).min()
    assert nearest >= distance * (1 - 1e-9)


def test_zones_far_from_the_area_give_a_warning(file):
    path = file([rectangle(14.0, 48.0, 14.01, 48.01)])
    away = file([rectangle(15.0, 48.0, 15.01, 48.01)], name="away.geojson")
    area = read_area(path, clear=away, no_fly=away)
    assert [notice.code for notice in area.notices] == ["elsewhere", "elsewhere"]
    assert area.clear.is_empty


def test_zones_with_swapped_axes_are_an_error(file):
    path = file([rectangle(14.0, 48.0, 14.01, 48.01)])
    swapped = file([rectangle(48.001, 14.001, 48.002, 14.002)], name="swapped.geojson")
    for zones in ({"clear": swapped}, {"no_fly": swapped}):
        with pytest.raises(
            RequestError, match="with latitude and longitude swapped, it would be near"
        ):
            read_area(path, **zones)


# Simplification


def coast(vertices, roughness_m=5.0):
    """A ring of many vertices around 48.3, 14.3, similar to the outline of a shore."""
    rng = np.random.default_rng(7)
    angle = np.arange(vertices) / vertices * 2 * np.pi
    radius = 800 + 100 * np.sin(7 * angle) + rng.uniform(0, roughness_m, vertices)
    lat, lon = to_wgs84(
        (48.3, 14.3), (radius * np.cos(angle)).tolist(), (radius * np.sin(angle)).tolist()
    )
    ring = list(map(list, zip(lon, lat, strict=True)))
    return [*ring, ring[0]]


def split(shape):
    """The edges of a shape as single lines."""
    points = shapely.get_coordinates(shape)
    return shapely.multilinestrings(np.stack([points[:-1], points[1:]], axis=1))


@pytest.mark.slow
def test_many_vertices_are_simplified_on_the_safe_side(file, monkeypatch):
    ring = coast(30_000, roughness_m=0.5)
    path = file([ring])
    monkeypatch.setattr(area_module, "MOST_VERTICES", 10**9)
    exact = read_area(path, clear=path, no_fly=path)
    monkeypatch.setattr(area_module, "MOST_VERTICES", 20_000)
    simple = read_area(path, no_fly=path)
    assert shapely.get_num_coordinates(simple.whole) <= 20_000
    assert 0.0 < simple.simplified_m <= 1.0
    assert exact.simplified_m == 0.0
    # The parts that have to be covered or avoided become larger, by at most the reported distance.
    for mine, true in ((simple.whole, exact.whole), (simple.keep_out, exact.keep_out)):
        assert shapely.difference(true, mine).area < 1e-6
        edges = shapely.STRtree(shapely.get_parts(split(true)))
        corners = shapely.points(shapely.get_coordinates(mine))
        _, apart = edges.query_nearest(corners, return_distance=True, all_matches=False)
        assert apart.max() <= simple.simplified_m
    # The clear part, which needs fewer views, becomes smaller.
    clear = read_area(path, clear=path).clear
    assert shapely.difference(clear, exact.clear).area < 1e-6


def test_outlines_with_too_many_vertices_after_simplification_are_refused(file, monkeypatch):
    monkeypatch.setattr(area_module, "MOST_VERTICES", 50)
    rings = [
        [around(0.001 * i, 0.001 * j, sides=5, radius_m=45)] for i in range(6) for j in range(6)
    ]
    with pytest.raises(RequestError, match="still has more than 50 vertices"):
        read_area(file(*rings))


# Shapes


def test_the_direction_of_the_long_side_of_a_rotated_rectangle_is_found():
    for degrees in (0.0, 10.0, 45.0, 90.0, 135.5, 179.0):
        turn = math.radians(degrees)
        along = np.array([math.sin(turn), math.cos(turn)])
        across = np.array([along[1], -along[0]])
        corners = [200 * along, 200 * along + 50 * across, 50 * across, 0 * along]
        found = long_side_deg(shapely.Polygon(corners))
        assert (found - degrees + 90.0) % 180.0 - 90.0 == pytest.approx(0.0, abs=0.01)
        assert 0.0 <= found < 180.0


def test_polygons_of_drops_points_and_lines():
    box = shapely.box(0, 0, 1, 1)
    mixed = shapely.GeometryCollection(
        [
            box,
            shapely.Point(3, 3),
            shapely.LineString([(0, 0), (5, 5)]),
            shapely.MultiPolygon([shapely.box(2, 2, 3, 3)]),
        ]
    )
    assert polygons_of(mixed).area == 2.0
    assert polygons_of(shapely.Polygon()).is_empty


def test_the_frame_agrees_with_the_projection_library(file):
    area = read_area(file([around(48.3, 14.3, sides=64)]))
    latitude, longitude = area.origin
    project = Transformer.from_crs(
        "EPSG:4326", f"+proj=aeqd +lat_0={latitude} +lon_0={longitude} +ellps=WGS84"
    )
    ring = around(48.3, 14.3, sides=64)
    expected = np.column_stack(project.transform(*zip(*[p[::-1] for p in ring], strict=True)))
    gap = shapely.distance(area.whole.boundary, shapely.points(expected)).max()
    assert gap < 1e-5
