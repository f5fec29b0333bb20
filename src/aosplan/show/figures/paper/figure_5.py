"""Fig. 5a, b: V and V̂ against density and N if no occluder is shared (Eq. 3 and 4)."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

from aosplan.models.equations import (
    normalized_visibility,
    required_samples,
    visibility,
    visibility_limits,
)
from aosplan.show.figures.paper.noise import OCCLUDER_PX, averaged
from aosplan.show.figures.paper.paper_figure import (
    PaperFigure,
    PaperValue,
    agreement,
    body,
    counted,
    simulated,
    starred,
)
from aosplan.show.figures.paper.stand import DENSITY
from aosplan.show.figures.style import LINES, legend_below

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.show.figures.paper.paper_figure import Progress
    from aosplan.show.figures.style import Theme

SAMPLES = (1, 2, 5, 10, 50)
POINTS = (0.1, 0.3, 0.5, 0.7, 0.9)
FEW = (2, 5, 10, 25, 50)
FINE = tuple(0.01 * k for k in range(101))
SHAPE = (200, 200)


def numbers(seed: int, progress: Progress | None = None) -> PaperFigure:
    """Compute the curves, and the V and V̂ of patterns that are shifted by more than the size of an
    occluder.
    """
    rows: list[tuple[object, ...]] = [
        ("a curve", p, n, float(visibility(p, 1, n, 1.0)), None, None)
        for n, p in product(SAMPLES, FINE)
    ]
    limits = [[float(end) for end in visibility_limits(p)] for p in FINE]
    rows += [
        ("a limit", p, None, high, None, None) for p, (_, high) in zip(FINE, limits, strict=True)
    ]
    rows += [
        ("b curve", None, n, float(normalized_visibility(1, n, 1.0)), None, None)
        for n in range(1, 101)
    ]
    away = []
    points = [("a", p, n) for n, p in product(SAMPLES, POINTS)] + [("b", DENSITY, n) for n in FEW]
    for index, (panel, p, n) in enumerate(counted(points, progress)):
        found = averaged(seed, index, p, (1, n), 2 * OCCLUDER_PX, SHAPE)
        if panel == "a":
            model = float(visibility(p, 1, n, 1.0))
            value, error = found.expected, found.expected_standard_error
        else:
            model = float(normalized_visibility(1, n, 1.0))
            value, error = found.normalized, found.normalized_standard_error
        rows.append((f"{panel} point", p, n, model, value, error))
        away.append((value - model) / error)
    gains = [high - low for low, high in limits]
    return PaperFigure(
        "5",
        "V against p, and V̂ against N, for d̂ ≥ 1",
        seed,
        ("part", "p", "N", "model", "simulated", "standard_error"),
        tuple(rows),
        (
            PaperValue("N that V̂ = 98 % requires", "50", str(required_samples("98%"))),
            PaperValue("p at which V gains most", "0.5", f"{FINE[gains.index(max(gains))]:g}"),
        ),
        (agreement("V and V̂ of averaged patterns", away),),
    )


def draw(figure: Figure, shown: PaperFigure, theme: Theme) -> None:
    """Draw V against p, and V̂ against N."""
    upper = body(figure, shown, theme)
    left, right = upper.subplots(1, 2, width_ratios=(1.4, 1.0))
    looks = [
        (theme.text, "-"),
        *((color, line) for color, line in zip(theme.data, LINES, strict=True)),
    ]
    for n, (color, line) in zip(SAMPLES, looks, strict=True):
        curve, points = shown.where(part="a curve", N=n), shown.where(part="a point", N=n)
        left.plot(curve["p"], curve["model"], line, color=color, lw=1.2, label=f"N = {n}")
        simulated(left, points["p"], points["simulated"], points["standard_error"], color)
    limit = shown.where(part="a limit")
    left.plot(limit["p"], limit["model"], color=theme.muted, ls=(0, (1, 1)), label="N = ∞")
    left.set(
        title="(a)",
        xlabel="integrated density $p$",
        ylabel="visibility $V$",
        xlim=(0, 1),
        ylim=(0, 1.03),
    )
    curve, points = shown.where(part="b curve"), shown.where(part="b point")
    right.plot(curve["N"], curve["model"], color=theme.text, lw=1.2)
    simulated(right, points["N"], points["simulated"], points["standard_error"], theme.text)
    starred(right, 50, 0.98, theme, "the paper's choice")
    left.plot([], [], "o", ms=3, color=theme.muted, label="averaged patterns ± 2 s.e.")
    right.set(
        title="(b)",
        xlabel="number of samples $N$",
        ylabel=r"normalised visibility $\hat{V}$",
        xlim=(0, 100),
        ylim=(0, 1.03),
    )
    handles = [panel.get_legend_handles_labels()[0] for panel in (left, right)]
    legend_below(upper, handles[0] + handles[1])
