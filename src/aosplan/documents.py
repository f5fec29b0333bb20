"""Documents that come from files, checked by pydantic, and their JSON Schemas.

A plain command never loads this module: flags meet the same invariants in the classes that
the documents are turned into.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, create_model

from aosplan.camera import Camera
from aosplan.checked import Document, Finite, OpenDocument, Pair, Pixels, checked
from aosplan.errors import RequestError
from aosplan.files import read_table
from aosplan.mission import Conduct, Mission, Waypoint, Waypoints, split
from aosplan.options import OPTIONS
from aosplan.quantities import nearest_hint
from aosplan.scene_schema import CorrelogramDocument, LayerDocument, SceneDocument
from aosplan.summary import SCHEMA


class CameraDocument(Document):
    """A camera file."""

    name: str
    focal_length_mm: Finite
    sensor_width_mm: Finite
    sensor_height_mm: Finite
    image_width_px: Pixels
    image_height_px: Pixels
    title: str = ""
    source: str = ""
    assumed: str = ""


_KINDS: dict[str, Any] = {
    "number": Finite | str,
    "share": Finite | str,
    "whole": int | str,
    "text": str,
    "pair": Pair | str,
    "flag": bool,
}

_OPTION_FIELDS: dict[str, Any] = {
    option.name: (_KINDS[option.kind] | None, Field(default=None, description=option.help))
    for option in OPTIONS
}

RequestDocument = create_model(
    "RequestDocument",
    __base__=Document,
    __doc__="A request file: the options of `aosplan plan`, with underscores for hyphens.",
    **_OPTION_FIELDS,
)


class WaypointDocument(Document):
    """One position, in flight order; a photo is taken unless `photo` is false."""

    index: int
    east_m: Finite
    north_m: Finite
    altitude_m: Finite
    latitude: Annotated[float, Field(ge=-90, le=90)] | None = None
    longitude: Annotated[float, Field(ge=-180, le=180)] | None = None
    ground_m: Finite | None = None
    photo: bool = True


class GridDocument(OpenDocument):
    """Shape and size of the grid; x along the heading, y to its right.

    A spiral is one row of all its sites, wound up: its pitch is that of neighbours along it, and
    that of its turns; its extent that of the rectangle around it.
    """

    kind: str
    rows: int
    columns: int
    extent_m: Pair
    pitch_m: Pair
    heading_deg: Finite | None = None


class VisibilityDocument(OpenDocument):
    """What a model predicts."""

    density: Finite
    minimum: Finite
    maximum: Finite
    expected: Finite
    normalized: Finite | None
    shortfall: Finite | None
    effective_samples: Finite | None
    contrast: Finite | None


class UncertaintyDocument(OpenDocument):
    """Standard errors of a prediction, and how they were found."""

    density: Finite
    expected: Finite
    normalized: Finite | None
    method: str


class NoiseDocument(OpenDocument):
    """Flights that the expectation over position noise was taken from, and its standard errors."""

    flights: int
    seed: int
    density_error: Finite
    expected_error: Finite
    normalized_error: Finite


class ChangeDocument(OpenDocument):
    """A scene that differs in one quantity, and what it does to the plan."""

    quantity: Literal["density", "occluder_size", "height"]
    factor: Finite
    visibility: Finite | None
    normalized: Finite | None
    samples: int | None
    baseline_m: Finite | None
    reason: str | None


class TargetVisibilityDocument(VisibilityDocument):
    """What a model predicts, beside the target."""

    target: Finite
    target_quantity: Literal["normalized", "visibility"]
    model: str
    view: Literal["telecentric", "perspective"] | None
    approximation: Literal["correlogram"] | None = None
    rays: str | None = None
    edges: Literal["wrapped"] | None = None
    uncertainty: UncertaintyDocument | None = None
    uncertainty_reason: str | None = None
    noise: NoiseDocument | None = None


class DisparityDocument(OpenDocument):
    """Disparity of the occluder that decides the coverage rule."""

    normalized: Finite | None
    pixels: Finite | None
    occluder_pixels: Finite | None


class CameraSummaryDocument(OpenDocument):
    """What the camera sees of the focal plane."""

    name: str
    gsd_m: Finite
    footprint_m: Pair
    common_footprint_m: Pair


class OneFlightDocument(OpenDocument):
    """What one battery flies: its first and last waypoint; length and time with the way there."""

    first: Annotated[int, Field(ge=0)]
    last: Annotated[int, Field(ge=0)]
    samples: int
    length_m: Finite
    time_s: Finite


class FlightDocument(OpenDocument):
    """Path from the first photo to the last, how it is flown (`mission.Conduct`), and flights."""

    length_m: Finite
    time_s: Finite
    trigger: Literal["stop", "distance"] = "stop"
    speed_mps: Annotated[Finite, Field(gt=0)] = 5.0
    hold_s: Annotated[Finite, Field(ge=0)] = 1.0
    spacing_m: Annotated[Finite, Field(ge=0)] = 0.0
    yaw_deg: Finite = 0.0
    gimbal_pitch_deg: Annotated[Finite, Field(ge=-180, le=180)] = -90.0
    autopilot: Literal["px4", "ardupilot"] | None = None
    drone: str | None = None
    payload: str | None = None
    takeoff_latitude: Annotated[float, Field(ge=-90, le=90)] | None = None
    takeoff_longitude: Annotated[float, Field(ge=-180, le=180)] | None = None
    takeoff_ground_m: Finite | None = None
    acceleration_mps2: Finite | None = None
    climb_mps: Finite | None = None
    run_in_m: Finite = 0.0
    total_time_s: Finite | None = None
    flights: list[OneFlightDocument] | None = None
    altitude_frame: Literal["takeoff", "terrain"] = "takeoff"
    most_waypoints: Annotated[int, Field(ge=2)] | None = None


class LimitDocument(OpenDocument):
    """What bound the result."""

    quantity: str
    value: Finite
    bound: Finite
    message: str


class MessageDocument(OpenDocument):
    """A warning."""

    code: str
    message: str


class SceneSummaryDocument(OpenDocument):
    """The scene in a few words and numbers."""

    name: str
    kind: str
    title: str
    source: str
    assumed: str
    integrated_density: Finite
    canopy_top_m: Finite


class PlanDocument(OpenDocument):
    """What `aosplan plan --json` prints."""

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
    limits: list[LimitDocument]
    sensitivity: list[ChangeDocument] | None = None
    warnings: list[MessageDocument]
    waypoints: Annotated[list[WaypointDocument], Field(min_length=1)]


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


class CalculatorDocument(OpenDocument):
    """What `aosplan visibility --json` prints."""

    schema_: Literal[1] = Field(alias="schema")
    version: str
    samples: int
    dhat: Finite | None
    visibility: VisibilityDocument


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


DOCUMENTS: dict[str, type[BaseModel]] = {
    "plan": PlanDocument,
    "simulation": SimulationDocument,
    "request": RequestDocument,
    "scene": SceneDocument,
    "camera": CameraDocument,
    "statistics": StatisticsDocument,
    "visibility": CalculatorDocument,
    "poses": PosesDocument,
    "integral": IntegralDocument,
    "tradeoff": TradeoffDocument,
}


def json_schema(name: str) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a document.

    Raises
    ------
    RequestError
        Where no document has the name.
    """
    if name not in DOCUMENTS:
        raise RequestError(
            f"unknown document '{name}'",
            nearest_hint(name, DOCUMENTS) or f"one of {', '.join(DOCUMENTS)}",
        )
    schema = DOCUMENTS[name].model_json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def read_camera(path: str) -> Camera:
    """A camera from a TOML or JSON file."""
    return Camera(**checked(CameraDocument, read_table(path), path).model_dump())


