"""Rows of a plan's table for flights in the order of gain.  They show how the probability of success
grows with time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.planning.gain_result import GainResult

MOST_FLIGHTS = 6
"""Largest number of flights that are listed."""


def gain_rows(gain: GainResult) -> Iterator[tuple[str, str]]:
    """Yield the heading and the text of each row."""
    for index, text in enumerate(gain_texts(gain)):
        yield "Order" if index == 0 else "", text.removesuffix(".")


def gain_texts(gain: GainResult) -> list[str]:
    """Results of a flight in the order of gain, in sentences."""
    found = [
        (
            f"The target is in the area with a probability of {gain.probability_of_area:.1%} "
            f"(POA). It is in the area and is found with a probability of {gain.success:.1%} (POS)."
        )
    ]
    if gain.is_part:
        found.append(
            f"The time is sufficient for {gain.photos:,} of the {gain.all_photos:,} photos of the "
            "whole area. They are those in which the target is most likely to be found. In the "
            f"shortest order, POS is {gain.usual_success:.1%} within this time."
        )
    mean, usual = gain.mean_s / 60.0, gain.usual_mean_s / 60.0
    found.append(
        "If the target is found, the photos that show it have been taken after "
        f"{mean:.1f} min on average ({usual:.1f} min in the shortest order)."
    )
    if len(gain.flights) > 1:
        shown = [
            f"flight {number}: {flight.success:.1%}"
            for number, flight in enumerate(gain.flights[:MOST_FLIGHTS], 1)
        ]
        if len(gain.flights) > MOST_FLIGHTS:
            shown.append("…")
        found.append(f"POS until the end of each flight: {', '.join(shown)}.")
    return found
