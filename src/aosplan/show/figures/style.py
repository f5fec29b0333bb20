"""The common style of all figures: colours, lines, fonts.

The lightness of any two colours of data differs by at least `LEAST_STEP`.  The colours can
therefore be distinguished in greyscale and by colour-blind readers.  Each colour also has its own
line style and marker.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure, SubFigure

LEAST_CONTRAST = 3.0
"""Smallest contrast between graphics and their background (WCAG 2.2, 1.4.11). For text, the
smallest contrast is 4.5.
"""

LEAST_STEP = 10.0
"""Smallest difference of lightness (CIE L*) between two colours of data."""

LONGEST = 60
"""Largest number of characters of a name in a legend."""

TITLE = 95
"""Largest number of characters of a title."""

LINES = ("-", "--", "-.", ":")
MARKERS = ("o", "s", "^", "D")


class Theme(NamedTuple):
    """Colours for a background.

    The colours in `data` can always be distinguished.  `shade` is for areas in the background.
    """

    name: str
    background: str
    text: str
    muted: str
    faint: str
    shade: str
    data: tuple[str, str, str, str]
    map: str


LIGHT = Theme(
    name="light",
    background="#ffffff",
    text="#1a1f24",
    muted="#5b6670",
    faint="#dde2e6",
    shade="#e9eff5",
    data=("#0a2a66", "#9e2f50", "#00808f", "#d97500"),
    map="cividis",
)
DARK = Theme(
    name="dark",
    background="#14181d",
    text="#f0f3f5",
    muted="#a3aeb8",
    faint="#343c44",
    shade="#222a33",
    data=("#f7eba0", "#6fd6be", "#f08a4b", "#5a7be8"),
    map="cividis",
)


def rules(theme: Theme) -> dict[str, Any]:
    """Matplotlib settings of a theme, in addition to Matplotlib's defaults."""
    return {
        "figure.facecolor": theme.background,
        "savefig.facecolor": theme.background,
        "axes.facecolor": theme.background,
        "axes.edgecolor": theme.muted,
        "axes.labelcolor": theme.text,
        "axes.titlesize": 9.0,
        "axes.titlelocation": "left",
        "axes.titlecolor": theme.text,
        "axes.labelsize": 8.5,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.linewidth": 0.8,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": theme.faint,
        "grid.linewidth": 0.6,
        "text.color": theme.text,
        "xtick.color": theme.muted,
        "ytick.color": theme.muted,
        "xtick.labelcolor": theme.text,
        "ytick.labelcolor": theme.text,
        "xtick.labelsize": 8.0,
        "ytick.labelsize": 8.0,
        "font.family": ["DejaVu Sans"],
        "font.size": 8.5,
        "mathtext.fontset": "dejavusans",
        "legend.framealpha": 0.85,
        "legend.facecolor": theme.background,
        "legend.edgecolor": "none",
        "legend.fontsize": 7.5,
        "legend.labelcolor": theme.text,
        "lines.linewidth": 1.5,
        "lines.markersize": 4.0,
        "hatch.color": theme.muted,
        "hatch.linewidth": 0.7,
        "figure.constrained_layout.use": True,
        "svg.fonttype": "path",
        "svg.hashsalt": "aosplan",
        "pdf.fonttype": 42,
    }


def printable(text: str) -> str:
    """Text from a request or a file without control characters."""
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in text)


def plain(text: str, longest: int = LONGEST) -> str:
    """Text from a request or a file, shortened and without mathematical markup, for a figure."""
    shown = printable(text)
    shown = shown if len(shown) <= longest else f"{shown[: longest - 1]}…"
    return shown.replace("$", r"\$")


def entitle(figure: Figure | SubFigure, title: str) -> None:
    """Add a title above a figure, aligned left."""
    figure.suptitle(plain(title, TITLE), x=0.01, ha="left", size=9.5, wrap=True)


def logarithmic(axis: Axis, steps: tuple[float, ...] = (1.0, 2.0, 5.0)) -> None:
    """Label a logarithmic axis with plain numbers, at the given multiples in each decade."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def legend_below(figure: Figure | SubFigure, handles: list[Any]) -> None:
    """Add a legend below a figure, with as many columns as fit."""
    longest = max(len(handle.get_label()) for handle in handles)
    # The width of an entry in points is estimated as 4.4 for each character, plus 36 for the
    # symbol.
    column = 4.4 * longest + 36.0
    room = 72.0 * figure.bbox.width / figure.dpi - 12.0
    figure.legend(handles=handles, loc="outside lower left", ncols=max(int(room / column), 1))
