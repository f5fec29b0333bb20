"""Outlines from files: supported content is read, and all other content gives one clear error."""

import io
import json
import resource
import struct
import zipfile
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aosplan.areas import boundary_file as area_file
from aosplan.areas.boundary_file import read_outline
from aosplan.errors import AosplanError, RequestError

SQUARE = [[14.0, 48.0], [14.01, 48.0], [14.01, 48.01], [14.0, 48.01], [14.0, 48.0]]
HOLE = [[14.002, 48.002], [14.004, 48.002], [14.004, 48.004], [14.002, 48.004], [14.002, 48.002]]
POLYGON = {"type": "Polygon", "coordinates": [SQUARE, HOLE]}


@pytest.fixture
def file(tmp_path):
    """A function that writes any content to a file and returns its path."""

    def write(content, name="area.geojson"):
        if not isinstance(content, (str, bytes)):
            content = json.dumps(content)
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return str(path)

    return write


def kml(*polygons, inside="", head='<?xml version="1.0"?>'):
    parts = "".join(f"<Placemark><Polygon>{rings}</Polygon></Placemark>" for rings in polygons)
    space = 'xmlns="http://www.opengis.net/kml/2.2"'
    return f"{head}<kml {space}><Document>{inside}{parts}</Document></kml>"


def boundary(ring, kind="outer", height=",12.5"):
    text = " \n".join(f"{x},{y}{height}" for x, y in ring)
    ring = f"<LinearRing><coordinates>{text}</coordinates></LinearRing>"
    return f"<{kind}BoundaryIs>{ring}</{kind}BoundaryIs>"


def kmz(members, **options):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, **options) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


# Supported content


def rings_of(path):
    return [[ring.tolist() for ring in rings] for rings in read_outline(path).polygons]


