"""The command ``aosplan review``."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any

from aosplan.cli.options import (
    command,
    defaults_option,
    file_argument,
    output_options,
    positions_argument,
    request_options,
    text_option,
)
from aosplan.cli.output import (
    check_distinct,
    chosen_outputs,
    print_json,
    print_warnings,
    progress_bar,
    write_outputs,
    writes_stdout,
)
from aosplan.cli.typer_classes import TyperOption

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from aosplan.maps.coverage_map import CoverageMap
    from aosplan.postflight.review import Review

MOST_NAMED = 20
"""Largest number of missing sites that are listed in the table."""


def run(
    *,
    positions: str,
    plan: str | None,
    tolerance: str | None,
    within: str | None,
    out: list[str] | None,
    format: str | None,  # noqa: A002 (the option's name)
    force: bool,
    quiet: bool,
    as_json: bool,
    coverage_map: list[str] | None,
    defaults: str | None,
    **flags: Any,
) -> None:
    """Compare recorded positions with a plan, and write a mission for the missing sites."""
    from aosplan.planning.user_defaults import request_of
    from aosplan.units import positive

    wanted = request_of(plan, flags, defaults=defaults)
    tolerance_m = None if tolerance is None else positive(tolerance, "--tolerance", "m")
    longest_s = math.inf if within is None else 60.0 * positive(within, "--within", "min")
    chosen = chosen_outputs(out or [], format, force=force)
    maps = coverage_map or []
    _check_maps(maps, [path for _, path in chosen], area=wanted.area is not None, force=force)
    writes_stdout([*(path for _, path in chosen), *maps], as_json=as_json)
    from aosplan.postflight.review import review
    from aosplan.postflight.views import read_views

    views = read_views(positions, on_earth=wanted.has_place)
    with progress_bar(quiet=quiet) as bar:
        found = review(
            wanted,
            views,
            tolerance_m=tolerance_m,
            longest_s=longest_s,
            folder=os.path.dirname(plan or ""),
            progress=bar,
            on_trial=bar.on_trial,
        )
    print_warnings(found.warnings, quiet=quiet)
    pages = {path: _map_file(found, path) for path in maps}
    flown = chosen if found.topup is not None else []
    written = write_outputs(
        found.topup.missions if found.topup else tuple, flown, pages, force=force, quiet=quiet
    )
    if as_json:
        print_json(found.document())
    elif not (quiet or "-" in written):
        _print_review(found, written)


MAP_SUFFIXES = (".tif", ".tiff", ".geojson", ".svg")
"""Extensions of a coverage map: for a raster, for gaps, and for a picture."""


def _check_maps(paths: list[str], others: list[str], *, area: bool, force: bool) -> None:
    """Refuse coverage maps that cannot be written, before any work is done."""
    if not paths:
        return
    from importlib.util import find_spec

    from aosplan.errors import MissingExtraError, RequestError
    from aosplan.files import check_output

    for path in paths:
        if not path.lower().endswith(MAP_SUFFIXES):
            raise RequestError(
                f"coverage map '{path}' does not end in .tif, .geojson or .svg",
                "write .tif for a raster, .geojson for the gaps, or .svg for a picture",
            )
        check_output(path, force=force)
    check_distinct([*paths, *others])
    if not area:
        raise RequestError("--coverage-map needs a plan over an --area")
    if any(path.lower().endswith((".tif", ".tiff")) for path in paths) and not find_spec(
        "rasterio"
    ):
        raise MissingExtraError("a coverage map", "raster")


def _map_file(found: Review, path: str) -> bytes:
    """A coverage map in the format of a file's extension."""
    assert found.coverage is not None  # A plan over an area always has a coverage.
    ending = os.path.splitext(path)[1].lower()
    if ending == ".geojson":
        return found.coverage.geojson()
    if ending == ".svg":
        from aosplan.show.page.search_map import coverage_picture

        return coverage_picture(found.coverage)
    return found.coverage.geotiff()


def _print_review(found: Review, written: Sequence[str]) -> None:
    from aosplan.show.text.tables import one_line, print_pairs, print_predictions, show
    from aosplan.show.text.terminal import written_text

    print_pairs(_rows(found))
    planned = found.plan.solution
    columns = {"planned": (planned.pattern.samples, planned.prediction)}
    if found.flown is not None:
        columns["flown"] = found.counted, found.flown
    if found.completed is not None and found.topup is not None:
        columns["after the top-up"] = found.counted + len(found.missing), found.completed
    if len(columns) > 1:
        show(one_line(""))
        print_predictions(columns)
    next_step = "Next: --out topup.waypoints writes a mission for the missing sites."
    if found.topup is None:
        next_step = "No photos are missing, so no mission is written."
    if written:
        next_step = written_text(written)
    show(one_line(""), one_line(next_step))


