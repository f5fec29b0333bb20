"""Ground heights from rasters, and flights at a constant height above the ground."""

import json
import math
import os
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod
from support.terrains import EAST, LINZ, NORTH, UTM, hills, planned, saved, slope, surface

from aosplan.cli.app import run
from aosplan.errors import InfeasibleError
from aosplan.flight.terrain import Terrain, raised, ways_ground_m
from aosplan.geodesy import to_local, to_wgs84

rasterio = pytest.importorskip("rasterio")
from rasterio.transform import Affine, from_origin  # noqa: E402


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("terrain")


@pytest.fixture(scope="module")
def sloped(folder):
    return saved(folder / "slope.tif", surface(slope))


@pytest.fixture(scope="module")
def hilly(folder):
    return saved(folder / "hills.tif", surface(hills))


# Heights


@settings(max_examples=40)
@given(x=st.floats(-199.4, 199.4), y=st.floats(-199.4, 199.4))
def test_interpolation_of_a_plane_is_exact_between_pixels(sloped, x, y):
    lon, lat = UTM.transform(EAST + x, NORTH + y, direction="INVERSE")
    with Terrain(sloped) as terrain:
        assert terrain.heights_m([lat], [lon])[0] == pytest.approx(slope(x, y), abs=1e-3)


def test_heights_are_bilinear_between_four_pixels(folder):
    corners = np.array([[1.0, 2.0], [4.0, 16.0]], dtype=np.float64)
    with Terrain(saved(folder / "four.tif", corners, pixel=10.0)) as terrain:
        for u in (0.0, 0.25, 1.0):
            for v in (0.0, 0.5, 1.0):
                x, y = -5.0 + 10.0 * u, 5.0 - 10.0 * v
                lon, lat = UTM.transform(EAST + x, NORTH + y, direction="INVERSE")
                true = (1 - v) * ((1 - u) * 1.0 + u * 2.0) + v * ((1 - u) * 4.0 + u * 16.0)
                assert terrain.heights_m([lat], [lon])[0] == pytest.approx(true, abs=1e-5)


def test_rasters_in_degrees_in_metres_and_rotated_give_the_same_heights(folder, sloped):
    # The same plane is in a raster in degrees, and in a raster that is rotated by 30 degrees.
    step, size = 1e-5, 500
    lon = LINZ[1] + (np.arange(size) - 0.5 * (size - 1)) * step
    lat = LINZ[0] - (np.arange(size) - 0.5 * (size - 1)) * step
    x, y = UTM.transform(*np.meshgrid(lon, lat))
    degrees = saved(
        folder / "degrees.tif",
        slope(x - EAST, y - NORTH).astype(np.float32),
        crs="EPSG:4326",
        transform=from_origin(lon[0] - 0.5 * step, lat[0] + 0.5 * step, step, step),
    )
    turn = Affine.translation(EAST, NORTH) * Affine.rotation(30.0) * Affine.scale(1.0, -1.0)
    turn *= Affine.translation(-200.0, -200.0)
    column, row = np.meshgrid(np.arange(400) + 0.5, np.arange(400) + 0.5)
    x, y = turn * (column, row)
    turned = saved(
        folder / "turned.tif", slope(x - EAST, y - NORTH).astype(np.float32), transform=turn
    )
    places = to_wgs84(LINZ, [0.0, 80.0, -60.0, 5.0], [0.0, 90.0, 20.0, -70.0])
    with Terrain(sloped) as one, Terrain(degrees) as two, Terrain(turned) as three:
        assert two.heights_m(*places) == pytest.approx(one.heights_m(*places), abs=2e-3)
        assert three.heights_m(*places) == pytest.approx(one.heights_m(*places), abs=2e-3)
        # The tolerance is for the scale of UTM at this place.
        assert one.pixel_m == pytest.approx(1.0, abs=4e-4)
        assert three.pixel_m == pytest.approx(one.pixel_m)
        # 1e-5 degrees are 1.11 m to the north and 0.74 m to the east. The smaller one is used.
        assert two.pixel_m == pytest.approx(0.742, abs=0.002)


