"""Relations between the options of a plan: options that exclude each other, and options that need
another option.

`PlanRequest` refuses combinations of options that these tables exclude.  Options may come from
several layers, such as flags and a request file.  An option of an upper layer removes the options
of lower layers that it excludes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.grid.patterns import NARROWEST_TURNS
from aosplan.models.signatures import SIGNATURES
from aosplan.planning.option_parsers import PERSON
from aosplan.planning.options import (
    BY_NAME,
    DEFAULTS,
    FIND_OPTIONS,
    NOT_SEARCHED,
    READING,
    is_guided,
)
from aosplan.solver import refusals

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping


OWN_SIGNATURE = ("contrast", "canopy_offset", "crown_share")
"""Options that describe a signature by numbers.  They are given together."""

ALTERNATIVES = (
    (("altitude",), ("gsd",), ("target_size", "target_pixels")),
    (("vhat",), ("visibility",)),
    (
        ("origin", "around_radius"),
        ("area", "clear", "no_fly", "buffer", "max_sites"),
        ("around", "around_radius", "clear", "no_fly", "buffer", "max_sites"),
    ),
    (
        ("scene", *READING),
        ("density", "volume_height", "volume_base"),
        ("integrated_density", "volume_height", "volume_base"),
        (
            "stems_per_hectare",
            "crown_diameter",
            "leaf_area_index",
            "volume_height",
            "volume_base",
        ),
    ),
    (("signature",), OWN_SIGNATURE),
    (
        ("camera",),
        ("focal_length", "sensor_width", "sensor_height", "image_width", "image_height"),
        ("fov", "image_width", "image_height"),
    ),
)
"""Sets of options. Options from different sets of the same row contradict each other."""


OPEN = "best"
"""Value of an option that a search chooses."""


class Need(NamedTuple):
    """Options that can only be given together with another option, their partner.

    Attributes
    ----------
    options
        The options.
    partners
        Options of which at least one is needed.
    shown
        Name of the partner in messages.
    hint
        The remedy.
    value
        Value that the partner must have; None if any value is allowed.
    waits
        Whether a default from the user's own file is ignored if its partner is missing. If it is
        false, such a default is refused.
    """

    options: tuple[str, ...]
    partners: tuple[str, ...]
    shown: str
    hint: str
    value: str | None = None
    waits: bool = False

    def is_met(self, values: Mapping[str, Any]) -> bool:
        """Whether one of the partners is given."""
        given = (values.get(partner) for partner in self.partners)
        return any(
            each is not None and (self.value is None or each in (self.value, OPEN))
            for each in given
        )


NEEDS = (
    Need(FIND_OPTIONS[1:], ("find",), "--find", "give --find person, or --find WxL in metres"),
    Need(
        ("crown_diameter", "leaf_area_index", "volume_height", "volume_base"),
        ("density", "integrated_density", "stems_per_hectare"),
        "a density or --stems-per-hectare",
        "give --density D, --integrated-density P or --stems-per-hectare N as well, or a "
        "--scene alone",
    ),
    Need(
        ("sensor_width", "sensor_height", "image_width", "image_height"),
        ("focal_length", "fov"),
        "--focal-length or --fov",
        "give --focal-length MM or --fov DEG as well, or a --camera",
    ),
    Need(
        ("max_blur", "exposure_time"),
        ("trigger",),
        "--trigger distance",
        "give --trigger distance too",
        value="distance",
        waits=True,
    ),
    Need(("wind_from",), ("wind_speed",), "--wind-speed", "give --wind-speed too"),
    Need(("wind_speed",), ("wind_from",), "--wind-from", "give --wind-from too"),
    Need(
        ("takeoff", "terrain"),
        ("origin", "area", "around"),
        "--origin LAT,LON",
        "give --origin LAT,LON too",
        waits=True,
    ),
    Need(
        ("terrain_units", "terrain_tolerance"),
        ("terrain",),
        "--terrain",
        "give --terrain too",
        waits=True,
    ),
    Need(
        ("clear", "no_fly", "buffer", "max_sites"),
        ("area", "around"),
        "--area",
        "give --area FILE too",
    ),
    Need(("around_radius",), ("around", "origin"), "--around", "give --around FILE or --origin"),
    Need(("buffer",), ("no_fly",), "--no-fly", "give --no-fly FILE too"),
)
"""Options that have a meaning only together with another option."""


class Description(NamedTuple):
    """A group of options that describe one thing together.

    Attributes
    ----------
    leading
        If one of these is given, the group is in use.
    parts
        All of these are needed if the group is in use.
    subject
        Name of the described thing in messages.
    hint
        The remedy.
    """

    leading: tuple[str, ...]
    parts: tuple[str, ...]
    subject: str
    hint: str


_CAMERA_HINT = "--fov or --focal-length, --sensor-width; --image-width and --image-height"

DESCRIPTIONS = (
    Description(("target_pixels",), ("target_size",), "--target-pixels", ""),
    Description(("target_size",), ("target_pixels",), "--target-size", ""),
    Description(
        ("density", "integrated_density"),
        ("occluder_size", "volume_height"),
        "a uniform scene",
        "give --density D --occluder-size M --volume-height M, or --scene NAME",
    ),
    Description(
        ("stems_per_hectare",),
        ("crown_diameter", "leaf_area_index", "volume_height"),
        "an inventory",
        "give --stems-per-hectare N --crown-diameter M --leaf-area-index L --volume-height M, or "
        "--scene NAME",
    ),
    Description(
        OWN_SIGNATURE,
        OWN_SIGNATURE,
        "a signature by numbers",
        "give --contrast, --canopy-offset and --crown-share together, or --signature "
        + ", ".join(SIGNATURES),
    ),
    Description(
        ("focal_length",),
        ("sensor_width", "image_width", "image_height"),
        "a camera on the command line",
        _CAMERA_HINT,
    ),
    Description(
        ("fov",), ("image_width", "image_height"), "a camera on the command line", _CAMERA_HINT
    ),
)
"""Groups of options that are given together or not at all."""

OF_LANES = ("lanes", "lane_pitch")
"""Options of lanes."""

LANE_OPTIONS = {"lanes": OF_LANES, "spiral": ("lane_pitch",), "best": OF_LANES}
"""The options of lanes that each kind of grid accepts."""

AIRCRAFT = ("drone", "payload", "autopilot", "camera_control")
"""Options that name the aircraft, which determines other options if one of these is given."""

BROUGHT_BY_DRONE = (
    "speed",
    "transit_speed",
    "acceleration",
    "climb",
    "photo_interval",
    "airspeed",
    "autopilot",
    "camera_control",
    "payload",
    "flight_time",
)
"""Options that a drone determines, in addition to its camera."""


BEST = ("visibility", "contrast", "detection")
"""Objectives that a search maximises within the time.  They need no target."""

LEFT_OPEN = ("grid", "heading", "trigger")
"""Options whose values a search chooses if they are not given."""


def check_alternatives(values: Mapping[str, Any]) -> None:
    """Refuse options that give the same quantity twice, or that contradict each other."""
    for alternatives in ALTERNATIVES:
        leading = [names[0] for names in alternatives if values[names[0]] is not None]
        if len(leading) > 1:
            flags = " and ".join(BY_NAME[name].flag for name in leading)
            raise RequestError(f"{flags} have the same meaning", "give only one of them")
        for names in alternatives:
            if leading and names[0] == leading[0]:
                unexpected = given_flags(values, sorted(_foreign(alternatives, names)))
                if unexpected:
                    raise RequestError(
                        f"{BY_NAME[leading[0]].flag} and {' and '.join(unexpected)} contradict "
                        "each other",
                        "give only one of them",
                    )


def check_partners(values: Mapping[str, Any]) -> None:
    """Refuse options that need another option which is not given."""
    if not given_flags(values, ("altitude", "gsd", "target_size", "target_pixels")):
        raise RequestError(
            "no altitude is given",
            "give --altitude M, or --gsd M, or --target-size M with --target-pixels K",
        )
    for described in DESCRIPTIONS:
        if given_flags(values, described.leading):
            missing = [name for name in described.parts if values[name] is None]
            if missing:
                raise RequestError(
                    f"{described.subject} needs {BY_NAME[missing[0]].flag}", described.hint
                )
    for need in NEEDS:
        unpaired = given_flags(values, need.options)
        if unpaired and not need.is_met(values):
            verb = "needs" if len(unpaired) == 1 else "need"
            raise RequestError(f"{' and '.join(unpaired)} {verb} {need.shown}", need.hint)


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


def check_grid(values: Mapping[str, Any]) -> None:
    """Refuse options that contradict the kind of grid or the number of its samples."""
    grid, samples, most = values["grid"], values["samples"], values["max_samples"]
    over_area, pitch = is_over_area(values), values["lane_pitch"]
    if samples and most and samples > most:
        raise RequestError(refusals.samples_beyond_bound(samples, most))
    if grid == "spiral" and values["trigger"] == "distance":
        raise RequestError(
            "--grid spiral cannot be used with --trigger distance, because a spiral has no "
            "straight lines",
            "give --grid lanes or line, or --trigger stop",
        )
    least = NARROWEST_TURNS if grid == "spiral" else 1.0
    if isinstance(pitch, float) and pitch < least:
        raise RequestError(
            f"--lane-pitch {pitch:g} is below {least:g}"
            + (", the narrowest turns of a spiral" if grid == "spiral" else "")
        )
    taken = LANE_OPTIONS.get(grid, ())
    unexpected = given_flags(values, [name for name in OF_LANES if name not in taken])
    # For lines over an area, the option gives the distance between lines.
    if grid == "line" and over_area:
        unexpected = [flag for flag in unexpected if flag != "--lane-pitch"]
    if unexpected:
        raise RequestError(
            f"{' and '.join(unexpected)} cannot be used with --grid {grid}",
            "give --grid lanes, or leave the other options out",
        )
    if values["heading"] == "auto" and not over_area:
        raise RequestError("--heading auto needs --area", "give --heading in degrees")
    if values["line_length"] is not None and over_area:
        raise RequestError("--line-length and --area contradict each other", "give only one")
    if grid == "spiral" and over_area:
        raise RequestError("--grid spiral cannot be repeated over an --area", "give --grid lanes")
    if values["line_length"] is not None and grid != "line":
        raise RequestError(f"--line-length cannot be used with --grid {grid}", "give --grid line")


def given_flags(values: Mapping[str, Any], names: Collection[str]) -> list[str]:
    """Flags of the options that have a value."""
    return [BY_NAME[name].flag for name in names if values[name] is not None]


def without_overridden(lower: dict[str, Any], upper: Mapping[str, Any]) -> dict[str, Any]:
    """The options of a lower layer that the upper layer does not override or exclude."""
    dropped = set(upper)
    for alternatives in ALTERNATIVES:
        for names in alternatives:
            if names[0] in upper:
                dropped |= _foreign(alternatives, names)
    if "scene" in upper and "scene" not in lower:
        # This option belonged to the uniform scene of the lower layer.
        dropped.add("occluder_size")
    if "grid" in upper:
        dropped |= {*OF_LANES} - {*LANE_OPTIONS.get(upper["grid"], ())}
    if upper.get("trigger") == "stop":
        dropped |= {"max_blur", "exposure_time"}
    elif upper.get("trigger") == "distance" and lower.get("grid") == "spiral":
        dropped |= {"grid", *OF_LANES}
    elif upper.get("grid") == "spiral" and lower.get("trigger") == "distance":
        dropped |= {"trigger", "max_blur", "exposure_time"}
    if "drone" in upper:
        dropped |= {*BROUGHT_BY_DRONE, *(name for names in ALTERNATIVES[-1] for name in names)}
    return {name: value for name, value in lower.items() if name not in dropped}


def with_partners(own: dict[str, Any], asked: Mapping[str, Any]) -> dict[str, Any]:
    """The options of a layer, without the options whose partner is neither in the layer nor in the
    request.
    """
    together = {**own, **asked}
    unpaired = {
        name for need in NEEDS if need.waits and not need.is_met(together) for name in need.options
    }
    if together.get("grid") != "lanes":
        unpaired |= set(OF_LANES)
    left = {name: value for name, value in own.items() if name not in unpaired}
    # An option that is removed may have been the partner of another option.
    return left if len(left) == len(own) else with_partners(left, asked)


def is_search(values: Mapping[str, Any]) -> bool:
    """Whether a request needs a search over flights."""
    if is_guided(values):
        return False
    if values["within"] is not None or _searches_area(values):
        return True
    names = (*LEFT_OPEN, "baseline", "samples")
    has_open = any(values[name] in (None, OPEN) for name in names)
    return values["optimize"] == "detection" and has_open


def _searches_area(values: Mapping[str, Any]) -> bool:
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
    if values["optimize"] is None:
        found["optimize"] = default_objective(values)
    objective = found.get("optimize", values["optimize"])
    searches = is_search({**values, "optimize": objective})
    for name in LEFT_OPEN:
        if values[name] is None:
            found[name] = OPEN if searches else DEFAULTS[name]
    if objective == "detection" and values["find"] is None:
        found["find"] = PERSON
    return found


def check_search(values: Mapping[str, Any]) -> None:
    """Refuse options that cannot be combined with a search, and options that need a search.

    Raises
    ------
    RequestError
        If the options cannot be combined.
    """
    if is_guided(values):
        from aosplan.planning.guided_relations import check_guided

        check_guided(values)
        return
    if not is_search(values):
        if isinstance(values["altitude"], str):
            raise RequestError(
                f"--altitude {values['altitude']} is a range",
                "give --within MIN, which chooses an altitude from the range, or give a "
                "single altitude",
            )
        if values["trigger"] == "best":
            raise RequestError("--trigger best needs --within", "give --within MIN as well")
        return
    which = "--optimize detection"
    if values["within"] is not None:
        which = "--within"
    elif _searches_area(values):
        which = "--optimize time --grid best over an --area"
    for name, reason in NOT_SEARCHED.items():
        if values[name]:
            flag = "--" + name.replace("_", "-")
            problem = f"{flag} cannot be used with {which}, because {reason}"
            raise RequestError(problem, f"leave {flag} out")
    if values["grid"] == "spiral":
        raise RequestError(
            f"--grid spiral cannot be used with {which}, because the search does not include "
            "spirals",
            "leave --grid out",
        )


def _foreign(alternatives: Collection[tuple[str, ...]], names: tuple[str, ...]) -> set[str]:
    """Options that belong to the other alternatives, but not to this one."""
    return {name for others in alternatives for name in others} - set(names)
