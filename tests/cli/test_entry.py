"""Tests of the settings that the process makes before it loads a command."""

import subprocess
import sys

import pytest

REPORTING = """
import atexit, os, sys
atexit.register(lambda: print(os.environ.get("OPENBLAS_NUM_THREADS"), file=sys.stderr))
sys.argv = ["aosplan", *sys.argv[1:]]
from aosplan.__main__ import main
main()
"""


@pytest.mark.parametrize(
    ("command", "own", "threads"),
    [("plan", None, "1"), ("plan", "3", "3"), ("thin", None, "None"), ("thin", "3", "3")],
)
def test_only_thin_uses_threads_for_matrix_products(monkeypatch, command, own, threads):
    if own is None:
        monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    else:
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", own)
    done = subprocess.run(
        [sys.executable, "-c", REPORTING, command, "--help"],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    assert done.stderr.split() == [threads]
