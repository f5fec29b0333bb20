"""Areas around points, compared with geodesic distances."""

import json

import numpy as np
import pytest
import shapely
from pyproj import Geod

from aosplan.areas.area import read_area
from aosplan.errors import RequestError
from aosplan.geodesy import to_wgs84

POINTS = [(14.3261, 48.3358), (14.3271, 48.3360), (14.32615, 48.33585)]


def features(points, **members):
    shapes = [{"type": "Point", "coordinates": list(point)} for point in points]
    found = [{"type": "Feature", "properties": {}, "geometry": shape} for shape in shapes]
    return json.dumps({"type": "FeatureCollection", "features": found, **members})


def kml(points):
    marks = "".join(
        f"<Placemark><Point><coordinates>\n {x},{y},0 </coordinates></Point></Placemark>"
        for x, y in points
    )
    return f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{marks}</Document></kml>'


def multipoint(points):
    return json.dumps({"type": "MultiPoint", "coordinates": points})


@pytest.mark.parametrize("text", [features(POINTS), kml(POINTS), multipoint(POINTS)])
def test_the_area_is_the_ground_within_the_radius_of_a_point(tmp_path, text):
    (tmp_path / "points").write_text(text)
    area = read_area(str(tmp_path / "points"), around_m=10.0)
    rng = np.random.default_rng(7)
    west, south, east, north = shapely.bounds(area.whole)
    x, y = rng.uniform(west - 3, east + 3, 20_000), rng.uniform(south - 3, north + 3, 20_000)
    inside = shapely.contains_xy(area.whole, x, y)
    latitude, longitude = map(np.array, to_wgs84(area.origin, x, y))
    ellipsoid = Geod(ellps="WGS84")
    nearest = np.min(
        [
            ellipsoid.inv(longitude, latitude, np.full_like(x, lon), np.full_like(x, lat))[2]
            for lon, lat in POINTS
        ],
        axis=0,
    )
    assert inside[nearest < 9.9999].all()
    # The corners of the 32-gons are 10.049 m from the points.
    assert not inside[nearest > 10.05].any()
    assert 1000 < inside.sum() < 19_000


def test_shapes_other_than_points_are_left_out_with_a_notice(tmp_path):
    square = {"type": "Polygon", "coordinates": [[[14, 48], [14.1, 48], [14.1, 48.1], [14, 48]]]}
    members = [square, {"type": "Point", "coordinates": [14.3, 48.3]}]
    (tmp_path / "mixed.geojson").write_text(
        json.dumps({"type": "GeometryCollection", "geometries": members})
    )
    area = read_area(str(tmp_path / "mixed.geojson"), around_m=5.0)
    assert area.whole.area == pytest.approx(np.pi * 25, rel=0.01)
    assert [notice.code for notice in area.notices] == ["ignored_geometry"]
    assert "1 Polygon" in area.notices[0].message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (features([]), "contains no point"),
        (features([(14.3, "48")]), "geometry.coordinates: "),
        (features([(480, 14)]), "is not a longitude and a latitude"),
        (features([()]), "is not a longitude and a latitude"),
        (kml([("east", 48)]), "point 1"),
        (features([(14.3, 48.3)] * 1001), "has 1001 points, more than 1000"),
    ],
)
def test_files_without_valid_points_are_refused(tmp_path, text, message):
    (tmp_path / "points").write_text(text)
    with pytest.raises(RequestError, match=message.replace(".", r"\.")):
        read_area(str(tmp_path / "points"), around_m=5.0)


def test_projected_points_are_transformed(tmp_path):
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32633"}}
    (tmp_path / "points").write_text(features([(450_000, 5_354_000)], crs=crs))
    area = read_area(str(tmp_path / "points"), around_m=5.0)
    # The notice is the same as for areas from polygons.
    assert [notice.code for notice in area.notices] == ["reprojected"]
    latitude, longitude = area.origin
    assert latitude == pytest.approx(48.336, abs=0.01)
    assert longitude == pytest.approx(14.325, abs=0.01)


def test_a_plan_covers_the_ground_around_hot_spots(command, tmp_path):
    (tmp_path / "spots.geojson").write_text(features(POINTS))
    arguments = ["plan", "--altitude", 40, "--vhat", 0.9, "--around", tmp_path / "spots.geojson"]
    _, document, _ = command(*arguments, "--around-radius", "6", "--json")
    plan = json.loads(document)
    assert plan["request"]["around_radius"] == 6.0
    assert plan["area"]["covered_share"] == 1.0
    # The first and the third point are 6.7 m apart, so two discs overlap.
    assert 2 * np.pi * 36 < plan["area"]["area_m2"] < 1.01 * 3 * np.pi * 36
