"""``aosplan export``: mission files from a saved plan."""

from __future__ import annotations

from aosplan.cli.options import command, file_argument, output_options
from aosplan.cli.output import chosen_outputs, write_outputs
from aosplan.errors import RequestError


def run(
    *,
    plan: str,
    out: list[str] | None,
    format: str | None,  # noqa: A002 (the option's name)
    force: bool,
    quiet: bool,
) -> None:
    """Write the waypoints of a saved plan without solving it again."""
    chosen = chosen_outputs(out or [], format, force=force)
    if not chosen:
        raise RequestError("no output is given", "give --out plan.csv, or another --out PATH")
    from aosplan.postflight.saved_missions import read_saved_missions

    missions = read_saved_missions(plan, [form for form, _ in chosen])
    written = write_outputs(lambda: missions, chosen, force=force, quiet=quiet)
    if not quiet and "-" not in written:
        from aosplan.show.text.terminal import readable, written_text

        print(readable(written_text(written)))


COMMAND = command(
    "export",
    run,
    summary="Write mission files from a plan that `plan --json` saved, without planning again.",
    examples=(
        "aosplan export plan.json --out plan.csv\n"
        "aosplan export plan.json --out plan.geojson --out csv:grid.txt --force\n"
        "aosplan export grid.kmz --out grid.geojson"
    ),
    parameters=[
        file_argument(
            "plan",
            "Output of `aosplan plan --json`, or a mission file (.waypoints, .plan, .kmz, "
            ".mavlink, .csv).",
        ),
        *[option for option in output_options() if option.name != "as_json"],
    ],
)
