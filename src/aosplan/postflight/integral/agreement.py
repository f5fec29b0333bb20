"""Agreement of the integral images of two disjoint halves of the views, which is a measure of
focus.

The contrast of an integral image is not a measure of focus: it decreases steadily as the focal
plane rises, because fewer occluders are blurred. Two integral images of different photos, however,
agree only at objects on the focal plane. All other objects are blurred differently in the two
images.

Let v_i be the detail of view i at a pixel. The mean of the product v_i v_j over all pairs of
different views is c = Σ_{i≠j} v_i v_j / (n (n-1)) = ((Σ v)² - Σ v²) / (n (n-1)), and the mean of
v_i² is d = Σ v² / n. The correlation of two integrals of n/2 views each, averaged over all ways to
halve the views, is then c / (c + 2 (d - c) / n). This formula includes all halves, so no halves
have to be drawn at random.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.postflight.integral.integral import read_source
from aosplan.postflight.integral.warping import warped

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from aosplan.postflight.integral.camera_pose import Intrinsics, View
    from aosplan.postflight.integral.focal_plane import Plane, Raster
    from aosplan.postflight.integral.integral import ViewSource

    Floats = NDArray[np.float64]

FINE_PX, COARSE_PX = 0.7, 6.0
"""Standard deviations of two Gaussian blurs, in pixels of the reduced image.  The detail is the
difference of the two blurred images.
"""

BLOCKS = 4
"""Number of blocks along each side of the raster. To estimate the error of a peak, each block is
left out once.
"""

LOCAL_PX, LEAST_SPREAD = 10.0, 0.5
"""Window in which the contrast of the detail is equalized: the standard deviation of a Gaussian, in
pixels of the reduced image; and the smallest local standard deviation, divided by its median.

