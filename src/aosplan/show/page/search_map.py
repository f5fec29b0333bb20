"""Map of the probability of detection for the page.  Cells have one of ten colours.  North is at
the top.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.show.figures.grid import nice_length_m
from aosplan.show.text.plan_rows import search_map_texts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.areas.ground_cells import GroundCells
    from aosplan.maps.coverage_map import CoverageMap
    from aosplan.maps.detection_map import DetectionMap, SearchSuccess
    from aosplan.maps.reciprocal_map import ReciprocalMap

WIDTH = 640.0
"""Width of the map.  The height of the map depends on the ground."""

TALLEST = 640.0

LEGEND = 56.0
"""Height of the legend below the map."""

COLOURS = (
    "#440154", "#482878", "#3e4a89", "#31688e", "#26828e",
    "#1f9e89", "#35b779", "#6dcd59", "#b4de2c", "#fde725",
)  # fmt: skip
"""Colours for probabilities from 0 to 1.  They are from viridis, whose colours colour-blind readers
can distinguish.
"""

UNSEEN = "#8a8a8a"
"""Colour of ground that no photo sees."""


class SearchMap(NamedTuple):
    """A map ready to be drawn, with its description.

    Attributes
    ----------
    summary, text
        Description of the picture, and results of the search in sentences.
    height
        Height of the picture, which is `WIDTH` wide.
    cells
        Colours, each with the outlines of the cells that have it.
    bar
        Length of the scale bar, and the label of the bar.
    swatches
        Positions and colours of the legend.
    marks
        Positions of marks.
    """

    summary: str
    text: str
    height: float
    cells: list[tuple[str, str]]
    bar: tuple[float, str]
    swatches: list[tuple[float, str]]
    marks: tuple[tuple[float, float], ...] = ()


def search_map(found: DetectionMap | None, success: SearchSuccess | None) -> SearchMap | None:
    """The picture of a detection map; None if there is no map."""
    if found is None:
        return None
    return _share_map(
        found.cells,
        found.probability,
        "Probability of detection",
        " ".join(search_map_texts(found, success)),
        unseen=found.looks == 0,
    )


def position_map(
    found: ReciprocalMap | None, sites_m: Sequence[tuple[float, float]]
) -> SearchMap | None:
    """The picture of a reciprocal map with the sites of the plan; None if there is no map."""
    if found is None:
        return None
    east_m, north_m, most = found.best
    text = (
        f"The colour of a position at {found.altitude_m:.4g} m is the share of the target area "
        f"({found.target_area_m2:.3g} m²) that a camera sees from there. The best position, "
        f"{east_m:.3g} m east and {north_m:.3g} m north of the origin, sees {most:.1%}. Circles are "
        "the sites of the plan."
    )
    return _share_map(
        found.cells, found.transparency, "Share of the target area seen", text, sites_m=sites_m
    )


def _share_map(
    cells: GroundCells,
    shares: NDArray[np.float64],
    what: str,
    text: str,
    *,
    unseen: NDArray[np.bool_] | None = None,
    sites_m: Sequence[tuple[float, float]] = (),
) -> SearchMap:
    """A picture of shares from 0 to 1 in cells; `unseen` cells are grey, `sites_m` are marked."""
    rows, columns = cells.inside.shape
    unit = min(WIDTH / columns, TALLEST / rows)
    left = 0.5 * (WIDTH - unit * columns)
    colour = np.minimum((10.0 * np.nan_to_num(shares)).astype(np.int64), 9)
    if unseen is not None:
        colour[unseen] = 10
    colour = np.where(cells.inside, colour.reshape(rows, columns), -1)
    known = shares[cells.inside_rows]
    wide_m, tall_m = columns * cells.cell_m, rows * cells.cell_m
    bar_m = nice_length_m(max(wide_m, tall_m))
    low, high = (float(value) for value in np.quantile(known, (0.05, 0.95)))
    scale = unit / cells.cell_m
    return SearchMap(
        summary=(
            f"{what} over {wide_m:.4g} m from west to east and {tall_m:.4g} m from "
            f"south to north, in cells of {cells.cell_m:g} m: {float(known.mean()):.1%} on average, "
            f"between {low:.1%} and {high:.1%} on nine tenths of the ground."
        ),
        text=text,
        height=unit * rows + LEGEND,
        cells=[
            (shade, outline)
            for number, shade in enumerate((*COLOURS, UNSEEN))
            if (outline := _outline(colour == number, unit, left))
        ],
        bar=(round(unit * bar_m / cells.cell_m, 1), f"{bar_m:g} m"),
        swatches=[(380.0 + 24.0 * number, shade) for number, shade in enumerate(COLOURS)],
        marks=tuple(
            (round(left + scale * (x - cells.left_m), 1), round(scale * (cells.top_m - y), 1))
            for x, y in sites_m
        ),
    )


def coverage_picture(coverage: CoverageMap) -> bytes:
    """An SVG of a coverage map. It shows, for each place, the share of the planned photos that see
    the place. It also shows outlines of the gaps.
    """
    cells = coverage.cells
    rows, columns = cells.inside.shape
    unit = min(WIDTH / columns, TALLEST / rows)
    left = 0.5 * (WIDTH - unit * columns)
    share = coverage.flown / np.maximum(coverage.planned, 1)
    colour = np.minimum((10.0 * share).astype(np.int64), 9)
    colour[coverage.flown == 0] = 10
    colour = np.where(cells.inside, colour.reshape(rows, columns), -1)
    gaps = coverage.gaps.reshape(rows, columns)
    height = unit * rows + LEGEND
    known = coverage.document()
    title = (
        "Number of photos that see each place, compared with the plan: "
        f"{known['flown_photos']:.3g} of {known['planned_photos']:.3g} on average; "
        f"{known['gap_share']:.1%} of the area are gaps"
    )
    bar_m = nice_length_m(max(rows, columns) * cells.cell_m)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {height:.1f}" role="img">',
        f"<title>{title}</title>",
        f'<rect width="{WIDTH:g}" height="{height:.1f}" fill="#ffffff"/>',
        '<g shape-rendering="crispEdges">',
    ]
    for number, shade in enumerate((*COLOURS, UNSEEN)):
        outline = _outline(colour == number, unit, left)
        if outline:
            parts.append(f'<path fill="{shade}" d="{outline}"/>')
    parts.append("</g>")
    parts.append(
        f'<path fill="none" stroke="#d00000" stroke-width="2" d="{_rim(gaps, unit, left)}"/>'
    )
    low = height - 12.0
    parts.append('<g font-family="sans-serif" font-size="15">')
    parts.append(
        f'<rect x="0" y="{height - 38:.1f}" width="{unit * bar_m / cells.cell_m:.1f}" height="3"/>'
        f'<text x="0" y="{low:.1f}">{bar_m:g} m</text>'
        f'<text x="150" y="{low:.1f}" fill="#d00000">red: gaps</text>'
    )
    parts += [
        f'<rect x="{380 + 24 * number}" y="{height - 44:.1f}" width="24" height="14" fill="{shade}"/>'
        for number, shade in enumerate(COLOURS)
    ]
    parts.append(
        f'<text x="380" y="{low:.1f}">0 %</text><text x="620" y="{low:.1f}" text-anchor="end">'
        "100 % of the planned photos</text></g></svg>"
    )
    return "\n".join(parts).encode() + b"\n"


def _rim(cells: NDArray[np.bool_], unit: float, left: float) -> str:
    """An SVG path along the sides between marked and unmarked cells."""
    wide = np.pad(cells, 1)
    line, column = np.nonzero(wide[1:, 1:-1] != wide[:-1, 1:-1])
    level = "".join(
        f"M{left + unit * x:.6g} {unit * y:.6g}h{unit:.6g}"
        for y, x in zip(line.tolist(), column.tolist(), strict=True)
    )
    line, column = np.nonzero(wide[1:-1, 1:] != wide[1:-1, :-1])
    return level + "".join(
        f"M{left + unit * x:.6g} {unit * y:.6g}v{unit:.6g}"
        for y, x in zip(line.tolist(), column.tolist(), strict=True)
    )


def _outline(cells: NDArray[np.bool_], unit: float, left: float) -> str:
    """An SVG path of runs of cells along rows."""
    edges = np.diff(np.pad(cells.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, start = np.nonzero(edges == 1)
    stop = np.nonzero(edges == -1)[1]
    return "".join(
        f"M{left + unit * first:.6g} {unit * line:.6g}h{unit * (last - first):.6g}v{unit:.6g}"
        f"h{-unit * (last - first):.6g}z"
        for line, first, last in zip(row.tolist(), start.tolist(), stop.tolist(), strict=True)
    )
