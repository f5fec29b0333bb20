"""Figure of a correlogram: the correlation of two views, by the distance and the direction between
their cameras.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.show.figures.style import LINES, MARKERS, entitle, legend_below, logarithmic

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.show.figures.style import Theme

SHOWN = 4
"""Number of directions that are drawn as separate lines.  They are evenly spaced."""


class CorrelogramFigure(NamedTuple):
    """A correlogram: ρ for each direction and lag.  The lag is the camera offset divided by the
    altitude.
    """

    scene: str
    lags: tuple[float, ...]
    directions_deg: tuple[float, ...]
    rho: tuple[tuple[float, ...], ...]
    reach: float

    @property
    def title(self) -> str:
        """Title of the figure, in one line."""
        return f"Correlogram of {self.scene}"

    @property
    def mean(self) -> tuple[float, ...]:
        """ρ for each lag, averaged over the directions."""
        return tuple(sum(column) / len(self.rho) for column in zip(*self.rho, strict=True))

    def description(self) -> str:
        """Description of the table as text."""
        mean = self.mean
        below = next((lag for lag, rho in zip(self.lags, mean, strict=True) if rho < 0.5), None)
        spread = [max(column) - min(column) for column in zip(*self.rho, strict=True)]
        widest = max(range(len(spread)), key=spread.__getitem__)
        column = [row[widest] for row in self.rho]
        text = (
            f"{self.title}: correlation between what two photos hide, by the distance of "
            "their cameras "
        )
        text += f"divided by the altitude. Mean over {len(self.rho)} directions: "
        places = sorted({0, len(mean) // 3, 2 * len(mean) // 3, len(mean) - 1})
        text += ", ".join(f"{mean[k]:.2f} at {self.lags[k]:.3g}" for k in places)
        text += "" if below is None else f"; it is below one half from {below:.3g} on"
        return (
            f"{text}. Directions differ most at {self.lags[widest]:.3g}: from {min(column):.2f} at "
            f"{self.directions_deg[column.index(min(column))]:g}° to {max(column):.2f} at "
            f"{self.directions_deg[column.index(max(column))]:g}°, clockwise from north. The plot "
            f"is large enough for lags up to {self.reach:.3g}."
        )

    def document(self) -> dict[str, Any]:
        """The numbers as plain values."""
        return self._asdict()


def correlations_of(found: LoadedScene) -> CorrelogramFigure:
    """The correlogram of a scene.  It is read from the scene or computed from its voxels.

    Raises
    ------
    RequestError
        If the scene has neither a correlogram nor voxels.
    """
    table = found.correlogram
    if table is None and found.volume is not None:
        from aosplan.scenes.correlogram import correlogram

        table = correlogram(found.volume)
    if table is None:
        raise RequestError(
            f"scene '{found.scene.name}' has neither a correlogram nor voxels to compute one",
            "give a point cloud, or a file that aosplan scene --save wrote from one",
        )
    return CorrelogramFigure(
        found.scene.title or found.scene.name,
        tuple(table.lags.tolist()),
        tuple(table.directions_deg.tolist()),
        tuple(map(tuple, table.rho.tolist())),
        table.reach,
    )


def draw(figure: Figure, shown: CorrelogramFigure, theme: Theme) -> None:
    """Draw lines for some directions, the range of all directions, and a map of all directions."""
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
    columns = list(zip(*shown.rho, strict=True))
    left.fill_between(
        shown.lags,
        [min(c) for c in columns],
        [max(c) for c in columns],
        color=theme.faint,
        lw=0,
        label="all directions",
    )
    count = len(shown.directions_deg)
    for place in range(min(SHOWN, count)):
        row = place * count // min(SHOWN, count)
        left.plot(
            shown.lags,
            shown.rho[row],
            LINES[place],
            marker=MARKERS[place],
            ms=3,
            color=theme.data[place],
            lw=1.2,
            label=f"{shown.directions_deg[row]:g}° from north",
        )
    left.set(xlabel="offset / altitude, log scale", ylabel=r"correlation $\rho$")
    left.set_ylim(min(0.0, *map(min, shown.rho)) - 0.02, 1.02)
    for panel in (left, right):
        if shown.reach <= shown.lags[-1]:
            panel.axvline(
                shown.reach,
                color=theme.muted,
                ls="-.",
                lw=1.0,
                label="largest offset for this plot",
            )
        panel.set_xscale("log")
        logarithmic(panel.xaxis, (1.0, 3.0))
    legend_below(figure, left.get_legend_handles_labels()[0])
    step = 180.0 / count
    image = right.pcolormesh(
        shown.lags,
        [*shown.directions_deg, 180.0],
        [*shown.rho, shown.rho[0]],
        cmap=theme.map,
        shading="gouraud",
        vmin=min(0.0, *map(min, shown.rho)),
        vmax=1.0,
        rasterized=True,
    )
    right.set(xlabel="offset / altitude, log scale", ylabel="direction from north [°]")
    right.set_yticks([step * k for k in range(0, count + 1, max(count // 4, 1))])
    right.grid(visible=False)
    figure.colorbar(image, ax=right, label=r"correlation $\rho$")
    entitle(figure, shown.title)
