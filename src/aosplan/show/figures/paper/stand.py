"""Shared parts of the paper's figures: the stand, result files, and comparisons."""

import csv
import io
from functools import cache
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image

mpl.use("Agg")
from matplotlib import pyplot as plt

from aosplan.scenes.occlusion import PlotWindow
from aosplan.simulation.forests import clumped_forest, generator
from aosplan.simulation.voxel_views import VoxelViews

RESULTS = Path(__file__).parent / "results"

DENSITY, SLICE_DENSITY = 0.567, 0.0095
"""p and mean D of the paper's LiDAR scan (its Figs. 4, 6 and 8)."""

OCCLUDER_M, BASE_M, HEIGHT_M = 0.20, 2.506, 17.54
"""Dimensions of our stand: o is our choice, l/o = 87.69 and 98 % at 3.5 m are from the paper."""

ALTITUDE_M, BASELINE_M, SAMPLES = 50.0, 3.5, 50
"""Altitude, baseline and samples of the paper's section III."""

TARGET_M = 12.0
"""Side of the target area below the centre of the aperture."""

plt.rcParams.update(
    {
        "figure.dpi": 100,
        "savefig.dpi": 100,
        "font.size": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.alpha": 0.3,
        "legend.frameon": False,
    }
)


@cache
def stand(index=0):
    """A clumped stand from a seed with the paper's p, because the paper's scan is not public.

    It has crowns and trunks on a periodic plot of 40 x 40 m that hides 56.7 % of the ground from
    above.
    """
    rng = generator(2019, index)
    return clumped_forest(rng, DENSITY, OCCLUDER_M, BASE_M, HEIGHT_M, (40.0, 40.0))


def views(index=0, altitude_m=ALTITUDE_M, *, per_voxel=2, side_m=TARGET_M):
    """Views in perspective of a square of targets at the centre of a stand's plot."""
    volume = stand(index)
    side = round(side_m / volume.voxel_m) * per_voxel
    whole = volume.occupied.shape[1] * per_voxel
    first = (whole - side) // 2
    return VoxelViews(
        volume, altitude_m, targets_per_voxel=per_voxel, window=PlotWindow(first, first, side, side)
    )


def grid(side, pitch_m):
    """Positions of side x side cameras [m], shape (side², 2)."""
    along = (np.arange(side) - 0.5 * (side - 1)) * pitch_m
    return np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)


def save(figure, name):
    """Write a small image file: 256 colours are sufficient."""
    drawn = io.BytesIO()
    figure.savefig(drawn)
    plt.close(figure)
    Image.open(drawn).convert("RGB").quantize(256).save(RESULTS / f"{name}.png", optimize=True)


def write_csv(name, header, rows):
    """Write the numbers of a figure with six digits."""
    with (RESULTS / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([f"{v:.6g}" if isinstance(v, float) else v for v in row] for row in rows)


def beside(figure, what, paper, ours, why=""):
    """Print a number of the paper, ours, the difference, and its reason."""
    off = "the same" if abs(ours - paper) < 5e-4 * abs(paper) else f"off by {ours - paper:+.3g}"
    print(f"  {figure}  {what}: paper {paper:g}, here {ours:.4g} ({off}){'; ' if why else ''}{why}")


def agreement(figure, what, z):
    """Print how far simulated points are from the model, in standard errors."""
    z = np.abs(np.asarray(z))
    print(f"  {figure}  {what}: {len(z)} points, {np.mean(z < 2):.0%} within 2 standard errors, "
          f"the worst {z.max():.1f}")  # fmt: skip
