"""Pydantic models of scene files, for the JSON Schema and for error messages."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from aosplan.validation import Document, Finite


class LayerDocument(Document):
    """One slice of a scene."""

    bottom_m: Finite
    top_m: Finite
    density: Finite
    occluder_size_m: Finite


class InteriorDocument(Document):
    """A correlogram of the targets whose rays to an aperture stay on the plot."""

    density: Finite
    rho: list[list[Finite]]
    density_by_offset: list[list[Finite]]


class CorrelogramDocument(Document):
    """Correlation of two views by direction and lag.  The lag is the camera offset divided by the
    altitude.
    """

    lags: list[Finite]
    directions_deg: list[Finite]
    rho: list[list[Finite]]
    reach: Finite
    interior: list[InteriorDocument] = Field(default_factory=list)


class SceneDocument(Document):
    """A scene file: one uniform volume, layers, or the numbers of an inventory.

    The output of `aosplan scene --json` is also a scene file. Values that can be computed from
    other values are not read.
    """

    name: str
    title: str = ""
    source: str = ""
    assumed: str = ""
    density: Finite | None = None
    integrated_density: Finite | None = None
    occluder_size_m: Finite | None = None
    volume_base_m: Finite | None = None
    volume_height_m: Finite | None = None
    stems_per_hectare: Finite | None = None
    crown_diameter_m: Finite | None = None
    leaf_area_index: Finite | None = None
    voxel_m: Finite | None = None
    layers: list[LayerDocument] | None = None
    correlogram: CorrelogramDocument | None = None
    density_by_offset: list[list[Finite]] | None = None

    # The program prints these statistics, but does not read them.
    schema_: Any = Field(default=None, alias="schema")
    version: Any = None
    kind: Any = None
    mean_density: Any = None
    canopy_top_m: Any = None
    baseline_curve: Any = None
    density_by_angle: Any = None
    opacity: Any = None
    edges: Any = None
    ground: Any = None
    min_height_m: Any = None
    points: Any = None
    points_per_m2: Any = None
    plot_m: Any = None
    warnings: Any = None
