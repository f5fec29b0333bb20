"""Occlusion of a sample of the targets of a large plot.

The share of targets that a view hides, and the share that two views both hide, are means over the
targets of a plot.  A tile of 500 m has 64 million targets, and a million of them give the same
means to within 0.001.

**Lattices.**  The sample consists of four lattices.  Each has one target in every M-th voxel along
both axes.  The lattices differ in the voxel at which they start and in the position of the target
within its voxel, so that all parts of a voxel are represented equally.  M is odd, or 2, so that the
lattices are not in step with trees that are planted in rows.  Because neighbouring targets are
correlated, lattices have a smaller error than randomly drawn targets.

**Views are shifts**, as in `aosplan.scenes.occlusion`.  A lattice that is shifted by n voxels meets
the voxels n mod M of every M-th, so each slice is sorted into its M x M lattices of voxels once.
These are packed eight to an octet along y, and a view is an OR of contiguous pieces of memory.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from aosplan.scenes.occlusion import Occlusion, checked_positions

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from aosplan.scenes.occlusion import Words
    from aosplan.scenes.voxels import VoxelVolume

    Octets = NDArray[np.uint8]

SAMPLE = 1_000_000
"""Smallest number of targets in a sample, if the plot has enough voxels."""

FEW_TARGETS = 4 * SAMPLE
"""Largest number of targets of a plot that is not sampled."""

LATTICES = 4
# A solution of the four queens problem: no two lattices share a row, a column or a diagonal.
OTHER_AXIS = np.array([1, 3, 0, 2])


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

    def __init__(self, occlusion: Occlusion, volume: VoxelVolume, sample: int = SAMPLE) -> None:
        self._all = occlusion
        _, rows, columns = volume.occupied.shape
        self._plot = rows, columns
        step = math.isqrt(max(LATTICES * rows * columns // sample, 1))
        # Four lattices with every second voxel contain all voxels, so a step of 2 need not be odd.
        self._step = step if step == 2 else step - 1 + step % 2
        order = np.arange(LATTICES)
        # Along x and y: position within a voxel [targets], and first voxel.
        places = np.column_stack([order, OTHER_AXIS])
        self._within = ((places + 0.5) * (occlusion.targets_per_voxel / LATTICES)).astype(np.intp)
        self._first = np.column_stack([OTHER_AXIS, order]) * self._step // LATTICES
        self._across, self._down = (-(-length // self._step) for length in (columns, rows))
        # Octets are along y and padded along x so that a lattice has whole 64-bit words.
        self._height = -(-self._down // 8)
        self._padded = -(-self._across // 8) * 8
        east = self._first[:, :1] + self._step * np.arange(self._padded) < columns
        north = self._first[:, 1:] + self._step * np.arange(8 * self._height) < rows
        bits = np.packbits(north, axis=1, bitorder="little")
        self._valid = bits[:, :, np.newaxis] * east[:, np.newaxis]
        self.targets = int((north.sum(axis=1) * east.sum(axis=1)).sum())

    @property
    def words(self) -> int:
        """Number of 8-byte words of a mask."""
        return int(self._valid.size) // 8

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
        # One number for the tile and for the position in it at which a view begins.
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
        """Voxels at which views meet each slice, for the first target of each lattice.

        Returns
        -------
        tuple
            Voxels, shape (slices, views, lattices, 3, x and y), relative to the lowest of each
            slice; the lowest voxels, shape (slices, 2); and the largest relative voxel, shape (2,).
        """
        shifts = self._all.meetings(offsets)[:, :, np.newaxis]
        lattice = np.s_[np.newaxis, np.newaxis, :, np.newaxis]
        places = (shifts + self._within[lattice]) // self._all.targets_per_voxel
        places += self._first[lattice]
        lows = places.min(axis=(1, 2, 3))
        places -= lows[:, np.newaxis, np.newaxis, np.newaxis]
        places %= self._plot[::-1]  # the plot is periodic
        return places, lows, places.max(axis=(0, 1, 2, 3))


class _Tiles:
    """One slice sorted into flat lattices of voxels, moved by 0 to 7 bits; each is computed on
    demand.
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
            # Every step-th row, eight of them packed into an octet.
            apart = self._plane[row :: self._step].view(np.uint8)
            octets = apart[0::8].copy()
            for place in range(1, 8):
                octets |= apart[place::8] << np.uint8(place)
            self._packed[row] = octets
        tile: Octets = self._packed[row].take(self._columns[column :: self._step], axis=1).ravel()
        return tile


def _wraps(indices: NDArray[np.intp], length: int) -> bool:
    return bool(indices[0] < 0 or indices[-1] >= length)


def views_of(
    volume: VoxelVolume,
    altitude_m: float,
    *,
    targets_per_voxel: int | None = None,
    focal_height_m: float = 0.0,
) -> Occlusion | SampledOcclusion:
    """Telecentric views of all targets of a plot, or of a sample of them if the plot is large.

    The parameters are those of `Occlusion`.
    """
    occlusion = Occlusion(
        volume, altitude_m, targets_per_voxel=targets_per_voxel, focal_height_m=focal_height_m
    )
    if occlusion.targets <= FEW_TARGETS:
        return occlusion
    return SampledOcclusion(occlusion, volume)
