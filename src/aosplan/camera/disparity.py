"""Disparity of occluders, and the baseline of the coverage rule.

An occluder of size o at height H above the focal plane is seen from altitude h by a camera with
focal length f (pixels). The image of the occluder is f o/(h - H) pixels large. Between two samples
at the distance b, this image moves by f b (1/(h-H) - 1/h) pixels. The normalised disparity d̂ = b
H/(h o) is the movement divided by the size. It does not depend on the camera, unless the image of
the occluder is smaller than a pixel. The size of such an occluder is taken as one pixel, so it has
to move by one pixel to reach d̂ = 1.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import InfeasibleError
from aosplan.numerics import SCALARS, smallest

if TYPE_CHECKING:
    from collections.abc import Sequence


MOST_SHARES = 4_000_000
"""Largest product of the number of slabs and the number of knots of a baseline curve."""


def occluder_px(
    occluder_size_m: float, height_m: float, altitude_m: float, focal_length_px: float
) -> float:
    """Size of an occluder in the image, at least one pixel [px].

    `height_m` and `altitude_m` are above the focal plane, and `height_m` is less than `altitude_m`.
    """
    return max(focal_length_px * occluder_size_m / (altitude_m - height_m), 1.0)


def disparity_px(baseline_m: Any, height_m: Any, altitude_m: Any, focal_length_px: Any) -> Any:
    """Shift of an occluder between neighbouring registered samples [px]."""
    # This is b f (1/(h-H) - 1/h), written without a difference of two similar terms.
    return baseline_m * focal_length_px * height_m / ((altitude_m - height_m) * altitude_m)


def baseline_for_disparity_px(
    disparity: Any, height_m: Any, altitude_m: Any, focal_length_px: Any
) -> Any:
    """Baseline [m] at which an occluder moves by `disparity` pixels: the inverse of
    `disparity_px`.
    """
    return disparity * (altitude_m - height_m) * altitude_m / (focal_length_px * height_m)


def covered_height_m(bottom_m: Any, top_m: Any, coverage: Any) -> Any:
    """Height above which the share `coverage` of the occluders between two heights is found.

    The occluders are distributed uniformly in height. The formula adds a part of the interval to
    its bottom. Subtracting a part from its top would cause cancellation for the lowest occluders,
    which determine the baseline.
    """
    return bottom_m + (1.0 - coverage) * (top_m - bottom_m)


def unit_baseline_m(
    occluder_size_m: Any, height_m: Any, altitude_m: Any, focal_length_px: Any, xp: Any = SCALARS
) -> Any:
    """Baseline [m] at which an occluder has d̂ = 1. An occluder that is smaller than a pixel is
    treated as if it were one pixel large.

    Heights are greater than 0.  The arguments are floats, or arrays if `xp` is numpy.
    """
    by_size = occluder_size_m * altitude_m / height_m
    by_pixel = baseline_for_disparity_px(1.0, height_m, altitude_m, focal_length_px)
    resolved = focal_length_px * occluder_size_m / (altitude_m - height_m) > 1.0
    return xp.where(resolved, by_size, by_pixel)


class CoverageBaseline(NamedTuple):
    """The baseline of the coverage rule, and the occluder that determines it.

    An occluder of size `occluder_size_m` at `height_m` has d̂ = 1 at `baseline_m`.  At this
    baseline, the required share of the occluders has d̂ >= 1.
    """

    baseline_m: float
    height_m: float
    occluder_size_m: float


def coverage_share(
    slabs: Sequence[Slab], altitude_m: float, focal_length_px: float, baseline_m: float
) -> float:
    """Share of the occluders with d̂ >= 1 at a baseline (Fig. 6b of the paper)."""
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
    """Smallest baseline at which the share `coverage` of the occluders has d̂ >= 1.  This is the
    coverage rule of the paper.

    The lowest occluders move least and therefore determine the baseline.  Within a slab, occluders
    are distributed uniformly in height.

    Parameters
    ----------
    slabs
        At least one slab of positive weight; heights are above the focal plane and below
        `altitude_m`.
    altitude_m
        Altitude above the focal plane.
    focal_length_px
        Focal length in pixels. Occluders that are smaller than a pixel are treated as if they were
        one pixel large.
    coverage
        Required share, greater than 0 and at most 1.

    Raises
    ------
    InfeasibleError
        If `coverage` includes occluders on the focal plane, which have no disparity.
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
            no_coverage_text(coverage),
            "no baseline separates occluders at height 0; give a smaller --coverage, such as 0.98",
        )
    unit = _unit_baseline_m(slab, height, altitude_m, focal_length_px)
    return CoverageBaseline(unit, height, slab.occluder_size_m)


