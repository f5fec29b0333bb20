"""Conversion of the metric quantities in a line of text to feet, inches, miles, acres and miles per
hour.

Only tables are converted, and only if the environment variable ``AOSPLAN_UNITS`` is ``imperial``.
Options, files and JSON documents are always metric.
"""

from __future__ import annotations

import math
import os
import re

from aosplan.errors import RequestError
from aosplan.units import FOOT_M

VARIABLE = "AOSPLAN_UNITS"

_UNITS = {
    "cm": ("in", 1.0 / 2.54),
    "m": ("ft", 1.0 / FOOT_M),
    "km": ("mi", 1000.0 / (5280.0 * FOOT_M)),
    "m/s": ("mph", 3600.0 / (5280.0 * FOOT_M)),
    "m²": ("ft²", 1.0 / FOOT_M**2),
    "ha": ("acres", 1e4 / (43560.0 * FOOT_M**2)),
}

_NUMBER = r"-?\d[\d,]*(?:\.\d+)?"

_QUANTITY = re.compile(
    rf"(?<![\w.])({_NUMBER}(?: (?:x|to|of) {_NUMBER})*) ({'|'.join(sorted(_UNITS, key=len)[::-1])})(?![\w/²])"
)
"""Matches one number, or several numbers with a common unit: ``19.6 x 16.8 m``."""


def is_imperial() -> bool:
    """Whether tables show imperial units.

    Raises
    ------
    RequestError
        If the variable is neither ``metric`` nor ``imperial``.
    """
    value = os.environ.get(VARIABLE, "") or "metric"
    if value not in ("metric", "imperial"):
        raise RequestError(f"{VARIABLE} '{value}' is neither metric nor imperial")
    return value == "imperial"


def imperial(text: str) -> str:
    """Convert the metric quantities in a text.  Each number keeps its number of significant digits,
    but has at least 3.
    """

    def replaced(match: re.Match[str]) -> str:
        unit, factor = _UNITS[match[2]]
        numbers = re.sub(_NUMBER, lambda number: _converted(number[0], factor), match[1])
        return f"{numbers} {unit}"

    return _QUANTITY.sub(replaced, text)


def _converted(number: str, factor: float) -> str:
    plain = number.replace(",", "")
    digits = max(len(plain.lstrip("-0.").replace(".", "")), 3)
    value = factor * float(plain)
    rounded = float(f"{value:.{digits - 1}e}")
    decade = math.floor(math.log10(abs(rounded))) if rounded else 0
    return f"{rounded:,.{max(digits - 1 - decade, 0)}f}"
