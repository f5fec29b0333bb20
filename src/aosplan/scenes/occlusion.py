"""Occlusion: which targets on the ground a view from above sees through a volume of voxels.

**Targets** lie on the focal plane, k x k to a voxel's ground cell, each in the middle of a cell
of pitch s = voxel/k.  The plot wraps: its copies stand all around it, so every target has a
canopy, and rays that leave on one side come back on the other.

**Views.**  A target at t is seen from altitude h by a ray that passes height H at

- *telecentric*: t + c H/h.  c is the offset of the camera from the target: every target under
  its own aperture.  Only c/h counts.
- *perspective*: t (1 - H/h) + C H/h, from the plot's centre.  C is the camera's position: all
  targets under one aperture.

**Cells.**  Within a slice of voxels a ray meets the cell at the slice's bottom, that at its top,
and where both coordinates change between them one of the two cells beside: the one that lies
along the axis on which the view is more oblique (perspective: along x).  So each ray meets as
many cells as it should, for up to one cell per slice and axis, and which of the two it is
makes no difference on average.

**Plates.**  The cells of a volume that was realised from pulses are plates.  A ray at angle θ
meets the cell of each slice at the slice's middle, and in a share sec θ - 1 of the slices the
cell beside as well, so that the optical depth grows with the path.  In perspective that share
is the sum of those of both axes, which is larger by a product of the two.

**Telecentric views are shifts.**  All targets share the shift c H/h, here rounded to whole
targets: a view is an OR of shifted slices, and no ray is traced.  Targets along x are bits of
octets, and octets along y are neighbours in memory.  A shift along x by less than an octet is
done once for all views that share it; all others are steps in memory, so that what is left is
one OR of one flat stretch of memory per view and meeting.

**Perspective views are scaled as well.**  A ray's place along x depends on x alone, and along y
on y: columns of voxels are picked once for all cameras of one x, then packed rows are picked for
each.  Nothing is rounded: in a scaled lattice a rounded ray would waver about its place, and
meet neighbours that it passes by.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.scenes import plates
from aosplan.scenes.voxels import FACE

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from aosplan.scenes.voxels import VoxelVolume

    Octets = NDArray[np.uint8]
    Words = NDArray[np.uint64]

ViewKind = Literal["telecentric", "perspective"]


class Window(NamedTuple):
    """A rectangle of a plot's targets: its first row and column, and how many of each."""

    row: int
    column: int
    rows: int
    columns: int


OCTETS_A_VIEW = 1 << 18
"""Memory for the targets of one view that are worked on at a time."""

OCTETS_AT_ONCE = 1 << 24
"""The same for all views that share the work of preparing a slice."""

OCTETS_KEPT = 1 << 27
"""Memory for slices that later views may use again."""

TARGETS_AT_ONCE = 1 << 24
"""Targets of all views that are unpacked at a time, as float32: it counts exactly up to there."""

BYTE_COUNTS = np.unpackbits(np.arange(256, dtype=np.uint8)[:, np.newaxis], axis=1).sum(
    axis=1, dtype=np.uint8
)


