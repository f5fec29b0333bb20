"""Integral images of recordings, compared with planes whose true pixels are known."""

import numpy as np
import pytest
from PIL import Image
from support.recorded import (
    FOCAL,
    FOV_DEG,
    HEIGHT,
    WIDTH,
    nadir_to,
    on_plane,
    photo,
    shift_px,
    sites,
    truth,
    write_colmap,
    write_recording,
)

from aosplan.errors import RequestError
from aosplan.postflight.integral.camera_pose import Intrinsics, View, from_field_of_view
from aosplan.postflight.integral.focal_plane import Plane, Raster, upward
from aosplan.postflight.integral.images import read_picture
from aosplan.postflight.integral.integral import ViewSource, integrate
from aosplan.postflight.integral.poses_file import read_poses
from aosplan.postflight.integral.recording import Recording, least_views
from aosplan.postflight.integral.view_subset import ViewSubset

LENS = Intrinsics(WIDTH, HEIGHT, FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2)
PINHOLE = f"1 PINHOLE {WIDTH} {HEIGHT} {FOCAL} {FOCAL} {WIDTH / 2} {HEIGHT / 2}"


def bilinear_error(gsd_m):
    """Largest error of bilinear interpolation of the texture.  It is one eighth of the second
    derivatives times the square of the pixel size.
    """
    # d²/dx² is at most 44 (2.1² + 0.7²), d²/dy² at most 44 (1.3² + 1.1²); photos may be rotated.
    return gsd_m**2 / 8.0 * 44.0 * (2.1**2 + 0.7**2 + 1.3**2 + 1.1**2)


def recorded(tmp_path, views=None, **options):
    views = list(views or sites())
    images = [photo(*view) for view in views]
    return Recording(*write_recording(tmp_path, views, images), **options)


# The integral of views of a plane is the plane


def test_the_integral_of_unoccluded_views_is_the_plane(tmp_path):
    recording = recorded(tmp_path)
    raster = recording.raster(gsd_m=0.2)
    found = recording.integrate(ViewSubset(), raster)
    seen = found.seen(1)
    assert seen.mean() > 0.95
    error = np.abs(found.values[..., 0] - truth(raster))[seen]
    # From 30 m, a pixel is at most 0.25 m, even at a corner of the image. Within half a pixel of an
    # image's edge, the last pixel is repeated.
    assert np.quantile(error, 0.99) < bilinear_error(0.25)
    assert error.mean() < 0.5 * bilinear_error(0.25)


@pytest.mark.parametrize("pitch", [0.0, 4.0])
def test_registration_is_better_than_a_tenth_of_a_pixel(tmp_path, pitch):
    recording = recorded(tmp_path, sites(16, pitch))
    raster = recording.raster((-8, -6, 8, 6), 0.1)
    found = recording.integrate(ViewSubset(), raster)
    assert found.seen(16).mean() > 0.5
    assert np.abs(shift_px(found.values[..., 0], truth(raster), found.seen(16))).max() < 0.02


@pytest.mark.parametrize("index", range(4))
def test_every_single_view_is_registered(tmp_path, index):
    recording = recorded(tmp_path, sites(4, 3.0, seed=7))
    raster = recording.raster((-4, -3, 4, 3), 0.2)
    found = recording.integrate(ViewSubset(views=str(index + 1)), raster)
    assert np.abs(shift_px(found.values[..., 0], truth(raster), found.seen(1))).max() < 0.05


def test_a_shift_of_a_tenth_of_a_pixel_would_be_found(tmp_path):
    recording = recorded(tmp_path)
    raster = recording.raster((-8, -6, 8, 6), 0.2)
    values = recording.integrate(ViewSubset(), raster).values[..., 0]
    moved = Raster(raster.left_m + 0.02, raster.top_m, 0.2, raster.columns, raster.rows)
    shift = shift_px(values, truth(moved), np.ones(values.shape, bool))
    assert shift == pytest.approx([0.1, 0.0], abs=0.02)


