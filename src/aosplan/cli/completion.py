"""Completion in shells: prints candidates for the word at the cursor.

``--show-completion SHELL`` prints a shell function.  This function runs ``aosplan`` with `VARIABLE`
set to the name of the shell.  The arguments are the words before the cursor. bash and PowerShell
pass the whole line instead, because bash splits words at ``=`` and ``:``, and PowerShell drops
empty words.  The output has one line per candidate: the word and, after a tab, its meaning.
"""

from __future__ import annotations

import io
import os
import shlex
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from aosplan.cli.typer_classes import TyperGroup

VARIABLE = "AOSPLAN_COMPLETE"
"""Environment variable that requests candidates."""


class Values(NamedTuple):
    """Values of an option or argument: known words, and files with certain extensions.

    If there are no extensions, no files are suggested.  An empty extension means any file.
    """

    words: Callable[[], Iterable[str]] = tuple
    extensions: tuple[str, ...] = ()


def _scenes() -> Iterable[str]:
    from aosplan.scenes.presets import SCENES

    return SCENES


def _cameras() -> Iterable[str]:
    from aosplan.camera.presets import CAMERAS

    return CAMERAS


def _drones() -> Iterable[str]:
    from aosplan.flight.drones import DRONES

    return DRONES


def _payloads() -> Iterable[str]:
    from aosplan.mission.dji_models import PAYLOADS

    return PAYLOADS


def _formats() -> Iterable[str]:
    from aosplan.mission.export import formats

    return formats()


def _documents() -> Iterable[str]:
    from aosplan.cli.schema import DOCUMENTS

    return DOCUMENTS


def _words_of(module: str, name: str, *more: str) -> Callable[[], Iterable[str]]:
    """Function that returns the names in a table of another module.  The module is imported when
    the names are needed.
    """
    return lambda: (*getattr(import_module(f"aosplan.{module}"), name), *more)


REQUEST = (".toml", ".json")
AREA = (".geojson", ".json", ".kml", ".kmz")
SCENE = (".las", ".laz", ".npz", ".tif", ".tiff", ".csv", ".toml", ".json")
SITES = (".csv", ".geojson", ".waypoints", ".plan")
MISSION = (".csv", ".geojson", ".kml", ".kmz", ".plan", ".waypoints")
FIGURE = (".png", ".svg", ".pdf")
TABLE = (".csv", ".parquet", ".jsonl")

VALUES = {
    "altitude_frame": Values(_words_of("mission.mission", "FRAMES")),
    "area": Values(extensions=AREA),
    "around": Values(extensions=AREA),
    "autopilot": Values(_words_of("planning.option_parsers", "AUTOPILOTS")),
    "camera": Values(_cameras, REQUEST),
    "camera_control": Values(_words_of("planning.option_parsers", "CAMERA_CONTROLS")),
    "clear": Values(extensions=AREA),
    "defaults": Values(lambda: ("none",), (".toml",)),
    "document": Values(_documents),
    "drone": Values(_drones),
    "forest": Values(_words_of("simulation.compare", "FORESTS")),
    "occluders": Values(_words_of("simulation.compare", "OCCLUDERS")),
    "format": Values(_formats),
    "grid": Values(_words_of("grid.patterns", "GRIDS", "guided", "best")),
    "ground": Values(_words_of("planning.option_parsers", "GROUND")),
    "heading": Values(lambda: ("auto", "best")),
    "images": Values(extensions=("/",)),
    "lane_pitch": Values(lambda: ("best",)),
    "lanes": Values(lambda: ("best",)),
    "model": Values(_words_of("models.model", "MODELS")),
    "no_fly": Values(extensions=AREA),
    "occlusion_map": Values(extensions=(".png",)),
    "opacity": Values(_words_of("planning.option_parsers", "OPACITY")),
    "optimize": Values(_words_of("solver.problem", "OBJECTIVES")),
    "order": Values(_words_of("planning.options", "ORDERS")),
    "out": Values(extensions=MISSION),
    "payload": Values(_payloads),
    "picture": Values(extensions=(".png",)),
    "plan": Values(extensions=REQUEST),
    "poa": Values(extensions=(".tif", ".tiff")),
    "photos": Values(extensions=(".json", ".geojson", ".txt", ".bin")),
    "positions": Values(extensions=SITES),
    "rays": Values(_words_of("models.model", "RAYS")),
    "request": Values(extensions=REQUEST),
    "plot": Values(extensions=FIGURE),
    "report": Values(extensions=(".html",)),
    "save": Values(extensions=(".toml", ".npz")),
    "scene": Values(_scenes, SCENE),
    "signature": Values(_words_of("models.signatures", "SIGNATURES")),
    "terrain": Values(extensions=(".tif", ".tiff")),
    "edges": Values(_words_of("planning.option_parsers", "EDGES")),
    "trigger": Values(_words_of("planning.option_parsers", "TRIGGERS")),
    "view": Values(_words_of("planning.option_parsers", "VIEWS")),
}
"""Completions by the name of an option or argument.  Numbers and locations have no completions."""

