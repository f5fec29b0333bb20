"""The request: everything that decides a plan, and nothing about where it is written.

`PlanRequest` has the options of ``aosplan plan`` (`aosplan.planning.options`) as fields, with underscores
for hyphens.  Fields left None take a default, or are not used.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, cast

from aosplan import units as q
from aosplan.errors import RequestError
from aosplan.grid.patterns import NARROWEST_TURNS
from aosplan.planning.aircraft import camera_of_payload, settled
from aosplan.planning.option_relations import (
    ALTERNATIVES,
    LANE_OPTIONS,
    OF_LANES,
    beneath,
    check_alternatives,
    check_needs,
    check_search,
    completed_target,
    default_target,
    fitting,
    given_flags,
    is_search,
    left_open,
)
from aosplan.planning.options import BY_NAME, DEFAULTS, OPTIONS
from aosplan.solver import refusals

if TYPE_CHECKING:
    from collections.abc import Mapping

    from aosplan.flight.drones import DronePreset


@dataclass(frozen=True, eq=False)  # comparing field by field costs each start 2 ms to compile
class PlanRequest:
    """What ``aosplan plan`` takes, checked; fields are its options with underscores.

    Lengths are metres, angles degrees, times seconds, focal length and sensor millimetres.
    Text is read as on the command line (``vhat="98%"``).

    Raises
    ------
    RequestError
        Where a value is outside its domain, or options contradict each other.

    Examples
    --------
    >>> PlanRequest(altitude=40, vhat="98%").vhat
    0.98
    """

    altitude: float | str | None = None
    gsd: float | None = None
    target_size: float | None = None
    target_pixels: float | None = None
    focal_height: float = DEFAULTS["focal_height"]
    vhat: float | str | None = None
    visibility: float | str | None = None
    find: str | None = None
    signature: str | None = None
    contrast: float | None = None
    canopy_offset: float | None = None
    crown_share: float | None = None
    false_alarms: float | None = None
    scene: str | None = None
    density: float | None = None
    integrated_density: float | None = None
    occluder_size: float | None = None
    volume_height: float | None = None
    volume_base: float | None = None
    stems_per_hectare: float | None = None
    crown_diameter: float | None = None
    leaf_area_index: float | None = None
    voxel: float | None = None
    ground: str | None = None
    min_height: float | None = None
    units: str | None = None
    crop: str | None = None
    opacity: str | None = None
    leaf_size: float | None = None
    trajectory: str | None = None
    crown_base: float | None = None
    camera: str | None = None
    focal_length: float | None = None
    sensor_width: float | None = None
    sensor_height: float | None = None
    fov: float | None = None
    image_width: int | None = None
    image_height: int | None = None
    coverage: float = DEFAULTS["coverage"]
    model: str | None = None
    view: str | None = None
    edges: str | None = None
    rays: str | None = None
    optimize: str = DEFAULTS["optimize"]
    within: float | None = None
    max_aperture: float | None = None
    max_samples: int | None = None
    baseline: float | None = None
    samples: int | None = None
    allow_no_common_ground: bool = False
    sensitivity: bool = False
    grid: str = cast("str", None)
    lanes: int | str | None = None
    lane_pitch: float | str | None = None
    origin: tuple[float, float] | None = None
    heading: float | str = cast("str", None)
    line_length: float | None = None
    area: str | None = None
    clear: str | None = None
    no_fly: str | None = None
    buffer: float | None = None
    max_sites: int | None = None
    drone: str | None = None
    speed: float | None = None
    transit_speed: float | None = None
    acceleration: float | None = None
    climb: float | None = None
    hold: float = DEFAULTS["hold"]
    hold_error: float = DEFAULTS["hold_error"]
    autopilot: str | None = None
    camera_control: str | None = None
    payload: str | None = None
    trigger: str = cast("str", None)
    max_blur: float | None = None
    exposure_time: float | None = None
    photo_interval: float | None = None
    wind_speed: float | None = None
    wind_from: float | None = None
    airspeed: float | None = None
    takeoff: tuple[float, float] | None = None
    flight_time: float | None = None
    file_waypoints: int | None = None
    resume_at: int | None = None
    clearance: float = DEFAULTS["clearance"]
    terrain: str | None = None
    terrain_units: str | None = None
    terrain_tolerance: float | None = None
    altitude_frame: str = DEFAULTS["altitude_frame"]

    def __post_init__(self) -> None:
        for name, value in left_open(vars(self)).items():
            object.__setattr__(self, name, value)
        for option in OPTIONS:
            value = getattr(self, option.name)
            if value is not None:
                object.__setattr__(self, option.name, option.parse(value, option.name))
        check_alternatives(vars(self))
        if self.vhat is None and self.visibility is None:
            object.__setattr__(self, "vhat", default_target(vars(self)))
        check_search(vars(self))
        for name, value in completed_target(vars(self)).items():
            object.__setattr__(self, name, value)
        self._check_altitude()
        self._check_scene()
        self._check_flight()
        check_needs(vars(self))
        self._check_camera()
        for name, value in settled(self).items():
            object.__setattr__(self, name, value)
        self._check_bounds()
        self._check_area()

    def __eq__(self, other: object) -> bool:
        return vars(self) == vars(other) if isinstance(other, PlanRequest) else NotImplemented

    def __hash__(self) -> int:
        return hash(tuple(vars(self).values()))

    def filled(self, values: Mapping[str, Any]) -> PlanRequest:
        """The same request with other values of some fields, which are not checked again."""
        made = copy(self)
        vars(made).update(values)
        return made

    @property
    def searches(self) -> bool:
        """Whether what is left open is chosen by a search over flights, not by the solver."""
        return is_search(vars(self))

    @property
    def has_place(self) -> bool:
        """Whether the plan lies somewhere on earth."""
        return self.origin is not None or self.area is not None

    @property
    def heading_deg(self) -> float:
        """The heading asked for; north where the best one is sought."""
        return self.heading if isinstance(self.heading, float) else 0.0

    def document(self) -> dict[str, Any]:
        """The request as plain values, without what is not used: enough to run it again."""
        values = ((field.name, getattr(self, field.name)) for field in fields(self))
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in values
            if value is not None
        }

    def _given(self, names: tuple[str, ...]) -> list[str]:
        return given_flags(vars(self), names)

    def _check_altitude(self) -> None:
        if self.target_pixels is not None and self.target_size is None:
            raise RequestError("--target-pixels needs --target-size")
        if self.target_size is not None and self.target_pixels is None:
            raise RequestError("--target-size needs --target-pixels")
        if self.altitude is None and self.gsd is None and self.target_size is None:
            raise RequestError(
                "no altitude is given",
                "give --altitude M, or --gsd M, or --target-size M with --target-pixels K",
            )

    def _check_scene(self) -> None:
        needed: tuple[str, ...] = ()
        if self.density is not None or self.integrated_density is not None:
            kind, needed = "a uniform scene", ("occluder_size", "volume_height")
            example = "--density D --occluder-size M --volume-height M"
        elif self.stems_per_hectare is not None:
            kind, needed = "an inventory", ("crown_diameter", "leaf_area_index", "volume_height")
            example = (
                "--stems-per-hectare N --crown-diameter M --leaf-area-index L --volume-height M"
            )
        for name in needed:
            if getattr(self, name) is None:
                raise RequestError(
                    f"{kind} needs {BY_NAME[name].flag}", f"give {example}, or --scene NAME"
                )
        if needed:
            if self.volume_base is None:
                object.__setattr__(self, "volume_base", DEFAULTS["volume_base"])
            return
        unpaired = self._given(
            ("crown_diameter", "leaf_area_index", "volume_height", "volume_base")
        )
        if unpaired:
            raise RequestError(
                f"{' and '.join(unpaired)} without a density or --stems-per-hectare",
                "give --density D, --integrated-density P or --stems-per-hectare N as well, or a "
                "--scene alone",
            )
        if self.scene is None:
            object.__setattr__(self, "scene", DEFAULTS["scene"])

    def _check_camera(self) -> None:
        needed: tuple[str, ...]
        if self.focal_length is not None:
            needed = ("sensor_width", "image_width", "image_height")
        elif self.fov is not None:
            needed = ("image_width", "image_height")
            if self.fov >= 180.0:
                raise RequestError(f"--fov {self.fov:g} is not below 180 degrees")
        else:
            unpaired = self._given(("sensor_width", "sensor_height", "image_width", "image_height"))
            if unpaired:
                raise RequestError(
                    f"{' and '.join(unpaired)} without --focal-length or --fov",
                    "give --focal-length MM or --fov DEG as well, or a --camera",
                )
            if self.camera is None and self.drone is not None:
                raise RequestError(
                    f"no camera is known for the drone {self.drone}",
                    "give its --camera NAME|FILE (aosplan cameras lists presets), or --fov DEG or "
                    "--focal-length MM with the size of the image",
                )
            if self.camera is None:
                object.__setattr__(self, "camera", DEFAULTS["camera"])
            return
        for name in needed:
            if getattr(self, name) is None:
                raise RequestError(
                    f"a camera on the command line needs {BY_NAME[name].flag}",
                    "--fov or --focal-length, --sensor-width; --image-width and --image-height",
                )

    def _check_flight(self) -> None:
        drone = _drone_of(self.drone)
        carried = None if self.payload is None else camera_of_payload(self.payload)
        own_camera = self.focal_length is not None or self.fov is not None
        for name, value in {
            "speed": drone.speed_mps if drone else DEFAULTS["speed"],
            "transit_speed": (
                drone.speed_mps if drone else max(DEFAULTS["speed"], self.speed or 0.0)
            ),
            "acceleration": drone.acceleration_mps2 if drone else DEFAULTS["acceleration"],
            "climb": drone.climb_mps if drone else DEFAULTS["climb"],
            "camera": None if own_camera else carried or (drone.camera if drone else None),
            "flight_time": _trusted_min(drone) if drone else None,
            "photo_interval": drone.photo_interval_s if drone else None,
            "airspeed": (
                drone.airspeed_mps if drone else DEFAULTS["airspeed"] if self.wind_speed else None
            ),
            "max_blur": DEFAULTS["max_blur"] if self.trigger == "distance" else None,
            "exposure_time": DEFAULTS["exposure_time"] if self.trigger == "distance" else None,
            "terrain_tolerance": DEFAULTS["terrain_tolerance"] if self.terrain else None,
        }.items():
            if getattr(self, name) is None and value is not None:
                object.__setattr__(self, name, value)

    def _check_bounds(self) -> None:
        if self.samples and self.max_samples and self.samples > self.max_samples:
            raise RequestError(refusals.samples_beyond_bound(self.samples, self.max_samples))
        taken = LANE_OPTIONS.get(self.grid, ())
        if not self.searches:
            for name in taken:
                object.__setattr__(self, name, getattr(self, name) or DEFAULTS[name])
        if self.grid == "spiral" and self.trigger == "distance":
            raise RequestError(
                "--grid spiral with --trigger distance: a spiral has no straight lines to fly "
                "through",
                "give --grid lanes or line, or --trigger stop",
            )
        least = NARROWEST_TURNS if self.grid == "spiral" else 1.0
        if isinstance(self.lane_pitch, float) and self.lane_pitch < least:
            raise RequestError(
                f"--lane-pitch {self.lane_pitch:g} is below {least:g}"
                + (", the narrowest turns of a spiral" if self.grid == "spiral" else "")
            )
        over_area = self.grid == "line" and self.area is not None
        unexpected = self._given(tuple(name for name in OF_LANES if name not in taken))
        unexpected = ["--lanes"] * ("--lanes" in unexpected) if over_area else unexpected
        if unexpected:
            raise RequestError(
                f"{' and '.join(unexpected)} with --grid {self.grid}", "they go with --grid lanes"
            )

    def _check_area(self) -> None:
        if self.area is None:
            if self.heading == "auto":
                raise RequestError("--heading auto needs --area", "give a number of degrees")
        else:
            if self.line_length is not None:
                raise RequestError("--line-length and --area contradict each other", "keep one")
            if self.grid == "spiral":
                raise RequestError("--grid spiral cannot be repeated over an --area", "use lanes")
            object.__setattr__(self, "max_sites", self.max_sites or DEFAULTS["max_sites"])
        if self.no_fly is not None:
            object.__setattr__(
                self, "buffer", DEFAULTS["buffer"] if self.buffer is None else self.buffer
            )
        if self.line_length is not None and self.grid != "line":
            raise RequestError(f"--line-length with --grid {self.grid}", "it goes with --grid line")


def _drone_of(name: str | None) -> DronePreset | None:
    """The drone of a name, if there is one."""
    if name is None:
        return None
    from aosplan.flight.find import find_drone

    return find_drone(name)


def _trusted_min(drone: DronePreset) -> float | None:
    """Minutes of a drone's battery that are planned with."""
    from aosplan.flight.drones import trusted_min  # loaded only if a drone is named

    return trusted_min(drone)


