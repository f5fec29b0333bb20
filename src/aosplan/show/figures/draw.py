"""Figures: what a plan, a stand or a sweep looks like, and the same said in words.

A file a kind.  Each has a class of plain numbers with a title, a `description` (the figure's text
alternative) and a `document`; a function that makes them and knows nothing of matplotlib; and
`draw`, which puts them on a figure.  `aosplan.show.figures.style` has the colours, `aosplan.show.figures.canvas`
turns what is drawn into the bytes of a PNG, SVG or PDF file.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.show.figures.style import Theme


class Shown(Protocol):
    """The numbers of a figure."""

    @property
    def title(self) -> str:
        """What it is, in one line."""

    def description(self) -> str:
        """What it shows, in words: for who cannot see it."""

    def document(self) -> dict[str, Any]:
        """Its numbers as plain values."""


class Kind(NamedTuple):
    """A kind of figure: what it is made from, in which module, and its height over its width."""

    name: str
    summary: str
    source: str
    module: str
    height: float

    def draw(self, figure: Figure, shown: Shown, theme: Theme) -> None:
        """Put the numbers on a figure."""
        import_module(f"aosplan.show.figures.{self.module}").draw(figure, shown, theme)


KINDS = {
    kind.name: kind
    for kind in (
        Kind(
            "visibility",
            "V̂ and V against N and b, and the chosen point",
            "plan",
            "visibility",
            0.82,
        ),
        Kind("tradeoff", "baseline, extent and time of each N", "plan", "tradeoff", 0.82),
        Kind("grid", "the waypoints on the ground, to scale", "plan", "grid", 1.0),
        Kind("density", "density of occluders at each height", "scene", "density", 0.62),
        Kind(
            "baseline-curve", "share of occluders at d̂ >= 1 by b/h", "scene", "coverage_curve", 0.62
        ),
        Kind(
            "correlogram", "correlation of views by lag and direction", "scene", "correlogram", 0.56
        ),
        Kind("sweep", "two results of a sweep, or one over two inputs", "results", "sweep", 0.66),
    )
}
"""Every kind by its name."""
