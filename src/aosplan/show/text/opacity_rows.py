"""Rows of a scene's table about its opacity: the source, and results from the pulses."""

from __future__ import annotations

from typing import Any


def opacity_rows(opacity: dict[str, Any]) -> list[tuple[str, str]]:
    """Rows for the opacity of a point cloud, from the document of ``scene --json``."""
    if opacity["source"] != "pulses":
        return [("Opacity", "a voxel with a point in it is opaque (not measured)")]
    first, weighted, last, sampled = (
        f"{100.0 * opacity[name]:.1f} %"
        for name in ("gap_first", "gap_weighted", "gap_last", "sampled_share")
    )
    low, high = opacity["zenith_deg"]
    several = "s" if opacity["lines"] != 1 else ""
    energy = (
        "energy by calibrated intensity" if opacity["energy"] == "intensity" else "equal energies"
    )
    return [
        (
            "Opacity",
            f"from {opacity['pulses']} pulses of {opacity['lines']} flight line{several}, {low:.0f}° "
            f"to {high:.0f}° off the vertical",
        ),
        ("Gaps", f"{weighted} of the pulses' energy reaches the ground ({energy})"),
        ("", f"{first} if first returns had all of it, {last} if last returns had"),
        (
            "Sampled",
            f"pulses cross {sampled} of the voxels up to the top; cells of "
            f"{opacity['leaf_size_m']:.2g} m",
        ),
    ]
