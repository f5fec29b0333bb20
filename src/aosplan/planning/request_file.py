"""Documents that come from files, checked by pydantic, and their JSON Schemas.

A plain command never loads this module: flags meet the same invariants in the classes that
the documents are turned into.
"""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field, create_model

from aosplan.camera.camera import Camera
from aosplan.cli.field_descriptions import meaning
from aosplan.cli.results_schema import (
    CalculatorDocument,
    FigureDocument,
    IntegralDocument,
    PosesDocument,
    ReviewDocument,
    SimulationDocument,
    StatisticsDocument,
    ThinningDocument,
    TradeoffDocument,
)
from aosplan.errors import RequestError
from aosplan.files import read_table
from aosplan.mission.mission import (
    Conduct,
    Mission,
    Waypoint,
    Waypoints,
    split,
)
from aosplan.planning.document import SCHEMA
from aosplan.planning.options import OPTIONS
from aosplan.planning.plan_schema import PlanDocument
from aosplan.scenes.files.scene_schema import SceneDocument
from aosplan.sweeps.sweep_schema import SweepDocument
from aosplan.units import nearest_hint
from aosplan.validation import (
    Document,
    Finite,
    Pair,
    Pixels,
    checked,
)


class CameraDocument(Document):
    """A camera file."""

    name: str
    focal_length_mm: Finite
    sensor_width_mm: Finite
    sensor_height_mm: Finite
    image_width_px: Pixels
    image_height_px: Pixels
    title: str = ""
    source: str = ""
    assumed: str = ""


_KINDS: dict[str, Any] = {
    "number": Finite | str,
    "share": Finite | str,
    "whole": int | str,
    "text": str,
    "pair": Pair | str,
    "flag": bool,
}

_OPTION_FIELDS: dict[str, Any] = {
    option.name: (_KINDS[option.kind] | None, Field(default=None, description=option.help))
    for option in OPTIONS
}

RequestDocument = create_model(
    "RequestDocument",
    __base__=Document,
    __doc__="A request file: the options of `aosplan plan`, with underscores for hyphens.",
    **_OPTION_FIELDS,
)


DOCUMENTS: dict[str, type[BaseModel]] = {
    "plan": PlanDocument,
    "simulation": SimulationDocument,
    "request": RequestDocument,
    "scene": SceneDocument,
    "camera": CameraDocument,
    "statistics": StatisticsDocument,
    "visibility": CalculatorDocument,
    "poses": PosesDocument,
    "integral": IntegralDocument,
    "review": ReviewDocument,
    "thinning": ThinningDocument,
    "tradeoff": TradeoffDocument,
    "figure": FigureDocument,
    "sweep": SweepDocument,
}


def json_schema(name: str) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a document.

    Raises
    ------
    RequestError
        Where no document has the name.
    """
    if name not in DOCUMENTS:
        raise RequestError(
            f"unknown document '{name}'",
            nearest_hint(name, DOCUMENTS) or f"one of {', '.join(DOCUMENTS)}",
        )
    schema = DOCUMENTS[name].model_json_schema(by_alias=True)
    for table in (schema, *schema.get("$defs", {}).values()):
        for field, about in table["properties"].items():
            text = meaning(table["title"], field)
            if text is not None:
                about.setdefault("description", text)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def read_camera(path: str) -> Camera:
    """A camera from a TOML or JSON file."""
    return Camera(**checked(CameraDocument, read_table(path), path).model_dump())


def read_request(path: str) -> dict[str, Any]:
    """The values of a request file: a table of options, or an earlier result that holds one."""
    table = read_table(path)
    inner = table.get("request")
    if isinstance(inner, dict):
        if table.get("schema") != SCHEMA:
            raise RequestError(
                f"'{path}' has schema {table.get('schema')!r}, not {SCHEMA}",
                "it was written by another version of aosplan",
            )
        table = inner
    return checked(RequestDocument, table, path).model_dump(exclude_none=True)


def read_mission(path: str) -> Mission:
    """The mission of a saved plan, all flights in one."""
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
        raise RequestError(f"'{path}': the flights do not take each waypoint once, in order")
    return split(whole, ranges)


def _saved_plan(path: str) -> tuple[dict[str, Any], PlanDocument]:
    table = read_table(path)
    document = checked(PlanDocument, table, path)
    assert isinstance(document, PlanDocument)
    return table, document


def _mission(table: dict[str, Any], document: PlanDocument, path: str) -> Mission:
    waypoints = [Waypoint(**waypoint.model_dump()) for waypoint in document.waypoints]
    given = {tuple(value is None for value in waypoint) for waypoint in waypoints}
    half_placed = (waypoints[0].latitude is None) != (waypoints[0].longitude is None)
    if len(given) > 1 or half_placed or [w.index for w in waypoints] != list(range(len(waypoints))):
        raise RequestError(f"'{path}': the waypoints are not one gapless list in flight order")
    return Mission(
        Waypoints.of(waypoints),
        {name: value for name, value in table.items() if name != "waypoints"},
        Conduct(**document.flight.model_dump(include=set(Conduct._fields))),
    )
