"""Areas: conversion of boundaries on earth to valid polygons in a local frame in metres.

The local frame is an azimuthal equidistant projection around the centre of the area
(`aosplan.geodesy`).  At the distance r from the centre, lengths between neighbouring points have a
relative error of at most r²/(6 R²), where R is the radius of the earth.  This is 1.6e-6 at the
distance `FARTHEST_M`.  The edges of a boundary are straight in longitude and latitude, along the
short way around the earth.  In metres they are curved.  Long edges are therefore divided until the
error is at most `BEND_M`.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely

from aosplan.areas.around_points import read_surroundings
from aosplan.areas.boundary_file import Outline, listed, read_outline
from aosplan.areas.crossings import cross_often
from aosplan.errors import RequestError
from aosplan.geodesy import to_local, to_wgs84
from aosplan.messages import Message

if TYPE_CHECKING:
    from numpy.typing import NDArray

FARTHEST_M = 20_000.0
"""Greatest distance between a point of an area and the centre of the area."""

BEND_M = 0.01
"""Largest deviation [m] between an edge that is straight in the local frame and an edge that is
straight in longitude and latitude.
"""

MOST_VERTICES = 20_000
"""A boundary is simplified if it has more vertices than this."""

TOLERANCES_M = (0.1, 0.3, 1.0, 3.0, 10.0)
"""Tolerances of the simplification.  They are tried in this order until the number of vertices is
small enough.
"""

EARTH_RADIUS_M = 6.371e6

NEARBY_M = 5.0 * FARTHEST_M
"""If no-fly zones or clear parts are farther from the area than this, their latitude and longitude
may be swapped.
"""

MARGIN_M = 0.1
"""Distance that is added to the buffer around no-fly zones, because formats round coordinates."""

THINNEST_M = 0.001
"""A polygon that is thinner than this is treated as having no area."""

SLIVER_M = 0.5
SLIVER_SHARE = 0.001
"""A part of an area is a sliver if it is narrow and its share of the area is at most this."""

MOST_MENDED = 1000
"""A boundary that crosses itself is repaired if the number of crossings is at most this."""

MOST_CROSSINGS = 200_000
"""Largest number of crossings between boundaries. Each crossing needs about 1 kB of memory."""

_ARC_SEGMENTS = 8
_ARC_RATIO = 1.01 / math.cos(0.75 * math.pi / (2 * _ARC_SEGMENTS))
"""The distance of a buffer is multiplied by this factor before GEOS computes the buffer. GEOS
replaces arcs by chords, so a buffer without this factor would not contain the exact buffer. A chord
spans at most one and a half times the angle of a segment, which is a quarter turn divided by
`_ARC_SEGMENTS`. Corners of the boundary may be cut off by up to 1 % of the distance.
"""


quiet = np.errstate(divide="ignore", invalid="ignore")
"""Context manager that suppresses NumPy's floating-point warnings. GEOS leaves floating-point flags
set, for which NumPy would print warnings.
"""


class Area(NamedTuple):
    """The area to cover and the no-fly zones, in metres east and north of `origin`.

    Attributes
    ----------
    origin
        Latitude and longitude of the centre of the area's bounds.
    whole
        The area.  All shapes are shapely geometries.
    canopy
        Part of the area that has to be seen from N sites.
    clear
        Part of the area that has to be seen from one site.
    keep_out
        No-fly zones with their buffer.
    simplified_m
        Largest distance by which simplification moved the boundaries.  The area and the no-fly
        zones can only become larger, and clear parts only smaller.
    notices
        Notices from reading the files.
    """

    origin: tuple[float, float]
    whole: Any
    canopy: Any
    clear: Any
    keep_out: Any
    simplified_m: float
    notices: tuple[Message, ...]

    @property
    def radius_m(self) -> float:
        """Distance between the origin and the farthest vertex."""
        return float(np.hypot(*shapely.get_coordinates(self.whole).T).max())

    @property
    def projection_error(self) -> float:
        """Largest relative error of lengths between neighbours in the local frame."""
        return self.radius_m**2 / (6.0 * EARTH_RADIUS_M**2)


@quiet
def read_area(
    path: str,
    *,
    around_m: float | None = None,
    clear: str | None = None,
    no_fly: str | None = None,
    buffer_m: float = 0.0,
) -> Area:
    """Read an area from files: its boundary, parts without canopy, and no-fly zones.

    Parameters
    ----------
    path
        GeoJSON, KML or KMZ file with polygons.  The area is their union.
    around_m
        If given, the area is all ground within this distance of the points in the file, and the
        polygons are not used.
    clear
        File with parts without canopy.  Only their intersection with the area is used.
    no_fly
        File with zones that neither sites nor legs may touch.
    buffer_m
        Distance that the drone keeps from the zones.

    Raises
    ------
    RequestError
        If a file is not valid, a boundary crosses itself, or the area is too large.
    """
    outline = read_outline(path) if around_m is None else read_surroundings(path, around_m)
    origin = _middle(outline)
    united, slivers = _without_slivers(_united(outline, origin), outline)
    whole, moved = _simplified(united, outward=True)
    _check_reach(shapely.get_coordinates(whole), outline, FARTHEST_M)
    notices = [*_ignored(outline), *slivers]
    clear_part, keep_out = shapely.Polygon(), shapely.Polygon()
    if clear is not None:
        clear_outline = read_outline(clear)
        notices += _ignored(clear_outline)
        clear_whole, moved_clear = _simplified(_united(clear_outline, origin), outward=False)
        _check_overlay(whole, clear_whole, clear)
        clear_part = polygons_of(shapely.intersection(whole, clear_whole))
        moved = max(moved, moved_clear)
        if clear_part.is_empty:
            notices.append(_elsewhere(clear_outline, clear_whole, "clear part", whole, origin))
    if no_fly is not None:
        zones = read_outline(no_fly)
        notices += _ignored(zones)
        keep_out, moved_zones = _simplified(_united(zones, origin), outward=True)
        _check_overlay(whole, keep_out, no_fly)
        keep_out = grown(keep_out, buffer_m)
        moved = max(moved, moved_zones)
        if shapely.distance(keep_out, whole) > 1000.0:
            notices.append(_elsewhere(zones, keep_out, "no-fly zone", whole, origin))
    return Area(
        origin=origin,
        whole=whole,
        canopy=polygons_of(shapely.difference(whole, clear_part)),
        clear=clear_part,
        keep_out=keep_out,
        simplified_m=moved,
        notices=tuple(notices),
    )


def _check_overlay(whole: Any, shape: Any, path: str) -> None:
    if cross_often([whole, shape], MOST_CROSSINGS):
        raise RequestError(
            f"the outlines of '{path}' cross the outlines of the area too often",
            "simplify them first",
        )


def grown(shape: Any, distance_m: float) -> Any:
    """Extend a shape by a distance. The extension is at least the exact distance, and at most 3 %
    larger.
    """
    if distance_m == 0.0 or shape.is_empty:
        return shape
    return _widened(shape, distance_m)


def _widened(shape: Any, distance_m: float) -> Any:
    return shapely.buffer(shape, distance_m * _ARC_RATIO, quad_segs=_ARC_SEGMENTS)


def polygons_of(shape: Any) -> Any:
    """The polygons of a shape, without the points and lines that an overlay may produce."""
    parts = shapely.get_parts(shapely.get_parts(shape))
    parts = parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]
    return shapely.multipolygons(parts)


def long_side_deg(shape: Any) -> float:
    """Direction of the longer side of the smallest rectangle around a shape.

    The direction is in degrees clockwise from north, at least 0 and below 180, rounded to 0.01. The
    number of flight lines is smallest if the lines have this direction.
    """
    corners = shapely.get_coordinates(shapely.oriented_envelope(shape))
    sides = np.diff(corners[:3], axis=0)
    east, north = sides[np.argmax(np.hypot(*sides.T))]
    return round(math.degrees(math.atan2(east, north)), 2) % 180.0


def _ignored(outline: Outline) -> list[Message]:
    if not outline.ignored:
        return outline.notices
    text = listed(outline.ignored)
    return [
        *outline.notices,
        Message(
            "ignored_geometry", f"{text} of '{outline.path}' have no area, so they are left out"
        ),
    ]


def _without_slivers(shape: Any, outline: Outline) -> tuple[Any, list[Message]]:
    """The polygons of an area without slivers.  Slivers result from inaccurate drawing."""
    parts = shapely.get_parts(shape)
    area_m2 = shapely.area(parts)
    thin = 2.0 * area_m2 < SLIVER_M * shapely.length(parts)
    thin &= area_m2 < SLIVER_SHARE * area_m2.sum()
    if not thin.any() or thin.all():
        return shape, []
    message = (
        f"{int(thin.sum())} of {len(parts)} parts of '{outline.path}' are slivers (narrower "
        f"than {SLIVER_M:g} m, with a total area of {float(area_m2[thin].sum()):.2g} m²), so "
        "they are left out"
    )
    return shapely.multipolygons(parts[~thin]), [Message("slivers", message)]


def _elsewhere(
    outline: Outline, shape: Any, what: str, whole: Any, origin: tuple[float, float]
) -> Message:
    """Make the warning that the shape in a file does not overlap the area.

    Raises
    ------
    RequestError
        If the shape is far away, but would be near if latitude and longitude were swapped.
    """
    apart = float(shapely.distance(shape, whole))
    swapped = np.concatenate([ring[:, ::-1] for rings in outline.polygons for ring in rings])
    if apart > NEARBY_M and np.abs(swapped[:, 1]).max() <= 90.0:
        points = _local(swapped, origin)
        if np.hypot(*points.T).min() < NEARBY_M:
            raise RequestError(
                f"'{outline.path}' is {apart / 1000.0:.4g} km from the area; with latitude "
                "and longitude swapped, it would be near the area",
                "give the longitude before the latitude",
            )
    return Message("elsewhere", f"no {what} of '{outline.path}' is near the area")


def _middle(outline: Outline) -> tuple[float, float]:
    """The origin of an area's local frame: the centre of its bounds."""
    positions = np.concatenate([rings[0] for rings in outline.polygons])
    longitude, latitude = np.radians(positions).T
    mean = (
        (np.cos(latitude) * np.cos(longitude)).mean(),
        (np.cos(latitude) * np.sin(longitude)).mean(),
        np.sin(latitude).mean(),
    )
    place = (
        math.degrees(math.atan2(mean[2], math.hypot(mean[0], mean[1]))),
        math.degrees(math.atan2(mean[1], mean[0])),
    )
    points = _local(positions, place)
    _check_reach(points, outline, 2.0 * FARTHEST_M)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    latitudes, longitudes = to_wgs84(place, [float(middle[0])], [float(middle[1])])
    return round(latitudes[0], 9), round(longitudes[0], 9)


