"""Units and coordinate reference systems of georeferenced files.

Point clouds, canopy rasters and terrain ask the same questions: which unit do x and y have,
which unit has z, and how long is such a unit on the ground at this place?  The answers come from
the axes that PROJ knows.  A unit that a file does not state is None here, never a guess; the
reader asks for it, or names what it assumes.
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
"""Metres in the units that a user mostly names."""

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
"""Units that differ by less, relatively, are the same for any height: feet of all kinds do."""

SCALED = 0.003
"""Lengths of a projection that are off by less count as true; within its zone UTM stays below."""

MOST_SKEW_DEG = 1.0
"""Axes of a projection that are farther from a right angle on the ground cannot be scaled."""

ASK = "say it with --units, such as m, ft or us-ft, or us-ft,m for x and y in feet and z in metres"
"""Hint for a scene's file that leaves its units open."""


class Units(NamedTuple):
    """Metres in the unit of x and y, and in that of z; None if it is not stated."""

    across_m: float | None
    up_m: float | None


class GroundScale(NamedTuple):
    """Metres on the ground in one unit of x and of y at a place, and where that place is.

    `skew_deg` is how far the two axes are from a right angle on the ground.
    """

    x_m: float
    y_m: float
    skew_deg: float
    latitude: float
    longitude: float


def unit_m(name: str) -> float | None:
    """Metres in a unit of length by its name, as EPSG and PROJ spell it; None if it is unknown."""
    plain = " ".join(name.lower().split())
    for short, synonyms in _SYNONYMS.items():
        if plain == short or plain in synonyms:
            return UNITS_M[short]
    return _units_by_name().get(plain)


def unit_of_code_m(code: int) -> float | None:
    """Metres in a unit of length by its EPSG code, such as 9003; None if it is unknown."""
    return _units_by_code().get(str(code))


def unit_text(metres: float) -> str:
    """A unit as text: metres, US survey feet, or its length."""
    named = {"m": "metres", "ft": "feet", "us-ft": "US survey feet"}
    for short, length_m in UNITS_M.items():
        if math.isclose(metres, length_m, rel_tol=1e-7):
            return named[short]
    if math.isclose(metres, UNITS_M["ft"], rel_tol=1e-4):
        return f"feet of {metres:.10g} m"
    return f"units of {metres:.10g} m"


def are_same(one_m: float, other_m: float) -> bool:
    """Whether two units are the same to any height that is measured in them."""
    return math.isclose(one_m, other_m, rel_tol=SAME_UNIT)


def parse_unit(value: Any, name: str) -> str:
    """An option that takes one unit of length.

    Raises
    ------
    RequestError
        If the unit is not known.
    """
    text = str(value).strip()
    if not unit_m(text):
        raise RequestError(
            f"{name} {shown(text)} is not a unit of length that is known",
            "m, ft, us-ft, or a name of EPSG's such as 'Indian foot'",
        )
    return text


def parse_units(value: Any, name: str) -> str:
    """The option ``--units``: one unit, or that of x and y, a comma, and that of z.

    Raises
    ------
    RequestError
        If a unit is not known.
    """
    across, comma, up = str(value).partition(",")
    parts = [parse_unit(part, name) for part in ([across, up] if comma else [across])]
    return ",".join(parts)


def given_units(text: str) -> Units:
    """Metres in the units that ``--units`` names, after `parse_units`."""
    across, _, up = text.partition(",")
    across_m = unit_m(across.strip())
    return Units(across_m, unit_m(up.strip()) if up else across_m)


def units_of(crs: CRS, what: str) -> Units:
    """Units that a coordinate reference system states for x and y, and for z.

    Parameters
    ----------
    crs
        Projected, local or compound.
    what
        What has it, for messages: ``point cloud 'a.laz'``.

    Raises
    ------
    RequestError
        If x and y are degrees or geocentric, if they run west or south, or if z counts downwards.
    """
    if crs.is_geographic or crs.is_geocentric:
        raise RequestError(
            f"the coordinates of {what} are not metres on a plane: its coordinate reference system "
            "is geographic or geocentric",
            "reproject it to a metric system such as UTM",
        )
    across = [axis for axis in crs.axis_info if axis.direction not in ("up", "down")]
    if any(axis.direction in ("west", "south") for axis in across):
        polar = {axis.direction for axis in across} in ({"south"}, {"north"})
        if not polar:
            raise RequestError(
                f"the axes of {what} run {' and '.join(axis.direction for axis in across)}",
                "reproject it to a system that counts to the east and north, such as UTM",
            )
    return Units(
        float(across[0].unit_conversion_factor) if across else None, vertical_unit_m(crs, what)
    )


