"""The options of a plan: a table in which each option and its default are described once.

The command line, request files, the JSON Schema and sweeps are made from `OPTIONS`.  Values are
read by `aosplan.planning.option_parsers`; `aosplan.planning.option_relations` says which options
exclude each other.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan import units as q
from aosplan.grid.patterns import GRIDS
from aosplan.mission.mission import FRAMES
from aosplan.models.model import MODELS, RAYS
from aosplan.models.signatures import FALSE_ALARMS, SIGNATURES
from aosplan.planning import option_parsers as parse
from aosplan.solver.problem import OBJECTIVES

if TYPE_CHECKING:
    from collections.abc import Callable

DEFAULTS: dict[str, Any] = {
    "focal_height": 0.0,
    "vhat": 0.98,
    "false_alarms": FALSE_ALARMS,
    "signature": "thermal-dawn",
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
    "around_radius": 10.0,
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


READING = (
    "voxel", "ground", "min_height", "units", "crop", "opacity", "leaf_size", "trajectory",
    "crown_base",
)  # fmt: skip
"""Options that say how a point cloud or a canopy height raster is read."""

FIND_OPTIONS = (
    "find", "signature", "contrast", "canopy_offset", "crown_share", "false_alarms",
)  # fmt: skip
"""``find``, and the options that go with it."""


class Option(NamedTuple):
    """One option: its field, how a value is read, and how help describes it.

    `kind` is the type of the value in a file: a number, a share, text, a whole number, a pair of
    numbers, or true and false for a flag.
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


_Row = tuple[str, "Callable[[Any, str], Any]", str, str, str]

