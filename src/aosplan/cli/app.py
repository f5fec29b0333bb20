"""The command group. It imports a command only when the command is called, and prints errors in one
line.
"""

from __future__ import annotations

import gc
import io
import os
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

from aosplan import __version__
from aosplan.cli.typer_classes import Exit, TyperCommand, TyperException, TyperGroup, TyperOption
from aosplan.errors import AosplanError, RequestError, SurroundingsError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

PANELS = {
    "Plan a flight": {
        "plan": "Compute the baseline and the number of photos, and write a mission.",
        "scene": "Print the share of the ground that a forest hides, and the heights of its occluders.",
        "tradeoff": "Compare plans with different numbers of photos.",
        "simulate": "Check a plan against a simulated forest.",
        "sweep": "Plan many scenarios, and write one row for each.",
        "plot": "Draw a figure of a plan, a scene or a sweep.",
        "export": "Write mission files from a saved plan.",
        "visibility": "Evaluate the equations of visibility.",
    },
    "After the flight": {
        "review": "Compare the photos of a flight with its plan, and plan the missing ones.",
        "thin": "Select the best of many recorded photos.",
        "integrate": "Average recorded photos on a focal plane.",
    },
    "Look things up": {
        "cameras": "List the built-in cameras.",
        "drones": "List the built-in drones.",
        "scenes": "List the built-in scenes.",
        "formats": "List the formats of mission files.",
        "schema": "Print the JSON Schema of the documents.",
    },
}
"""Summaries of the commands, by the groups in which the help lists the commands."""

COMMANDS = {name: text for panel in PANELS.values() for name, text in panel.items()}


class LazyGroup(TyperGroup):
    """A group that has only the summaries of its commands, and imports a command when it is
    called.
    """

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Find the command that is called, and import it."""
        name, command, rest = super().resolve_command(ctx, args)
        if name in COMMANDS:
            command = import_module(f"aosplan.cli.{name}").COMMAND
        return name, command, rest

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002 (the signature is inherited)
        """Write the summaries of the commands, in the groups of the help."""
        for panel, summaries in PANELS.items():
            with formatter.section(panel):
                formatter.write_dl(list(summaries.items()))


def _show_version(_context: Any, _parameter: Any, value: bool) -> None:  # noqa: FBT001
    if value:
        print(f"aosplan {__version__}")
        raise Exit(0)


def _show_completion(_context: Any, _parameter: Any, shell: str | None) -> None:
    if shell is not None:
        from aosplan.cli.completion import script_of

        print(script_of(shell), end="")
        raise Exit(0)


def _install_completion(_context: Any, _parameter: Any, shell: str | None) -> None:
    if shell is not None:
        from aosplan.cli.completion import install
        from aosplan.show.text.terminal import print_notice

        path, left = install(shell)
        print(f"Wrote {path}; it takes effect in the next shell.")
        if left:
            print_notice("hint", left)
        raise Exit(0)


def _immediate_option(
    flag: str, callback: Callable[..., None], help_text: str, **kind: Any
) -> TyperOption:
    """An option that is handled immediately, without a command."""
    return TyperOption(
        param_decls=[flag],
        is_eager=True,
        expose_value=False,
        callback=callback,
        help=help_text,
        **kind,
    )


GROUP = LazyGroup(
    name="aosplan",
    help=(
        "Plan drone flights for airborne optical sectioning: how many photos to take, how far "
        "apart, and where."
    ),
    epilog="Try: aosplan plan --altitude 40 --vhat 0.98",
    commands={
        name: TyperCommand(name, help=text, rich_markup_mode=None)
        for name, text in COMMANDS.items()
    },
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    params=[
        _immediate_option("--version", _show_version, "Print the version.", is_flag=True),
        _immediate_option(
            "--install-completion",
            _install_completion,
            "Install completion of options, presets and files: bash, zsh, fish or powershell.",
            type=str,
            metavar="SHELL",
        ),
        _immediate_option(
            "--show-completion",
            _show_completion,
            "Print the completion script of a shell.",
            type=str,
            metavar="SHELL",
        ),
    ],
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with a status: 0 for success, 1 if the machine failed, 2 if the
    request is wrong.
    """
    exit_quickly(run(arguments))


