"""Which sites of a lattice an area needs, and what they show of it: the coverage rule.

A *window* is the grid of a plan, R rows by C columns of sites with N of them in use.  Repeated
without end it is a lattice of pitch p_x along the heading and p_y across it.  **A point is
covered where the rectangle C p_x by R p_y around it, borders included, holds at least N sites.**
That rectangle is the aperture plus one pitch: the least that holds C x R lattice sites wherever
the point lies.  Its sites are within half of it of the point on each axis, so the point is in
all their images where the footprint is no smaller than the rectangle.

The lattice divides the ground into cells p_x by p_y, each around the middle of one placement of
the window; a point's nearest placement lies within its rectangle.  So an area needs the sites of
every placement whose cell it reaches into, and no others: each point then sees the very pattern
that was planned, trimmed sites included, from at most half a pitch off its middle.  What remains
after sites were dropped is *counted*, cell by cell: the C x R sites around a cell are the same for
all points in it.

Clear ground needs one site whose image it is in.  Sites flown for the canopy beside it serve;
for the rest, cells that one image contains whole are taken greedily, strip by strip.

Distances of less than `SLACK` pitches count as nothing.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely

from aosplan.areas.cell_runs import CellRuns, runs_of, united
from aosplan.errors import RequestError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.areas.cell_runs import Whole
    from aosplan.grid.patterns import Pattern

    Points = NDArray[np.float64]

MOST_CELLS = 2**60
"""Cells of a lattice, of any number that fits in 64 bits."""

SLACK = 1e-9
"""Relative to the pitch: a cell that an area enters by less is not entered."""


class Window(NamedTuple):
    """The grid that every point has to see, in sites and metres.

    `used` has a run (first, last column) for each stretch of sites of each row, as
    (row, first, last).
    """

    rows: int
    columns: int
    samples: int
    used: tuple[tuple[int, int, int], ...]
    pitch_m: tuple[float, float]

    @property
    def size_m(self) -> tuple[float, float]:
        """The rectangle that the rule is about, along and across the heading."""
        return self.columns * self.pitch_m[0], self.rows * self.pitch_m[1]


def window_of(pattern: Pattern, pitch_m: tuple[float, float]) -> Window:
    """The window of a pattern of sites."""
    columns = pattern.columns
    numbers = np.array(sorted(row * (columns + 1) + column for row, column in pattern.sites()))
    runs = runs_of(numbers.astype(np.int64))
    used = tuple(
        (start // (columns + 1), start % (columns + 1), (stop - 1) % (columns + 1))
        for start, stop in zip(runs.start.tolist(), runs.stop.tolist(), strict=True)
    )
    return Window(pattern.rows, columns, pattern.samples, used, pitch_m)


class Lattice(NamedTuple):
    """Where cells lie: (row, column) is the number row · stride + column.

    x runs along the heading and y to its right; `corner_m` is the corner of cell (0, 0) with
    the smallest x and y.
    """

    corner_m: tuple[float, float]
    pitch_m: tuple[float, float]
    stride: int

    def middles(self, numbers: Whole) -> Points:
        """Shape (n, 2): x and y of the middles of cells."""
        rows, columns = np.divmod(numbers, self.stride)
        return np.column_stack(
            [
                self.corner_m[0] + (columns + 0.5) * self.pitch_m[0],
                self.corner_m[1] + (rows + 0.5) * self.pitch_m[1],
            ]
        )

    def boxes(self, cells: CellRuns) -> Any:
        """A rectangle for every run of cells."""
        rows, first = np.divmod(cells.start, self.stride)
        x = self.corner_m[0] + first * self.pitch_m[0]
        y = self.corner_m[1] + rows * self.pitch_m[1]
        length = (cells.stop - cells.start) * self.pitch_m[0]
        return shapely.box(x, y, x + length, y + self.pitch_m[1])

    def moved(self, x_pitches: float, y_pitches: float) -> Lattice:
        """The same cells, elsewhere."""
        return self._replace(
            corner_m=(
                self.corner_m[0] + x_pitches * self.pitch_m[0],
                self.corner_m[1] + y_pitches * self.pitch_m[1],
            )
        )


def centred_lattice(shape: Any, whole: Any, window: Window, margin: int) -> Lattice:
    """A lattice of placement cells, centred on a shape.

    Its rows have room for all of `whole`, which the shape is a part of, and `margin` columns
    on both sides.

    Raises
    ------
    RequestError
        If its cells are more than can be numbered.
    """
    x_low, y_low, x_high, y_high = shapely.bounds(shape).tolist()
    left, lower, right, upper = shapely.bounds(whole).tolist()
    x_pitch, y_pitch = window.pitch_m
    columns = math.ceil((x_high - x_low) / x_pitch - SLACK)
    rows = math.ceil((y_high - y_low) / y_pitch - SLACK)
    before = math.ceil((x_low - left) / x_pitch) + margin
    stride = before + columns + math.ceil((right - x_high) / x_pitch) + window.columns + margin
    if stride * ((upper - lower) / y_pitch + margin) > MOST_CELLS:
        raise RequestError(f"the area is too large for sites {x_pitch:.4g} m apart")
    return Lattice(
        (
            0.5 * (x_low + x_high) - (0.5 * columns + before) * x_pitch,
            0.5 * (y_low + y_high) - 0.5 * rows * y_pitch,
        ),
        window.pitch_m,
        stride,
    )


def entered(shape: Any, lattice: Lattice) -> CellRuns:
    """Cells into which a shape reaches.

    They are those that its border passes through, and those between the border's crossings of
    the middle line of each row: a cell without border in it is inside or outside as a whole.
    V edges that cross R rows take V + R steps.
    """
    rings = shapely.get_rings(shapely.get_parts(shape))
    points, ring = shapely.get_coordinates(rings, return_index=True)
    points = (points - lattice.corner_m) / lattice.pitch_m
    start, stop = points[:-1], points[1:]
    same = ring[:-1] == ring[1:]
    upwards = (start[:, 1] <= stop[:, 1])[:, None]
    lower, upper = np.where(upwards, start, stop)[same], np.where(upwards, stop, start)[same]

    first = np.floor(lower[:, 1] + SLACK).astype(np.int64)
    edge, row = _repeated(first, np.ceil(upper[:, 1] - SLACK).astype(np.int64))
    ends = np.sort(
        [_x_at(lower[edge], upper[edge], row), _x_at(lower[edge], upper[edge], row + 1.0)], axis=0
    )
    border = _cells(row, ends[0], ends[1], lattice.stride)

    first = np.ceil(lower[:, 1] - 0.5).astype(np.int64)
    edge, row = _repeated(first, np.ceil(upper[:, 1] - 0.5).astype(np.int64))
    crossing = _x_at(lower[edge], upper[edge], row + 0.5)
    order = np.lexsort((crossing, row))
    crossing, row = crossing[order], row[order]
    inner = _cells(row[::2], crossing[::2], crossing[1::2], lattice.stride)
    return united(*(np.concatenate(both) for both in zip(border, inner, strict=True)))


def _repeated(first: Whole, stop: Whole) -> tuple[Whole, Whole]:
    """Each index, and each whole number from its `first` to before its `stop`."""
    count = np.maximum(stop - first, 0)
    index = np.repeat(np.arange(len(count)), count)
    return index, np.arange(len(index)) - np.repeat(np.cumsum(count) - count - first, count)


def _x_at(lower: Points, upper: Points, y: NDArray[Any]) -> NDArray[np.float64]:
    """Where edges are at a height, or at their ends where they do not reach it."""
    rise = upper[:, 1] - lower[:, 1]
    share = (y - lower[:, 1]) / np.where(rise > 0.0, rise, 1.0)
    share = np.where(rise > 0.0, np.clip(share, 0.0, 1.0), y > lower[:, 1])
    # Weighted so that both ends come out as they are.
    x: NDArray[np.float64] = (1.0 - share) * lower[:, 0] + share * upper[:, 0]
    return x


def _cells(
    row: Whole, left: NDArray[np.float64], right: NDArray[np.float64], stride: int
) -> tuple[Whole, Whole]:
    """Runs of the cells of rows that stretches of x enter; what lies on a border enters none."""
    first = np.floor(left + SLACK).astype(np.int64)
    stop = np.ceil(right - SLACK).astype(np.int64)
    kept = stop > first
    return (row * stride + first)[kept], (row * stride + stop)[kept]


def sites_for(placements: CellRuns, window: Window, stride: int) -> CellRuns:
    """The sites of every placement of a window; a placement's number is that of its first site."""
    return placements.dilated(
        (row * stride + first, row * stride + last) for row, first, last in window.used
    )