# fmt: off
_PANELS: dict[str, tuple[_Row, ...]] = {
    "Altitude": (
        ("altitude", parse.altitude, "number", "M|RANGE",
         "Height above the focal plane; with --within also a range such as 40..80."),
        ("gsd", parse.length, "number", "M",
         "Required ground sampling distance, instead of an altitude."),
        ("target_size", parse.length, "number", "M",
         "Size of the target; requires --target-pixels."),
        ("target_pixels", parse.positive, "number", "PX",
         "Pixels across the target, instead of an altitude."),
        ("focal_height", parse.height, "number", "M",
         "Height of the focal plane above ground.  [default]"),
    ),
    "Target": (
        ("vhat", parse.target_share, "share", "X",
         "Target normalised visibility: 0.98 or 98%.  [default]"),
        ("visibility", parse.target_share, "share", "X",
         "Target absolute visibility, instead of --vhat."),
        ("find", parse.target_name, "text", "person|WxL",
         "Target to find: a lying person, or W x L metres."),
        ("signature", q.one_of(SIGNATURES), "text", "NAME",
         f"Assumed signature, for --find: {', '.join(SIGNATURES)}.  [default]"),
        ("contrast", parse.contrast, "number", "C",
         "Radiance of the target minus the ground's, in standard deviations of the canopy."),
        ("canopy_offset", parse.radiance, "number", "M",
         "Mean radiance of the canopy minus the ground's, in the same unit."),
        ("crown_share", q.share, "share", "X",
         "Share of the canopy's variance that lies between crowns."),
        ("false_alarms", parse.false_alarms, "number", "N",
         "False alarms per hectare, for --find.  [default]"),
    ),
    "Scene": (
        ("scene", q.word, "text", "NAME|FILE",
         "Preset, scene file, point cloud (also a folder, or '*.laz'), or height raster.  "
         "[default]"),
        ("density", q.share, "share", "D",
         "Share of each slice that occluders fill, for a uniform scene."),
        ("integrated_density", q.share, "share", "P",
         "Share of the ground that one photo does not see, instead of --density."),
        ("occluder_size", parse.length, "number", "M", "Edge length of an occluder."),
        ("volume_height", parse.length, "number", "M", "Thickness of the volume of occluders."),
        ("volume_base", parse.height, "number", "M",
         "Height of that volume's base above ground.  [default]"),
        ("stems_per_hectare", parse.positive, "number", "N",
         "Trees per hectare, for a scene from an inventory."),
        ("crown_diameter", parse.length, "number", "M",
         "Diameter of the crowns, for an inventory."),
        ("leaf_area_index", parse.at_least_zero, "number", "L",
         "Leaf area divided by ground area."),
        ("voxel", parse.length, "number", "M", "Voxel size of a point cloud.  [0.25]"),
        ("ground", q.one_of(parse.GROUND), "text", "HOW",
         f"How to find the ground of a point cloud: {', '.join(parse.GROUND)}.  [default]"),
        ("min_height", parse.height, "number", "M",
         "Height above ground below which points of a cloud are ignored.  [default]"),
        ("units", parse.length_units, "text", "UNIT",
         "Unit of a point cloud's coordinates or a canopy raster's heights, instead of the unit "
         "in the file: m, ft, us-ft; us-ft,m if z has another unit."),
        ("crop", q.word, "text", "WHERE",
         "Part of a point cloud: W,S,E,N in its coordinates or in degrees, a GeoJSON file, or "
         "all.  [around --area or --origin]"),
        ("opacity", q.one_of(parse.OPACITY), "text", "HOW",
         f"Opacity of a point cloud: {', '.join(parse.OPACITY)}.  [default]"),
        ("leaf_size", parse.length, "number", "M",
         "Edge length of a cell, for opacity from pulses.  [0.06]"),
        ("trajectory", q.word, "text", "FILE",
         "Positions of the laser scanner: CSV with gps_time,x,y,z.  [from the pulses]"),
        ("crown_base", q.share, "share", "X",
         "Base of the crowns in a height raster, as a share of its height.  [0.5]"),
    ),
    "Camera": (
        ("camera", q.word, "text", "NAME|FILE", "Preset or camera file.  [default]"),
        ("focal_length", parse.positive, "number", "MM", "Physical focal length."),
        ("sensor_width", parse.positive, "number", "MM",
         "Width of the sensor that the image covers."),
        ("sensor_height", parse.positive, "number", "MM",
         "Height of the sensor that the image covers.  [square pixels]"),
        ("fov", parse.field_of_view, "number", "DEG",
         "Horizontal field of view, instead of focal length and sensor."),
        ("image_width", q.whole, "whole", "PX", "Width of the image, across the heading."),
        ("image_height", q.whole, "whole", "PX", "Height of the image, along the heading."),
    ),
    "Model and objective": (
        ("coverage", q.share_above_zero, "share", "X",
         "Share of occluders that must reach a disparity d̂ ≥ 1.  [default]"),
        ("model", q.one_of(MODELS), "text", "NAME",
         f"Visibility model: {', '.join(MODELS)}.  [by scene]"),
        ("view", q.one_of(parse.VIEWS), "text", "KIND",
         f"View of the measured model: {' or '.join(parse.VIEWS)}.  [telecentric]"),
        ("edges", q.one_of(parse.EDGES), "text", "HOW",
         f"Targets that the measured model counts: {', '.join(parse.EDGES)}.  [auto]"),
        ("rays", q.one_of(RAYS), "text", "KIND",
         f"Rays of the uniform and layered models: {', '.join(RAYS)}.  [nadir]"),
        ("optimize", q.one_of(OBJECTIVES), "text", "WHAT",
         f"Objective: {', '.join(OBJECTIVES)}.  [samples; with --within and without a target: "
         "detection if --find is given, else visibility]"),
        ("within", parse.positive, "number", "MIN",
         "Choose the options that are not given (grid, trigger, heading, altitude) for a flight "
         "of this time."),
        ("max_aperture", parse.length, "number", "M", "Largest length of the grid's longer side."),
        ("max_samples", q.whole, "whole", "N", "Largest number of samples."),
        ("baseline", parse.length, "number", "M", "Fixed distance between neighbouring samples."),
        ("samples", q.whole, "whole", "N", "Fixed number of samples."),
        ("allow_no_common_ground", q.flag, "flag", "",
         "Allow grids so wide that no ground is seen by all samples."),
        ("sensitivity", q.flag, "flag", "",
         "Show the effect of 20 % errors in density, occluder size and heights."),
    ),
    "Grid": (
        ("grid", q.one_of((*GRIDS, "best")), "text", "KIND",
         f"Kind of grid: {', '.join(GRIDS)}, or best.  [default]"),
        ("lanes", q.or_best(q.whole), "whole", "K",
         "Number of lanes, for --grid lanes, or best.  [default]"),
        ("lane_pitch", q.or_best(parse.positive), "number", "X",
         "Distance between lanes, between turns of a spiral, or between lines over an area, divided "
         "by the spacing along them; or best.  [default]"),
        ("origin", q.latitude_longitude, "pair", "LAT,LON",
         "Latitude and longitude of the grid's centre."),
        ("heading", parse.heading_or_auto, "number", "DEG",
         "Direction of the flight lines, clockwise from true north; best; or auto: along the longer "
         "side of an area.  [default]"),
        ("line_length", parse.length, "number", "M",
         "Length of a continuous line, for --grid line; any N consecutive photos make an "
         "integral."),
    ),
    "Area": (
        ("area", q.word, "text", "FILE", "Area to cover (GeoJSON, KML, KMZ), instead of --origin."),
        ("around", q.word, "text", "FILE",
         "Points to look at closely (GeoJSON, KML, KMZ), instead of --area."),
        ("around_radius", parse.positive, "number", "M",
         "Radius of the area to cover around each point.  [default]"),
        ("clear", q.word, "text", "FILE",
         "Parts of the area without canopy, for which one photo is enough."),
        ("no_fly", q.word, "text", "FILE", "Zones that sites and legs must avoid."),
        ("buffer", parse.height, "number", "M", "Distance to keep from no-fly zones.  [default]"),
        ("max_sites", q.whole, "whole", "N", "Reject areas that need more sites.  [default]"),
    ),
    "Flight": (
        ("drone", q.word, "text", "NAME|FILE", "Drone: its camera, speeds and limits."),
        ("speed", parse.speed, "number", "M/S",
         "Speed over ground between photos.  [default, or the drone's]"),
        ("transit_speed", parse.speed, "number", "M/S",
         "Speed to, from and between lines.  [the drone's]"),
        ("acceleration", parse.positive, "number", "M/S²",
         "Acceleration.  [default, or the drone's]"),
        ("climb", parse.speed, "number", "M/S",
         "Vertical speed, up and down.  [default, or the drone's]"),
        ("hold", parse.seconds_or_zero, "number", "S",
         "Duration of the stop at each site.  [default]"),
        ("hold_error", parse.height, "number", "M",
         "Standard deviation of the position at each site, along either axis.  [default]"),
        ("autopilot", q.one_of(parse.AUTOPILOTS), "text", "NAME",
         f"Flight controller of a drone without a preset: {' or '.join(parse.AUTOPILOTS)}."
         "  [the drone's]"),
        ("camera_control", q.one_of(parse.CAMERA_CONTROLS), "text", "HOW",
         "How PX4 triggers the camera: mavlink or outputs."),
        ("payload", parse.payload, "text", "NAME",
         "Payload of a DJI drone, such as dji-h20t.  [by camera]"),
        ("trigger", q.one_of(parse.TRIGGERS), "text", "HOW",
         "When to take photos: stop (at each site) or distance (while flying).  [default; best "
         "with --within]"),
        ("max_blur", parse.positive, "number", "PX",
         "Largest motion blur, for --trigger distance.  [default]"),
        ("exposure_time", parse.seconds, "number", "S",
         "Exposure time, for --trigger distance.  [default]"),
        ("photo_interval", parse.seconds, "number", "S",
         "Shortest time between two photos.  [the drone's]"),
        ("wind_speed", parse.wind_speed, "number", "M/S", "Wind speed; requires --wind-from."),
        ("wind_from", parse.direction, "number", "DEG",
         "Direction that the wind blows from, clockwise from true north."),
        ("airspeed", parse.speed, "number", "M/S",
         "Largest airspeed; wind lowers the speed over ground to stay within it.  [default, or "
         "the drone's]"),
        ("takeoff", q.latitude_longitude, "pair", "LAT,LON",
         "Point of take-off and landing.  [below the first waypoint]"),
        ("flight_time", parse.positive, "number", "MIN",
         "Flight time per battery; longer missions are split.  [2/3 of the drone's in still air]"),
        ("file_waypoints", parse.file_waypoints, "whole", "N",
         "Largest number of waypoints (MAVLink: commands) in one file, if it differs from the known "
         "limit."),
        ("resume_at", q.index, "whole", "K",
         "First waypoint to fly, counted over all flights.  [0]"),
    ),
    "Height": (
        ("clearance", parse.height, "number", "M",
         "Smallest height above the top of the canopy.  [default]"),
        ("terrain", q.word, "text", "DEM.tif", "Ground heights to follow (GeoTIFF)."),
        ("terrain_units", parse.length_unit, "text", "UNIT",
         "Unit of the terrain file's heights, instead of the unit in the file: m, ft, us-ft."),
        ("terrain_tolerance", parse.length, "number", "M",
         "Largest loss of height above ground on the path between two sites.  [default]"),
        ("altitude_frame", q.one_of(FRAMES), "text", "FRAME",
         "Reference of the heights in a file: takeoff, or terrain if the autopilot follows it."),
    ),
}
# fmt: on


def _shown(name: str) -> str:
    """The default of an option as its help shows it."""
    value = DEFAULTS.get(name)
    return value if isinstance(value, str) else "" if value is None else f"{value:g}"


OPTIONS = tuple(
    Option(name, parser, kind, metavar, text.replace("[default", f"[{_shown(name)}"), panel)
    for panel, rows in _PANELS.items()
    for name, parser, kind, metavar, text in rows
)

BY_NAME = {option.name: option for option in OPTIONS}

SHOWING = tuple(
    option.name
    for option in OPTIONS
    if option.panel in ("Altitude", "Scene", "Camera")
    or option.name
    in (*FIND_OPTIONS, "coverage", "model", "view", "rays", "origin", "heading", "clearance")
)
"""Options that decide what photos from given positions show."""
