"""Improvements of integral images for viewing: exposure, blending, contrast, scale and north arrow."""

from __future__ import annotations

import io
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from aosplan.postflight.integral.focal_plane import Plane, Raster
    from aosplan.postflight.integral.images import Picture
    from aosplan.postflight.integral.integral import Integral, ViewSource
    from aosplan.postflight.integral.recording import Recording

    Adjust = Callable[[ViewSource, Picture], Picture]

RIM = 0.15
"""Width of the rim of a photo in which its weight decreases to zero, as a share of the side of the
photo.
"""

SHOWN_PX = 600
"""Approximate size to which a small picture is enlarged before a scale bar is added."""

EXPOSURE_PX = 96
"""Longer side of the reduced integral image in which exposures are compared."""


def together(steps: Sequence[Adjust]) -> Adjust | None:
    """Combine several adjustments into one that applies them one after the other; None if there are
    no adjustments.
    """
    if not steps:
        return None

    def adjust(source: ViewSource, picture: Picture) -> Picture:
        for step in steps:
            picture = step(source, picture)
        return picture

    return adjust


def adjustment(
    recording: Recording,
    indices: NDArray[np.intp],
    raster: Raster,
    *,
    equalize: bool = False,
    feather: bool = False,
) -> Adjust | None:
    """The requested adjustments of each photo, beginning with the exposure; None if no adjustment
    is requested.
    """
    steps: list[Adjust] = []
    if equalize:
        chosen = [recording.sources[index] for index in indices]
        steps.append(equalized(chosen, recording.plane, raster))
    if feather:
        steps.append(faded)
    return together(steps)


def faded(_source: ViewSource, picture: Picture) -> Picture:
    """A picture whose weight decreases towards its edges, which makes the edges of photos invisible
    in the integral image.
    """
    width, height = picture.size
    x, y = ((np.arange(side) + 0.5) / side for side in (width, height))
    ramps = [np.clip(np.minimum(line, 1.0 - line) / RIM, 0.0, 1.0) for line in (x, y)]
    weight = np.outer(ramps[1], ramps[0]).astype(np.float32)
    if picture.weight is not None:
        weight = weight * picture.weight
    return picture._replace(weight=weight)


def equalized(sources: Sequence[ViewSource], plane: Plane, raster: Raster) -> Adjust:
    """Adjustment of each photo to a common exposure, computed from the ground that several photos
    see.

    Byte values are multiplied by a factor, because the exposure differs between photos.  To other
    values, such as temperatures, an offset is added, because thermal cameras drift.
    """
    from aosplan.postflight.integral.focal_plane import Raster
    from aosplan.postflight.integral.integral import add_view, read_source

    coarse = max(raster.gsd_m, raster.gsd_m * max(raster.columns, raster.rows) / EXPOSURE_PX)
    small = Raster.over(raster.extent_m, coarse)
    shape = (small.rows, small.columns)
    images = []
    is_byte = True
    for source in sources:
        picture = read_source(source, None)
        is_byte = is_byte and picture.is_byte
        sums, seen = np.zeros((*shape, picture.pixels.shape[2])), np.zeros(shape)
        add_view(picture, source, plane, small, sums, seen)
        grey = sums.mean(axis=2)
        images.append(np.where(seen > 0.5, grey / np.maximum(seen, 1e-9), np.nan))
    stack = np.stack(images)
    change = np.full(len(stack), 1.0 if is_byte else 0.0)
    for _ in range(3):
        corrected = stack * change[:, None, None] if is_byte else stack + change[:, None, None]
        count = np.maximum(np.isfinite(corrected).sum(axis=0), 1)
        mean = np.nansum(corrected, axis=0) / count
        for index, image in enumerate(corrected):
            there = np.isfinite(image) & (count > 1)
            if not there.any():
                continue
            if is_byte:
                change[index] *= float(mean[there].mean() / max(image[there].mean(), 1e-6))
            else:
                change[index] += float(mean[there].mean() - image[there].mean())
    # The corrections are scaled, so that the mean brightness of all photos does not change.
    change = change / np.exp(np.log(change).mean()) if is_byte else change - change.mean()
    by_name = {source.path: float(value) for source, value in zip(sources, change, strict=True)}

    def adjust(source: ViewSource, picture: Picture) -> Picture:
        value = np.float32(by_name.get(source.path, 1.0 if is_byte else 0.0))
        pixels = picture.pixels * value if is_byte else picture.pixels + value
        return picture._replace(pixels=pixels)

    return adjust


def local_contrast(
    values: NDArray[np.float64], seen: NDArray[np.bool_], window_px: float
) -> NDArray[np.float64]:
    """Values minus their local mean, divided by their local standard deviation.

    This removes the uneven veil of the canopy.

    Parameters
    ----------
    values
        Shape (rows, columns, bands).
    seen
        Mask of the pixels that are used.
    window_px
        Standard deviation of the Gaussian window.

    Returns
    -------
    ndarray
        Values in local standard deviations.  Pixels that are not seen are nan.
    """
    from scipy.ndimage import gaussian_filter

    def smooth(image: NDArray[np.float64]) -> NDArray[np.float64]:
        blurred: NDArray[np.float64] = gaussian_filter(np.where(seen, image, 0.0), window_px)
        return blurred / np.maximum(gaussian_filter(seen.astype(float), window_px), 1e-9)

    bands = []
    for each in np.moveaxis(values, -1, 0):
        band = np.where(seen, each, 0.0)
        mean = smooth(band)
        spread = np.sqrt(np.maximum(smooth((band - mean) ** 2), 0.0))
        floor = 0.1 * float(np.median(spread[seen])) if seen.any() else 1.0
        bands.append(np.where(seen, (band - mean) / np.maximum(spread, max(floor, 1e-9)), np.nan))
    return np.stack(bands, axis=-1)


def with_scale(png: bytes, integral: Integral) -> bytes:
    """A PNG with a scale bar and a north arrow below the image.  Small images are enlarged."""
    from PIL import Image, ImageDraw

    from aosplan.postflight.integral.layers import label

    with Image.open(io.BytesIO(png)) as opened:
        zoom = max(SHOWN_PX // max(opened.size), 1)
        image = opened.convert("RGBA").resize(
            (opened.width * zoom, opened.height * zoom), Image.Resampling.NEAREST
        )
    strip = max(round(0.08 * max(image.size)), 28)
    canvas = Image.new("RGBA", (max(image.width, 160), image.height + strip), "white")
    canvas.paste(image, (0, 0), image)
    pen = ImageDraw.Draw(canvas)
    pixel_m = integral.raster.gsd_m / zoom
    length_m = _round(0.3 * canvas.width * pixel_m)
    length = length_m / pixel_m
    middle, text = image.height + strip // 2, max(strip // 2, 12)
    pen.rectangle([10, middle - 2, 10 + length, middle + 2], fill="black")
    label(pen, (16 + length, middle - text // 2), f"{length_m:g} m", text)
    x, half = canvas.width - strip // 2 - 6, strip // 2 - 4
    pen.polygon([(x, middle - half), (x - half // 2, middle + half), (x, middle + half // 2),
                 (x + half // 2, middle + half)], fill="black")  # fmt: skip
    label(pen, (x - strip, middle - text // 2), "N", text)
    buffer = io.BytesIO()
    canvas.save(buffer, "PNG")
    return buffer.getvalue()


def _round(length: float) -> float:
    """Round a length down to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(length))
    return float(
        max(step * power for step in (1.0, 2.0, 5.0) if step * power <= length * (1 + 1e-9))
    )
