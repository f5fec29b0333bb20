"""Formatting of the numbers of a plan's document for the page.  They are rounded and have units.
The exact number is in a tooltip.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from aosplan.show.figures.style import printable
from aosplan.units import duration, percent

if TYPE_CHECKING:
    from collections.abc import Callable

LONGEST = 120
"""Largest number of characters of a name that are shown directly."""


def _length(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


def spacing(value: float) -> str:
    """Text of a length, rounded to centimetres, or to significant digits if it is very short or
    very long.
    """
    return f"{value:.2f} m" if value == 0.0 or 0.1 <= value < 1000.0 else f"{_length(value)} m"


KINDS: dict[str, Callable[[Any], str]] = {
    "m": lambda value: f"{_length(value)} m",
    "b": spacing,
    "cm": lambda value: f"{100.0 * value:.3g} cm",
    "ha": lambda value: f"{value / 1e4:,.4g} ha",
    "m/s": lambda value: f"{value:.3g} m/s",
    "deg": lambda value: f"{value:.4g}°",
    "px": lambda value: f"{value:.3g} px",
    "%": percent,
    "time": duration,
    "count": lambda value: f"{value:,}",
    "plain": lambda value: f"{value:.4g}",
}
"""Function that formats a number, by kind of number."""


class NumberFormatter:
    """Formats numbers of a document, which are named by their place in the document:
    ``number("visibility.expected", "%")``.
    """

    def __init__(self, document: dict[str, Any]) -> None:
        self.document = document

    def __call__(self, place: str, kind: str) -> Markup:
        """The number as text, in an element that also contains all its digits.

        Parameters
        ----------
        place
            Names, and indices in lists, joined by dots.
        kind
            One of `KINDS`.
        """
        value: Any = self.document
        for name in place.split("."):
            value = value[int(name)] if isinstance(value, list) else value[name]
        if value is None:
            return Markup("–")
        return Markup('<data value="{}" data-of="{}">{}</data>').format(
            value, place, KINDS[kind](value)
        )


def long(text: str, most: int = LONGEST) -> bool:
    """Whether a text is too long to be shown directly."""
    return len(text) > most


def short(text: str, most: int = LONGEST) -> str:
    """The beginning of a text in one line, without unprintable characters."""
    shown = printable(text[:most])
    return f"{shown}…" if long(text, most) else shown
