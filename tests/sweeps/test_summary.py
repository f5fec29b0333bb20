"""The summary of a sweep agrees with the rows in the file, for all ways in which the sweep can be
run.
"""

import contextlib
import io
import json
import math
import os
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from support.campaigns import CAMPAIGN, sweep

from aosplan.cli.schema import json_schema
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.sweeps import aggregate as gather_module
from aosplan.sweeps import grouping as outline_module
from aosplan.sweeps import scenarios as scenarios_module
from aosplan.sweeps import summary as summary_module
from aosplan.sweeps.grouping import grouping
from aosplan.sweeps.scenarios import ScenarioProduct, ScenarioTable, column_of, read_scenarios
from aosplan.sweeps.summary import MEDIAN_ERROR, bins_of, exact_sum, value_of

pl = pytest.importorskip("polars")


def summary(capsys, *arguments):
    capsys.readouterr()
    assert sweep(*arguments, "--summary", "--json") == 0
    return json.loads(capsys.readouterr().out)


def units(values):
    return sum((Fraction(value) for value in values), Fraction(0)) * 2**1074


# Exact sums of parts


@given(st.lists(st.floats(-1e200, 1e200), min_size=1, max_size=50))
def test_sums_are_exact(values):
    assert exact_sum(np.array(values)) == units(values)


@given(st.lists(st.integers(-(2**53), 2**53), min_size=1, max_size=50))
def test_sums_of_whole_numbers_are_exact(values):
    assert exact_sum(np.array(values, dtype=np.int64)) == sum(values) * 2**1074


def test_sums_of_many_numbers_are_exact():
    rng = np.random.default_rng(3)
    values = rng.normal(size=100_000) * 10.0 ** rng.integers(-200, 200, 100_000)
    assert exact_sum(values) == units(values.tolist())


FLOATS = st.floats(-1e300, 1e300, allow_subnormal=False)


@given(FLOATS, FLOATS)
def test_bins_rise_with_their_numbers_and_are_narrow(first, second):
    bins = bins_of(np.array([first, second])).tolist()
    assert (bins[0] <= bins[1]) if first <= second else (bins[0] >= bins[1])
    for value, at in zip((first, second), bins, strict=True):
        assert abs(value_of(at, whole=False) - value) <= MEDIAN_ERROR * abs(value)


def test_each_whole_number_below_512_has_a_separate_bin():
    numbers = np.arange(0.0, 512.0)
    assert [value_of(at, whole=True) for at in bins_of(numbers).tolist()] == numbers.tolist()


@given(
    kinds=st.lists(st.integers(0, 30), min_size=1, max_size=40),
    cut=st.integers(0, 40),
    data=st.data(),
)
def test_reasons_that_are_left_out_never_come_back(kinds, cut, data):
    def of(part, start):
        found = {}
        for place, kind in enumerate(part, start):
            reason = summary_module.Reason(1, place, f"{kind}")
            key = ("invalid", f"kind {kind:02d}")
            found[key] = found[key] + reason if key in found else reason
        kept = dict(sorted(found.items())[: summary_module.MOST_REASONS])
        return summary_module.Summary(len(part), 0, {}, kept, {}, ())

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(summary_module, "MOST_REASONS", 5)
        parts = [of([kind], place) for place, kind in enumerate(kinds)]
        joined = of(kinds[:cut], 0)
        for part in data.draw(st.permutations(parts[cut:])):
            joined = joined.joined(part, most=False)
        assert joined.reasons == of(kinds, 0).reasons


# Comparison with the stored file


OPTIONS = [
    [],
    ["--where", "samples <= 49 AND altitude > 20"],
    ["--where", "status <> 'invalid'", "--best", "visibility_expected"],
    ["--best", "-flight_time_s", "--per", "vhat"],
    ["--columns", "all"],
    ["--columns", "flight_time_s,grid_rows"],
]


@pytest.fixture(scope="module")
def everything(tmp_path_factory):
    """The file of a sweep, and all its rows."""
    folder = tmp_path_factory.mktemp("campaign")
    path, out = folder / "campaign.toml", folder / "all.parquet"
    path.write_text(CAMPAIGN, encoding="utf-8")
    assert sweep(path, "--out", out, "--columns", "all") == 0
    return path, pl.read_parquet(out).with_row_index("row")


@pytest.fixture(scope="module", params=OPTIONS, ids=" ".join)
def stored(request, everything):
    """Options, the summary with these options, all rows, the kept rows, and the kept rows with a
    plan.
    """
    options, (path, frame) = request.param, everything
    kept, said = frame, io.TextIOWrapper(io.BytesIO(), "utf-8")
    if "--where" in options:
        kept = frame.filter(pl.sql_expr(options[options.index("--where") + 1]))
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(said):
        patch.setattr(scenarios_module, "ROWS_A_BLOCK", 30)
        assert sweep(path, *options, "--summary", "--json") == 0
    said.seek(0)
    return options, json.load(said), frame, kept, kept.filter(pl.col("status") == "ok")


