"""What a plan's JSON says of an area, and of a line that is flown on and on."""

from __future__ import annotations

from typing import Literal

from aosplan.validation import (
    Finite,
    OpenDocument,
    Pair,
)


class AreaDocument(OpenDocument):
    """What is covered of an area (`aosplan.areas.survey.Survey`)."""

    origin: Pair
    area_m2: Finite
    clear_m2: Finite
    no_fly_m2: Finite
    covered_share: Finite
    fewest_looks: int | None
    sites: int
    sites_in_rectangle: int
    sites_in_no_fly: int
    sites_enclosed: int
    rectangle_m: Pair
    pitch_m: Pair
    axis: Literal["along", "across"]
    shortest_m: Finite
    over_shortest: Finite | None
    simplified_m: Finite
    projection_error: Finite


class LineIntegralDocument(OpenDocument):
    """The last photos of a line flown on and on, and what they show."""

    samples: int
    spacing_m: Finite
    length_m: Finite
    speed_mps: Finite
    interval_s: Finite
    duration_s: Finite
    expected: Finite
    normalized: Finite


class ContinuousDocument(OpenDocument):
    """Integrals along a line, by number of photos and by speed."""

    fastest_mps: Finite | None
    by_samples: list[LineIntegralDocument]
    by_speed: list[LineIntegralDocument]
