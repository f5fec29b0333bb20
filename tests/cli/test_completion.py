"""Completion: tests of the candidates at each place, and of real shells that use them."""

import os
import pty
import re
import select
import shutil
import subprocess
import sys
import time
from importlib import import_module

import pytest
from support.command_line import process

from aosplan.camera.presets import CAMERAS
from aosplan.cli.app import COMMANDS, GROUP, run
from aosplan.cli.completion import COMMAND_VALUES, SCRIPTS, VALUES, candidates
from aosplan.errors import AosplanError
from aosplan.flight.drones import DRONES
from aosplan.planning.options import OPTIONS
from aosplan.scenes.presets import SCENES


def words(*line):
    return [word for word, _ in candidates(line, GROUP)]


def test_completion_offers_commands_and_options_of_the_program():
    assert words("") == [*COMMANDS, *words("--")]
    assert words("--") == ["--version", "--install-completion", "--show-completion", "--help"]
    assert words("sce") == ["scene", "scenes"]
    assert words("--show-completion", "") == [*SCRIPTS]
    assert words("nonsense", "") == []


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_of_a_command_is_offered_with_its_help(name):
    parameters = import_module(f"aosplan.cli.{name}").COMMAND.params
    flags = [flag for each in parameters for flag in each.opts if flag.startswith("--")]
    offered = dict(candidates([name, "--"], GROUP))
    assert list(offered) == [*flags, "--help"]
    assert all(offered.values())


def test_options_that_were_given_are_not_offered_again():
    assert "--altitude" not in words("plan", "--altitude", "40", "--")
    assert "--out" in words("plan", "--out", "a.csv", "--")  # This option can be repeated.


@pytest.mark.parametrize(
    ("line", "known"),
    [
        (["plan", "--camera", ""], [*CAMERAS]),
        (["plan", "--scene", ""], [*SCENES]),
        (["scene", ""], [*SCENES]),
        (["simulate", "--drone", ""], [*DRONES]),
        (["plan", "--drone", "px"], ["px4-multicopter"]),
        (["plan", "--model=lay"], ["--model=layered"]),
        (["plan", "--heading", ""], ["auto", "best"]),
        (["visibility", "--grid", ""], []),
        (["plan", "--altitude", ""], []),
        (["plan", "--sensitivity", "--model", "u"], ["uniform"]),
        (["schema", "pl"], ["plan"]),
        (["simulate", "--forest", "cl"], ["clumped", "cloud"]),
    ],
    ids=" ".join,
)
def test_completion_offers_presets_and_choices(line, known):
    assert sorted(words(*line)) == sorted(known)


@pytest.mark.parametrize("option", OPTIONS, ids=lambda option: option.name)
def test_choices_are_those_that_the_option_takes(option):
    """The candidates are the values in the parser's error message for a wrong value."""
    try:
        option.parse("\x01", "--x")
        refusal = ""
    except AosplanError as error:
        refusal = error.message
    listed = re.search(r"is not one of (.+)", refusal)
    if listed:
        assert words("plan", option.flag, "") == listed[1].split(", ")
    for word in VALUES.get(option.name, [tuple])[0]():
        option.parse(word, option.flag)


def test_completed_option_names_exist():
    named = {
        each.name
        for command in COMMANDS
        for each in import_module(f"aosplan.cli.{command}").COMMAND.params
    }
    assert set(VALUES) <= named
    assert {name for _, name in COMMAND_VALUES} <= named
    assert {command for command, _ in COMMAND_VALUES} <= set(COMMANDS)


@pytest.fixture
def files(folder):
    (folder / "tiles").mkdir()
    for name in (
        "stand.laz",
        "plan.json",
        "photo.jpg",
        ".hidden.toml",
        "tiles/north.laz",
        "a b.laz",
    ):
        (folder / name).write_text("")
    return folder


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        (["plan", "--scene", "s"], ["savanna", "stand.laz"]),
        (["plan", "--scene", "tiles/"], ["tiles/north.laz"]),
        (["plan", "--scene", "t"], ["tropical-forest", "tiles/"]),
        (["plan", ""], ["plan.json", "tiles/"]),
        (["plan", "."], [".hidden.toml"]),
        (["export", ""], ["plan.json", "tiles/"]),
        (["export", "plan.json", ""], []),
        (["thin", "tiles", ""], ["plan.json", "tiles/"]),
        (["plan", "--altitude", "40", ""], ["plan.json", "tiles/"]),
        (["plan", "--out", "csv:st"], ["csv:stand.laz"]),
        (["plan", "--out", "none:st"], []),
        (["scene", "stand.laz", "a"], ["a b.laz"]),
        (["plan", "--area", "nowhere/"], []),
    ],
    ids=" ".join,
)
def test_files_are_completed_by_their_extension(files, line, offered):
    assert words(*line) == offered


