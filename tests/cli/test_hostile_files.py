"""Small files that need too much time or memory, or that have unexpected content, give one error
line.

The comment at each test gives the effect that the file once had: minutes, gigabytes, or an
exception.
"""

import io
import json
import math
import os
import struct
import zipfile

import numpy as np
import pytest
from support.command_line import check_refusal

PLAN = ["plan", "--altitude", "40"]
AREA = [*PLAN, "--area"]
CAMERA = {
    "name": "core",
    "focal_length_mm": 13.0,
    "sensor_width_mm": 7.68,
    "sensor_height_mm": 6.144,
    "image_width_px": 640,
    "image_height_px": 512,
}
STAND = {
    "name": "stand",
    "occluder_size_m": 0.3,
    "volume_height_m": 10,
    "volume_base_m": 2,
    "density": 0.02,
}


@pytest.fixture
def refused(folder, command):
    """A function that writes a file, runs a command that must refuse it, and returns the message."""

    def run(name, content, *arguments):
        if not isinstance(content, (str, bytes)):
            content = json.dumps(content)
        (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
        status, out, err = command(*arguments)
        check_refusal(status, out, err)
        assert "unexpected" not in err
        return err

    return run


def star(points):
    """An outline in which each edge crosses almost all other edges."""
    step = points // 2 - 1
    while math.gcd(points, step) > 1:
        step -= 1
    turns = [2 * math.pi * step * index / points for index in range(points + 1)]
    ring = [[14.3 + 0.001 * math.cos(turn), 48.3 + 0.001 * math.sin(turn)] for turn in turns]
    ring[-1] = ring[0]
    return ring


@pytest.mark.parametrize("points", [300, 6000])
def test_an_outline_with_very_many_self_crossings_is_refused(refused, points):  # > 60 s; 9 GB
    area = {"type": "Polygon", "coordinates": [star(points)]}
    assert "crosses itself near" in refused("star.geojson", area, *AREA, "star.geojson")


def grid_of_needles(count):
    """Two sets of polygons.  Each polygon of one set crosses all polygons of the other set."""
    span, width = 0.001, 0.001 / count / 4
    for index in range(count):
        at = span * index / count
        ring = [[at, 0.0], [at + width, 0.0], [at + width, span], [at, span], [at, 0.0]]
        for turned in (False, True):
            yield [[[14.3 + p[turned], 48.3 + p[not turned]] for p in ring]]


def test_polygons_with_very_many_crossings_are_refused(refused):  # gigabytes
    area = {"type": "MultiPolygon", "coordinates": list(grid_of_needles(600))}
    assert "cross each other too often" in refused(
        "needles.geojson", area, *AREA, "needles.geojson"
    )


def test_polygons_with_few_crossings_are_accepted(folder, command):
    area = {"type": "MultiPolygon", "coordinates": list(grid_of_needles(3))}
    (folder / "few.geojson").write_text(json.dumps(area), encoding="utf-8")
    status, _, err = command(*AREA, "few.geojson", "--samples", 4)
    assert "error" not in err or "cross" not in err, status


DOTS = {
    "quoted": '"a=b"' + ".c" * 25_000 + " = 1",  # 2.4 GB
    "plain": "a" + ".c" * 25_000 + " = 1",
    "blanks": "a" + " .\tc" * 25_000 + " = 1",
    "header": "[a" + ".c" * 25_000 + "]",
    "inline": "x = { a" + ".'c'" * 25_000 + " = 1 }",
}


@pytest.mark.parametrize("kind", DOTS)
def test_very_deep_dotted_keys_are_refused(refused, kind):
    assert "nested too deeply to be read" in refused("dots.toml", DOTS[kind], "plan", "dots.toml")


def test_a_toml_file_with_too_many_tables_is_refused(refused):  # 1 kB of memory for every 6 bytes
    text = "".join(f"[a{index}]\n" for index in range(200_001))
    assert "more than 200000 names" in refused("tables.toml", text, "plan", "tables.toml")


def test_text_with_dots_is_not_counted_as_a_dotted_key(folder, command):
    stand = f'title = "{"Some words. Others. " * 100}{"..." * 100}"\n' + "".join(
        f"{name} = {json.dumps(value)}\n" for name, value in STAND.items()
    )
    (folder / "stand.toml").write_text(stand, encoding="utf-8")
    assert command("scene", "stand.toml")[0] == 0


def test_a_name_repeated_very_often_is_refused(refused):  # > 60 s
    names = ", ".join(f'"{index}": 0' for index in [*range(100_000), 99_999])
    assert "'99999' is given twice" in refused("often.json", f"{{{names}}}", "scene", "often.json")


@pytest.mark.parametrize("name", ["\ud800", "a\udfff", "\ude00\ud83d"])
@pytest.mark.parametrize("where", ["value", "name"])
def test_an_unpaired_surrogate_is_refused(refused, name, where):  # UnicodeEncodeError
    stand = {**STAND, "name": name} if where == "value" else {**STAND, name: 1}
    message = refused("stand.json", stand, "scene", "stand.json", "--json")
    assert "is not Unicode text" in message


def test_a_surrogate_pair_is_accepted(folder, command):
    (folder / "stand.json").write_text(json.dumps({**STAND, "name": "🌲"}), encoding="ascii")
    status, out, _ = command("scene", "stand.json", "--json")
    assert status == 0
    assert json.loads(out)["name"] == "🌲"


@pytest.mark.parametrize("argument", ["\udcff.toml", "a\udc80b"])
def test_a_non_unicode_argument_is_refused(command, argument):
    status, out, err = command(*PLAN, "--scene", argument)
    check_refusal(status, out, err)
    assert "is not Unicode text" in err


@pytest.mark.parametrize("number", ["1e999", "-1e400", "1" + "0" * 400])
@pytest.mark.parametrize("suffix", ["json", "toml"])
def test_a_number_too_large_for_a_float_is_refused(refused, number, suffix):
    text = f'{{"name": "a", "x": [0, {number}]}}' if suffix == "json" else f"x = [0, {number}]"
    message = refused(f"a.{suffix}", text, "scene", f"a.{suffix}")
    assert "x.1 is too large a number" in message


@pytest.mark.parametrize("encoding", ["foo", "utf-7", "rot13", "utf-16"])
def test_an_unknown_xml_encoding_is_refused(refused, encoding):  # LookupError
    text = f'<?xml version="1.0" encoding="{encoding}"?><kml/>'
    refused("area.kml", text, *AREA, "area.kml")


@pytest.mark.parametrize("value", [1e308, 1e-300])
@pytest.mark.parametrize("name", ["focal_length_mm", "sensor_width_mm"])
def test_a_camera_with_overflowing_numbers_is_refused(refused, name, value):  # inf in JSON
    message = refused(
        "core.json", {**CAMERA, name: value}, *PLAN, "--camera", "core.json", "--json"
    )
    assert f"{name} {value:g} is not between" in message


def test_a_geometry_with_a_list_as_type_is_refused(refused):  # TypeError
    point = {"type": ["Point"], "coordinates": [14.0, 48.0]}
    points = {"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": point}]}
    arguments = ("--positions", "points.geojson", "--density", 0.5, "--spacing", 2)
    message = refused("points.geojson", points, "visibility", *arguments)
    assert "feature 1: geometry type '['Point']' is not a name" in message


