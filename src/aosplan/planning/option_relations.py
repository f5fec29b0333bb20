"""Relations between the options of a plan: options that exclude each other, and options that need
another option.

`PlanRequest` refuses combinations of options that `RELATIONS` excludes.  Options may come from
several layers, such as flags and a request file.  An option of an upper layer removes the options
of lower layers that it excludes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.grid.patterns import NARROWEST_TURNS
from aosplan.models.signatures import SIGNATURES
from aosplan.planning.dependent_defaults import OF_LANES, OWN_SIGNATURE, is_search, searches_area
from aosplan.planning.options import (
    BY_NAME,
    FIND_OPTIONS,
    READING,
)
from aosplan.solver import refusals

if TYPE_CHECKING:
    from collections.abc import Mapping


SEARCH, RANGE = "search", "range"
"""Names of two conditions on the whole request: the first is met if the request needs a search over
flights, and the second is met if its altitude is a range.
"""


class Condition(NamedTuple):
    """A condition on one option.

    It is written as ``name`` (the option is given), ``name=VALUE|VALUE`` (it has one of these
    values) or ``name!=VALUE|VALUE`` (it is given and has another value). If no values follow
    ``name!=``, the condition is met by every value.
    """

    option: str
    values: tuple[str, ...] = ()
    others: bool = False

    @classmethod
    def read(cls, text: str) -> Condition:
        """The condition that a text describes."""
        option, _, allowed = text.partition("=")
        values = tuple(allowed.split("|")) if allowed else ()
        return cls(option.removesuffix("!"), values, option.endswith("!"))

    def is_met(self, values: Mapping[str, Any]) -> bool:
        """Whether the values of a request meet the condition."""
        value = values.get(self.option)
        if value is None or value is False:
            return False
        return not self.values or (str(value) in self.values) is not self.others

    def shown(self, values: Mapping[str, Any]) -> str:
        """The option as it is named in messages, with its value if the condition depends on the
        value.
        """
        flag = flag_of(self.option, values)
        return f"{flag} {values[self.option]}" if self.values or self.others else flag


class Relation(NamedTuple):
    """A rule about options: `given`, `verb`, `others`.

    Attributes
    ----------
    given
        The rule applies if one of these conditions is met.  If there are none, it always applies.
    verb
        `IS_THE_ONLY`: only one of `given` may be met.  `EXCLUDES`: none of `others` may be met.
        `NEEDS`: one of `others` has to be met.  `NEEDS_ALL`: all of `others` have to be met.
    others
        The conditions on other options.
    message, hint
        Texts for requests that break the rule.  They may contain ``{given}`` (the conditions in
        `given` that are met), ``{flags}`` (these without their values), ``{need}`` (the verb),
        ``{others}`` (the conditions that break the rule) and ``{grid}`` (the kind of grid).
    yields
        Whether options in a lower layer, such as a request file, are ignored if an option in an
        upper layer, such as a flag, breaks the rule with them.
    waits
        Whether options in the user's own defaults are ignored if what they need is missing.
    """

    given: tuple[Condition, ...]
    verb: str
    others: tuple[Condition, ...]
    message: str
    hint: str
    yields: bool = False
    waits: bool = False


IS_THE_ONLY, EXCLUDES, NEEDS, NEEDS_ALL = "is the only", "excludes", "needs", "needs all"


def _rule(
    given: str, verb: str, others: str, message: str = "", hint: str = "", **layers: bool
) -> Relation:
    """A relation whose conditions are given as text."""
    first, second = (tuple(map(Condition.read, text.split())) for text in (given, others))
    return Relation(first, verb, second, message, hint, **layers)


def _same(options: str) -> Relation:
    """Options that have the same meaning."""
    message = "{given} have the same meaning"
    return _rule(options, IS_THE_ONLY, "", message, "give only one of them", yields=True)


def _against(given: str, others: str) -> Relation:
    """Options that contradict options of another description of the same thing."""
    message = "{given} and {others} contradict each other"
    return _rule(given, EXCLUDES, others, message, "give only one of them", yields=True)


def _unguided(given: str, reason: str) -> Relation:
    """An option, or a value of an option, that cannot be used with guided positions."""
    message = "{given} cannot be used with {others}, because " + reason
    hint = "leave {flags} out, or give another --grid"
    return _rule(given, EXCLUDES, "grid=guided", message, hint)


def _unsearched(given: str, reason: str) -> Relation:
    """An option that cannot be combined with a search."""
    message = "{flags} cannot be used with {others}, because " + reason
    return _rule(given, EXCLUDES, SEARCH, message, "leave {flags} out")


_READING = " ".join(READING)
_NO_INVENTORY = "crown_diameter leaf_area_index"
_CAMERA = "a camera on the command line needs {others}"
_CAMERA_HINT = (
    "give --fov, or --focal-length and --sensor-width; and --image-width and --image-height"
)
_PLACE_HINT = "give --origin LAT,LON too"

RELATIONS = (
    # Options that are alternatives, because they give the same quantity.
    _same("altitude gsd target_size"),
    _against("altitude gsd", "target_pixels"),
    _same("vhat visibility"),
    _same("origin area around"),
    _against("origin", "clear no_fly buffer max_sites"),
    _against("area", "around_radius"),
    _same("scene density integrated_density stems_per_hectare"),
    _against("scene", f"volume_height volume_base {_NO_INVENTORY}"),
    _against("density", f"{_READING} {_NO_INVENTORY}"),
    _against("integrated_density", f"{_READING} {_NO_INVENTORY}"),
    _against("stems_per_hectare", _READING),
    _same("signature contrast"),
    _against("signature", "canopy_offset crown_share"),
    _same("camera focal_length fov"),
    _against("camera", "sensor_width sensor_height image_width image_height"),
    _against("fov", "sensor_width sensor_height"),
    # Guided positions.
    _unguided(
        "find!=",
        "guided positions did not always find more targets than plain grids in simulations",
    ),
    _unguided(
        "optimize!=visibility", "the positions are chosen for the visibility of the place"
    ),
    _unguided("trigger!=stop", "the positions are not on lines that can be flown through"),
    _unguided("model!=measured", "the positions are chosen with the voxels of the place"),
    _unguided("view!=perspective", "all photos show one place, in perspective"),
    _unguided("edges!=auto|interior", "only positions whose rays stay on the plot are used"),
    _unguided("hold_error!=0.0", "errors of the position are not part of the choice"),
    _unguided("order=gain", "all positions show the same place"),
    _unguided("sensitivity", "the sensitivity can be computed only for a grid"),
    _unguided("allow_no_common_ground", "every photo shows the whole target area"),
    *(
        _rule(
            given, EXCLUDES, "grid=guided",
            "{given} cannot be used with --grid guided, because guided positions are chosen for a "
            f"single {name}",
            "give a number",
        )
        for given, name in (("heading=best", "heading"), (RANGE, "altitude"))
    ),
    _rule(
        "grid=guided", NEEDS, "origin area around",
        "--grid guided needs a location, because the positions are chosen for one place",
        "give --origin LAT,LON or --area FILE",
    ),
    # Searches.
    _rule(
        RANGE, NEEDS, SEARCH, "{given} is a range",
        "give --within MIN, which chooses an altitude from the range, or give a single altitude",
    ),
    _rule(
        "trigger=best", NEEDS, SEARCH, "{given} {need} --within", "give --within MIN as well"
    ),
    _unsearched("resume_at!=0", "a resumed mission already has sites"),
    _unsearched("line_length", "--within chooses the length of a line"),
    _unsearched("sensitivity", "the sensitivity is computed only for a given grid"),
    _rule(
        "grid=spiral", EXCLUDES, SEARCH,
        "{given} cannot be used with {others}, because the search does not include spirals",
        "leave --grid out",
    ),
    # Options that are parts of a description.
    _rule(
        "", NEEDS, "altitude gsd target_size target_pixels", "no altitude is given",
        "give --altitude M (with --within, also a range such as 30..90), or --gsd M, or "
        "--target-size M with --target-pixels K",
    ),
    _rule("target_pixels", NEEDS_ALL, "target_size", "{given} needs {others}"),
    _rule("target_size", NEEDS_ALL, "target_pixels", "{given} needs {others}"),
    _rule(
        "density integrated_density", NEEDS_ALL, "occluder_size volume_height",
        "a uniform scene needs {others}",
        "give --density D --occluder-size M --volume-height M, or --scene NAME",
    ),
    _rule(
        "stems_per_hectare", NEEDS_ALL, "crown_diameter leaf_area_index volume_height",
        "an inventory needs {others}",
        "give --stems-per-hectare N --crown-diameter M --leaf-area-index L --volume-height M, or "
        "--scene NAME",
    ),
    _rule(
        " ".join(OWN_SIGNATURE), NEEDS_ALL, " ".join(OWN_SIGNATURE),
        "a signature by numbers needs {others}",
        "give --contrast, --canopy-offset and --crown-share together, or --signature "
        + ", ".join(SIGNATURES),
    ),
    _rule(
        "focal_length", NEEDS_ALL, "sensor_width image_width image_height", _CAMERA, _CAMERA_HINT
    ),
    _rule("fov", NEEDS_ALL, "image_width image_height", _CAMERA, _CAMERA_HINT),
    _rule(
        " ".join(FIND_OPTIONS[1:]), NEEDS, "find", "{given} {need} --find",
        "give --find person, or --find WxL in metres",
    ),
    _rule(
        f"{_NO_INVENTORY} volume_height volume_base", NEEDS,
        "density integrated_density stems_per_hectare",
        "{given} {need} a density or --stems-per-hectare",
        "give --density D, --integrated-density P or --stems-per-hectare N as well, or a "
        "--scene alone",
    ),
    _rule(
        "sensor_width sensor_height image_width image_height", NEEDS, "focal_length fov",
        "{given} {need} --focal-length or --fov",
        "give --focal-length MM or --fov DEG as well, or a --camera",
    ),
    # A kind of grid and a trigger.
    _rule(
        "grid=spiral", EXCLUDES, "trigger=distance",
        "{given} cannot be used with {others}, because a spiral has no straight lines",
        "give --grid lanes or line, or --trigger stop", yields=True,
    ),
    # Options that have a meaning only together with another option.
    _rule(
        "max_blur exposure_time", NEEDS, "trigger=distance|best",
        "{given} {need} --trigger distance", "give --trigger distance too",
        yields=True, waits=True,
    ),
    _rule(
        "wind_from", NEEDS, "wind_speed", "{given} {need} --wind-speed", "give --wind-speed too"
    ),
    _rule(
        "wind_speed", NEEDS, "wind_from", "{given} {need} --wind-from", "give --wind-from too"
    ),
    _rule(
        "takeoff terrain", NEEDS, "origin area around", "{given} {need} --origin LAT,LON",
        _PLACE_HINT, waits=True,
    ),
    _rule(
        "terrain_units terrain_tolerance", NEEDS, "terrain", "{given} {need} --terrain",
        "give --terrain too", waits=True,
    ),
    _rule(
        "clear no_fly buffer max_sites", NEEDS, "area around", "{given} {need} --area",
        "give --area FILE too",
    ),
    _rule(
        "around_radius", NEEDS, "around origin", "{given} {need} --around",
        "give --around FILE or --origin",
    ),
    _rule("buffer", NEEDS, "no_fly", "{given} {need} --no-fly", "give --no-fly FILE too"),
    # Orders.
    _rule(
        "order", NEEDS, "area around", "{given} {need} --area",
        "give --area FILE, or leave --order out",
    ),
    _rule(
        "order=gain", NEEDS, "poa", "{given} needs to know where the target is expected",
        "give --poa PRIOR.tif, or leave --order out",
    ),
    # Kinds of grid.
    *(
        _rule(
            options, NEEDS, needed, "{given} cannot be used with --grid {grid}",
            "give --grid lanes, or leave the other options out", yields=True,
        )
        for options, needed in (
            ("lanes lane_pitch", "grid=lanes|spiral|line|best"),
            # For lines over an area, --lane-pitch gives the distance between lines.
            ("lanes lane_pitch", "grid=lanes|spiral|best area around"),
            ("lanes", "grid=lanes|best"),
        )
    ),
    _rule(
        "heading=auto", NEEDS, "area around", "{given} needs --area", "give --heading in degrees"
    ),
    _rule(
        "line_length", EXCLUDES, "area around", "{given} and --area contradict each other",
        "give only one",
    ),
    _rule(
        "grid=spiral", EXCLUDES, "area around", "{given} cannot be repeated over an --area",
        "give --grid lanes",
    ),
    _rule(
        "line_length", NEEDS, "grid=line", "{given} cannot be used with --grid {grid}",
        "give --grid line",
    ),
)  # fmt: skip
"""The rules, in the order in which they are checked."""

OWN_CAMERA = (
    "camera", "focal_length", "sensor_width", "sensor_height", "fov", "image_width",
    "image_height",
)  # fmt: skip
"""Options that describe a camera."""

AIRCRAFT = ("drone", "payload", "autopilot", "camera_control")
"""Options that name the aircraft. If one of them is given, the aircraft determines other options.
"""

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


def check_relations(values: Mapping[str, Any]) -> None:
    """Refuse a request whose options break a rule in `RELATIONS`.

    Raises
    ------
    RequestError
        If a rule is broken.  The message names the options.
    """
    known = {**values, SEARCH: _search_flag(values), RANGE: None}
    if isinstance(values["altitude"], str):
        known[RANGE] = f"--altitude {values['altitude']}"
    for relation in RELATIONS:
        given = [each for each in relation.given if each.is_met(known)]
        if relation.given and not given:
            continue
        met = [each for each in relation.others if each.is_met(known)]
        if relation.verb == IS_THE_ONLY:
            broken = len(given) > 1
        elif relation.verb == EXCLUDES:
            broken = bool(met)
        elif relation.verb == NEEDS:
            broken = not met
        else:
            broken = len(met) < len(relation.others)
            met = [each for each in relation.others if each not in met][:1]
        if broken:
            texts = {
                "given": " and ".join(each.shown(known) for each in given),
                "flags": " and ".join(flag_of(each.option, known) for each in given),
                "others": " and ".join(each.shown(known) for each in sorted(met)),
                "need": "needs" if len(given) == 1 else "need",
                "grid": values["grid"],
            }
            raise RequestError(relation.message.format(**texts), relation.hint.format(**texts))


def flag_of(option: str, values: Mapping[str, Any]) -> str:
    """The flag of an option.  `SEARCH` and `RANGE` have their flag as a value."""
    return BY_NAME[option].flag if option in BY_NAME else str(values[option])


def check_numbers(values: Mapping[str, Any]) -> None:
    """Refuse numbers that contradict each other or the kind of grid."""
    samples, most, pitch = values["samples"], values["max_samples"], values["lane_pitch"]
    if samples and most and samples > most:
        raise RequestError(refusals.samples_beyond_bound(samples, most))
    is_spiral = values["grid"] == "spiral"
    least = NARROWEST_TURNS if is_spiral else 1.0
    if isinstance(pitch, float) and pitch < least:
        raise RequestError(
            f"--lane-pitch {pitch:g} is below {least:g}"
            + (", the narrowest turns of a spiral" if is_spiral else "")
        )


def without_overridden(lower: dict[str, Any], upper: Mapping[str, Any]) -> dict[str, Any]:
    """The options of a lower layer, without those that the upper layer overrides or excludes."""
    dropped = set(upper)
    for relation in RELATIONS:
        if relation.yields:
            dropped |= _overridden(relation, lower, upper, dropped)
    if "scene" in upper and "scene" not in lower:
        # This option belonged to the uniform scene of the lower layer.
        dropped.add("occluder_size")
    if "drone" in upper:
        dropped |= {*BROUGHT_BY_DRONE, *OWN_CAMERA}
    return {name: value for name, value in lower.items() if name not in dropped}


def _overridden(
    relation: Relation, lower: Mapping[str, Any], upper: Mapping[str, Any], dropped: set[str]
) -> set[str]:
    """Options of a lower layer that break a rule together with the options of an upper layer.

    `dropped` contains the options that the upper layer overrides or excludes by other rules.
    """
    given, others = relation.given, relation.others
    if relation.verb == NEEDS:
        partners = [each for each in others if each.values and each.option in dropped]
        is_met = any(each.is_met(upper) for each in partners)
        return {each.option for each in given if partners and not is_met}
    found: set[str] = set()
    if any(each.is_met(upper) for each in given):
        excluded = given if relation.verb == IS_THE_ONLY else others
        found |= {each.option for each in excluded if not each.values or each.is_met(lower)}
    if any(each.values and each.is_met(upper) for each in others):
        found |= {each.option for each in given if each.is_met(lower)}
    return found


def with_partners(own: dict[str, Any], asked: Mapping[str, Any]) -> dict[str, Any]:
    """The options of a layer, without those that need another option that is neither in the layer
    nor in the request.
    """
    together = {**own, **asked}
    unpaired = {
        each.option
        for relation in RELATIONS
        if relation.waits and not any(other.is_met(together) for other in relation.others)
        for each in relation.given
    }
    if together.get("grid") != "lanes":
        unpaired |= set(OF_LANES)
    left = {name: value for name, value in own.items() if name not in unpaired}
    # An option that is removed may have been the partner of another option.
    return left if len(left) == len(own) else with_partners(left, asked)


def _search_flag(values: Mapping[str, Any]) -> str | None:
    """The options that make a request a search, as text; None if the request is not a search."""
    if not is_search(values):
        return None
    if values["within"] is not None:
        return "--within"
    if searches_area(values):
        return "--optimize time --grid best over an --area"
    return "--optimize detection"
