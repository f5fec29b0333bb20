"""The command ``aosplan sweep``."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan import __version__
from aosplan.cli.options import (
    command,
    defaults_option,
    file_argument,
    flag_option,
    json_option,
    text_option,
)
from aosplan.cli.output import print_json, shown_live, waiting_bar
from aosplan.cli.simulate import read_settings
from aosplan.cli.typer_classes import TyperOption
from aosplan.errors import RequestError
from aosplan.files import check_output
from aosplan.messages import SCHEMA
from aosplan.planning.user_defaults import find_defaults, read_defaults
from aosplan.show.figures.sweep_columns import ColumnChoice
from aosplan.show.text.terminal import print_notice, readable, written_text
from aosplan.units import whole

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from aosplan.simulation.compare import Settings
    from aosplan.sweeps.aggregate import Aggregation
    from aosplan.sweeps.scenarios import ScenarioProduct, ScenarioTable
    from aosplan.sweeps.summary import Aggregates, AggregationPlan
    from aosplan.sweeps.sweep import Sweep
    from aosplan.sweeps.verify import Verification

MOST_SCENARIOS = 1_000_000_000
"""Largest number of scenarios that is started without ``--yes``."""


def run(
    *,
    file: str,
    out: str | None,
    columns: str | None,
    where: str | None,
    best: str | None,
    per: list[str] | None,
    summary: bool,
    simulate: str | None,
    seed: str | None,
    precision: str | None,
    workers: str | None,
    scheduler: str | None,
    resume: bool,
    force: bool,
    yes: bool,
    quiet: bool,
    plot: str | None,
    plot_x: str | None,
    plot_y: str | None,
    plot_value: str | None,
    plot_by: str | None,
    as_json: bool,
    defaults: str | None,
) -> None:
    """Solve every scenario of a file, and write one row for each or print a summary."""
    from aosplan.sweeps.run import run as run_sweep
    from aosplan.sweeps.run import summarise
    from aosplan.sweeps.scenarios import read_scenarios
    from aosplan.sweeps.solve_block import chosen_results
    from aosplan.sweeps.sweep import Sweep, check

    sampled = verify_options(simulate, seed, precision)
    told = summary or sampled is not None
    if as_json and not told:
        raise RequestError(
            "--json needs --summary or --simulate", "give one of these options as well"
        )
    if out is not None:
        _check_out(out, best, resume=resume, force=force)
    elif not told or plot is not None or scheduler is not None:
        need = "" if not told else " for --plot" if plot is not None else " for --scheduler"
        raise RequestError(
            f"no output is given{need}", f"give --out results.csv{'' if told else ', or --summary'}"
        )
    if scheduler is not None and workers is not None:
        raise RequestError(
            "--scheduler and --workers contradict each other",
            "leave --workers out, because a cluster has its own workers",
        )
    if per and best is None:
        raise RequestError(
            "--per needs --best", "give --best COLUMN, which decides which row is kept"
        )
    scenarios = read_scenarios(file)
    own = find_defaults(defaults)
    if own is not None:
        from aosplan.sweeps.user_defaults import with_defaults

        scenarios = with_defaults(scenarios, read_defaults(own), own, os.path.dirname(file))
    if scenarios.rows > MOST_SCENARIOS and not yes:
        raise RequestError(
            f"'{file}' has {scenarios.rows} scenarios, more than {MOST_SCENARIOS}",
            "leave values out, or give --yes to plan all of them; --where and --best make "
            "the result smaller",
        )
    sweep = Sweep(
        scenarios,
        chosen_results(columns, finds="find" in scenarios.names),
        os.path.dirname(os.path.abspath(file)),
        where,
        best,
        tuple(name for text in per or [] for name in text.split(",")),
        aggregation_plan(scenarios, best, sampled) if told else None,
    )
    check(sweep)
    choice = ColumnChoice(plot_x, plot_y, plot_value, plot_by)
    if plot is not None:
        _check_plot(plot, sweep.names, choice, force=force)
    elif any(choice):
        raise RequestError("--plot-x, --plot-y, --plot-value and --plot-by need --plot")
    common: dict[str, Any] = {
        "resume": resume,
        "force": force,
        "workers": 1 if workers is None else whole(workers, "--workers"),
    }
    with _bar(scenarios.rows, quiet=quiet) as advance, _hint_if_interrupted():
        if out is not None:
            rows, gathering = run_sweep(sweep, out, **common, scheduler=scheduler, progress=advance)
        else:
            rows, gathering = 0, summarise(sweep, f"{file}.gathered", **common, progress=advance)
    if gathering is not None:
        verify_and_print(sweep, gathering, sampled, summary=summary, quiet=quiet, as_json=as_json)
    if out is not None:
        quiet = quiet or as_json
        if not quiet:
            print(readable(f"Wrote {out}: {rows} rows of {scenarios.rows} scenarios"))
        if plot is not None:
            _draw(plot, out, choice, force=force, quiet=quiet)


def _check_out(out: str, best: str | None, *, resume: bool, force: bool) -> None:
    """Refuse a result that cannot be written."""
    from aosplan.sweeps.parquet_folder import check_folder, is_folder
    from aosplan.sweeps.sweep import SUFFIXES

    if is_folder(out):
        check_folder(out, resume=resume, force=force)
        if best is not None:
            raise RequestError(
                "--best cannot be used with a folder, because a folder has one file for each "
                "part of the sweep",
                "give one file: --out best.parquet",
            )
    elif os.path.splitext(out)[1].lower() not in SUFFIXES:
        raise RequestError(
            f"output '{out}' does not have one of the extensions {', '.join(SUFFIXES)}",
            f"for a folder of Parquet files, write {out}/",
        )
    else:
        check_output(out, force=force)


@contextlib.contextmanager
def _hint_if_interrupted() -> Iterator[None]:
    """Context manager that prints the path of the finished results if the work is interrupted."""
    try:
        yield
    except KeyboardInterrupt:
        print_notice("hint", "finished parts are kept; --resume continues the sweep")
        raise


def _check_plot(plot: str, names: list[str], choice: ColumnChoice, *, force: bool) -> None:
    """Refuse a figure that cannot be drawn, before anything is solved."""
    from aosplan.show.figures.canvas import check_extra, form_of
    from aosplan.show.figures.sweep_columns import check_columns

    form_of(plot)
    check_output(plot, force=force)
    check_extra()
    check_columns(names, choice, flags="--plot-")


def _draw(plot: str, results: str, choice: ColumnChoice, *, force: bool, quiet: bool) -> None:
    from aosplan.files import write_all
    from aosplan.show.figures.canvas import form_of, rendered
    from aosplan.show.figures.draw import KINDS
    from aosplan.show.figures.style import printable
    from aosplan.show.figures.sweep_results import results_of

    shown = results_of(results, choice)
    write_all({plot: rendered(KINDS["sweep"], shown, form_of(plot))}, force=force)
    if not quiet:
        print(printable(shown.description()))
        print(readable(written_text([plot])))


@contextlib.contextmanager
def _bar(total: int, *, quiet: bool) -> Iterator[Callable[[int], None] | None]:
    """A progress bar with rate and remaining time on stderr, if stderr is a terminal."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        ProgressColumn,
        Task,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        """Column of the progress bar with the number of scenarios per second."""

        def render(self, task: Task) -> Text:
            speed = task.finished_speed or task.speed
            return Text("" if speed is None else f"{speed:,.0f} a second")

    shown = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        Rate(),
        TimeRemainingColumn(),
    )
    with shown_live(Progress(*shown, console=Console(stderr=True), transient=True)) as progress:
        task = progress.add_task("scenarios", total=total)
        yield lambda done: progress.advance(task, done)


