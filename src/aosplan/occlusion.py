"""Occlusion: which targets on the ground a view from above sees through a volume of voxels.

**Targets** lie on the focal plane, k x k to a voxel's ground cell, each in the middle of a cell
of pitch s = voxel/k.  The plot wraps: its copies stand all around it, so every target has a
canopy, and rays that leave on one side come back on the other.

**Views.**  A target at t is seen from altitude h by a ray that passes height H at

- *telecentric*: t + c H/h.  c is the offset of the camera from the target: every target under
  its own aperture.  Only c/h counts.
- *perspective*: t (1 - H/h) + C H/h, from the plot's centre.  C is the camera's position: all
  targets under one aperture.

**Sheets.**  A slanted ray enters a cube through its bottom or its side and leaves through its
side or its top.  The sheet at the face between two slices holds the cells of either; a ray that
meets no filled cell of any sheet meets no cube, but for those of which it cuts just an edge that
stands upright.

**Shifts.**  With u = t (telecentric), or sampled on a lattice that is scaled by m = 1 - H/h once
for all cameras (perspective, with m = 1 in the other view), a sheet is met at m (u + shift),
shift = ⌊c H/(h m s) + ½⌋ whole targets.  So a view is an OR of shifted sheets: no ray is traced.

**Bits.**  64 targets along x share a word, and the words of a column of targets are neighbours in
memory.  A shift along x is a shift of bits, done once for all views that share it; whole words
and targets along y are steps in memory, so that what is left to do is one OR over one slice of
memory, per view and sheet.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from aosplan.errors import RequestError
from aosplan.voxels import FACE

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from aosplan.voxels import VoxelVolume

    Octets = NDArray[np.uint8]
    Words = NDArray[np.uint64]

ViewKind = Literal["telecentric", "perspective"]

OCTETS_A_VIEW = 1 << 18
"""Memory for the targets of one view that are worked on at a time."""

OCTETS_AT_ONCE = 1 << 23
"""The same for all views that share the work of preparing a sheet."""

TARGETS_AT_ONCE = 1 << 15
"""Targets that are unpacked at a time, four bytes each and view."""

BYTE_COUNTS = np.unpackbits(np.arange(256, dtype=np.uint8)[:, np.newaxis], axis=1).sum(
    axis=1, dtype=np.uint8
)


class Occlusion:
    """The targets of one plot, as cameras at one altitude see them.

    Parameters
    ----------
    volume
        What stands on the plot.
    altitude_m
        h, height of the cameras above the focal plane; above everything that stands.
    view
        ``telecentric`` or ``perspective``, as in the module's text.
    targets_per_voxel
        k, targets along either side of a voxel, from 1.  Lateral positions are rounded to 1/k
        of a voxel.
    focal_height_m
        Height of the focal plane, and the targets, above the ground; what is below it hides
        nothing.

    Raises
    ------
    RequestError
        Where the cameras are not above the volume, or a number is outside its domain.
    """

    def __init__(
        self,
        volume: VoxelVolume,
        altitude_m: float,
        *,
        view: ViewKind = "telecentric",
        targets_per_voxel: int = 4,
        focal_height_m: float = 0.0,
    ) -> None:
        if view not in ("telecentric", "perspective"):
            raise RequestError(f"view '{view}' is unknown", "use telecentric or perspective")
        if not (targets_per_voxel >= 1 and targets_per_voxel == int(targets_per_voxel)):
            raise RequestError(
                f"targets_per_voxel {targets_per_voxel:g} is not a whole number from 1"
            )
        if not 0.0 <= focal_height_m < np.inf:
            raise RequestError(f"focal height {focal_height_m:g} m is not zero or above")
        top_m = volume.canopy_top_m - focal_height_m
        if not max(top_m, 0.0) < altitude_m < np.inf:
            raise RequestError(
                f"altitude {altitude_m:g} m is not above the canopy, whose top is {top_m:g} m above "
                "the focal plane",
                f"fly higher than {max(top_m, 0.0):g} m",
            )
        lowest = int(focal_height_m / volume.voxel_m + FACE)
        self._occupied = volume.occupied[lowest:]
        faces = np.arange(len(self._occupied) + 1)
        height_m = np.maximum((lowest + faces) * volume.voxel_m - focal_height_m, 0.0)
        filled = np.pad(volume.slice_densities[lowest:] > 0.0, 1)
        kept = filled[:-1] | filled[1:]
        self._faces = faces[kept]
        self._scale = 1.0 - height_m[kept] / altitude_m * (view == "perspective")
        pitch_m = volume.voxel_m / targets_per_voxel
        self._shear = height_m[kept] / (altitude_m * pitch_m * self._scale)
        self._per_voxel = int(targets_per_voxel)
        _, rows, columns = volume.occupied.shape
        self.rows = int(rows * self._per_voxel)
        self.columns = int(columns * self._per_voxel)
        # Octets, but whole words of them.
        self._width = 8 * -(-self.columns // 64)

    @property
    def targets(self) -> int:
        """Number of targets."""
        return self.rows * self.columns

    @property
    def words(self) -> int:
        """Words that a mask takes, 8 bytes each."""
        return self._width * self.rows // 8

    def masks(self, positions_m: ArrayLike) -> Words:
        """Targets that are hidden from cameras.

        Parameters
        ----------
        positions_m
            Shape (N, 2), east and north: offsets c from the target (telecentric), or positions C
            from the centre of the plot (perspective).

        Returns
        -------
        ndarray
            Shape (N, words), a bit for each target, set where something is in the way; bits that
            stand for no target are 0.  Take it as opaque, or see `unpack`.
        """
        offsets = np.asarray(positions_m, dtype=np.float64)
        if offsets.ndim != 2 or offsets.shape[1] != 2 or not np.isfinite(offsets).all():
            raise ValueError("positions are not finite numbers of shape (N, 2)")
        masks = np.empty((len(offsets), self._width, self.rows), dtype=np.uint8)
        if len(offsets):
            self._fill(masks, offsets, 0)
        ends = np.arange(8 * self._width).reshape(self._width, 8) < self.columns
        masks &= np.packbits(ends, axis=1, bitorder="little")
        return masks.reshape(len(offsets), -1).view(np.uint64)

    def unpack(self, masks: Words) -> NDArray[np.bool_]:
        """Masks as arrays: shape (N, rows, columns), true where the target is hidden."""
        octets = masks.view(np.uint8).reshape(-1, self._width, self.rows)
        bits = np.unpackbits(octets.transpose(0, 2, 1), axis=2, bitorder="little")
        return bits[:, :, : self.columns].astype(np.bool_)

    def _fill(self, masks: Octets, offsets: NDArray[np.float64], row: int) -> None:
        """Set the masks, shape (views, width, rows), of the targets in a band from `row` on."""
        views, width, rows = masks.shape
        if rows * width > OCTETS_A_VIEW and rows > 1:
            half = rows // 2
            self._fill(masks[:, :, :half], offsets, row)
            self._fill(masks[:, :, half:], offsets, row + half)
            return
        shifts = np.floor(offsets * self._shear[:, np.newaxis, np.newaxis] + 0.5).astype(np.intp)
        lows = shifts.min(axis=1)
        spans = shifts.max(axis=1) - lows
        spare_x, spare_y = spans.max(axis=0, initial=0).tolist()
        # With rows to spare for the largest shift, every shift is one slice of flat memory; what
        # it drags along beyond the band's own rows is thrown away in the end.
        stride = rows + spare_y
        if (views + 1) * (width + spare_x // 8) * stride > OCTETS_AT_ONCE and views > 1:
            half = views // 2
            self._fill(masks[:half], offsets[:half], row)
            self._fill(masks[half:], offsets[half:], row)
            return
        size = (width - 1) * stride + rows
        hidden = np.zeros((views, width * stride), dtype=np.uint8)
        targets = [mask[:size] for mask in hidden]
        for sheet, low in enumerate(lows):
            octets = int(spans[sheet, 0]) // 8 + width + 1
            tile = self._tile(sheet, int(low[0]), int(low[1]) + row, octets, stride)
            phases: dict[int, Octets] = {0: tile}
            for (x, y), hit in zip((shifts[sheet] - low).tolist(), targets, strict=True):
                octet, bit = divmod(x, 8)
                if bit not in phases:
                    phases[bit] = _advanced(tile, stride, bit)
                start = octet * stride + y
                np.bitwise_or(hit, phases[bit][start : start + size], out=hit)
        masks[...] = hidden.reshape(views, width, stride)[:, :, :rows]

    def _tile(self, sheet: int, low_x: int, low_y: int, width: int, rows: int) -> Octets:
        """A sheet on the lattice of targets from (low_x, low_y) on, flat from (width, rows)."""
        face, scale = self._faces[sheet], self._scale[sheet]
        slices = self._occupied[max(face - 1, 0) : face + 1]
        x = self._voxels(low_x, 8 * width, self.columns, scale)
        y = self._voxels(low_y, rows, self.rows, scale)
        used = np.arange(y[0], y[-1] + 1)
        plane = slices.take(used, axis=1, mode="wrap").any(axis=0).take(x, axis=1, mode="wrap")
        octets: Octets = np.packbits(plane, axis=1, bitorder="little").take(y - y[0], axis=0)
        return octets.ravel(order="F")

    def _voxels(self, low: int, count: int, across: int, scale: float) -> NDArray[np.intp]:
        """Voxels, not wrapped, below targets low … low + count - 1 of a side `across` targets long."""
        centre = 0.5 * across
        cells = (np.arange(low, low + count) + (0.5 - centre)) * scale + centre
        return np.floor(cells / self._per_voxel).astype(np.intp)


def popcount(words: Words) -> NDArray[np.int64]:
    """Number of bits that are set, along the last axis."""
    if hasattr(np, "bitwise_count"):
        bits = np.bitwise_count(words)
    else:  # numpy 1
        bits = BYTE_COUNTS[np.ascontiguousarray(words).view(np.uint8)]
    return np.asarray(bits.sum(axis=-1, dtype=np.int64))


class Tally:
    """How often each target is hidden, over any number of views: a binary counter per bit.

    Plane i holds bit i of every target's count c, so a view is added with a few operations on
    words, and Σ c and Σ c² follow from the bits of planes and pairs of planes.
    """

    def __init__(self, words: int) -> None:
        self.views = 0
        self._words = words
        self._planes: list[Words] = []

    def add(self, mask: Words) -> None:
        """Count one more view, shape (words,)."""
        self.views += 1
        if self.views.bit_length() > len(self._planes):
            self._planes.append(np.zeros(self._words, dtype=np.uint64))
        carry = mask
        for plane in self._planes:
            overflow = plane & carry
            np.bitwise_xor(plane, carry, out=plane)
            carry = overflow

    def moments(self) -> tuple[int, int]:
        """Σ c and Σ c² over all targets, exact."""
        joint = [[int(popcount(one & other)) for other in self._planes] for one in self._planes]
        squares = sum(bits << (i + k) for i, row in enumerate(joint) for k, bits in enumerate(row))
        return sum(row[i] << i for i, row in enumerate(joint)), squares


def joint_counts(masks: Words) -> NDArray[np.int64]:
    """Number of targets hidden from both views of every pair, shape (N, N).

    Parameters
    ----------
    masks
        Shape (N, words), as `Occlusion.masks` returns them.
    """
    octets = masks.view(np.uint8)
    counts = np.zeros((len(masks), len(masks)), dtype=np.int64)
    step = TARGETS_AT_ONCE // 8
    for start in range(0, octets.shape[1], step):
        # Below 2^24 a float32 counts exactly, and its matrix product is the fastest there is.
        bits = np.unpackbits(octets[:, start : start + step], axis=1).astype(np.float32)
        counts += (bits @ bits.T).astype(np.int64)
    return counts


def _advanced(tile: Octets, stride: int, bit: int) -> Octets:
    """A flat tile whose targets have moved 1 to 7 places towards x = 0; its last octets are lost."""
    moved = tile[:-stride] >> np.uint8(bit)
    # As fast as the other operations on octets, which a shift to the left is not.
    moved |= tile[stride:] * np.uint8(1 << (8 - bit))
    return moved
