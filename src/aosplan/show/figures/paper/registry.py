"""The figures of the paper by number."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.show.figures.draw import KINDS, FigureKind

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.show.figures.paper.paper_figure import PaperFigure, Progress
    from aosplan.show.figures.style import Theme

SEED = 2019
"""Default seed.  The figures of the documentation are made with this seed."""


class Entry(NamedTuple):
    """A figure of the paper: its subject, the ratio of its height to its width, and its computing
    time.
    """

    summary: str
    height: float
    seconds: int = 1

    @property
    def described(self) -> str:
        """The subject, and the computing time if it is more than a few seconds."""
        return f"{self.summary} (about {self.seconds} s)" if self.seconds > 4 else self.summary


FIGURES = {
    "2b": Entry("density p against l/o, for several D", 0.66, 2),
    "3": Entry("visibility V against disparity, for p = 25, 50 and 75 %", 0.66, 10),
    "4": Entry("an averaged noise pattern at eight disparities", 0.64, 2),
    "5": Entry("V and V̂ against p and N, if no occluder is shared", 0.74, 2),
    "6": Entry("p of a stand from the top down; share of occluders with d̂ ≥ 1", 0.76),
    "7": Entry("V̂ against the aperture, of the model and of stands", 0.8, 8),
    "8": Entry("a chart seen through a stand, by N and b, with V̂ and SSIM", 1.0, 3),
    "9": Entry("integral images by aperture, with SSIM against all 504 images", 0.74, 4),
    "10": Entry("SSIM against all 504 images, by aperture", 0.8, 11),
}
"""The figures of the paper that show data.  The other figures are drawings and photos."""


def checked_number(number: Any) -> str:
    """Extract the number of a figure of the paper from text such as ``7`` or ``fig. 2b``.

    Raises
    ------
    RequestError
        If there is no such figure with data.
    """
    found = str(number).strip().lower().removeprefix("fig.").removeprefix("figure").strip()
    if found == "2":
        found = "2b"  # Fig. 2a is a drawing without data.
    elif found[-1:] in ("a", "b", "c") and found[:-1] in FIGURES:
        found = found[:-1]
    if found not in FIGURES:
        raise RequestError(
            f"the paper has no figure '{number}' that shows data", f"one of {', '.join(FIGURES)}"
        )
    return found


def kind_of(number: str) -> FigureKind:
    """Return the kind of drawing for a figure of the paper."""
    return KINDS["paper"]._replace(height=FIGURES[number].height)


def numbers_of(number: str, seed: int = SEED, progress: Progress | None = None) -> PaperFigure:
    """Compute the numbers of a figure of the paper.

    Parameters
    ----------
    number
        A key of `FIGURES`.
    seed
        Seed of the simulations, at least 0.
    progress
        Function that is called with the number of finished steps and the total number of steps.

    Raises
    ------
    MissingExtraError
        If Figure 8, 9 or 10 is computed without the extra ``pictures``.
    """
    found: PaperFigure = _module_of(number).numbers(seed, progress)
    assert found.number == number
    return found


def draw(figure: Figure, shown: PaperFigure, theme: Theme) -> None:
    """Draw a figure of the paper."""
    _module_of(shown.number).draw(figure, shown, theme)


def _module_of(number: str) -> Any:
    return import_module(f"aosplan.show.figures.paper.figure_{number}")
