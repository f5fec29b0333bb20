"""The options of a plan: a table in which each option and its default are described once.

The command line, request files, the JSON Schema and sweeps are made from `OPTIONS`.
`aosplan.planning.option_parsers` reads the values.  `aosplan.planning.option_relations` has the
options that exclude each other.
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
    "order": "shortest",
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
"""Default values of options, for single plans and for the columns of a sweep."""


GUIDED = "guided"
"""The kind of grid whose positions are chosen for one place from a point cloud."""

GAIN = "gain"
"""The order of lines by the gain of the probability of success per minute."""

ORDERS = ("shortest", GAIN)
"""Orders of the lines over an area."""

READING = (
    "voxel", "ground", "min_height", "units", "crop", "opacity", "leaf_size", "trajectory",
    "crown_base",
)  # fmt: skip
"""Options that determine how a point cloud or a canopy height raster is read."""

FIND_OPTIONS = (
    "find", "signature", "contrast", "canopy_offset", "crown_share", "false_alarms",
)  # fmt: skip
"""``find``, and the options that can be given with it."""


class Option(NamedTuple):
    """One option: its field, its parser, and its description in the help.

    `flag` is the name of the option on the command line. `kind` is the type of the value in a file:
    a number, a share, text, a whole number, a pair of numbers, or a Boolean value for a flag.
    """

    name: str
    parse: Callable[[Any, str], Any]
    kind: str
    metavar: str
    help: str
    panel: str
    flag: str


_Row = tuple[str, "Callable[[Any, str], Any]", str, str, str]

# fmt: off
_PANELS: dict[str, tuple[_Row, ...]] = {
    "Altitude": (
        ("altitude", parse.altitude, "number", "M|RANGE",
         "Height above the focal plane.  With --within, also a range such as 40..80."),
        ("gsd", parse.length, "number", "M",
         "Size of a pixel on the ground, instead of --altitude."),
        ("target_size", parse.length, "number", "M",
         "Size of an object on the ground, with --target-pixels instead of --altitude."),
        ("target_pixels", parse.positive, "number", "PX",
         "Number of pixels across the object of --target-size."),
        ("focal_height", parse.height, "number", "M",
         "Height of the focal plane above ground.  [default]"),
    ),
    "Target": (
        ("vhat", parse.target_share, "share", "X",
         "Normalised visibility V̂ to reach: 0.98 or 98%.  [default]"),
        ("visibility", parse.target_share, "share", "X",
         "Visibility V to reach, instead of --vhat."),
        ("find", parse.target_name, "text", "person|WxL",
         "Target to search for: a lying person, or W x L metres."),
        ("signature", q.one_of(SIGNATURES), "text", "NAME",
         f"Set of assumed radiances for --find: {', '.join(SIGNATURES)}.  [default]"),
        ("contrast", parse.contrast, "number", "C",
         "Radiance of the target minus radiance of the ground, in standard deviations between "
         "occluders."),
        ("canopy_offset", parse.radiance, "number", "M",
         "Mean radiance of the canopy minus radiance of the ground, in the unit of --contrast."),
        ("crown_share", q.share, "share", "X",
         "Share of the variance of the canopy's radiance that comes from differences between crowns."),
        ("false_alarms", parse.false_alarms, "number", "N",
         "Allowed false alarms per hectare, for --find.  [default]"),
    ),
    "Scene": (
        ("scene", q.word, "text", "NAME|FILE",
         "Preset, scene file, point cloud (a file, a folder or '*.laz'), or canopy height "
         "raster.  [default]"),
        ("density", q.share, "share", "D",
         "Uniform scene: share of a slice that occluders fill."),
        ("integrated_density", q.share, "share", "P",
         "Uniform scene: share of the ground that one photo does not see, instead of "
         "--density."),
        ("occluder_size", parse.length, "number", "M", "Edge length of an occluder."),
        ("volume_height", parse.length, "number", "M", "Thickness of the volume of occluders."),
        ("volume_base", parse.height, "number", "M",
         "Height of the base of this volume above ground.  [default]"),
        ("stems_per_hectare", parse.positive, "number", "N",
         "Inventory: number of trees per hectare."),
        ("crown_diameter", parse.length, "number", "M",
         "Inventory: diameter of the crowns."),
        ("leaf_area_index", parse.at_least_zero, "number", "L",
         "Inventory: leaf area divided by ground area."),
        ("voxel", parse.length, "number", "M",
         "Point cloud: edge length of a voxel.  [0.25]"),
        ("ground", q.one_of(parse.GROUND), "text", "HOW",
         f"Point cloud: how to find the ground: {', '.join(parse.GROUND)}.  [default]"),
        ("min_height", parse.height, "number", "M",
         "Point cloud: height above ground below which points are ignored.  [default]"),
        ("units", parse.length_units, "text", "UNIT",
         "Unit of the coordinates of a point cloud, or of the heights of a canopy raster, instead "
         "of the unit in the file: m, ft, us-ft.  If z has another unit than x and y: two units, "
         "such as us-ft,m.  With imperial units, tables show feet and acres."),
        ("crop", q.word, "text", "WHERE",
         "Point cloud: part to use, as W,S,E,N in its coordinates or in degrees, a GeoJSON "
         "file, or all.  [around --area or --origin]"),
        ("opacity", q.one_of(parse.OPACITY), "text", "HOW",
         f"Point cloud: source of the opacity: {', '.join(parse.OPACITY)}.  [default]"),
        ("leaf_size", parse.length, "number", "M",
         "Opacity from pulses: edge length of the cells that represent leaves.  [0.06]"),
        ("trajectory", q.word, "text", "FILE",
         "Opacity from pulses: positions of the laser scanner, a CSV with gps_time,x,y,z.  "
         "[computed from the pulses]"),
        ("crown_base", q.share, "share", "X",
         "Canopy height raster: base of the crowns, as a share of the height of the canopy.  "
         "[0.5]"),
    ),
    "Camera": (
        ("camera", q.word, "text", "NAME|FILE",
         "Name of a preset, or a camera file.  [default]"),
        ("focal_length", parse.positive, "number", "MM",
         "Physical focal length, not the 35 mm equivalent."),
        ("sensor_width", parse.positive, "number", "MM",
         "Width of the part of the sensor that the image shows."),
        ("sensor_height", parse.positive, "number", "MM",
         "Height of the part of the sensor that the image shows.  [for square pixels]"),
        ("fov", parse.field_of_view, "number", "DEG",
         "Horizontal field of view, instead of --focal-length and --sensor-width."),
        ("image_width", q.whole, "whole", "PX",
         "Width of the image (across the heading)."),
        ("image_height", q.whole, "whole", "PX",
         "Height of the image (along the heading)."),
    ),
    "Model and objective": (
        ("coverage", q.share_above_zero, "share", "X",
         "Share of the occluders that must move by their own size or more between neighbouring "
         "photos (d̂ ≥ 1).  [default]"),
        ("model", q.one_of(MODELS), "text", "NAME",
         f"Visibility model: {', '.join(MODELS)}.  [by scene]"),
        ("view", q.one_of(parse.VIEWS), "text", "KIND",
         "Measured model: each target is below its own grid (telecentric), or all targets are "
         "below one grid (perspective).  [telecentric]"),
        ("edges", q.one_of(parse.EDGES), "text", "HOW",
         "Measured model: count the targets whose rays stay on the plot (interior), all "
         "targets (wrapped), or the interior targets if they are enough (auto).  [auto]"),
        ("rays", q.one_of(RAYS), "text", "KIND",
         "Uniform and layered models: vertical rays (nadir), slanted rays (oblique), or "
         "slanted rays through cubes (cubes).  [nadir]"),
        ("optimize", q.one_of(OBJECTIVES), "text", "WHAT",
         f"Quantity to minimise or maximise: {', '.join(OBJECTIVES)}.  [samples; with "
             "--within and no target: detection or visibility]"),
        ("within", parse.positive, "number", "MIN",
         "Longest time from take-off to landing.  aosplan chooses the options that are not given."),
        ("max_aperture", parse.length, "number", "M",
         "Largest extent of the grid (the length of its longer side)."),
        ("max_samples", q.whole, "whole", "N",
         "Largest number of photos (samples)."),
        ("baseline", parse.length, "number", "M",
         "Fixed distance between neighbouring photos."),
        ("samples", q.whole, "whole", "N",
         "Fixed number of photos (samples)."),
        ("allow_no_common_ground", q.flag, "flag", "",
         "Allow grids that are so wide that no ground is in all photos."),
        ("sensitivity", q.flag, "flag", "",
         "Show how errors of 20 % in density, occluder size and heights change the plan."),
    ),
    "Grid": (
        ("grid", q.one_of((*GRIDS, GUIDED, "best")), "text", "KIND",
         f"Kind of grid: {', '.join(GRIDS)}, guided, or best.  [default]"),
        ("lanes", q.or_best(q.whole), "whole", "K",
         "Number of lanes for --grid lanes, or best.  [default]"),
        ("lane_pitch", q.or_best(parse.positive), "number", "X",
         "Distance between lanes, turns of a spiral, or lines over an area, divided by the "
         "distance between photos along them; or best.  [default]"),
        ("origin", q.latitude_longitude, "pair", "LAT,LON",
         "Latitude and longitude of the grid's centre."),
        ("heading", parse.heading_or_auto, "number", "DEG",
         "Direction of the flight lines, clockwise from true north; best (for visibility); "
             "or auto (along an area).  [default]"),
        ("line_length", parse.length, "number", "M",
         "Length of a continuous line, for --grid line.  Any N consecutive photos can be "
         "averaged to an integral image."),
    ),
    "Area": (
        ("area", q.word, "text", "FILE", "Area to cover (GeoJSON, KML, KMZ), instead of --origin."),
        ("around", q.word, "text", "FILE",
         "Points to look at closely (GeoJSON, KML, KMZ), instead of --area."),
        ("around_radius", parse.positive, "number", "M",
         "Radius of the area to cover around each point, or of the target area around --origin for "
         "guided grids and reciprocal maps.  [default]"),
        ("clear", q.word, "text", "FILE",
         "Parts of the area without canopy, for which one photo is enough."),
        ("no_fly", q.word, "text", "FILE",
         "Zones that sites and flight paths must avoid."),
        ("buffer", parse.height, "number", "M",
         "Distance between flight paths and no-fly zones.  [default]"),
        ("order", q.one_of(ORDERS), "text", "HOW",
         "Order of the lines over an area: shortest, or gain (the largest gain of the probability "
         "of success per minute first; needs --poa).  [default]"),
        ("poa", q.word, "text", "PRIOR.tif",
         "Where the target is expected (GeoTIFF of relative probabilities), for --order gain and "
         "--detection-map."),
        ("max_sites", q.whole, "whole", "N",
         "Largest number of sites; an area that needs more is rejected.  [default]"),
    ),
    "Flight": (
        ("drone", q.word, "text", "NAME|FILE",
         "Drone; sets the camera, speeds and limits."),
        ("speed", parse.speed, "number", "M/S",
         "Speed over ground between photos.  [default, or the drone's]"),
        ("transit_speed", parse.speed, "number", "M/S",
         "Speed over ground to the first line, between lines, and back.  [the drone's]"),
        ("acceleration", parse.positive, "number", "M/S²",
         "Acceleration along the path.  [default, or the drone's]"),
        ("climb", parse.speed, "number", "M/S",
         "Vertical speed, up and down.  [default, or the drone's]"),
        ("hold", parse.seconds_or_zero, "number", "S",
         "Duration of the stop at each site.  [default]"),
        ("hold_error", parse.height, "number", "M",
         "Standard deviation of the drone's position at each site, along each axis.  [default]"),
        ("autopilot", q.one_of(parse.AUTOPILOTS), "text", "NAME",
         f"Autopilot of a drone that is not a preset: {' or '.join(parse.AUTOPILOTS)}.  [the "
             "drone's]"),
        ("camera_control", q.one_of(parse.CAMERA_CONTROLS), "text", "HOW",
         "How PX4 triggers the camera: mavlink or outputs.  [by camera]"),
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
         "Shortest time that the camera needs between two photos.  [the drone's]"),
        ("wind_speed", parse.wind_speed, "number", "M/S",
         "Wind speed; needs --wind-from."),
        ("wind_from", parse.direction, "number", "DEG",
         "Direction from which the wind blows, clockwise from true north."),
        ("airspeed", parse.speed, "number", "M/S",
         "Largest airspeed of the drone.  In wind, the drone flies more slowly over ground to "
         "stay below it.  [default, or the drone's]"),
        ("takeoff", q.latitude_longitude, "pair", "LAT,LON",
         "Point of take-off and landing.  [below the first waypoint]"),
        ("flight_time", parse.positive, "number", "MIN",
         "Usable flight time per battery; a longer mission is split into flights.  [2/3 of the "
         "drone's flight time in still air]"),
        ("file_waypoints", parse.file_waypoints, "whole", "N",
         "Largest number of waypoints (MAVLink: commands) in one file, instead of the known "
         "limit."),
        ("resume_at", q.index, "whole", "K",
         "Number of the first waypoint to fly, counted from 0 over all flights.  [0]"),
    ),
    "Height": (
        ("clearance", parse.height, "number", "M",
         "Smallest height above the top of the canopy.  [default]"),
        ("terrain", q.word, "text", "DEM.tif",
         "Elevation model that the flight follows (GeoTIFF)."),
        ("terrain_units", parse.length_unit, "text", "UNIT",
         "Unit of the elevation model's heights, instead of the unit in the file: m, ft, "
         "us-ft."),
        ("terrain_tolerance", parse.length, "number", "M",
         "Distance by which the path between two sites may come closer to the ground than planned.  "
         "[default]"),
        ("altitude_frame", q.one_of(FRAMES), "text", "FRAME",
         "Reference of the heights in mission files: takeoff, or terrain (the autopilot "
         "follows its own terrain model)."),
    ),
}
# fmt: on


def _shown(name: str) -> str:
    """Text of an option's default in the help."""
    value = DEFAULTS.get(name)
    return value if isinstance(value, str) else "" if value is None else f"{value:g}"


OPTIONS = tuple(
    Option(
        name,
        parser,
        kind,
        metavar,
        text.replace("[default", f"[{_shown(name)}"),
        panel,
        "--" + name.replace("_", "-"),
    )
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
"""Options that determine what photos from given positions show."""
