"""Fig. 3a-c: visibility against disparity for three values of p, from Eq. 2 and from averaged noise
patterns.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

from aosplan.models.equations import visibility
from aosplan.show.figures.paper.noise import OCCLUDER_PX, averaged
from aosplan.show.figures.paper.paper_figure import (
    PaperFigure,
    PaperValue,
    agreement,
    body,
    counted,
    simulated,
)
from aosplan.show.figures.style import LINES, legend_below

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.show.figures.paper.paper_figure import Progress
    from aosplan.show.figures.style import Theme

DENSITIES = (0.25, 0.5, 0.75)
SIDES = (2, 3, 5, 10)
DISPARITIES = tuple(range(11))
FINE = tuple(0.05 * k for k in range(201))
SHAPE = (150, 150)


def numbers(seed: int, progress: Progress | None = None) -> PaperFigure:
    """Compute the curves, and the means of several noise patterns."""
    rows: list[tuple[object, ...]] = [
        ("curve", p, side**2, d, float(visibility(p, side, side, d / OCCLUDER_PX)), None, None)
        for p, side, d in product(DENSITIES, SIDES, FINE)
    ]
    away = []
    points = [*product(DENSITIES, SIDES, DISPARITIES)]
    for index, (p, side, d) in enumerate(counted(points, progress)):
        model = float(visibility(p, side, side, d / OCCLUDER_PX))
        found = averaged(seed, index, p, (side, side), d, SHAPE)
        error = found.expected_standard_error
        rows.append(("point", p, side**2, d, model, found.expected, error))
        away.append((found.expected - model) / error)
    change = max(
        abs(float(visibility(p, 10, 10, 2.0)) - float(visibility(p, 10, 10, 1.0)))
        for p in DENSITIES
    )
    return PaperFigure(
        "3",
        "visibility V against disparity d",
        seed,
        ("part", "p", "N", "d_px", "V", "V_simulated", "standard_error"),
        tuple(rows),
        (PaperValue("change of V beyond d = o (d̂ = 1)", "0", f"{change:.2g}"),),
        (agreement("V of averaged patterns", away),),
    )


def draw(figure: Figure, shown: PaperFigure, theme: Theme) -> None:
    """Draw a panel for each value of p."""
    upper = body(figure, shown, theme)
    panels = upper.subplots(1, 3)
    for axes, p, letter in zip(panels, DENSITIES, "abc", strict=True):
        for side, color, line in zip(SIDES, theme.data, LINES, strict=True):
            curve = shown.where(part="curve", p=p, N=side**2)
            points = shown.where(part="point", p=p, N=side**2)
            axes.plot(curve["d_px"], curve["V"], line, color=color, lw=1.2, label=f"N = {side**2}")
            simulated(axes, points["d_px"], points["V_simulated"], points["standard_error"], color)
        axes.axvline(OCCLUDER_PX, color=theme.muted, ls="-.", lw=0.9, label="d = o")
        axes.set(
            title=f"({letter}) p = {100 * p:g} %", xlabel="disparity $d$ [px]", xlim=(-0.3, 10.3)
        )
    panels[0].set_ylabel("visibility $V$")
    panels[0].plot([], [], "o", ms=3, color=theme.muted, label="averaged patterns ± 2 s.e.")
    legend_below(upper, panels[0].get_legend_handles_labels()[0])
