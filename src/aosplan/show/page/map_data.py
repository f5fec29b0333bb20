"""Data of the page's map: waypoints as columns of bytes, and other shapes of the map."""

from __future__ import annotations

import sys
from array import array
from base64 import b64encode
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.mission.mission import Waypoints
    from aosplan.planning.result import Plan
    from aosplan.show.figures.grid import GridFigure, Polygon


class PackedColumn(NamedTuple):
    """One column of the waypoints: its name, its packing, and its text.

    `packing` is ``f8`` for floats of eight bytes and ``u1`` for booleans of one byte; both are
    little-endian and in base64.  It is ``same`` if all waypoints have the same value.
    """

    name: str
    packing: str
    text: str


def packed_columns(waypoints: Waypoints) -> list[PackedColumn]:
    """The columns of waypoints at full precision."""
    return [_column(name, values) for name, values in waypoints.columns().items()]


def _column(name: str, values: Sequence[Any]) -> PackedColumn:
    first = values[0]
    if all(value == first for value in values):
        return PackedColumn(name, "same", repr(first).lower())
    if isinstance(first, bool):
        return PackedColumn(name, "u1", b64encode(bytes(values)).decode())
    packed = array("d", values)
    if sys.byteorder == "big":
        packed.byteswap()
    return PackedColumn(name, "f8", b64encode(packed.tobytes()).decode())


def scenery_of(plan: Plan, grid: GridFigure) -> dict[str, Any]:
    """The objects on the map other than the waypoints, as plain values in metres east and north.

    The size of the grid is included if there is a single grid, but not for an area or a continuous
    line.  If the take-off point is not known, it is assumed to be below the first waypoint.
    """
    one_grid = plan.layout.area is None and plan.inputs.line_length_m is None
    east, north = grid.takeoff or (grid.east_m[0], grid.north_m[0])
    return {
        "heading_deg": grid.heading_deg,
        "footprint_m": list(grid.footprint_m),
        "common_footprint_m": grid.common_m and list(grid.common_m),
        "extent_m": list(plan.extent_m) if one_grid else None,
        "spacing_m": plan.solution.baseline_m,
        "takeoff": {"east_m": east, "north_m": north, "known": grid.takeoff is not None},
        "flights": [list(flight) for flight in grid.flights],
        "area": _rings(grid.area),
        "clear": _rings(grid.clear),
        "no_fly": _rings(grid.no_fly),
    }


def _rings(polygons: tuple[Polygon, ...]) -> list[list[float]]:
    """The rings of polygons as alternating east and north coordinates, rounded to centimetres.  The
    holes of a polygon follow its outer ring.
    """
    return [
        [round(value, 2) for point in ring for value in point]
        for polygon in polygons
        for ring in polygon
    ]
