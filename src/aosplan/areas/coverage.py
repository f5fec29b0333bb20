"""The coverage rule: the sites of a lattice that an area needs, and the ground that they cover.

A *window* is the grid of a plan: R rows and C columns of sites, N of which are used. A window that
is repeated in all directions gives a lattice, with the pitch p_x along the heading and p_y across
it. **A point is covered if the rectangle of C p_x by R p_y around it, including its border,
contains at least N sites.** Along each axis, the rectangle is one pitch longer than the aperture.
It is the smallest rectangle that contains C x R lattice sites for every position of the point.
Along each axis, the distance between these sites and the point is at most half the side of the
rectangle. If the footprint is at least as large as the rectangle, the images from all these sites
therefore show the point.

The lattice divides the ground into cells of p_x by p_y. A *placement* is one position of the window
on the lattice. Each cell surrounds the centre of one placement. The placement nearest to a point is
inside the point's rectangle. An area needs the sites of those placements whose cells it overlaps.
Each point is then seen from exactly the sites of the planned pattern, including the gaps of trimmed
grids. Along each axis, the point is at most half a pitch away from the centre of the pattern. If
sites are dropped later, the remaining coverage is *counted* cell by cell, because all points of a
cell have the same C x R sites around them.

Clear ground needs one site whose image contains it. This may be a site that is flown for
neighbouring canopy. For the remaining clear ground, sites are added strip by strip. Only cells that
are completely inside an image count as seen.

Distances of less than `SLACK` pitches are treated as zero.
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
"""Largest number of cells of a lattice. The limit exists because the number that identifies a cell
has to fit in 64 bits.
"""

SLACK = 1e-9
"""Tolerance as a share of the pitch. A cell that an area overlaps by less than this is not counted
as overlapped.
"""


class RequiredGrid(NamedTuple):
    """The grid of sites from which every point has to be seen.

    `used` has a tuple (row, first column, last column) for each run of used sites in a row.
    """

    rows: int
    columns: int
    samples: int
    used: tuple[tuple[int, int, int], ...]
    pitch_m: tuple[float, float]

    @property
    def size_m(self) -> tuple[float, float]:
        """Size of the rectangle of the coverage rule, along and across the heading."""
        return self.columns * self.pitch_m[0], self.rows * self.pitch_m[1]


def window_of(pattern: Pattern, pitch_m: tuple[float, float]) -> RequiredGrid:
    """The window of a pattern of sites."""
    columns = pattern.columns
    numbers = np.array(sorted(row * (columns + 1) + column for row, column in pattern.sites()))
    runs = runs_of(numbers.astype(np.int64))
    used = tuple(
        (start // (columns + 1), start % (columns + 1), (stop - 1) % (columns + 1))
        for start, stop in zip(runs.start.tolist(), runs.stop.tolist(), strict=True)
    )
    return RequiredGrid(pattern.rows, columns, pattern.samples, used, pitch_m)


class CellLattice(NamedTuple):
    """Positions of the cells of a lattice.  A cell has the number row · stride + column.

    x is along the heading and y to its right.  `corner_m` is the corner of the cell (0, 0) with the
    smallest x and y.
    """

    corner_m: tuple[float, float]
    pitch_m: tuple[float, float]
    stride: int

    def middles(self, numbers: Whole) -> Points:
        """x and y of the centres of cells, shape (n, 2)."""
        rows, columns = np.divmod(numbers, self.stride)
        return np.column_stack(
            [
                self.corner_m[0] + (columns + 0.5) * self.pitch_m[0],
                self.corner_m[1] + (rows + 0.5) * self.pitch_m[1],
            ]
        )

    def boxes(self, cells: CellRuns) -> Any:
        """One rectangle for each run of cells."""
        rows, first = np.divmod(cells.start, self.stride)
        x = self.corner_m[0] + first * self.pitch_m[0]
        y = self.corner_m[1] + rows * self.pitch_m[1]
        length = (cells.stop - cells.start) * self.pitch_m[0]
        return shapely.box(x, y, x + length, y + self.pitch_m[1])

    def moved(self, x_pitches: float, y_pitches: float) -> CellLattice:
        """The same cells shifted by a number of pitches."""
        return self._replace(
            corner_m=(
                self.corner_m[0] + x_pitches * self.pitch_m[0],
                self.corner_m[1] + y_pitches * self.pitch_m[1],
            )
        )


def centred_lattice(shape: Any, whole: Any, window: RequiredGrid, margin: int) -> CellLattice:
    """A lattice of placement cells that is centred on a shape.

    `whole` contains the shape.  Each row of the lattice is as long as `whole`, and has `margin`
    additional columns on both sides.

    Raises
    ------
    RequestError
        If there are more cells than can be numbered.
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
    return CellLattice(
        (
            0.5 * (x_low + x_high) - (0.5 * columns + before) * x_pitch,
            0.5 * (y_low + y_high) - 0.5 * rows * y_pitch,
        ),
        window.pitch_m,
        stride,
    )


