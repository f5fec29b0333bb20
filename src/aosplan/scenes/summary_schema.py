"""Schema of the document that ``aosplan scene --json`` prints."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from aosplan.scenes.files.scene_schema import CorrelogramDocument, LayerDocument
from aosplan.validation import Finite, MessageDocument, OpenDocument, Pair


class OpacityDocument(OpenDocument):
    """Record of the method by which the opacity of a point cloud was found."""

    source: Literal["pulses", "voxels"]
    reason: str | None = None
    gap_first: Finite | None = None
    gap_weighted: Finite | None = None
    gap_last: Finite | None = None
    energy: Literal["equal", "intensity"] | None = None
    zenith_deg: Pair | None = None
    sampled_share: Finite | None = None
    pulses: int | None = None
    lines: int | None = None
    voxel_m: Finite | None = None
    leaf_size_m: Finite | None = None
    scale: Finite | None = None
    scale_first: Finite | None = None
    scale_last: Finite | None = None
    shrinkage: Finite | None = None
    seed: int | None = None


class StatisticsDocument(OpenDocument):
    """The output of `aosplan scene --json`."""

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
    opacity: OpacityDocument | None = None
    warnings: list[MessageDocument]
