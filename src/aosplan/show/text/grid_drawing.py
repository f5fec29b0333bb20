"""Drawings of grids and flights as text.

If there is enough space, each site is one character.  Otherwise the drawing is to scale.  A drawing
to scale has 2 x 4 dots per character, from the Braille block of Unicode.  If only ASCII is
available, each dot is one character.
"""

from __future__ import annotations

import math
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

from aosplan.grid.patterns import Pattern
from aosplan.show.text.terminal import flowed
from aosplan.units import length

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from aosplan.grid.patterns import AnyPattern

WIDTH, HEIGHT = 72, 20
"""Size of the largest drawing, in characters and lines."""

MOST_POINTS = 20_000
"""Largest number of sites that are drawn.  For a longer spiral or flight, only every n-th site is
drawn.
"""

BRAILLE = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bits of the dots of a Braille character (from U+2800 on), by line and column."""


class Marks(NamedTuple):
    """Characters of a drawing."""

    site: str
    first: str
    last: str
    arrow: str


UNICODE, ASCII = Marks("●", "▶", "■", "→"), Marks("o", "S", "E", "->")


def grid_picture(pattern: AnyPattern, *, plain: bool = False, width: int = WIDTH) -> list[str]:
    """Drawing of a grid with a legend. x is to the right and y is downwards.  It is empty for a
    single site.
    """
    if pattern.samples < 2:
        return []
    marks, width = ASCII if plain else UNICODE, min(width, WIDTH)
    legend = [f"{marks.first} first photo", f"{marks.last} last photo", f"{marks.arrow} heading"]
    drawn = _site_by_site(pattern, marks, width)
    if not drawn:
        even = isinstance(pattern, Pattern)
        sites = list(_thinned(pattern, width))
        drawn, step = to_scale(sites, marks, width, plain=plain, even=even)
        legend.append(_scale_text(pattern, step, plain=plain))
    return [*drawn, "", *flowed(legend, width)]


def flight_picture(
    points: Sequence[tuple[float, float]], *, plain: bool = False, width: int = WIDTH
) -> list[str]:
    """Drawing of a flight from above with a legend.  North is at the top.  `points` are metres east
    and north.
    """
    if len(points) < 2:
        return []
    marks, width = ASCII if plain else UNICODE, min(width, WIDTH)
    every = -(-len(points) // MOST_POINTS)
    chosen = [*points[:-1:every], points[-1]]
    drawn, step = to_scale([(x, -y) for x, y in chosen], marks, width, plain=plain)
    legend = [f"{marks.first} first photo", f"{marks.last} last photo", "north is up"]
    legend.append(f"a {'letter' if plain else 'dot'} is {length(step)}")
    return [*drawn, "", *flowed(legend, width)]


def _site_by_site(pattern: AnyPattern, marks: Marks, width: int) -> list[str]:
    """Drawing with one character per site, if it fits.  A baseline is two characters wide, or one
    character wide if the grid is a single line.
    """
    for apart in (2, 1) if pattern.rows == 1 and isinstance(pattern, Pattern) else (2,):
        if pattern.samples > WIDTH * HEIGHT:
            return []
        places = _places(pattern, apart)
        rows, columns = (max(place[axis] for place in places) + 1 for axis in (0, 1))
        if columns <= width and rows <= HEIGHT:
            lines = [[" "] * columns for _ in range(rows)]
            shown = [marks.first, *[marks.site] * (len(places) - 2), marks.last]
            for (row, column), mark in zip(places, shown, strict=True):
                lines[row][column] = mark
            return ["".join(line).rstrip() for line in lines]
    return []


def _places(pattern: AnyPattern, apart: int) -> list[tuple[int, int]]:
    """Positions of the sites in the drawing, as (line, character) in flight order.

    If rows are more than one baseline apart, there is one empty line between them.
    """
    if not isinstance(pattern, Pattern):
        offsets = list(pattern.offsets())
        left, top = (min(offset[axis] for offset in offsets) for axis in (0, 1))
        return [(round(y - top), round(apart * (x - left))) for x, y in offsets]
    lines = 2 if round(pattern.row_pitch) > 1 else 1
    return [(lines * row, apart * column) for row, column in pattern.sites()]


def _thinned(pattern: AnyPattern, width: int) -> Iterable[tuple[float, float]]:
    """Sites in flight order, including the first and the last. If there are more sites than a
    drawing can show, only some of them are returned.
    """
    if not isinstance(pattern, Pattern):
        every = -(-pattern.samples // MOST_POINTS)
        yield from islice(pattern.offsets(), 0, pattern.samples - 1, every)
        yield next(islice(pattern.offsets(), pattern.samples - 1, None))
        return
    gone = set(pattern.removed)
    rows = _spread(pattern.rows, 4 * HEIGHT)
    columns = _spread(pattern.columns, 2 * width)
    yield _end(pattern, gone, 0, range(pattern.columns))
    for row in rows:
        for column in columns:
            if (row, column) not in gone:
                yield float(column), row * pattern.row_pitch
    last = pattern.rows - 1
    backwards = range(pattern.columns)[:: 1 if last % 2 else -1]
    yield _end(pattern, gone, last, backwards)


def _end(
    pattern: Pattern, gone: set[tuple[int, int]], row: int, columns: range
) -> tuple[float, float]:
    """The first site of a row, for a given order of its columns."""
    column = next(column for column in columns if (row, column) not in gone)
    return float(column), row * pattern.row_pitch


def _spread(count: int, most: int) -> list[int]:
    """Indices of all rows, or of at most `most` rows that are evenly spaced."""
    if count <= most:
        return list(range(count))
    return [round(index * (count - 1) / (most - 1)) for index in range(most)]


def to_scale(
    points: Sequence[tuple[float, float]],
    marks: Marks,
    width: int,
    *,
    plain: bool,
    even: bool = False,
) -> tuple[list[str], float]:
    """Draw points to scale, with x to the right and y downwards.  Returns the drawing and the width
    of a dot.

    The first and the last point have special characters. If `even` is true and the unit of length
    is longer than a dot, the unit is drawn as a whole number of dots.
    """
    per_column, per_line = (1, 1) if plain else (2, 4)
    # A character is twice as high as it is wide. A Braille character has four lines and two columns
    # of dots, so the spacing of dots is equal in both directions.
    flat = 2.0 if plain else 1.0
    (left, right), (top, bottom) = ((min(c), max(c)) for c in zip(*points, strict=True))
    step = max(
        (right - left) / (per_column * width - 1), (bottom - top) / flat / (per_line * HEIGHT - 1)
    )
    if step < 1.0:  # For an even spacing, the distance between sites is a whole number of dots.
        step = 1.0 / math.floor(1.0 / step) if even and step > 0.0 else step or 1.0
    cells: dict[tuple[int, int], int] = {}

    def cell(point: tuple[float, float]) -> tuple[int, int, int, int]:
        x, y = round((point[0] - left) / step), round((point[1] - top) / step / flat)
        return y // per_line, x // per_column, y % per_line, x % per_column

    for point in points:
        line, column, low, aside = cell(point)
        cells[line, column] = cells.get((line, column), 0) | BRAILLE[low][aside]
    rows, columns = (max(place[axis] for place in cells) + 1 for axis in (0, 1))
    lines = [[" "] * columns for _ in range(rows)]
    for (line, column), bits in cells.items():
        lines[line][column] = marks.site if plain else chr(0x2800 + bits)
    for point, mark in ((points[-1], marks.last), (points[0], marks.first)):
        line, column = cell(point)[:2]
        lines[line][column] = mark
    return ["".join(line).rstrip() for line in lines], step


def _scale_text(pattern: AnyPattern, step: float, *, plain: bool) -> str:
    """Text with the number of sites that a dot of the drawing represents."""
    dot = "letter" if plain else "dot"
    if not isinstance(pattern, Pattern):
        return f"a {dot} is {step:.2g} baselines"
    along = min(math.ceil(step), pattern.columns)
    across = min(math.ceil(step * (2.0 if plain else 1.0) / pattern.row_pitch), pattern.rows)
    if along == across == 1:
        return f"{dot}s are sites"
    return f"a {dot} is up to {along} x {across} sites"