def no_coverage_text(coverage: float) -> str:
    """Error message for a coverage that includes occluders on the focal plane."""
    return (
        f"coverage {coverage:g} includes every occluder, but some occluders are on the focal plane"
    )


def _unit_baseline_m(
    slab: Slab, height_m: float, altitude_m: float, focal_length_px: float
) -> float:
    """Baseline at which a slab's occluders at a height have d̂ = 1; inf on the focal plane."""
    if height_m <= 0.0:
        return math.inf
    return float(unit_baseline_m(slab.occluder_size_m, height_m, altitude_m, focal_length_px))


def baseline_curve(slabs: Sequence[Slab]) -> list[tuple[float, float]]:
    """Curve of the share of the occluders with d̂ >= 1 against the ratio of baseline to altitude.

    The curve has one knot for each bottom and top of a slab, in order of increasing baseline.  A
    bottom on the focal plane has no knot, because occluders there have no disparity.  If there are
    very many slabs, only every n-th knot and the knot with the largest baseline are kept.  The size
    of a pixel is not taken into account.
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
        # Because of rounding, the sum of all shares may be slightly below 1.
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
    """The slab in which d̂ reaches 1 at a baseline, and the height at which d̂ = 1."""

    def outside(slab: Slab) -> float:
        height = _unit_height_m(slab, altitude_m, focal_length_px, baseline_m)
        return max(slab.bottom_m - height, height - slab.top_m, 0.0)

    slab = min(slabs, key=outside)
    height = _unit_height_m(slab, altitude_m, focal_length_px, baseline_m)
    return slab, min(max(height, slab.bottom_m), slab.top_m)


def _unit_height_m(
    slab: Slab, altitude_m: float, focal_length_px: float, baseline_m: float
) -> float:
    """Height above which the occluders of a slab have d̂ >= 1 at a baseline."""
    if math.isinf(baseline_m):
        return 0.0
    by_size = slab.occluder_size_m * altitude_m / baseline_m
    by_pixel = altitude_m**2 / (focal_length_px * baseline_m + altitude_m)
    return max(by_size, by_pixel)


def _share_above(slab: Slab, height_m: float) -> float:
    if slab.top_m == slab.bottom_m:
        # The comparison needs a tolerance, because the baseline may have been computed from this
        # height.
        return 1.0 if slab.top_m >= height_m * (1.0 - 1e-12) else 0.0
    share = (slab.top_m - height_m) / (slab.top_m - slab.bottom_m)
    return min(max(share, 0.0), 1.0)


class Slab(NamedTuple):
    """Occluders of one size, distributed uniformly between two heights, which may be equal.

    `weight` is proportional to the slab's share of all occluders.
    """

    bottom_m: float
    top_m: float
    occluder_size_m: float
    weight: float


def disparity_document(
    coverage: CoverageBaseline | None,
    baseline_m: float,
    altitude_m: float,
    focal_length_px: float,
) -> dict[str, float | None]:
    """Disparity and size of the occluder that determines the coverage rule.  The size is at least
    one pixel.
    """
    if coverage is None:
        return {"normalized": None, "pixels": None, "occluder_pixels": None}
    height_m, camera = coverage.height_m, (altitude_m, focal_length_px)
    return {
        "normalized": baseline_m / coverage.baseline_m,
        "pixels": disparity_px(baseline_m, height_m, *camera),
        "occluder_pixels": occluder_px(coverage.occluder_size_m, height_m, *camera),
    }
