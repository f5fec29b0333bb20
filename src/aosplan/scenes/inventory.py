"""Scenes from a forest inventory: stems, crowns and leaf area.

Crowns are ellipsoids of equal size at random places (a Boolean model).  They are `crown_diameter_m`
wide and as high as the volume.  Leaves fill the crowns uniformly and have a spherical angle
distribution.  With λ stems per square metre, the mean number of crowns above a point is μ = λ π
d²/4.  Here d is the diameter of a crown.  By the law of Beer and Lambert, a vertical ray through
the centre of a crown has the optical depth κ = 3 G L / (2 μ), where L is the leaf area index and G
= 1/2 is the projection of leaf area.  A vertical ray at the distance r from the centre has the
optical depth κ w with w = √(1 - (2 r/d)²). w² is uniformly distributed over the disc of a crown, so
a crown transmits the share

    t = 2 ∫ w exp(-κ w) dw = 2 (1 - (1 + κ) exp(-κ)) / κ².

The number of crowns above a point has a Poisson distribution, so the visible share of the ground is

    1 - p = exp(-μ (1 - t)) = exp(-G L Ω),   Ω = μ (1 - t) / (G L).

The clumping index Ω is 1 for thin leaves. The share exp(-μ) of gaps between crowns does not depend
on the leaf area (Nilson 1971, Agricultural Meteorology 8, 25-38; Nilson 1999, Agricultural and
Forest Meteorology 98-99, 437-448; G: Ross 1981, The Radiation Regime and Architecture of Plant
Stands).

The optical depth -ln(1 - p) is distributed over the height like the leaf area: in proportion to the
cross-section of the ellipsoid. Slices are treated as independent, although they are not independent
in real stands, because leaves are clumped. The predicted V̂ is therefore an upper bound.
"""

from __future__ import annotations

import math
from itertools import pairwise

from aosplan.errors import RequestError
from aosplan.scenes.scene import LARGEST_M, Layer, LayeredScene

PROJECTION = 0.5
"""G: mean projection of unit leaf area for a spherical distribution of leaf angles."""

OCCLUDER_SIZE_M = 0.25
"""Default size of leaf clumps.  It is the default voxel size of point clouds."""

MOST_SLICES = 500
SQUARE_METRES_A_HECTARE = 1e4


def crowns_over_a_spot(stems_per_hectare: float, crown_diameter_m: float) -> float:
    """Mean number μ of crowns above a point on the ground."""
    return stems_per_hectare / SQUARE_METRES_A_HECTARE * math.pi * crown_diameter_m**2 / 4.0


def crown_absorption(depth: float) -> float:
    """Share 1 - t of the vertical rays that an ellipsoidal crown absorbs.

    Parameters
    ----------
    depth
        κ, optical depth along the vertical axis of the crown, at least 0.
    """
    if depth < 1.0:
        # The closed form loses digits for small κ. The series is 1 - t = -Σ (-κ)ⁿ 2 / (n! (n + 2)),
        # from n = 1.
        term, total = 1.0, 0.0
        for n in range(1, 20):
            term *= -depth / n
            total -= term * 2.0 / (n + 2)
        return total
    return 1.0 - 2.0 * (1.0 - (1.0 + depth) * math.exp(-depth)) / depth**2


def inventory_scene(
    name: str,
    *,
    stems_per_hectare: float,
    crown_diameter_m: float,
    leaf_area_index: float,
    volume_base_m: float,
    volume_height_m: float,
    occluder_size_m: float | None = None,
) -> LayeredScene:
    """A layered scene from an inventory.

    Parameters
    ----------
    name
        Name of the scene in the output.
    stems_per_hectare, crown_diameter_m
        Number of trees per hectare, and diameter of their crowns; above 0.
    leaf_area_index
        L, one-sided leaf area per ground area, at least 0.
    volume_base_m, volume_height_m
        Height of the crown base above the ground, and height of the crowns.
    occluder_size_m
        Size of the leaf clumps; None for `OCCLUDER_SIZE_M`.

    Raises
    ------
    RequestError
        If a number is outside its domain.
    """
    for label, value in (
        ("stems_per_hectare", stems_per_hectare),
        ("crown_diameter_m", crown_diameter_m),
        ("volume_height_m", volume_height_m),
    ):
        if not 0.0 < value <= LARGEST_M:
            raise RequestError(f"scene '{name}': {label} {value:g} is not a positive number")
    if not 0.0 <= leaf_area_index <= LARGEST_M:
        raise RequestError(f"scene '{name}': leaf_area_index {leaf_area_index:g} is below 0")
    size_m = OCCLUDER_SIZE_M if occluder_size_m is None else occluder_size_m
    crowns = crowns_over_a_spot(stems_per_hectare, crown_diameter_m)
    leaves = PROJECTION * leaf_area_index
    depth = crowns * crown_absorption(1.5 * leaves / crowns) if crowns > 0.0 else 0.0
    count = 1 if not size_m > 0.0 else math.ceil(min(volume_height_m / size_m, MOST_SLICES))
    edges = [i / count for i in range(count + 1)]
    layers = tuple(
        Layer(
            volume_base_m + low * volume_height_m,
            volume_base_m + high * volume_height_m,
            -math.expm1(-depth * (_share_below(high) - _share_below(low))),
            size_m,
        )
        for low, high in pairwise(edges)
    )
    clumping = depth / leaves if leaves > 0.0 else 1.0
    return LayeredScene(
        name=name,
        layers=layers,
        title=f"{stems_per_hectare:g} stems per hectare, crowns of {crown_diameter_m:g} m, "
        f"leaf area index {leaf_area_index:g}",
        source="Nilson (1999), Agricultural and Forest Meteorology 98-99, 437-448",
        assumed=(
            "crowns are ellipsoids of one size at random places, from "
            f"{volume_base_m:g} to {volume_base_m + volume_height_m:g} m; their leaves "
            f"are spread evenly, have random directions (G = {PROJECTION:g}; clumping "
            f"index {clumping:.2f}) and form clumps of {size_m:g} m; there are no "
            "stems or branches; slices are assumed to be independent, so V̂ is an "
            "upper bound"
        ),
    )


def _share_below(height: float) -> float:
    """Share of an ellipsoid's volume below a height.  The height is given as a share of the total
    height.
    """
    return height * height * (3.0 - 2.0 * height)
