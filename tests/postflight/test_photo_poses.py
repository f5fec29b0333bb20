"""Poses from the metadata of photos, from OpenDroneMap and from COLMAP, up to the integral image of
a folder.
"""

import json
import struct
from functools import partial

import numpy as np
import pytest
import rasterio
import tifffile
from jsonschema import Draft202012Validator
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from scipy.spatial.transform import Rotation
from support import flown
from support.flown import ORIGIN, fly, rotation_of, write_photo
from support.recorded import FOCAL, HEIGHT, WIDTH, photo, sites, texture, truth, write_colmap

from aosplan.cli.schema import json_schema
from aosplan.errors import RequestError
from aosplan.postflight.integral.colmap import read_colmap
from aosplan.postflight.integral.odm_shots import read_shots
from aosplan.postflight.integral.photo_poses import PhotoOptions, camera_rotation, read_photo_poses
from aosplan.postflight.integral.recording import Recording
from aosplan.postflight.integral.view_subset import ViewSubset
from aosplan.postflight.photo_metadata import read_metadata

pytestmark = pytest.mark.usefixtures("folder")


@pytest.fixture
def command(command):
    return partial(command, "integrate")


def read(folder, **options):
    return read_photo_poses(str(folder), PhotoOptions(**options), None)


@pytest.mark.parametrize(
    "angles", [(0, -90, 0), (90, -90, 0), (-137, -60, 12), (3, -90, 180), (10, 0, 0)]
)
def test_camera_rotations_equal_those_of_scipy(angles):
    assert camera_rotation(*angles) == pytest.approx(rotation_of(*angles), abs=1e-12)


def test_the_top_of_a_photo_straight_down_points_to_its_yaw():
    right, down, forward = camera_rotation(90.0, -90.0, 0.0)
    assert forward == pytest.approx([0, 0, -1], abs=1e-12)
    assert -down == pytest.approx([1, 0, 0], abs=1e-12)  # The top of the image is in the east.
    assert right == pytest.approx([0, -1, 0], abs=1e-12)


def test_the_integral_of_photos_of_a_plane_equals_the_plane(folder):
    poses = fly(folder / "photos")
    recording = Recording(str(folder / "photos"))
    for view, (position, angles) in zip(recording.views, poses, strict=True):
        shift = np.array(recording.georeference.to_world(*ORIGIN)).ravel()
        assert view.position[:2] - shift == pytest.approx(position[:2], abs=2e-4)
        assert view.position[2] == pytest.approx(position[2])
        assert view.rotation == pytest.approx(rotation_of(*angles), abs=1e-9)
    raster = recording.raster((-4, -4, 4, 4), 0.1)
    found = recording.integrate(ViewSubset(), raster).values[..., 0]
    x, y = recording.georeference.to_world(*ORIGIN)
    wanted = truth(raster, shade=lambda u, v: texture(u - x, v - y))
    # The tolerance is in grey values (of 256), because JPEG is lossy.
    assert np.abs(found - wanted).mean() < 1.5


@pytest.mark.parametrize("dialect", ["AUTEL", "PARROT", "PIX4D", "SKYDIO"])
def test_metadata_of_other_manufacturers_give_the_same_poses(folder, dialect):
    poses = fly(folder / "photos", xmp=getattr(flown, dialect))
    tags = [read_metadata(str(path)) for path in sorted((folder / "photos").iterdir())]
    for tag, (position, angles) in zip(tags, poses, strict=True):
        assert (tag.yaw_deg, tag.pitch_deg, tag.roll_deg) == pytest.approx(tuple(angles), abs=1e-4)
        assert tag.absolute_altitude_m == pytest.approx(position[2] + 470.0)
        if dialect == "AUTEL":
            assert tag.relative_altitude_m == pytest.approx(position[2])


