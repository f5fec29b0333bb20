"""Occlusion: computes which targets on the ground a view from above sees through a volume of
voxels.

**Targets** are on the focal plane.  There are k x k targets per voxel column, each in the middle of
a square of side s = voxel/k.  The plot is periodic: it is surrounded by copies of itself.  Every
target therefore has a canopy, and a ray that leaves the plot on one side comes back on the opposite
side.

**Views.**  A camera at altitude h sees a target at the position t along a ray. At the height H, the ray is at the position

- *telecentric*: t + c H/h, where c is the offset of the camera from the target.  Every target has
  its own aperture above it.  The result depends only on c/h.
- *perspective*: t (1 - H/h) + C H/h, relative to the plot's centre, where C is the position of the
  camera.  All targets have the same aperture.

**Cells.**  In a slice of cubes, a ray meets the cell at its bottom and the cell at its top. If these cells differ along both axes, the ray also meets one of the two cells between them. It is the neighbour of the first cell along the axis on which the view is more oblique (in perspective: along x). This number of cells is correct if a ray crosses at most one face between cells per slice and axis. The choice between the two cells makes no difference on average.

**Plates.**  The cells of a volume from laser pulses are plates. A ray at the angle θ meets the cell at the middle of each slice. In a share sec θ - 1 of the slices, it also meets a neighbouring cell. The optical depth therefore increases with the length of the path. For perspective views, sec θ - 1 is replaced by the sum of the shares along both axes.  This sum is larger than sec θ - 1 by about the product of the two shares.

**Telecentric views are shifts.** At the height H, the rays of all targets are shifted by the same
vector c H/h, which is rounded to whole targets.  A view is then the bitwise OR of shifted slices,
and no rays are traced.  Targets along x are bits of octets, and octets along y are adjacent in
memory.  A shift along x by less than an octet is computed once for all views that need it.  All
other shifts are offsets in memory: each needs only an OR with one contiguous piece of memory.

**Perspective views are also scaled.**  The position of a ray along x depends only on the x of camera
and target, and its position along y only on their y.  Octets of columns are therefore selected once
for all cameras with the same x.  Then rows of octets are selected for each camera.  Positions are not
rounded.  In a scaled lattice, rounded rays would meet neighbouring cells that the exact rays miss.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.scenes import plates
from aosplan.scenes.packed_columns import MetColumns, advanced, from_each_column, packed
from aosplan.scenes.perspective import Axis
from aosplan.scenes.voxels import FACE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike, NDArray

    from aosplan.scenes.voxels import VoxelVolume

    Octets = NDArray[np.uint8]
    Words = NDArray[np.uint64]
    Met = tuple[list[Octets], list[NDArray[np.intp]]]
    """For each camera along x, the octets that targets meet; along y, the rows of these octets."""

ViewKind = Literal["telecentric", "perspective"]


class PlotWindow(NamedTuple):
    """A rectangle of a plot's targets: first row, first column, number of rows, number of
    columns.
    """

    row: int
    column: int
    rows: int
    columns: int


OCTETS_A_VIEW = 1 << 18
"""Memory for the targets of one view that are processed at once [bytes]."""

OCTETS_AT_ONCE = 1 << 24
"""Memory for all views that share a prepared slice [bytes]."""

OCTETS_IN_CACHE = 1 << 20
"""Memory for views that share stored slices [bytes].  It fits into the cache of a processor."""

OCTETS_KEPT = 1 << 27
"""Memory for slices that later views may reuse [bytes]."""

POSITIONS_AT_ONCE = 1 << 18
"""Number of positions of rays in slices that are computed at once."""


class _Tiles(NamedTuple):
    """Slices prepared for a band of targets and for the shifts of some views.

    The tile of a slice is a flat array of octets.  It begins at the lowest shift of the views in
    this slice, or up to seven columns before it, so that it begins with an octet of the packed slice.
    It covers `spans` further shifts along x and y.  For each slice, `slices` has the
    tiles computed so far.  Their key is the number of bits by which they are moved.
    """

    row: int
    rows: int
    lows: NDArray[np.intp]
    spans: tuple[int, int]
    octets: int
    slices: list[dict[int, Octets]]

    @property
    def stride(self) -> int:
        """Number of octets between neighbours along x.  It is the number of rows of the band and
        its margin.
        """
        return self.rows + self.spans[1]

    def hold(self, row: int, rows: int, steps: NDArray[np.intp]) -> bool:
        """Whether these tiles were prepared for a band and contain the given shifts."""
        beyond = steps - self.lows[:, np.newaxis, np.newaxis]
        inside = bool((beyond >= 0).all() and (beyond <= self.spans).all())
        return inside and (row, rows) == (self.row, self.rows)


class Occlusion:
    """Occlusion of the targets of one plot, for cameras at one altitude.

    Parameters
    ----------
    volume
        The voxels of the plot.
    altitude_m
        h, height of the cameras above the focal plane.  The cameras have to be above all occluders.
    view
        ``telecentric`` or ``perspective``, as described in the module docstring.
    targets_per_voxel
        k, number of targets along each side of a voxel, at least 1; None for the default of the
        volume.  Positions of telecentric rays are rounded to 1/k of a voxel.
    focal_height_m
        Height above the ground of the focal plane, which contains the targets.  Occluders below it
        are ignored.
    window
        The targets to compute; None for all targets.

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
        window: PlotWindow | None = None,
    ) -> None:
        if targets_per_voxel is None:
            targets_per_voxel = volume.targets_per_voxel
        if view not in ("telecentric", "perspective"):
            raise RequestError(f"view '{view}' is unknown", "give telecentric or perspective")
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
        # Heights of the faces between slices divided by the altitude, including bottom and top.
        self._faces = np.maximum(faces_m, 0.0) / altitude_m
        self._plates = volume.slice_m is not None
        self._cell_voxels = volume.cell_voxels
        self._altitude_m = altitude_m
        self._view = view
        self._per_voxel = int(targets_per_voxel)
        self._pitch_m = volume.voxel_m / self._per_voxel
        _, rows, columns = volume.occupied.shape
        self._plot = int(rows * self._per_voxel), int(columns * self._per_voxel)
        self._window = window or PlotWindow(0, 0, *self._plot)
        self.rows, self.columns = self._window.rows, self._window.columns
        # Number of octets for the columns, rounded up to whole 64-bit words.
        self._width = 8 * -(-self.columns // 64)
        self._tiles: _Tiles | None = None
        self._packed: dict[int, Octets] = {}
        self._from_each: dict[tuple[int, ...], Octets] = {}

    @property
    def targets_per_voxel(self) -> int:
        """Number of targets along each side of a voxel."""
        return self._per_voxel

    @property
    def targets_per_cell(self) -> int:
        """Number of targets along each side of a cell in the arrays of `unpack`.  Here, a cell is a
        voxel column.
        """
        return self._per_voxel

    @property
    def targets(self) -> int:
        """Number of targets."""
        return self.rows * self.columns

    def targets_in(self, window: PlotWindow) -> int:
        """Number of targets in a window; 0 if its number of rows or columns is not positive."""
        return max(window.rows, 0) * max(window.columns, 0)

    @property
    def words(self) -> int:
        """Number of 8-byte words of a mask."""
        return self._width * self.rows // 8

    @property
    def slices(self) -> list[tuple[int, NDArray[np.bool_]]]:
        """The slices above the focal plane that have occupied voxels.  Each item is an index into
        `meetings` and the voxels, shape (rows, columns).
        """
        return [(level, self._occupied[level]) for level in self._filled.tolist()]

    def meetings(self, offsets_m: NDArray[np.float64]) -> NDArray[np.intp]:
        """Shifts [targets] at which telecentric views meet the cells of each slice.

        Parameters
        ----------
        offsets_m
            Shape (N, 2), as in `masks`.

        Returns
        -------
        ndarray
            Shape (slices, N, 3, 2): the shifts along x and y of up to three cells in each slice.
        """
        return self._plate_meetings(offsets_m) if self._plates else self._cube_meetings(offsets_m)

    def masks(self, positions_m: ArrayLike) -> Words:
        """Targets that are hidden from each camera.

        Parameters
        ----------
        positions_m
            Shape (N, 2), east and north: offsets c from the target (telecentric), or positions C
            relative to the centre of the plot (perspective).

        Returns
        -------
        ndarray
            Shape (N, words), one bit per target.  A bit is set if the target is hidden; padding
            bits are 0.  The order of the bits is not specified; `unpack` converts masks to arrays.
        """
        offsets = checked_positions(positions_m)
        masks = np.zeros((len(offsets), self._width, self.rows), dtype=np.uint8)
        used = masks[:, : -(-self.columns // 8)]
        if len(offsets) == 0:
            pass
        elif self._view == "perspective":
            self._perspective(used, offsets)
        else:
            self._telecentric(used, offsets, self._window.row)
        ends = np.arange(8 * self._width).reshape(self._width, 8) < self.columns
        masks &= np.packbits(ends, axis=1, bitorder="little")
        return masks.reshape(len(offsets), 8 * self.words).view(np.uint64)

    def mask_of(self, window: PlotWindow) -> Words:
        """A mask in which exactly the targets of a window are set, shape (words,)."""
        inside = np.zeros((self.rows, 8 * self._width), dtype=np.bool_)
        rows = slice(window.row, window.row + window.rows)
        inside[rows, window.column : window.column + window.columns] = True
        octets = np.packbits(inside, axis=1, bitorder="little").T
        return np.ascontiguousarray(octets).reshape(-1).view(np.uint64)

    def unpack(self, masks: Words, window: PlotWindow | None = None) -> NDArray[np.bool_]:
        """Convert masks to boolean arrays of shape (N, rows, columns), which are true for hidden
        targets.

        If a window is given, the arrays contain only the targets of the window.
        """
        octets = masks.view(np.uint8).reshape(-1, self._width, self.rows)
        bits = np.unpackbits(octets.transpose(0, 2, 1), axis=2, bitorder="little")
        row, column, rows, columns = window or (0, 0, self.rows, self.columns)
        return bits[:, row : row + rows, column : column + columns].astype(np.bool_)

    def _telecentric(self, masks: Octets, offsets: NDArray[np.float64], row: int) -> None:
        """Set masks of shape (views, width, rows) for the targets in a band that begins at `row`."""
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
        # The plot is periodic, so a shift by a whole plot changes nothing and is left out.
        steps %= self._plot[::-1]
        stride = tiles.stride
        places = (steps[..., 0] // 8 * stride + steps[..., 1]) * 8 + steps[..., 0] % 8
        # A search asks for a few views at a time. These views are usually between the views of its
        # first grids, so the tiles can be used again.
        kept = len(self._filled) * 8 * tiles.octets * stride <= OCTETS_KEPT
        self._tiles = tiles if kept else None
        together = max((OCTETS_IN_CACHE if kept else OCTETS_AT_ONCE) // (width * stride), 1)
        for first in range(0, views, together):
            group = slice(first, first + together)
            self._merge(masks[group], tiles, places[:, group], kept=kept)

    def _merge(self, masks: Octets, tiles: _Tiles, places: NDArray[np.intp], *, kept: bool) -> None:
        """Set the masks of views to the OR of tiles.  `places` has shape (slices, views, 3)."""
        views, width, rows = masks.shape
        size = (width - 1) * tiles.stride + rows
        hidden = np.zeros((views, width * tiles.stride), dtype=np.uint8)
        hits = [mask[:size] for mask in hidden]
        for level in self._filled.tolist():
            phases = tiles.slices[level]
            if not phases:
                phases[0] = self._tile(tiles, level)
            for met, hit in zip(places[level].tolist(), hits, strict=True):
                for place in set(met):
                    start, bit = place >> 3, place & 7
                    if bit not in phases:
                        base = phases[0]
                        phases[bit] = advanced(base[: -tiles.stride], bit, base[tiles.stride :])
                    np.bitwise_or(hit, phases[bit][start : start + size], hit)
            if not kept:
                phases.clear()
        masks[...] = hidden.reshape(views, width, tiles.stride)[:, :, :rows]

    def _tiles_for(self, row: int, rows: int, width: int, steps: NDArray[np.intp]) -> _Tiles:
        """Empty tiles for the shifts of some views.  Each tile is computed when it is needed."""
        lows, highs = steps.min(axis=(1, 2)), steps.max(axis=(1, 2))
        lows[:, 0] -= (lows[:, 0] + self._window.column) % self._plot[1] % 8
        # The tiles have additional rows for the largest shift, so that every shift is one
        # contiguous piece of memory. The rows beyond the band are discarded at the end.
        spans = np.minimum((highs - lows).max(axis=0, initial=0), np.subtract(self._plot, 1)[::-1])
        span_x, span_y = spans.tolist()
        octets = width + span_x // 8 + 1
        return _Tiles(row, rows, lows, (span_x, span_y), octets, [{} for _ in lows])

    def _tile(self, tiles: _Tiles, level: int) -> Octets:
        """Flat array of the targets of a slice, which begins at the lowest shift of the views."""
        low_x, low_y = tiles.lows[level].tolist()
        rows, columns = self._plot
        first = (low_x + self._window.column) % columns // 8
        # The columns of a tile may begin anywhere in the plot and extend beyond its end.
        octets = self._octets(level, columns // 8 + self._width + columns // 8 + 2)
        y = (low_y + tiles.row) % rows + np.arange(tiles.stride)
        voxels = y // self._per_voxel
        near = octets[first : first + tiles.octets]
        copies = [near] * (voxels[-1] // near.shape[1] + 1)
        near = np.concatenate(copies, axis=1)[:, voxels[0] : voxels[-1] + 1]
        if self._per_voxel > 1:
            near = near.take(voxels - voxels[0], axis=1)
        return near.ravel()

    def _octets(self, level: int, count: int) -> Octets:
        """A packed slice of `count` octets.  It is stored if the volume is not too large."""
        found = self._packed.get(level)
        if found is None:
            found = packed(self._occupied[level], self._per_voxel, count)
            if len(self._filled) * found.size <= OCTETS_KEPT:
                self._packed[level] = found
        return found

    def _cube_meetings(self, offsets: NDArray[np.float64]) -> NDArray[np.intp]:
        """Shifts [targets] at which views meet the cells of each slice of cubes."""
        faces = self._faces[:, np.newaxis, np.newaxis]
        shifts = np.floor(offsets * faces / self._pitch_m + 0.5).astype(np.intp)
        bottom, top = shifts[:-1], shifts[1:]
        x_first = np.abs(offsets[:, :1]) >= np.abs(offsets[:, 1:])
        beside = np.where(x_first == (True, False), top, bottom)
        return np.stack([bottom, beside, top], axis=2)

    def _plate_meetings(self, offsets: NDArray[np.float64]) -> NDArray[np.intp]:
        """Shifts [targets] at which views meet the cells of each slice of plates."""
        middle = 0.5 * (self._faces[:-1] + self._faces[1:])
        slope = offsets / self._altitude_m
        per_cell = self._per_voxel * self._cell_voxels
        return plates.shifts(offsets / self._pitch_m, slope, middle, per_cell)

    def _perspective(self, masks: Octets, positions: NDArray[np.float64]) -> None:
        """Set masks of shape (views, width, rows) for perspective views."""
        x_m, x_of = np.unique(positions[:, 0], return_inverse=True)
        y_m, y_of = np.unique(positions[:, 1], return_inverse=True)
        abreast = [np.flatnonzero(x_of == x).tolist() for x in range(len(x_m))]
        scale = self._pitch_m, self._altitude_m
        along, across = self._plot
        width = masks.shape[1]
        east = Axis.along(x_m, *scale, across, self._window.column, 8 * width)
        north = Axis.along(y_m, *scale, along, self._window.row, self.rows)
        slices = self._met_plates if self._plates else self._met_cubes
        hidden = np.zeros((len(masks), self.rows, width), dtype=np.uint8)
        for by_camera, lines in slices(east, north):
            for views, octets in zip(abreast, by_camera, strict=True):
                turned = np.ascontiguousarray(octets.T)
                for view in views:
                    for rows in lines:
                        hidden[view] |= turned.take(rows[y_of[view]], axis=0)
        masks[...] = hidden.transpose(0, 2, 1)

    def _met_plates(self, east: Axis, north: Axis) -> Iterator[Met]:
        """The octets and rows that rays meet in slices of plates."""
        per_cell = self._per_voxel * self._cell_voxels
        for levels in _parts(self._filled, east, north):
            heights = 0.5 * (self._faces[levels] + self._faces[levels + 1])
            moved = per_cell * _seconds(east, levels)
            columns = MetColumns.of(east.met(heights), self._plot[1], moved)
            first = north.met(heights)
            second = first + per_cell * _seconds(north, levels)
            for place, level in enumerate(levels.tolist()):
                lines = [first[place]]
                if (first[place] != second[place]).any():
                    lines.append(second[place])
                (octets,), lines = self._slices([(level,)], lines)
                yield columns.hidden(octets, place), lines

    def _met_cubes(self, east: Axis, north: Axis) -> Iterator[Met]:
        """The octets and rows that rays meet at the faces between slices of cubes."""
        filled = set(self._filled.tolist())
        for faces in _parts(np.union1d(self._filled, self._filled + 1), east, north):
            all_faces = np.union1d(faces, faces + 1)
            # No slice is above the highest face, so the rays there do not matter.
            heights = self._faces[np.minimum(all_faces, len(self._faces) - 1)]
            columns = MetColumns.of(east.met(heights), self._plot[1])
            rows = north.met(self._faces[faces])
            for place, face in enumerate(faces.tolist()):
                around = tuple(level for level in (face - 1, face) if level in filled)
                merged = [around, (face,)] if face in filled else [around]
                slices, lines = self._slices(merged, [rows[place]])
                at = int(np.searchsorted(all_faces, face))
                hidden = columns.hidden(slices[0], at)
                for above in slices[1:]:
                    for own, beside in zip(hidden, columns.hidden(above, at + 1), strict=True):
                        np.bitwise_or(own, beside, out=own)
                yield hidden, lines

    def _slices(
        self, merged: list[tuple[int, ...]], lines: list[NDArray[np.intp]]
    ) -> tuple[list[Octets], list[NDArray[np.intp]]]:
        """Octets that begin at each column of merged slices, and the rows that targets meet.

        Parameters
        ----------
        merged
            For each result, the slices that are merged into one.
        lines
            Rows of targets that rays meet.
        """
        along = self._plot[0] // self._per_voxel
        lines = [line // self._per_voxel % along for line in lines]
        if 2 * self.rows >= self._plot[0]:
            return [self._from_each_column(levels) for levels in merged], lines
        # Most rows of the plot are not needed, because no ray meets them.
        met, places = np.unique(np.stack(lines), return_inverse=True)
        octets = [from_each_column(self._merged(levels)[:, met]) for levels in merged]
        return octets, list(places.reshape(len(lines), *lines[0].shape))

    def _from_each_column(self, levels: tuple[int, ...]) -> Octets:
        """Octets that begin at each column of merged slices, stored if the volume is not too large."""
        found = self._from_each.get(levels)
        if found is None:
            found = from_each_column(self._merged(levels))
            if 2 * len(self._filled) * found.size <= OCTETS_KEPT:
                self._from_each[levels] = found
        return found

    def _merged(self, levels: tuple[int, ...]) -> Octets:
        """Slices that are packed and merged into one."""
        count = self._plot[1] // 8 + 2
        octets = self._octets(levels[0], count)
        for level in levels[1:]:
            octets = octets | self._octets(level, count)
        return octets


def checked_positions(positions_m: ArrayLike) -> NDArray[np.float64]:
    """Positions as an array of shape (N, 2).  Raises ValueError if they are not finite or have
    another shape.
    """
    offsets = np.asarray(positions_m, dtype=np.float64)
    if offsets.ndim != 2 or offsets.shape[1] != 2 or not np.isfinite(offsets).all():
        raise ValueError("positions are not finite numbers of shape (N, 2)")
    return offsets


def _parts(levels: NDArray[np.intp], *axes: Axis) -> Iterator[NDArray[np.intp]]:
    """Yield levels in groups.  The positions of the rays in a group fit into memory."""
    step = max(POSITIONS_AT_ONCE // max(axis.size for axis in axes), 1)
    for start in range(0, len(levels), step):
        yield levels[start : start + step]


def _seconds(axis: Axis, levels: NDArray[np.intp]) -> NDArray[np.intp]:
    """Number of cells between the first and the second cell that a ray meets in a slice of plates."""
    return plates.seconds(axis.slant, axis.slope, axis.plot, levels).astype(np.intp)