def test_a_world_with_z_down_gives_the_same_picture(tmp_path):
    # In the AOS project's recordings the camera looks along the world's z axis.
    views = [
        (nadir_to(10.0 * i, 2.0, -1.0, z_up=False), np.array([2.0 * i, 1.0, -30.0]))
        for i in range(3)
    ]
    images = [photo(*view, up=-1.0) for view in views]
    recording = Recording(*write_recording(tmp_path, views, images, text=True))
    assert recording.plane.up == "-z"
    raster = recording.raster((-3, -4, 7, 4), 0.2)
    found = recording.integrate(ViewSubset(), raster)
    assert np.abs(shift_px(found.values[..., 0], truth(raster), found.seen(1))).max() < 0.02
    assert np.abs(found.values[..., 0] - truth(raster)).max() < bilinear_error(0.25)


def test_the_plane_may_be_at_any_height(tmp_path):
    views = list(sites(4))
    images = [photo(*view, height=7.5) for view in views]
    recording = Recording(*write_recording(tmp_path, views, images), focal_height_m=7.5)
    raster = recording.raster((-3, -3, 3, 3), 0.15)
    found = recording.integrate(ViewSubset(), raster).values[..., 0]
    assert np.abs(found - truth(raster)).max() < bilinear_error(0.2)


def test_a_point_above_the_plane_appears_where_similar_triangles_put_it(tmp_path):
    # For cameras at x = ±3 m and 30 m height, a spot at 10 m height and x = 0 is at ±3 * 10 / 20.
    views = [(nadir_to(0.0), np.array([x, 0.0, 30.0])) for x in (-3.0, 3.0)]

    def spot(x, y):
        return 255.0 * np.exp(-((x / 0.4) ** 2) - (y / 0.4) ** 2)

    images = [photo(*view, height=10.0, shade=spot) for view in views]
    recording = Recording(*write_recording(tmp_path, views, images))
    raster = recording.raster((-4, -2, 4, 2), 0.05)
    values = recording.integrate(ViewSubset(), raster).values[..., 0]
    middles = raster.left_m + 0.05 * (np.arange(raster.columns) + 0.5)
    profile = values.sum(axis=0)
    for side, expected in ((middles < 0, 1.5), (middles > 0, -1.5)):
        centre = (profile * middles)[side].sum() / profile[side].sum()
        assert centre == pytest.approx(-expected, abs=0.01)


# Coverage


def test_coverage_is_the_number_of_views_that_contain_the_projection(tmp_path):
    views = list(sites(9, 6.0, 20.0))
    recording = recorded(tmp_path, views)
    raster = recording.raster((-14, -12, 14, 12), 0.25)
    coverage = recording.integrate(ViewSubset(), raster).coverage
    x = raster.left_m + 0.25 * (np.arange(raster.columns) + 0.5)
    y = raster.top_m - 0.25 * (np.arange(raster.rows) + 0.5)
    ground = np.stack([*np.meshgrid(x, y), np.zeros((raster.rows, raster.columns))], axis=-1)
    counted = np.zeros(coverage.shape)
    for rotation, position in views:
        right, down, ahead = np.moveaxis((ground - position) @ rotation.T, -1, 0)
        column, row = FOCAL * right / ahead + WIDTH / 2, FOCAL * down / ahead + HEIGHT / 2
        inside = (column >= 0) & (column < WIDTH) & (row >= 0) & (row < HEIGHT)
        counted += inside & (ahead > 0)
    assert (coverage == counted).all()
    assert {0.0, 9.0} <= set(np.unique(counted))


def test_pixels_that_no_view_sees_are_nan_and_uncovered(tmp_path):
    recording = recorded(tmp_path, sites(1))
    found = recording.integrate(ViewSubset(), recording.raster((-30, -30, 30, 30), 0.5))
    assert np.isnan(found.values[0, 0, 0])
    assert found.coverage[0, 0] == 0
    assert np.isfinite(found.values[found.seen(1)]).all()
    assert not found.seen(2).any()