def read_request(path: str) -> dict[str, Any]:
    """The values of a request file: a table of options, or an earlier result that holds one."""
    table = read_table(path)
    inner = table.get("request")
    if isinstance(inner, dict):
        if table.get("schema") != SCHEMA:
            raise RequestError(
                f"'{path}' has schema {table.get('schema')!r}, not {SCHEMA}",
                "it was written by another version of aosplan",
            )
        table = inner
    return checked(RequestDocument, table, path).model_dump(exclude_none=True)


def read_mission(path: str) -> Mission:
    """The mission of a saved plan, all flights in one."""
    return _mission(*_saved_plan(path), path)


def read_missions(path: str) -> tuple[Mission, ...]:
    """The missions of a saved plan, one for each of its flights."""
    table, document = _saved_plan(path)
    whole, flights = _mission(table, document, path), document.flight.flights
    if flights is None:
        return (whole,)
    ranges = [(flight.first, flight.last) for flight in flights]
    flown = [place for first, last in ranges for place in range(first, last + 1)]
    if flown != list(range(len(whole.waypoints))) or any(last < first for first, last in ranges):
        raise RequestError(f"'{path}': the flights do not take each waypoint once, in order")
    return split(whole, ranges)


def _saved_plan(path: str) -> tuple[dict[str, Any], PlanDocument]:
    table = read_table(path)
    document = checked(PlanDocument, table, path)
    assert isinstance(document, PlanDocument)
    return table, document


def _mission(table: dict[str, Any], document: PlanDocument, path: str) -> Mission:
    waypoints = [Waypoint(**waypoint.model_dump()) for waypoint in document.waypoints]
    given = {tuple(value is None for value in waypoint) for waypoint in waypoints}
    half_placed = (waypoints[0].latitude is None) != (waypoints[0].longitude is None)
    if len(given) > 1 or half_placed or [w.index for w in waypoints] != list(range(len(waypoints))):
        raise RequestError(f"'{path}': the waypoints are not one gapless list in flight order")
    return Mission(
        Waypoints.of(waypoints),
        {name: value for name, value in table.items() if name != "waypoints"},
        Conduct(**document.flight.model_dump(include=set(Conduct._fields))),
    )
