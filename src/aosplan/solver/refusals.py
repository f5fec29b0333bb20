"""Error messages for requests and targets that cannot be met.

Single plans and sweeps use the same texts.  `symbol` is V̂ or V, and `target` is the requested
value.
"""

from __future__ import annotations

from aosplan.grid.patterns import MOST_SITES
from aosplan.solver.problem import reached_text, target_text

LIFT_GROUND = (
    "fly higher, use a camera with a wider field of view, give a lower target, or give "
    "--allow-no-common-ground"
)
"""Hint for a grid that cannot be made large enough, because all samples have to see
common ground.
"""


def best_text(symbol: str, reached: float, samples: int, baseline_m: float) -> str:
    """Text that describes the best plan within some bounds."""
    return f"{reached_text(symbol, reached)} with {samples} samples {baseline_m:.4g} m apart"


def beyond_scene(symbol: str, target: float, least: float, most: float) -> str:
    """Error: no number of samples reaches the target in this scene."""
    return (
        f"{target_text(symbol, target)} is out of reach for this scene: one photo reaches "
        f"{least:.4g}, and infinitely many photos reach {most:.4g}"
    )


def beyond_samples(
    symbol: str, target: float, samples: int, reached: float, widest_m: float
) -> str:
    """Error: the given number of samples does not reach the target at any baseline."""
    return (
        f"{target_text(symbol, target)} is out of reach with --samples {samples}; the best "
        f"grid reaches {reached_text(symbol, reached)}, with photos {widest_m:.4g} m apart"
    )


def beyond_max_samples(symbol: str, target: float, needed: int, most: int, best: str) -> str:
    """Error: the target needs more samples than the bound allows."""
    return (
        f"{target_text(symbol, target)} needs at least {needed} samples, more than "
        f"--max-samples {most}; the best grid reaches {best}"
    )


def beyond_bounds(
    symbol: str,
    target: float,
    max_aperture_m: float | None,
    max_samples: int | None,
    best: str,
    *,
    on_ground: bool = False,
) -> str:
    """Error: no pattern within the bounds reaches the target."""
    bounds = []
    if max_aperture_m is not None:
        bounds.append(f"--max-aperture {max_aperture_m:g}")
    if max_samples is not None:
        bounds.append(f"--max-samples {max_samples}")
    if on_ground:
        bounds.append("a grid for which some ground is in all photos")
    within = " and ".join(bounds) or "any baseline"
    return (
        f"{target_text(symbol, target)} is out of reach within {within}; the best grid reaches "
        f"{best}"
    )


def beyond_baseline(
    symbol: str, target: float, baseline_m: float, samples: int | None, *, bounded: bool
) -> str:
    """Error: at the given baseline, the target needs more samples than the bound allows, or than a
    plan may have.
    """
    needed = samples or f"more than {MOST_SITES}"
    allowed = "allowed" if bounded else "one plan may have"
    return (
        f"{target_text(symbol, target)} at --baseline {baseline_m:g} needs {needed} samples, more "
        f"than {allowed}"
    )


def beyond_ground(
    symbol: str, target: float, baseline_m: float, samples: int, widest_m: float
) -> str:
    """Error: at the given baseline, the samples have no common ground that all of them see."""
    return (
        f"{target_text(symbol, target)} at --baseline {baseline_m:g} needs {samples} "
        "samples, and no ground is in all of these photos, unless the baseline is below "
        f"{widest_m:.4g} m"
    )


def beyond_aperture(
    symbol: str,
    target: float,
    baseline_m: float,
    samples: int,
    extent_m: float,
    max_aperture_m: float,
) -> str:
    """Error: at the given baseline, the extent of the samples exceeds the bound on the aperture."""
    return (
        f"{target_text(symbol, target)} at --baseline {baseline_m:g} needs {samples} samples over "
        f"{extent_m:.4g} m, more than --max-aperture {max_aperture_m:g}"
    )


def samples_beyond_bound(samples: int, most: int) -> str:
    """Error: the given number of samples exceeds the bound on the number of samples."""
    return f"--samples {samples} is more than --max-samples {most}"


def within_canopy(altitude_m: float, top_m: float, *, given: bool) -> str:
    """Error: the altitude is not above the canopy.

    `given` is true if the request gives the altitude, and false if the altitude was computed from
    the resolution.
    """
    return f"{_altitude_text(altitude_m, given=given)} is not above {_canopy_text(top_m)}"


def below_clearance(altitude_m: float, top_m: float, clearance_m: float, *, given: bool) -> str:
    """Error: the distance between the altitude and the canopy is less than the clearance.

    `given` is true if the request gives the altitude, and false if the altitude was computed from
    the resolution.
    """
    return (
        f"{_altitude_text(altitude_m, given=given)} is less than --clearance {clearance_m:g} m "
        f"above {_canopy_text(top_m)}"
    )


def opaque_scene(name: str) -> str:
    """Error: no ray reaches the ground of the scene."""
    return (
        f"scene '{name}' has integrated density 1: no ray reaches the ground, so "
        "photos cannot show the ground"
    )


def _altitude_text(altitude_m: float, *, given: bool) -> str:
    return f"altitude {altitude_m:.6g} m" + ("" if given else ", computed from the resolution,")


def _canopy_text(top_m: float) -> str:
    return f"the canopy, whose top is {top_m:.6g} m above the focal plane"
