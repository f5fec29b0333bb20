"""The values of a figure of the paper, and the parts of a drawing that all of these figures have in
common.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from aosplan.show.figures.style import entitle, plain

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from aosplan.show.figures.style import Theme

    Progress = Callable[[int, int], None]

T = TypeVar("T")

ROW_INCHES = 0.165
"""Height of a row of the table below a figure."""

PAPER_AT, PROJECT_AT = 0.61, 0.82
"""Positions at which the second and the third column of this table begin, as shares of
its width.
"""

UNSTATED = "not stated"

NOT_PUBLIC = "The paper's LiDAR scan is not public; the stands here are generated."


class PaperValue(NamedTuple):
    """A quantity with the value in the paper and the value computed here."""

    quantity: str
    paper: str
    project: str


class Picture(NamedTuple):
    """An image of a figure, grey or in colour, with values from 0 to 1, and its title."""

    title: str
    image: Any


class PaperFigure(NamedTuple):
    """A figure of the paper.

    Attributes
    ----------
    number, subject
        The number of the figure in the paper, and a description of its content.
    seed
        Seed of the simulations.
    names, rows
        The numbers that are drawn, as a table: names of the columns, and rows.
    values
        Quantities with their values in the paper and the values computed here.
    remarks
        Sentences about the agreement and the differences.
    pictures
        Images; empty for figures without images.
    """

    number: str
    subject: str
    seed: int
    names: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    values: tuple[PaperValue, ...]
    remarks: tuple[str, ...] = ()
    pictures: tuple[Picture, ...] = ()

    @property
    def title(self) -> str:
        """Title of the figure, in one line."""
        return f"Fig. {self.number} of the paper: {self.subject}"

    def description(self) -> str:
        """The values of the paper and the values computed here, as text."""
        compared = "; ".join(
            f"{value.quantity}: paper {value.paper}, here {value.project}" for value in self.values
        )
        return " ".join([f"{self.title}. {compared}.", *self.remarks, f"Seed {self.seed}."])

    def document(self) -> dict[str, Any]:
        """The numbers as plain values, without the pictures."""
        found = self._asdict() | {"values": [value._asdict() for value in self.values]}
        del found["pictures"]
        return found

    def where(self, **equal: Any) -> dict[str, list[Any]]:
        """The columns, with only those rows that have the given values."""
        wanted = {self.names.index(name): value for name, value in equal.items()}
        kept = [row for row in self.rows if all(row[k] == v for k, v in wanted.items())]
        return {name: [row[k] for row in kept] for k, name in enumerate(self.names)}


def counted(items: Sequence[T], progress: Progress | None) -> Iterator[T]:
    """Yield the items one after the other, and call `progress` with the number of
    finished items.
    """
    for done, item in enumerate(items, 1):
        yield item
        if progress is not None:
            progress(done, len(items))


def agreement(what: str, errors: Sequence[float]) -> str:
    """Sentence about the differences between simulated points and the model, in standard errors."""
    away = [abs(each) for each in errors]
    near = sum(each < 2.0 for each in away)
    return (
        f"{what}: {near} of {len(away)} simulated points are within 2 standard errors of the "
        f"model; the farthest is {max(away):.1f} standard errors away."
    )


def plus_minus(value: float, error: float, digits: int = 3) -> str:
    """A value with its standard error."""
    return f"{value:.{digits}f} ± {error:.{digits}f}"


def body(figure: Figure, shown: PaperFigure, theme: Theme) -> SubFigure:
    """The upper part of a figure, with the title. The table of values is drawn below this part."""
    height = figure.get_size_inches()[1]
    table = ROW_INCHES * (len(shown.values) + 1.6)
    parts: Any = figure.subfigures(2, 1, height_ratios=(height - table, table))
    upper: SubFigure = parts[0]
    lower: SubFigure = parts[1]
    for part in (upper, lower):
        part.set_facecolor(theme.background)
    entitle(upper, shown.title)
    lines = [PaperValue(f"seed {shown.seed}", "paper", "here"), *shown.values]
    for index, line in enumerate(lines):
        y = 1.0 - ROW_INCHES / table * (index + 0.8)
        for x, text in zip((0.01, PAPER_AT, PROJECT_AT), line, strict=True):
            lower.text(x, y, plain(text), size=7.5, color=theme.text if index else theme.muted)
    return upper


def simulated(axes: Axes, x: Any, y: Any, errors: Any, color: str) -> None:
    """Draw simulated points with error bars of two standard errors."""
    axes.errorbar(
        x, y, [2.0 * error for error in errors], fmt="o", ms=3, lw=0.9, color=color, zorder=3
    )


def starred(axes: Axes, x: float, y: float, theme: Theme, label: str) -> None:
    """Mark a value of the paper with a star."""
    axes.plot(
        [x], [y], "*", ms=12, color=theme.text, mec=theme.background, zorder=5, label=label, ls=""
    )


def pictured(panels: Sequence[Axes], pictures: Sequence[Picture], size: float = 7.5) -> None:
    """Draw a picture in each panel."""
    for panel, (title, image) in zip(panels, pictures, strict=True):
        panel.imshow(image, cmap="gray", vmin=0.0, vmax=1.0, interpolation="nearest")
        panel.set(xticks=[], yticks=[])
        panel.set_title(title, size=size, loc="center", pad=3.0)
        panel.grid(visible=False)
        panel.spines[:].set_visible(False)