class _Tiles(NamedTuple):
    """Slices as a band of targets sees them, flat octets, ready for the shifts of some views.

    Of each level they begin at the lowest shift and take `spans` of them, along x and y.
    `slices` has, by level, what has been made so far: the tile by the bits that it has moved by.
    """

    row: int
    rows: int
    lows: NDArray[np.intp]
    spans: tuple[int, int]
    octets: int
    slices: list[dict[int, Octets]]

    @property
    def stride(self) -> int:
        """Octets from one octet along x to the next: the band's rows and those to spare."""
        return self.rows + self.spans[1]

    def hold(self, row: int, rows: int, steps: NDArray[np.intp]) -> bool:
        """Whether a band at these shifts is among what the tiles were made for."""
        beyond = steps - self.lows[:, np.newaxis, np.newaxis]
        inside = bool((beyond >= 0).all() and (beyond <= self.spans).all())
        return inside and (row, rows) == (self.row, self.rows)


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
        k, targets along either side of a voxel, from 1; None for what the volume calls for.
        Telecentric rays are rounded to 1/k of a voxel.
    focal_height_m
        Height of the focal plane, and the targets, above the ground; what is below it hides
        nothing.
    window
        The targets that count, where not all of the plot's do.

    Raises
    ------
    RequestError
        If the cameras are not above the volume, or a number is outside its domain.
    """

    def __init__(
        self,
        volume: VoxelVolume,
        altitude_m: float,
        *,
        view: ViewKind = "telecentric",
        targets_per_voxel: int | None = None,
        focal_height_m: float = 0.0,
        window: Window | None = None,
    ) -> None:
        if targets_per_voxel is None:
            targets_per_voxel = volume.targets_per_voxel
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
        thickness_m = volume.slice_height_m
        lowest = int(focal_height_m / thickness_m + FACE)
        self._occupied = volume.occupied[lowest:]
        self._filled = np.flatnonzero(volume.slice_densities[lowest:])
        faces_m = (lowest + np.arange(len(self._occupied) + 1)) * thickness_m - focal_height_m
        # Height over altitude of the faces between slices, bottom and top included.
        self._faces = np.maximum(faces_m, 0.0) / altitude_m
        self._plates = volume.slice_m is not None
        self._altitude_m = altitude_m
        self._view = view
        self._per_voxel = int(targets_per_voxel)
        self._pitch_m = volume.voxel_m / self._per_voxel
        _, rows, columns = volume.occupied.shape
        self._plot = int(rows * self._per_voxel), int(columns * self._per_voxel)
        self._window = window or Window(0, 0, *self._plot)
        self.rows, self.columns = self._window.rows, self._window.columns
        # Octets, but whole words of them.
        self._width = 8 * -(-self.columns // 64)
        self._tiles: _Tiles | None = None

    @property
    def targets_per_voxel(self) -> int:
        """Targets along either side of a voxel."""
        return self._per_voxel

    @property
    def targets(self) -> int:
        """Number of targets."""
        return self.rows * self.columns

    @property
    def words(self) -> int:
        """Words that a mask takes, 8 bytes each."""
        return self._width * self.rows // 8

    @property
    def slices(self) -> list[tuple[int, NDArray[np.bool_]]]:
        """The slices above the focal plane that hold anything: their places in `meetings`, and
        their voxels, shape (rows, columns).
        """
        return [(level, self._occupied[level]) for level in self._filled.tolist()]

    def meetings(self, offsets_m: NDArray[np.float64]) -> NDArray[np.intp]:
        """Shifts [targets] at which telecentric views meet each slice.

        Parameters
        ----------
        offsets_m
            Shape (N, 2), as in `masks`.

        Returns
        -------
        ndarray
            Shape (slices, N, 3, 2): up to three cells of each slice, along x and y.
        """
        return self._plate_meetings(offsets_m) if self._plates else self._cube_meetings(offsets_m)

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
        offsets = checked_positions(positions_m)
        masks = np.empty((len(offsets), self._width, self.rows), dtype=np.uint8)
        if self._view == "perspective":
            perspective = self._perspective_plates if self._plates else self._perspective
            perspective(masks, offsets)
        elif len(offsets):
            self._telecentric(masks, offsets, self._window.row)
        ends = np.arange(8 * self._width).reshape(self._width, 8) < self.columns
        masks &= np.packbits(ends, axis=1, bitorder="little")
        return masks.reshape(len(offsets), 8 * self.words).view(np.uint64)

    def mask_of(self, window: Window) -> Words:
        """The targets of a window as a mask, shape (words,)."""
        inside = np.zeros((self.rows, 8 * self._width), dtype=np.bool_)
        rows = slice(window.row, window.row + window.rows)
        inside[rows, window.column : window.column + window.columns] = True
        octets = np.packbits(inside, axis=1, bitorder="little").T
        return np.ascontiguousarray(octets).reshape(-1).view(np.uint64)

    def unpack(self, masks: Words) -> NDArray[np.bool_]:
        """Masks as arrays: shape (N, rows, columns), true where the target is hidden."""
        octets = masks.view(np.uint8).reshape(-1, self._width, self.rows)
        bits = np.unpackbits(octets.transpose(0, 2, 1), axis=2, bitorder="little")
        return bits[:, :, : self.columns].astype(np.bool_)

    def _telecentric(self, masks: Octets, offsets: NDArray[np.float64], row: int) -> None:
        """Set masks, shape (views, width, rows), of the targets in a band from `row` on."""
        views, width, rows = masks.shape
        if rows * width > OCTETS_A_VIEW and rows > 1:
            half = rows // 2
            self._telecentric(masks[:, :, :half], offsets, row)
            self._telecentric(masks[:, :, half:], offsets, row + half)
            return
        steps = self.meetings(offsets)
        tiles = self._tiles
        if tiles is None or not tiles.hold(row, rows, steps):
            tiles = self._tiles_for(row, rows, width, steps)
        steps -= tiles.lows[:, np.newaxis, np.newaxis]
        steps %= self._plot[::-1]  # the plot wraps
        stride, octets = tiles.stride, tiles.octets
        if (views + 1) * octets * stride > OCTETS_AT_ONCE and views > 1:
            half = views // 2
            self._telecentric(masks[:half], offsets[:half], row)
            self._telecentric(masks[half:], offsets[half:], row)
            return
        size = (width - 1) * stride + rows
        hidden = np.zeros((views, width * stride), dtype=np.uint8)
        hits = [mask[:size] for mask in hidden]
        places = (steps[..., 0] // 8 * stride + steps[..., 1]) * 8 + steps[..., 0] % 8
        # A search asks for few views at a time, mostly between those that it began with.
        kept = len(self._filled) * 8 * octets * stride <= OCTETS_KEPT
        self._tiles = tiles if kept else None
        for level in self._filled.tolist():
            phases = tiles.slices[level]
            if not phases:
                phases[0] = self._tile(tiles, level)
            for met, hit in zip(places[level].tolist(), hits, strict=True):
                for place in set(met):
                    start, bit = place >> 3, place & 7
                    if bit not in phases:
                        phases[bit] = _advanced(phases[0], stride, bit)
                    np.bitwise_or(hit, phases[bit][start : start + size], hit)
            if not kept:
                phases.clear()
        masks[...] = hidden.reshape(views, width, stride)[:, :, :rows]

    def _tiles_for(self, row: int, rows: int, width: int, steps: NDArray[np.intp]) -> _Tiles:
        """Tiles for the shifts of views, still to be made."""
        lows, highs = steps.min(axis=(1, 2)), steps.max(axis=(1, 2))
        # With rows to spare for the largest shift, every shift is one stretch of flat memory; what
        # it drags along beyond the band's own rows is thrown away in the end.
        spans = np.minimum((highs - lows).max(axis=0, initial=0), np.subtract(self._plot, 1)[::-1])
        span_x, span_y = spans.tolist()
        octets = width + span_x // 8 + 1
        return _Tiles(row, rows, lows, (span_x, span_y), octets, [{} for _ in lows])

    def _tile(self, tiles: _Tiles, level: int) -> Octets:
        """A slice's targets, packed along x and flat, from the lowest shift of its views on."""
        low_x, low_y = tiles.lows[level].tolist()
        x = (low_x + self._window.column + np.arange(8 * tiles.octets)) // self._per_voxel
        y = (low_y + tiles.row + np.arange(tiles.stride)) // self._per_voxel
        near = self._occupied[level].take(np.arange(y[0], y[-1] + 1), axis=0, mode="wrap")
        # Turned for it, as rows are taken whole and columns bit by bit.
        fine = np.ascontiguousarray(near.T).take(x, axis=0, mode="wrap").T
        packed = np.packbits(np.ascontiguousarray(fine), axis=1, bitorder="little")
        tile: Octets = packed.take(y - y[0], axis=0).ravel(order="F")
        return tile

    def _cube_meetings(self, offsets: NDArray[np.float64]) -> NDArray[np.intp]:
        """Shifts [targets] at which views meet each slice of cubes."""
        faces = self._faces[:, np.newaxis, np.newaxis]
        shifts = np.floor(offsets * faces / self._pitch_m + 0.5).astype(np.intp)
        bottom, top = shifts[:-1], shifts[1:]
        x_first = np.abs(offsets[:, :1]) >= np.abs(offsets[:, 1:])
        beside = np.where(x_first == (True, False), top, bottom)
        return np.stack([bottom, beside, top], axis=2)

    def _plate_meetings(self, offsets: NDArray[np.float64]) -> NDArray[np.intp]:
        """Shifts [targets] at which views meet each slice of plates."""
        middle = 0.5 * (self._faces[:-1] + self._faces[1:])
        slope = offsets / self._altitude_m
        return plates.shifts(offsets / self._pitch_m, slope, middle, self._per_voxel)

    def _perspective_plates(self, masks: Octets, positions: NDArray[np.float64]) -> None:
        """Set masks, shape (views, width, rows), for a volume of plates."""
        x_m, x_of = np.unique(positions[:, 0], return_inverse=True)
        y_m, y_of = np.unique(positions[:, 1], return_inverse=True)
        abreast = [np.flatnonzero(x_of == x).tolist() for x in range(len(x_m))]
        along, across = self._plot
        scale = self._pitch_m, self._altitude_m, self._per_voxel
        east = plates.Axis.along(x_m, across, self._window.column, 8 * self._width, *scale)
        north = plates.Axis.along(y_m, along, self._window.row, self.rows, *scale)
        hidden = np.zeros((len(masks), self.rows, self._width), dtype=np.uint8)
        for level in self._filled.tolist():
            height = 0.5 * float(self._faces[level] + self._faces[level + 1])
            plane = _column_bits(self._occupied[level])
            x, x_beside = east.cells(height, level)
            y, y_beside = north.cells(height, level)
            again = (y != y_beside).any(axis=1)
            for views, met, beside in zip(abreast, x, x_beside, strict=True):
                octets = _picked(plane, met)
                if (met != beside).any():
                    octets |= _picked(plane, beside)
                rows = np.ascontiguousarray(octets.T)
                for view in views:
                    line = y_of[view]
                    hidden[view] |= rows.take(y[line], axis=0)
                    if again[line]:
                        hidden[view] |= rows.take(y_beside[line], axis=0)
        masks[...] = hidden.transpose(0, 2, 1)

    def _perspective(self, masks: Octets, positions: NDArray[np.float64]) -> None:
        """Set masks, shape (views, width, rows)."""
        x_m, x_of = np.unique(positions[:, 0], return_inverse=True)
        y_m, y_of = np.unique(positions[:, 1], return_inverse=True)
        abreast = [np.flatnonzero(x_of == x).tolist() for x in range(len(x_m))]
        along, across = self._plot
        first_y, first_x = self._window[:2]
        hidden = np.zeros((len(masks), self.rows, self._width), dtype=np.uint8)
        for face in np.union1d(self._filled, self._filled + 1):
            above = np.asarray(self._occupied[face : face + 1].any(axis=0))
            around = np.asarray(self._occupied[max(face - 1, 0) : face + 1].any(axis=0))
            x = self._voxels(face, x_m, across, first_x, 8 * self._width)
            x_beside = self._voxels(face + 1, x_m, across, first_x, 8 * self._width)
            y = self._voxels(face, y_m, along, first_y, self.rows)
            if 2 * self.rows < along:  # most of the plot's rows are not met
                met_rows, places = np.unique(y, return_inverse=True)
                y = places.reshape(y.shape).astype(np.int32)
                above, around = above[met_rows], around[met_rows]
            above_bits, around_bits = _column_bits(above), _column_bits(around)
            for views, met, beside in zip(abreast, x, x_beside, strict=True):
                octets = _picked(around_bits, met) | _picked(above_bits, beside)
                rows = np.ascontiguousarray(octets.T)
                for view in views:
                    hidden[view] |= rows.take(y[y_of[view]], axis=0)
        masks[...] = hidden.transpose(0, 2, 1)

    def _voxels(
        self, face: int, camera_m: NDArray[np.float64], across: int, first: int, count: int
    ) -> NDArray[np.int32]:
        """Voxels met at a face along an axis `across` targets long, shape (cameras, count).

        Of the targets, `count` from the `first` on.

        Where there is no such face, nothing is met, wherever that is.
        """
        height = self._faces[min(face, len(self._faces) - 1)]
        target = (np.arange(first, first + count) + (0.5 - 0.5 * across)) * (1.0 - height)
        camera = camera_m * (height / self._pitch_m) + 0.5 * across
        place = (target + camera[:, np.newaxis]) / self._per_voxel
        voxels: NDArray[np.int32] = np.floor(place).astype(np.int32)
        voxels %= across // self._per_voxel
        return voxels


