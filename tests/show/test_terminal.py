"""Colours, characters and widths depend on the destination of the output."""

import ast
import io
import re
from pathlib import Path

import pytest
from support.command_line import on_a_terminal, process

import aosplan
from aosplan.show.text import tables
from aosplan.show.text import terminal as screen

ESCAPE = re.compile(r"\x1b\[[0-9;]*m")
COLOUR = re.compile(r"\x1b\[[0-9;]*(3[0-7]|4[0-7]|38|48|9[0-7])[0-9;]*m")

LISTS = ["cameras", "drones", "scenes", "formats"]
TABLES = [
    ["plan", "--altitude", "40"],
    ["plan", "--altitude", "40", "--samples", "10000"],
    ["plan", "--altitude", "40", "--grid", "spiral", "--samples", "400"],
    ["tradeoff", "--altitude", "40", "--vhat", "0.9", "--max-samples", "25"],
    ["scene", "paper-forest"],
    ["visibility", "--density", "0.5", "--samples", "50", "--dhat", "1"],
    *([name] for name in LISTS),
]


class Stream(io.StringIO):
    """A stream with a given encoding, which may be a terminal."""

    def __init__(self, *, terminal, encoding="utf-8"):
        super().__init__()
        self.terminal, self.named = terminal, encoding

    @property
    def encoding(self):
        return self.named

    def isatty(self):
        return self.terminal


@pytest.mark.parametrize(
    ("environment", "terminal", "pipe"),
    [
        ({}, True, False),
        ({"NO_COLOR": "1"}, False, False),
        ({"NO_COLOR": "0"}, False, False),  # the variable may have any value
        ({"NO_COLOR": ""}, True, False),  # but an empty one has no effect
        ({"FORCE_COLOR": "1"}, True, True),
        ({"FORCE_COLOR": ""}, True, False),
        ({"CLICOLOR": "0"}, False, False),
        ({"CLICOLOR": "1"}, True, False),
        ({"CLICOLOR_FORCE": "1"}, True, True),
        ({"CLICOLOR_FORCE": "0"}, True, False),
        ({"CLICOLOR": "0", "CLICOLOR_FORCE": "1"}, True, True),
        ({"NO_COLOR": "1", "FORCE_COLOR": "1"}, False, False),
        ({"NO_COLOR": "1", "CLICOLOR_FORCE": "1"}, False, False),
        ({"TERM": "dumb"}, False, False),
        ({"TERM": "dumb", "FORCE_COLOR": "1"}, True, True),
    ],
)
def test_colours_follow_the_conventions(monkeypatch, environment, terminal, pipe):
    for name in ("NO_COLOR", "FORCE_COLOR", "CLICOLOR", "CLICOLOR_FORCE", "TERM"):
        monkeypatch.delenv(name, raising=False)
    for name, value in ({"TERM": "xterm"} | environment).items():
        monkeypatch.setenv(name, value)
    assert screen.is_coloured(Stream(terminal=True)) is terminal
    assert screen.is_coloured(Stream(terminal=False)) is pipe


def test_a_terminal_shows_headlines_bounds_and_words_of_warning_in_colour():
    line = ("plan", "--altitude=40", "--grid=line", "--baseline=2", "--samples=52")
    shown = on_a_terminal(*line)
    assert re.search(r"\x1b\[1;36mb = 2\.00 m", shown)
    assert re.search(r"\x1b\[33m.*baseline", shown)
    assert "\x1b[1;33mwarning:\x1b[0m " in shown
    plain = on_a_terminal(*line, NO_COLOR="1")
    assert not COLOUR.search(plain)
    assert ESCAPE.sub("", plain) == ESCAPE.sub("", shown)


@pytest.mark.parametrize("arguments", TABLES[:4:3], ids=" ".join)
def test_a_dumb_terminal_gets_ascii_without_escapes(arguments):
    shown = on_a_terminal(*arguments, TERM="dumb")
    assert "\x1b" not in shown
    assert shown.isascii()


@pytest.mark.parametrize("arguments", TABLES, ids=" ".join)
def test_text_without_unicode_has_no_replacement_characters(arguments):
    done = process(*arguments, LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0")
    assert done.returncode == 0
    for text in (done.stdout.decode("ascii"), done.stderr.decode("ascii")):
        assert "?" not in text
        assert "\\" not in text
        assert max(map(len, text.splitlines() if text == done.stdout.decode() else [""])) <= 80


def test_every_special_character_has_an_ascii_replacement():
    beyond = set()
    for path in sorted(Path(aosplan.__file__).parent.rglob("*.py")):
        if path.name == "xml_text.py":  # ranges of characters
            continue
        text = path.read_text(encoding="utf-8")
        if text.isascii() and "\\u" not in text:
            continue
        nodes = list(ast.walk(ast.parse(text)))
        said = {id(n.value) for n in nodes if isinstance(n, ast.Expr)}
        for node in nodes:
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                beyond |= set() if id(node) in said else {c for c in node.value if not c.isascii()}
    assert beyond
    beyond -= {c for c in beyond if screen.letter_of(c) != "?"}  # names of people
    assert beyond <= set(screen.PLAIN)
    assert all(text.isascii() for text in screen.PLAIN.values())


@pytest.mark.parametrize(
    ("arguments", "columns"),
    [*((arguments, 40) for arguments in TABLES), (TABLES[0], 60), (TABLES[0], 200)],
)
def test_tables_fit_the_terminal(arguments, columns):
    shown = ESCAPE.sub("", on_a_terminal(*arguments, COLUMNS=str(columns)))
    lines = [line.replace("\u0302", "") for line in shown.splitlines()]
    lines = [line for line in lines if not re.match("(warning|hint): |Sources|Cruise", line)]
    assert max(map(len, lines)) <= min(columns, 80)


def test_no_number_of_a_table_is_broken_or_cut(monkeypatch, capsys):
    header = ("grid", "b [m]", "a [bold]", "some words", "V̂")
    row = ("trimmed", "12345.678", "0.9000", "one two three", "0.12345678")
    least = sum(map(len, ("trimmed", "12345.678", "a [bold]", "one two three", "0.12345678"))) + 8
    for width in range(20, 81):
        monkeypatch.setattr(tables, "screen_width", lambda width=width: width)
        tables.print_rows(header, [row])
        shown = capsys.readouterr().out
        for word in " ".join([*header[1:], *row]).split():
            assert word in re.sub("[:,]", "", shown).split()
        is_table = shown.startswith("grid")
        assert is_table == (width >= least), width
        # The 1 is added because a combining character has no width.
        assert all(len(line) <= width + 1 for line in shown.splitlines())


@pytest.mark.parametrize("columns", ["1", "0", "x", "99999999999"])
def test_absurd_terminal_widths_cause_no_traceback(columns):
    shown = on_a_terminal("plan", "--altitude", "40", COLUMNS=columns)
    assert "rror" not in shown
    assert "b = 2.80 m" in re.sub(r"\s+", " ", ESCAPE.sub("", shown)) or columns == "1"


def test_long_lists_of_files_are_named_in_part():
    assert screen.written_text(["a.csv", "b.csv"]) == "Wrote a.csv, b.csv"
    assert screen.written_text([f"{i}" for i in range(100)]) == "Wrote 0, 1, 2, 3, 4, 5 and 94 more"
