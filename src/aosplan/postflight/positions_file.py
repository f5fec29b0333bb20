"""Reading of positions of photos from tables, missions and logs."""

from __future__ import annotations

import csv
import io
import math
import os
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.areas.reprojection import is_wgs84
from aosplan.errors import RequestError
from aosplan.files import read_bytes, read_table, text_of
from aosplan.mission import mavlink as mav
from aosplan.units import number, shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence


PLACE_NAMES = (("latitude", "longitude"), ("lat", "lon"), ("lat", "lng"), ("lat", "long"))
"""Names that the columns of latitude and longitude may have in a CSV."""

ALTITUDES = ("altitude_m", "altitude(m)", "altitude", "alt")
"""Names that the column of altitudes may have in a CSV."""

SUFFIXES = (".waypoints", ".plan", ".geojson", ".kmz", ".mavlink")
"""Extensions of files whose positions are latitudes and longitudes."""


class Place(NamedTuple):
    """A position: latitude and longitude [deg], and the altitude [m], which is None if the file
    does not have it.
    """

    latitude: float
    longitude: float
    altitude_m: float | None = None


def read_places(path: str) -> list[Place]:
    """Read the positions of photos in a mission, ``.geojson`` or CSV file, in the order of the
    file.

    If a mission triggers the camera, the positions are those of its photos; otherwise, they are all
    waypoints. The CSV file may be a mission of Litchi.

    Raises
    ------
    RequestError
        If the file is of another type, if a position is not on earth, or if there are no positions.
        The message gives the line or the item.
    """
    suffix = os.path.splitext(path)[1].lower()
    if suffix in {".waypoints", ".mavlink"}:
        places = _flown(_rows(path), path)
    elif suffix == ".kmz":
        from aosplan.postflight.wpml_route import read_route

        places = _taken(read_route(path))
    elif suffix == ".plan":
        places = _flown(_items(path), path)
    elif suffix in {".geojson", ".json"}:
        places = [_place(*point) for point in _points(path)]
    else:
        places = places_of(read_csv(path))
    if not places:
        raise RequestError(f"'{path}' contains no positions")
    return places


def local_m(
    places: Sequence[Place], origin: tuple[float, float], path: str, named: str
) -> tuple[list[float], list[float]]:
    """Metres east and north of an origin.  `named` is the name of the origin in messages.

    Raises
    ------
    RequestError
        If a position in the file is too far from the origin.
    """
    from aosplan.geodesy import FARTHEST_M, to_local

    latitudes, longitudes, _ = zip(*places, strict=True)
    east, north = to_local(origin, latitudes, longitudes)
    farthest = max(map(math.hypot, east, north))
    if farthest > FARTHEST_M:
        raise RequestError(
            f"'{path}': positions are {farthest / 1000.0:.4g} km from {named}, more than "
            f"{FARTHEST_M / 1000.0:g} km"
        )
    return east, north


def places_of(table: PositionTable) -> list[Place]:
    """Latitudes, longitudes and altitudes from the columns of a table."""
    return [_place(where, *values) for where, values in table.columns(PLACE_NAMES, ALTITUDES)]


def _place(where: str, latitude: Any, longitude: Any, altitude: Any = None) -> Place:
    north = number(latitude, f"{where} latitude")
    east = number(longitude, f"{where} longitude")
    if abs(north) > 90.0 or abs(east) > 180.0:
        raise RequestError(
            f"{where} {north:g}, {east:g} is not a latitude and longitude",
            "latitudes are between -90 and 90 degrees, and longitudes between -180 and 180 degrees",
        )
    return Place(north, east, None if altitude is None else number(altitude, f"{where} altitude"))


PLACING = {mav.WAYPOINT, 17, 18, 19, 31, 82}
"""Commands that move the vehicle to a position: waypoint, loiter (unlimited, by turns, by time, to
an altitude), and spline waypoint.
"""

PLACELESS = {
    # These commands are take-off, landing, return, delays, jumps, changes of speed and home,
    # cameras, gimbals, servos, relays, regions of interest, grippers, fences, rally points and the
    # state of the vehicle.
    20, 21, 22, 23, 24, 30, 32, 84, 85, 92, 93, 94, 95, 112, 113, 114, 115, 159, *range(176, 190),
    *range(193, 223), 240, 241, 242, 252, 300, *range(400, 402), *range(500, 540), 600, 601,
    *range(1000, 1003), *range(2000, 2006), *range(2500, 2521), 2800, 3000, *range(4501, 4505),
    *range(5000, 5005), 5100, *range(30001, 30003), *range(31000, 31015), *range(42600, 42705),
}  # fmt: skip
"""Commands that may have a latitude and a longitude, which are not positions of photos."""

