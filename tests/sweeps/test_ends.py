"""Sweeps that end early leave no incomplete files, and resuming them gives the same bytes."""

import contextlib
import os
import signal
import subprocess
import sys
import time

import pytest
from support.campaigns import CAMPAIGN, sweep

from aosplan.sweeps import run as run_module
from aosplan.sweeps import scenarios as scenarios_module

pl = pytest.importorskip("polars")

SHORT = CAMPAIGN.replace("count = 6", "count = 2")
ROWS = 8
"""The sweep of the tests with 32 scenarios, in four blocks of this size."""


@pytest.fixture
def campaign(campaign):
    campaign.write_text(SHORT, encoding="utf-8")
    return campaign


@pytest.fixture
def small_blocks(monkeypatch):
    monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", ROWS)


@pytest.mark.parametrize("suffix", ["csv", "parquet", "jsonl"])
@pytest.mark.parametrize(
    "conditions",
    [
        pytest.param([], marks=pytest.mark.slow),
        ["--best", "-flight_time_s", "--per", "altitude"],
    ],
)
def test_interruptions_change_no_byte(
    campaign, tmp_path, small_blocks, monkeypatch, suffix, conditions
):
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
    # The result exists, and neither --resume nor --force is given.
    assert sweep(campaign, "--out", broken, *conditions) == 2
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
    whole, broken = tmp_path / "whole.csv", tmp_path / "broken.csv"
    assert sweep(campaign, "--out", whole) == 0

    def full(*_):
        raise OSError(28, "No space left on device", str(broken))

    monkeypatch.setattr(run_module.Parts, "join", full)
    assert sweep(campaign, "--out", broken) == 1
    monkeypatch.undo()
    monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", ROWS)
    part = tmp_path / "broken.csv.parts" / "00000002.csv"
    part.write_bytes(part.read_bytes()[:100])
    assert sweep(campaign, "--out", broken, "--resume") == 0
    assert broken.read_bytes() == whole.read_bytes()


@pytest.mark.parametrize("line", ['{"part": 7}', "5", '{"part": "a"}', "\x00"])
def test_a_damaged_journal_is_passed_over_or_refused(
    campaign, tmp_path, small_blocks, monkeypatch, capsys, line
):
    out = tmp_path / "r.csv"
    monkeypatch.setattr(
        run_module.Parts, "join", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt)
    )
    assert sweep(campaign, "--out", out) == 130
    journal = tmp_path / "r.csv.parts" / "journal.jsonl"
    whole = journal.read_text()
    journal.write_text(f"{line}\n{whole}")
    monkeypatch.undo()
    monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", ROWS)
    if line != "\x00":
        assert sweep(campaign, "--out", out, "--resume") == 2
        assert "parts of another sweep" in capsys.readouterr().err
    journal.write_text(f"{whole}{line}\n")
    assert sweep(campaign, "--out", out, "--resume") == 0


def test_a_file_that_came_while_a_sweep_ran_stays(campaign, tmp_path, monkeypatch, capsys):
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


def test_the_results_of_another_sweep_are_not_resumed(campaign, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(
        run_module, "solve_part", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt)
    )
    out = tmp_path / "r.csv"
    assert sweep(campaign, "--out", out) == 130
    monkeypatch.undo()
    campaign.write_text(SHORT.replace("0.2", "0.3"), encoding="utf-8")
    assert sweep(campaign, "--out", out, "--resume") == 2
    assert "parts of another sweep" in capsys.readouterr().err
    assert sweep(campaign, "--out", out, "--force") == 0


def test_a_sweep_of_files_that_have_changed_is_not_resumed(
    tmp_path, small_blocks, monkeypatch, capsys
):
    scene, path, out = tmp_path / "stand.toml", tmp_path / "s.toml", tmp_path / "r.csv"
    text = 'name = "stand"\nintegrated_density = 0.4\noccluder_size_m = 1.0\nvolume_base_m = 2.0\n'
    scene.write_text(f"{text}volume_height_m = 10.0\n", encoding="utf-8")
    path.write_text(
        '[sweep]\naltitude = [40, 50]\nvhat = 0.9\nscene = "stand.toml"\n', encoding="utf-8"
    )

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
    # The sweep runs in a separate process, because workers are spawned and import the main module.
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
    # Ctrl-C in a terminal is sent to all processes of a command. A job manager sends a signal only
    # to the first process.
    status, error = ended(tmp_path, lambda pid: os.kill(pid, signal.SIGINT))
    assert status == 130
    assert error == "hint: finished parts are kept; --resume continues the sweep\n"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_waits_end_when_they_are_interrupted(campaign, tmp_path):
    # The signal handler of polars would let the processes continue.
    code = (
        "import os, signal, threading\nfrom aosplan.cli.app import run\n"
        f"assert run(['sweep', {str(campaign)!r}, '--out', {str(tmp_path / 'r.csv')!r}]) == 0\n"
        "try:\n"
        "    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
        "    threading.Event().wait()\n"
        "except KeyboardInterrupt:\n    os._exit(7)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], timeout=60, check=False)
    assert done.returncode == 7


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_termination_leaves_whole_parts_alone(tmp_path):
    def terminate(pid):
        # Such a file remains if a worker ends while it writes a part.
        (tmp_path / "r.csv.parts" / f"00000099.csv.{'0' * 32}.tmp").write_text("altitude")
        os.kill(pid, signal.SIGTERM)

    assert ended(tmp_path, terminate) == (143, "")
    names = os.listdir(tmp_path / "r.csv.parts")
    assert "journal.jsonl" in names
    assert not [name for name in names if name.endswith(".tmp")]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="finds the workers in /proc")
