"""The options of a plan, each described once.

The command line, request files, the JSON Schema and sweeps are made from `OPTIONS`.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan import units as q
from aosplan.crs import parse_unit, parse_units
from aosplan.errors import RequestError
from aosplan.flight.photo_trigger import TRIGGERS
from aosplan.grid.patterns import GRIDS
from aosplan.mission.mission import FRAMES
from aosplan.models.model import MODELS, RAYS
from aosplan.models.signatures import FALSE_ALARMS, SIGNATURES
from aosplan.planning.find import SEARCH, contrast, false_alarms, radiance, target_name
from aosplan.solver.problem import OBJECTIVES

if TYPE_CHECKING:
    from collections.abc import Callable

VIEWS = ("telecentric", "perspective")
"""Targets of the measured model: each below its own aperture, or all below one."""

EDGES = ("auto", "interior", "wrapped")
"""Targets of the measured model: those whose rays stay on the plot, or all, as the plot wraps."""

GROUND = ("auto", "class", "filter", "normalized")
"""How the ground of a point cloud is found."""

READING = (
    "voxel", "ground", "min_height", "units", "crop", "opacity", "leaf_size", "trajectory",
    "crown_base",
)  # fmt: skip
"""Options that say how a point cloud or a canopy height raster is read."""

OPACITY = ("auto", "pulses", "voxels")
"""Where the opacity of a point cloud comes from."""

AUTOPILOTS = ("px4", "ardupilot")
"""Flight controllers that take QGroundControl's plans."""

CAMERA_CONTROLS = ("mavlink", "outputs")
"""How PX4 triggers a camera: by MAVLink's camera protocol, or by its own outputs."""


def target_share(value: Any, name: str) -> float | str:
    """A target below 1, kept as it was written where a float would change it."""
    exact = q.exact_share(value, name)
    if not 0 <= exact < 1:
        hint = (
            "no finite number of samples reaches 1; ask for 0.98"
            if exact == 1
            else q.percent_hint(value) or "a target lies between 0 and 1, such as 0.98 or 98%"
        )
        raise RequestError(f"{name} {q.shown(value)} is not a share below 1", hint)
    nearest = float(exact)
    if isinstance(value, float) or q.exact_share(repr(nearest), name) == exact:
        return nearest
    return str(value)


LARGEST = 1e9
"""No quantity of a request is larger, and none that is not zero smaller than its inverse."""


def bounded(parse: Callable[..., float], value: Any, name: str, **unit: str) -> float:
    """A quantity within the range in which products of several of them stay numbers."""
    result = parse(value, name, **unit)
    if result and not 1.0 / LARGEST <= abs(result) <= LARGEST:
        raise RequestError(
            f"{name} {q.shown(value)} is not between {1 / LARGEST:g} and {LARGEST:g}"
        )
    return result


def payload(value: Any, name: str) -> str:
    """What a DJI drone may carry."""
    from aosplan.mission.dji_models import PAYLOADS

    return q.one_of(PAYLOADS)(value, name)


DEFAULTS: dict[str, Any] = {
    "focal_height": 0.0,
    "vhat": 0.98,
    "false_alarms": FALSE_ALARMS,
    "scene": "paper-forest",
    "volume_base": 2.0,
    "ground": "auto",
    "min_height": 2.0,
    "opacity": "auto",
    "camera": "dji-m3t-thermal",
    "coverage": 0.98,
    "optimize": "samples",
    "grid": "trimmed",
    "lanes": 3,
    "lane_pitch": 4.0,
    "heading": 0.0,
    "buffer": 5.0,
    "max_sites": 10_000,
    "speed": 5.0,
    "acceleration": 2.0,
    "climb": 3.0,
    "hold": 1.0,
    "hold_error": 0.0,
    "trigger": "stop",
    "max_blur": 1.0,
    "exposure_time": 0.01,
    "airspeed": 15.0,
    "clearance": 2.0,
    "terrain_tolerance": 3.0,
    "altitude_frame": "takeoff",
}
"""Values of options that are not given, for the request and for the columns of a sweep."""


