"""The same ground gives the same heights in all units and projections of rasters, or an error."""

import numpy as np
import pytest
from pyproj import Transformer
from support.terrains import LINZ, planned, saved, slope, surface

from aosplan.errors import RequestError
from aosplan.flight.terrain import Terrain

rasterio = pytest.importorskip("rasterio")
from rasterio.transform import from_origin  # noqa: E402

FOOT = 1200 / 3937
PLACE = (37.5, -120.5)


def at(path, units=None, place=LINZ):
    with Terrain(path, units) as terrain:
        return terrain.heights_m([place[0]], [place[1]])[0]


def in_state_plane(path, heights, crs="EPSG:2227", unit=""):
    """A raster with x and y in US survey feet, around `PLACE`."""
    x, y = Transformer.from_crs("EPSG:4326", "EPSG:2227", always_xy=True).transform(*PLACE[::-1])
    return saved(path, heights, crs=crs, transform=from_origin(x - 500, y + 500, 10, 10), unit=unit)


@pytest.mark.parametrize(
    ("crs", "unit", "given", "metres"),
    [
        ("EPSG:2227", "ft", None, 0.3048),
        ("EPSG:2227", "Indian foot", None, 0.304799510248147),
        ("EPSG:2227+5703", "", None, 1.0),
        ("EPSG:2227+6360", "", None, FOOT),
        ("EPSG:2227", "", "us-ft", FOOT),
        ("EPSG:2227", "", "m", 1.0),
    ],
)
def test_rasters_in_different_units_give_the_same_heights(tmp_path, crs, unit, given, metres):
    heights = np.full((100, 100), 498.0 / metres, dtype=np.float64)
    path = in_state_plane(tmp_path / "feet.tif", heights, crs, unit)
    assert at(path, given, PLACE) == pytest.approx(498.0, abs=1e-6)


def test_heights_without_a_unit_are_refused_if_x_and_y_are_in_feet(tmp_path):
    path = in_state_plane(tmp_path / "feet.tif", np.full((100, 100), 1633.9))
    with pytest.raises(RequestError, match="does not state the unit of its heights") as caught:
        planned(origin=PLACE, terrain=path)
    assert "--terrain-units" in caught.value.hint
    told = planned(origin=PLACE, terrain=path, terrain_units="us-ft")
    assert told.waypoints.ground_m[0] == pytest.approx(1633.9 * FOOT)


def test_depths_are_refused(tmp_path):
    path = saved(tmp_path / "depths.tif", surface(slope), crs="EPSG:32633+5715")
    with pytest.raises(RequestError, match="depths"):
        at(path)


@pytest.mark.parametrize("value", [-9999.0, -32768.0, -3.4e38, 3.4e38, 65535.0])
def test_missing_values_are_not_heights_whether_tagged_or_not(tmp_path, value):
    heights = surface(slope)
    heights[100:300, 100:300] = value
    with pytest.raises(RequestError, match="has no height at"):
        at(saved(tmp_path / "hole.tif", heights))


def test_pixels_of_web_mercator_are_as_long_as_on_the_ground(tmp_path):
    x, y = Transformer.from_crs("EPSG:4326", "EPSG:3857", always_xy=True).transform(*LINZ[::-1])
    path = saved(
        tmp_path / "web.tif", surface(slope), crs="EPSG:3857", transform=from_origin(x, y, 2, 2)
    )
    with Terrain(path) as terrain:
        assert terrain.pixel_m == pytest.approx(2 * np.cos(np.radians(LINZ[0])), rel=0.004)


def test_the_error_for_a_distant_terrain_gives_its_location(tmp_path):
    path = saved(tmp_path / "linz.tif", surface(slope))
    with pytest.raises(RequestError, match="does not cover") as caught:
        planned(origin=(-33.8, 151.2), terrain=path)
    assert "48.3" in caught.value.hint
