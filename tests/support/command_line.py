"""Helpers for tests of the command line: processes, terminals, and the check of error messages."""

import fcntl
import json
import os
import pty
import re
import subprocess
import sys
import termios

from support.paths import AREAS

UNIFORM = ["--occluder-size", "0.2", "--volume-height", "18"]
LENS = ["--focal-length", "9.1", "--sensor-width", "7.68", "--image-width", "640"]
LENS = [*LENS, "--image-height", "512"]

FIELD = ["--area", str(AREAS / "field.geojson")]


def loads(text):
    """Parse a JSON document.  Constants that JSON does not allow, such as NaN, are an error."""

    def refuse(constant):
        raise AssertionError(constant)

    return json.loads(text, parse_constant=refuse)


def process(*arguments, cwd=None, stdin="", **environment):
    """Run a real process.  Only the given settings of colour and encoding are in its
    environment.
    """
    cleared = ("NO_COLOR", "FORCE_COLOR", "PYTHONIOENCODING", "PYTHONUTF8", "COLUMNS", "LC_ALL")
    kept = {name: value for name, value in os.environ.items() if name not in cleared}
    return subprocess.run(
        [sys.executable, "-m", "aosplan", *arguments],
        input=stdin.encode(),
        capture_output=True,
        check=False,
        cwd=cwd,
        env=kept | environment,
        timeout=60,
    )


def check_refusal(status, out, err, expected=2):
    """Check that there is one `error:` line, at most one `hint:`, and no other output."""
    assert status == expected
    assert out == ""
    lines = err.split("\n")
    assert lines.pop() == ""
    assert 1 <= len(lines) <= 2, err
    assert re.match(r"error: \S", lines[0])
    assert all(re.match(r"hint: \S", line) for line in lines[1:])
    assert all(line.isprintable() for line in lines)
    assert all(len(line) < 500 for line in lines)


def on_a_terminal(*arguments, program=("-m", "aosplan"), typed=None, **environment):
    """Output that a process writes to a terminal.  If keys are `typed` after its first output, its
    exit status is also returned.
    """
    parent, child = pty.openpty()
    kept = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR")}
    with subprocess.Popen(
        [sys.executable, *program, *arguments],
        stdin=subprocess.DEVNULL if typed is None else child,
        stdout=child,
        stderr=child,
        start_new_session=typed is not None,
        preexec_fn=None  # noqa: PLW1509 (one thread)
        if typed is None
        else lambda: fcntl.ioctl(child, termios.TIOCSCTTY, 0),
        env=kept | {"TERM": "xterm-256color"} | environment,
    ) as running:
        os.close(child)
        parts, keys = [], None
        while True:
            try:
                part = os.read(parent, 65536)
            except OSError:  # The other end of the terminal is closed.
                break
            if not part:
                break
            parts.append(part)
            if typed is not None:
                os.write(parent, typed)
                keys, typed = typed, None
        os.close(parent)
        status = running.wait(timeout=60)
    shown = b"".join(parts).decode()
    return shown if keys is None else (shown, status)


def extent(result):
    return max(result["grid"]["extent_m"])
