"""Estimation of small errors of poses, from the shift of each view relative to the integral of the
other views.

If the recorded position of a view is wrong, its detail is shifted on the focal plane. Let e_i be
the shifts of all views, and b_i their positions relative to their centre. The shifts are a sum of
three parts. The first part is proportional to b_i. It is caused by a wrong height h of the plane: e
= -b (h* - h)/(A - h*), where A is the height of the cameras and h* the true height of the plane.
The second part is a rotation around the centre. It is caused by a common yaw error ψ: e = ψ × b.
The rest is caused by errors of the positions. Random errors of positions also contribute to the
first and the second part. With the standard deviation σ of the positions, the standard errors of
height and yaw are therefore σ (A
- h)/√Σb² and σ/√Σb².
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.postflight.integral.agreement import on_plane

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.postflight.integral.agreement import Detail
    from aosplan.postflight.integral.camera_pose import View
    from aosplan.postflight.integral.focal_plane import Plane, Raster

    Floats = NDArray[np.float64]

CLEAR = 3.0
"""A shift is significant if its correlation exceeds the correlations of other shifts by this number
of robust standard deviations.
"""


class Correction(NamedTuple):
    """Corrections of recorded poses.

    Attributes
    ----------
    yaw_deg
        Rotation of all cameras, clockwise as seen from above.
    shifts_m
        Shape (N, 2): shifts of the cameras along x and y of the plane.
    """

    yaw_deg: float
    shifts_m: Floats

    @classmethod
    def none(cls, count: int) -> Correction:
        """A correction by zero, for the given number of views."""
        return cls(0.0, np.zeros((count, 2)))

    def applied(self, views: Sequence[View], frame: Floats) -> list[View]:
        """Views with corrected poses.  The rows of `frame` are the axes of the plane."""
        c, s = math.cos(math.radians(self.yaw_deg)), math.sin(math.radians(self.yaw_deg))
        clockwise = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        turn = frame.T @ clockwise @ frame
        return [
            view.moved(frame[:2].T @ shift, turn)
            for view, shift in zip(views, self.shifts_m, strict=True)
        ]


class Fit(NamedTuple):
    """The parts of the shifts of views: growth and rotation, both divided by the distance from the
    centre, and the rest [m].
    """

    growth: float
    turn_rad: float
    rest_m: Floats
    clear: NDArray[np.bool_]


def shifts_of(
    details: Sequence[Detail], views: Sequence[View], plane: Plane, raster: Raster, reach_m: float
) -> tuple[Floats, NDArray[np.bool_]]:
    """Shift of each view relative to the integral of the other views [m], and whether this shift is
    significant.

    Parameters
    ----------
    details, views
        Detail of N views, and the poses with which it is projected on the plane.
    plane, raster
        Plane and raster of the projection.
    reach_m
        Largest shift to examine along x and y.

    Returns
    -------
    shifts, clear
        The shifts, shape (N, 2), and a mask of the significant shifts, shape (N,).
    """
    from scipy.fft import irfft2, next_fast_len, rfft2

    images = np.stack(
        [on_plane(detail, view, plane, raster) for detail, view in zip(details, views, strict=True)]
    )
    seen = np.isfinite(images)
    images[~seen] = 0.0
    total, count = images.sum(axis=0), seen.sum(axis=0)
    reach = max(math.ceil(reach_m / raster.gsd_m), 2)
    reach = min(reach, min(raster.rows, raster.columns) // 2)
    shape = [next_fast_len(side + 2 * reach, real=True) for side in total.shape]
    shifts, clear = np.zeros((len(images), 2)), np.zeros(len(images), dtype=bool)
    for index, image in enumerate(images):
        others = (total - image) / np.maximum(count - seen[index], 1)
        product = irfft2(rfft2(image, shape) * np.conj(rfft2(others, shape)), shape)
        near = np.roll(product, (reach, reach), (0, 1))[: 2 * reach + 1, : 2 * reach + 1]
        row, column = np.unravel_index(int(np.argmax(near)), near.shape)
        middle = np.median(near)
        spread = 1.4826 * np.median(np.abs(near - middle))
        clear[index] = near[row, column] - middle > CLEAR * spread > 0.0
        shifts[index] = (
            (_between(near[row], int(column)) - reach) * raster.gsd_m,
            (reach - _between(near[:, column], int(row))) * raster.gsd_m,
        )
    return shifts, clear


def _between(values: Floats, index: int) -> float:
    """Index of the largest value, interpolated by the parabola through it and its neighbours."""
    if not 0 < index < len(values) - 1:
        return float(index)
    before, here, after = values[index - 1 : index + 2]
    bend = before - 2.0 * here + after
    return index + (0.5 * float((before - after) / bend) if bend < 0.0 else 0.0)


def fitted(shifts_m: Floats, clear: NDArray[np.bool_], positions_m: Floats) -> Fit:
    """Growth, rotation and rest of shifts, from a least-squares fit to the significant shifts."""
    from_middle = positions_m - positions_m.mean(axis=0)
    x, y = from_middle.T
    ones, zeros = np.ones_like(x), np.zeros_like(x)
    terms = np.stack(
        [
            np.column_stack([ones, zeros]).ravel(),
            np.column_stack([zeros, ones]).ravel(),
            np.column_stack([x, y]).ravel(),
            np.column_stack([-y, x]).ravel(),
        ],
        axis=1,
    )
    rows = np.repeat(clear, 2)
    found, *_ = np.linalg.lstsq(terms[rows], shifts_m.ravel()[rows], rcond=None)
    rest = (shifts_m.ravel() - terms @ found).reshape(-1, 2)
    return Fit(float(found[2]), float(found[3]), np.where(clear[:, None], rest, 0.0), clear)
