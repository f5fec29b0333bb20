"""Reading of boundaries from GeoJSON, KML, KMZ and other vector files, with limits on size and
depth.

The content of a file determines its type; the name does not. Polygons and points are read. Lines
are only counted and reported. Heights are ignored. XML files with a document type, which may define
entities, are refused. One member of a KMZ archive is read, and its size is limited.
"""

from __future__ import annotations

import io
import lzma
import struct
import zipfile
import zlib
from collections import Counter
from typing import TYPE_CHECKING, Any, NamedTuple
from xml.parsers import expat

import numpy as np

from aosplan.areas.reprojection import Reprojection, change_of, is_wgs84
from aosplan.areas.vector_file import is_vector_file
from aosplan.errors import RequestError
from aosplan.files import MOST_BYTES, parse_table, read_bytes, read_start, text_of
from aosplan.units import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from aosplan.messages import Message

MOST_POSITIONS = 2_000_000
"""Largest number of positions of a boundary."""

BROKEN = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    RuntimeError,  # raised for encrypted members and for unknown compression methods
    EOFError,
    LookupError,
    OSError,
    ValueError,
)
"""Exceptions that a damaged archive may raise."""

MOST_DIRECTORY_BYTES = 1_000_000
"""Largest size of a KMZ archive's directory."""

ALMOST_CLOSED_DEG = 1e-6
"""If the ends of a ring are closer than this (0.1 m), the ring is treated as closed, because
programs round coordinates.
"""

DEEPEST = 60
"""Greatest number of nested elements in a KML file."""


class Point(NamedTuple):
    """A point of a file: its place in the file, unchecked position, and reference system."""

    place: str
    position: Any
    crs: str


class Outline(NamedTuple):
    """Polygons of a file.  Each polygon is a list with an outer ring and the rings of its holes.

    A ring has the shape (n, 2) with longitude and latitude [deg].  Its last position equals its
    first.  `places` has the place of each polygon in the file, for messages.  `ignored` counts the
    objects without an area, by their kind.  `points` has the points of the file, which are not
    checked.  `notices` are warnings about the file.
    """

    path: str
    polygons: list[list[NDArray[np.float64]]]
    places: list[str]
    ignored: Counter[str]
    points: list[Point]
    notices: list[Message]


def read_outline(path: str) -> Outline:
    """Read the polygons of a GeoJSON, KML or KMZ file.

    Raises
    ------
    RequestError
        If the file is of another type or has no polygon, or if a polygon is not closed, has too few
        positions, or has coordinates that are not longitude and latitude.  The message gives the
        place.
    """
    outline = read_shapes(path)
    if not outline.polygons:
        found = listed(outline.ignored)
        raise RequestError(
            f"'{path}' contains no polygon" + (f", only {found}, without area" if found else ""),
            "draw the area as a polygon",
        )
    if sum(len(ring) for rings in outline.polygons for ring in rings) > MOST_POSITIONS:
        raise _too_many(path)
    return outline


def read_shapes(path: str) -> Outline:
    """Read the polygons and points of a file.  The file may contain neither.

    Raises
    ------
    RequestError
        In the same cases as `read_outline`, except that polygons may be missing.
    """
    outline = Outline(path, [], [], Counter(), [], [])
    if path != "-" and is_vector_file(path, read_start(path, 2000)):
        _read_vectors(path, outline)
    else:
        _read_document(read_bytes(path), outline)
    return outline


def _read_document(content: bytes, outline: Outline) -> None:
    path = outline.path
    if content[:2] == b"PK":
        content = archive_member(content, path, _document_name)
    encoding = None  # With None, expat uses the encoding that the document declares.
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        content, encoding = text_of(content, path).encode(), "utf-8"
    content = content.removeprefix(b"\xef\xbb\xbf").lstrip()
    if content[:1] == b"<":
        _KmlReader(outline).read(content, encoding)
    elif content[:1] in (b"{", b"["):
        if content.count(b"[") > MOST_POSITIONS:
            raise _too_many(path)
        _read_geojson(parse_table(content, path, with_nan=True), outline)
    else:
        raise RequestError(
            f"'{path}' is neither GeoJSON, KML nor KMZ",
            "convert other formats with ogr2ogr -t_srs EPSG:4326 area.geojson FILE",
        )


def _read_vectors(path: str, outline: Outline) -> None:
    from aosplan.areas.vector_file import read_vectors

    for rings, place, notice in read_vectors(path):
        if notice is not None and notice not in outline.notices:
            outline.notices.append(notice)
        if rings is not None:
            outline.polygons.append([checked_ring(ring, f"'{path}': {place}") for ring in rings])
            outline.places.append(place)
        elif place:
            outline.ignored[place] += 1


