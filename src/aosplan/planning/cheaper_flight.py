"""Hint about a cheaper flight over the same area, if the plan takes hours or thousands of
photos.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from aosplan.errors import InfeasibleError, RequestError
from aosplan.messages import Message

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.planning.request import PlanRequest

LONG_S = 3600.0
"""Time of all flights above which a cheaper flight is searched for."""

CHEAPER = 0.7
"""Largest time of a cheaper flight, as a share of the time of the plan."""

TRIES = 4
"""Number of flights that are planned completely in each round of the search. No-fly zones may make
all of these flights impossible.
"""

LONGEST_MIN = 24.0 * 60.0


def cheaper_way(
    request: PlanRequest, folder: str, loaded: LoadedScene, time_s: float = math.inf
) -> str | None:
    """Text that describes options with which the same target over an area is reached in less time.

    Parameters
    ----------
    request
        The request.
    folder
        Folder in which its files are looked for before the current folder.
    loaded
        The scene.
    time_s
        Time that the flights of the request take.

    Returns
    -------
    str or None
        The text; None if no flight takes less than `CHEAPER` of the time.
    """
    if not request.over_area or loaded.kind == "cloud":
        return None
    from aosplan.planning.within import WithinSearch
    from aosplan.planning.within_shapes import request_for

    opened = replace(
        request, within=LONGEST_MIN, optimize="time", grid="best", trigger="best", lanes=None,
        lane_pitch=None, baseline=None, samples=None, max_samples=None, resume_at=None,
        sensitivity=False, max_blur=None, exposure_time=None,
        photo_interval=request.photo_interval or 2.0,
    )  # fmt: skip
    try:
        search = WithinSearch(opened, folder, lambda _: loaded)
        found = search.best(min(60.0 * LONGEST_MIN, CHEAPER * time_s), TRIES)
    except (InfeasibleError, RequestError):
        return None
    if found is None:
        return None
    shape = found.candidate.shape
    way = request_for(opened, found.candidate)
    grid = "--grid line" if shape.rows == 1 else f"--grid lanes --lanes {shape.rows}"
    flights = "" if found.flights == 1 else f" in {found.flights} flights"
    return (
        f"--trigger {way.trigger} {grid} --lane-pitch {_below(way.lane_pitch)} "
        f"--samples {shape.samples} --baseline {_below(way.baseline)} reaches the "
        f"target in {math.ceil(found.time_s / 60.0)} min{flights} with "
        f"{found.sites:,} photos; --within MIN chooses the best plan for the "
        "available time"
    )


def long_flight(
    request: PlanRequest, folder: str, loaded: LoadedScene, time_s: float
) -> Iterator[Message]:
    """Warn of flights over an area that take hours, if a cheaper flight is found."""
    if time_s <= LONG_S:
        return
    way = cheaper_way(request, folder, loaded, time_s)
    if way is not None:
        yield Message(
            "cheaper_flight", f"the flights take {time_s / 60.0:,.0f} min in total; {way}"
        )


def _below(value: float | str | None) -> str:
    """A length or a pitch as text. It is rounded down, because a wider grid may be larger than the
    footprint of the images.
    """
    assert isinstance(value, float)
    return f"{math.floor(1000.0 * value) / 1000.0:g}"
