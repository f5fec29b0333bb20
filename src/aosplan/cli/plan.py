"""The command ``aosplan plan``."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from aosplan import units as q
from aosplan.cli.options import (
    SHORT_HELP,
    command,
    defaults_option,
    flag_option,
    output_options,
    request_argument,
    request_options,
    text_option,
)
from aosplan.cli.output import (
    chosen_outputs,
    print_json,
    print_warnings,
    progress_bar,
    waiting_bar,
    write_outputs,
    writes_stdout,
)
from aosplan.errors import RequestError
from aosplan.files import located
from aosplan.planning.option_parsers import PERSON
from aosplan.planning.options import GAIN
from aosplan.planning.planner import plan
from aosplan.planning.user_defaults import request_of

if TYPE_CHECKING:
    from aosplan.maps.detection_map import DetectionMap, SearchSuccess
    from aosplan.maps.reciprocal_map import ReciprocalMap
    from aosplan.mission.format import Format
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.result import Plan


def run(
    *,
    request: str | None,
    out: list[str] | None,
    format: str | None,  # noqa: A002 (the option's name)
    force: bool,
    quiet: bool,
    as_json: bool,
    report: str | None,
    no_report_picture: bool,
    report_seed: str | None,
    detection_map: str | None,
    reciprocal_map: str | None,
    defaults: str | None,
    **flags: Any,
) -> None:
    """Make a plan, write its files and print it."""
    if detection_map is not None:
        wanted = _request_with_target(request, flags, defaults)
    else:
        wanted = request_of(request, flags, defaults=defaults)
    chosen = chosen_outputs(out or [], format, force=force)
    seed = _report_seed(report, report_seed, picture=not no_report_picture)
    if report is not None:
        _check_report(report, [path for _, path in chosen], seed=seed, force=force)
    paths = [path for _, path in chosen]
    others = [*paths, *([] if report is None else [report])]
    folder = os.path.dirname(request or "")
    prior = None if wanted.poa is None else located(wanted.poa, folder)
    if prior is not None:
        _check_prior(prior, wanted, detection_map)
    _check_map("detection map", detection_map, others, force=force)
    maps = [] if detection_map is None else [detection_map]
    _check_map("reciprocal map", reciprocal_map, [*others, *maps], force=force)
    to_stdout = writes_stdout([*paths, report, detection_map, reciprocal_map], as_json=as_json)
    if not wanted.has_place:
        _refuse_without_place(chosen, detection_map, reciprocal_map)
    with progress_bar(quiet=quiet) as bar:
        result = plan(wanted, folder=folder, progress=bar, on_trial=bar.on_trial)
    print_warnings(result.warnings, quiet=quiet)
    pages, found, success = {}, None, None
    if detection_map is not None:
        found, success = _detection_map(result, prior, quiet=quiet)
        pages[detection_map] = found.geotiff()
    positions = None
    if reciprocal_map is not None:
        positions = _reciprocal_map(result, quiet=quiet)
        pages[reciprocal_map] = positions.geotiff()
    if report is not None:
        from aosplan.show.page.page import report_page

        with waiting_bar("drawing the report", quiet=quiet):
            pages[report] = report_page(
                result, seed=seed, detection_map=found, success=success, reciprocal_map=positions
            )
    written = write_outputs(result.missions, chosen, pages, force=force, quiet=quiet)
    if as_json:
        document = result.document()
        if found is not None:
            document["detection"]["map"] = found.document(success)
        if positions is not None:
            document["reciprocal_map"] = positions.document()
        print_json(document)
    elif not (quiet or to_stdout):
        from aosplan.show.text.tables import print_plan

        print_plan(result, written, found, success, positions)


def _detection_map(
    result: Plan, prior: str | None, *, quiet: bool
) -> tuple[DetectionMap, SearchSuccess | None]:
    """The map of the probability of detection of a plan, and the probability of success if a prior
    is given.
    """
    from aosplan.maps.detection_map import detection_map

    with waiting_bar("predicting detection by place", quiet=quiet):
        found = detection_map(result)
    print_warnings(found.messages(), quiet=quiet)
    if prior is None:
        return found, None
    return found, found.success(prior)


def _reciprocal_map(result: Plan, *, quiet: bool) -> ReciprocalMap:
    """The map of camera positions with the share of the plan's target area that each one sees."""
    from aosplan.maps.reciprocal_map import reciprocal_map

    with waiting_bar("computing what each position sees", quiet=quiet):
        return reciprocal_map(result)


