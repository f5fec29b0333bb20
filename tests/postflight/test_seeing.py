"""Focal surfaces, stacks, animations and filters, tested with recordings whose content is known."""

import json
from functools import partial

import numpy as np
import pytest
import rasterio
import tifffile
from PIL import Image
from support.flown import ORIGIN, rotation_of, write_photo
from support.recorded import WIDTH, nadir_to, photo, sites, texture, truth, write_recording

from aosplan.geodesy import to_wgs84
from aosplan.postflight.integral.focal_plane import Raster
from aosplan.postflight.integral.hot_spots import anomalies
from aosplan.postflight.integral.images import Picture
from aosplan.postflight.integral.recording import Recording
from aosplan.postflight.integral.seeing import equalized, faded, local_contrast
from aosplan.postflight.integral.surface import read_stack
from aosplan.postflight.integral.view_subset import ViewSubset

pytestmark = pytest.mark.usefixtures("folder")

SLOPE = (0.2, -0.1)
SITES = [(2.0 * x, 2.0 * y) for x in (-1, 0, 1) for y in (-1, 0, 1)]
BOX = Raster.over((-5.0, -5.0, 5.0, 5.0), 0.1)


@pytest.fixture
def command(command):
    return partial(command, "integrate")


def sloping(position):
    """A vertical photo of ground with the slope `SLOPE`, computed by tracing each ray."""
    column, row = np.meshgrid(np.arange(160) + 0.5, np.arange(120) + 0.5)
    dx, dy = (column - 80.0) / 150.0, -(row - 60.0) / 150.0  # per metre of descent
    rise = SLOPE[0] * dx + SLOPE[1] * dy
    above = position[2] - SLOPE[0] * position[0] - SLOPE[1] * position[1]
    depth = above / (1.0 + rise)
    return texture(position[0] + dx * depth, position[1] + dy * depth)


def fly(folder):
    (folder / "photos").mkdir()
    for index, site in enumerate(SITES):
        image = np.rint(sloping((*site, 30.0))).astype(np.uint8)
        path = folder / "photos" / f"DJI_{index:04d}.jpg"
        write_photo(path, (*site, 30.0), (0.0, -90.0, 0.0), image=image)


def write_dem(path, rise=0.0):
    """Heights of the slope as a GeoTIFF in degrees, with an offset of 400 m."""
    (south, north), (west, east) = to_wgs84(ORIGIN, [-20.0, 20.0], [-20.0, 20.0])
    count = 81
    step_x, step_y = (east - west) / (count - 1), (north - south) / (count - 1)
    at = np.linspace(-20.0, 20.0, count)
    heights = 400.0 + rise + SLOPE[0] * at[None, :] + SLOPE[1] * at[::-1][:, None]
    corner = rasterio.Affine(step_x, 0, west - step_x / 2, 0, -step_y, north + step_y / 2)
    with rasterio.open(path, "w", driver="GTiff", width=count, height=count, count=1,
                       dtype="float64", crs="EPSG:4326", transform=corner) as file:  # fmt: skip
        file.write(heights, 1)
        file.units = ("metre",)


def shifted(recording):
    x, y = (float(v) for v in recording.georeference.to_world(*ORIGIN))
    return truth(BOX, shade=lambda u, v: texture(u - x, v - y))


def test_a_tilted_plane_and_an_elevation_model_are_the_ground(folder):
    fly(folder)
    write_dem(folder / "dem.tif")
    # The take-off point is below the first photo. There, the ground is lower than in the middle by
    # this height.
    first = SLOPE[0] * SITES[0][0] + SLOPE[1] * SITES[0][1]
    tilted = Recording("photos", slope=SLOPE)
    model = Recording("photos", focal_height_m=first)
    level = Recording("photos").integrate(ViewSubset(), BOX).values[..., 0]
    wanted = shifted(tilted)
    one = tilted.integrate(ViewSubset(), BOX).values[..., 0]
    other = model.integrate(ViewSubset(), BOX, surface="dem.tif").values[..., 0]
    assert np.abs(one - wanted).mean() < 2.0
    assert np.abs(other - wanted).mean() < 2.0
    assert np.abs(level - wanted).mean() > 3.0 * np.abs(other - wanted).mean()