def test_focal_lengths_come_from_the_first_available_source(folder):
    xmp = flown.PARROT
    rational = {37386: 4.5, 41486: 2000.0 / 6.0, 41487: 2000.0 / 6.0, 41488: 4, 41989: 24}
    for name, exif, expected in [
        ("a.jpg", rational, 1500.0),  # 4.5 mm at 333.3 pixels per millimetre
        ("b.jpg", {37386: 4.5, 41989: 40}, 40 / np.hypot(36, 24) * np.hypot(WIDTH, HEIGHT)),
        ("c.jpg", {37386: 4.5}, None),
    ]:
        write_photo(folder / name, (0, 0, 30), (0, -90, 0), xmp=xmp, exif=exif)
        assert read_metadata(str(folder / name)).focal_px == pytest.approx(expected)
    dewarp = 'drone-dji:DewarpData="2021-05-01;151,152,1.5,-2,0.1,-0.2,0.001,0.002,0.05" '
    write_photo(folder / "d.jpg", (0, 0, 30), (0, -90, 0), more=dewarp)
    tag = read_metadata(str(folder / "d.jpg"))
    assert tag.lens_px == (151, 152, 81.5, 58, 0.1, -0.2, 0.001, 0.002, 0.05)
    write_photo(
        folder / "e.jpg", (0, 0, 30), (0, -90, 0), more=dewarp + 'drone-dji:DewarpFlag="1" '
    )
    assert read_metadata(str(folder / "e.jpg")).lens_px is None


def test_fixed_rtk_heights_replace_barometric_heights(folder):
    fly(folder / "photos", more='drone-dji:RtkFlag="50"', count=4)
    found = read(folder / "photos")
    assert found.sigma_m < 0.1
    first = folder / "photos" / "DJI_0000.jpg"
    content = first.read_bytes()
    at = content.index(b'RelativeAltitude="') + 18
    # This height is an outlier of the barometer.
    first.write_bytes(content[:at] + b"+99" + content[at + 3 :])
    heights = [view.position[2] for view in read(folder / "photos").views]
    before = [view.position[2] for view in found.views]
    assert np.ptp(np.subtract(heights, before)) < 1e-6


def test_pixels_are_in_the_order_of_the_sensor_for_every_orientation(command, folder):
    fly(folder / "upright", count=4)
    fly(folder / "turned", count=4, orientation=6)
    for name in ("upright", "turned"):
        command(name, "--extent=-3,-3,3,3", "--gsd", "0.1", "--out", f"{name}.png")
    assert (folder / "upright.png").read_bytes() == (folder / "turned.png").read_bytes()
    (said,) = [each for each in read(folder / "turned").messages if each.code == "orientation"]
    assert "4 photos have an EXIF orientation other than 1" in said.message
    assert not any(each.code == "orientation" for each in read(folder / "upright").messages)


# Selection of photos


def test_photos_of_two_bands_need_a_choice_of_band(command, folder):
    fly(folder / "photos", count=4, name="DJI_20250101120000_{:04d}_T.jpg")
    fly(folder / "photos", count=4, name="DJI_20250101120000_{:04d}_V.jpg")
    status, out, err = command("photos", "--out", "x.png")
    assert (status, out) == (2, "")
    assert "4 thermal, 4 wide" in err
    assert "--band thermal or --band visible" in err
    for band, letter in (("thermal", "T"), ("visible", "V")):
        names = [view.name for view in read(folder / "photos", band=band).views]
        assert len(names) == 4
        assert all(name.endswith(f"_{letter}.jpg") for name in names)
    assert "--band 'x'" in command("photos", "--out", "x.png", "--band", "x")[2]
    assert "no photo of this kind" in command("photos", "--out", "x.png", "--band", "zoom")[2]


def test_photos_without_a_band_beside_thermal_ones_are_visible(command, folder):
    fly(folder / "photos", count=4, name="DJI_{:04d}.jpg")
    fly(folder / "photos", count=4, name="DJI_{:04d}_T.jpg")
    assert "4 thermal, 4 visible" in command("photos", "--out", "x.png")[2]
    names = [view.name for view in read(folder / "photos", band="visible").views]
    assert names == [f"DJI_{index:04d}.jpg" for index in range(4)]