GLOBAL_FRAMES = {0, 3, 5, 6, 10, 11}
"""MAVLink frames in which x and y are latitude and longitude."""


def _flown(commands: Iterator[tuple[str, int, Sequence[Any]]], path: str) -> list[Place]:
    """Positions of photos: single photos, and one photo per spacing while a distance trigger is on.

    If the mission never triggers the camera, all waypoints are returned.
    """
    places: list[Place] = []
    photos: list[Place] = []
    spacing_m = gone_m = 0.0
    for where, command, params in commands:
        if command in PLACING:
            place = _place(where, *params[4:7])
            if places and spacing_m:
                passed, gone_m = _passed(places[-1], place, spacing_m, gone_m)
                photos += passed
            places.append(place)
        elif command in {mav.SHOOT, mav.CAPTURE}:
            photos += places[-1:]
        elif command == mav.BY_DISTANCE:
            spacing_m, gone_m = max(0.0, number(params[0], f"{where} distance")), 0.0
            photos += places[-1:] if spacing_m else []
        elif command not in PLACELESS and any(_is_set(value) for value in params[4:6]):
            raise RequestError(
                f"{where} command {command} is unknown and has a position: it is not known "
                "whether a photo is taken there",
                "remove the command, or replace it by a waypoint (16)",
            )
    if not places:
        raise RequestError(f"'{path}' contains no waypoints")
    return photos or places


def _taken(route: Iterable[tuple[str, Any, Any, Any, int, float | None]]) -> list[Place]:
    """Positions of photos of a WPML route: photos at waypoints, and one photo per spacing between
    waypoints.
    """
    places: list[Place] = []
    photos: list[Place] = []
    spacing_m = gone_m = 0.0
    for where, latitude, longitude, altitude, shots, switch in route:
        place = _place(where, latitude, longitude, altitude)
        if places and spacing_m:
            passed, gone_m = _passed(places[-1], place, spacing_m, gone_m)
            photos += passed
        if switch is not None:
            spacing_m, gone_m = switch, 0.0
        photos += [place] * shots
        places.append(place)
    return photos or places


def _passed(
    start: Place, stop: Place, spacing_m: float, gone_m: float
) -> tuple[list[Place], float]:
    """Positions of the photos that a distance trigger takes on a leg, and the distance between the
    last photo and the end of the leg.

    `gone_m` is the distance between the last photo before the leg and the start of the leg.
    """
    from aosplan.geodesy import to_local
    from aosplan.grid.patterns import MOST_SITES

    (east,), (north,) = to_local(
        (start.latitude, start.longitude), [stop.latitude], [stop.longitude]
    )
    length = math.hypot(east, north)
    count = math.floor((gone_m + length) / spacing_m + AT_END)
    if count > MOST_SITES:
        raise RequestError(
            f"a photo every {spacing_m:g} m would be {count:,} photos on one leg of {length:.4g} m"
        )
    turn = math.remainder(stop.longitude - start.longitude, 360.0)
    photos = []
    for number_ in range(1, count + 1):
        share = min((number_ * spacing_m - gone_m) / length, 1.0)
        height = start.altitude_m
        if height is not None and stop.altitude_m is not None:
            height += share * (stop.altitude_m - height)
        photos.append(
            Place(
                start.latitude + share * (stop.latitude - start.latitude),
                math.remainder(start.longitude + share * turn, 360.0),
                height,
            )
        )
    return photos, gone_m + length - count * spacing_m


AT_END = 0.01
"""Tolerance for the photo at the end of a leg. The photo is counted even if the leg is shorter than
it should be by this share of a spacing.
"""


def _is_set(value: Any) -> bool:
    """Whether a parameter is a number other than zero."""
    try:
        return bool(float(value))
    except (TypeError, ValueError):
        return False


def _check_frame(where: str, command: int, frame: Any) -> None:
    """Refuse a position in metres of a local frame."""
    if command in PLACING and number(frame, f"{where} frame") not in GLOBAL_FRAMES:
        raise RequestError(
            f"{where} frame {frame} is not one of latitude and longitude",
            f"frames are {', '.join(map(str, sorted(GLOBAL_FRAMES)))}",
        )


def _rows(path: str) -> Iterator[tuple[str, int, Sequence[Any]]]:
    """Commands of a ``.waypoints`` file.  The first row, which is the home position, is skipped."""
    lines = text_of(read_bytes(path), path).split("\n")
    if not lines[0].startswith("QGC WPL 1"):
        raise RequestError(f"'{path}' does not begin with QGC WPL 110")
    # Parrot's files do not have a row for the home position.
    first = 1 if path.lower().endswith(".mavlink") else 2
    for line_number, line in enumerate(lines[first:], first + 1):
        fields = line.split()
        if not fields or line.startswith("#"):
            continue
        where = f"'{path}', line {line_number}:"
        if len(fields) != 12:
            raise RequestError(f"{where} {len(fields)} fields, not 12")
        command = _code(fields[3], where)
        _check_frame(where, command, fields[2])
        yield where, command, fields[4:11]


