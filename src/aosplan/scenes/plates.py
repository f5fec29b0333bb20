"""The cells that rays meet in slices of plates.

A ray meets the cell at the middle of each slice. Within a slice, the path of a ray at the angle θ
is sec θ times as long as the path of a vertical ray. The optical depth has to increase by the same
factor. In a share sec θ - 1 of the slices, the ray therefore also meets a neighbouring cell. Cells
are drawn independently of each other, so a neighbouring cell is equivalent to a new random cell.
The slices with two cells are evenly distributed, and differ between views.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Sides = NDArray[np.int8]

SPREAD = np.array([754.877666, 569.840291])
"""Factors that convert positions to evenly distributed numbers.  They are derived from the plastic
number.
"""


def shifts(offsets: Floats, slope: Floats, middle: Floats, per_cell: int) -> NDArray[np.intp]:
    """Shifts [targets] at which telecentric views meet the cells of each slice of plates.

    Parameters
    ----------
    offsets
        Shape (N, 2): offsets of the cameras from their targets, in targets.
    slope
        Shape (N, 2): offsets divided by the altitude, which is tan θ along x and y.
    middle
        Shape (slices,): middle height of each slice divided by the altitude.
    per_cell
        Number of targets along each side of a cell.

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


def seconds(slant: Floats, slope: Floats, across: int, levels: NDArray[np.intp]) -> Sides:
    """The second cell along one axis, which perspective rays meet in some slices.

    Parameters
    ----------
    slant
        Shape (cameras, count): tangents of the angles of rays, projected on the axis.
    slope
        Shape (cameras,): positions of the cameras relative to the plot's centre, divided by the altitude.
    across
        Number of targets along the plot.
    levels
        Shape (slices,): indices of the slices.

    Returns
    -------
    ndarray
        Shape (slices, cameras, count): 0 for rays that meet one cell. For other rays, 1 or -1: the
        second cell is beside the first cell, in the direction of the camera.
    """
    more = np.sqrt(1.0 + slant * slant) - 1.0
    phase = _phase(np.column_stack([slope, np.full(len(slope), across)]))[:, np.newaxis]
    level = levels.astype(np.float64)[:, np.newaxis, np.newaxis]
    again = _again(more, phase, level) > 0
    toward: Sides = np.where(slant < 0.0, -1, 1).astype(np.int8) * again
    return toward


def _phase(positions: Floats) -> Floats:
    """Numbers from 0 to 1 that are evenly distributed over positions, shape (N,)."""
    phases: Floats = (positions @ SPREAD) % 1.0
    return phases


def _again(more: Floats, phase: Floats, level: Floats) -> NDArray[np.intp]:
    """Number of additional cells that rays meet in a slice.  Its mean over the slices is `more`."""
    passed = np.floor((level + 1.0) * more + phase) - np.floor(level * more + phase)
    return passed.astype(np.intp)
