"""Reading of positions from files that aosplan has written, and from malicious files."""

import csv
import io
import json

import pytest
from hypothesis import given, settings
from pyproj import Geod
from support.flights import flown_in, grid, missions

from aosplan.cli.app import run
from aosplan.errors import AosplanError, RequestError
from aosplan.geodesy import to_local, to_wgs84
from aosplan.mission.export import formats, render
from aosplan.postflight.positions_file import read_places, read_positions

ENDINGS = {
    "autel": ".kmz",
    "csv": ".csv",
    "dji-fly": ".kmz",
    "geojson": ".geojson",
    "kmz": ".kmz",
    "litchi": ".csv",
    "parrot": ".mavlink",
    "plan": ".plan",
    "waypoints": ".waypoints",
}


def file_of(folder, mission, name):
    path = folder / f"mission{ENDINGS[name]}"
    path.write_bytes(render(flown_in(mission, name), formats()[name]))
    return str(path)


@pytest.mark.parametrize("name", ENDINGS)
@given(mission=missions)
@settings(max_examples=20)
def test_places_read_back_are_the_sites_with_photos(tmp_path_factory, name, mission):
    # For photos while flying, positions are computed from the ends of the lines. The next test
    # checks such photos.
    mission = mission._replace(settings=mission.settings._replace(trigger="stop"))
    path = file_of(tmp_path_factory.mktemp("places"), mission, name)
    found = read_places(path)
    assert len(found) == len(mission.waypoints)
    for place, site in zip(found, mission.waypoints, strict=True):
        # Copter reads degrees of 0 as the current position, so they are written as 1e-7.
        near = 1.001e-7 if 0.0 in (site.latitude, site.longitude) else 1e-8
        assert place.latitude == pytest.approx(site.latitude, rel=0, abs=near)
        assert place.longitude == pytest.approx(site.longitude, rel=0, abs=near)
        # Heights of Litchi have three decimals.
        off = 5.1e-4 if name == "litchi" else 1e-4
        assert place.altitude_m == pytest.approx(site.altitude_m, abs=off)


@pytest.mark.parametrize("trigger", ["stop", "distance"])
@pytest.mark.parametrize("name", ENDINGS)
def test_turning_points_are_left_out(tmp_path, name, trigger):
    photo = [index % 4 != 3 for index in range(12)]
    mission = grid(photo=photo, trigger=trigger)
    found = read_places(file_of(tmp_path, mission, name))
    sites = [site for site in mission.waypoints if site.photo]
    assert len(found) == len(sites) == 9
    for place, site in zip(found, sites, strict=True):
        assert place.latitude == pytest.approx(site.latitude, rel=0, abs=1e-8)
        assert place.longitude == pytest.approx(site.longitude, rel=0, abs=1e-8)


def test_a_mission_without_a_camera_has_its_waypoints(tmp_path):
    content = render(grid(5), formats()["waypoints"]).replace(b"\t203\t", b"\t113\t")
    (tmp_path / "bare.waypoints").write_bytes(content)
    assert len(read_places(str(tmp_path / "bare.waypoints"))) == 5


@pytest.mark.parametrize("name", ["geojson", "plan", "waypoints"])
def test_positions_of_missions_are_metres_from_the_first(tmp_path, name):
    mission = grid(20, origin=(-33.9, -179.9999), baseline_m=7.0)
    found = read_positions(file_of(tmp_path, mission, name))
    ways = mission.waypoints
    for (east, north), x, y in zip(found, ways.east_m, ways.north_m, strict=True):
        assert east == pytest.approx(x - ways.east_m[0], abs=2e-3)
        assert north == pytest.approx(y - ways.north_m[0], abs=2e-3)


@given(mission=missions)
def test_local_metres_are_the_inverse_of_places_on_earth(mission):
    ways = mission.waypoints
    origin = (ways.latitude[0], ways.longitude[0])
    east, north = to_local(origin, ways.latitude, ways.longitude)
    geod = Geod(ellps="WGS84")
    latitude, longitude = to_wgs84(origin, east, north)
    for one, other in zip(
        zip(latitude, longitude, strict=True),
        zip(ways.latitude, ways.longitude, strict=True),
        strict=True,
    ):
        assert geod.inv(one[1], one[0], other[1], other[0])[2] < 1e-6


def test_visibility_accepts_a_mission_as_positions(tmp_path, capsys):
    path = file_of(tmp_path, grid(9, baseline_m=4.0, heading_deg=0.0), "plan")
    line = ["visibility", "--density", "0.5", "--spacing", "4", "--json", "--positions"]
    assert run([*line, path]) == 0
    assert json.loads(capsys.readouterr().out)["samples"] == 9


