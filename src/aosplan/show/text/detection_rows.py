"""Rows of a plan's table about the probability of detection and about the detection map."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from aosplan.maps.detection_map import DetectionMap, SearchSuccess
    from aosplan.planning.result import Plan

CURVE_SHOWN = (1.0, 2.0, 3.0, 5.0, 8.0)
"""Absolute contrasts for which the probability of detection is shown."""


def detection_rows(plan: Plan) -> Iterable[tuple[str, str]]:
    """Rows with the probability of detection: as a sentence, and for several contrasts."""
    from aosplan.planning.plan_detection import detection_text

    found = plan.detection
    assert found is not None
    yield "Detection", detection_text(plan)
    if plan.layout.survey is not None:
        samples = plan.solution.pattern.samples
        yield (
            "",
            (
                f"this is for a place that {samples} photos see; --detection-map computes the mean "
                "of the area"
            ),
        )
    contrast, offset, crowns = found.signature
    assumed = f"assumed signature {found.assumed}: " if found.assumed else ""
    yield "", f"{assumed}contrast {contrast:g}, canopy offset {offset:+g}, crown share {crowns:.0%}"
    curve = [f"{at:g}: {share:.0%}" for at, share in found.curve if abs(at) in CURVE_SHOWN]
    yield "", "found at contrast " + ", ".join(curve)


def map_rows(
    found: DetectionMap | None, success: SearchSuccess | None
) -> Iterable[tuple[str, str]]:
    """Rows with the results of a detection map."""
    if found is None:
        return
    yield "", ""
    for index, text in enumerate(search_map_texts(found, success)):
        yield "Search" if index == 0 else "", text.removesuffix(".")


def search_map_texts(found: DetectionMap, success: SearchSuccess | None) -> list[str]:
    """Results of a detection map in sentences."""
    document = found.document(success)
    ground = "area" if found.ground == "area" else "ground that the photos show"
    photos = document["photos"]
    lines = [
        (
            f"{found.mean:.1%} on average over the {ground} "
            f"({found.cells.area_m2 / 1e4:.3g} ha). On average, {photos['mean']:.3g} "
            f"photos see a place ({photos['least']} to {photos['most']})."
        )
    ]
    if document["unseen_share"] > 0.0:
        lines.append(f"No photo sees {document['unseen_share']:.1%} of this ground.")
    if found.sweep_width_m is not None:
        lines.append(f"The line has a sweep width of {found.sweep_width_m:.3g} m.")
    if success is not None:
        lines.append(
            f"The target is on this ground with a probability of {success.area:.1%} (POA).  "
            f"It is on this ground and is found with a probability of {success.success:.1%} "
            "(POS)."
        )
    return lines
