"""Parsing and printing of quantities: numbers and text become floats in metres, degrees, seconds.

One of these functions parses every value that a user gives on the command line, in a file or in
Python. Units such as feet and knots are therefore converted everywhere, and a mistake causes the
same message everywhere. Examples of mistakes are a percentage instead of a fraction, text instead
of a number, and infinity.
"""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

FOOT_M = 0.3048

_OWN_UNITS = {"m": "metres", "deg": "degrees", "s": "seconds", "m/s": "metres per second"}
_FOREIGN = {
    "ft": (FOOT_M, "m"),
    "feet": (FOOT_M, "m"),
    "foot": (FOOT_M, "m"),
    "'": (FOOT_M, "m"),
    "yd": (0.9144, "m"),
    "cm": (0.01, "m"),
    "km": (1000.0, "m"),
    "in": (0.0254, "m"),
    "mph": (0.44704, "m/s"),
    "km/h": (1 / 3.6, "m/s"),
    "kn": (1852.0 / 3600.0, "m/s"),
    "ms": (0.001, "s"),
    "min": (60.0, "s"),
}


def number(value: Any, name: str, unit: str = "") -> float:
    """Parse a finite number, which may be followed by its unit: ``"40m"``, ``"130ft"``.

    Parameters
    ----------
    value
        A number in `unit`, or text.  The text may end with `unit` or with a unit that is converted
        to `unit`.
    name
        Name of the value in messages.
    unit
        The unit of the result.

    Raises
    ------
    RequestError
        If the value is not a finite number, or if its unit belongs to another quantity.
    """
    if isinstance(value, str):
        return _from_text(value.strip(), name, unit)
    try:
        result = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        result = math.nan
    if not math.isfinite(result):
        raise RequestError(f"{name} {shown(value)} is not a finite number", _unit_hint(unit))
    return result


def positive(value: Any, name: str, unit: str = "") -> float:
    """A number greater than 0."""
    result = number(value, name, unit)
    if result <= 0.0:
        raise RequestError(f"{name} {shown(value)} is not above zero", _unit_hint(unit))
    return result


def at_least_zero(value: Any, name: str, unit: str = "") -> float:
    """A number that is at least 0."""
    result = number(value, name, unit)
    if result < 0.0:
        raise RequestError(f"{name} {shown(value)} is below zero", _unit_hint(unit))
    return result + 0.0  # Adding zero turns -0.0 into 0.0; -0.0 would be printed with its sign.


def whole(value: Any, name: str) -> int:
    """A whole number that is at least 1."""
    result = number(value, name)
    if result < 1.0 or result != math.floor(result) or result >= 2**53:
        raise RequestError(f"{name} {shown(value)} is not a whole number from 1")
    return int(result)


def index(value: Any, name: str) -> int:
    """A whole number that is at least 0."""
    result = number(value, name)
    if result < 0.0 or result != math.floor(result) or result >= 2**53:
        raise RequestError(f"{name} {shown(value)} is not a whole number from 0")
    return int(result)


def share(value: Any, name: str) -> float:
    """A share between 0 and 1.  If the value is text, it may be a percentage such as ``98%``."""
    text = value.strip() if isinstance(value, str) else ""
    result = number(text[:-1], name) / 100.0 if text.endswith("%") else number(value, name)
    if not 0.0 <= result <= 1.0:
        raise RequestError(f"{name} {shown(value)} is not between 0 and 1", percent_hint(value))
    return result


def share_above_zero(value: Any, name: str) -> float:
    """A share that is greater than 0 and at most 1."""
    result = share(value, name)
    if result == 0.0:
        raise RequestError(f"{name} {shown(value)} is not above zero")
    return result


def one_of(choices: Iterable[str]) -> Callable[[Any, str], str]:
    """A parser that accepts one of the given words."""
    allowed = tuple(choices)

    def parse(value: Any, name: str) -> str:
        if value not in allowed:
            raise RequestError(
                f"{name} {shown(value)} is not one of {', '.join(allowed)}",
                nearest_hint(str(value), allowed),
            )
        return str(value)

    return parse


def flag(value: Any, name: str) -> bool:
    """True or false, as a Boolean or as text."""
    if isinstance(value, str) and value.strip().lower() in ("true", "false"):
        return value.strip().lower() == "true"
    if not isinstance(value, bool):
        raise RequestError(f"{name} {shown(value)} is not true or false")
    return value


def or_best(parse: Callable[[Any, str], Any]) -> Callable[[Any, str], Any]:
    """A parser that also accepts the word ``best``: the program then chooses the value."""

    def parsed(value: Any, name: str) -> Any:
        return "best" if value == "best" else parse(value, name)

    return parsed


def word(value: Any, name: str) -> str:
    """Text that is not empty."""
    if not isinstance(value, str) or not value.strip():
        raise RequestError(f"{name} {shown(value)} is not a name")
    if "\0" in value:
        raise RequestError(f"{name} {shown(value)} contains a zero byte")
    return value


def latitude_longitude(value: Any, name: str) -> tuple[float, float]:
    """A place on earth: the text ``LAT,LON`` in degrees, or two numbers.

    Raises
    ------
    RequestError
        If the value does not consist of two numbers in their ranges.  If the latitude is beyond 90
        degrees but is a valid longitude, the hint suggests that latitude and longitude are swapped.
    """
    parts = value.split(",") if isinstance(value, str) else value
    if not isinstance(parts, (list, tuple)) or len(parts) != 2:
        raise RequestError(
            f"{name} {shown(value)} is not a latitude and a longitude",
            "write LAT,LON in degrees, such as 48.3358,14.3261",
        )
    parts = [part.strip() if isinstance(part, str) else part for part in parts]
    latitude = number(parts[0], f"latitude of {name}", "deg")
    longitude = number(parts[1], f"longitude of {name}", "deg")
    if abs(latitude) > 90.0:
        swapped = abs(latitude) <= 180.0 and abs(longitude) <= 90.0
        raise RequestError(
            f"{name} {shown(value)}: latitude {latitude:g} is not between -90 and 90",
            f"give the latitude first: {parts[1]},{parts[0]}" if swapped else "",
        )
    if abs(longitude) > 180.0:
        raise RequestError(
            f"{name} {shown(value)}: longitude {longitude:g} is not between -180 and 180"
        )
    return latitude, longitude


