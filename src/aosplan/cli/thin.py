"""The command ``aosplan thin``."""

from __future__ import annotations

import os
from typing import Any

from aosplan.cli.options import (
    command,
    defaults_option,
    flag_option,
    json_option,
    positions_argument,
    request_argument,
    request_options,
    text_option,
)
from aosplan.cli.output import print_json, print_warnings, waiting_bar
from aosplan.errors import RequestError
from aosplan.planning.options import SHOWING


def run(
    *,
    positions: str,
    request: str | None,
    samples: str | None,
    best: str | None,
    out: str | None,
    force: bool,
    quiet: bool,
    as_json: bool,
    defaults: str | None,
    **flags: Any,
) -> None:
    """Choose the views that share the fewest occluders."""
    from aosplan.files import check_output, write_all
    from aosplan.planning.user_defaults import request_of
    from aosplan.units import one_of, whole

    if samples is None:
        raise RequestError("--samples N is needed", "N is the number of photos to select")
    count = whole(samples, "--samples")
    wanted = request_of(request, flags, defaults=defaults)
    if out is not None:
        check_output(out, force=force)
        if out == "-" and as_json:
            raise RequestError("--json and --out - both write to stdout", "give one of them")
    from aosplan.postflight.thin import QUANTITIES, thin_views
    from aosplan.postflight.views import read_views

    quantity = one_of(QUANTITIES)(best or QUANTITIES[0], "--best")

    views = read_views(positions, on_earth=wanted.origin is not None)
    with waiting_bar("choosing views", quiet=quiet) as progress:
        found = thin_views(
            wanted,
            views,
            count,
            best=quantity,
            folder=os.path.dirname(request or ""),
            progress=progress,
        )
    print_warnings(found.warnings, quiet=quiet)
    if out is not None:
        write_all({out: found.render()}, force=force)
    if as_json:
        print_json(found.document())
    elif not quiet and out != "-":
        from aosplan.show.text.tables import one_line, print_predictions, show

        print_predictions(
            {
                f"all {len(views)}": (len(views), found.every),
                f"best {count}": (count, found.kept),
                f"{count} independent": (count, found.bound),
            }
        )
        show(
            one_line(""),
            one_line(
                f"independent: {count} photos that share no occluder; their V̂ is an upper limit"
            ),
        )
        if found.detection is not None:
            every, kept = found.detection
            show(
                one_line(
                    f"Probability of detection: {kept:.0%} with the selected photos, "
                    f"{every:.0%} with all photos"
                )
            )
        show(one_line(""), one_line(f"Wrote {out}" if out else "Next: --out kept.csv"))


COMMAND = command(
    "thin",
    run,
    summary="Select the best N of many recorded photos: those that share the fewest occluders.",
    examples=(
        "aosplan thin views.csv plan.json --samples 50 --out kept.csv\n"
        "aosplan thin photos/ --samples 25 --altitude 35 --scene stand.laz --json"
    ),
    common=frozenset({"samples"}),
    parameters=[
        positions_argument(),
        request_argument(),
        text_option("--samples", "N", "Number of photos to select."),
        text_option(
            "--best",
            "WHAT",
            "Quantity to maximise: normalized (V̂), visibility (V), or similarity (to the "
            "integral of all photos).  [normalized]",
        ),
        *request_options(lambda option: option.name in SHOWING),
        defaults_option(),
        text_option(
            "--out",
            "PATH",
            "Write the positions (and file names) of the selected photos as CSV.",
            "Output",
        ),
        flag_option("--force", "Overwrite an existing file."),
        flag_option("--quiet", "Print no table and no hints."),
        json_option(),
    ],
)
