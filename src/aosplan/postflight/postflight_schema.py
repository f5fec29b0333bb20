"""Schemas of the documents that ``aosplan review``, ``thin`` and ``integrate`` print."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from aosplan.planning.plan_schema import FlightDocument, VisibilityDocument, WaypointDocument
from aosplan.validation import Document, Finite, MessageDocument, OpenDocument, Pair, Pixels


class KeptViewDocument(OpenDocument):
    """A view by its place among all that were recorded, from 0; metres from the origin."""

    index: Annotated[int, Field(ge=0)]
    name: str | None
    east_m: Finite
    north_m: Finite
    latitude: Finite | None
    longitude: Finite | None


class ThinnedDetectionDocument(OpenDocument):
    """Probability of detection by all views, and by the chosen ones."""

    all: Finite
    kept: Finite


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
    detection: ThinnedDetectionDocument | None = None
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


class FlownDetectionDocument(OpenDocument):
    """Probability of detection: as planned, by the photos, and by them and the missing sites."""

    planned: Finite
    flown: Finite | None
    completed: Finite | None


class AreaCoverageDocument(OpenDocument):
    """What the photos show of an area, place by place (`aosplan.maps.coverage_map`)."""

    area_m2: Finite
    cell_m: Finite
    planned_photos: Finite
    flown_photos: Finite
    unseen_share: Finite
    gap_share: Finite
    gap_m2: Finite
    gaps: int
    rule: Literal["photos", "detection"]


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
    detection: FlownDetectionDocument | None = None
    coverage: AreaCoverageDocument | None = None
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


class PeakDocument(OpenDocument):
    """A peak of the agreement, at a height, with its standard deviation [m]."""

    place: Finite
    value: Finite
    deviation: Finite


class FocusDocument(OpenDocument):
    """Agreement of integrals from disjoint halves of the views over heights, and what was corrected."""

    heights_m: list[Finite]
    agreement: list[Finite]
    ground: PeakDocument
    crowns: PeakDocument | None
    yaw_offset_deg: Finite
    yaw_deviation_deg: Finite
    aligned_views: int
    moved_m: Finite


class IntegralDocument(OpenDocument):
    """What `aosplan integrate --json` prints."""

    schema_: Literal[1] = Field(alias="schema")
    version: str
    views: int
    recorded_views: int
    up: Literal["z", "-z", "y", "-y"]
    focal_height_m: Finite
    origin: Pair | None
    crs: str | None
    altitude_m: Finite
    aperture_m: Pair
    nearest_m: Finite | None
    gsd_m: Finite
    extent_m: list[Finite]
    size_px: list[int]
    coverage: CoverageDocument
    focus: FocusDocument | None
    limits: Pair
    comparison: ComparisonDocument | None
    warnings: list[MessageDocument]