def crs_of_wkt(text: str, what: str) -> CRS:
    """The coordinate reference system of a WKT text.

    Raises
    ------
    RequestError
        If PROJ cannot read it.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        return CRS.from_wkt(text)
    except CRSError:
        raise RequestError(
            f"the coordinate reference system of {what} cannot be read",
            "give it one that can: gdal_edit.py -a_srs EPSG:CODE FILE",
        ) from None


def height_unit_m(band: str | None, stated: Units, what: str, hint: str) -> float:
    """Metres in the unit of a raster's heights: that of its band, or of its vertical axis.

    A raster that states neither has metres, unless its x and y are in feet.

    Parameters
    ----------
    band
        Name of the unit of the raster's band, if it has one.
    stated
        Units of its coordinate reference system.
    what, hint
        What the raster is, for messages, and how the unit can be given.

    Raises
    ------
    RequestError
        If the unit is unknown, stated twice in different ways, or missing beside feet.
    """
    named_m = unit_m(band) if band and band.strip() else None
    if band and band.strip() and named_m is None:
        raise RequestError(
            f"{what} has heights in {shown(band.strip()[:40])}, an unknown unit", hint
        )
    if named_m and stated.up_m and not are_same(named_m, stated.up_m):
        raise RequestError(
            f"{what} has heights in {unit_text(named_m)} by its band, and in "
            f"{unit_text(stated.up_m)} by its vertical coordinate reference system",
            hint,
        )
    if named_m or stated.up_m:
        return named_m or stated.up_m or 1.0
    if stated.across_m and not are_same(stated.across_m, 1.0):
        raise RequestError(
            f"{what} does not state the unit of its heights, and its x and y are in "
            f"{unit_text(stated.across_m)}",
            hint,
        )
    return 1.0


def vertical_unit_m(crs: CRS, what: str) -> float | None:
    """Metres in the unit of heights, if the coordinate reference system has a vertical axis.

    Raises
    ------
    RequestError
        If the axis counts downwards.
    """
    for axis in crs.axis_info:
        if axis.direction == "down":
            raise RequestError(
                f"{what} has depths, which count downwards, by its coordinate reference system",
                "give it heights, which count upwards",
            )
        if axis.direction == "up":
            return float(axis.unit_conversion_factor)
    return None


def horizontal(crs: CRS) -> CRS:
    """The part of a coordinate reference system that x and y have."""
    if crs.is_compound:
        return horizontal(crs.sub_crs_list[0])
    if crs.is_bound and crs.source_crs is not None:
        return horizontal(crs.source_crs)
    return crs.to_2d()


def vertical_name(crs: CRS) -> str | None:
    """Name of the vertical part of a coordinate reference system, if it has one."""
    return next((str(part.name) for part in crs.sub_crs_list if part.is_vertical), None)


def transformer(source: CRS | str, target: CRS | str) -> Transformer:
    """From one system to another, x and longitude first, without PROJ's words on missing grids.

    Raises
    ------
    pyproj.exceptions.ProjError
        If there is no way from one to the other.
    """
    import warnings

    from pyproj import Transformer

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return Transformer.from_crs(source, target, always_xy=True)


def ground_scale(crs: CRS, x: float, y: float) -> GroundScale | None:
    """Metres on the ground, on the ellipsoid, in one unit of x and of y at a place.

    The unit and the scale of the projection come out together: of a degree, of a US survey foot,
    of a metre of web Mercator (1 / cos φ too long).  None if the place cannot be found.
    """
    from pyproj.exceptions import ProjError

    plane = horizontal(crs)
    globe = plane.geodetic_crs
    ellipsoid = plane.get_geod()
    if globe is None or ellipsoid is None or not (math.isfinite(x) and math.isfinite(y)):
        return None
    # Long enough for nine digits to be left of the differences, short enough for one scale.
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
    turn = (azimuths[0] - azimuths[1]) % 360.0  # 90° from north to east
    return GroundScale(
        lengths[0] / (2.0 * step),
        lengths[1] / (2.0 * step),
        abs(turn - 90.0),
        float(latitudes[0]),
        float(longitudes[0]),
    )


def true_lengths(scale: GroundScale | None, across_m: float, what: str) -> tuple[float, float]:
    """Metres on the ground in a unit of x and of y at a place, `across_m` if that is near it.

    Parameters
    ----------
    scale
        What `ground_scale` finds there.
    across_m
        Metres in the unit of x and y.
    what
        What has the coordinates, for messages.

    Raises
    ------
    RequestError
        If the axes of the projection are not at a right angle on the ground here.
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
    """Whether an unreadable description of a coordinate reference system speaks of feet."""
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
