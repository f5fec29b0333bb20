"""Metres in the plan are metres on the ellipsoid, at any place on earth.

`pyproj.Geod.inv` is the reference.  The tested code uses the same library for the forward problem.
Therefore, there are two further references that share no code with it: PROJ's azimuthal equidistant
projection, and chords between earth-centred coordinates, which this file computes.
"""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pyproj import Geod, Transformer

from aosplan.geodesy import to_wgs84
from aosplan.grid.patterns import local_sites, pattern_for
from aosplan.mission.mission import Waypoints, placed

GEOD = Geod(ellps="WGS84")
MILLIMETRE = 1e-3

EQUATORIAL_M = 6378137.0
FLATTENING = 1 / 298.257223563

PLACES = {
    "Linz": (48.3358, 14.3261),
    "equator": (0.0, 0.0),
    "antimeridian": (12.0, 180.0),
    "antimeridian from the west": (-16.5, -180.0),
    "just west of the antimeridian": (52.0, 179.9999),
    "just east of the antimeridian": (52.0, -179.9999),
    "equator at the antimeridian": (0.0, 180.0),
    "north pole": (90.0, 0.0),
    "south pole": (-90.0, 0.0),
    "north pole at another longitude": (90.0, 137.0),
    "near the north pole": (89.999, -30.0),
    "near the south pole": (-89.9999, 179.0),
    "Svalbard": (78.2, 15.6),
    "McMurdo": (-77.85, 166.67),
    "Sydney": (-33.8688, 151.2093),
}


def chord_m(start, stop):
    """Length of the straight line between two places on the ellipsoid, from earth-centred
    coordinates.
    """

    def earth_centred(place):
        latitude, longitude = (math.radians(angle) for angle in place)
        squared = FLATTENING * (2 - FLATTENING)
        radius = EQUATORIAL_M / math.sqrt(1 - squared * math.sin(latitude) ** 2)
        return (
            radius * math.cos(latitude) * math.cos(longitude),
            radius * math.cos(latitude) * math.sin(longitude),
            radius * (1 - squared) * math.sin(latitude),
        )

    return math.dist(earth_centred(start), earth_centred(stop))


def distance_m(start, stop):
    """Geodesic distance."""
    return GEOD.inv(start[1], start[0], stop[1], stop[0])[2]


def azimuth_deg(start, stop):
    return GEOD.inv(start[1], start[0], stop[1], stop[0])[0] % 360.0


def angle_between_deg(one, other):
    return abs((one - other + 180.0) % 360.0 - 180.0)


def grid_at(place, samples, baseline_m, heading_deg, kind="square"):
    """Waypoints of a grid by (row, column)."""
    pattern = pattern_for(kind, samples)
    east, north = local_sites(pattern, baseline_m, heading_deg)
    waypoints = placed(Waypoints(east, north, [40.0] * len(east)), place)
    return {
        site: (waypoint.latitude, waypoint.longitude)
        for site, waypoint in zip(pattern.sites(), waypoints, strict=True)
    }


def neighbours(sites):
    for row, column in sites:
        for other in ((row, column + 1), (row + 1, column)):
            if other in sites:
                yield (row, column), other


