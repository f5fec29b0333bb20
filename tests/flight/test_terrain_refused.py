"""An invalid terrain file, or one that does not cover the flight, gives one clear error."""

from pathlib import Path

import numpy as np
import pytest
from support.terrains import planned, saved, slope, surface

from aosplan.errors import RequestError

rasterio = pytest.importorskip("rasterio")


@pytest.fixture
def sloped(tmp_path):
    return saved(tmp_path / "slope.tif", surface(slope))


def refused(path, **values):
    with pytest.raises(RequestError) as caught:
        planned(terrain=str(path), **values)
    assert str(path) in caught.value.message
    return caught.value


def test_a_raster_not_covering_the_sites_is_refused(tmp_path):
    small = saved(tmp_path / "small.tif", surface(slope, size=10))
    error = refused(small)
    assert "does not cover" in error.message
    assert "48.33" in error.message


def test_a_raster_far_from_the_sites_is_refused(sloped):
    error = refused(sloped, origin=(10.0, 14.0))
    assert "does not cover" in error.message
    assert refused(sloped, origin=(-89.9, 0.0)).hint


def test_a_takeoff_outside_the_raster_is_refused(sloped):
    assert "does not cover" in refused(sloped, takeoff=(48.35, 14.3261)).message


@pytest.mark.parametrize("hole", ["nodata", "nan", "infinite"])
def test_a_raster_without_data_below_the_flight_is_refused(tmp_path, hole):
    heights = surface(slope)
    heights[195:205, 195:205] = {"nodata": -9999.0, "nan": np.nan, "infinite": np.inf}[hole]
    path = saved(tmp_path / f"{hole}.tif", heights, nodata=-9999.0 if hole == "nodata" else None)
    assert "has no height at" in refused(path).message


def test_missing_data_away_from_the_flight_are_accepted(tmp_path):
    heights = surface(slope)
    heights[:50, :50] = -9999.0
    path = saved(tmp_path / "elsewhere.tif", heights, nodata=-9999.0)
    assert planned(terrain=path).waypoints.ground_m is not None


def test_a_raster_without_a_location_is_refused(tmp_path):
    path = str(tmp_path / "lost.tif")
    with (
        pytest.warns(rasterio.errors.NotGeoreferencedWarning),
        rasterio.open(
            path, "w", driver="GTiff", width=9, height=9, count=1, dtype="float32"
        ) as raster,
    ):
        raster.write(np.zeros((9, 9), dtype=np.float32), 1)
    error = refused(path)
    assert "coordinate reference system" in error.message
    assert "gdal_edit" in error.hint


def test_heights_in_an_unknown_unit_are_refused(tmp_path):
    path = saved(tmp_path / "unit.tif", surface(slope), unit="cubit")
    assert "'cubit'" in refused(path).message


def test_complex_numbers_are_refused_as_heights(tmp_path):
    path = saved(tmp_path / "complex.tif", surface(slope).astype(np.complex64))
    assert "complex" in refused(path).message


def test_a_file_that_is_not_a_raster_is_refused(tmp_path):
    (tmp_path / "text.tif").write_text("no raster")
    assert "not a GeoTIFF" in refused(tmp_path / "text.tif").message
    assert "no file" in refused(tmp_path / "missing.tif").message
    assert "is a folder" in refused(tmp_path).message


def test_a_raster_that_refers_to_other_files_is_refused(tmp_path, sloped):
    (tmp_path / "points.tif").write_text(
        '<VRTDataset rasterXSize="9" rasterYSize="9"><VRTRasterBand dataType="Float32" band="1">'
        f"<SimpleSource><SourceFilename>{sloped}</SourceFilename><SourceBand>1</SourceBand>"
        "</SimpleSource></VRTRasterBand></VRTDataset>"
    )
    assert "not a GeoTIFF" in refused(tmp_path / "points.tif").message


def test_a_truncated_raster_is_refused(tmp_path, sloped):
    content, path = Path(sloped).read_bytes(), tmp_path / "cut.tif"
    for length in (0, 4, 200, len(content) // 2):
        path.write_bytes(content[:length])
        assert refused(path).message


def test_an_internet_address_is_refused_as_file():
    for path in ("http://localhost/dem.tif", "/vsicurl/http://localhost/x", "zip://a.zip!b.tif"):
        assert "is not a file" in refused(path).message
