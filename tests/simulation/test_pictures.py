"""Tests of the chart, of its image behind trees, and of PNG files."""

import io
import sys

import numpy as np
import pytest
from PIL import Image

from aosplan.errors import MissingExtraError
from aosplan.simulation.pictures import LEAVES, integral_image, png, resolution_chart, side_by_side
from aosplan.simulation.ssim import similarity


@pytest.mark.parametrize("shape", [(360, 480), (97, 61), (1, 1), (40, 400)])
def test_a_chart_fills_any_shape_with_greys(shape):
    chart = resolution_chart(*shape)
    assert chart.shape == shape
    assert chart.min() >= 0.0
    assert chart.max() <= 1.0


def test_a_chart_has_bars_from_coarse_to_fine_a_star_and_ten_greys():
    chart = resolution_chart(1000, 1000)
    changes = np.count_nonzero(np.diff(chart[120]))
    assert changes == 2 * (2 + 4 + 6 + 9 + 13)  # two edges per bar
    lying = np.count_nonzero(np.diff(chart[220:800, 100]))
    assert lying == changes
    turns = np.linspace(0, 2 * np.pi, 20000, endpoint=False)
    ring = chart[(530 + 200 * np.sin(turns)).astype(int), (500 + 200 * np.cos(turns)).astype(int)]
    assert np.count_nonzero(np.diff(np.append(ring, ring[0])) > 0) == 24
    assert np.unique(chart[910, 60:940]).size == 10


def test_an_integral_image_mixes_target_and_leaves_by_the_share_of_views():
    target = np.array([[0.0, 1.0], [0.5, 0.5]])
    share = np.array([[0.0, 0.0], [1.0, 0.25]])
    image = integral_image(target, share)
    assert image[0, 0] == pytest.approx(0.0)
    assert image[0, 1] == pytest.approx(1.0)
    assert image[1, 0] == pytest.approx(LEAVES)
    assert image[1, 1] == pytest.approx(0.75 * 0.5 + 0.25 * np.array(LEAVES))


def test_more_views_come_closer_to_the_optimum():
    rng = np.random.default_rng(2)
    chart = resolution_chart(64, 64)
    optimum = integral_image(chart, np.array(0.5))
    found = [
        similarity(integral_image(chart, rng.binomial(n, 0.5, chart.shape) / n), optimum).ssim
        for n in (1, 9, 49, 1000)
    ]
    assert found == sorted(found)
    assert found[0] < 0.5
    assert found[-1] > 0.95


def test_a_png_contains_the_image_and_is_the_same_each_time():
    image = side_by_side([integral_image(resolution_chart(20, 30), np.array(0.3))] * 2)
    content = png(image)
    read = np.asarray(Image.open(io.BytesIO(content)))
    assert read.shape == (20, 64, 3)
    assert np.array_equal(read, np.rint(image * 255))
    assert (read[:, 30:34] == 255).all()
    assert png(image) == content
    assert np.asarray(Image.open(io.BytesIO(png(image[..., 0])))).shape == (20, 64)


@pytest.mark.parametrize(
    ("module", "call"),
    [
        ("skimage.metrics", lambda image: similarity(image, image)),
        ("PIL", png),
    ],
)
def test_without_the_extra_one_line_says_how_to_get_it(module, call, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match="pictures") as caught:
        call(np.zeros((20, 20)))
    assert caught.value.hint == 'pip install "aosplan[pictures]"'
