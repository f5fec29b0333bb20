"""Options that several commands have in common. They are created from the table of a request's
options.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aosplan.cli.typer_classes import Exit, TyperArgument, TyperCommand, TyperOption
from aosplan.planning.options import BY_NAME, OPTIONS, Option

if TYPE_CHECKING:
    from collections.abc import Callable


SHORT_HELP = frozenset(
    {
        "altitude",
        "gsd",
        "vhat",
        "visibility",
        "find",
        "scene",
        "density",
        "occluder_size",
        "volume_height",
        "camera",
        "optimize",
        "within",
        "max_samples",
        "grid",
        "origin",
        "heading",
        "area",
        "no_fly",
        "drone",
        "speed",
        "terrain",
    }
)
"""Options of a plan that ``--help`` shows.  ``--help-all`` shows every option."""

ALL = "aosplan.help_all"
"""Key in the context of a command. It is set if the help shows every option."""


class PanelCommand(TyperCommand):
    """A command whose help groups its options and ends with examples.

    The short help leaves out the options of a plan that are not in `common`.
    """

    common: frozenset[str] | None = None

    def is_hidden(self, parameter: Any) -> bool:
        """Whether the short help leaves out a parameter."""
        common = self.common
        return common is not None and parameter.name in BY_NAME and parameter.name not in common

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the options by panel."""
        panels: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.get_params(ctx):
            if not ctx.meta.get(ALL) and self.is_hidden(parameter):
                continue
            record = parameter.get_help_record(ctx)
            if record is not None:
                panel = getattr(parameter, "rich_help_panel", None) or "Options"
                panels.setdefault(panel, []).append(record)
        for panel, records in panels.items():
            with formatter.section(panel):
                formatter.write_dl(records)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002 (the signature is inherited)
        """Write the examples without wrapping."""
        if self.epilog:
            formatter.write("\nExamples:\n")
            for line in self.epilog.splitlines():
                formatter.write(f"  {line}\n")


def command(
    name: str,
    callback: Callable[..., None],
    kind: type[PanelCommand] = PanelCommand,
    *,
    summary: str,
    examples: str,
    parameters: list[Any],
    common: frozenset[str] | None = None,
) -> PanelCommand:
    """Create a command from its function and its parameters.

    Parameters
    ----------
    name, callback, summary, examples, parameters
        Properties of the command.
    kind
        Class of the command, if its help differs.
    common
        Options of a plan that the short help shows.  If it is None, the help shows all options, and
        there is no ``--help-all``.
    """
    made = kind(
        name,
        callback=callback,
        help=summary,
        epilog=examples,
        params=parameters,
        rich_markup_mode=None,
    )
    if common is not None:
        made.common = common
        hidden = sum(map(made.is_hidden, parameters))
        made.params.append(_help_all(hidden))
    return made


def _help_all(hidden: int) -> TyperOption:
    """``--help-all``."""
    return TyperOption(
        param_decls=["--help-all"],
        is_flag=True,
        is_eager=True,
        expose_value=False,
        callback=_show_all,
        help=f"Show this help with {hidden} more options of a plan.",
    )


def _show_all(ctx: Any, _parameter: Any, value: bool) -> None:  # noqa: FBT001
    if value:
        ctx.meta[ALL] = True
        print(ctx.get_help())
        raise Exit(0)


def text_option(flag: str, metavar: str, help_text: str, panel: str = "Options") -> TyperOption:
    """An option whose value is text.  The text is parsed later, by aosplan and not by click."""
    return TyperOption(
        param_decls=[flag], type=str, metavar=metavar, help=help_text, rich_help_panel=panel
    )


def flag_option(
    flag: str, help_text: str, panel: str = "Output", *, default: bool | None = False
) -> TyperOption:
    """An option without a value."""
    return TyperOption(
        param_decls=[flag], is_flag=True, default=default, help=help_text, rich_help_panel=panel
    )


def file_argument(name: str, help_text: str, *, required: bool = True) -> TyperArgument:
    """A positional file name."""
    return TyperArgument(
        param_decls=[name], type=str, required=required, metavar=name.upper(), help=help_text
    )


def request_options(only: Callable[[Option], bool] = lambda _: True) -> list[TyperOption]:
    """The options of a plan's request.  If an option is not given, its value is None."""
    return [
        flag_option(option.flag, option.help, option.panel, default=None)
        if option.kind == "flag"
        else text_option(option.flag, option.metavar, option.help, option.panel)
        for option in OPTIONS
        if only(option)
    ]


def positions_argument() -> TyperArgument:
    """The positions of photos."""
    return file_argument(
        "positions",
        "Positions of the photos: a folder of photos, a mission file (.waypoints, .plan, "
        ".kmz, .mavlink), a CSV or a .geojson.",
    )


def request_argument() -> TyperArgument:
    """A request file, which is not required."""
    return file_argument(
        "request",
        "Request file (TOML or JSON) or saved plan.  Options override its values.",
        required=False,
    )


def defaults_option() -> TyperOption:
    """``--defaults``."""
    return text_option(
        "--defaults",
        "FILE|none",
        "File with your own defaults.  [aosplan/defaults.toml in the folder for settings]",
    )


def output_options() -> list[TyperOption]:
    """The options of commands that write waypoints."""
    return [
        TyperOption(
            param_decls=["--out"],
            type=str,
            multiple=True,
            metavar="PATH",
            help="Write a mission file.  The extension or NAME:PATH selects the format.  "
            "Repeatable.",
            rich_help_panel="Output",
        ),
        text_option(
            "--format", "NAME", "Format of the mission file, for a single --out.", "Output"
        ),
        flag_option("--force", "Overwrite existing files."),
        flag_option("--quiet", "Print no table and no hints."),
        json_option(),
    ]


def json_option() -> TyperOption:
    """``--json``."""
    return TyperOption(
        param_decls=["as_json", "--json"],
        is_flag=True,
        default=False,
        help="Print the result as a JSON document.",
        rich_help_panel="Output",
    )
