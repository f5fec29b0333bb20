"""Images warped onto a focal plane, by OpenCV.

A raster is computed in tiles. Each tile is computed from the part of the image that it shows. The
required memory therefore depends neither on the size of the raster nor on that of the image. An
image extends to the outer edges of its pixels. Between the centres of pixels, values are
interpolated bilinearly. From the outermost centres to the edges, the outermost values are used. If
a pixel of the raster is at least twice as large as a pixel of the image, the pixels of the image
are first averaged in blocks. Every pixel is therefore used.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.errors import needs_extra

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from aosplan.postflight.integral.camera_pose import Intrinsics
    from aosplan.postflight.integral.focal_plane import Raster

    Floats = NDArray[np.float64]

TILE_PX = 1024
"""Longest side of a tile of the raster."""

MARGIN_PX = 4
"""Margin around the part of an image that a tile shows, measured in blocks."""


class RasterWindow(NamedTuple):
    """Part of a raster: ranges of rows and columns."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Index of the part in an array whose first axes are rows and columns."""
        return slice(self.top, self.bottom), slice(self.left, self.right)


class Relief(NamedTuple):
    """Heights of a focal surface above its plane, and the vector in a camera's frame by which one
    metre of height moves a point.
    """

    heights_m: Floats
    lift: Floats