def voxels(about, occupied=None, **members):
    """The bytes of a voxel file of a small stand, with some members replaced."""
    packed = np.full((10, 8, 1), 255, np.uint8) if occupied is None else occupied
    slices, rows, octets = packed.shape
    plain = {
        "version": 1, "voxel_m": 0.5, "x_min_m": 0.0, "y_min_m": 0.0, "min_height_m": 2.0,
        "points": 1000, "ground": "classified", "warnings": [], "source": "a", "assumed": "",
        "shape": [slices, rows, 8 * octets], "layers": [[2.0, 2.5, 0.1, 0.3]],
    }  # fmt: skip
    text = np.frombuffer(json.dumps({**plain, **about}).encode(), np.uint8)
    content = io.BytesIO()
    np.savez_compressed(content, about=text, occupied=packed)
    with zipfile.ZipFile(content, "a") as archive:
        for name, member in members.items():
            archive.writestr(name, member)
    return content.getvalue()


HUGE = [10**400, 10**20, -1, "many"]


@pytest.mark.parametrize("points", HUGE, ids=["overflow", "large", "negative", "text"])
def test_a_voxel_file_with_an_invalid_point_count_is_refused(refused, points):  # OverflowError
    refused("stand.npz", voxels({"points": points}), "scene", "stand.npz")


