"""The same image in many formats (bits, signs, bands, planes), and poses that do not match their
images.
"""

import json

import numpy as np
import pytest

from aosplan.errors import RequestError
from aosplan.postflight.integral.colmap import read_colmap
from aosplan.postflight.integral.images import damage_of, read_picture

tifffile = pytest.importorskip("tifffile")
Image = pytest.importorskip("PIL.Image")

VALUES = (np.arange(5 * 7 * 3).reshape(5, 7, 3) * 601 + 30_000 % 65_536).astype(np.uint16)


def bands(path):
    picture = read_picture(str(path))
    return picture.pixels, picture


@pytest.mark.parametrize("planar", ["contig", "separate"])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("compression", [None, "zlib"])
def test_16_bits_a_colour_keep_their_bits(tmp_path, planar, order, compression):
    values = VALUES if planar == "contig" else np.moveaxis(VALUES, 2, 0)
    tifffile.imwrite(
        tmp_path / "a.tif",
        values,
        photometric="rgb",
        planarconfig=planar,
        byteorder=order,
        compression=compression,
    )
    found, picture = bands(tmp_path / "a.tif")
    assert np.array_equal(found, VALUES)
    assert not picture.is_byte


def test_a_tiff_of_16_bits_with_colour_and_alpha_is_read(tmp_path):
    alpha = np.full((5, 7, 1), 65535, np.uint16)
    alpha[0, 0] = 0
    values = np.concatenate([VALUES, alpha], axis=2)
    tifffile.imwrite(tmp_path / "a.tif", values, photometric="rgb", extrasamples=["unassalpha"])
    found, picture = bands(tmp_path / "a.tif")
    assert np.array_equal(found, VALUES)
    assert np.array_equal(np.asarray(picture.weight), (alpha[..., 0] > 0).astype(float))


@pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
def test_16_bits_of_a_png_keep_their_bits_or_are_refused(tmp_path, monkeypatch):
    rasterio = pytest.importorskip("rasterio")
    path = tmp_path / "a.png"
    with rasterio.open(path, "w", driver="PNG", width=7, height=5, count=3, dtype="uint16") as file:
        file.write(np.moveaxis(VALUES, 2, 0))
    assert np.array_equal(bands(path)[0], VALUES)
    monkeypatch.setitem(__import__("sys").modules, "rasterio", None)
    with pytest.raises(RequestError, match="16 bits per colour"):
        read_picture(str(path))


@pytest.mark.parametrize("kind", [np.uint32, np.int32, np.uint16, np.float32])
def test_grey_values_do_not_overflow(tmp_path, kind):
    values = np.full((5, 7), 3e9 if kind is np.uint32 else 30_000, kind)
    tifffile.imwrite(tmp_path / "a.tif", values)
    assert np.array_equal(bands(tmp_path / "a.tif")[0][..., 0], values.astype(np.float32))


def test_negative_values_stay_negative(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", np.full((5, 7), -40, np.int32))
    assert bands(tmp_path / "a.tif")[0].max() == -40


@pytest.mark.parametrize("between", ["\n\n", "\n", "\n1.5 2.5 -1 3.5 4.5 17\n"])
@pytest.mark.parametrize("long", [False, True])
def test_colmap_images_with_and_without_lines_of_points(tmp_path, between, long):
    if long:
        between = between.replace(" 17", " 17" + " 1.5 2.5 1" * 9)
    (tmp_path / "cameras.txt").write_text("1 SIMPLE_PINHOLE 64 48 60 32 24\n")
    rows = [f"{index} 0 1 0 0 {-index} 0 20 1 im{index}.png" for index in range(1, 5)]
    (tmp_path / "images.txt").write_text("# comment\n" + between.join(rows) + "\n")
    assert [view.name for view in read_colmap(str(tmp_path))] == [f"im{k}.png" for k in range(1, 5)]


# Poses and images that do not match


def recording(folder, names, *, held):
    poses = [
        {"imagefile": name, "M3x4": [[1, 0, 0, -k], [0, -1, 0, 0], [0, 0, -1, 20]]}
        for k, name in enumerate(names)
    ]
    (folder / "poses.json").write_text(json.dumps({"images": poses}))
    (folder / "images").mkdir()
    for name in held:
        Image.new("L", (64, 48), 100).save(folder / "images" / name)
    return ["integrate", "poses.json", "images", "--fov", "60", "--out", "o.npz"]


@pytest.mark.usefixtures("folder")
def test_poses_without_images_are_left_out_and_named(command, folder):
    arguments = recording(folder, ["a.png", "b.png", "gone.png"], held=["a.png", "b.png"])
    status, out, err = command(*arguments)
    assert status == 0
    assert "1 of 3 poses have no image in the folder, so they are left out: gone.png" in err
    assert "2 of 2" in out


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("name", ["../b.png", "/etc/b.png", "x/../../b.png", "..\\b.png"])
def test_names_that_lead_out_of_the_folder_are_refused(command, folder, name):
    Image.new("L", (64, 48), 100).save(folder / "b.png")
    status, _, err = command(*recording(folder, ["a.png", name], held=["a.png"]))
    assert status == 2
    assert "is outside the folder" in err


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("rows", [7, 50])
def test_a_tiff_without_compression_has_its_stored_values(tmp_path, kind, rows):
    # With 7 rows in each strip, the last strip is shorter.
    wanted = np.random.default_rng(3).integers(0, np.iinfo(kind).max, (50, 30)).astype(kind)
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, wanted, rowsperstrip=rows, photometric="minisblack")
    found = read_picture(str(path))
    assert found.pixels.dtype == kind
    assert found.is_byte == (kind == np.uint8)
    np.testing.assert_array_equal(found.pixels[..., 0], wanted)
    assert damage_of(str(path)) is None
    path.write_bytes(path.read_bytes()[:-20])
    assert "damaged" in str(damage_of(str(path)))


@pytest.mark.parametrize("after", [b"", b"\0" * 100, b"data of the drone"])
@pytest.mark.parametrize("ending", ["jpg", "png"])
def test_only_incomplete_photos_are_damaged(tmp_path, after, ending):
    path = tmp_path / f"a.{ending}"
    pixels = np.random.default_rng(4).integers(0, 255, (64, 64)).astype(np.uint8)
    Image.fromarray(pixels).save(path)
    content = path.read_bytes()
    path.write_bytes(content + after)
    assert damage_of(str(path)) is None
    path.write_bytes(content[: len(content) // 2])
    assert "damaged" in str(damage_of(str(path)))