COMMAND_VALUES = {
    ("integrate", "out"): Values(extensions=(".png", ".npz", ".tif")),
    ("plot", "file"): Values(extensions=(*REQUEST, *SCENE, *TABLE)),
    ("plot", "kind"): Values(_words_of("show.figures.draw", "KINDS")),
    ("plot", "out"): Values(extensions=FIGURE),
    ("sweep", "file"): Values(extensions=(".toml", ".csv", ".parquet")),
    ("sweep", "out"): Values(extensions=TABLE),
    ("thin", "best"): Values(_words_of("postflight.thin", "QUANTITIES")),
    ("thin", "out"): Values(extensions=(".csv", ".txt")),
    ("tradeoff", "out"): Values(extensions=(".csv", ".json", ".jsonl")),
    ("visibility", "grid"): Values(),
}
"""Completions for single commands. They replace the completions in `VALUES`."""

WORDS_AFTER = {("plot", "paper"): _words_of("show.figures.paper.registry", "FIGURES")}
"""Completions of the argument that follows a certain word of a command."""

Candidate = tuple[str, str]
"""A word and its meaning."""


def print_candidates(group: TyperGroup) -> None:
    """Print the candidates that a shell has requested."""
    if os.environ[VARIABLE] == "bash":
        lines = _for_bash(
            os.environ.get("COMP_LINE", ""), os.environ.get("COMP_WORDBREAKS", ""), group
        )
    else:
        powershell = os.environ[VARIABLE] == "powershell"
        if powershell and isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(encoding="utf-8")  # The function in PowerShell reads UTF-8.
        found = candidates(_of_powershell() if powershell else sys.argv[1:], group)
        lines = [f"{word}\t{text}" if text else word for word, text in found]
    for line in lines:
        if "\n" not in line:  # Shells do not accept candidates with a line break.
            print(line)


def _of_powershell() -> list[str]:
    """Words of PowerShell's line after the name of the program. A backslash is not an escape here,
    because it separates folders.
    """
    line = os.environ.get("COMP_LINE", "").replace("\\", "\\\\")
    return [word.replace("\\\\", "\\") for word in _words(line)[1:]]


def _for_bash(line: str, breaks: str, group: TyperGroup) -> list[str]:
    """Candidates for a line up to the cursor. bash splits words at more characters than other
    shells. It replaces only its own last word, which may be the end of a word here, by the chosen
    candidate. The part of each candidate before bash's last word is therefore removed.
    """
    words = _words(line)
    found = [word for word, _ in candidates(words[1:], group)]
    begin = max((words[-1].rfind(mark) for mark in "=:" if mark in breaks), default=-1) + 1
    return [word[begin:] for word in found]


def _words(line: str) -> list[str]:
    """The words of a line, split in the same way as by a shell.  The last word may be incomplete or
    empty.
    """
    for closing in ("", '"', "'"):
        lexer = shlex.shlex(line + closing, posix=True, punctuation_chars=False)
        lexer.whitespace_split, lexer.commenters = True, ""
        try:
            words = list(lexer)
        except ValueError:  # A quote is not closed.
            continue
        return [*words, ""] if not closing and line[-1:].isspace() else words
    return [""]


