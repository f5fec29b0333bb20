"""The target on the ground, and the kernels for the statistics of a window of its size.

A target is a rectangle of w x l with a random direction. The detector takes the mean of the
integral image over such a window and subtracts the mean of a box around it. Second moments of both
means are integrals of a covariance R(δ) over the offset δ of two points. Let A and B be the two
areas over which means are taken. The weight w_AB is their covariogram (Matheron's random sets;
Adler 1981):

    Cov(mean over A, mean over B) = ∫ w_AB(δ) R(δ) dδ,   w_AB(δ) = |A ∩ (B - δ)| / (|A| |B|).

For two equal rectangles, w_AB is a product of two triangles along the sides of the rectangle.
`kernels` computes the mean of w_AB over all directions of the target, on a lattice of offsets.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.scenes.integral_image import PIXEL_M
from aosplan.scenes.matched_window import BOX_M, DIRECTIONS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

TURN = math.pi / DIRECTIONS
"""Angle between two neighbouring directions [rad]."""

FINEST_STEP = 0.15
"""Step of the lattice at its centre, as a share of the length over which covariances change."""

NARROWEST_STEP_M = 0.015
"""Smallest step of the lattice."""


class Target(NamedTuple):
    """Width and length of a target [m].  The width is the shorter side."""

    width_m: float
    length_m: float

    @property
    def area_m2(self) -> float:
        """Area of the target."""
        return self.width_m * self.length_m

    @property
    def diagonal_m(self) -> float:
        """Largest distance between two points of the target."""
        return math.hypot(self.width_m, self.length_m)

    @property
    def box_m(self) -> float:
        """Side of the detector's box. It is `BOX_M`, or longer if the target is large compared with
        `BOX_M`.
        """
        return max(BOX_M, 2.0 * self.diagonal_m)

    @property
    def kept(self) -> float:
        """Share of the target's signal that remains after the mean of the box is subtracted."""
        return 1.0 - self.area_m2 / self.box_m**2

    @property
    def matched(self) -> float:
        """Share of the target that the window covers, at the best direction and the best pixel.

        If the window is rotated by θ relative to a long target, it misses the share |θ| l/(4 w) of
        the target. The mean of |θ| is a quarter of the angle between two neighbouring directions.
        If the window is shifted by a along a side of length s, it misses the share a/s. The mean of
        a is a quarter of a pixel, but only half of this mean is used here. According to
        simulations, the detector regains the other half, because it uses the highest output in the
        neighbourhood.
        """
        missed = 0.25 * TURN * 0.25 * self.length_m / self.width_m
        missed += 0.125 * PIXEL_M * (1.0 / self.width_m + 1.0 / self.length_m)
        return 1.0 - min(missed, 0.5)


class Kernels(NamedTuple):
    """Kernels: weights of offsets on two lattices. The sum of the weights of each kernel is 1.

    Attributes
    ----------
    fine_m, coarse_m
        Offsets along each axis [m], symmetric about 0.
    window
        Shape (4, n, n), on the fine lattice.  Each kernel is for the window and a second window.
        The second window is one of four: the same window, the window shifted by `step_m` along its
        length, the window shifted by `step_m` along its width, and the window rotated by `turn`.
    box
        Shape (2, m, m), on the coarse lattice.  The kernels are for window and box, and for the box
        and itself.
    step_m, turn
        The shift and the rotation [rad] in `window`.
    """

    fine_m: Floats
    coarse_m: Floats
    window: Floats
    box: Floats
    step_m: float
    turn: float


