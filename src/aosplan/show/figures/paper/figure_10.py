"""Fig. 10: SSIM against aperture at b = 2.8 m, for a rendered recording of 504 images from 40 m."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

from aosplan.show.figures.paper.figure_9 import DIFFERENCE, LOSSES, compared_values
from aosplan.show.figures.paper.paper_figure import PaperFigure, body
from aosplan.show.figures.style import legend_below

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.show.figures.paper.paper_figure import Progress
    from aosplan.show.figures.style import Theme

APERTURES_M = tuple(4.0 * k for k in range(13))
VIEWS = ("2.8 m apart", "all, 2 m apart")


def numbers(seed: int, progress: Progress | None = None) -> PaperFigure:
    """Compute the SSIM of the integral for each aperture, once with a thinned set of views and once
    with all views.
    """
    from aosplan.simulation.pictures import check_extra

    check_extra()
    from aosplan.show.figures.paper.recording import RULE_M, compared_subsets

    choices = [*product(zip(VIEWS, (RULE_M, None), strict=True), APERTURES_M)]
    subsets = [(aperture_m, pitch_m) for (_, pitch_m), aperture_m in choices]
    compared, _ = compared_subsets(seed, subsets, progress)
    rows = [
        (name, aperture_m, found.views, found.ssim, found.matched)
        for ((name, _), aperture_m), found in zip(choices, compared, strict=True)
    ]
    ruled = [row for row in rows if row[0] == VIEWS[0]]
    chosen = next(row for row in ruled if row[2] >= 25)
    wide = next(row for row in ruled if row[1] >= 20.0)
    return PaperFigure(
        "10",
        "SSIM against all 504 images, by aperture",
        seed,
        ("views", "aperture_m", "N", "ssim", "ssim_matched"),
        tuple(rows),
        (*compared_values(*chosen[2:]), *compared_values(*wide[2:])),
        (
            DIFFERENCE,
            "By Eq. 5, 25 samples have an aperture of 12 m. The text of the paper states 14 m.",
            "On a 2 m lattice, the smallest distance of at least 2.8 m is the diagonal, 2.83 m.",
        ),
    )


def draw(figure: Figure, shown: PaperFigure, theme: Theme) -> None:
    """Draw SSIM against the aperture, with the original brightness and with matched brightness."""
    upper = body(figure, shown, theme)
    axes = upper.subplots()
    for name, color, marker in zip(VIEWS, theme.data, "os", strict=False):
        line = shown.where(views=name)
        axes.plot(
            line["aperture_m"], line["ssim"], f"-{marker}", color=color, label=f"views {name}"
        )
        axes.plot(
            line["aperture_m"],
            line["ssim_matched"],
            "--",
            lw=1.1,
            color=color,
            label=f"views {name}, equally bright",
        )
    axes.axvline(14.0, color=theme.muted, ls="-.", lw=0.9, label=f"paper: {LOSSES} from 14 m on")
    axes.set(
        xlabel="aperture $a$ [m]",
        ylabel="SSIM against all 504 images",
        xlim=(-1, 50),
        ylim=(0, 1.03),
    )
    legend_below(upper, axes.get_legend_handles_labels()[0])