def test_a_summary_has_the_numbers_of_the_file(stored):
    _, found, frame, kept, met = stored
    Draft202012Validator(json_schema("sweep")).validate(found)
    assert (found["scenarios"], found["rows"]) == (96, kept.height)
    counts = frame.get_column("status").value_counts()
    assert found["statuses"] == {"ok": 0, "infeasible": 0, "invalid": 0} | dict(counts.iter_rows())
    reasons = frame.filter(pl.col("reason").is_not_null())
    assert sum(reason["count"] for reason in found["reasons"]) == reasons.height
    for reason in found["reasons"]:
        first = reason["first"]
        assert frame["reason"][first["row"] - 1] == first["reason"]
    for name, result in found["results"].items():
        column = met.filter(pl.col(name).is_not_null())
        values = column[name].to_list()
        assert result["count"] == len(values)
        assert result["mean"] == float(sum(map(Fraction, values)) / len(values))
        assert result["mean"] == pytest.approx(column[name].mean(), rel=1e-12)
        places = column[name].arg_min(), column[name].arg_max()
        for extreme, place in zip((result["minimum"], result["maximum"]), places, strict=True):
            row = column.row(place, named=True)
            assert (extreme["value"], extreme["row"]) == (row[name], row["row"] + 1)
            assert type(extreme["value"]) is type(row[name])
            assert extreme["request"] == {key: row[key] for key in extreme["request"]}


