"""Occlusion of a sample of the targets of a large plot.

Predictions need two shares of the targets: the share that is hidden in a view, and the share that
is hidden in both of two views. These shares are means over the targets of a plot. A tile with sides
of 500 m has 64 million targets. The means over a sample of a million targets differ by less than
0.001.

**Lattices.** The sample consists of sixteen lattices. Each has one target in every M-th voxel along
both axes. The lattices differ in the voxel at which they start and in the position of the target
within its voxel. There are 4 x 4 positions, which represent all parts of a voxel equally.  This
matters for the share of targets that are hidden in both of two views if the cameras of these views
are close together. M is odd, or 2.  The period of the lattices is then rarely equal to the distance
between planted rows of trees.  Lattices have a smaller error than randomly drawn targets, because
neighbouring targets are correlated.

**Views are shifts**, as in `aosplan.scenes.occlusion`. A lattice that is shifted by n voxels meets
every M-th voxel, beginning with voxel n mod M. Each slice is therefore sorted once into M x M
lattices of voxels. Along y, eight voxels of a lattice are packed into one octet. A view is then a
bitwise OR of contiguous pieces of memory.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from aosplan.scenes.hidden_counts import popcount
from aosplan.scenes.occlusion import Occlusion, PlotWindow, checked_positions

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from aosplan.scenes.occlusion import ViewKind, Words
    from aosplan.scenes.voxels import VoxelVolume

    Octets = NDArray[np.uint8]

SAMPLE = 1_000_000
"""Smallest number of targets in a sample, if the plot has enough voxels."""

FEW_TARGETS = 4 * SAMPLE
"""If a plot has at most this number of targets, all of them are computed."""

ABREAST = 4
"""The lattices start in a square of voxels. This is the number of lattices along each side of the
square.
"""

LATTICES = ABREAST**2
"""Number of all lattices."""


class SampledOcclusion:
    """Occlusion of a sample of the targets of one plot, for telecentric cameras at one altitude.

    Parameters
    ----------
    occlusion
        Occlusion of all targets of the plot.
    volume
        The voxels of the plot.
    sample
        Smallest number of targets.
    """

    def __init__(self, occlusion: Occlusion, volume: VoxelVolume, sample: int) -> None:
        self._all = occlusion
        _, rows, columns = volume.occupied.shape
        self._plot = rows, columns
        step = math.isqrt(max(LATTICES * rows * columns // sample, 1))
        # The step has to be odd, except if it is 2, because the lattices then contain all voxels.
        self._step = step if step == 2 else step - 1 + step % 2
        row, column = np.divmod(np.arange(LATTICES), ABREAST)
        # For each lattice, along x and y: the position within a voxel [targets], and the first
        # voxel. The positions in each row and in each column of the lattices are all different.
        places = np.column_stack([column + row, column + 2 * row]) % ABREAST
        self._within = ((places + 0.5) * (occlusion.targets_per_voxel / ABREAST)).astype(np.intp)
        self._first = np.column_stack([column, row]) * self._step // ABREAST
        self._across, self._down = (-(-length // self._step) for length in (columns, rows))
        # Octets are along y. Lattices are padded along x to whole 64-bit words.
        self._height = -(-self._down // 8)
        self._padded = -(-self._across // 8) * 8
        whole = PlotWindow(0, 0, self.rows, self.columns)
        self._valid = self._octets_of(whole)
        self.targets = int(popcount(self.mask_of(whole)))

    @property
    def rows(self) -> int:
        """Number of rows of all targets of the plot.  Windows are rectangles of these targets."""
        return self._all.rows

    @property
    def columns(self) -> int:
        """Number of columns of all targets of the plot."""
        return self._all.columns

    @property
    def targets_per_voxel(self) -> int:
        """Number of targets along each side of a voxel, before sampling."""
        return self._all.targets_per_voxel

    @property
    def targets_per_cell(self) -> int:
        """Number of targets along each side of a cell in the arrays of `unpack`.  A cell has one
        target of each lattice.
        """
        return ABREAST

    @property
    def words(self) -> int:
        """Number of 8-byte words of a mask."""
        return int(self._valid.size) // 8

    def targets_in(self, window: PlotWindow) -> int:
        """Number of the sample's targets in a window; 0 if the window does not contain a whole
        cell.
        """
        if min(self._cells(window)[1]) <= 0:
            return 0
        east, north = self._inside(window)
        return int((north.sum(axis=1) * east.sum(axis=1)).sum())

    def mask_of(self, window: PlotWindow) -> Words:
        """The sample's targets in a window as a mask, shape (words,)."""
        words: Words = self._octets_of(window).reshape(-1).view(np.uint64)
        return words

    def unpack(self, masks: Words, window: PlotWindow | None = None) -> NDArray[np.bool_]:
        """Convert masks to boolean arrays, which are true for hidden targets.

        The arrays have the shape (N, 4 rows, 4 columns), where `rows` and `columns` are numbers of
        cells. The side of a cell is the distance between neighbouring targets of a lattice. A cell
        has one target of each lattice, near its true position. Cells that are not completely in the
        plot, or in the window if there is one, are left out.
        """
        octets = masks.view(np.uint8).reshape(len(masks), LATTICES, self._height, self._padded)
        first, (rows, columns) = self._cells(window or PlotWindow(0, 0, self.rows, self.columns))
        bits = np.unpackbits(octets, axis=2, bitorder="little")
        cells = bits[:, :, first[0] : first[0] + rows, first[1] : first[1] + columns]
        square = cells.reshape(len(masks), ABREAST, ABREAST, rows, columns).transpose(0, 3, 1, 4, 2)
        return square.reshape(len(masks), ABREAST * rows, ABREAST * columns).astype(np.bool_)

    def _cells(self, window: PlotWindow) -> tuple[tuple[int, int], tuple[int, int]]:
        """The cells that are completely in a window: first row, first column, number of rows,
        number of columns.
        """
        size = self._step * self.targets_per_voxel
        first = -(-window.row // size), -(-window.column // size)
        end = (window.row + window.rows) // size, (window.column + window.columns) // size
        return first, (end[0] - first[0], end[1] - first[1])

    def _inside(self, window: PlotWindow) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """For each lattice, the places along x that are in a window, and the places along y, as
        masks.
        """
        lengths = self._padded, 8 * self._height
        bounds = (window.column, window.columns), (window.row, window.rows)
        inside = []
        for axis, (length, (low, count)) in enumerate(zip(lengths, bounds, strict=True)):
            voxels = self._first[:, axis, np.newaxis] + self._step * np.arange(length)
            targets = voxels * self.targets_per_voxel + self._within[:, axis, np.newaxis]
            inside.append((low <= targets) & (targets < low + count))
        return inside[0], inside[1]

    def _octets_of(self, window: PlotWindow) -> Octets:
        """The sample's targets in a window as octets, shape (lattices, height, padded)."""
        east, north = self._inside(window)
        bits = np.packbits(north, axis=1, bitorder="little")
        octets: Octets = bits[:, :, np.newaxis] * east[:, np.newaxis]
        return octets

    def masks(self, positions_m: ArrayLike) -> Words:
        """Targets of the sample that are hidden from each camera.

        Parameters
        ----------
        positions_m
            Shape (N, 2), east and north: offsets from the target.

        Returns
        -------
        ndarray
            Shape (N, words), as `Occlusion.masks` returns them.
        """
        offsets = checked_positions(positions_m)
        views = len(offsets)
        if views == 0:
            return np.zeros((0, self.words), dtype=np.uint64)
        places, lows, spans = self._places(offsets)
        span_x, span_y = (spans // self._step).tolist()
        stride, octets = self._padded + span_x, self._height + span_y // 8 + 1
        size = (self._height - 1) * stride + self._padded
        hidden = np.zeros((views, LATTICES, self._height * stride), dtype=np.uint8)
        hits = [one[:size] for one in hidden.reshape(views * LATTICES, -1)]
        shift, phase = np.divmod(places, self._step)
        octet, bit = np.divmod(shift[..., 1], 8)
        # One number encodes the tile and the number of bits by which it is moved.
        tiles = (phase[..., 1] * self._step + phase[..., 0]) * 8 + bit
        keys = tiles * (octets * stride) + octet * stride + shift[..., 0]
        for level, plane in self._all.slices:
            slice_tiles = _Tiles(plane, lows[level], self._step, (stride, octets))
            for met, hit in zip(keys[level].reshape(len(hits), -1).tolist(), hits, strict=True):
                for key in set(met):
                    tile, start = divmod(key, octets * stride)
                    np.bitwise_or(hit, slice_tiles[tile][start : start + size], hit)
        masks = hidden.reshape(views, LATTICES, self._height, stride)[..., : self._padded]
        words: Words = (masks & self._valid).reshape(views, -1).view(np.uint64)
        return words

    def _places(
        self, offsets: NDArray[np.float64]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """Voxels in which rays cross each slice.  The rays go from the views to the first target of
        each lattice.

        Returns
        -------
        tuple
            Three arrays: voxels relative to the lowest voxel of each slice, shape (slices, views,
            lattices, 3, 2); the lowest voxels, shape (slices, 2); and the largest relative voxel,
            shape (2,).
        """
        shifts = self._all.meetings(offsets)[:, :, np.newaxis]
        lattice = np.s_[np.newaxis, np.newaxis, :, np.newaxis]
        places = (shifts + self._within[lattice]) // self._all.targets_per_voxel
        places += self._first[lattice]
        lows = places.min(axis=(1, 2, 3))
        places -= lows[:, np.newaxis, np.newaxis, np.newaxis]
        # The plot is periodic, so a shift by a whole plot changes nothing and is left out.
        places %= self._plot[::-1]
        return places, lows, places.max(axis=(0, 1, 2, 3))


class _Tiles:
    """One slice, sorted into flat lattices of voxels that are moved by 0 to 7 bits.  Each tile is
    computed when it is needed.
    """

    def __init__(
        self,
        plane: NDArray[np.bool_],
        low: NDArray[np.intp],
        step: int,
        shape: tuple[int, int],
    ) -> None:
        stride, octets = shape
        rows = np.arange(low[1], low[1] + 8 * octets * step)
        columns = np.arange(low[0], low[0] + stride * step)
        near = plane.take(rows, axis=0, mode="wrap") if _wraps(rows, len(plane)) else plane[rows]
        self._plane, self._columns = near, columns % plane.shape[1]
        self._step, self._stride, self._octets = step, stride, octets
        self._packed: dict[int, Octets] = {}
        self._tiles: dict[int, Octets] = {}

    def __getitem__(self, number: int) -> Octets:
        if number not in self._tiles:
            self._tiles[number] = self._made(number)
        return self._tiles[number]

    def _made(self, number: int) -> Octets:
        phase, bit = divmod(number, 8)
        if bit:
            plain = self[phase * 8]
            moved = plain >> np.uint8(bit)
            moved[: -self._stride] |= plain[self._stride :] * np.uint8(1 << (8 - bit))
            return moved
        row, column = divmod(phase, self._step)
        if row not in self._packed:
            # Every `step`-th row of the plane. Eight of these rows are packed into an octet.
            apart = self._plane[row :: self._step].view(np.uint8)
            octets = apart[0::8].copy()
            for place in range(1, 8):
                octets |= apart[place::8] << np.uint8(place)
            self._packed[row] = octets
        tile: Octets = self._packed[row].take(self._columns[column :: self._step], axis=1).ravel()
        return tile


def _wraps(indices: NDArray[np.intp], length: int) -> bool:
    return bool(indices[0] < 0 or indices[-1] >= length)


def occlusion_of(
    volume: VoxelVolume,
    altitude_m: float,
    *,
    view: ViewKind = "telecentric",
    targets_per_voxel: int | None = None,
    focal_height_m: float = 0.0,
) -> Occlusion | SampledOcclusion:
    """Occlusion of all targets of a plot, or of a sample of the targets if the plot is large.

    Perspective views cannot be computed as shifts. On a large plot, they therefore have fewer
    targets per voxel instead of a sample.

    The parameters are those of `Occlusion`.
    """
    occlusion = Occlusion(
        volume,
        altitude_m,
        view=view,
        targets_per_voxel=targets_per_voxel,
        focal_height_m=focal_height_m,
    )
    if occlusion.targets <= FEW_TARGETS:
        return occlusion
    if view == "telecentric":
        return SampledOcclusion(occlusion, volume, SAMPLE)
    _, rows, columns = volume.occupied.shape
    fewer = max(math.isqrt(FEW_TARGETS // (rows * columns)), 1)
    return Occlusion(
        volume,
        altitude_m,
        view=view,
        targets_per_voxel=min(fewer, occlusion.targets_per_voxel),
        focal_height_m=focal_height_m,
    )
