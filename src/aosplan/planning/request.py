"""The request: the options that determine a plan, without the options of its output.

`PlanRequest` has the options of ``aosplan plan`` (`aosplan.planning.options`) as fields, with
underscores for hyphens.  Fields that are None get a default or are not used.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, cast

from aosplan import units as q
from aosplan.errors import RequestError
from aosplan.planning.dependent_defaults import (
    default_target,
    dependent_defaults,
    is_over_area,
    is_search,
    left_open,
)
from aosplan.planning.option_relations import (
    AIRCRAFT,
    check_numbers,
    check_relations,
    with_partners,
    without_overridden,
)
from aosplan.planning.options import BY_NAME, DEFAULTS, OPTIONS

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, eq=False)  # A generated __eq__ would add 2 ms to each start.
class PlanRequest:
    """The checked options of ``aosplan plan`` as fields, with underscores.

    Lengths are in metres, angles in degrees, times in seconds, and focal length and sensor size in
    millimetres.  Text is parsed as on the command line (``vhat="98%"``).

    Raises
    ------
    RequestError
        If a value is outside its domain, or if options contradict each other.

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
    optimize: str = cast("str", None)
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
    around: str | None = None
    around_radius: float | None = None
    clear: str | None = None
    no_fly: str | None = None
    buffer: float | None = None
    order: str | None = None
    poa: str | None = None
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
        values = vars(self)  # Only this method sets fields of the frozen value.
        values.update(left_open(values))
        for option in OPTIONS:
            if values[option.name] is not None:
                values[option.name] = option.parse(values[option.name], option.name)
        check_relations(values)
        if self.vhat is None and self.visibility is None:
            values["vhat"] = default_target(values)
        if any(values[name] is not None for name in AIRCRAFT):
            from aosplan.planning.aircraft import decided_by_aircraft

            values.update(decided_by_aircraft(values))
        values.update(dependent_defaults(values))
        check_numbers(values)

    def __eq__(self, other: object) -> bool:
        return vars(self) == vars(other) if isinstance(other, PlanRequest) else NotImplemented

    def __hash__(self) -> int:
        return hash(tuple(vars(self).values()))

    def filled(self, values: Mapping[str, Any]) -> PlanRequest:
        """The same request with other values of some fields.  The new values are not checked."""
        made = copy(self)
        vars(made).update(values)
        return made

    @property
    def searches(self) -> bool:
        """Whether a search over flights chooses options that are not given."""
        return is_search(vars(self))

    @property
    def has_place(self) -> bool:
        """Whether the plan has a location."""
        return self.origin is not None or self.over_area

    @property
    def over_area(self) -> bool:
        """Whether the plan covers an area, or areas around points."""
        return is_over_area(vars(self))

    @property
    def heading_deg(self) -> float:
        """The requested heading; 0 if the best heading is searched for."""
        return self.heading if isinstance(self.heading, float) else 0.0

    def document(self) -> dict[str, Any]:
        """The request as plain values, without unused options. The plan can be computed again from
        these values.
        """
        values = ((field.name, getattr(self, field.name)) for field in fields(self))
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in values
            if value is not None
        }


def request_from(
    values: Mapping[str, Any],
    *,
    overrides: Mapping[str, Any] | None = None,
    where: str = "",
    defaults: Mapping[str, Any] | None = None,
    defaults_where: str = "",
) -> PlanRequest:
    """Make a request from the values in a file and the flags that override them.

    A flag also removes values of the file that contradict it: ``--visibility`` removes ``vhat``,
    ``--gsd`` removes ``altitude``, and ``--drone`` removes the camera and the speeds of another
    drone.

    Parameters
    ----------
    values
        Options by name.
    overrides
        Flags by name.  None means that a flag is not given.
    where
        The file, for messages.
    defaults, defaults_where
        The user's own defaults, which files and flags override, and the file of these defaults.
        Defaults that contradict the request are ignored.

    Raises
    ------
    RequestError
        If a name is unknown or a value is not valid.  The message gives the place.
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
    asked = without_overridden(given, flags) | flags
    if own:
        asked = fitting_defaults(own, asked, defaults_where) | asked
    return PlanRequest(**asked)


def fitting_defaults(
    defaults: Mapping[str, Any], asked: dict[str, Any], where: str
) -> dict[str, Any]:
    """The user's own defaults that do not contradict the requested options.

    Raises
    ------
    RequestError
        If the defaults contradict each other.
    """
    own = {name: _parsed(name, value, f"{name} in {where}") for name, value in defaults.items()}
    try:
        PlanRequest(
            **({"altitude": 40.0} if not _has_altitude(own) else {}) | with_partners(own, {})
        )
    except RequestError as error:
        raise RequestError(f"'{where}': {error.message}", error.hint) from None
    return with_partners(without_overridden(own, asked), asked)


def _has_altitude(values: Mapping[str, Any]) -> bool:
    return any(name in values for name in ("altitude", "gsd", "target_size"))


def _parsed(name: str, value: Any, label: str) -> Any:
    if name not in BY_NAME:
        raise RequestError(f"unknown option {label}", q.nearest_hint(name, BY_NAME))
    return BY_NAME[name].parse(value, label)