def percent_hint(value: Any) -> str:
    """The hint for a percentage that is written as a plain number; empty for other values."""
    try:
        percent = float(value)
    except (TypeError, ValueError, OverflowError):
        return ""
    return f"write {percent:g}%" if 1.0 < percent <= 100.0 else ""


def nearest_hint(name: str, known: Iterable[str]) -> str:
    """The hint with the most similar known name; empty if no known name is similar."""
    import difflib

    close = difflib.get_close_matches(name.lower()[:100], list(known), n=1, cutoff=0.5)
    return f"did you mean {close[0]}?" if close else ""


def preset_hint(name: str, titles: Mapping[str, str]) -> str:
    """The hint that lists the presets whose name or title resembles a word; empty if there is no
    such preset.
    """
    word = _squashed(name)
    parts = [each for each in titles if each.startswith(f"{name.lower()}-")]
    if not parts and len(word) > 2:
        parts = [
            each for each, title in titles.items() if word in (_squashed(each), _squashed(title))
        ] or [
            each
            for each, title in titles.items()
            if word in _squashed(each) or word in _squashed(title)
        ]
    if not parts:
        return nearest_hint(name, titles)
    return f"did you mean {' or '.join(parts[:4])}?"


def _squashed(text: str) -> str:
    return "".join(letter for letter in text.lower() if letter.isalnum())


def _from_text(text: str, name: str, unit: str) -> float:
    digits = text.rstrip("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ/'°% ")
    suffix = text[len(digits) :].strip()
    try:
        result = float(digits) if "_" not in digits else math.nan
    except ValueError:
        result = math.nan
    if math.isfinite(result) and suffix in ("", unit):
        return result
    factor, own = _FOREIGN.get(suffix.lower(), (math.nan, ""))
    if math.isfinite(result * factor) and own == unit:
        return result * factor
    raise RequestError(f"{name} {shown(text)} is not a finite number", _unit_hint(unit))


def _unit_hint(unit: str) -> str:
    return f"give a number of {_OWN_UNITS[unit]}" if unit in _OWN_UNITS else ""


def exact_share(value: float | str | Decimal | Fraction, name: str) -> Fraction:
    """A share as the exact number that the user wrote: ``0.98``, ``"0.98"``, ``"98%"``.

    Raises
    ------
    RequestError
        If the value is not a finite number.
    """
    text = str(value).strip() if isinstance(value, (str, Decimal)) else None
    try:
        if isinstance(value, bool):
            exact = None
        else:
            exact = Fraction(value) if text is None else _fraction(text)
    except (ArithmeticError, ValueError, TypeError):
        exact = None
    if exact is None:
        raise RequestError(
            f"{name} {shown(value if text is None else text)} is not a number",
            "give a share such as 0.98 or 98%",
        )
    return exact


def _fraction(text: str) -> Fraction | None:
    """The exact value of a decimal number or a percentage; None if it has more than about 400
    digits.
    """
    if len(text) > 400 or "_" in text:
        return None
    digits = Decimal(text[:-1].rstrip() if text.endswith("%") else text)
    # Fraction would expand an exponent such as 1e-999999999 into all of its digits.
    if not digits.is_finite() or abs(digits.adjusted()) > 400:
        return None
    return Fraction(digits) / (100 if text.endswith("%") else 1)


def shown(value: Any) -> str:
    """A value for a message: one line of printable characters, shortened if it is long."""
    try:
        text = value if isinstance(value, str) else repr(value)
    except ValueError:  # Python does not convert an integer with thousands of digits to text.
        text = f"a number of {value.bit_length()} bits"
    text = text.encode("unicode_escape").decode() if not text.isprintable() else text
    return f"'{text[:57]}...'" if len(text) > 60 else f"'{text}'"


def percent(value: float) -> str:
    """A share in per cent with one decimal.

    A share just below 100 % has more decimals, because it must not be rounded to ``100 %``.
    """
    shown = 100.0 * value
    decimals = 1
    while decimals < 9 and value < 1.0 and float(f"{shown:.{decimals}f}") >= 100.0:
        decimals += 1
    return f"{shown:.{decimals}f} %"


def duration(seconds: float) -> str:
    """A duration in hours, minutes and seconds. Leading units that are zero are left out."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    parts = ((hours, "h"), (minutes, "min"), (rest, "s"))
    first = next((place for place, part in enumerate(parts) if part[0]), 2)
    return " ".join(f"{value:,} {unit}" for value, unit in parts[first:])


def length(metres: float) -> str:
    """A length with two significant digits in metres, or three in kilometres."""
    return f"{metres / 1e3:.3g} km" if metres >= 1e3 else f"{float(f'{metres:.2g}'):g} m"


def rounded_up(value: float, digits: int = 4) -> str:
    """A number rounded up to a few significant digits, as text."""
    text = f"{value:.{digits}g}"
    if 0.0 < value < math.inf and float(text) < value * (1.0 - 1e-13):
        unit = 10.0 ** (math.floor(math.log10(value)) + 1 - digits)
        text = f"{math.ceil(value / unit) * unit:.{digits}g}"
    return f"{float(text):g}"
