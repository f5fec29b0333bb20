"""Output of ``aosplan integrate`` about an integral image: the document, the warnings and the
table.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.postflight.integral.integral import Integral
    from aosplan.postflight.integral.recording import Recording


def integral_document(
    recording: Recording, integral: Integral, indices: Any, least: int
) -> dict[str, Any]:
    """Description of an integral image as plain values."""
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


def print_summary(document: dict[str, Any], out: tuple[str, ...]) -> None:
    """Print a document as a table."""
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
        ("Photos", f"{document['views']} of {document['recorded_views']}"),
        (
            "Extent",
            f"{x:.4g} x {y:.4g} m"
            + (f", the closest photos {nearest:.3g} m apart" if nearest else ""),
        ),
        ("Altitude", f"{document['altitude_m']:.4g} m above the focal plane"),
        ("Image", f"{columns} x {rows} pixels of {100 * document['gsd_m']:.3g} cm"),
        (
            "Coverage",
            f"{100 * coverage['share']:.1f} % of the pixels are in {coverage['least_views']} "
            f"or more photos; mean {coverage['mean_views']:.4g}",
        ),
    ]
    if document["focus"] is not None:
        lines += _focus_lines(document["focus"])
    if document["comparison"] is not None:
        other = document["comparison"]
        lines.append(
            (
                "SSIM",
                f"{other['ssim']:.4f} to the integral of {other['views']} photos ({other['choice']})",
            )
        )
    if out:
        lines.append(("Wrote", ", ".join(out)))
    for name, text in lines:
        table.add_row(name, one_line(text))
    show(table)


def _focus_lines(focus: dict[str, Any]) -> Iterator[tuple[str, str]]:
    ground, crowns = focus["ground"], focus["crowns"]
    found = (
        f"at {ground['place']:.2f} ± {ground['deviation']:.2g} m (agreement {ground['value']:.2f})"
    )
    if crowns is None:
        yield "Focus", f"lowest layer found {found}; it is the ground or the crowns"
    else:
        yield (
            "Focus",
            f"ground {found}, crowns at {crowns['place']:.1f} m ({crowns['value']:.2f})",
        )
    if focus["aligned_views"]:
        # With `--align yaw`, the positions are assumed to be exact. No position is moved, and the
        # yaw has no standard deviation.
        deviation, moved = focus["yaw_deviation_deg"], focus["moved_m"]
        yield (
            "Aligned",
            f"{focus['aligned_views']} photos: turned by {focus['yaw_offset_deg']:+.2f}"
            + (f" ± {deviation:.2g}" if deviation else "")
            + " degrees"
            + (f", moved by {moved:.2g} m (root mean square)" if moved else ""),
        )
