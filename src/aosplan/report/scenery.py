"""What the page's map draws: waypoints as columns of bytes, and all that lies around them."""

from __future__ import annotations

import sys
from array import array
from base64 import b64encode
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.mission import Waypoints
    from aosplan.planning import Plan


class Column(NamedTuple):
    """A column of all waypoints: its name, how it is packed, and the text of it.

    `packing` is ``f8`` for floats of eight bytes, ``u1`` for truth values of one, both
    little-endian and in base64, or ``same`` for the one value that all waypoints have.
    """

    name: str
    packing: str
    text: str


def columns_of(waypoints: Waypoints) -> list[Column]:
    """The columns of waypoints, every digit of them."""
    return [_column(name, values) for name, values in waypoints.columns().items()]


def _column(name: str, values: Sequence[Any]) -> Column:
    first = values[0]
    if all(value == first for value in values):
        return Column(name, "same", repr(first).lower())
    if isinstance(first, bool):
        return Column(name, "u1", b64encode(bytes(values)).decode())
    packed = array("d", values)
    if sys.byteorder == "big":
        packed.byteswap()
    return Column(name, "f8", b64encode(packed.tobytes()).decode())


def scenery_of(plan: Plan) -> dict[str, Any]:
    """All that lies around the waypoints, in metres east and north, as plain values.

    Size of the grid, and of the ground that all samples see, are given where there is one grid:
    neither over an area nor along a line that is flown on.
    """
    area = plan.layout.area
    along, across = plan.common_footprint_m
    one_grid = area is None and plan.request.line_length is None
    return {
        "heading_deg": plan.heading_deg,
        "footprint_m": list(plan.camera.footprint_m(plan.altitude_m)),
        "common_footprint_m": [along, across] if one_grid and min(along, across) > 0.0 else None,
        "extent_m": list(plan.extent_m) if one_grid else None,
        "spacing_m": plan.solution.baseline_m,
        "takeoff": _takeoff(plan),
        "flights": [[flight.first, flight.last] for flight in plan.route.flights],
        "area": [] if area is None else _rings(area.whole),
        "clear": [] if area is None else _rings(area.clear),
        "no_fly": [] if area is None else _rings(area.keep_out),
    }


def _takeoff(plan: Plan) -> dict[str, Any]:
    """Where the drone takes off, and whether that was said; else below the first waypoint."""
    if plan.route.takeoff is None or plan.origin is None:
        waypoint = plan.waypoints[0]
        return {"east_m": waypoint.east_m, "north_m": waypoint.north_m, "given": False}
    from aosplan.geodesy import to_local

    latitude, longitude = plan.route.takeoff
    (east,), (north,) = to_local(plan.origin, [latitude], [longitude])
    return {"east_m": east, "north_m": north, "given": plan.request.takeoff is not None}


def _rings(shape: Any) -> list[list[list[float]]]:
    """The rings of a shape to a centimetre, each east and north by turns; holes as they come."""
    import shapely

    return [
        [round(value, 2) for value in shapely.get_coordinates(ring).ravel().tolist()]
        for part in shapely.get_parts(shape)
        for ring in (part.exterior, *part.interiors)
    ]
