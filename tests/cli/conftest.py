"""Fixtures of the tests of the command line: an empty folder, and commands that run in it.

Most tests run commands in the process of the tests.  A few tests of pipes, encodings and terminals
start a real process.  All output goes to `tmp_path`.
"""

import pytest
from support.command_line import loads


@pytest.fixture(autouse=True)
def folder(folder):
    """An empty folder as the current one, for every test."""
    return folder


@pytest.fixture
def document(command):
    """A function that runs a command line with --json and returns the document."""

    def execute(*arguments):
        status, out, err = command(*arguments, "--json")
        assert status == 0, err
        return loads(out)

    return execute


@pytest.fixture
def plan_of(document):
    """A function that plans at 40 m with further options and returns the document."""
    return lambda *arguments: document("plan", "--altitude", 40, *arguments)