@pytest.mark.parametrize("heading", [0.0, 37.0, 90.0, 213.5])
@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
@pytest.mark.parametrize(("samples", "baseline"), [(50, 2.8), (9, 1000.0), (81, 250.0)])
def test_neighbours_are_a_baseline_apart_to_a_millimetre(place, heading, samples, baseline):
    sites = grid_at(place, samples, baseline, heading)
    for one, other in neighbours(sites):
        assert distance_m(sites[one], sites[other]) == pytest.approx(
            baseline, rel=0, abs=MILLIMETRE
        )


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_chords_between_sites_agree_for_small_grids(place):
    # For 2.8 m, arc and chord differ by 2e-14 m; coordinates have an error of 1e-8 m.
    sites = grid_at(place, 49, 2.8, 30.0)
    for one, other in neighbours(sites):
        assert chord_m(sites[one], sites[other]) == pytest.approx(2.8, rel=0, abs=1e-6)


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_chords_between_sites_agree_to_a_millimetre_for_large_grids(place):
    sites = grid_at(place, 81, 250.0, 75.0)
    for one, other in neighbours(sites):
        assert chord_m(sites[one], sites[other]) == pytest.approx(250.0, rel=0, abs=MILLIMETRE)


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_the_frame_is_the_azimuthal_equidistant_projection(place):
    project = Transformer.from_crs(
        "EPSG:4326",
        f"+proj=aeqd +lat_0={place[0]} +lon_0={place[1]} +ellps=WGS84 +units=m",
        always_xy=True,
    )
    east = [0.0, 2.8, -2.8, 100.0, -700.0, 1400.0]
    north = [0.0, 0.0, 1.5, -300.0, 900.0, -1400.0]
    latitudes, longitudes = to_wgs84(place, east, north)
    x, y = project.transform(longitudes, latitudes)
    # At a pole, every direction is south, so only distances are defined.
    if abs(place[0]) == 90.0:
        x, y = [math.hypot(*pair) for pair in zip(x, y, strict=True)], None
        east = [math.hypot(*pair) for pair in zip(east, north, strict=True)]
    assert list(x) == pytest.approx(east, rel=0, abs=1e-6)
    if y is not None:
        assert list(y) == pytest.approx(north, rel=0, abs=1e-6)


@pytest.mark.parametrize("heading", [0.0, 30.0, 90.0, 180.0, 270.0, 359.0, -90.0, 750.0])
@pytest.mark.parametrize(
    "place", [p for p in PLACES.values() if abs(p[0]) < 89.0], ids=lambda p: f"{p[0]},{p[1]}"
)
def test_lines_fly_along_the_heading(place, heading):
    # East of the origin, the azimuth of a line changes because meridians converge. At 78 degrees
    # north and a distance of 10 m, the change is 0.0004 degrees.
    sites = grid_at(place, 49, 2.8, heading)
    for row in range(7):
        along = azimuth_deg(sites[row, 0], sites[row, 6])
        assert angle_between_deg(along, heading) < 1e-3
    middle = azimuth_deg(place, sites[3, 6])
    assert angle_between_deg(middle, heading) < 1e-6


@pytest.mark.parametrize(
    "place", [p for p in PLACES.values() if abs(p[0]) < 89.0], ids=lambda p: f"{p[0]},{p[1]}"
)
def test_rows_follow_to_the_right_of_the_heading(place):
    sites = grid_at(place, 49, 2.8, 30.0)
    assert angle_between_deg(azimuth_deg(sites[0, 3], sites[6, 3]), 120.0) < 1e-3


@pytest.mark.parametrize("kind", ["square", "trimmed", "rectangle", "line"])
@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_the_rectangle_is_centred_on_the_origin(place, kind):
    pattern = pattern_for(kind, 50)
    east, north = local_sites(pattern, 2.8, 33.0)
    corners_e, corners_n = [], []
    sites = dict(zip(pattern.sites(), zip(east, north, strict=True), strict=True))
    # Point-mirrored sites are on opposite sides of the centre at equal distances.
    for (row, column), (e, n) in sites.items():
        mirrored = (pattern.rows - 1 - row, pattern.columns - 1 - column)
        if mirrored in sites:
            assert sites[mirrored] == pytest.approx((-e, -n), abs=1e-9)
            corners_e.append(e)
            corners_n.append(n)
    latitudes, longitudes = to_wgs84(place, corners_e, corners_n)
    for e, n, latitude, longitude in zip(corners_e, corners_n, latitudes, longitudes, strict=True):
        assert distance_m(place, (latitude, longitude)) == pytest.approx(
            math.hypot(e, n), rel=0, abs=1e-6
        )


