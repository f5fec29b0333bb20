"""The lattice of camera positions from which guided positions are chosen."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import InfeasibleError
from aosplan.numerics import heading_axis, turned

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.areas.no_fly import NoFlyZones
    from aosplan.models.place import PlaceViews
    from aosplan.planning.resolve import PlanInputs
    from aosplan.planning.target_area import TargetArea
    from aosplan.scenes.plot_frame import PlotFrame

    Floats = NDArray[np.float64]

STEP_M = 1.0
"""Default spacing of the candidate positions."""

MOST_CANDIDATES = 2500
"""Largest number of candidates. If the default spacing gives more candidates, a larger spacing is
used.
"""


class Candidates(NamedTuple):
    """Candidate positions on a lattice whose axes are along the heading and across it.

    Attributes
    ----------
    places
        Positions as whole numbers of steps from the origin, along the heading and to its right,
        shape (M, 2).
    step_m
        The step.
    points_m
        Positions in metres east and north of the origin, shape (M, 2).
    reason
        What limits the extent of the candidates.
    """

    places: NDArray[np.int64]
    step_m: float
    points_m: Floats
    reason: str

    @property
    def reach_m(self) -> tuple[float, float]:
        """Extent along the heading and across it."""
        along, across = (self.step_m * np.ptp(self.places, axis=0)).tolist()
        return along, across


def candidates_of(
    inputs: PlanInputs, area: TargetArea, frame: PlotFrame, views: PlaceViews, zones: NoFlyZones
) -> Candidates:
    """Find the positions from which the sites are chosen.

    Raises
    ------
    InfeasibleError
        If no photo shows the whole area, if there are no candidates, or if there are too many.
    """
    low, high = area.bounds_m(inputs.heading_deg)
    footprint = np.array(inputs.footprint_m)
    if (high - low >= footprint).any():
        along, across = (high - low).tolist()
        raise InfeasibleError(
            f"no photo shows the whole target area: a photo shows {footprint[0]:.4g} x "
            f"{footprint[1]:.4g} m, along and across the heading, and the area is {along:.4g} x "
            f"{across:.4g} m",
            "fly higher, give a smaller area (--around-radius), or use a wider camera",
        )
    first, last = high - 0.5 * footprint, low + 0.5 * footprint
    reason = "every photo shows the whole target area"
    widest = inputs.bounds.max_aperture_m
    if widest is not None and (last - first > widest).any():
        middle = 0.5 * (low + high)
        first = np.maximum(first, middle - 0.5 * widest)
        last = np.minimum(last, middle + 0.5 * widest)
        reason = f"the grid is at most --max-aperture {widest:g} wide"
    step = _step_m(inputs, last - first)
    counts = np.floor(last / step + 1e-9) - np.ceil(first / step - 1e-9) + 1.0
    x, y = (
        math.ceil(start / step - 1e-9) + np.arange(max(int(count), 0))
        for start, count in zip(first.tolist(), counts.tolist(), strict=True)
    )
    places = np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))]).astype(np.int64)
    axis = heading_axis(inputs.heading_deg)
    points = np.column_stack(turned(step * places[:, 0], step * places[:, 1], axis))
    stays = views.stays_on_plot(frame.onto_plot(points))
    if not stays.all():
        reason = "beyond these positions, rays to the target area leave the point cloud"
    kept = stays & ~zones.inside(points) if zones else stays
    if not kept.any():
        raise InfeasibleError(
            "no position is possible: each position is in a no-fly zone, or rays from it to the target "
            "area leave the point cloud",
            "give a larger point cloud, a smaller area, or a place nearer to its middle",
        )
    return Candidates(places[kept], step, points[kept], reason)


def _step_m(inputs: PlanInputs, size_m: Floats) -> float:
    """Spacing of the candidates: the requested spacing, or the smallest multiple of half a metre
    that gives at most `MOST_CANDIDATES`.
    """
    asked = inputs.bounds.baseline_m

    def count(step_m: float) -> float:
        return float(np.prod(np.floor(size_m / step_m) + 1.0))

    step_m = STEP_M if asked is None else asked
    while count(step_m) > MOST_CANDIDATES:
        step_m += 0.5
    if asked is not None and step_m > asked:
        raise InfeasibleError(
            f"--baseline {asked:g} gives {count(asked):.0f} candidate positions, more than "
            f"{MOST_CANDIDATES}",
            f"give --baseline {step_m:g} or more, or a smaller --max-aperture",
        )
    return step_m