def candidates(words: Sequence[str], group: TyperGroup) -> list[Candidate]:
    """Candidates for the last of the words that follow the name of the program."""
    *before, current = words or [""]
    summaries = [(name, _help(each)) for name, each in group.commands.items()]
    name = next((word for word in before if not word.startswith("-")), None)
    if name is None:
        options = [(flag, _help(each)) for each in group.params for flag in each.opts]
        shells = [] if not before else [shell for shell in SCRIPTS if "completion" in before[-1]]
        known = [(shell, "") for shell in shells] or [*summaries, *options, HELP]
        return _matching(known, current)
    if name not in group.commands:
        return []
    parameters = import_module(f"aosplan.cli.{name}").COMMAND.params
    before = before[before.index(name) + 1 :]
    by_flag = {flag: each for each in parameters for flag in each.opts if flag.startswith("--")}
    if before and _takes_value(by_flag.get(before[-1])):
        return _values(name, by_flag[before[-1]].name, current)
    flag, equals, value = current.partition("=")
    if equals and _takes_value(by_flag.get(flag)):
        found = _values(name, by_flag[flag].name, value)
        return [(f"{flag}={word}", text) for word, text in found]
    if current.startswith("-"):
        open_flags = {f: p for f, p in by_flag.items() if p.multiple or f not in before}
        return _matching([*((f, _help(p)) for f, p in open_flags.items()), HELP], current)
    return _argument(name, parameters, by_flag, before, current)


HELP = ("--help", "Show this message and exit.")


def _argument(
    command: str,
    parameters: Sequence[Any],
    by_flag: dict[str, Any],
    before: Sequence[str],
    current: str,
) -> list[Candidate]:
    """Candidates for the next argument."""
    values = {i + 1 for i, word in enumerate(before) if _takes_value(by_flag.get(word))}
    words = [w for i, w in enumerate(before) if i not in values and not w.startswith("-")]
    given = len(words)
    if given == 1 and (command, words[0]) in WORDS_AFTER:
        return _matching([(word, "") for word in WORDS_AFTER[command, words[0]]()], current)
    arguments = [each for each in parameters if each.param_type_name == "argument"]
    if arguments and arguments[-1].nargs == -1:
        given = min(given, len(arguments) - 1)
    return _values(command, arguments[given].name, current) if given < len(arguments) else []


def _help(parameter: Any) -> str:
    return parameter.help or ""


def _takes_value(parameter: Any) -> bool:
    return parameter is not None and not parameter.is_flag


def _matching(known: Iterable[Candidate], current: str) -> list[Candidate]:
    return [(word, text) for word, text in known if word.startswith(current)]


def _values(command: str, name: str, current: str) -> list[Candidate]:
    """Words and files that an option or argument accepts."""
    values = COMMAND_VALUES.get((command, name)) or VALUES.get(name, Values())
    prefix = ""
    if name == "out" and values is VALUES["out"]:
        form, colon, path = current.partition(":")
        if colon and form in _formats():
            prefix, current, values = f"{form}:", path, Values(extensions=("",))
    found = _matching([(word, "") for word in values.words()], current)
    return found + [(prefix + path, "") for path in _files(current, values.extensions)]


def _files(current: str, extensions: tuple[str, ...]) -> list[str]:
    """Files and folders whose path starts with the given text. The files have one of the given
    extensions. The path of a folder ends with /.
    """
    if not extensions:
        return []
    folder, start = os.path.split(current)
    try:
        with os.scandir(os.path.expanduser(folder) or ".") as entries:
            there = [(entry.name, entry.is_dir()) for entry in entries]
    except OSError:
        return []
    return sorted(
        os.path.join(folder, name) + "/" * is_folder
        for name, is_folder in there
        if name.startswith(start)
        and (start.startswith(".") or not name.startswith("."))
        and (is_folder or name.lower().endswith(extensions))
    )


BASH = """\
_aosplan() {
    local line
    COMPREPLY=()
    while IFS= read -r line; do
        COMPREPLY+=("$line")
    done < <(AOSPLAN_COMPLETE=bash COMP_LINE="${COMP_LINE:0:COMP_POINT}" \\
        COMP_WORDBREAKS="$COMP_WORDBREAKS" "$1" 2>/dev/null)
}
complete -o filenames -o nosort -F _aosplan aosplan 2>/dev/null ||
    complete -o filenames -F _aosplan aosplan
"""

