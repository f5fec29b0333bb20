"""Waypoints and tables in pandas, polars and GeoPandas."""

import pytest

import aosplan

PLAN = {"altitude": 40, "vhat": 0.9, "origin": (48.3, 14.3)}


@pytest.fixture(scope="module")
def placed():
    return aosplan.plan(**PLAN)


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_waypoints_are_converted_to_data_frames(library, placed):
    frames = pytest.importorskip(library)
    ways = placed.waypoints
    for frame in (frames.DataFrame(ways), frames.DataFrame(ways.columns())):
        assert list(frame["east_m"]) == list(ways.east_m)
        assert list(frame["latitude"]) == list(ways.latitude)
        assert len(frame) == len(ways)


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_tables_are_converted_to_data_frames(library, placed):
    frames = pytest.importorskip(library)
    table = aosplan.tradeoff(altitude=40, vhat=0.9, max_samples=12).columns()
    assert list(frames.DataFrame(table)["samples"]) == table["samples"]
    swept = aosplan.sweep({"altitude": [30, 40], "vhat": 0.9}).columns()
    assert list(frames.DataFrame(swept)["baseline_m"]) == swept["baseline_m"]


def test_geopandas_reads_waypoints_and_plans(placed):
    geopandas = pytest.importorskip("geopandas")
    points = geopandas.GeoDataFrame.from_features(placed.waypoints, crs=4326)
    assert list(points.geometry.x) == list(placed.waypoints.longitude)
    assert list(points.geometry.y) == list(placed.waypoints.latitude)
    whole = geopandas.GeoDataFrame.from_features(placed, crs=4326)
    assert len(whole) == len(points) + 1
    assert whole.geometry.iloc[-1].geom_type == "LineString"
    # Distances in UTM agree with the distances of the plan.
    metres = points.to_crs(points.estimate_utm_crs())
    east, north = placed.waypoints.east_m, placed.waypoints.north_m
    planned = ((east[1] - east[0]) ** 2 + (north[1] - north[0]) ** 2) ** 0.5
    assert metres.geometry.iloc[0].distance(metres.geometry.iloc[1]) == pytest.approx(
        planned, rel=1e-3
    )


def test_waypoints_are_a_sequence(placed):
    ways = placed.waypoints
    assert ways[-1] in ways
    assert len(list(reversed(ways))) == len(ways)
    assert len(ways[2:5]) == 3
