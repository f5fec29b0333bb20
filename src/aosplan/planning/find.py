"""What is looked for: the options of ``--find``, read and completed."""

from __future__ import annotations

from typing import Any

from aosplan import units as q
from aosplan.errors import RequestError
from aosplan.models.signatures import FALSE_ALARMS, PERSON_M, SIGNATURES

PERSON = "person"

DEFAULT_SIGNATURE = "thermal-dawn"

NUMBERS = ("contrast", "canopy_offset", "crown_share")
"""Options that are a signature of one's own, all of them together."""

OPTIONS = ("signature", *NUMBERS, "false_alarms")
"""Options that go with ``--find``."""

SEARCH = ("find", *OPTIONS)
"""All options of a search."""

SMALLEST_M, LARGEST_M = 0.1, 10.0
"""Sides of a target."""

LARGEST_CONTRAST = 1000.0


def target_name(value: Any, name: str) -> str:
    """``person``, or width and length in metres, such as ``0.5x1.7``."""
    text = str(value).strip().lower().replace("×", "x")
    if text == PERSON:
        return text
    sides = text.split("x")
    if len(sides) != 2:
        raise RequestError(
            f"{name} {q.shown(value)} is not person and not WxL in metres",
            "give person (0.5 x 1.7 m, lying), or width and length such as 2x4",
        )
    width, length = sorted(q.positive(side, name, unit="m") for side in sides)
    for side in (width, length):
        if not SMALLEST_M <= side <= LARGEST_M:
            raise RequestError(
                f"{name} {q.shown(value)}: a side of {side:g} m is not between {SMALLEST_M:g} and "
                f"{LARGEST_M:g} m"
            )
    return f"{width:g}x{length:g}"


def target_m(name: str) -> tuple[float, float]:
    """Width and length [m] of what `target_name` returns."""
    if name == PERSON:
        return PERSON_M
    width, length = (float(side) for side in name.split("x"))
    return width, length


def radiance(value: Any, name: str) -> float:
    """A radiance in units of the spread between occluders."""
    found = q.number(value, name)
    if abs(found) > LARGEST_CONTRAST:
        raise RequestError(
            f"{name} {q.shown(value)} is beyond {LARGEST_CONTRAST:g}",
            "it counts in units of the spread between occluders, not in degrees or grey values",
        )
    return found


def contrast(value: Any, name: str) -> float:
    """A contrast: a radiance that is not zero."""
    found = radiance(value, name)
    if found == 0.0:
        raise RequestError(f"{name} 0: a target like the ground cannot be found")
    return found


def false_alarms(value: Any, name: str) -> float:
    """False alarms a hectare."""
    found = q.positive(value, name)
    if not 1e-6 <= found <= 100.0:
        raise RequestError(f"{name} {q.shown(value)} a hectare is not between 1e-06 and 100")
    return found


def completed(values: dict[str, Any]) -> dict[str, Any]:
    """Defaults of the options that go with ``--find``.

    Parameters
    ----------
    values
        ``find`` and `OPTIONS`, None where they are not given.

    Returns
    -------
    dict
        What is to be filled in.

    Raises
    ------
    RequestError
        Where they are given without ``--find``, or contradict each other.
    """
    given = {name: "--" + name.replace("_", "-") for name in OPTIONS if values[name] is not None}
    if values["find"] is None:
        if given:
            raise RequestError(
                f"{' and '.join(given.values())} without --find",
                "give --find person, or --find WxL in metres",
            )
        return {}
    own = [given[name] for name in NUMBERS if name in given]
    if own and "signature" in given:
        raise RequestError(
            f"--signature and {' and '.join(own)} say the same thing twice", "keep one of them"
        )
    if own and len(own) < len(NUMBERS):
        missing = ["--" + name.replace("_", "-") for name in NUMBERS if name not in given]
        raise RequestError(
            f"{' and '.join(own)} without {' and '.join(missing)}",
            "a signature has a contrast, an offset of the canopy and a share of whole crowns; "
            "or take --signature " + ", ".join(SIGNATURES),
        )
    found: dict[str, Any] = {"false_alarms": values["false_alarms"] or FALSE_ALARMS}
    if not own:
        found["signature"] = values["signature"] or DEFAULT_SIGNATURE
    return found
