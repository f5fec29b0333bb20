"""Canopy height rasters: tests of crowns cell by cell, and of the error for other files."""

import math
import sys

import numpy as np
import pytest

from aosplan.errors import MissingExtraError, RequestError
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.scenes.files.canopy_raster import read_canopy

rasterio = pytest.importorskip("rasterio")
from affine import Affine  # noqa: E402

UTM = "EPSG:32633"
PLACE = Affine(0.5, 0.0, 400_000.0, 0.0, -0.5, 5_000_020.0)


@pytest.fixture
def raster(tmp_path):
    """A function that writes heights as a raster.  The heights are one band of shape (rows,
    columns), whose first row is in the north, or several such bands.
    """

    def write(heights, *, transform=PLACE, crs=UTM, unit=None, name="canopy.tif", **given):
        bands = np.asarray(heights)
        bands = bands[np.newaxis] if bands.ndim == 2 else bands
        path = tmp_path / name
        with rasterio.open(
            path,
            "w",
            driver="GTiff",
            count=len(bands),
            height=bands.shape[1],
            width=bands.shape[2],
            dtype=bands.dtype,
            crs=crs,
            transform=transform,
            **given,
        ) as file:
            file.write(bands)
            if unit is not None:
                file.units = [unit] * len(bands)
        return str(path)

    return write


def trees(seed=0, rows=40, columns=60):
    rng = np.random.default_rng(seed)
    heights = rng.uniform(0.0, 24.0, (rows, columns)).astype(np.float32)
    heights[rng.random(heights.shape) < 0.4] = 0.0
    return heights


def by_hand(heights, voxel, base, cut):
    """Occupied voxels of a raster whose cells have the size of voxels, computed column by
    column.
    """
    found = set()
    for row, line in enumerate(heights[::-1]):
        for column, top in enumerate(line.tolist()):
            if top >= cut:
                low = math.floor(max(base * top, cut) / voxel + 1e-6)
                high = math.floor(top / voxel + 1e-6)
                found |= {(k, row, column) for k in range(low, high + 1)}
    return found


@pytest.mark.parametrize(("base", "cut"), [(0.5, 2.0), (0.0, 2.0), (1.0, 2.0), (0.3, 7.1)])
def test_crowns_reach_from_a_share_of_the_height_to_the_top(raster, base, cut):
    heights = trees()
    volume = read_canopy(raster(heights), crown_base=base, min_height_m=cut)
    assert {tuple(i) for i in np.argwhere(volume.occupied).tolist()} == by_hand(
        heights, 0.5, base, cut
    )
    assert (volume.voxel_m, volume.x_min_m, volume.y_min_m) == (0.5, 400_000.0, 5_000_000.0)
    assert (volume.ground, volume.warnings, volume.points) == ("raster", (), 0)
    assert volume.column_occupancy == pytest.approx((heights >= cut).mean())
    assert f"solid from {base:g}" in volume.assumed


def test_south_up_and_mirrored_rasters_are_the_same_stand(raster):
    heights = trees()
    north_up = read_canopy(raster(heights))
    south_up = Affine(0.5, 0.0, 400_000.0, 0.0, 0.5, 5_000_000.0)
    flipped = read_canopy(raster(heights[::-1], transform=south_up))
    assert np.array_equal(flipped.occupied, north_up.occupied)
    mirrored = Affine(-0.5, 0.0, 400_030.0, 0.0, -0.5, 5_000_020.0)
    assert np.array_equal(
        read_canopy(raster(heights[:, ::-1], transform=mirrored)).occupied, north_up.occupied
    )


@pytest.mark.parametrize("strip", [1, 70, 10_000])
def test_voxels_of_another_size_have_the_height_at_their_middle(raster, monkeypatch, strip):
    monkeypatch.setattr("aosplan.scenes.files.canopy_raster.PIXELS_AT_ONCE", strip)
    heights = trees()
    volume = read_canopy(raster(heights), voxel_m=0.2)
    assert volume.occupied.shape[1:] == (100, 150)
    row, column = ((np.arange(n) + 0.5) * 0.2 / 0.5 for n in (100, 150))
    picked = heights[::-1][row.astype(int)][:, column.astype(int)]
    assert np.array_equal(volume.occupied.any(axis=0), picked >= 2.0)