def test_a_voxel_file_with_bytes_instead_of_arrays_is_refused(refused):  # AttributeError
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("about", b"{}")
        archive.writestr("occupied", b"\0")
    assert "are not arrays" in refused("a.npz", content.getvalue(), "scene", "a.npz")


def test_a_voxel_file_with_extreme_compression_is_refused(refused):  # 4.1 GB
    content = voxels({}, np.zeros((1, 5000, 5000), np.uint8))
    assert len(content) < 100_000
    message = refused("bomb.npz", content, "scene", "bomb.npz")
    assert "are too few for a stand of" in message


def test_a_valid_voxel_file_is_read(folder, command):
    (folder / "stand.npz").write_bytes(voxels({}))
    assert command("scene", "stand.npz", "--quiet")[0] == 0


def test_a_parquet_file_declaring_more_rows_than_it_has_is_refused(
    folder, command
):  # 3.5 GB and > 60 s
    polars = pytest.importorskip("polars")
    polars.DataFrame({"altitude": np.full(2_100_000, 40.0)}).write_parquet("rows.parquet")
    status, out, err = command("sweep", "rows.parquet", "--summary")
    check_refusal(status, out, err)
    assert "declares 2100000 rows, more than its" in err


def test_a_panic_in_a_library_gives_one_error_line(command, monkeypatch):  # a traceback
    polars = pytest.importorskip("polars")

    class PanicException(BaseException):
        """The exception that a panic in Rust code raises in Python."""

    def panic(*_arguments, **_options):
        raise PanicException("assertion failed")

    polars.DataFrame({"altitude": [40.0]}).write_parquet("rows.parquet")
    monkeypatch.setattr(polars, "read_parquet", panic)
    status, out, err = command("sweep", "rows.parquet", "--out", "a.csv")
    check_refusal(status, out, err)
    assert "'rows.parquet' is not a table of scenarios" in err
    assert sorted(os.listdir()) == ["rows.parquet"]


def geotiff(path, values, crs, cell, **options):
    rasterio = pytest.importorskip("rasterio")
    profile = {
        "driver": "GTiff", "height": 20, "width": 20, "count": 1, "dtype": "float32", "crs": crs,
        "transform": rasterio.Affine(cell, 0.0, options.pop("left"), 0.0, -cell, options.pop("top")),
    }  # fmt: skip
    with rasterio.open(path, "w", **profile) as raster:
        raster.write(values.astype(np.float32), 1)
        raster.scales = [options.get("scale", 1.0)]
    return path


ECKERT = (
    'PROJCS["a",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],'
    'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Lambert_Conformal_Conic'
    '_2SP"],PARAMETER["standard_parallel_1",0],PARAMETER["standard_parallel_2",0],UNIT["metre",1]]'
)


def test_a_terrain_with_an_impossible_projection_is_refused(folder, command):  # ProjError
    geotiff("dem.tif", np.full((20, 20), 100.0), ECKERT, 10.0, left=0.0, top=0.0)
    arguments = ("--samples", 9, "--baseline", 8, "--origin", "48.3,14.3", "--terrain", "dem.tif")
    status, out, err = command(*PLAN, *arguments, "--out", "a.csv")
    assert status == 2
    assert out == ""
    assert "unexpected" not in err
    assert "error: 'dem.tif' is not a terrain" in err
    assert sorted(os.listdir()) == ["dem.tif"]


def test_overflowing_canopy_heights_are_refused(folder, command):  # a RuntimeWarning of numpy
    heights = np.full((20, 20), 3e38)
    geotiff("chm.tif", heights, "EPSG:32633", 1.0, left=5e5, top=5e6, scale=1e30)
    status, out, err = command("scene", "chm.tif")
    check_refusal(status, out, err)


