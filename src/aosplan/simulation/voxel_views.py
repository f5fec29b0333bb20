"""What views hide of the targets below a volume of voxels, counted in bounded memory.

The views are bit masks (`aosplan.scenes.occlusion`): slices of voxels, shifted and put one over the
other.  Here they are added up, a tile of targets and a batch of views at a time, so that memory
grows with neither.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

import numpy as np

from aosplan.scenes.occlusion import Occlusion, Tally, Window
from aosplan.simulation.moments import Counts

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike, NDArray

    from aosplan.scenes.occlusion import ViewKind
    from aosplan.scenes.voxels import VoxelVolume

TILE_TARGETS = 1 << 23
"""Targets of a tile: a megabyte for each view."""

BATCH_OCTETS = 1 << 26
"""Memory for the views of a tile that are made at a time."""


class _Given(TypedDict):
    volume: VoxelVolume
    altitude_m: float
    view: ViewKind
    targets_per_voxel: int
    focal_height_m: float


class VoxelViews:
    """Views from one altitude on the targets below one volume.

    Parameters
    ----------
    volume
        What stands on the plot, which wraps.
    altitude_m
        Above the focal plane, and above everything that stands.
    view
        ``telecentric`` or ``perspective``, as in `aosplan.scenes.occlusion`.
    targets_per_voxel
        Targets along either side of a voxel; None for what the volume calls for.
    focal_height_m
        Height of the focal plane above the ground.
    window
        The targets that count; None for all of the plot.
    """

    def __init__(
        self,
        volume: VoxelVolume,
        altitude_m: float,
        *,
        view: ViewKind = "perspective",
        targets_per_voxel: int | None = None,
        focal_height_m: float = 0.0,
        window: Window | None = None,
    ) -> None:
        if targets_per_voxel is None:
            targets_per_voxel = volume.targets_per_voxel
        _, rows, columns = volume.occupied.shape
        whole = Window(0, 0, rows * targets_per_voxel, columns * targets_per_voxel)
        self.window = window or whole
        # What the views on any part of the targets have in common.
        self._given: _Given = {
            "volume": volume,
            "altitude_m": altitude_m,
            "view": view,
            "targets_per_voxel": targets_per_voxel,
            "focal_height_m": focal_height_m,
        }

    def within(self, window: Window) -> VoxelViews:
        """The same views on a part of the targets."""
        return VoxelViews(**self._given, window=window)

    def counts(self, positions_m: ArrayLike) -> Counts:
        """How often the targets are hidden from cameras, shape (N, 2), east and north."""
        total: Counts | None = None
        for tile in tiles(self.window, TILE_TARGETS):
            occlusion = Occlusion(**self._given, window=tile)
            tally = Tally(occlusion.words)
            for masks in _batches(occlusion, positions_m):
                for mask in masks:
                    tally.add(mask)
            found = Counts(tally.views, occlusion.targets, *tally.moments())
            total = found if total is None else total + found
        assert total is not None  # a window has at least one tile
        return total

    def blocked_views(self, positions_m: ArrayLike) -> NDArray[np.int32]:
        """How many of the views hide each target: shape (rows, columns), north and east.

        Over N, it is the integral image of a black ground below white trees, and one minus the
        share of views that see each target.
        """
        window = self.window
        blocked = np.zeros((window.rows, window.columns), dtype=np.int32)
        for tile in tiles(window, TILE_TARGETS):
            occlusion = Occlusion(**self._given, window=tile)
            row, column = tile.row - window.row, tile.column - window.column
            part = blocked[row : row + tile.rows, column : column + tile.columns]
            for masks in _batches(occlusion, positions_m):
                for mask in masks:
                    part += occlusion.unpack(mask[np.newaxis])[0]
        return blocked


def tiles(window: Window, most_targets: int) -> Iterator[Window]:
    """Parts of a window, of whole rows where they fit, each of no more targets than that."""
    columns = min(window.columns, max(most_targets // 64, 1) * 64)
    rows = min(window.rows, max(most_targets // columns, 1))
    for row in range(0, window.rows, rows):
        for column in range(0, window.columns, columns):
            yield Window(
                window.row + row,
                window.column + column,
                min(rows, window.rows - row),
                min(columns, window.columns - column),
            )


def blocks(window: Window, rows: int, columns: int) -> list[Window]:
    """A window cut into rows x columns blocks, as equal as whole targets allow."""
    y = [window.row + window.rows * k // rows for k in range(rows + 1)]
    x = [window.column + window.columns * k // columns for k in range(columns + 1)]
    return [
        Window(y[i], x[k], y[i + 1] - y[i], x[k + 1] - x[k])
        for i in range(rows)
        for k in range(columns)
        if y[i] < y[i + 1] and x[k] < x[k + 1]
    ]


def _batches(occlusion: Occlusion, positions_m: ArrayLike) -> Iterator[NDArray[np.uint64]]:
    positions = np.asarray(positions_m, dtype=np.float64)
    # Views that share their place along x share work: they come one after the other.
    positions = positions[np.lexsort((positions[:, 1], positions[:, 0]))]
    step = max(BATCH_OCTETS // (8 * occlusion.words), 1)
    for start in range(0, len(positions), step):
        yield occlusion.masks(positions[start : start + step])