def test_oblong_cells_give_cubes(raster):
    place = Affine(1.0, 0.0, 0.0, 0.0, -0.5, 20.0)
    volume = read_canopy(raster(trees(), transform=place))
    assert volume.voxel_m == 0.5
    assert volume.occupied.shape[1:] == (40, 120)


@pytest.mark.parametrize("compress", ["deflate", "lzw", None])
@pytest.mark.parametrize("kind", ["float32", "float64", "uint8", "int16"])
def test_a_canopy_raster_is_read_with_any_compression_and_type_of_number(raster, compress, kind):
    whole = trees().round()
    given = {"compress": compress} if compress else {}
    volume = read_canopy(raster(whole.astype(kind), **given))
    assert np.array_equal(volume.occupied, read_canopy(raster(whole, name="b.tif")).occupied)


def test_scales_and_units_of_heights_count(raster, tmp_path):
    heights = trees()
    expected = read_canopy(raster(heights)).occupied
    path = raster((heights * 100).round().astype(np.int16), name="cm.tif")
    with rasterio.open(path, "r+") as file:
        file.scales = [0.01]
    share = (read_canopy(path).occupied ^ expected[: 24 * 2]).mean()
    assert share < 0.002  # because of rounding to centimetres
    in_feet = read_canopy(raster(heights.astype(float) / 0.3048, unit="ft", name="ft.tif"))
    assert np.array_equal(in_feet.occupied, expected)


def test_cells_in_feet_are_converted_with_a_warning(raster):
    foot = 1200 / 3937
    place = Affine(0.5 / foot, 0, 0, 0, -0.5 / foot, 20 / foot)
    volume = read_canopy(raster(trees(), transform=place, crs="EPSG:2231", unit="m"))
    assert [code for code, _ in volume.warnings] == ["units_converted"]
    assert volume.voxel_m == pytest.approx(0.5)
    assert volume.occupied.shape[1:] == (40, 60)


def test_cells_without_data_are_open_ground_with_a_warning(raster):
    heights = trees()
    heights[:, :30] = -9999.0
    heights[0, 40] = np.nan
    volume = read_canopy(raster(heights, nodata=-9999.0))
    known = heights[:, 30:]
    ((code, message),) = volume.warnings
    assert code == "partial_plot"
    assert "50.0%" in message
    inside = np.nan_to_num(known) >= 2.0
    assert f"p = {inside.mean() / 2:.3g}" in message
    assert f"{inside.sum() / (known.size - 1):.3g}" in message
    assert not volume.occupied[:, :, :30].any()


def test_a_raster_without_a_reference_system_is_read_in_metres_with_a_warning(raster):
    volume = read_canopy(raster(trees(), crs=None))
    assert [code for code, _ in volume.warnings] == ["units_assumed"]


def test_bare_ground_has_no_slices_and_gives_a_warning(raster):
    bare = read_canopy(raster(np.zeros((4, 5), np.float32)))
    assert bare.occupied.shape == (0, 4, 5)
    assert [code for code, _ in bare.warnings] == ["no_vegetation"]
    assert read_canopy(raster(np.full((4, 5), -3.0)), min_height_m=0.0).occupied.shape[0] == 0


def test_a_raster_plans_by_its_voxels_and_again_from_its_request(raster):
    path = raster(trees() * (np.indices((40, 60)).sum(axis=0) % 7 < 3))
    result = plan(PlanRequest(altitude=60, scene=path, vhat=0.3))
    assert result.model == "measured"
    assert "crowns are assumed to be solid from 0.5" in result.document()["scene"]["assumed"]
    request = result.request.document()
    assert (request["voxel"], request["min_height"], request["crown_base"]) == (0.5, 2.0, 0.5)
    assert plan(PlanRequest(**request)).document() == result.document()
    deeper = plan(PlanRequest(altitude=60, scene=path, vhat=0.3, crown_base=0.1))
    assert deeper.solution.prediction.density > result.solution.prediction.density


# --- Bad files ---


def refusal(path, **given):
    with pytest.raises(RequestError) as caught:
        read_canopy(str(path), **given)
    assert str(path) in caught.value.message
    assert "\n" not in caught.value.message
    return caught.value


@pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"transform": None, "crs": None}, "no georeference"),
        ({"crs": "EPSG:4326"}, "geographic"),
        ({"transform": Affine(0.4, 0.3, 0.0, 0.3, -0.4, 0.0)}, "rotated"),
        ({"transform": Affine(1e7, 0.0, 0.0, 0.0, -1e7, 0.0)}, "too large for a stand"),
        ({"unit": "cubit"}, "heights in 'cubit'"),
    ],
)
def test_a_raster_that_is_not_a_plot_in_metres_is_refused(raster, change, said):
    assert said in refusal(raster(trees(), **change)).message


@pytest.mark.parametrize(
    ("heights", "said"),
    [
        (np.full((3, 4), 612.5), "reaches 612.5"),
        (np.full((3, 4), np.nan), "contains no heights"),
        (np.full((3, 4), np.inf), "contains no heights"),
        (np.zeros((3, 4, 5)), "3 bands"),
        (np.zeros((4, 5), np.complex64), "complex64"),
    ],
)
def test_invalid_heights_are_named_in_the_error(raster, heights, said):
    assert said in refusal(raster(heights)).message


def test_voxels_larger_than_the_raster_are_refused(raster):
    assert "larger than raster" in refusal(raster(trees()), voxel_m=21.0).message
    assert read_canopy(raster(trees()), voxel_m=20.0).occupied.shape[1:] == (1, 1)


def test_a_huge_raster_is_refused_before_it_is_read(raster, monkeypatch):
    path = raster(trees())
    monkeypatch.setattr("aosplan.scenes.files.canopy_raster.MOST_PIXELS", 2000)
    assert "60 x 40 cells" in refusal(path).message


def test_a_very_large_sparse_raster_is_refused(tmp_path):
    path = tmp_path / "giant.tif"
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        count=1,
        height=200_000,
        width=200_000,
        dtype="float32",
        crs=UTM,
        transform=PLACE,
        tiled=True,
        sparse_ok=True,
        bigtiff="yes",
    ):
        pass
    assert path.stat().st_size < 20_000_000
    assert "too many" in refusal(path).message


@pytest.mark.parametrize("voxel", [1e-3, 1e-300])
def test_too_many_voxels_are_refused_with_a_possible_size(raster, voxel):
    path = raster(trees())
    error = refusal(path, voxel_m=voxel)
    size = float(error.hint.split()[2])
    assert read_canopy(path, voxel_m=4 * size).occupied.any()


@pytest.mark.parametrize("content", [b"", b"II", b"ply\n", b"II*\0" + b"\xff" * 60, b"MM\0*"])
def test_files_that_are_not_geotiff_are_refused_by_name(tmp_path, content):
    path = tmp_path / "a.tif"
    path.write_bytes(content)
    refusal(path)


@pytest.mark.parametrize("share", [0.001, 0.02, 0.3, 0.9])
def test_a_truncated_raster_is_named(raster, tmp_path, share):
    path = raster(trees(rows=300, columns=300))
    with open(path, "rb") as file:
        content = file.read()
    cut = tmp_path / "cut.tif"
    cut.write_bytes(content[: int(share * len(content))])
    refusal(cut)


def test_a_missing_raster_and_a_folder_are_named(tmp_path):
    assert "no raster" in refusal(tmp_path / "none.tif").message
    assert "is a folder" in refusal(tmp_path).message
    with pytest.raises(RequestError):
        read_canopy("a\0.tif")


def test_without_the_optional_dependency_the_error_names_it(raster, monkeypatch):
    path = raster(trees())
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(MissingExtraError, match="'raster'"):
        read_canopy(path)


def test_options_of_other_scenes_are_refused(raster):
    path = raster(trees())
    with pytest.raises(RequestError, match="--ground needs a point cloud"):
        plan(PlanRequest(altitude=60, scene=path, ground="class"))
    with pytest.raises(RequestError, match="--crown-base needs a canopy height raster"):
        plan(PlanRequest(altitude=60, scene="savanna", crown_base=0.5))


# Units, scales and values without data


FOOT = 1200 / 3937
IN_FEET = Affine(0.5 / FOOT, 0, 6_561_666.0, 0, -0.5 / FOOT, 1_940_416.0)


def warned(volume):
    return [code for code, _ in volume.warnings]


