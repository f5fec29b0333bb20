"""Rows of a plan's table about the choice of guided positions, and about plain grids with the same
flight time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.units import percent

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.maps.reciprocal_map import ReciprocalMap
    from aosplan.planning.guided_result import GuidedResult, PlainFlight


def guided_rows(guided: GuidedResult) -> Iterator[tuple[str, str]]:
    """Yield heading and text of each row."""
    chosen, doubts, *plain = guided_texts(guided)
    yield "Guided", chosen.removesuffix(".")
    yield "", doubts.removesuffix(".")
    for index, text in enumerate(plain):
        yield "Plain grid" if index == 0 else "", text.removesuffix(".")


def guided_texts(guided: GuidedResult) -> list[str]:
    """Sentences about the choice of guided positions, about its uncertainty, and about
    plain grids.
    """
    return [
        "The positions were chosen with one half of the pulses, and V is predicted with the other "
        f"half (with the first: {percent(guided.chosen_expected)}).",
        f"V = {percent(guided.least_expected)} if there is dense foliage wherever no pulse has "
        f"passed; {percent(guided.unseen_share)} of the area is in no photo.",
        *map(plain_text, guided.plain[:2]),
    ]


def plain_text(flight: PlainFlight) -> str:
    """Short description of a plain grid with the same flight time."""
    how = "while flying" if flight.trigger == "distance" else "at stops"
    shape = (
        f"Line of {flight.columns}"
        if flight.rows == 1
        else f"Lanes of {flight.rows} x {flight.columns}"
    )
    return (
        f"{shape} {how}, {flight.time_s / 60.0:.1f} min: V = "
        f"{percent(flight.prediction.expected)}, {percent(flight.unseen_share)} in no photo."
    )


def position_rows(found: ReciprocalMap | None) -> Iterator[tuple[str, str]]:
    """Yield rows with the results of a map of camera positions."""
    if found is None:
        return
    east_m, north_m, most = found.best
    known = found.document()
    yield "", ""
    yield (
        "Positions",
        f"a camera sees {percent(known['mean'])} of the {found.target_area_m2:.3g} m² on average; "
        f"the best position, {east_m:.3g} m east and {north_m:.3g} m north, {percent(most)}",
    )
