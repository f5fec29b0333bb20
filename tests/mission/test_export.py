"""Formats: every file has the same positions in the same order, and either all files are complete
or none is written.
"""

import csv
import importlib
import io
import json
import math
import sys
from functools import cache
from itertools import pairwise

import pytest
from golden.make import FOLDER, REQUESTS, contents
from hypothesis import given
from hypothesis import strategies as st
from support.flights import flown_in

from aosplan.cli.app import run
from aosplan.errors import RequestError, SurroundingsError
from aosplan.mission import formats as formats_folder
from aosplan.mission.export import MODULES, choose_format, formats, render
from aosplan.mission.mission import Mission, Waypoint, Waypoints
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest

LINZ = (48.3358, 14.3261)


@cache
def planned(**values):
    return plan(PlanRequest(**({"altitude": 40, "vhat": 0.9} | values)))


def rendered(result, name):
    return render(result.mission(), formats()[name])


def rows_of(content):
    return list(csv.DictReader(io.StringIO(content.decode(), newline="")))


def points_of(content):
    collection = json.loads(content)
    return [f for f in collection["features"] if f["geometry"]["type"] == "Point"]


def path_of(content):
    (path,) = [f for f in json.loads(content)["features"] if f["geometry"]["type"] != "Point"]
    return path


# Golden files


def test_every_golden_file_is_written_and_no_other():
    assert set(contents()) == {path.name for path in FOLDER.iterdir() if path.suffix != ".py"} - {
        "__pycache__"
    }


