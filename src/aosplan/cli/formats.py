"""The command ``aosplan formats``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.cli.options import command, json_option
from aosplan.cli.output import print_json
from aosplan.mission.export import formats

if TYPE_CHECKING:
    from aosplan.mission.format import Format, Limits


def run(*, as_json: bool) -> None:
    """List the formats."""
    known = formats()
    if as_json:
        print_json(
            [
                form._asdict() | {"limits": [limits._asdict() for limits in form.limits]}
                for form in known.values()
            ]
        )
        return
    from aosplan.show.text.tables import one_line, print_pairs, print_rows, show

    rows = [
        (
            form.name,
            " ".join(form.suffixes) or f"{form.name}:PATH",
            form.title,
            "yes" if form.needs_place else "no",
            form.altitudes,
        )
        for form in known.values()
    ]
    print_rows(("name", "extension", "format", "needs a location", "heights above"), rows)
    show(one_line(""), one_line("Limits of one file:"))
    print_pairs((form.name, _limits_text(form)) for form in known.values())


def _limits_text(form: Format) -> str:
    named = [(limits.target, _bounds(limits)) for limits in form.limits]
    if len(named) == 1:
        return named[0][1] or "any number of waypoints"
    return "; ".join(f"{target}: {bounds}" for target, bounds in named)


def _bounds(limits: Limits) -> str:
    fewest, most = limits.waypoints
    bounds = (
        (f"{fewest} to {most}" if fewest > 1 else f"{most}", limits.unit, most),
        (
            f"{limits.leg_m[0]:g} to {limits.leg_m[1] or 0.0:g}",
            "m between waypoints",
            limits.leg_m[1],
        ),
        (f"up to {limits.speed_mps[1] or 0.0:g}", "m/s", limits.speed_mps[1]),
        (f"up to {limits.height_m[1] or 0.0:g}", "m high", limits.height_m[1]),
        (f"hold up to {limits.hold_s[1] or 0.0:g}", "s", limits.hold_s[1]),
    )
    return ", ".join(f"{text} {unit}" for text, unit, bound in bounds if bound is not None)


COMMAND = command(
    "formats",
    run,
    summary="List the formats of mission files, with their requirements and limits.",
    examples="aosplan formats\naosplan formats --json",
    parameters=[json_option()],
)
