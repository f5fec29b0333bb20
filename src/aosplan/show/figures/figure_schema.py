"""Schema of the document that ``aosplan plot --json`` prints."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from aosplan.validation import OpenDocument


class FigureDocument(OpenDocument):
    """The document that `aosplan plot --json` prints.  It has the description and the numbers of a
    figure.
    """

    schema_: Literal[1] = Field(alias="schema")
    version: str
    kind: str
    title: str
    description: str
    data: dict[str, Any]