def listed(counts: Counter[str]) -> str:
    """The kinds of objects, and the number of objects of each kind, as text."""
    return ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items()))


def _too_many(path: str) -> RequestError:
    return RequestError(
        f"'{path}' has more than {MOST_POSITIONS} positions",
        "simplify it first, with ogr2ogr -simplify 0.000001 simple.geojson FILE",
    )


# GeoJSON


def _read_geojson(table: dict[str, Any], outline: Outline) -> None:
    for place, rings, crs in _polygons(table, "", "", outline):
        if not isinstance(rings, list) or not rings:
            raise RequestError(f"'{outline.path}': {place} is empty")
        change = change_of(crs, outline.path, outline.notices)
        outline.polygons.append(
            [
                _ring(ring, f"'{outline.path}': {place}.{index}", change)
                for index, ring in enumerate(rings)
            ]
        )
        outline.places.append(place)


def _stated_crs(node: dict[str, Any], above: str, place: str, path: str) -> str:
    """The coordinate reference system that an object states, or else the system of the object that
    contains it.

    In GeoJSON of 2008, any object may have a member ``crs``.
    """
    crs = node.get("crs")
    if crs is None or crs == {}:
        return above
    facts = crs.get("properties") if isinstance(crs, dict) else None
    if isinstance(facts, dict):
        own = facts.get("name", facts.get("code"))
        own = f"EPSG:{own}" if type(own) is int else own
    else:
        own = crs
    if not isinstance(own, str) or not own.strip():
        raise RequestError(
            f"'{path}': {place}crs {shown(crs)} cannot be read, so the coordinates may "
            "not be WGS 84",
            "ogr2ogr -t_srs EPSG:4326 area.geojson FILE",
        )
    if above and above != own and not (is_wgs84(above) and is_wgs84(own)):
        raise RequestError(
            f"'{path}': {place}crs is {shown(own)}, but {shown(above)} in the object around it",
            "keep the correct one",
        )
    return own.strip()


def _polygons(node: Any, place: str, crs: str, outline: Outline) -> Iterator[tuple[str, Any, str]]:
    """Coordinates of every polygon of a GeoJSON object, with its place and coordinate reference
    system.

    Points are added to the outline.
    """
    kind = node.get("type") if isinstance(node, dict) else None
    dot = f"{place}." if place else ""
    if isinstance(node, dict):
        crs = _stated_crs(node, crs, dot, outline.path)
    if kind in ("FeatureCollection", "GeometryCollection"):
        name = "features" if kind == "FeatureCollection" else "geometries"
        members = node.get(name)
        if not isinstance(members, list):
            raise RequestError(f"'{outline.path}': {dot}{name} is not a list")
        for index, member in enumerate(members):
            yield from _polygons(member, f"{dot}{name}.{index}", crs, outline)
    elif kind == "Feature":
        if node.get("geometry") is not None:
            yield from _polygons(node["geometry"], f"{dot}geometry", crs, outline)
    elif kind == "Polygon":
        yield f"{dot}coordinates", node.get("coordinates"), crs
    elif kind == "MultiPolygon":
        parts = node.get("coordinates")
        if not isinstance(parts, list) or not parts:
            raise RequestError(f"'{outline.path}': {dot}coordinates is empty")
        for index, part in enumerate(parts):
            yield f"{dot}coordinates.{index}", part, crs
    elif kind in ("Point", "MultiPoint", "LineString", "MultiLineString"):
        outline.ignored[kind] += 1
        found = node.get("coordinates")
        if kind == "Point":
            outline.points.append(Point(f"{dot}coordinates", found, crs))
        elif kind == "MultiPoint" and isinstance(found, list):
            outline.points.extend(
                Point(f"{dot}coordinates.{index}", position, crs)
                for index, position in enumerate(found)
            )
    else:
        raise RequestError(
            f"'{outline.path}': {place or 'the file'} has type {shown(kind)}, which is "
            "not a type of GeoJSON",
            "an area is a Polygon or a MultiPolygon, or a Feature or a collection that contains "
            "them",
        )