def test_a_band_is_named_by_the_tag_before_the_name(folder):
    write_photo(folder / "DJI_0001_V.jpg", (0, 0, 30), (0, -90, 0),
                more='drone-dji:ImageSource="InfraredCamera"')  # fmt: skip
    assert read_metadata(str(folder / "DJI_0001_V.jpg")).band == "thermal"


def test_photos_of_the_horizon_and_without_a_place_are_left_out_by_name(command, folder):
    fly(folder / "photos")
    write_photo(folder / "photos" / "level.jpg", (0, 0, 30), (0, -5, 0))
    write_photo(folder / "photos" / "nowhere.jpg", (0, 0, 30), (0, -90, 0), xmp="", gps=False)
    status, out, err = command("photos", "--out", "x.png")
    assert status == 0
    assert "9 of 9" in out
    assert "level.jpg" in err
    assert "nowhere.jpg" in err


def test_a_radiometric_tiff_beside_its_photo_has_the_pixels(folder):
    poses = fly(folder / "photos", count=4)
    for index, (position, angles) in enumerate(poses):
        kelvin = photo(rotation_of(*angles), position) * 0.1 + 280.0
        Image.fromarray(kelvin.astype(np.float32)).save(folder / "photos" / f"DJI_{index:04d}.tif")
    recording = Recording(str(folder / "photos"))
    found = recording.integrate(ViewSubset(), recording.raster((-3, -3, 3, 3), 0.2))
    assert not found.is_byte
    assert 280.0 < np.nanmin(found.values) < np.nanmax(found.values) < 305.6


