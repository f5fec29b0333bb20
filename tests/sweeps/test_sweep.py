"""Each row of a sweep has the same numbers as `plan`, and the bytes do not depend on the way in
which the sweep is run.
"""

import json
import math
import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.campaigns import sweep
from support.sweeps import results_of

from aosplan.errors import AosplanError
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.sweeps import scenarios as scenarios_module
from aosplan.sweeps.scenarios import ScenarioProduct, column_of, read_scenarios

pl = pytest.importorskip("polars")


@given(sizes=st.lists(st.integers(1, 7), min_size=1, max_size=4), room=st.integers(1, 20))
def test_blocks_are_all_scenarios_once_and_in_order(sizes, room):
    earlier, scenarios_module.ROWS_A_BLOCK = scenarios_module.ROWS_A_BLOCK, room
    try:
        names = ["altitude", "vhat", "density", "coverage"]
        crossing = ScenarioProduct(
            {
                name: column_of([float(value) for value in range(size)])
                for name, size in zip(names, sizes, strict=False)
            }
        )
        blocks = [crossing.block(index) for index in range(crossing.blocks)]
        assert all(block.rows <= room for block in blocks)
        assert [block.start for block in blocks] == [
            sum(block.rows for block in blocks[:index]) for index in range(len(blocks))
        ]
        for axis, name in enumerate(crossing.names):
            column = np.concatenate([block.flat(name) for block in blocks])
            whole = np.indices(sizes)[axis].reshape(-1)
            assert column.tolist() == whole.tolist()
    finally:
        scenarios_module.ROWS_A_BLOCK = earlier


# Files


def test_rows_are_crossed_in_the_order_written_with_the_last_fastest(campaign, tmp_path):
    out = tmp_path / "r.csv"
    assert sweep(campaign, "--out", out) == 0
    frame = pl.read_csv(out)
    assert frame.height == 6 * 2 * 2 * 4
    assert frame["altitude"].to_list() == [10.0 + 22 * (row // 16) for row in range(96)]
    assert frame["max_aperture"].to_list()[:8] == [8.0] * 4 + [40.0] * 4
    assert frame["density"][:4].to_list() == pytest.approx(
        [0.001 * 20 ** (step / 3) for step in range(4)]
    )
    assert set(frame["status"]) == {"ok", "infeasible", "invalid"}
    for row in frame[::5].iter_rows(named=True):  # These rows contain every value of every input.
        inputs = {name: row[name] for name in frame.columns[:6]}
        if row["status"] != "ok":
            with pytest.raises(AosplanError) as caught:
                plan(PlanRequest(**inputs))
            assert (row["reason"], row["samples"]) == (caught.value.message, None)
            continue
        expected = results_of(plan(PlanRequest(**inputs)))
        assert row["reason"] is None
        for name in ("samples", "baseline_m", "visibility_expected", "flight_time_s"):
            assert row[name] == pytest.approx(expected[name], rel=1e-12)


def test_the_best_rows_are_the_best(campaign, tmp_path, small_blocks):
    every, best = tmp_path / "every.csv", tmp_path / "best.csv"
    assert sweep(campaign, "--out", every) == 0
    assert (
        sweep(campaign, "--out", best, "--best", "visibility_expected", "--per", "altitude,vhat")
        == 0
    )
    rows = [
        row
        for row in pl.read_csv(every, infer_schema_length=None).to_dicts()
        if row["status"] == "ok"
    ]
    kept = pl.read_csv(best, infer_schema_length=None).to_dicts()
    groups = {(row["altitude"], row["vhat"]) for row in rows}
    assert len(kept) == len(groups)
    for row in kept:
        group = [r for r in rows if (r["altitude"], r["vhat"]) == (row["altitude"], row["vhat"])]
        assert row == max(group, key=lambda r: r["visibility_expected"])


def test_a_table_is_a_scenario_a_row(tmp_path):
    path, out = tmp_path / "rows.csv", tmp_path / "r.jsonl"
    path.write_text("altitude,vhat,grid,samples\n40,0.9,,\n50,98%,square,\n60,0.9,,64\n10,,,\n")
    assert sweep(path, "--out", out) == 0
    rows = [json.loads(line) for line in out.read_text().splitlines()]
    assert [row["samples"] for row in rows] == [10, 64, 64, None]
    assert [row["request_samples"] for row in rows] == [None, None, 64, None]
    assert [row["status"] for row in rows] == ["ok", "ok", "ok", "invalid"]
    # A Parquet file with the same rows gives the same result.
    frame = pl.DataFrame(
        {
            "altitude": [40.0, 50, 60, 10],
            "vhat": ["0.9", "98%", "0.9", None],
            "grid": [None, "square", None, None],
            "samples": [None, None, 64, None],
        }
    )
    frame.write_parquet(tmp_path / "rows.parquet")
    assert sweep(tmp_path / "rows.parquet", "--out", tmp_path / "p.jsonl") == 0
    assert (tmp_path / "p.jsonl").read_bytes() == out.read_bytes()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("[sweep]\naltitud = 40\n", ["unknown name 'altitud'", "altitude"]),
        ("[sweep]\naltitude = []\n", ["altitude has no values"]),
        ("[sweep]\naltitude = [40, 'x']\n", ["altitude 'x'"]),
        ("[sweep]\naltitude = { start = 1, stop = 2 }\n", ["lacks count"]),
        ("[sweep]\naltitude = { start = 0, stop = 2, count = 3, spacing = 'log' }\n", ["logarithmic"]),
        ("[sweep]\naltitude = { start = 1, stop = 2, count = 3, step = 1 }\n", ["'step'"]),
        ("[sweep]\naltitude = { start = 1, stop = 2, count = 1e12 }\n", ["count 1000000000000"]),
        ("[sweep]\naltitude = { file = 'none.txt' }\n", ["no file"]),
        ("altitude = 40\n", ["no table [sweep]"]),
        ("[sweep]\naltitude = { start = 20, stop = 90, count = 10000 }\n"
         "vhat = { start = 0.1, stop = 0.9, count = 10000 }\n"
         "max_aperture = { start = 1, stop = 9, count = 10000 }\n", ["1000000000000 scenarios", "--where", "--yes"]),
    ],
)  # fmt: skip
def test_wrong_sweeps_are_errors(tmp_path, capsys, content, words):
    path = tmp_path / "s.toml"
    path.write_text(content, encoding="utf-8")
    assert sweep(path, "--out", tmp_path / "r.csv") == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert all(word in error for word in words), error
    assert os.listdir(tmp_path) == ["s.toml"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("altitude,samples\n40,10\n50,6x4\n", ["column 'samples'", "6x4", "row 2"]),
        ("altitude,sample\n40,10\n", ["'sample'", "samples"]),
        ("altitude\n", ["no rows"]),
        ("", ["not a table"]),
    ],
)
def test_wrong_tables_are_errors(tmp_path, capsys, content, words):
    path = tmp_path / "rows.csv"
    path.write_text(content, encoding="utf-8")
    assert sweep(path, "--out", tmp_path / "r.csv") == 2
    error = capsys.readouterr().err
    assert all(word in error for word in words), error


