"""Gaps are found where photos of an area are missing, and the top-up closes them."""

import json

import numpy as np
import pytest
import shapely

from aosplan.cli.app import run
from aosplan.geodesy import to_local, to_wgs84
from aosplan.maps.coverage_map import covering
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.postflight.positions_file import read_positions
from aosplan.postflight.review import review
from aosplan.postflight.views import read_views

MIDDLE = (48.3358, 14.3261)
SEARCH = {"find": "person", "contrast": 1.0, "canopy_offset": -1.0, "crown_share": 0.2}


@pytest.fixture(scope="module")
def square(tmp_path_factory):
    """A square of 80 m in a GeoJSON file."""
    east, north = [-40.0, 40.0, 40.0, -40.0, -40.0], [-40.0, -40.0, 40.0, 40.0, -40.0]
    latitude, longitude = to_wgs84(MIDDLE, east, north)
    ring = [list(point) for point in zip(longitude, latitude, strict=True)]
    path = tmp_path_factory.mktemp("area") / "square.geojson"
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    return str(path)


def flown(path, planned, kept, noise_m=0.0):
    """A table of some of the photos of a plan, and their positions."""
    ways = planned.waypoints
    points = np.column_stack([ways.east_m, ways.north_m])[kept]
    points = points + noise_m * np.random.default_rng(2).standard_normal(points.shape)
    latitude, longitude = to_wgs84(planned.origin, *points.T.tolist())
    rows = "".join(f"{a!r},{b!r}\n" for a, b in zip(latitude, longitude, strict=True))
    path.write_text("latitude,longitude\n" + rows)
    return str(path), points


def reviewed(path, request):
    return review(request, read_views(path, on_earth=True))


def test_photos_are_counted_cell_by_cell(tmp_path, square):
    request = PlanRequest(altitude=40, baseline=5.0, samples=12, heading=25.0, area=square)
    planned = plan(request)
    kept = np.arange(len(planned.waypoints)) % 7 != 3
    path, points = flown(tmp_path / "f.csv", planned, kept, 0.4)
    coverage = reviewed(path, request).coverage
    along_m, across_m = planned.camera.footprint_m(40.0)
    turn = np.radians(25.0)
    places = coverage.cells.middles_m
    for place in np.random.default_rng(1).choice(np.flatnonzero(coverage.cells.inside_rows), 30):
        count = 0
        for east, north in points - places[place]:
            along = east * np.sin(turn) + north * np.cos(turn)
            across = east * np.cos(turn) - north * np.sin(turn)
            count += abs(along) <= along_m / 2 and abs(across) <= across_m / 2
        assert coverage.flown[place] == count


@pytest.mark.parametrize("noise_m", [0.0, 0.4])
def test_gaps_are_at_missing_photos_and_the_top_up_closes_them(tmp_path, square, noise_m):
    request = PlanRequest(altitude=40, baseline=5.0, samples=12, heading=25.0, area=square)
    planned = plan(request)
    ways = planned.waypoints
    sites = np.column_stack([ways.east_m, ways.north_m])
    gone = np.hypot(*(sites - [10.0, -5.0]).T) < 12.0
    path, points = flown(tmp_path / "f.csv", planned, ~gone, noise_m)
    found = reviewed(path, request)
    assert found.missing == np.flatnonzero(gone).tolist()
    coverage = found.coverage
    places = coverage.cells.middles_m
    # A place has too few sites if a site in the rectangle around it is missing.
    window = planned.layout.survey.rectangle_m
    turn = np.radians(25.0)
    axes = np.array([[np.sin(turn), np.cos(turn)], [np.cos(turn), -np.sin(turn)]])
    off = np.abs((places[:, None] - sites[None]) @ axes.T)
    in_window = (off <= np.array(window) / 2 + 1e-6).all(axis=2)
    short = in_window[:, ~gone].sum(axis=1) < np.minimum(in_window.sum(axis=1), 12)
    assert (coverage.gaps == (short & coverage.cells.inside_rows)).all()
    assert 0.05 < coverage.gap_share < 0.5
    # All gaps are within reach of the missing sites, and the centre of the missing sites is in a
    # gap.
    near = np.hypot(*(places[coverage.gaps] - [10.0, -5.0]).T)
    assert near.max() < 12.0 + np.hypot(*window) / 2
    assert near.min() < 1.0
    # With the photos of the top-up, there are no gaps.
    route = found.topup.waypoints
    more = np.column_stack([route.east_m, route.north_m])
    latitude, longitude = to_wgs84(planned.origin, *np.vstack([points, more]).T.tolist())
    rows = "".join(f"{a!r},{b!r}\n" for a, b in zip(latitude, longitude, strict=True))
    (tmp_path / "all.csv").write_text("latitude,longitude\n" + rows)
    after = reviewed(str(tmp_path / "all.csv"), request)
    assert after.coverage.gap_share == 0.0
    assert after.topup is None
    assert len(more) <= gone.sum()