def test_images_may_be_the_photos_scaled(folder):
    fly(folder / "photos", count=4)
    (folder / "small").mkdir()
    for path in (folder / "photos").iterdir():
        Image.open(path).resize((WIDTH // 2, HEIGHT // 2)).save(folder / "small" / path.name)
    full = Recording(str(folder / "photos"))
    half = Recording(str(folder / "photos"), str(folder / "small"))
    raster = full.raster((-3, -3, 3, 3), 0.4)
    one, other = (r.integrate(ViewSubset(), raster).values for r in (full, half))
    assert np.abs(one - other).mean() < 3.0


# Missing data in photos


def test_a_plan_supplies_values_that_photos_do_not_have(command, folder):
    poses = [(np.array([x, 0.0, 30.0]), (40.0, -90.0, 0.0)) for x in (-2.0, 0.0, 2.0)]
    (folder / "photos").mkdir()
    for index, pose in enumerate(poses):
        write_photo(folder / "photos" / f"{index}.jpg", *pose, xmp="")
    assert "--altitude M" in command("photos", "--out", "x.png")[2]
    assert "--heading DEG" in command("photos", "--altitude", "30", "--out", "x.png")[2]
    given = ["--altitude", "30", "--heading", "40"]
    assert "--camera NAME" in command("photos", *given, "--out", "x.png")[2]
    camera = {"name": "x", "focal_length_mm": FOCAL, "sensor_width_mm": WIDTH,
              "sensor_height_mm": HEIGHT, "image_width_px": WIDTH, "image_height_px": HEIGHT}  # fmt: skip
    (folder / "c.json").write_text(json.dumps(camera))
    given += ["--camera", "c.json", "--extent=-3,-3,3,3"]
    status, _, err = command("photos", *given, "--out", "x.png", "--json")
    assert status == 0
    assert "assumed to look straight down" in err
    plan = {
        "altitude_m": 30.0,
        "request": {"camera": "c.json", "heading": 40.0, "origin": list(ORIGIN)},
    }
    (folder / "photos" / "plan.json").write_text(json.dumps(plan))
    status, out, err = command("photos", "--out", "y.png", "--extent=-3,-3,3,3", "--json")
    assert status == 0
    assert "plan.json" in err
    document = json.loads(out)
    Draft202012Validator(json_schema("integral")).validate(document)
    assert document["origin"] == list(ORIGIN)
    assert document["altitude_m"] == pytest.approx(30.0)
    first, second = (np.asarray(Image.open(name)).astype(float) for name in ("x.png", "y.png"))
    # The origin of the plan is the centre of the photos.
    assert np.abs(first - second).mean() < 2.0


def test_the_geotiff_of_photos_has_the_correct_location(command, folder):
    fly(folder / "photos")
    assert command("photos", "--out", "x.tif", "--extent=-4,-4,4,4", "--gsd", "0.1")[0] == 0
    with rasterio.open("x.tif") as raster:
        from rasterio.warp import transform

        x, y = transform("EPSG:4326", raster.crs, [ORIGIN[1]], [ORIGIN[0]])
        row, column = raster.index(x[0], y[0])
        assert abs(row - 40) <= 1
        assert abs(column - 40) <= 1


def test_the_error_for_poses_without_images_names_them(command, folder):
    (folder / "poses.json").write_text("{}")
    assert "folder of the images is missing" in command("poses.json", "--out", "x.png")[2]
    assert "no folder 'none'" in command("none", "--out", "x.png")[2]
    (folder / "empty").mkdir()
    assert "no photo with a position" in command("empty", "--out", "x.png")[2]


# OpenDroneMap and COLMAP's binary files


def shots_of(poses, *, zone="EPSG:32633"):
    from pyproj import Transformer

    from aosplan.geodesy import to_wgs84

    to_map = Transformer.from_crs("EPSG:4326", zone, always_xy=True)
    features = []
    for index, (rotation, position) in enumerate(poses):
        (latitude,), (longitude,) = to_wgs84(ORIGIN, [position[0]], [position[1]])
        x, y = to_map.transform(longitude, latitude)
        turn = Rotation.from_matrix(rotation).as_rotvec()
        features.append({
            "type": "Feature",
            "properties": {"filename": f"{index:03d}.tif", "focal": FOCAL / WIDTH, "width": WIDTH,
                           "height": HEIGHT, "translation": [x, y, position[2]],
                           "rotation": turn.tolist()},
            "geometry": {"type": "Point", "coordinates": [longitude, latitude, position[2]]},
        })  # fmt: skip
    return {"type": "FeatureCollection", "features": features}


def test_shots_of_opendronemap_are_poses_on_the_map(folder):
    poses = list(sites(4))
    (folder / "shots.geojson").write_text(json.dumps(shots_of(poses)))
    found = read_shots("shots.geojson")
    assert found.georeference.crs == "EPSG:32633"
    for view, (rotation, position) in zip(found.views, poses, strict=True):
        assert view.rotation == pytest.approx(rotation, abs=1e-9)
        assert view.position[2] == pytest.approx(position[2])
        latitude, longitude = found.georeference.places(*view.position[:2])
        (north,), (east,) = flown.to_wgs84(ORIGIN, [position[0]], [position[1]])
        assert (float(latitude), float(longitude)) == pytest.approx((north, east), abs=1e-8)


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (lambda f: f["properties"].pop("filename"), "no filename"),
        (lambda f: f["properties"].update(rotation=[1, 2]), "rotation is not three numbers"),
        (lambda f: f["properties"].update(focal=0), "focal length 0 px"),
        (lambda f: f["properties"].update(width=1.5), "width"),
        (lambda f: f["geometry"].update(coordinates=[500, 0]), "not a latitude"),
        (lambda f: f.pop("geometry"), "no geometry"),
    ],
)
def test_wrong_shots_are_refused(command, folder, change, part):
    document = shots_of(list(sites(4)))
    change(document["features"][1])
    (folder / "shots.geojson").write_text(json.dumps(document))
    (folder / "images").mkdir()
    status, out, err = command("shots.geojson", "images", "--out", "x.png")
    assert (status, out) == (2, "")
    assert "feature 2" in err
    assert part in err


