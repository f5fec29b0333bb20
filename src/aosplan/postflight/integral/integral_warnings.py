"""Warnings about an integral image: missing images, and implausible views or heights."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.messages import Message

if TYPE_CHECKING:
    from aosplan.postflight.integral.focus import Focus
    from aosplan.postflight.integral.integral import Integral
    from aosplan.postflight.integral.recording import Recording


def integral_warnings(recording: Recording, integral: Integral, least: int) -> list[Message]:
    """Warnings about an integral image for the user.

    Parameters
    ----------
    recording, integral
        The recording, and the integral image of some of its views.
    least
        Smallest number of views that have to see a pixel so that it is shown.
    """
    found = [(message.code, message.message) for message in recording.messages]
    if recording.missing:
        count = len(recording.missing)
        found.append(
            (
                "missing_images",
                f"{count} of {count + len(recording.views)} poses have no image in the "
                "folder, so they are left out: "
                f"{', '.join(recording.missing[:3])}{' ...' * (count > 3)}",
            )
        )
    if integral.blind:
        found.append(
            ("blind-views", f"{integral.blind} of {integral.views} photos do not show the extent")
        )
    if not integral.seen(least).any():
        found.append(
            (
                "coverage",
                f"no pixel is in {least} photos, so the image is empty; give a smaller --min-views",
            )
        )
    heights = recording.heights_m
    if heights.max() > 3.0 * heights.min():
        found.append(
            (
                "heights",
                f"cameras are {heights.min():.3g} to {heights.max():.3g} m above the focal "
                "plane; check --focal-height, and leave out photos that were taken during "
                "take-off",
            )
        )
    return [Message(code, message) for code, message in found]


def focus_warnings(focus: Focus | None) -> list[Message]:
    """Warnings about the focus; empty if there was no search for the focus."""
    found = []
    if focus is None:
        return []
    if focus.at_end:
        found.append(
            Message(
                "focus_at_end",
                f"the photos agree best at {focus.ground.place:.4g} m, which is the lowest "
                "or highest of the searched heights, so the ground may be outside; give "
                "other heights with --focus H1..H2",
            )
        )
    elif focus.crowns is None:
        found.append(
            Message(
                "one_layer",
                f"the photos agree at only one height, {focus.ground.place:.4g} m, which may be the "
                "height of the ground or of the crowns; if it is the height of the crowns, give "
                "lower heights with --focus H1..H2",
            )
        )
    count = len(focus.correction.shifts_m)
    if 0 < focus.aligned < count:
        found.append(
            Message(
                "unaligned",
                f"{count - focus.aligned} of {count} photos show too little to be aligned",
            )
        )
    return found
