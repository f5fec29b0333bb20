"""SSIM of two images in the area that both cover.

SSIM is the structural similarity as defined by Wang, Bovik, Sheikh and Simoncelli (2004). It is
computed by scikit-image, with Gaussian windows of σ = 1.5 pixels that are 11 pixels wide. Only
windows whose pixels are all covered in both images are used. The images are not normalised. A veil
or a different exposure therefore reduces the similarity.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.errors import RequestError, needs_extra

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

WINDOW_PX = 11


class Similarity(NamedTuple):
    """Mean SSIM over the used windows, and the number of these windows."""

    ssim: float
    pixels: int


def similarity(
    image: NDArray[np.float64],
    reference: NDArray[np.float64],
    covered: NDArray[np.bool_] | None = None,
    span: float | None = None,
) -> Similarity:
    """SSIM of an image and a reference.  It is 1 for equal images.

    Parameters
    ----------
    image, reference
        Shape (rows, columns) or (rows, columns, bands).
    covered
        Shape (rows, columns): pixels that both images cover; None for all pixels.
    span
        Dynamic range of the values, such as 255 for 8-bit images; None for the range of the
        reference.

    Raises
    ------
    RequestError
        If the shapes differ, if no window is covered, or if all pixels of the reference have the
        same value.
    MissingExtraError
        If scikit-image is not installed.
    """
    with needs_extra("comparing images", "pictures"):
        from skimage.metrics import structural_similarity
    from scipy.ndimage import minimum_filter

    sizes = [f"{one.shape[1]} x {one.shape[0]}" for one in (image, reference)]
    if image.shape != reference.shape:
        raise RequestError(f"images of {' and '.join(sizes)} pixels cannot be compared")
    if min(image.shape[:2]) < WINDOW_PX:
        raise RequestError(
            f"images of {sizes[0]} pixels are too small to compare",
            f"the similarity is computed in windows of {WINDOW_PX} x {WINDOW_PX}",
        )
    if covered is None:
        covered = np.ones(image.shape[:2], dtype=np.bool_)
    inside = minimum_filter(covered, WINDOW_PX, mode="constant", cval=False)
    if not inside.any():
        raise RequestError(
            f"no window of {WINDOW_PX} x {WINDOW_PX} pixels is covered in both images",
            "give a smaller --gsd, a larger --extent, or a smaller --min-views",
        )
    if span is None:
        span = float(np.ptp(reference[covered]))
    if not span > 0.0:
        raise RequestError(
            "all pixels of the reference image have the same value, so it cannot be compared"
        )
    compared: Callable[..., Any] = structural_similarity
    bands = [np.atleast_3d(one) for one in (image, reference)]
    maps = [
        compared(
            *(np.where(covered, one[..., band], 0.0) for one in bands),
            data_range=span,
            gaussian_weights=True,
            sigma=1.5,
            use_sample_covariance=False,
            full=True,
        )[1][inside]
        for band in range(bands[0].shape[2])
    ]
    return Similarity(float(np.mean(maps)), int(inside.sum()))