class Option(NamedTuple):
    """One option: its field, how a value is read, and how help describes it.

    `kind` says what a file may hold: a number, text, a whole number, a pair of numbers, or, of a
    flag, true or false.
    """

    name: str
    parse: Callable[[Any, str], Any]
    kind: str
    metavar: str
    help: str
    panel: str

    @property
    def flag(self) -> str:
        """The option as it is written on the command line."""
        return "--" + self.name.replace("_", "-")


_positive = partial(bounded, q.positive)
_length = partial(bounded, q.positive, unit="m")
_heading = q.or_best(partial(q.number, unit="deg"))


def altitude(value: Any, name: str) -> float | str:
    """A height, or a range of heights such as ``40..80``."""
    if not (isinstance(value, str) and ".." in value):
        return _length(value, name)
    low, _, high = value.partition("..")
    lowest, highest = _length(low, name), _length(high, name)
    if not lowest < highest:
        raise RequestError(
            f"{name} {q.shown(value)} does not rise", "give a range such as 40..80, or one height"
        )
    return f"{lowest!r}..{highest!r}"


def heading_or_auto(value: Any, name: str) -> float | str:
    """A direction, ``best``, or ``auto``: along the longer side of an area."""
    return "auto" if value == "auto" else _heading(value, name)


_height = partial(bounded, q.at_least_zero, unit="m")
_index = partial(bounded, q.at_least_zero)

_speed = partial(bounded, q.positive, unit="m/s")
_seconds = partial(bounded, q.positive, unit="s")

_Row = tuple[str, "Callable[[Any, str], Any]", str, str, str]


def file_waypoints(value: Any, what: str) -> int:
    """A number of waypoints, at least 2."""
    count = q.whole(value, what)
    if count < 2:
        raise RequestError(f"{what} {value} is too few", "a mission file has 2 waypoints or more")
    return count


