"""Warnings about a point cloud that was read into voxels."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from aosplan.scenes.opacity import SPARSE_POINTS_PER_M2, is_sparse
from aosplan.units import rounded_up

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.scenes.opacity import Opacity
    from aosplan.scenes.voxels import VoxelVolume

    Warned = tuple[str, str]

SATURATED_OCCUPANCY = 0.98
FULL_FOOTPRINT = 0.95
POINTS_A_COLUMN = 1.6
"""Smallest mean number of points per voxel column. With fewer points, more than a fifth of the
columns are empty by chance.
"""


def cloud_doubts(volume: VoxelVolume, covered: float, *, assumed: bool) -> Iterator[Warned]:
    """Yield warnings about the point cloud."""
    occupancy = volume.column_occupancy
    if volume.ground == "filter":
        message = (
            "a cloth simulation filter computed the ground, because the points have no classes"
        )
        yield "ground_filtered", message
    if volume.ground == "normalized" and assumed:
        message = "z is assumed to be the height above ground, because the lowest z are near 0"
        yield "ground_assumed_normalized", message
    if covered < FULL_FOOTPRINT:
        message = (
            f"the points cover {covered:.0%} of their bounding rectangle, and the rest is "
            f"treated as open ground; p is {occupancy:.3g} for the whole rectangle, but "
            f"{min(occupancy / covered, 1.0):.3g} in the part with points; crop a rectangle "
            "from the cloud"
            if occupancy
            else f"the points cover {covered:.0%} of their bounding rectangle"
        )
        yield "partial_plot", message
    if occupancy == 0.0:
        message = f"no point is {volume.min_height_m:g} m or more above the ground"
        yield "no_vegetation", message


def pulse_doubts(volume: VoxelVolume, opacity: Opacity, *, later_returns: bool) -> Iterator[Warned]:
    """Yield warnings about a volume whose opacity was computed from few or incomplete pulses."""
    density = (opacity.pulses or 0) / volume.plot_area_m2
    if is_sparse(volume.points, volume.plot_area_m2):
        message = (
            f"{density:.3g} pulses per m² do not resolve the gaps in crowns, so V̂ is too high by "
            "about its standard error (±); V is more reliable"
        )
        yield "sparse_cloud", message
    if not later_returns:
        message = (
            "the cloud contains only the first return of each pulse, so the canopy is more "
            "transparent than it seems"
        )
        yield "only_first_returns", message
    if opacity.zenith_deg == (0.0, 0.0):
        message = (
            "the position of the laser cannot be computed from the pulses, so they are treated as "
            "vertical, which may change V by 0.1; --trajectory gives the position"
        )
        yield "pulses_assumed_vertical", message


def opacity_doubts(volume: VoxelVolume, spacing_m: float) -> Iterator[Warned]:
    """Yield warnings about a volume in which every voxel with a point is treated as opaque."""
    voxel_m, occupancy = volume.voxel_m, volume.column_occupancy
    sparse = is_sparse(volume.points, volume.plot_area_m2)
    if sparse and occupancy > 0.0:
        message = (
            f"{volume.points_per_m2:.3g} points per m² are fewer than "
            f"{SPARSE_POINTS_PER_M2:g}, so most of the "
            f"canopy is missing and p = {occupancy:.2g} is too low; give a cloud with more points, "
            "or a scene that describes the forest"
        )
        yield "sparse_cloud", message
    if volume.opacity is not None and volume.opacity.reason:
        message = (
            "the opacity cannot be computed from the pulses, so each voxel with a point is opaque, "
            f"and the result depends on --voxel: {volume.opacity.reason}"
        )
        yield "opacity_from_voxels", message
    enough_m = math.sqrt(POINTS_A_COLUMN) * spacing_m
    if voxel_m < enough_m * (1.0 - 1e-9) and not sparse:
        points = (voxel_m / spacing_m) ** 2
        message = (
            f"columns of {voxel_m:g} m contain {points:.2g} points on average, so "
            f"{math.exp(-points):.0%} of the columns contain none by chance, and the canopy seems "
            f"more transparent than it is; give --voxel with {rounded_up(enough_m, 2)} m or more"
        )
        yield "voxel_below_spacing", message
    if occupancy > SATURATED_OCCUPANCY:
        message = (
            f"{occupancy:.1%} of the voxel columns contain points, so the density of the "
            f"canopy cannot be measured; give a --voxel that is smaller than {voxel_m:g} m"
        )
        if spacing_m < voxel_m:
            message += f", but not below {rounded_up(spacing_m, 2)} m, which fits the density of the points"
        yield "saturated", message