def _rows(found: Review) -> Iterator[tuple[str, str]]:
    """Rows about the photos and the missing sites."""
    strays, total = len(found.strays), len(found.sites)
    aside = f", {strays} of them far from every site" if strays else ""
    yield "Photos", f"{len(found.views)}{aside} (--tolerance {found.tolerance_m:.3g} m)"
    if found.errors_m is not None:
        yield (
            "Position error",
            "{:.2f} m root mean square, {:.2f} m at most".format(*found.errors_m),
        )
    if found.detection is not None:
        named_shares = (
            ("planned", found.detection.planned),
            ("flown", found.detection.flown),
            ("after the top-up", found.detection.completed if found.topup else None),
        )
        shares = [f"{share:.0%} {name}" for name, share in named_shares if share is not None]
        yield "Detection", ", ".join(shares)
    yield "Sites", f"{total - len(found.missing)} of {total} have a photo"
    if found.coverage is not None:
        yield from _coverage_rows(found.coverage)
    if found.after is not None and found.topup is not None:
        yield "", f"{found.after.gap_share:.1%} after the top-up"
    if found.topup is None:
        return
    named = ", ".join(map(str, found.missing[:MOST_NAMED]))
    more = f" and {len(found.missing) - MOST_NAMED} more" if len(found.missing) > MOST_NAMED else ""
    yield "Missing", f"waypoints {named}{more} (numbered from 0)"
    route = found.topup.route
    flights = f", {len(route.flights)} flights" if len(route.flights) > 1 else ""
    photos = sum(found.topup.waypoints.photo or [True] * len(found.topup.waypoints))
    yield (
        "Top-up",
        f"{photos} photos, {route.length_m:.0f} m, {route.total_time_s / 60.0:.1f} min "
        f"with take-off and return{flights}",
    )


def _coverage_rows(coverage: CoverageMap) -> Iterator[tuple[str, str]]:
    """Rows about the gaps in an area."""
    known = coverage.document()
    yield (
        "Area",
        f"{known['area_m2'] / 1e4:.3g} ha; a place is in "
        f"{known['flown_photos']:.3g} photos on average "
        f"({known['planned_photos']:.3g} planned)",
    )
    if known["gap_share"] == 0.0:
        yield "Gaps", "none, because every place is seen at least as well as planned"
        return
    why = (
        "in fewer photos than planned"
        if known["rule"] == "photos"
        else "the probability of detection is more than 0.05 lower than in the plan"
    )
    yield (
        "Gaps",
        f"{known['gap_share']:.1%} of the area, {known['gap_m2']:,.0f} m² in {known['gaps']} "
        f"part{'s' if known['gaps'] > 1 else ''}: {why}",
    )


COMMAND = command(
    "review",
    run,
    summary="Compare the photos of a flight with its plan, and write a mission for the missing "
    "photos.",
    examples=(
        "aosplan review photos/ plan.json --out topup.waypoints\n"
        "aosplan review flown.csv request.toml --tolerance 1 --json"
    ),
    common=frozenset(),
    parameters=[
        positions_argument(),
        file_argument(
            "plan",
            "Output of `aosplan plan --json`, or the request file.  Options override its values.",
            required=False,
        ),
        text_option(
            "--tolerance",
            "M",
            "Largest distance between a site and a photo that counts for this site.  [half "
            "the smaller distance between neighbouring sites]",
        ),
        text_option(
            "--within",
            "MIN",
            "Longest time of the mission for the missing photos, from take-off to landing.  "
            "Within this time, it takes the photos that close most of the gaps.  [time for "
            "all missing photos]",
        ),
        *request_options(lambda option: option.name not in ("resume_at", "sensitivity", "within")),
        defaults_option(),
        *output_options(),
        TyperOption(
            param_decls=["--coverage-map"],
            type=str,
            multiple=True,
            metavar="COV.tif",
            help=(
                "Write the coverage of an area: a raster (.tif), the gaps (.geojson) or a "
                "picture (.svg).  Repeatable."
            ),
            rich_help_panel="Output",
        ),
    ],
)
