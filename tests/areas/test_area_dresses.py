"""An area has the same outline in all file formats, reference systems and variants of other
programs.
"""

import io
import json
import zipfile

import numpy as np
import pytest
from pyproj import Transformer, transformer
from pyproj.transformer import TransformerGroup

from aosplan.areas.area import read_area
from aosplan.areas.boundary_file import read_outline
from aosplan.areas.reprojection import reprojection
from aosplan.errors import MissingExtraError, RequestError

RING = [[14.0, 48.0], [14.0013, 48.0], [14.0013, 48.0009], [14.0, 48.0009], [14.0, 48.0]]


def polygon(ring=RING, **more):
    return {"type": "Polygon", "coordinates": [ring], **more}


def feature(geometry, **more):
    return {"type": "Feature", "properties": {}, "geometry": geometry, **more}


def collection(*features, **more):
    return {"type": "FeatureCollection", "features": list(features), **more}


def named(name):
    return {"crs": {"type": "name", "properties": {"name": name}}}


def kml(ring=RING, head='<?xml version="1.0" encoding="UTF-8"?>', attributes=""):
    text = " ".join(f"{x},{y},0" for x, y in ring)
    return (
        f'{head}<kml xmlns="http://www.opengis.net/kml/2.2"><Document {attributes}><Placemark><Polygon>'
        f"<outerBoundaryIs><LinearRing><coordinates>{text}</coordinates></LinearRing>"
        "</outerBoundaryIs></Polygon></Placemark></Document></kml>"
    )


def archive(members):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        for name, content in members.items():
            file.writestr(name, content)
    return buffer.getvalue()


@pytest.fixture
def written(tmp_path):
    def write(content, name="area.geojson"):
        if isinstance(content, dict):
            content = json.dumps(content)
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        return str(tmp_path / name)

    return write


def in_system(code, ring=RING):
    x, y = Transformer.from_crs("EPSG:4326", code, always_xy=True).transform(*np.transpose(ring))
    return np.column_stack([x, y]).tolist()


ELSEWHERE = [[15.0, 48.0], [15.1, 48.0], [15.1, 48.1], [15.0, 48.0]]
JUNK = "Mac OS X leftovers"

DRESSES = {
    "NaN in a property": json.dumps(collection(feature(polygon()))).replace(
        "{}", '{"height": NaN}'
    ),
    "UTF-16": json.dumps(polygon()).encode("utf-16"),
    "blank first lines": "\n\n  " + json.dumps(polygon()),
    "an old crs of WGS 84": collection(feature(polygon(**named("EPSG:4326")))),
    "UTM on top": collection(
        feature(polygon(in_system(32633))), **named("urn:ogc:def:crs:EPSG::32633")
    ),
    "UTM in the geometry": feature(polygon(in_system(25833), **named("EPSG:25833"))),
    "web Mercator": polygon(in_system(3857), **named("EPSG:3857")),
    "a crs by its code": polygon(
        in_system(32633), crs={"type": "EPSG", "properties": {"code": 32633}}
    ),
    "almost closed": polygon([*RING[:-1], [14.0 + 4e-8, 48.0 - 4e-8]]),
    "KML with blank first lines": "\n \n" + kml(),
    "KML with an unbound prefix": kml(attributes='xsi:schemaLocation="x y"'),
    "KML in UTF-16 that says UTF-8": kml().encode("utf-16"),
    "KML with a prefix": kml()
    .replace("<", "<kml:")
    .replace("<kml:/", "</kml:")
    .replace("<kml:?", "<?"),
    "a KMZ of macOS": archive({"__MACOSX/._area.kml": JUNK, "._b.kml": JUNK, "area.kml": kml()}),
    "a KMZ with a colon": archive({"Area 12:30.kml": kml()}),
    "a KMZ with a linked document": archive({"files/old.kml": kml(ELSEWHERE), "area.kml": kml()}),
    "a KMZ with two at its top": archive({"a.kml": kml(ELSEWHERE), "doc.kml": kml()}),
    "a KMZ with one in a folder": archive({"files/area.kml": kml()}),
}


@pytest.mark.parametrize("name", DRESSES)
def test_one_area_is_the_same_in_every_file_format(written, name):
    outline = read_outline(written(DRESSES[name]))
    ((ring,),) = outline.polygons
    assert ring == pytest.approx(np.array(RING), abs=2e-9)


def test_a_notice_gives_a_transformation_and_its_accuracy(written):
    area = read_area(written(polygon(in_system(32633), **named("EPSG:32633"))))
    ((code, message),) = area.notices
    assert code == "reprojected"
    assert "WGS 84 / UTM zone 33N" in message
    assert area.whole.area == pytest.approx(read_area(written(polygon())).whole.area, rel=1e-6)


class Silent:
    """A transformer that does not state the accuracy of its steps, as in PROJ 9.8."""

    accuracy = -1.0

    def __init__(self, *arguments, **options):
        self.operations = TransformerGroup(*arguments, **options).transformers[0].operations
        self.transformers = [self]


def test_a_projection_of_the_same_datum_is_exact_in_each_version_of_proj(monkeypatch):
    monkeypatch.setattr(transformer, "TransformerGroup", Silent)
    for same in ("EPSG:32633", "EPSG:3857"):
        assert reprojection(same, "a.kml").notice.message.endswith("with an error of at most 0 m")
    for other in ("EPSG:25833", "+proj=utm +zone=33 +ellps=GRS80"):
        with pytest.raises(RequestError, match="to WGS 84 is not known"):
            reprojection(other, "a.kml")


