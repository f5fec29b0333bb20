"""Comparison of models with simulations: V̂ over N and b, for forests that meet the assumptions of
the models.
"""

import io
from functools import cache
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from aosplan import PlanRequest
from aosplan.grid.patterns import local_sites
from aosplan.planning.loaded_scene import LoadedScene
from aosplan.planning.planner import plan
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.occluder_statistics import layered_scene
from aosplan.show.figures.style import LIGHT, LINES, MARKERS, rules
from aosplan.simulation.compare import Settings, simulate
from aosplan.simulation.forests import clumped_forest, generator
from aosplan.simulation.moments import estimate
from aosplan.simulation.voxel_views import VoxelViews

HERE = Path(__file__).parent
STAND = str(HERE.parent / "stand.toml")

ALTITUDE_M = 50.0
SAMPLES = (9, 25, 49)
BASELINES_M = (0.4, 0.8, 1.4, 2.2, 3.2)
STANDS = 12


def planned(samples, baseline_m, loaded=None, **scene):
    request = PlanRequest(
        altitude=ALTITUDE_M, vhat=0.5, grid="square", samples=samples, baseline=baseline_m, **scene
    )
    return plan(request, loaded=loaded)


def simulated(result, forest):
    settings = Settings(seed=7, precision=0.008, view="telecentric", forest=forest)
    return simulate(result, settings).simulated


@cache
def trees(index):
    """A stand of clumped crowns as voxels.  It hides 56.7 % of the ground from vertically above."""
    return clumped_forest(generator(2019, index), 0.567, 0.2, 2.5, 17.5, (40.0, 40.0))


def seen_in_other_stands(result):
    """V̂ of a plan in other random stands of the same kind."""
    sites = np.column_stack(local_sites(result.solution.pattern, result.solution.baseline_m, 0.0))
    views = (
        VoxelViews(trees(index), ALTITUDE_M, view="telecentric", targets_per_voxel=2)
        for index in range(1, STANDS + 1)
    )
    return estimate([each.counts(sites) for each in views])


def panels():
    """For each panel: its title, a function that makes a plan from N and b, and a function that
    simulates it.
    """
    volume = trees(0)
    layers = layered_scene(volume, "clumped trees")
    stand = LoadedScene(layers, "cloud", volume=volume, correlogram=correlogram(volume))
    return (
        (
            "uniform, on noise patterns",
            lambda n, b: planned(n, b, scene="paper-forest"),
            lambda result: simulated(result, "noise"),
        ),
        (
            "layered, on random layers",
            lambda n, b: planned(n, b, scene=STAND),
            lambda result: simulated(result, "layered"),
        ),
        (
            f"measured in one stand, on {STANDS} others",
            lambda n, b: planned(n, b, stand),
            seen_in_other_stands,
        ),
    )


def main():
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(rules(LIGHT) | {"font.size": 10.0, "axes.titlesize": 11.0})
        mpl.rcParams.update({"axes.labelsize": 10.5, "legend.fontsize": 9.5})
        figure = Figure(figsize=(10.4, 3.9), layout="constrained")
        draw(figure)
        drawn = io.BytesIO()
        figure.savefig(drawn, dpi=130)
    Image.open(drawn).convert("RGB").quantize(256).save(HERE / "agreement.png", optimize=True)


def draw(figure):
    axes = figure.subplots(1, 3, sharey=True)
    fine = np.linspace(0.1, 3.4, 67).tolist()
    for axis, (title, planning, simulation) in zip(axes, panels(), strict=True):
        errors = []
        for place, samples in enumerate(SAMPLES):
            first = planning(samples, 1.0)
            model, pattern = first.problem.model, first.solution.pattern
            curve = [model.predict(pattern, b).normalized for b in fine]
            look = {"color": LIGHT.data[place]}
            axis.plot(fine, curve, LINES[place], label=f"model, $N$ = {samples}", **look)
            found = [simulation(planning(samples, b)) for b in BASELINES_M]
            axis.errorbar(
                BASELINES_M,
                [each.normalized for each in found],
                [2.0 * each.normalized_standard_error for each in found],
                fmt=MARKERS[place],
                ms=5.5,
                mfc=LIGHT.background,
                capsize=2.5,
                label="simulated, ± 2 s.e.",
                **look,
            )
            told = [model.predict(pattern, b).normalized for b in BASELINES_M]
            errors += [
                (each.normalized - value, each.normalized_standard_error)
                for each, value in zip(found, told, strict=True)
            ]
        inside = sum(abs(off) <= 2.0 * error + ROUNDING for off, error in errors)
        print(
            f"  {title}: {inside} of {len(errors)} points within 2 standard errors and {ROUNDING:g} "
            f"for voxels; largest difference {max(abs(off) for off, _ in errors):.4f}"
        )
        axis.set(title=title, xlabel=f"baseline $b$ [m] from {ALTITUDE_M:g} m", xlim=(0.0, 3.5))
    axes[0].set_ylabel(r"normalised visibility $\hat{V}$")
    axes[0].set_ylim(0.0, 1.02)
    axes[0].legend(loc="lower right")


ROUNDING = 0.01
"""Approximate effect of voxels on V̂.  `aosplan.simulation.compare` computes it exactly."""


if __name__ == "__main__":
    main()
