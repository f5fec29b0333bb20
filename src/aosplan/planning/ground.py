"""Visibility over the ground of a plan, with the real slant of the rays."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from aosplan.errors import RequestError
from aosplan.models.ground_visibility import (
    GroundVisibility,
    followed,
    of_statistics,
    over_ground,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.grid.patterns import Sites
    from aosplan.models.model import Prediction, VisibilityModel
    from aosplan.planning.sites import Layout
    from aosplan.planning.solved_plan import SolvedPlan

MOST_TARGETS = 1_000_000
"""Largest number of targets of a plot that are evaluated beside the middle of the grid."""


def ground_of(solved: SolvedPlan, layout: Layout) -> GroundVisibility | None:
    """Visibility over the ground of a plan; None if nothing is hidden, or no ground is seen by all.

    Notes
    -----
    The ground of one grid is the ground that all its samples see; for a single line, it is the swath.
    Over an area, every place has a grid whose middle is within half a pitch.
    """
    inputs, problem, solution = solved.inputs, solved.problem, solved.solution
    if problem is None:
        return None
    sides = zip(inputs.footprint_m, solution.pattern.extent, strict=True)
    x, y = (size - side * solution.baseline_m for size, side in sides)
    if layout.survey is not None:
        pitch_x, pitch_y = layout.survey.pitch_m
        x, y = min(x, pitch_x), min(y, pitch_y)
    if min(x, y) <= 0.0:
        return None
    if inputs.model != "measured":
        sites = followed(solution.pattern, solution.baseline_m)
        nadir = solution.prediction._replace(
            density=problem.model.density, transparency=problem.model.transparency
        )
        return over_ground((x, y), of_statistics(nadir, sites, inputs.altitude_m))
    try:
        return over_ground(
            (x, y), measured_at(problem.model, solution.pattern, solution.baseline_m)
        )
    except RequestError:  # beyond the lags of a saved correlogram
        return None


def measured_at(
    model: VisibilityModel, pattern: Sites, baseline_m: float
) -> Callable[[float, float], tuple[float, float]]:
    """p and V of targets beside the middle of a grid over a measured scene."""
    from aosplan.grid.patterns import local_sites
    from aosplan.models.measured import MeasuredModel

    if isinstance(model, MeasuredModel):
        model = model.beside_the_middle(MOST_TARGETS)
    more_p = more_v = 0.0
    heading_deg = model.heading_deg or 0.0
    heading = math.radians(heading_deg)
    sine, cosine = math.sin(heading), math.cos(heading)
    sites = list(zip(*local_sites(pattern, baseline_m, heading_deg), strict=True))

    def at(x: float, y: float) -> tuple[float, float]:
        east, north = x * sine + y * cosine, x * cosine - y * sine
        found: Prediction = model.predict_positions([(e - east, n - north) for e, n in sites])
        return found.density + more_p, found.expected + more_v

    if isinstance(model, MeasuredModel) and model.edges != "wrapped":
        # Different places count at each offset, so the effect of the slant is taken from the wrapped plot.
        alone, model = model.predict(pattern, baseline_m), model.wrapped()
        p, v = at(0.0, 0.0)
        more_p, more_v = alone.density - p, alone.expected - v
    return at
