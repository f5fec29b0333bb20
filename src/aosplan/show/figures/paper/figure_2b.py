"""Fig. 2b: integrated density against l/o, by Eq. 1 and for simulated volumes.

The points are volumes: slices of cubes of size one, counted from vertically above.
"""

import numpy as np
from common import DENSITY, SLICE_DENSITY, agreement, plt, save, write_csv

from aosplan import integrated_density
from aosplan.simulation.forests import generator, uniform_forest

DENSITIES = (0.0025, SLICE_DENSITY, 0.02, 0.05)
RATIOS = np.arange(0, 201, 4)
SIMULATED = (10, 40, 87.69, 160)
SIDE = 120


def main():
    figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    rows, z = [], []
    for d in DENSITIES:
        line = [integrated_density(d, float(ratio), 1.0) for ratio in RATIOS]
        axes.plot(RATIOS, line, label=f"D = {100 * d:g} %")
        rows += [(d, float(ratio), p, "", "") for ratio, p in zip(RATIOS, line, strict=True)]
        for index, ratio in enumerate(SIMULATED):
            model = integrated_density(d, ratio, 1.0)
            volume = uniform_forest(generator(26, index), d, 1.0, 0.0, ratio, (SIDE, SIDE))
            p = float(volume.occupied.any(axis=0).mean())
            error = np.sqrt(model * (1 - model)) / SIDE  # each column of cubes is one trial
            axes.errorbar(ratio, p, 2 * error, fmt="k.", ms=4, lw=0.8)
            rows.append((d, float(ratio), model, p, float(error)))
            z.append((p - model) / error)
    axes.plot([], [], "k.", label="simulated volumes")
    axes.set(xlabel="l/o", ylabel="integrated density p", xlim=(0, 200), ylim=(0, 1.02))
    figure.legend(loc="outside right upper")
    save(figure, "figure_2b")
    write_csv("figure_2b", ("D", "l_over_o", "p", "p_simulated", "standard_error"), rows)
    agreement("2b", "p of simulated volumes against Eq. 1", z)
    ratio = float(np.log1p(-DENSITY) / np.log1p(-SLICE_DENSITY))
    print(
        f"  2b  l/o at which D = 0.95 % gives p = 56.7 %: {ratio:.2f}; the paper prints D and p alone"
    )


if __name__ == "__main__":
    main()
