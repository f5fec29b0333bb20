"""What a search within a time has found: the best within half the time, the time, and twice it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.messages import Limit, Message
from aosplan.planning.option_relations import BEST

if TYPE_CHECKING:
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.within_shapes import TimedFlight

PHOTO_INTERVAL_S = 2.0
"""Time between photos in passing where neither a drone nor an option tells it: DJI's Mavic 3T's."""


class WithinRow(NamedTuple):
    """The best within a time.

    Attributes
    ----------
    minutes
        The time allowed.
    timed
        What is flown; None if nothing can be.
    value
        The objective: a probability, a visibility or a contrast, or minus what is minimised.
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
    """What a search within a time has found.

    Attributes
    ----------
    asked
        The request as it was, with what it leaves open.
    minutes
        The time allowed, or, if none was given, the time from which on more gains little.
    rows
        The best within half the time, the time, and twice it.
    curve
        Flight time [s] and objective of the best within parts of the time, rising.
    predicted, laid_out
        Grids that were predicted, and flights that were laid out.
    notices
        What was assumed.
    """

    asked: PlanRequest
    minutes: float
    rows: tuple[WithinRow, ...]
    curve: tuple[tuple[float, float], ...]
    predicted: int
    laid_out: int
    notices: tuple[Message, ...] = ()

    def limits(self, time_s: float) -> tuple[Limit, ...]:
        """What bounds the plan that was chosen, whose flights take a time [s]."""
        allowed_s = 60.0 * self.minutes
        if self.asked.within is None and self.asked.optimize == "time":
            text = "the least time in which a flight over the area reaches the target"
        elif self.asked.within is None:
            text = "twice the time would improve the plan only slightly"
        elif self.asked.optimize in BEST:
            text = f"the best within {self.minutes:.4g} min, from take-off to landing"
        else:
            text = f"the lowest value that reaches the target within {self.minutes:.4g} min"
        return (Limit("total_time_s", time_s, allowed_s, text),)

    def document(self) -> dict[str, Any]:
        """``within`` of a plan's JSON."""
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
    """The warning of an interval between photos that nothing tells."""
    return Message(
        "photo_interval_assumed",
        f"the shortest time between photos is not known: {PHOTO_INTERVAL_S:g} s is "
        "assumed for photos while flying; give --photo-interval S, or a --drone",
    )


def samples_bounded(samples: int) -> Message:
    """The warning of a search that more photos of each point would fit into."""
    return Message(
        "search_samples_bounded",
        f"the search takes up to {samples} photos of each point, and more would fit into the "
        "time; allow them with --max-samples N",
    )