FORMS = {
    "polygon": (POLYGON, [[SQUARE, HOLE]]),
    "multipolygon": (
        {"type": "MultiPolygon", "coordinates": [[SQUARE], [HOLE]]},
        [[SQUARE], [HOLE]],
    ),
    "feature": ({"type": "Feature", "properties": None, "geometry": POLYGON}, [[SQUARE, HOLE]]),
    "collection": (
        {
            "type": "FeatureCollection",
            "features": [
                {"type": "Feature", "properties": {}, "geometry": None},
                {
                    "type": "Feature",
                    "properties": {},
                    "geometry": {
                        "type": "GeometryCollection",
                        "geometries": [POLYGON, {"type": "Point", "coordinates": [1, 2]}],
                    },
                },
            ],
        },
        [[SQUARE, HOLE]],
    ),
    "with heights": (
        {"type": "Polygon", "coordinates": [[[*position, 300.0] for position in SQUARE]]},
        [[SQUARE]],
    ),
    "kml": (kml(boundary(HOLE, "inner") + boundary(SQUARE)), [[SQUARE, HOLE]]),
    "kml of two": (kml(boundary(SQUARE), boundary(HOLE)), [[SQUARE], [HOLE]]),
    "kml without heights": (kml(boundary(SQUARE, height="")), [[SQUARE]]),
    "kml in UTF-16": (
        kml(boundary(SQUARE), head='<?xml version="1.0" encoding="UTF-16"?>').encode("utf-16"),
        [[SQUARE]],
    ),
    "kmz": (kmz({"doc.kml": kml(boundary(SQUARE)), "a/b.png": "x"}), [[SQUARE]]),
    "kmz of another name": (kmz({"files/x.KML": kml(boundary(SQUARE))}), [[SQUARE]]),
    "with a byte order mark": ("\ufeff" + json.dumps(POLYGON), [[SQUARE, HOLE]]),
    "an old crs of degrees": (
        POLYGON
        | {"crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}},
        [[SQUARE, HOLE]],
    ),
}


@pytest.mark.parametrize("name", FORMS)
def test_polygons_are_read_from_every_form_and_extension(file, name):
    content, rings = FORMS[name]
    assert rings_of(file(content, "area.dat")) == rings


def test_objects_without_an_area_are_counted(file):
    points = [{"type": "Point", "coordinates": [0, 0]}] * 2
    table = {"type": "GeometryCollection", "geometries": [*points, POLYGON]}
    assert read_outline(file(table)).ignored == {"Point": 2}
    inside = "<Placemark><LineString><coordinates>1,2 3,4</coordinates></LineString></Placemark>"
    assert read_outline(file(kml(boundary(SQUARE), inside=inside))).ignored == {"LineString": 1}


@given(st.lists(st.tuples(st.floats(-180, 180), st.floats(-90, 90)), min_size=3, max_size=30))
def test_coordinates_from_geojson_and_kml_are_exact_to_the_last_bit(tmp_path_factory, places):
    ring = [list(place) for place in [*places, places[0]]]
    path = tmp_path_factory.mktemp("rings") / "ring"
    for content in (
        json.dumps({"type": "Polygon", "coordinates": [ring]}),
        kml(boundary(ring)),
    ):
        path.write_text(content)
        assert np.array_equal(read_outline(str(path)).polygons[0][0], ring)


# All other content gives one clear error


def polygon_of(ring):
    return {"type": "Polygon", "coordinates": [ring]}


def changed(index, position):
    return polygon_of([*SQUARE[:index], position, *SQUARE[index + 1 :]])


ENTITY = '<!DOCTYPE kml [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]>'
EXTERNAL = '<!DOCTYPE kml SYSTEM "file:///etc/passwd">'

WRONG = {
    "empty": (b"", "is neither GeoJSON, KML nor KMZ"),
    "text": ("lat,lon\n1,2\n", "is neither GeoJSON, KML nor KMZ"),
    "a shapefile": (b"\x00\x00\x27\x0a" + bytes(96), "but its name does not have the extension of a vector file"),
    "broken JSON": ('{"type": "Polygon"', "is not valid JSON"),
    "a list": ("[]", "contains no table"),
    "not GeoJSON": ({"a": 1}, "has type 'None'"),
    "an unknown type": ({"type": "Circle"}, "has type 'Circle'"),
    "a type that is a list": ({"type": ["Polygon"]}, "which is not a type of GeoJSON"),
    "NaN": ('{"type": "Polygon", "coordinates": [[[NaN, 1]]]}', "0.0: nan, 1 is not a longitude"),
    "infinity": ('{"type": "Polygon", "coordinates": [[[1e999, 1]]]}', "0.0.0 is too large a number"),
    "a huge whole number": (
        json.dumps(polygon_of([[10**400, 1]] * 4)),
        "coordinates.0.0.0 is too large a number",
    ),
    "text in numbers": (changed(1, ["14.01", "48"]), "coordinates.0.1: "),
    "true in numbers": (changed(1, [True, 48.0]), "coordinates.0.1: "),
    "one coordinate": (changed(2, [14.01]), "coordinates.0.2: '[14.01]' is not a longitude"),
    "no coordinates": ({"type": "Polygon"}, "coordinates is empty"),
    "no rings": ({"type": "Polygon", "coordinates": []}, "coordinates is empty"),
    "an empty ring": (polygon_of([]), "coordinates.0 is empty"),
    "a ring that is a number": (polygon_of(5), "coordinates.0 is not a list"),
    "coordinates that are text": ({"type": "Polygon", "coordinates": "abc"}, "is empty"),
    "no members": ({"type": "MultiPolygon", "coordinates": []}, "coordinates is empty"),
    "features that are none": ({"type": "FeatureCollection", "features": 3}, "is not a list"),
    "an empty collection": ({"type": "FeatureCollection", "features": []}, "contains no polygon"),
    "a point": ({"type": "Point", "coordinates": [14, 48]}, "only 1 Point, without area"),
    "a line": ({"type": "LineString", "coordinates": SQUARE}, "only 1 LineString, without area"),
    "not closed": (polygon_of(SQUARE[:-1]), "is not closed: it ends at 14, 48.01"),
    "two positions": (polygon_of([SQUARE[0], SQUARE[1], SQUARE[0]]), "but a closed ring has at least 4"),
    "off the globe": (changed(1, [181.0, 48.0]), "coordinates.0.1: 181, 48 is not a longitude"),
    "below the south pole": (changed(1, [14.0, -90.1]), "14, -90.1 is not a longitude"),
    "metres": (changed(1, [1.6e6, 6.1e6]), "1600000, 6100000 is not a longitude"),
    "another crs": (
        POLYGON | {"crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}}},
        "is not WGS 84",
    ),
    "nested too deep": ("[" * 100 + "]" * 100, "nested too deeply to be read"),
    "nested far too deep": ('{"a":' + "[" * 10**5 + "]" * 10**5 + "}", "nested too deeply to be read"),
    "broken XML": ("<kml><Document></kml>", "is not valid XML"),
    "other XML": ("<html><body/></html>", "is XML, but not KML: it begins with <html>"),
    "KML without a polygon": (kml(), "contains no polygon"),
    "KML with a point": (
        kml(inside="<Placemark><Point><coordinates>1,2</coordinates></Point></Placemark>"),
        "only 1 Point, without area",
    ),
    "blanks after commas": (
        kml(boundary(SQUARE).replace("14.01,48.0,", "14.01, 48.0,")),
        "polygon 1: '14.01,' is not a longitude and a latitude",
    ),
    "four coordinates": (kml(boundary(SQUARE, height=",1,2")), "is not a longitude"),
    "KML nan": (kml(boundary([["nan", 1], *SQUARE[1:]])), "polygon 1.0: nan, 1 is not a longitude"),
    "KML that is not closed": (kml(boundary(SQUARE), boundary(SQUARE[:-1])), "polygon 2 is not closed"),
    "KML with an empty ring": (kml(boundary([])), "polygon 1 is empty"),
    "KML without a shell": (kml(boundary(HOLE, "inner")), "polygon 1 has 0 outer boundaries"),
    "KML with two shells": (kml(boundary(SQUARE) * 2), "polygon 1 has 2 outer boundaries"),
    "an entity bomb": (kml(boundary(SQUARE), head=ENTITY), "has a document type"),
    "an external entity": (kml(boundary(SQUARE), head=EXTERNAL), "has a document type"),
    "deep KML": ("<kml>" * 500 + "</kml>" * 500, "nested too deeply to be read"),
    "an archive without KML": (kmz({"a.txt": "x"}), "an archive without a KML document"),
    "a path out of the archive": (
        kmz({"../../doc.kml": kml(boundary(SQUARE))}),
        "the path of member '../../doc.kml' is outside the archive",
    ),
    "an absolute path": (kmz({"/etc/x.kml": kml(boundary(SQUARE))}), "is outside the archive"),
    "a cut archive": (kmz({"doc.kml": kml(boundary(SQUARE))})[:-30], "a broken KMZ archive"),
    "an archive of nothing": (b"PK\x03\x04", "a broken KMZ archive"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_unsupported_content_gives_one_clear_error(file, name):
    content, message = WRONG[name]
    path = file(content)
    with pytest.raises(RequestError) as caught:
        read_outline(path)
    assert message in caught.value.message
    assert path in caught.value.message
    assert len(caught.value.message) < 400 + len(path)


@pytest.mark.parametrize(
    ("position", "hint"),
    [
        ([48.0, 114.0], "give the longitude before the latitude"),
        ([181.5, 48.0], "181.5 is the same as -178.5"),
        ([5e5, 5.3e6], "convert metres to degrees"),
    ],
)
def test_the_hint_names_the_likely_mistake(file, position, hint):
    with pytest.raises(RequestError) as caught:
        read_outline(file(changed(1, position)))
    assert hint in caught.value.hint


def test_a_missing_file_gives_an_error(tmp_path):
    with pytest.raises(RequestError, match="no file"):
        read_outline(str(tmp_path / "none.kml"))


# Decompression bombs


def test_a_zip_bomb_is_refused_before_it_is_unpacked(file):
    bomb = kmz({"doc.kml": b" " * (area_file.MOST_BYTES + 1)})
    assert len(bomb) < 100_000
    with pytest.raises(RequestError, match="larger than 64 MB unpacked"):
        read_outline(file(bomb))


def test_a_zip_bomb_with_a_wrong_stated_size_is_refused(file):
    # The header declares 10 bytes, and the stream contains 200 MB.
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    packed = b"".join(packer.compress(bytes(10**6)) for _ in range(200)) + packer.flush()
    name = b"doc.kml"
    common = struct.pack("<HHHHHIIIHH", 20, 0, 8, 0, 0, 0, len(packed), 10, len(name), 0)
    local = b"PK\x03\x04" + common + name
    central = b"PK\x01\x02\x14\x00" + common + bytes(14) + name
    end = struct.pack("<IHHHHIIH", 0x06054B50, 0, 0, 1, 1, len(central), len(local + packed), 0)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(RequestError, match=r"KMZ archive|larger than"):
        read_outline(file(local + packed + central + end))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000  # kB


def test_an_archive_with_too_many_members_is_refused(file):
    many = kmz({f"{index}.kml": "" for index in range(20_000)})
    with pytest.raises(RequestError, match="too many files"):
        read_outline(file(many))


def test_an_encrypted_archive_is_an_error(file):
    plain = bytearray(kmz({"doc.kml": kml(boundary(SQUARE))}))
    plain[6] |= 1
    plain[plain.rfind(b"PK\x01\x02") + 8] |= 1
    with pytest.raises(RequestError, match="encrypted"):
        read_outline(file(bytes(plain)))


@pytest.mark.parametrize("form", ["geojson", "kml"])
def test_too_many_positions_are_refused_early(file, monkeypatch, form):
    monkeypatch.setattr(area_file, "MOST_POSITIONS", 3)
    with pytest.raises(RequestError, match="more than 3 positions"):
        read_outline(file(POLYGON if form == "geojson" else kml(boundary(SQUARE))))


@given(st.binary(max_size=300))
def test_no_file_content_causes_a_traceback(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("any") / "area"
    for start in (b"", b"PK\x03\x04", b"<", b'{"type": "Polygon", "coordinates": '):
        path.write_bytes(start + content)
        with pytest.raises(AosplanError):
            read_outline(str(path))


@given(st.integers(0, 600), st.binary(min_size=1, max_size=4))
def test_damaged_archives_cause_no_traceback(tmp_path_factory, place, damage):
    path = tmp_path_factory.mktemp("any") / "area.kmz"
    good = kmz({"doc.kml": kml(boundary(SQUARE))})
    place %= len(good)
    path.write_bytes(good[:place] + damage + good[place + len(damage) :])
    try:
        read_outline(str(path))
    except AosplanError as error:
        assert str(path) in error.message  # noqa: PT017 (most damage is an error, not all)
