"""Rows of a scene's table about its opacity: its source, and results from the pulses."""

from __future__ import annotations

from typing import Any


def opacity_rows(opacity: dict[str, Any]) -> list[tuple[str, str]]:
    """Rows about the opacity of a point cloud, from the document of ``scene --json``."""
    if opacity["source"] != "pulses":
        return [("Opacity", "each voxel that contains a point is opaque (assumed, not measured)")]
    first, weighted, last, sampled = (
        f"{100.0 * opacity[name]:.1f} %"
        for name in ("gap_first", "gap_weighted", "gap_last", "sampled_share")
    )
    low, high = opacity["zenith_deg"]
    several = "s" if opacity["lines"] != 1 else ""
    energy = (
        "energies of the returns from calibrated intensities"
        if opacity["energy"] == "intensity"
        else "equal energies of all returns of a pulse"
    )
    return [
        (
            "Opacity",
            f"from {opacity['pulses']} pulses of {opacity['lines']} flight line{several}, "
            + (f"{low:.0f}° to {high:.0f}° off nadir" if high else "treated as vertical"),
        ),
        ("Gaps", f"{weighted} of the pulses' energy reaches the ground ({energy})"),
        (
            "",
            f"{first} if the first return of each pulse had all of its energy, {last} if the "
            "last return had",
        ),
        (
            "Sampled",
            f"pulses cross {sampled} of the voxels below the top of the canopy; leaves are "
            f"cells of {opacity['leaf_size_m']:.2g} m",
        ),
    ]