@pytest.mark.slow
def test_a_search_is_topped_up_until_its_detection_is_as_planned(tmp_path, square):
    request = PlanRequest(altitude=40, baseline=8.0, samples=6, heading=25.0, area=square, **SEARCH)
    planned = plan(request)
    ways = planned.waypoints
    sites = np.column_stack([ways.east_m, ways.north_m])
    gone = np.hypot(*(sites - [10.0, -5.0]).T) < 16.0
    path, _ = flown(tmp_path / "f.csv", planned, ~gone)
    found = reviewed(path, request)
    coverage, detection = found.coverage, found.detection
    inside = coverage.cells.inside_rows
    assert detection.planned == pytest.approx(coverage.planned_detection[inside].mean())
    assert detection.flown == pytest.approx(coverage.flown_detection[inside].mean())
    assert detection.flown < detection.planned - 0.02
    assert detection.planned - 0.02 < detection.completed < detection.planned + 0.01
    assert coverage.document()["rule"] == "detection"
    # If all planned photos of a place were taken, its probability of detection equals the planned
    # one.
    same = inside & (coverage.flown == coverage.planned)
    change = coverage.planned_detection[same] - coverage.flown_detection[same]
    assert np.abs(change).max() < 0.05
    near = np.hypot(*(coverage.cells.middles_m[coverage.gaps] - [10.0, -5.0]).T)
    assert near.max() < 16.0 + np.hypot(*planned.inputs.footprint_m) / 2


def test_a_complete_flight_has_no_gaps(tmp_path, square):
    request = PlanRequest(altitude=40, baseline=5.0, samples=12, heading=25.0, area=square)
    planned = plan(request)
    path, _ = flown(tmp_path / "f.csv", planned, np.ones(len(planned.waypoints), bool), 0.4)
    found = reviewed(path, request)
    assert (found.topup, found.missing, found.coverage.gap_share) == (None, [], 0.0)


@pytest.mark.parametrize("seed", range(5))
def test_few_sites_cover_all_places(seed):
    rng = np.random.default_rng(seed)
    rows = [np.flatnonzero(rng.random(12) < 0.4) for _ in range(30)]
    wanted = rng.integers(-1, 4, 30)
    chosen = set(covering(rows, wanted, 12).tolist())
    for row, number in zip(rows, wanted.tolist(), strict=True):
        assert len(chosen & set(row.tolist())) >= min(number, len(row))
    # The greedy choice is at most 1 + ln(30) times as large as the smallest one. For a single
    # place, it has exactly the required number of sites.
    assert len(covering([np.arange(5)], np.array([3]), 5)) == 3
    assert len(covering([np.arange(5)], np.array([0]), 5)) == 0


def test_the_command_writes_the_map_the_gaps_and_a_picture(tmp_path, square, monkeypatch, capsys):
    rasterio = pytest.importorskip("rasterio")
    monkeypatch.chdir(tmp_path)
    request = PlanRequest(altitude=40, baseline=5.0, samples=12, area=square)
    planned = plan(request)
    kept = np.arange(len(planned.waypoints)) < len(planned.waypoints) - 30
    flown(tmp_path / "f.csv", planned, kept, 0.4)
    line = ["--altitude", "40", "--baseline", "5", "--samples", "12", "--area", square]
    maps = [f"--coverage-map=c.{ending}" for ending in ("tif", "geojson", "svg")]
    assert run(["review", "f.csv", *line, *maps, "--out", "top.csv", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    with rasterio.open("c.tif") as file:
        photos, missing, gap = file.read()
    known = document["coverage"]
    assert np.nanmean(gap) == pytest.approx(known["gap_share"], abs=1e-9)
    assert np.nanmean(photos) == pytest.approx(known["flown_photos"], rel=1e-6)
    assert np.nanmean(photos + missing) >= known["planned_photos"] - 1e-6
    gaps = json.loads((tmp_path / "c.geojson").read_text("utf-8"))["features"]
    assert len(gaps) == known["gaps"]
    area = 0.0
    for feature in gaps:
        polygon = shapely.geometry.shape(feature["geometry"])
        assert polygon.exterior.is_ccw
        longitude, latitude = np.array(polygon.exterior.coords).T
        ring = to_local(planned.origin, latitude.tolist(), longitude.tolist())
        holes = [
            list(zip(*to_local(planned.origin, [p[1] for p in r.coords], [p[0] for p in r.coords]),
                     strict=True))
            for r in polygon.interiors
        ]  # fmt: skip
        area += shapely.Polygon(list(zip(*ring, strict=True)), holes).area
    assert area == pytest.approx(known["gap_m2"], rel=1e-3)
    assert (tmp_path / "c.svg").read_text("utf-8").startswith("<svg")
    assert len(read_positions("top.csv")) <= 30


@pytest.mark.parametrize(
    ("place", "name", "message"),
    [
        ("--origin=48,14", "c.tif", "needs a plan over an --area"),
        ("--area=SQUARE", "c.png", "does not end in .tif"),
        ("--area=SQUARE", "missing/c.tif", "missing"),
    ],
)
def test_impossible_coverage_maps_give_one_error(
    tmp_path, square, monkeypatch, capsys, place, name, message
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "f.csv").write_text("latitude,longitude\n48.0,14.0\n")
    place = place.replace("SQUARE", square)
    line = ["--altitude", "40", "--baseline", "5", "--samples", "12", place]
    assert run(["review", "f.csv", *line, "--coverage-map", name]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len([line for line in err.splitlines() if line.startswith("error:")]) == 1
    assert message in err