def test_a_parquet_from_elsewhere_is_an_error(tmp_path, capsys):
    path = tmp_path / "rows.parquet"
    path.write_bytes(b"PAR1 not really")
    assert sweep(path, "--out", tmp_path / "r.csv") == 2
    assert "not a table of scenarios" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("where", "met"),
    [
        ("reason LIKE '%max(%' OR samples > 10", True),
        ('"samples" > 10 AND ABS(samples) > 1', True),
        ("reason = 'it''s over'", False),
    ],
)
def test_conditions_of_single_rows_are_taken(campaign, tmp_path, where, met):
    out = tmp_path / "r.csv"
    assert sweep(campaign, "--out", out, "--where", where) == 0
    assert (len(out.read_text().splitlines()) > 1) == met


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--where", "sampels < 3"], ["sampels", "columns: "]),
        (["--where", "samples"], ["--where samples"]),
        (["--where", "GREATEST() > 1"], ["--where GREATEST() > 1"]),
        (["--where", "samples = MAX(samples)"], ["MAX needs several rows", "--best"]),
        (["--where", "samples > avg (samples)"], ["AVG needs several rows"]),
        (["--where", "SUM(samples) OVER (PARTITION BY altitude) < 3"], ["SUM needs several rows"]),
        (["--best", "samplse"], ["samplse", "samples"]),
        (["--best", "status"], ["--best status", "text"]),
        (["--best", "-reason"], ["--best -reason", "text"]),
        (["--per", "altitude"], ["--per needs --best"]),
        (["--columns", "samples,foo"], ["'foo'"]),
        (["--workers", "0"], ["--workers '0'"]),
    ],
)
def test_wrong_conditions_are_errors_before_anything_is_solved(
    campaign, tmp_path, capsys, arguments, words
):
    assert sweep(campaign, "--out", tmp_path / "r.csv", *arguments) == 2
    error = capsys.readouterr().err
    assert all(word in error for word in words), error
    assert os.listdir(tmp_path) == [campaign.name]


