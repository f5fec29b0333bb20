"""Schema of the document that ``aosplan scene --json`` prints."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from aosplan.scenes.files.scene_schema import CorrelogramDocument, LayerDocument
from aosplan.validation import Finite, MessageDocument, OpenDocument, Pair


class StatisticsDocument(OpenDocument):
    """What `aosplan scene --json` prints."""

    schema_: Literal[1] = Field(alias="schema")
    version: str
    name: str
    kind: Literal["uniform", "layered"]
    layers: list[LayerDocument]
    integrated_density: Finite
    mean_density: Finite
    canopy_top_m: Finite
    baseline_curve: list[Pair]
    correlogram: CorrelogramDocument | None = None
    density_by_offset: list[list[Finite]] | None = None
    density_by_angle: list[Pair] | None = None
    warnings: list[MessageDocument]