@pytest.mark.parametrize("line", [["plan", "--ca"], ["plan", "--camera", ""], ["sweep", ""], [""]])
def test_completion_loads_no_heavy_modules(line):
    code = (
        f"import sys\nfrom aosplan.cli.app import GROUP\nfrom aosplan.cli.completion import candidates\ncandidates({line!r}, GROUP)\n"
        "print(*sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert not loaded & {"numpy", "scipy", "pyproj", "shapely", "pydantic", "rich", "polars"}


def test_the_completion_module_is_loaded_only_on_request():
    code = "import sys\nfrom aosplan.cli.app import run\nrun(['--version'])\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "aosplan.cli.completion" not in done.stdout


# The line in bash


@pytest.mark.parametrize(
    ("line", "breaks", "replies"),
    [
        ("aosplan plan --model=la", " \t=:", ["layered"]),
        ("aosplan plan --model=la", " \t", ["--model=layered"]),
        ("aosplan plan --out csv:sta", "=:", ["stand.laz"]),
        ("aosplan plan --scene 'a ", "=:", ["a b.laz"]),
        ('aosplan plan --scene "a ', "=:", ["a b.laz"]),
        ("aosplan plan --scene a\\ b", "=:", ["a b.laz"]),
        ("aosplan plan --scene s", "=:", ["savanna", "stand.laz"]),
        (
            "aosplan plan --optimize ",
            "=:",
            ["samples", "aperture", "time", "visibility", "contrast", "detection"],
        ),
        ("", "", [*COMMANDS, "--version", "--install-completion", "--show-completion", "--help"]),
    ],
)
def test_completion_for_bash_returns_the_part_after_the_last_word_break(
    files, line, breaks, replies
):
    asked = {"AOSPLAN_COMPLETE": "bash", "COMP_LINE": line, "COMP_WORDBREAKS": breaks}
    done = process(**asked)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.decode().splitlines() == replies


# Real shells


@pytest.fixture
def program(tmp_path_factory, monkeypatch):
    """A program ``aosplan`` in a folder that is on the PATH."""
    place = tmp_path_factory.mktemp("bin") / "aosplan"
    place.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m aosplan "$@"\n')
    place.chmod(0o755)
    monkeypatch.setenv("PATH", f"{place.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("TERM", "xterm")
    return place


def script(shell, folder):
    path = folder / f".completion.{shell}"
    path.write_bytes(process("--show-completion", shell).stdout)
    return path


def typed(command, lines, keys, wanted, seconds=60.0):
    """Type lines and keys in an interactive shell, and return its output up to the expected text."""
    child, terminal = pty.fork()
    if child == 0:
        os.execvp(command[0], command)
    shown = b""

    def read_until(text, until):
        nonlocal shown
        while text not in shown and time.monotonic() < until:
            if select.select([terminal], [], [], 0.1)[0]:
                try:
                    shown += os.read(terminal, 65536)
                except OSError:
                    return

    try:
        until = time.monotonic() + seconds
        for line in lines:
            os.write(terminal, f"{line}\n".encode())
        os.write(terminal, b"echo rea''dy\n")
        read_until(b"ready", until)
        shown = b""
        os.write(terminal, keys.encode())
        read_until(wanted.encode(), until)
    finally:
        os.close(terminal)
        os.waitpid(child, 0)
    return shown.decode(errors="replace")


CASES = [
    ("aosplan plan --camera dji-m3t-t", "dji-m3t-thermal"),
    ("aosplan plan --altitude 40 --sensiti", "--sensitivity"),
    ("aosplan scene tiles/n", "tiles/north.laz"),
    ("aosplan scene a", "a b.laz"),
    ("aosplan plan --model=laye", "--model=layered"),
]

SHELLS = {
    "bash": (["bash", "--norc", "-i"], []),
    "zsh": (["zsh", "-f", "-i"], ["autoload -Uz compinit; compinit -u -D"]),
}


def needs(shell):
    return pytest.mark.skipif(not shutil.which(shell), reason=f"no {shell}")


# For zsh, all cases but the first are slow tests, because `compinit` takes half a second, and these
# cases are the same for both shells.
@pytest.mark.parametrize(
    ("shell", "line", "wanted"),
    [
        pytest.param(
            shell,
            *case,
            marks=[needs(shell), *([pytest.mark.slow] if shell == "zsh" and number else [])],
        )
        for shell in SHELLS
        for number, case in enumerate(CASES)
    ],
)
def test_completion_works_in_bash_and_zsh(program, files, shell, line, wanted):
    command, begin = SHELLS[shell]
    wanted = wanted.replace(" ", "\\ ")[len(line.split()[-1]) :]  # the part that the shell adds
    source = [*begin, f"source {script(shell, files)}"]
    assert wanted in typed(command, source, f"{line}\t", wanted)


@needs("fish")
@pytest.mark.parametrize(("line", "wanted"), CASES, ids=[line for line, _ in CASES])
def test_completion_works_in_fish(program, files, line, wanted):
    code = f"source {script('fish', files)}; complete -C '{line}'"
    done = subprocess.run(
        ["fish", "--no-config", "-c", code], check=True, capture_output=True, text=True
    )
    (found,) = done.stdout.splitlines()
    assert found.partition("\t")[0] == wanted


@needs("fish")
def test_fish_shows_descriptions_of_candidates(program, files):
    code = f"source {script('fish', files)}; complete -C 'aosplan plan --alt'"
    done = subprocess.run(
        ["fish", "--no-config", "-c", code], check=True, capture_output=True, text=True
    )
    assert done.stdout.startswith("--altitude\tHeight above the synthetic focal plane.")


# PowerShell


@pytest.fixture(scope="module")
def parsed():
    """A function that parses PowerShell code and returns whether the code has a syntax error."""
    tree_sitter = pytest.importorskip("tree_sitter")
    grammar = pytest.importorskip("tree_sitter_powershell")
    parser = tree_sitter.Parser(tree_sitter.Language(grammar.language()))
    return lambda text: parser.parse(text.encode()).root_node.has_error


def test_the_grammar_of_powershell_accepts_its_script(parsed):
    script = SCRIPTS["powershell"]
    assert not parsed(script)
    # The grammar finds errors: a bracket or a quote that is not closed, and a missing keyword.
    for right, wrong in (("$null ", "$null) "), ("'powershell'", "'powershell"), ("try {", "{")):
        assert parsed(script.replace(right, wrong, 1)), wrong


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("aosplan pl", ["plan", "plot"]),
        ("aosplan plan ", None),
        ("aosplan plan --scene boreal", ["boreal-pine"]),
        ("aosplan plan --optimize ti", ["time"]),
        ("& 'C:\\Program Files\\aosplan.exe'", None),
        ("aosplan plot paper 1", ["10"]),
        ("aosplan plot grid 1", []),
        ("aosplan.exe plan --area 'C:\\no folder\\", []),
    ],
)
def test_powershell_passes_the_whole_line(monkeypatch, capsys, line, wanted):
    monkeypatch.setenv("AOSPLAN_COMPLETE", "powershell")
    monkeypatch.setenv("COMP_LINE", line)
    assert run([]) == 0
    found = [row.split("\t")[0] for row in capsys.readouterr().out.splitlines()]
    assert wanted is None or found == wanted


