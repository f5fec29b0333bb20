"""Coordinate reference systems of LAS and LAZ files, read from all records that may state them.

A file has WKT or GeoTIFF keys. They are in the variable length records before the points, or in the
extended records after the points. If both exist, the WKT bit of the header decides which applies
(LAS 1.4 R15, 2.4 and 2.6.2). With GeoTIFF keys, the unit of x and y is stated by key 3076 or by the
projected system (key 3072). The unit of z is stated by key 4099 or by the vertical system (key
4096).
"""

from __future__ import annotations

import os
import struct
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from aosplan import crs as reference
from aosplan.crs import Units, are_same, unit_text
from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pyproj import CRS

    Warned = tuple[str, str]

WKT, GEO_KEYS, GEO_DOUBLES, GEO_ASCII = 2112, 34735, 34736, 34737
"""Ids of the records with the user id LASF_Projection."""

MODEL, GEODETIC, PROJECTED, UNIT, UNIT_SIZE, VERTICAL, VERTICAL_UNIT = (
    1024, 2048, 3072, 3076, 3077, 4096, 4099,
)  # fmt: skip
"""Numbers of GeoTIFF keys."""

USER_DEFINED = 32767
WITHOUT_UNIT = range(5001, 5200)
"""Values of key 4096 that GeoTIFF 1.0 uses for ellipsoids and datums, which have no unit."""

MOST_BYTES = 1 << 20
"""Longest record that is read as a coordinate reference system."""


class UnclearUnitError(RequestError):
    """The units that a file states are ambiguous or unreadable."""


class Reference(NamedTuple):
    """The coordinate reference system and units that a file states.

    Attributes
    ----------
    units
        Metres in the unit of x and y, and in the unit of z; None if the file does not state it.
    horizontal
        System of x and y, if there is one and it can be read.
    vertical
        Name of the system of z, if the file states it.
    unreadable
        Text that continues a sentence after the name of the file. It tells which part of the
        reference cannot be read, and is empty if everything can be read.
    warnings
        Codes, and sentences that continue after the name of the file.
    """

    units: Units = Units(None, None)
    horizontal: CRS | None = None
    vertical: str | None = None
    unreadable: str = ""
    warnings: tuple[Warned, ...] = ()


def metres_of(found: Reference, given: Units | None) -> tuple[Units, list[Warned]]:
    """Units for every axis, and warnings about assumptions and conversions.

    Each warning is the end of a sentence that begins with the name of the file.

    Parameters
    ----------
    found
        The statements of the file.
    given
        Units from the user, which override those that the file states.
    """
    if given is not None:
        return given, []
    across_m, up_m = found.units
    doubts = list(found.warnings)
    if found.unreadable:
        message = f"{found.unreadable}; metres are assumed, unless --units is given"
        doubts.append(("crs_unreadable", message))
    elif across_m is None:
        message = "does not state the unit of x and y; metres are assumed, unless --units is given"
        doubts.append(("units_assumed", message))
    across_m = across_m or 1.0
    if up_m is None and not are_same(across_m, 1.0):
        doubts.append(
            (
                "vertical_units_assumed",
                f"does not state the unit of z: {unit_text(across_m)} are assumed, as for "
                "x and y, unless --units is given",
            )
        )
    up_m = up_m or across_m
    if not (across_m == up_m == 1.0):
        both = f"is in {unit_text(across_m)}"
        if up_m != across_m:
            both = f"has x and y in {unit_text(across_m)} and z in {unit_text(up_m)}"
        doubts.append(("units_converted", f"{both}; its coordinates were converted to metres"))
    return Units(across_m, up_m), doubts


def read_reference(header: Any, stream: IO[bytes], name: str) -> Reference:
    """The coordinate reference system and units that a file states, from laspy's header and the
    file.

    Raises
    ------
    RequestError
        If the coordinates are not in a plane, if two statements about a unit contradict each other,
        or if the extended records are beyond the end of the file.
    """
    records = [
        (int(record.record_id), record.record_data_bytes())
        for record in header.vlrs
        if record.user_id.rstrip("\0 ") == "LASF_Projection"
    ]
    records += _extended(stream, name)
    by_id: dict[int, bytes] = {}
    for number, data in records:
        by_id.setdefault(number, data)
    what = f"point cloud {name}"
    readers = {WKT: _of_wkt, GEO_KEYS: _of_keys}
    order = (WKT, GEO_KEYS) if header.global_encoding.wkt else (GEO_KEYS, WKT)
    stated = [
        readers[number](by_id, what) for number in order if by_id.get(number, b"").strip(b"\0 ")
    ]
    if not stated:
        return Reference()
    first, *others = sorted(stated, key=lambda each: bool(each.unreadable))
    for other in others:
        if other.unreadable:
            continue
        for axes, one, two in zip(("x and y", "z"), first.units, other.units, strict=True):
            if one and two and not are_same(one, two):
                message = (
                    f"states {axes} twice, in {unit_text(one)} and in {unit_text(two)}; the "
                    "first unit is used because of the WKT bit in the header"
                )
                first = first._replace(
                    warnings=(*first.warnings, ("crs_contradicts_itself", message))
                )
    return first


