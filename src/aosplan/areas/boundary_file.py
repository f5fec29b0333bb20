"""Outlines on earth from GeoJSON, KML, KMZ and other vector files, read with limits.

The content decides what a file is, not its name.  Only polygons count; points and lines are
left out and counted.  Heights are ignored.  An XML document type is refused, and with it every
entity; a KMZ is never unpacked: one member of it is read, up to a limit.
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

from aosplan.areas.reprojection import Reprojection, is_wgs84, reprojection
from aosplan.areas.vector_file import is_vector_file
from aosplan.errors import RequestError
from aosplan.files import MOST_BYTES, parse_table, read_bytes, read_start, text_of
from aosplan.units import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from aosplan.messages import Message

MOST_POSITIONS = 2_000_000
"""Outlines have no more positions than this."""

BROKEN = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    RuntimeError,  # encrypted, or compressed in a way that is not known
    EOFError,
    LookupError,
    OSError,
    ValueError,
)
"""What reading a damaged archive may raise."""

MOST_DIRECTORY_BYTES = 1_000_000
"""A KMZ whose list of members is longer is refused."""

ALMOST_CLOSED_DEG = 1e-6
"""A ring whose ends are nearer to each other, 0.1 m, is closed: programs round them apart."""

DEEPEST = 60
"""Levels of elements that a KML file may have."""


class Outline(NamedTuple):
    """Polygons as they stand in a file, each a shell and its holes.

    A ring has shape (n, 2): longitude and latitude [deg], the last as the first.  `places` says where each stands, for messages; `ignored` counts what has no area, by
    kind; `notices` are about its reading.
    """

    path: str
    polygons: list[list[NDArray[np.float64]]]
    places: list[str]
    ignored: Counter[str]
    notices: list[Message]


def read_outline(path: str) -> Outline:
    """The polygons of a GeoJSON, KML or KMZ file.

    Raises
    ------
    RequestError
        If the file is none of these, holds no polygon, or one that is not closed, has too
        few positions, or coordinates that are no longitude and latitude; the message names
        the place.
    """
    outline = Outline(path, [], [], Counter(), [])
    if path != "-" and is_vector_file(path, read_start(path, 2000)):
        _read_vectors(path, outline)
    else:
        _read_document(read_bytes(path), outline)
    if not outline.polygons:
        found = listed(outline.ignored)
        raise RequestError(
            f"'{path}' holds no polygon" + (f", only {found}, without area" if found else ""),
            "draw the area as a polygon",
        )
    if sum(len(ring) for rings in outline.polygons for ring in rings) > MOST_POSITIONS:
        raise _too_many(path)
    return outline


def _read_document(content: bytes, outline: Outline) -> None:
    path = outline.path
    if content[:2] == b"PK":
        content = archive_member(content, path, _document_name)
    encoding = None  # as the document says
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
            "other formats: ogr2ogr -t_srs EPSG:4326 area.geojson FILE",
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
    """Kinds and how many there are of each, as text."""
    return ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items()))


def _too_many(path: str) -> RequestError:
    return RequestError(
        f"'{path}' has more than {MOST_POSITIONS} positions",
        "simplify it first: ogr2ogr -simplify 0.000001 simple.geojson FILE",
    )


# GeoJSON


def _read_geojson(table: dict[str, Any], outline: Outline) -> None:
    changes: dict[str, Reprojection | None] = {}
    for place, rings, crs in _polygons(table, "", "", outline):
        if not isinstance(rings, list) or not rings:
            raise RequestError(f"'{outline.path}': {place} is empty")
        if crs not in changes:
            changes[crs] = reprojection(crs, outline.path) if crs else None
        change = changes[crs]
        outline.polygons.append(
            [
                _ring(ring, f"'{outline.path}': {place}.{index}", change)
                for index, ring in enumerate(rings)
            ]
        )
        outline.places.append(place)
    outline.notices.extend(change.notice for change in changes.values() if change is not None)


def _stated_crs(node: dict[str, Any], above: str, place: str, path: str) -> str:
    """The coordinate reference system of an object: its own, or that of the one around it.

    GeoJSON of 2008 has it as a member ``crs``, which may stand in any object.
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
            f"'{path}': {place}crs {shown(crs)} cannot be read, so it is not WGS 84 for certain",
            "ogr2ogr -t_srs EPSG:4326 area.geojson FILE",
        )
    if above and above != own and not (is_wgs84(above) and is_wgs84(own)):
        raise RequestError(
            f"'{path}': {place}crs is {shown(own)}, and {shown(above)} around it",
            "keep the one that is right",
        )
    return own.strip()


