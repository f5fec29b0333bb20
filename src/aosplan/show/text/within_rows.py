"""Rows of a plan's table about a search within a time: the best plans within half the time, the
time, and twice the time.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.planning.within_result import WithinResult, WithinRow

OBJECTIVES = {
    "detection": "{:.1%} found",
    "visibility": "V = {:.1%}",
    "contrast": "contrast {:.3g}",
    "samples": "N = {:.0f}",
    "aperture": "extent {:.1f} m",
    "time": "{:.0f} s",
}
"""Text of each objective in the table."""


def within_rows(answer: WithinResult) -> Iterator[tuple[str, str]]:
    """Yield heading and text of each row."""
    for index, row in enumerate(answer.rows):
        first, second = row_text(row, answer.asked.optimize)
        yield "Within" if index == 0 else "", first
        if second:
            yield "", second


def row_text(row: WithinRow, objective: str) -> tuple[str, str]:
    """Text with the objective and the flight of the best plan within a time."""
    start = f"{row.minutes:.4g} min: "
    if row.timed is None or row.value is None:
        return start + "no plan is possible", ""
    shape, way, _ = row.timed.candidate
    along_m, across_m = shape.along * way.altitude_m, shape.across * way.altitude_m
    value = OBJECTIVES[objective].format(abs(row.value))
    how = "while flying" if way.inputs.flight.trigger == "distance" else "at stops"
    flights = "" if row.timed.flights == 1 else f" in {row.timed.flights} flights"
    minutes = math.ceil(row.timed.time_s / 6.0) / 10.0
    apart = (
        f"{along_m:.1f}"
        if shape.samples == shape.columns and along_m == across_m
        else (f"{along_m:.1f} x {across_m:.1f}")
    )
    return (
        f"{start}{value} with {row.timed.sites:,} photos {how}, {minutes:g} min{flights}",
        f"{shape.samples} photos of each point, {apart} m apart, from {way.altitude_m:.4g} m",
    )
