"""Pydantic models of a plan's JSON document, for its schema and for checks when a plan is read."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from aosplan.validation import Document, Finite, MessageDocument, OpenDocument, Pair, Words


class WaypointDocument(Document):
    """One position of the flight.  A photo is taken unless `photo` is false."""

    index: int
    east_m: Finite
    north_m: Finite
    altitude_m: Finite
    latitude: Annotated[float, Field(ge=-90, le=90)] | None = None
    longitude: Annotated[float, Field(ge=-180, le=180)] | None = None
    ground_m: Finite | None = None
    photo: bool = True


class GridDocument(OpenDocument):
    """Shape and size of the grid. x is along the heading and y is to its right.

    A spiral is described as one row that contains all its sites.  Its pitch is the distance between
    neighbours along the spiral, and the distance between its turns.  Its extent is the size of the
    rectangle around it.
    """

    kind: str
    rows: int
    columns: int
    extent_m: Pair
    pitch_m: Pair
    heading_deg: Finite | None = None


class VisibilityDocument(OpenDocument):
    """Prediction of a model."""

    density: Finite
    minimum: Finite
    maximum: Finite
    expected: Finite
    normalized: Finite | None
    shortfall: Finite | None
    effective_samples: Finite | None
    contrast: Finite | None


class ErrorPartDocument(OpenDocument):
    """One contribution to the standard errors of a prediction."""

    source: Literal["plot", "opacity", "clumps", "edges"]
    density: Finite
    expected: Finite
    normalized: Finite | None


class UncertaintyDocument(OpenDocument):
    """Standard errors of a prediction, with the errors that they include and those that they
    omit.
    """

    density: Finite
    expected: Finite
    normalized: Finite | None
    method: str
    parts: list[ErrorPartDocument]
    omits: list[str]


class NoiseDocument(OpenDocument):
    """Expectation over position noise: the number of simulated flights, and standard errors."""

    flights: int
    seed: int
    density_error: Finite
    expected_error: Finite
    normalized_error: Finite


class ChangeDocument(OpenDocument):
    """Effect on the plan of a change of one quantity of the scene."""

    quantity: Literal["density", "occluder_size", "height"]
    factor: Finite
    visibility: Finite | None
    normalized: Finite | None
    samples: int | None
    baseline_m: Finite | None
    reason: str | None


class GroundVisibilityDocument(OpenDocument):
    """Visibility over the whole ground of the plan, with slanted rays."""

    size_m: Pair
    density: Finite
    expected: Finite
    normalized: Finite | None
    worst_expected: Finite


class TargetVisibilityDocument(VisibilityDocument):
    """Prediction of a model, and the target."""

    target: Finite
    target_quantity: Literal["normalized", "visibility"]
    model: str
    view: Literal["telecentric", "perspective"] | None
    approximation: Literal["correlogram"] | None = None
    one_photo: Finite | None = None
    reading: Literal["rule", "slices"] | None = None
    ground: GroundVisibilityDocument | None = None
    rays: str | None = None
    edges: Literal["interior", "wrapped"] | None = None
    uncertainty: UncertaintyDocument | None = None
    uncertainty_reason: str | None = None
    noise: NoiseDocument | None = None


class DisparityDocument(OpenDocument):
    """Disparity of the occluder that determines the baseline of the coverage rule."""

    normalized: Finite | None
    pixels: Finite | None
    occluder_pixels: Finite | None


class CameraSummaryDocument(OpenDocument):
    """Resolution and footprint of the camera on the focal plane."""

    name: str
    gsd_m: Finite
    footprint_m: Pair
    common_footprint_m: Pair


class OneFlightDocument(OpenDocument):
    """A flight with one battery: first and last waypoint; length and time from take-off to
    landing.
    """

    first: Annotated[int, Field(ge=0)]
    last: Annotated[int, Field(ge=0)]
    samples: int
    length_m: Finite
    time_s: Finite
    climb_m: Finite | None = None
    return_m: Finite | None = None


class FlightDocument(OpenDocument):
    """The path from the first photo to the last, the settings of the flight
    (`mission.FlightSettings`), and the flights.
    """

    length_m: Finite
    time_s: Finite
    trigger: Literal["stop", "distance"] = "stop"
    speed_mps: Annotated[Finite, Field(gt=0)] = 5.0
    hold_s: Annotated[Finite, Field(ge=0)] = 1.0
    spacing_m: Annotated[Finite, Field(ge=0)] = 0.0
    yaw_deg: Finite = 0.0
    gimbal_pitch_deg: Annotated[Finite, Field(ge=-180, le=180)] = -90.0
    autopilot: Literal["px4", "ardupilot", "dji", "autel", "parrot"] | None = None
    camera_control: Literal["mavlink", "outputs"] | None = None
    drone: str | None = None
    payload: str | None = None
    takeoff_latitude: Annotated[float, Field(ge=-90, le=90)] | None = None
    takeoff_longitude: Annotated[float, Field(ge=-180, le=180)] | None = None
    takeoff_ground_m: Finite | None = None
    height_datum: str | None = None
    transit_mps: Annotated[Finite, Field(gt=0)] | None = None
    transit_climb_m: Finite | None = None
    transit_return_m: Finite | None = None
    acceleration_mps2: Finite | None = None
    climb_mps: Finite | None = None
    run_in_m: Finite = 0.0
    total_time_s: Finite | None = None
    flights: list[OneFlightDocument] | None = None
    altitude_frame: Literal["takeoff", "terrain"] = "takeoff"
    most_waypoints: Annotated[int, Field(ge=2)] | None = None
    file_waypoints: Annotated[int, Field(ge=2)] | None = None
    mission_formats: Words | None = None


class LimitDocument(OpenDocument):
    """A limit that determines the result."""

    quantity: str
    value: Finite
    bound: Finite
    message: str


class SceneSummaryDocument(OpenDocument):
    """Summary of the scene."""

    name: str
    kind: str
    title: str
    source: str
    assumed: str
    integrated_density: Finite
    canopy_top_m: Finite


class AreaDocument(OpenDocument):
    """Coverage of an area (`aosplan.areas.survey.Survey`)."""

    origin: Pair
    area_m2: Finite
    clear_m2: Finite
    no_fly_m2: Finite
    covered_share: Finite
    fewest_looks: int | None
    sites: int
    sites_in_rectangle: int
    sites_in_no_fly: int
    sites_enclosed: int
    rectangle_m: Pair
    pitch_m: Pair
    axis: Literal["along", "across"]
    shortest_m: Finite
    over_shortest: Finite | None
    simplified_m: Finite
    projection_error: Finite


class LineIntegralDocument(OpenDocument):
    """An integral of the last photos of a continuous line."""

    samples: int
    spacing_m: Finite
    length_m: Finite
    speed_mps: Finite
    interval_s: Finite
    duration_s: Finite
    expected: Finite
    normalized: Finite


class ContinuousDocument(OpenDocument):
    """Integrals along a line, by number of photos and by speed."""

    fastest_mps: Finite | None
    by_samples: list[LineIntegralDocument]
    by_speed: list[LineIntegralDocument]


class SeenShareDocument(OpenDocument):
    """Distribution of the share of a target that the photos see, over places and directions."""

    mean: Finite
    p05: Finite
    median: Finite
    p95: Finite
    at_least: dict[str, Finite]


class WithinRowDocument(OpenDocument):
    """The best plan within a given time.  It has no flight data if no plan is possible."""

    within_min: Finite
    found: bool
    time_s: Finite | None = None
    flights: int | None = None
    rows: int | None = None
    columns: int | None = None
    pitch_m: Pair | None = None
    altitude_m: Finite | None = None
    heading_deg: Finite | None = None
    trigger: str | None = None
    photos: int | None = None


class WithinDocument(OpenDocument):
    """Result of a search within a given time (`aosplan.planning.within`)."""

    minutes: Finite
    asked: bool
    objective: str
    rows: list[WithinRowDocument]
    curve: list[Pair]
    predicted: int
    laid_out: int


class ShortestOrderDocument(OpenDocument):
    """The shortest order, for comparison with the order by gain."""

    probability_of_success: Finite
    mean_time_s: Finite
    curve: list[Pair]


class GainFlightDocument(OpenDocument):
    """Probability of success of one flight."""

    landed_s: Finite
    probability_of_success: Finite
    cumulative_probability_of_success: Finite


class GainDocument(OpenDocument):
    """Result of an order by gain (`aosplan.planning.gain_order`)."""

    probability_of_area: Finite
    probability_of_success: Finite
    mean_time_s: Finite
    shortest_order: ShortestOrderDocument
    flights: list[GainFlightDocument]
    curve: list[Pair]
    photos: int
    photos_of_whole_area: int


class PhotosByPlaceDocument(OpenDocument):
    """Statistics of the number of photos that see a cell of a map."""

    mean: Finite
    least: int
    most: int


class DetectionMapDocument(OpenDocument):
    """Probability of detection by place (`aosplan.maps.detection_map`)."""

    probability: Finite
    ground: Literal["area", "footprints"]
    area_m2: Finite
    cell_m: Finite
    photos: PhotosByPlaceDocument
    unseen_share: Finite
    canopy: Literal["scene", "local"]
    sweep_width_m: Finite | None
    probability_of_area: Finite | None
    probability_of_success: Finite | None


class DetectionDocument(OpenDocument):
    """Seen share and probability of detection of a target (`aosplan.models.detection`)."""

    target_m: Pair
    probability: Finite
    probability_by_contrast: list[Pair]
    seen_share: SeenShareDocument
    contrast: Finite
    canopy_offset: Finite
    crown_share: Finite
    false_alarms_per_hectare: Finite
    threshold: Finite
    clutter: Finite
    assumed: str | None
    uncertainty: Finite | None
    map: DetectionMapDocument | None = None


class PlainFlightDocument(OpenDocument):
    """A plain grid that takes at most the same time as guided positions."""

    kind: Literal["lanes", "line", "square", "trimmed"]
    trigger: Literal["stop", "distance"]
    rows: int
    columns: int
    pitch_m: Pair
    samples: int
    time_s: Finite
    density: Finite
    expected: Finite
    normalized: Finite
    least_expected: Finite
    unseen_share: Finite


class GuidedDocument(OpenDocument):
    """How guided positions were chosen (`aosplan.planning.guided`)."""

    chosen_with: str
    predicted_with: str
    pulses: int
    target_area_m2: Finite
    targets: int
    target_pitch_m: Finite
    candidates: int
    step_m: Finite
    reach_m: Pair
    chosen_expected: Finite
    least_expected: Finite
    unseen_share: Finite
    plain: list[PlainFlightDocument]


class ReciprocalMapDocument(OpenDocument):
    """How much of a target area is visible from each position (`aosplan.maps.reciprocal_map`)."""

    target_area_m2: Finite
    targets: int
    altitude_m: Finite
    cell_m: Finite
    positions: int
    mean: Finite
    most: Finite
    best_east_m: Finite
    best_north_m: Finite


class PlanDocument(OpenDocument):
    """The document that `aosplan plan --json` prints."""

    schema_: Literal[1] = Field(alias="schema")
    version: str
    request: dict[str, Any]
    scene: SceneSummaryDocument
    altitude_m: Finite
    baseline_m: Finite
    samples: int
    samples_required: int | None
    aperture_m: Finite
    grid: GridDocument
    visibility: TargetVisibilityDocument
    disparity: DisparityDocument
    camera: CameraSummaryDocument
    flight: FlightDocument
    height: dict[str, Any] | None = None
    area: AreaDocument | None = None
    continuous: ContinuousDocument | None = None
    detection: DetectionDocument | None = None
    within: WithinDocument | None = None
    gain: GainDocument | None = None
    guided: GuidedDocument | None = None
    reciprocal_map: ReciprocalMapDocument | None = None
    limits: list[LimitDocument]
    sensitivity: list[ChangeDocument] | None = None
    warnings: list[MessageDocument]
    waypoints: Annotated[list[WaypointDocument], Field(min_length=1)]
