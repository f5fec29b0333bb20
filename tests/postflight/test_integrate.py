"""`aosplan integrate`: selections of views, SSIM, files, and refusals."""

import json
import os
import sys
from functools import partial

import numpy as np
import pytest
import rasterio
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from PIL import Image
from support.recorded import (
    FOV_DEG,
    HEIGHT,
    WIDTH,
    nadir_to,
    photo,
    sites,
    write_colmap,
    write_recording,
)

from aosplan.cli.schema import json_schema
from aosplan.postflight.integral.view_subset import ViewSubset, chosen, read_view_subset

pytestmark = pytest.mark.usefixtures("folder")

# Selections of views


def grid(side, pitch):
    x = (np.arange(side) - 0.5 * (side - 1)) * pitch
    return np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)


def names(count):
    return [f"{index:03d}.png" for index in range(count)]


@given(
    st.lists(st.tuples(*[st.floats(-50, 50)] * 2), min_size=1, max_size=60), st.floats(0.1, 40.0)
)
def test_a_pitch_keeps_as_many_views_as_possible_at_this_distance(points, pitch):
    positions = np.array(points)
    kept = chosen(ViewSubset(pitch_m=pitch), names(len(points)), positions)
    distances = np.hypot(*(positions[:, None] - positions[kept][None]).T)
    among = distances[:, kept][~np.eye(len(kept), dtype=bool)]
    assert (among >= pitch * (1 - 1e-8)).all()  # All chosen views are far enough apart,
    assert (distances.min(axis=0) <= pitch).all()  # and no other view could be added.


@pytest.mark.parametrize(("pitch", "count"), [(2.0, 81), (2.8, 41), (4.0, 25), (100.0, 1)])
def test_grids_are_thinned_to_grids(pitch, count):
    assert len(chosen(ViewSubset(pitch_m=pitch), names(81), grid(9, 2.0))) == count


@pytest.mark.parametrize(("aperture", "count"), [(0, 1), (3.9, 1), (4.0, 9), (16.0, 81), (99, 81)])
def test_an_aperture_is_a_square_around_the_middle(aperture, count):
    assert len(chosen(ViewSubset(aperture_m=aperture), names(81), grid(9, 2.0) + 1e6)) == count


def test_views_by_number_range_and_name(tmp_path):
    (tmp_path / "few.txt").write_text("# first\n1\n\n003.png\n")
    for text, expected in [
        ("1,5-7", [0, 4, 5, 6]),
        (" 2 , 2, 001.png", [1]),
        ("008.png", [8]),
        (str(tmp_path / "few.txt"), [0, 3]),
    ]:
        assert chosen(ViewSubset(views=text), names(9), grid(3, 1.0)).tolist() == expected


def test_parts_of_a_choice_narrow_it_down():
    choice = read_view_subset("views=1-40 pitch=4 aperture=12", "--compare")
    kept = chosen(choice, names(81), grid(9, 2.0))
    assert choice == ViewSubset(4.0, 12.0, "1-40")
    assert set(kept) <= set(chosen(ViewSubset(None, 12.0, "1-40"), names(81), grid(9, 2.0)))
    assert set(kept) < set(range(40))


# The command


@pytest.fixture
def command(command):
    """A function that runs the command and returns its status, stdout and stderr."""
    return partial(command, "integrate")


@pytest.fixture
def recorded(folder):
    """Nine views 2 m apart with 8-bit images, and the arguments that integrate them."""
    views = list(sites())
    images = [np.rint(photo(*view)).astype(np.uint8) for view in views]
    return write_recording(folder, views, images)


def refused(command, *arguments, status=2):
    found, out, err = command(*arguments)
    assert (found, out) == (status, "")
    assert err.startswith("error: ")
    assert err.count("\n") <= 2
    return err


def test_the_document_matches_its_schema(command, recorded):
    status, out, _ = command(*recorded, "--out", "i.png", "--compare", "pitch=2.5", "--json")
    assert status == 0
    document = json.loads(out)
    Draft202012Validator(json_schema("integral")).validate(document)
    assert (document["views"], document["recorded_views"]) == (9, 9)
    assert document["aperture_m"] == pytest.approx([4.0, 4.0])
    assert document["nearest_m"] == pytest.approx(2.0)
    assert document["altitude_m"] == pytest.approx(30.0, abs=1.0)
    assert document["comparison"]["views"] == 5
    assert 0.99 < document["comparison"]["ssim"] < 1.0


