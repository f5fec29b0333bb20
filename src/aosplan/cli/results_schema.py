"""JSON documents that the other commands print, or read, for their schemas."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from aosplan.planning.plan_schema import (
    FlightDocument,
    MessageDocument,
    PlanDocument,
    VisibilityDocument,
    WaypointDocument,
)
from aosplan.scenes.files.scene_schema import (
    CorrelogramDocument,
    LayerDocument,
)
from aosplan.validation import (
    Document,
    Finite,
    OpenDocument,
    Pair,
    Pixels,
)


class TradeoffRowDocument(OpenDocument):
    """A pattern at a baseline: at the smallest that meets the target, or the nearest to it.

    On the front, no row that meets the target is as good in samples, extent and time and better
    in one; under the objectives that are maximised, no row at all, and in their value too.
    """

    grid: str
    samples: int
    rows: int
    columns: int
    baseline_m: Finite
    aperture_m: Finite
    extent_x_m: Finite
    extent_y_m: Finite
    pitch_y_m: Finite
    length_m: Finite
    time_s: Finite
    density: Finite
    expected: Finite
    normalized: Finite | None
    effective_samples: Finite | None
    contrast: Finite | None
    meets: bool
    front: bool
    chosen: bool


class TradeoffDocument(OpenDocument):
    """What `aosplan tradeoff --json` prints."""

    schema_: Literal[1] = Field(alias="schema")
    version: str
    request: dict[str, Any]
    rows: list[TradeoffRowDocument]


class PredictedDocument(OpenDocument):
    """A model's answer to the question of an experiment."""

    density: Finite
    expected: Finite
    normalized: Finite | None


class SimulatedDocument(PredictedDocument):
    """What an experiment found, with standard errors."""

    density_standard_error: Finite
    expected_standard_error: Finite
    normalized_standard_error: Finite | None


class ToleranceDocument(OpenDocument):
    """Error of an experiment that is not chance."""

    density: Finite
    expected: Finite
    normalized: Finite


class SimilarityDocument(OpenDocument):
    """SSIM of images of the ground to that of endless views."""

    single: Finite
    integral: Finite


class SimulationDocument(PlanDocument):
    """What `aosplan simulate --json` prints."""

    predicted: PredictedDocument
    simulated: SimulatedDocument
    agree: bool
    differences: list[str]
    tolerance: ToleranceDocument
    forest: Literal["noise", "uniform", "layered", "clumped", "cloud"]
    view: Literal["telecentric", "perspective"] | None
    seed: int
    precision: Finite
    precise: bool
    views: int
    targets: int
    volumes: int
    similarity: SimilarityDocument | None = None


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


class FigureDocument(OpenDocument):
    """What `aosplan plot --json` prints: a figure in words, and the numbers in it."""

    schema_: Literal[1] = Field(alias="schema")
    version: str
    kind: str
    title: str
    description: str
    data: dict[str, Any]


class CalculatorDocument(OpenDocument):
    """What `aosplan visibility --json` prints."""

    schema_: Literal[1] = Field(alias="schema")
    version: str
    samples: int
    dhat: Finite | None
    visibility: VisibilityDocument


class KeptViewDocument(OpenDocument):
    """A view by its place among all that were recorded, from 0; metres from the origin."""

    index: Annotated[int, Field(ge=0)]
    name: str | None
    east_m: Finite
    north_m: Finite
    latitude: Finite | None
    longitude: Finite | None


class ThinningDocument(OpenDocument):
    """What `aosplan thin --json` prints.

    `bound` is what as many views would show that share no occluder.
    """

    schema_: Literal[1] = Field(alias="schema")
    version: str
    request: dict[str, Any]
    model: str
    origin: Pair | None
    positions: int
    samples: int
    best: Literal["normalized", "visibility"]
    all: VisibilityDocument
    kept: VisibilityDocument
    bound: VisibilityDocument
    views: list[KeptViewDocument]
    warnings: list[MessageDocument]


class OffSiteDocument(OpenDocument):
    """Distances of photos from their sites [m]."""

    root_mean_square: Finite
    largest: Finite


class StrayDocument(OpenDocument):
    """A photo that belongs to no site, by its place among all, from 0."""

    index: Annotated[int, Field(ge=0)]
    name: str | None
    east_m: Finite
    north_m: Finite
    nearest_site: Annotated[int, Field(ge=0)]
    off_m: Finite


class ReviewDocument(OpenDocument):
    """What `aosplan review --json` prints.

    `counted` photos are those whose visibility is `flown`; `completed` is that of them and of the
    `missing` sites, which are waypoints of the plan.
    """

    schema_: Literal[1] = Field(alias="schema")
    version: str
    request: dict[str, Any]
    model: str
    origin: Pair | None
    tolerance_m: Finite
    positions: int
    counted: int
    sites: int
    sites_flown: int
    off_site_m: OffSiteDocument | None
    planned: VisibilityDocument
    flown: VisibilityDocument | None
    completed: VisibilityDocument | None
    missing: list[WaypointDocument]
    strays: list[StrayDocument]
    topup: FlightDocument | None
    warnings: list[MessageDocument]


class IntrinsicsDocument(Document):
    """A pinhole camera in pixels, counted from the outer corner of the first one."""

    width: Pixels
    height: Pixels
    fx: Annotated[Finite, Field(gt=0)]
    fy: Annotated[Finite, Field(gt=0)]
    cx: Finite
    cy: Finite


PoseRow = Annotated[list[Finite | str], Field(min_length=4, max_length=4)]
"""Four numbers of a pose, some of which the AOS project writes as text."""


class ViewDocument(OpenDocument):
    """An image of a recording and its pose, [R|t] from the world to the camera, in metres."""

    imagefile: str
    M3x4: Annotated[list[PoseRow], Field(min_length=3, max_length=3)]
    camera: IntrinsicsDocument | None = None


class PosesDocument(OpenDocument):
    """Poses of a recording, as the AOS project publishes them; the camera is an addition of ours."""

    images: Annotated[list[ViewDocument], Field(min_length=1)]
    camera: IntrinsicsDocument | None = None


class CoverageDocument(OpenDocument):
    """How many views see the pixels of an integral image."""

    least_views: int
    share: Finite
    mean_views: Finite
    most_views: int


class ComparisonDocument(OpenDocument):
    """SSIM against the integral image of another choice of views."""

    choice: str
    views: int
    ssim: Finite
    pixels: int


class IntegralDocument(OpenDocument):
    """What `aosplan integrate --json` prints."""

    schema_: Literal[1] = Field(alias="schema")
    version: str
    views: int
    recorded_views: int
    up: Literal["z", "-z", "y", "-y"]
    focal_height_m: Finite
    altitude_m: Finite
    aperture_m: Pair
    nearest_m: Finite | None
    gsd_m: Finite
    extent_m: list[Finite]
    size_px: list[int]
    coverage: CoverageDocument
    limits: Pair
    comparison: ComparisonDocument | None
    warnings: list[MessageDocument]
