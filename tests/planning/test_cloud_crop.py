"""Tests of the argument of `--crop`, and of the part of a cloud that a plan uses without this
option.
"""

import json
import math

import numpy as np
import pytest
from support.clouds import slope, write_cloud
from support.command_line import check_refusal

from aosplan.errors import RequestError
from aosplan.planning.cloud_crop import RAYS_M, asked_crop, crop_of_plan
from aosplan.planning.request import PlanRequest

pyproj = pytest.importorskip("pyproj")
EAST, NORTH = 500_000.0, 5_200_000.0
SIDE_M = 240.0


@pytest.fixture(scope="module")
def tile(tmp_path_factory):
    """A stand of 240 m, centred on the central meridian of UTM zone 33."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0.0, SIDE_M, (2, 30_000)).round(3)
    high = rng.random(x.size) < 0.5
    z = slope(x, y) + np.where(high, rng.uniform(5.0, 9.0, x.size), 0.0)
    offset = (EAST, NORTH, 0.0)
    path = tmp_path_factory.mktemp("tile") / "tile.las"
    return write_cloud(path, (x + EAST, y + NORTH, z), np.where(high, 5, 2), offset=offset)


def in_degrees(x, y):
    to = pyproj.Transformer.from_crs("EPSG:32633", "EPSG:4326", always_xy=True)
    return to.transform(EAST + x, NORTH + y)


def square(path, low, high):
    """A GeoJSON file with a square between two corners of the stand."""
    corners = [(low, low), (high, low), (high, high), (low, high), (low, low)]
    ring = [in_degrees(*corner) for corner in corners]
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    return path


@pytest.mark.parametrize(
    "text", ["1,2,3", "1,2,3,nan", "3,2,1,4", "1,4,2,3", "1,2,1,4", "1,2,inf,4", "no.geojson"]
)
def test_invalid_crop_rectangles_are_refused(text):
    with pytest.raises(RequestError):
        asked_crop(text, "")


def test_a_crop_is_a_rectangle_an_outline_or_all(tmp_path):
    assert asked_crop("all", "") is None
    assert asked_crop(" 1, -2.5,3e3,4", "").bounds == (1.0, -2.5, 3000.0, 4.0)
    square(tmp_path / "a.geojson", 10.0, 40.0)
    crop = asked_crop("a.geojson", str(tmp_path))
    assert crop.frame == "degrees"
    assert crop.bounds == pytest.approx((*in_degrees(10, 10), *in_degrees(40, 40)), abs=1e-6)


def test_a_plan_crops_the_cloud_to_the_ground_of_its_photos_and_line():
    request = PlanRequest(altitude=40.0, origin=(46.95, 15.0), scene="a.las")
    crop = crop_of_plan(request, None, (60.0, 80.0))
    west, south, east, north = crop.bounds
    geod = pyproj.Geod(ellps="WGS84")
    across, down = (
        geod.inv(west, 46.95, east, 46.95)[2],
        geod.inv(15.0, south, 15.0, north)[2],
    )
    assert (across, down) == pytest.approx((100.0, 100.0), abs=0.1)
    assert (crop.margin_m, crop.of_plan, crop.frame) == (RAYS_M, True, "degrees")
    assert crop_of_plan(PlanRequest(altitude=40.0, scene="a.las"), None, (60.0, 80.0)) is None


def points_used(document):
    return document["scene"]["points"]


@pytest.mark.slow
def test_scene_and_plan_read_the_crop(tile, folder, command):
    def document(*arguments):
        status, out, err = command(*arguments, "--json")
        assert status == 0, err
        return json.loads(out)

    square(folder / "part.geojson", 60.0, 180.0)
    bounds = f"{EAST + 60},{NORTH + 60},{EAST + 180},{NORTH + 180}"
    whole = document("scene", str(tile))["points"]
    by_bounds = document("scene", str(tile), "--crop", bounds)["points"]
    by_file = document("scene", str(tile), "--crop", "part.geojson")["points"]
    assert whole == 30_000
    assert by_bounds == pytest.approx(whole / 4, rel=0.03)
    assert by_file == pytest.approx(by_bounds, abs=9)
    latitude, longitude = in_degrees(120, 120)[::-1]
    plan = (
        "plan",
        "--altitude=30",
        "--vhat=0.5",
        "--voxel=1",
        f"--scene={tile}",
        f"--origin={latitude},{longitude}",
    )
    around = document(*plan)
    said = {each["code"]: each["message"] for each in around["warnings"]}
    assert "only the part of the point cloud around the plan is used" in said["cropped_to_plan"]
    everything = document(*plan, "--crop", "all")
    assert "cropped_to_plan" not in {each["code"] for each in everything["warnings"]}
    footprint = around["camera"]["footprint_m"]
    side_m = 2.0 * RAYS_M + math.hypot(*footprint)
    assert f"is used, {side_m:.0f} x {side_m:.0f} m" in said["cropped_to_plan"]


def test_a_crop_outside_the_cloud_gives_one_error_line(tile, command):
    check_refusal(*command("scene", str(tile), "--crop", "0,0,10,10"))
    check_refusal(*command("scene", str(tile), "--crop", "0,0,10"))
    check_refusal(*command("plan", "--altitude=30", "--crop=1,2,3,4"))