Without this equalization, a few sunlit crowns would outweigh the ground between them.
"""

LONGEST_PX = 480
"""Longest side of the images from which detail is computed."""

PROMINENCE = 3.0
"""Smallest prominence of a significant peak, in standard deviations."""

WEAK, WEAK_SHARE = 0.1, 0.25
"""The agreement of a significant peak is larger than both of these limits: a value, and a share of
the largest agreement.
"""

CLIP = 4.0
"""Detail is limited to this number of standard deviations. Otherwise, single hot pixels would
dominate.
"""


class Detail(NamedTuple):
    """Detail of one view: its reduced image without low frequencies, in local standard deviations.

    The pixels have the shape (rows, columns, 1).
    """

    view: View
    intrinsics: Intrinsics
    pixels: NDArray[np.float32]


def detail_of(source: ViewSource, longest_px: int = LONGEST_PX) -> Detail:
    """Compute the detail of a view's image.

    Parameters
    ----------
    source
        The view.
    longest_px
        Longest side of the reduced image.
    """
    from scipy.ndimage import gaussian_filter

    width, height = source.intrinsics[:2]
    block = max(-(-max(width, height) // longest_px), 1)
    picture = read_source(source, None, block)
    lens = source.intrinsics.in_blocks(picture.block_px)
    block = max(-(-max(lens[:2]) // longest_px), 1)
    lens = lens.in_blocks(block)
    grey = picture.pixels[..., 0].astype(np.float32)
    for band in range(1, picture.pixels.shape[2]):
        grey += picture.pixels[..., band]
    grey /= picture.pixels.shape[2]
    rows, columns = lens.height_px, lens.width_px
    grey = grey[: rows * block, : columns * block]
    grey = grey.reshape(rows, block, columns, block).mean(axis=(1, 3))
    finite = np.isfinite(grey)
    if not finite.all():
        grey = np.where(finite, grey, grey[finite].mean() if finite.any() else 0.0)
    smooth = gaussian_filter(grey, COARSE_PX, mode="nearest")
    detail = gaussian_filter(grey, FINE_PX, mode="nearest") - smooth
    spread = np.sqrt(gaussian_filter(detail * detail, LOCAL_PX, mode="nearest"))
    least = LEAST_SPREAD * float(np.median(spread)) or float(detail.std())
    scaled = np.zeros_like(detail)
    if least > 0.0:
        scaled = np.clip(detail / np.maximum(spread, least), -CLIP, CLIP)
    return Detail(source.view, lens, scaled.astype(np.float32)[..., np.newaxis])


def details_of(
    sources: Sequence[ViewSource],
    longest_px: int = LONGEST_PX,
    step: Callable[[], None] = lambda: None,
) -> list[Detail]:
    """Compute the detail of several views, and subtract the detail that all images have at the same
    place.

    A thermal camera has a fixed pattern, and images may show a logo, black borders or a part of the
    drone. Without the subtraction, these would agree best on a plane at infinity.

    Parameters
    ----------
    sources, longest_px
        As for `detail_of`.
    step
        Function that is called after each view.
    """
    found = []
    for source in sources:
        found.append(detail_of(source, longest_px))
        step()
    sums: dict[tuple[int, ...], Any] = {}
    for detail in found:
        total, count = sums.get(detail.pixels.shape, (0.0, 0))
        sums[detail.pixels.shape] = total + detail.pixels, count + 1
    fixed = {shape: total / count for shape, (total, count) in sums.items() if count > 1}
    return [
        detail._replace(pixels=detail.pixels - fixed.get(detail.pixels.shape, np.float32(0.0)))
        for detail in found
    ]


def on_plane(detail: Detail, view: View, plane: Plane, raster: Raster) -> NDArray[np.float32]:
    """Detail of a view on the raster; nan outside its image."""
    image = np.full((raster.rows, raster.columns), np.nan, dtype=np.float32)
    ray = plane.to_camera(view) @ raster.to_plane
    for tile, values, inside in warped(detail.pixels, detail.intrinsics, ray, raster):
        np.copyto(image[tile.slices], values[..., 0], where=inside.view(bool))
    return image


class DetailSums:
    """Sums over views at each pixel: the sum of the detail, the sum of its square, and the number
    of views.
    """

    def __init__(self, raster: Raster) -> None:
        shape = (raster.rows, raster.columns)
        self.detail, self.square, self.count = np.zeros(shape), np.zeros(shape), np.zeros(shape)

    def add(self, image: NDArray[np.float32]) -> None:
        """Add a view."""
        seen = np.isfinite(image)
        value = np.where(seen, image, 0.0)
        self.detail += value
        self.square += value * value
        self.count += seen


class Agreement(NamedTuple):
    """Agreement between halves of the views. `without` has one agreement for each block of the
    raster, which is computed without this block, shape (BLOCKS²,).
    """

    value: float
    without: Floats


def agreement(sums: DetailSums) -> Agreement:
    """Correlation of the integrals of two halves of the views."""
    rows, columns = sums.count.shape
    down = np.minimum(np.arange(rows) * BLOCKS // rows, BLOCKS - 1)
    right = np.minimum(np.arange(columns) * BLOCKS // columns, BLOCKS - 1)
    block = (down[:, None] * BLOCKS + right).ravel()
    enough = sums.count >= 2.0

    def per_block(values: Floats) -> Floats:
        weights = np.where(enough, values, 0.0).ravel()
        return np.bincount(block, weights, BLOCKS**2).astype(np.float64)

    parts = np.stack(
        [
            per_block(sums.detail**2 - sums.square),
            per_block(sums.count * (sums.count - 1.0)),
            per_block(sums.square),
            per_block(sums.count),
            per_block(np.ones_like(sums.count)),
        ]
    )
    total = parts.sum(axis=1, keepdims=True)
    values = _of_halves(np.concatenate([total, total - parts], axis=1))
    return Agreement(float(values[0]), values[1:])


def _of_halves(parts: Floats) -> Floats:
    shared, pairs, square, count, pixels = parts
    with np.errstate(invalid="ignore", divide="ignore"):
        c, d, n = shared / pairs, square / count, count / pixels
        found = c / (c + 2.0 * (d - c) / n)
    # If views contradict each other at all pixels, the denominator may be negative.
    return np.where(np.isfinite(found), np.clip(found, -1.0, 1.0), 0.0)


def agreement_at(
    details: Sequence[Detail], views: Iterable[View], plane: Plane, raster: Raster
) -> Agreement:
    """Agreement of views on a plane."""
    sums = DetailSums(raster)
    for detail, view in zip(details, views, strict=True):
        sums.add(on_plane(detail, view, plane, raster))
    return agreement(sums)


class Peak(NamedTuple):
    """A peak of a curve: its position, its value, and the standard deviation of the position."""

    place: float
    value: float
    deviation: float


def peak_near(places: Floats, curve: Sequence[Agreement], index: int) -> Peak:
    """The peak of a parabola through three points of a curve.  Its standard deviation follows from
    the variation between blocks.
    """
    inside = min(max(index, 1), len(places) - 2)
    part = slice(inside - 1, inside + 2)
    whole = vertex(places[part], np.array([each.value for each in curve[part]]))
    blocks = np.array([each.without for each in curve[part]])
    moved = np.array([vertex(places[part], values) for values in blocks.T])
    moved = moved[np.isfinite(moved)]
    count = len(moved)
    spread = np.sqrt((count - 1) * np.mean((moved - moved.mean()) ** 2)) if count > 1 else np.inf
    value = float(np.interp(whole, places[part], [each.value for each in curve[part]]))
    return Peak(whole, value, float(spread))


def peaks_of(places: Floats, curve: Sequence[Agreement]) -> tuple[int, int | None]:
    """Indices of the lowest significant peak, and of the highest peak above it.

    A peak is significant if the difference between the peak and the saddle beside it is larger than
    `PROMINENCE` standard deviations of this difference. The standard deviation is computed by
    leaving out one block of the raster at a time (jackknife). Errors of neighbouring values are
    correlated, so the difference is more accurate than each value. If no peak is significant, the
    largest value is taken, even if it is at an end of the curve.
    """
    from scipy.signal import find_peaks

    values = np.array([each.value for each in curve])
    without = np.array([each.without for each in curve])
    best = int(np.argmax(values))
    found, about = find_peaks(values, prominence=0.05 * max(values[best], 0.0))
    left, right = about["left_bases"], about["right_bases"]
    saddles = np.where(values[left] >= values[right], left, right)
    rises = without[found] - without[saddles]
    spread = np.sqrt(without.shape[1] - 1.0) * rises.std(axis=1)
    least = max(WEAK, WEAK_SHARE * values[best])
    clear = [
        int(index)
        for index, rise, error in zip(found, about["prominences"], spread, strict=True)
        if rise > PROMINENCE * error and values[index] > least
    ]
    if not clear:
        return best, None
    lowest = clear[0]
    above = [index for index in clear[1:] if places[index] > places[lowest]]
    return lowest, max(above, key=lambda index: values[index]) if above else None


def vertex(places: Floats, values: Floats) -> float:
    """Position of the maximum of a parabola through three points.  It is limited to the range of
    the points.
    """
    slope = np.diff(values) / np.diff(places)
    bend = (slope[1] - slope[0]) / (places[2] - places[0])
    if not bend < 0.0:
        return float(places[int(np.argmax(values))])
    middle = 0.5 * (places[0] + places[1]) - slope[0] / (2.0 * bend)
    return float(np.clip(middle, places[0], places[2]))
