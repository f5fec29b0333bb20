"""Units and coordinate reference systems of georeferenced files.

Readers of point clouds, canopy rasters and terrain need the unit of x and y, the unit of z, and the
length on the ground of one unit of x and of one unit of y at a place.  The units and the length
come from the axes of the coordinate reference system, as PROJ describes them.  If a file does not
state a unit, the functions of this module return None and never guess.  The reader of the file then
asks the user for the unit, or reports which unit it assumes.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.units import shown

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

UNITS_M = {"m": 1.0, "ft": 0.3048, "us-ft": 1200.0 / 3937.0}
"""Lengths [m] of the units that users name most often."""

_SYNONYMS = {
    "m": ("metre", "meter", "metres", "meters"),
    "ft": ("foot", "feet", "international foot", "international feet", "ift"),
    "us-ft": (
        "us survey foot",
        "us survey feet",
        "survey foot",
        "ftus",
        "us_ft",
        "foot_us",
        "usft",
    ),
}

SAME_UNIT = 1e-4
"""Largest relative difference between two units of height that are treated as equal, such as the
international foot and the US survey foot.
"""

SCALED = 0.003
"""Relative scale errors of a projection up to this are ignored. Within its zone, UTM has smaller
errors.
"""

MOST_SKEW_DEG = 1.0
"""Largest allowed deviation from 90° of the angle between a projection's axes on the ground. If the
deviation is larger, a scale along each axis cannot correct lengths.
"""

ASK = "give --units m, ft or us-ft, or two units such as us-ft,m (x and y in feet, z in metres)"
"""Hint for a scene file that does not state its units."""


class Units(NamedTuple):
    """Length [m] of the unit of x and y, and of the unit of z; None if the unit is not stated."""

    across_m: float | None
    up_m: float | None


class GroundScale(NamedTuple):
    """Lengths on the ground [m] of one unit of x and of one unit of y at a place, and the
    coordinates of this place.

    `skew_deg` is the deviation of the angle between the two axes from a right angle on the ground,
    and `turn_deg` the direction of the y axis, clockwise from true north. Latitude and longitude
    refer to the system's own datum.
    """

    x_m: float
    y_m: float
    skew_deg: float
    turn_deg: float
    latitude: float
    longitude: float


class Location(NamedTuple):
    """WGS 84 latitude and longitude of a point, and the direction of the y axis there.

    `turn_deg` is clockwise from true north, between -180 and 180.
    """

    latitude: float
    longitude: float
    turn_deg: float


def unit_m(name: str) -> float | None:
    """The length [m] of a unit with a given EPSG or PROJ name; None if the name is unknown."""
    plain = " ".join(name.lower().split())
    for short, synonyms in _SYNONYMS.items():
        if plain == short or plain in synonyms:
            return UNITS_M[short]
    return _units_by_name().get(plain)


def unit_of_code_m(code: int) -> float | None:
    """The length [m] of a unit with an EPSG code, such as 9003; None if the code is unknown."""
    return _units_by_code().get(str(code))


def unit_text(metres: float) -> str:
    """Name of a unit for messages: metres, feet, US survey feet, or its length in metres."""
    named = {"m": "metres", "ft": "feet", "us-ft": "US survey feet"}
    for short, length_m in UNITS_M.items():
        if math.isclose(metres, length_m, rel_tol=1e-7):
            return named[short]
    if math.isclose(metres, UNITS_M["ft"], rel_tol=1e-4):
        return f"feet of {metres:.10g} m"
    return f"units of {metres:.10g} m"


def are_same(one_m: float, other_m: float) -> bool:
    """Whether two units are equal within `SAME_UNIT`."""
    return math.isclose(one_m, other_m, rel_tol=SAME_UNIT)


def given_units(text: str) -> Units:
    """Lengths in metres of the units in the option ``--units``: one unit for all axes, or one unit
    for x and y and another unit for z.
    """
    across, _, up = text.partition(",")
    across_m = unit_m(across.strip())
    return Units(across_m, unit_m(up.strip()) if up else across_m)


def units_of(crs: CRS, what: str) -> Units:
    """The unit of x and y and the unit of z, as a coordinate reference system states them.

    Parameters
    ----------
    crs
        A projected, local or compound system.
    what
        The data that have this system, for messages: ``point cloud 'a.laz'``.

    Raises
    ------
    RequestError
        If x and y are in degrees, if the system is geocentric, if an axis points west or south, or
        if z increases downwards.
    """
    if crs.is_geographic or crs.is_geocentric:
        raise RequestError(
            f"the coordinates of {what} are not distances on a plane, because its coordinate "
            "reference system is geographic or geocentric",
            "reproject it to a projected system in metres, such as UTM",
        )
    across = [axis for axis in crs.axis_info if axis.direction not in ("up", "down")]
    if any(axis.direction in ("west", "south") for axis in across):
        polar = {axis.direction for axis in across} in ({"south"}, {"north"})
        if not polar:
            raise RequestError(
                f"the axes of {what} run {' and '.join(axis.direction for axis in across)}",
                "reproject it to a system with axes to the east and north, such as UTM",
            )
    return Units(
        float(across[0].unit_conversion_factor) if across else None, vertical_unit_m(crs, what)
    )


def crs_of_wkt(text: str, what: str) -> CRS:
    """The coordinate reference system that a WKT text describes.

    Raises
    ------
    RequestError
        If PROJ cannot read the text.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        return CRS.from_wkt(text)
    except CRSError:
        raise RequestError(
            f"the coordinate reference system of {what} cannot be read",
            "write a valid system with gdal_edit.py -a_srs EPSG:CODE FILE",
        ) from None