@pytest.mark.parametrize(
    ("text", "views", "expected"),
    [("10%", 49, 5), ("10%", 5, 1), ("0%", 5, 1), ("100%", 7, 7), ("3", 7, 3), ("10%", 50, 5)],
)
def test_the_smallest_number_of_views_is_a_number_or_a_share(text, views, expected):
    assert least_views(text, views) == expected


def test_points_behind_the_camera_are_not_visible(tmp_path):
    # The camera is tilted by 75 degrees, so part of the image is sky.
    view = nadir_to(0.0, 75.0), np.array([0.0, 0.0, 10.0])
    _, y, ahead = on_plane(*view)
    assert 0.05 < ahead.mean() < 0.95
    recording = Recording(*write_recording(tmp_path, [view], [photo(*view)]))
    raster = recording.raster((-60, -60, 60, 60), 0.5)
    found = recording.integrate(ViewSubset(), raster)
    seen_y = raster.top_m - 0.5 * (np.nonzero(found.seen(1))[0] + 0.5)
    assert abs(seen_y).min() > abs(y[ahead]).min() - 0.5
    assert (np.sign(seen_y) == np.sign(np.median(y[ahead]))).all()


def test_a_coarse_raster_averages_all_pixels_of_the_image(tmp_path):
    stripes = np.zeros((HEIGHT, WIDTH), np.float32)
    stripes[:, ::2] = 100.0
    view = nadir_to(0.0), np.array([0.0, 0.0, 30.0])
    recording = Recording(*write_recording(tmp_path, [view], [stripes]))
    found = recording.integrate(ViewSubset(), recording.raster((-9, -9, 9, 9), 0.8))
    assert found.values == pytest.approx(np.full(found.values.shape, 50.0))


def test_blocks_do_not_shift_the_picture(tmp_path):
    recording = recorded(tmp_path, sites(4))
    fine, coarse = (recording.raster((-8, -6, 8, 6), gsd) for gsd in (0.1, 0.5))
    values = recording.integrate(ViewSubset(), coarse).values[..., 0]
    assert fine.columns == 5 * coarse.columns
    averaged = truth(fine).reshape(coarse.rows, 5, coarse.columns, 5).mean(axis=(1, 3))
    assert np.abs(shift_px(values, averaged, np.ones(values.shape, bool))).max() < 0.02