@lru_cache(maxsize=64)
def kernels(target: Target, resolution_m: float) -> Kernels:
    """Kernels of a target, averaged over its directions.

    Parameters
    ----------
    target
        The target, which has the same size as the window.
    resolution_m
        Length over which covariances change: the size of the occluders, projected on the ground.
        The fine lattice has the smallest steps at its centre, because the covariance is largest
        there.  Its steps are smaller than the width of the target everywhere.
    """
    step = 0.15 * target.width_m
    fine, widths = _sinh_axis(
        target.diagonal_m + step,
        max(FINEST_STEP * min(resolution_m, target.width_m), NARROWEST_STEP_M),
        max(0.22 * target.width_m, target.diagonal_m / 24.0),
    )
    coarse, coarse_widths = _sinh_axis(
        target.box_m,
        max(0.3 * min(resolution_m, target.width_m), NARROWEST_STEP_M),
        target.box_m / 24.0,
    )
    window = np.zeros((4, len(fine), len(fine)))
    y, x = np.meshgrid(fine, fine, indexing="ij")
    angles = (np.arange(2 * DIRECTIONS) + 0.5) * (0.5 * TURN)
    for angle in angles.tolist():
        along = x * math.cos(angle) + y * math.sin(angle)
        across = y * math.cos(angle) - x * math.sin(angle)
        length, width = _triangle(along, target.length_m), _triangle(across, target.width_m)
        window[0] += length * width
        for sign in (-0.5, 0.5):
            window[1] += 0.5 * _triangle(along + 2.0 * sign * step, target.length_m) * width
            window[2] += 0.5 * length * _triangle(across + 2.0 * sign * step, target.width_m)
    window *= np.outer(widths, widths)
    window[:3] /= window[:3].sum(axis=(1, 2), keepdims=True)
    # For rotated windows, there is no short formula. The effect of the rotation is computed from
    # pairs of points of both windows: the weights with the rotation minus the weights without it.
    turned = _paired(target, fine, 0.5 * TURN) - _paired(target, fine, 0.0)
    window[3] = window[0] + turned
    boxes = _boxes(target, coarse) * np.outer(coarse_widths, coarse_widths)
    boxes /= boxes.sum(axis=(1, 2), keepdims=True)
    return Kernels(fine, coarse, window, boxes, step, 0.5 * TURN)


def _sinh_axis(reach: float, closest: float, widest: float) -> tuple[Floats, Floats]:
    """Nodes s sinh(c k) up to a reach, and the widths of the intervals around them. The widths
    increase from `closest` to `widest`.
    """
    ratio = max(widest / closest, 1.2)
    scale = reach / math.sqrt(ratio * ratio - 1.0)
    count = math.ceil(math.acosh(ratio) * scale / closest)
    bend = math.acosh(ratio) / count
    place = bend * np.arange(-count, count + 1.0)
    return scale * np.sinh(place), scale * bend * np.cosh(place)


def _triangle(offset: Floats, side: float) -> Floats:
    overlap: Floats = np.maximum(1.0 - np.abs(offset) / side, 0.0)
    return overlap


def points_of(target: Target, pitch_m: float) -> Floats:
    """Points that are evenly distributed over a target, shape (n, 2).  The length of the target is
    along x.
    """
    counts = [max(round(side / pitch_m), 2) for side in (target.length_m, target.width_m)]
    along, across = (
        ((np.arange(count) + 0.5) / count - 0.5) * side
        for count, side in zip(counts, (target.length_m, target.width_m), strict=True)
    )
    return np.stack(np.meshgrid(along, across, indexing="ij"), axis=-1).reshape(-1, 2)


def rotation(angle: float) -> Floats:
    """Matrix that rotates row vectors (x, y) counterclockwise."""
    return np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])


def _paired(target: Target, axis: Floats, turn: float) -> Floats:
    """Distribution of the offset between points of a window and points of the same window after a
    rotation.
    """
    points = points_of(target, target.width_m / 5.0)
    apart = (points[:, None] @ rotation(turn) - points[None]).reshape(-1, 2)
    last = len(axis) - 1
    found = np.zeros((len(axis), len(axis)))
    for angle in (np.arange(2 * DIRECTIONS) + 0.5) * (0.5 * TURN):
        place = np.interp(apart @ rotation(angle), axis, np.arange(last + 1.0))
        place = np.minimum(place, last - 1e-9)
        whole = place.astype(np.intp)
        part = place - whole
        for dy in (0, 1):
            for dx in (0, 1):
                weight = np.where(dx, part[:, 0], 1.0 - part[:, 0])
                weight = weight * np.where(dy, part[:, 1], 1.0 - part[:, 1])
                cell = (whole[:, 1] + dy) * len(axis) + whole[:, 0] + dx
                found += np.bincount(cell, weight, found.size).reshape(found.shape)
    total: Floats = found / found.sum()
    return total


def _boxes(target: Target, axis: Floats) -> Floats:
    """Weights for window and box, and for the box and itself.  The box is parallel to the axes."""
    side, edge = target.box_m, target.box_m / 26.0
    both = _triangle(axis, side)
    # For each point of the window, the box is shifted relative to the point. The weights are means
    # over these points.
    points = points_of(target, target.width_m / 3.0)
    mixed = np.zeros((len(axis), len(axis)))
    for angle in (np.arange(DIRECTIONS) + 0.5) * TURN:
        x, y = (points @ rotation(angle)).T
        inside = [
            np.clip((0.5 * side - np.abs(axis[None] + place[:, None])) / edge + 0.5, 0.0, 1.0)
            for place in (x, y)
        ]
        mixed += inside[1].T @ inside[0]
    return np.stack([mixed, np.outer(both, both)])
