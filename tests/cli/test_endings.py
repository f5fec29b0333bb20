"""Processes end without a traceback if they are interrupted, or if the reader of their output has
ended.
"""

import os
import random
import shlex
import signal
import subprocess
import sys

import pytest

PROGRAM = shlex.join([sys.executable, "-m", "aosplan"])

SIGNALS_ITSELF = """
import signal, sys

class Signalling:
    def find_spec(self, name, path, target=None):
        if name == "{module}":
            signal.raise_signal({number})

sys.meta_path.insert(0, Signalling())
from aosplan.__main__ import main
main()
"""
"""A program that receives a signal just before it loads a module: the moment does not depend on
the speed of the machine.
"""

SIGNALS_ITSELF_LATER = """
import signal, sys

left = {moment}

def count(frame, event, argument):
    global left
    left -= 1
    if left == 0:
        signal.raise_signal(signal.SIGINT)

class Counting:
    def find_spec(self, name, path, target=None):
        if name == "aosplan.cli.app":
            sys.setprofile(count)

sys.meta_path.insert(0, Counting())
from aosplan.__main__ import main
try:
    main()
finally:
    sys.setprofile(None)
    if {moment} == -1:
        print(-1 - left)
"""
"""A program that interrupts itself at the function call or return with a given number.  The numbers
begin just before the program loads a module.  If the given number is -1, the program prints how
many calls and returns there are.
"""

LINES = [
    ["plan", "--altitude", "40", "--quiet"],
    ["plan", "--altitude", "40", "--origin", "48,14", "--out", "a.geojson", "--quiet"],
    ["scene", "paper-forest"],
]


def executed(code, arguments, handler=signal.default_int_handler):
    """Run Python code in a process that starts with a given handler of Ctrl-C, and return the
    finished process.
    """
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        capture_output=True,
        check=False,
        text=True,
        timeout=60,
        preexec_fn=lambda: signal.signal(signal.SIGINT, handler),
    )


def signals_itself(number, module, arguments, handler=signal.default_int_handler):
    """Status and stderr of a process that receives a signal before it loads a module."""
    code = SIGNALS_ITSELF.format(module=module, number=int(number))
    done = executed(code, arguments, handler)
    return done.returncode, done.stderr


@pytest.mark.parametrize("arguments", LINES, ids=" ".join)
def test_ctrl_c_at_any_moment_is_status_130_and_silent(folder, arguments):
    whole = executed(SIGNALS_ITSELF_LATER.format(moment=-1), arguments)
    moments = int(whole.stdout.splitlines()[-1])
    written = [folder / name for name in os.listdir(folder)]
    for _ in range(3):
        for path in written:
            path.unlink(missing_ok=True)
        moment = random.randint(1, moments)
        done = executed(SIGNALS_ITSELF_LATER.format(moment=moment), arguments)
        # In a callback, the exception is lost and raised again 10 ms later. By then, a short
        # command may have ended.
        assert done.returncode in {0, 130}, moment
        assert done.stderr == "", moment
        assert not [name for name in os.listdir(folder) if name != "a.geojson"]


@pytest.mark.parametrize("arguments", LINES, ids=" ".join)
def test_ctrl_c_before_the_first_module_is_status_130(folder, arguments):
    assert signals_itself(signal.SIGINT, "aosplan.cli.app", arguments) == (130, "")
    assert os.listdir(folder) == []


MET = """
import signal, sys, weakref

class Leaf: pass

class Member:
    def __set_name__(self, owner, name):
        signal.raise_signal(signal.SIGINT)

def call_back():
    leaf = Leaf()
    weakref.finalize(leaf, signal.raise_signal, signal.SIGINT).atexit = False

class Interrupting:
    def find_spec(self, name, path, target=None):
        if name == "aosplan.planning.planner":
            {then}

sys.meta_path.insert(0, Interrupting())
from aosplan.__main__ import main
main()
"""
"""Programs that receive Ctrl-C at moments at which Python does not raise KeyboardInterrupt as
usual: in a callback, and while a class is created.
"""


@pytest.mark.parametrize(
    ("then", "statuses"),
    [
        ("call_back(); import time; time.sleep(60)", {130}),
        ("call_back()", {0, 130}),  # A short command may already have finished.
        ("type('Class', (), {'member': Member()})", {130}),
    ],
)
def test_ctrl_c_in_callbacks_and_class_bodies_is_status_130(folder, then, statuses):
    line = [sys.executable, "-c", MET.replace("{then}", then)]
    line += ["plan", "--altitude", "40", "--out", "a.csv"]
    done = subprocess.run(line, capture_output=True, check=False, text=True, timeout=50)
    assert done.returncode in statuses
    assert done.stderr == ""
    assert os.listdir(folder) in ([], ["a.csv"])


@pytest.mark.parametrize("late", [True, False])
def test_ctrl_c_just_before_or_after_the_run_is_status_130(late):
    code = (
        "import signal, sys\n"
        "from aosplan import __main__\n"
        "from aosplan.cli import app\n"
        "app.run = lambda: 0\n"
        "given, handlers = signal.signal, []\n"
        "def set_handler(number, handler):\n"
        "    handlers.append(handler)\n"
        f"    if number == signal.SIGINT and len(handlers) == {4 if late else 3}:\n"
        "        raise KeyboardInterrupt\n"
        "    return given(number, handler)\n"
        "signal.signal = set_handler\n"
        "__main__.main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, check=False, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (130, "")


def test_ignored_ctrl_c_remains_ignored():
    arguments = ["plan", "--altitude", "40"]
    ended = signals_itself(signal.SIGINT, "aosplan.cli.app", arguments, signal.SIG_IGN)
    assert ended == (0, "")


@pytest.mark.parametrize("module", ["aosplan.cli.app", "aosplan.planning.planner"])
def test_a_terminated_program_prints_nothing(module):
    arguments = ["plan", "--altitude", "40"]
    assert signals_itself(signal.SIGTERM, module, arguments) == (143, "")


def shell(text):
    return subprocess.run(
        ["sh", "-c", text], capture_output=True, check=False, text=True, timeout=60
    )


@pytest.mark.parametrize(
    "line",
    [
        "plan --altitude 40 | head -1",
        "cameras | true",
        "cameras --json | true",
        "plan --help | true",
        "--version | true",
        "plan --altitude 40 --out csv:- | true",
        "plan --altitude 10 2>&1 | true",
        "plan --altitude 40 --grid line 2>&1 | true",
    ],
)
def test_a_reader_that_stops_early_causes_no_error(line):
    assert shell(f"{PROGRAM} {line}").stderr == ""


@pytest.mark.parametrize(
    ("line", "status"),
    [
        ("plan --altitude 40 >&-", 0),
        ("plan --altitude 40 --json >&-", 0),
        ("plan --altitude 40 --out a.csv --quiet >&- 2>&- <&-", 0),
        ("plan --altitude 10 2>&-", 2),
        ("plan --altitude 10 2>&1 >/dev/null | true", 0),
        ("plan - <&-", 2),
        ("plan --altitude 40 --grid line 2>&- | wc -l", 0),
    ],
)
def test_closed_standard_streams_do_not_affect_other_files(folder, line, status):
    done = shell(f"{PROGRAM} {line}")
    assert done.returncode == status
    assert "Traceback" not in done.stderr
    written = folder / "a.csv"
    if written.exists():  # The file must not contain the output of another stream.
        rows = written.read_text().splitlines()
        assert rows[0].startswith("index,")
        assert len(rows) == 51
    assert ("a.csv" in line) == written.exists()