def test_a_choice_of_views_has_similarity_1_with_itself(command, recorded):
    _, out, _ = command(*recorded, "--pitch", "3", "--compare", "pitch=3", "--json")
    assert json.loads(out)["comparison"]["ssim"] == pytest.approx(1.0)


def test_all_output_formats_contain_the_same_image(command, recorded, folder):
    assert command(*recorded, "--out", "i.png", "--out", "i.tif", "--out", "i.npz")[0] == 0
    png = np.asarray(Image.open("i.png"))
    tif = np.asarray(Image.open("i.tif"))
    with np.load("i.npz") as saved:
        values, coverage = saved["values"][..., 0], saved["coverage"]
        assert saved["extent_m"][2] - saved["extent_m"][0] == pytest.approx(
            saved["gsd_m"] * values.shape[1]
        )
    seen = coverage >= 1
    assert (png[..., 1] == np.where(seen, 255, 0)).all()
    assert (png[..., 0][seen] == np.rint(values[seen])).all()
    assert (np.isnan(tif) == ~seen).all()
    assert tif[seen] == pytest.approx(values[seen])


def test_pixels_of_few_views_are_transparent(command, recorded):
    shares = []
    for least in ("1", "5", "100%"):
        command(*recorded, "--extent", "all", "--min-views", least, "--out", f"{least}.png")
        shares.append((np.asarray(Image.open(f"{least}.png"))[..., 1] > 0).mean())
    assert shares[0] > shares[1] > shares[2] > 0


def test_the_same_command_writes_the_same_bytes(command, recorded, folder):
    for name in ("a", "b"):
        command(*recorded, "--out", f"{name}.png", "--out", f"{name}.npz")
    assert (folder / "a.png").read_bytes() == (folder / "b.png").read_bytes()


def test_colours_stay_colours(command, folder):
    view = nadir_to(0.0), np.array([0.0, 0.0, 30.0])
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    image[:] = 10, 120, 230
    paths = write_recording(folder, [view], [image])
    assert command(*paths, "--out", "i.png")[0] == 0
    assert np.asarray(Image.open("i.png"))[60, 60].tolist() == [10, 120, 230, 255]
    assert command(*paths, "--out", "i.tif")[0] == 0
    with rasterio.open("i.tif") as raster:
        assert raster.read()[:, 60, 60].tolist() == [10, 120, 230]
        assert raster.crs is None


def test_16_bit_values_are_stretched_in_png_and_kept_in_tiff(command, folder):
    views = list(sites(4))
    images = [(photo(*view) * 20 + 7000).astype(np.uint16) for view in views]
    paths = write_recording(folder, views, images)
    _, out, _ = command(*paths, "--out", "i.png", "--out", "i.tif", "--json")
    low, high = json.loads(out)["limits"]
    tif, png = np.asarray(Image.open("i.tif")), np.asarray(Image.open("i.png"))
    assert 7000 < low < high < 7000 + 20 * 256
    assert np.nanmin(tif) > 7000
    assert (png[..., 0][tif >= high] == 255).all()
    assert (png[..., 0][tif <= low] == 0).all()


def test_a_camera_given_on_the_command_line_equals_the_one_in_the_poses(command, recorded, folder):
    command(*recorded, "--out", "own.png")
    document = json.loads((folder / "poses.json").read_text())
    del document["camera"]
    (folder / "poses.json").write_text(json.dumps(document))
    assert "no camera" in refused(command, *recorded, "--out", "i.png")
    assert command(*recorded, "--fov", FOV_DEG, "--out", "fov.png")[0] == 0
    camera = {"name": "x", "focal_length_mm": 1.5, "sensor_width_mm": 1.6,
              "sensor_height_mm": 1.2, "image_width_px": 320, "image_height_px": 240}  # fmt: skip
    (folder / "c.json").write_text(json.dumps(camera))
    assert command(*recorded, "--camera", "c.json", "--out", "cam.png")[0] == 0
    own, fov, cam = (np.asarray(Image.open(f"{n}.png")).astype(int) for n in ("own", "fov", "cam"))
    assert abs(own - fov).max() <= 1
    assert abs(own - cam).max() <= 1
    assert "crop" in refused(command, *recorded, "--camera", "dji-m3t-thermal", "--out", "x.png")


