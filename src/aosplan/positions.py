"""Positions where photos were, or would be, taken, in metres."""

from __future__ import annotations

import csv
import io
import os
from typing import NamedTuple

from aosplan.errors import RequestError
from aosplan.files import read_bytes
from aosplan.units import number

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
    from aosplan.postflight.positions import (
        SUFFIXES,
        local_m,
        read_places,
    )

    if os.path.splitext(path)[1].lower() in SUFFIXES:
        places = read_places(path)
        return list(zip(*local_m(places, places[0][:2], path, "the first"), strict=True))
    points = positions_of(read_csv(path))
    if not points:
        raise RequestError(f"'{path}' holds no positions")
    return points


class Table(NamedTuple):
    """A CSV: the names of its columns, and its rows, each with its place in the file.

    Rows whose column ``photo`` says false are left out.
    """

    path: str
    header: list[str]
    rows: list[tuple[str, list[str]]]

    def pair(self, pairs: tuple[tuple[str, str], ...]) -> tuple[str, str] | None:
        """The first pair of names that are both columns."""
        return next((pair for pair in pairs if set(pair) <= set(self._names)), None)

    def columns(
        self, pairs: tuple[tuple[str, str], ...], thirds: tuple[str, ...] = ()
    ) -> list[tuple[str, list[str]]]:
        """Two columns, and a third that may be missing: each row's place in the file, and its values.

        Raises
        ------
        RequestError
            Where there are no such columns, or a row is too short.
        """
        pair = self.pair(pairs)
        if pair is None:
            wanted = ", or ".join(f"{one} and {other}" for one, other in pairs[::2])
            raise RequestError(
                f"'{self.path}' has no columns {wanted}",
                "the first line names the columns, separated by commas",
            )
        third = [name for name in thirds if name in self._names][:1]
        columns = [self._names.index(name) for name in (*pair, *third)]
        for where, row in self.rows:
            if len(row) <= max(columns):
                raise RequestError(f"{where} {len(row)} values are too few")
        return [(where, [row[column] for column in columns]) for where, row in self.rows]

    @property
    def _names(self) -> list[str]:
        return [name.strip().lower() for name in self.header]


def read_csv(path: str) -> Table:
    """A CSV with a header.

    Raises
    ------
    RequestError
        Where it is none; the message names the line.
    """
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RequestError(f"'{path}' is not UTF-8 text (byte {error.start})") from None
    reader = csv.reader(io.StringIO(text, newline=""))
    rows = []
    try:
        header = next(reader, [])
        names = [name.strip().lower() for name in header]
        photo = names.index("photo") if "photo" in names else None
        for row in reader:
            where = f"'{path}', line {reader.line_num}:"
            if row and len(row) <= (photo or 0):
                raise RequestError(f"{where} {len(row)} values are too few")
            if row and (photo is None or row[photo].strip().lower() not in {"false", "0"}):
                rows.append((where, row))
    except csv.Error as error:
        raise RequestError(f"'{path}', line {reader.line_num}: {error}") from None
    return Table(path, header, rows)


def positions_of(table: Table) -> list[tuple[float, float]]:
    """Positions [m] from a table's columns."""
    return [_position(where, *values) for where, values in table.columns(NAMES)]


def _position(where: str, *values: str) -> tuple[float, float]:
    x, y = (number(value, f"{where} value") for value in values)
    if max(abs(x), abs(y)) > FARTHEST_M:
        raise RequestError(f"{where} {x:g}, {y:g} is farther than {FARTHEST_M:g} m")
    return x, y
