"""From occluders and a camera to disparities and the baseline.

An occluder of size o at height H above the focal plane, seen from altitude h by a camera of
focal length f (pixels), is f o/(h - H) pixels large, and moves by f b (1/(h-H) - 1/h)
between two samples b apart.  Their ratio is the normalised disparity d̂ = b H/(h o): it does
not depend on the camera until the occluder is smaller than a pixel, when a disparity has to
reach one pixel to separate anything.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import InfeasibleError
from aosplan.numerics import SCALARS, smallest

if TYPE_CHECKING:
    from collections.abc import Sequence


MOST_SHARES = 4_000_000
"""Slabs times knots of a baseline curve."""


def occluder_px(
    occluder_size_m: float, height_m: float, altitude_m: float, focal_length_px: float
) -> float:
    """Projected size of an occluder [px], at least one pixel.

    Heights and altitude count from the focal plane, height below altitude.
    """
    return max(focal_length_px * occluder_size_m / (altitude_m - height_m), 1.0)


def disparity_px(baseline_m: Any, height_m: Any, altitude_m: Any, focal_length_px: Any) -> Any:
    """Shift of an occluder between neighbouring registered samples [px]."""
    # b f (1/(h-H) - 1/h), without the cancellation of the two terms.
    return baseline_m * focal_length_px * height_m / ((altitude_m - height_m) * altitude_m)


def baseline_for_disparity_px(
    disparity: Any, height_m: Any, altitude_m: Any, focal_length_px: Any
) -> Any:
    """Baseline [m] at which an occluder moves by a number of pixels: `disparity_px` solved for b."""
    return disparity * (altitude_m - height_m) * altitude_m / (focal_length_px * height_m)


def covered_height_m(bottom_m: Any, top_m: Any, coverage: Any) -> Any:
    """Height above which a share of the occluders lies that are spread evenly between two heights.

    It is counted upwards from the bottom: the lowest occluders decide, and nothing cancels.
    """
    return bottom_m + (1.0 - coverage) * (top_m - bottom_m)


def unit_baseline_m(
    occluder_size_m: Any, height_m: Any, altitude_m: Any, focal_length_px: Any, xp: Any = SCALARS
) -> Any:
    """Baseline [m] at which an occluder has d̂ = 1; one smaller than a pixel counts as one pixel.

    Heights above 0; floats, or arrays with numpy as `xp`.
    """
    by_size = occluder_size_m * altitude_m / height_m
    by_pixel = baseline_for_disparity_px(1.0, height_m, altitude_m, focal_length_px)
    resolved = focal_length_px * occluder_size_m / (altitude_m - height_m) > 1.0
    return xp.where(resolved, by_size, by_pixel)


class CoverageBaseline(NamedTuple):
    """The baseline of the coverage rule, and the occluder that decides it.

    `occluder_size_m` at `height_m` has d̂ = 1 at `baseline_m`; the wanted share of the
    occluders has at least that.
    """

    baseline_m: float
    height_m: float
    occluder_size_m: float


def coverage_share(
    slabs: Sequence[Slab], altitude_m: float, focal_length_px: float, baseline_m: float
) -> float:
    """Share of the occluders with d̂ >= 1 at a baseline (the paper's Fig. 6b)."""
    if baseline_m <= 0.0:
        return 0.0
    covered = [
        slab.weight
        * _share_above(slab, _unit_height_m(slab, altitude_m, focal_length_px, baseline_m))
        for slab in slabs
    ]
    return math.fsum(covered) / math.fsum(slab.weight for slab in slabs)


def coverage_baseline(
    slabs: Sequence[Slab], altitude_m: float, focal_length_px: float, coverage: float
) -> CoverageBaseline:
    """Smallest baseline at which a share of the occluders has d̂ >= 1: the paper's rule.

    Low occluders move least, so it is they that decide.  Within a slab the occluders are
    spread evenly in height.

    Parameters
    ----------
    slabs
        At least one, of positive weight; heights from the focal plane, all below the altitude.
    altitude_m
        Above the focal plane.
    focal_length_px
        Focal length; occluders smaller than a pixel count as one pixel.
    coverage
        Wanted share, above 0 and at most 1.

    Raises
    ------
    InfeasibleError
        If occluders reach down to the focal plane and all of them are asked for.
    """
    if len(slabs) == 1:
        slab = slabs[0]
        height = covered_height_m(slab.bottom_m, slab.top_m, coverage)
    elif coverage == 1.0:
        slab = max(
            slabs, key=lambda s: _unit_baseline_m(s, s.bottom_m, altitude_m, focal_length_px)
        )
        height = slab.bottom_m
    else:
        baseline = _covering_baseline_m(slabs, altitude_m, focal_length_px, coverage)
        slab, height = _deciding(slabs, altitude_m, focal_length_px, baseline)
    if height <= 0.0:
        raise InfeasibleError(
            uncovered(coverage),
            "occluders at height 0 never blur away: use a smaller --coverage, such as 0.98",
        )
    unit = _unit_baseline_m(slab, height, altitude_m, focal_length_px)
    return CoverageBaseline(unit, height, slab.occluder_size_m)


def uncovered(coverage: float) -> str:
    """What is said of a coverage that includes occluders on the focal plane."""
    return f"coverage {coverage:g} asks for every occluder, and some stand on the focal plane"


def _unit_baseline_m(
    slab: Slab, height_m: float, altitude_m: float, focal_length_px: float
) -> float:
    """Baseline at which a slab's occluders at a height have d̂ = 1; inf on the focal plane."""
    if height_m <= 0.0:
        return math.inf
    return float(unit_baseline_m(slab.occluder_size_m, height_m, altitude_m, focal_length_px))


def baseline_curve(slabs: Sequence[Slab]) -> list[tuple[float, float]]:
    """Baseline over altitude, and the share of the occluders with d̂ >= 1 there.

    One knot for each end of a slab, by rising baseline; occluders on the focal plane itself
    never have d̂ >= 1 and have no knot.  Of very many slabs only some of the ends have one, evenly
    chosen, the widest among them.  Pixels are not considered.
    """
    ends = {
        slab.occluder_size_m / height
        for slab in slabs
        for height in (slab.bottom_m, slab.top_m)
        if height > 0.0
    }
    every = -(-len(ends) * len(slabs) // MOST_SHARES)
    knots = sorted(ends, reverse=True)[:: max(every, 1)]
    return [(knot, coverage_share(slabs, 1.0, math.inf, knot)) for knot in reversed(knots)]


def _covering_baseline_m(
    slabs: Sequence[Slab], altitude_m: float, focal_length_px: float, coverage: float
) -> float:
    def covers(baseline_m: float) -> bool:
        # Shares add up to 1 only within rounding.
        share = coverage_share(slabs, altitude_m, focal_length_px, baseline_m)
        return share >= coverage * (1.0 - 1e-15)

    high = altitude_m
    while not covers(high):
        high *= 2.0
        if not math.isfinite(high):
            return high
    return smallest(covers, 0.0, high)


def _deciding(
    slabs: Sequence[Slab], altitude_m: float, focal_length_px: float, baseline_m: float
) -> tuple[Slab, float]:
    """The slab in which d̂ = 1 is reached at a baseline, and the height at which it is."""

    def outside(slab: Slab) -> float:
        height = _unit_height_m(slab, altitude_m, focal_length_px, baseline_m)
        return max(slab.bottom_m - height, height - slab.top_m, 0.0)

    slab = min(slabs, key=outside)
    height = _unit_height_m(slab, altitude_m, focal_length_px, baseline_m)
    return slab, min(max(height, slab.bottom_m), slab.top_m)


def _unit_height_m(
    slab: Slab, altitude_m: float, focal_length_px: float, baseline_m: float
) -> float:
    """Height from which occluders of a slab have d̂ >= 1 at a baseline."""
    if math.isinf(baseline_m):
        return 0.0
    by_size = slab.occluder_size_m * altitude_m / baseline_m
    by_pixel = altitude_m**2 / (focal_length_px * baseline_m + altitude_m)
    return max(by_size, by_pixel)


def _share_above(slab: Slab, height_m: float) -> float:
    if slab.top_m == slab.bottom_m:
        # A height that was computed from this very slab's baseline counts as reached.
        return 1.0 if slab.top_m >= height_m * (1.0 - 1e-12) else 0.0
    share = (slab.top_m - height_m) / (slab.top_m - slab.bottom_m)
    return min(max(share, 0.0), 1.0)


class Slab(NamedTuple):
    """Occluders of one size, spread evenly between two heights, which may be the same.

    `weight` is their share among all slabs, up to a common factor.
    """

    bottom_m: float
    top_m: float
    occluder_size_m: float
    weight: float