def test_a_csv_of_positions_leaves_turning_points_out(tmp_path):
    path = tmp_path / "p.csv"
    path.write_text("x,y,photo\n0,0,true\n1,1,false\n2,2,1\n3,3,0\n")
    assert read_positions(str(path)) == [(0.0, 0.0), (2.0, 2.0)]


def test_places_of_a_csv_of_others(tmp_path):
    path = tmp_path / "p.csv"
    path.write_text("Lat,Lng,name\n48.1,14.2,a\n48.2,14.3,b\n")
    assert read_places(str(path)) == [(48.1, 14.2, None), (48.2, 14.3, None)]


# Malicious files

PLAN = '{"mission": {"items": %s}}'
ITEM = '{"type": "SimpleItem", "command": %s, "params": %s}'
GEOJSON = '{"type": "FeatureCollection", "features": %s}'
FEATURE = '{"type": "Feature", "geometry": %s, "properties": {}}'

BAD = {
    "wrong first line.waypoints": ("QGC WPL", "does not begin with QGC WPL 110"),
    "empty.waypoints": ("", "does not begin with"),
    "no rows.waypoints": ("QGC WPL 110\n", "contains no waypoints"),
    "eleven.waypoints": ("QGC WPL 110\n\n1 0 3 16 0 0 0 0 1 2 3\n", "line 3: 11 fields"),
    "letters.waypoints": ("QGC WPL 110\n\n" + "a " * 12, "line 3: command 'a'"),
    "fraction.waypoints": ("QGC WPL 110\n\n1 0 3 16.5 0 0 0 0 1 2 3 1", "not a whole number"),
    "nan.waypoints": ("QGC WPL 110\n\n1 0 3 16 0 0 0 0 nan 2 3 1", "line 3: latitude 'nan'"),
    "huge.waypoints": ("QGC WPL 110\n\n1 0 3 16 0 0 0 0 91 2 3 1", "not a latitude and longitude"),
    "infinite.waypoints": ("QGC WPL 110\n\n1 0 3 1e999 0 0 0 0 1 2 3 1", "command '1e999'"),
    "list.plan": ("[]", "no table of named values"),
    "nothing.plan": ("{}", "it is not a QGroundControl plan"),
    "items.plan": (PLAN % '{"a": 1}', "it is not a QGroundControl plan"),
    "survey.plan": (PLAN % '[{"type": "ComplexItem"}]', "'ComplexItem' is not a SimpleItem"),
    "text.plan": (PLAN % '["SimpleItem"]', "item 1: None is not a SimpleItem"),
    "six.plan": (PLAN % f"[{ITEM % (16, '[0, 0, 0, 0, 1, 2]')}]", "params are not seven values"),
    "null.plan": (PLAN % f"[{ITEM % (16, '[0, 0, 0, 0, null, 2, 3]')}]", "item 1: latitude"),
    "true.plan": (PLAN % f"[{ITEM % ('true', '[0, 0, 0, 0, 1, 2, 3]')}]", "item 1: command"),
    "constant.plan": (PLAN % f"[{ITEM % (16, '[0, 0, 0, 0, NaN, 2, 3]')}]", "NaN is not a number"),
    "deep.plan": ("[" * 100_000, "nested too deeply to be read"),
    "deep.geojson": ('{"a":' * 200 + "1" + "}" * 200, "nested too deeply to be read"),
    "geometry.geojson": ('{"type": "Point", "coordinates": [1, 2]}', "not a GeoJSON"),
    "none.geojson": (GEOJSON % "[]", "contains no positions"),
    "null.geojson": (GEOJSON % f"[{FEATURE % 'null'}]", "contains no positions"),
    "far.geojson": (
        GEOJSON % f"[{FEATURE % json.dumps({'type': 'Point', 'coordinates': [14, 200]})}]",
        "feature 1: 200, 14 is not a latitude and longitude",
    ),
    "one.geojson": (
        GEOJSON % f"[{FEATURE % json.dumps({'type': 'Point', 'coordinates': [14]})}]",
        "coordinates are not longitude",
    ),
    "words.geojson": (
        GEOJSON % f"[{FEATURE % json.dumps({'type': 'LineString', 'coordinates': 'abc'})}]",
        "coordinates are not a list",
    ),
    "header.csv": ("a,b\n1,2\n", "has no columns latitude and longitude"),
    "rows.csv": ("latitude,longitude\n", "contains no positions"),
    "short.csv": ("latitude,longitude\n1\n", "line 2: 1 values are too few"),
    "off.csv": ("lat,lon\n1,181\n", "line 2: 1, 181 is not a latitude and longitude"),
}


