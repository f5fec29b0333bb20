"""Positions from a CSV file: where photos were, or would be, taken."""

from __future__ import annotations

import csv
import io

from aosplan.errors import RequestError
from aosplan.files import read_bytes
from aosplan.quantities import number

NAMES = (("east_m", "north_m"), ("x_m", "y_m"), ("x", "y"), ("east", "north"))
"""Names that the two columns may have."""

FARTHEST_M = 1e9
"""No position is farther from its origin."""


def read_positions(path: str) -> list[tuple[float, float]]:
    """Positions [m] from a CSV with a header, such as aosplan's own waypoints.

    Raises
    ------
    RequestError
        Where there is no header with two known columns, no row, or a row without two numbers;
        the message names the line.
    """
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RequestError(f"'{path}' is not UTF-8 text (byte {error.start})") from None
    reader = csv.reader(io.StringIO(text, newline=""))
    try:
        header = [name.strip().lower() for name in next(reader, [])]
        pair = next((pair for pair in NAMES if set(pair) <= set(header)), None)
        if pair is None:
            raise RequestError(
                f"'{path}' has no columns east_m and north_m, or x and y",
                "the first line names the columns, separated by commas",
            )
        columns = [header.index(name) for name in pair]
        points = [
            _position(row, columns, f"'{path}', line {reader.line_num}:") for row in reader if row
        ]
    except csv.Error as error:
        raise RequestError(f"'{path}', line {reader.line_num}: {error}") from None
    if not points:
        raise RequestError(f"'{path}' holds no positions")
    return points


def _position(row: list[str], columns: list[int], place: str) -> tuple[float, float]:
    if len(row) <= max(columns):
        raise RequestError(f"{place} {len(row)} values are too few")
    x, y = (number(row[column], f"{place} value") for column in columns)
    if max(abs(x), abs(y)) > FARTHEST_M:
        raise RequestError(f"{place} {x:g}, {y:g} is farther than {FARTHEST_M:g} m")
    return x, y
