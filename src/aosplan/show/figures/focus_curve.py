"""Figure of the agreement between two halves of the views of a recording, by the height of the
focal plane.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.show.figures.style import entitle

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from aosplan.show.figures.style import Theme


class FocusCurve(NamedTuple):
    """The curve and its peaks: height, agreement, and standard deviation of the height."""

    heights_m: tuple[float, ...]
    agreement: tuple[float, ...]
    peaks: tuple[tuple[str, float, float, float], ...]

    @classmethod
    def of(cls, focus: Mapping[str, Any]) -> FocusCurve:
        """The curve from the document of a focus."""
        peaks = tuple(
            (
                "lowest layer" if focus["crowns"] is None else name,
                peak["place"],
                peak["value"],
                peak["deviation"],
            )
            for name in ("ground", "crowns")
            if (peak := focus[name]) is not None
        )
        return cls(tuple(focus["heights_m"]), tuple(focus["agreement"]), peaks)

    @property
    def title(self) -> str:
        """Title of the figure, in one line."""
        return "Agreement of integrals from disjoint halves of the views"

    def description(self) -> str:
        """Description of the curve as text."""
        return f"{self.title}: " + "; ".join(
            f"{name} at {place:.2f} m (± {deviation:.2g} m), agreement {value:.2f}"
            for name, place, value, deviation in self.peaks
        )

    def document(self) -> dict[str, Any]:
        """The numbers as plain values."""
        return self._asdict()


def draw(figure: Figure, shown: FocusCurve, theme: Theme) -> None:
    """Draw the agreement against the height, and mark the peaks."""
    panel = figure.subplots()
    panel.plot(shown.heights_m, shown.agreement, color=theme.data[0])
    for index, (name, place, value, deviation) in enumerate(shown.peaks):
        panel.errorbar(
            [place],
            [value],
            xerr=[deviation],
            fmt="*v"[index],
            ms=(13, 8)[index],
            mfc=theme.text,
            mec=theme.background,
            ecolor=theme.text,
            capsize=3,
            zorder=5,
            label=f"{name} at {place:.2f} m ± {deviation:.2g} m",
        )
    panel.axhline(0.0, color=theme.muted, ls=(0, (1, 1)), lw=1.2)
    panel.set(xlabel="height of the focal plane [m]", ylabel="agreement", ylim=(None, 1.05))
    panel.legend(loc="upper right")
    entitle(figure, shown.title)
