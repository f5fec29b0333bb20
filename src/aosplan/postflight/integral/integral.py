"""Integral images: views are warped onto the focal plane and averaged.

A pixel of the raster is the mean of the views that show it, weighted by their alpha. Grey values
that are not finite are ignored. Only the sums and one image are in memory at a time. The required
memory therefore does not depend on the number of images.

Images are warped as `aosplan.postflight.integral.warping` describes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError, needs_extra
from aosplan.postflight.integral.focal_plane import heights_above
from aosplan.postflight.integral.images import REDUCIBLE, Picture, image_size, read_picture
from aosplan.postflight.integral.warping import Relief, Scratch, block_of, warped

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray

    from aosplan.postflight.integral.camera_pose import Intrinsics, View
    from aosplan.postflight.integral.focal_plane import Plane, Raster


class ViewSource(NamedTuple):
    """A view, its camera, and the path of its image."""

    view: View
    intrinsics: Intrinsics
    path: str


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
        # Because of this tolerance, a view counts even if its weight is slightly below 1 at the
        # edge of its image.
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
        Heights of the focal surface above the plane at the pixels of the raster, shape (rows,
        columns); None if the focal surface is the plane itself.
    adjust
        Function that changes each image before it is added, for example its exposure.
    progress
        Function that is called with the number of finished views.

    Raises
    ------
    RequestError
        If an image is damaged, does not have the size of its camera, or has other bands than the
        previous images; if a camera is below the plane; or if no view sees the raster.
    """
    sums: NDArray[np.float64] | None = None
    bands: int | None = None
    # Numbers of views are exact in float32.
    coverage = np.zeros((raster.rows, raster.columns), dtype=np.float32)
    done = blind = 0
    scratch = Scratch()
    is_byte = True
    for source in sources:
        block_px = 1
        if source.path.lower().endswith(REDUCIBLE):
            ray = plane.to_camera(source.view) @ raster.to_plane
            block_px = block_of(source.intrinsics, ray, raster)
        picture = read_source(source, bands, block_px)
        bands = picture.pixels.shape[2]
        if adjust is not None:
            picture = adjust(source, picture)
        if sums is None:
            sums = np.zeros((raster.rows, raster.columns, picture.pixels.shape[2]))
        is_byte = is_byte and picture.is_byte
        blind += not add_view(picture, source, plane, raster, sums, coverage, relief_m, scratch)
        done += 1
        if progress is not None:
            progress(done)
    if sums is None or blind == done:
        raise RequestError(
            f"none of the {done} photos shows the extent",
            "compare --extent and --focal-height with the positions of the cameras",
        )
    with np.errstate(invalid="ignore", divide="ignore"):
        sums /= coverage[..., np.newaxis]
    return Integral(raster, sums, coverage.astype(np.float64), done, blind, is_byte)


def read_source(source: ViewSource, bands: int | None, block_px: int = 1) -> Picture:
    """The image of a view, after checking its size and its bands.

    `block_px` is the side of the blocks of pixels whose means the caller needs (`read_picture`).
    """
    picture = read_picture(source.path, block_px)
    wanted = source.intrinsics.in_blocks(picture.block_px)[:2]
    if picture.size != wanted:
        width, height = image_size(source.path)
        raise RequestError(
            f"image '{source.path}' has {width} x {height} pixels, but its camera has "
            f"{source.intrinsics.width_px} x {source.intrinsics.height_px}",
            "all images of a camera must have the same size",
        )
    if bands is not None and picture.pixels.shape[2] != bands:
        kinds = {1: "grey", 3: "in colour"}
        raise RequestError(
            f"image '{source.path}' is {kinds[picture.pixels.shape[2]]}, but the images "
            f"before it are {kinds[bands]}"
        )
    return picture


def add_view(
    picture: Picture,
    source: ViewSource,
    plane: Plane,
    raster: Raster,
    sums: NDArray[np.float64],
    coverage: NDArray[np.floating],
    relief_m: NDArray[np.float64] | None = None,
    scratch: Scratch | None = None,
) -> bool:
    """Add one view to the sums, shape (rows, columns, bands). Returns whether the view sees any
    part of the raster.
    """
    with needs_extra("warping images", "pictures"):
        import cv2

    above_m = plane.camera_m(source.view)[2] - (0.0 if relief_m is None else np.nanmax(relief_m))
    if not above_m > 0.0:
        raise RequestError(
            f"image '{source.view.name}': its camera is not above the focal plane",
            "--focal-height is measured along the upward axis of the world, which --up sets",
        )
    # This matrix maps (column, row, 1) of the raster to the camera's frame. Its third row gives the
    # depth.
    ray = plane.to_camera(source.view) @ raster.to_plane
    relief = None if relief_m is None else Relief(relief_m, heights_above(plane, source.view))
    pixels, weight = picture.pixels, picture.weight
    if weight is not None:
        pixels = np.dstack([pixels * weight[..., np.newaxis], weight])
    has_holes = pixels.dtype.kind == "f" and not np.isfinite(pixels).all()
    seen = False
    lens = source.intrinsics.in_blocks(picture.block_px)
    for tile, values, inside in warped(pixels, lens, ray, raster, relief, scratch):
        if has_holes:
            np.minimum(inside, np.isfinite(values).all(axis=2), out=inside)
        seen = seen or bool(inside.any())
        bands = values if weight is None else np.ascontiguousarray(values[..., :-1])
        cv2.accumulate(bands, sums[tile.slices], inside)
        cv2.accumulate(
            inside if weight is None else np.ascontiguousarray(values[..., -1]),
            coverage[tile.slices],
            inside,
        )
    return seen
