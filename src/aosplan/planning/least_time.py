"""The least time of a flight in closed form, as a bound for searches.

Without no-fly zones and terrain, no flight over an area is quicker than `least_time_s`.  At one
place it is the time of the flight itself.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from aosplan.flight.kinematics import steady
from aosplan.planning.route import LONGEST_RUN_IN_M

if TYPE_CHECKING:
    from aosplan.flight.kinematics import Timing
    from aosplan.planning.route import FlightInputs

BOTH_WAYS = ((1.0, 0.0), (-1.0, 0.0))
"""Courses of lines, in the axes along the heading and across it."""


class FlownLines(NamedTuple):
    """What is flown: sites on lines along the heading.

    Attributes
    ----------
    sites, lines
        Number of photos, and of the lines that they lie on.
    pitch_m
        Distance between photos along a line, and between lines.
    way_back_m
        Level distance from the last site back to the first; 0 if it is not known.
    """

    sites: int
    lines: int
    pitch_m: tuple[float, float]
    way_back_m: float = 0.0


def least_time_s(
    flight: FlightInputs,
    lattice: FlownLines,
    *,
    heading_deg: float,
    altitude_m: float,
    away_m: float = 0.0,
) -> float:
    """Least time of all flights over a lattice, from take-off to landing.

    Parameters
    ----------
    flight
        How to fly, and how long a battery lasts.
    lattice
        What is flown.
    heading_deg
        Direction of the lines, clockwise from true north; it matters to the wind.
    altitude_m
        Of the sites above the take-off.
    away_m
        Least level distance between the take-off and any site.

    Returns
    -------
    float
        Seconds; infinite if the speed needs too long a run-in, or if a battery does not last for the
        path there and back.
    """
    timing = steady(flight.timing(heading_deg).at(lattice.pitch_m[0]), BOTH_WAYS)
    if timing.run_in_m > LONGEST_RUN_IN_M:
        return math.inf
    transit = timing.transit
    way_s = transit.leg_s(0.0, 0.0, altitude_m)
    ways_s = 2.0 * way_s + _there_and_back_s(transit, away_m)
    back_s = _quicker_s(transit, lattice.way_back_m) if not away_m else 0.0
    work_s, turn_s = _work_s(timing, lattice)
    whole_s = work_s + ways_s + back_s
    battery_s = math.inf if flight.flight_time_min is None else 60.0 * flight.flight_time_min
    if whole_s <= battery_s:
        return whole_s
    if battery_s <= ways_s:
        return math.inf
    # Each additional flight saves one path between lines and adds the path there and back.
    flights = max(math.ceil((work_s + turn_s) / (battery_s - ways_s + turn_s) - 1e-9), 2)
    return work_s - (flights - 1) * turn_s + flights * ways_s


def _work_s(timing: Timing, lattice: FlownLines) -> tuple[float, float]:
    """Time from the first waypoint to the last, and of one way between lines."""
    sites, lines, (x_m, y_m), _ = lattice
    if not timing.fly_through:
        along_s, across_s = _quicker_s(timing, x_m), _quicker_s(timing, 0.0, y_m)
        legs_s = (sites - lines) * along_s + (lines - 1) * across_s
        return sites * timing.hold_s + legs_s, max(along_s, across_s)
    turn_s = _quicker_s(timing.transit, 0.0, y_m)
    ramp_s = timing.run_in_m / timing.speed_mps + 0.5 * timing.speed_mps / timing.acceleration_mps2
    lines_s = (sites - lines) * x_m / timing.speed_mps + 2.0 * lines * ramp_s
    return lines_s + (lines - 1) * turn_s, turn_s


def _quicker_s(timing: Timing, x_m: float, y_m: float = 0.0) -> float:
    """Time of a leg in the quicker of its two directions."""
    return min(timing.leg_s(x_m, y_m), timing.leg_s(-x_m, -y_m))


def _there_and_back_s(timing: Timing, away_m: float) -> float:
    """Time of a level path there and back in calm air; with wind it is longer."""
    return 2.0 * timing._replace(wind=(0.0, 0.0)).leg_s(away_m)
