"""Visibility over the ground that a plan is for, by rays as they are.

The visibility of a plan is that of a target below the middle of the grid; the paper's model looks
straight down there.  A target beside the middle, at t on the ground, is seen along the rays from t to
every sample, which are slanted and pass more of the canopy.

- Uniform and layered scenes: a ray at angle θ passes with probability T^(sec θ) (Beer-Lambert, for
  occluders without a direction).  With p_i(t) what sample i does not see of it,
  V(t) = 1 - (mean p_i)² - K mean p_i (1 - p_i), K being the plan's own: what neighbours share hardly
  changes with their common slant.
- Measured scenes: the prediction for samples at c_i - t.  The stand is taken to be alike everywhere.

The mean over the ground is by Gauss-Legendre quadrature with three points along either axis; the worst
is the least of the four corners and those points.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from aosplan.grid.patterns import Sites
    from aosplan.models.model import Prediction

NODES = ((-math.sqrt(0.6), 5.0 / 18.0), (0.0, 8.0 / 18.0), (math.sqrt(0.6), 5.0 / 18.0))
"""Gauss-Legendre points on -1 to 1, and weights whose sum is 1."""

MOST_RAYS = 1024
"""Samples whose rays are followed; of more, as many spread over the grid."""


class GroundVisibility(NamedTuple):
    """What a plan shows of the ground that it is for.

    Attributes
    ----------
    size_m
        Extents of that ground along and across the heading.
    density
        Mean share of it that a sample does not see.
    expected, worst_expected
        V: its mean over the ground, and its least.
    normalized
        V̂ of the mean: (V - (1 - p))/(p (1 - p)).
    """

    size_m: tuple[float, float]
    density: float
    expected: float
    normalized: float
    worst_expected: float

    def document(self) -> dict[str, Any]:
        """The numbers as plain values."""
        own = self._asdict()
        normalized = self.normalized if math.isfinite(self.normalized) else None
        return own | {"size_m": list(self.size_m), "normalized": normalized}


def over_ground(
    size_m: tuple[float, float], at: Callable[[float, float], tuple[float, float]]
) -> GroundVisibility:
    """Mean and worst over a rectangle of ground around the middle of a grid.

    Parameters
    ----------
    size_m
        Extents along x and y.
    at
        p and V of a target at (x, y) from the middle.
    """
    half_x, half_y = 0.5 * size_m[0], 0.5 * size_m[1]
    density = expected = 0.0
    worst = math.inf
    for x, weight_x in NODES:
        for y, weight_y in NODES:
            p, v = at(x * half_x, y * half_y)
            density += weight_x * weight_y * p
            expected += weight_x * weight_y * v
            worst = min(worst, v)
    corners = [at(x, y)[1] for x in (-half_x, half_x) for y in (-half_y, half_y)]
    spread = density * (1.0 - density)
    normalized = (expected - (1.0 - density)) / spread if spread > 0.0 else math.nan
    return GroundVisibility(size_m, density, expected, normalized, min(worst, *corners))


def of_statistics(
    prediction: Prediction, sites_m: Sequence[tuple[float, float]], altitude_m: float
) -> Callable[[float, float], tuple[float, float]]:
    """p and V of a target beside the middle, in a uniform or layered scene.

    Parameters
    ----------
    prediction
        Of the plan: its K.
    sites_m
        Samples along x and y from the middle.
    altitude_m
        Of the samples above the ground that they look at.

    Notes
    -----
    The transparency straight down is that of the prediction, which has to be one of nadir rays.
    """
    log_t, shortfall = math.log(prediction.transparency), prediction.shortfall
    area = altitude_m * altitude_m

    def at(x: float, y: float) -> tuple[float, float]:
        total = squares = 0.0
        for site_x, site_y in sites_m:
            across = (site_x - x) ** 2 + (site_y - y) ** 2
            hidden = -math.expm1(log_t * math.sqrt(1.0 + across / area))
            total += hidden
            squares += hidden * hidden
        count = len(sites_m)
        p = total / count
        return p, 1.0 - p * p - shortfall * (p - squares / count)

    return at


def followed(pattern: Sites, baseline_m: float) -> list[tuple[float, float]]:
    """Samples of a pattern along x and y from the middle, every so many of a large one."""
    step = max(1, -(-pattern.samples // MOST_RAYS))
    while step > 1 and math.gcd(step, pattern.columns) > 1:
        step += 1  # or it would take some columns only
    return list(_every(step, pattern, baseline_m))


def _every(step: int, pattern: Sites, baseline_m: float) -> Iterator[tuple[float, float]]:
    for index, (x, y) in enumerate(pattern.offsets()):
        if index % step == 0:
            yield x * baseline_m, y * baseline_m
