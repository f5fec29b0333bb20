"""Simulated search: places targets on the ground of a forest, computes the integral image, and
applies the detector.

Targets have random places and directions, and the ground has a texture. The detector is described
in `aosplan.scenes.matched_window`. A target is found if the output near it exceeds the threshold.
Each peak above the threshold at another place is a false alarm.

This module does not use the prediction. `aosplan.simulation.compare_search` compares the prediction
and the search.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.scenes.integral_image import (
    TEXTURE,
    TEXTURE_LENGTH_M,
    CanopyRadiance,
    gaussian_field,
    integrate_planes,
    planes_of_layers,
    planes_of_volume,
)
from aosplan.scenes.matched_window import MatchedWindow, peaks
from aosplan.simulation.forests import generator

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.scenes.integral_image import CanopyIntegral
    from aosplan.scenes.scene import Layer
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

PLACINGS = 8
"""Number of times that new targets are placed on the ground of a forest."""

APART_M = 8.0
"""Side of the cells in which targets are placed.  Each cell has one target."""

NEAR_M = 0.3
"""Largest distance along x and y between the centre of a target and an output that can find the
target.
"""

MOST_PEAKS = 400
"""Number of highest peaks that are kept for a forest."""

SIZE_M = 32.0
"""Side of the ground that is searched below one forest."""


class TargetRadiance(NamedTuple):
    """A target and its radiance, in units of the standard deviation of the radiances of occluders.

    Attributes
    ----------
    width_m, length_m
        Size of the target.
    contrast, canopy_offset, crown_share
        C, M, and the share of the canopy's variance that is common to whole crowns.
    """

    width_m: float
    length_m: float
    contrast: float
    canopy_offset: float
    crown_share: float

    @property
    def canopy(self) -> CanopyRadiance:
        """Radiances of the occluders."""
        return CanopyRadiance(self.canopy_offset, self.crown_share)


class Searched(NamedTuple):
    """Output of the detector for one forest.

    Attributes
    ----------
    outputs
        Highest output of the detector near each target.
    seen
        Seen share of each target.
    peaks
        Outputs of the highest peaks without targets, in decreasing order.
    area_m2
        Area in which peaks were searched.
    """

    outputs: Floats
    seen: Floats
    peaks: Floats
    area_m2: float


def search(
    rng: np.random.Generator, integral: CanopyIntegral, look: TargetRadiance, *, wraps: bool = False
) -> Searched:
    """Apply the detector to an integral image, with targets and without.

    Parameters
    ----------
    rng
        Random generator of places and directions.
    integral
        Integral image of one forest.
    look
        Target and radiances.
    wraps
        Whether the integral image is periodic, because the plot is periodic.
    """
    shape, pitch = integral.seen.shape, integral.pitch_m
    ground = TEXTURE * gaussian_field(rng, (shape[0], shape[1]), pitch[0], TEXTURE_LENGTH_M)
    plain = integral.canopy + integral.seen * ground
    detector = MatchedWindow((look.width_m, look.length_m), (shape[0], shape[1]), pitch)
    margin = 0 if wraps else math.ceil(0.5 * detector.box_m / min(pitch)) + 1
    inner = tuple(slice(margin, count - margin) for count in shape)
    heights = peaks(detector.output(plain)[inner], pitch)
    # All places of a periodic image are equivalent, but a target must not cross the edges of any
    # image.
    room = max(margin, *detector.cover(0.0).shape)
    outputs, shares = [], []
    for _ in range(PLACINGS):
        seam = rng.integers(0, shape).tolist() if wraps else (0, 0)
        image, below, open_share = (
            np.roll(each, seam, axis=(0, 1)) for each in (plain, ground, integral.seen)
        )
        places = []
        for row, column, angle in _places(rng, shape, room, pitch[0]):
            cover = detector.cover(angle, *(rng.random(2) - 0.5).tolist())
            rows, columns = (count // 2 for count in cover.shape)
            at = np.s_[row - rows : row + rows + 1, column - columns : column + columns + 1]
            image[at] += cover * open_share[at] * (look.contrast - below[at])
            shares.append(float((cover * open_share[at]).sum() / cover.sum()))
            places.append((row, column))
        found = detector.output(image)
        near = round(NEAR_M / pitch[0])
        outputs += [
            float(found[r - near : r + near + 1, c - near : c + near + 1].max()) for r, c in places
        ]
    area = math.prod(
        (count - 2 * margin) * step for count, step in zip(shape, pitch[::-1], strict=True)
    )
    return Searched(np.array(outputs), np.array(shares), heights[:MOST_PEAKS], area)


def _places(
    rng: np.random.Generator, shape: tuple[int, ...], margin: int, pitch_m: float
) -> list[tuple[int, int, float]]:
    """Places of targets, one in each cell, and their directions."""
    inner = [count - 2 * margin for count in shape]
    cells = [max(int(count * pitch_m / APART_M), 1) for count in inner]
    places = []
    for i in range(cells[0]):
        for k in range(cells[1]):
            cell = np.array([inner[0] / cells[0], inner[1] / cells[1]])
            # Targets are only in half of each cell. A box therefore rarely contains parts of two
            # targets.
            row, column = (margin + (np.array([i, k]) + 0.5 * rng.random(2)) * cell).tolist()
            places.append((int(row), int(column), float(rng.random() * math.pi)))
    return places


def search_layers(
    layers: Sequence[Layer],
    sites_m: Floats,
    altitude_m: float,
    look: TargetRadiance,
    *,
    seed: int,
    index: int,
) -> Searched:
    """Create random independent slices, compute the integral image, and search the ground."""
    rng = generator(seed, index)
    sites = np.asarray(sites_m, dtype=np.float64)
    wide = SIZE_M + float(np.ptp(sites, axis=0).max(initial=0.0)) + 2.0
    planes = planes_of_layers(rng, layers, wide, look.canopy)
    return search(rng, integrate_planes(planes, sites, altitude_m, (SIZE_M, SIZE_M)), look)


def search_volume(
    volume: VoxelVolume,
    sites_m: Floats,
    altitude_m: float,
    look: TargetRadiance,
    *,
    seed: int,
    index: int,
    focal_height_m: float = 0.0,
    parallel: bool = True,
) -> Searched:
    """Search the ground below the voxels of a stand, with random radiances.

    The positions of the cameras are relative to each target.  If `parallel` is false, they are
    relative to the centre of the plot.
    """
    rng = generator(seed, index)
    planes = planes_of_volume(rng, volume, look.canopy, focal_height_m)
    integral = integrate_planes(planes, sites_m, altitude_m, volume.size_m, parallel=parallel)
    return search(rng, integral, look, wraps=parallel)