def write_binary(folder, views):
    """COLMAP's binary files of views, each with its own OPENCV camera."""
    cameras = struct.pack("<Q", 1) + struct.pack("<iiQQ8d", 1, 4, WIDTH, HEIGHT, FOCAL, FOCAL,
                                                 WIDTH / 2, HEIGHT / 2, 0.01, 0, 0, 0)  # fmt: skip
    (folder / "cameras.bin").write_bytes(cameras)
    content = struct.pack("<Q", len(views))
    for index, view in enumerate(views):
        x, y, z, w = Rotation.from_matrix(view.rotation).as_quat()
        content += struct.pack("<i7di", index, w, x, y, z, *view.translation, 1)
        content += view.name.encode() + b"\0"
        content += struct.pack("<Q", 2) + 2 * struct.pack("<ddq", 1.0, 2.0, -1)
    (folder / "images.bin").write_bytes(content)


def test_binary_models_are_the_text_ones(folder):
    poses = list(sites(4))
    lens = [f"1 OPENCV {WIDTH} {HEIGHT} {FOCAL} {FOCAL} {WIDTH / 2} {HEIGHT / 2} 0.01 0 0 0"]
    images = [photo(*pose) for pose in poses]
    path, _ = write_colmap(folder, poses, images, lens)
    text = read_colmap(path)
    write_binary(folder, text)
    for binary, view in zip(read_colmap(str(folder / "images.bin")), text, strict=True):
        assert binary.name == view.name
        assert binary.intrinsics == view.intrinsics
        assert binary.rotation == pytest.approx(view.rotation, abs=1e-12)
        assert binary.translation == pytest.approx(view.translation)


@pytest.mark.parametrize("cut", [4, 30, 90, 100, 140])
def test_cut_binary_models_are_refused(folder, cut):
    poses = list(sites(4))
    lens = [f"1 SIMPLE_PINHOLE {WIDTH} {HEIGHT} {FOCAL} {WIDTH / 2} {HEIGHT / 2}"]
    path, _ = write_colmap(folder, poses, [photo(*pose) for pose in poses], lens)
    write_binary(folder, read_colmap(path))
    content = (folder / "images.bin").read_bytes()
    (folder / "images.bin").write_bytes(content[:cut])
    with pytest.raises(RequestError, match="ends in the middle"):
        read_colmap(str(folder / "images.bin"))


# Folders as they come from memory cards


def said(folder):
    return {message.code: message.message for message in read(folder).messages}


def test_photos_in_folders_inside_the_folder_are_used(command, folder):
    (folder / "photos").mkdir()
    fly(folder / "photos" / "100MEDIA", count=4)
    fly(folder / "photos" / "101MEDIA", count=4, seed=2)
    fly(folder / "photos" / ".Trashes", count=4, seed=3)
    names = [view.name for view in read(folder / "photos").views]
    assert names[0].replace("\\", "/") == "100MEDIA/DJI_0000.jpg"
    assert len(names) == 8
    status, _, err = command("photos", "--out", "a.png", "--quiet")
    assert (status, err) == (0, "")


def test_a_png_is_a_photo_if_it_has_a_position(folder):
    poses = fly(folder / "photos", count=4)
    for path in sorted((folder / "photos").iterdir()):
        with Image.open(path) as image:
            text = PngInfo()
            text.add_itxt("XML:com.adobe.xmp", image.info["xmp"].decode())
            image.save(path.with_suffix(".png"), exif=image.getexif(), pnginfo=text)
        path.unlink()
    Image.new("L", (3, 3)).save(folder / "photos" / "integral.png")
    found = read(folder / "photos")
    assert [view.name for view in found.views] == [f"DJI_{k:04d}.png" for k in range(4)]
    assert found.messages == ()
    assert [view.position[2] for view in found.views] == pytest.approx([p[2] for p, _ in poses])


