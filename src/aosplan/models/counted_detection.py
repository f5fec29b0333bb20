"""Probability of detection below the voxels of a stand, counted over all places.

The model of independent slices does not apply to clumped crowns.  If the voxels are known, the
integral image itself is computed instead (`aosplan.scenes.integral_image`).  It is telecentric: the
positions of the cameras are relative to each place.  The radiances of voxels and ground are drawn
from a random seed.

- The seen share of a window is the mean over its pixels of the share of photos that see the pixel.
  It is evaluated at all places and in all directions.
- The threshold is found from the highest peaks of the detector's output without a target.  Above
  these peaks, an exponential tail is assumed.  The scale of the tail is the mean excess of the
  `PEAKS` highest peaks over the next lower peak.  A Gaussian tail would have an error of 0.2 in the
  probability for clumped crowns.
- The output for a target is the output of the canopy at its place plus η C s
  (`aosplan.models.detection`).  POD is the share of places and directions for which the output
  exceeds the threshold.

**Edges.**  The integral image is periodic, but as for V, only the places whose rays stay on the plot
are counted (`aosplan.models.plot_interior`).  If they are too few, all places are counted.

The standard error is computed from the four quarters of the counted places.  If all places are
counted although some of their rays leave the plot, the standard error also includes the difference
between the results for all places and for the places whose rays stay on the plot.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.models.clutter import HECTARE_M2
from aosplan.models.detection import Detection, contrasts, upright
from aosplan.models.plot_interior import counted_part
from aosplan.models.seen_share import SeenShare
from aosplan.models.uncertainty import UNIFORM
from aosplan.scenes.integral_image import (
    TEXTURE,
    TEXTURE_LENGTH_M,
    CanopyRadiance,
    gaussian_field,
    integrate_planes,
    planes_of_volume,
)
from aosplan.scenes.matched_window import MatchedWindow, peaks

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from aosplan.models.plot_interior import PlotInterior
    from aosplan.models.signatures import Signature
    from aosplan.models.target_window import Target
    from aosplan.scenes.integral_image import OccluderPlane
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

PEAKS = 30
"""Number of highest peaks from which the tail is estimated."""

SEED = 1
"""Random seed of the radiances.  It is the same for every plan."""

MOST_KEPT = 1 << 25
"""The planes of a stand are stored if it has at most this number of voxels. They need five bytes
per voxel.
"""


def count_detection(
    volume: VoxelVolume,
    sites_m: Floats,
    altitude_m: float,
    target: Target,
    signature: Signature,
    *,
    false_alarms: float,
    assumed: str = "",
    focal_height_m: float = 0.0,
    edges: str = "wrapped",
) -> Detection:
    """Detection of a target below a stand by photos from known sites.

    Parameters
    ----------
    volume
        The voxels of the plot, which is periodic.
    sites_m
        Camera positions around a place, metres east and north, shape (N, 2).
    altitude_m
        Altitude of the cameras above the focal plane.
    target, signature, false_alarms, assumed
        As in `aosplan.models.detection.Detection`.
    focal_height_m
        Height of the focal plane above the ground.
    edges
        The places that are counted: ``auto``, ``interior`` or ``wrapped``, as in
        `aosplan.models.measured.MeasuredModel`.

    Raises
    ------
    RequestError
        If `edges` is ``interior`` and from every place some ray leaves the plot.
    """
    inside, compared = counted_part(
        volume, altitude_m, sites_m, edges, focal_height_m=focal_height_m
    )
    contrast, *canopy = upright(signature)
    rng = np.random.default_rng(SEED)
    kept = volume.occupied.size <= MOST_KEPT
    made = (_kept_planes if kept else _planes)(volume, CanopyRadiance(*canopy), focal_height_m)
    planes, rng.bit_generator.state = made
    integral = integrate_planes(planes, sites_m, altitude_m, volume.size_m, parallel=True)
    shape = integral.seen.shape[0], integral.seen.shape[1]
    ground = TEXTURE * gaussian_field(rng, shape, integral.pitch_m[0], TEXTURE_LENGTH_M)
    plain = integral.canopy + integral.seen * ground
    window = MatchedWindow((target.width_m, target.length_m), shape, integral.pitch_m)
    around = window.box_mean(plain)
    output = np.maximum.reduce(window.means(plain)) - around
    shares = np.clip(np.array(window.means(integral.seen)), 0.0, 1.0)
    # A target hides the ground below it. This reduces the texture in the window and in the box
    # around it.
    part = target.area_m2 / window.box_m**2
    base = np.array(window.means(integral.canopy)) - around
    base += part * np.array(window.means(integral.seen * ground))
    signal = target.matched * target.kept * shares

    def found_in(where: PlotInterior | None) -> tuple[Floats, Floats, float]:
        """The detector's output, the smallest contrast with which each target is found, and the
        threshold.
        """
        its_output, its_base, its_signal = (
            each if where is None else where.of(each, volume) for each in (output, base, signal)
        )
        area_m2 = volume.plot_area_m2 * its_output.size / output.size
        level = tail_level(peaks(its_output, integral.pitch_m), false_alarms * area_m2 / HECTARE_M2)
        wanted = np.where(
            its_signal > 1e-9, (level - its_base) / np.maximum(its_signal, 1e-9), math.inf
        )
        wanted[its_base > level] = -math.inf
        return its_output, wanted, level

    counted, wanted, level = found_in(inside)
    curve = tuple((each, float((wanted <= abs(each)).mean())) for each in contrasts(signature))
    probability = dict(curve)[signature.contrast]
    error = _error_of_quarters((wanted <= contrast).mean(axis=0))
    if compared is not None:
        other = float((found_in(compared)[1] <= contrast).mean())
        error = math.hypot(error, UNIFORM * abs(probability - other))
    return Detection(
        target,
        signature,
        assumed,
        false_alarms,
        SeenShare.counted(shares if inside is None else inside.of(shares, volume)),
        level,
        float(counted.std()),
        probability,
        curve,
        error,
    )


def _planes(
    volume: VoxelVolume, canopy: CanopyRadiance, focal_height_m: float
) -> tuple[list[OccluderPlane], Mapping[str, Any]]:
    """The planes of a stand, and the state of the random generator after the planes have been
    drawn.
    """
    rng = np.random.default_rng(SEED)
    planes = planes_of_volume(rng, volume, canopy, focal_height_m)
    return planes, rng.bit_generator.state


_kept_planes = lru_cache(maxsize=1)(_planes)
"""`_planes` with stored results, because a search counts detection for several plans over the same
stand.
"""


def tail_level(heights: Floats, number: float) -> float:
    """The level that is exceeded by the given number of peaks on average.

    Parameters
    ----------
    heights
        Heights of all peaks, in decreasing order.
    number
        Expected number of peaks, above 0; it may be a fraction.
    """
    if number >= PEAKS or len(heights) <= PEAKS:
        index = min(max(math.ceil(number) - 1, 0), len(heights) - 1)
        return float(heights[index])
    base = float(heights[PEAKS])
    scale = float(heights[:PEAKS].mean()) - base
    return base + scale * math.log(PEAKS / number)


def _error_of_quarters(found: Floats) -> float:
    """Standard error of the mean of a map, from its four quarters."""
    rows, columns = (count // 2 for count in found.shape)
    quarters = [
        found[i * rows : (i + 1) * rows, k * columns : (k + 1) * columns].mean()
        for i in (0, 1)
        for k in (0, 1)
    ]
    return float(np.std(quarters, ddof=1)) / 2.0
