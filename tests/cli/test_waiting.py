"""A terminal shows progress during long work, and removes it at the end."""

import re

from support.command_line import on_a_terminal, process

AT_ONCE = (
    "-c",
    "import aosplan.cli.output as output\noutput.PATIENCE_S = 0.0\n"
    "from aosplan.__main__ import main\nmain()\n",
)
"""Arguments of Python that run the program so that it shows the progress of a search at once."""

SEARCH = ["plan", "--altitude", "40", "--grid", "best", "--optimize", "visibility"]
SEARCH = [*SEARCH, "--max-samples", "30", "--max-aperture", "9"]

CURSOR = "\x1b[?25h"


def test_a_long_search_shows_its_candidates_and_clears_the_line():
    shown = on_a_terminal(*SEARCH, program=AT_ONCE)
    tried = re.findall(r"searching: ([a-z0-9 ]+?)( of pitch [0-9.]+)?, N = \d+, b = \d", shown)
    assert tried
    before, _, after = shown.rpartition(CURSOR)
    assert "searching" in before
    assert "searching" not in after
    assert "Baseline" in after


def test_a_quick_command_shows_no_progress():
    for arguments in (SEARCH, ["plan", "--altitude", "40"]):
        assert "searching" not in on_a_terminal(*arguments, TERM="dumb")
    assert "searching" not in on_a_terminal("plan", "--altitude", "40", program=AT_ONCE)
    assert "searching" not in on_a_terminal(*SEARCH, "--quiet", program=AT_ONCE)


def test_no_search_progress_is_written_to_a_pipe():
    done = process(*SEARCH)
    assert b"searching" not in done.stdout + done.stderr


def test_ctrl_c_ends_a_search_and_restores_the_cursor():
    endless = [*SEARCH[:-4], "--max-samples", "100000"]
    shown, status = on_a_terminal(*endless, program=AT_ONCE, typed=b"\x03")
    assert status == 130
    assert "Traceback" not in shown
    assert shown.rstrip().endswith(CURSOR) or CURSOR in shown.rpartition("searching")[2]