@pytest.mark.parametrize(("unit", "metres"), [("ft", 0.3048), ("US survey foot", 1200 / 3937)])
def test_heights_in_feet_are_converted_to_metres(folder, unit, metres):
    path = saved(folder / "feet.tif", surface(slope), unit=unit)
    with Terrain(path) as terrain:
        assert terrain.heights_m([LINZ[0]], [LINZ[1]])[0] == pytest.approx(300 * metres, abs=1e-3)


def test_scaled_integers_are_converted_to_heights(folder):
    heights = np.round((surface(slope) - 100.0) * 10.0).astype(np.int16)
    path = saved(folder / "scaled.tif", heights, nodata=-32768)
    with rasterio.open(path, "r+") as raster:
        raster.scales, raster.offsets = [0.1], [100.0]
    with Terrain(path) as terrain:
        assert terrain.heights_m([LINZ[0]], [LINZ[1]])[0] == pytest.approx(300.0, abs=0.06)


@pytest.mark.parametrize("west", [179.95, -180.05])
def test_heights_are_read_from_a_raster_across_the_antimeridian(folder, west):
    rows, columns = np.mgrid[0:200, 0:200]
    heights = (500.0 + 0.5 * columns + 0.0 * rows).astype(np.float32)
    path = saved(
        folder / "fiji.tif",
        heights,
        crs="EPSG:4326",
        transform=from_origin(west, -16.45, 5e-4, 5e-4),
    )
    with Terrain(path) as terrain:
        # Column 100 begins at 180 degrees.
        found = terrain.heights_m([-16.5] * 3, [179.99975, -179.99975, 180.0])
        assert found == pytest.approx([549.5, 550.0, 549.75], abs=1e-3)
    result = planned(origin=(-16.5, 180.0), terrain=path)
    assert all(549.0 < height < 550.5 for height in result.waypoints.ground_m)


def test_a_raster_with_a_vertical_datum_names_it(folder):
    path = saved(folder / "datum.tif", surface(slope), crs="EPSG:32633+5773")
    with Terrain(path) as terrain:
        assert terrain.datum == "EGM96 height"
        assert terrain.heights_m([LINZ[0]], [LINZ[1]])[0] == pytest.approx(300.0, abs=1e-3)


