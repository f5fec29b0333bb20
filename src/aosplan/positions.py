"""Positions where photos were, or would be, taken, in metres."""

from __future__ import annotations

import csv
import io
import math
import os

from aosplan.errors import RequestError
from aosplan.files import read_bytes
from aosplan.quantities import number

NAMES = (("east_m", "north_m"), ("x_m", "y_m"), ("x", "y"), ("east", "north"))
"""Names that the two columns may have."""

FARTHEST_M = 1e9
"""No position is farther from its origin."""


def read_positions(path: str) -> list[tuple[float, float]]:
    """Positions [m] from a CSV with a header, such as aosplan's own waypoints, or from a mission.

    Places of ``.waypoints``, ``.plan`` and ``.geojson`` files count east and north from the first.

    Raises
    ------
    RequestError
        Where there is no header with two known columns, no row, or a row without two numbers;
        the message names the line.
    """
    from aosplan.places import SUFFIXES, read_places

    if os.path.splitext(path)[1].lower() in SUFFIXES:
        from aosplan.geodesy import FARTHEST_M as PLACED_M
        from aosplan.geodesy import to_local

        latitudes, longitudes, _ = zip(*read_places(path), strict=True)
        east, north = to_local((latitudes[0], longitudes[0]), latitudes, longitudes)
        farthest = max(map(math.hypot, east, north))
        if farthest > PLACED_M:
            raise RequestError(
                f"'{path}': positions are {farthest / 1000.0:.4g} km from the first, more than "
                f"{PLACED_M / 1000.0:g} km"
            )
        return list(zip(east, north, strict=True))
    points = [_position(where, *values) for where, values in read_columns(path, NAMES)]
    if not points:
        raise RequestError(f"'{path}' holds no positions")
    return points


def read_columns(
    path: str, pairs: tuple[tuple[str, str], ...], thirds: tuple[str, ...] = ()
) -> list[tuple[str, list[str]]]:
    """Two columns of a CSV, and a third that may be missing: each row's place in it, and its values.

    Rows whose column ``photo`` says false are left out.

    Raises
    ------
    RequestError
        Where there is no such header, or a row is too short.
    """
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RequestError(f"'{path}' is not UTF-8 text (byte {error.start})") from None
    reader = csv.reader(io.StringIO(text, newline=""))
    try:
        header = [name.strip().lower() for name in next(reader, [])]
        pair = next((pair for pair in pairs if set(pair) <= set(header)), None)
        if pair is None:
            wanted = ", or ".join(f"{one} and {other}" for one, other in pairs[::2])
            raise RequestError(
                f"'{path}' has no columns {wanted}",
                "the first line names the columns, separated by commas",
            )
        third = [name for name in thirds if name in header][:1]
        columns = [header.index(name) for name in (*pair, *third)]
        photo = header.index("photo") if "photo" in header else None
        rows = []
        for row in reader:
            where = f"'{path}', line {reader.line_num}:"
            if row and len(row) <= max(*columns, photo or 0):
                raise RequestError(f"{where} {len(row)} values are too few")
            if row and (photo is None or row[photo].strip().lower() not in {"false", "0"}):
                rows.append((where, [row[column] for column in columns]))
    except csv.Error as error:
        raise RequestError(f"'{path}', line {reader.line_num}: {error}") from None
    return rows


def _position(where: str, *values: str) -> tuple[float, float]:
    x, y = (number(value, f"{where} value") for value in values)
    if max(abs(x), abs(y)) > FARTHEST_M:
        raise RequestError(f"{where} {x:g}, {y:g} is farther than {FARTHEST_M:g} m")
    return x, y
