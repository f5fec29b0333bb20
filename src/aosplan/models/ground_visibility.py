"""Visibility over the whole ground of a plan, with slanted rays.

The visibility of a plan applies to a target below the centre of the grid, and the model of the
paper uses vertical rays.  The rays from the samples to a target at any other place t on the ground
are slanted.  They pass through more of the canopy.

- Uniform and layered scenes: a ray at angle θ passes with probability T^(sec θ) (Beer-Lambert, for
  occluders without a preferred direction). Let p_i(t) be the share of the target that sample i does
  not see. Then V(t) = 1 - (mean p_i)² - K mean p_i (1 - p_i). For K, the shortfall of the plan is
  used: neighbouring rays are slanted in about the same direction, which hardly changes the number
  of occluders that they share.
- Measured scenes: V(t) is the prediction for samples at c_i - t, where c_i are the positions of the
  samples.  The stand is assumed to be the same everywhere.

The mean over the ground is computed by Gauss-Legendre quadrature with three points per axis.  The
worst value is the smallest value at these points and at the four corners.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.grid.patterns import local_sites
from aosplan.numerics import heading_axis, turned

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from aosplan.grid.patterns import AnyPattern
    from aosplan.models.model import Prediction, VisibilityModel

NODES = ((-math.sqrt(0.6), 5.0 / 18.0), (0.0, 8.0 / 18.0), (math.sqrt(0.6), 5.0 / 18.0))
"""Gauss-Legendre points on [-1, 1], and weights with the sum 1."""

MOST_RAYS = 1024
"""Largest number of samples whose rays are evaluated. If there are more samples, an evenly spread
subset is used.
"""


MOST_TARGETS = 1_000_000
"""Largest number of targets of a plot that are evaluated for each place away from the middle of the
grid.
"""


class GroundVisibility(NamedTuple):
    """Visibility over the ground of a plan.

    Attributes
    ----------
    size_m
        Size of the ground along and across the heading.
    density
        Mean over the ground of the share that a sample does not see.
    expected, worst_expected
        Mean and smallest value of V over the ground.
    normalized
        V̂ that corresponds to the means: (V - (1 - p))/(p (1 - p)).
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


def ground_visibility(
    model: VisibilityModel,
    prediction: Prediction,
    pattern: AnyPattern,
    baseline_m: float,
    *,
    altitude_m: float,
    size_m: tuple[float, float],
) -> GroundVisibility | None:
    """Visibility over the ground of a grid.

    Parameters
    ----------
    model
        The model of the plan.
    prediction
        Its prediction for the pattern at the baseline.
    pattern, baseline_m
        The grid.
    altitude_m
        Altitude of the samples above the ground.
    size_m
        Size of the ground along and across the heading.

    Returns
    -------
    visibility
        The visibility; None if there is no ground, or if the model cannot predict the visibility of
        other places.
    """
    if min(size_m) <= 0.0:
        return None
    if model.name in ("uniform", "layered"):
        nadir = prediction._replace(density=model.density, transparency=model.transparency)
        sites = followed(pattern, baseline_m)
        return over_ground(size_m, of_statistics(nadir, sites, altitude_m))
    try:
        return over_ground(size_m, measured_at(model, pattern, baseline_m))
    except RequestError:  # An offset is larger than the lags of a saved correlogram.
        return None


def over_ground(
    size_m: tuple[float, float], at: Callable[[float, float], tuple[float, float]]
) -> GroundVisibility:
    """Mean and worst visibility over a rectangle of ground around the centre of a grid.

    Parameters
    ----------
    size_m
        Size of the rectangle along x and y.
    at
        Function that takes a position (x, y) relative to the centre, and returns p and V of a
        target there.
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
    """Make a function that returns p and V of a target at (x, y) in a uniform or layered scene.

    Parameters
    ----------
    prediction
        Prediction of the plan, from which K is taken.
    sites_m
        Samples along x and y from the centre.
    altitude_m
        Altitude of the samples above the ground.

    Notes
    -----
    The transparency of vertical rays is taken from the prediction.  The prediction therefore has to
    be for nadir rays.
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


def followed(pattern: AnyPattern, baseline_m: float) -> list[tuple[float, float]]:
    """Samples of a pattern along x and y from the centre.  For a large pattern, only every n-th
    sample is returned.
    """
    step = max(1, -(-pattern.samples // MOST_RAYS))
    while step > 1 and math.gcd(step, pattern.columns) > 1:
        # If the step and the number of columns had a common factor, only some of the columns
        # would be selected.
        step += 1
    return list(_every(step, pattern, baseline_m))


def _every(step: int, pattern: AnyPattern, baseline_m: float) -> Iterator[tuple[float, float]]:
    for index, (x, y) in enumerate(pattern.offsets()):
        if index % step == 0:
            yield x * baseline_m, y * baseline_m


def measured_at(
    model: VisibilityModel, pattern: AnyPattern, baseline_m: float
) -> Callable[[float, float], tuple[float, float]]:
    """Make a function that returns p and V of targets at (x, y) from the middle of a grid over a
    measured scene.
    """
    from aosplan.models.measured import MeasuredModel

    if isinstance(model, MeasuredModel):
        model = model.beside_the_middle(MOST_TARGETS)
    more_p = more_v = 0.0
    heading_deg = model.heading_deg or 0.0
    axis = heading_axis(heading_deg)
    sites = list(zip(*local_sites(pattern, baseline_m, heading_deg), strict=True))

    def at(x: float, y: float) -> tuple[float, float]:
        east, north = turned(x, y, axis)
        found: Prediction = model.predict_positions([(e - east, n - north) for e, n in sites])
        return found.density + more_p, found.expected + more_v

    if isinstance(model, MeasuredModel) and model.edges != "wrapped":
        # For each offset, the rays of other places stay on the plot. These places may have another
        # density, so the effect of the slant is taken from the wrapped plot.
        alone, model = model.predict(pattern, baseline_m), model.wrapped()
        p, v = at(0.0, 0.0)
        more_p, more_v = alone.density - p, alone.expected - v
    return at
