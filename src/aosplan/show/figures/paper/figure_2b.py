"""Fig. 2b: integrated density against l/o, from Eq. 1 and from simulated volumes.

Each point of the figure is a simulated volume. Its slices consist of cubes with edges of length 1.
The share of the ground that is hidden from vertically above is counted.
"""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING

from aosplan.scenes.density import integrated_density
from aosplan.show.figures.paper.paper_figure import (
    UNSTATED,
    PaperFigure,
    PaperValue,
    agreement,
    body,
    counted,
    simulated,
    starred,
)
from aosplan.show.figures.paper.stand import DENSITY, SLICE_DENSITY
from aosplan.show.figures.style import LINES, legend_below

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.show.figures.paper.paper_figure import Progress
    from aosplan.show.figures.style import Theme

DENSITIES = (0.0025, SLICE_DENSITY, 0.02, 0.05)
RATIOS = tuple(float(ratio) for ratio in range(0, 201, 4))
SIMULATED = (10.0, 40.0, 87.69, 160.0)
SIDE = 120
"""Columns of cubes along each side of a volume; each column is one trial."""


def numbers(seed: int, progress: Progress | None = None) -> PaperFigure:
    """Compute the curves and the simulated points."""
    from aosplan.simulation.forests import generator, uniform_forest

    rows: list[tuple[object, ...]] = [
        ("curve", d, ratio, float(integrated_density(d, ratio, 1.0)), None, None)
        for d, ratio in product(DENSITIES, RATIOS)
    ]
    away = []
    for index, (d, ratio) in enumerate(counted([*product(DENSITIES, SIMULATED)], progress)):
        model = float(integrated_density(d, ratio, 1.0))
        volume = uniform_forest(generator(seed, index), d, 1.0, 0.0, ratio, (SIDE, SIDE))
        p = float(volume.occupied.any(axis=0).mean())
        error = math.sqrt(model * (1.0 - model)) / SIDE
        rows.append(("point", d, ratio, model, p, error))
        away.append((p - model) / error)
    ratio = math.log1p(-DENSITY) / math.log1p(-SLICE_DENSITY)
    return PaperFigure(
        "2b",
        "density p against l/o",
        seed,
        ("part", "D", "l_over_o", "p", "p_simulated", "standard_error"),
        tuple(rows),
        (PaperValue("l/o at which D = 0.95 % gives p = 56.7 %", UNSTATED, f"{ratio:.2f}"),),
        (
            "Each curve rises from 0 towards 1. It rises faster if D is larger.",
            agreement("p of simulated volumes", away),
        ),
    )


def draw(figure: Figure, shown: PaperFigure, theme: Theme) -> None:
    """Draw a curve and its points for each D."""
    upper = body(figure, shown, theme)
    axes = upper.subplots()
    for d, color, line in zip(DENSITIES, theme.data, LINES, strict=True):
        curve, points = shown.where(part="curve", D=d), shown.where(part="point", D=d)
        label = f"D = {100 * d:g} % per slice"
        axes.plot(curve["l_over_o"], curve["p"], line, color=color, label=label)
        simulated(axes, points["l_over_o"], points["p_simulated"], points["standard_error"], color)
    axes.plot([], [], "o", ms=3, color=theme.muted, label="simulated volumes ± 2 s.e.")
    ratio = math.log1p(-DENSITY) / math.log1p(-SLICE_DENSITY)
    starred(axes, ratio, DENSITY, theme, "D and p of the paper's scan")
    axes.set(
        xlabel="height of the volume / size of an occluder, $l/o$",
        ylabel="integrated density $p$",
        xlim=(0, 200),
        ylim=(0, 1.02),
    )
    legend_below(upper, axes.get_legend_handles_labels()[0])
