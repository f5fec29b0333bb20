"""Results of a search within a given time: the best flights within half of this
time, within this time, and within twice this time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.messages import Limit, Message
from aosplan.planning.dependent_defaults import BEST

if TYPE_CHECKING:
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.within_shapes import TimedFlight

PHOTO_INTERVAL_S = 2.0
"""Assumed time between photos while flying, if neither a drone nor an option gives it.  It is the
value of the DJI Mavic 3T.
"""


class WithinRow(NamedTuple):
    """The best flight within a given time.

    Attributes
    ----------
    minutes
        The allowed time.
    timed
        The flight; None if no flight is possible.
    value
        The objective: a probability, a visibility or a contrast, or minus the quantity that is
        minimised.
    """

    minutes: float
    timed: TimedFlight | None
    value: float | None = None

    def document(self, objective: str) -> dict[str, Any]:
        """The row as plain values."""
        if self.timed is None or self.value is None:
            return {"within_min": self.minutes, "found": False}
        shape, way, _ = self.timed.candidate
        altitude_m = way.altitude_m
        return {
            "within_min": self.minutes,
            "found": True,
            "time_s": self.timed.time_s,
            "flights": self.timed.flights,
            objective: abs(self.value),
            "rows": shape.rows,
            "columns": shape.columns,
            "pitch_m": [shape.along * altitude_m, shape.across * altitude_m],
            "altitude_m": altitude_m,
            "heading_deg": way.heading_deg,
            "trigger": way.inputs.flight.trigger,
            "photos": self.timed.sites,
        }


class WithinResult(NamedTuple):
    """Results of a search within a given time.

    Attributes
    ----------
    asked
        The original request, without the options that the search chose.
    minutes
        The allowed time. If no time was given, the time from which on more time improves the
        objective only slightly.
    rows
        The best flights within half the time, within the time, and within twice the time.
    curve
        Flight time [s] and objective of the best flights within multiples of the time, by
        increasing time.
    predicted, laid_out
        Number of grids that were predicted, and number of flights that were planned completely.
    notices
        Assumptions of the search.
    """

    asked: PlanRequest
    minutes: float
    rows: tuple[WithinRow, ...]
    curve: tuple[tuple[float, float], ...]
    predicted: int
    laid_out: int
    notices: tuple[Message, ...] = ()

    def limits(self, time_s: float) -> tuple[Limit, ...]:
        """The limits that determine the chosen plan, whose flights take the time `time_s`."""
        allowed_s = 60.0 * self.minutes
        if self.asked.within is None and self.asked.optimize == "time":
            text = "no faster flight over the area reaches the target"
        elif self.asked.within is None:
            text = "twice the time would improve the plan only slightly"
        elif self.asked.optimize in BEST:
            text = (
                f"among the plans that take at most {self.minutes:.4g} min from take-off to landing, "
                "none with a higher value was found"
            )
        else:
            text = (
                "among the plans that reach the target and take at most "
                f"{self.minutes:.4g} min, none with a lower value was found"
            )
        return (Limit("total_time_s", time_s, allowed_s, text),)

    def document(self) -> dict[str, Any]:
        """The object ``within`` of a plan's JSON document."""
        objective = self.asked.optimize
        return {
            "minutes": self.minutes,
            "asked": self.asked.within is not None,
            "objective": objective,
            "rows": [row.document(objective) for row in self.rows],
            "curve": [[time_s, abs(value)] for time_s, value in self.curve],
            "predicted": self.predicted,
            "laid_out": self.laid_out,
        }


def interval_assumed() -> Message:
    """The warning that the interval between photos is assumed."""
    return Message(
        "photo_interval_assumed",
        "the shortest time between photos is not known; for photos taken in flight, "
        f"{PHOTO_INTERVAL_S:g} s is assumed; give --photo-interval S or --drone NAME",
    )


def samples_bounded(samples: int) -> Message:
    """The warning that the largest allowed number of photos of each point limits the search."""
    return Message(
        "search_samples_bounded",
        f"the search allows at most {samples} photos of each point, but more photos would be "
        "possible within the time; allow them with --max-samples N",
    )
