"""Fig. 9: integral images by aperture and number of samples at b = 2.8 m, from a rendered recording.

Each picture has its SSIM against the integral of all 504 images, as in the paper.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.show.figures.paper.paper_figure import (
    PaperFigure,
    PaperValue,
    Picture,
    body,
    pictured,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.show.figures.paper.paper_figure import Progress
    from aosplan.show.figures.style import Theme

APERTURES_M = (0.0, 4.0, 8.0, 12.0, 16.0, 20.0, 28.0)

LOSSES = "no significant loss"
"""What the paper says about the SSIM of 25 and more samples."""

DIFFERENCE = (
    "The recording of the paper is not public, and the paper contains no numbers for this figure. In "
    "the simulated recording, the rays of wide apertures cross more foliage, so their images are "
    "darker."
)


def compared_values(views: int, ssim: float, matched: float) -> tuple[PaperValue, ...]:
    """The SSIM for several numbers of samples, each with the original and with matched brightness
    and contrast.
    """
    words = f"SSIM of N = {views} against all 504 images"
    return (
        PaperValue(words, LOSSES, f"{ssim:.2f}"),
        PaperValue(f"{words}, equally bright", LOSSES, f"{matched:.2f}"),
    )


def numbers(seed: int, progress: Progress | None = None) -> PaperFigure:
    """Compute the image and the SSIM for each aperture."""
    from aosplan.simulation.pictures import check_extra

    check_extra()
    from aosplan.show.figures.paper.recording import RULE_M, VIEWS, compared_subsets

    subsets = [(aperture_m, RULE_M) for aperture_m in APERTURES_M]
    compared, reference = compared_subsets(seed, subsets, progress)
    rows, pictures = [], []
    for aperture_m, found in zip(APERTURES_M, compared, strict=True):
        rows.append((aperture_m, found.views, found.ssim, found.matched))
        title = f"a = {aperture_m:g} m, N = {found.views}\nSSIM {found.ssim:.2f}"
        pictures.append(Picture(title, found.image))
    pictures.append(Picture(f"all: a = 50 m, N = {VIEWS}\nthe reference", reference))
    chosen = next(row for row in rows if row[1] >= 25)
    return PaperFigure(
        "9",
        "integral images by aperture, 2.8 m apart, from 40 m",
        seed,
        ("aperture_m", "N", "ssim", "ssim_matched"),
        tuple(rows),
        compared_values(*chosen[1:]),
        (
            f"SSIM rises from {rows[0][2]:.2f} for one image to {rows[-1][2]:.2f} for "
            f"{rows[-1][1]}.",
            DIFFERENCE,
        ),
        tuple(pictures),
    )


def draw(figure: Figure, shown: PaperFigure, theme: Theme) -> None:
    """Draw the images."""
    pictured(body(figure, shown, theme).subplots(2, 4).flat, shown.pictures)