class Scratch:
    """Memory that is used again for each image, because it takes the system a long time to provide
    memory.
    """

    def __init__(self) -> None:
        self._kept: dict[str, NDArray[np.float32]] = {}

    def array(self, name: str, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """An array of this shape with undefined values. It replaces the array of the same name."""
        size = math.prod(shape)
        kept = self._kept.get(name)
        if kept is None or kept.size < size:
            kept = self._kept[name] = np.empty(size, dtype=np.float32)
        return kept[:size].reshape(shape)


class Warped(NamedTuple):
    """An image on a tile of the raster.

    Attributes
    ----------
    tile
        The tile.
    values
        Shape (rows, columns, bands), not defined outside the image.  With a `Scratch`, they are
        valid until the next tile.
    inside
        Shape (rows, columns): 1 inside the image and 0 outside.
    """

    tile: RasterWindow
    values: NDArray[np.float32]
    inside: NDArray[np.uint8]


def warped(
    pixels: NDArray[np.generic],
    intrinsics: Intrinsics,
    ray: Floats,
    raster: Raster,
    relief: Relief | None = None,
    scratch: Scratch | None = None,
) -> Iterator[Warped]:
    """Warp an image to the tiles of a raster that it can reach.

    Parameters
    ----------
    pixels
        Shape (rows, columns, bands), with at most four bands.
    intrinsics
        The camera of the image.
    ray
        Shape (3, 3): maps (column, row, 1) of the raster to the camera's frame.
    raster
        The raster.
    relief
        Heights above the plane of the raster; None for the plane itself.
    scratch
        Memory that is used again; None for new memory.

    Raises
    ------
    MissingExtraError
        If OpenCV is not installed.
    """
    reached = _reached(ray, intrinsics, raster) if relief is None else _whole(raster)
    if reached is None:
        return
    block = _block(intrinsics, ray, reached)
    scratch = scratch or Scratch()
    for tile in _tiles(reached):
        corners = np.array(
            [[tile.left, tile.right, tile.right, tile.left],
             [tile.top, tile.top, tile.bottom, tile.bottom], [1, 1, 1, 1]]
        )  # fmt: skip
        depth = ray[2] @ corners
        if relief is None and intrinsics.is_pinhole and depth.min() > 1e-6 * np.abs(depth).max():
            found = _by_homography(pixels, intrinsics, ray, tile, block, scratch)
        else:
            found = _by_coordinates(pixels, intrinsics, ray, tile, block, relief, scratch)
        if found is not None:
            yield found


def _whole(raster: Raster) -> RasterWindow:
    return RasterWindow(0, raster.rows, 0, raster.columns)


def _tiles(window: RasterWindow) -> Iterator[RasterWindow]:
    for top in range(window.top, window.bottom, TILE_PX):
        for left in range(window.left, window.right, TILE_PX):
            yield RasterWindow(
                top, min(top + TILE_PX, window.bottom), left, min(left + TILE_PX, window.right)
            )


def _reached(ray: Floats, intrinsics: Intrinsics, raster: Raster) -> RasterWindow | None:
    """The part of the raster that an image can reach; the whole raster if this part is not
    known.
    """
    whole = _whole(raster)
    if not intrinsics.is_pinhole:
        return whole
    # Arrays of this size would be slower than numbers.
    x = [(u - intrinsics.cx_px) / intrinsics.fx_px for u in (0.0, intrinsics.width_px)]
    y = [(v - intrinsics.cy_px) / intrinsics.fy_px for v in (0.0, intrinsics.height_px)]
    across, down, ahead = np.linalg.inv(ray).tolist()
    columns, rows = [], []
    for u, v in itertools.product(x, y):
        scale = ahead[0] * u + ahead[1] * v + ahead[2]
        if not scale > 0.0:  # The horizon is in the image.
            return whole
        columns.append((across[0] * u + across[1] * v + across[2]) / scale)
        rows.append((down[0] * u + down[1] * v + down[2]) / scale)
    window = RasterWindow(
        math.floor(min(max(min(rows), 0.0), raster.rows)),
        math.ceil(min(max(*rows, 0.0), raster.rows)),
        math.floor(min(max(min(columns), 0.0), raster.columns)),
        math.ceil(min(max(*columns, 0.0), raster.columns)),
    )
    return window if window.top < window.bottom and window.left < window.right else None


def block_of(intrinsics: Intrinsics, ray: Floats, raster: Raster) -> int:
    """Side [px] of the square blocks of an image that are about as large as a raster step.

    The size of a raster step is measured in the middle of the part of the raster that the image can
    reach. The parameters have the same meaning as in `warped`.
    """
    window = _reached(ray, intrinsics, raster)
    return 1 if window is None else _block(intrinsics, ray, window)


def _block(intrinsics: Intrinsics, ray: Floats, window: RasterWindow) -> int:
    column, row = 0.5 * (window.left + window.right), 0.5 * (window.top + window.bottom)
    lines = ray.tolist()
    x, y, depth = (line[0] * column + line[1] * row + line[2] for line in lines)
    if not depth > 0.0:
        return 1
    (a, b), (c, d) = (
        [(line[k] * depth - place * lines[2][k]) / depth**2 for k in (0, 1)]
        for line, place in ((lines[0], x), (lines[1], y))
    )
    # The smaller singular value of this matrix is the shortest step at a focal length of 1.
    shortest = 0.5 * abs(math.hypot(a + d, c - b) - math.hypot(a - d, c + b))
    step = shortest * intrinsics.fx_px
    return max(int(min(step, intrinsics.width_px, intrinsics.height_px) + 1e-6), 1)


def _by_homography(
    pixels: NDArray[np.generic],
    intrinsics: Intrinsics,
    ray: Floats,
    tile: RasterWindow,
    block: int,
    scratch: Scratch,
) -> Warped | None:
    """Warp a pinhole image by its homography.  The result is None if the image does not reach the
    tile.
    """
    with needs_extra("warping images", "pictures"):
        import cv2

    camera = np.array(
        [
            [intrinsics.fx_px, 0.0, intrinsics.cx_px],
            [0.0, intrinsics.fy_px, intrinsics.cy_px],
            [0.0, 0.0, 1.0],
        ]
    )
    # Maps the indices (column, row, 1) of the tile's pixels to the image.
    matrix = camera @ ray @ [[1.0, 0.0, tile.left + 0.5], [0.0, 1.0, tile.top + 0.5], [0, 0, 1.0]]
    shape = rows, columns = tile.bottom - tile.top, tile.right - tile.left
    inside = _spans(matrix, shape, intrinsics)
    if not inside.any():
        return None
    ends = np.array([[0, columns - 1, columns - 1, 0], [0, 0, rows - 1, rows - 1], [1, 1, 1, 1]])
    u, v, scale = matrix @ ends
    part, (left, top) = _reduced(pixels, u / scale, v / scale, block, scratch)
    to_part = np.array(
        [[1 / block, 0, -left / block - 0.5], [0, 1 / block, -top / block - 0.5], [0, 0, 1]]
    )
    values = cv2.warpPerspective(
        part,
        to_part @ matrix,
        (columns, rows),
        dst=scratch.array("warped", (rows, columns, *part.shape[2:])),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return Warped(tile, _three_axes(values), inside)


def _spans(matrix: Floats, shape: tuple[int, int], intrinsics: Intrinsics) -> NDArray[np.uint8]:
    """Mask of the pixels of a tile whose centres are inside an image.

    The conditions 0 <= u < width and 0 <= v < height are linear in the column, because u and v are
    quotients with the same positive denominator. The pixels of a row are therefore one span.
    """
    rows, columns = shape
    edges = [
        matrix[0],
        matrix[1],
        intrinsics.width_px * matrix[2] - matrix[0],
        intrinsics.height_px * matrix[2] - matrix[1],
    ]
    first, last = np.zeros(rows), np.full(rows, columns - 1.0)
    for index, (slope, step, start) in enumerate(edges):
        offset = step * np.arange(rows) + start
        includes_zero = index < 2
        if slope == 0.0:
            first[~((offset >= 0.0) if includes_zero else (offset > 0.0))] = columns
            continue
        zero = -offset / slope
        if slope > 0.0:
            first = np.maximum(first, np.ceil(zero) if includes_zero else np.floor(zero) + 1.0)
        else:
            last = np.minimum(last, np.floor(zero) if includes_zero else np.ceil(zero) - 1.0)
    column = np.arange(columns, dtype=np.int16)
    low = np.clip(first, 0, columns).astype(np.int16)[:, None]
    high = np.clip(last, -1, columns - 1).astype(np.int16)[:, None]
    inside: NDArray[np.bool_] = (column >= low) & (column <= high)
    return inside.view(np.uint8)


def _reduced(
    pixels: NDArray[np.generic], u: Floats, v: Floats, block: int, scratch: Scratch
) -> tuple[NDArray[np.float32], tuple[int, int]]:
    """The part of an image around some positions, averaged in blocks, as float32, and the
    coordinates of its left and upper edge [px].
    """
    import cv2

    ranges = []
    for places, side in ((v, pixels.shape[0]), (u, pixels.shape[1])):
        count = side // block
        low = np.clip(np.floor(np.nanmin(places) / block) - MARGIN_PX, 0, count - 1)
        high = np.clip(np.ceil(np.nanmax(places) / block) + MARGIN_PX, low + 1, count)
        ranges.append((int(low), int(high)))
    (top, bottom), (left, right) = ranges
    shown = pixels[top * block : bottom * block, left * block : right * block]
    part = scratch.array("part", shown.shape)
    np.copyto(part, shown, casting="unsafe")
    size = (right - left, bottom - top)
    reduced = part if block == 1 else cv2.resize(part, size, interpolation=cv2.INTER_AREA)
    return np.asarray(reduced, dtype=np.float32), (left * block, top * block)


def _by_coordinates(
    pixels: NDArray[np.generic],
    intrinsics: Intrinsics,
    ray: Floats,
    tile: RasterWindow,
    block: int,
    relief: Relief | None,
    scratch: Scratch,
) -> Warped | None:
    """Warp an image with lens distortion point by point. Points above the horizon are left out."""
    with needs_extra("warping images", "pictures"):
        import cv2

    columns = np.arange(tile.left, tile.right) + 0.5
    rows = (np.arange(tile.top, tile.bottom) + 0.5)[:, None]
    x, y, depth = (line[0] * columns + line[1] * rows + line[2] for line in ray)
    if relief is not None:
        x, y, depth = (
            value + lift * relief.heights_m[tile.slices]
            for value, lift in zip((x, y, depth), relief.lift, strict=True)
        )
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        depth = np.where(depth > 0.0, depth, np.nan)
        u, v = intrinsics.distorted(x / depth, y / depth)
        u = intrinsics.fx_px * u + intrinsics.cx_px
        v = intrinsics.fy_px * v + intrinsics.cy_px
        inside = (u >= 0.0) & (u < intrinsics.width_px) & (v >= 0.0) & (v < intrinsics.height_px)
    if not inside.any():
        return None
    part, (left, top) = _reduced(pixels, u[inside], v[inside], block, scratch)
    values = cv2.remap(
        part,
        np.where(inside, (u - left) / block - 0.5, 0.0).astype(np.float32),
        np.where(inside, (v - top) / block - 0.5, 0.0).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return Warped(tile, _three_axes(values), inside.view(np.uint8))


def _three_axes(values: NDArray[Any]) -> NDArray[np.float32]:
    """An image with an axis of bands.  OpenCV removes this axis if there is only one band."""
    return np.atleast_3d(np.asarray(values, dtype=np.float32))
