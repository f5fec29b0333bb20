"""Images warped by OpenCV, compared with bilinear interpolation in double precision."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from aosplan.postflight.integral import warping
from aosplan.postflight.integral.camera_pose import Intrinsics, View
from aosplan.postflight.integral.focal_plane import Plane, Raster, heights_above

pytest.importorskip("cv2")

WIDTH, HEIGHT = 640, 512
LENS = Intrinsics(WIDTH, HEIGHT, 580.0, 575.0, 322.4, 254.1)
PLANE = Plane("z", 0.0)
NOISE = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)


def tilted(yaw_deg, tilt_deg, height_m=40.0):
    """A camera above (3, -2) that looks down and is then tilted around its x axis."""
    (cy, sy), (ct, st) = ((np.cos(a), np.sin(a)) for a in np.radians([yaw_deg, tilt_deg]))
    down = np.array([[cy, sy, 0.0], [sy, -cy, 0.0], [0.0, 0.0, -1.0]])
    rotation = np.array([[1, 0, 0], [0, ct, -st], [0, st, ct]]) @ down
    return View("a", rotation, -rotation @ [3.0, -2.0, height_m])


def expected(pixels, lens, view, raster, heights_m=0.0):
    """The exact image on the raster, computed from the positions of its pixels in space.  It is nan
    outside the image.
    """
    x = raster.left_m + raster.gsd_m * (np.arange(raster.columns) + 0.5)
    y = raster.top_m - raster.gsd_m * (np.arange(raster.rows) + 0.5)
    x, y = np.meshgrid(x, y)
    ground = np.stack([x, y, np.broadcast_to(heights_m, x.shape)], axis=-1)
    right, down, ahead = np.moveaxis(ground @ view.rotation.T + view.translation, -1, 0)
    ahead = np.where(ahead > 0, ahead, np.nan)
    u, v = lens.distorted(right / ahead, down / ahead)
    u, v = lens.fx_px * u + lens.cx_px, lens.fy_px * v + lens.cy_px
    inside = (u >= 0) & (u < lens.width_px) & (v >= 0) & (v < lens.height_px)
    at = np.where(inside, [v - 0.5, u - 0.5], 0.0)
    bands = [
        np.where(inside, map_coordinates(band, at, order=1, mode="nearest"), np.nan)
        for band in np.moveaxis(pixels.astype(float), 2, 0)
    ]
    return np.stack(bands, axis=2)


def assembled(pixels, lens, view, raster, relief_m=None):
    found = np.full((raster.rows, raster.columns, pixels.shape[2]), np.nan)
    ray = PLANE.to_camera(view) @ raster.to_plane
    relief = None
    if relief_m is not None:
        relief = warping.Relief(relief_m, heights_above(PLANE, view))
    for tile, values, inside in warping.warped(pixels, lens, ray, raster, relief):
        part = found[tile.slices]
        assert np.isnan(part).all()  # Tiles do not overlap.
        part[inside.view(bool)] = values[inside.view(bool)]
    return found


@pytest.mark.parametrize("k1", [0.0, -0.12])
@pytest.mark.parametrize(("yaw_deg", "tilt_deg"), [(0.0, 0.0), (31.0, 8.0), (200.0, 50.0)])
@pytest.mark.parametrize("tile_px", [97, 1024])
def test_the_error_of_interpolation_is_small_for_noise(monkeypatch, k1, yaw_deg, tilt_deg, tile_px):
    # Noise is a hard test, because differences between neighbouring pixels are up to 255.
    monkeypatch.setattr(warping, "TILE_PX", tile_px)
    lens = LENS._replace(k1=k1)
    view, raster = tilted(yaw_deg, tilt_deg), Raster.over((-30, -25, 33, 29), 0.071)
    found, exact = assembled(NOISE, lens, view, raster), expected(NOISE, lens, view, raster)
    assert (np.isnan(found) == np.isnan(exact)).all()
    assert 0.1 < np.isfinite(exact).mean() < 0.95
    error = np.abs(found - exact)[np.isfinite(exact)]
    assert error.max() < 0.1
    assert np.sqrt(np.mean(error**2)) < 0.01


def test_on_a_relief():
    view, raster = tilted(31.0, 8.0), Raster.over((-30, -25, 33, 29), 0.071)
    relief = 3.0 * np.sin(np.linspace(0, 9, raster.columns)) * np.ones((raster.rows, 1))
    found = assembled(NOISE, LENS, view, raster, relief)
    exact = expected(NOISE, LENS, view, raster, relief)
    assert (np.isnan(found) == np.isnan(exact)).all()
    assert np.nanmax(np.abs(found - exact)) < 0.1


@pytest.mark.parametrize("tile_px", [31, 1024])
def test_blocks_are_means(monkeypatch, tile_px):
    # Each pixel of the raster covers 4 x 4 pixels of the image, and the raster has its own edges.
    monkeypatch.setattr(warping, "TILE_PX", tile_px)
    lens = Intrinsics(WIDTH, HEIGHT, 400.0, 400.0, WIDTH / 2, HEIGHT / 2)
    view, raster = tilted(0.0, 0.0), Raster.over((3 - 32, -2 - 25.6, 3 + 32, -2 + 25.6), 0.4)
    assert (raster.rows, raster.columns) == (HEIGHT // 4, WIDTH // 4)
    exact = NOISE.reshape(HEIGHT // 4, 4, WIDTH // 4, 4, 3).mean(axis=(1, 3))
    assert assembled(NOISE, lens, view, raster) == pytest.approx(exact, abs=1e-2)


def test_only_tiles_that_are_reached_are_warped():
    view = tilted(0.0, 0.0)
    raster = Raster.over((-400, -400, 400, 400), 0.2)
    ray = PLANE.to_camera(view) @ raster.to_plane
    pixels = sum(tile.values[..., 0].size for tile in warping.warped(NOISE, LENS, ray, raster))
    assert pixels < 1.1 * (WIDTH / LENS.fx_px * 40 / 0.2 + 2) * (HEIGHT / LENS.fy_px * 40 / 0.2 + 2)
