"""SSIM, compared with its formula and with scikit-image, for whole images and parts of images."""

import numpy as np
import pytest
from skimage.metrics import structural_similarity

from aosplan.errors import RequestError
from aosplan.simulation.pictures import resolution_chart
from aosplan.simulation.ssim import similarity


def ssim_by_hand(one, other):
    """Mean SSIM of two grey images by the formula of Wang et al. (2004), window by window."""
    offsets = np.arange(-5, 6)
    kernel = np.exp(-(offsets**2) / (2 * 1.5**2))
    kernel = np.outer(kernel, kernel) / kernel.sum() ** 2
    c1, c2 = 0.01**2, 0.03**2
    values = []
    for row in range(5, one.shape[0] - 5):
        for column in range(5, one.shape[1] - 5):
            x, y = (image[row - 5 : row + 6, column - 5 : column + 6] for image in (one, other))
            mx, my = (kernel * x).sum(), (kernel * y).sum()
            vx, vy = (kernel * (x - mx) ** 2).sum(), (kernel * (y - my) ** 2).sum()
            cov = (kernel * (x - mx) * (y - my)).sum()
            values.append(
                (2 * mx * my + c1) * (2 * cov + c2) / ((mx * mx + my * my + c1) * (vx + vy + c2))
            )
    return np.mean(values)


def test_similarity_is_that_of_wang_et_al():
    rng = np.random.default_rng(1)
    one = resolution_chart(40, 33)
    other = np.clip(one + 0.2 * rng.standard_normal(one.shape), 0, 1)
    assert similarity(one, other, span=1.0).ssim == pytest.approx(
        ssim_by_hand(one, other), abs=1e-9
    )
    colours = [np.repeat(image[..., None], 3, axis=2) for image in (one, other)]
    grey = similarity(one, other, span=1.0).ssim
    assert similarity(*colours, span=1.0).ssim == pytest.approx(grey, abs=1e-12)
    assert similarity(one, one).ssim == 1.0


def noisy(seed, bands=1):
    return np.random.default_rng(seed).uniform(0, 255, (60, 70, bands))


def test_ssim_of_whole_images_is_scikit_images():
    image, reference = noisy(1)[..., 0], noisy(2)[..., 0]
    reference += image
    whole = structural_similarity(
        image, reference, data_range=255.0, gaussian_weights=True, sigma=1.5,
        use_sample_covariance=False,
    )  # fmt: skip
    found = similarity(image[..., None], reference[..., None], span=255.0)
    assert found.ssim == pytest.approx(whole, abs=1e-12)
    assert found.pixels == 50 * 60


def test_ssim_of_an_image_with_itself_is_one():
    assert similarity(noisy(1, 3), noisy(1, 3), np.ones((60, 70), bool)).ssim == pytest.approx(1)


def test_ssim_follows_the_formula_at_a_single_window():
    # For a single window, the result follows from means, variances and covariance with Gaussian
    # weights.
    image, reference = noisy(3), noisy(4) * 0.5 + noisy(3) * 0.5
    covered = np.zeros((60, 70), bool)
    covered[20:31, 30:41] = True
    line = np.exp(-0.5 * (np.arange(-5, 6) / 1.5) ** 2)
    weight = np.outer(line, line) / line.sum() ** 2
    x, y = image[20:31, 30:41, 0], reference[20:31, 30:41, 0]
    mx, my = (weight * x).sum(), (weight * y).sum()
    vx, vy = (weight * (x - mx) ** 2).sum(), (weight * (y - my) ** 2).sum()
    cov = (weight * (x - mx) * (y - my)).sum()
    c1, c2 = 2.55**2, 7.65**2
    expected = (2 * mx * my + c1) * (2 * cov + c2) / ((mx**2 + my**2 + c1) * (vx + vy + c2))
    found = similarity(image, reference, covered, 255.0)
    assert found.pixels == 1
    assert found.ssim == pytest.approx(expected, abs=1e-12)


def test_pixels_that_are_not_covered_do_not_change_ssim():
    covered = np.zeros((60, 70), bool)
    covered[10:50, 5:60] = True
    image, reference = noisy(1), noisy(2)
    before = similarity(image, reference, covered, 255.0)
    image[~covered] = np.nan
    reference[~covered] = 1e6
    assert similarity(image, reference, covered, 255.0) == before


def test_images_without_a_covered_window_are_refused():
    with pytest.raises(RequestError, match="11 x 11 pixels"):
        similarity(noisy(1), noisy(2), np.eye(70, dtype=bool)[:60])
    with pytest.raises(RequestError, match="the same value"):
        similarity(noisy(1), np.ones((60, 70, 1)), np.ones((60, 70), bool))


def test_images_that_cannot_be_compared_are_named():
    with pytest.raises(RequestError, match="20 x 20 and 21 x 20"):
        similarity(np.zeros((20, 20)), np.zeros((20, 21)))
    with pytest.raises(RequestError, match="20 x 10 pixels are too small"):
        similarity(np.zeros((10, 20)), np.zeros((10, 20)))
