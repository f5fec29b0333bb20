"""``aosplan visibility``: a calculator for the equations."""

from __future__ import annotations

from typing import Any

from aosplan import __version__
from aosplan import units as q
from aosplan.cli.options import command, json_option, text_option
from aosplan.cli.output import print_json
from aosplan.errors import RequestError
from aosplan.messages import SCHEMA
from aosplan.models.equations import line_shortfall
from aosplan.models.model import Prediction, prediction_document
from aosplan.models.positions import pattern_shortfall
from aosplan.numerics import heading_axis, turned
from aosplan.scenes.density import integrated_density, transparency


def run(
    *,
    density: str | None,
    slice_density: str | None,
    height_ratio: str | None,
    samples: str | None,
    grid: str | None,
    dhat: str | None,
    positions: str | None,
    spacing: str | None,
    heading: str | None,
    as_json: bool,
) -> None:
    """Evaluate Eq. 1 to 4 for a grid, or for any set of positions."""
    p, t = _density(density, slice_density, height_ratio)
    if positions is not None:
        if samples is not None or grid is not None or dhat is not None:
            raise RequestError(
                "--positions already determines the samples and their distances",
                "give --positions only together with --spacing M",
            )
        if spacing is None:
            raise RequestError(
                "--positions needs --spacing M",
                "M is the shift of the camera by which the image of an occluder moves by its own "
                "size: o h/H",
            )
        turned = 0.0 if heading is None else q.number(heading, "--heading", "deg")
        count, shortfall = _positions(positions, q.positive(spacing, "--spacing", "m"), turned)
        unit: float | None = None
    else:
        for name, value in (("--spacing", spacing), ("--heading", heading)):
            if value is not None:
                raise RequestError(f"{name} needs --positions")
        if dhat is None:
            raise RequestError(
                "--dhat X is needed", "with d̂ = 1, neighbouring samples share no occluder"
            )
        unit = q.at_least_zero(dhat, "--dhat")
        count, shortfall = _lattice(samples, grid, unit)
    numbers = prediction_document(Prediction(p, t, shortfall))
    document = {
        "schema": SCHEMA,
        "version": __version__,
        "samples": count,
        "dhat": unit,
        "visibility": numbers,
    }
    if as_json:
        print_json(document)
        return
    from aosplan.show.text.tables import print_rows

    shown = {name: "-" if value is None else f"{value:.10g}" for name, value in numbers.items()}
    rows = [
        ("N", f"{count}", "samples"),
        ("p", f"{p:.10g}", "integrated density of one sample"),
        ("V", shown["expected"], "visibility (Eq. 2)"),
        ("V̂", shown["normalized"], "normalised visibility"),
        ("1 - V̂", shown["shortfall"], "shortfall"),
        ("Vmin", shown["minimum"], "visibility of one sample"),
        ("Vmax", shown["maximum"], "visibility of infinitely many samples"),
        ("1/(1 - V̂)", shown["effective_samples"], "effective samples"),
    ]
    print_rows(("quantity", "value", "meaning"), rows)


def _density(
    density: str | None, slice_density: str | None, height_ratio: str | None
) -> tuple[float, float]:
    if (density is None) == (slice_density is None):
        raise RequestError(
            "exactly one of --density and --slice-density is needed",
            "give --density P, or --slice-density D with --height-ratio L/O",
        )
    if density is not None:
        if height_ratio is not None:
            raise RequestError("--height-ratio needs --slice-density")
        p = q.share(density, "--density")
        return p, 1.0 - p
    if height_ratio is None:
        raise RequestError("--slice-density needs --height-ratio L/O")
    per_slice = q.share(slice_density, "--slice-density")
    ratio = q.at_least_zero(height_ratio, "--height-ratio")
    return integrated_density(per_slice, ratio, 1.0), transparency(per_slice, ratio, 1.0)


def _lattice(samples: str | None, grid: str | None, dhat: float) -> tuple[int, float]:
    """Number of samples and shortfall of a trimmed or complete grid."""
    if (samples is None) == (grid is None):
        raise RequestError(
            "exactly one of --samples and --grid is needed",
            "--samples N is a trimmed grid of N sites; --grid 7x8 is a complete rectangle",
        )
    if grid is not None:
        parts = grid.lower().replace("×", "x").split("x")
        if len(parts) != 2:
            raise RequestError(f"--grid '{grid}' is not ROWSxCOLUMNS", "write 7x8")
        rows, columns = (q.whole(part, f"--grid '{grid}':") for part in parts)
        return rows * columns, line_shortfall(rows, dhat) * line_shortfall(columns, dhat)
    from math import isqrt

    from aosplan.grid.patterns import MOST_SITES, pattern_for

    count = q.whole(samples, "--samples")
    side = isqrt(count)
    if dhat >= 1.0:
        return count, 1.0 / count
    if side * side == count:  # A square grid has no removed sites.
        return count, line_shortfall(side, dhat) ** 2
    if count > MOST_SITES:
        raise RequestError(
            f"--samples {count} is not possible with d̂ below 1, because the grid before trimming "
            f"has more than {MOST_SITES} sites",
            f"give --grid {side}x{side}",
        )
    return count, pattern_shortfall(pattern_for("trimmed", count), dhat)


def _positions(path: str, spacing_m: float, heading_deg: float) -> tuple[int, float]:
    from aosplan.models.positions import positions_shortfall
    from aosplan.postflight.positions_file import read_positions

    points = read_positions(path)
    # The occluders of the model are squares aligned with the heading.
    axis = heading_axis(heading_deg)
    if axis != (0.0, 1.0):
        # The result is in the order (y, x), which is the order of the axes in the file. With the
        # heading 0, this changes nothing.
        points = [turned(x, y, axis)[::-1] for x, y in points]
    return len(points), positions_shortfall(points, spacing_m)


def _options() -> list[Any]:
    return [
        text_option(
            "--density",
            "P",
            "Integrated density: share of the ground that one sample does not see.",
        ),
        text_option(
            "--slice-density",
            "D",
            "Share of each slice that occluders fill, instead of --density (Eq. 1).",
        ),
        text_option(
            "--height-ratio", "L/O", "Volume height divided by occluder size, for --slice-density."
        ),
        text_option("--samples", "N", "Number of samples of a trimmed grid."),
        text_option(
            "--grid",
            "ROWSxCOLUMNS",
            "Rows and columns of a rectangular grid, instead of --samples.",
        ),
        text_option("--dhat", "X", "Normalised disparity d̂ between neighbouring samples."),
        text_option(
            "--positions",
            "FILE",
            "Positions of the samples, instead of a grid: CSV with x,y or east_m,north_m in metres, "
            ".waypoints, .plan or .geojson.",
        ),
        text_option(
            "--spacing",
            "M",
            "For --positions: shift of the camera by which the image of an occluder moves by its "
            "own size.",
        ),
        text_option(
            "--heading",
            "DEG",
            "Direction of the flight lines, clockwise from true north.  The occluders are "
            "squares along it.  [0]",
        ),
        json_option(),
    ]


COMMAND = command(
    "visibility",
    run,
    summary="Evaluate the visibility equations for a grid, or for any set of positions.",
    examples=(
        "aosplan visibility --density 0.567 --samples 50 --dhat 1\n"
        "aosplan visibility --slice-density 0.0095 --height-ratio 87.69 \\\n"
        "    --grid 7x8 --dhat 0.5"
    ),
    parameters=_options(),
)