def _check_reach(points: NDArray[np.float64], outline: Outline, most_m: float) -> None:
    farthest = np.hypot(*points.T).max()
    if farthest > most_m:
        raise RequestError(
            f"area '{outline.path}' reaches {farthest / 1000.0:.4g} km from its "
            f"middle, more than the {FARTHEST_M / 1000.0:g} km that a plan can cover",
            "give the longitude before the latitude; divide a large area into several plans",
        )


def _local(ring: NDArray[np.float64], origin: tuple[float, float]) -> NDArray[np.float64]:
    return np.column_stack(to_local(origin, ring[:, 1].tolist(), ring[:, 0].tolist()))


def _bent(ring: NDArray[np.float64], origin: tuple[float, float]) -> NDArray[np.float64]:
    """A ring in metres. Its edges are divided, so that straight lines in metres deviate from the
    edges in degrees by at most `BEND_M`.
    """
    # Longitudes change along the short way around the earth.
    steps = (np.diff(ring[:, 0]) + 180.0) % 360.0 - 180.0
    degrees = np.column_stack([ring[0, 0] + np.append(0.0, np.cumsum(steps)), ring[:, 1]])
    for _ in range(6):
        points = _local(degrees, origin)
        between = 0.5 * (degrees[:-1] + degrees[1:])
        bend = np.hypot(*(_local(between, origin) - 0.5 * (points[:-1] + points[1:])).T)
        if not (bend > BEND_M).any():
            break
        pieces = np.minimum(np.ceil(np.sqrt(np.maximum(bend / BEND_M, 1.0))), 4096).astype(int)
        edge = np.repeat(np.arange(len(pieces)), pieces)
        share = (np.arange(len(edge)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[
            edge
        ]
        inner = degrees[edge] + share[:, None] * (degrees[edge + 1] - degrees[edge])
        degrees = np.concatenate([inner, degrees[-1:]])
    points[-1] = points[0]
    return np.round(points, 7)


def _united(outline: Outline, origin: tuple[float, float]) -> Any:
    """The union of a boundary's polygons in metres.  Each of the polygons has to be valid."""
    polygons = []
    for rings, place in zip(outline.polygons, outline.places, strict=True):
        shell, *holes = (_bent(ring, origin) for ring in rings)
        polygon = shapely.Polygon(shell, holes)
        sound = polygon if polygon.is_valid else _sound(polygon)
        if sound is None:
            raise RequestError(
                f"'{outline.path}': {place}: {_reason(polygon, origin)}",
                "correct the outline in the program with which it was drawn, or draw it as "
                "several polygons",
            )
        polygons.append(sound)
    if len(polygons) > 1 and cross_often(polygons, MOST_CROSSINGS):
        raise RequestError(
            f"'{outline.path}': its {len(polygons)} polygons cross each other too often",
            "merge them first, or keep only those that you need",
        )
    united = shapely.union_all(polygons)
    if not united.area > 0.5 * THINNEST_M * united.length:
        raise RequestError(f"'{outline.path}' has no area")
    return polygons_of(united)


def _sound(polygon: Any) -> Any:
    """The polygon if it is valid, otherwise a repaired polygon; None if the repair would change its
    area.

    If rings touch, they may cross by a tiny distance after the projection.  Repairing this does not
    change the area.
    """
    if cross_often([polygon], MOST_MENDED):
        return None
    sound = _without_specks(polygons_of(shapely.make_valid(polygon)))
    return sound if abs(sound.area - polygon.area) <= THINNEST_M * polygon.length else None


def _without_specks(shape: Any) -> Any:
    """The polygons of a repaired shape, except those without a width. If no polygon has a width,
    the shape is returned unchanged.

    A spike whose sides cross after rounding becomes such a polygon. If the sides of the spike are
    equal, the repair replaces it by a line, which is left out as well.
    """
    parts = shapely.get_parts(shape)
    wide = shapely.area(parts) > 0.5 * THINNEST_M * shapely.length(parts)
    return shapely.multipolygons(parts[wide]) if wide.any() else shape


def _reason(polygon: Any, origin: tuple[float, float]) -> str:
    """The reason why a polygon is not valid, and the place on earth."""
    words, _, place = str(shapely.is_valid_reason(polygon)).partition("[")
    words = words.strip().lower()
    if "self-intersection" in words:
        words = "the outline crosses itself"
    found = re.findall(r"[-+\d.e]+", place)
    if len(found) < 2:
        return words
    (latitude,), (longitude,) = to_wgs84(origin, [float(found[0])], [float(found[1])])
    return f"{words} near latitude {latitude:.6f}, longitude {longitude:.6f}"


def _simplified(shape: Any, *, outward: bool) -> tuple[Any, float]:
    """A simplified shape, and the distance by which the boundary moved.

    The simplified shape contains the given shape, or is inside it. The boundary is simplified by
    the algorithm of Douglas and Peucker. Around the new edges there is a band that extends to both
    sides by the tolerance. The given ring is inside this band, and the new ring can be deformed
    continuously into the given ring within the band. A point outside the band is therefore inside
    both rings or outside both rings. This is true even if the simplified rings cross each other.
    """
    if shapely.get_num_coordinates(shape) <= MOST_VERTICES:
        return shape, 0.0
    rings = [
        [shapely.LineString(ring.coords) for ring in (part.exterior, *part.interiors)]
        for part in shapely.get_parts(shape)
    ]
    for tolerance in TOLERANCES_M:
        simple = [shapely.simplify(lines, tolerance, preserve_topology=False) for lines in rings]
        band = shapely.multilinestrings(np.concatenate(simple))
        if 2 * shapely.get_num_coordinates(band) > MOST_VERTICES:
            continue
        inside = shapely.union_all([_even_odd(lines) for lines in simple])
        band = _widened(band, tolerance)
        safe = shapely.union(inside, band) if outward else shapely.difference(inside, band)
        if shapely.get_num_coordinates(safe) <= MOST_VERTICES:
            return polygons_of(safe), (1.0 + 1.03) * tolerance
    raise RequestError(
        f"an outline of {shapely.get_num_coordinates(shape)} vertices still has more than "
        f"{MOST_VERTICES} vertices after a simplification with a tolerance of "
        f"{TOLERANCES_M[-1]:g} m",
        "draw it with fewer vertices",
    )


def _even_odd(lines: NDArray[Any]) -> Any:
    """The region that closed lines enclose an odd number of times."""
    whole = shapely.MultiPolygon()
    for line in lines:
        if shapely.get_num_coordinates(line) >= 4:
            ring = polygons_of(shapely.make_valid(shapely.Polygon(line)))
            whole = shapely.symmetric_difference(whole, ring)
    return whole