@pytest.mark.parametrize(
    ("crs", "unit", "given", "up"),
    [
        ("EPSG:2227", "ft", None, 0.3048),
        ("EPSG:2227", "US survey foot", None, FOOT),
        ("EPSG:2227", "Clarke's foot", None, 0.3047972654),
        ("EPSG:2227", "m", None, 1.0),
        ("EPSG:2227+5703", None, None, 1.0),
        ("EPSG:2227+6360", None, None, FOOT),
        ("EPSG:2227", None, "us-ft", FOOT),
        ("EPSG:2227", None, "us-ft,m", 1.0),
        (None, None, "us-ft,Indian foot", 0.304799510248147),
    ],
)
def test_one_canopy_in_every_unit_reads_the_same(raster, crs, unit, given, up):
    heights = np.round(trees() * 4) / 4 + 0.1  # The heights are not near the faces of voxels.
    true = read_canopy(raster(heights))
    dressed = raster(heights / up, transform=IN_FEET, crs=crs, unit=unit, name="feet.tif")
    volume = read_canopy(dressed, units=given, voxel_m=0.5)
    assert np.array_equal(volume.occupied, true.occupied)
    expected = [] if given else ["units_converted"]
    assert warned(volume) == expected + ["heights_converted"] * (not given and up != 1.0)


def test_heights_without_a_unit_are_refused_if_x_and_y_are_in_feet(raster):
    with pytest.raises(RequestError, match="does not state the unit of its heights") as caught:
        read_canopy(raster(trees(), transform=IN_FEET, crs="EPSG:2227"))
    assert "--units" in caught.value.hint


def test_contradictory_units_in_a_raster_are_refused(raster):
    path = raster(trees(), transform=IN_FEET, crs="EPSG:2227+6360", unit="m")
    with pytest.raises(
        RequestError, match="in metres according to its band, but in US survey feet"
    ) as caught:
        read_canopy(path)
    assert "--units" in caught.value.hint
    assert read_canopy(path, units="us-ft,m", voxel_m=0.5).canopy_top_m > 20.0


@pytest.mark.parametrize("value", [-9999.0, -32768.0, -3.4028234663852886e38])
def test_values_without_data_that_are_not_tagged_are_named_and_left_out(raster, value):
    heights = trees()
    heights[:, :20] = value
    tagged = read_canopy(raster(heights, nodata=value))
    volume = read_canopy(raster(heights))
    assert warned(volume) == ["nodata_assumed", "partial_plot"]
    assert f"{value:.6g}" in volume.warnings[0][1]
    assert np.array_equal(volume.occupied, tagged.occupied)
    wrong = read_canopy(raster(heights, nodata=-1.0))
    assert "another value for missing data, -1" in wrong.warnings[0][1]


def test_cells_of_web_mercator_are_scaled_to_the_ground(raster):
    # At 60° a metre of web Mercator is half a metre on the ground.
    place = Affine(1.0, 0.0, 1_500_000.0, 0.0, -1.0, 8_399_737.9)
    volume = read_canopy(raster(trees(), transform=place, crs="EPSG:3857"))
    assert warned(volume) == ["projection_scaled"]
    assert volume.voxel_m == pytest.approx(0.5, rel=0.003)


@pytest.mark.parametrize(
    "storage",
    [
        {"ENDIANNESS": "BIG"},
        {"ENDIANNESS": "BIG", "compress": "lzw", "predictor": 3},
        {"BIGTIFF": "YES", "tiled": True, "blockxsize": 16, "blockysize": 16},
        {"compress": "deflate", "predictor": 2, "dtype": "int16"},
        {"dtype": "float64", "nodata": float("nan")},
        {"dtype": "int32", "nodata": -(2**31)},
        {"dtype": "uint8", "nodata": 255},
    ],
)
def test_one_canopy_in_every_storage_reads_the_same(raster, storage):
    heights = np.round(trees())
    given = dict(storage)
    dressed = heights.astype(given.pop("dtype", "float32"))
    missing = given.get("nodata")
    if missing is not None:
        dressed[:2, :2] = missing
    true = read_canopy(raster(heights))
    volume = read_canopy(raster(dressed, name="dressed.tif", **given))
    if missing is None:
        assert warned(volume) == warned(true)
        assert np.array_equal(volume.occupied, true.occupied)
    else:  # The treatment of missing cells is tested elsewhere.
        away = np.s_[:, :-8, 8:]
        assert np.array_equal(volume.occupied[away], true.occupied[away])