def test_images_are_found_under_another_ending(command, recorded, folder):
    for path in (folder / "images").iterdir():
        Image.open(path).save(path.with_suffix(".PNG"))
        path.unlink()
    assert command(*recorded, "--out", "i.png")[0] == 0
    Image.new("L", (WIDTH, HEIGHT)).save(folder / "images" / "004.bmp")
    assert "004.PNG" in refused(command, *recorded, "--out", "j.png")


def test_the_summary_names_views_extent_ssim_and_file(command, recorded):
    status, out, err = command(*recorded, "--out", "i.png", "--compare", "all")
    assert (status, err) == (0, "")
    for part in ("9 of 9", "4 x 4 m", "SSIM", "1.0000", "i.png"):
        assert part in out
    assert command(*recorded, "--out", "i.png", "--quiet", "--force") == (0, "", "")


def test_views_during_takeoff_give_a_warning(command, folder):
    views = [(nadir_to(0.0), np.array([0.0, 0.0, z])) for z in (2.0, 30.0, 31.0)]
    paths = write_recording(folder, views, [photo(*view) for view in views])
    _, _, err = command(*paths, "--out", "i.png", "--gsd", "0.1")
    assert "take-off" in err


# Refusals


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ([], "no output is requested"),
        (["--out", "i.jpg"], "i.jpg"),
        (["--out", "no/i.png"], "no"),
        (["--out", "i.png", "--focal-height", "40"], "below the focal plane"),
        (["--out", "i.png", "--focal-height", "nan"], "--focal-height"),
        (["--out", "i.png", "--focal-height=-1e300"], "more than 1e+09 m from the origin"),
        (["--out", "i.png", "--extent=-1e300,-1e300,1e300,1e300"], "more than 1e+09 m from the origin"),
        (["--out", "i.png", "--out", "./i.png"], "given twice"),
        (["--out", "i.png", "--focal-height", "9kg"], "--focal-height"),
        (["--out", "i.png", "--up", "x"], "--up 'x'"),
        (["--out", "i.png", "--up=-z"], "below the focal plane"),
        (["--out", "i.png", "--gsd", "0"], "--gsd"),
        (["--out", "i.png", "--gsd", "1e-9"], "too many"),
        (["--out", "i.png", "--gsd", "1e-300"], "too many"),
        (["--out", "i.png", "--extent", "1,2,3"], "--extent '1,2,3'"),
        (["--out", "i.png", "--extent", "middle"], "--extent 'middle'"),
        (["--out", "i.png", "--extent", "3,0,1,2"], "empty"),
        (["--out", "i.png", "--extent=900,900,910,910"], "none of the 9 photos"),
        (["--out", "i.png", "--pitch", "0"], "pitch"),
        (["--out", "i.png", "--pitch", "-1"], "pitch"),
        (["--out", "i.png", "--aperture", "x"], "aperture"),
        (["--out", "i.png", "--aperture", "1", "--views", "1"], "no photo is in a square of 1 m"),
        (["--out", "i.png", "--views", "0"], "'0' is not within 1 to 9"),
        (["--out", "i.png", "--views", "5-3"], "5-3"),
        (["--out", "i.png", "--views", "10"], "10"),
        (["--out", "i.png", "--views", "1e3"], "1e3"),
        (["--out", "i.png", "--views", ","], "names no photos"),
        (["--out", "i.png", "--views", "99999999999999999999999"], "not within"),
        (["--out", "i.png", "--views", "0000.tif"], "000.tif"),
        (["--out", "i.png", "--min-views", "10"], "more than the 9"),
        (["--out", "i.png", "--min-views", "0"], "--min-views"),
        (["--out", "i.png", "--min-views", "101%"], "--min-views"),
        (["--compare", "pitsch=3"], "pitch"),
        (["--compare", "pitch=3 pitch=4"], "pitch=4"),
        (["--compare", "all pitch=3"], "all"),
        (["--compare", " "], "names no photos"),
        (["--compare", "views=77"], "77"),
        (["--compare", "all", "--gsd", "3"], "11 x 11"),
        (["--out", "i.png", "--fov", "60"], "another one"),
        (["--out", "i.png", "--fov", "60", "--camera", "x"], "both"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)  # fmt: skip
def test_wrong_requests_are_refused(command, recorded, folder, arguments, part):
    before = sorted(os.listdir(folder))
    assert part in refused(command, *recorded, *arguments)
    assert sorted(os.listdir(folder)) == before


