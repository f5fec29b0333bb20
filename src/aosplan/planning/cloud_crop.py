"""The part of a point cloud that a request asks for, or that its plan needs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from aosplan.errors import RequestError
from aosplan.files import located
from aosplan.geodesy import to_wgs84

if TYPE_CHECKING:
    from aosplan.areas.area import Area
    from aosplan.planning.request import PlanRequest
    from aosplan.scenes.files.crop import Crop

ALL = "all"

RAYS_M = 50.0
"""Margin around the area of a plan.  Rays that are slanted by up to 45° cross a canopy with a
height of 50 m within this margin.
"""


def asked_crop(text: str, folder: str) -> Crop | None:
    """The crop that ``--crop`` gives: four bounds, or the bounds of an outline in a file. For
    ``all``, the result is None.

    Raises
    ------
    RequestError
        If the bounds or the file are not valid.
    """
    from aosplan.scenes.files.crop import Crop

    if text == ALL:
        return None
    parts = text.split(",")
    try:
        numbers = tuple(float(part) for part in parts)
    except ValueError:
        from aosplan.areas.boundary_file import read_outline

        outline = read_outline(located(text, folder))
        rings = [ring for polygon in outline.polygons for ring in polygon[:1]]
        west, south = (min(float(ring[:, axis].min()) for ring in rings) for axis in range(2))
        east, north = (max(float(ring[:, axis].max()) for ring in rings) for axis in range(2))
        return Crop((west, south, east, north), "degrees")
    hint = "give W,S,E,N in the coordinates of the cloud or in degrees, a GeoJSON file, or all"
    if len(numbers) != 4 or not all(math.isfinite(number) for number in numbers):
        raise RequestError(f"--crop {text} does not have four numbers", hint)
    west, south, east, north = numbers
    if west >= east or south >= north:
        raise RequestError(f"--crop {text} is empty", hint)
    return Crop((west, south, east, north))


def crop_of_plan(
    request: PlanRequest, area: Area | None, footprint_m: tuple[float, float]
) -> Crop | None:
    """The ground around a plan; None if the plan has no location.

    It contains the area of the plan. If the plan has no area, it contains the ground that a photo
    from the middle and the photos along a line show. A margin of `RAYS_M` is added.
    """
    from aosplan.scenes.files.crop import Crop

    if area is not None:
        west, south, east, north = area.whole.bounds
        origin = area.origin
    elif request.origin is not None:
        half = 0.5 * math.hypot(*footprint_m) + 0.5 * (request.line_length or 0.0)
        west, south, east, north = -half, -half, half, half
        origin = request.origin
    else:
        return None
    latitudes, longitudes = to_wgs84(origin, [west, west, east, east], [south, north, south, north])
    # The bounds have seven decimals of a degree, which is about a centimetre.
    bounds = (min(longitudes), min(latitudes), max(longitudes), max(latitudes))
    west, south, east, north = (round(bound, 7) for bound in bounds)
    if east - west > 180.0:  # The bounds cross the antimeridian.
        return None
    return Crop((west, south, east, north), "degrees", RAYS_M, of_plan=True)
