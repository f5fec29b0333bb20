"""``aosplan plan``."""

from __future__ import annotations

import os
from typing import Any

from aosplan.cli.options import (
    command,
    defaults_option,
    file_argument,
    output_options,
    request_options,
)
from aosplan.cli.output import (
    chosen_outputs,
    print_json,
    print_warnings,
    progress_bar,
    write_outputs,
    writes_stdout,
)
from aosplan.defaults import request_of
from aosplan.errors import RequestError
from aosplan.planning import plan


def run(
    *,
    request: str | None,
    out: list[str] | None,
    format: str | None,  # noqa: A002 (the option's name)
    force: bool,
    quiet: bool,
    as_json: bool,
    defaults: str | None,
    **flags: Any,
) -> None:
    """Plan a flight, write it and show it."""
    wanted = request_of(request, flags, defaults=defaults)
    chosen = chosen_outputs(out or [], format, force=force)
    to_stdout = writes_stdout(chosen, as_json=as_json)
    if wanted.origin is None and wanted.area is None:
        for form, path in chosen:
            if form.needs_place:
                raise RequestError(
                    f"output '{path}': {form.title} needs a place on earth",
                    "give --origin LAT,LON or --area FILE, or write CSV",
                )
    with progress_bar(wanted.scene or "", quiet=quiet) as progress:
        result = plan(wanted, folder=os.path.dirname(request or ""), progress=progress)
    print_warnings(result.warnings, quiet=quiet)
    written = write_outputs(result.missions, chosen, force=force, quiet=quiet)
    if as_json:
        print_json(result.document())
    elif not (quiet or to_stdout):
        from aosplan.cli.tables import print_plan

        print_plan(result, written)


COMMAND = command(
    "plan",
    run,
    summary="Solve for the baseline and the number of photos, and write the grid to fly.",
    examples=(
        "aosplan plan --altitude 40 --vhat 0.98\n"
        "aosplan plan --altitude 50 --scene stand.laz --model uniform \\\n"
        "    --origin 48.3358,14.3261 --heading 30 --out plan.geojson --out plan.csv"
    ),
    parameters=[
        file_argument(
            "request",
            "Request file (TOML or JSON), or an earlier result; flags override it.",
            required=False,
        ),
        *request_options(),
        defaults_option(),
        *output_options(),
    ],
)
