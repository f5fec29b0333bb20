"""Fig. 7a, b: V̂ against the aperture. Panel a shows the V̂ of the model.  Panel b shows the V̂ of
stands, with b = 3.5 m at an altitude of 50 m.
"""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING

from aosplan.models.equations import aperture, normalized_visibility
from aosplan.show.figures.paper.paper_figure import (
    NOT_PUBLIC,
    PaperFigure,
    PaperValue,
    body,
    counted,
    plus_minus,
    simulated,
    starred,
)
from aosplan.show.figures.style import legend_below

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.show.figures.paper.paper_figure import Progress
    from aosplan.show.figures.style import Theme
    from aosplan.simulation.voxel_views import VoxelViews

DHATS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)
SIDES = tuple(range(2, 41))
GRIDS = tuple(range(1, 10))
"""Numbers of cameras along each side of the grids of panel b."""

STANDS = 6
BELOW_ONE, BELOW_OWN = "12 m below one aperture", "each target below its own"
"""Names of the two sets of targets: a square below the centre of one aperture, or all targets of
the stand.
"""


def numbers(seed: int, progress: Progress | None = None) -> PaperFigure:
    """Compute the curves of the model, and the mean V̂ of several stands."""
    import numpy as np

    from aosplan.grid.patterns import local_sites, pattern_for
    from aosplan.models.measured import MeasuredModel
    from aosplan.show.figures.paper.stand import ALTITUDE_M, BASELINE_M, SAMPLES, grid, stand
    from aosplan.simulation.moments import estimate

    rows: list[tuple[object, ...]] = [
        ("a", f"d̂ = {d:g}", n * n, (n - 1) * d, float(normalized_visibility(n, n, d)), None)
        for d, n in product(DHATS, SIDES)
    ]
    pattern = pattern_for("trimmed", SAMPLES)
    sites = np.column_stack(local_sites(pattern, BASELINE_M, 0.0))
    grids = [grid(n, BASELINE_M) for n in GRIDS]
    counts = {
        (index, name): [_seen(seed, index, name).counts(each) for each in (*grids, sites)]
        for index, name in counted([*product(range(STANDS), (BELOW_ONE, BELOW_OWN))], progress)
    }
    values = [
        PaperValue("aperture for V̂ = 98 % at d̂ = 1 [occluders]", "6.1", f"{float(aperture(SAMPLES, 1.0)):.2f}"),
        PaperValue("aperture of 25 samples, 2.8 m apart", "14 m", f"{float(aperture(25, 2.8)):.1f} m"),
    ]  # fmt: skip
    for name in (BELOW_ONE, BELOW_OWN):
        *found, chosen = (
            estimate([counts[index, name][k] for index in range(STANDS)])
            for k in range(len(grids) + 1)
        )
        rows += [
            ("b", name, n * n, (n - 1) * BASELINE_M, each.normalized, each.normalized_standard_error)
            for n, each in zip(GRIDS, found, strict=True)
        ]  # fmt: skip
        values.append(
            PaperValue(
                f"V̂ of {SAMPLES} samples 3.5 m apart, {name}",
                "0.824",
                plus_minus(chosen.normalized, chosen.normalized_standard_error),
            )
        )
    model = MeasuredModel(stand(seed), ALTITUDE_M, targets_per_voxel=1)
    first = estimate([counts[0, BELOW_OWN][-1]], one_plot=True)
    return PaperFigure(
        "7",
        "V̂ against the aperture",
        seed,
        ("panel", "curve", "N", "a", "vhat", "standard_error"),
        tuple(rows),
        tuple(values),
        (
            NOT_PUBLIC,
            "In section III of the paper, an aperture is √N baselines long. In Eq. 5 and Fig. 7, it is one baseline shorter.",
            f"V̂ of the first stand: measured model "
            f"{model.predict(pattern, BASELINE_M).normalized:.4f}, simulated {first.normalized:.4f}.",
        ),
    )


def _seen(seed: int, index: int, name: str) -> VoxelViews:
    """Views of a stand: either of the targets at its centre, from one aperture, or of all its
    targets, each of them from an aperture that is centred above the target.
    """
    from aosplan.show.figures.paper.stand import ALTITUDE_M, stand, views
    from aosplan.simulation.voxel_views import VoxelViews

    if name == BELOW_ONE:
        return views(seed, index)
    return VoxelViews(stand(seed, index), ALTITUDE_M, view="telecentric", targets_per_voxel=1)


def draw(figure: Figure, shown: PaperFigure, theme: Theme) -> None:
    """Draw V̂ of the model for several d̂, and V̂ of the stands."""
    import numpy as np

    upper = body(figure, shown, theme)
    left, right = upper.subplots(1, 2)
    colors = (*theme.data[:3], theme.text, theme.data[3], theme.data[1])
    for d, color in zip(DHATS, colors, strict=True):
        curve = shown.where(panel="a", curve=f"d̂ = {d:g}")
        line = "--" if d < 1.0 else ":" if d > 1.0 else "-"
        label = rf"$\hat{{d}}$ = {d:g}"
        left.plot(curve["a"], curve["vhat"], line, color=color, label=label)
        at = (math.sqrt(50.0) - 1.0) * d
        left.plot(at, np.interp(at, curve["a"], curve["vhat"]), "x", color=color, ms=5)
    left.plot([], [], "x", color=theme.muted, ms=5, label="N = 50")
    starred(left, 6.1, 0.98, theme, "the paper's values")
    left.set(
        title="(a) model",
        xlabel="aperture $a$ [occluders]",
        ylabel=r"normalised visibility $\hat{V}$",
        xlim=(0, 15),
        ylim=(0.6, 1.01),
    )
    for name, color, line in zip((BELOW_ONE, BELOW_OWN), theme.data, ("-", "--"), strict=False):
        curve = shown.where(panel="b", curve=name)
        right.plot(curve["a"], curve["vhat"], line, color=color, label=f"stands, {name}")
        simulated(right, curve["a"], curve["vhat"], curve["standard_error"], color)
    right.plot(
        curve["a"], [1.0 - 1.0 / n for n in curve["N"]], color=theme.muted, lw=1, label="Eq. 4"
    )
    starred(right, (math.sqrt(50.0) - 1.0) * 3.5, 0.824, theme, "the paper's scan, N = 50")
    right.set(
        title="(b) stands, $b$ = 3.5 m at 50 m",
        xlabel="aperture $a$ [m]",
        ylim=(-0.02, 1.03),
    )
    right.set_ylabel(r"normalised visibility $\hat{V}$")
    left.legend(loc="lower right", fontsize=7)
    legend_below(upper, right.get_legend_handles_labels()[0])
