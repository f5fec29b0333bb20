"""Results of a detection map in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from aosplan.maps.detection_map import DetectionMap, SearchSuccess


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
        lines.append(f"No photo sees {document['unseen_share']:.1%} of it.")
    if found.sweep_width_m is not None:
        lines.append(f"The line has a sweep width of {found.sweep_width_m:.3g} m.")
    if success is not None:
        lines.append(
            f"The target is there with a probability of {success.area:.1%} (POA), and "
            f"it is there and found with a probability of {success.success:.1%} (POS)."
        )
    return lines
