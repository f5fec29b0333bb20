"""Review of a flight: missing sites are found, the visibility of the flown sites is predicted, and
a flight to the missing sites is planned.
"""

import json
import os

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from support.forests import STANDS, clumped_forest
from support.paths import AREAS
from support.slices import slices_shortfall

from aosplan.cli.app import run
from aosplan.cli.schema import json_schema
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.postflight.positions_file import read_places, read_positions
from aosplan.postflight.review import review
from aosplan.postflight.views import read_views
from aosplan.scenes.files.voxel_file import VoxelStand, stand_npz

PLACED = {"altitude": 40, "origin": (48.3358, 14.3261), "heading": 30}
FORMATS = ["csv", "geojson", "waypoints", "plan"]


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """A function that runs a command in an empty folder and returns its status, stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def execute(*arguments):
        status = run([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return status, out, err

    return execute


def csv_of(path, points, header="east_m,north_m", rows=None):
    lines = [",".join(map(repr, map(float, point))) for point in points] if rows is None else rows
    path.write_text("\n".join([header, *lines, ""]))
    return str(path)


def sites_of(planned):
    ways = planned.waypoints
    return np.column_stack([ways.east_m, ways.north_m])


def without(points, gone):
    return np.delete(points, sorted(gone), axis=0)


def reviewed(path, points, request, **options):
    views = read_views(csv_of(path, points), on_earth=request.has_place)
    return review(request, views, **options)


@pytest.mark.parametrize(
    "wanted",
    [
        {"altitude": 40},
        {"altitude": 40, "heading": 33, "grid": "lanes"},
        {"altitude": 50, "model": "layered", "grid": "spiral", "vhat": 0.95},
        {"altitude": 40, "rays": "oblique", "heading": -70, "vhat": 0.9},
        {"altitude": 40, "model": "layered", "rays": "cubes", "grid": "rectangle", "vhat": 0.9},
    ],
    ids=["uniform", "lanes", "spiral", "oblique", "cubes"],
)
def test_sites_without_a_photo_are_missing_and_no_others(tmp_path, wanted):
    request = PlanRequest(**wanted)
    planned = plan(request)
    sites = sites_of(planned)
    gone = [2, 3, len(sites) - 1]
    found = reviewed(tmp_path / "f.csv", without(sites, gone), request)
    assert found.missing == gone
    assert found.strays == []
    assert found.errors_m == pytest.approx((0.0, 0.0), abs=1e-9)
    # The sum over pairs of the pattern equals the sum over pairs of positions.
    assert tuple(found.completed) == pytest.approx(tuple(planned.solution.prediction), rel=1e-9)
    assert found.flown.shortfall != found.completed.shortfall
    flown = sites_of(found.topup)
    assert flown == pytest.approx(sites[gone], abs=1e-12)


def test_flown_photos_are_predicted_at_their_recorded_positions(tmp_path):
    request = PlanRequest(altitude=40, heading=40, samples=30, baseline=2.0)
    planned = plan(request)
    points = sites_of(planned) + np.random.default_rng(5).normal(0.0, 0.4, (30, 2))
    found = reviewed(tmp_path / "f.csv", points, request)
    turn = np.radians(40.0)
    along = points @ [np.sin(turn), np.cos(turn)]
    across = points @ [np.cos(turn), -np.sin(turn)]
    # Neighbours share occluders, so the volume is treated as slices of one occluder's thickness.
    expected = slices_shortfall(np.column_stack([along, across]), planned.scene.slices(), 40.0)
    assert found.flown.shortfall == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_noise_below_the_tolerance_leaves_nothing_missing(tmp_path, seed):
    request = PlanRequest(altitude=40, grid="square", hold_error=0.3)
    sites = sites_of(plan(request))
    rng = np.random.default_rng(seed)
    turns, radii = rng.uniform(0, 2 * np.pi, len(sites)), rng.uniform(0, 1.39, len(sites))
    missed = np.column_stack([np.sin(turns), np.cos(turns)]) * radii[:, np.newaxis]
    found = reviewed(tmp_path / "f.csv", rng.permutation(sites + missed), request)
    assert (found.missing, found.strays, found.topup) == ([], [], None)
    assert found.tolerance_m == pytest.approx(1.4, rel=0.01)
    assert found.errors_m == pytest.approx((np.sqrt(np.mean(radii**2)), radii.max()), abs=1e-9)
    closer = reviewed(tmp_path / "f.csv", sites + missed, request, tolerance_m=0.7)
    assert closer.missing == np.flatnonzero(radii > 0.7).tolist() == closer.strays


def test_distant_photos_belong_to_no_site(tmp_path):
    request = PlanRequest(altitude=40)
    sites = sites_of(plan(request))
    nearby, far = [[1.5, 0.1]], [[400.0, 0.0]]
    found = reviewed(tmp_path / "f.csv", np.vstack([nearby, sites, far]), request, tolerance_m=0.5)
    assert found.strays == [0, 51]
    assert found.missing == []
    assert found.counted == 51  # The distant photo does not see the centre.
    seen = np.vstack([nearby, sites])[:, ::-1]  # The heading is north.
    expected = slices_shortfall(seen, found.plan.scene.slices(), 40.0)
    assert found.flown.shortfall == pytest.approx(expected, rel=1e-9)
    assert [code for code, _ in found.warnings] == ["photos_aside"]


def test_two_photos_of_one_site_count_as_one_sample(tmp_path):
    request = PlanRequest(altitude=40)
    sites = sites_of(plan(request))
    sites[1] = sites[0]
    assert reviewed(tmp_path / "f.csv", sites, request, tolerance_m=50.0).missing == [1]


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_comes_back_and_its_holes_are_topped_up(tmp_path, command, name):
    command("plan", *flags(PLACED), "--out", f"flown.{name}", "--quiet")
    status, text, _ = command("plan", *flags(PLACED), "--json")
    (tmp_path / "plan.json").write_text(text)
    whole = json.loads(text)
    status, text, err = command(
        "review", f"flown.{name}", "plan.json", "--out", "top.plan", "--json"
    )
    found = json.loads(text)
    assert (status, err, found["missing"], found["strays"]) == (0, "", [], [])
    assert found["flown"]["shortfall"] == pytest.approx(whole["visibility"]["shortfall"], rel=0.01)
    assert not (tmp_path / "top.plan").exists()

    places = read_places(f"flown.{name}")
    rows = [f"{place[0]!r},{place[1]!r}" for k, place in enumerate(places) if k not in (7, 30)]
    csv_of(tmp_path / "holes.csv", [], "lat,lon", rows)
    line = ("review", "holes.csv", "plan.json", "--out", f"top.{name}", "--json")
    status, text, err = command(*line)
    found = json.loads(text)
    assert status == 0
    expected = {
        "plan": "no autopilot is given",
        "waypoints": "the height of the home position above sea level",
    }
    assert expected[name] in err if name in expected else err == ""
    assert [site["index"] for site in found["missing"]] == [7, 30]
    Draft202012Validator(json_schema("review")).validate(found)
    topped = read_places(f"top.{name}")
    for place, index in zip(topped, (7, 30), strict=True):
        assert place[0] == pytest.approx(whole["waypoints"][index]["latitude"], abs=1e-7)
        assert place[1] == pytest.approx(whole["waypoints"][index]["longitude"], abs=1e-7)
    assert found["completed"]["shortfall"] == pytest.approx(found["planned"]["shortfall"], rel=0.01)


def flags(request):
    return [
        f"--{name}={','.join(map(str, value)) if isinstance(value, tuple) else value}"
        for name, value in request.items()
    ]


def test_a_folder_of_photos_is_reviewed(tmp_path, command):
    photo = pytest.importorskip("support.geotagged").photo
    (tmp_path / "photos").mkdir()
    ways = plan(PlanRequest(**PLACED)).waypoints
    for way in ways:
        if way.index not in (0, 20):
            xmp = f'<x drone-dji:RelativeAltitude="+{40 + 5 * (way.index == 9)}.1"/>'.encode()
            name = tmp_path / "photos" / f"DJI_{way.index:04}.JPG"
            photo(name, way.latitude, way.longitude, xmp)
    photo(tmp_path / "photos" / "DJI_0020.JPG")
    status, text, err = command("review", "photos", *flags(PLACED), "--json")
    found = json.loads(text)
    assert status == 0
    assert [site["index"] for site in found["missing"]] == [0, 20]
    assert [w["code"] for w in found["warnings"]] == ["photos_without_position", "altitude_differs"]
    assert "DJI_0020.JPG" in err
    assert "1 of 48 photos" in err
    assert found["off_site_m"]["largest"] < 0.02


def test_a_plan_without_a_location_is_matched_to_the_middle_of_the_photos(tmp_path, command):
    command("plan", *flags(PLACED), "--out", "flown.waypoints", "--quiet")
    line = ("review", "flown.waypoints", "--altitude=40", "--heading=30", "--json")
    status, text, err = command(*line)
    found = json.loads(text)
    assert (status, found["missing"]) == (0, [])
    assert found["origin"] == pytest.approx(PLACED["origin"], abs=1e-6)
    assert [warning["code"] for warning in found["warnings"]] == ["origin_assumed"]
    assert "48.3358" in err


def test_a_plan_without_a_location_is_matched_to_its_photos_despite_missing_ones(tmp_path, command):
    planned = plan(PlanRequest(**PLACED))
    ways = planned.waypoints
    # One side of the grid except one photo, and one site in the middle, are missing.
    side = np.argsort(ways.east_m)[: len(ways) // 3].tolist()
    gone = sorted({*side[1:], len(ways) // 2})
    rows = [
        f"{latitude!r},{longitude!r}"
        for index, (latitude, longitude) in enumerate(
            zip(ways.latitude, ways.longitude, strict=True)
        )
        if index not in gone
    ]
    csv_of(tmp_path / "f.csv", [], "latitude,longitude", [*rows, "48.34,14.33"])
    line = ("review", "f.csv", "--altitude=40", "--heading=30", "--json", "--out", "rest.waypoints")
    status, text, _ = command(*line)
    found = json.loads(text)
    assert status == 0
    assert found["origin"] == pytest.approx(PLACED["origin"], abs=1e-8)
    assert [each["index"] for each in found["missing"]] == gone
    assert found["off_site_m"]["largest"] < 1e-3
    assert len(found["strays"]) == 1
    topup = read_places("rest.waypoints")
    assert np.abs(np.array(topup)[:, :2] - PLACED["origin"]).max() < 1e-3


def test_a_measured_stand_is_predicted_voxel_by_voxel(tmp_path):
    scene = tmp_path / "stand.npz"
    forest = clumped_forest(STANDS["beech"], side_m=20.0, voxel_m=0.5)
    scene.write_bytes(stand_npz(VoxelStand.of(forest)))
    request = PlanRequest(
        altitude=60, scene=str(scene), samples=12, baseline=1.5, heading=25.0, grid="rectangle"
    )
    planned = plan(request)
    sites = sites_of(planned)
    found = reviewed(tmp_path / "f.csv", sites[:-2], request)
    model = planned.problem.model
    assert found.missing == [10, 11]
    assert found.flown == model.predict_positions(sites[:-2])
    assert tuple(found.completed) == pytest.approx(tuple(planned.solution.prediction), rel=1e-12)


def test_lines_that_are_flown_through_keep_their_turns_in_a_top_up(tmp_path):
    request = PlanRequest(altitude=40, trigger="distance")
    planned = plan(request)
    photos = [way for way in planned.waypoints if way.photo]
    left = [way for k, way in enumerate(photos) if k not in (3, 4, 5)]
    found = reviewed(tmp_path / "f.csv", [way[1:3] for way in left], request)
    assert found.missing == [way.index for way in photos[3:6]]
    assert [way.photo for way in found.topup.waypoints] == [False, True, True, True, False]


def test_an_area_has_its_missing_sites_and_a_top_up_around_its_zones(tmp_path, command):
    detour = pytest.importorskip("aosplan.areas.no_fly")
    from aosplan.areas.area import read_area

    files = [f"--area={AREAS / 'field.geojson'}", f"--no-fly={AREAS / 'mast.geojson'}"]
    line = ["--altitude=100", "--samples=4", "--baseline=12", *files]
    status, text, _ = command("plan", *line, "--json")
    assert status == 0
    ways = [way for way in json.loads(text)["waypoints"] if way.get("photo", True)]
    no_fly = str(AREAS / "mast.geojson")
    area = read_area(str(AREAS / "field.geojson"), no_fly=no_fly, buffer_m=5)
    zones = detour.NoFlyZones(area.keep_out)
    sites = np.array([(way["east_m"], way["north_m"]) for way in ways])
    apart = zones.cross(np.repeat(sites[:1], len(sites), axis=0), sites)
    # The mast of the no-fly zone is between the two sites.
    gone = [ways[0], ways[np.flatnonzero(apart)[0]]]
    points = [(way["latitude"], way["longitude"]) for way in ways if way not in gone]
    csv_of(tmp_path / "f.csv", points, "latitude,longitude")
    status, text, _ = command("review", "f.csv", *line, "--out", "top.csv", "--json")
    found = json.loads(text)
    assert status == 0
    assert found["missing"] == [{k: v for k, v in way.items() if k != "photo"} for way in gone]
    assert (found["flown"], found["completed"]) == (None, None)
    assert "no_single_aperture" in [warning["code"] for warning in found["warnings"]]
    assert len(read_positions("top.csv")) == 2
    rows = [row.split(",")[1:3] for row in (tmp_path / "top.csv").read_text().split("\n")[1:-1]]
    way = np.array(rows, dtype=float)
    assert len(way) > 2
    assert not zones.cross(way[:-1], way[1:]).any()


# Malicious inputs


def test_a_single_photo_leaves_all_other_sites_missing(tmp_path):
    request = PlanRequest(altitude=40)
    found = reviewed(tmp_path / "f.csv", sites_of(plan(request))[:1], request)
    assert found.missing == list(range(1, 50))
    assert found.flown.shortfall == 1.0


@pytest.mark.slow
def test_a_hundred_thousand_positions_are_matched_without_a_prediction(tmp_path):
    points = np.random.default_rng(1).uniform(-40.0, 40.0, (100_000, 2)).round(3)
    found = reviewed(tmp_path / "f.csv", points, PlanRequest(altitude=40))
    assert found.missing == []
    assert found.flown is None
    assert [code for code, _ in found.warnings][-1] == "too_many_views"


def test_photos_at_one_place_share_all_occluders(tmp_path):
    found = reviewed(tmp_path / "f.csv", [(1.4, 1.4)] * 300, PlanRequest(altitude=40))
    assert found.flown.shortfall == pytest.approx(1.0, rel=1e-12)


def test_photos_far_from_all_sites_give_a_warning(tmp_path):
    found = reviewed(tmp_path / "f.csv", [(1e8, 0.0), (1e8, 5.0)], PlanRequest(altitude=40))
    assert (len(found.missing), found.flown) == (50, None)
    assert tuple(found.completed) == pytest.approx(tuple(found.plan.solution.prediction), rel=1e-9)
    assert "no_photo_at_any_site" in [code for code, _ in found.warnings]


def test_a_scene_without_occluders_is_fully_visible_in_a_review(tmp_path):
    request = PlanRequest(altitude=40, density=0.0, occluder_size=0.2, volume_height=10)
    found = reviewed(tmp_path / "f.csv", [(0.3, 0.2)], request)
    assert (found.missing, found.flown.density) == ([], 0.0)
    assert found.document()["flown"]["normalized"] is None


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("f.csv", b"x,y\nnan,0\n", "line 2: value 'nan' is not a finite number"),
        ("f.csv", b"x,y\n1\n", "line 2: 1 values are too few"),
        ("f.csv", b"x,y\n", "contains no positions"),
        ("f.csv", b"", "has no columns"),
        ("f.csv", b"a,b\n1,2\n", "has no columns latitude and longitude, or"),
        ("f.csv", b"lat,lon\n95,0\n", "is not a latitude"),
        ("f.jpg", b"\xff\xd8\xff\xe1", "is not UTF-8 text"),
        ("f.plan", b"{}", "has no mission"),
        ("f.waypoints", b"x", "does not begin with QGC WPL"),
        ("f.geojson", b'{"features": []}', "contains no positions"),
        ("f.json", b'{"schema": 1}', "is not a GeoJSON"),
        ("f.csv", b"lat,lon\n-48,-14\n", "km from the plan's origin"),
    ],
)
@pytest.mark.parametrize("name_of_command", ["review", "thin"])
def test_files_of_the_wrong_kind_give_one_clear_error(
    tmp_path, command, name, content, words, name_of_command
):
    (tmp_path / name).write_bytes(content)
    extra = ["--samples=1"] if name_of_command == "thin" else []
    line = (name_of_command, name, "--altitude=40", "--origin=48,14", *extra)
    status, out, err = command(*line)
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert words in err


@pytest.mark.parametrize("name_of_command", ["review", "thin"])
def test_an_empty_folder_is_an_error(tmp_path, command, name_of_command):
    (tmp_path / "photos").mkdir()
    extra = ["--samples=1"] if name_of_command == "thin" else []
    status, _, err = command(name_of_command, "photos", "--altitude=40", *extra)
    assert status == 2
    assert "0 photos were read" in err


def test_names_that_are_not_unicode_are_printed(tmp_path, command):
    photo = pytest.importorskip("support.geotagged").photo
    (tmp_path / "photos").mkdir()
    photo(tmp_path / "photos" / "far\nout.jpg", 48.001, 14.0)
    for name in (b"far\xff.jpg", b"none\xff.jpg"):
        source = tmp_path / "one.jpg"
        photo(source, *((48.0, 14.001) if name[0] == ord("f") else ()))
        try:
            source.rename(tmp_path / "photos" / os.fsdecode(name))
        except OSError:
            pytest.skip("this file system has Unicode alone")
    status, out, err = command("review", "photos", "--altitude=40", "--origin=48,14", "--json")
    assert status == 0
    assert [stray["name"] for stray in json.loads(out)["strays"]] == ["far?out.jpg", "far?.jpg"]
    assert "none?.jpg" in err
    status, out, _ = command("thin", "photos", "--altitude=40", "--samples=1", "--json")
    assert (status, len(json.loads(out)["views"])) == (0, 1)


def test_formats_that_need_a_location_write_nothing_without_it(tmp_path, command):
    csv_of(tmp_path / "f.csv", [(0.0, 0.0)])
    line = ("review", "f.csv", "--altitude=40", "--out=top.waypoints", "--out=top.csv")
    status, _, err = command(*line)
    assert status == 2
    assert "needs a location" in err
    assert [path.name for path in tmp_path.iterdir()] == ["f.csv"]


def test_a_negative_tolerance_is_refused(tmp_path, command):
    csv_of(tmp_path / "f.csv", [(0.0, 0.0)])
    status, _, err = command("review", "f.csv", "--altitude=40", "--tolerance=-1")
    assert (status, "--tolerance" in err) == (2, True)


FOUND = {"find": "person", "contrast": 3.0, "canopy_offset": 0.0, "crown_share": 0.0}
FEW_SLICES = {"integrated_density": 0.8, "occluder_size": 0.5, "volume_height": 3.0}


def test_detection_is_lower_with_missing_photos_and_as_planned_after_the_top_up(tmp_path):
    request = PlanRequest(altitude=40, samples=36, baseline=2.0, **FEW_SLICES, **FOUND)
    planned = plan(request)
    # The last lines are missing. If instead every second photo were missing, about as many targets
    # would be found as in the plan.
    half = without(sites_of(planned), range(12, 36))
    found = reviewed(tmp_path / "flown.csv", half, request)
    assert found.detection.planned == planned.detection.probability
    assert found.detection.completed == pytest.approx(planned.detection.probability, abs=1e-6)
    assert found.detection.flown < found.detection.planned - 0.02
    document = found.document()
    assert document["detection"] == found.detection._asdict()
    Draft202012Validator(json_schema("review")).validate(document)
    plain = reviewed(
        tmp_path / "plain.csv",
        half,
        PlanRequest(altitude=40, samples=36, baseline=2.0, **FEW_SLICES),
    )
    assert "detection" not in plain.document()