def test_inputs_have_the_numbers_of_the_file(stored):
    options, found, frame, kept, met = stored
    objective, best = found["objective"]["column"], found["objective"]["best"]
    if "--best" in options:
        wanted = options[options.index("--best") + 1]
        assert (objective, best) == (wanted.lstrip("-"), "least" if wanted[0] == "-" else "most")
    else:
        assert (objective, best) == ("samples", "least")
    names = [entry["name"] for entry in found["inputs"]]
    assert names == ["altitude", "vhat", "max_aperture", "density"]
    assert found["fixed"] == {"occluder_size": 0.2, "volume_height": 15.0}
    exact = objective == "samples"
    for entry in found["inputs"]:
        name = entry["name"]
        assert [group["value"] for group in entry["groups"]] == sorted(set(frame[name]))
        for group in entry["groups"]:
            own = pl.col(name) == group["value"]
            heights = [part.filter(own).height for part in (frame, kept, met)]
            assert [group["scenarios"], group["rows"], group["met"]] == heights
            assert group["met_share"] == (heights[2] / heights[1] if heights[1] else None)
            values = sorted(met.filter(own)[objective].to_list())
            if not values:
                assert (group["best"], group["approximate_median"]) == (None, None)
                continue
            assert group["best"] == (values[-1] if best == "most" else values[0])
            error = 0.0 if exact else found["objective"]["median_error"]
            median = values[(len(values) - 1) // 2]
            assert abs(group["approximate_median"] - median) <= error * median


def test_extremes_are_those_of_plan(campaign, capsys):
    found = summary(capsys, campaign)
    for extreme in ("minimum", "maximum"):
        named = found["results"]["flight_time_s"][extreme]
        again = plan(PlanRequest(**named["request"])).document()
        assert named["value"] == pytest.approx(again["flight"]["time_s"], rel=1e-12)


TABLE = "altitude,vhat,grid,samples,heading\n" + "".join(
    f"{20 + row % 37},{['98%', '0.9', ''][row % 3]},{['', 'square', 'line'][row // 7 % 3]},"
    f"{['', '64'][row % 2]},{['', 'best', '30', '45'][row % 4]}\n"
    for row in range(300)
)


@pytest.mark.parametrize("kind", ["toml", "csv"])
def test_parts_change_no_byte(tmp_path, capsys, monkeypatch, kind):
    path = tmp_path / f"s.{kind}"
    # The first 84 rows contain all values of the table.
    path.write_text(CAMPAIGN if kind == "toml" else "".join(TABLE.splitlines(True)[:85]))
    found = set()
    for rows in (7, 1 << 18):
        monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", rows)
        assert sweep(path, "--summary", "--json", "--best", "-flight_time_s") == 0
        found.add(capsys.readouterr().out)
    assert len(found) == 1
    Draft202012Validator(json_schema("sweep")).validate(json.loads(found.pop()))


@pytest.mark.slow
def test_text_values_and_missing_values_are_separate_groups(tmp_path, capsys):
    path = tmp_path / "rows.csv"
    path.write_text(TABLE)
    found = summary(capsys, path)
    groups = {entry["name"]: entry["groups"] for entry in found["inputs"]}
    assert [group["value"] for group in groups["grid"]] == [None, "square", "line"]
    assert [group["value"] for group in groups["samples"]] == [64, None]
    assert [group["scenarios"] for group in groups["samples"]] == [150, 150]
    assert [group["value"] for group in groups["heading"]] == [30.0, 45.0, None, "best"]
    # 37 altitudes are too many to have one line each.
    assert len(groups["altitude"]) == 10
    assert (groups["altitude"][0]["first"], groups["altitude"][-1]["last"]) == (20.0, 56.0)
    for parts in groups.values():
        assert sum(group["scenarios"] for group in parts) == 300


def test_inputs_with_many_text_values_are_not_listed_individually(monkeypatch):
    monkeypatch.setattr(outline_module, "MOST_GROUPS", 2)
    groups = grouping(ScenarioTable({"scene": column_of(["a", "b", "c", "a"])})).groups[0]
    assert groups.labels() == [{"value": "a"}, {"value": "b"}, {"others": True}]
    assert groups.places(column_of(["c", "b", "a", "c"])).tolist() == [2, 1, 0, 2]


@given(st.sets(st.floats(1.0, 1e6), min_size=2, max_size=60))
def test_every_number_is_within_its_bin(values):
    groups = grouping(ScenarioProduct({"altitude": column_of(sorted(values))})).groups[0]
    assert len(groups.numbers) == (len(values) if len(values) <= 20 else 10)
    for value, place in zip(values, groups.places(np.array([*values])).tolist(), strict=True):
        low, high = groups.numbers[place]
        assert low <= value <= high


@pytest.mark.parametrize(
    ("optimize", "column", "best"),
    [("time", "flight_time_s", "least"), ("contrast", "visibility_contrast", "most")],
)
def test_the_objective_is_what_the_sweep_optimises(tmp_path, capsys, optimize, column, best):
    path = tmp_path / "s.toml"
    path.write_text(
        f"[sweep]\naltitude = [40, 50]\nvhat = 0.8\nmax_samples = 9\noptimize = '{optimize}'\n"
    )
    objective = summary(capsys, path)["objective"]
    assert (objective["column"], objective["best"]) == (column, best)


# Interruption


def interrupted_after(monkeypatch, parts, seen):
    from aosplan.sweeps import run as run_module

    solve = run_module.solve_part

    def solve_part(sweep, index, path):
        if len(seen) == parts:
            raise KeyboardInterrupt
        seen.append(index)
        return solve(sweep, index, path)

    monkeypatch.setattr(run_module, "solve_part", solve_part)


@pytest.mark.slow
@pytest.mark.parametrize(
    "out",
    [
        pytest.param([], id="no file", marks=pytest.mark.slow),
        pytest.param(["--out", "r.csv"], id="file"),
    ],
)
@pytest.mark.parametrize("every_s", [0.0, pytest.param(1e9, marks=pytest.mark.slow)])
def test_interruptions_change_no_byte(campaign, tmp_path, capsys, monkeypatch, out, every_s):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", 30)
    monkeypatch.setattr(gather_module, "EVERY_S", every_s)
    line = [campaign.name, "--summary", "--json", "--simulate", 1, "--precision", 0.2]
    assert sweep(*line) == 0
    whole = capsys.readouterr().out
    assert os.listdir() == [campaign.name]
    seen = []
    with monkeypatch.context() as patch:
        interrupted_after(patch, 3, seen)
        assert sweep(*line, *out) == 130
        assert "--resume continues" in capsys.readouterr().err
        # The result exists, and neither --resume nor --force is given.
        assert sweep(*line, *out) == 2
        assert "--force starts again" in capsys.readouterr().err
        assert sweep(*line, *out, "--resume", "--where", "samples < 9") == 2
        assert "another sweep" in capsys.readouterr().err
    again = []
    with monkeypatch.context() as patch:
        interrupted_after(patch, 1000, again)
        assert sweep(*line, *out, "--resume") == 0
    assert not set(again) & set(seen)
    assert len(again) + len(seen) == read_scenarios(campaign.name).blocks
    assert capsys.readouterr().out == whole
    assert sorted(os.listdir()) == sorted([campaign.name, *out[1:]])


@pytest.mark.slow
def test_resuming_an_interrupted_simulation_solves_no_scenario_again(
    campaign, tmp_path, capsys, monkeypatch
):
    from aosplan.sweeps import verify

    line = [campaign, "--json", "--simulate", 1, "--precision", 0.2]
    assert sweep(*line) == 0
    whole = capsys.readouterr().out
    with monkeypatch.context() as patch:
        patch.setattr(verify, "verify", lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt))
        assert sweep(*line) == 130
    seen = []
    interrupted_after(monkeypatch, 0, seen)
    assert sweep(*line, "--resume") == 0
    assert capsys.readouterr().out == whole
    assert os.listdir(tmp_path) == [campaign.name]