@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="no /proc")
def test_only_the_needed_part_of_a_huge_raster_is_read(folder):
    # 60,000 x 60,000 heights would need 14 GB; only tiles that are written are stored.
    path, size = str(folder / "huge.tif"), 60_000
    west, top = EAST - 0.5 * size, NORTH + 0.5 * size
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        width=size,
        height=size,
        count=1,
        dtype="float32",
        crs="EPSG:32633",
        transform=from_origin(west, top, 1.0, 1.0),
        tiled=True,
        sparse_ok=True,
    ) as raster:
        near = rasterio.windows.Window(size // 2 - 200, size // 2 - 200, 400, 400)
        raster.write(surface(slope), 1, window=near)
    code = (
        "from aosplan import PlanRequest, plan\n"
        f"r = plan(PlanRequest(altitude=40, origin={LINZ}, terrain={path!r}))\n"
        "print(r.waypoints.ground_m[0])\n"
        # This is the peak memory of the program alone. ru_maxrss would include the memory of its
        # parent.
        "status = open('/proc/self/status').read()\n"
        "print(status.split('VmHWM:')[1].split()[0])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    height, kilobytes = done.stdout.split()
    assert 290.0 < float(height) < 310.0
    assert int(kilobytes) < 1_000_000
    # Distant points are read in parts.
    with Terrain(path) as terrain:
        lon, lat = UTM.transform(
            [EAST, EAST + 29e3, EAST - 29e3],
            [NORTH, NORTH + 29e3, NORTH - 29e3],
            direction="INVERSE",
        )
        assert terrain.heights_m(lat, lon) == pytest.approx([300.0, 0.0, 0.0], abs=1e-3)


# Flights over terrain


def true_ground(function, waypoints, result):
    lat, lon = result.waypoints.latitude, result.waypoints.longitude
    x, y = UTM.transform(lon, lat)
    return [float(function(a - EAST, b - NORTH)) for a, b in zip(x, y, strict=True)]


@pytest.mark.parametrize("trigger", ["stop", "distance"])
def test_every_waypoint_keeps_its_height_above_the_ground(hilly, trigger):
    result = planned(terrain=hilly, trigger=trigger, heading=25)
    ways = result.waypoints
    # The raster's pixels of 1 m flatten the hills by at most 12 / 17² / 8 m.
    assert ways.ground_m == pytest.approx(true_ground(hills, ways, result), abs=0.01)
    assert set(ways.altitude_m) == {40.0}
    above = result.mission().above_takeoff_m()
    assert above == pytest.approx(
        [40.0 + ground - result.route.takeoff_ground_m for ground in ways.ground_m]
    )
    assert result.mission().settings.takeoff_ground_m == ways.ground_m[0]


@given(
    baseline=st.floats(2.0, 25.0),
    tolerance=st.sampled_from([0.5, 2.0, 6.0]),
    trigger=st.sampled_from(["stop", "distance"]),
    heading=st.floats(0.0, 360.0),
)
def test_the_path_between_waypoints_keeps_the_height_within_the_tolerance(
    hilly, baseline, tolerance, trigger, heading
):
    result = planned(
        terrain=hilly,
        baseline=baseline,
        samples=16,
        terrain_tolerance=tolerance,
        trigger=trigger,
        heading=heading,
    )
    ways = list(result.waypoints)
    nearest = math.inf
    for one, other in pairwise(ways):
        for share in np.linspace(0.0, 1.0, 200):
            lat = one.latitude + share * (other.latitude - one.latitude)
            lon = one.longitude + share * (other.longitude - one.longitude)
            x, y = UTM.transform(lon, lat)
            level = (1 - share) * one.ground_m + share * other.ground_m + 40.0
            nearest = min(nearest, level - float(hills(x - EAST, y - NORTH)))
    # Because places are checked every half pixel, and because of the size of pixels, errors of a
    # few cm are possible.
    assert nearest >= 40.0 - tolerance - 0.05
    assert result.document()["height"]["nearest_m"] == pytest.approx(nearest, abs=0.05)
    photos = [way for way in ways if way.photo]
    flat = planned(baseline=baseline, samples=16, trigger=trigger, heading=heading)
    assert [(w.east_m, w.north_m) for w in photos] == [
        (w.east_m, w.north_m) for w in flat.waypoints if w.photo
    ]


def test_waypoints_are_added_only_where_the_path_is_too_low(hilly):
    counts = [
        len(planned(terrain=hilly, baseline=25, samples=16, terrain_tolerance=t).waypoints)
        for t in (0.2, 2.0, 8.0, 100.0)
    ]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > counts[-1] == 16


def test_the_tolerance_is_limited_by_the_clearance(hilly):
    # At 22.5 m, half a metre remains above 20.04 m of canopy and 2 m of clearance.
    low = planned(altitude=22.5, terrain=hilly, baseline=25, samples=16, terrain_tolerance=50)
    nearest = low.document()["height"]["nearest_m"]
    assert nearest >= low.scene.canopy_top_m + 2.0


def test_climbs_increase_the_flight_time(sloped):
    # The slope is 10 % to the north and 20 % to the east.
    flat = planned(baseline=20, samples=16, grid="line", heading=90)
    steep = planned(baseline=20, samples=16, grid="line", heading=90, terrain=sloped)
    slow = planned(baseline=20, samples=16, grid="line", heading=90, terrain=sloped, climb=0.5)
    assert flat.route.time_s < steep.route.time_s < slow.route.time_s
    # There are 15 legs. Each is about 20 m long and rises by about 4 m (about, because grid north
    # is not true north). At a climb rate of 0.5 m/s, each leg also needs v/a to accelerate.
    ground = true_ground(slope, slow.waypoints, slow)
    rise = (ground[-1] - ground[0]) / 15
    assert rise == pytest.approx(4.0, abs=0.05)
    speed = 0.5 * math.hypot(20.0, rise) / rise
    assert slow.route.time_s == pytest.approx(15 * (rise / 0.5 + speed / 2.0) + 16, rel=1e-4)


def test_the_height_of_a_given_takeoff_is_read_from_the_terrain(sloped):
    east, north = 120.0, -60.0
    (lat,), (lon,) = to_wgs84(LINZ, [east], [north])
    result = planned(terrain=sloped, takeoff=(lat, lon))
    x, y = UTM.transform(lon, lat)
    assert result.route.takeoff_ground_m == pytest.approx(slope(x - EAST, y - NORTH), abs=0.01)
    assert result.settings.takeoff_latitude == lat
    assert to_local(LINZ, [lat], [lon])[0][0] == pytest.approx(east, abs=1e-6)


def test_without_a_takeoff_a_warning_says_where_to_take_off(hilly):
    result = planned(terrain=hilly, flight_time=2)
    first = result.waypoints[0]
    (warning,) = [w.message for w in result.warnings if w.code == "takeoff_assumed"]
    assert f"{first.ground_m:.1f} m" in warning
    # The files of all flights have the same take-off point. Their heights therefore have the same
    # reference.
    for mission in result.missions():
        place = mission.settings.takeoff_latitude, mission.settings.takeoff_longitude
        assert place == pytest.approx((first.latitude, first.longitude), abs=1e-9)
        assert mission.settings.takeoff_ground_m == first.ground_m
    assert planned().settings.takeoff_latitude is None


def test_the_drone_climbs_above_a_hill_on_its_way_from_the_takeoff(folder):
    ridge = surface(lambda x, y: 300.0 + 45.0 * np.exp(-(((x - 100.0) / 10.0) ** 2)) + 0.0 * y)
    path = saved(folder / "ridge.tif", ridge)
    (lat,), (lon,) = to_wgs84(LINZ, [170.0], [0.0])
    far = planned(terrain=path, takeoff=(lat, lon))
    codes = {w.code: w.message for w in far.warnings}
    assert "takeoff_assumed" not in codes
    # The ridge is at 300 m. The transit is above it by the height of the canopy plus the clearance.
    (flight,) = far.route.flights
    expected = 45.0 + far.scene.canopy_top_m + 2.0
    assert flight.climb_m == pytest.approx(expected, abs=0.3)
    assert flight.return_m == pytest.approx(expected, abs=0.3)
    assert "transit_above_120_m" not in codes
    near = planned(terrain=path, takeoff=LINZ)
    assert near.route.flights[0].climb_m == pytest.approx(40.0, abs=0.3)
    assert far.route.flights[0].time_s > near.route.flights[0].time_s
    with Terrain(path) as terrain:
        lowest, highest = ways_ground_m(
            terrain, LINZ, (0.0, 0.0), [170.0, 0.0, 0.0], [0.0, 0.0, 40.0]
        )
    assert highest == pytest.approx([345, 300, 300], abs=0.2)
    assert lowest == pytest.approx([300, 300, 300], abs=0.2)


def test_a_path_high_above_a_valley_gives_a_warning(folder):
    ridge = surface(lambda x, y: 300.0 + 110.0 * np.exp(-(((x - 100.0) / 10.0) ** 2)) + 0.0 * y)
    path = saved(folder / "high.tif", ridge)
    (lat,), (lon,) = to_wgs84(LINZ, [170.0], [0.0])
    codes = {w.code for w in planned(terrain=path, takeoff=(lat, lon)).warnings}
    assert "transit_above_120_m" in codes


def test_heights_above_valleys_are_compared_with_120_metres(folder):
    valley = surface(lambda x, y: 300.0 - 60.0 * (abs(y) < 20.0) + 0.0 * x)
    path = saved(folder / "valley.tif", valley)
    flat = planned(altitude=100, baseline=60, samples=4)
    deep = planned(altitude=100, baseline=60, samples=4, terrain=path)
    assert "above_120_m" not in {warning.code for warning in flat.warnings}
    assert "above_120_m" in {warning.code for warning in deep.warnings}
    assert deep.document()["height"]["farthest_m"] == pytest.approx(160.0, abs=0.1)


@settings(max_examples=100)
@given(
    heights=st.lists(st.floats(-50.0, 50.0), min_size=2, max_size=40),
    tolerance=st.floats(0.0, 20.0),
)
def test_no_ground_is_above_the_path_by_more_than_the_tolerance(heights, tolerance):
    profile, along = np.array(heights), np.linspace(0.0, 1.0, len(heights))
    knots = raised(along, profile, tolerance)
    assert knots[0] == 0
    assert knots[-1] == len(heights) - 1
    assert knots == sorted(set(knots))
    rise = profile - np.interp(along, along[knots], profile[knots])
    assert rise.max() <= tolerance + 1e-9


# The command line


@pytest.mark.parametrize(("value", "holds"), [("0.2", True), ("100", False)])
def test_options_of_terrain_have_their_effect(folder, hilly, capsys, value, holds):
    line = ["plan", "--altitude", "40", "--origin", "48.3358,14.3261", "--baseline", "25"]
    line += ["--samples", "16", "--terrain", hilly, "--terrain-tolerance", value, "--json"]
    assert run(line) == 0
    document = json.loads(capsys.readouterr().out)
    assert (len(document["waypoints"]) > 16) is holds
    assert all("ground_m" in waypoint for waypoint in document["waypoints"])
    assert "terrain file" in document["height"]["ground"]


def test_the_table_names_the_reference_of_heights(hilly, capsys):
    line = ["plan", "--altitude", "40", "--origin", "48.3358,14.3261", "--terrain", hilly]
    assert run(line) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "Terrain 29" in text
    assert "the flight is at least" in text


def test_terrain_is_looked_for_beside_the_request(folder, hilly, capsys):
    (folder / "r.toml").write_text(
        'altitude = 40\norigin = [48.3358, 14.3261]\nterrain = "hills.tif"\n'
    )
    assert run(["plan", str(folder / "r.toml"), "--json"]) == 0
    assert "ground_m" in json.loads(capsys.readouterr().out)["waypoints"][0]


def test_without_the_optional_dependency_the_message_names_it(monkeypatch, hilly, capsys):
    monkeypatch.setitem(sys.modules, "rasterio", None)
    line = ["plan", "--altitude", "40", "--origin", "48.3358,14.3261", "--terrain", hilly]
    assert run(line) == 2
    assert 'pip install "aosplan[raster]"' in capsys.readouterr().err


# Locations


@given(
    latitude=st.floats(-89.0, 89.0),
    longitude=st.floats(-180.0, 180.0),
    east=st.floats(-2e4, 2e4),
    north=st.floats(-2e4, 2e4),
)
def test_local_metres_are_the_inverse_of_places(latitude, longitude, east, north):
    there = to_wgs84((latitude, longitude), [east], [north])
    (x,), (y,) = to_local((latitude, longitude), *there)
    assert (x, y) == pytest.approx((east, north), abs=1e-6)
    _, _, distance = Geod(ellps="WGS84").inv(longitude, latitude, there[1][0], there[0][0])
    assert distance == pytest.approx(math.hypot(east, north), abs=1e-6)


def test_flights_over_terrain_begin_and_end_at_photos(hilly):
    values = {"terrain": hilly, "baseline": 25, "samples": 16, "terrain_tolerance": 0.2}
    whole, split = planned(**values), planned(**values, flight_time=3.0)
    assert len(split.route.flights) > 1
    photos = [[(w.east_m, w.north_m) for w in r.waypoints if w.photo] for r in (whole, split)]
    assert photos[0] == photos[1]
    assert len(split.waypoints) < len(whole.waypoints)
    for mission in split.missions():
        assert mission.waypoints[0].photo
        assert mission.waypoints[len(mission.waypoints) - 1].photo
    with pytest.raises(InfeasibleError):
        planned(**values, flight_time=0.3)
