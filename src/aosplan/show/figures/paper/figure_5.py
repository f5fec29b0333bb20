"""Fig. 5a, b: V and V̂ against density and N if no occluder is shared (Eq. 3 and 4)."""

import math

import numpy as np
from common import agreement, beside, plt, save, write_csv

from aosplan import normalized_visibility, required_samples, visibility, visibility_limits
from aosplan.simulation.forests import generator
from aosplan.simulation.moments import estimate
from aosplan.simulation.noise_patterns import blocked_views, counts_of, grid_shifts

SAMPLES = (1, 2, 5, 10, 50)
POINTS = (0.1, 0.3, 0.5, 0.7, 0.9)
OCCLUDER_PX, PATTERNS, SHAPE = 5, 16, (200, 200)


def simulated(p, n, seed):
    """V and V̂ of a line of N patterns, each shifted by more than an occluder."""
    shifts = grid_shifts(1, n, 2 * OCCLUDER_PX)
    return estimate(
        [
            counts_of(blocked_views(generator(seed, k), p, OCCLUDER_PX, shifts, SHAPE), n)
            for k in range(PATTERNS)
        ]
    )


def main():
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained", width_ratios=(1.5, 1))  # fmt: skip
    p = np.linspace(0.0, 1.0, 101)
    minimum, maximum = visibility_limits(p)
    rows, z = [], []
    for n in SAMPLES:
        colour = left.plot(p, visibility(p, 1, n, 1.0), lw=1, label=f"N = {n}")[0].get_color()
        for density in POINTS:
            found = simulated(density, n, 5000 + len(rows))
            model = visibility(density, 1, n, 1.0)
            left.errorbar(density, found.expected, 2 * found.expected_standard_error, fmt=".", color=colour, ms=4, lw=0.8)  # fmt: skip
            rows.append(("a", density, n, model, found.expected, found.expected_standard_error))
            z.append((found.expected - model) / found.expected_standard_error)
    left.plot(p, maximum, "k--", lw=1, label="N = ∞")
    left.set(
        title="(a)",
        xlabel="integrated density p",
        ylabel="visibility V",
        xlim=(0, 1),
        ylim=(0, 1.02),
    )
    left.legend(loc="lower left")
    n = np.arange(1, 101)
    right.plot(n, normalized_visibility(1, n, 1.0), lw=1.2)
    needed = required_samples("98%")
    right.plot([0, needed, needed], [0.98, 0.98, 0.0], "k:", lw=1)
    for count in (2, 5, 10, 25, 50):
        found = simulated(0.567, count, 5000 + len(rows))
        model, error = 1 - 1 / count, found.normalized_standard_error
        right.errorbar(count, found.normalized, 2 * error, fmt="k.", ms=4, lw=0.8)
        rows.append(("b", 0.567, count, model, found.normalized, error))
        z.append((found.normalized - model) / error)
    right.set(
        title="(b)", xlabel="N", ylabel="normalised visibility V̂", xlim=(0, 100), ylim=(0, 1.02)
    )
    save(figure, "figure_5")
    write_csv("figure_5", ("panel", "p", "N", "model", "simulated", "standard_error"), rows)
    agreement("5", "V and V̂ of independent patterns against Eq. 3 and 4", z)
    beside("5b", "N for V̂ = 98 %", 50, needed)
    beside("5a", "p of the largest gain", 0.5, float(p[np.argmax(maximum - minimum)]))
    assert math.isclose(max(maximum - minimum), 0.25)


if __name__ == "__main__":
    main()
