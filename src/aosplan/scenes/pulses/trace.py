"""The path of each pulse through the voxels, from above the canopy to its last return.

A path is a polyline that starts above the canopy on the line to the sensor and goes from return to
return.  `paths_to_ground` extends it to the ground.  The path is cut into pieces that are 2 m high.
The height of the ground is evaluated at each cut, because the voxels follow the ground.  Within a
piece, the intersections with all voxel faces are sorted.  Each length between two intersections is
therefore in exactly one voxel, and a path ends exactly at its last return.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.scenes.voxels import FACE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from aosplan.scenes.pulses.grouping import Pulses
    from aosplan.scenes.pulses.returns import Returns

    Floats = NDArray[np.float64]

PIECE_M = 2.0
"""Along a path, the height of the ground is evaluated each time the path has risen or fallen by
this height.
"""

PIECES_AT_ONCE = 1 << 16
"""Number of lengths within voxels that are processed at once."""


class VoxelGrid(NamedTuple):
    """Voxels above the ground of a plot.

    Attributes
    ----------
    ground_m
        Shape (rows + 1, columns + 1): z of the ground at the corners of the columns.
    voxel_m
        Edge length of a voxel.
    slices
        Number of slices of voxels.
    cut_m
        Height below which lengths are ignored.
    size_m
        Size of the plot along x and y.  The plot may fill the last row and column only partly.
    """

    ground_m: NDArray[np.float32]
    voxel_m: float
    slices: int
    cut_m: float
    size_m: tuple[float, float]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Slices, rows and columns."""
        return self.slices, self.ground_m.shape[0] - 1, self.ground_m.shape[1] - 1

    def heights_m(self, xyz_m: Floats) -> Floats:
        """Height above the ground, shape (n,). For a point outside the plot, the ground at the
        nearest point of the edge is used.
        """
        rows, columns = self.shape[1:]
        x = np.clip(xyz_m[0] / self.voxel_m + FACE, 0.0, columns)
        y = np.clip(xyz_m[1] / self.voxel_m + FACE, 0.0, rows)
        column = np.minimum(x.astype(np.intp), columns - 1)
        row = np.minimum(y.astype(np.intp), rows - 1)
        x -= column
        y -= row
        corner = row * (columns + 1) + column
        flat = self.ground_m.ravel()
        low = flat[corner] * (1.0 - x) + flat[corner + 1] * x
        corner += columns + 1
        high = flat[corner] * (1.0 - x) + flat[corner + 1] * x
        heights: Floats = xyz_m[2] - (low * (1.0 - y) + high * y)
        return heights

    def inside(self, xyz_m: Floats) -> NDArray[np.bool_]:
        """Mask of the points that are above the plot and not beside it."""
        x, y = xyz_m[0], xyz_m[1]
        within: NDArray[np.bool_] = (x >= 0.0) & (x <= self.size_m[0])
        within &= (y >= 0.0) & (y <= self.size_m[1])
        return within

    def cells(self, x_m: Floats, y_m: Floats, height_m: Floats) -> NDArray[np.intp]:
        """Flat index of the voxel that contains each point.  It is -1 outside the volume and below
        the cut.
        """
        slices, rows, columns = self.shape
        column = np.floor(x_m / self.voxel_m + FACE).astype(np.intp)
        row = np.floor(y_m / self.voxel_m + FACE).astype(np.intp)
        level = np.floor(height_m / self.voxel_m + FACE).astype(np.intp)
        cell = (level * rows + row) * columns + column
        outside = (column < 0) | (column >= columns) | (row < 0) | (row >= rows)
        outside |= (height_m < self.cut_m) | (level >= slices)
        cell[outside] = -1
        return cell