def _items(path: str) -> Iterator[tuple[str, int, Sequence[Any]]]:
    """Commands of a ``.plan`` file."""
    mission = read_table(path).get("mission")
    items = mission.get("items") if isinstance(mission, dict) else None
    if not isinstance(items, list):
        raise RequestError(f"'{path}' has no mission with items: it is not a QGroundControl plan")
    for index, item in enumerate(items, 1):
        where = f"'{path}', item {index}:"
        kind = item.get("type") if isinstance(item, dict) else None
        if kind != "SimpleItem":
            raise RequestError(
                f"{where} {kind!r} is not a SimpleItem",
                "save surveys of QGroundControl as .waypoints, which lists each position",
            )
        params = item.get("params")
        if not isinstance(params, list) or len(params) != 7:
            raise RequestError(f"{where} params are not seven values")
        command = _code(item.get("command"), where)
        _check_frame(where, command, item.get("frame", mav.RELATIVE))
        yield where, command, params


def _code(value: Any, where: str) -> int:
    code = number(value, f"{where} command")
    if code != int(code):
        raise RequestError(f"{where} command {code:g} is not a whole number")
    return int(code)


def _points(path: str) -> Iterator[tuple[Any, ...]]:
    """Points of a GeoJSON file. If the file has no points, the vertices of its lines
    are returned.
    """
    table = read_table(path, with_nan=True)
    _check_crs(table, f"'{path}':")
    features = table.get("features")
    if not isinstance(features, list):
        raise RequestError(f"'{path}' is not a GeoJSON FeatureCollection")
    found: dict[str, list[tuple[Any, ...]]] = {"Point": [], "LineString": []}
    for index, feature in enumerate(features, 1):
        where = f"'{path}', feature {index}:"
        geometry = feature.get("geometry") if isinstance(feature, dict) else None
        properties = feature.get("properties") if isinstance(feature, dict) else None
        kind = geometry.get("type") if isinstance(geometry, dict) else None
        if not isinstance(kind, (str, type(None))):
            raise RequestError(f"{where} geometry type {shown(kind)} is not a name")
        if kind not in found or (isinstance(properties, dict) and properties.get("photo") is False):
            continue
        assert isinstance(geometry, dict)  # The geometry has a type, so it is a dictionary.
        for node in (feature, geometry):
            _check_crs(node, where)
        coordinates = geometry.get("coordinates")
        for place in [coordinates] if kind == "Point" else _listed(coordinates, where):
            found[kind].append((where, *_coordinates(place, where)))
    yield from found["Point"] or found["LineString"]


def _check_crs(node: dict[str, Any], where: str) -> None:
    """Refuse positions in another coordinate reference system than WGS 84."""
    crs = node.get("crs")
    facts = crs.get("properties") if isinstance(crs, dict) else None
    name = facts.get("name") if isinstance(facts, dict) else crs
    if crs and not (isinstance(name, str) and is_wgs84(name)):
        raise RequestError(
            f"{where} crs {shown(name)} is not WGS 84",
            "ogr2ogr -t_srs EPSG:4326 points.geojson FILE",
        )


def _listed(value: Any, where: str) -> list[Any]:
    if not isinstance(value, list):
        raise RequestError(f"{where} coordinates are not a list")
    return value