def test_copies_of_a_photo_are_used_once(command, folder):
    fly(folder / "photos", count=4)
    content = (folder / "photos" / "DJI_0001.jpg").read_bytes()
    (folder / "photos" / "DJI_0001 (1).jpg").write_bytes(content)
    # This is another photo from the same place, with a file of the same size.
    (folder / "photos" / "DJI_0009.jpg").write_bytes(content[:-3] + b"\0" + content[-2:])
    assert len(read(folder / "photos").views) == 5
    assert said(folder / "photos")["copies"] == (
        "1 photo with the same content as another photo is left out: DJI_0001 (1).jpg"
    )


@pytest.mark.parametrize(
    ("east_m", "up_m", "code"),
    [(3000.0, 30.0, "far_photos"), (90_000.0, 30.0, "far_photos"), (0.0, 0.0, "low_photos"),
     (0.0, -0.4, "low_photos"), (0.0, 12.0, "low_photos"), (0.0, 20.0, None), (200.0, 30.0, None)],
)  # fmt: skip
def test_a_wrong_position_or_a_photo_of_the_take_off_is_left_out(folder, east_m, up_m, code):
    fly(folder / "photos", count=9)
    write_photo(folder / "photos" / "DJI_0100.jpg", (east_m, 0.0, up_m), (0.0, -90.0, 0.0))
    found = said(folder / "photos")
    assert set(found) == ({code} if code else set())
    assert code is None or found[code].endswith("left out: DJI_0100.jpg")
    assert len(read(folder / "photos").views) == (10 if code is None else 9)


def test_many_low_photos_are_not_a_climb(folder):
    fly(folder / "photos", count=9)
    for index in range(4):
        place = (2.0 * index, 0.0, 10.0)
        write_photo(folder / "photos" / f"DJI_010{index}.jpg", place, (0.0, -90.0, 0.0))
    assert len(read(folder / "photos").views) == 13


@pytest.mark.parametrize(
    ("before_m", "after_m", "left"),
    [
        ([1.0, 4.0, 9.0], [], 9),
        ([2.0, 8.0], [13.0, 6.0], 9),
        ([], [12.0, 5.0, 1.0], 9),
        ([9.0, 4.0, 1.0], [], 12),
        ([], [2.0, 8.0, 12.0], 12),
    ],
)
def test_a_long_climb_and_descent_are_left_out(folder, before_m, after_m, left):
    fly(folder / "photos", count=9)
    for prefix, heights in (("A", before_m), ("Z", after_m)):
        for index, up_m in enumerate(heights):
            path = folder / "photos" / f"{prefix}_{index}.jpg"
            write_photo(path, (0.0, 0.0, up_m), (0.0, -90.0, 0.0))
    assert len(read(folder / "photos").views) == left


def test_photos_of_another_size_are_named(folder):
    fly(folder / "photos", count=4)
    assert "sizes" not in said(folder / "photos")
    small = Image.new("L", (WIDTH // 2, HEIGHT // 2))
    write_photo(folder / "photos" / "small.jpg", (1.0, 1.0, 30.0), (0.0, -90.0, 0.0), image=small)
    assert said(folder / "photos")["sizes"].startswith(
        f"1 of 5 photos do not have the usual size of {WIDTH} x {HEIGHT} pixels: small.jpg;"
    )


@pytest.mark.parametrize("nodata", ["-9999", "nan"])
def test_missing_values_of_radiometric_tiffs_do_not_count(folder, nodata):
    fly(folder / "photos", count=4)
    for index in range(4):
        values = np.full((HEIGHT, WIDTH), 293.0, np.float32)
        values[:40] = float(nodata)
        path = folder / "photos" / f"DJI_{index:04d}.tif"
        tifffile.imwrite(path, values, extratags=[(42113, "s", 0, nodata, True)])
    recording = Recording(str(folder / "photos"))
    assert recording.messages == ()  # The TIFFs contain the pixels of the photos.
    found = recording.integrate(ViewSubset(), recording.raster((-8, -8, 8, 8), 0.2))
    assert found.values[found.coverage > 0] == pytest.approx(293.0, abs=1e-3)
    assert 0 < found.coverage.min() + 1 < found.coverage.max()
