"""Request files and saved plans as requests, checked with pydantic.

If a plan is given by flags, this module is not imported. `PlanRequest` itself checks the same
rules.
"""

from __future__ import annotations

import os
from typing import Any

from pydantic import Field, create_model

from aosplan.errors import RequestError
from aosplan.files import read_table
from aosplan.messages import SCHEMA
from aosplan.planning.aircraft import with_drone_file
from aosplan.planning.options import OPTIONS
from aosplan.validation import Document, Finite, Pair, checked

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


def read_request(path: str) -> dict[str, Any]:
    """Read the options in a request file, or in the request of a saved result."""
    if not os.path.exists(path) and path.replace(".", "", 1).removeprefix("-").isdigit():
        raise RequestError(
            f"there is no file '{path}'",
            "write the latitude and the longitude with a comma and without a space: --origin "
            f"LAT,{path}",
        )
    table = read_table(path)
    inner = table.get("request")
    if isinstance(inner, dict):
        if table.get("schema") != SCHEMA:
            raise RequestError(
                f"'{path}' has schema {table.get('schema')!r}, not {SCHEMA}",
                "another version of aosplan wrote this file",
            )
        table = inner
    values = checked(RequestDocument, table, path).model_dump(exclude_none=True)
    return with_drone_file(values, os.path.dirname(path))
