"""Draws figures on Matplotlib axes of the caller, or on a new pyplot figure."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError
from aosplan.show.figures.canvas import INCH_MM, FigureStyle, check_extra
from aosplan.show.figures.style import rules

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from aosplan.show.figures.draw import FigureData, FigureKind


def axes_or_new(ax: Axes | None, size_in: tuple[float, float]) -> Axes:
    """The given axes, or the axes of a new pyplot figure of this size [inches].

    Raises
    ------
    MissingExtraError
        If Matplotlib is not installed.
    """
    check_extra()
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    found: Axes = plt.subplots(figsize=size_in, layout="constrained")[1]
    return found


def plotted(kind: FigureKind, shown: FigureData, ax: Axes | None = None) -> Any:
    """Draw a figure on Matplotlib axes.

    Parameters
    ----------
    kind, shown
        The kind of figure, and its numbers.
    ax
        Axes to draw on, with the settings of their figure; None for a new pyplot figure in the
        style of ``aosplan plot``.

    Returns
    -------
    ax
        The axes, or an array of them if the figure has several.

    Raises
    ------
    RequestError
        If the kind has several panels and `ax` is given.
    MissingExtraError
        If Matplotlib is not installed.
    """
    check_extra()
    if ax is not None:
        draw_panel = getattr(
            import_module(f"aosplan.show.figures.{kind.module}"), "draw_panel", None
        )
        if draw_panel is None:
            raise RequestError(
                f"a figure of kind '{kind.name}' has several panels and does not fit into one axes",
                "leave ax out",
            )
        handles = draw_panel(ax, shown, FigureStyle().theme)
        if handles:
            ax.legend(handles=handles, fontsize="small")
        ax.set_title(shown.title, fontsize="medium")
        return ax
    import matplotlib as mpl
    import matplotlib.pyplot as plt
    import numpy as np

    look = FigureStyle()
    width = look.width_mm / INCH_MM
    settings: Any = rules(look.theme)
    with plt.rc_context(settings):
        figure = plt.figure(figsize=(width, width * kind.height), layout="constrained")
        kind.draw(figure, shown, look.theme)
        # The figure is drawn inside the context, because ticks read their settings when they are
        # drawn for the first time.
        interactive = mpl.is_interactive()
        figure.draw_without_rendering()
    # The first figure loads the backend. The backend of a notebook turns the interactive mode on,
    # but the end of the context turned it off again. Without this mode, later figures would not be
    # displayed.
    mpl.interactive(interactive)
    panels = [panel for panel in figure.axes if panel.get_label() != "<colorbar>"]
    return panels[0] if len(panels) == 1 else np.array(panels)