_PANELS: dict[str, tuple[_Row, ...]] = {
    "Altitude": (
        (
            "altitude",
            altitude,
            "number",
            "M|RANGE",
            "Height above the synthetic focal plane; 40..80 with --within.",
        ),
        (
            "gsd",
            _length,
            "number",
            "M",
            "Required ground sampling distance, instead of an altitude.",
        ),
        (
            "target_size",
            _length,
            "number",
            "M",
            "Size of the target; requires --target-pixels.",
        ),
        (
            "target_pixels",
            _positive,
            "number",
            "PX",
            "Pixels across the target, instead of an altitude.",
        ),
        (
            "focal_height",
            _height,
            "number",
            "M",
            "Height of the focal plane above ground.  [default]",
        ),
    ),
    "Target": (
        (
            "vhat",
            target_share,
            "share",
            "X",
            "Target normalised visibility: 0.98 or 98%.  [default]",
        ),
        (
            "visibility",
            target_share,
            "share",
            "X",
            "Target absolute visibility, instead of --vhat.",
        ),
        (
            "find",
            target_name,
            "text",
            "person|WxL",
            "Target to find: a lying person, or W x L metres.",
        ),
        (
            "signature",
            q.one_of(SIGNATURES),
            "text",
            "NAME",
            f"Assumed signature: {', '.join(SIGNATURES)}.",
        ),
        ("contrast", contrast, "number", "C", "Target minus ground, in spreads of the canopy."),
        ("canopy_offset", radiance, "number", "M", "Canopy minus ground, in the same unit."),
        (
            "crown_share",
            q.share,
            "share",
            "X",
            "Share of the canopy's variance at the scale of crowns.",
        ),
        (
            "false_alarms",
            false_alarms,
            "number",
            "N",
            "False alarms per hectare, for --find.  [default]",
        ),
    ),
    "Scene": (
        (
            "scene",
            q.word,
            "text",
            "NAME|FILE",
            "Preset, scene file, point cloud (also a folder, or '*.laz'), or height raster.  [default]",
        ),
        (
            "density",
            q.share,
            "share",
            "D",
            "Share of each slice that occluders fill, for a uniform scene.",
        ),
        (
            "integrated_density",
            q.share,
            "share",
            "P",
            "Share of the ground that one photo does not see, instead of --density.",
        ),
        ("occluder_size", _length, "number", "M", "Edge length of an occluder."),
        ("volume_height", _length, "number", "M", "Thickness of the volume of occluders."),
        (
            "volume_base",
            _height,
            "number",
            "M",
            "Height of that volume's base above ground.  [default]",
        ),
        (
            "stems_per_hectare",
            _positive,
            "number",
            "N",
            "Trees per hectare, for a scene from an inventory.",
        ),
        ("crown_diameter", _length, "number", "M", "Diameter of the crowns, for an inventory."),
        ("leaf_area_index", _index, "number", "L", "Leaf area divided by ground area."),
        ("voxel", _length, "number", "M", "Voxel size of a point cloud.  [0.25]"),
        (
            "ground",
            q.one_of(GROUND),
            "text",
            "HOW",
            f"How to find the ground of a point cloud: {', '.join(GROUND)}.  [default]",
        ),
        (
            "min_height",
            _height,
            "number",
            "M",
            "Points of a cloud that are lower above ground are left out.  [default]",
        ),
        (
            "units",
            parse_units,
            "text",
            "UNIT",
            "Unit of a point cloud's coordinates or a canopy raster's heights, instead of the unit in "
            "the file: m, ft, us-ft; us-ft,m if z has another unit.",
        ),
        (
            "crop",
            q.word,
            "text",
            "WHERE",
            "Part of a point cloud: W,S,E,N in its coordinates or in degrees, a GeoJSON file, or "
            "all.  [around --area or --origin]",
        ),
        (
            "opacity",
            q.one_of(OPACITY),
            "text",
            "HOW",
            f"Opacity of a point cloud: {', '.join(OPACITY)}.  [default]",
        ),
        (
            "leaf_size",
            _length,
            "number",
            "M",
            "Edge length of a cell, for opacity from pulses.  [0.06]",
        ),
        (
            "trajectory",
            q.word,
            "text",
            "FILE",
            "Positions of the laser scanner: CSV with gps_time,x,y,z.  [from the pulses]",
        ),
        (
            "crown_base",
            q.share,
            "share",
            "X",
            "Base of the crowns in a height raster, as a share of its height.  [0.5]",
        ),
    ),
    "Camera": (
        ("camera", q.word, "text", "NAME|FILE", "Preset or camera file.  [default]"),
        ("focal_length", _positive, "number", "MM", "Physical focal length."),
        (
            "sensor_width",
            _positive,
            "number",
            "MM",
            "Width of the sensor that the image covers.",
        ),
        (
            "sensor_height",
            _positive,
            "number",
            "MM",
            "Height of the sensor that the image covers.  [square pixels]",
        ),
        (
            "fov",
            _positive,
            "number",
            "DEG",
            "Horizontal field of view, instead of focal length and sensor.",
        ),
        ("image_width", q.whole, "whole", "PX", "Width of the image, across the heading."),
        ("image_height", q.whole, "whole", "PX", "Height of the image, along the heading."),
    ),
    "Model and objective": (
        (
            "coverage",
            q.share_above_zero,
            "share",
            "X",
            "Share of occluders that must reach a disparity d̂ ≥ 1.  [default]",
        ),
        (
            "model",
            q.one_of(MODELS),
            "text",
            "NAME",
            f"Visibility model: {', '.join(MODELS)}.  [by scene]",
        ),
        (
            "view",
            q.one_of(VIEWS),
            "text",
            "KIND",
            f"View of the measured model: {' or '.join(VIEWS)}.  [telecentric]",
        ),
        (
            "edges",
            q.one_of(EDGES),
            "text",
            "HOW",
            f"Measured model: targets that count: {', '.join(EDGES)}.  [auto]",
        ),
        (
            "rays",
            q.one_of(RAYS),
            "text",
            "KIND",
            f"Rays of the uniform and layered models: {', '.join(RAYS)}.  [nadir]",
        ),
        (
            "optimize",
            q.one_of(OBJECTIVES),
            "text",
            "WHAT",
            f"Objective: {', '.join(OBJECTIVES)}.  [default]",
        ),
        (
            "within",
            _positive,
            "number",
            "MIN",
            "Choose the options that are not given (grid, trigger, heading, altitude) for a flight of this time.",
        ),
        ("max_aperture", _length, "number", "M", "Largest length of the grid's longer side."),
        ("max_samples", q.whole, "whole", "N", "Largest number of samples."),
        ("baseline", _length, "number", "M", "Fixed distance between neighbouring samples."),
        ("samples", q.whole, "whole", "N", "Fixed number of samples."),
        (
            "allow_no_common_ground",
            q.flag,
            "flag",
            "",
            "Plan grids so wide that all samples together see no ground.",
        ),
        (
            "sensitivity",
            q.flag,
            "flag",
            "",
            "Show the effect of 20 % errors in density, occluder size and heights.",
        ),
    ),
    "Grid": (
        (
            "grid",
            q.one_of((*GRIDS, "best")),
            "text",
            "KIND",
            f"Kind of grid: {', '.join(GRIDS)}, or best.  [default]",
        ),
        (
            "lanes",
            q.or_best(q.whole),
            "whole",
            "K",
            "Number of lanes, for --grid lanes, or best.  [default]",
        ),
        (
            "lane_pitch",
            q.or_best(_positive),
            "number",
            "X",
            "Distance between lanes, turns of a spiral, or lines over an area, divided by the "
            "spacing along them; or best.  [default]",
        ),
        (
            "origin",
            q.latitude_longitude,
            "pair",
            "LAT,LON",
            "Latitude and longitude of the grid's centre.",
        ),
        (
            "heading",
            heading_or_auto,
            "number",
            "DEG",
            "Direction of the flight lines, clockwise from true north; or best; or auto, along an area.  [default]",
        ),
        (
            "line_length",
            _length,
            "number",
            "M",
            "Length of a continuous line, for --grid line; any N consecutive photos make an integral.",
        ),
    ),
    "Area": (
        ("area", q.word, "text", "FILE", "Area to cover (GeoJSON, KML, KMZ), instead of --origin."),
        (
            "clear",
            q.word,
            "text",
            "FILE",
            "Parts of the area without canopy, which one photo is enough for.",
        ),
        ("no_fly", q.word, "text", "FILE", "Zones that sites and legs must avoid."),
        ("buffer", _height, "number", "M", "Distance to keep from no-fly zones.  [default]"),
        ("max_sites", q.whole, "whole", "N", "Reject areas that need more sites.  [default]"),
    ),
    "Flight": (
        ("drone", q.word, "text", "NAME|FILE", "Drone: its camera, speeds and limits."),
        (
            "speed",
            _speed,
            "number",
            "M/S",
            "Speed over ground between photos.  [default, or the drone's]",
        ),
        (
            "transit_speed",
            _speed,
            "number",
            "M/S",
            "Speed to, from and between lines.  [the drone's]",
        ),
        ("acceleration", _positive, "number", "M/S²", "Acceleration.  [default, or the drone's]"),
        (
            "climb",
            _speed,
            "number",
            "M/S",
            "Vertical speed, up and down.  [default, or the drone's]",
        ),
        (
            "hold",
            partial(bounded, q.at_least_zero, unit="s"),
            "number",
            "S",
            "Duration of the stop at each site.  [default]",
        ),
        (
            "hold_error",
            _height,
            "number",
            "M",
            "Standard deviation of the position at each site, along either axis.  [default]",
        ),
        (
            "autopilot",
            q.one_of(AUTOPILOTS),
            "text",
            "NAME",
            f"Flight controller of a drone without a preset: {' or '.join(AUTOPILOTS)}.  [the drone's]",
        ),
        (
            "camera_control",
            q.one_of(CAMERA_CONTROLS),
            "text",
            "HOW",
            "How PX4 triggers the camera: mavlink or outputs.",
        ),
        (
            "payload",
            payload,
            "text",
            "NAME",
            "Payload of a DJI drone, such as dji-h20t.  [by camera]",
        ),
        (
            "trigger",
            q.one_of((*TRIGGERS, "best")),
            "text",
            "HOW",
            "When to take photos: stop (at each site) or distance (while flying).  [default; best with --within]",
        ),
        (
            "max_blur",
            _positive,
            "number",
            "PX",
            "Largest motion blur, for --trigger distance.  [default]",
        ),
        (
            "exposure_time",
            _seconds,
            "number",
            "S",
            "Exposure time, for --trigger distance.  [default]",
        ),
        (
            "photo_interval",
            _seconds,
            "number",
            "S",
            "Shortest time between two photos.  [the drone's]",
        ),
        (
            "wind_speed",
            partial(bounded, q.at_least_zero, unit="m/s"),
            "number",
            "M/S",
            "Wind speed; requires --wind-from.",
        ),
        (
            "wind_from",
            _heading,
            "number",
            "DEG",
            "Direction that the wind blows from, clockwise from true north.",
        ),
        (
            "airspeed",
            _speed,
            "number",
            "M/S",
            "Largest airspeed; wind lowers the speed over ground to stay within it.  [default, or the drone's]",
        ),
        (
            "takeoff",
            q.latitude_longitude,
            "pair",
            "LAT,LON",
            "Point of take-off and landing.  [below the first waypoint]",
        ),
        (
            "flight_time",
            _positive,
            "number",
            "MIN",
            "Flight time per battery; longer missions are split.  [2/3 of the drone's in still air]",
        ),
        (
            "file_waypoints",
            file_waypoints,
            "whole",
            "N",
            "Waypoints (MAVLink: commands) in one file, if other than its known limit.",
        ),
        (
            "resume_at",
            q.index,
            "whole",
            "K",
            "First waypoint to fly, counted over the whole plan.  [0]",
        ),
    ),
    "Height": (
        (
            "clearance",
            _height,
            "number",
            "M",
            "Smallest height above the top of the canopy.  [default]",
        ),
        ("terrain", q.word, "text", "DEM.tif", "Ground heights to follow (GeoTIFF)."),
        (
            "terrain_units",
            parse_unit,
            "text",
            "UNIT",
            "Unit of the terrain file's heights, instead of the unit in the file: m, ft, us-ft.",
        ),
        (
            "terrain_tolerance",
            _length,
            "number",
            "M",
            "How much closer to the ground the path between two sites may come.  [default]",
        ),
        (
            "altitude_frame",
            q.one_of(FRAMES),
            "text",
            "FRAME",
            "Reference of a file's heights: takeoff, or terrain, which the autopilot then follows.",
        ),
    ),
}


def _shown(name: str) -> str:
    """The default of an option as its help shows it."""
    value = DEFAULTS.get(name)
    return value if isinstance(value, str) else "" if value is None else f"{value:g}"


OPTIONS = tuple(
    Option(name, parse, kind, metavar, text.replace("[default", f"[{_shown(name)}"), panel)
    for panel, rows in _PANELS.items()
    for name, parse, kind, metavar, text in rows
)

BY_NAME = {option.name: option for option in OPTIONS}

SHOWING = tuple(
    option.name
    for option in OPTIONS
    if option.panel in ("Altitude", "Scene", "Camera")
    or option.name
    in (*SEARCH, "coverage", "model", "view", "rays", "origin", "heading", "clearance")
)
"""Options that say what given positions show, whatever else is planned."""
