"""Schemas of the documents that ``aosplan review``, ``thin`` and ``integrate`` print."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from aosplan.planning.plan_schema import FlightDocument, VisibilityDocument, WaypointDocument
from aosplan.validation import Document, Finite, MessageDocument, OpenDocument, Pair, Pixels


class KeptViewDocument(OpenDocument):
    """A view by its index among all recorded views, from 0; metres from the origin."""

    index: Annotated[int, Field(ge=0)]
    name: str | None
    east_m: Finite
    north_m: Finite
    latitude: Finite | None
    longitude: Finite | None


class ThinnedDetectionDocument(OpenDocument):
    """Probability of detection with all views and with the chosen views."""

    all: Finite
    kept: Finite


class ThinningDocument(OpenDocument):
    """The document that `aosplan thin --json` prints.

    `bound` is the prediction for the same number of views, if they share no occluder.
    """

    schema_: Literal[1] = Field(alias="schema")
    version: str
    request: dict[str, Any]
    model: str
    origin: Pair | None
    positions: int
    samples: int
    best: Literal["normalized", "visibility", "similarity"]
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
    """A photo that belongs to no site, by its index among all photos, from 0."""

    index: Annotated[int, Field(ge=0)]
    name: str | None
    east_m: Finite
    north_m: Finite
    nearest_site: Annotated[int, Field(ge=0)]
    off_m: Finite


class FlownDetectionDocument(OpenDocument):
    """Probabilities of detection: for the plan, for the flown photos, and for the flown photos
    together with photos at the missing sites.
    """

    planned: Finite
    flown: Finite | None
    completed: Finite | None


class AreaCoverageDocument(OpenDocument):
    """Statistics of the photos that see each place of an area (`aosplan.maps.coverage_map`)."""

    area_m2: Finite
    cell_m: Finite
    planned_photos: Finite
    flown_photos: Finite
    unseen_share: Finite
    gap_share: Finite
    gap_m2: Finite
    gaps: int
    gap_share_completed: Finite
    rule: Literal["photos", "detection"]


class ReviewDocument(OpenDocument):
    """The document that `aosplan review --json` prints.

    `flown` is the visibility of the `counted` photos.  `completed` is the visibility of these
    photos and of photos at the `missing` sites.  The missing sites are waypoints of the plan.
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
    """A pinhole camera in pixels, relative to the outer corner of the first pixel."""

    width: Pixels
    height: Pixels
    fx: Annotated[Finite, Field(gt=0)]
    fy: Annotated[Finite, Field(gt=0)]
    cx: Finite
    cy: Finite


PoseRow = Annotated[list[Finite | str], Field(min_length=4, max_length=4)]
"""One row of a pose, with four numbers.  The AOS project writes some numbers as text."""


class ViewDocument(OpenDocument):
    """An image of a recording and its pose [R|t], which transforms world to camera coordinates
    [m].
    """

    imagefile: str
    M3x4: Annotated[list[PoseRow], Field(min_length=3, max_length=3)]
    camera: IntrinsicsDocument | None = None


class PosesDocument(OpenDocument):
    """Poses of a recording in the format of the AOS project, with the additional key `camera`."""

    images: Annotated[list[ViewDocument], Field(min_length=1)]
    camera: IntrinsicsDocument | None = None


class CoverageDocument(OpenDocument):
    """Statistics of the number of views that see a pixel of an integral image."""

    least_views: int
    share: Finite
    mean_views: Finite
    most_views: int


class ComparisonDocument(OpenDocument):
    """SSIM relative to the integral image of another subset of views."""

    choice: str
    views: int
    ssim: Finite
    pixels: int


class PeakDocument(OpenDocument):
    """A peak of the agreement: its height and the standard deviation of the height [m]."""

    place: Finite
    value: Finite
    deviation: Finite


class FocusDocument(OpenDocument):
    """Agreement of integrals of disjoint halves of the views, as a function of height, and
    corrections of poses.
    """

    heights_m: list[Finite]
    agreement: list[Finite]
    ground: PeakDocument
    crowns: PeakDocument | None
    yaw_offset_deg: Finite
    yaw_deviation_deg: Finite
    aligned_views: int
    moved_m: Finite


class IntegralDocument(OpenDocument):
    """The document that `aosplan integrate --json` prints."""

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
