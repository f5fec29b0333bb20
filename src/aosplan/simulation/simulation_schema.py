"""Schema of the document that ``aosplan simulate --json`` prints."""

from __future__ import annotations

from typing import Literal

from aosplan.planning.plan_schema import PlanDocument
from aosplan.validation import Finite, OpenDocument


class PredictedDocument(OpenDocument):
    """Prediction of a model for an experiment."""

    density: Finite
    expected: Finite
    normalized: Finite | None


class SimulatedDocument(PredictedDocument):
    """Result of an experiment, with standard errors."""

    density_standard_error: Finite
    expected_standard_error: Finite
    normalized_standard_error: Finite | None


class ToleranceDocument(OpenDocument):
    """Systematic error of an experiment."""

    density: Finite
    expected: Finite
    normalized: Finite


class SimilarityDocument(OpenDocument):
    """Similarity (SSIM) of images of the ground to the image of infinitely many views."""

    single: Finite
    integral: Finite


class SearchDocument(OpenDocument):
    """Comparison of a simulated search with the predicted probability of detection."""

    predicted: Finite
    simulated: Finite
    standard_error: Finite
    agree: bool
    tolerance: Finite
    simulated_at_rate: Finite
    false_alarms_per_hectare: Finite
    stated_per_hectare: Finite
    seen_at_least: dict[str, Finite]
    forest: Literal["uniform", "layered", "clumped", "cloud"]
    forests: int
    targets: int
    hectares: Finite
    seed: int


class SimulationDocument(PlanDocument):
    """The output of `aosplan simulate --json`."""

    predicted: PredictedDocument
    simulated: SimulatedDocument
    agree: bool
    differences: list[str]
    as_flown: list[str]
    tolerance: ToleranceDocument
    forest: Literal["noise", "uniform", "layered", "clumped", "cloud"]
    occluders: Literal["cubes", "leaves"] | None
    view: Literal["telecentric", "perspective"] | None
    seed: int
    precision: Finite
    precise: bool
    views: int
    targets: int
    volumes: int
    similarity: SimilarityDocument | None = None
    search: SearchDocument | None = None
