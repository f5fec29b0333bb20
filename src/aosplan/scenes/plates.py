"""Rays through slices of plates: the cell at a slice's middle, and further ones for long paths.

A ray at angle θ is sec θ times as long within a slice as a vertical one.  So that its optical
depth grows alike, it meets the cell beside as well, in a share sec θ - 1 of the slices.  Cells are
drawn independently of each other, so the cell beside is as good as a new one.  Which slices
these are differs from view to view, and they lie evenly over the slices.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

SPREAD = np.array([754.877666, 569.840291])
"""Turns positions into numbers that are spread evenly, from the plastic number."""


def shifts(offsets: Floats, slope: Floats, middle: Floats, per_voxel: int) -> NDArray[np.intp]:
    """Shifts [targets] at which telecentric views meet each slice of plates.

    Parameters
    ----------
    offsets
        Shape (N, 2): cameras' offsets from their targets, in targets.
    slope
        Shape (N, 2): the same over the altitude, tan θ along x and y.
    middle
        Shape (slices,): height over altitude of the slices' middles.
    per_voxel
        Targets along either side of a cell.

    Returns
    -------
    ndarray
        Shape (slices, N, 3, 2): of three meetings, those that are not needed repeat another.
    """
    once = np.floor(offsets * middle[:, np.newaxis, np.newaxis] + 0.5).astype(np.intp)
    more = np.sqrt(1.0 + (slope * slope).sum(axis=1)) - 1.0
    levels = np.arange(len(middle), dtype=np.float64)[:, np.newaxis]
    again = np.minimum(_again(more, _phase(slope), levels), 2)[:, :, np.newaxis]
    x_first = np.abs(offsets[:, :1]) >= np.abs(offsets[:, 1:])
    beside = np.where(x_first == (True, False), np.where(offsets < 0.0, -1, 1), 0) * per_voxel
    met = [once, once + np.minimum(again, 1) * beside, once + again * beside]
    return np.stack(met, axis=2)


class Axis(NamedTuple):
    """Targets and cameras of perspective views along one axis.

    Attributes
    ----------
    target
        Shape (count,): places of targets from the plot's middle, in targets.
    camera
        Shape (cameras,): the same of the cameras.
    more
        Shape (cameras, count): sec θ - 1 of the rays, θ seen along this axis.
    toward
        Shape (cameras, count): 1 or -1, direction from the target to the camera.
    phase
        Shape (cameras, 1).
    across
        Targets across the plot.
    per_voxel
        Targets along either side of a cell.
    """

    target: Floats
    camera: Floats
    more: Floats
    toward: NDArray[np.int32]
    phase: Floats
    across: int
    per_voxel: int

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
    ) -> Axis:
        """An axis `across` targets long, of which `count` from the `first` on are looked at."""
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
        )

    def cells(self, height: float, level: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Cells that rays meet in a slice, and the cells beside for those that meet it again.

        Both have the shape (cameras, count), and agree for rays that meet it once.
        """
        place = self.target * (1.0 - height) + self.camera[:, np.newaxis] * height
        place += 0.5 * self.across
        met = np.floor(place / self.per_voxel).astype(np.int32)
        again = _again(self.more, self.phase, np.float64(level)) > 0
        cells = np.int32(self.across // self.per_voxel)
        return met % cells, (met + self.toward * again) % cells


def _phase(positions: Floats) -> Floats:
    """Numbers from 0 to 1 that are spread evenly over positions, shape (N,)."""
    phases: Floats = (positions @ SPREAD) % 1.0
    return phases


def _again(more: Floats, phase: Floats, level: Floats | np.float64) -> NDArray[np.intp]:
    """How often more than once rays meet a slice: `more` on average over the slices."""
    passed = np.floor((level + 1.0) * more + phase) - np.floor(level * more + phase)
    return passed.astype(np.intp)
