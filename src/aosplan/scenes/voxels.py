"""Voxels: representation of a stand as a grid of cells that are either opaque or empty.

A `VoxelVolume` is made from a point cloud (`aosplan.scenes.files.point_cloud`), from a canopy
height raster, or by a generator of forests.  The measured model, the simulator and the statistics
of `aosplan.scenes.occluder_statistics` use it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.units import rounded_up

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from aosplan.scenes.opacity import Opacity

MAX_VOXELS = 2_000_000_000
# The limit of columns is needed because the arrays of the ground take as much memory as a few dozen
# slices.
MAX_COLUMNS = MAX_VOXELS // 100
# Tolerance for rounding errors, in voxels. A point on the face between two voxels belongs to the
# upper voxel.
FACE = 1e-6
PLATE_TARGET_M = 0.06
"""Approximate distance between targets below plates.  It equals the distance between targets below
cubes of 0.25 m.
"""


class HalfStand(NamedTuple):
    """Occupied voxels, drawn from one half of the pulses.

    Attributes
    ----------
    measured
        Voxels drawn from the attenuation that was found, in the same way as the voxels of the whole
        volume.
    dense
        Voxels drawn in the same way, but with dense foliage wherever no pulse of either half has
        passed.
    """

    measured: NDArray[np.bool_]
    dense: NDArray[np.bool_]


PARTS_A_SIDE = 16
"""Number of positions along each side of a plot at which a typical part is searched."""


@dataclass(frozen=True, eq=False)
class VoxelVolume:
    """The occupied voxels above a plot.

    The plot is periodic: beyond each edge, it continues with the opposite side. All rays from every
    target therefore cross a canopy. A plot should be at least twice as wide as the horizontal
    length of the most oblique ray in the canopy.

    Parameters
    ----------
    occupied
        Shape (slices, rows, columns).  Slice k is from ``k * slice_height_m`` to
        ``(k + 1) * slice_height_m`` above the ground; rows are along y (north), columns along x
        (east).  Bare ground has no slices.
    voxel_m
        Edge length of a voxel along x and y.
    x_min_m, y_min_m
        Outer corner of the voxel in row 0 and column 0, in the coordinates of the source.
    min_height_m
        Height below which occluders were ignored.
    points
        Number of points of the cloud that were used; 0 if the volume is not from a point cloud.
    ground
        Method by which the ground was found: ``class``, ``filter``, ``normalized`` or ``raster``.
    warnings
        Pairs of a code and a sentence for the user of the results.
    source
        Name of the source of the volume, for messages.
    assumed
        Assumptions that were made instead of measurements.
    slice_m
        Thickness of a slice if it differs from the edge length of a voxel.  The voxels are then
        plates without side faces: a ray meets one plate in each slice, and slanted rays meet
        further plates, in proportion to the length of their path.  If it is None, the voxels are
        cubes.
    cell_voxels
        Number of voxels along each side of a plate.  The second plate that a ray meets in a slice
        is this number of voxels beside the first.
    opacity
        Record of the method by which the opacity was found, for volumes from point clouds.
    bounds
        The voxels for two extreme assumptions: the first return of each pulse has all its energy,
        or the last return has all of it.  These are the densest and the most open stand that are
        consistent with the pulses.
    halves
        The stand from each random half of the pulses. Positions that are chosen with one half are
        predicted with the other half. None if the halves were not requested.
    place
        Latitude and longitude [deg] of the middle of the plot, if the source has a location.
    turn_deg
        Direction of increasing rows at this place, clockwise from true north.

    Raises
    ------
    RequestError
        If the array is not a boolean volume with at least one column, or if a length is outside its
        domain.
    """

    occupied: NDArray[np.bool_]
    voxel_m: float
    x_min_m: float = 0.0
    y_min_m: float = 0.0
    min_height_m: float = 0.0
    points: int = 0
    ground: str = "normalized"
    warnings: tuple[tuple[str, str], ...] = ()
    source: str = ""
    assumed: str = ""
    slice_m: float | None = None
    opacity: Opacity | None = None
    bounds: tuple[NDArray[np.bool_], NDArray[np.bool_]] | None = None
    place: tuple[float, float] | None = None
    turn_deg: float = 0.0
    halves: tuple[HalfStand, HalfStand] | None = None
    cell_voxels: int = 1

    def __post_init__(self) -> None:
        where = f"voxel volume '{self.source}'" if self.source else "voxel volume"
        shape = self.occupied.shape
        if self.occupied.dtype != np.bool_ or len(shape) != 3 or 0 in shape[1:]:
            raise RequestError(
                f"{where}: occupied is {self.occupied.dtype} of shape {shape}, not bool of shape "
                "(slices, rows, columns) with at least one row and column"
            )
        if not (np.isfinite(self.voxel_m) and self.voxel_m > 0.0):
            raise RequestError(f"{where}: voxel_m {self.voxel_m:g} is not a positive number")
        if not (np.isfinite(self.min_height_m) and self.min_height_m >= 0.0):
            raise RequestError(f"{where}: min_height_m {self.min_height_m:g} is not zero or above")
        if self.slice_m is not None and not (np.isfinite(self.slice_m) and self.slice_m > 0.0):
            raise RequestError(f"{where}: slice_m {self.slice_m:g} is not a positive number")
        others = [*(self.bounds or ()), *(each for half in self.halves or () for each in half)]
        if any(other.shape != shape or other.dtype != np.bool_ for other in others):
            raise RequestError(f"{where}: the bounds or halves do not have the shape of the volume")

    def of_voxels(self, occupied: NDArray[np.bool_]) -> VoxelVolume:
        """The same volume with other occupied voxels, and without its bounds and halves."""
        return replace(self, occupied=occupied, bounds=None, halves=None)

    @property
    def slice_height_m(self) -> float:
        """Thickness of a slice."""
        return self.voxel_m if self.slice_m is None else self.slice_m

    @property
    def targets_per_voxel(self) -> int:
        """Default number of targets along each side of a voxel."""
        return 4 if self.slice_m is None else max(round(self.voxel_m / PLATE_TARGET_M), 1)

    @property
    def size_m(self) -> tuple[float, float]:
        """Size of the plot along x and y, a whole number of voxels."""
        _, rows, columns = self.occupied.shape
        return columns * self.voxel_m, rows * self.voxel_m

    @property
    def plot_area_m2(self) -> float:
        """Area of the plot."""
        width_m, depth_m = self.size_m
        return width_m * depth_m

    @property
    def points_per_m2(self) -> float:
        """Number of used points per square metre of the plot."""
        return self.points / self.plot_area_m2

    @cached_property
    def slice_densities(self) -> NDArray[np.float64]:
        """Occupied share of each slice, from the ground up, shape (slices,)."""
        _, rows, columns = self.occupied.shape
        counts = [np.count_nonzero(plane) for plane in self.occupied]
        return np.array(counts, dtype=np.float64) / float(rows * columns)

    @property
    def canopy_top_m(self) -> float:
        """Height of the top of the highest occupied voxel above the ground; 0 for bare ground."""
        filled = np.flatnonzero(self.slice_densities)
        return float(filled[-1] + 1) * self.slice_height_m if filled.size else 0.0

    @cached_property
    def column_occupancy(self) -> float:
        """Share p of the columns of voxels that have an occupied voxel, 0 to 1.

        This is the share of the ground that photos from vertically above do not see.
        """
        return float(self.hidden_columns.mean())

    def typical_part(self, size_m: tuple[float, float]) -> VoxelVolume:
        """The part of the plot whose share of occupied columns is nearest to the share of the whole
        plot.

        Parameters
        ----------
        size_m
            Largest size of the part along x and y.  If the plot is not larger, it is the part.
        """
        rows, columns = self.occupied.shape[1:]
        down, across = (
            min(max(int(length / self.voxel_m), 1), count)
            for length, count in zip(size_m[::-1], (rows, columns), strict=True)
        )
        if (down, across) == (rows, columns):
            return self
        total = np.zeros((rows + 1, columns + 1))
        total[1:, 1:] = self.hidden_columns.cumsum(axis=0).cumsum(axis=1)
        row, column = np.meshgrid(
            np.unique(np.linspace(0, rows - down, PARTS_A_SIDE).astype(np.intp)),
            np.unique(np.linspace(0, columns - across, PARTS_A_SIDE).astype(np.intp)),
            indexing="ij",
        )
        hidden = total[row + down, column + across] - total[row, column + across]
        hidden += total[row, column] - total[row + down, column]
        best = np.abs(hidden / (down * across) - self.column_occupancy).argmin()
        south, west = row.flat[best], column.flat[best]
        part = self.of_voxels(self.occupied[:, south : south + down, west : west + across])
        return replace(
            part,
            x_min_m=self.x_min_m + west * self.voxel_m,
            y_min_m=self.y_min_m + south * self.voxel_m,
            place=None,
        )

    @cached_property
    def hidden_columns(self) -> NDArray[np.bool_]:
        """Mask of the columns of voxels that have an occupied voxel, shape (rows, columns)."""
        return np.asarray(self.occupied.any(axis=0))


def fill(
    blocks: Iterable[NDArray[np.float64]],
    ground: NDArray[np.float32],
    cut: float,
    voxel_m: float,
    where: str,
    touched: NDArray[np.bool_] | None = None,
) -> NDArray[np.bool_]:
    """Sort points into voxels above a ground; all lengths except `voxel_m` are in voxels.

    Parameters
    ----------
    blocks
        Arrays of shape (3, n): x and y relative to the outer corner of the plot, and z relative to
        any datum.
    ground
        z of the ground at the corners of the columns, shape (rows + 1, columns + 1); it is
        interpolated bilinearly.
    cut
        Height above the ground below which points are ignored.
    voxel_m
        Edge length of a voxel.
    where
        Name of the volume, for messages.
    touched
        Shape (rows * columns,): set to true for each column with a point at any height.

    Returns
    -------
    ndarray
        Shape (slices, rows, columns), up to the highest occupied slice.

    Raises
    ------
    RequestError
        If the volume needs more than two thousand million voxels.
    """
    rows, columns = ground.shape[0] - 1, ground.shape[1] - 1
    cells = rows * columns
    base = ground[:-1, :-1].ravel()
    east = (ground[:-1, 1:] - ground[:-1, :-1]).ravel()
    north = (ground[1:, :-1] - ground[:-1, :-1]).ravel()
    twist = (ground[1:, 1:] - ground[1:, :-1]).ravel() - east
    occupied = np.zeros(0, dtype=np.bool_)
    slices = 0
    for block in blocks:
        x, y, z = block + FACE
        # All operations are in place and use one type. A block therefore stays in the processor's
        # cache, and NumPy does not need buffers for conversions.
        column, row = np.floor(x), np.floor(y)
        x -= column
        y -= row
        row *= columns
        row += column
        cell = row.astype(np.intp)
        if touched is not None:
            touched[cell] = True
        # The bilinear ground is base + x * east + y * (north + x * twist).
        rise = twist.take(cell).astype(np.float64)
        rise *= x
        rise += north.take(cell).astype(np.float64)
        rise *= y
        x *= east.take(cell).astype(np.float64)
        rise += x
        rise += base.take(cell).astype(np.float64)
        z -= rise
        kept = np.flatnonzero(z >= cut)
        level = z.take(kept).astype(np.intp)
        if level.size == 0:
            continue
        slices = max(slices, int(level.max()) + 1)
        if slices * cells > MAX_VOXELS:
            # From here on, no voxels are filled. The other blocks are only read because the error
            # message below needs the height of the whole stand.
            continue
        if slices * cells > occupied.size:
            # Resizing in place does not copy the array, and the operating system provides new pages
            # only when they are used.
            occupied.resize(slices * cells, refcheck=False)
        level *= cells
        level += cell.take(kept)
        occupied[level] = True
    if slices * cells > MAX_VOXELS:
        raise too_many_voxels((columns * voxel_m, rows * voxel_m, slices * voxel_m), voxel_m, where)
    return occupied.reshape(slices, rows, columns)


def footprint(touched: NDArray[np.bool_], reach: int) -> float:
    """Share of a plot that its points cover, 0 to 1.

    The plot is divided into squares of columns. A square is covered if it contains a point, or if
    it is enclosed by squares with points (for example, above a pond). The covered share of a square
    at the rim is its number of columns with points, divided by the mean number of such columns in
    the squares of the interior.

    Parameters
    ----------
    touched
        Shape (rows, columns): whether a column contains a point.
    reach
        Side of a square in columns, at least 1. It should be large enough for every square inside
        the footprint to contain a point.
    """
    rows, columns = touched.shape
    down, across = np.arange(0, rows, reach), np.arange(0, columns, reach)
    size = np.outer(np.diff(down, append=rows), np.diff(across, append=columns))
    counts = np.add.reduceat(touched.astype(np.int32), down, axis=0)
    full = np.add.reduceat(counts, across, axis=1) / size
    covered: NDArray[np.bool_] = full > 0.0
    if covered.all():
        return 1.0
    from scipy.ndimage import binary_erosion, binary_fill_holes

    covered = np.asarray(binary_fill_holes(covered))
    within = np.asarray(binary_erosion(covered, border_value=1))
    usual = float(full[within].mean()) if within.any() else 1.0
    shares = np.where(within, 1.0, np.minimum(full / usual, 1.0))
    return float((shares * covered * size).sum() / size.sum())


def cells_along(length_m: float, voxel_m: float) -> int:
    """Number of voxels that contain all points along a length, including its two ends."""
    return math.floor(length_m / voxel_m + FACE) + 1


def without_ragged_cells(
    occupied: NDArray[np.bool_], size_m: Sequence[float], voxel_m: float, points: int
) -> NDArray[np.bool_]:
    """Voxels without the last row or column if the points fill it only partly.

    The last row or column is removed if the distance between the last points and its edge is larger
    than the mean distance between points. If it were kept, its empty part would be treated as open
    ground, although it was not measured.

    Parameters
    ----------
    occupied
        Shape (slices, rows, columns).
    size_m
        Extent of the points along x and y, from the corner of the voxels.
    voxel_m
        Edge length of a voxel.
    points
        Number of points.
    """
    spacing_m = voxel_m * math.sqrt(occupied[0].size / points) if len(occupied) else voxel_m
    columns, rows = (
        cells - (cells > 1 and cells * voxel_m - length_m > spacing_m * (1.0 + FACE))
        for cells, length_m in zip(occupied.shape[:0:-1], size_m, strict=False)
    )
    return occupied[:, :rows, :columns]


def fits(size_m: Sequence[float], voxel_m: float) -> bool:
    """Whether a volume of size (x, y, z) stays within the limits."""
    columns, rows, slices = (float(length_m) / voxel_m + 1.0 for length_m in size_m)
    return columns * rows <= MAX_COLUMNS and columns * rows * slices <= MAX_VOXELS


def too_many_voxels(size_m: Sequence[float], voxel_m: float, where: str) -> RequestError:
    """An error for a volume of size (x, y, z) that is too large.  Its hint suggests a possible
    voxel size.
    """
    enough_m = max(voxel_m, 1e-6)
    while not fits(size_m, enough_m):
        enough_m *= 1.1
    width_m, depth_m, height_m = size_m
    return RequestError(
        f"{where} needs too many voxels of {voxel_m:g} m for its {width_m:.4g} x "
        f"{depth_m:.4g} x {height_m:.4g} m",
        f"give --voxel {rounded_up(enough_m, 2)}"
        + (", or use a part of the cloud (--crop)" if where.startswith("point cloud") else ""),
    )