class Paths(NamedTuple):
    """Straight pieces of the paths of pulses, with heights above the ground.

    Attributes
    ----------
    owner
        Shape (L,): index of the pulse of each piece.
    start, end
        Shape (3, L): x, y and height above the ground [m] of both ends of each piece.
    stretch
        Shape (L,): true length of the piece divided by the distance between `start` and `end`.
    weight
        Shape (L,): share of the pulse's energy that has not yet been intercepted on this piece.
    """

    owner: NDArray[np.intp]
    start: Floats
    end: Floats
    stretch: Floats
    weight: Floats


class Lengths(NamedTuple):
    """Lengths of paths within voxels: the index of the piece, the index of the voxel, and the true
    length, each of shape (n,).
    """

    piece: NDArray[np.intp]
    cell: NDArray[np.intp]
    length_m: Floats


def points_at_height(points: Floats, to_sensor: Floats, grid: VoxelGrid, height_m: float) -> Floats:
    """For each of `points`, the point on its line to the sensor at a given height above the ground,
    shape (3, P).
    """
    found = points.copy()
    upward = np.maximum(to_sensor[2], 0.05)
    for _ in range(4):
        found += to_sensor * ((height_m - grid.heights_m(found)) / upward)
    return found


def paths_to_hits(
    returns: Returns,
    pulses: Pulses,
    energy: Floats,
    to_sensor: Floats,
    grid: VoxelGrid,
) -> Paths:
    """Paths from above the canopy through all returns, with the energy that remains on each piece.

    Parameters
    ----------
    returns, pulses
        The pulses.
    energy
        Shape (n,): energy of each return.
    to_sensor
        Shape (3, P): unit vectors from the pulses to the sensor.
    grid
        The voxels.
    """
    lengths = pulses.stop - pulses.first
    owner = np.repeat(np.arange(len(pulses)), lengths)
    starts = np.cumsum(lengths) - lengths
    member = np.arange(owner.size) + np.repeat(pulses.first - starts, lengths)
    end = returns.xyz_m[:, member]
    begin = np.empty_like(end)
    begin[:, 1:] = end[:, :-1]
    begin[:, starts] = _entries(returns.xyz_m[:, pulses.first], to_sensor, grid)
    taken = energy[member]
    before = np.cumsum(taken) - taken
    since = before - np.repeat(before[starts], lengths)
    # If earlier returns are missing because the cloud was clipped, a path starts with the energy of
    # the returns that are present.
    whole = np.bincount(owner, taken, len(pulses))
    left = np.repeat(whole, lengths) - since
    return _cut(owner, begin, end, left, grid)


def paths_to_ground(returns: Returns, pulses: Pulses, to_sensor: Floats, grid: VoxelGrid) -> Paths:
    """Straight paths from above the canopy to the ground, with weight 1."""
    foot = points_at_height(returns.xyz_m[:, pulses.last], to_sensor, grid, 0.0)
    entry = _entries(foot, to_sensor, grid)
    return _cut(np.arange(len(pulses)), entry, foot, np.ones(len(pulses)), grid)


def _entries(points: Floats, to_sensor: Floats, grid: VoxelGrid) -> Floats:
    """For each point, the place above the canopy on its line to the sensor. A point that is already
    above the canopy is returned unchanged.
    """
    top = points_at_height(points, to_sensor, grid, grid.slices * grid.voxel_m)
    entries: Floats = np.where(top[2] > points[2], top, points)
    return entries


