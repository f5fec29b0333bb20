"""What every test of the command line starts with: an empty folder, and commands to run in it.

Most tests run the commands in this process; a few start a real one, for pipes, encodings and
terminals.  Every output goes to `tmp_path`.
"""

import pytest
from support.command_line import loads


@pytest.fixture(autouse=True)
def folder(folder):
    """An empty folder that is the current one, whether or not a test asks for it."""
    return folder


@pytest.fixture
def document(command):
    """A function that runs a command line with --json: its document."""

    def execute(*arguments):
        status, out, err = command(*arguments, "--json")
        assert status == 0, err
        return loads(out)

    return execute


@pytest.fixture
def plan_of(document):
    """A function that plans at 40 m with more options: the document."""
    return lambda *arguments: document("plan", "--altitude", 40, *arguments)
