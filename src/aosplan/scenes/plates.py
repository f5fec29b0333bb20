"""The cells that rays meet in slices of plates.

A ray meets the cell at the middle of each slice.  Within a slice, the path of a ray at the angle θ
is sec θ times as long as that of a vertical ray.  To make its optical depth increase by the same
factor, the ray also meets a neighbouring cell in a share sec θ - 1 of the slices.  Cells are drawn
independently of each other, so that a neighbouring cell is equivalent to a new random cell.  The
choice of slices differs between views and is evenly distributed over the slices.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

SPREAD = np.array([754.877666, 569.840291])
"""Factors that convert positions to evenly distributed numbers.  They are derived from the plastic
number.
"""


def shifts(offsets: Floats, slope: Floats, middle: Floats, per_cell: int) -> NDArray[np.intp]:
    """Shifts [targets] at which telecentric views meet the cells of each slice of plates.

    Parameters
    ----------
    offsets
        Shape (N, 2):
    offsets
        of the cameras from their targets, in targets.
    slope
        Shape (N, 2): offsets divided by the altitude, which is tan θ along x and y.
    middle
        Shape (slices,): middle height of each slice divided by the altitude.
    per_cell
        Targets along each side of a cell.

    Returns
    -------
    ndarray
        Shape (slices, N, 3, 2): shifts for up to three cells that a ray meets.  If a ray meets
        fewer cells, shifts are repeated.
    """
    once = np.floor(offsets * middle[:, np.newaxis, np.newaxis] + 0.5).astype(np.intp)
    more = np.sqrt(1.0 + (slope * slope).sum(axis=1)) - 1.0
    levels = np.arange(len(middle), dtype=np.float64)[:, np.newaxis]
    again = np.minimum(_again(more, _phase(slope), levels), 2)[:, :, np.newaxis]
    x_first = np.abs(offsets[:, :1]) >= np.abs(offsets[:, 1:])
    beside = np.where(x_first == (True, False), np.where(offsets < 0.0, -1, 1), 0) * per_cell
    met = [once, once + np.minimum(again, 1) * beside, once + again * beside]
    return np.stack(met, axis=2)


class Axis(NamedTuple):
    """Targets and cameras of perspective views along one axis.

    Attributes
    ----------
    target
        Shape (count,): positions of targets relative to the plot's centre, in targets.
    camera
        Shape (cameras,): positions of cameras relative to the plot's centre, in targets.
    more
        Shape (cameras, count): sec θ - 1 of the rays, where θ is the angle of the ray projected on
        this axis.
    toward
        Shape (cameras, count): 1 or -1, the direction from the target to the camera.
    phase
        Shape (cameras, 1): start of the sequence that selects the slices with a second cell.
    across
        Number of targets along the plot.
    per_voxel
        Targets along each side of a voxel.
    cell_voxels
        Voxels along each side of a cell.
    """

    target: Floats
    camera: Floats
    more: Floats
    toward: NDArray[np.int32]
    phase: Floats
    across: int
    per_voxel: int
    cell_voxels: int

    @classmethod
    def along(
        cls,
        camera_m: Floats,
        across: int,
        first: int,
        count: int,
        pitch_m: float,
        altitude_m: float,
        per_voxel: int,
        cell_voxels: int,
    ) -> Axis:
        """An axis of `across` targets, with the `count` targets from `first` on."""
        target = (np.arange(first, first + count) + (0.5 - 0.5 * across)).astype(np.float64)
        slant = (camera_m[:, np.newaxis] - target * pitch_m) / altitude_m
        return cls(
            target,
            camera_m / pitch_m,
            np.sqrt(1.0 + slant * slant) - 1.0,
            np.where(slant < 0.0, -1, 1).astype(np.int32),
            _phase(np.column_stack([camera_m / altitude_m, np.full(len(camera_m), across)]))[
                :, np.newaxis
            ],
            across,
            per_voxel,
            cell_voxels,
        )

    def cells(self, height: float, level: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """First and second cell that rays meet in a slice.

        Both arrays have the shape (cameras, count).  If a ray meets only one cell, the second cell
        equals the first.
        """
        place = self.target * (1.0 - height) + self.camera[:, np.newaxis] * height
        place += 0.5 * self.across
        met = np.floor(place / self.per_voxel).astype(np.int32)
        again = (_again(self.more, self.phase, np.float64(level)) > 0) * np.int32(self.cell_voxels)
        cells = np.int32(self.across // self.per_voxel)
        return met % cells, (met + self.toward * again) % cells


def _phase(positions: Floats) -> Floats:
    """Numbers from 0 to 1 that are evenly distributed over positions, shape (N,)."""
    phases: Floats = (positions @ SPREAD) % 1.0
    return phases


def _again(more: Floats, phase: Floats, level: Floats | np.float64) -> NDArray[np.intp]:
    """Number of additional cells that rays meet in a slice.  Its mean over the slices is `more`."""
    passed = np.floor((level + 1.0) * more + phase) - np.floor(level * more + phase)
    return passed.astype(np.intp)