COMMAND = command(
    "sweep",
    run,
    summary="Plan many scenarios, and write one row for each or print a summary.",
    examples=(
        "aosplan sweep campaign.toml --summary --simulate 20\n"
        'aosplan sweep campaign.toml --out best.csv --where "samples <= 100" \\\n'
        "    --best -flight_time_s --per altitude\n"
        "aosplan sweep campaign.toml --scheduler head:8786 \\\n"
        "    --out /shared/results.parquet/"
    ),
    parameters=[
        file_argument(
            "file",
            "TOML file with a table [sweep] of options, or a CSV or Parquet file with one "
            "scenario per row.",
        ),
        text_option(
            "--out",
            "PATH",
            "Write the rows: .csv, .parquet, .jsonl, or a folder of Parquet files if PATH "
            "ends in /.",
            "Output",
        ),
        text_option("--plot", "PATH", "Draw the result: .png, .svg or .pdf.", "Output"),
        text_option("--plot-x", "COLUMN", "Column of the x axis.  [samples]", "Output"),
        text_option("--plot-y", "COLUMN", "Column of the y axis.  [flight_time_s]", "Output"),
        text_option("--plot-value", "COLUMN", "Column to draw as a map over both axes.", "Output"),
        text_option(
            "--plot-by", "COLUMN", "Column of the colours of points, or of several maps.", "Output"
        ),
        text_option(
            "--columns",
            "LIST|all",
            "Columns of results to write, separated by commas.  [a standard selection]",
            "Output",
        ),
        text_option(
            "--where",
            "SQL",
            "Keep only the rows that meet this condition, such as 'samples <= 49'.",
            "Output",
        ),
        text_option(
            "--best",
            "[-]COLUMN",
            "Keep only the row with the largest value of this column (-COLUMN: with the smallest).",
            "Output",
        ),
        TyperOption(
            param_decls=["--per"],
            type=str,
            multiple=True,
            metavar="COLUMNS",
            help="With --best: keep one row for each combination of values of these columns.",
            rich_help_panel="Output",
        ),
        flag_option(
            "--summary",
            "Print a summary: numbers of rows, smallest and largest results, and shares for each "
            "input.  Does not need --out.",
        ),
        text_option(
            "--simulate",
            "N",
            "Simulate N of the feasible rows, including those with the smallest and largest results.",
            "Simulation",
        ),
        text_option(
            "--seed",
            "N",
            "Random seed of the selection of rows and of their simulations.  [1]",
            "Simulation",
        ),
        text_option(
            "--precision",
            "X",
            "Standard error of V and V̂ in each simulation.  [0.005]",
            "Simulation",
        ),
        defaults_option(),
        text_option("--workers", "N", "Number of processes.  [1]"),
        text_option(
            "--scheduler",
            "HOST:PORT",
            "Use the Dask cluster whose scheduler has this address.  All workers must see "
            "--out under the same path.",
        ),
        flag_option(
            "--resume",
            "Continue an interrupted sweep, or repair damaged parts of a folder.",
            "Options",
        ),
        flag_option("--yes", f"Allow more than {MOST_SCENARIOS} scenarios.", "Options"),
        flag_option("--force", "Overwrite an existing file, and discard an interrupted sweep."),
        flag_option("--quiet", "Print no progress bar, no table and no message."),
        json_option(),
    ],
)