def _cut(
    owner: NDArray[np.intp], begin: Floats, end: Floats, weight: Floats, grid: VoxelGrid
) -> Paths:
    """Cut the legs of paths into pieces of limited height. The heights of both ends of a piece are
    converted to heights above the ground.
    """
    count = np.ceil(np.abs(begin[2] - end[2]) / PIECE_M).astype(np.intp)
    np.maximum(count, 1, out=count)
    leg = np.repeat(np.arange(count.size), count)
    place = np.arange(leg.size) - np.repeat(np.cumsum(count) - count, count)
    step = ((end - begin) / count)[:, leg]
    start = begin[:, leg] + step * place
    stop = start + step
    true_m = np.sqrt((step * step).sum(axis=0))
    start[2], stop[2] = grid.heights_m(start), grid.heights_m(stop)
    # A piece is removed if both its ends are below the cut, above the volume, or on the same side
    # beside the plot.
    slices, rows, columns = grid.shape
    high = np.array([columns, rows, slices])[:, np.newaxis] * grid.voxel_m
    low = np.array([0.0, 0.0, grid.cut_m])[:, np.newaxis]
    useful = ~(((start < low) & (stop < low)) | ((start >= high) & (stop >= high))).any(axis=0)
    useful &= weight[leg] > 1e-9
    start, stop, leg = start[:, useful], stop[:, useful], leg[useful]
    across = stop - start
    apparent = np.sqrt((across * across).sum(axis=0))
    stretch = np.divide(true_m[useful], apparent, out=np.zeros_like(apparent), where=apparent > 0.0)
    return Paths(owner[leg], start, stop, stretch, weight[leg])


def lengths_in_voxels(paths: Paths, grid: VoxelGrid) -> Iterator[Lengths]:
    """Yield the lengths of paths within voxels, in blocks of several pieces.

    Lengths outside the volume are left out.
    """
    # From here on, the unit of length is the edge of a voxel. The cut is treated as an additional
    # face between voxels.
    start, end = paths.start / grid.voxel_m + FACE, paths.end / grid.voxel_m + FACE
    crossings = (np.abs(np.floor(end) - np.floor(start))).sum(axis=0).astype(np.intp) + 2
    bounds = np.cumsum(crossings)
    begin = 0
    while begin < bounds.size:
        done = bounds[begin - 1] if begin else 0
        stop = max(int(np.searchsorted(bounds, done + PIECES_AT_ONCE, side="right")), begin + 1)
        part = _lengths(start[:, begin:stop], end[:, begin:stop], paths.stretch[begin:stop], grid)
        yield part._replace(piece=part.piece + begin)
        begin = stop


def _lengths(start: Floats, end: Floats, stretch: Floats, grid: VoxelGrid) -> Lengths:
    pieces = start.shape[1]
    across = end - start
    keys = [np.arange(pieces, dtype=np.float64)]
    cut = grid.cut_m / grid.voxel_m + FACE
    for axis in range(3):
        low = np.floor(np.minimum(start[axis], end[axis])).astype(np.intp)
        faces = np.floor(np.maximum(start[axis], end[axis])).astype(np.intp) - low
        of = np.repeat(np.arange(pieces), faces)
        face = np.arange(of.size) - np.repeat(np.cumsum(faces) - faces, faces) + low[of] + 1
        place = (face - start[axis, of]) / across[axis, of]
        keys.append(of + np.clip(place, 0.0, 1.0 - 1e-9))
    crosses = np.flatnonzero((start[2] < cut) != (end[2] < cut))
    place = (cut - start[2, crosses]) / across[2, crosses]
    keys.append(crosses + np.clip(place, 0.0, 1.0 - 1e-9))
    key = np.sort(np.concatenate(keys))
    piece = key.astype(np.intp)
    begin = key - piece
    stop = np.ones_like(begin)
    same = piece[1:] == piece[:-1]
    stop[:-1][same] = begin[1:][same]
    middle = 0.5 * (begin + stop)
    slices, rows, columns = grid.shape
    step = across[:, piece]
    x, y, z = start[:, piece] + step * middle
    length = (stop - begin) * np.sqrt((across * across).sum(axis=0))[piece]
    length *= stretch[piece] * grid.voxel_m
    column, row, level = (np.floor(each).astype(np.intp) for each in (x, y, z))
    good = (x >= 0.0) & (x < columns) & (y >= 0.0) & (y < rows) & (z >= cut) & (z < slices)
    good &= length > 0.0
    cell = (level * rows + row) * columns + column
    return Lengths(piece[good], cell[good], length[good])
