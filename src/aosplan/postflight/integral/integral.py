"""Integral images: views are warped onto the focal plane and averaged.

A pixel of the raster is the mean of the views that show it, weighted by their alpha.  Grey values
that are not finite are ignored.  In addition to the sums, only one image is in memory at a time.
The required memory therefore depends on the raster and not on the number of images.

Between its pixels, an image is interpolated bilinearly.  If a pixel of the raster is at least twice
as large as a pixel of the image, the pixels of the image are first averaged in blocks, so that no
pixel is skipped.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.postflight.integral.focal_plane import heights_above
from aosplan.postflight.integral.images import Picture, read_picture

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray
    from PIL.Image import Image

    from aosplan.postflight.integral.camera_pose import Intrinsics, View
    from aosplan.postflight.integral.focal_plane import Plane, Raster

ROWS_AT_ONCE = 256
"""Number of rows of a distorted view that are warped at once."""


class ViewSource(NamedTuple):
    """A view, its camera, and the path of its image."""

    view: View
    intrinsics: Intrinsics
    path: str


class RasterWindow(NamedTuple):
    """Part of a raster: ranges of rows and columns."""

    top: int
    bottom: int
    left: int
    right: int


def whole_box(raster: Raster) -> RasterWindow:
    """The whole raster as a box."""
    return RasterWindow(0, raster.rows, 0, raster.columns)


class Relief(NamedTuple):
    """Heights of a focal surface above its plane, and the change of a point in the camera's frame
    per metre of height.
    """

    heights_m: NDArray[np.float64]
    lift: NDArray[np.float64]


@dataclass(frozen=True)
class Integral:
    """An integral image.

    Parameters
    ----------
    raster
        Pixels of the image on the focal plane.
    values
        Shape (rows, columns, bands), with one band or three: means in the units of the images.
        Pixels that no view sees are nan.
    coverage
        Shape (rows, columns): number of views that see each pixel.
    views
        Number of views that were integrated.
    blind
        Number of views that do not see any part of the raster.
    is_byte
        Whether all images had values between 0 and 255.
    """

    raster: Raster
    values: NDArray[np.float64]
    coverage: NDArray[np.float64]
    views: int
    blind: int
    is_byte: bool

    def seen(self, least_views: int) -> NDArray[np.bool_]:
        """Mask of the pixels that at least `least_views` views see, shape (rows, columns)."""
        # With this tolerance, a view is counted even if its weight is slightly below 1 at the edge
        # of its image.
        mask: NDArray[np.bool_] = self.coverage >= least_views - 1e-3
        return mask


def integrate(
    sources: Iterable[ViewSource],
    plane: Plane,
    raster: Raster,
    *,
    relief_m: NDArray[np.float64] | None = None,
    adjust: Callable[[ViewSource, Picture], Picture] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Integral:
    """Average views on a focal plane.

    Parameters
    ----------
    sources
        The views.  Each image is read when it is needed.
    plane, raster
        Plane and pixels of the integral image.
    relief_m
        Heights of the focal surface above the plane at the raster's pixels, shape (rows, columns);
        None for the plane itself.
    adjust
        Function that changes each image before it is added, for example its exposure.
    progress
        Function that is called with the number of views done.

    Raises
    ------
    RequestError
        If an image is damaged, does not have the size of its camera, or has other bands than the
        images before it; if a camera is below the plane; or if no view sees the raster.
    """
    sums: NDArray[np.float64] | None = None
    bands: int | None = None
    coverage = np.zeros((raster.rows, raster.columns))
    done = blind = 0
    is_byte = True
    for source in sources:
        picture = read_source(source, bands)
        bands = len(picture.bands)
        if adjust is not None:
            picture = adjust(source, picture)
        if sums is None:
            sums = np.zeros((len(picture.bands), raster.rows, raster.columns))
        is_byte = is_byte and picture.is_byte
        blind += not add_view(picture, source, plane, raster, sums, coverage, relief_m)
        done += 1
        if progress is not None:
            progress(done)
    if sums is None or blind == done:
        raise RequestError(
            f"none of the {done} views sees the extent",
            "compare --extent and --focal-height with the positions of the cameras",
        )
    with np.errstate(invalid="ignore", divide="ignore"):
        sums /= coverage
    return Integral(raster, np.moveaxis(sums, 0, -1), coverage, done, blind, is_byte)


def read_source(source: ViewSource, bands: int | None) -> Picture:
    """The image of a view, after checking its size and its bands."""
    picture = read_picture(source.path)
    wanted = (source.intrinsics.width_px, source.intrinsics.height_px)
    if picture.size != wanted:
        raise RequestError(
            f"image '{source.path}' has {picture.size[0]} x {picture.size[1]} pixels, "
            f"its camera {wanted[0]} x {wanted[1]}",
            "all images of a camera have the same size",
        )
    if bands is not None and len(picture.bands) != bands:
        kinds = {1: "grey", 3: "in colour"}
        raise RequestError(
            f"image '{source.path}' is {kinds[len(picture.bands)]}, but the images "
            f"before it are {kinds[bands]}"
        )
    return picture


def add_view(
    picture: Picture,
    source: ViewSource,
    plane: Plane,
    raster: Raster,
    sums: NDArray[np.float64],
    coverage: NDArray[np.float64],
    relief_m: NDArray[np.float64] | None = None,
) -> bool:
    """Add one view to the sums.  Returns whether the view sees any part of the raster."""
    above_m = plane.camera_m(source.view)[2] - (0.0 if relief_m is None else np.nanmax(relief_m))
    if not above_m > 0.0:
        raise RequestError(
            f"image '{source.view.name}': its camera is not above the focal plane",
            "--focal-height is measured along the upward axis of the world, which --up sets",
        )
    # This matrix maps (column, row, 1) of the raster to the camera's frame. Its third row gives the
    # depth.
    ray = plane.to_camera(source.view) @ raster.to_plane
    box = _reached(ray, source.intrinsics, raster)
    relief = None
    if relief_m is not None:
        box = whole_box(raster)
        relief = Relief(relief_m, heights_above(plane, source.view))
    if box is None:
        return False
    bands = list(picture.bands)
    if picture.weight is not None:
        bands = [_product(band, picture.weight) for band in bands] + [picture.weight]
    *values, last = warped(bands, source.intrinsics, ray, box, relief)
    reached = np.isfinite(last)
    last[~reached] = 0.0
    window = np.s_[box.top : box.bottom, box.left : box.right]
    if picture.weight is None:
        values.append(last)
    for total, value in zip(sums, values, strict=True):
        total[window] += value
    coverage[window] += reached if picture.weight is None else last
    return bool(reached.any())


def _product(band: Image, weight: Image) -> Image:
    from PIL import Image

    return Image.fromarray(np.asarray(band) * np.asarray(weight))


def _reached(
    ray: NDArray[np.float64], intrinsics: Intrinsics, raster: Raster
) -> RasterWindow | None:
    """The part of the raster that an image may show.  If this is not known, it is the whole
    raster.
    """
    whole = whole_box(raster)
    if not intrinsics.is_pinhole:
        return whole
    x = (np.array([0.0, 1.0, 1.0, 0.0]) * intrinsics.width_px - intrinsics.cx_px) / intrinsics.fx_px
    y = (
        np.array([0.0, 0.0, 1.0, 1.0]) * intrinsics.height_px - intrinsics.cy_px
    ) / intrinsics.fy_px
    columns, rows, scale = np.linalg.solve(ray, np.stack([x, y, np.ones(4)]))
    if not (scale > 0.0).all():  # The image contains the horizon.
        return whole
    columns, rows = columns / scale, rows / scale
    box = RasterWindow(
        int(np.clip(np.floor(rows.min()), 0, raster.rows)),
        int(np.clip(np.ceil(rows.max()), 0, raster.rows)),
        int(np.clip(np.floor(columns.min()), 0, raster.columns)),
        int(np.clip(np.ceil(columns.max()), 0, raster.columns)),
    )
    return box if box.top < box.bottom and box.left < box.right else None


def warped(
    bands: list[Image],
    intrinsics: Intrinsics,
    ray: NDArray[np.float64],
    box: RasterWindow,
    relief: Relief | None = None,
) -> list[NDArray[np.float32]]:
    """Bands warped to a part of the raster.

    `ray` maps (column, row, 1) of the raster to the camera's frame.  Outside the image, values are
    0; in the last band they are nan.
    """
    corners = np.array(
        [[box.left, box.right, box.right, box.left], [box.top, box.top, box.bottom, box.bottom]]
    )
    depth = ray[2, :2] @ corners + ray[2, 2]
    bands, block = _blocks(bands, intrinsics, ray, box)
    if relief is None and intrinsics.is_pinhole and depth.min() > 1e-6 * np.abs(depth).max():
        outside = [0.0] * (len(bands) - 1) + [np.nan]
        return [
            _homography(band, intrinsics, ray, box, block, fill)
            for band, fill in zip(bands, outside, strict=True)
        ]
    return _by_coordinates(bands, intrinsics, ray, box, block, relief)


def _blocks(
    bands: list[Image], intrinsics: Intrinsics, ray: NDArray[np.float64], box: RasterWindow
) -> tuple[list[Image], int]:
    """Bands that are averaged in square blocks, and the side of a block [px].  A block is about as
    large as a pixel of the raster.
    """
    middle = np.array([0.5 * (box.left + box.right), 0.5 * (box.top + box.bottom), 1.0])
    x, y, depth = ray @ middle
    if not depth > 0.0:
        return bands, 1
    slope = np.array([ray[0, :2] * depth - x * ray[2, :2], ray[1, :2] * depth - y * ray[2, :2]])
    steps = np.linalg.svd(slope / depth**2, compute_uv=False) * intrinsics.fx_px
    block = int(min(steps.min(), bands[0].width, bands[0].height) + 1e-6)
    if block < 2:
        return bands, 1
    width, height = (side // block * block for side in bands[0].size)
    return [band.reduce(block, (0, 0, width, height)) for band in bands], block


def _homography(
    band: Image,
    intrinsics: Intrinsics,
    ray: NDArray[np.float64],
    box: RasterWindow,
    block: int,
    outside: float,
) -> NDArray[np.float32]:
    """One band of a pinhole image, warped by its homography."""
    from PIL import Image

    camera = np.array(
        [
            [intrinsics.fx_px, 0.0, intrinsics.cx_px],
            [0.0, intrinsics.fy_px, intrinsics.cy_px],
            [0.0, 0.0, float(block)],
        ]
    )
    shift = np.array([[1.0, 0.0, box.left], [0.0, 1.0, box.top], [0.0, 0.0, 1.0]])
    matrix = camera @ ray @ shift
    matrix = matrix / matrix[2, 2]
    warped = band.transform(
        (box.right - box.left, box.bottom - box.top),
        Image.Transform.PERSPECTIVE,
        tuple(matrix.ravel()[:8]),
        Image.Resampling.BILINEAR,
        fillcolor=outside,
    )
    return np.array(warped)


def _by_coordinates(
    bands: list[Image],
    intrinsics: Intrinsics,
    ray: NDArray[np.float64],
    box: RasterWindow,
    block: int,
    relief: Relief | None,
) -> list[NDArray[np.float32]]:
    """Bands of any image, warped point by point with lens distortion.  Points above the horizon are
    left out.
    """
    from scipy.ndimage import map_coordinates

    arrays = [np.asarray(band) for band in bands]
    warped = [np.empty((box.bottom - box.top, box.right - box.left), np.float32) for _ in arrays]
    columns = np.arange(box.left, box.right) + 0.5
    for start in range(box.top, box.bottom, ROWS_AT_ONCE):
        rows = (np.arange(start, min(start + ROWS_AT_ONCE, box.bottom)) + 0.5)[:, None]
        x, y, depth = (line[0] * columns + line[1] * rows + line[2] for line in ray)
        if relief is not None:
            window = np.s_[start : start + len(rows), box.left : box.right]
            x, y, depth = (
                value + lift * relief.heights_m[window]
                for value, lift in zip((x, y, depth), relief.lift, strict=True)
            )
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            depth = np.where(depth > 0.0, depth, np.nan)
            u, v = intrinsics.distorted(x / depth, y / depth)
            u = (intrinsics.fx_px * u + intrinsics.cx_px) / block
            v = (intrinsics.fy_px * v + intrinsics.cy_px) / block
            height, width = arrays[0].shape
            outside = ~((u >= 0.0) & (u < width) & (v >= 0.0) & (v < height))
        u[outside] = v[outside] = 0.5
        for array, out in zip(arrays, warped, strict=True):
            part = out[start - box.top : start - box.top + len(rows)]
            map_coordinates(
                array, [v - 0.5, u - 0.5], part, order=1, mode="nearest", prefilter=False
            )
            part[outside] = np.nan if out is warped[-1] else 0.0
    return warped