def looks(sites: Whole, placements: Whole, window: Window, stride: int) -> Whole:
    """How many of some sites lie in the rectangle around each placement, by counting."""
    count = np.zeros(len(placements), np.int64)
    for row in range(window.rows):
        start = placements + row * stride
        count += np.searchsorted(sites, start + window.columns) - np.searchsorted(sites, start)
    return count


def image_cells(footprint_m: tuple[float, float], pitch_m: tuple[float, float]) -> tuple[int, int]:
    """Cells around a site, columns and rows, that its image contains whole; both odd."""
    columns, rows = (
        2 * math.floor(0.5 * (size / pitch - 1.0) + SLACK) + 1
        for size, pitch in zip(footprint_m, pitch_m, strict=True)
    )
    return columns, rows


def seen_cells(sites: CellRuns, image: tuple[int, int], stride: int) -> CellRuns:
    """Cells that the image of some site contains whole."""
    columns, rows = image
    return sites.dilated(
        (row * stride - columns // 2, row * stride + columns // 2)
        for row in range(-(rows // 2), rows // 2 + 1)
    )


def sites_seeing(cells: CellRuns, image: tuple[int, int], stride: int) -> Whole:
    """Few sites such that each cell is in the image of one, chosen greedily strip by strip."""
    columns, rows = image
    row, first = np.divmod(cells.start, stride)
    last = (cells.stop - 1) % stride
    chosen: list[int] = []
    index = 0
    while index < len(row):
        upper = row[index]
        after = int(np.searchsorted(row, upper + rows))
        strip = united(first[index:after], last[index:after] + 1)
        covered = -stride
        for start, stop in zip(strip.start.tolist(), strip.stop.tolist(), strict=True):
            left = max(start, covered)
            number = max(-(-(stop - left) // columns), 0)
            chosen += [
                int(upper + rows // 2) * stride + left + columns // 2 + step * columns
                for step in range(number)
            ]
            covered = max(covered, left + number * columns)
        index = after
    return np.array(sorted(chosen), np.int64)
