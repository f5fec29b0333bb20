"""A prediction for all targets of an area, with the slanted rays from the cameras to these targets.

A ray with the slopes x and y crosses √(1 + x² + y²) times as many leaves of random direction as a
vertical ray. In slices of cubes, it also meets side faces: it is free with probability Π q^(1 + r
(|x| + |y|)), where r is the thickness of a slice divided by the size of its occluders. Let p_i(t)
be the probability that view i does not see the target t. Then

    E[X²] = mean over t of (mean over i of p_i)² + K · mean of p_i (1 - p_i),

where K is the shortfall of the plan.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from aosplan.models.model import Prediction

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from aosplan.scenes.occlusion import ViewKind
    from aosplan.scenes.scene import Scene

    Floats = NDArray[np.float64]
    LogClear = Callable[[Floats, Floats], Floats]

AREA_POINTS = 9
"""Number of points along each side of the area over which a prediction is averaged."""


def cube_terms(above: Scene) -> tuple[float, float]:
    """Logarithm of the transparency of vertical rays, and its change per unit of slope for
    cubes.
    """
    straight = slope = 0.0
    for layer in above.slices():
        cubes = (layer.top_m - layer.bottom_m) / layer.occluder_size_m
        log_clear = math.log1p(-layer.density)
        straight += log_clear
        slope += log_clear * cubes / max(round(cubes), 1)
    return straight, slope


def cubes(above: Scene) -> LogClear:
    """Make a function of the slopes of a ray along x and y. It returns the logarithm of the
    transparency of slices of cubes.
    """
    straight, slope = cube_terms(above)
    return lambda x, y: straight + slope * (x + y)


def leaves(above: Scene) -> LogClear:
    """Make a function of the slopes of a ray. It returns the logarithm of the transparency of
    leaves of random direction.
    """
    straight, _ = cube_terms(above)
    return lambda x, y: straight * np.sqrt(1.0 + x * x + y * y)


def slanted(
    shortfall: float,
    log_clear: LogClear,
    positions_m: Floats,
    area_m: tuple[float, float],
    altitude_m: float,
    view: ViewKind,
) -> Prediction:
    """The prediction for an area, by the formula in the docstring of this module.

    Parameters
    ----------
    shortfall
        K of the plan.
    log_clear
        Function that takes the absolute slopes of rays along x and y, and returns the logarithm of
        their transparency.
    positions_m
        Positions of the cameras relative to the middle of the pattern, shape (N, 2).
    area_m
        Size of the area of the targets along x and y, for perspective views.
    altitude_m
        Altitude of the cameras above the targets.
    view
        Whether all targets are below one aperture (perspective), or each target is below its own
        aperture (telecentric).
    """
    share = (np.arange(AREA_POINTS) + 0.5) / AREA_POINTS - 0.5
    scale = 0.0 if view == "telecentric" else 1.0
    x, y = (
        np.abs(positions_m[:, axis] - scale * area_m[axis] * share[:, np.newaxis]) / altitude_m
        for axis in (0, 1)
    )
    clear = np.exp(log_clear(x[:, np.newaxis, :], y[np.newaxis, :, :]))
    p, t = 1.0 - float(clear.mean()), float(clear.mean())
    means = 1.0 - clear.mean(axis=2)
    squares = float((means * means).mean()) + shortfall * float((clear * (1.0 - clear)).mean())
    return Prediction(p, t, (squares - p * p) / (p * t))
