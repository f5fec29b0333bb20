"""``aosplan integrate``: real recordings to an integral image."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TYPE_CHECKING, Any

from typer.core import TyperOption

from aosplan import __version__
from aosplan.cli.options import command, file_argument, flag_option, json_option, text_option
from aosplan.cli.output import drawn, print_json
from aosplan.errors import RequestError
from aosplan.messages import SCHEMA
from aosplan.show.text.terminal import print_notice
from aosplan.units import number, positive

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from aosplan.postflight.integral.camera_pose import Intrinsics
    from aosplan.postflight.integral.integral import Integral
    from aosplan.postflight.integral.recording import Recording

ENDINGS = (".png", ".tif", ".tiff", ".npz")


def run(
    *,
    photos: str,
    images: str | None,
    out: tuple[str, ...],
    focal_height: str | None,
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
    from aosplan.postflight.integral.photo_poses import PhotoOptions, check_band
    from aosplan.postflight.integral.recording import Recording, least_views
    from aosplan.postflight.integral.view_subset import read_view_subset, view_subset_of

    _check_endings(out)
    for index, path in enumerate(out):
        check_output(path, force=force)
        if os.path.realpath(path) in map(os.path.realpath, out[:index]):
            raise RequestError(f"output '{path}' is given twice")
    choice = view_subset_of(pitch, aperture, views)
    reference = None if compare is None else read_view_subset(compare, "--compare")
    if not out and reference is None:
        raise RequestError(
            "nothing to do with the integral image", "--out integral.png, or --compare all"
        )
    corners = _extent(extent)
    recording = Recording(
        photos,
        images,
        focal_height_m=0.0 if focal_height is None else _place(focal_height, "--focal-height"),
        up=up,
        camera=_camera(camera, fov),
        photos=PhotoOptions(
            check_band(band),
            plan,
            None if altitude is None else positive(altitude, "--altitude", "m"),
            None if heading is None else number(heading, "--heading", "deg"),
        ),
    )
    raster = recording.raster(corners, None if gsd is None else positive(gsd, "--gsd", "m"))
    indices = recording.choose(choice)
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
    write_all({path: _bytes(path, recording, integral, least, limits) for path in out}, force=force)
    document = {
        "schema": SCHEMA,
        "version": __version__,
        **_described(recording, integral, indices, least),
        "limits": list(limits),
        "comparison": comparison,
        "warnings": _warnings(recording, integral, least),
    }
    if not quiet:
        for warning in document["warnings"]:
            print_notice("warning", warning["message"])
    if as_json:
        print_json(document)
    elif not quiet:
        _show(document, out)


def _check_endings(out: tuple[str, ...]) -> None:
    for path in out:
        if not path.lower().endswith(ENDINGS):
            raise RequestError(
                f"--out '{path}' does not end in {', '.join(ENDINGS)}",
                ".png to look at, .tif with the values, .npz with everything",
            )


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


def _camera(camera: str | None, fov: str | None) -> Callable[[int, int], Intrinsics] | None:
    from aosplan.postflight.integral.camera_pose import from_camera, from_field_of_view

    if camera is not None and fov is not None:
        raise RequestError("--camera and --fov both give the camera", "leave one of them out")
    if camera is not None:
        from aosplan.camera.find import find_camera

        return from_camera(find_camera(camera))
    return None if fov is None else from_field_of_view(number(fov, "--fov", "deg"))


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


def _described(
    recording: Recording, integral: Integral, indices: Any, least: int
) -> dict[str, Any]:
    raster = integral.raster
    return {
        "views": integral.views,
        "recorded_views": len(recording.views),
        "up": recording.plane.up,
        "focal_height_m": recording.plane.height_m,
        "origin": None if recording.origin is None else list(recording.origin),
        "crs": None if recording.georeference is None else recording.georeference.crs,
        "altitude_m": float(recording.heights_m[indices].mean()),
        "aperture_m": list(recording.extent_m(indices)),
        "nearest_m": recording.nearest_m(indices),
        "gsd_m": raster.gsd_m,
        "extent_m": list(raster.extent_m),
        "size_px": [raster.columns, raster.rows],
        "coverage": {
            "least_views": least,
            "share": float(integral.seen(least).mean()),
            "mean_views": float(integral.coverage.mean()),
            "most_views": round(float(integral.coverage.max())),
        },
    }


def _warnings(recording: Recording, integral: Integral, least: int) -> list[dict[str, str]]:
    found = [(message.code, message.message) for message in recording.messages]
    if recording.missing:
        count = len(recording.missing)
        found.append(
            (
                "missing_images",
                f"{count} of {count + len(recording.views)} poses have no image in the folder and "
                f"are left out: {', '.join(recording.missing[:3])}{' ...' * (count > 3)}",
            )
        )
    if integral.blind:
        found.append(
            ("blind-views", f"{integral.blind} of {integral.views} views see nothing of the extent")
        )
    if not integral.seen(least).any():
        found.append(
            ("coverage", f"no pixel is seen by {least} views, so nothing shows: --min-views")
        )
    heights = recording.heights_m
    if heights.max() > 3.0 * heights.min():
        found.append(
            (
                "heights",
                f"cameras are {heights.min():.3g} to {heights.max():.3g} m above the focal plane: "
                "is take-off among them, or --focal-height off?",
            )
        )
    return [{"code": code, "message": message} for code, message in found]


def _show(document: dict[str, Any], out: tuple[str, ...]) -> None:
    from rich.table import Table

    from aosplan.show.text.tables import one_line, show

    table = Table.grid(padding=(0, 2))
    table.add_column(style="bold")
    table.add_column()
    x, y = document["aperture_m"]
    columns, rows = document["size_px"]
    nearest = document["nearest_m"]
    coverage = document["coverage"]
    lines = [
        ("Views", f"{document['views']} of {document['recorded_views']}"),
        ("Aperture", f"{x:.4g} x {y:.4g} m" + (f", {nearest:.3g} m apart" if nearest else "")),
        ("Altitude", f"{document['altitude_m']:.4g} m above the focal plane"),
        ("Image", f"{columns} x {rows} pixels of {100 * document['gsd_m']:.3g} cm"),
        (
            "Coverage",
            f"{100 * coverage['share']:.1f} % seen by at least {coverage['least_views']} of them, "
            f"{coverage['mean_views']:.4g} on average",
        ),
    ]
    if document["comparison"] is not None:
        other = document["comparison"]
        lines.append(("SSIM", f"{other['ssim']:.4f} against {other['views']} ({other['choice']})"))
    if out:
        lines.append(("Wrote", ", ".join(out)))
    for name, text in lines:
        table.add_row(name, one_line(text))
    show(table)


@contextlib.contextmanager
def _bar(total: int, *, quiet: bool) -> Iterator[Callable[[int], None]]:
    """A bar of views on a terminal's stderr."""
    if quiet or not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with drawn(Progress(console=Console(stderr=True), transient=True)) as progress:
        task = progress.add_task("integrating", total=total)
        yield lambda done: progress.update(task, completed=done)