def checked_positions(positions_m: ArrayLike) -> NDArray[np.float64]:
    """Positions as an array of shape (N, 2); ValueError if they are not finite or of that shape."""
    offsets = np.asarray(positions_m, dtype=np.float64)
    if offsets.ndim != 2 or offsets.shape[1] != 2 or not np.isfinite(offsets).all():
        raise ValueError("positions are not finite numbers of shape (N, 2)")
    return offsets


def _column_bits(plane: NDArray[np.bool_]) -> Octets:
    """Columns of a plane, moved to each of the bits of octets: shape (8, columns, rows)."""
    bits = np.uint8(1) << np.arange(8, dtype=np.uint8)
    return np.ascontiguousarray(plane.T).view(np.uint8) * bits[:, np.newaxis, np.newaxis]


def _picked(column_bits: Octets, columns: NDArray[np.int32]) -> Octets:
    """Columns of a plane that targets lie below, eight to an octet: shape (width, rows)."""
    _, count, rows = column_bits.shape
    places = columns.reshape(-1, 8) + count * np.arange(8)
    apart = column_bits.reshape(-1, rows).take(places, axis=0)
    octets: Octets = np.bitwise_or.reduce(apart, axis=1)
    return octets


def _advanced(tile: Octets, stride: int, bit: int) -> Octets:
    """A flat tile whose targets have moved 1 to 7 places towards x = 0; its last octets are lost."""
    moved = tile[:-stride] >> np.uint8(bit)
    # As fast as the other operations on octets, which a shift to the left is not.
    moved |= tile[stride:] * np.uint8(1 << (8 - bit))
    return moved


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

    @property
    def planes(self) -> Words:
        """Binary digits of the counts, the lowest first, as masks: shape (digits, words)."""
        return np.stack(self._planes)

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
    step = max(TARGETS_AT_ONCE // (8 * max(len(masks), 1)), 1)
    for start in range(0, octets.shape[1], step):
        # A product of matrices counts faster than anything on bits.
        bits = np.unpackbits(octets[:, start : start + step], axis=1).astype(np.float32)
        counts += (bits @ bits.T).astype(np.int64)
    return counts
