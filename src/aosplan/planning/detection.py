"""The detection that a plan promises: from a solved request to the model of `aosplan.models`.

Loaded where something is looked for, and nowhere else.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from aosplan.errors import RequestError
from aosplan.grid.patterns import local_sites
from aosplan.messages import Message
from aosplan.models.counted_detection import count_detection
from aosplan.models.detection import DetectionModel
from aosplan.models.signatures import SIGNATURES, Signature
from aosplan.models.target_window import Target
from aosplan.planning.option_parsers import PERSON, target_m
from aosplan.scenes.scene import Layer

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from aosplan.grid.patterns import Sites
    from aosplan.models.detection import Detection
    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.planning.plan_data import PlanData
    from aosplan.planning.request import PlanRequest
    from aosplan.scenes.scene import Scene
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

CLEAR = (Layer(1.0, 1.1, 1e-6, 0.2),)
"""Used instead of a scene without occluders: a millionth of the ground is hidden."""

FEWEST_PHOTOS = 9
"""Photos from which a prediction is within 0.05 of simulations at the same threshold."""

MOST_CROWN_SHARE = 0.2
"""Share of the clutter at the scale of crowns up to which it is."""


def target_of(request: PlanRequest) -> Target:
    """What a request looks for."""
    assert request.find is not None
    return Target(*target_m(request.find))


def signature_of(request: PlanRequest) -> tuple[Signature, str]:
    """The signature of a request, and its name if it is an assumed one."""
    if request.signature is not None:
        return SIGNATURES[request.signature], request.signature
    assert request.contrast is not None
    assert request.canopy_offset is not None
    assert request.crown_share is not None
    return Signature(request.contrast, request.canopy_offset, request.crown_share), ""


def slices_of(scene: Scene, request: PlanRequest) -> tuple[Layer, ...]:
    """What of a scene stands above the focal plane, as slices: targets lie on that plane."""
    above = scene.above(request.focal_height)
    return tuple(above.slices()) if above is not None and above.integrated_density else CLEAR


def detection_model(scene: Scene, request: PlanRequest, altitude_m: float) -> DetectionModel:
    """Detection through independent slices for any pattern and baseline: what a search asks."""
    signature, name = signature_of(request)
    assert request.false_alarms is not None
    return _model(
        slices_of(scene, request),
        altitude_m,
        target_of(request),
        signature,
        request.false_alarms,
        name,
    )


@lru_cache(maxsize=16)
def _model(
    layers: tuple[Layer, ...],
    altitude_m: float,
    target: Target,
    signature: Signature,
    false_alarms: float,
    assumed: str,
) -> DetectionModel:
    """The model, kept with the integrals that it has made."""
    return DetectionModel(
        layers, altitude_m, target, signature, false_alarms=false_alarms, assumed=assumed
    )


def detection_of(
    request: PlanRequest,
    found: LoadedScene,
    model: str,
    altitude_m: float,
    pattern: Sites,
    baseline_m: float,
    heading_deg: float,
) -> Detection:
    """Detection of what a request looks for, by one grid.

    Parameters
    ----------
    request
        With ``find`` and what goes with it.
    found
        The scene.
    model
        Name of the visibility model: ``measured`` counts in the voxels, others take slices.
    altitude_m
        Above the focal plane.
    pattern, baseline_m, heading_deg
        The grid.

    Raises
    ------
    RequestError
        Where the measured model has no voxels.
    """
    if model != "measured":
        return detection_model(found.scene, request, altitude_m).predict(pattern, baseline_m)
    sites = np.column_stack(local_sites(pattern, baseline_m, heading_deg))
    return _counted(request, found.volume, altitude_m, sites)


def _counted(
    request: PlanRequest,
    volume: VoxelVolume | None,
    altitude_m: float,
    sites_m: Floats,
) -> Detection:
    """Detection counted in the voxels of a stand, sites east and north of the middle."""
    if volume is None:
        raise RequestError(
            "--find needs the voxels of the stand, and this scene has statistics alone",
            "give the point cloud, or what scene --save NAME.npz wrote; or --model layered",
        )
    signature, name = signature_of(request)
    assert request.false_alarms is not None
    return count_detection(
        volume,
        sites_m,
        altitude_m,
        target_of(request),
        signature,
        false_alarms=request.false_alarms,
        assumed=name,
        focal_height_m=request.focal_height,
    )


def detections_of_rows(
    plan: PlanData, rows: Sequence[tuple[Sites, float, bool]]
) -> list[Detection | None]:
    """Detection by many grids over the scene of a plan.

    Parameters
    ----------
    plan
        With what is looked for.
    rows
        Pattern, baseline and whether the row matters.  Counting in voxels takes seconds a row, so
        only those that matter are counted; the others are None.
    """
    request = plan.request
    if plan.model != "measured":
        model = detection_model(plan.scene, request, plan.altitude_m).for_search()
        return [model.predict(pattern, baseline) for pattern, baseline, _ in rows]
    return [
        _counted(
            request,
            plan.volume,
            plan.altitude_m,
            np.column_stack(local_sites(pattern, baseline, plan.heading_deg)),
        )
        if matters
        else None
        for pattern, baseline, matters in rows
    ]


def detection_at(plan: PlanData, points_m: Floats) -> Detection:
    """Detection by photos from known positions over the scene of a plan.

    Parameters
    ----------
    plan
        With what is looked for.
    points_m
        Shape (N, 2), from the middle: east and north over voxels, along the plan's axes otherwise.
    """
    if plan.model != "measured":
        model = detection_model(plan.scene, plan.request, plan.altitude_m)
        return model.predict_positions(points_m)
    return _counted(plan.request, plan.volume, plan.altitude_m, points_m)


def detection_warnings(
    detection: Detection, request: PlanRequest, samples: int, gsd_m: float
) -> Iterator[Message]:
    """What a reader of a detection should know."""
    width = detection.target.width_m
    if gsd_m > 0.5 * width:
        yield Message(
            "target_below_pixel",
            f"a pixel is {gsd_m:.2g} m wide on the ground and the target {width:g} m: less than two "
            "pixels show it, and the prediction assumes a sharp image; fly lower, or use a "
            "longer lens",
        )
    if samples < FEWEST_PHOTOS:
        yield Message(
            "detection_few_photos",
            f"with fewer than {FEWEST_PHOTOS} photos the probability of detection may be off by 0.2",
        )
    if detection.signature.crown_share > MOST_CROWN_SHARE:
        yield Message(
            "detection_crown_clutter",
            f"{detection.signature.crown_share:.0%} of the clutter are at the scale of crowns: the "
            "probability of detection may be off by 0.1, and depends on that share",
        )
    if detection.standard_error is None:
        yield Message(
            "detection_independent_occluders",
            "the probability of detection takes occluders for independent of each other; below "
            "generated stands with crowns as dense, about half as many targets were found: take it "
            "for an upper bound, or give the point cloud of a stand",
        )
    if request.hold_error > 0.0 or request.rays not in (None, "nadir"):
        yield Message(
            "detection_plain_rays",
            "the probability of detection is predicted for rays straight down from the planned "
            "sites, without --hold-error and --rays",
        )


def sentence(detection: Detection, request: PlanRequest) -> str:
    """The detection in the words of a search."""
    width, length = detection.target
    who = "people" if request.find == PERSON else f"targets of {width:g} x {length:g} m"
    alarms = detection.false_alarms
    rate = "one false alarm" if alarms == 1.0 else f"{alarms:g} false alarms"
    return (
        f"of 100 {who} lying there, {_count(detection.probability, 'about ')} would be found at {rate} "
        f"a hectare; {_count(detection.unseen)} are nearly unseen"
    )


def _count(share: float, about: str = "") -> str:
    """A share of a hundred, without claiming none or all where it is only nearly so."""
    hundred = 100.0 * share
    if 0.0 < hundred < 0.5:
        return "fewer than 1" if hundred >= 0.05 else "0"
    return "more than 99" if 99.5 <= hundred < 99.95 else f"{about}{hundred:.0f}"
