"""Files that ``aosplan integrate`` writes."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from aosplan.postflight.integral.focus import Focus
    from aosplan.postflight.integral.integral import Integral
    from aosplan.postflight.integral.recording import Recording

EXTENSIONS = (".png", ".tif", ".tiff", ".npz")


class IntegralDisplay(NamedTuple):
    """Options for the display of integral images and for the search in them."""

    stretch: bool
    local_m: float | None
    scale: bool
    heights_m: list[float] | None
    anomalies: str | None
    hot_spots: str | None


def check_outputs(out: tuple[str, ...], others: list[str], *, stacked: bool, force: bool) -> None:
    """Refuse paths that have a wrong extension, that exist already, or that are given twice."""
    from aosplan.files import check_output

    for path in out:
        if path.lower().endswith(".gif") and not stacked:
            raise RequestError(
                f"--out '{path}' is an animation, which needs several heights (--stack)",
                "give --stack 0..20:2",
            )
        if not path.lower().endswith((*EXTENSIONS, ".gif")):
            raise RequestError(
                f"--out '{path}' does not end in {', '.join(EXTENSIONS)}",
                "write .png for viewing, .tif for the values, or .npz for the values and the "
                "number of photos",
            )
    for path in others:
        ending = os.path.splitext(path)[1].lower()
        if ending not in (".geojson", ".json", ".svg", ".pdf", *EXTENSIONS):
            raise RequestError(
                f"output '{path}' has an unknown extension",
                "--anomalies .tif or .png, --hot-spots .geojson, --focus-figure .png, .svg or .pdf",
            )
    every = [*out, *others]
    for index, path in enumerate(every):
        check_output(path, force=force)
        if os.path.realpath(path) in map(os.path.realpath, every[:index]):
            raise RequestError(f"output '{path}' is given twice")


def check_figure(path: str | None) -> None:
    """Refuse a figure if its format is unknown or matplotlib is not installed."""
    if path is None:
        return
    from aosplan.show.figures.canvas import check_extra, form_of

    form_of(path)
    check_extra()


def output_contents(
    out: Sequence[str],
    recording: Recording,
    integral: Integral,
    least: int,
    looks: IntegralDisplay,
    averaged: Callable[..., Integral],
) -> tuple[dict[str, bytes], tuple[float, float]]:
    """The content of each file, by path, and the values that a PNG shows as black and as white."""
    from aosplan.postflight.integral.seeing import local_contrast, with_scale

    shown = integral
    if looks.local_m is not None:
        window = looks.local_m / integral.raster.gsd_m
        values = local_contrast(integral.values, integral.seen(least), window)
        shown = replace(integral, values=values, is_byte=False)
    limits = _limits(shown, least, stretch=looks.stretch)
    contents = {}
    for path in out:
        is_png = path.lower().endswith(".png")
        if looks.heights_m is not None and not path.lower().endswith((".png", ".npz")):
            continue
        contents[path] = _bytes(path, recording, shown if is_png else integral, least, limits)
        if looks.scale and is_png:
            contents[path] = with_scale(contents[path], integral)
    if looks.heights_m is not None:
        plain = _limits(integral, least, stretch=looks.stretch)
        contents |= _layers(recording, looks.heights_m, out, least, plain, averaged)
    return contents | _candidates(recording, integral, least, looks, averaged), limits


def _layers(
    recording: Recording,
    heights_m: Sequence[float],
    out: Sequence[str],
    least: int,
    limits: tuple[float, float],
    averaged: Callable[..., Integral],
) -> dict[str, bytes]:
    """Stacks and animations of integral images at several heights, by path."""
    import numpy as np

    from aosplan.postflight.integral.layers import film_bytes, stack_bytes

    plane, pages = recording.plane, []
    try:
        for height in heights_m:
            recording.plane = plane._replace(height_m=height)
            integral = averaged()
            pages.append(np.where(integral.seen(least)[..., None], integral.values, np.nan))
    finally:
        recording.plane = plane
    made = {}
    for path in out:
        if path.lower().endswith(".gif"):
            made[path] = film_bytes(pages, heights_m, limits)
        elif path.lower().endswith((".tif", ".tiff")):
            made[path] = stack_bytes(pages, heights_m)
    return made


def _candidates(
    recording: Recording,
    integral: Integral,
    least: int,
    looks: IntegralDisplay,
    averaged: Callable[..., Integral],
) -> dict[str, bytes]:
    """The averaged anomalies of the photos, and the hot spots, by path."""
    from aosplan.postflight.integral import hot_spots as found

    made = {}
    if looks.anomalies is not None:
        masks = averaged(adjust=found.anomalies)
        made[looks.anomalies] = _bytes(
            looks.anomalies, recording, masks, least, _limits(masks, least, stretch=True)
        )
    if looks.hot_spots is not None:
        spots = found.hot_spots(integral, integral.seen(least))
        made[looks.hot_spots] = found.geojson_bytes(spots, recording.georeference)
    return made


def _limits(integral: Integral, least: int, *, stretch: bool) -> tuple[float, float]:
    """The two values that are drawn black and white in a PNG."""
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
    from aosplan.postflight.integral.geotiff import integral_geotiff

    rows, columns, count = integral.values.shape
    shown = np.full((count, rows, columns), np.nan, dtype=np.float32)
    np.copyto(shown, np.moveaxis(integral.values, -1, 0), casting="same_kind", where=seen)
    return integral_geotiff(shown, integral.raster, recording.georeference)


def figure_bytes(path: str, found: Focus) -> bytes:
    """The bytes of a figure file with the curve of agreement."""
    from aosplan.show.figures.canvas import FigureStyle, form_of, rendered
    from aosplan.show.figures.draw import FigureKind
    from aosplan.show.figures.focus_curve import FocusCurve

    # Letters of this width are legible on a phone.
    narrow = FigureStyle(width_mm=100.0)
    kind = FigureKind(
        "focus", "agreement between halves of the photos", "recording", "focus_curve", 0.7
    )
    return rendered(kind, FocusCurve.of(found.document()), form_of(path), narrow)
