"""Parsers of the options of a plan.

A parser converts the value that a user gives (text, or a value from a file) to a value within the
domain of the option.  Its second argument is the name of the option, for messages.  Parsers of
plain numbers are in `aosplan.units`.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from aosplan import units as q
from aosplan.errors import RequestError
from aosplan.models.signatures import PERSON_M

if TYPE_CHECKING:
    from collections.abc import Callable

VIEWS = ("telecentric", "perspective")
"""Views of the measured model: each target is below its own aperture (``telecentric``), or all
targets are below the same aperture (``perspective``).
"""

EDGES = ("auto", "interior", "wrapped")
"""Targets that the measured model counts: those whose rays stay on the plot (``interior``), all
targets of the periodic plot (``wrapped``), or a choice between these (``auto``).
"""

GROUND = ("auto", "class", "filter", "normalized")
"""Methods that find the ground of a point cloud."""

TRIGGERS = ("stop", "distance", "best")
"""Ways to take photos: at a stop, by distance while flying, or the better of both."""

OPACITY = ("auto", "pulses", "voxels")
"""Sources of the opacity of a point cloud."""

AUTOPILOTS = ("px4", "ardupilot")
"""Flight controllers that read QGroundControl's plans."""

CAMERA_CONTROLS = ("mavlink", "outputs")
"""Ways in which PX4 triggers a camera: by MAVLink's camera protocol, or by its own outputs."""


LARGEST = 1e9
"""Largest value of a quantity in a request. The smallest value other than zero is the inverse of
this.
"""


def bounded(parse: Callable[..., float], value: Any, name: str, **unit: str) -> float:
    """A quantity within limits, so that products of several quantities do not overflow."""
    result = parse(value, name, **unit)
    if result and not 1.0 / LARGEST <= abs(result) <= LARGEST:
        raise RequestError(
            f"{name} {q.shown(value)} is not between {1 / LARGEST:g} and {LARGEST:g}"
        )
    return result


positive = partial(bounded, q.positive)
at_least_zero = partial(bounded, q.at_least_zero)
length = partial(bounded, q.positive, unit="m")
height = partial(bounded, q.at_least_zero, unit="m")
speed = partial(bounded, q.positive, unit="m/s")
wind_speed = partial(bounded, q.at_least_zero, unit="m/s")
seconds = partial(bounded, q.positive, unit="s")
seconds_or_zero = partial(bounded, q.at_least_zero, unit="s")
direction = partial(q.number, unit="deg")
heading_or_best = q.or_best(direction)


def field_of_view(value: Any, name: str) -> float:
    """An angle between 0 and 180 degrees."""
    found = positive(value, name)
    if found >= 180.0:
        raise RequestError(f"{name} {q.shown(value)} is not below 180 degrees")
    return found


def target_share(value: Any, name: str) -> float | str:
    """A share below 1, as a target. If the conversion to a float would change its value, it is
    returned as text.
    """
    exact = q.exact_share(value, name)
    if not 0 <= exact < 1:
        hint = (
            "no finite number of photos reaches 1; give a target such as 0.98"
            if exact == 1
            else q.percent_hint(value) or "give a target between 0 and 1, such as 0.98 or 98%"
        )
        raise RequestError(f"{name} {q.shown(value)} is not a share below 1", hint)
    nearest = float(exact)
    if isinstance(value, float) or q.exact_share(repr(nearest), name) == exact:
        return nearest
    return str(value)


def altitude(value: Any, name: str) -> float | str:
    """A height, or a range of heights such as ``40..80``."""
    if not (isinstance(value, str) and ".." in value):
        return length(value, name)
    low, _, high = value.partition("..")
    lowest, highest = length(low, name), length(high, name)
    if not lowest < highest:
        raise RequestError(
            f"{name} {q.shown(value)} is not an increasing range",
            "give a range such as 40..80, or a single height",
        )
    return f"{lowest!r}..{highest!r}"


