"""Fig. 7a, b: V̂ against the aperture, by the model and for a stand with b = 3.5 m at 50 m."""

import math

import numpy as np
from common import ALTITUDE_M, BASELINE_M, SAMPLES, beside, grid, plt, save, stand, views, write_csv

from aosplan import aperture, normalized_visibility
from aosplan.grid.patterns import local_sites, pattern_for
from aosplan.models.measured import MeasuredModel
from aosplan.simulation.moments import estimate
from aosplan.simulation.voxel_views import VoxelViews

DHATS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)
SIDES = (1, 2, 3, 4, 5, 6, 7, 8, 9)
STANDS = 6


def telecentric(index):
    """Views of a stand in which each target is at the centre of its own aperture."""
    return VoxelViews(stand(index), ALTITUDE_M, view="telecentric", targets_per_voxel=1)


SEEN = {"12 m below one aperture": views, "each target below its own": telecentric}


def vhat_of(seen, positions):
    """V̂ of several stands, which are independent samples of the forest."""
    return estimate([seen(index).counts(positions) for index in range(STANDS)])


def main():
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.4, 3.6), layout="constrained")
    rows = []
    n = np.arange(2, 41)
    for dhat in DHATS:
        a, v = (n - 1) * dhat, normalized_visibility(n, n, dhat)
        style = "--" if dhat < 1 else ":" if dhat > 1 else "-"
        line = left.plot(a, v, style, lw=1.6 if dhat == 1 else 1, label=f"d̂ = {dhat:g}")[0]
        at = (math.sqrt(SAMPLES) - 1) * dhat
        left.plot(at, np.interp(at, a, v), "x", color=line.get_color())
        rows += [
            ("a", dhat, int(k * k), float(x), float(y), "") for k, x, y in zip(n, a, v, strict=True)
        ]
    left.axhline(0.98, color="k", ls=":", lw=0.8)
    left.set(title="(a)", xlabel="aperture a (occluders)", ylabel="normalised visibility V̂", xlim=(0, 15), ylim=(0.6, 1.005))  # fmt: skip
    left.legend(loc="lower right")

    a = [(k - 1) * BASELINE_M for k in SIDES]
    for name, seen in SEEN.items():
        found = [vhat_of(seen, grid(k, BASELINE_M)) for k in SIDES]
        values = [each.normalized for each in found]
        errors = [each.normalized_standard_error for each in found]
        right.errorbar(a, values, errors, fmt="o-", ms=3, lw=1, label=f"stands, {name}")
        rows += [
            (f"b {name}", "", k * k, x, y, error)
            for k, x, y, error in zip(SIDES, a, values, errors, strict=True)
        ]
    right.plot(a, [1 - 1 / k**2 for k in SIDES], "k-", lw=1, label="Eq. 4")
    right.set(title="(b)", xlabel="aperture a [m] at b = 3.5 m", ylabel="V̂", ylim=(-0.02, 1.02))
    right.legend(loc="lower right")
    save(figure, "figure_7")
    write_csv("figure_7", ("panel", "dhat", "N", "a", "vhat", "standard_error"), rows)

    beside("7a", "aperture for V̂ = 98 % at d̂ = 1", 6.1, aperture(SAMPLES, 1.0))
    beside("7a", "aperture [m] of 25 samples 2.8 m apart, in its section III", 14, aperture(25, 2.8),
           "the paper's text has √N pitches there, its Eq. 5 and Fig. 7 one fewer")  # fmt: skip
    pattern = pattern_for("trimmed", SAMPLES)
    sites = np.column_stack(local_sites(pattern, BASELINE_M, 0.0))
    for name, seen in SEEN.items():
        found = vhat_of(seen, sites)
        beside("7b", f"V̂ of 50 samples 3.5 m apart, {name}", 0.824, found.normalized,
               f"standard error {found.normalized_standard_error:.3f} over {STANDS} stands of ours; "
               "the paper's LiDAR scan is not public")  # fmt: skip
    model = MeasuredModel(stand(), ALTITUDE_M, targets_per_voxel=1).predict(pattern, BASELINE_M)
    counted = estimate([telecentric(0).counts(sites)], one_plot=True)
    print(f"  7b  V̂ of the first stand, telecentric: measured model {model.normalized:.4f}, "
          f"simulated {counted.normalized:.4f}")  # fmt: skip


if __name__ == "__main__":
    main()