def overlapped_cells(shape: Any, lattice: CellLattice) -> CellRuns:
    """Cells that a shape overlaps.

    These are the cells that the border passes through and, in each row, the cells between the
    intersections of the border with the centre line of the row.  All other cells are completely
    outside.  The computing time is proportional to the number of edges plus the number of rows that
    they cross.
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
    """All pairs of an index i and a whole number from ``first[i]`` to ``stop[i] - 1``, as two
    arrays.
    """
    count = np.maximum(stop - first, 0)
    index = np.repeat(np.arange(len(count)), count)
    return index, np.arange(len(index)) - np.repeat(np.cumsum(count) - count - first, count)


def _x_at(lower: Points, upper: Points, y: NDArray[Any]) -> NDArray[np.float64]:
    """x coordinate of each edge at a given y. For an edge that does not reach this y, the x of its
    nearest end is returned.
    """
    rise = upper[:, 1] - lower[:, 1]
    share = (y - lower[:, 1]) / np.where(rise > 0.0, rise, 1.0)
    share = np.where(rise > 0.0, np.clip(share, 0.0, 1.0), y > lower[:, 1])
    # A weighted mean of the ends is used, because it is exact at both ends.
    x: NDArray[np.float64] = (1.0 - share) * lower[:, 0] + share * upper[:, 0]
    return x


def _cells(
    row: Whole, left: NDArray[np.float64], right: NDArray[np.float64], stride: int
) -> tuple[Whole, Whole]:
    """For each interval of x in a row, the cells that it overlaps, as a run.  An interval that
    only touches a cell does not overlap it.
    """
    first = np.floor(left + SLACK).astype(np.int64)
    stop = np.ceil(right - SLACK).astype(np.int64)
    kept = stop > first
    return (row * stride + first)[kept], (row * stride + stop)[kept]


def sites_for(placements: CellRuns, window: RequiredGrid, stride: int) -> CellRuns:
    """The sites of all given placements of a window.  The number that identifies a placement is the
    number of its first site.
    """
    return placements.dilated(
        (row * stride + first, row * stride + last) for row, first, last in window.used
    )


def site_counts(sites: Whole, placements: Whole, window: RequiredGrid, stride: int) -> Whole:
    """Number of sites in the rectangle around each placement."""
    count = np.zeros(len(placements), np.int64)
    for row in range(window.rows):
        start = placements + row * stride
        count += np.searchsorted(sites, start + window.columns) - np.searchsorted(sites, start)
    return count


def image_cells(footprint_m: tuple[float, float], pitch_m: tuple[float, float]) -> tuple[int, int]:
    """Number of columns and number of rows of the cells that the image of a site contains. Both
    numbers are odd.
    """
    columns, rows = (
        2 * math.floor(0.5 * (size / pitch - 1.0) + SLACK) + 1
        for size, pitch in zip(footprint_m, pitch_m, strict=True)
    )
    return columns, rows


def seen_cells(sites: CellRuns, image: tuple[int, int], stride: int) -> CellRuns:
    """Cells that the image of at least one site contains completely."""
    columns, rows = image
    return sites.dilated(
        (row * stride - columns // 2, row * stride + columns // 2)
        for row in range(-(rows // 2), rows // 2 + 1)
    )


def sites_seeing(cells: CellRuns, image: tuple[int, int], stride: int) -> Whole:
    """Choose a small number of sites whose images together contain all cells. The sites are chosen
    strip by strip.
    """
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
