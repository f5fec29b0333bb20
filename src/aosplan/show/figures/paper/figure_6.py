"""Fig. 6a, b: density p of a stand against depth below its top, and the share of occluders with d̂
>= 1 against the baseline b.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.show.figures.paper.paper_figure import (
    UNSTATED,
    PaperFigure,
    PaperValue,
    body,
    counted,
    starred,
)
from aosplan.show.figures.style import legend_below

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.show.figures.paper.paper_figure import Progress
    from aosplan.show.figures.style import Theme


def numbers(seed: int, progress: Progress | None = None) -> PaperFigure:
    """Compute the values of both panels, for a clumped stand and from the model."""
    import numpy as np

    from aosplan.camera.disparity import coverage_share
    from aosplan.planning.planner import plan
    from aosplan.planning.request import PlanRequest
    from aosplan.scenes.density import integrated_density
    from aosplan.show.figures.paper.stand import ALTITUDE_M, DENSITY, OCCLUDER_M, stand

    volume = stand(seed)
    # (a) The slices from the highest to the lowest one with occluders, and Eq. 1 with the mean D of
    # these slices.
    filled = np.flatnonzero(volume.occupied.any(axis=(1, 2)))
    slices = volume.occupied[filled[0] : filled[-1] + 1][::-1]
    hidden = np.logical_or.accumulate(slices, axis=0).mean(axis=(1, 2))
    d = float(slices.mean())
    ratio = np.arange(1.0, len(slices) + 1.0) * (volume.voxel_m / OCCLUDER_M)
    model = integrated_density(d, ratio, 1.0)

    # (b) Each occupied voxel is an occluder at the height of the voxel.
    heights = (np.arange(len(volume.occupied)) + 0.5) * volume.voxel_m
    weights = volume.occupied.sum(axis=(1, 2))
    baselines = [0.05 * k for k in range(1, 101)]
    share = np.array(
        [weights[heights >= OCCLUDER_M * ALTITUDE_M / b].sum() / weights.sum() for b in baselines]
    )
    preset = plan(PlanRequest(altitude=ALTITUDE_M))
    slabs = preset.scene.slabs()
    uniform = [
        float(coverage_share(slabs, ALTITUDE_M, np.inf, b)) for b in counted(baselines, progress)
    ]
    enough = baselines[int(np.argmax(share >= 0.98))]
    rows = [
        *(
            ("a", *each)
            for each in zip(ratio.tolist(), model.tolist(), hidden.tolist(), strict=True)
        ),
        *(("b", *each) for each in zip(baselines, uniform, share.tolist(), strict=True)),
    ]
    return PaperFigure(
        "6",
        "p from the top down, and the share of occluders with d̂ ≥ 1",
        seed,
        ("panel", "l_over_o or b_m", "model", "stand"),
        tuple(rows),
        (
            PaperValue(
                "p of the stand, which is generated with this p", f"{DENSITY}", f"{hidden[-1]:.3f}"
            ),
            PaperValue("p by Eq. 1 with the stand's mean D", UNSTATED, f"{model[-1]:.3f}"),
            PaperValue(
                "b at which 98 % have d̂ ≥ 1, uniform",
                "3.5 m",
                f"{preset.solution.baseline_m:.2f} m",
            ),
            PaperValue("b at which 98 % have d̂ ≥ 1, stand", "3.5 m", f"{enough:.2f} m"),
        ),
        (
            "The base of the uniform scene (paper-forest) is chosen so that b is 3.5 m.",
            "The scan of the paper is not public. The generated stand has other heights and sizes.",
            "Eq. 1 assumes independent slices. In clumps, many occluders are behind other occluders.",
        ),
    )


def draw(figure: Figure, shown: PaperFigure, theme: Theme) -> None:
    """Draw p against l/o, and the share of occluders against b."""
    upper = body(figure, shown, theme)
    left, right = upper.subplots(1, 2)
    names = ("model", "stand"), ("by Eq. 1; uniform scene", "clumped stand")
    for panel, axes in zip("ab", (left, right), strict=True):
        columns = shown.where(panel=panel)
        for name, label, color, line in zip(*names, theme.data, ("--", "-"), strict=False):
            axes.plot(columns[shown.names[1]], columns[name], line, color=color, label=label)
    starred(left, 87.69, 0.567, theme, "the paper's values")
    starred(right, 3.5, 0.98, theme, "the paper's values")
    left.set(
        title="(a)",
        xlabel="$l/o$ from the top down",
        ylabel="integrated density $p$",
        xlim=(0, None),
        ylim=(0, 1.03),
    )
    right.set(
        title="(b)",
        xlabel="baseline $b$ [m] at 50 m",
        ylabel=r"share of occluders with $\hat{d} \geq 1$",
        xlim=(0, 5),
        ylim=(0, 1.03),
    )
    legend_below(upper, left.get_legend_handles_labels()[0])
