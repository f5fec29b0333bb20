"""Figures of the paper, computed again: `paper_figure`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aosplan.api.summarized import Summarized
from aosplan.show.figures.paper import paper_figure as paper
from aosplan.show.figures.paper.registry import SEED, checked_number, kind_of, numbers_of

if TYPE_CHECKING:
    from collections.abc import Callable


class PaperFigure(Summarized, paper.PaperFigure):
    """The numbers of a figure of the paper.

    It has the attributes of `aosplan.show.figures.paper.paper_figure.PaperFigure`: `values` has
    several quantities, each with its value in the paper and the value computed here.
    """

    __slots__ = ()

    def summary(self) -> tuple[str, dict[str, str]]:
        """A headline and named values as text."""
        return self.title, {
            value.quantity: f"paper {value.paper}, here {value.project}" for value in self.values
        }

    def columns(self) -> dict[str, list[Any]]:
        """The numbers that are drawn, as columns."""
        return self.where()

    def plot(self) -> Any:
        """Draw the figure with Matplotlib.

        Returns
        -------
        ax
            The axes; an array of them for figures with several panels.
        """
        from aosplan.show.figures.axes import plotted

        return plotted(kind_of(self.number), self)


def paper_figure(
    number: int | str,
    *,
    seed: int = SEED,
    progress: Callable[[int, int], None] | None = None,
) -> PaperFigure:
    """Compute a figure of the paper again. The result contains the values of the paper and the
    values that are computed here.

    Parameters
    ----------
    number
        Number of the figure in the paper: ``"2b"``, or 3 to 10.
    seed
        Seed of the simulations, at least 0.
    progress
        Function that is called with the number of finished steps and the total number of steps.

    Raises
    ------
    RequestError
        If the paper has no figure with this number, or the figure shows no data.
    MissingExtraError
        If the extra ``pictures`` is not installed, for Figures 8 to 10.

    Examples
    --------
    >>> import aosplan
    >>> found = aosplan.paper_figure(6)
    >>> found.values[2].quantity, found.values[2].paper, found.values[2].project
    ('b at which 98 % have d̂ ≥ 1, uniform', '3.5 m', '3.50 m')
    """
    from aosplan.units import index

    found = numbers_of(checked_number(number), index(seed, "seed"), progress)
    return PaperFigure(*found)