ZSH = """\
#compdef aosplan
_aosplan() {
    local -a told words_only folders before
    local word text
    before=("${(@Q)words[2,CURRENT-1]}")
    while IFS=$'\\t' read -r word text; do
        if [[ $word == */ ]]; then
            folders+=("$word")
        elif [[ -n $text ]]; then
            told+=("${word//:/\\\\:}:$text")
        else
            words_only+=("$word")
        fi
    done < <(AOSPLAN_COMPLETE=zsh ${(Q)words[1]} "${before[@]}" "${(Q)PREFIX}" 2>/dev/null)
    (( $#told )) && _describe -V aosplan told
    (( $#words_only )) && compadd -- "${words_only[@]}"
    (( $#folders )) && compadd -S '' -- "${folders[@]}"
}
if [[ $funcstack[1] == _aosplan ]]; then
    _aosplan "$@"
else
    compdef _aosplan aosplan
fi
"""

FISH = """\
function __aosplan_candidates
    set -l before (commandline -opc)
    set -l current (commandline -ct | string unescape)
    env AOSPLAN_COMPLETE=fish $before[1] $before[2..-1] "$current" 2>/dev/null
end
complete --command aosplan --no-files --arguments '(__aosplan_candidates)'
"""

POWERSHELL = """\
Register-ArgumentCompleter -Native -CommandName aosplan -ScriptBlock {
    param($wordToComplete, $commandAst, $cursorPosition)
    $program = $commandAst.GetCommandName()
    # From the program, without a call operator (&) before it, to the cursor.
    $start = $commandAst.CommandElements[0].Extent.StartOffset
    $line = $commandAst.Extent.Text.Substring($start - $commandAst.Extent.StartOffset)
    $length = $cursorPosition - $start
    if ($length -gt $line.Length) { $line = $line.PadRight($length) }
    # Windows PowerShell drops empty arguments, so the line is handed over as a whole.
    $env:AOSPLAN_COMPLETE = 'powershell'
    $env:COMP_LINE = $line.Substring(0, $length)
    $encoding = [Console]::OutputEncoding
    try {
        # An editor without a console refuses an encoding.
        try { [Console]::OutputEncoding = New-Object System.Text.UTF8Encoding $false } catch { }
        & $program 2>$null | ForEach-Object {
            $word, $text = $_ -split "`t", 2
            $shown = if ($word -match '[\\s&;,|<>(){}$@#`"'']') { "'" + $word.Replace("'", "''") + "'" } else { $word }
            $tip = if ($text) { $text } else { $word }
            [System.Management.Automation.CompletionResult]::new($shown, $word, 'ParameterValue', $tip)
        }
    } finally {
        try { [Console]::OutputEncoding = $encoding } catch { }
        Remove-Item 'Env:AOSPLAN_COMPLETE', 'Env:COMP_LINE'
    }
}
"""

SCRIPTS = {"bash": BASH, "zsh": ZSH, "fish": FISH, "powershell": POWERSHELL}
"""The script that each shell has to run at its start."""


def script_of(shell: str) -> str:
    """The completion script of a shell."""
    if shell not in SCRIPTS:
        raise RequestError(f"unknown shell '{shell}'", f"known: {', '.join(SCRIPTS)}")
    return SCRIPTS[shell]


def install(shell: str) -> tuple[str, str]:
    """Write the script of a shell to its usual place.  Returns the path of the file, and an
    instruction for the user.
    """
    from aosplan.files import write_all

    content = script_of(shell).encode()
    home = os.path.expanduser("~")
    data = os.environ.get("XDG_DATA_HOME") or os.path.join(home, ".local", "share")
    settings = os.environ.get("XDG_CONFIG_HOME") or os.path.join(home, ".config")
    path, left = {
        "bash": (
            os.path.join(data, "bash-completion", "completions", "aosplan"),
            "if the package bash-completion is not installed, add to ~/.bashrc: source '{}'",
        ),
        "zsh": (
            os.path.join(home, ".zfunc", "_aosplan"),
            "add to ~/.zshrc: fpath+=~/.zfunc; autoload -Uz compinit; compinit",
        ),
        "fish": (os.path.join(settings, "fish", "completions", "aosplan.fish"), ""),
        "powershell": (
            os.path.join(settings, "aosplan", "completion.ps1"),
            "add to the file that $PROFILE names: . '{}'",
        ),
    }[shell]
    os.makedirs(os.path.dirname(path), exist_ok=True)
    write_all({path: content}, force=True)
    return path, left.format(path)