REFUSED = {
    "degrees of another datum, on top": (collection(feature(polygon()), **named("EPSG:4314")), "is not WGS 84"),
    "degrees of another datum, within": (collection(feature(polygon(**named("EPSG:4314")))), "is not WGS 84"),
    "two systems": (collection(feature(polygon(**named("EPSG:32632"))), **named("EPSG:32633")), "around it"),
    "degrees said to be metres": (polygon(**named("EPSG:32633")), "look like degrees"),
    "an unknown system": (polygon(**named("EPSG:1")), "is not known"),
    "a system behind a link": (polygon(crs={"type": "link", "properties": {"href": "x"}}), "cannot be read"),
    "metres far off": (polygon([[1e9, 1e9], [2e9, 1e9], [2e9, 2e9], [1e9, 1e9]], **named("EPSG:32633")), "EPSG"),
    "two documents in a KMZ": (archive({"a.kml": kml(), "b.kml": kml(ELSEWHERE)}), "2 KML documents"),
    "two documents in folders": (archive({"x/a.kml": kml(), "y/b.kml": kml()}), "2 KML documents"),
    "leftovers alone": (archive({"__MACOSX/._a.kml": JUNK}), "without a KML document"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_unclear_reference_systems_are_refused(written, name):
    content, said = REFUSED[name]
    with pytest.raises(RequestError) as caught:
        read_outline(written(content))
    assert said in caught.value.message or "do not fit" in caught.value.message
    assert "\n" not in caught.value.message


def test_slivers_beside_an_area_are_left_out_with_a_notice(written):
    sliver = [[14.01, 48.0], [14.010001, 48.0], [14.010001, 48.0001], [14.01, 48.0]]
    area = read_area(written(collection(feature(polygon()), feature(polygon(sliver)))))
    assert [code for code, _ in area.notices] == ["slivers"]
    alone = read_area(written(polygon()))
    assert area.whole.area == pytest.approx(alone.whole.area, rel=1e-3)
    # If there are no other parts, a sliver is kept.
    assert not read_area(written(polygon(sliver))).whole.is_empty


# Formats that pyogrio reads


def vector(path, geometry, crs, kind="Polygon", **given):
    pyogrio = pytest.importorskip("pyogrio")
    shapely = pytest.importorskip("shapely")
    pyogrio.raw.write(
        str(path),
        np.array([shapely.to_wkb(geometry)], dtype=object),
        [],
        [],
        crs=crs,
        geometry_type=kind,
        **given,
    )
    return str(path)


@pytest.mark.parametrize("suffix", ["gpkg", "shp", "fgb"])
@pytest.mark.parametrize("code", ["EPSG:4326", "EPSG:32633", "EPSG:25833"])
def test_other_vector_files_are_read_in_any_system(tmp_path, suffix, code):
    shapely = pytest.importorskip("shapely")
    path = vector(tmp_path / f"area.{suffix}", shapely.Polygon(in_system(code)), code)
    found = read_area(path)
    expected = shapely.Polygon(RING)
    assert shapely.Polygon(read_outline(path).polygons[0][0]).equals_exact(
        expected, 2e-9, normalize=True
    )
    assert [code for code, _ in found.notices] == ["reprojected"] * (code != "EPSG:4326")


def test_a_shapefile_without_its_system_is_refused(tmp_path):
    shapely = pytest.importorskip("shapely")
    path = vector(tmp_path / "area.shp", shapely.Polygon(RING), "EPSG:4326")
    (tmp_path / "area.prj").unlink()
    with pytest.raises(RequestError, match="does not state its coordinate reference system"):
        read_outline(path)


def gpx(ring):
    points = "".join(f'<trkpt lat="{y}" lon="{x}"><ele>300</ele></trkpt>' for x, y in ring)
    return (
        '<?xml version="1.0"?><gpx version="1.1" creator="x" xmlns="http://www.topografix.com/GPX/1/1">'
        f'<wpt lat="48" lon="14"/><trk><trkseg>{points}</trkseg></trk></gpx>'
    )


def test_closed_tracks_are_outlines_and_open_tracks_are_not(written):
    pytest.importorskip("pyogrio")
    walked = [*RING[:-1], [14.0, 48.00002]]
    area = read_area(written(gpx(walked), "walk.gpx"))
    assert "track_closed" in [code for code, _ in area.notices]
    assert area.whole.area == pytest.approx(read_area(written(polygon())).whole.area, rel=1e-3)
    with pytest.raises(RequestError, match="contains no polygon"):
        read_outline(written(gpx(RING[:3]), "way.gpx"))


def test_damaged_and_misnamed_vector_files_give_one_error(written):
    pytest.importorskip("pyogrio")
    for content, name in ((b"SQLite format 3\0" + bytes(100), "a.gpkg"), (b"<gpx>", "a.gpx")):
        with pytest.raises(RequestError):
            read_outline(written(content, name))
    with pytest.raises(RequestError, match="does not have the extension of a vector file"):
        read_outline(written(b"SQLite format 3\0", "a.geojson"))


def test_without_the_optional_dependency_the_error_names_it(written, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyogrio", None)
    with pytest.raises(MissingExtraError, match="'vector'"):
        read_outline(written(gpx(RING), "a.gpx"))
