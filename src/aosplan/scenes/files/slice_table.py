"""Tables of slices (CSV), read as layered scenes."""

from __future__ import annotations

import csv
import os
from functools import partial
from typing import TYPE_CHECKING

from aosplan import units as q
from aosplan.errors import RequestError
from aosplan.files import read_bytes, text_of
from aosplan.scenes.scene import MOST_SLICES, Layer, LayeredScene

if TYPE_CHECKING:
    from collections.abc import Callable

_height = partial(q.at_least_zero, unit="m")
_length = partial(q.positive, unit="m")

COLUMNS: dict[str, Callable[[str, str], float]] = {
    "bottom_m": _height,
    "top_m": _length,
    "density": q.share,
    "occluder_size_m": _length,
}
"""Names of the required columns, and their parsers.  The columns may be in any order, and there may
be others.
"""


def read_slices(path: str) -> LayeredScene:
    """Read a layered scene from a CSV file with a header and one slice per line.

    Lengths are in metres; the density is a share (``0.02`` or ``2%``).  Slices may be in any order
    but must not overlap.

    Raises
    ------
    RequestError
        If the file is not such a table.  The message gives the line and the column.
    """
    text = text_of(read_bytes(path), path)
    rows = csv.reader(text.splitlines(), strict=True)
    try:
        header = [name.strip().lower() for name in next(rows, [])]
        places = _places(header, path)
        layers = []
        for cells in rows:
            if not any(cell.strip() for cell in cells):
                continue
            row = _as_long_as(header, cells)
            if len(row) != len(header):
                raise RequestError(
                    f"'{path}' line {rows.line_num} has {len(row)} cells, but the header has "
                    f"{len(header)}",
                    "separate columns by commas, and use decimal points",
                )
            layers.append(
                Layer(
                    *(
                        read(row[places[name]].strip(), f"'{path}' line {rows.line_num}, {name}")
                        for name, read in COLUMNS.items()
                    )
                )
            )
            if len(layers) > MOST_SLICES:
                raise RequestError(f"'{path}' has more than {MOST_SLICES} slices")
    except csv.Error as error:
        raise RequestError(f"'{path}' line {rows.line_num} is not valid CSV: {error}") from None
    if not layers:
        raise RequestError(f"'{path}' has a header but no slices")
    return LayeredScene(name=os.path.basename(path), layers=tuple(sorted(layers)), source=path)


def _as_long_as(header: list[str], cells: list[str]) -> list[str]:
    """The cells of a row, shortened or extended to the number of cells of the header.

    Some spreadsheets add commas after the last column, or leave out empty cells at the end of a
    row.
    """
    if not any(cell.strip() for cell in cells[len(header) :]):
        cells = cells[: len(header)]
    if not any(header[len(cells) :]):
        cells = cells + [""] * (len(header) - len(cells))
    return cells


def _places(header: list[str], path: str) -> dict[str, int]:
    """Index of each column."""
    if not any(header):
        raise RequestError(f"'{path}' has no header line", f"it reads {','.join(COLUMNS)}")
    for mark, word in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and mark in header[0]:
            raise RequestError(
                f"'{path}' separates its columns by {word}",
                "save it with commas between columns and with decimal points",
            )
    for name in COLUMNS:
        if header.count(name) != 1:
            what = "two columns" if header.count(name) else "no column"
            others = [other for other in header if other and other not in COLUMNS]
            near = q.nearest_hint(name, others).removeprefix("did you mean ").rstrip("?")
            raise RequestError(
                f"'{path}' has {what} {name}",
                (
                    f"its column '{near}' is similar: lengths are in metres (_m), densities "
                    "are shares"
                )
                if near and not header.count(name)
                else f"the header must have the columns {', '.join(COLUMNS)}",
            )
    return {name: header.index(name) for name in COLUMNS}
