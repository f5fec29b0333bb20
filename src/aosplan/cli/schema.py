"""``aosplan schema``."""

from __future__ import annotations

from typer.core import TyperArgument

from aosplan.cli.options import command
from aosplan.cli.output import print_json


def run(document: str | None) -> None:
    """Print the JSON Schema of one document, or of all by name."""
    from aosplan.planning.request_file import (
        DOCUMENTS,
        json_schema,
    )

    if document is not None:
        print_json(json_schema(document))
    else:
        print_json({name: json_schema(name) for name in DOCUMENTS})


COMMAND = command(
    "schema",
    run,
    summary="Print the JSON Schema of a document, or of all of them by name.",
    examples="aosplan schema plan\naosplan schema > schemas.json",
    parameters=[
        TyperArgument(
            param_decls=["document"],
            type=str,
            required=False,
            metavar="DOCUMENT",
            help="plan, request, scene, camera, statistics, visibility, poses, integral, sweep, …",
        )
    ],
)
