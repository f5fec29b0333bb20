"""Fig. 3a-c: visibility against disparity at three p, by Eq. 2 and averaged noise patterns."""

import numpy as np
from common import agreement, beside, plt, save, write_csv

from aosplan import visibility
from aosplan.simulation.forests import generator
from aosplan.simulation.moments import estimate
from aosplan.simulation.noise_patterns import blocked_views, counts_of, grid_shifts

OCCLUDER_PX = 5
SIDES = (2, 3, 5, 10)
DISPARITIES = range(11)
PATTERNS, SHAPE = 16, (150, 150)


def simulated(p, side, disparity, seed):
    """V of averaged patterns, the mean of several repetitions, and its standard error."""
    shifts = grid_shifts(side, side, disparity)
    counts = [
        counts_of(blocked_views(generator(seed, k), p, OCCLUDER_PX, shifts, SHAPE), side**2)
        for k in range(PATTERNS)
    ]
    found = estimate(counts)
    return found.expected, found.expected_standard_error


def main():
    figure, panels = plt.subplots(1, 3, figsize=(9.6, 3.3), layout="constrained")
    rows, z = [], []
    for axes, p, letter in zip(panels, (0.25, 0.5, 0.75), "abc", strict=True):
        d = np.linspace(0.0, 10.0, 201)
        for side in SIDES:
            colour = axes.plot(d, visibility(p, side, side, d / OCCLUDER_PX), lw=1)[0].get_color()
            for disparity in DISPARITIES:
                model = visibility(p, side, side, disparity / OCCLUDER_PX)
                v, error = simulated(p, side, disparity, 3000 + len(rows))
                axes.errorbar(disparity, v, 2 * error, fmt=".", color=colour, ms=4, lw=0.8)
                rows.append((p, side**2, disparity, model, v, error))
                z.append((v - model) / error)
            axes.plot([], [], color=colour, label=f"N = {side**2}")
        axes.axvline(OCCLUDER_PX, color="k", ls="-.", lw=0.8)
        axes.set(
            title=f"({letter}) p = {100 * p:g} %", xlabel="disparity d [px]", xlim=(-0.3, 10.3)
        )
    panels[0].set_ylabel("visibility V")
    panels[0].legend(loc="lower right")
    save(figure, "figure_3")
    write_csv("figure_3", ("p", "N", "d_px", "V", "V_simulated", "standard_error"), rows)
    agreement("3", "V of averaged patterns against Eq. 2", z)
    settled = [abs(visibility(p, 10, 10, 1.0) - visibility(p, 10, 10, 2.0)) for p in (0.25, 0.75)]
    beside("3", "change of V beyond d = o", 0.0, max(settled))


if __name__ == "__main__":
    main()