def height_unit_m(band: str | None, stated: Units, what: str, hint: str) -> float:
    """The length [m] of the unit of a raster's heights, as its band or its vertical axis states it.

    If neither states a unit, metres are assumed, unless x and y are in feet.

    Parameters
    ----------
    band
        Name of the unit of the raster's band, if it has one.
    stated
        Units of its coordinate reference system.
    what, hint
        Parts of messages: a name of the raster, and a hint that tells the user how to give the
        unit.

    Raises
    ------
    RequestError
        If the unit is unknown, if the band and the axis have different units, or if no unit of
        heights is stated and x and y are in feet.
    """
    named_m = unit_m(band) if band and band.strip() else None
    if band and band.strip() and named_m is None:
        raise RequestError(
            f"{what} has heights in {shown(band.strip()[:40])}, which is not a known unit", hint
        )
    if named_m and stated.up_m and not are_same(named_m, stated.up_m):
        raise RequestError(
            f"{what} has heights in {unit_text(named_m)} according to its band, but in "
            f"{unit_text(stated.up_m)} according to its vertical coordinate reference system",
            hint,
        )
    if named_m or stated.up_m:
        return named_m or stated.up_m or 1.0
    if stated.across_m and not are_same(stated.across_m, 1.0):
        raise RequestError(
            f"{what} does not state the unit of its heights, and its x and y are not in "
            f"metres but in {unit_text(stated.across_m)}",
            hint,
        )
    return 1.0


def vertical_unit_m(crs: CRS, what: str) -> float | None:
    """The length [m] of the unit of heights; None if the system has no vertical axis.

    Raises
    ------
    RequestError
        If the axis points downwards.
    """
    for axis in crs.axis_info:
        if axis.direction == "down":
            raise RequestError(
                f"{what} has depths (positive downwards) according to its coordinate "
                "reference system",
                "convert them to heights (positive upwards)",
            )
        if axis.direction == "up":
            return float(axis.unit_conversion_factor)
    return None


def horizontal(crs: CRS) -> CRS:
    """The horizontal part of a coordinate reference system, which x and y refer to."""
    if crs.is_compound:
        return horizontal(crs.sub_crs_list[0])
    if crs.is_bound and crs.source_crs is not None:
        return horizontal(crs.source_crs)
    return crs.to_2d()


def vertical_name(crs: CRS) -> str | None:
    """Name of the vertical part of a coordinate reference system; None if the system has no
    vertical part.
    """
    return next((str(part.name) for part in crs.sub_crs_list if part.is_vertical), None)


def transformer(source: CRS | str, target: CRS | str) -> Transformer:
    """Transformation between two systems, with x or longitude first.

    PROJ's warnings about missing grids are suppressed.

    Raises
    ------
    pyproj.exceptions.ProjError
        If PROJ knows no transformation between the two systems.
    """
    import warnings

    from pyproj import Transformer

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return Transformer.from_crs(source, target, always_xy=True)


