"""Fig. 4: a noise pattern with p = 25 % and o = 5 px, averaged 10 x 10 times at several
disparities.
"""

import numpy as np
from common import agreement, plt, save, write_csv

from aosplan import visibility
from aosplan.simulation.forests import generator
from aosplan.simulation.moments import estimate
from aosplan.simulation.noise_patterns import blocked_views, counts_of, grid_shifts

P, OCCLUDER_PX, SIDE = 0.25, 5, 10
DISPARITIES = (0, 1, 2, 3, 4, 5, 7, 10)
SHAPE = (160, 160)
PATTERNS = 16


def main():
    figure, panels = plt.subplots(2, 4, figsize=(8, 4.6), layout="constrained")
    rows, z = [], []
    for axes, disparity in zip(panels.flat, DISPARITIES, strict=True):
        shifts = grid_shifts(SIDE, SIDE, disparity)
        blocked = [
            blocked_views(generator(400 + disparity, k), P, OCCLUDER_PX, shifts, SHAPE)
            for k in range(PATTERNS)
        ]
        image = blocked[0] / SIDE**2
        found = estimate([counts_of(each, SIDE**2) for each in blocked])
        model = visibility(P, SIDE, SIDE, disparity / OCCLUDER_PX)
        axes.imshow(image, cmap="gray", vmin=0, vmax=1, interpolation="nearest")
        axes.set(title=f"d = {disparity}: V = {1 - np.mean(image**2):.3f}", xticks=[], yticks=[])
        axes.grid(visible=False)
        rows.append((disparity, model, found.expected, found.expected_standard_error))
        z.append((found.expected - model) / found.expected_standard_error)
    save(figure, "figure_4")
    write_csv("figure_4", ("d_px", "V", "V_simulated", "standard_error"), rows)
    agreement("4", "V of sixteen averaged patterns each against Eq. 2", z)


if __name__ == "__main__":
    main()
