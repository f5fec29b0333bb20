"""``aosplan schema``: prints JSON Schemas of the documents that aosplan reads and prints."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from aosplan.cli.options import command
from aosplan.cli.output import print_json
from aosplan.cli.typer_classes import TyperArgument
from aosplan.errors import RequestError
from aosplan.units import nearest_hint

DOCUMENTS = {
    "plan": ("planning.plan_schema", "PlanDocument"),
    "simulation": ("simulation.simulation_schema", "SimulationDocument"),
    "request": ("planning.request_file", "RequestDocument"),
    "scene": ("scenes.files.scene_schema", "SceneDocument"),
    "camera": ("camera.camera_file", "CameraDocument"),
    "statistics": ("scenes.summary_schema", "StatisticsDocument"),
    "visibility": ("cli.visibility_schema", "CalculatorDocument"),
    "poses": ("postflight.postflight_schema", "PosesDocument"),
    "integral": ("postflight.postflight_schema", "IntegralDocument"),
    "review": ("postflight.postflight_schema", "ReviewDocument"),
    "thinning": ("postflight.postflight_schema", "ThinningDocument"),
    "tradeoff": ("solver.tradeoff_schema", "TradeoffDocument"),
    "figure": ("show.figures.figure_schema", "FigureDocument"),
    "sweep": ("sweeps.sweep_schema", "SweepDocument"),
}
"""Module and class of each document by name."""


def json_schema(name: str) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a document.

    Raises
    ------
    RequestError
        If no document has this name.
    """
    from aosplan.cli.field_descriptions import meaning

    if name not in DOCUMENTS:
        raise RequestError(
            f"unknown document '{name}'",
            nearest_hint(name, DOCUMENTS) or f"one of {', '.join(DOCUMENTS)}",
        )
    module, title = DOCUMENTS[name]
    document = getattr(import_module(f"aosplan.{module}"), title)
    schema: dict[str, Any] = document.model_json_schema(by_alias=True)
    for table in (schema, *schema.get("$defs", {}).values()):
        for field, about in table["properties"].items():
            text = meaning(table["title"], field)
            if text is not None:
                about.setdefault("description", text)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def run(document: str | None) -> None:
    """Print the JSON Schema of one document, or of all documents by name."""
    if document is not None:
        print_json(json_schema(document))
    else:
        print_json({name: json_schema(name) for name in DOCUMENTS})


COMMAND = command(
    "schema",
    run,
    summary="Print the JSON Schema of a document, or of all documents by name.",
    examples="aosplan schema plan\naosplan schema > schemas.json",
    parameters=[
        TyperArgument(
            param_decls=["document"],
            type=str,
            required=False,
            metavar="DOCUMENT",
            help="Name of a document: plan, request, scene, camera, statistics, visibility, "
            "poses, integral, sweep, …",
        )
    ],
)
