"""Random forests as voxels.

There are two kinds, which match the statistics of a scene:

- `uniform_forest` and `layered_forest`: independent slices. A slice is a plane of square cells with
  a random phase. The density of the slice is the probability that a cell is occupied. If the slice
  is thick enough, cells are as thick as they are wide. Oblique rays therefore meet the sides of
  cells.
- `clumped_forest`: trees with a trunk and a crown of leafy clumps.  Leaves are removed until the
  stand hides the required share of the ground from vertically above.  As in real stands, slices are
  not independent.

All random numbers come from one `numpy.random.Generator`; `generator` gives the same numbers on
every platform.  Plots are periodic.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.errors import RequestError
from aosplan.scenes.density import slice_density
from aosplan.scenes.scene import UniformScene
from aosplan.scenes.voxels import FACE, VoxelVolume

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from aosplan.scenes.scene import Layer, Scene

MOST_VOXELS = 1 << 26
"""Largest number of voxels of a volume. If a forest would need more voxels, the voxels are made
larger.
"""

VOXELS_AN_OCCLUDER = 3
"""Number of voxels along the edge of a cube, unless the volume would be too large."""

BISECTIONS = 40


def generator(seed: int, index: int = 0) -> np.random.Generator:
    """The random generator for sample `index` of a simulation.  It gives the same numbers on every
    platform.
    """
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, index))))


def voxel_for(occluder_size_m: float, size_m: tuple[float, float], top_m: float) -> float:
    """Voxel size [m] for cubes: a third, half or all of the edge of a cube, or more if there would
    be too many voxels.

    If voxels are smaller than a cube, cells of different slices can start at different positions.
    """
    for parts in range(VOXELS_AN_OCCLUDER, 0, -1):
        voxel_m = occluder_size_m / parts
        if _smallest_voxel_m(voxel_m, size_m, top_m) <= voxel_m:
            return voxel_m
    return _smallest_voxel_m(occluder_size_m, size_m, top_m)


def _smallest_voxel_m(wanted_m: float, size_m: tuple[float, float], top_m: float) -> float:
    """The requested voxel size, or the smallest voxel size for which the volume is not too
    large.
    """
    width, depth = (max(length, wanted_m) for length in size_m)
    return max(wanted_m, math.cbrt(width * depth * max(top_m, wanted_m) / MOST_VOXELS))


def uniform_forest(
    rng: np.random.Generator,
    slice_density: float,
    occluder_size_m: float,
    volume_base_m: float,
    volume_height_m: float,
    size_m: tuple[float, float],
    *,
    of_leaves: bool = False,
) -> VoxelVolume:
    """A volume of cubes of one size: the model of the paper (section II), before projection.

    Parameters
    ----------
    rng
        Random generator of the forest.
    slice_density
        D, share of a slice of one occluder's thickness that is filled with occluders.
    occluder_size_m
        o, edge length of an occluder.
    volume_base_m, volume_height_m
        Height of the bottom of the volume, and its thickness l.
    size_m
        Size of the plot along x and y.
    """
    if not 0.0 <= slice_density <= 1.0:
        raise RequestError(f"forest: slice density {slice_density:g} is not between 0 and 1")
    top_m = volume_base_m + volume_height_m
    voxel_m = voxel_for(occluder_size_m, size_m, top_m)
    canvas = _Canvas(size_m, voxel_m, top_m, of_leaves=of_leaves)
    # The volume has whole slices from the base upwards. The rest of the volume is one slice with
    # parts of cubes.
    slices = volume_height_m / occluder_size_m
    if voxel_m > occluder_size_m:
        canvas.add(rng, volume_base_m, top_m, _thinned(slice_density, 1.0 / slices), voxel_m)
    for k in range(math.ceil(slices - 1e-9) if voxel_m <= occluder_size_m else 0):
        bottom = volume_base_m + k * occluder_size_m
        share = min(slices - k, 1.0)
        density = _thinned(slice_density, 1.0 / share)
        canvas.add(rng, bottom, bottom + share * occluder_size_m, density, occluder_size_m)
    return canvas.volume("uniform forest")


def layered_forest(
    rng: np.random.Generator,
    layers: Sequence[Layer],
    size_m: tuple[float, float],
    *,
    of_leaves: bool = False,
) -> VoxelVolume:
    """Independent layers, each with its own occluder size and density.

    Parameters
    ----------
    rng
        Random generator of the forest.
    layers
        For each layer: bottom and top [m], share D that blocks a vertical ray, and occluder size
        [m].  A layer that is thicker than its occluders is filled with several independent slices.
        Together, these slices block the share D.
    size_m
        Size of the plot along x and y.
    """
    filled = [layer for layer in layers if layer.density > 0.0]
    top_m = max((layer.top_m for layer in filled), default=0.0)
    finest = min(
        (min(layer.occluder_size_m, layer.top_m - layer.bottom_m) for layer in filled),
        default=min(size_m),
    )
    canvas = _Canvas(size_m, voxel_for(finest, size_m, top_m), top_m, of_leaves=of_leaves)
    for layer in filled:
        canvas.add(rng, layer.bottom_m, layer.top_m, layer.density, layer.occluder_size_m)
    return canvas.volume("layered forest")


def clumped_forest(
    rng: np.random.Generator,
    density: float,
    occluder_size_m: float,
    volume_base_m: float,
    volume_height_m: float,
    size_m: tuple[float, float],
    *,
    of_leaves: bool = False,
) -> VoxelVolume:
    """A stand of trees that hides a given share of the ground from vertically above.

    Trees are placed at random until they cover the given share of the ground and half of the rest.
    A crown is an ellipsoid in which whole clumps are either leafy or empty.  Only as many leafy
    voxels are kept as the density requires.  Trunks extend from the base of the volume into the
    crown.

    Parameters
    ----------
    rng
        Random generator of the forest.
    density
        p, share of the ground that vertical rays do not reach; less than 1.
    occluder_size_m
        Edge length of a voxel, which is the smallest occluder.
    volume_base_m, volume_height_m
        Height of the bottom of the canopy, and thickness of the canopy.  The tallest tree reaches
        the top, and crowns start in the lower half.
    size_m
        Size of the plot along x and y.

    Raises
    ------
    RequestError
        If the density is not a share that is less than 1.
    """
    if not 0.0 <= density < 1.0:
        raise RequestError(f"forest: density {density:g} is not a share below 1")
    top_m = volume_base_m + volume_height_m
    voxel_m = _smallest_voxel_m(occluder_size_m, size_m, top_m)
    canvas = _Canvas(size_m, voxel_m, top_m, of_leaves=of_leaves)
    if density == 0.0:
        return canvas.volume("clumped forest")
    leafy = _clumps(rng, canvas.occupied.shape, max(round(0.04 * top_m / voxel_m), 1))
    crowns = np.zeros_like(canvas.occupied)
    trunks = np.zeros_like(canvas.occupied)
    covered = np.zeros(crowns.shape[1:], dtype=np.bool_)
    while covered.mean() < 0.5 * (1.0 + density) or trunks.any(axis=0).mean() == 0.0:
        _plant(rng, crowns, trunks, covered, voxel_m, volume_base_m, top_m)
    leaves = crowns & leafy
    # If the leafy clumps have too few voxels to hide the share, all voxels of crowns are made
    # leafy.
    if leaves.any(axis=0).mean() <= density:
        leaves = crowns
    if trunks.any(axis=0).mean() > density:
        trunks[:] = False
    trunk = np.asarray(trunks.any(axis=0))
    kept = _kept_share(leaves.sum(axis=0), trunk, density)
    canvas.occupied[...] = leaves & (rng.random(leaves.shape, dtype=np.float32) < kept)
    canvas.occupied[...] |= trunks
    return canvas.volume("clumped forest")


def maker(above: Scene, forest: str, *, of_leaves: bool = False) -> Callable[..., Any]:
    """Make a function that creates a volume of a scene. The arguments of this function are a random
    generator and a size along x and y.
    """
    if forest == "uniform":
        assert isinstance(above, UniformScene)
        density = above.density
        if density is None:
            p = above.integrated_density
            density = float(slice_density(p, above.volume_height_m, above.occluder_size_m))
        numbers = density, above.occluder_size_m, above.volume_base_m, above.volume_height_m
        return lambda rng, size: uniform_forest(rng, *numbers, size, of_leaves=of_leaves)
    slices = above.slices()
    if forest == "layered":
        return lambda rng, size: layered_forest(rng, slices, size, of_leaves=of_leaves)
    finest = min(layer.occluder_size_m for layer in slices)
    base = min(layer.bottom_m for layer in slices)
    stand = above.integrated_density, finest, base, above.canopy_top_m - base
    return lambda rng, size: clumped_forest(rng, *stand, size, of_leaves=of_leaves)


class _Canvas:
    """An empty volume that is filled with slices of cells."""

    def __init__(
        self, size_m: tuple[float, float], voxel_m: float, top_m: float, *, of_leaves: bool
    ) -> None:
        self.of_leaves = of_leaves
        self.cell_voxels = 1
        columns, rows = (max(math.ceil(length / voxel_m - 1e-9), 1) for length in size_m)
        self.voxel_m = voxel_m
        self.occupied: NDArray[np.bool_] = np.zeros(
            (math.floor(top_m / voxel_m + 0.5) + 1, rows, columns), dtype=np.bool_
        )

    def add(
        self,
        rng: np.random.Generator,
        bottom_m: float,
        top_m: float,
        density: float,
        occluder_size_m: float,
    ) -> None:
        """Fill a layer with independent slices of cells, which are about as thick as they are wide."""
        low = math.floor(bottom_m / self.voxel_m + 0.5)
        high = max(math.floor(top_m / self.voxel_m + 0.5), low + 1)
        size = max(occluder_size_m / self.voxel_m, 1.0)
        count = min(max(round((high - low) / size), 1), high - low)
        share = _thinned(density, count)
        for k in range(count):
            first, last = (low + (high - low) * edge // count for edge in (k, k + 1))
            if self.of_leaves:  # A ray meets a plate only once, at the middle of the slice.
                first = (first + last) // 2
                last = first + 1
            self.occupied[first:last] |= _cells(rng, self.occupied.shape[1:], size, share)
        self.cell_voxels = max(self.cell_voxels, math.ceil(size - FACE))

    def volume(self, source: str) -> VoxelVolume:
        """The filled volume, up to the highest slice that is not empty."""
        filled = np.flatnonzero(self.occupied.any(axis=(1, 2)))
        top = filled[-1] + 1 if filled.size else 0
        return VoxelVolume(
            self.occupied[:top],
            self.voxel_m,
            source=source,
            slice_m=self.voxel_m if self.of_leaves else None,
            cell_voxels=self.cell_voxels if self.of_leaves else 1,
        )


def _thinned(density: float, count: float) -> float:
    """Density of each of `count` independent slices that together block the given share."""
    return 1.0 if density >= 1.0 else -math.expm1(math.log1p(-density) / count)


def _cells(
    rng: np.random.Generator, shape: tuple[int, ...], size: float, density: float
) -> NDArray[np.bool_]:
    """A plane of square cells, `size` voxels wide, with a random phase."""
    width = cell_width(size)
    phases = rng.random(2) * width
    rows, columns = (
        np.floor((np.arange(count) + 0.5 + phase) / width).astype(np.intp)
        for count, phase in zip(shape, phases.tolist(), strict=True)
    )
    cells = rng.random((rows[-1] + 1, columns[-1] + 1)) < density
    plane: NDArray[np.bool_] = cells[rows[:, np.newaxis], columns]
    return plane


@lru_cache
def cell_width(size: float) -> float:
    """Width of cells [voxels] with which a plane of voxels has a given integral range.

    At whole lags, the correlation of a plane of voxels equals the triangle of its cells.  Between
    whole lags, it is linear.  For a width w = n + f with a whole number n, the integral of this
    correlation is w + f (1 - f)/w, which is slightly more than w.
    """
    low, high = float(math.floor(size)), size
    for _ in range(BISECTIONS):
        width = 0.5 * (low + high)
        part = width % 1.0
        low, high = (low, width) if width + part * (1.0 - part) / width > size else (width, high)
    return high


def _clumps(rng: np.random.Generator, shape: tuple[int, ...], clump: int) -> NDArray[np.bool_]:
    """Blocks of `clump` voxels along each axis.  Half of the blocks are leafy."""
    leafy = rng.random([-(-count // clump) for count in shape]) < 0.5
    for axis in range(3):
        leafy = leafy.repeat(clump, axis=axis)
    return leafy[: shape[0], : shape[1], : shape[2]]


def _plant(
    rng: np.random.Generator,
    crowns: NDArray[np.bool_],
    trunks: NDArray[np.bool_],
    covered: NDArray[np.bool_],
    voxel_m: float,
    base_m: float,
    top_m: float,
) -> None:
    """Add one tree: its crown, its trunk, and the ground that both cover."""
    _, rows, columns = crowns.shape
    east, north, *variation = rng.random(5).tolist()
    height = base_m + (top_m - base_m) * (0.7 + 0.3 * variation[0])
    half = 0.5 * (height - base_m) * (0.5 + 0.4 * variation[1])
    radius = (top_m - base_m) * (0.1 + 0.08 * variation[2])
    middle = height - half
    (x, dx), (y, dy) = (
        _around(count, place * count, radius / voxel_m)
        for count, place in ((columns, east), (rows, north))
    )
    across = ((dx * dx)[np.newaxis] + (dy * dy)[:, np.newaxis]) * (voxel_m * voxel_m)
    z = (np.arange(len(crowns)) + 0.5) * voxel_m
    inside = across / (radius * radius)
    up = (z - middle) / half
    cells = np.ix_(y, x)
    covered[cells] |= inside < 1.0
    for level in np.flatnonzero(up * up < 1.0):
        crowns[level][cells] |= inside + up[level] * up[level] < 1.0
    stem_m = max(0.012 * height, 0.5 * voxel_m)
    stem = across <= max(stem_m * stem_m, float(across.min()))
    for level in np.flatnonzero((z > base_m) & (z < middle)):
        trunks[level][cells] |= stem


def _around(count: int, place: float, reach: float) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Cells of a periodic axis that are within a given distance of a place, and their distances
    from this place.  Each cell is listed once.
    """
    span = min(2 * math.ceil(reach) + 1, count)
    cells = math.floor(place) - span // 2 + np.arange(span)
    return cells % count, np.abs(cells + 0.5 - place)


def _kept_share(leaves: NDArray[np.int64], trunk: NDArray[np.bool_], density: float) -> float:
    """Share of leafy voxels with which the expected share of hidden columns is `density`."""
    columns = np.bincount(leaves[~trunk])
    always = np.count_nonzero(trunk)
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        share = 0.5 * (low + high)
        open_columns = float((columns * (1.0 - share) ** np.arange(len(columns))).sum())
        hidden = (always + float(columns.sum()) - open_columns) / leaves.size
        low, high = (low, share) if hidden > density else (share, high)
    return 0.5 * (low + high)
