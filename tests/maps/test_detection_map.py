"""Detection at each place, compared with counts of photos and with predictions for single places."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from support.forests import STANDS, clumped_forest
from support.paths import AREAS

from aosplan.areas.photo_sets import photo_sets
from aosplan.cli.app import run
from aosplan.maps.detection_map import detection_map, ground_of, photos_of
from aosplan.planning import place_detection
from aosplan.planning.place_detection import PlaceDetection, canopy_over
from aosplan.planning.plan_detection import detection_at
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.postflight.views import along_heading
from aosplan.scenes.local_canopy import local_canopy
from aosplan.scenes.voxels import VoxelVolume

rasterio = pytest.importorskip("rasterio")

SEARCH = {
    "altitude": 40,
    "find": "person",
    "contrast": 1.0,
    "canopy_offset": -1.0,
    "crown_share": 0.2,
}
SPARSE = {**SEARCH, "baseline": 4.0, "samples": 12, "heading": 30.0}
FIELD = str(AREAS / "field.geojson")


@pytest.fixture(scope="module")
def over_field():
    """A plan and its map from fewer different predictions than usual.  These tests do not check the
    values of the predictions.
    """
    planned = plan(PlanRequest(**SPARSE, area=FIELD))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(place_detection, "MOST_PREDICTIONS", 60)
        return planned, detection_map(planned)


def seen_from(planned, east, north):
    """The photos whose footprint contains a place, in plain Python."""
    heading = math.radians(planned.heading_deg)
    along_m, across_m = planned.camera.footprint_m(planned.altitude_m)
    ways = planned.waypoints
    photo = ways.photo or [True] * len(ways)
    found = []
    for x, y, taken in zip(ways.east_m, ways.north_m, photo, strict=True):
        away_east, away_north = x - east, y - north
        along = away_east * math.sin(heading) + away_north * math.cos(heading)
        across = away_east * math.cos(heading) - away_north * math.sin(heading)
        if taken and abs(along) <= along_m / 2 and abs(across) <= across_m / 2:
            found.append((away_east, away_north))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("noise_m", [0.0, pytest.param(0.7, marks=pytest.mark.slow)])
def test_places_are_seen_by_the_photos_whose_footprint_contains_them(noise_m):
    planned = plan(PlanRequest(**SPARSE, area=FIELD))
    rng = np.random.default_rng(4)
    cells, _ = ground_of(planned)
    points = photos_of(planned)
    points = points + noise_m * rng.standard_normal(points.shape)
    places = cells.middles_m
    sets = photo_sets(places, points, planned.inputs.footprint_m, planned.heading_deg)
    found = PlaceDetection(planned).probabilities(sets, places, points)
    inside = np.flatnonzero(cells.inside.ravel())
    errors = []
    for place in rng.choice(inside, 25, replace=False):
        mine = points[sets.of(place)] - places[place]
        if not noise_m:
            plain = seen_from(planned, *places[place])
            assert sorted(map(tuple, np.round(mine, 6).tolist())) == sorted(
                map(tuple, np.round(plain, 6).tolist())
            )
        alone = detection_at(
            planned.inputs, along_heading(*mine.T, planned.heading_deg)
        ).probability
        errors.append(found[place] - alone)
    assert np.abs(errors).max() < 0.04
    assert np.sqrt(np.mean(np.square(errors))) < 0.015
    assert 0.3 < found[inside].mean() < 0.99  # The probabilities are neither all 0 nor all 1.


def test_the_mean_is_over_the_places_and_the_size_is_that_of_the_outline(over_field):
    planned, found = over_field
    document = found.document()
    inside = found.cells.inside.ravel()
    assert document["probability"] == pytest.approx(
        sum(found.probability[inside].tolist()) / int(inside.sum()), rel=1e-12
    )
    assert document["area_m2"] == pytest.approx(planned.layout.survey.area_m2, rel=0.01)
    # By the coverage rule, there are N sites around every point.
    assert document["photos"]["least"] >= 12
    assert document["unseen_share"] == 0.0
    assert document["canopy"] == "scene"


def test_the_map_of_one_grid_covers_all_ground_in_its_photos():
    planned = plan(PlanRequest(**SPARSE, origin=(48.3, 14.3)))
    found = detection_map(planned)
    x, y = planned.camera.footprint_m(40.0)
    extent = planned.extent_m
    box = (x + extent[0]) * (y + extent[1])
    assert 0.85 * box < found.cells.area_m2 <= 1.01 * box  # trimmed corners are not visible
    looks = found.looks[found.cells.inside.ravel()]
    assert (looks.min(), looks.max()) == (1, 12)
    common = (looks == 12).sum() * found.cells.cell_m**2
    assert common == pytest.approx((x - extent[0]) * (y - extent[1]), rel=0.05)


def test_the_sweep_width_of_a_line_is_the_swath_times_the_probability():
    line = {"grid": "line", "trigger": "distance", "line_length": 150.0, "origin": (48.3, 14.3)}
    wanted = {**SEARCH, "contrast": 1.5, "baseline": 2.9, "samples": 9, "heading": 20.0}
    planned = plan(PlanRequest(**wanted, **line))
    found = detection_map(planned)
    along_m, swath_m = planned.camera.footprint_m(40.0)
    # This is the lateral range curve. In the middle of the line, each place is in 9 or 10 photos:
    # those within the length of a footprint. Their number does not depend on the distance from the
    # line.
    aside = (np.arange(11) - 5.0) * swath_m / 11.0
    width = []
    for phase in (np.arange(10) + 0.5) / 10.0:
        along = 2.9 * (np.arange(-10, 10) + phase)
        along = along[np.abs(along) <= along_m / 2]
        curve = [
            detection_at(
                planned.inputs, np.column_stack([along, np.full(len(along), y)])
            ).probability
            for y in aside
        ]
        width.append(swath_m * np.mean(curve))
    assert found.sweep_width_m == pytest.approx(np.mean(width), rel=0.015)
    assert 0.2 * swath_m < found.sweep_width_m < 0.95 * swath_m


@pytest.mark.slow
def test_a_denser_canopy_reduces_detection_at_the_correct_place():
    stand = clumped_forest(next(iter(STANDS.values())))
    middle = (48.3, 14.3)
    # The western half is open, but not the eastern one.
    occupied = stand.occupied.copy()
    occupied[:, :, : occupied.shape[2] // 2] = False
    stand = replace(stand, occupied=occupied, place=middle)
    planned = plan(PlanRequest(**SPARSE, origin=middle))
    inputs = planned.inputs._replace(loaded=replace(planned.inputs.loaded, volume=stand))
    cells, _ = ground_of(planned)
    canopy = canopy_over(replace(planned, inputs=inputs), cells)
    east, north = cells.middles_m.T
    near = (np.abs(north) < 3.0) & (np.abs(east) > canopy.window_m) & (np.abs(east) < 12.0)
    assert (canopy.depth[near & (east < 0.0)] < 0.02).all()
    assert (canopy.depth[near & (east > 0.0)] > canopy.mean_depth).all()
    width_m, depth_m = stand.size_m
    rim_m = 0.5 * canopy.window_m
    for within_m, finite in ((rim_m + stand.voxel_m, True), (rim_m - stand.voxel_m, False)):
        inside = (np.abs(east) < 0.5 * width_m - within_m) & (
            np.abs(north) < 0.5 * depth_m - within_m
        )
        assert np.isfinite(canopy.depth[inside if finite else ~inside]).all() == finite
        assert np.isfinite(canopy.depth[inside if finite else ~inside]).any() == finite
    sets = photo_sets(cells.middles_m, photos_of(planned), planned.inputs.footprint_m, 30.0)
    predict = PlaceDetection(planned)
    found = [
        predict.probabilities(sets, cells.middles_m, photos_of(planned), np.full(len(east), depth))
        for depth in (0.0, 0.6, 1.0, 2.2)
    ]
    seen = sets.looks > 8
    means = [float(each[seen].mean()) for each in found]
    assert means == sorted(means, reverse=True)
    assert means[0] - means[3] > 0.3


def prior_of(path, found, values, **profile):
    """A prior of a few large pixels over the map, in UTM."""
    latitude, longitude = found.origin
    from pyproj import Transformer

    x, y = Transformer.from_crs(4326, 32633, always_xy=True).transform(longitude, latitude)
    rows, columns = values.shape
    profile = {"crs": "EPSG:32633", "dtype": "float32", "count": 1} | profile
    corner = rasterio.Affine(100.0, 0.0, x - 50.0 * columns, 0.0, -100.0, y + 50.0 * rows)
    with rasterio.open(
        path, "w", driver="GTiff", width=columns, height=rows, transform=corner, **profile
    ) as file:
        for band in range(1, profile["count"] + 1):
            file.write(values.astype(profile["dtype"]), band)
    return str(path)


def test_near_the_edge_of_a_plot_the_canopy_is_not_known():
    """The canopy of a place is known if the square around it is within the plot."""
    rng = np.random.default_rng(3)
    occupied = rng.random((20, 60, 40)) < 0.02
    volume = VoxelVolume(occupied, 0.5, place=(48.0, 14.0))
    places = np.array([[0.0, 0.0], [7.7, 0.0], [8.3, 0.0], [0.0, -12.7], [0.0, -13.3]])
    found = local_canopy(volume, places, (48.0, 14.0), altitude_m=50.0, footprint_m=10.0)
    assert found.window_m == 4.0  # The plot is 20 m wide and 30 m deep.
    assert np.isfinite(found.depth).tolist() == [True, True, False, True, False]
    square = occupied.any(axis=0)[26:34, 16:24]
    assert -np.expm1(-found.depth[0]) == pytest.approx(square.mean())


def test_success_is_the_sum_of_detection_times_prior(tmp_path, over_field):
    _, found = over_field
    # The prior has ten by ten pixels of 100 m around the area, which is 1 km². It is uniform, so
    # the probability that the target is in the area is the size of the area in km².
    even = found.success(prior_of(tmp_path / "even.tif", found, np.full((10, 10), 7.0)))
    assert even.area == pytest.approx(found.cells.area_m2 / 1e6, rel=0.002)
    assert even.success == pytest.approx(even.area * found.mean, rel=1e-3)


@pytest.mark.parametrize(
    ("values", "profile", "message"),
    [
        (np.full((2, 2), -1.0), {}, "which is not a probability"),
        (np.array([[1.0, np.inf]]), {}, "contains inf, which is not a probability"),
        (np.zeros((2, 2)), {}, "zero everywhere"),
        (np.pad([[1.0]], ((9, 0), (0, 9))), {}, "has no probability on the ground of the plan"),
        (np.ones((2, 2)), {"crs": None}, "has no coordinate system"),
        (np.ones((2, 2)), {"count": 2}, "has 2 bands"),
    ],
)
def test_an_invalid_prior_raster_is_refused(tmp_path, over_field, values, profile, message):
    from aosplan.errors import RequestError

    path = prior_of(tmp_path / "bad.tif", over_field[1], values, **profile)
    with pytest.raises(RequestError, match=message):
        over_field[1].success(path)


@pytest.mark.slow
def test_the_command_writes_a_map_that_lies_over_the_area(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    place = ["--area", FIELD, "--altitude", "40", "--baseline", "4", "--samples", "12"]
    arguments = ["plan", *place, "--detection-map", "pod.tif", "--json"]
    assert run([*arguments, "--report", "page.html", "--no-report-picture"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["request"]["find"] == "person"
    found = document["detection"]["map"]
    with rasterio.open(tmp_path / "pod.tif") as file:
        pod, looks = file.read()
        corners = [file.transform * (0, 0), file.transform * (file.width, file.height)]
        assert file.descriptions == ("probability of detection", "photos")
        crs = file.crs
    assert np.nanmean(pod) == pytest.approx(found["probability"], rel=1e-5)
    assert np.isnan(pod).sum() == np.isnan(looks).sum() > 0
    from pyproj import Transformer

    ring = json.loads((AREAS / "field.geojson").read_text("utf-8"))
    ring = ring["features"][0]["geometry"] if "features" in ring else ring.get("geometry", ring)
    x, y = Transformer.from_crs(4326, crs, always_xy=True).transform(
        *np.array(ring["coordinates"][0]).T[:2]
    )
    cell = found["cell_m"]
    assert corners[0][0] <= min(x) < corners[0][0] + cell
    assert corners[0][1] >= max(y) > corners[0][1] - cell
    assert corners[1][0] >= max(x) > corners[1][0] - cell
    assert corners[1][1] <= min(y) < corners[1][1] + cell
    page = (tmp_path / "page.html").read_text("utf-8")
    assert f"{found['probability']:.1%} on average over the area" in page


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--detection-map", "pod.tif"], "needs a location"),
        (["--origin", "48,14", "--detection-map", "pod.png"], "does not end in .tif"),
        (
            ["--origin", "48,14", "--poa", "prior.tif"],
            "--poa needs --detection-map or --order gain",
        ),
        (["--origin", "48,14", "--detection-map", "p.tif", "--out", "p.tif"], "p.tif"),
        (["--origin", "48,14", "--detection-map", "p.tif", "--poa", "no.tif"], "no.tif"),
        (
            ["--origin", "48,14", "--detection-map", "p.tif", "--signature", "dawn"],
            "--signature 'dawn'",
        ),
    ],
)
def test_impossible_detection_maps_give_one_error_and_no_file(
    tmp_path, monkeypatch, capsys, arguments, message
):
    monkeypatch.chdir(tmp_path)
    assert run(["plan", "--altitude", "40", "--samples", "4", "--baseline", "3", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    errors = [line for line in err.splitlines() if line.startswith("error:")]
    assert len(errors) == 1
    assert message in errors[0]
    assert list(tmp_path.iterdir()) == []


def test_a_map_with_only_a_signature_searches_for_a_person(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arguments = ["--samples", "4", "--baseline", "3", "--origin", "48,14", "--signature", "colour"]
    assert run(["plan", "--altitude", "40", *arguments, "--detection-map", "p.tif"]) == 0
    assert "Search" in capsys.readouterr().out


@pytest.mark.slow
def test_the_map_over_voxels_has_the_counted_detection_for_the_planned_grid(tmp_path):
    from aosplan.scenes.files.voxel_file import VoxelStand, stand_npz

    stand = clumped_forest(STANDS["beech"])
    (tmp_path / "stand.npz").write_bytes(stand_npz(VoxelStand.of(stand)))
    wanted = {"scene": str(tmp_path / "stand.npz"), "baseline": 3.0, "samples": 9}
    planned = plan(PlanRequest(**{**SEARCH, "contrast": 3.0}, **wanted, origin=(48.3, 14.3)))
    assert planned.model == "measured"
    counted = planned.detection.probability
    assert 0.1 < counted < 0.9
    found = detection_map(planned)
    east, north = found.cells.middles_m.T
    middle = np.hypot(east, north).argmin()
    assert found.looks[middle] == 9
    assert found.probability[middle] == pytest.approx(counted, abs=0.03)