def _polygons(node: Any, place: str, crs: str, outline: Outline) -> Iterator[tuple[str, Any, str]]:
    """Coordinates of every polygon of a GeoJSON object, where they stand, and their system."""
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
    else:
        raise RequestError(
            f"'{outline.path}': {place or 'the file'} has type {shown(kind)}, "
            "which GeoJSON does not know",
            "an area is a Polygon, a MultiPolygon, or a Feature or collection of them",
        )


def _ring(positions: Any, place: str, change: Reprojection | None) -> NDArray[np.float64]:
    """A ring from a list of positions, checked."""
    if not isinstance(positions, list):
        raise RequestError(f"{place} is not a list of positions")
    for index, position in enumerate(positions):
        if (
            not isinstance(position, list)
            or len(position) < 2
            or type(position[0]) not in (int, float)
            or type(position[1]) not in (int, float)
        ):
            raise RequestError(
                f"{place}.{index}: {shown(position)} is not a longitude and a latitude"
            )
    ring = np.array([position[:2] for position in positions], dtype=np.float64)
    ring = ring.reshape(-1, 2)
    if change is not None and np.isfinite(ring).all():
        ring = change.degrees(ring, place)
    return checked_ring(ring, place)


def checked_ring(ring: NDArray[np.float64], place: str) -> NDArray[np.float64]:
    """A ring of longitudes and latitudes, if it is one.

    Raises
    ------
    RequestError
        If it is not closed, has fewer than four positions, or leaves the globe.
    """
    if len(ring) == 0:
        raise RequestError(f"{place} is empty")
    finite = np.isfinite(ring).all(axis=1)
    inside = finite & (np.abs(ring[:, 0]) <= 180.0) & (np.abs(ring[:, 1]) <= 90.0)
    if not inside.all():
        index = int(np.argmin(inside))
        longitude, latitude = ring[index].tolist()
        raise _off_the_globe(longitude, latitude, f"{place}.{index}")
    if np.abs(ring[0] - ring[-1]).max() <= ALMOST_CLOSED_DEG:
        ring[-1] = ring[0]
    if not np.array_equal(ring[0], ring[-1]):
        raise RequestError(
            f"{place} is not closed: it ends at {_text(ring[-1])}, and began at {_text(ring[0])}",
            "the first position of a ring comes again at its end",
        )
    if len(ring) < 4:
        raise RequestError(f"{place} has {len(ring)} positions, and a closed ring at least 4")
    return ring


def _text(position: NDArray[np.float64]) -> str:
    return f"{position[0]:.10g}, {position[1]:.10g}"


def _off_the_globe(longitude: float, latitude: float, place: str) -> RequestError:
    hint = ""
    if max(abs(longitude), abs(latitude)) > 360.0:
        hint = "degrees are expected, not metres: ogr2ogr -t_srs EPSG:4326 area.geojson FILE"
    elif abs(latitude) > 90.0 and abs(longitude) <= 90.0:
        hint = "longitude comes first, then latitude"
    elif abs(latitude) <= 90.0:
        hint = f"across the antimeridian, {longitude:g} is {(longitude + 180) % 360 - 180:g}"
    return RequestError(
        f"{place}: {longitude:.10g}, {latitude:.10g} is not a longitude and a latitude", hint
    )