def test_existing_files_are_not_overwritten(command, recorded, folder):
    (folder / "i.png").write_text("mine")
    assert "exists" in refused(command, *recorded, "--out", "i.png")
    assert (folder / "i.png").read_text() == "mine"


def edit(folder, change):
    document = json.loads((folder / "poses.json").read_text())
    change(document)
    (folder / "poses.json").write_text(json.dumps(document))


CHANGES = {
    "no list 'images'": lambda d: d.pop("images"),
    "no images": lambda d: d["images"].clear(),
    "image 2": lambda d: d["images"].__setitem__(1, 3),
    "no name": lambda d: d["images"][1].pop("imagefile"),
    "no 'M3x4'": lambda d: d["images"][1].pop("M3x4"),
    "3 rows of 4": lambda d: d["images"][1]["M3x4"].pop(),
    "not a finite number": lambda d: d["images"][1]["M3x4"][0].__setitem__(0, "north"),
    "not a rotation": lambda d: d["images"][1]["M3x4"][0].__setitem__(0, 7.0),
    "rotation": lambda d: d["images"][1].update(
        M3x4=[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 30]]  # mirrored
    ),
    "from the origin": lambda d: d["images"][1]["M3x4"][0].__setitem__(3, 1e12),
    "given twice": lambda d: d["images"].append(d["images"][0]),
    "focal length": lambda d: d["camera"].update(fx=0),
    "exactly the names": lambda d: d["camera"].pop("cx"),
    "width": lambda d: d["camera"].update(width=1.5),
    "its camera has 100 x 120": lambda d: d["camera"].update(width=100),
    "image '../000.tif' is outside the folder": lambda d: d["images"][0].update(
        imagefile="../000.tif"
    ),
    "zero": lambda d: d["images"][0].update(imagefile="\0"),
}


@pytest.mark.parametrize("part", CHANGES)
def test_wrong_poses_are_refused(command, recorded, folder, part):
    edit(folder, CHANGES[part])
    part = "no name" if part == "zero" else part
    assert part in refused(command, *recorded, "--out", "i.png")


BEYOND_A_SCHEMA = {"not a rotation", "rotation", "not a finite number", "from the origin", "given twice",
                   "its camera has 100 x 120", "image '../000.tif' is outside the folder", "zero"}  # fmt: skip


@pytest.mark.parametrize("part", CHANGES)
def test_the_schema_of_poses_refuses_what_has_the_wrong_shape(recorded, folder, part):
    validator = Draft202012Validator(json_schema("poses"))
    assert validator.is_valid(json.loads((folder / "poses.json").read_text()))
    edit(folder, CHANGES[part])
    document = json.loads((folder / "poses.json").read_text())
    assert validator.is_valid(document) == (part in BEYOND_A_SCHEMA)


