"""Programs for maps read the written files: GDAL, fastkml with the OGC schema, geojson, and
litchi-wp.

If a program is not installed, its tests are skipped.
"""

import io
import shutil
import struct
import subprocess
import warnings
import zipfile

import pytest
from support.flights import SUMMARY, grid

from aosplan.mission.export import formats, render

MISSIONS = {
    "linz": grid(50),
    "dateline": grid(20, origin=(-16.5, 180.0), heading_deg=90.0),
    "pole": grid(9, origin=(90.0, 0.0)),
    "turns": grid(12, photo=[index % 4 != 3 for index in range(12)], ground_m=[321.5] * 12),
    "single": grid(1),
    "named": grid(5)._replace(summary=SUMMARY | {"scene": {"name": "<b>a & b</b> ]]> \x00"}}),
}


def client(name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return pytest.importorskip(name)


def check_sites(found, mission):
    """Check latitude, longitude and altitude of the sites, in order."""
    assert len(found) == len(mission.waypoints)
    for (latitude, longitude, altitude), site in zip(found, mission.waypoints, strict=True):
        assert abs(latitude - site.latitude) <= 1e-7
        assert abs(longitude - site.longitude) <= 1e-7
        assert abs(altitude - site.altitude_m) <= 1e-3


def gdal_points(path, **options):
    """Latitude, longitude and altitude of the points that GDAL reads from the first layer."""
    raw = client("pyogrio.raw")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        _, _, geometry, _ = raw.read(path, **options)
    points = []
    for blob in geometry:
        (kind,) = struct.unpack_from("<I", blob, 1)
        if kind in {1, 0x80000001, 1001}:
            values = struct.unpack_from(f"<{(len(blob) - 5) // 8}d", blob, 5)
            points.append((values[1], values[0], values[2] if len(values) > 2 else 0.0))
    return points


@pytest.mark.parametrize("name", MISSIONS)
@pytest.mark.parametrize("form", ["geojson", "kml"])
def test_gdal_reads_points_in_order(tmp_path, name, form):
    path = tmp_path / f"mission.{form}"
    path.write_bytes(render(MISSIONS[name], formats()[form]))
    layer = {"layer": "waypoints"} if form == "kml" else {}
    check_sites(gdal_points(path, **layer), MISSIONS[name])


@pytest.mark.parametrize("name", MISSIONS)
def test_gdal_reads_csv(tmp_path, name):
    path = tmp_path / "mission.csv"
    path.write_bytes(render(MISSIONS[name], formats()["csv"]))
    columns = {"X": "longitude", "Y": "latitude", "Z": "altitude_m"}
    options = {f"{axis}_POSSIBLE_NAMES": column for axis, column in columns.items()}
    check_sites(gdal_points(path, **options), MISSIONS[name])


@pytest.mark.parametrize("member", ["template.kml", "waylines.wpml"])
def test_gdal_reads_both_documents_of_wpml(tmp_path, member):
    mission = MISSIONS["linz"]
    archive = zipfile.ZipFile(io.BytesIO(render(mission, formats()["kmz"])))
    path = tmp_path / f"{member}.kml"
    path.write_bytes(archive.read(f"wpmz/{member}"))
    found = gdal_points(path)
    # WPML has heights in separate elements.
    check_sites([(latitude, longitude, 40.0) for latitude, longitude, _ in found], mission)


@pytest.mark.parametrize("name", MISSIONS)
def test_kml_is_valid_by_the_ogc_schema(name, tmp_path):
    client("lxml.etree")
    client("fastkml")
    from fastkml import validator

    path = tmp_path / "mission.kml"
    path.write_bytes(render(MISSIONS[name], formats()["kml"]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert validator.validate(file_to_validate=path)
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace("<altitudeMode>relative", "<altitudeMode>above", 1))
        with pytest.raises(AssertionError):
            validator.validate(file_to_validate=path)


@pytest.mark.parametrize("name", MISSIONS)
def test_fastkml_reads_the_sites(name, tmp_path):
    client("fastkml")
    from fastkml import KML, Placemark
    from fastkml.utils import find_all

    path = tmp_path / "mission.kml"
    path.write_bytes(render(MISSIONS[name], formats()["kml"]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        document = KML.parse(path)
        marks = [mark for mark in find_all(document, of_type=Placemark) if mark.name != "path"]
        found = [mark.geometry.coords[0] for mark in marks]
    check_sites([(latitude, longitude, up) for longitude, latitude, up in found], MISSIONS[name])


@pytest.mark.skipif(shutil.which("xmllint") is None, reason="needs xmllint")
@pytest.mark.parametrize("name", MISSIONS)
def test_xmllint_finds_the_documents_well_formed(name):
    content = render(MISSIONS[name], formats()["kml"])
    done = subprocess.run(["xmllint", "--noout", "-"], input=content, check=False)
    assert done.returncode == 0


@pytest.mark.parametrize("name", MISSIONS)
def test_the_geojson_package_finds_it_valid(name, monkeypatch):
    geojson = client("geojson")
    monkeypatch.setattr("geojson.geometry.DEFAULT_PRECISION", 15)
    collection = geojson.loads(render(MISSIONS[name], formats()["geojson"]))
    assert collection.is_valid, collection.errors()
    points = [f.geometry for f in collection.features if f.geometry["type"] == "Point"]
    assert all(point.is_valid for point in points)
    found = [(y, x, z) for x, y, z in (point["coordinates"] for point in points)]
    check_sites(found, MISSIONS[name])


@pytest.mark.parametrize("trigger", ["stop", "distance"])
@pytest.mark.parametrize("name", sorted(set(MISSIONS) - {"turns"}))
def test_litchi_wp_reads_every_row(tmp_path, name, trigger):
    client("litchi_wp")
    from litchi_wp.enums import ActionType, GimbalMode
    from litchi_wp.waypoint import Waypoint

    settings = MISSIONS[name].settings._replace(trigger=trigger, hold_s=0.35)
    mission = MISSIONS[name]._replace(settings=settings)
    path = tmp_path / "mission.csv"
    path.write_bytes(render(mission, formats()["litchi"]))
    assert path.read_text().splitlines()[0] == Waypoint.get_header(None)
    # The program prints and skips rows that it does not understand. The rows are therefore counted.
    read = Waypoint.from_file(str(path))
    if trigger == "stop":
        check_sites([(site.lat, site.lon, site.altitude.value) for site in read], mission)
    for site in read:
        assert site.gimbal.mode is GimbalMode.INTERPOLATE
        assert site.gimbal.pitchangle == -90
        assert site.heading == pytest.approx(settings.yaw_deg, abs=0.01)
        actions = [(a.type, a.param) for a in site.actions if a.type is not ActionType.NO_ACTION]
        if trigger == "stop":
            assert actions == [
                (ActionType.TILT_CAMERA, -90.0),
                (ActionType.STAY_FOR, 350.0),
                (ActionType.TAKE_PHOTO, 0.0),
            ]
            assert site.photo.distance_interval == -1
    if trigger == "distance" and len(read) > 2:
        assert any(site.photo.distance_interval == pytest.approx(3.0) for site in read)


def test_litchi_wp_skips_numbers_with_exponents(tmp_path):
    client("litchi_wp")
    from litchi_wp.waypoint import Waypoint

    path = tmp_path / "mission.csv"
    content = render(MISSIONS["linz"], formats()["litchi"]).replace(b",40.000,", b",4e1,", 1)
    path.write_bytes(content)
    assert len(Waypoint.from_file(str(path))) == 49
