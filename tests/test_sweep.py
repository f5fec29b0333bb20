"""Sweeps: the same numbers as plan, row by row; the same bytes however they were run."""

import json
import math
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from campaigns import CAMPAIGN, sweep
from hypothesis import given
from hypothesis import strategies as st
from sweeps import results_of

from aosplan.errors import AosplanError
from aosplan.planning import plan
from aosplan.request import PlanRequest
from aosplan.sweep import scenarios as scenarios_module
from aosplan.sweep.scenarios import Crossing, column_of, read_scenarios

pl = pytest.importorskip("polars")


@given(sizes=st.lists(st.integers(1, 7), min_size=1, max_size=4), room=st.integers(1, 20))
def test_blocks_are_all_scenarios_once_and_in_order(sizes, room):
    earlier, scenarios_module.ROWS_A_BLOCK = scenarios_module.ROWS_A_BLOCK, room
    try:
        names = ["altitude", "vhat", "density", "coverage"]
        crossing = Crossing(
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


@pytest.fixture
def small_blocks(monkeypatch):
    monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", 30)


def test_rows_are_crossed_in_the_order_written_with_the_last_fastest(campaign, tmp_path):
    out = tmp_path / "r.csv"
    assert sweep(campaign, "--out", out) == 0
    frame = pl.read_csv(out)
    assert frame.height == 12 * 2 * 2 * 4
    assert frame["altitude"].to_list() == [10.0 + 10 * (row // 16) for row in range(192)]
    assert frame["max_aperture"].to_list()[:8] == [8.0] * 4 + [40.0] * 4
    assert frame["density"][:4].to_list() == pytest.approx(
        [0.001 * 20 ** (step / 3) for step in range(4)]
    )
    assert set(frame["status"]) == {"ok", "infeasible", "invalid"}
    for row in frame.iter_rows(named=True):
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


@pytest.mark.parametrize("suffix", ["csv", "parquet", "jsonl"])
@pytest.mark.parametrize("conditions", [[], ["--best", "-flight_time_s", "--per", "altitude"]])
def test_interruptions_change_no_byte(
    campaign, tmp_path, small_blocks, monkeypatch, suffix, conditions
):
    from aosplan.sweep import run as run_module

    whole, broken = tmp_path / f"whole.{suffix}", tmp_path / f"broken.{suffix}"
    assert sweep(campaign, "--out", whole, *conditions) == 0
    solved = []
    solve = run_module.solve_part

    def interrupted(sweep, index, path):
        if len(solved) == 3:
            raise KeyboardInterrupt
        solved.append(index)
        return solve(sweep, index, path)

    monkeypatch.setattr(run_module, "solve_part", interrupted)
    assert sweep(campaign, "--out", broken, *conditions) == 130
    assert not broken.exists()
    assert sweep(campaign, "--out", broken, *conditions) == 2  # neither resumed nor forced
    again = []

    def counted(sweep, index, path):
        again.append(index)
        return solve(sweep, index, path)

    monkeypatch.setattr(run_module, "solve_part", counted)
    assert sweep(campaign, "--out", broken, "--resume", *conditions) == 0
    assert not set(again) & set(solved)
    assert broken.read_bytes() == whole.read_bytes()
    assert sorted(os.listdir(tmp_path)) == sorted([whole.name, broken.name, campaign.name])


def test_a_damaged_part_is_solved_again(campaign, tmp_path, small_blocks, monkeypatch):
    from aosplan.sweep import run as run_module

    whole, broken = tmp_path / "whole.csv", tmp_path / "broken.csv"
    assert sweep(campaign, "--out", whole) == 0

    def full(*_):
        raise OSError(28, "No space left on device", str(broken))

    monkeypatch.setattr(run_module.Parts, "join", full)
    assert sweep(campaign, "--out", broken) == 1
    monkeypatch.undo()
    monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", 30)
    part = tmp_path / "broken.csv.parts" / "00000002.csv"
    part.write_bytes(part.read_bytes()[:100])
    assert sweep(campaign, "--out", broken, "--resume") == 0
    assert broken.read_bytes() == whole.read_bytes()


@pytest.mark.parametrize("line", ['{"part": 7}', "5", '{"part": "a"}', "[]", '{"x": 1}', "\x00"])
def test_a_damaged_journal_is_passed_over_or_refused(
    campaign, tmp_path, small_blocks, monkeypatch, capsys, line
):
    from aosplan.sweep import run as run_module

    out = tmp_path / "r.csv"
    monkeypatch.setattr(
        run_module.Parts, "join", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt)
    )
    assert sweep(campaign, "--out", out) == 130
    journal = tmp_path / "r.csv.parts" / "journal.jsonl"
    whole = journal.read_text()
    journal.write_text(f"{line}\n{whole}")
    monkeypatch.undo()
    monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", 30)
    if line != "\x00":
        assert sweep(campaign, "--out", out, "--resume") == 2
        assert "parts of another sweep" in capsys.readouterr().err
    journal.write_text(f"{whole}{line}\n")
    assert sweep(campaign, "--out", out, "--resume") == 0


def test_a_file_that_came_while_a_sweep_ran_stays(campaign, tmp_path, monkeypatch, capsys):
    from aosplan.sweep import run as run_module

    solve, out = run_module.solve_part, tmp_path / "r.csv"

    def other(*arguments):
        out.write_text("another's")
        return solve(*arguments)

    monkeypatch.setattr(run_module, "solve_part", other)
    assert sweep(campaign, "--out", out) == 2
    assert "exists" in capsys.readouterr().err
    assert out.read_text() == "another's"
    monkeypatch.undo()
    assert sweep(campaign, "--out", out, "--resume", "--force") == 0
    assert sorted(os.listdir(tmp_path)) == [campaign.name, "r.csv"]


def test_another_sweep_is_not_resumed(campaign, tmp_path, monkeypatch, capsys):
    from aosplan.sweep import run as run_module

    monkeypatch.setattr(
        run_module, "solve_part", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt)
    )
    out = tmp_path / "r.csv"
    assert sweep(campaign, "--out", out) == 130
    monkeypatch.undo()
    campaign.write_text(CAMPAIGN.replace("0.2", "0.3"), encoding="utf-8")
    assert sweep(campaign, "--out", out, "--resume") == 2
    assert "parts of another sweep" in capsys.readouterr().err
    assert sweep(campaign, "--out", out, "--force") == 0


def test_a_sweep_of_files_that_have_changed_is_not_resumed(
    tmp_path, small_blocks, monkeypatch, capsys
):
    from aosplan.sweep import run as run_module

    scene, path, out = tmp_path / "stand.toml", tmp_path / "s.toml", tmp_path / "r.csv"
    text = 'name = "stand"\nintegrated_density = 0.4\noccluder_size_m = 1.0\nvolume_base_m = 2.0\n'
    scene.write_text(f"{text}volume_height_m = 10.0\n", encoding="utf-8")
    path.write_text('[sweep]\naltitude = [40, 50]\nscene = "stand.toml"\n', encoding="utf-8")

    def full(*_):
        raise OSError(28, "No space left on device", str(out))

    monkeypatch.setattr(run_module.Parts, "join", full)
    assert sweep(path, "--out", out) == 1
    monkeypatch.undo()
    scene.write_text(f"{text}volume_height_m = 12.0\n", encoding="utf-8")
    assert sweep(path, "--out", out, "--resume") == 2
    assert "parts of another sweep" in capsys.readouterr().err
    scene.write_text(f"{text}volume_height_m = 10.0\n", encoding="utf-8")
    assert sweep(path, "--out", out, "--resume") == 0
    assert set(pl.read_csv(out)["status"]) == {"ok"}


@pytest.mark.slow
def test_workers_change_no_byte(tmp_path):
    # In a process of its own: workers are started anew and import the main module.
    many = tmp_path / "many.toml"
    many.write_text(
        "[sweep]\naltitude = { start = 45, stop = 120, count = 300000 }\nvhat = [0.9, 0.98]\n"
    )
    files = []
    for workers in (1, 2):
        out = tmp_path / f"{workers}.csv"
        command = ["sweep", many, "--out", out, "--workers", workers, "--where", "altitude > 119"]
        done = subprocess.run(
            [sys.executable, "-m", "aosplan", *map(str, command)],
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        files.append(out.read_bytes())
    assert files[0] == files[1]
    assert files[0].count(b"\n") == 1 + 2 * 4000


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_an_interruption_of_the_first_process_alone_ends_its_workers(tmp_path):
    # A terminal interrupts every process of a line; a job's manager only the first.
    status, error = ended(tmp_path, lambda pid: os.kill(pid, signal.SIGINT))
    assert status == 130
    assert error == "hint: what is done is kept; --resume goes on with it\n"


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_waits_end_when_they_are_interrupted(campaign, tmp_path):
    # The columnar library's handler has them go on.
    code = (
        "import os, signal, threading\nfrom aosplan.cli.app import run\n"
        f"assert run(['sweep', {str(campaign)!r}, '--out', {str(tmp_path / 'r.csv')!r}]) == 0\n"
        "threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
        "try:\n    threading.Event().wait()\nexcept KeyboardInterrupt:\n    os._exit(7)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], timeout=60, check=False)
    assert done.returncode == 7


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_termination_leaves_whole_parts_alone(tmp_path):
    assert ended(tmp_path, lambda pid: os.kill(pid, signal.SIGTERM)) == (143, "")
    names = os.listdir(tmp_path / "r.csv.parts")
    assert "journal.jsonl" in names
    assert not [name for name in names if name.endswith(".tmp")]


@pytest.mark.skipif(sys.platform != "linux", reason="finds the workers in /proc")
def test_a_worker_that_dies_is_an_error(tmp_path):
    def kill_workers(pid):
        with open(f"/proc/{pid}/task/{pid}/children", encoding="ascii") as children:
            for child in children.read().split():
                with open(f"/proc/{child}/cmdline", encoding="utf-8") as line:
                    if "spawn_main" in line.read():
                        os.kill(int(child), signal.SIGKILL)

    status, error = ended(tmp_path, kill_workers)
    assert status == 1
    assert error.startswith("error: a worker process died")
    assert "--resume" in error
    assert error.count("\n") == 2


def ended(folder, act):
    """How a long sweep with two workers ends when something happens to it, and what it says."""
    path, out = folder / "s.toml", folder / "r.csv"
    path.write_text(
        "[sweep]\nspeed = { start = 1, stop = 9, count = 5000 }\n"
        "vhat = { start = 0.5, stop = 0.99, count = 30 }\n"
        "altitude = { start = 30, stop = 90, count = 5000 }\n"
    )
    command = ["sweep", path, "--out", out, "--workers", 2, "--where", "altitude < 0"]
    with subprocess.Popen(
        [sys.executable, "-m", "aosplan", *map(str, command)],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            journal = folder / "r.csv.parts" / "journal.jsonl"
            while not journal.exists() or journal.read_bytes().count(b"\n") < 2:
                assert process.poll() is None
                time.sleep(0.05)
            act(process.pid)
            error = process.communicate(timeout=60)[1]  # stderr ends with the last process
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            raise
    return process.returncode, error


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
    # A Parquet with the same rows gives the same.
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
        ("[sweep]\naltitude = { start = 20, stop = 90, count = 1000000 }\n"
         "vhat = { start = 0.1, stop = 0.9, count = 1000000 }\n", ["1000000000000 scenarios", "--where", "--yes"]),
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
        ("", ["no table"]),
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
    assert "no table of scenarios" in capsys.readouterr().err


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
        (["--where", "samples = MAX(samples)"], ["MAX looks at several rows", "--best"]),
        (["--where", "samples > avg (samples)"], ["AVG looks at several rows"]),
        (["--where", "SUM(samples) OVER (PARTITION BY altitude) < 3"], ["SUM looks at"]),
        (["--best", "samplse"], ["samplse", "samples"]),
        (["--best", "status"], ["--best status", "words"]),
        (["--best", "-reason"], ["--best -reason", "words"]),
        (["--per", "altitude"], ["--per without --best"]),
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
def test_names_with_brackets_are_no_patterns(tmp_path, small_blocks, ending, best):
    for folder, altitude in (("g[1]", 40), ("g1", 99)):
        (tmp_path / folder).mkdir()
        rows = "".join(f"{altitude},{0.5 + 0.01 * row}\n" for row in range(40))
        (tmp_path / folder / "t[2].csv").write_text(f"altitude,vhat\n{rows}")
        (tmp_path / folder / "t2.csv").write_text(f"altitude,vhat\n{rows.replace('40', '99')}")
    folder = tmp_path / "g[1]"
    line = [folder / "t[2].csv", "--columns", "altitude_m,flight_time_s,samples", *best]
    for name in (f"r[3].{ending}", f"r3.{ending}"):
        figure = ["--plot", folder / f"{name.rstrip('/')}.svg"]
        assert sweep(*line, "--out", f"{folder}/{name}", *figure) == 0
    drawn = [(folder / f"{name}.{ending.rstrip('/')}.svg").read_bytes() for name in ("r[3]", "r3")]
    assert drawn[0] == drawn[1]
    frame = pl.read_csv(folder / f"r3.{ending}", glob=False) if ending == "csv" else None
    assert frame is None or set(frame["altitude_m"]) == {40.0}


def test_names_of_files_write_no_escape_sequences(campaign, tmp_path, capsys):
    out, figure = tmp_path / "r\x1b[31m.csv", tmp_path / "f\x1b[31m.svg"
    assert sweep(campaign, "--out", out, "--plot", figure) == 0
    told = capsys.readouterr().out
    assert "\x1b" not in told
    assert "r?[31m.csv: " in told
    assert "f?[31m.svg" in told


def test_a_result_that_is_named_twice_is_one_column(campaign, tmp_path):
    out = tmp_path / "r.csv"
    assert sweep(campaign, "--out", out, "--columns", "samples,baseline_m,samples") == 0
    assert pl.read_csv(out).columns[-4:] == ["samples", "baseline_m", "status", "reason"]


def test_values_of_a_file_are_read_beside_it(tmp_path):
    (tmp_path / "altitudes.txt").write_text("40\n\n50 m\n")
    path = tmp_path / "s.toml"
    path.write_text("[sweep]\naltitude = { file = 'altitudes.txt' }\n")
    assert read_scenarios(str(path)).values["altitude"].tolist() == [40.0, 50.0]


def test_numbers_that_a_plan_does_not_have_are_nan():
    clear = PlanRequest(altitude=40, integrated_density=0, occluder_size=1, volume_height=9)
    assert math.isnan(results_of(plan(clear))["visibility_normalized"])


def test_a_stand_is_read_once_and_its_correlogram_made_once(tmp_path, monkeypatch):
    from forests import STANDS, clumped_forest

    from aosplan.models import correlogram as correlogram_module
    from aosplan.sweep import rows
    from aosplan.voxel_file import Stand, stand_npz

    volume = clumped_forest(STANDS["beech"], side_m=12.0, voxel_m=0.5)
    (tmp_path / "stand.npz").write_bytes(stand_npz(Stand.of(volume)))
    (tmp_path / "s.toml").write_text(
        "[sweep]\nscene = 'stand.npz'\naltitude = [40, 60]\nsamples = [4, 9]\nvhat = 0.3\n"
    )
    monkeypatch.setattr(rows, "_scenes", {})
    read, made = [], []
    scene_of, correlogram = rows.scene_of, correlogram_module.correlogram
    monkeypatch.setattr(rows, "scene_of", lambda *a, **k: read.append(a) or scene_of(*a, **k))
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