def _ring(positions: Any, place: str, change: Reprojection | None) -> NDArray[np.float64]:
    """A checked ring from a list of positions."""
    if not isinstance(positions, list):
        raise RequestError(f"{place} is not a list of positions")
    for index, position in enumerate(positions):
        check_position(position, f"{place}.{index}")
    ring = np.array([position[:2] for position in positions], dtype=np.float64)
    ring = ring.reshape(-1, 2)
    if change is not None and np.isfinite(ring).all():
        ring = change.degrees(ring, place)
    return checked_ring(ring, place)


def check_position(position: Any, place: str) -> None:
    """Check that a position begins with two numbers.

    Raises
    ------
    RequestError
        If the position does not begin with two numbers.
    """
    if (
        not isinstance(position, list)
        or len(position) < 2
        or type(position[0]) not in (int, float)
        or type(position[1]) not in (int, float)
    ):
        raise RequestError(f"{place}: {shown(position)} is not a longitude and a latitude")


def check_globe(ring: NDArray[np.float64], place: str) -> None:
    """Check that positions, shape (n, 2), are longitudes and latitudes.

    Raises
    ------
    RequestError
        If a position is not on earth.  The message names the first such position.
    """
    finite = np.isfinite(ring).all(axis=1)
    inside = finite & (np.abs(ring[:, 0]) <= 180.0) & (np.abs(ring[:, 1]) <= 90.0)
    if not inside.all():
        index = int(np.argmin(inside))
        longitude, latitude = ring[index].tolist()
        raise _off_the_globe(longitude, latitude, f"{place}.{index}")


def checked_ring(ring: NDArray[np.float64], place: str) -> NDArray[np.float64]:
    """Check a ring of longitudes and latitudes.  If it is almost closed, it is closed.

    Raises
    ------
    RequestError
        If the ring is not closed, has fewer than four positions, or has invalid coordinates.
    """
    if len(ring) == 0:
        raise RequestError(f"{place} is empty")
    check_globe(ring, place)
    if np.abs(ring[0] - ring[-1]).max() <= ALMOST_CLOSED_DEG:
        ring[-1] = ring[0]
    if not np.array_equal(ring[0], ring[-1]):
        raise RequestError(
            f"{place} is not closed: it ends at {_text(ring[-1])}, but begins at {_text(ring[0])}",
            "repeat the first position at the end of the ring",
        )
    if len(ring) < 4:
        raise RequestError(f"{place} has {len(ring)} positions, but a closed ring has at least 4")
    return ring


def _text(position: NDArray[np.float64]) -> str:
    return f"{position[0]:.10g}, {position[1]:.10g}"


def _off_the_globe(longitude: float, latitude: float, place: str) -> RequestError:
    hint = ""
    if max(abs(longitude), abs(latitude)) > 360.0:
        hint = "convert metres to degrees with ogr2ogr -t_srs EPSG:4326 area.geojson FILE"
    elif abs(latitude) > 90.0 and abs(longitude) <= 90.0:
        hint = "give the longitude before the latitude"
    elif abs(latitude) <= 90.0:
        hint = f"longitudes are from -180 to 180; {longitude:g} is the same as {(longitude + 180) % 360 - 180:g}"
    return RequestError(
        f"{place}: {longitude:.10g}, {latitude:.10g} is not a longitude and a latitude", hint
    )


# KML


