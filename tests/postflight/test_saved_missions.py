"""Missions that are read back: routes in zips, Litchi's photos, map files, and malicious files."""

import csv
import io
import json
import zipfile

import pytest
from support.flights import flown_in, grid, written

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.postflight.positions_file import read_places


def kmz(tmp_path, waylines, name="wpmz/waylines.wpml"):
    path = tmp_path / "route.kmz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(name, waylines)
    return str(path)


PHOTO = [True, False, True, True, False, True, True, True, True]


@pytest.mark.parametrize(("name", "ending"), [("kmz", ".kmz"), ("litchi", ".csv")])
@pytest.mark.parametrize("trigger", ["stop", "distance"])
def test_waypoints_without_a_photo_are_not_positions(tmp_path, name, ending, trigger):
    mission = grid(9, kind="line", photo=PHOTO, trigger=trigger)
    path = tmp_path / f"m{ending}"
    path.write_bytes(written(mission, name))
    sites = [way for way in mission.waypoints if way.photo]
    found = read_places(str(path))
    assert [(round(p.latitude, 9), round(p.longitude, 9)) for p in found] == [
        (round(way.latitude, 9), round(way.longitude, 9)) for way in sites
    ]


def test_a_route_without_photos_is_all_of_its_waypoints(tmp_path):
    mission = flown_in(grid(4, photo=[False] * 4), "dji-fly")
    path = tmp_path / "m.kmz"
    path.write_bytes(written(mission, "dji-fly"))
    assert len(read_places(str(path))) == 4


@pytest.mark.parametrize(
    ("waylines", "words"),
    [
        ("<kml>", "not valid XML"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><kml/>", "document type"),
        ("<kml/>", "contains no positions"),
        ("<a>" * 100 + "</a>" * 100, "nested too deeply to be read"),
        ("<kml><Placemark><index>0</index></Placemark></kml>", "waypoint 0 has no coordinates"),
        (
            "<kml><Placemark><coordinates>14,97</coordinates></Placemark></kml>",
            "waypoint 0: 97, 14 is",
        ),
        (
            "<kml><Placemark><coordinates>1,2</coordinates><actionGroup>"
            "<actionGroupStartIndex>x</actionGroupStartIndex>"
            "<actionActuatorFunc>takePhoto</actionActuatorFunc></actionGroup></Placemark></kml>",
            "actionGroupStartIndex",
        ),
    ],
)
def test_invalid_routes_are_refused(tmp_path, waylines, words):
    with pytest.raises(RequestError) as caught:
        read_places(kmz(tmp_path, waylines))
    assert words in caught.value.message


def test_an_archive_without_a_route_is_refused(tmp_path):
    with pytest.raises(RequestError, match=r"contains no waylines\.wpml"):
        read_places(kmz(tmp_path, "<kml/>", "doc.kml"))
    (tmp_path / "plain.kmz").write_bytes(b"<kml/>")
    with pytest.raises(RequestError, match="is not a KMZ archive"):
        read_places(str(tmp_path / "plain.kmz"))


@pytest.mark.parametrize(
    ("name", "ending"),
    [("kmz", ".kmz"), ("plan", ".plan"), ("waypoints", ".waypoints"), ("litchi", ".csv")],
)
def test_a_mission_file_is_exported_as_a_map(tmp_path, capsys, name, ending):
    mission = grid(9)
    path = tmp_path / f"m{ending}"
    path.write_bytes(written(mission, name))
    outs = ["--out", str(tmp_path / "map.geojson"), "--out", f"csv:{tmp_path / 'sites.txt'}"]
    assert run(["export", str(path), *outs]) == 0
    points = [
        feature["geometry"]["coordinates"]
        for feature in json.loads((tmp_path / "map.geojson").read_text())["features"]
        if feature["geometry"]["type"] == "Point"
    ]
    assert len(points) == 9
    for point, way in zip(points, mission.waypoints, strict=True):
        assert point == pytest.approx([way.longitude, way.latitude, 40.0], abs=1e-7)
    rows = list(csv.DictReader(io.StringIO((tmp_path / "sites.txt").read_text())))
    east = [float(row["east_m"]) for row in rows]
    ways = mission.waypoints
    assert east == pytest.approx([e - ways.east_m[0] for e in ways.east_m], abs=2e-3)
    assert run(["export", str(path), "--out", str(tmp_path / "again.waypoints")]) == 2
    assert "also needs speeds and the camera" in capsys.readouterr().err


def test_review_and_thin_accept_wpml_routes(tmp_path, capsys):
    line = ["plan", "--altitude", "40", "--origin", "48.3358,14.3261", "--drone", "dji-m3t"]
    assert run([*line, "--out", str(tmp_path / "g.kmz"), "--json"]) == 0
    (tmp_path / "plan.json").write_text(capsys.readouterr().out)
    files = [str(tmp_path / "g.kmz"), str(tmp_path / "plan.json")]
    assert run(["review", *files]) == 0
    assert "Sites           50 of 50 have a photo" in capsys.readouterr().out
    assert run(["thin", *files, "--samples", "25", "--json"]) == 0