def test_a_worker_that_dies_is_an_error(tmp_path):
    def kill_workers(pid):
        for child in children_of(pid):
            # The process has just ended.
            with contextlib.suppress(FileNotFoundError, ProcessLookupError):
                with open(f"/proc/{child}/cmdline", encoding="utf-8") as line:
                    is_worker = "spawn_main" in line.read()
                if is_worker:
                    os.kill(child, signal.SIGKILL)

    status, error = ended(tmp_path, kill_workers)
    assert status == 1
    assert error.startswith("error: a worker process died")
    assert "--resume" in error
    assert error.count("\n") == 2


def children_of(pid):
    """Running child processes of a process."""
    with open(f"/proc/{pid}/task/{pid}/children", encoding="ascii") as children:
        return [int(child) for child in children.read().split()]


def is_running(pid):
    """Whether a process is still running.  After its end, a process continues to exist until its
    parent asks for its status.
    """
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii") as values:
            return values.read().rpartition(")")[2].split()[0] not in {"Z", "X"}
    except (FileNotFoundError, ProcessLookupError):
        return False


def ended(folder, act):
    """Status and stderr of a long sweep with two workers that is interrupted by `act`."""
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
            # stderr is closed when the last process ends.
            error = process.communicate(timeout=60)[1]
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            raise
    return process.returncode, error


@pytest.mark.skipif(sys.platform != "linux", reason="finds the workers in /proc")
def test_workers_end_when_the_first_process_is_killed(tmp_path):
    workers = []

    def kill(pid):
        workers.extend(children_of(pid))
        os.kill(pid, signal.SIGKILL)

    assert ended(tmp_path, kill)[0] == -signal.SIGKILL
    assert len(workers) >= 2
    until = time.monotonic() + 120
    while left := [pid for pid in workers if is_running(pid)]:
        assert time.monotonic() < until, left
        time.sleep(0.1)


@pytest.mark.skipif(sys.platform == "win32", reason="without locks")
@pytest.mark.parametrize(
    ("out", "again"), [("r.csv", "--force"), ("r.parquet/", "--force"), ("r.csv", "--resume")]
)
def test_a_second_sweep_to_the_same_output_is_refused(
    campaign, tmp_path, small_blocks, monkeypatch, capsys, out, again
):
    solve, second = run_module.solve_part, []

    def beside(sweep_, index, path):
        monkeypatch.setattr(run_module, "solve_part", solve)
        second.append(sweep(campaign, "--out", f"{tmp_path}/{out}", again))
        return solve(sweep_, index, path)

    monkeypatch.setattr(run_module, "solve_part", beside)
    assert sweep(campaign, "--out", f"{tmp_path}/{out}") == 0
    assert second == [2]
    assert "another sweep is writing" in capsys.readouterr().err
    assert not [name for name in os.listdir(tmp_path) if "lock" in name or "parts" in name]
    assert sweep(campaign, "--out", f"{tmp_path}/{out}", "--force") == 0


def test_file_names_are_not_written_as_spreadsheet_formulas(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stand = 'name = "a"\ndensity = 0.02\noccluder_size_m = 0.3\nvolume_base_m = 2\nvolume_height_m = 10\n'
    names = ["=1+1.toml", "+a.toml", "-a.toml", "@a.toml", "a.toml"]
    for name in names:
        (tmp_path / name).write_text(stand, encoding="utf-8")
    rows = "".join(f"{name},40\n" for name in names)
    (tmp_path / "in.csv").write_text(f"scene,altitude\n{rows}", encoding="utf-8")
    assert sweep("in.csv", "--out", "out.csv") == 0
    assert list(pl.read_csv("out.csv")["scene"]) == [f"'{name}" for name in names[:4]] + names[4:]
    assert sweep("in.csv", "--out", "out.parquet") == 0
    assert list(pl.read_parquet("out.parquet")["scene"]) == names


@pytest.mark.skipif(sys.platform != "linux", reason="limits of addresses")
@pytest.mark.parametrize("megabytes", [300, pytest.param(600, marks=pytest.mark.slow), 900])
@pytest.mark.parametrize("where", [["--summary"], ["--out", "r.csv"]])
def test_too_little_memory_gives_one_error_line(campaign, tmp_path, megabytes, where):
    # polars would end the process with its own message.
    import resource

    done = subprocess.run(
        [sys.executable, "-m", "aosplan", "sweep", str(campaign), *where],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (megabytes << 20,) * 2),
    )
    assert done.returncode == 1, done.stderr
    assert done.stderr.startswith("error: not enough memory for a sweep")
    assert done.stderr.count("\n") == 2
    assert os.listdir(tmp_path) == [campaign.name]