def test_the_origin_itself_is_the_site_in_the_middle():
    for place in PLACES.values():
        latitude, longitude = grid_at(place, 9, 100.0, 20.0)[1, 1]
        assert latitude == pytest.approx(place[0], abs=1e-12)
        if abs(place[0]) < 90.0:
            assert angle_between_deg(longitude, place[1]) < 1e-9


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_longitudes_are_from_minus_180_to_180(place):
    for latitude, longitude in grid_at(place, 81, 250.0, 45.0).values():
        assert -90.0 <= latitude <= 90.0
        assert -180.0 <= longitude < 180.0


@pytest.mark.parametrize("longitude", [180.0, -180.0])
def test_a_grid_on_the_antimeridian_has_sites_on_both_sides(longitude):
    longitudes = [lon for _, lon in grid_at((10.0, longitude), 81, 100.0, 0.0).values()]
    assert any(lon < 0.0 for lon in longitudes)
    assert any(lon > 0.0 for lon in longitudes)
    assert all(abs(lon) > 179.9 for lon in longitudes)


def test_longitudes_180_and_minus_180_are_the_same_place():
    east, north = [5.0, -700.0, 0.0], [3.0, 10.0, 0.0]
    one, other = to_wgs84((10.0, 180.0), east, north), to_wgs84((10.0, -180.0), east, north)
    assert one[0] == pytest.approx(other[0], abs=1e-12)
    assert one[1] == pytest.approx(other[1], abs=1e-9)


def test_empty_input_gives_empty_output():
    assert to_wgs84((48.0, 14.0), [], []) == ([], [])


def test_lists_of_different_lengths_are_an_error():
    with pytest.raises(ValueError, match="shorter"):
        to_wgs84((48.0, 14.0), [1.0, 2.0], [1.0])


offsets = st.floats(-1000.0, 1000.0)


@given(
    latitude=st.floats(-90, 90),
    longitude=st.floats(-180, 180),
    one=st.tuples(offsets, offsets),
    other=st.tuples(offsets, offsets),
)
@example(latitude=90.0, longitude=0.0, one=(1000.0, 0.0), other=(0.0, 1000.0))
@example(latitude=-90.0, longitude=180.0, one=(0.0, -1000.0), other=(1000.0, 0.0))
@example(latitude=0.0, longitude=180.0, one=(-1000.0, 1000.0), other=(1000.0, -1000.0))
def test_any_two_points_are_as_far_apart_as_on_the_plan(latitude, longitude, one, other):
    # The frame stretches distances that are perpendicular to the direction to the origin by r²/(6
    # R²). For 2.8 km at a radius of 1.4 km, this is 0.02 mm.
    latitudes, longitudes = to_wgs84((latitude, longitude), [one[0], other[0]], [one[1], other[1]])
    start, stop = zip(latitudes, longitudes, strict=True)
    planned = math.dist(one, other)
    assert distance_m(start, stop) == pytest.approx(planned, rel=0, abs=MILLIMETRE)
    assert all(-180.0 <= lon < 180.0 for lon in longitudes)


@given(
    latitude=st.floats(-90, 90),
    longitude=st.floats(-180, 180),
    heading=st.floats(-1e6, 1e6),
    samples=st.integers(2, 60),
    baseline=st.floats(0.1, 200),
    kind=st.sampled_from(["trimmed", "rectangle", "square", "line"]),
)
def test_any_grid_anywhere_has_its_baseline_on_the_ground(
    latitude, longitude, heading, samples, baseline, kind
):
    if kind == "line":
        samples = min(samples, 10)  # This limits the length of lines to about 2 km.
    sites = grid_at((latitude, longitude), samples, baseline, heading, kind)
    for one, other in neighbours(sites):
        assert distance_m(sites[one], sites[other]) == pytest.approx(
            baseline, rel=0, abs=MILLIMETRE
        )
