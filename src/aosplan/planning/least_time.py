"""A lower bound of the time of a flight, in closed form, for searches.

Without no-fly zones and terrain, no flight over an area takes less time than `least_time_s`.  For a
grid at one place, the result is the time of the flight itself.
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
"""The two directions in which lines are flown, along the heading and opposite to it, as vectors
(along, across).
"""


class FlownLines(NamedTuple):
    """Sites on lines along the heading.

    Attributes
    ----------
    sites, lines
        Number of photos, and number of lines.
    pitch_m
        Distance between photos along a line, and distance between lines.
    way_back_m
        Horizontal distance from the last site back to the first; 0 if it is not known.
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
    """Shortest possible total time of all flights over a lattice, from take-off to landing.

    Parameters
    ----------
    flight
        Settings of the flight, including the flight time of a battery.
    lattice
        The sites.
    heading_deg
        Direction of the lines, clockwise from true north.  It has an effect only with wind.
    altitude_m
        Height of the sites above the take-off point.
    away_m
        Smallest horizontal distance between the take-off point and any site.

    Returns
    -------
    float
        Time [s].  It is infinite if the run-in for the speed is too long, or if a battery is not
        enough for the path to the sites and back.
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
    # Each additional flight replaces one path between lines by one path back and one path to the
    # sites.
    flights = max(math.ceil((work_s + turn_s) / (battery_s - ways_s + turn_s) - 1e-9), 2)
    return work_s - (flights - 1) * turn_s + flights * ways_s


def _work_s(timing: Timing, lattice: FlownLines) -> tuple[float, float]:
    """Time from the first waypoint to the last, and time of one path between lines."""
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
    """Time of a leg in the faster one of its two directions."""
    return min(timing.leg_s(x_m, y_m), timing.leg_s(-x_m, -y_m))


def _there_and_back_s(timing: Timing, away_m: float) -> float:
    """Time of a horizontal path to the sites and back without wind.  With wind, it takes longer."""
    return 2.0 * timing._replace(wind=(0.0, 0.0)).leg_s(away_m)