@pytest.mark.parametrize("content", ["", "{}", "[1]", '{"fingerprint": 1, "done": 3}'])
def test_files_of_other_programs_are_neither_read_nor_overwritten(
    campaign, tmp_path, capsys, content
):
    place = tmp_path / "campaign.toml.gathered"
    place.write_text(content)
    assert sweep(campaign, "--summary", "--resume") == 2
    assert "another sweep" in capsys.readouterr().err
    assert place.read_text() == content
    assert sweep(campaign, "--summary", "--force", "--quiet") == 0
    assert not place.exists()


@pytest.mark.slow
def test_workers_change_no_byte(tmp_path):
    path = tmp_path / "many.toml"
    path.write_text(
        "[sweep]\naltitude = { start = 45, stop = 120, count = 150000 }\nvhat = [0.9, 0.98]\n"
    )
    found = []
    for workers in (1, 2):
        command = [
            "sweep",
            path,
            "--summary",
            "--json",
            "--workers",
            workers,
            "--where",
            "samples < 20 OR altitude > 100",
        ]
        done = subprocess.run(
            [sys.executable, "-m", "aosplan", *map(str, command)],
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        found.append(done.stdout)
    assert found[0] == found[1]
    assert json.loads(found[0])["rows"] == 150_000 + 40_000


# Printed summary


def test_tables_fit_80_columns(campaign, tmp_path, capsys):
    assert sweep(campaign, "--summary", "--columns", "all", "--where", "altitude > 10") == 0
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 80
    assert "96 scenarios; 80 kept by --where altitude > 10" in out
    for word in (
        "met",
        "infeasible",
        "best samples",
        "median (approx.)",
        "every row: occluder_size",
    ):
        assert word in out
    assert os.listdir(tmp_path) == [campaign.name]
    assert sweep(campaign, "--summary", "--quiet") == 0
    assert capsys.readouterr().out == ""


def test_a_sweep_without_any_plan_has_a_summary(tmp_path, capsys):
    path = tmp_path / "s.toml"
    path.write_text("[sweep]\naltitude = [5, 6]\n")
    found = summary(capsys, path)
    Draft202012Validator(json_schema("sweep")).validate(found)
    assert found["statuses"]["invalid"] == 2
    assert found["results"]["samples"] == {
        "count": 0,
        "mean": None,
        "minimum": None,
        "maximum": None,
    }
    assert sweep(path, "--summary") == 0


def test_the_summary_marks_rows_that_are_only_evaluated(tmp_path, capsys):
    path = tmp_path / "s.toml"
    path.write_text("[sweep]\naltitude = 40\nsamples = [2, 3]\nbaseline = 1\n")
    assert sweep(path, "--summary") == 0
    assert "every row counts as feasible" in capsys.readouterr().out
    path.write_text("[sweep]\naltitude = 40\nsamples = [60, 70]\n")
    assert sweep(path, "--summary") == 0
    assert "whatever" not in capsys.readouterr().out


def test_a_sweep_without_any_kept_row_has_a_summary(campaign, capsys):
    found = summary(capsys, campaign, "--where", "samples < 0")
    assert found["rows"] == 0
    assert found["inputs"][0]["groups"][0]["met_share"] is None
    assert sweep(campaign, "--summary", "--where", "samples < 0") == 0
    assert "-" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([], ["no output is given", "--summary"]),
        (["--json", "--out", "r.csv"], ["--json needs --summary"]),
        (["--summary", "--where", "sampels < 1"], ["sampels", "the columns are"]),
        (["--summary", "--seed", "3"], ["--seed needs --simulate"]),
        (["--simulate", "0"], ["--simulate '0'"]),
        (["--simulate", "2.5"], ["--simulate '2.5'"]),
        (["--simulate", "1000000"], ["--simulate 1000000", "10000"]),
        (["--simulate", "3", "--seed", "-1"], ["--seed -1"]),
        (["--simulate", "3", "--precision", "0"], ["--precision '0'"]),
    ],
)
def test_wrong_options_are_errors(campaign, tmp_path, capsys, monkeypatch, options, words):
    monkeypatch.chdir(tmp_path)
    assert sweep(campaign, *options) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert all(word in error for word in words), error
    assert os.listdir() == [campaign.name]


def test_means_do_not_accumulate_rounding_errors():
    column = summary_module.ResultSummary()
    for value in [1e16, 1.0, -1e16, math.pi]:
        found = exact_sum(np.array([value]))
        column = column + summary_module.ResultSummary(1, found, (value, 0), (value, 0))
    assert column.mean == float((Fraction(1) + Fraction(math.pi)) / 4)