class _KmlReader:
    """Collects the polygons of a KML document while expat parses it."""

    def __init__(self, outline: Outline) -> None:
        self.outline = outline
        self.path: list[str] = []
        self.text: list[str] | None = None
        self.shells: list[NDArray[np.float64]] = []
        self.holes: list[NDArray[np.float64]] = []
        self.positions = 0

    def read(self, content: bytes, encoding: str | None = None) -> None:
        """Parse a document and add its polygons to the outline."""
        # Namespace prefixes are ignored, because many programs do not declare them.
        parser = expat.ParserCreate(encoding)
        parser.buffer_text = True
        parser.StartDoctypeDeclHandler = self._doctype
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._characters
        try:
            parser.Parse(content, True)
        # Python raises these errors for unknown encodings.
        except (expat.ExpatError, LookupError, ValueError) as error:
            raise RequestError(f"'{self.outline.path}' is not valid XML: {error}") from None

    def _doctype(self, *_: Any) -> None:
        raise RequestError(
            f"'{self.outline.path}' has a document type (<!DOCTYPE …>), which is not accepted",
            "remove the <!DOCTYPE …> line; KML does not need it",
        )

    def _start(self, name: str, _attributes: dict[str, str]) -> None:
        tag = name.rpartition(":")[2]
        if not self.path and tag != "kml":
            raise RequestError(f"'{self.outline.path}' is XML, but not KML: it begins with <{tag}>")
        self.path.append(tag)
        if len(self.path) > DEEPEST:
            raise RequestError(f"'{self.outline.path}' is nested too deeply to be read")
        if tag == "Polygon":
            self.shells, self.holes = [], []
        elif tag == "coordinates" and ("Polygon" in self.path or self.path[-2:-1] == ["Point"]):
            self.text = []
        elif tag in ("Point", "LineString"):
            self.outline.ignored[tag] += 1

    def _characters(self, text: str) -> None:
        if self.text is not None:
            self.text.append(text)

    def _end(self, _name: str) -> None:
        tag = self.path.pop()
        if tag == "coordinates" and self.text is not None and self.path[-1:] == ["Point"]:
            place = f"point {len(self.outline.points) + 1}"
            position = list("".join(self.text).strip().split(","))
            self.outline.points.append(Point(place, position, ""))
            self.text = None
        elif tag == "coordinates" and self.text is not None:
            rings = self.holes if "innerBoundaryIs" in self.path else self.shells
            rings.append(self._ring("".join(self.text)))
            self.text = None
        elif tag == "Polygon":
            if len(self.shells) != 1:
                raise RequestError(f"{self._place} has {len(self.shells)} outer boundaries, not 1")
            self.outline.places.append(f"polygon {len(self.outline.polygons) + 1}")
            self.outline.polygons.append(self.shells + self.holes)

    @property
    def _place(self) -> str:
        return f"'{self.outline.path}': polygon {len(self.outline.polygons) + 1}"

    def _ring(self, text: str) -> NDArray[np.float64]:
        tuples = text.split()
        self.positions += len(tuples)
        if self.positions > MOST_POSITIONS:
            raise _too_many(self.outline.path)
        pairs = []
        for item in tuples:
            try:
                longitude, latitude, *height = map(float, item.split(","))
            except ValueError:
                height = [0.0, 0.0]
            if len(height) > 1:
                raise RequestError(
                    f"{self._place}: {shown(item)} is not a longitude and a latitude",
                    "coordinates are lon,lat or lon,lat,alt, without spaces after the commas",
                )
            pairs.append((longitude, latitude))
        return checked_ring(np.array(pairs).reshape(-1, 2), self._place)


def archive_member(content: bytes, path: str, choose: Callable[[list[str], str], str]) -> bytes:
    """Read one member of a KMZ archive.  `choose` selects this member from the names of all
    members.

    Raises
    ------
    RequestError
        If the archive is damaged or has too many members, or if the member is too large.
    """
    end = content.rfind(b"PK\x05\x06")
    if end < 0 or len(content) < end + 22:
        raise RequestError(f"'{path}' is a broken KMZ archive")
    (directory,) = struct.unpack_from("<I", content, end + 12)
    if directory > MOST_DIRECTORY_BYTES:
        raise RequestError(f"'{path}' has too many files for a KMZ archive")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            name = choose(archive.namelist(), path)
            with archive.open(name) as member:
                document = member.read(MOST_BYTES + 1)
    except BROKEN as error:
        raise RequestError(f"'{path}' is a broken KMZ archive: {error}") from None
    if len(document) > MOST_BYTES:
        raise RequestError(f"'{path}': '{name}' is larger than {MOST_BYTES // 2**20} MB unpacked")
    return document


def _document_name(names: list[str], path: str) -> str:
    """Name of the member that is the KML document of an archive."""
    documents = [
        name
        for name in names
        if name.lower().endswith(".kml")
        and not name.startswith("__MACOSX/")
        and not name.replace("\\", "/").rpartition("/")[2].startswith("._")
    ]
    if not documents:
        raise RequestError(
            f"'{path}' is an archive without a KML document",
            "if it contains files of another format, unpack it",
        )
    # The root document is at the top level of the archive. It refers to the documents in folders.
    top = [name for name in documents if "/" not in name and "\\" not in name]
    usual = [name for name in top if name.lower() == "doc.kml"]
    chosen = usual or top or documents
    if len(chosen) > 1:
        raise RequestError(
            f"'{path}' contains {len(chosen)} KML documents: {', '.join(map(shown, chosen[:3]))}",
            "unpack it, and give one of the documents",
        )
    name = chosen[0]
    parts = name.replace("\\", "/").split("/")
    if name.startswith(("/", "\\")) or ".." in parts or (":" in parts[0] and len(parts) > 1):
        raise RequestError(f"'{path}': the path of member {shown(name)} is outside the archive")
    return name