def verify_options(
    simulate: str | None, seed: str | None, precision: str | None
) -> VerifyOptions | None:
    """The settings that ``--simulate`` and its options give; None without ``--simulate``."""
    if simulate is None:
        for option, value in (("--seed", seed), ("--precision", precision)):
            if value is not None:
                raise RequestError(
                    f"{option} needs --simulate", "give --simulate N, where N is the number of rows"
                )
        return None
    from aosplan.simulation.compare import Settings
    from aosplan.sweeps.verify import MOST_ROWS

    rows = whole(simulate, "--simulate")
    if rows > MOST_ROWS:
        raise RequestError(
            f"--simulate {simulate} is more than the {MOST_ROWS} rows that are possible"
        )
    return VerifyOptions(rows, read_settings(Settings(), seed, precision))


class VerifyOptions(NamedTuple):
    """Number of rows to simulate, and settings of the simulation."""

    rows: int
    settings: Settings


def aggregation_plan(
    scenarios: ScenarioProduct | ScenarioTable, best: str | None, simulated: VerifyOptions | None
) -> AggregationPlan:
    """The summary to compute for a sweep, and the rows to sample if they will be simulated."""
    from aosplan.sweeps.grouping import grouping
    from aosplan.sweeps.summary import AggregationPlan
    from aosplan.sweeps.verify import SamplingPlan

    found = grouping(scenarios, best)
    if simulated is None:
        return AggregationPlan(found)
    return AggregationPlan(
        found, SamplingPlan(simulated.rows, simulated.settings.seed, found.groups)
    )


def _verified(
    sweep: Sweep, gathered: Aggregates, simulated: VerifyOptions, *, quiet: bool
) -> Verification:
    """Simulate the rows that were sampled at random."""
    from aosplan.sweeps.verify import verify

    assert sweep.gather is not None  # If rows are drawn, `gather` is set.
    assert sweep.gather.drawing is not None
    with waiting_bar("simulating", quiet=quiet) as progress:
        return verify(
            sweep.scenarios,
            gathered.draw,
            sweep.gather.drawing,
            simulated.settings,
            sweep.folder,
            progress=progress,
        )


def verify_and_print(
    sweep: Sweep,
    gathering: Aggregation,
    simulated: VerifyOptions | None,
    *,
    summary: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Simulate the sampled rows, and print the summary as a document or as tables."""
    from aosplan.sweeps.summary import summary_document

    assert sweep.gather is not None  # The caller has computed a summary, so `gather` is set.
    verification = None
    if simulated is not None:
        try:
            verification = _verified(sweep, gathering.gathered, simulated, quiet=quiet)
        except KeyboardInterrupt:
            if gathering.write():
                print_notice("hint", "--resume continues the simulation")
            raise
    gathering.remove()
    document = {
        "schema": SCHEMA,
        "version": __version__,
        "where": sweep.where,
        **summary_document(gathering.gathered.summary, sweep.gather.grouping, sweep.scenarios),
        "verification": verification and verification.document(),
    }
    if as_json:
        print_json(document)
    elif not quiet:
        from aosplan.show.text.sweep_tables import print_summary, print_verification

        if summary:
            print_summary(document)
        if verification is not None:
            print_verification(document["verification"])
