"""``aosplan export``: files from a saved plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.cli.options import command, file_argument, output_options
from aosplan.cli.output import chosen_outputs, write_outputs
from aosplan.errors import RequestError

if TYPE_CHECKING:
    from aosplan.mission.format import Format
    from aosplan.mission.mission import Mission

MISSION_ENDINGS = (".waypoints", ".plan", ".kmz", ".mavlink", ".csv")
"""Endings of mission files; of ``.csv`` Litchi's, or any with latitudes and longitudes."""


def run(
    *,
    plan: str,
    out: list[str] | None,
    format: str | None,  # noqa: A002 (the option's name)
    force: bool,
    quiet: bool,
) -> None:
    """Write a saved plan's waypoints without solving again."""
    chosen = chosen_outputs(out or [], format, force=force)
    if not chosen:
        raise RequestError("no output is given", "give --out plan.csv, or another --out PATH")
    missions = _missions(plan, [form for form, _ in chosen])
    written = write_outputs(lambda: missions, chosen, force=force, quiet=quiet)
    if not quiet and "-" not in written:
        from aosplan.show.text.terminal import readable, wrote

        print(readable(wrote(written)))


def _missions(path: str, chosen: list[Format]) -> tuple[Mission, ...]:
    """The missions of a saved plan; of a mission file its sites, for files that are not flown."""
    if not path.lower().endswith(MISSION_ENDINGS):
        from aosplan.planning.saved_plan import read_missions

        return read_missions(path)
    from aosplan.postflight.mission_file import read_mission_file

    flown = [form.title for form in chosen if form.flown_by]
    if flown:
        raise RequestError(
            f"'{path}' is a mission file, of which the sites are read alone: {flown[0]} needs speeds "
            "and the camera too",
            "write .csv, .geojson or .kml, or export the plan.json that the mission is from",
        )
    return (read_mission_file(path),)


COMMAND = command(
    "export",
    run,
    summary="Write files from a plan saved by `plan --json`, without solving again.",
    examples=(
        "aosplan export plan.json --out plan.csv\n"
        "aosplan export plan.json --out plan.geojson --out csv:grid.txt --force\n"
        "aosplan export flown.kmz --out flown.geojson"
    ),
    parameters=[
        file_argument(
            "plan",
            "What `aosplan plan --json` printed, or a mission (.waypoints, .plan, .kmz, .mavlink, .csv).",
        ),
        *[option for option in output_options() if option.name != "as_json"],
    ],
)
