"""Counts of the targets below a voxel volume that are hidden in views, computed with limited
memory.

The views are bit masks, which are computed from shifted slices of voxels
(`aosplan.scenes.occlusion`). This module adds up the masks for one tile of targets and one batch of
views at a time. The required memory therefore does not depend on the number of targets or views.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

import numpy as np

from aosplan.scenes.hidden_counts import HiddenCount
from aosplan.scenes.occlusion import Occlusion, PlotWindow
from aosplan.simulation.moments import Counts

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike, NDArray

    from aosplan.scenes.occlusion import ViewKind
    from aosplan.scenes.voxels import VoxelVolume

TILE_TARGETS = 1 << 23
"""Number of targets of a tile.  A view of a tile takes one megabyte."""

BATCH_OCTETS = 1 << 26
"""Memory for the views of a tile that are computed at once [bytes]."""


class _Given(TypedDict):
    volume: VoxelVolume
    altitude_m: float
    view: ViewKind
    targets_per_voxel: int
    focal_height_m: float


class VoxelViews:
    """Views of the targets below one volume, all from the same altitude.

    Parameters
    ----------
    volume
        The voxels of the plot, which is periodic.
    altitude_m
        Altitude above the focal plane.  It has to be above all voxels.
    view
        ``telecentric`` or ``perspective``, as in `aosplan.scenes.occlusion`.
    targets_per_voxel
        Number of targets along each side of a voxel; None for the default of the volume.
    focal_height_m
        Height of the focal plane above the ground.
    window
        The targets that are counted; None for the whole plot.
    """

    def __init__(
        self,
        volume: VoxelVolume,
        altitude_m: float,
        *,
        view: ViewKind = "perspective",
        targets_per_voxel: int | None = None,
        focal_height_m: float = 0.0,
        window: PlotWindow | None = None,
    ) -> None:
        if targets_per_voxel is None:
            targets_per_voxel = volume.targets_per_voxel
        _, rows, columns = volume.occupied.shape
        whole = PlotWindow(0, 0, rows * targets_per_voxel, columns * targets_per_voxel)
        self.window = window or whole
        # These arguments are the same for all parts of the targets.
        self._given: _Given = {
            "volume": volume,
            "altitude_m": altitude_m,
            "view": view,
            "targets_per_voxel": targets_per_voxel,
            "focal_height_m": focal_height_m,
        }

    def within(self, window: PlotWindow) -> VoxelViews:
        """The same views of some of the targets."""
        return VoxelViews(**self._given, window=window)

    def counts(self, positions_m: ArrayLike) -> Counts:
        """Two sums over the targets: of the number of views in which a target is hidden, and of the
        square of this number. Camera positions have the shape (N, 2), east and north.
        """
        total: Counts | None = None
        for tile in tiles(self.window, TILE_TARGETS):
            occlusion = Occlusion(**self._given, window=tile)
            tally = HiddenCount(occlusion.words)
            for masks in _batches(occlusion, positions_m):
                for mask in masks:
                    tally.add(mask)
            found = Counts(tally.views, occlusion.targets, *tally.moments())
            total = found if total is None else total + found
        assert total is not None  # A window has at least one tile.
        return total

    def blocked_views(self, positions_m: ArrayLike) -> NDArray[np.int32]:
        """Number of views in which each target is hidden, shape (rows, columns). Rows are
        northwards and columns eastwards.

        The number divided by N is the integral image of black ground below white trees. It is also
        1 minus the share of views that see each target.
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


def tiles(window: PlotWindow, most_targets: int) -> Iterator[PlotWindow]:
    """Parts of a window with at most `most_targets` targets, as whole rows if possible."""
    columns = min(window.columns, max(most_targets // 64, 1) * 64)
    rows = min(window.rows, max(most_targets // columns, 1))
    for row in range(0, window.rows, rows):
        for column in range(0, window.columns, columns):
            yield PlotWindow(
                window.row + row,
                window.column + column,
                min(rows, window.rows - row),
                min(columns, window.columns - column),
            )


def blocks(window: PlotWindow, rows: int, columns: int) -> list[PlotWindow]:
    """A window, divided into rows x columns blocks.  Their sizes differ by at most one target."""
    y = [window.row + window.rows * k // rows for k in range(rows + 1)]
    x = [window.column + window.columns * k // columns for k in range(columns + 1)]
    return [
        PlotWindow(y[i], x[k], y[i + 1] - y[i], x[k + 1] - x[k])
        for i in range(rows)
        for k in range(columns)
        if y[i] < y[i + 1] and x[k] < x[k + 1]
    ]


def _batches(occlusion: Occlusion, positions_m: ArrayLike) -> Iterator[NDArray[np.uint64]]:
    positions = np.asarray(positions_m, dtype=np.float64)
    # Views with the same position along x share part of the computation. They are therefore
    # computed one after the other.
    positions = positions[np.lexsort((positions[:, 1], positions[:, 0]))]
    step = max(BATCH_OCTETS // (8 * occlusion.words), 1)
    for start in range(0, len(positions), step):
        yield occlusion.masks(positions[start : start + step])