# KML


class _KmlReader:
    """Collects the polygons of a KML document while expat walks through it."""

    def __init__(self, outline: Outline) -> None:
        self.outline = outline
        self.path: list[str] = []
        self.text: list[str] | None = None
        self.shells: list[NDArray[np.float64]] = []
        self.holes: list[NDArray[np.float64]] = []
        self.positions = 0

    def read(self, content: bytes, encoding: str | None = None) -> None:
        """Read a document into the outline."""
        # Names are taken without their prefixes, which many programs leave unbound.
        parser = expat.ParserCreate(encoding)
        parser.buffer_text = True
        parser.StartDoctypeDeclHandler = self._doctype
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._characters
        try:
            parser.Parse(content, True)
        except (expat.ExpatError, LookupError, ValueError) as error:  # of an encoding, too
            raise RequestError(f"'{self.outline.path}' is not valid XML: {error}") from None

    def _doctype(self, *_: Any) -> None:
        raise RequestError(
            f"'{self.outline.path}' has a document type, which may hide entities",
            "remove its <!DOCTYPE …> line: KML has none",
        )

    def _start(self, name: str, _attributes: dict[str, str]) -> None:
        tag = name.rpartition(":")[2]
        if not self.path and tag != "kml":
            raise RequestError(f"'{self.outline.path}' is XML, but not KML: it begins with <{tag}>")
        self.path.append(tag)
        if len(self.path) > DEEPEST:
            raise RequestError(f"'{self.outline.path}' is nested too deeply")
        if tag == "Polygon":
            self.shells, self.holes = [], []
        elif tag == "coordinates" and "Polygon" in self.path:
            self.text = []
        elif tag in ("Point", "LineString"):
            self.outline.ignored[tag] += 1

    def _characters(self, text: str) -> None:
        if self.text is not None:
            self.text.append(text)

    def _end(self, _name: str) -> None:
        tag = self.path.pop()
        if tag == "coordinates" and self.text is not None:
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
                    "coordinates are lon,lat or lon,lat,alt, without blanks after the commas",
                )
            pairs.append((longitude, latitude))
        return checked_ring(np.array(pairs).reshape(-1, 2), self._place)


def archive_member(content: bytes, path: str, choose: Callable[[list[str], str], str]) -> bytes:
    """One member of a KMZ, which is chosen from the names of all of them.

    Raises
    ------
    RequestError
        If the archive is broken, has too many members, or one that is too large.
    """
    end = content.rfind(b"PK\x05\x06")
    if end < 0 or len(content) < end + 22:
        raise RequestError(f"'{path}' is a broken KMZ archive")
    (directory,) = struct.unpack_from("<I", content, end + 12)
    if directory > MOST_DIRECTORY_BYTES:
        raise RequestError(f"'{path}' has more members than a KMZ archive should")
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
    """The member of an archive that is its KML document."""
    documents = [
        name
        for name in names
        if name.lower().endswith(".kml")
        and not name.startswith("__MACOSX/")
        and not name.replace("\\", "/").rpartition("/")[2].startswith("._")
    ]
    if not documents:
        raise RequestError(
            f"'{path}' is an archive without a KML document", "unpack files of other formats"
        )
    # The root document is at the top of the archive; files in folders are what it refers to.
    top = [name for name in documents if "/" not in name and "\\" not in name]
    usual = [name for name in top if name.lower() == "doc.kml"]
    chosen = usual or top or documents
    if len(chosen) > 1:
        raise RequestError(
            f"'{path}' holds {len(chosen)} KML documents: {', '.join(map(shown, chosen[:3]))}",
            "unpack it, and name the one that is meant",
        )
    name = chosen[0]
    parts = name.replace("\\", "/").split("/")
    if name.startswith(("/", "\\")) or ".." in parts or (":" in parts[0] and len(parts) > 1):
        raise RequestError(f"'{path}': member {shown(name)} points out of the archive")
    return name