def test_powershell_receives_utf8_with_any_system_encoding(tmp_path):
    (tmp_path / "wäldchen.geojson").touch()
    found = subprocess.run(
        [sys.executable, "-m", "aosplan"],
        env={
            **os.environ,
            "PYTHONIOENCODING": "cp850",
            "AOSPLAN_COMPLETE": "powershell",
            "COMP_LINE": "aosplan plan --area wä",
        },
        cwd=tmp_path,
        check=True,
        capture_output=True,
    )
    assert found.stdout.decode("utf-8").split() == ["wäldchen.geojson"]


@pytest.mark.skipif(shutil.which("pwsh") is None, reason="no pwsh")
def test_completion_works_in_powershell(files):
    code = f". '{script('powershell', files)}'; (TabExpansion2 'aosplan plan --scene boreal').CompletionMatches.CompletionText"
    found = subprocess.run(
        ["pwsh", "-NoProfile", "-Command", code], check=True, capture_output=True, text=True
    )
    assert found.stdout.split() == ["boreal-pine"]


# Installation


@pytest.mark.parametrize(
    ("shell", "path"),
    [
        ("bash", "data/bash-completion/completions/aosplan"),
        ("zsh", "home/.zfunc/_aosplan"),
        ("fish", "settings/fish/completions/aosplan.fish"),
        ("powershell", "settings/aosplan/completion.ps1"),
    ],
)
def test_completion_is_installed_where_the_shell_reads_it(
    folder, command, monkeypatch, shell, path
):
    for name, place in (
        ("HOME", "home"),
        ("XDG_DATA_HOME", "data"),
        ("XDG_CONFIG_HOME", "settings"),
    ):
        monkeypatch.setenv(name, str(folder / place))
    for _ in range(2):  # The result is the same if it is already installed.
        status, out, err = command("--install-completion", shell)
        assert status == 0
        assert path in out
        assert err == "" or err.startswith("hint: ")
        assert (folder / path).read_text() == SCRIPTS[shell]


@pytest.mark.parametrize("flag", ["--show-completion", "--install-completion"])
def test_an_unknown_shell_is_refused(command, flag):
    status, out, err = command(flag, "tcsh")
    assert (status, out) == (2, "")
    assert err == "error: unknown shell 'tcsh'\nhint: known: bash, zsh, fish, powershell\n"
    assert run([flag]) == 2
