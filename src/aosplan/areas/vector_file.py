"""Reading of boundaries from GeoPackage, shapefile, GPX, FlatGeobuf and MapInfo files with pyogrio.

GPX files have no polygons.  The closed tracks and routes in these files are used as boundaries.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from aosplan.areas.reprojection import Reprojection, reprojection
from aosplan.errors import RequestError, needs_extra
from aosplan.files import decoding
from aosplan.messages import Message

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Rings = list[NDArray[np.float64]]

EXTRA = "vector"
MAGIC = (b"SQLite format 3\0", b"\x00\x00\x27\x0a", b"fgb\x03")
SUFFIXES = (".gpkg", ".shp", ".gpx", ".fgb", ".tab", ".mif")
"""Extensions of the files that GDAL is allowed to open.  Other formats may refer to further files
or servers.
"""

OPEN_SHARE = 0.1
"""A track is closed if the distance between its ends is less than this share of its length."""


def is_vector_file(path: str, start: bytes) -> bool:
    """Whether the first bytes or the extension of a file show that pyogrio has to read it."""
    if start.startswith(MAGIC) or b"<gpx" in start[:2000]:
        return True
    return path.lower().endswith((".tab", ".mif"))


def read_vectors(path: str) -> Iterator[tuple[Rings | None, str, Message | None]]:
    """Yield the polygons of a file as rings of longitude and latitude, with their place and
    notices.

    For a geometry without an area, None and the kind of the geometry are yielded.

    Raises
    ------
    RequestError
        If the file is damaged, or has no coordinate reference system.
    MissingExtraError
        If pyogrio is not installed.
    """
    if not path.lower().endswith(SUFFIXES):
        raise RequestError(
            f"'{path}' is a vector file, but its name does not have the extension of a vector file",
            f"extensions: {', '.join(SUFFIXES)}",
        )
    with needs_extra(f"area '{path}'", EXTRA):
        import pyogrio
        from pyogrio import raw
    with decoding("area", path):
        layers = [str(name) for name, kind in pyogrio.list_layers(path) if kind is not None]
        read = [raw.read(path, layer=layer, columns=[], force_2d=True) for layer in layers]
    for layer, (facts, _, geometries, _) in zip(layers, read, strict=True):
        if geometries is None or len(geometries) == 0 or layer.endswith("_points"):
            continue
        crs = facts.get("crs")
        if not crs:
            raise RequestError(
                f"'{path}' does not state its coordinate reference system",
                "for a shapefile, add the .prj file, which contains it",
            )
        change = reprojection(str(crs), path)
        if change is not None:
            yield None, "", change.notice
        with decoding("area", path):
            shapes = shapely.from_wkb(geometries)
        for index, shape in enumerate(shapes):
            yield from _polygons(shape, f"{layer} {index}", change, path)


def _polygons(
    shape: Any, place: str, change: Reprojection | None, path: str
) -> Iterator[tuple[Rings | None, str, Message | None]]:
    if shape is None or shape.is_empty:
        return
    parts = shapely.get_parts(shapely.get_parts(shape))
    if shape.geom_type in ("LineString", "MultiLineString") and path.lower().endswith(".gpx"):
        parts = [shapely.LineString(np.concatenate([shapely.get_coordinates(p) for p in parts]))]
    for part in parts:
        if part.geom_type == "Polygon":
            rings = [part.exterior, *part.interiors]
            yield (
                [
                    _degrees(shapely.get_coordinates(ring), change, f"'{path}': {place}")
                    for ring in rings
                ],
                place,
                None,
            )
        elif path.lower().endswith(".gpx") and _comes_back(part):
            ring = shapely.get_coordinates(part)
            message = (
                f"'{path}': {place}, a track or route, returns to its start, so it was closed and "
                "is used as an outline"
            )
            yield [np.concatenate([ring, ring[:1]])], place, Message("track_closed", message)
        else:
            yield None, part.geom_type, None


def _degrees(
    ring: NDArray[np.float64], change: Reprojection | None, place: str
) -> NDArray[np.float64]:
    return ring if change is None else change.degrees(ring, place)


def _comes_back(line: Any) -> bool:
    """Whether a track is closed."""
    points = shapely.get_coordinates(line)
    gap = float(np.hypot(*(points[-1] - points[0])))
    return len(points) >= 4 and gap < OPEN_SHARE * line.length