def test_a_stack_has_a_page_for_each_height_and_a_film_a_frame(command, folder):
    views = list(sites())
    paths = write_recording(folder, views, [np.rint(photo(*v)).astype(np.uint8) for v in views])
    args = ["--stack", "-2..4:2", "--out", "s.tif", "--out", "f.gif", "--out", "p.png"]
    assert command(*paths, *args, "--extent=-4,-4,4,4")[0] == 0
    with tifffile.TiffFile("s.tif") as file:
        assert [page.description for page in file.pages] == [
            f"height_m={height}" for height in (-2, 0, 2, 4)
        ]
        sharp = file.pages[1].asarray()
    command(*paths, "--out", "one.tif", "--extent=-4,-4,4,4")
    with Image.open("one.tif") as one:
        assert np.asarray(one) == pytest.approx(sharp)
    with Image.open("f.gif") as film:
        assert film.n_frames == 6  # forwards and backwards
    assert "--stack" in command(*paths, "--out", "g.gif")[2]


def test_heights_of_a_stack():
    assert read_stack("0..1:0.25") == pytest.approx([0, 0.25, 0.5, 0.75, 1])
    assert read_stack("1,5,2") == [1, 5, 2]


def test_photos_of_different_exposure_are_matched(folder):
    views = list(sites())
    gains = np.linspace(0.6, 1.4, len(views))
    images = [np.clip(np.rint(0.5 * g * photo(*v)), 0, 255).astype(np.uint8) for g, v in zip(gains, views, strict=True)]  # fmt: skip
    recording = Recording(*write_recording(folder, views, images))
    adjust = equalized(recording.sources, recording.plane, BOX)
    brightness = []
    for source, image in zip(recording.sources, images, strict=True):
        changed = adjust(source, Picture(image[..., None], None, is_byte=True)).pixels
        brightness.append(changed.mean() / (image.mean() / gains[len(brightness)]))
    # After the correction, the brightnesses agree. Small differences remain, because the photos
    # show different ground.
    assert np.std(brightness) / np.mean(brightness) < 0.1 < np.std(gains)


def test_temperatures_are_shifted_not_scaled(folder):
    views = list(sites())
    images = [(280.0 + 0.01 * photo(*v) + k).astype(np.float32) for k, v in enumerate(views)]
    recording = Recording(*write_recording(folder, views, images))
    adjust = equalized(recording.sources, recording.plane, BOX)
    for source, image in zip(recording.sources, images, strict=True):
        changed = adjust(source, Picture(image[..., None], None, is_byte=False))
        off = changed.pixels[..., 0] - image
        assert np.ptp(off) < 1e-3
    values = recording.integrate(ViewSubset(), BOX, adjust=adjust).values
    assert np.nanmean(values) == pytest.approx(280.0 + 1.28 + 4.0, abs=0.5)


def test_feathered_photos_leave_no_seam(folder):
    views = [(nadir_to(0.0), np.array([x, 0.0, 30.0])) for x in (-6.0, 6.0)]
    images = [np.full((120, WIDTH), value, np.uint8) for value in (100, 160)]
    recording = Recording(*write_recording(folder, views, images))
    raster = Raster.over((-12.0, -2.0, 12.0, 2.0), 0.2)
    plain, soft = (
        recording.integrate(ViewSubset(), raster, adjust=a).values for a in (None, faded)
    )
    steps = [np.abs(np.diff(image[10, :, 0])).max() for image in (plain, soft)]
    assert steps[0] == pytest.approx(30.0)  # This is the ratio of one photo to the mean of both.
    assert steps[1] < 10.0


def test_an_uneven_veil_is_removed():
    rng = np.random.default_rng(1)
    detail = rng.normal(0, 1, (80, 80))
    veil = np.linspace(0, 200, 80)[:, None]
    seen = np.ones((80, 80), bool)
    found = local_contrast((veil + detail)[..., None], seen, 6.0)[..., 0]
    inner = np.s_[20:-20, 20:-20]
    assert np.corrcoef(found[inner].ravel(), detail[inner].ravel())[0, 1] > 0.9
    assert abs(found[20:30].mean() - found[-30:-20].mean()) < 0.3