@pytest.mark.parametrize("size", [(800, 640), (803, 645)])
def test_a_jpeg_may_be_decoded_smaller_for_a_coarse_raster(tmp_path, monkeypatch, size):
    width, height = size
    rng = np.random.default_rng(4)
    smooth = Image.fromarray(rng.integers(60, 200, (height // 16, width // 16, 3)).astype(np.uint8))
    picture = smooth.resize(size, Image.Resampling.BICUBIC)
    noise = rng.normal(0.0, 12.0, (height, width, 1))
    noisy = np.clip(np.asarray(picture) + noise, 0, 255).astype(np.uint8)
    Image.fromarray(noisy).save(tmp_path / "a.jpg", quality=98)
    lens = Intrinsics(width, height, 600.0, 600.0, width / 2, height / 2)
    view = nadir_to(10.0), np.array([0.0, 0.0, 30.0])
    source = ViewSource(View("a", view[0], -view[0] @ view[1]), lens, str(tmp_path / "a.jpg"))
    raster = Raster.over((-15, -12, 15, 12), 5.3 * 30 / 600)
    blocks = []

    def decoded(path, block_px=1):
        blocks.append(read_picture(path, block_px).block_px)
        return read_picture(path, block_px)

    monkeypatch.setattr("aosplan.postflight.integral.integral.read_picture", decoded)
    small = integrate([source], Plane("z", 0.0), raster)
    monkeypatch.setattr(
        "aosplan.postflight.integral.integral.read_picture", lambda path, _: decoded(path)
    )
    full = integrate([source], Plane("z", 0.0), raster)
    assert blocks == [4, 1]
    both = (small.coverage > 0) & (full.coverage > 0)
    assert both.mean() > 0.8
    # At two edges, up to 3 pixels do not fill a block.
    assert (small.coverage != full.coverage).mean() < 0.03
    # Blocks of 4 and of 5 pixels are means of different pixels. With noise of 12, they differ by
    # about 12 sqrt(1 / 16 + 1 / 25) before interpolation. The picture itself is not shifted.
    off = (small.values - full.values)[both].mean(axis=-1)
    assert np.sqrt(np.mean(off**2)) < 4.0
    assert np.abs(shift_px(small.values[..., 0], full.values[..., 0], both)).max() < 0.03


# Memory


def test_one_image_at_a_time_is_all_that_is_needed(tmp_path):
    # Every file is deleted before the next one is written.
    def streamed():
        path = tmp_path / "only.tif"
        for index, (rotation, position) in enumerate(sites()):
            path.unlink(missing_ok=True)
            Image.fromarray(photo(rotation, position)).save(path)
            yield ViewSource(View(f"{index}", rotation, -rotation @ position), LENS, str(path))

    raster = Raster.over((-4, -4, 4, 4), 0.2)
    found = integrate(streamed(), Plane("z", 0.0), raster)
    assert found.views == 9
    assert np.abs(found.values[..., 0] - truth(raster)).max() < bilinear_error(0.25)


# COLMAP


LENSES = {
    "SIMPLE_PINHOLE": ((), ()),
    "PINHOLE": ((), ()),
    "SIMPLE_RADIAL": ((-0.12,), (-0.12, 0, 0, 0)),
    "RADIAL": ((-0.12, 0.03), (-0.12, 0.03, 0, 0)),
    "OPENCV": ((-0.15, 0.04, 0.002, -0.003), (-0.15, 0.04, 0.002, -0.003)),
    "FULL_OPENCV": ((-0.15, 0.04, 0.002, -0.003, 0, 0, 0, 0), (-0.15, 0.04, 0.002, -0.003)),
}


@pytest.mark.parametrize("model", LENSES)
def test_colmap_with_and_without_distortion(tmp_path, model):
    middle = 83.0, 58.5
    extra, distortion = LENSES[model]
    focal = f"{FOCAL}" if model.startswith(("SIMPLE", "RADIAL")) else f"{FOCAL} {FOCAL}"
    camera = f"1 {model} {WIDTH} {HEIGHT} {focal} {middle[0]} {middle[1]} "
    camera += " ".join(map(str, extra))
    views = list(sites(9, 2.0))
    images = [photo(*view, distortion=distortion or None, middle=middle) for view in views]
    recording = Recording(*write_colmap(tmp_path, views, images, [camera]))
    raster = recording.raster((-9, -7, 9, 7), 0.2)
    found = recording.integrate(ViewSubset(), raster)
    assert np.abs(shift_px(found.values[..., 0], truth(raster), found.seen(1))).max() < 0.02
    error = np.abs(found.values[..., 0] - truth(raster))[found.seen(1)]
    assert np.quantile(error, 0.99) < bilinear_error(0.27)


def test_a_rational_distortion_is_refused(tmp_path):
    numbers = f"{FOCAL} {FOCAL} 80 60 -0.1 0 0 0 0 0.2 0 0"
    view = next(iter(sites(1)))
    camera = f"1 FULL_OPENCV {WIDTH} {HEIGHT} {numbers}"
    folder, _ = write_colmap(tmp_path, [view], [photo(*view)], [camera])
    with pytest.raises(RequestError, match="k4, k5 or k6 is not supported"):
        read_poses(folder)


def test_ignoring_the_distortion_would_be_found(tmp_path):
    views = list(sites(9, 2.0))
    images = [photo(*view, distortion=(-0.12, 0, 0, 0)) for view in views]
    recording = Recording(*write_colmap(tmp_path, views, images, [PINHOLE]))
    raster = recording.raster((-9, -7, 9, 7), 0.2)
    found = recording.integrate(ViewSubset(), raster)
    error = np.abs(found.values[..., 0] - truth(raster))[found.seen(1)]
    assert np.quantile(error, 0.99) > 4 * bilinear_error(0.27)


def test_beyond_the_fold_of_a_lens_nothing_is_seen():
    # r (1 - 0.3 r²) has a maximum at r = 1.054. Rays with a larger r would be mapped into the image
    # again.
    lens = LENS._replace(k1=-0.3)
    x, _ = lens.distorted(np.array([0.5, 1.0, 1.1, 1.8]), np.zeros(4))
    assert np.isfinite(x).tolist() == [True, True, False, False]
    assert lens.undistorted(0.4625, 0.0) == pytest.approx((0.5, 0.0))
    assert np.isnan(lens.undistorted(0.8, 0.0)).all()


def test_the_rotation_of_a_quaternion_is_scipys(tmp_path):
    views = [
        (nadir_to(a, b, c), np.array([1.0, 2, 30]))
        for a, b, c in np.random.default_rng(3).normal(0, 90, (20, 3))
    ]
    folder, _ = write_colmap(tmp_path, views, [photo(*views[0])] * 20, [PINHOLE])
    for view, (rotation, position) in zip(read_poses(folder), views, strict=True):
        assert view.rotation == pytest.approx(rotation, abs=1e-12)
        assert view.position == pytest.approx(position, abs=1e-9)


def test_either_file_of_a_colmap_reconstruction_is_accepted(tmp_path):
    views = list(sites(2))
    folder, _ = write_colmap(tmp_path, views, [photo(*view) for view in views], [PINHOLE])
    for path in (folder, f"{folder}/images.txt", f"{folder}/cameras.txt"):
        assert [view.name for view in read_poses(path)] == ["shot 000.tif", "shot 001.tif"]


# The AOS project's own files


def test_poses_as_the_aos_project_publishes_them(tmp_path):
    # The values are from the open-field recording of the AOS project: 27 m above a start at 285.48
    # m, with z downwards. In some files, numbers are text.
    text = """{"images": [
      {"imagefile": "31.png", "M3x4": [
        [0.9945218953682733, -0.10452846326765342, -0.0, -3.1725731711559653],
        [0.10452846326765342, 0.9945218953682733, 0.0, 14.66177421312209],
        [0.0, -0.0, 1.0, 312.23864195287615]]},
      {"imagefile": "20191004_091656.tiff", "M3x4": [
        ["0.543312252", "-0.836627603", "0.0697564632", "3.69248009"],
        ["0.822949588", "0.514307797", "-0.24133262", "-13.0545139"],
        ["0.166029245", "0.188525036", "0.967932105", "48.0838966"]]}]}"""
    (tmp_path / "poses.json").write_text(text)
    first, second = read_poses(str(tmp_path / "poses.json"))
    assert first.position[2] == pytest.approx(-312.2386)
    assert second.rotation @ second.position == pytest.approx(-second.translation)
    assert upward([first, second]) == "-z"
    plane = Plane("-z", 285.48)
    assert plane.camera_m(first)[2] == pytest.approx(26.7586, abs=1e-3)


def test_the_given_field_of_view_is_across_the_width_of_the_image():
    lens = from_field_of_view(50.815436217896945)(512, 512)
    assert lens.fx_px == pytest.approx(538.94, abs=0.5)  # 512 / 0.95, as in the project
    assert from_field_of_view(FOV_DEG)(WIDTH, HEIGHT) == pytest.approx(LENS)


# Modes


def of_mode(mode, value=100):
    grey = np.full((HEIGHT, WIDTH), value)
    if mode in ("I;16", "I;16B"):
        return Image.fromarray(grey.astype(np.uint16) * 300)
    if mode == "I":
        return Image.fromarray(grey.astype(np.int32) * 1000)
    if mode == "F":
        return Image.fromarray(grey.astype(np.float32) / 8)
    return Image.fromarray(grey.astype(np.uint8)).convert(mode)


MODES = {"L": 100, "I;16": 30000, "I": 100000, "F": 12.5, "RGB": 100, "P": 100, "1": None,
         "LA": 100, "RGBA": 100, "CMYK": 100}  # fmt: skip


@pytest.mark.parametrize("mode", MODES)
def test_images_of_any_mode_keep_their_values(tmp_path, mode):
    view = nadir_to(0.0), np.array([0.0, 0.0, 30.0])
    ending = "png" if mode in ("P", "LA", "RGBA", "1") else "tif"
    poses, images = write_recording(tmp_path, [view], [np.zeros((2, 2), np.uint8)])
    (tmp_path / "images" / "000.tif").unlink()
    of_mode(mode, 255 if mode == "1" else 100).save(tmp_path / "images" / f"000.{ending}")
    recording = Recording(poses, images)
    found = recording.integrate(ViewSubset(), recording.raster((-3, -3, 3, 3), 0.3))
    assert found.values == pytest.approx(np.full(found.values.shape, MODES[mode] or 255.0))
    assert found.values.shape[2] == (3 if mode in ("RGB", "P", "RGBA", "CMYK") else 1)
    assert found.is_byte == (mode not in ("I;16", "I", "F"))


def test_values_that_are_not_finite_do_not_count(tmp_path):
    view = nadir_to(0.0), np.array([0.0, 0.0, 30.0])
    whole = np.full((HEIGHT, WIDTH), 20.0, np.float32)
    holes = whole + 10.0
    holes[:, :50], holes[:40] = np.nan, np.inf
    recording = Recording(*write_recording(tmp_path, [view] * 2, [whole, holes]))
    found = recording.integrate(ViewSubset(), recording.raster((-9, -9, 9, 9), 0.3))
    assert set(np.unique(found.coverage)) == {1.0, 2.0}
    assert found.values[found.coverage == 1] == pytest.approx(20.0)
    assert found.values[found.coverage == 2] == pytest.approx(25.0)


@pytest.mark.parametrize("k1", ["", "-0.1"])
def test_a_view_outside_the_raster_is_counted_as_blind(tmp_path, k1):
    model = "SIMPLE_RADIAL" if k1 else "SIMPLE_PINHOLE"
    camera = f"1 {model} {WIDTH} {HEIGHT} {FOCAL} {WIDTH / 2} {HEIGHT / 2} {k1}"
    views = [(nadir_to(0.0), np.array([x, 0.0, 30.0])) for x in (0.0, 500.0)]
    recording = Recording(*write_colmap(tmp_path, views, [photo(*views[0])] * 2, [camera]))
    raster = recording.raster((-3, -3, 3, 3), 0.3)
    assert recording.integrate(ViewSubset(), raster).blind == 1
    with pytest.raises(RequestError, match="none of the 1 photos"):
        recording.integrate(ViewSubset(views="2"), raster)


def test_transparent_pixels_do_not_count(tmp_path):
    # The left half of one of two images is transparent and white.
    view = nadir_to(0.0), np.array([0.0, 0.0, 30.0])
    grey = np.full((HEIGHT, WIDTH, 2), 255, np.uint8)
    grey[..., 0] = 40
    masked = grey.copy()
    masked[:, : WIDTH // 2] = 250, 0
    poses, images = write_recording(
        tmp_path, [view] * 2, [Image.fromarray(grey, "LA"), Image.fromarray(masked, "LA")]
    )
    recording = Recording(poses, images)
    found = recording.integrate(ViewSubset(), recording.raster((-6, -3, 6, 3), 0.3))
    assert found.values[..., 0] == pytest.approx(np.full(found.values.shape[:2], 40.0))
    assert found.coverage[10, 0] == pytest.approx(1)
    assert found.coverage[10, -1] == pytest.approx(2)
