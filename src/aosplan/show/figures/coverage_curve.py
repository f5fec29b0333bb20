"""Figure of the share of the occluders with d̂ >= 1, by baseline divided by altitude (Fig. 6b of
the paper).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.camera.disparity import coverage_baseline
from aosplan.errors import InfeasibleError, RequestError
from aosplan.scenes.summary import statistics_document
from aosplan.show.figures.style import entitle, logarithmic

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from aosplan.scenes.scene import Scene
    from aosplan.show.figures.style import Theme

SHARES = (0.5, 0.9)
"""The description gives the baselines for these shares and for the requested share."""


class BaselineCurve(NamedTuple):
    """Knots of the curve: b/h, and the share of occluders with d̂ >= 1.

    If the curve is `stepped`, the share is constant from each knot to the next.  This is the case
    for layers at single heights.  Otherwise the share is linear between knots.  `ratio` is b/h for
    the requested share; None if no baseline reaches this share.
    """

    scene: str
    coverage: float
    ratio: float | None
    knots: tuple[tuple[float, float], ...]
    stepped: bool
    altitude_m: float | None = None

    @property
    def title(self) -> str:
        """Title of the figure, in one line."""
        return f"Occluders that neighbouring photos separate in {self.scene}"

    def description(self) -> str:
        """Description of the curve as text."""
        text = f"{self.title}: the share with d̂ of at least 1 rises from {self.knots[0][1]:.3g} at "
        text += (
            f"b/h = {self.knots[0][0]:.3g} to {self.knots[-1][1]:.3g} at {self.knots[-1][0]:.3g}"
        )
        for share in SHARES:
            there = next((ratio for ratio, found in self.knots if found >= share), None)
            if there is not None:
                text += f"; {share:.0%} at {there:.3g}"
        if self.ratio is None:
            return f"{text}. No baseline reaches the required share of {self.coverage:.4g}."
        text += f". The required share of {self.coverage:.4g} is reached at b/h = {self.ratio:.4g}"
        if self.altitude_m is not None:
            text += f", which is a baseline of {self.ratio * self.altitude_m:.3g} m from {self.altitude_m:g} m"
        return f"{text}."

    def document(self) -> dict[str, Any]:
        """The numbers as plain values."""
        return self._asdict()


def curve_of(
    scene: Scene | None, coverage: float, altitude_m: float | None = None
) -> BaselineCurve:
    """The curve of a scene with heights above the focal plane, and the baseline of the coverage
    rule.

    Raises
    ------
    RequestError
        If the scene is empty.
    """
    if scene is None or scene.integrated_density == 0.0:
        raise RequestError("no occluder is above the focal plane")
    knots = statistics_document(scene)["baseline_curve"]
    try:
        # Any h above the canopy can be used, because b/h does not depend on h.
        h = 2.0 * scene.canopy_top_m
        ratio = coverage_baseline(scene.slabs(), h, math.inf, coverage).baseline_m / h
    except InfeasibleError:
        ratio = None
    return BaselineCurve(
        scene.title or scene.name,
        coverage,
        ratio,
        tuple((k, share) for k, share in knots),
        all(slab.bottom_m == slab.top_m for slab in scene.slabs()),
        altitude_m,
    )


def draw(figure: Figure, shown: BaselineCurve, theme: Theme) -> None:
    """Draw the share against b/h on a logarithmic axis. If there is an altitude, a second axis
    shows b.
    """
    draw_panel(figure.subplots(), shown, theme)
    entitle(figure, shown.title)


def draw_panel(panel: Axes, shown: BaselineCurve, theme: Theme) -> list[Any]:
    """Draw the curve on one panel, with its legend."""
    first = [(shown.knots[0][0], 0.0)] if shown.stepped else []
    panel.plot(
        *zip(*first, *shown.knots, strict=True),
        color=theme.data[0],
        drawstyle="steps-post" if shown.stepped else "default",
        label="occluders with $\\hat{d}$ ≥ 1",
    )
    panel.axhline(
        shown.coverage,
        color=theme.muted,
        ls=(0, (1, 1)),
        lw=1.2,
        label=f"required share {shown.coverage:.4g}",
    )
    if shown.ratio is not None:
        words = f"$b/h$ = {shown.ratio:.3g}"
        if shown.altitude_m is not None:
            words += f", $b$ = {shown.ratio * shown.altitude_m:.3g} m"
        panel.plot(
            [shown.ratio],
            [shown.coverage],
            "*",
            ms=13,
            mfc=theme.text,
            mec=theme.background,
            zorder=5,
            label=words,
        )
    panel.set(
        xscale="log",
        ylim=(-0.02, 1.05),
        xlabel="baseline divided by altitude $b/h$, log scale",
        ylabel="share of the occluders",
    )
    logarithmic(panel.xaxis)
    if shown.altitude_m is not None:
        altitude: Any = shown.altitude_m  # The type is Any, because the altitude multiplies arrays.
        top = panel.secondary_xaxis(
            "top", functions=(lambda ratio: altitude * ratio, lambda b: b / altitude)
        )
        logarithmic(top.xaxis)
        top.set_xlabel(f"baseline $b$ [m] from {altitude:g} m, log scale")
    panel.legend(loc="lower right")
    return []
