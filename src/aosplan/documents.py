"""Documents that come from files, checked by pydantic, and their JSON Schemas.

A plain command never loads this module: flags meet the same invariants in the classes that
the documents are turned into.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, create_model

from aosplan.camera import Camera
from aosplan.errors import RequestError
from aosplan.files import read_table
from aosplan.mission import Conduct, Mission, Waypoint, Waypoints
from aosplan.options import OPTIONS
from aosplan.quantities import nearest_hint
from aosplan.scene import Layer, LayeredScene, Scene, UniformScene
from aosplan.summary import SCHEMA

if TYPE_CHECKING:
    from collections.abc import Mapping

Finite = Annotated[float, Field(allow_inf_nan=False)]


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


Pair = Annotated[tuple[Finite, Finite], BeforeValidator(_as_tuple)]
"""Two numbers; a file has them as a list."""

Pixels = Annotated[int, Field(gt=0, le=10**9)]


class Document(BaseModel):
    """A table of a file: unknown names are errors."""

    model_config = ConfigDict(extra="forbid", strict=True)


class OpenDocument(BaseModel):
    """A table that later versions may add names to."""

    model_config = ConfigDict(extra="allow", strict=True)


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


class LayerDocument(Document):
    """One slice of a scene."""

    bottom_m: Finite
    top_m: Finite
    density: Finite
    occluder_size_m: Finite


class SceneDocument(OpenDocument):
    """A scene file: one uniform volume, or layers."""

    name: str
    title: str = ""
    source: str = ""
    assumed: str = ""
    density: Finite | None = None
    integrated_density: Finite | None = None
    occluder_size_m: Finite | None = None
    volume_base_m: Finite | None = None
    volume_height_m: Finite | None = None
    voxel_m: Finite | None = None
    layers: list[LayerDocument] | None = None


_KINDS: dict[str, Any] = {
    "number": Finite | str,
    "share": Finite | str,
    "whole": int | str,
    "text": str,
    "pair": Pair | str,
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
    """Shape and size of the grid; x along the heading, y to its right."""

    kind: str
    rows: int
    columns: int
    extent_m: Pair
    pitch_m: Pair


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


class TargetVisibilityDocument(VisibilityDocument):
    """What a model predicts, beside the target."""

    target: Finite
    target_quantity: Literal["normalized", "visibility"]
    model: str
    view: Literal["telecentric", "perspective"] | None


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


class FlightDocument(OpenDocument):
    """Path from the first waypoint to the last, and how it is flown (`mission.Conduct`)."""

    length_m: Finite
    time_s: Finite
    trigger: Literal["stop", "distance"] = "stop"
    speed_mps: Finite = 5.0
    hold_s: Finite = 1.0
    spacing_m: Finite = 0.0
    yaw_deg: Finite = 0.0
    gimbal_pitch_deg: Finite = -90.0
    autopilot: Literal["px4", "ardupilot"] | None = None
    drone: str | None = None
    payload: str | None = None
    takeoff_latitude: Annotated[float, Field(ge=-90, le=90)] | None = None
    takeoff_longitude: Annotated[float, Field(ge=-180, le=180)] | None = None
    takeoff_ground_m: Finite | None = None
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
    limits: list[LimitDocument]
    warnings: list[MessageDocument]
    waypoints: Annotated[list[WaypointDocument], Field(min_length=1)]


class CorrelogramDocument(OpenDocument):
    """Correlation of two views by direction and lag (camera offset over altitude)."""

    lags: list[Finite]
    directions_deg: list[Finite]
    rho: list[list[Finite]]


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
    warnings: list[MessageDocument]


class CalculatorDocument(OpenDocument):
    """What `aosplan visibility --json` prints."""

    schema_: Literal[1] = Field(alias="schema")
    version: str
    samples: int
    dhat: Finite | None
    visibility: VisibilityDocument


DOCUMENTS: dict[str, type[BaseModel]] = {
    "plan": PlanDocument,
    "request": RequestDocument,
    "scene": SceneDocument,
    "camera": CameraDocument,
    "statistics": StatisticsDocument,
    "visibility": CalculatorDocument,
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
    return Camera(**_checked(CameraDocument, read_table(path), path).model_dump())


def read_scene(path: str) -> Scene:
    """A scene from a TOML or JSON file: uniform, or layered.

    Raises
    ------
    RequestError
        Where the file is not a scene.
    """
    document = _checked(SceneDocument, read_table(path), path)
    assert isinstance(document, SceneDocument)
    words = {
        "name": document.name,
        "title": document.title,
        "source": document.source,
        "assumed": document.assumed,
    }
    if document.layers is not None:
        uniform = ("density", "occluder_size_m", "volume_base_m", "volume_height_m")
        both = [name for name in uniform if getattr(document, name) is not None]
        if both:
            raise RequestError(
                f"scene file '{path}' has layers and {' and '.join(both)}",
                "a scene is uniform or layered: keep one of them",
            )
        return LayeredScene(
            layers=tuple(Layer(**layer.model_dump()) for layer in document.layers),
            measured_density=document.integrated_density,
            voxel_m=document.voxel_m,
            **words,
        )
    missing = [
        name
        for name in ("occluder_size_m", "volume_base_m", "volume_height_m")
        if getattr(document, name) is None
    ]
    if missing or (document.density is None and document.integrated_density is None):
        lacking = ", ".join(missing) or "density"
        raise RequestError(
            f"scene file '{path}' lacks {lacking}",
            "a uniform scene has density, occluder_size_m, volume_base_m and volume_height_m; "
            "a layered one [[layers]]",
        )
    assert document.occluder_size_m is not None
    assert document.volume_base_m is not None
    assert document.volume_height_m is not None
    return UniformScene(
        density=document.density,
        occluder_size_m=document.occluder_size_m,
        volume_base_m=document.volume_base_m,
        volume_height_m=document.volume_height_m,
        given_integrated_density=document.integrated_density,
        **words,
    )


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
    return _checked(RequestDocument, table, path).model_dump(exclude_none=True)


def read_mission(path: str) -> Mission:
    """The mission of a saved plan."""
    table = read_table(path)
    document = _checked(PlanDocument, table, path)
    assert isinstance(document, PlanDocument)
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


def _checked(model: type[BaseModel], table: Mapping[str, Any], path: str) -> BaseModel:
    try:
        return model.model_validate(table)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"] if not _is_branch(part)) or "the file"
        hint = ""
        if first["type"] == "extra_forbidden":
            hint = nearest_hint(str(first["loc"][-1]), _names_at(model, first["loc"]))
            raise RequestError(f"'{path}': unknown name '{place}'", hint) from None
        message = first["msg"][:1].lower() + first["msg"][1:]
        raise RequestError(f"'{path}': {place}: {message}", hint) from None
    except RecursionError:
        raise RequestError(f"'{path}' is nested too deeply") from None


def _names_at(model: type[BaseModel], place: tuple[int | str, ...]) -> list[str]:
    """Names that a document knows where an unknown one was found: its own, or its layers'."""
    inside_layers = model is SceneDocument and place[0] == "layers"
    return list((LayerDocument if inside_layers else model).model_fields)


def _is_branch(part: Any) -> bool:
    """Whether a part of an error's place names a type of a union, not a name of the file."""
    return isinstance(part, str) and (
        part in {"str", "float", "int"} or part.startswith(("constrained", "tuple", "function"))
    )
