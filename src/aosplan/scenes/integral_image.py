"""Simulated integral images of the ground below occluders, in which a search looks for targets.

Occluders are flat square cells in horizontal planes. Each cell has its own radiance. A part of this
radiance is the same for the whole crown. A photo shows the first surface that each ray meets. The
integral image is the mean of the photos, registered on the ground. It is stored in two parts: the
contribution of the canopy, and the share of photos that see each pixel of the ground. The image of
any ground with any targets can then be computed without tracing rays again.

Radiances are in units of σ_c, the standard deviation of the radiance between occluders.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.scenes.scene import Layer
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]
    Image = NDArray[np.float32]

TEXTURE, TEXTURE_LENGTH_M = 0.3, 0.2
"""Standard deviation of the ground's texture, and length L [m] of its correlation exp(-r²/(2
L²)).
"""

CROWN_LENGTH_M = 1.0
"""Length L [m] of the correlation of the radiance that is common to crowns."""

PIXEL_M = 0.1
"""Approximate size of the pixels of an integral on the ground."""


SPREAD = (0.7548776662466927, 0.5698402909980532)
"""Steps by which the offset within a pixel increases from one photo to the next, along x and along
y. With these steps, the photos sample a pixel evenly (Roberts' R2 sequence).
"""


class CanopyRadiance(NamedTuple):
    """Radiance of occluders: the mean M, relative to the mean of the ground, and the share of the
    variance that whole crowns have in common.
    """

    offset: float
    crown_share: float


class OccluderPlane(NamedTuple):
    """Occluders at one height: square cells with their radiance, ``nan`` for empty cells."""

    height_m: float
    cell_m: float
    origin_m: tuple[float, float]
    radiance: Image


class CanopyIntegral(NamedTuple):
    """An integral image in two parts: the share of photos that see each pixel, and the contribution
    of the canopy.

    The integral image of ground with the radiance g is `canopy` + `seen` g.  Pixels are `pitch_m`
    wide along x and y.
    """

    seen: Floats
    canopy: Floats
    pitch_m: tuple[float, float]


def planes_of_layers(
    rng: np.random.Generator, layers: Sequence[Layer], size_m: float, canopy: CanopyRadiance
) -> list[OccluderPlane]:
    """One plane for each independent slice, at the middle height of the slice.  The planes are
    squares centred at the origin.
    """
    crowns = _crowns(rng, size_m)
    planes = []
    for layer in sorted(layers, key=lambda layer: layer.height_m):
        cell = layer.occluder_size_m
        origin = -0.5 * size_m - rng.random(2) * cell
        count = math.ceil(size_m / cell) + 2
        hidden = rng.random((count, count)) < layer.density
        planes.append(_plane(rng, layer.height_m, cell, origin, hidden, crowns, size_m, canopy))
    return planes


def planes_of_volume(
    rng: np.random.Generator,
    volume: VoxelVolume,
    canopy: CanopyRadiance,
    focal_height_m: float = 0.0,
) -> list[OccluderPlane]:
    """Planes of a stand's voxels.

    A slice of cubes has a plane at its bottom and one at its top. A slice of plates has a plane at
    its middle. Heights are relative to the focal plane, which is `focal_height_m` above the ground.
    Slices below the focal plane are ignored. The effect of the longer path of slanted rays through
    plates (1 % at 8°) is neglected.
    """
    _, rows, columns = volume.occupied.shape
    size_m = max(rows, columns) * volume.voxel_m
    crowns = _crowns(rng, size_m)
    origin = -0.5 * volume.voxel_m * np.array([columns, rows])
    planes = []
    thickness = volume.slice_height_m
    for level in np.flatnonzero(volume.slice_densities):
        bottom = float(level) * thickness - focal_height_m
        if bottom + thickness <= 0.0:
            continue
        heights = [max(bottom, 0.0), bottom + thickness]
        if volume.slice_m is not None:
            heights = [0.5 * sum(heights)]
        hidden = volume.occupied[level]
        plane = _plane(rng, heights[0], volume.voxel_m, origin, hidden, crowns, size_m, canopy)
        planes += [plane._replace(height_m=height) for height in heights]
    return planes


def _plane(
    rng: np.random.Generator,
    height_m: float,
    cell_m: float,
    origin: Floats,
    hidden: NDArray[np.bool_],
    crowns: Image,
    size_m: float,
    canopy: CanopyRadiance,
) -> OccluderPlane:
    y, x = (
        ((start + (np.arange(count) + 0.5) * cell_m + 0.5 * size_m) * len(crowns) / size_m).astype(
            np.intp
        )
        % len(crowns)
        for start, count in zip(origin[::-1], hidden.shape, strict=True)
    )
    own = rng.standard_normal(hidden.shape, dtype=np.float32)
    radiance = canopy.offset + math.sqrt(1.0 - canopy.crown_share) * own
    radiance += math.sqrt(canopy.crown_share) * crowns[y[:, None], x]
    radiance[~hidden] = np.nan
    return OccluderPlane(height_m, cell_m, (float(origin[0]), float(origin[1])), radiance)


def _crowns(rng: np.random.Generator, size_m: float) -> Image:
    count = max(math.ceil(4.0 * size_m / CROWN_LENGTH_M), 8)
    return gaussian_field(rng, (count, count), size_m / count, CROWN_LENGTH_M)


def gaussian_field(
    rng: np.random.Generator, shape: tuple[int, int], pitch_m: float, length_m: float
) -> Image:
    """A periodic Gaussian field with variance 1 and correlation exp(-r²/(2 L²))."""
    from scipy.ndimage import gaussian_filter

    spread = length_m / math.sqrt(2.0) / pitch_m
    noise = gaussian_filter(rng.standard_normal(shape), spread, mode="wrap")
    # For a continuous filter, the variance after the filter would be 1/(4 π σ²). Here it is
    # computed from the samples of the filter.
    impulse = np.zeros(shape)
    impulse[0, 0] = 1.0
    scale = math.sqrt(float((gaussian_filter(impulse, spread, mode="wrap") ** 2).sum()))
    return (noise / scale).astype(np.float32)


def integrate_planes(
    planes: Sequence[OccluderPlane],
    sites_m: Floats,
    altitude_m: float,
    size_m: tuple[float, float],
    *,
    parallel: bool = False,
) -> CanopyIntegral:
    """The integral image of a rectangle of ground whose centre is the mean of the sites.

    Parameters
    ----------
    planes
        The planes, in order of increasing height.  They are periodic.
    sites_m
        Camera positions, shape (N, 2).
    altitude_m
        Altitude of the cameras above the ground.
    size_m
        Size of the rectangle along x and y.
    parallel
        Whether the positions of the cameras are relative to each pixel (telecentric).  Otherwise
        all pixels have the same cameras.
    """
    counts = [max(round(length / PIXEL_M), 1) for length in size_m]
    ground = [
        ((np.arange(count) + 0.5) / count - 0.5) * length
        for count, length in zip(counts, size_m, strict=True)
    ]
    seen = np.zeros((counts[1], counts[0]))
    canopy = np.zeros_like(seen)
    steps = [length / count for count, length in zip(counts, size_m, strict=True)]
    for index, site in enumerate(np.asarray(sites_m, dtype=np.float64)):
        # Each photo samples a different point within the pixels. The mean over photos is then
        # similar to real pixels, which average over their area.
        within = [
            ((index + 0.5) * part % 1.0 - 0.5) * step
            for part, step in zip(SPREAD, steps, strict=True)
        ]
        photo = np.full(seen.shape, np.nan, dtype=np.float32)
        for plane in planes:
            ratio = plane.height_m / altitude_m
            near = 1.0 if parallel else 1.0 - ratio
            x, y = (
                np.floor(((axis + off) * near + at * ratio - start) / plane.cell_m).astype(np.intp)
                for axis, off, at, start in zip(ground, within, site, plane.origin_m, strict=True)
            )
            rows, columns = plane.radiance.shape
            met = plane.radiance.take(y % rows, axis=0).take(x % columns, axis=1)
            np.copyto(photo, met, where=~np.isnan(met))
        clear = np.isnan(photo)
        seen += clear
        canopy += np.where(clear, np.float32(0.0), photo)
    return CanopyIntegral(seen / len(sites_m), canopy / len(sites_m), (steps[0], steps[1]))
