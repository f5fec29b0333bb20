"""The probability of detection of a plan's target, computed with `aosplan.models`.

This module is imported only if a plan has a target to find.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from aosplan.errors import RequestError
from aosplan.grid.patterns import local_sites
from aosplan.messages import Message
from aosplan.models.counted_detection import count_detection
from aosplan.models.detection import DetectionModel
from aosplan.models.target_window import Target
from aosplan.scenes.scene import Layer

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from aosplan.grid.patterns import AnyPattern
    from aosplan.models.detection import Detection
    from aosplan.models.signatures import Signature
    from aosplan.planning.resolve import FindInputs, PlanInputs
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

CLEAR = (Layer(1.0, 1.1, 1e-6, 0.2),)
"""A slice that is used for scenes without occluders. It hides one millionth of the ground."""

FEWEST_PHOTOS = 9
"""Smallest number of photos for which predictions are within 0.05 of simulations at the same
threshold.
"""

MOST_CROWN_SHARE = 0.2
"""Largest crown share of the clutter for which predictions are within 0.05 of simulations."""


COUNTED_M = 48.0
"""Edge length of the part of a wide plot on which the detection is counted."""

WIDE_M = 2.0 * COUNTED_M
"""Edge length of a plot above which the detection is counted on a part of it."""

STEP_M = 8.0
"""The size of a counted part is a multiple of this length."""


def slices_of(inputs: PlanInputs) -> tuple[Layer, ...]:
    """The slices of a scene above the focal plane.  Targets lie on the focal plane."""
    above = inputs.loaded.scene.above(inputs.focal_height_m)
    return tuple(above.slices()) if above is not None and above.integrated_density else CLEAR


def detection_model(inputs: PlanInputs) -> DetectionModel:
    """The model of detection through independent slices, for any pattern and baseline."""
    find = find_of(inputs)
    return _model(
        slices_of(inputs),
        inputs.altitude_m,
        Target(*find.size_m),
        find.signature,
        find.false_alarms,
        find.assumed,
    )


def find_of(inputs: PlanInputs) -> FindInputs:
    """The target of a plan that has a target to find."""
    assert inputs.find is not None
    return inputs.find


@lru_cache(maxsize=16)
def _model(
    layers: tuple[Layer, ...],
    altitude_m: float,
    target: Target,
    signature: Signature,
    false_alarms: float,
    assumed: str,
) -> DetectionModel:
    """The model. It is cached, because its integrals can be used again."""
    return DetectionModel(
        layers, altitude_m, target, signature, false_alarms=false_alarms, assumed=assumed
    )


def detection_of(inputs: PlanInputs, pattern: AnyPattern, baseline_m: float) -> Detection:
    """Predict the detection of a plan's target with one grid, at the heading of the inputs.

    The measured model counts hidden targets in the voxels.  The other models use slices.

    Raises
    ------
    RequestError
        If the model is the measured one and the scene has no voxels.
    """
    if inputs.model != "measured":
        return detection_model(inputs).predict(pattern, baseline_m)
    sites = np.column_stack(local_sites(pattern, baseline_m, inputs.heading_deg))
    return _counted(inputs, sites)


def detections_of_rows(
    inputs: PlanInputs, rows: Sequence[tuple[AnyPattern, float, bool]]
) -> list[Detection | None]:
    """The detection of a plan's target with each of several grids.

    Parameters
    ----------
    inputs
        The inputs of a plan that has a target to find.
    rows
        For each row: pattern, baseline, and whether the detection of this row is needed.  Counting
        in voxels takes seconds for each row.  A row that is not needed is not counted, and its
        detection is None.
    """
    if inputs.model != "measured":
        model = detection_model(inputs).for_search()
        return [model.predict(pattern, baseline) for pattern, baseline, _ in rows]
    return [
        detection_of(inputs, pattern, baseline) if matters else None
        for pattern, baseline, matters in rows
    ]


def detection_at(inputs: PlanInputs, points_m: Floats) -> Detection:
    """The detection of a plan's target with photos from known positions.

    Parameters
    ----------
    inputs
        The inputs of a plan that has a target to find.
    points_m
        Shape (N, 2), from the middle of the grid: east and north for the measured model, along and
        across the heading for the other models.
    """
    if inputs.model != "measured":
        return detection_model(inputs).predict_positions(points_m)
    return _counted(inputs, points_m)


def _counted(inputs: PlanInputs, sites_m: Floats) -> Detection:
    """Count the detection in the voxels of a stand. Sites are in metres east and north of the
    middle of the grid.
    """
    find, volume = find_of(inputs), inputs.loaded.volume
    if volume is None:
        raise RequestError(
            "--find needs the voxels of the stand, but this scene has only statistics",
            "give the point cloud, a .npz file that aosplan scene --save wrote, or --model layered",
        )
    return count_detection(
        _part_to_count(volume, sites_m, inputs.altitude_m),
        sites_m,
        inputs.altitude_m,
        Target(*find.size_m),
        find.signature,
        false_alarms=find.false_alarms,
        assumed=find.assumed,
        focal_height_m=inputs.focal_height_m,
        edges=inputs.edges,
    )


def _part_to_count(volume: VoxelVolume, sites_m: Floats, altitude_m: float) -> VoxelVolume:
    """A typical part of a wide plot, on which the detection is counted.  Other plots are whole.

    It is so wide that a square of `COUNTED_M` remains from which all rays stay on it.  Its size is
    rounded up, so that plans with similar grids have the same part.
    """
    if max(volume.size_m) <= WIDE_M:
        return volume
    rise = volume.canopy_top_m / altitude_m
    width_m, depth_m = (
        STEP_M * math.ceil((COUNTED_M + rise * float(extent)) / STEP_M)
        for extent in np.ptp(sites_m, axis=0)
    )
    return _typical_part(volume, (width_m, depth_m))


@lru_cache(maxsize=4)
def _typical_part(volume: VoxelVolume, size_m: tuple[float, float]) -> VoxelVolume:
    return volume.typical_part(size_m)


def detection_warnings(detection: Detection, inputs: PlanInputs, samples: int) -> Iterator[Message]:
    """Yield warnings about the limits of a predicted detection."""
    width, gsd_m = detection.target.width_m, inputs.camera.gsd_m(inputs.altitude_m)
    if gsd_m > 0.5 * width:
        yield Message(
            "target_below_pixel",
            f"a pixel is {gsd_m:.2g} m wide on the ground, and the target is {width:g} m "
            "wide, so the target is less than two pixels wide; the prediction assumes a sharp "
            "image; fly lower, or use a longer lens",
        )
    if samples < FEWEST_PHOTOS:
        yield Message(
            "detection_few_photos",
            f"with fewer than {FEWEST_PHOTOS} photos, the probability of detection may be "
            "wrong by 0.2",
        )
    volume = inputs.loaded.volume
    if inputs.model == "measured" and volume is not None and max(volume.size_m) > WIDE_M:
        yield Message(
            "detection_of_a_part",
            f"the detection is counted on a part of the plot, about {COUNTED_M:g} x {COUNTED_M:g} "
            "m; it is the part whose share of hidden ground is nearest to that of the whole plot",
        )
    if detection.signature.crown_share > MOST_CROWN_SHARE:
        yield Message(
            "detection_crown_clutter",
            f"the crown share is {detection.signature.crown_share:.0%}; for crown shares "
            "above 20%, the probability of detection may be wrong by 0.1",
        )
    if detection.standard_error is None:
        yield Message(
            "detection_independent_occluders",
            "the probability of detection assumes independent occluders, so it is an upper "
            "bound; in generated stands that have crowns and the same density, about half as "
            "many targets were found; for a better prediction, give the point cloud of a "
            "stand",
        )
    if inputs.hold_error_m > 0.0 or inputs.rays not in (None, "nadir"):
        yield Message(
            "detection_plain_rays",
            "the probability of detection is predicted for vertical rays and exact "
            "positions, so it does not depend on --hold-error and --rays",
        )