def _coordinates(value: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(value, list) or not 2 <= len(value) <= 3:
        raise RequestError(f"{where} coordinates are not longitude, latitude and altitude")
    return (value[1], value[0], *value[2:])


NAMES_M = (("east_m", "north_m"), ("x_m", "y_m"), ("x", "y"), ("east", "north"))
"""Names that the two columns of positions in metres may have."""

FARTHEST_M = 1e9
"""Greatest distance of a position from its origin."""


def read_positions(path: str) -> list[tuple[float, float]]:
    """Read positions [m] from a CSV with a header, such as aosplan's waypoints, or from a mission.

    Positions in missions and ``.geojson`` files are converted to metres east and north of the first
    position.

    Raises
    ------
    RequestError
        If the header does not contain the names of two columns of positions, if there are no rows,
        or if a row does not have two numbers. The message gives the line.
    """
    from aosplan.postflight.positions_file import SUFFIXES, local_m, read_places

    if os.path.splitext(path)[1].lower() in SUFFIXES:
        places = read_places(path)
        return list(zip(*local_m(places, places[0][:2], path, "the first"), strict=True))
    points = positions_of(read_csv(path))
    if not points:
        raise RequestError(f"'{path}' contains no positions")
    return points


class PositionTable(NamedTuple):
    """A CSV file: the names of its columns, and its rows with their places in the file.

    Rows whose column ``photo`` is false are left out.
    """

    path: str
    header: list[str]
    rows: list[tuple[str, list[str]]]

    def pair(self, pairs: tuple[tuple[str, str], ...]) -> tuple[str, str] | None:
        """The first pair of names for which both columns exist."""
        return next((pair for pair in pairs if set(pair) <= set(self._names)), None)

    def columns(
        self, pairs: tuple[tuple[str, str], ...], thirds: tuple[str, ...] = ()
    ) -> list[tuple[str, list[str]]]:
        """Values of two columns, and of a third column if it exists, with the place of each row in
        the file.

        Raises
        ------
        RequestError
            If there are no such columns, or if a row is too short.
        """
        pair = self.pair(pairs)
        if pair is None:
            wanted = ", or ".join(f"{one} and {other}" for one, other in pairs[::2])
            raise RequestError(
                f"'{self.path}' has no columns {wanted}",
                "the first line names the columns, separated by commas",
            )
        third = [name for name in thirds if name in self._names][:1]
        columns = [self._names.index(name) for name in (*pair, *third)]
        for where, row in self.rows:
            if len(row) <= max(columns):
                raise RequestError(f"{where} {len(row)} values are too few")
        return [(where, [row[column] for column in columns]) for where, row in self.rows]

    @property
    def _names(self) -> list[str]:
        return [name.strip().lower() for name in self.header]


def read_csv(path: str) -> PositionTable:
    """Read a CSV file with a header.

    Raises
    ------
    RequestError
        If the file is not a CSV file with a header.  The message gives the line.
    """
    text = text_of(read_bytes(path), path)
    reader = csv.reader(io.StringIO(text, newline=""))
    rows = []
    try:
        header = next(reader, [])
        names = [name.strip().lower() for name in header]
        photo = names.index("photo") if "photo" in names else None
        for row in reader:
            where = f"'{path}', line {reader.line_num}:"
            if not any(cell.strip() for cell in row):
                continue
            if row and len(row) <= (photo or 0):
                raise RequestError(f"{where} {len(row)} values are too few")
            if row and (photo is None or row[photo].strip().lower() not in {"false", "0"}):
                rows.append((where, row))
    except csv.Error as error:
        raise RequestError(f"'{path}', line {reader.line_num}: {error}") from None
    return PositionTable(path, header, _photographed(names, rows))


def _photographed(
    names: list[str], rows: list[tuple[str, list[str]]]
) -> list[tuple[str, list[str]]]:
    """Rows with photos. For a Litchi mission that takes photos, there is one row per photo. For
    other files, all rows are returned.
    """
    actions = [place for place, name in enumerate(names) if name.startswith("actiontype")]
    columns = [
        names.index(name) if name in names else -1
        for name in ("latitude", "longitude", "altitude(m)", "photo_distinterval")
    ]
    if not actions or min(columns[:2]) < 0:
        return rows
    photos: list[tuple[str, list[str]]] = []
    spacing_m, gone_m, last = 0.0, 0.0, None
    for where, row in rows:
        values = [row[k] if 0 <= k < len(row) else None for k in columns]
        point = _place(where, *values[:3])
        if last is not None and spacing_m:
            passed, gone_m = _passed(last, point, spacing_m, gone_m)
            photos += [(where, _moved(row, columns, place)) for place in passed]
        every = max(0.0, number(values[3], f"{where} photo_distinterval")) if values[3] else 0.0
        if every != spacing_m:
            spacing_m, gone_m = every, 0.0
            photos += [(where, row)] if every else []
        if any(row[place].strip() == "1" for place in actions if place < len(row)):
            photos.append((where, row))
        last = point
    return photos or rows


def _moved(row: list[str], columns: list[int], place: Place) -> list[str]:
    """A row with its position replaced."""
    moved = list(row)
    for column, value in zip(columns, place, strict=False):
        if 0 <= column < len(row) and value is not None:
            moved[column] = repr(value)
    return moved


def positions_of(table: PositionTable) -> list[tuple[float, float]]:
    """Positions [m] from the columns of a table."""
    return [_position(where, *values) for where, values in table.columns(NAMES_M)]


def _position(where: str, *values: str) -> tuple[float, float]:
    x, y = (number(value, f"{where} value") for value in values)
    if max(abs(x), abs(y)) > FARTHEST_M:
        raise RequestError(f"{where} {x:g}, {y:g} is more than {FARTHEST_M:g} m from the origin")
    return x, y
