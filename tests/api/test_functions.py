"""The functions of `aosplan` check their arguments, and give the same results as the commands."""

import inspect
import json
from dataclasses import fields, replace
from html import escape

import pytest
from support.recorded import FOV_DEG, photo, sites, write_recording

import aosplan
from aosplan import PlanRequest, RequestError
from aosplan.api.request_options import RequestOptions
from aosplan.cli.app import run

ALTITUDE = {"altitude": 40, "vhat": 0.9}


@pytest.fixture(scope="module")
def placed():
    return aosplan.plan(**ALTITUDE, max_samples=20, origin=(48.3, 14.3))


@pytest.fixture
def document(capsys):
    """The JSON document that a command prints."""

    def printed(*line):
        assert run([*map(str, line), "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return printed


def test_functions_accept_the_fields_of_a_request_as_keyword_arguments():
    assert list(RequestOptions.__annotations__) == [field.name for field in fields(PlanRequest)]


def test_a_plan_comes_from_a_request_options_a_plan_or_a_file(tmp_path, document):
    by_options = aosplan.plan(**ALTITUDE)
    (tmp_path / "plan.json").write_text(json.dumps(by_options.document()))
    (tmp_path / "request.toml").write_text("altitude = 40\nvhat = 0.9\n")
    command = document("plan", "--altitude", 40, "--vhat", 0.9, "--defaults", "none")
    for found in (
        by_options,
        aosplan.plan(PlanRequest(**ALTITUDE)),
        aosplan.plan(by_options),
        aosplan.plan(tmp_path / "plan.json"),
        aosplan.plan(str(tmp_path / "request.toml")),
        aosplan.plan(altitude=60, vhat=0.5, request=by_options).__class__(
            **{f.name: getattr(by_options, f.name) for f in fields(by_options)}
        ),
    ):
        assert found.document() == command


def test_options_override_a_request_and_remove_options_that_contradict_them():
    higher = aosplan.plan(PlanRequest(**ALTITUDE), gsd=0.05)
    assert higher.request.vhat == 0.9
    assert higher.request.altitude is None


def test_wrong_options_are_errors_that_name_them():
    with pytest.raises(RequestError, match="unknown option 'altidude'"):
        aosplan.plan(altidude=40)
    with pytest.raises(RequestError, match="--altitude"):
        aosplan.plan(altitude=-3)
    with pytest.raises(RequestError, match="without a location"):
        _ = aosplan.plan(**ALTITUDE).__geo_interface__


def test_results_have_a_short_text_and_html(placed, tmp_path):
    placed.write(tmp_path / "grid.csv")
    results = [
        placed,
        aosplan.tradeoff(placed),
        aosplan.read_scene("paper-forest"),
        aosplan.sweep({"altitude": [40, 50], "vhat": 0.9}),
        aosplan.simulate(placed, forest="noise", precision=0.05),
        aosplan.review(tmp_path / "grid.csv", placed),
        aosplan.thin(tmp_path / "grid.csv", 5, placed),
    ]
    for found in results:
        lines = repr(found).splitlines()
        assert 2 <= len(lines) <= 7
        assert max(map(len, lines)) <= 100
        html = found._repr_html_()
        assert html.startswith("<table>")
        assert escape(lines[0]) in html
        with pytest.raises(AttributeError):  # The class is frozen, so this raises an error.
            found.plan = None
    assert repr(placed.waypoints).startswith("<10 waypoints: east_m, north_m")


def test_html_of_names_from_files_is_escaped(tmp_path):
    scene = 'name = "<b>x</b>"\ndensity = 0.01\noccluder_size_m = 0.2\nvolume_base_m = 2.0\n'
    (tmp_path / "s.toml").write_text(f"{scene}volume_height_m = 9.0\n")
    html = aosplan.plan(altitude=40, scene=str(tmp_path / "s.toml"))._repr_html_()
    assert "&lt;b&gt;" in html
    assert "<b>" not in html


def test_simulate_returns_the_document_of_the_command(document):
    found = aosplan.simulate(**ALTITUDE, forest="noise", seed=3, precision=0.02)
    line = ["--altitude", 40, "--vhat", 0.9, "--seed", 3, "--precision", 0.02]
    assert found.document() == document("simulate", *line, "--forest", "noise")
    assert found.columns()["predicted"][0] == found.predicted.density


def test_a_view_of_the_simulation_is_passed_on():
    found = aosplan.simulate(**ALTITUDE, forest="uniform", view="telecentric", precision=0.05)
    assert found.settings.view == "telecentric"


def test_tradeoff_returns_the_rows_of_the_command(document):
    table = aosplan.tradeoff(**ALTITUDE, max_samples=12)
    line = ["--altitude", 40, "--vhat", 0.9, "--max-samples", 12]
    assert table.document() == document("tradeoff", *line)
    assert table.columns()["samples"] == [row.pattern.samples for row in table.rows]


def test_sweeps_have_the_rows_of_the_command(tmp_path):
    import polars as pl

    (tmp_path / "s.toml").write_text("[sweep]\naltitude = [30, 40, 50]\nvhat = [0.9, 0.95]\n")
    out = tmp_path / "out.parquet"
    assert run(["sweep", str(tmp_path / "s.toml"), "--out", str(out), "--quiet"]) == 0
    written = pl.read_parquet(out)
    for scenarios in (tmp_path / "s.toml", {"altitude": [30, 40, 50], "vhat": [0.9, 0.95]}):
        found = aosplan.sweep(scenarios)
        assert found.frame.equals(written)
        assert found.scenarios == 6
    best = aosplan.sweep({"altitude": [30, 40], "vhat": 0.9}, best="-flight_time_s", columns="all")
    assert best.columns()["altitude"] == [30.0]
    with pytest.raises(RequestError, match="per needs best"):
        aosplan.sweep({"altitude": [30, 40]}, per=["altitude"])
    with pytest.raises(RequestError, match="unknown name 'altidude'"):
        aosplan.sweep({"altidude": [30, 40]})


def test_a_scene_that_was_read_is_planned_without_its_file(tmp_path, document):
    stand = tmp_path / "stand.toml"
    aosplan.read_scene("paper-forest").save(stand)
    found = aosplan.read_scene(stand)
    assert found.document() == document("scene", stand)
    stand.unlink()
    planned = aosplan.plan(**ALTITUDE, scene=found)
    assert planned.request.scene == str(stand)
    assert planned.document()["samples"] == aosplan.plan(**ALTITUDE).document()["samples"]
    simulated = aosplan.simulate(**ALTITUDE, scene=found, forest="noise", precision=0.05)
    assert simulated.agree


def test_flights_are_reviewed_and_thinned_as_by_the_commands(placed, tmp_path, document):
    placed.write(tmp_path / "grid.csv")
    lines = (tmp_path / "grid.csv").read_text().splitlines()
    flown = tmp_path / "flown.csv"
    flown.write_text("\n".join(lines[:8]) + "\n")
    plan = tmp_path / "plan.json"
    plan.write_text(json.dumps(placed.document()))
    found = aosplan.review(flown, placed)
    assert found.document() == document("review", flown, plan)
    assert found.missing == [7, 8, 9]
    # As in the command, `within` limits the time of the top-up. The plan keeps its own limit.
    minutes = found.topup.route.total_time_s / 60.0 - 0.01
    shorter = aosplan.review(flown, placed, within=minutes)
    assert shorter.document() == document("review", flown, plan, "--within", minutes)
    assert 0 < len(shorter.topup.waypoints) < len(found.topup.waypoints)
    assert shorter.missing == found.missing
    assert len(found.columns()["off_m"]) == 7
    thinned = aosplan.thin(flown, 4, plan)
    assert thinned.document() == document("thin", flown, plan, "--samples", 4)
    assert thinned.columns()["index"] == thinned.chosen


def test_exported_plans_and_saved_files_give_the_same_bytes(placed, tmp_path):
    plan, one, other = (tmp_path / name for name in ("plan.json", "a.csv", "b.csv"))
    plan.write_text(json.dumps(placed.document()))
    assert aosplan.export(placed, one) == [str(one)]
    assert aosplan.export(plan, other) == [str(other)]
    assert one.read_bytes() == other.read_bytes()
    with pytest.raises(RequestError, match="exists"):
        aosplan.export(placed, one)


def test_integrate_returns_the_result_of_the_command(tmp_path, document):
    views = list(sites(4))
    images = [photo(*view) for view in views]
    poses, folder = write_recording(tmp_path, views, images, camera=False)
    found = aosplan.integrate(poses, folder, fov_deg=FOV_DEG, extent="all", gsd_m=0.25)
    line = [poses, folder, "--fov", FOV_DEG, "--extent", "all", "--gsd", 0.25]
    said = document("integrate", *line, "--out", tmp_path / "i.png")
    assert list(found.raster.extent_m) == said["extent_m"]
    assert found.views == said["views"] == 4
    assert [each._asdict() for each in found.warnings] == said["warnings"]
    assert repr(found).startswith("Integral of 4 views, ")
    assert found.plot().get_xlabel() == "x [m]"
    assert found.focus is None


def test_integrate_finds_the_same_focus_as_the_command(tmp_path, document):
    views = list(sites(9))
    images = [photo(*view, height=1.0) for view in views]
    poses, folder = write_recording(tmp_path, views, images, camera=False)
    chosen = {"focus": (-2.0, 4.0), "equalize": True, "feather": True, "slope": (0.01, 0.0)}
    found = aosplan.integrate(poses, folder, fov_deg=FOV_DEG, **chosen)
    line = [poses, folder, "--fov", FOV_DEG, "--focus=-2..4", "--equalize", "--feather"]
    said = document("integrate", *line, "--slope", "0.01,0", "--out", tmp_path / "i.png")
    assert found.focus.document() == said["focus"]
    assert [each._asdict() for each in found.warnings] == said["warnings"]
    assert "Focus" in found.summary()[1]
    with pytest.raises(RequestError, match="align needs focus"):
        aosplan.integrate(poses, folder, fov_deg=FOV_DEG, align="yaw")


def test_results_are_frozen_and_can_be_replaced(placed):
    assert replace(placed, notices=()).__class__ is aosplan.Plan


def test_every_function_documents_an_example_or_its_parameters():
    for name in aosplan.__all__:
        function = getattr(aosplan, name)
        if inspect.isfunction(function) and function.__module__.startswith("aosplan.api"):
            assert "Parameters\n" in function.__doc__, name
            assert "Raises\n" in function.__doc__, name