def damaged(path, how):
    content = path.read_bytes()
    if how == "short":
        path.write_bytes(content[: len(content) // 2])
    elif how == "text":
        path.write_text("no image")
    elif how == "empty":
        path.write_bytes(b"")
    elif how == "size":
        Image.new("L", (WIDTH + 1, HEIGHT)).save(path)
    elif how == "colour":
        Image.new("RGB", (WIDTH, HEIGHT)).save(path)


@pytest.mark.parametrize("how", ["short", "text", "empty"])
def test_a_damaged_image_is_left_out_and_named(command, recorded, folder, how):
    damaged(folder / "images" / "004.tif", how)
    status, out, err = command(*recorded, "--out", "i.png", "--json")
    assert status == 0
    assert "1 of 9 photos is damaged and left out: 004.tif" in " ".join(err.split())
    assert json.loads(out)["views"] == 8
    assert "damaged_photos" in [each["code"] for each in json.loads(out)["warnings"]]


def test_images_that_are_all_damaged_are_refused(command, recorded, folder):
    for path in (folder / "images").iterdir():
        damaged(path, "short")
    assert "000.tif' is damaged" in refused(command, *recorded, "--out", "i.png")


@pytest.mark.parametrize("how", ["size", "colour"])
def test_an_image_that_is_not_like_the_others_is_named(command, recorded, folder, how):
    damaged(folder / "images" / "004.tif", how)
    assert "004.tif" in refused(command, *recorded, "--out", "i.png")
    assert not (folder / "i.png").exists()


def test_the_horizon_needs_an_extent(command, folder):
    view = nadir_to(0.0, 75.0), np.array([0.0, 0.0, 10.0])
    paths = write_recording(folder, [view], [photo(*view)])
    assert "shows the horizon" in refused(command, *paths, "--out", "i.png")
    given_all = ["--extent=-60,-60,60,60", "--gsd", "0.5", "--out", "i.png"]
    assert command(*paths, *given_all)[0] == 0


def test_cameras_that_look_along_the_ground_need_an_up(command, folder):
    view = nadir_to(0.0, 90.0), np.array([0.0, 0.0, 10.0])
    paths = write_recording(folder, [view], [photo(*view)])
    assert "--up" in refused(command, *paths, "--out", "i.png")


@pytest.mark.parametrize(
    ("camera", "part"),
    [
        (f"1 OPENCV_FISHEYE {WIDTH} {HEIGHT} 1 1 1 1 0 0 0 0", "image_undistorter"),
        (f"1 PINHOLE {WIDTH} {HEIGHT} 150 150 80", "4 parameters"),
        (f"1 PINHOLE {WIDTH} {HEIGHT} 150 x 80 60", "fy"),
        (f"1 PINHOLE {WIDTH}", "not CAMERA_ID"),
        (f"2 PINHOLE {WIDTH} {HEIGHT} 150 150 80 60", "camera '1'"),
        (f"1 SIMPLE_RADIAL {WIDTH} {HEIGHT} 150 80 60 -1.5", "maps two points to the same pixel"),
    ],
)
def test_cameras_of_colmap_that_do_not_fit_are_named(command, folder, camera, part):
    views = list(sites(1))
    paths = write_colmap(folder, views, [photo(*views[0])], [camera])
    assert part in refused(command, *paths, "--out", "i.png")


@pytest.mark.parametrize(
    ("line", "part"),
    [
        ("1 1 0 0 0 0 0 30 1", "IMAGE_ID"),
        ("1 9 0 0 0 0 0 30 1 a.tif", "length 9"),
        ("1 0 1 0 0 0 x 30 1 a.tif", "line 1"),
        ("1 0 1 0 0 0 1e300 30 1 a.tif", "larger"),
        ("1 0 1 0 0 0 0 30 1 missing.tif", "missing.tif"),
    ],
)
def test_images_of_colmap_that_do_not_fit_are_named(command, folder, line, part):
    views = list(sites(1))
    paths = write_colmap(
        folder, views, [photo(*views[0])], [f"1 PINHOLE {WIDTH} {HEIGHT} 150 150 80 60"]
    )
    (folder / "images.txt").write_text(line + "\n\n")
    assert part in refused(command, *paths, "--out", "i.png")


def test_files_that_are_not_recordings_are_refused(command, folder, recorded):
    (folder / "empty").mkdir()
    (folder / "binary").mkdir()
    (folder / "binary" / "images.bin").write_bytes(b"\0")
    poses, images = recorded
    assert "no file 'binary/cameras.bin'" in refused(command, "binary", images, "--out", "i.png")
    assert "no photo" in refused(command, "empty", images, "--out", "i.png")
    assert "no file 'x.json'" in refused(command, "x.json", images, "--out", "i.png")
    assert "no folder 'x'" in refused(command, poses, "x", "--out", "i.png")
    assert "is not a folder" in refused(command, poses, poses, "--out", "i.png")


@pytest.mark.parametrize("module", ["PIL", "skimage.metrics"])
def test_a_missing_extra_is_named(command, recorded, monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    err = refused(command, *recorded, "--compare", "all")
    assert "optional extra 'pictures'" in err
    assert 'pip install "aosplan[pictures]"' in err


def test_an_image_too_large_to_be_safe_is_refused(command, recorded, monkeypatch):
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", WIDTH * HEIGHT - 1)
    assert "has more than 19199 pixels" in refused(command, *recorded, "--out", "i.png")


def test_text_that_is_not_utf8_names_its_place(command, recorded, folder):
    images = recorded[1]
    (folder / "few.txt").write_bytes(b"1\n\xff\n")
    (folder / "cameras.txt").write_bytes(b"\xff")
    assert "byte 2" in refused(command, *recorded, "--out", "i.png", "--views", "few.txt")
    assert "byte 0" in refused(command, ".", images, "--out", "i.png")
