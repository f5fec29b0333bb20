"""Pictures of a resolution chart behind trees, and PNG files.

Images are arrays of floats from 0 to 1, of shape (rows, columns) or (rows, columns, 3). The top row
is the first. In the limit of infinitely many views, an integral image is a mixture of the target
and a uniform veil. The veil is the colour of the occluders, with the weight p. With a finite number
of views, some structure of the occluders remains. This makes the image less similar to the limit.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import MissingExtraError, needs_extra

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Image = NDArray[np.float64]

EXTRA = "pictures"
EXTRA_MODULES = ("PIL", "skimage")

LEAVES = (0.16, 0.42, 0.14)
"""Colour of the occluders (red, green, blue)."""

SPOKES = 24
BARS = (2, 4, 6, 9, 13)
"""Number of pairs of bars in each group of the chart."""

GAP_PX = 4
"""Width of the white gap between the panels of a picture."""


def resolution_chart(rows: int, columns: int) -> Image:
    """A grey chart with bars, a Siemens star and a wedge of grey levels, without text.

    Parameters
    ----------
    rows, columns
        Size of the image, at least 1.  The chart fills the image.

    Returns
    -------
    ndarray
        Shape (rows, columns), from 0 (black) to 1 (white).
    """
    y = (np.arange(rows) + 0.5) / rows
    x = (np.arange(columns) + 0.5) / columns
    chart = np.full((rows, columns), 0.92)
    for k, pairs in enumerate(BARS):
        low, high = 0.05 + 0.18 * k, 0.05 + 0.18 * k + 0.15
        along = (x - low) / (high - low)
        bars = (along * pairs) % 1.0 < 0.5
        _fill(chart, (y > 0.05) & (y < 0.2), (along >= 0.0) & (along < 1.0), bars[np.newaxis])
        # The same groups with horizontal bars are along the left and the right side.
        down = (y - low * 0.62 - 0.22) / ((high - low) * 0.62)
        lines = ((down * pairs) % 1.0 < 0.5)[:, np.newaxis]
        for side in (0.05, 0.83):
            _fill(chart, (down >= 0.0) & (down < 1.0), (x > side) & (x < side + 0.12), lines)
    # The star is round even if the image is not square.
    unit = min(rows, columns)
    dy = (np.arange(rows) + 0.5 - 0.53 * rows) / unit
    dx = (np.arange(columns) + 0.5 - 0.5 * columns) / unit
    angle = np.arctan2(dy[:, np.newaxis], dx) / (2.0 * np.pi)
    inside = dy[:, np.newaxis] ** 2 + dx**2 < 0.28**2
    chart[inside & ((angle * SPOKES) % 1.0 < 0.5)] = 0.05
    wedge = np.floor(np.clip((x - 0.05) / 0.9, 0.0, 0.999) * 10.0) / 9.0
    band = (y > 0.87) & (y < 0.95)
    across = (x > 0.05) & (x < 0.95)
    chart[np.ix_(band, across)] = wedge[across]
    return chart


def _fill(
    chart: Image, rows: NDArray[np.bool_], columns: NDArray[np.bool_], dark: NDArray[np.bool_]
) -> None:
    chart[rows[:, np.newaxis] & columns & dark] = 0.05


def integral_image(target: Image, blocked_share: Image) -> Image:
    """Image of a grey target below trees. At each pixel, the share X of the views shows the colour
    of the occluders instead of the target.

    Parameters
    ----------
    target
        Shape (rows, columns).
    blocked_share
        X with the same shape, or the number p for infinitely many views.

    Returns
    -------
    ndarray
        Shape (rows, columns, 3).
    """
    veil = np.broadcast_to(np.asarray(blocked_share, dtype=np.float64), target.shape)
    image: Image = (target * (1.0 - veil))[..., np.newaxis] + np.multiply.outer(veil, LEAVES)
    return image


class Panels(NamedTuple):
    """A chart behind trees: in one view, in the integral of all views, and in the limit of
    infinitely many views.

    `share` is X, the share of the views that do not see each target.
    """

    single: Image
    integral: Image
    endless: Image
    share: Image


def panels(every: NDArray[np.int32], one: NDArray[np.int32], views: int) -> Panels:
    """Draw the images of an experiment, with the far end of the area at the top.

    Parameters
    ----------
    every, one
        Number of blocked views, among all views and for the middle view alone.  Their shape is
        (rows, columns), with the near end first.
    views
        Number of all views.
    """
    share = every[::-1] / views
    chart = resolution_chart(*share.shape)
    veils = (one[::-1].astype(float), share, np.asarray(share.mean()))
    single, integral, endless = (integral_image(chart, veil) for veil in veils)
    return Panels(single, integral, endless, share)


def check_extra() -> None:
    """Check that pictures can be drawn, before any work is done for them.

    Raises
    ------
    MissingExtraError
        If Pillow or scikit-image is not installed.
    """
    from importlib.util import find_spec

    if any(find_spec(name) is None for name in EXTRA_MODULES):
        raise MissingExtraError("drawing pictures", EXTRA)


def side_by_side(images: list[Image]) -> Image:
    """One image with several images of the same height side by side, separated by white gaps."""
    gap = np.ones((images[0].shape[0], GAP_PX, *images[0].shape[2:]))
    parts = [part for image in images for part in (image, gap)]
    return np.concatenate(parts[:-1], axis=1)


def png(image: Image) -> bytes:
    """The bytes of a PNG file with an image.  They depend only on the image and the version of
    Pillow.

    Raises
    ------
    MissingExtraError
        If Pillow is not installed.
    """
    with needs_extra("writing pictures", EXTRA):
        from PIL import Image as Pillow
    levels = np.clip(np.rint(image * 255.0), 0, 255).astype(np.uint8)
    file = io.BytesIO()
    Pillow.fromarray(levels).save(file, format="PNG", optimize=True)
    return file.getvalue()
