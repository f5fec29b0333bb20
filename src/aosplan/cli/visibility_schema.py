"""Schema of the document that ``aosplan visibility --json`` prints."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from aosplan.planning.plan_schema import VisibilityDocument
from aosplan.validation import Finite, OpenDocument


class CalculatorDocument(OpenDocument):
    """The document that `aosplan visibility --json` prints."""

    schema_: Literal[1] = Field(alias="schema")
    version: str
    samples: int
    dhat: Finite | None
    visibility: VisibilityDocument
