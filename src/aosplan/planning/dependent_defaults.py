"""Defaults of options that depend on other options, and questions about the whole request on which
these defaults depend: whether the request needs a search, and whether it covers an area.

The other defaults are in `aosplan.planning.options`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aosplan.planning.option_parsers import PERSON
from aosplan.planning.options import BY_NAME, DEFAULTS, GAIN, GUIDED

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

OWN_SIGNATURE = ("contrast", "canopy_offset", "crown_share")
"""Options that describe a signature by numbers.  They are given together."""

OPEN = "best"
"""Value of an option for which a search chooses the value."""

OF_LANES = ("lanes", "lane_pitch")
"""Options of lanes."""

LANE_OPTIONS = {"lanes": OF_LANES, "spiral": ("lane_pitch",), "best": OF_LANES}
"""The options of lanes that have a default, for each kind of grid that has such options."""

BEST = ("visibility", "contrast", "detection")
"""Objectives that a search maximises within the time.  They need no target."""

LEFT_OPEN = ("grid", "heading", "trigger")
"""Options whose values a search chooses if they are not given."""


def dependent_defaults(values: Mapping[str, Any]) -> dict[str, Any]:
    """Defaults of options that are needed by the given options, but are not given themselves."""
    numbers = given_flags(values, ("density", "integrated_density", "stems_per_hectare"))
    own_camera = given_flags(values, ("focal_length", "fov"))
    needed = ["volume_base"] if numbers else ["scene"]
    needed += ["speed", "acceleration", "climb"]
    if not own_camera:
        needed.append("camera")
    if values["find"] is not None:
        needed.append("false_alarms")
        if not given_flags(values, OWN_SIGNATURE):
            needed.append("signature")
    if not is_search(values):
        needed += LANE_OPTIONS.get(values["grid"], ())
    if is_over_area(values):
        needed.append("max_sites")
    if values["around"] is not None or (is_guided(values) and values["origin"] is not None):
        needed.append("around_radius")
    if values["no_fly"] is not None:
        needed.append("buffer")
    if values["trigger"] == "distance":
        needed += ["max_blur", "exposure_time"]
    if values["wind_speed"]:
        needed.append("airspeed")
    if values["terrain"]:
        needed.append("terrain_tolerance")
    found = {name: DEFAULTS[name] for name in needed if values[name] is None}
    if values["transit_speed"] is None:
        found["transit_speed"] = max(DEFAULTS["speed"], values["speed"] or 0.0)
    return found


def is_over_area(values: Mapping[str, Any]) -> bool:
    """Whether the plan covers an area, or areas around points, instead of a single place."""
    return values["area"] is not None or values["around"] is not None


def given_flags(values: Mapping[str, Any], names: Collection[str]) -> list[str]:
    """Flags of the options that have a value."""
    return [BY_NAME[name].flag for name in names if values[name] is not None]


def is_search(values: Mapping[str, Any]) -> bool:
    """Whether a request needs a search over flights."""
    if is_guided(values):
        return False
    if values["within"] is not None or searches_area(values):
        return True
    names = (*LEFT_OPEN, "baseline", "samples")
    has_open = any(values[name] in (None, OPEN) for name in names)
    return values["optimize"] == "detection" and has_open


def searches_area(values: Mapping[str, Any]) -> bool:
    """Whether the request asks for the kind of grid that is flown fastest over an area.

    Such a request needs a search. The solver compares the flight times of single grids, but the
    time over an area depends on the spacing of the lines.
    """
    return values["optimize"] == "time" and values["area"] is not None and values["grid"] == OPEN


def default_target(values: Mapping[str, Any]) -> float:
    """Default of the target V̂. It is 0 if a search or guided positions maximise an objective."""
    searched = is_search(values) or is_guided(values)
    return 0.0 if searched and values["optimize"] in BEST else DEFAULTS["vhat"]


def default_objective(values: Mapping[str, Any]) -> str:
    """Default of the objective.

    If the request has a time but no target, the objective is to achieve the best result within this
    time.
    """
    has_target = values["vhat"] is not None or values["visibility"] is not None
    if not is_guided(values) and (values["within"] is None or has_target):
        return str(DEFAULTS["optimize"])
    return "visibility" if values["find"] is None else "detection"


def left_open(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values of the objective and of the options in `LEFT_OPEN`, if they are not given.

    In a search, the options in `LEFT_OPEN` get the value `OPEN`.
    """
    found: dict[str, Any] = {}
    if values["order"] == GAIN and values["find"] is None:
        found["find"] = PERSON
    if values["optimize"] is None:
        found["optimize"] = default_objective({**values, **found})
    objective = found.get("optimize", values["optimize"])
    searches = is_search({**values, "optimize": objective})
    for name in LEFT_OPEN:
        if values[name] is None:
            found[name] = OPEN if searches else DEFAULTS[name]
    if objective == "detection" and values["find"] is None:
        found["find"] = PERSON
    return found


def is_guided(values: Mapping[str, Any]) -> bool:
    """Whether the positions of the photos are chosen for one place from a point cloud."""
    return bool(values["grid"] == GUIDED)
