"""The kinds of figures.

Each kind is a module with three parts: a class, a function that creates an object of this class
without Matplotlib, and `draw`, which draws the object on a Matplotlib figure.  The class contains
plain numbers.  It has a title, a `description` (the text alternative of the figure) and a
`document`.  `aosplan.show.figures.style` has the colours, and `aosplan.show.figures.canvas`
converts figures to the bytes of a PNG, SVG or PDF file.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.show.figures.style import Theme


class FigureData(Protocol):
    """The numbers of a figure."""

    @property
    def title(self) -> str:
        """Title of the figure, in one line."""

    def description(self) -> str:
        """Description as text, for readers who cannot see the figure."""

    def document(self) -> dict[str, Any]:
        """The numbers as plain values."""


class FigureKind(NamedTuple):
    """A kind of figure: its name, the source of its numbers, its module, and the ratio of its
    height to its width.
    """

    name: str
    summary: str
    source: str
    module: str
    height: float

    def draw(self, figure: Figure, shown: FigureData, theme: Theme) -> None:
        """Draw the numbers on a figure."""
        import_module(f"aosplan.show.figures.{self.module}").draw(figure, shown, theme)


KINDS = {
    kind.name: kind
    for kind in (
        FigureKind(
            "visibility",
            "V̂ and V against the number of photos N and the baseline b, with the plan",
            "plan",
            "visibility",
            0.82,
        ),
        FigureKind(
            "tradeoff",
            "baseline, extent and flight time of each number of photos",
            "plan",
            "tradeoff",
            0.82,
        ),
        FigureKind("grid", "the waypoints on the ground, to scale", "plan", "grid", 1.0),
        FigureKind("density", "density of occluders at each height", "scene", "density", 0.62),
        FigureKind(
            "baseline-curve",
            "share of the occluders that neighbouring photos separate, against the baseline",
            "scene",
            "coverage_curve",
            0.62,
        ),
        FigureKind(
            "correlogram",
            "correlation of what two photos hide, by distance and direction",
            "scene",
            "correlogram",
            0.56,
        ),
        FigureKind(
            "sweep",
            "one result of a sweep against another, or one result over two inputs",
            "results",
            "sweep",
            0.66,
        ),
        FigureKind(
            "paper", "a figure of the paper, by its number", "paper", "paper.registry", 0.66
        ),
    )
}
"""All kinds by name."""
