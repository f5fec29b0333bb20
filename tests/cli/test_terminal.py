"""Real processes with pipes, encodings, terminals, and readers that stop reading."""

import re
import shlex
import subprocess
import sys

import pytest
from support.command_line import check_refusal, on_a_terminal, process

import aosplan


def test_the_module_runs():
    done = process("--version")
    assert done.returncode == 0
    assert done.stdout.decode() == f"aosplan {aosplan.__version__}\n"


def test_a_real_process_exits_with_the_status():
    done = process("plan", "--altitude", "10")
    check_refusal(done.returncode, done.stdout.decode(), done.stderr.decode())


PLAN = ["plan", "--altitude", "40"]


@pytest.mark.parametrize(
    ("environment", "lines"),
    [
        ({"PYTHONIOENCODING": "ascii"}, [PLAN, ["plan", "--help"], ["cameras"], ["scenes"]]),
        ({"PYTHONIOENCODING": "latin-1"}, [PLAN, ["cameras"]]),
        ({"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, [PLAN]),
    ],
    ids=["ascii", "latin-1", "C"],
)
def test_a_terminal_without_unicode_gets_plain_text(environment, lines, folder):
    for arguments in lines:
        done = process(*arguments, **environment)
        assert (done.returncode, done.stderr) == (0, b"")
    done = process("plan", "--altitude", "40", "--samples", "5", **environment)
    check_refusal(done.returncode, done.stdout.decode(), done.stderr.decode("latin-1"))


def test_json_is_utf_8_on_every_terminal():
    plain = process("plan", "--altitude", "40", "--json", PYTHONIOENCODING="ascii")
    assert plain.stdout == process("plan", "--altitude", "40", "--json").stdout
    assert "d̂ ≥ 1" in process("schema", "request", PYTHONIOENCODING="ascii").stdout.decode()


def test_output_to_a_pipe_has_no_colour():
    for arguments in (["plan", "--altitude", "40"], ["cameras"], ["plan", "--help"]):
        done = process(*arguments, TERM="xterm-256color")
        assert b"\x1b" not in done.stdout + done.stderr


def test_no_color_is_respected_on_a_terminal():
    colour = re.compile(r"\x1b\[[0-9;]*(3[0-7]|4[0-7]|38|48|9[0-7])[0-9;]*m")
    for arguments in (["plan", "--altitude", "40"], ["cameras"]):
        assert not colour.search(on_a_terminal(*arguments, NO_COLOR="1"))


def test_a_terminal_shows_the_same_text_as_a_pipe():
    shown = re.sub(r"\x1b\[[0-9;]*m", "", on_a_terminal("cameras"))
    piped = process("cameras").stdout.decode()
    assert [line.rstrip() for line in shown.splitlines()] == piped.splitlines()


def test_a_plan_without_a_point_cloud_shows_no_bar_on_a_terminal():
    shown = re.sub(r"\x1b\[[0-9;]*m", "", on_a_terminal("plan", "--altitude", "40"))
    assert "\x1b" not in shown
    assert "reading points" not in shown


def test_a_terminal_shows_what_is_done_with_a_point_cloud(tmp_path):
    pytest.importorskip("laspy")
    from support.clouds import stand, write_cloud

    path = write_cloud(tmp_path / "a.las", *stand())
    shown = on_a_terminal("scene", str(path), "--save", str(tmp_path / "a.toml"), AOSPLAN_CACHE="0")
    stages = ("finding the ground", "measuring the slices")
    places = [shown.find(stage) for stage in (*stages, "measuring the correlogram")]
    assert -1 not in places
    assert places == sorted(places)


@pytest.mark.parametrize("arguments", [["--json"], ["--out", "csv:-"]])
def test_a_reader_that_closes_the_pipe_causes_no_traceback(arguments):
    line = ["plan", "--altitude", "40", "--vhat", "0.9998", "--allow-no-common-ground", "--quiet"]
    line += arguments
    with subprocess.Popen(
        [sys.executable, "-m", "aosplan", *line], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as running:
        assert running.stdout.readline()
        running.stdout.close()
        err = running.stderr.read()
        assert running.wait(timeout=60) in (0, 1)
    assert err == b""


@pytest.mark.parametrize("arguments", [[], ["--json"], ["--out", "csv:-"]])
def test_a_closed_stdout_causes_no_traceback(arguments):
    line = shlex.join([sys.executable, "-m", "aosplan", "plan", "--altitude", "40", *arguments])
    done = subprocess.run(
        ["sh", "-c", f"exec {line} >&-"], capture_output=True, check=False, text=True, timeout=60
    )
    assert "Traceback" not in done.stderr
    assert done.returncode in (0, 1)


def test_a_full_stdout_gives_status_1_and_one_error_line(folder):
    # The file cannot become larger, as on a full disk.
    line = shlex.join([sys.executable, "-m", "aosplan", "plan", "--altitude", "40", "--json"])
    done = subprocess.run(
        ["sh", "-c", f"ulimit -f 0; exec {line} > out.json"],
        capture_output=True,
        check=False,
        text=True,
        timeout=60,
    )
    check_refusal(done.returncode, done.stdout, done.stderr, expected=1)
    assert (folder / "out.json").read_bytes() == b""
