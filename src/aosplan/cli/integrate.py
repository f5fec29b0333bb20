"""``aosplan integrate``: integral images from real recordings."""

from __future__ import annotations

import contextlib
import sys
from functools import partial
from typing import TYPE_CHECKING, Any

from aosplan import __version__
from aosplan.cli.integrate_options import integrate_options
from aosplan.cli.integrate_outputs import (
    IntegralDisplay,
    check_figure,
    check_outputs,
    figure_bytes,
    output_contents,
)
from aosplan.cli.integrate_summary import integral_document, print_summary
from aosplan.cli.options import command
from aosplan.cli.output import print_json, shown_live
from aosplan.errors import RequestError
from aosplan.messages import SCHEMA
from aosplan.show.text.terminal import print_notice
from aosplan.units import number, positive

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from aosplan.postflight.integral.integral import Integral


def run(
    *,
    photos: str,
    images: str | None,
    out: tuple[str, ...],
    focal_height: str | None,
    focus: str | None,
    align: str | None,
    focus_figure: str | None,
    focal_surface: str | None,
    slope: str | None,
    stack: str | None,
    up: str | None,
    gsd: str | None,
    extent: str | None,
    camera: str | None,
    fov: str | None,
    band: str | None,
    plan: str | None,
    altitude: str | None,
    heading: str | None,
    views: str | None,
    pitch: str | None,
    aperture: str | None,
    min_views: str | None,
    stretch: bool,
    local: str | None,
    scale: bool,
    equalize: bool,
    feather: bool,
    anomalies: str | None,
    hot_spots: str | None,
    compare: str | None,
    force: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Average recorded images on a focal surface, and compare subsets of them."""
    from aosplan.files import write_all
    from aosplan.postflight.integral.camera_pose import named_camera
    from aosplan.postflight.integral.focus import focus_recording, search_of
    from aosplan.postflight.integral.integral_warnings import focus_warnings, integral_warnings
    from aosplan.postflight.integral.photo_poses import PhotoOptions, check_band
    from aosplan.postflight.integral.recording import Recording, least_views
    from aosplan.postflight.integral.seeing import adjustment
    from aosplan.postflight.integral.surface import read_slope, read_stack
    from aosplan.postflight.integral.view_subset import read_view_subset, view_subset_of

    others = [path for path in (anomalies, hot_spots, focus_figure) if path is not None]
    check_outputs(out, others, stacked=stack is not None, force=force)
    choice = view_subset_of(pitch, aperture, views)
    reference = None if compare is None else read_view_subset(compare, "--compare")
    if not (out or anomalies or hot_spots) and reference is None:
        raise RequestError("no output is requested", "give --out integral.png or --compare all")
    height_m = None if focal_height is None else _place(focal_height, "--focal-height")
    heights, height_m = search_of(focus, height_m, focal_surface)
    if focus is None and (align is not None or focus_figure is not None):
        raise RequestError("--align and --focus-figure need --focus", "give --focus auto")
    check_figure(focus_figure)
    looks = IntegralDisplay(
        stretch=stretch,
        local_m=None if local is None else positive(local, "--local", "m"),
        scale=scale,
        heights_m=None if stack is None else read_stack(stack),
        anomalies=anomalies,
        hot_spots=hot_spots,
    )
    corners = _extent(extent)
    recording = Recording(
        photos,
        images,
        focal_height_m=0.0 if height_m is None and heights is None else height_m,
        slope=(0.0, 0.0) if slope is None else read_slope(slope),
        up=up,
        camera=named_camera(camera, None if fov is None else number(fov, "--fov", "deg")),
        photos=PhotoOptions(
            check_band(band),
            plan,
            None if altitude is None else positive(altitude, "--altitude", "m"),
            None if heading is None else number(heading, "--heading", "deg"),
        ),
    )
    indices = recording.choose(choice)
    with _bar(1, quiet=quiet, doing="focusing") as advance:
        found_focus = focus_recording(recording, indices, heights, align=align, progress=advance)
    raster = recording.raster(corners, None if gsd is None else positive(gsd, "--gsd", "m"))
    least = least_views("10%" if min_views is None else min_views, len(indices))
    other = None if reference is None else recording.choose(reference)
    with _bar(len(indices) + (0 if other is None else len(other)), quiet=quiet) as advance:
        adjust = adjustment(recording, indices, raster, equalize=equalize, feather=feather)
        averaged = partial(recording.integrate, raster=raster, surface=focal_surface, adjust=adjust)
        integral = averaged(choice, progress=advance)
        comparison = None
        if reference is not None and other is not None:
            against = averaged(reference, progress=lambda done: advance(len(indices) + done))
            least_other = least_views("10%" if min_views is None else min_views, len(other))
            comparison = {
                "choice": compare,
                "views": len(other),
                **_similarity(integral, against, least, least_other),
            }
        contents, limits = output_contents(
            out, recording, integral, least, looks, partial(averaged, choice)
        )
    if focus_figure is not None and found_focus is not None:
        contents[focus_figure] = figure_bytes(focus_figure, found_focus)
    write_all(contents, force=force)
    document = {
        "schema": SCHEMA,
        "version": __version__,
        **integral_document(recording, integral, indices, least),
        "focus": None if found_focus is None else found_focus.document(),
        "limits": list(limits),
        "comparison": comparison,
        "warnings": [
            *(each._asdict() for each in integral_warnings(recording, integral, least)),
            *(each._asdict() for each in focus_warnings(found_focus)),
        ],
    }
    if not quiet:
        for warning in document["warnings"]:
            print_notice("warning", warning["message"])
    if as_json:
        print_json(document)
    elif not quiet:
        print_summary(document, tuple(contents))


def _similarity(
    integral: Integral, against: Integral, least: int, least_other: int
) -> dict[str, Any]:
    from aosplan.simulation.ssim import similarity

    found = similarity(
        integral.values,
        against.values,
        integral.seen(least) & against.seen(least_other),
        255.0 if against.is_byte else None,
    )
    return found._asdict()


def _extent(text: str | None) -> str | list[float]:
    from aosplan.postflight.integral.recording import EXTENTS

    if text is None or text in EXTENTS:
        return text or EXTENTS[0]
    parts = text.split(",")
    if len(parts) != 4:
        raise RequestError(
            f"--extent '{text}' is not XMIN,YMIN,XMAX,YMAX",
            f"give XMIN,YMIN,XMAX,YMAX or one of {', '.join(EXTENTS)}",
        )
    return [_place(part, "--extent") for part in parts]


def _place(text: str, name: str) -> float:
    """Parse a coordinate [m]. Coordinates are refused if they are so large that their decimals
    would not be accurate.
    """
    from aosplan.postflight.integral.camera_pose import FARTHEST_M

    place = number(text, name, "m")
    if abs(place) > FARTHEST_M:
        raise RequestError(f"{name} {place:g} is more than {FARTHEST_M:g} m from the origin")
    return place


@contextlib.contextmanager
def _bar(total: int, *, quiet: bool, doing: str = "integrating") -> Iterator[Callable[..., None]]:
    """A progress bar of views on stderr, if stderr is a terminal."""
    if quiet or not sys.stderr.isatty():
        yield lambda *_: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with shown_live(Progress(console=Console(stderr=True), transient=True)) as progress:
        task = progress.add_task(doing, total=total)
        yield lambda done, of=total: progress.update(task, completed=done, total=of)


COMMAND = command(
    "integrate",
    run,
    summary="Average recorded photos on a focal plane, and compare the integrals of different photos.",
    examples=(
        "aosplan integrate photos --plan plan.json --out integral.png\n"
        "aosplan integrate poses.json images --fov 50.8 --focal-height -36 \\\n"
        "    --out integral.png\n"
        "aosplan integrate poses.json images --fov 50.8 --pitch 2.8 --compare all \\\n"
        "    --out few.png"
    ),
    parameters=integrate_options(),
)
