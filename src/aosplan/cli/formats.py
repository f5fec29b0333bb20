"""``aosplan formats``."""

from __future__ import annotations

from aosplan.cli.options import command, json_option
from aosplan.cli.output import print_json
from aosplan.export import formats


def run(*, as_json: bool) -> None:
    """List the formats."""
    known = formats()
    if as_json:
        print_json([form._asdict() for form in known.values()])
        return
    from aosplan.cli.tables import print_rows

    rows = [
        (form.name, " ".join(form.suffixes), form.title, "yes" if form.needs_place else "no")
        for form in known.values()
    ]
    print_rows(("name", "endings", "format", "needs --origin"), rows)


COMMAND = command(
    "formats",
    run,
    summary="List the formats that waypoints are written in.",
    examples="aosplan formats\naosplan formats --json",
    parameters=[json_option()],
)