def exit_quickly(status: int) -> None:
    """Exit without a final garbage collection. The operating system frees the memory."""
    gc.freeze()  # A final garbage collection would take 20 % of the time of a plan.
    sys.exit(status)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status.  Without arguments it prints the help."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given[:1] == ["help"]:
        given = [*given[1:], "--help"]
    _replace_unprintable()
    units = os.environ.get("AOSPLAN_UNITS")
    try:
        _check_unicode(given)
        given = _without_table_units(given)
        if "AOSPLAN_COMPLETE" in os.environ:
            from aosplan.cli.completion import print_candidates

            print_candidates(GROUP)
            sys.stdout.flush()
            return 0
        status = GROUP.main(
            args=given or ["--help"],
            prog_name="aosplan",
            standalone_mode=False,
        )
        sys.stdout.flush()
    except AosplanError as error:
        return _report(error.message, error.hint, error.exit_status)
    except TyperException as error:
        return _report_usage(error)
    except BrokenPipeError:
        return _discard_output()
    except OSError as error:
        failed = SurroundingsError(
            f"{error.filename or 'output'}: {error.strerror or error}".lower()
        )
        return _report(failed.message, "", failed.exit_status)
    except MemoryError:
        return _report("not enough memory for this request", "", 1)
    except KeyboardInterrupt:
        return 130
    except BaseException as error:  # A bug in the program is also reported in one line.
        if _interrupted(error):
            return 130
        if isinstance(error, SystemExit) or os.environ.get("AOSPLAN_DEBUG"):
            raise
        return _report(
            f"unexpected {type(error).__name__}: {error}",
            "this is an error in aosplan; please report it together with the command line; "
            "AOSPLAN_DEBUG=1 prints the traceback",
            1,
        )
    finally:
        # `--units` applies to one command only.
        if units is None:
            os.environ.pop("AOSPLAN_UNITS", None)
        else:
            os.environ["AOSPLAN_UNITS"] = units
    return status if isinstance(status, int) else 0


def _without_table_units(arguments: Sequence[str]) -> list[str]:
    """Take ``--units imperial`` and ``--units metric`` out of the arguments of any command.

    These values set the units of tables.  Other values of ``--units`` are the unit of a point
    cloud or a raster, which the command reads.
    """
    rest = list(arguments)
    for value in ("imperial", "metric"):
        for words in (["--units", value], [f"--units={value}"]):
            for place in range(len(rest) - len(words), -1, -1):
                if rest[place : place + len(words)] == words and "--" not in rest[:place]:
                    del rest[place : place + len(words)]
                    os.environ["AOSPLAN_UNITS"] = value
    return rest


def _check_unicode(arguments: Sequence[str]) -> None:
    """Refuse arguments that are not Unicode, because they could not be printed or written."""
    for argument in arguments:
        try:
            argument.encode()
        except UnicodeEncodeError:
            raise RequestError(
                f"argument {argument!r} is not Unicode text", "give the file another name"
            ) from None


def _interrupted(error: BaseException | None) -> bool:
    """Whether Ctrl-C is the cause of an error. If Ctrl-C is pressed while a class is created,
    Python raises another exception, with KeyboardInterrupt as its cause.
    """
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _replace_unprintable() -> None:
    """Replace characters that a stream cannot show.  For example, without UTF-8, ``≥`` becomes
    ``>=`` and V̂ becomes ``V^``.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # This setting is for text that is not valid Unicode, for example in file names.
            errors = "replace"
            if not stream.encoding.lower().startswith("utf"):
                from aosplan.show.text.terminal import HANDLER

                errors = HANDLER
            stream.reconfigure(errors=errors)


def _report(message: str, hint: str, status: int) -> int:
    from aosplan.show.text.terminal import print_notice

    try:
        print_notice("error", _one_line(message))
        if hint:
            print_notice("hint", _one_line(hint))
    except OSError:
        _discard_output()
    return status


def _discard_output() -> int:
    """Discard the buffers of streams that are closed or full. Otherwise, Python would raise further
    errors at exit.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(nowhere, stream.fileno())
    return 1


def _report_usage(error: TyperException) -> int:
    """Report a mistake in the options, with the message of the parser."""
    message = error.format_message().rstrip(".")
    hint = ""
    for mark in (" Did you mean ", " (Possible options: "):
        before, found, after = message.partition(mark)
        if found:
            message, hint = before.rstrip("."), f"did you mean {after.rstrip('?)')}?"
    return _report(message[:1].lower() + message[1:], hint, 2)


LONGEST_WORD = 200
"""Largest number of characters of a word in a message.  Longer words are shortened in the
middle.
"""


def _one_line(text: str) -> str:
    """Text without line breaks and control characters.  Names from files may contain such
    characters.
    """
    if len(text) > LONGEST_WORD:
        text = " ".join(
            word if len(word) <= LONGEST_WORD else f"{word[:100]}…{word[-60:]}"
            for word in text.split(" ")
        )
    return "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