def heading_or_auto(value: Any, name: str) -> float | str:
    """A direction, ``best``, or ``auto`` (along the longer side of an area)."""
    return "auto" if value == "auto" else heading_or_best(value, name)


def payload(value: Any, name: str) -> str:
    """The name of a payload of DJI drones."""
    from aosplan.mission.dji_models import PAYLOADS

    return q.one_of(PAYLOADS)(value, name)


def length_unit(value: Any, name: str) -> str:
    """Check the value of an option that is one unit of length.

    Raises
    ------
    RequestError
        If the unit is not known.
    """
    from aosplan.crs import unit_m

    text = str(value).strip()
    if not unit_m(text):
        raise RequestError(
            f"{name} {q.shown(text)} is not a known unit of length",
            "give m, ft, us-ft, or a name from EPSG such as 'Indian foot'",
        )
    return text


def length_units(value: Any, name: str) -> str:
    """Check the option ``--units``: one unit for all axes, or one unit for x and y and another unit
    for z.

    The two units are separated by a comma.

    Raises
    ------
    RequestError
        If a unit is not known.
    """
    across, comma, up = str(value).partition(",")
    parts = [length_unit(part, name) for part in ([across, up] if comma else [across])]
    return ",".join(parts)


def file_waypoints(value: Any, what: str) -> int:
    """A number of waypoints, at least 2."""
    count = q.whole(value, what)
    if count < 2:
        raise RequestError(
            f"{what} {value} is too few",
            "give 2 or more, because a mission file has at least 2 waypoints",
        )
    return count


PERSON = "person"
"""Name of the target whose size `target_m` knows."""

SMALLEST_TARGET_M, LARGEST_TARGET_M = 0.1, 10.0
"""Limits of the sides of a target."""

LARGEST_CONTRAST = 1000.0


def target_name(value: Any, name: str) -> str:
    """``person``, or width and length in metres, such as ``0.5x1.7``."""
    text = str(value).strip().lower().replace("×", "x")
    if text == PERSON:
        return text
    sides = text.split("x")
    if len(sides) != 2:
        raise RequestError(
            f"{name} {q.shown(value)} is neither person nor WxL in metres",
            "give person (0.5 x 1.7 m, lying), or width and length such as 2x4",
        )
    width, length = sorted(q.positive(side, name, unit="m") for side in sides)
    for side in (width, length):
        if not SMALLEST_TARGET_M <= side <= LARGEST_TARGET_M:
            raise RequestError(
                f"{name} {q.shown(value)}: a side of {side:g} m is not between {SMALLEST_TARGET_M:g} and "
                f"{LARGEST_TARGET_M:g} m"
            )
    return f"{width:g}x{length:g}"


def target_m(name: str) -> tuple[float, float]:
    """Width and length [m] of a target that `target_name` returned."""
    if name == PERSON:
        return PERSON_M
    width, length = (float(side) for side in name.split("x"))
    return width, length


def radiance(value: Any, name: str) -> float:
    """A radiance in units of the standard deviation between occluders."""
    found = q.number(value, name)
    if abs(found) > LARGEST_CONTRAST:
        raise RequestError(
            f"{name} {q.shown(value)} is not between -{LARGEST_CONTRAST:g} and {LARGEST_CONTRAST:g}",
            "the unit is the standard deviation between occluders, and not degrees or grey values",
        )
    return found


def contrast(value: Any, name: str) -> float:
    """A contrast: a radiance that is not zero."""
    found = radiance(value, name)
    if found == 0.0:
        raise RequestError(f"{name} 0: a target that looks like the ground cannot be found")
    return found


def false_alarms(value: Any, name: str) -> float:
    """False alarms per hectare."""
    found = q.positive(value, name)
    if not 1e-6 <= found <= 100.0:
        raise RequestError(f"{name} {q.shown(value)} per hectare is not between 1e-06 and 100")
    return found