def request_from(
    values: Mapping[str, Any],
    *,
    overrides: Mapping[str, Any] | None = None,
    where: str = "",
    defaults: Mapping[str, Any] | None = None,
    defaults_where: str = "",
) -> PlanRequest:
    """A request from a file's values and the flags that override them.

    What is given drops what it contradicts below: ``--visibility`` a file's ``vhat``, ``--gsd``
    its ``altitude``, ``--drone`` the camera and the speeds of another.

    Parameters
    ----------
    values
        Options by name.
    overrides
        Flags by name; None counts as not given.
    where
        The file, for messages.
    defaults, defaults_where
        Options that both override, and their file; those that do not fit the rest are left out.

    Raises
    ------
    RequestError
        Where a name is unknown or a value wrong; the message names the place.
    """
    flags, given, own = (
        {name: value for name, value in (layer or {}).items() if value is not None}
        for layer in (overrides, values, defaults)
    )
    place = f" in {where}" if where else ""
    given = {name: _parsed(name, value, f"{name}{place}") for name, value in given.items()}
    flags = {
        name: _parsed(name, value, BY_NAME[name].flag if name in BY_NAME else f"'{name}'")
        for name, value in flags.items()
    }
    asked = beneath(given, flags) | flags
    if own:
        asked = own_beneath(own, asked, defaults_where) | asked
    return PlanRequest(**asked)


def own_beneath(defaults: Mapping[str, Any], asked: dict[str, Any], where: str) -> dict[str, Any]:
    """The user's own defaults that what is asked for leaves room for.

    Raises
    ------
    RequestError
        Where they contradict each other, whatever is asked for.
    """
    own = {name: _parsed(name, value, f"{name} in {where}") for name, value in defaults.items()}
    try:
        PlanRequest(**({"altitude": 40.0} if not _has_altitude(own) else {}) | fitting(own, {}))
    except RequestError as error:
        raise RequestError(f"'{where}': {error.message}", error.hint) from None
    return fitting(beneath(own, asked), asked)


def _has_altitude(values: Mapping[str, Any]) -> bool:
    return any(names[0] in values for names in ALTERNATIVES[0])


def _parsed(name: str, value: Any, label: str) -> Any:
    if name not in BY_NAME:
        raise RequestError(f"unknown option {label}", q.nearest_hint(name, BY_NAME))
    return BY_NAME[name].parse(value, label)
