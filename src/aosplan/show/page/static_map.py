"""Map and table of the waypoints for browsers without scripts."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from aosplan.show.figures.grid import nice_length_m, window
from aosplan.units import length

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from aosplan.planning.result import Plan
    from aosplan.show.figures.grid import GridFigure, Polygon

MOST_SITES = 5000
"""Largest number of waypoints of a static map. If there are more waypoints, the page has a note
instead of the map.
"""

MOST_ROWS = 1000
"""Largest number of rows of the table."""

WIDTH = 640.0
"""Width of the map.  The height of the map depends on its content."""

MARGIN = 16.0


class StaticMap(NamedTuple):
    """A map ready to be drawn, with north up and to scale, and the rows of its table.

    Attributes
    ----------
    summary
        Description of the path as text.
    height
        Height of the map.  Its width is `WIDTH`.
    shapes
        Class and outline of the shapes below the path, beginning with the lowest.
    flights
        Path and sites of each flight.  Sites are lines of zero length.
    turns
        Waypoints without a photo, as lines of zero length.
    first, last, takeoff
        Positions of marks.  If the take-off point is not known, it is assumed to be below the first
        waypoint.
    dot
        Diameter of the dot of a site.
    bar
        Length of the scale bar, and the label of the bar.
    columns, rows
        Content of the table as text.  There are no rows if there would be more than `MOST_ROWS`.
    """

    summary: str
    height: float
    shapes: list[tuple[str, str]]
    flights: list[tuple[str, str]]
    turns: str
    first: tuple[float, float]
    last: tuple[float, float]
    takeoff: tuple[float, float]
    dot: float
    bar: tuple[float, str]
    columns: list[str]
    rows: list[list[str]]


def static_map_of(plan: Plan, grid: GridFigure) -> StaticMap | None:
    """The static map of a plan and its grid; None for more than `MOST_SITES` waypoints."""
    ways = plan.waypoints
    if len(ways) > MOST_SITES:
        return None
    low, high = window(grid)
    wide, tall = high[0] - low[0], high[1] - low[1]
    unit = (WIDTH - 2.0 * MARGIN) / max(wide, tall)
    # The height of the map is at most its width. The scale bar is in the lowest line.
    left = 0.5 * (WIDTH - unit * wide)
    height = unit * tall + 2.0 * MARGIN + 24.0

    def place(point: Sequence[float]) -> tuple[float, float]:
        east, north = point
        return round(left + unit * (east - low[0]), 1), round(MARGIN + unit * (high[1] - north), 1)

    places = [place(point) for point in zip(grid.east_m, grid.north_m, strict=True)]
    photo = grid.photo or [True] * len(places)
    common: tuple[Polygon, ...] = () if grid.common is None else ((grid.common,),)
    shapes = {
        "area": grid.area,
        "clear": grid.clear,
        "no-fly": grid.no_fly,
        "common": common,
        "footprint": ((grid.footprint,),),
    }
    length_m = nice_length_m(max(wide, tall))
    columns = ways.columns()
    return StaticMap(
        summary=grid.description(),
        height=round(height, 1),
        shapes=[(name, _outline(parts, place)) for name, parts in shapes.items() if parts],
        flights=[
            (
                _line(places[first : last + 1]),
                _dots(places[k] for k in range(first, last + 1) if photo[k]),
            )
            for first, last in grid.flights
        ],
        turns=_dots(at for at, taken in zip(places, photo, strict=True) if not taken),
        first=places[0],
        last=places[-1],
        takeoff=place(grid.takeoff) if grid.takeoff else (places[0][0], places[0][1] + 14.0),
        dot=min(max(0.44 * unit * plan.solution.baseline_m, 2.0), 9.0),
        bar=(round(unit * length_m, 1), length(length_m)),
        columns=list(columns),
        rows=[
            [_cell(name, value) for name, value in zip(columns, row, strict=True)]
            for row in zip(*columns.values(), strict=True)
            if len(ways) <= MOST_ROWS
        ],
    )


def _outline(
    polygons: tuple[Polygon, ...], place: Callable[[Sequence[float]], tuple[float, float]]
) -> str:
    return "".join(
        f"{_line([place(point) for point in ring])}Z" for polygon in polygons for ring in polygon
    )


def _line(places: Iterable[tuple[float, float]]) -> str:
    return "M" + "L".join(f"{x:g} {y:g}" for x, y in places)


def _dots(places: Iterable[tuple[float, float]]) -> str:
    return "".join(f"M{x:g} {y:g}h0" for x, y in places)


def _cell(name: str, value: float) -> str:
    """A value as text: a boolean, or a number rounded to about a centimetre."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if name in ("latitude", "longitude"):
        return f"{value:.7f}"
    return f"{round(value, 2) + 0.0:.2f}"
