"""The one style of all figures: colours, lines, letters.

The colours of data differ in lightness by at least `LEAST_STEP`, so that they survive a grey print,
and for eyes that see two colours of three; each has a line style and a marker of its own as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

LEAST_CONTRAST = 3.0
"""Of everything that is drawn to its background: WCAG 2.2, 1.4.11; of text 4.5."""

LEAST_STEP = 10.0
"""Between the lightness (CIE L*) of any two colours of data."""

LONGEST = 60
"""Letters of a name in a legend."""

TITLE = 95
"""Letters of a title."""

LINES = ("-", "--", "-.", ":")
MARKERS = ("o", "s", "^", "D")


class Theme(NamedTuple):
    """Colours on a background.

    `data` are told apart whatever the eye or the printer; `shade` fills the areas behind them.
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
    """Settings of matplotlib for a theme, on top of its own defaults."""
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
    """Words with a name from a request or a file, without the letters that steer a terminal."""
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in text)


def plain(text: str, longest: int = LONGEST) -> str:
    """Words with a name from a request or a file as a figure shows them: short, no mathematics."""
    shown = printable(text)
    shown = shown if len(shown) <= longest else f"{shown[: longest - 1]}…"
    return shown.replace("$", r"\$")


def entitle(figure: Figure, title: str) -> None:
    """Put a title over a figure, at its left."""
    figure.suptitle(plain(title, TITLE), x=0.01, ha="left", size=9.5, wrap=True)


def logarithmic(axis: Axis, steps: tuple[float, ...] = (1.0, 2.0, 5.0)) -> None:
    """Label a logarithmic axis at these steps of each decade, in plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def legend_below(figure: Figure, handles: list[Any]) -> None:
    """A legend below a figure, in as many columns as there is room for."""
    longest = max(len(handle.get_label()) for handle in handles)
    column = 4.4 * longest + 36.0  # points: letters of 7.5 and what stands before them
    room = 72.0 * figure.get_size_inches()[0] - 12.0
    figure.legend(handles=handles, loc="outside lower left", ncols=max(int(room / column), 1))
