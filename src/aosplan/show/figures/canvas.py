"""Conversion of figures to files. Figures with equal numbers give files with equal bytes. Each file
contains the description of the figure.
"""

from __future__ import annotations

import io
import os
import warnings
from hashlib import sha256
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import MissingExtraError, RequestError
from aosplan.show.figures.style import LIGHT, Theme, printable, rules
from aosplan.xml_text import escaped

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.show.figures.draw import FigureData, FigureKind

EXTRA = "figures"

FORMATS = (".png", ".svg", ".pdf")

WIDTHS_MM = (140.0, 1000.0)
"""Smallest and largest width of a figure. A narrower figure would not have enough space for the
text.
"""

DPIS = (50.0, 1200.0)
MOST_PIXELS = 100_000_000

INCH_MM = 25.4


class FigureStyle(NamedTuple):
    """Appearance of a figure: colours, width, and pixels per inch for PNG."""

    theme: Theme = LIGHT
    width_mm: float = 170.0
    dpi: float = 150.0

    def check(self) -> None:
        """Refuse sizes that are too small or too large.

        Raises
        ------
        RequestError
            If the width or the resolution is outside its bounds, or if there would be too many
            pixels.
        """
        for name, value, (least, most) in (
            ("--width-mm", self.width_mm, WIDTHS_MM),
            ("--dpi", self.dpi, DPIS),
        ):
            if not least <= value <= most:
                raise RequestError(f"{name} {value:g} is not from {least:g} to {most:g}")
        pixels = (self.width_mm / INCH_MM * self.dpi) ** 2  # The tallest figure is a square.
        if pixels > MOST_PIXELS:
            raise RequestError(
                f"--width-mm {self.width_mm:g} at --dpi {self.dpi:g} gives a picture of more "
                f"than {MOST_PIXELS // 10**6} million pixels",
                "give a smaller --width-mm or --dpi, or write .svg or .pdf",
            )


def form_of(path: str) -> str:
    """The format of a path by its extension, without the dot.

    Raises
    ------
    RequestError
        If the path does not have one of the extensions `FORMATS`.
    """
    ending = os.path.splitext(path)[1].lower()
    if ending not in FORMATS:
        raise RequestError(
            f"figure '{path}' does not have one of the extensions {', '.join(FORMATS)}"
        )
    return ending[1:]


def check_extra() -> None:
    """Check that figures can be drawn, before any work is done for them.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    """
    from importlib.util import find_spec

    if find_spec("matplotlib") is None:
        raise MissingExtraError("drawing figures", EXTRA)


def drawn(kind: FigureKind, shown: FigureData, look: FigureStyle) -> Figure:
    """The figure as a Matplotlib object.  `rendered` converts it to a file."""
    from matplotlib.figure import Figure

    width = look.width_mm / INCH_MM
    figure = Figure(figsize=(width, width * kind.height), layout="constrained")
    kind.draw(figure, shown, look.theme)
    return figure


def rendered(
    kind: FigureKind, shown: FigureData, form: str, look: FigureStyle | None = None
) -> bytes:
    """The bytes of a file with a figure.

    Parameters
    ----------
    kind, shown
        The kind of figure, and its numbers.
    form
        ``png``, ``svg`` or ``pdf``.
    look
        Colours and size.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    """
    check_extra()
    import matplotlib as mpl

    look = look or FigureStyle()
    file = io.BytesIO()
    # With this context, a figure does not depend on the Matplotlib settings of the user.
    with mpl.rc_context(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # The warnings are about characters that no font has.
        mpl.rcdefaults()
        settings: Any = mpl.rcParams
        settings.update(rules(look.theme))
        figure = drawn(kind, shown, look)
        figure.savefig(file, format=form, dpi=look.dpi, metadata=_metadata(form, shown))
    content = file.getvalue()
    return _with_words(content, shown) if form == "svg" else content


def _metadata(form: str, shown: FigureData) -> dict[str, Any]:
    """Metadata with the title and the description. They do not contain anything that differs
    between runs.
    """
    title, text = printable(shown.title), printable(shown.description())
    if form == "png":
        return {"Title": title, "Description": text, "Software": None}
    if form == "pdf":
        creator = {"Creator": "aosplan", "Producer": None, "CreationDate": None}
        return {"Title": title, "Subject": text, **creator}
    return {"Date": None, "Creator": None, "Format": None, "Type": None}


def _with_words(svg: bytes, shown: FigureData) -> bytes:
    """Add a title and a description to an SVG.  Screen readers read these texts instead of the
    picture.
    """
    title, text = escaped(shown.title), escaped(shown.description())
    # The identifiers differ between figures, because a page may contain several figures.
    name = sha256(f"{title}\n{text}".encode()).hexdigest()[:8]
    before, tag, after = svg.decode().partition("<svg ")
    attributes, close, rest = after.partition(">")
    role = f'role="img" aria-labelledby="title-{name} text-{name}" '
    words = f'\n <title id="title-{name}">{title}</title>\n <desc id="text-{name}">{text}</desc>'
    return f"{before}{tag}{role}{attributes}{close}{words}{rest}".encode()