def ground_scale(crs: CRS, x: float, y: float) -> GroundScale | None:
    """Length of one unit of x and of one unit of y at a place, measured on the ellipsoid.

    The lengths [m] include both the unit and the scale error of the projection. Degrees, US survey
    feet, and the metres of web Mercator, which differ from true metres by the factor 1 / cos φ, are
    therefore all converted correctly. The result is None if the place has no latitude and
    longitude.
    """
    from pyproj.exceptions import ProjError

    plane = horizontal(crs)
    globe = plane.geodetic_crs
    ellipsoid = plane.get_geod()
    if globe is None or ellipsoid is None or not (math.isfinite(x) and math.isfinite(y)):
        return None
    # The step is a compromise. It has to be long, so that differences of coordinates have nine
    # accurate digits. It has to be short, so that the scale is constant along it.
    step = 1e-3 if plane.is_geographic else 100.0
    try:
        longitudes, latitudes = transformer(plane, globe).transform(
            [x, x - step, x + step, x, x], [y, y, y, y - step, y + step]
        )
    except ProjError:
        return None
    if not all(math.isfinite(value) for value in (*longitudes, *latitudes)):
        return None
    azimuths, _, lengths = ellipsoid.inv(
        [longitudes[1], longitudes[3]],
        [latitudes[1], latitudes[3]],
        [longitudes[2], longitudes[4]],
        [latitudes[2], latitudes[4]],
    )
    if not min(lengths) > 0.0:
        return None
    # The turn is 90° if x points east and y points north.
    turn = (azimuths[0] - azimuths[1]) % 360.0
    return GroundScale(
        lengths[0] / (2.0 * step),
        lengths[1] / (2.0 * step),
        abs(turn - 90.0),
        float(azimuths[1]),
        float(latitudes[0]),
        float(longitudes[0]),
    )


def location_of(crs: CRS, x: float, y: float) -> Location | None:
    """Location of a point in a coordinate reference system; None if the system has none."""
    from pyproj.exceptions import ProjError

    scale = ground_scale(crs, x, y)
    if scale is None:
        return None
    try:
        longitude, latitude = transformer(horizontal(crs), "EPSG:4326").transform(x, y)
    except ProjError:
        return None
    if not math.isfinite(latitude + longitude):
        return None
    return Location(float(latitude), float(longitude), scale.turn_deg)


def true_lengths(scale: GroundScale | None, across_m: float, what: str) -> tuple[float, float]:
    """Length on the ground of one unit of x and of one unit of y at a place.

    If the scale of the projection is close to 1, both lengths are `across_m`.

    Parameters
    ----------
    scale
        Result of `ground_scale` at the place.  If it is None, `across_m` is returned.
    across_m
        Length of the unit of x and y, without the scale of the projection.
    what
        The data that have these coordinates, for messages.

    Raises
    ------
    RequestError
        If the scale has to be corrected and the axes are not at a right angle on the ground.
    """
    if scale is None:
        return across_m, across_m
    if max(abs(scale.x_m / across_m - 1.0), abs(scale.y_m / across_m - 1.0)) <= SCALED:
        return across_m, across_m
    if scale.skew_deg > MOST_SKEW_DEG:
        raise RequestError(
            f"the projection of {what} distorts angles here by {scale.skew_deg:.2g}°",
            "reproject it to a system that keeps angles, such as UTM",
        )
    return scale.x_m, scale.y_m


def reads_like_feet(text: str) -> bool:
    """Whether a text mentions feet, for coordinate reference systems that PROJ cannot read."""
    import re

    return (
        re.search(r"\b(feet|foot|ft|ftus|us-?ft)\b|_(feet|foot|ft|ftus)\b", text, re.IGNORECASE)
        is not None
    )


@cache
def _units_by_name() -> dict[str, float]:
    return {
        name.lower(): unit.conv_factor
        for unit in _linear_units()
        for name in (unit.name, unit.proj_short_name)
        if name and not unit.deprecated
    }


@cache
def _units_by_code() -> dict[str, float]:
    return {unit.code: unit.conv_factor for unit in _linear_units() if unit.auth_name == "EPSG"}


def _linear_units() -> list[Any]:
    from pyproj.database import get_units_map

    return [
        *get_units_map(auth_name="PROJ", category="linear").values(),
        *get_units_map(auth_name="EPSG", category="linear", allow_deprecated=True).values(),
    ]
