"""``aosplan integrate``: real recordings to an integral image."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TYPE_CHECKING, Any

from aosplan import __version__
from aosplan.cli.integrate_options import integrate_options
from aosplan.cli.integrate_summary import described, doubts_of, show_summary
from aosplan.cli.options import command
from aosplan.cli.output import drawn, print_json
from aosplan.errors import RequestError
from aosplan.messages import SCHEMA
from aosplan.show.text.terminal import print_notice
from aosplan.units import number, positive

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from aosplan.postflight.integral.focus import Focus
    from aosplan.postflight.integral.integral import Integral
    from aosplan.postflight.integral.recording import Recording

ENDINGS = (".png", ".tif", ".tiff", ".npz")


def run(
    *,
    photos: str,
    images: str | None,
    out: tuple[str, ...],
    focal_height: str | None,
    focus: str | None,
    align: str | None,
    focus_figure: str | None,
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
    compare: str | None,
    force: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Average recorded images on a focal plane, and compare choices of them."""
    from aosplan.files import check_output, write_all
    from aosplan.postflight.integral.camera_pose import named_camera
    from aosplan.postflight.integral.integral_warnings import integral_warnings
    from aosplan.postflight.integral.photo_poses import PhotoOptions, check_band
    from aosplan.postflight.integral.recording import Recording, least_views
    from aosplan.postflight.integral.view_subset import read_view_subset, view_subset_of

    _check_outputs(out, force=force)
    choice = view_subset_of(pitch, aperture, views)
    reference = None if compare is None else read_view_subset(compare, "--compare")
    if not out and reference is None:
        raise RequestError(
            "nothing to do with the integral image", "--out integral.png, or --compare all"
        )
    corners = _extent(extent)
    heights = None if focus is None else _heights(focus, focal_height)
    if isinstance(heights, float):
        focal_height, heights = str(heights), None
    elif focus is None and (align is not None or focus_figure is not None):
        raise RequestError("--align and --focus-figure go with --focus", "--focus auto")
    if focus_figure is not None:
        from aosplan.show.figures.canvas import check_extra, form_of

        form_of(focus_figure)
        check_output(focus_figure, force=force)
        check_extra()
    recording = Recording(
        photos,
        images,
        focal_height_m=0.0 if focal_height is None else _place(focal_height, "--focal-height"),
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
    found_focus = _focused(recording, indices, heights, align, quiet=quiet)
    raster = recording.raster(corners, None if gsd is None else positive(gsd, "--gsd", "m"))
    least = least_views("10%" if min_views is None else min_views, len(indices))
    other = None if reference is None else recording.choose(reference)
    with _bar(len(indices) + (0 if other is None else len(other)), quiet=quiet) as advance:
        integral = recording.integrate(choice, raster, progress=advance)
        comparison: dict[str, Any] | None = None
        if reference is not None and other is not None:
            from aosplan.simulation.ssim import similarity

            against = recording.integrate(
                reference, raster, progress=lambda done: advance(len(indices) + done)
            )
            least_other = least_views("10%" if min_views is None else min_views, len(other))
            found = similarity(
                integral.values,
                against.values,
                integral.seen(least) & against.seen(least_other),
                255.0 if against.is_byte else None,
            )
            comparison = {"choice": compare, "views": len(other), **found._asdict()}
    limits = _limits(integral, least, stretch=stretch)
    contents = {path: _bytes(path, recording, integral, least, limits) for path in out}
    if focus_figure is not None and found_focus is not None:
        contents[focus_figure] = _figure(focus_figure, found_focus)
    write_all(contents, force=force)
    document = {
        "schema": SCHEMA,
        "version": __version__,
        **described(recording, integral, indices, least),
        "focus": None if found_focus is None else found_focus.document(),
        "limits": list(limits),
        "comparison": comparison,
        "warnings": [
            *(each._asdict() for each in integral_warnings(recording, integral, least)),
            *([] if found_focus is None else doubts_of(found_focus)),
        ],
    }
    if not quiet:
        for warning in document["warnings"]:
            print_notice("warning", warning["message"])
    if as_json:
        print_json(document)
    elif not quiet:
        show_summary(document, tuple(contents))


def _check_outputs(out: tuple[str, ...], *, force: bool) -> None:
    from aosplan.files import check_output

    for path in out:
        if not path.lower().endswith(ENDINGS):
            raise RequestError(
                f"--out '{path}' does not end in {', '.join(ENDINGS)}",
                ".png to look at, .tif with the values, .npz with everything",
            )
    for index, path in enumerate(out):
        check_output(path, force=force)
        if os.path.realpath(path) in map(os.path.realpath, out[:index]):
            raise RequestError(f"output '{path}' is given twice")


def _heights(focus: str, focal_height: str | None) -> tuple[float, float] | float | str:
    """Heights to search, by the text of --focus: ``auto`` as it is."""
    from aosplan.postflight.integral.focus import read_heights

    found = read_heights(focus)
    if isinstance(found, float) and focal_height is not None:
        raise RequestError("--focus H and --focal-height both give the height", "leave one out")
    return "auto" if found is None else found


def _focused(
    recording: Recording,
    indices: Any,
    heights: tuple[float, float] | str | None,
    align: str | None,
    *,
    quiet: bool,
) -> Focus | None:
    """Bring the recording into focus; what was found."""
    if heights is None:
        return None
    from aosplan.postflight.integral.focus import ALIGNMENTS, find_focus

    if align is None:
        align = "none" if recording.sigma_m is None else "positions"
    if align not in ALIGNMENTS:
        raise RequestError(f"--align '{align}' is not one of {', '.join(ALIGNMENTS)}")
    with _bar(1, quiet=quiet, doing="focusing") as advance:
        found = find_focus(
            recording,
            indices,
            None if isinstance(heights, str) else heights,
            align=align,
            sigma_m=recording.sigma_m or 0.5,
            progress=advance,
        )
    chosen = [recording.views[index] for index in indices]
    recording.refocus(
        found.ground.place, found.correction.applied(chosen, recording.plane.frame), indices
    )
    return found


def _figure(path: str, found: Focus) -> bytes:
    from aosplan.show.figures.canvas import form_of, rendered
    from aosplan.show.figures.draw import Kind
    from aosplan.show.figures.focus_curve import FocusCurve

    kind = Kind("focus", "how well halves of the views agree", "recording", "focus_curve", 0.55)
    return rendered(kind, FocusCurve.of(found.document()), form_of(path))


def _extent(text: str | None) -> str | list[float]:
    from aosplan.postflight.integral.recording import EXTENTS

    if text is None or text in EXTENTS:
        return text or EXTENTS[0]
    parts = text.split(",")
    if len(parts) != 4:
        raise RequestError(
            f"--extent '{text}' is not XMIN,YMIN,XMAX,YMAX", f"or one of {', '.join(EXTENTS)}"
        )
    return [_place(part, "--extent") for part in parts]


def _place(text: str, name: str) -> float:
    """A coordinate [m] that leaves room for digits below the metre."""
    from aosplan.postflight.integral.camera_pose import FARTHEST_M

    place = number(text, name, "m")
    if abs(place) > FARTHEST_M:
        raise RequestError(f"{name} {place:g} is farther than {FARTHEST_M:g} m")
    return place


def _limits(integral: Integral, least: int, *, stretch: bool) -> tuple[float, float]:
    """Values that a PNG shows as black and white."""
    import numpy as np

    if integral.is_byte and not stretch:
        return 0.0, 255.0
    seen = integral.values[integral.seen(least)]
    if not seen.size:
        return 0.0, 1.0
    low, high = np.percentile(seen, [1.0, 99.0])
    return float(low), float(high)


def _bytes(
    path: str,
    recording: Recording,
    integral: Integral,
    least: int,
    limits: tuple[float, float],
) -> bytes:
    import numpy as np

    from aosplan.postflight.integral.images import png_bytes, tiff_bytes

    seen = integral.seen(least)
    suffix = path.lower().rpartition(".")[2]
    if suffix == "png":
        return png_bytes(integral.values, seen, limits)
    if suffix == "npz":
        import io

        buffer = io.BytesIO()
        raster = integral.raster
        np.savez_compressed(
            buffer,
            values=integral.values.astype(np.float32),
            coverage=integral.coverage.astype(np.float32),
            extent_m=np.array(raster.extent_m),
            gsd_m=np.array(raster.gsd_m),
        )
        return buffer.getvalue()
    if recording.georeference is None and integral.values.shape[2] == 1:
        return tiff_bytes(integral.values, seen)
    from aosplan.postflight.integral.geotiff import geotiff_bytes

    shown = np.where(seen[..., None], integral.values, np.nan)
    return geotiff_bytes(np.moveaxis(shown, -1, 0), integral.raster, recording.georeference)


@contextlib.contextmanager
def _bar(total: int, *, quiet: bool, doing: str = "integrating") -> Iterator[Callable[..., None]]:
    """A bar of views on a terminal's stderr."""
    if quiet or not sys.stderr.isatty():
        yield lambda *_: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with drawn(Progress(console=Console(stderr=True), transient=True)) as progress:
        task = progress.add_task(doing, total=total)
        yield lambda done, of=total: progress.update(task, completed=done, total=of)


COMMAND = command(
    "integrate",
    run,
    summary="Average recorded images on a focal plane, and compare choices of them.",
    examples=(
        "aosplan integrate photos --out integral.png\n"
        "aosplan integrate poses.json images --fov 50.8 --focal-height -36 \\\n"
        "    --out integral.png\n"
        "aosplan integrate poses.json images --fov 50.8 --pitch 2.8 --compare all \\\n"
        "    --out few.png"
    ),
    parameters=integrate_options(),
)