def warm(folder, spot=(1.5, -2.0)):
    """Photos of uniform ground with noise and with one warm square, which is 0.6 m wide."""
    rng = np.random.default_rng(2)
    (folder / "photos").mkdir()

    def shade(x, y):
        inside = (np.abs(x - spot[0]) < 0.3) & (np.abs(y - spot[1]) < 0.3)
        return np.where(inside, 160.0, 100.0)

    for index, site in enumerate(SITES):
        image = photo(rotation_of(0.0, -90.0, 0.0), np.array([*site, 30.0]), shade=shade)
        image = np.clip(np.rint(image + rng.normal(0, 4, image.shape)), 0, 255).astype(np.uint8)
        path = folder / "photos" / f"DJI_{index:04d}.jpg"
        write_photo(path, (*site, 30.0), (0.0, -90.0, 0.0), image=image)


def test_a_warm_spot_is_found_in_its_place(command, folder):
    warm(folder)
    args = [
        "--hot-spots",
        "h.geojson",
        "--anomalies",
        "a.tif",
        "--extent=-6,-6,6,6",
        "--gsd",
        "0.1",
    ]
    assert command("photos", *args)[0] == 0
    first = json.loads((folder / "h.geojson").read_text())["features"][0]
    (north,), (east,) = to_wgs84(ORIGIN, [1.5], [-2.0])
    assert first["geometry"]["coordinates"] == pytest.approx([east, north], abs=2e-6)  # 0.2 m
    assert first["properties"]["size_m"] == pytest.approx(0.6, abs=0.25)
    assert first["properties"]["contrast"] == pytest.approx(55.0, abs=12.0)
    with rasterio.open("a.tif") as raster:
        share = raster.read(1)
        row, column = np.unravel_index(np.nanargmax(share), share.shape)
        x, y = raster.xy(row, column)
    assert (x, y) == pytest.approx((1.5, -2.0), abs=0.4)
    assert np.nanmax(share) > 0.9


def test_the_anomalies_of_a_photo_are_the_rarest_colours():
    rng = np.random.default_rng(3)
    pixels = rng.normal(100, 5, (60, 60, 3)).astype(np.float32)
    pixels[5:9, 5:9] = 100.0, 130.0, 70.0
    mask = anomalies(None, Picture(pixels, None, is_byte=True)).pixels[..., 0]
    assert mask[5:9, 5:9].all()
    assert mask.mean() == pytest.approx(0.01, abs=0.002)


def test_a_picture_may_have_a_scale_and_north(command, folder):
    warm(folder)
    command("photos", "--out", "a.png", "--extent=-6,-6,6,6", "--gsd", "0.05")
    command("photos", "--out", "b.png", "--scale", "--extent=-6,-6,6,6", "--gsd", "0.05")
    with Image.open("a.png") as plain, Image.open("b.png") as scaled:
        zoom = scaled.width // plain.width
        assert scaled.width == 2 * plain.width
        strip = np.asarray(scaled.convert("L"))[2 * plain.height + 2 :]
        bar = strip[len(strip) // 2] < 50
    run = np.diff(np.flatnonzero(np.diff(bar.astype(int))))[0]
    assert run * 0.05 / zoom == pytest.approx(2.0, abs=0.1)  # 2 m


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--slope", "1"], "--slope '1'"),
        (["--slope", "3,0"], "steeper"),
        (["--stack", "5..1"], "empty"),
        (["--stack", "0..9:0"], "--stack"),
        (["--stack", "0..9:0.001"], "more than 500"),
        (["--local", "0"], "--local"),
        (["--focal-surface", "none.tif"], "none.tif"),
        (["--focal-surface", "dem.tif", "--focus", "auto"], "surface"),
        (["--hot-spots", "h.xyz"], "h.xyz"),
        (["--hot-spots", "x.png"], "x.png"),
    ],
)
def test_wrong_requests_are_refused(command, folder, arguments, part):
    fly(folder)
    status, out, err = command("photos", *arguments, "--out", "x.png")
    assert (status, out) == (2, "")
    assert part in err
    assert not (folder / "x.png").exists()