@pytest.mark.parametrize("name", BAD)
def test_broken_files_are_refused_at_their_place(tmp_path, name):
    content, words = BAD[name]
    path = tmp_path / name.replace(" ", "-")
    path.write_text(content, encoding="utf-8")
    with pytest.raises(RequestError) as caught:
        read_places(str(path))
    assert words in caught.value.message


@pytest.mark.parametrize("suffix", [".waypoints", ".plan", ".geojson", ".csv"])
def test_bytes_that_are_not_text_are_refused(tmp_path, suffix):
    path = tmp_path / f"noise{suffix}"
    path.write_bytes(bytes(range(256)) * 4)
    with pytest.raises(AosplanError):
        read_places(str(path))
    with pytest.raises(AosplanError, match="no file"):
        read_places(str(tmp_path / f"none{suffix}"))


def test_positions_too_far_apart_are_refused(tmp_path):
    features = [
        {"type": "Feature", "properties": None, "geometry": {"type": "Point", "coordinates": where}}
        for where in ([14.0, 48.0], [-100.0, 48.0])
    ]
    path = tmp_path / "far.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    assert len(read_places(str(path))) == 2
    with pytest.raises(RequestError, match="km from the first"):
        read_positions(str(path))


@pytest.mark.slow
def test_all_of_2500_positions_are_read_from_every_format(tmp_path):
    mission = grid(2500)
    for name in ENDINGS:
        assert len(read_places(file_of(tmp_path, mission, name))) == 2500
    rows = csv.reader(io.StringIO(render(mission, formats()["csv"]).decode()))
    assert sum(1 for _ in rows) == 2501


# Commands with a position


def waypoints(rows):
    home = "0\t1\t0\t16\t0\t0\t0\t0\t48\t14\t300\t1"
    lines = [
        f"{index}\t0\t{frame}\t{command}\t0\t0\t0\t0\t{48 + 1e-4 * index}\t14\t40\t1"
        for index, (command, frame) in enumerate(rows, 1)
    ]
    return "\n".join(["QGC WPL 110", home, *lines, ""])


@pytest.mark.parametrize("command", [16, 17, 18, 19, 31, 82])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_every_command_that_places_the_vehicle_is_a_position(tmp_path, command, encoding):
    path = tmp_path / "a.waypoints"
    path.write_bytes(waypoints([(16, 3), (command, 3), (203, 2), (16, 3)]).encode(encoding))
    places = read_places(str(path))
    photographed = [(48.0002,)]
    assert [(round(place.latitude, 6),) for place in places] == photographed
    path.write_text(waypoints([(16, 3), (command, 0), (command, 10)]))
    assert [round(place.latitude, 6) for place in read_places(str(path))] == [
        48.0001,
        48.0002,
        48.0003,
    ]


def test_unknown_commands_with_a_place_are_named(tmp_path):
    path = tmp_path / "a.waypoints"
    path.write_text(waypoints([(16, 3), (999, 3)]))
    with pytest.raises(RequestError, match="line 4: command 999 is unknown"):
        read_places(str(path))
    # The commands 22, 201 and 21 are take-off, region of interest, and landing.
    path.write_text(waypoints([(22, 3), (201, 3), (16, 3), (21, 3)]))
    assert len(read_places(str(path))) == 1


def test_places_in_metres_of_a_local_frame_are_refused(tmp_path):
    path = tmp_path / "a.waypoints"
    path.write_text(waypoints([(16, 1)]))
    with pytest.raises(RequestError, match="line 3: frame 1 is not one of latitude"):
        read_places(str(path))


def test_blank_rows_of_spreadsheets_are_not_positions(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("east_m,north_m,\r\n1,2,\r\n,,\r\n\r\n3,4,\r\n")
    assert read_positions(str(path)) == [(1.0, 2.0), (3.0, 4.0)]


def points(**more):
    feature = {"type": "Feature", "properties": {"h": float("nan")}}
    feature["geometry"] = {"type": "Point", "coordinates": [14.0, 48.0]} | more
    return {"type": "FeatureCollection", "features": [feature]}


def test_points_of_another_datum_are_refused_and_nan_in_properties_is_not_read(tmp_path):
    path = tmp_path / "a.geojson"
    path.write_text(json.dumps(points()))
    assert read_places(str(path)) == [(48.0, 14.0, None)]
    system = {"crs": {"type": "name", "properties": {"name": "EPSG:4314"}}}
    for table in (points(**system), points() | system):
        path.write_text(json.dumps(table))
        with pytest.raises(RequestError, match="'EPSG:4314' is not WGS 84"):
            read_places(str(path))
