"""Fig. 4: a noise pattern with p = 25 % and o = 5 px, averaged 10 x 10 times at several
disparities.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.models.equations import visibility
from aosplan.show.figures.paper.noise import OCCLUDER_PX, PATTERNS, averaged
from aosplan.show.figures.paper.paper_figure import (
    UNSTATED,
    PaperFigure,
    PaperValue,
    Picture,
    agreement,
    body,
    counted,
    pictured,
    plus_minus,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.show.figures.paper.paper_figure import Progress
    from aosplan.show.figures.style import Theme

P, SIDE = 0.25, 10
DISPARITIES = (0, 1, 2, 3, 4, 5, 7, 10)
SHAPE = (160, 160)


def numbers(seed: int, progress: Progress | None = None) -> PaperFigure:
    """Compute the mean V of several patterns at each disparity, and the image of the
    first pattern.
    """
    from aosplan.simulation.forests import generator
    from aosplan.simulation.noise_patterns import blocked_views, grid_shifts

    rows, away, pictures = [], [], []
    for index, d in enumerate(counted(DISPARITIES, progress)):
        shifts = grid_shifts(SIDE, SIDE, d)
        found = averaged(seed, index, P, (SIDE, SIDE), d, SHAPE)
        rng = generator(seed, index * PATTERNS)
        image = blocked_views(rng, P, OCCLUDER_PX, shifts, SHAPE) / SIDE**2
        pictures.append(Picture(f"d = {d} px: V = {1.0 - float((image**2).mean()):.3f}", image))
        model = float(visibility(P, SIDE, SIDE, d / OCCLUDER_PX))
        error = found.expected_standard_error
        rows.append((d, model, found.expected, error))
        away.append((found.expected - model) / error)
    settled = rows[DISPARITIES.index(OCCLUDER_PX)]
    return PaperFigure(
        "4",
        f"a noise pattern with p = 25 %, averaged over {SIDE**2} shifts",
        seed,
        ("d_px", "V", "V_simulated", "standard_error"),
        tuple(rows),
        (
            PaperValue(
                f"V at d = o = {OCCLUDER_PX} px, {PATTERNS} patterns (Eq. 2: {settled[1]:.4f})",
                UNSTATED,
                plus_minus(settled[2], settled[3], 4),
            ),
        ),
        (agreement("V of averaged patterns", away),),
        tuple(pictures),
    )


def draw(figure: Figure, shown: PaperFigure, theme: Theme) -> None:
    """Draw the averaged pattern at each disparity."""
    pictured(body(figure, shown, theme).subplots(2, 4).flat, shown.pictures)
