"""The command ``aosplan tradeoff``."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from aosplan.cli.options import (
    SHORT_HELP,
    command,
    defaults_option,
    flag_option,
    json_option,
    request_argument,
    request_options,
    text_option,
)
from aosplan.cli.output import print_json, print_warnings, progress_bar
from aosplan.errors import RequestError
from aosplan.planning.user_defaults import request_of

if TYPE_CHECKING:
    from collections.abc import Sequence

EXTENSIONS = (".csv", ".json", ".jsonl")


def run(
    *,
    request: str | None,
    out: str | None,
    force: bool,
    quiet: bool,
    as_json: bool,
    defaults: str | None,
    **flags: Any,
) -> None:
    """Show cost and benefit by number of samples, for every requested kind of grid."""
    from aosplan.files import check_output, write_all
    from aosplan.planning.planner import plan

    wanted = request_of(request, flags, defaults=defaults)
    if out is not None:
        if not out.lower().endswith(EXTENSIONS):
            raise RequestError(f"--out '{out}' does not end in {', '.join(EXTENSIONS)}")
        check_output(out, force=force)
    with progress_bar(quiet=quiet) as bar:
        folder = os.path.dirname(request or "")
        chosen = plan(wanted, folder=folder, progress=bar, on_trial=bar.on_trial)
        document = chosen.tradeoff_document(chosen.tradeoff())
    print_warnings(chosen.warnings, quiet=quiet)
    rows = document["rows"]
    if out is not None:
        write_all({out: _file_content(document, rows, out)}, force=force)
    if as_json:
        print_json(document)
    elif not quiet:
        _print_table(rows, out)


def _file_content(document: dict[str, Any], rows: Sequence[dict[str, Any]], path: str) -> bytes:
    import json

    if path.lower().endswith(".json"):
        return (json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1) + "\n").encode()
    if path.lower().endswith(".jsonl"):
        return "".join(json.dumps(row, allow_nan=False) + "\n" for row in rows).encode()
    lines = [",".join(rows[0]), *(",".join(map(_cell, row.values())) for row in rows)]
    return ("\n".join(lines) + "\n").encode()


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _print_table(rows: Sequence[dict[str, Any]], out: str | None) -> None:
    """Print the Pareto front and the row of the plan as a table. If no row meets the target, all
    rows are printed.
    """
    from aosplan.show.text.tables import one_line, print_rows, show

    shown = [row for row in rows if row["front"] or row["chosen"]] or rows
    last = "found" if "detection" in shown[0] else "contrast"
    header = ("grid", "N", "b [m]", "extent [m]", "path [m]", "time [s]", "V", "V̂", last, "")
    print_rows(header, [_table_row(row) for row in shown])
    note = (
        f"{len(rows)} rows.  The table shows the rows that no other row surpasses in all "
        "columns, and the row of the plan"
    )
    show(
        one_line(""),
        one_line(f"{note} (◀)."),
        one_line(f"Wrote {out}" if out else "Next: --out table.csv"),
    )


def _table_row(row: dict[str, Any]) -> list[str]:
    def number(name: str, form: str) -> str:
        return "-" if row[name] is None else format(row[name], form)

    return [
        row["grid"],
        str(row["samples"]),
        number("baseline_m", ".3g"),
        f"{row['extent_x_m']:.1f} x {row['extent_y_m']:.1f}",
        number("length_m", ".0f"),
        number("time_s", ".0f"),
        number("expected", ".4f"),
        number("normalized", ".4f"),
        number("detection", ".0%") if "detection" in row else number("contrast", ".3g"),
        "◀" if row["chosen"] else "",
    ]


COMMAND = command(
    "tradeoff",
    run,
    summary="Compare plans with different numbers of photos: baseline, extent, flight time and "
    "visibility.",
    examples=(
        "aosplan tradeoff --altitude 40 --vhat 0.98 --out table.csv\n"
        "aosplan tradeoff --altitude 50 --scene stand.laz --vhat 0.8 \\\n"
        "    --grid best --json"
    ),
    common=SHORT_HELP,
    parameters=[
        request_argument(),
        *request_options(),
        defaults_option(),
        text_option("--out", "PATH", "Write all rows: .csv, .json or .jsonl.", "Output"),
        flag_option("--force", "Overwrite an existing file."),
        flag_option("--quiet", "Print no table and no hints."),
        json_option(),
    ],
)