def _options() -> list[Any]:
    lens, plane, choice = "Photos", "Focal plane", "Choice of views"
    return [
        file_argument(
            "photos",
            "Folder of photos with positions in EXIF or XMP; or poses: JSON with 3 x 4 matrices as the "
            "AOS project has it, a COLMAP folder, or OpenDroneMap's shots.geojson.",
        ),
        file_argument("images", "Folder of the images, beside poses.", required=False),
        text_option(
            "--focal-height", "M", "Height of the plane along the world's upward axis [0].", plane
        ),
        text_option("--up", "AXIS", "z, -z, y or -y [z or -z, as the cameras look].", plane),
        text_option("--gsd", "M", "Pixel of the integral image [that of the images].", plane),
        text_option(
            "--extent",
            "BOX",
            "XMIN,YMIN,XMAX,YMAX on the plane, 'all' that any view sees, or 'centre', what the "
            "middle view sees [centre].",
            plane,
        ),
        text_option(
            "--camera",
            "NAME",
            "Camera, if the poses have none or instead of the photos': name or file.",
            lens,
        ),
        text_option("--fov", "DEG", "Horizontal field of view, instead.", lens),
        text_option("--band", "NAME", "Of several cameras: thermal, visible, wide or zoom.", lens),
        text_option(
            "--plan",
            "FILE",
            "Plan with what the photos lack: camera, altitude, heading  [plan.json among the photos].",
            lens,
        ),
        text_option(
            "--altitude", "M", "Mean height above the ground, if the photos give none.", lens
        ),
        text_option("--heading", "DEG", "Where the top of photos points that give no yaw.", lens),
        text_option(
            "--views", "LIST", "Numbers from 1, ranges, names: 1-9,12; or a file of them.", choice
        ),
        text_option("--aperture", "M", "Views within a square of this side.", choice),
        text_option(
            "--pitch", "M", "Views at least so far apart, from the middle outwards.", choice
        ),
        text_option(
            "--min-views",
            "N",
            "Pixels that fewer views see are transparent: a number, or a share [10%].",
            choice,
        ),
        text_option(
            "--compare",
            "CHOICE",
            "SSIM against another choice: all, or pitch=M, aperture=M, views=LIST.",
            choice,
        ),
        TyperOption(
            param_decls=["--out"],
            type=str,
            multiple=True,
            metavar="PATH",
            help="Write .png (8 bits), .tif (float32, in its place) or .npz (with coverage).  Repeatable.",
            rich_help_panel="Output",
        ),
        flag_option("--stretch", "PNG from the 1st to the 99th percentile, for 8 bits too."),
        flag_option("--force", "Overwrite existing files."),
        flag_option("--quiet", "No table, no warnings."),
        json_option(),
    ]


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
    parameters=_options(),
)