@pytest.mark.parametrize("name", contents())
def test_files_equal_the_golden_files_byte_for_byte(name):
    assert contents()[name].decode() == (FOLDER / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("request_", REQUESTS.values(), ids=REQUESTS)
def test_the_same_mission_gives_the_same_bytes(request_):
    one, other = plan(request_).mission(), plan(request_).mission()
    for form in formats().values():
        if one.has_place or not form.needs_place:
            first, second = (render(flown_in(one_, form.name), form) for one_ in (one, other))
            assert first == second


# CSV


def test_csv_has_the_columns_of_the_contract():
    assert rendered(planned(), "csv").splitlines()[0] == b"index,east_m,north_m,altitude_m"
    assert (
        rendered(planned(origin=LINZ), "csv").splitlines()[0]
        == b"index,east_m,north_m,altitude_m,latitude,longitude"
    )


def test_csv_is_plain_text_with_a_line_for_each_waypoint():
    content = rendered(planned(origin=LINZ), "csv")
    assert content.isascii()
    assert b"\r" not in content
    assert content.endswith(b"\n")
    assert content.count(b"\n") == 1 + len(planned(origin=LINZ).waypoints)


def test_degrees_have_nine_decimals_or_more():
    for row in rows_of(rendered(planned(origin=LINZ), "csv")):
        for name in ("latitude", "longitude"):
            assert len(row[name].partition(".")[2]) >= 9


coordinates = st.floats(-2e4, 2e4)
missions = st.lists(
    st.tuples(
        coordinates, coordinates, st.floats(0, 9000), st.floats(-90, 90), st.floats(-180, 180)
    ),
    min_size=1,
    max_size=5,
).map(lambda rows: Mission(Waypoints.of(Waypoint(i, *row) for i, row in enumerate(rows)), {}))


@given(mission=missions)
def test_csv_read_back_is_the_mission(mission):
    rows = rows_of(render(mission, formats()["csv"]))
    for row, waypoint in zip(rows, mission.waypoints, strict=True):
        assert int(row["index"]) == waypoint.index
        for name in ("east_m", "north_m", "altitude_m"):
            assert float(row[name]) == pytest.approx(getattr(waypoint, name), rel=0, abs=5.1e-5)
        for name in ("latitude", "longitude"):
            assert float(row[name]) == pytest.approx(getattr(waypoint, name), rel=0, abs=5.1e-10)


@given(mission=missions)
def test_csv_has_neither_exponents_nor_negative_zeros(mission):
    content = render(mission, formats()["csv"]).decode()
    body = content.partition("\n")[2]
    assert set(body) <= set("0123456789.-,\n")
    for row in csv.reader(io.StringIO(body)):
        assert not any(cell.startswith("-") and float(cell) == 0.0 for cell in row)


# GeoJSON


@pytest.mark.parametrize("origin", [LINZ, (12.0, 180.0), (90.0, 0.0), (-33.9, -70.6)])
@pytest.mark.parametrize("grid", ["trimmed", "line", "lanes"])
def test_geojson_is_a_feature_collection_of_rfc_7946(origin, grid):
    collection = json.loads(rendered(planned(origin=origin, grid=grid), "geojson"))
    assert collection["type"] == "FeatureCollection"
    assert "crs" not in collection
    assert not {"coordinates", "geometries", "geometry", "properties"} & set(collection)
    for feature in collection["features"]:
        assert feature["type"] == "Feature"
        assert isinstance(feature["properties"], dict)
        assert set(feature["geometry"]) == {"type", "coordinates"}
    # RFC 7946, section 4: WGS 84, longitude first, and a third element for height.
    for point in collection["features"][:-1]:
        assert point["geometry"]["type"] == "Point"
        longitude, latitude, altitude = point["geometry"]["coordinates"]
        assert -180 <= longitude <= 180
        assert -90 <= latitude <= 90
        assert altitude == 40.0


def test_geojson_names_longitude_first():
    # At Linz, 48 must be the latitude. If the axes were swapped, the position would be in the
    # Indian Ocean.
    for point in points_of(rendered(planned(origin=LINZ), "geojson")):
        longitude, latitude, _ = point["geometry"]["coordinates"]
        assert longitude == pytest.approx(LINZ[1], abs=1e-3)
        assert latitude == pytest.approx(LINZ[0], abs=1e-3)


def test_points_have_the_properties_of_the_csv():
    content = rendered(planned(origin=LINZ), "geojson")
    rows = planned(origin=LINZ).document()["waypoints"]
    for point, waypoint in zip(points_of(content), rows, strict=True):
        assert set(point["properties"]) == set(waypoint)
        assert point["properties"]["index"] == waypoint["index"]
        assert point["geometry"]["coordinates"] == [
            point["properties"]["longitude"],
            point["properties"]["latitude"],
            point["properties"]["altitude_m"],
        ]


def test_the_last_feature_is_the_path_through_all_points_in_order():
    content = rendered(planned(origin=LINZ), "geojson")
    last = json.loads(content)["features"][-1]
    assert last["geometry"]["type"] == "LineString"
    assert last["geometry"]["coordinates"] == [
        point["geometry"]["coordinates"] for point in points_of(content)
    ]


def test_a_single_waypoint_has_no_path():
    result = plan(PlanRequest(altitude=40, vhat=0, origin=LINZ))
    features = json.loads(rendered(result, "geojson"))["features"]
    assert [feature["geometry"]["type"] for feature in features] == ["Point"]


def test_the_summary_is_a_foreign_member():
    result = planned(origin=LINZ)
    summary = json.loads(rendered(result, "geojson"))["aosplan"]
    document = json.loads(json.dumps(result.document()))
    assert summary == {name: value for name, value in document.items() if name != "waypoints"}
    assert summary["schema"] == 1


@pytest.mark.parametrize("longitude", [180.0, -180.0, 179.99999, -179.99999])
@pytest.mark.parametrize("grid", ["trimmed", "square", "line"])
@pytest.mark.parametrize("heading", [0.0, 45.0, 90.0])
def test_a_path_across_the_antimeridian_is_cut_there(longitude, grid, heading):
    result = planned(origin=(-16.5, longitude), grid=grid, heading=heading)
    geometry = path_of(rendered(result, "geojson"))["geometry"]
    parts = (
        geometry["coordinates"]
        if geometry["type"] == "MultiLineString"
        else [geometry["coordinates"]]
    )
    for part in parts:
        assert len(part) >= 2
        assert all(abs(stop[0] - start[0]) <= 180 for start, stop in pairwise(part))
    for part, following in pairwise(parts):
        # The cut is at a single place, which has two longitudes.
        assert {part[-1][0], following[0][0]} == {180.0, -180.0}
        assert part[-1][1:] == following[0][1:]
    places = [tuple(place) for part in parts for place in part]
    flown = [tuple(p["geometry"]["coordinates"]) for p in points_of(rendered(result, "geojson"))]
    assert set(flown) <= set(places)


def test_a_cut_at_the_antimeridian_is_on_the_line_between_its_neighbours():
    waypoints = (
        Waypoint(0, 0.0, 0.0, 40.0, 10.0, 179.9),
        Waypoint(1, 0.0, 0.0, 40.0, 13.0, -179.8),
    )
    geometry = path_of(render(Mission(Waypoints.of(waypoints), {}), formats()["geojson"]))[
        "geometry"
    ]
    assert geometry["coordinates"] == [
        [[179.9, 10.0, 40.0], [180.0, pytest.approx(11.0), 40.0]],
        [[-180.0, pytest.approx(11.0), 40.0], [-179.8, 13.0, 40.0]],
    ]


@given(mission=missions)
def test_geojson_read_back_is_the_mission(mission):
    points = points_of(render(mission, formats()["geojson"]))
    for point, waypoint in zip(points, mission.waypoints, strict=True):
        longitude, latitude, altitude = point["geometry"]["coordinates"]
        assert latitude == pytest.approx(waypoint.latitude, rel=0, abs=5.1e-11)
        assert longitude == pytest.approx(waypoint.longitude, rel=0, abs=5.1e-11)
        assert altitude == pytest.approx(waypoint.altitude_m, rel=0, abs=5.1e-5)


# One mission in every format


@pytest.mark.parametrize("origin", [LINZ, (12.0, 180.0), (-90.0, 0.0)])
@pytest.mark.parametrize("grid", ["trimmed", "lanes", "line"])
@pytest.mark.parametrize("heading", [0.0, 123.0])
def test_csv_geojson_and_json_have_the_same_positions_in_the_same_order(origin, grid, heading):
    result = planned(origin=origin, grid=grid, heading=heading)
    rows = rows_of(rendered(result, "csv"))
    points = [point["properties"] for point in points_of(rendered(result, "geojson"))]
    document = result.document()["waypoints"]
    assert len(rows) == len(points) == len(document) == result.solution.pattern.samples
    for row, point, waypoint in zip(rows, points, document, strict=True):
        assert int(row["index"]) == point["index"] == waypoint["index"]
        for name in ("east_m", "north_m", "altitude_m"):
            assert float(row[name]) == point[name]
            assert point[name] == pytest.approx(waypoint[name], rel=0, abs=5.1e-5)
        for name in ("latitude", "longitude"):
            assert float(row[name]) == point[name]
            assert point[name] == pytest.approx(waypoint[name], rel=0, abs=5.1e-11)


# Choosing a format


def test_formats_are_those_of_the_contract():
    assert {"csv", "geojson"} <= set(formats())
    assert list(formats()) == sorted(formats())


def test_every_extension_belongs_to_one_format():
    endings = [suffix for form in formats().values() for suffix in form.suffixes]
    assert len(endings) == len(set(endings))
    assert all(suffix.startswith(".") and suffix == suffix.lower() for suffix in endings)


@pytest.mark.parametrize(
    ("path", "name", "chosen", "rest"),
    [
        ("plan.csv", None, "csv", "plan.csv"),
        ("plan.CSV", None, "csv", "plan.CSV"),
        ("a.b/plan.geojson", None, "geojson", "a.b/plan.geojson"),
        ("csv:plan.txt", None, "csv", "plan.txt"),
        ("csv:plan.geojson", None, "csv", "plan.geojson"),
        ("csv:-", None, "csv", "-"),
        ("csv:a:b", None, "csv", "a:b"),
        ("C:plan.csv", None, "csv", "C:plan.csv"),
        ("2026-11-22T08:00.csv", None, "csv", "2026-11-22T08:00.csv"),
        ("plan", "csv", "csv", "plan"),
        ("plan.csv", "geojson", "geojson", "plan.csv"),
        ("-", "csv", "csv", "-"),
        ("x", "qgc_plan", "plan", "x"),
        ("wpml:x.zip", None, "kmz", "x.zip"),
        ("wpml:x.zip", "kmz", "kmz", "x.zip"),
    ],
)
def test_a_format_is_chosen_by_name_or_extension(path, name, chosen, rest):
    form, where = choose_format(path, name)
    assert (form.name, where) == (chosen, rest)


@pytest.mark.parametrize(
    ("path", "name", "words"),
    [
        ("plan.txt", None, "'plan.txt': no format has the extension '.txt'"),
        ("plan", None, "no format has the extension"),
        ("kml2:plan.xyz", None, "no format has the extension '.xyz'"),
        ("-", None, "output '-' (stdout) has no extension"),
        ("plan.csv", "cvs", "unknown format 'cvs'"),
        ("", None, "the name of an output file is empty"),
        ("csv:", None, "the name of an output file is empty"),
        ("", "csv", "the name of an output file is empty"),
    ],
)
def test_an_unknown_format_is_refused(path, name, words):
    with pytest.raises(RequestError) as caught:
        choose_format(path, name)
    assert words in caught.value.message


def test_html_outputs_are_refused_with_a_hint_for_report():
    with pytest.raises(RequestError) as caught:
        choose_format("plan.html")
    assert caught.value.hint == "to write a page about the plan, give --report plan.html"


def test_an_unknown_ending_lists_the_known_ones():
    with pytest.raises(RequestError) as caught:
        choose_format("plan.txt")
    assert "csv (.csv)" in caught.value.hint
    assert "geojson (.geojson)" in caught.value.hint
    assert "litchi (litchi:FILE)" in caught.value.hint  # This format has no extension of its own.


def test_a_misspelt_format_gets_the_nearest():
    with pytest.raises(RequestError) as caught:
        choose_format("plan", "geojsn")
    assert caught.value.hint == "did you mean geojson?"


@pytest.fixture
def added_format(tmp_path, monkeypatch):
    """An additional module of formats, and its entry in the registry."""
    (tmp_path / "counted.py").write_text(
        "from aosplan.mission.format import Format\n"
        'FORMAT = Format("counted", (".cnt",), "Count", needs_place=False)\n'
        "def render(mission):\n"
        '    return b"%d\\n" % len(mission.waypoints)\n'
    )
    monkeypatch.setattr(formats_folder, "__path__", [*formats_folder.__path__, str(tmp_path)])
    monkeypatch.setitem(MODULES, "counted", "counted")
    importlib.invalidate_caches()
    yield "counted"
    sys.modules.pop("aosplan.mission.formats.counted", None)
    vars(formats_folder).pop("counted", None)


def test_a_module_and_a_registry_entry_add_a_format(added_format, tmp_path, capsys):
    assert added_format in formats()
    planned().write(tmp_path / "plan.cnt")
    assert (tmp_path / "plan.cnt").read_text() == "10\n"
    assert run(["formats"]) == 0
    assert "counted" in capsys.readouterr().out
    out = str(tmp_path / "more.txt")
    assert run(["plan", "--altitude", "40", "--out", f"counted:{out}", "--quiet"]) == 0
    assert (tmp_path / "more.txt").read_text() == "50\n"


def test_formats_added_by_another_test_are_not_registered():
    assert "counted" not in formats()


# Writing files


def test_a_plan_writes_its_waypoints_to_a_file(tmp_path):
    result = planned(origin=LINZ)
    result.write(tmp_path / "plan.csv")
    result.write(f"csv:{tmp_path / 'plan.txt'}")
    result.write(str(tmp_path / "plan"), format="geojson")
    assert (tmp_path / "plan.csv").read_bytes() == rendered(result, "csv")
    assert (tmp_path / "plan.txt").read_bytes() == rendered(result, "csv")
    assert (tmp_path / "plan").read_bytes() == rendered(result, "geojson")


def test_a_plan_overwrites_only_when_forced(tmp_path):
    (tmp_path / "plan.csv").write_text("old")
    with pytest.raises(RequestError, match="exists"):
        planned().write(tmp_path / "plan.csv")
    assert (tmp_path / "plan.csv").read_text() == "old"
    planned().write(tmp_path / "plan.csv", force=True)
    assert (tmp_path / "plan.csv").read_bytes() == rendered(planned(), "csv")


def test_without_a_location_geojson_is_refused_and_no_file_is_written(tmp_path):
    with pytest.raises(RequestError) as caught:
        planned().write(tmp_path / "plan.geojson")
    assert "needs a location" in caught.value.message
    assert "--origin LAT,LON" in caught.value.hint
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_an_error(tmp_path):
    with pytest.raises(RequestError, match="there is no folder"):
        planned().write(tmp_path / "no" / "plan.csv")


def test_a_full_disk_leaves_no_file(tmp_path, monkeypatch):
    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(SurroundingsError, match="no space left"):
        planned().write(tmp_path / "plan.csv")
    assert list(tmp_path.iterdir()) == []


# The command `aosplan export`

LINE = ["plan", "--altitude", "40", "--vhat", "0.9", "--origin=48.3358,14.3261", "--heading", "30"]


@pytest.fixture
def saved(tmp_path, capsys):
    assert run([*LINE, "--json"]) == 0
    path = tmp_path / "plan.json"
    path.write_text(capsys.readouterr().out, encoding="utf-8")
    return path


@pytest.mark.parametrize("ending", ["csv", "geojson"])
def test_a_saved_plan_exports_the_same_bytes_as_the_plan_itself(saved, tmp_path, capsys, ending):
    direct, exported = tmp_path / f"direct.{ending}", tmp_path / f"exported.{ending}"
    assert run([*LINE, "--out", str(direct)]) == 0
    assert run(["export", str(saved), "--out", str(exported)]) == 0
    assert exported.read_bytes() == direct.read_bytes()


def test_export_reports_the_written_file_unless_quiet(saved, tmp_path, capsys):
    out = str(tmp_path / "a.csv")
    assert run(["export", str(saved), "--out", out]) == 0
    assert out in capsys.readouterr().out
    assert run(["export", str(saved), "--out", out, "--force", "--quiet"]) == 0
    assert capsys.readouterr().out == ""


def test_export_writes_to_stdout(saved, capsys):
    assert run(["export", str(saved), "--out", "csv:-"]) == 0
    assert capsys.readouterr().out.encode() == rendered(planned(origin=LINZ, heading=30.0), "csv")


def test_a_saved_plan_without_a_location_is_not_exported_as_geojson(tmp_path, capsys):
    assert run(["plan", "--altitude", "40", "--json"]) == 0
    (tmp_path / "plan.json").write_text(capsys.readouterr().out)
    out = tmp_path / "plan.geojson"
    assert run(["export", str(tmp_path / "plan.json"), "--out", str(out)]) == 2
    assert "needs a location" in capsys.readouterr().err
    assert not out.exists()


def test_export_writes_all_outputs_or_none(saved, tmp_path, capsys):
    (tmp_path / "b.geojson").write_text("old")
    outputs = ["--out", str(tmp_path / "a.csv"), "--out", str(tmp_path / "b.geojson")]
    assert run(["export", str(saved), *outputs]) == 2
    assert not (tmp_path / "a.csv").exists()
    assert (tmp_path / "b.geojson").read_text() == "old"


def test_numbers_in_files_are_finite():
    for name in ("csv", "geojson"):
        content = rendered(planned(origin=LINZ), name).decode().lower()
        assert "nan" not in content
        assert "infinity" not in content
    columns = planned(origin=LINZ).waypoints.columns()
    assert all(math.isfinite(value) for column in columns.values() for value in column)
