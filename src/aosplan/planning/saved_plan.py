"""Reading of missions from plans that were saved as JSON."""

from __future__ import annotations

from typing import Any

from aosplan.errors import RequestError
from aosplan.files import read_table
from aosplan.mission.mission import FlightSettings, FlightShare, Mission, Waypoint, Waypoints, split
from aosplan.planning.plan_schema import PlanDocument
from aosplan.validation import checked

MOST_BYTES = 1024 * 1024 * 1024
"""Largest size of a saved plan [bytes]. The file of a plan with the largest number of waypoints has
0.8 GB.
"""


def read_mission(path: str) -> Mission:
    """The mission of a saved plan.  It contains all flights."""
    return _mission(*_saved_plan(path), path)


def read_missions(path: str) -> tuple[Mission, ...]:
    """The missions of a saved plan, one for each of its flights."""
    table, document = _saved_plan(path)
    whole, flights = _mission(table, document, path), document.flight.flights
    if flights is None:
        return (whole,)
    ranges = [(flight.first, flight.last) for flight in flights]
    flown = [place for first, last in ranges for place in range(first, last + 1)]
    if flown != list(range(len(whole.waypoints))) or any(last < first for first, last in ranges):
        raise RequestError(
            f"'{path}': the flights do not contain each waypoint exactly once, in order"
        )
    return split(
        whole,
        [
            FlightShare(flight.first, flight.last, flight.climb_m, flight.return_m)
            for flight in flights
        ],
    )


def _saved_plan(path: str) -> tuple[dict[str, Any], PlanDocument]:
    table = read_table(path, most=MOST_BYTES)
    document = checked(PlanDocument, table, path)
    assert isinstance(document, PlanDocument)
    return table, document


def _mission(table: dict[str, Any], document: PlanDocument, path: str) -> Mission:
    waypoints = [Waypoint(**waypoint.model_dump()) for waypoint in document.waypoints]
    given = {tuple(value is None for value in waypoint) for waypoint in waypoints}
    half_placed = (waypoints[0].latitude is None) != (waypoints[0].longitude is None)
    if len(given) > 1 or half_placed or [w.index for w in waypoints] != list(range(len(waypoints))):
        raise RequestError(f"'{path}': the waypoints are not a complete list in flight order")
    return Mission(
        Waypoints.of(waypoints),
        {name: value for name, value in table.items() if name != "waypoints"},
        FlightSettings(**document.flight.model_dump(include=set(FlightSettings._fields))),
    )
