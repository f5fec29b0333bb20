"""The command ``aosplan plot``."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from aosplan import __version__
from aosplan import units as q
from aosplan.cli.options import (
    PanelCommand,
    command,
    defaults_option,
    file_argument,
    flag_option,
    json_option,
    request_options,
    text_option,
)
from aosplan.cli.output import print_json, print_warnings, progress_bar, waiting_bar
from aosplan.errors import RequestError
from aosplan.messages import SCHEMA
from aosplan.planning.user_defaults import request_of
from aosplan.show.figures.draw import KINDS, FigureData, FigureKind
from aosplan.show.figures.style import printable
from aosplan.show.figures.sweep_columns import ColumnChoice
from aosplan.show.text.terminal import readable, written_text

if TYPE_CHECKING:
    from aosplan.planning.request import PlanRequest
    from aosplan.show.figures.canvas import FigureStyle


def run(
    *,
    kind: str,
    file: str | None,
    out: str | None,
    dark: bool,
    width_mm: str | None,
    dpi: str | None,
    x: str | None,
    y: str | None,
    value: str | None,
    by: str | None,
    seed: str | None,
    force: bool,
    quiet: bool,
    as_json: bool,
    defaults: str | None,
    **flags: Any,
) -> None:
    """Draw a figure and print its description."""
    from aosplan.files import check_output, write_all
    from aosplan.show.figures.canvas import check_extra, form_of, rendered

    chosen = _kind(kind)
    look = figure_style(dark=dark, width_mm=width_mm, dpi=dpi)
    if out is not None:
        form_of(out)
        check_output(out, force=force)
        check_extra()
    for source, given, names in (
        ("results", (x, y, value, by), "--x, --y, --value and --by"),
        ("paper", (seed,), "--seed"),
    ):
        if chosen.source != source and any(each is not None for each in given):
            users = "sweep" if source == "results" else "paper"
            raise RequestError(
                f"{names} cannot be used with the figure '{chosen.name}'",
                f"give {names} only with aosplan plot {users}",
            )
    shown: FigureData
    if chosen.source == "results":
        shown = _of_results(file, flags, ColumnChoice(x, y, value, by))
    elif chosen.source == "paper":
        chosen, shown = _of_paper(file, flags, seed, quiet=quiet)
    elif chosen.source == "scene":
        shown = _of_scene(chosen, file, flags, quiet=quiet)
    else:
        wanted = request_of(file, flags, defaults=defaults)
        shown = _of_plan(chosen, wanted, os.path.dirname(file or ""), quiet=quiet)
    if out is not None:
        write_all({out: rendered(chosen, shown, form_of(out), look)}, force=force)
    if as_json:
        print_json(document(chosen, shown))
    elif not quiet:
        print(printable(shown.description()))
        print(readable(written_text([out])) if out else "Next: --out figure.png")


def document(kind: FigureKind, shown: FigureData) -> dict[str, Any]:
    """The document that ``plot --json`` prints."""
    return {
        "schema": SCHEMA,
        "version": __version__,
        "kind": kind.name,
        "title": shown.title,
        "description": shown.description(),
        "data": shown.document(),
    }


def figure_style(*, dark: bool, width_mm: str | None = None, dpi: str | None = None) -> FigureStyle:
    """Appearance of a figure from the options."""
    from aosplan.show.figures.canvas import FigureStyle
    from aosplan.show.figures.style import DARK, LIGHT

    look = FigureStyle(DARK if dark else LIGHT)
    if width_mm is not None:
        look = look._replace(width_mm=q.positive(width_mm, "--width-mm", "mm"))
    if dpi is not None:
        look = look._replace(dpi=q.positive(dpi, "--dpi"))
    look.check()
    return look


def _kind(name: str) -> FigureKind:
    for kind in KINDS.values():
        if kind.name.replace("-", "") == name.replace("-", "").lower():
            return kind
    raise RequestError(
        f"unknown kind of figure '{name}'",
        q.nearest_hint(name, KINDS) or f"one of {', '.join(KINDS)}",
    )


def _of_plan(kind: FigureKind, wanted: PlanRequest, folder: str, *, quiet: bool) -> FigureData:
    """The numbers of a figure of a plan."""
    from aosplan.planning.planner import plan

    with progress_bar(quiet=quiet) as bar:
        result = plan(wanted, folder=folder, progress=bar, on_trial=bar.on_trial)
    print_warnings(result.warnings, quiet=quiet)
    from aosplan.show.figures.sources import shown_of_plan

    return shown_of_plan(kind, result)


def _of_scene(
    kind: FigureKind, file: str | None, flags: dict[str, Any], *, quiet: bool
) -> FigureData:
    """The numbers of a figure of a scene.  The scene is given by name or by a request."""
    from aosplan.planning.loaded_scene import load_scene
    from aosplan.planning.request import request_from

    given = {name: value for name, value in flags.items() if value is not None}
    folder = ""
    if file is not None and _is_request(file):
        from aosplan.planning.request_file import read_request

        given, folder = read_request(file) | given, os.path.dirname(file)
    elif file is not None:
        if "scene" in given:
            raise RequestError(
                f"'{file}' and --scene {given['scene']} both give a scene", "give only one of them"
            )
        given["scene"] = file
    if not given:
        raise RequestError("no scene is given", "give a point cloud, a scene file or a preset")
    # A request needs an altitude. These figures do not use it.
    ways = ("altitude", "gsd", "target_size")
    high = any(name in given for name in ways)
    request = request_from(given if high else given | {"altitude": 1.0})
    with progress_bar(quiet=quiet) as bar:
        found = load_scene(request, folder=folder, progress=bar)
    print_warnings(found.warnings, quiet=quiet)
    from aosplan.planning.resolve import altitude_of, camera_of
    from aosplan.show.figures.sources import shown_of_scene

    needs_altitude = high and kind.name == "baseline-curve"
    return shown_of_scene(
        kind,
        found,
        focal_height_m=request.focal_height,
        coverage=request.coverage,
        altitude_m=(
            altitude_of(request, camera_of(request, folder=folder)) if needs_altitude else None
        ),
    )


def _of_results(file: str | None, flags: dict[str, Any], choice: ColumnChoice) -> FigureData:
    """The numbers of a figure of a sweep's results."""
    from aosplan.show.figures.sweep_results import results_of

    _check_unused(flags, "the results of a sweep")
    if file is None:
        raise RequestError(
            "no results of a sweep are given", "give the file that aosplan sweep --out wrote"
        )
    return results_of(file, choice)