def _extended(stream: IO[bytes], name: str) -> Iterator[tuple[int, bytes]]:
    """The extended records that describe coordinates.  Other extended records are skipped."""
    size = os.fstat(stream.fileno()).st_size
    stream.seek(0)
    head = stream.read(375)
    if len(head) < 375 or head[25] < 4:
        return
    start, count = struct.unpack_from("<QI", head, 235)
    for _ in range(count):
        if not 0 < start <= size - 60:
            raise RequestError(
                f"point cloud {name} is truncated: according to its header, {count} "
                "extended records follow its points, but some are missing"
            )
        stream.seek(start)
        user, number, length = struct.unpack_from("<2x16sHQ", stream.read(60))
        if user.rstrip(b"\0 ") == b"LASF_Projection" and length <= MOST_BYTES:
            yield number, stream.read(length)
        start += 60 + length


def _of_wkt(records: dict[int, bytes], what: str) -> Reference:
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    text = records[WKT].split(b"\0")[0].decode("utf-8", "replace").strip()
    try:
        crs = CRS.from_wkt(text)
    except CRSError:
        if reference.reads_like_feet(text):
            raise _unknown_unit(
                what, "its coordinate reference system cannot be read, and its text mentions feet"
            ) from None
        return Reference(unreadable="has a coordinate reference system whose WKT cannot be read")
    units = reference.units_of(crs, what)
    return Reference(units, reference.horizontal(crs), reference.vertical_name(crs))


def _of_keys(records: dict[int, bytes], what: str) -> Reference:
    keys = _keys(records)
    citation = records.get(GEO_ASCII, b"").decode("ascii", "replace")
    code = _value(keys, PROJECTED)
    if _value(keys, MODEL) in (2, 3) or (
        code is None and _value(keys, MODEL) is None and _value(keys, GEODETIC) is not None
    ):
        raise RequestError(
            f"the coordinates of {what} are not distances on a plane, because its coordinate "
            "reference system is geographic or geocentric",
            "reproject it to a projected system in metres, such as UTM",
        )
    plane = None if code is None or code == USER_DEFINED else _crs(code)
    by_system = Units(None, None) if plane is None else reference.units_of(plane, what)
    by_key = _unit(keys, records)
    across_m = _agreed(by_key, by_system.across_m, "x and y", (UNIT, PROJECTED), what)
    vertical_code, vertical = _value(keys, VERTICAL), None
    if vertical_code and vertical_code != USER_DEFINED and vertical_code not in WITHOUT_UNIT:
        vertical = _crs(vertical_code)
        if vertical is None or not vertical.is_vertical:
            raise _unknown_unit(
                what, f"its vertical coordinate reference system, EPSG {vertical_code}, is unknown"
            )
    by_vertical = None if vertical is None else reference.vertical_unit_m(vertical, what)
    up_code = _value(keys, VERTICAL_UNIT)
    up_key = None if up_code is None else reference.unit_of_code_m(up_code)
    up_m = _agreed(up_key, by_vertical, "z", (VERTICAL_UNIT, VERTICAL), what) or by_system.up_m
    unreadable = ""
    if across_m is None and (code is not None or _value(keys, MODEL) is not None):
        if reference.reads_like_feet(citation):
            raise _unknown_unit(
                what, f"its GeoTIFF keys do not contain a known unit of x and y, and {citation!r}"
            )
        unreadable = "has GeoTIFF keys that do not contain a known unit of x and y"
    return Reference(
        Units(across_m, up_m),
        None if plane is None else reference.horizontal(plane),
        None if vertical is None else str(vertical.name),
        unreadable,
    )


def _keys(records: dict[int, bytes]) -> dict[int, tuple[int, int]]:
    """Location and value of each key in the GeoTIFF key directory."""
    data = records[GEO_KEYS]
    if len(data) < 8:
        return {}
    (count,) = struct.unpack_from("<H", data, 6)
    rows = struct.iter_unpack("<4H", data[8 : 8 + 8 * min(count, (len(data) - 8) // 8)])
    return {key: (place, value) for key, place, _, value in rows}


def _value(keys: dict[int, tuple[int, int]], key: int) -> int | None:
    """Value of a key that is a short integer; None if it is missing or undefined."""
    place, value = keys.get(key, (0, 0))
    return value if place == 0 and value != 0 else None


def _unit(keys: dict[int, tuple[int, int]], records: dict[int, bytes]) -> float | None:
    """Metres in the unit of x and y, from the keys for this unit: the code of a unit, or its size
    in metres.
    """
    code = _value(keys, UNIT)
    if code is None:
        return None
    place, index = keys.get(UNIT_SIZE, (0, 0))
    doubles = records.get(GEO_DOUBLES, b"")
    if code == USER_DEFINED and place == GEO_DOUBLES and len(doubles) >= 8 * (index + 1):
        (size_m,) = struct.unpack_from("<d", doubles, 8 * index)
        return size_m if 1e-6 < size_m < 1e6 else None
    return reference.unit_of_code_m(code)


def _agreed(
    by_key: float | None, by_system: float | None, axes: str, keys: tuple[int, int], what: str
) -> float | None:
    """The unit of some axes. It may be stated twice: by the key of the unit and by the coordinate
    reference system.

    Raises
    ------
    RequestError
        If the two statements contradict each other.
    """
    if by_key and by_system and not are_same(by_key, by_system):
        raise _unknown_unit(
            what,
            f"{axes} are in {unit_text(by_key)} according to its GeoTIFF key {keys[0]}, but in "
            f"{unit_text(by_system)} according to key {keys[1]}",
        )
    return by_key or by_system


def _crs(code: int) -> CRS | None:
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    for authority in ("EPSG", "ESRI"):
        try:
            return CRS.from_authority(authority, code)
        except CRSError:
            continue
    return None


def _unknown_unit(what: str, why: str) -> UnclearUnitError:
    return UnclearUnitError(f"the unit of {what} is not known: {why}", reference.ASK)