def jpeg(width, height):
    """A JPEG that declares a size and has no further content."""
    frame = struct.pack(">BHBHHB", 0xC0, 11, 8, height, width, 1) + b"\1\x11\0"
    return b"\xff\xd8\xff" + frame + b"\xff\xd9"


@pytest.mark.parametrize("side", [12_000, 40_000])
def test_photos_declaring_very_many_pixels_are_handled(
    folder, command, side
):  # a warning; an error
    pytest.importorskip("PIL")
    (folder / "photos").mkdir()
    (folder / "photos" / "a.jpg").write_bytes(jpeg(side, side))
    status, out, _ = command(*PLAN, "--origin", "48.3,14.3", "--json")
    assert status == 0
    (folder / "plan.json").write_text(out, encoding="utf-8")
    status, out, err = command("review", "photos", "plan.json")
    check_refusal(status, out, err)
    assert "has no photo with a position" in err


LENSES = {"singular": (80.0, 1e15), "overflow": (1e308, 60.0)}


@pytest.mark.parametrize("kind", LENSES)
def test_a_lens_with_overflowing_numbers_is_refused(
    folder, command, kind
):  # LinAlgError; RuntimeWarning
    cx, cy = LENSES[kind]
    (folder / "images").mkdir()
    (folder / "model").mkdir()
    camera = f"1 OPENCV 160 120 150 150 {cx} {cy} 0.01 0.001 0 0\n"
    (folder / "model" / "cameras.txt").write_text(camera, encoding="utf-8")
    (folder / "model" / "images.txt").write_text("1 1 0 0 0 0 0 30 1 a.tif\n\n", encoding="utf-8")
    status, out, err = command("integrate", "model", "images", "--out", "a.png")
    check_refusal(status, out, err)
    assert "cameras.txt', line 1: c" in err


def test_an_overflowing_rotation_is_refused(folder, command):  # RuntimeWarning
    (folder / "images").mkdir()
    pose = {"imagefile": "a.tif", "M3x4": [[1e300, 0, 0, 0], [0, 1e300, 0, 0], [0, 0, 1, 0]]}
    (folder / "poses.json").write_text(json.dumps({"images": [pose]}), encoding="utf-8")
    status, out, err = command("integrate", "poses.json", "images", "--fov", 60, "--out", "a.png")
    check_refusal(status, out, err)
    assert "is not a rotation" in err


def test_the_largest_plan_that_is_written_is_read(command):
    from aosplan.grid.patterns import MOST_SITES
    from aosplan.planning import saved_plan

    grid = ("--origin", "48.3,14.3", "--baseline", 0.5)
    sizes = [len(command(*PLAN, *grid, "--samples", count, "--json")[1]) for count in (100, 1100)]
    assert (sizes[1] - sizes[0]) / 1000 * MOST_SITES < saved_plan.MOST_BYTES


@pytest.mark.slow
def test_export_reads_plans_larger_than_the_limit_of_other_documents(folder, command):
    from aosplan.files import MOST_BYTES

    _, text, _ = command(*PLAN, "--origin", "48.3,14.3", "--json")
    text = text.replace("\n", " " * (MOST_BYTES // text.count("\n") + 1) + "\n")
    assert len(text) > MOST_BYTES
    (folder / "plan.json").write_text(text, encoding="utf-8")
    assert command("export", "plan.json", "--out", "a.csv")[0] == 0


def test_an_image_declaring_more_pixels_than_it_has_is_refused(folder, command):  # 2.7 GB
    image = pytest.importorskip("PIL.Image")
    (folder / "images").mkdir()
    image.new("L", (6000, 5000)).save(folder / "images" / "a.png")
    pose = {"imagefile": "a.png", "M3x4": [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 30]]}
    (folder / "poses.json").write_text(json.dumps({"images": [pose]}), encoding="utf-8")
    status, out, err = command("integrate", "poses.json", "images", "--fov", 60, "--out", "a.png")
    check_refusal(status, out, err)
    assert "declares 6000 x 5000 pixels, more than its" in err