def _of_paper(
    number: str | None, flags: dict[str, Any], seed: str | None, *, quiet: bool
) -> tuple[FigureKind, FigureData]:
    """A figure of the paper: how it is drawn, and its numbers."""
    from aosplan.show.figures.paper.registry import (
        FIGURES,
        SEED,
        checked_number,
        kind_of,
        numbers_of,
    )

    _check_unused(flags, "figures of the paper")
    if number is None:
        raise RequestError("no figure of the paper is given", f"one of {', '.join(FIGURES)}")
    found = checked_number(number)
    chosen_seed = SEED if seed is None else q.index(seed, "--seed")
    with waiting_bar(f"Figure {found}", quiet=quiet) as progress:
        return kind_of(found), numbers_of(found, chosen_seed, progress)


def _check_unused(flags: dict[str, Any], what: str) -> None:
    """Refuse options of a plan for figures that do not need a plan."""
    given = next((name for name, found in flags.items() if found is not None), None)
    if given is not None:
        raise RequestError(f"--{given.replace('_', '-')} cannot be used with {what}")


def _is_request(path: str) -> bool:
    """Whether a file is a request or a saved result, instead of a scene."""
    from aosplan.files import read_table

    if not path.lower().endswith((".toml", ".json")):
        return False
    table = read_table(path)
    return "request" in table or any(name in table for name in ("scene", "altitude", "gsd"))


class PlotCommand(PanelCommand):
    """The command; ``plot paper --help`` also lists the figures of the paper."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments, and store whether the help should be about the paper's figures."""
        ctx.meta[PAPER] = "paper" in args[:1]
        return super().parse_args(ctx, args)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Add the options to the help text. For ``plot paper``, add a list of the figures too."""
        super().format_options(ctx, formatter)
        if ctx.meta.get(PAPER):
            from aosplan.show.figures.paper.registry import FIGURES

            with formatter.section("Figures of the paper"):
                formatter.write_dl([(number, entry.described) for number, entry in FIGURES.items()])


PAPER = "aosplan.paper"
"""Key in the context of a command. It is set if the command line begins with ``plot paper``."""

COMMAND = command(
    "plot",
    run,
    PlotCommand,
    summary="Draw a figure of a plan, a scene or a sweep, and describe it in text.",
    examples=(
        "aosplan plot visibility --altitude 40 --out visibility.png\n"
        "aosplan plot correlogram stand.npz --dark --out correlogram.svg\n"
        "aosplan plot paper 7 --out figure-7.png"
    ),
    common=frozenset(),
    parameters=[
        file_argument("kind", "; ".join(f"{k.name}: {k.summary}" for k in KINDS.values()) + "."),
        file_argument(
            "file",
            "Request file or saved plan.  For density, baseline-curve and correlogram, also "
            "a scene.  For sweep, the file that aosplan sweep wrote.  For paper, the number of a "
            "figure (aosplan plot paper --help lists them).",
            required=False,
        ),
        *request_options(),
        defaults_option(),
        text_option("--out", "PATH", "Write the figure: .png, .svg or .pdf.", "Output"),
        text_option("--x", "COLUMN", "Sweep: column of the x axis.  [samples]", "Sweep"),
        text_option("--y", "COLUMN", "Sweep: column of the y axis.  [flight_time_s]", "Sweep"),
        text_option("--value", "COLUMN", "Sweep: column to draw as a map over both axes.", "Sweep"),
        text_option(
            "--by", "COLUMN", "Sweep: column of the colours of points, or of several maps.", "Sweep"
        ),
        text_option("--seed", "N", "Paper: seed of its simulations.  [2019]", "Paper"),
        flag_option("--dark", "Use a dark background."),
        text_option("--width-mm", "MM", "Width of the figure.  [170]", "Output"),
        text_option("--dpi", "N", "Pixels per inch of a .png.  [150]", "Output"),
        flag_option("--force", "Overwrite an existing file."),
        flag_option("--quiet", "Print no description and no warnings."),
        json_option(),
    ],
)