def _refuse_without_place(
    chosen: list[tuple[Format, str]], detection_map: str | None, reciprocal_map: str | None
) -> None:
    """Refuse outputs that need a location."""
    for flag, path in (("--detection-map", detection_map), ("--reciprocal-map", reciprocal_map)):
        if path is not None:
            raise RequestError(f"{flag} needs a location", "give --origin LAT,LON or --area FILE")
    for form, path in chosen:
        if form.needs_place:
            raise RequestError(
                f"output '{path}': {form.title} needs a location",
                "give --origin LAT,LON or --area FILE, or write CSV",
            )


def _request_with_target(
    request: str | None, flags: dict[str, Any], defaults: str | None
) -> PlanRequest:
    """A request with a target to find.  By default, the target is a person."""
    if flags.get("find") is None:
        try:
            wanted = request_of(request, flags, defaults=defaults)
        except RequestError:
            # A request without a target may be wrong for this reason alone. An example is a request
            # with a signature.
            wanted = None
        if wanted is not None and wanted.find is not None:
            return wanted
        flags = flags | {"find": PERSON}
    return request_of(request, flags, defaults=defaults)


def _check_prior(prior: str, wanted: PlanRequest, detection_map: str | None) -> None:
    """Refuse a prior if no other option uses it or if it cannot be read."""
    from aosplan.files import check_input

    if detection_map is None and wanted.order != GAIN:
        raise RequestError(
            "--poa needs --detection-map or --order gain",
            "give --detection-map POD.tif or --order gain as well",
        )
    check_input(prior)


def _check_map(what: str, path: str | None, others: list[str], *, force: bool) -> None:
    """Refuse a map that cannot be written, before any work is done."""
    if path is None:
        return
    from importlib.util import find_spec

    from aosplan.errors import MissingExtraError
    from aosplan.files import check_output

    if path != "-" and not path.lower().endswith((".tif", ".tiff")):
        raise RequestError(
            f"{what} '{path}' does not end in .tif", "write a GeoTIFF, such as pod.tif"
        )
    check_output(path, force=force)
    if os.path.realpath(path) in map(os.path.realpath, others):
        raise RequestError(f"output '{path}' is given twice")
    if find_spec("rasterio") is None:
        raise MissingExtraError(f"a {what}", "raster")


def _report_seed(report: str | None, seed: str | None, *, picture: bool) -> int | None:
    """Random seed of the report's picture; None without a picture."""
    if report is None:
        unpaired = "--no-report-picture" if not picture else "--report-seed" if seed else ""
        if unpaired:
            raise RequestError(f"{unpaired} needs --report", "give --report PAGE.html as well")
        return None
    if not picture:
        if seed is not None:
            raise RequestError("--report-seed and --no-report-picture contradict each other")
        return None
    from aosplan.show.page.page import SEED

    return SEED if seed is None else q.index(seed, "--report-seed")


def _check_report(path: str, others: list[str], *, seed: int | None, force: bool) -> None:
    """Refuse a report that cannot be written, before any work is done."""
    from aosplan.files import check_output
    from aosplan.show.page.page import SUFFIXES, check_extra

    if path != "-" and not path.lower().endswith(SUFFIXES):
        raise RequestError(
            f"report '{path}' does not end in .html", "write an HTML page, such as plan.html"
        )
    check_output(path, force=force)
    if os.path.realpath(path) in map(os.path.realpath, others):
        raise RequestError(f"output '{path}' is given twice")
    check_extra(picture=seed is not None)


COMMAND = command(
    "plan",
    run,
    summary="Compute the baseline and the number of photos, and write a mission.",
    examples=(
        "aosplan plan --altitude 40 --vhat 0.98\n"
        "aosplan plan --altitude 50 --scene stand.laz --model uniform \\\n"
        "    --origin 48.3358,14.3261 --heading 30 --out plan.geojson --out plan.csv"
    ),
    common=SHORT_HELP,
    parameters=[
        request_argument(),
        *request_options(),
        defaults_option(),
        *output_options(),
        text_option(
            "--report", "PAGE.html", "Write a report of the plan as an HTML page.", "Output"
        ),
        text_option(
            "--report-seed",
            "N",
            "Seed of the simulated picture in the report.  [1]",
            "Output",
        ),
        flag_option("--no-report-picture", "Make a report without the simulated picture."),
        text_option(
            "--detection-map",
            "POD.tif",
            "Write a map of the probability of detection (GeoTIFF).",
            "Output",
        ),
        text_option(
            "--reciprocal-map",
            "SEEN.tif",
            "Write a map of what each camera position sees.",
            "Output",
        ),
    ],
)
