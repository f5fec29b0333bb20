"""Fig. 8: a resolution chart seen through a stand, for several N and b, with V̂ and SSIM."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

from aosplan.show.figures.paper.paper_figure import (
    PaperFigure,
    PaperValue,
    Picture,
    body,
    counted,
    pictured,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.show.figures.paper.paper_figure import Progress
    from aosplan.show.figures.style import Theme

SIDES = (1, 3, 5, 7, 10)
BASELINES_M = (0.5, 1.0, 2.0, 3.5, 5.0)


def numbers(seed: int, progress: Progress | None = None) -> PaperFigure:
    """Compute V̂, SSIM and the image for each grid of cameras."""
    import numpy as np

    from aosplan.show.figures.paper.stand import BASELINE_M, DENSITY, grid, views
    from aosplan.simulation.moments import estimate
    from aosplan.simulation.noise_patterns import counts_of
    from aosplan.simulation.pictures import check_extra, integral_image, resolution_chart
    from aosplan.simulation.ssim import similarity

    check_extra()
    seen = views(seed)
    size = seen.window.rows
    chart = resolution_chart(size, size)
    optimum = integral_image(chart, np.asarray(DENSITY))
    rows, pictures, table = [], [], {}
    for side, b in counted([*product(SIDES, BASELINES_M)], progress):
        n = side * side
        blocked = seen.blocked_views(grid(side, b))
        found = estimate([counts_of(blocked, n)], one_plot=True)
        image = integral_image(chart, (blocked / n)[::-1])  # the first row is in the north
        ssim = similarity(image, optimum, span=1.0).ssim
        title = f"V̂ {100 * found.normalized:.0f} %, SSIM {ssim:.2f}"
        pictures.append(Picture(title, image))
        rows.append((n, b, found.density, found.expected, found.normalized, ssim))
        table[n, b] = found.density, found.normalized, ssim
    chosen, most = table[49, BASELINE_M], table[100, 5.0]
    change = "N = 49, b = 3.5 m to N = 100, b = 5 m"
    return PaperFigure(
        "8",
        "a chart seen through a stand from 50 m, by N and b",
        seed,
        ("N", "b_m", "p", "V", "vhat", "ssim"),
        tuple(rows),
        tuple(
            PaperValue(
                f"gain of {name} from {change}", "0.04 to 0.05", f"{most[k] - chosen[k]:+.3f}"
            )
            for name, k in (("V̂", 1), ("SSIM", 2))
        ),
        (
            "The chart becomes clearer with more images and with larger distances between them.",
            f"The rays of an aperture of 45 m cross more foliage. p increases from {chosen[0]:.2f} to "
            f"{most[0]:.2f}. In the reference image, p is {DENSITY:g}, so the new image is darker than the reference.",
        ),
        tuple(pictures),
    )


def draw(figure: Figure, shown: PaperFigure, theme: Theme) -> None:
    """Draw the images; N increases downwards and b increases to the right."""
    panels = body(figure, shown, theme).subplots(len(SIDES), len(BASELINES_M))
    pictured(panels.flat, shown.pictures, 6.5)
    for row, side in zip(panels, SIDES, strict=True):
        row[0].set_ylabel(f"$N$ = {side * side}")
    for panel, b in zip(panels[-1], BASELINES_M, strict=True):
        panel.set_xlabel(f"$b$ = {b:g} m")
