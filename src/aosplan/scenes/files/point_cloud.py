"""Conversion of point clouds (LAS and LAZ files of one stand) to a `VoxelVolume`.

Noise (classes 7 and 18, withheld points) is removed. The ground points are triangulated, and the
ground is linear within the triangles. Outside the hull of the triangles, the ground has the height
of the nearest ground point. The height of the ground is computed at the corners of the voxel
columns and interpolated bilinearly between them. The height of a point is its z minus the z of this
ground. A voxel is occupied if it contains at least one point.

Each file is decoded once.  The coordinates are kept as integers in an anonymous temporary file
until the ground is known.  They are then sorted into voxels block by block.  The required memory
therefore depends on the number of voxels and not on the number of points.  Numbers in a header are
checked before memory is allocated according to them.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from aosplan.crs import given_units
from aosplan.errors import RequestError, SurroundingsError
from aosplan.scenes import voxels
from aosplan.scenes.files import outliers
from aosplan.scenes.files.cloud_doubts import cloud_doubts, opacity_doubts, pulse_doubts
from aosplan.scenes.files.crop import box_of
from aosplan.scenes.files.ground import (
    MAX_VERTICES,
    filtered,
    is_level_zero,
    lowest,
    surface,
    vertices,
)
from aosplan.scenes.files.las import PointFile, not_metric
from aosplan.scenes.files.spool import Spool
from aosplan.scenes.files.tiles import brought_together, located, warnings_of_files
from aosplan.scenes.opacity import Opacity, OpacitySource, is_sparse
from aosplan.scenes.voxels import VoxelVolume, cells_along, fill, fits, footprint, too_many_voxels

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from aosplan.scenes.files.crop import Crop, CropBox
    from aosplan.scenes.pulses.fit import PulseVolume

    Floats = NDArray[np.float64]
    Progress = Callable[[int, int], object]
    Warned = tuple[str, str]

GroundMethod = Literal["auto", "class", "filter", "normalized"]

NOISE_CLASSES = (7, 18)
GROUND_CLASS = 2

# Additional ground points are not used, because the mean of fifty points for each vertex of the
# ground is accurate enough.
ENOUGH_GROUND_POINTS = 50 * MAX_VERTICES

MAX_EXTENT_M = 100_000.0
MAX_RISE_M = 10_000.0
FEWEST_GROUND_POINTS_PER_M2 = 0.04

MOST_PULSE_COLUMNS = 500_000
"""Largest number of voxel columns for a fit of pulses; larger plots get larger voxels."""

LARGEST_PULSE_VOXEL_M = 0.5
"""Largest voxel for a fit of pulses. When voxels were enlarged from 0.15 m to 0.5 m, V changed by
at most 2.3 %.
"""

LARGEST_SPARSE_VOXEL_M = 4.0
"""Largest voxel for a fit of the pulses of a sparse cloud. When voxels were enlarged from 0.5 m to
1.5 m on a cloud with one pulse per square metre, V changed by 3 %.
"""

DEFAULT_VOXEL_M = 0.25
USUAL_VOXELS = 800_000_000
"""Approximate limit of the number of voxels on large plots if the user gives no voxel size."""

USUAL_TOP_M = 45.0
"""Height of a stand that is assumed for this limit."""

LARGEST_VOXEL_M = 0.5
"""Largest voxel size that is chosen for this limit. On larger plots, the usual default is kept, and
is refused as too small.
"""

SPACINGS_ACROSS = 4.0
"""Side of a square that contains 16 points on average, divided by the mean distance
between points.
"""


def read_voxels(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    *,
    voxel_m: float | None = None,
    ground: GroundMethod = "auto",
    min_height_m: float = 2.0,
    units: str | None = None,
    opacity: OpacitySource = "voxels",
    leaf_size_m: float | None = None,
    trajectory: str | None = None,
    crop: Crop | None = None,
    halves: bool = False,
    progress: Progress | None = None,
) -> VoxelVolume:
    """Read one or several LAS or LAZ files of one stand into voxels.

    Parameters
    ----------
    paths
        The files; several are read as one cloud.
    voxel_m
        Edge length of a voxel. The default is 0.25 m. On plots of several hundred metres, a larger
        default is chosen, which gives `USUAL_VOXELS` voxels, and there is a warning.
    ground
        ``class``: the points of class 2.  ``filter``: the points that a cloth simulation filter
        finds.  ``normalized``: z is already the height above the ground.  ``auto``: ``class`` if
        there is at least one ground point per 25 m²; otherwise ``normalized`` if the lowest point
        is within 0.5 m of zero in nine of ten cells of 5 m; otherwise ``filter``.
    min_height_m
        Points below this height are not occluders.
    units
        Units that replace those in the files: ``us-ft``, or ``us-ft,m`` if the unit of z differs
        (`aosplan.crs.given_units`).
    opacity
        ``voxels``: a voxel is opaque if it contains a point.  ``pulses``: the opacity is fitted to
        the laser pulses (`aosplan.scenes.pulses`) and represented by smaller cells.  ``auto``:
        ``pulses`` if the cloud has usable pulses, otherwise ``voxels`` with a warning.
    leaf_size_m
        Edge length of these smaller cells. The default is about 0.06 m, less on small plots, and
        more on large plots.
    trajectory
        CSV file with positions of the sensor (`aosplan.scenes.pulses.trajectory`); None to
        compute them from the pulses.
    crop
        Rectangle outside of which points are ignored; None to use all points.
    halves
        Whether the volume also contains the voxels from each half of the pulses. This needs opacity
        from pulses.
    progress
        Function that is called with the work done and the total work, in points.  Each point counts
        twice: once when it is read, and once when it is sorted into a voxel.

    Returns
    -------
    VoxelVolume
        The volume, up to the highest occupied slice.  Coordinates are converted to metres from the
        units that the files state.  The warnings name conversions and assumptions.

    Raises
    ------
    RequestError
        If a file is missing, damaged or empty, if its coordinates are not metres in a plane, or if
        the plot needs too many voxels.
    MissingExtraError
        If laspy, its LAZ backend or the ground filter is not installed.
    SurroundingsError
        If the operating system fails: permission, disk, memory.
    """
    names = [os.fspath(p) for p in ([paths] if isinstance(paths, str | os.PathLike) else paths)]
    _check_request(names, voxel_m, ground, min_height_m)
    if opacity not in get_args(OpacitySource):
        raise RequestError(
            f"opacity '{opacity}' is unknown", f"use {', '.join(get_args(OpacitySource))}"
        )
    source = names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
    try:
        with Spool() as cloud:
            given = given_units(units) if units else None
            files = [PointFile(name, given) for name in names]
            warnings = warnings_of_files(files) + brought_together(files, source)
            box = None if crop is None else box_of(crop, files, source)
            if box is not None:
                warnings += box.said
                files = [file for file in files if box.meets(file)]
            read = _decode(files, source, cloud, progress, box)
            if voxel_m is None:
                voxel_m, enlarged = _voxel_for(cloud)
                warnings += enlarged
            plot = _Plot.around(cloud, voxel_m, source)
            method, ground_m, strange = _find_ground(cloud, plot, ground)
            found, reason = None, ""
            if opacity != "voxels":
                found, reason = _from_pulses(
                    files,
                    plot,
                    ground_m,
                    min_height_m,
                    leaf_size_m,
                    trajectory,
                    cloud.count,
                    halves=halves,
                )
                if found is None and (opacity == "pulses" or trajectory is not None):
                    raise RequestError(
                        f"the pulses of point cloud {source} cannot give its opacity: {reason}",
                        "use --opacity voxels",
                    )
            blocks = cloud.blocks(plot.origin_m, voxel_m)
            touched = np.zeros(plot.rows * plot.columns, dtype=np.bool_)
            occupied = fill(
                _followed(blocks, 2 * read - cloud.count, 2 * read, progress),
                ground_m / np.float32(voxel_m),
                min_height_m / voxel_m,
                voxel_m,
                f"point cloud {source}",
                touched,
            )
    except MemoryError as error:
        raise SurroundingsError(
            f"not enough memory for point cloud {source}"
            + (f" in voxels of {voxel_m:g} m" if voxel_m else ""),
            "use larger voxels",
        ) from error
    volume = VoxelVolume(
        occupied=voxels.without_ragged_cells(occupied, plot.size_m.tolist(), voxel_m, cloud.count),
        voxel_m=voxel_m,
        x_min_m=float(plot.origin_m[0]),
        y_min_m=float(plot.origin_m[1]),
        min_height_m=min_height_m,
        points=cloud.count,
        ground=method,
        source=source,
        opacity=Opacity("voxels", reason),
    )
    spacing_m = 1.0 / math.sqrt(volume.points_per_m2)
    squares = math.ceil(SPACINGS_ACROSS * spacing_m / voxel_m)
    columns = touched.reshape(plot.rows, plot.columns)
    covered = footprint(columns, squares)
    known = (
        *warnings,
        *strange,
        *outliers.outliers_above(volume),
        *outliers.beside(columns, volume),
    )
    if found is None:
        of_opacity = opacity_doubts(volume, spacing_m)
    else:
        volume = replace(
            volume,
            occupied=found.occupied,
            voxel_m=found.cell_m,
            slice_m=found.opacity.voxel_m,
            bounds=found.bounds,
            halves=found.halves,
            opacity=found.opacity,
        )
        later = any(file.later_returns for file in files)
        of_opacity = pulse_doubts(volume, found.opacity, later_returns=later)
    doubts = cloud_doubts(volume, covered, assumed=ground == "auto")
    volume = replace(volume, warnings=(*known, *doubts, *of_opacity))
    return located(volume, files)


def _from_pulses(
    files: Sequence[PointFile],
    plot: _Plot,
    ground_m: NDArray[np.float32],
    cut_m: float,
    leaf_m: float | None,
    trajectory: str | None,
    points: int,
    *,
    halves: bool,
) -> tuple[PulseVolume | None, str]:
    """The volume from the pulses of a stand, or None and the reason why they cannot be used."""
    from aosplan.scenes.pulses.fit import UnsoundPulsesError, volume_from_pulses
    from aosplan.scenes.pulses.trace import VoxelGrid
    from aosplan.scenes.pulses.trajectory import read_trajectory

    track = None if trajectory is None else read_trajectory(trajectory)
    width_m, depth_m = plot.size_m[:2].tolist()
    voxel_m = plot.voxel_m
    sparse = is_sparse(points, width_m * depth_m)
    while plot.rows * plot.columns * (plot.voxel_m / voxel_m) ** 2 > MOST_PULSE_COLUMNS:
        if 2.0 * voxel_m > (LARGEST_SPARSE_VOXEL_M if sparse else LARGEST_PULSE_VOXEL_M):
            return None, (
                f"{width_m:.4g} x {depth_m:.4g} m are too wide to fit pulses with voxels of "
                f"{voxel_m:g} m (give --crop)"
            )
        voxel_m *= 2.0
        down, across = (
            np.minimum(np.arange(0, length + 2, 2), length)
            for length in (ground_m.shape[0] - 1, ground_m.shape[1] - 1)
        )
        ground_m = ground_m[np.ix_(down, across)]
    grid = VoxelGrid(ground_m, voxel_m, 1, cut_m, (width_m, depth_m))
    try:
        found = volume_from_pulses(
            files,
            grid,
            plot.origin_m,
            leaf_m=leaf_m,
            trajectory=track,
            points=points,
            halves=halves,
        )
    except UnsoundPulsesError as error:
        return None, str(error)
    return found, ""


def _voxel_for(cloud: Spool) -> tuple[float, list[Warned]]:
    """Voxel size for a cloud, and a warning if it is not the default."""
    width_m, depth_m, rise_m = (float(length) for length in cloud.high_m - cloud.low_m)
    volume_m3 = width_m * depth_m * min(rise_m, USUAL_TOP_M)
    if not DEFAULT_VOXEL_M**3 < volume_m3 / USUAL_VOXELS <= LARGEST_VOXEL_M**3:
        return DEFAULT_VOXEL_M, []
    voxel_m = math.ceil(20.0 * (volume_m3 / USUAL_VOXELS) ** (1.0 / 3.0) - 1e-9) / 20.0
    message = (
        f"voxels of {voxel_m:g} m are used instead of {DEFAULT_VOXEL_M:g} m, because the plot of "
        f"{width_m:.4g} x {depth_m:.4g} m is large: give --crop to read a part of it, or give "
        "--voxel"
    )
    return voxel_m, [("voxels_enlarged", message)]


def _check_request(
    names: list[str], voxel_m: float | None, ground: str, min_height_m: float
) -> None:
    if not names:
        raise RequestError("no point cloud is given", "give one or more .las or .laz files")
    if voxel_m is not None and not (math.isfinite(voxel_m) and voxel_m > 0.0):
        raise RequestError(f"voxel size {voxel_m:g} m is not a positive number")
    if not (math.isfinite(min_height_m) and min_height_m >= 0.0):
        raise RequestError(f"minimum height {min_height_m:g} m is not zero or above")
    methods = get_args(GroundMethod)
    if ground not in methods:
        raise RequestError(f"ground method '{ground}' is unknown", f"use {', '.join(methods)}")


# --- Points: from the files to a temporary file ---


def _decode(
    files: list[PointFile],
    source: str,
    cloud: Spool,
    progress: Progress | None,
    box: CropBox | None,
) -> int:
    """Store all points that are not noise.  Returns the number of points including noise."""
    total = sum(file.count for file in files)
    done = 0
    for file in files:
        for raw, kind, withheld in file.chunks():
            used = ~withheld
            for noise in NOISE_CLASSES:
                used &= kind != noise
            if box is not None:
                used &= box.holds(raw, file)
            is_ground = kind == GROUND_CLASS
            ground = np.flatnonzero(used & is_ground)
            other = np.flatnonzero(used & ~is_ground)
            order = np.concatenate([ground, other])
            in_order = order.size == kind.size and ground.size in (0, kind.size)
            cloud.append(raw if in_order else raw.take(order, axis=1), ground.size, file)
            done += kind.size
            if progress is not None:
                progress(done, 2 * total)
    if cloud.count == 0:
        if box is not None:
            raise box.is_empty
        raise RequestError(
            f"point cloud {source} contains only noise, because all of its {total} points "
            "have class 7 or 18 or are withheld"
        )
    return total


# --- The plot and its ground ---


@dataclass(frozen=True)
class _Plot:
    """The rectangle around the points.  The plot consists of the voxels that are completely in
    it.
    """

    origin_m: Floats
    size_m: Floats
    rows: int
    columns: int
    voxel_m: float
    source: str

    @classmethod
    def around(cls, cloud: Spool, voxel_m: float, source: str) -> _Plot:
        """Return the plot of a cloud, after checking its coordinates and its size."""
        low, high = cloud.low_m, cloud.high_m
        size = high - low
        degrees = (np.abs([low[:2], high[:2]]) <= (180.0, 90.0)).all()
        if degrees and cloud.finest_m < 1e-5 and max(size[:2]) < 1.0:
            raise not_metric(
                source,
                f"x {low[0]:g} to {high[0]:g} and y {low[1]:g} to {high[1]:g} look like degrees",
            )
        # The ground filter takes very long for a cloud that is kilometres high.
        if max(size) > MAX_EXTENT_M or size[2] > MAX_RISE_M:
            bounds = ", ".join(
                f"{axis} {first:.1f} to {last:.1f}"
                for axis, first, last in zip("xyz", low.tolist(), high.tolist(), strict=True)
            )
            raise RequestError(
                f"point cloud {source} measures {size[0]:.3g} x {size[1]:.3g} x "
                f"{size[2]:.3g} m ({bounds}), which is too large for a stand",
                "check the scale and the offset, whether all files are from one place, and "
                "whether a single point is far from all others",
            )
        if not fits((size[0], size[1], 0.0), voxel_m):
            raise too_many_voxels(size, voxel_m, f"point cloud {source}")
        columns, rows = cells_along(size[0], voxel_m), cells_along(size[1], voxel_m)
        return cls(low, size, rows, columns, voxel_m, source)

    def surface(self, points: Floats) -> NDArray[np.float32]:
        """Height of the ground at the corners of the voxel columns, from ground points."""
        return surface(points, self.rows, self.columns, self.voxel_m)


def _find_ground(
    cloud: Spool, plot: _Plot, method: GroundMethod
) -> tuple[str, NDArray[np.float32], list[Warned]]:
    """Choose a method and find the ground.

    Returns the method, z of the ground at the corners of the columns, and warnings. z is relative
    to the lowest point of the cloud.
    """
    origin, size = plot.origin_m, plot.size_m
    if method in ("auto", "class"):
        fewest = 1 if method == "class" else max(3, FEWEST_GROUND_POINTS_PER_M2 * size[0] * size[1])
        if cloud.ground_count >= fewest:
            every = max(cloud.ground_count // ENOUGH_GROUND_POINTS, 1)
            blocks = cloud.blocks(origin, ground_only=True, every=every)
            points = vertices(blocks, cloud.ground_count // every, size)
            return "class", plot.surface(points), list(outliers.ground_outliers(points, origin))
        if method == "class":
            raise RequestError(
                f"point cloud {plot.source} has no points of class {GROUND_CLASS} (ground)",
                "give --ground filter, or --ground normalized if z is the height above ground",
            )
    if method != "normalized":
        low = lowest(cloud.blocks(origin), size)
        if method == "filter" or not is_level_zero(low, size, -origin[2]):
            points = filtered(low, size)
            if points.size == 0:
                raise RequestError(
                    f"the filter finds no ground in point cloud {plot.source}",
                    "if z is the height above ground, give --ground normalized",
                )
            points = vertices([points], points.shape[1], size)
            return "filter", plot.surface(points), list(outliers.ground_outliers(points, origin))
    level = np.full((plot.rows + 1, plot.columns + 1), -origin[2], dtype=np.float32)
    return "normalized", level, []


def _followed(
    blocks: Iterable[Floats], done: int, total: int, progress: Progress | None
) -> Iterator[Floats]:
    for block in blocks:
        yield block
        done += block.shape[1]
        if progress is not None:
            progress(done, total)