@pytest.mark.parametrize(
    ("ending", "best"),
    [
        ("csv", []),
        ("csv", ["--best", "samples", "--per", "vhat"]),
        ("parquet", []),
        ("jsonl", []),
        ("parquet/", []),
    ],
)
def test_file_names_with_brackets_are_not_patterns(tmp_path, small_blocks, ending, best):
    for folder, altitude in (("g[1]", 40), ("g1", 99)):
        (tmp_path / folder).mkdir()
        rows = "".join(f"{altitude},{0.5 + 0.01 * row}\n" for row in range(40))
        (tmp_path / folder / "t[2].csv").write_text(f"altitude,vhat\n{rows}")
        (tmp_path / folder / "t2.csv").write_text(f"altitude,vhat\n{rows.replace('40', '99')}")
    folder = tmp_path / "g[1]"
    line = [folder / "t[2].csv", "--columns", "altitude_m,flight_time_s,samples", *best]
    for name in (f"r[3].{ending}", f"r3.{ending}"):
        figure = [] if best else ["--plot", folder / f"{name.rstrip('/')}.svg"]
        assert sweep(*line, "--out", f"{folder}/{name}", *figure) == 0
    if not best:
        one, other = (folder / f"{name}.{ending.rstrip('/')}.svg" for name in ("r[3]", "r3"))
        assert one.read_bytes() == other.read_bytes()
    frame = pl.read_csv(folder / f"r3.{ending}", glob=False) if ending == "csv" else None
    assert frame is None or set(frame["altitude_m"]) == {40.0}


def test_names_of_files_write_no_escape_sequences(campaign, tmp_path, capsys):
    out, figure = tmp_path / "r\x1b[31m.csv", tmp_path / "f\x1b[31m.svg"
    assert sweep(campaign, "--out", out, "--plot", figure) == 0
    told = capsys.readouterr().out
    assert "\x1b" not in told
    assert "r?[31m.csv: " in told
    assert "f?[31m.svg" in told


def test_a_result_named_twice_gives_one_column(campaign, tmp_path):
    out = tmp_path / "r.csv"
    assert sweep(campaign, "--out", out, "--columns", "samples,baseline_m,samples") == 0
    assert pl.read_csv(out).columns[-4:] == ["samples", "baseline_m", "status", "reason"]


def test_a_file_of_values_is_found_in_the_folder_of_its_sweep_file(tmp_path):
    (tmp_path / "altitudes.txt").write_text("40\n\n50 m\n")
    path = tmp_path / "s.toml"
    path.write_text("[sweep]\naltitude = { file = 'altitudes.txt' }\n")
    assert read_scenarios(str(path)).values["altitude"].tolist() == [40.0, 50.0]


def test_numbers_that_a_plan_does_not_have_are_nan():
    clear = PlanRequest(altitude=40, integrated_density=0, occluder_size=1, volume_height=9)
    assert math.isnan(results_of(plan(clear))["visibility_normalized"])


def test_a_stand_is_read_once_and_its_correlogram_made_once(tmp_path, monkeypatch):
    from support.forests import STANDS, clumped_forest

    from aosplan.scenes import correlogram as correlogram_module
    from aosplan.scenes.files.voxel_file import VoxelStand, stand_npz
    from aosplan.sweeps import solve_rows as rows

    volume = clumped_forest(STANDS["beech"], side_m=12.0, voxel_m=0.5)
    (tmp_path / "stand.npz").write_bytes(stand_npz(VoxelStand.of(volume)))
    (tmp_path / "s.toml").write_text(
        "[sweep]\nscene = 'stand.npz'\naltitude = [40, 60]\nsamples = [4, 9]\nvhat = 0.3\n"
    )
    rows.forget_scenes()
    read, made = [], []
    load_scene, correlogram = rows.load_scene, correlogram_module.correlogram
    monkeypatch.setattr(rows, "load_scene", lambda *a, **k: read.append(a) or load_scene(*a, **k))
    monkeypatch.setattr(
        correlogram_module, "correlogram", lambda *a, **k: made.append(a) or correlogram(*a, **k)
    )
    out = tmp_path / "r.jsonl"
    assert sweep(tmp_path / "s.toml", "--out", out) == 0
    assert (len(read), len(made)) == (1, 1)
    for line in out.read_text().splitlines():
        row = json.loads(line)
        inputs = {"altitude": row["altitude"], "samples": row["request_samples"], "vhat": 0.3}
        expected = results_of(plan(PlanRequest(scene=str(tmp_path / "stand.npz"), **inputs)))
        assert row["visibility_expected"] == pytest.approx(expected["visibility_expected"])
