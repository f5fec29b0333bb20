"""The flight that takes missing photos: all missing photos, or as many as a given time allows."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import InfeasibleError
from aosplan.flight.track import FlightPoints
from aosplan.messages import Message
from aosplan.planning.plan_warnings import with_warnings
from aosplan.planning.sites import route_of, ways_in_zones
from aosplan.planning.within_shapes import last_number
from aosplan.postflight.views import along_heading

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.planning.result import Plan

STARTS = 12
"""Largest number of sites that are tried as the start of a part of the path."""


class TopUp(NamedTuple):
    """A flight that takes missing photos.

    Attributes
    ----------
    plan
        The plan with the path of this flight.
    sites
        Waypoints of the plan that the flight visits, in increasing order.
    wanted, all_s
        Number of all requested sites, and the time of a flight to all of them.
    """

    plan: Plan
    sites: list[int]
    wanted: int
    all_s: float

    def messages(self, longest_s: float) -> list[Message]:
        """Messages to the user about the flight."""
        found = [*self.plan.notices]
        if len(self.sites) < self.wanted:
            text = (
                f"the top-up takes {len(self.sites)} of {self.wanted} missing photos within "
                f"{longest_s / 60.0:.4g} min; all missing photos would take "
                f"{self.all_s / 60.0:.1f} min"
            )
            found.append(Message("topup_is_part", text))
        return found


def topup_within(
    planned: Plan, sites: list[int], gains: NDArray[np.float64], longest_s: float = math.inf
) -> TopUp:
    """The top-up with the largest gain that takes at most a given time.

    The candidates are contiguous parts of the fastest path through all sites.

    Parameters
    ----------
    planned
        The plan.
    sites
        Waypoints without a photo, in increasing order.
    gains
        Value of a photo at each of these waypoints.
    longest_s
        Longest time from take-off to landing.

    Raises
    ------
    InfeasibleError
        If even the flight to a single site takes longer.
    """
    whole, order = _fastest(planned, sites)
    all_s = whole.route.total_time_s
    if all_s <= longest_s:
        return TopUp(whole, sites, len(sites), all_s)
    gain_of = dict(zip(sites, gains.tolist(), strict=True))

    def number_from(start: int) -> int:
        """The largest number of consecutive sites, beginning with a start site, that can be flown
        within the given time.
        """
        return last_number(
            len(order) - start,
            lambda count: _time_s(planned, order[start : start + count]) <= longest_s,
        )

    starts = np.unique(np.linspace(0, len(order) - 1, STARTS).astype(int)).tolist()
    parts = [order[start : start + number_from(start)] for start in starts]
    part = sorted(max(parts, key=lambda part: sum(gain_of[site] for site in part)))
    if not part:
        least_s = min(_time_s(planned, [order[start]]) for start in starts)
        raise InfeasibleError(
            f"no missing photo can be taken within {longest_s / 60.0:.4g} min, from take-off to "
            "landing",
            f"--within {math.ceil(least_s / 6.0) / 10.0:g} is enough for one of them",
        )
    return TopUp(_fastest(planned, part)[0], part, len(sites), all_s)


def _time_s(planned: Plan, sites: list[int]) -> float:
    """Time of the flight to some sites in their order, from take-off to landing."""
    return _topup(planned, sites).route.total_time_s


def _fastest(planned: Plan, sites: list[int]) -> tuple[Plan, list[int]]:
    """The fastest path through some sites, and the sites in its order."""
    usual = _topup(planned, sites)
    survey = planned.layout.survey
    if survey is None or len(sites) < 3:
        return usual, sites
    order = _toured(planned, sites, survey.pitch_m)
    own = _topup(planned, order)
    is_faster = own.route.total_time_s < usual.route.total_time_s
    return (own, order) if is_faster else (usual, sites)


def _toured(planned: Plan, sites: list[int], pitch_m: tuple[float, float]) -> list[int]:
    """Sites of a lattice in the order of a new tour."""
    import shapely

    from aosplan.areas.no_fly import NoFlyZones
    from aosplan.areas.tour import tour_of

    ways, heading = planned.waypoints, planned.heading_deg
    points = along_heading(
        [ways.east_m[index] for index in sites], [ways.north_m[index] for index in sites], heading
    )
    column, row = np.rint((points - points.min(axis=0)) / pitch_m).astype(np.int64).T
    stride = int(column.max()) + 2
    order = np.argsort(row * stride + column)
    assert planned.layout.area is not None  # A plan with a survey has an area.
    zones = shapely.transform(
        planned.layout.area.keep_out, lambda each: along_heading(each[:, 0], each[:, 1], heading)
    )
    tour = tour_of(
        (row * stride + column)[order],
        stride,
        points[order],
        planned.route.timing,
        NoFlyZones(zones),
    )
    return [sites[place] for place in order[tour.order].tolist()]


def _topup(planned: Plan, missing: list[int]) -> Plan:
    """The plan with a path through the missing sites only, in their order, from the take-off point
    of the plan.
    """
    ways, inputs = planned.waypoints, planned.inputs
    if planned.route.takeoff is not None:
        inputs = inputs._replace(flight=inputs.flight._replace(takeoff=planned.route.takeoff))
    points = np.array([(ways.east_m[index], ways.north_m[index]) for index in missing])
    taken = [True] * len(missing)
    if inputs.area is not None and not inputs.area.keep_out.is_empty:
        from aosplan.areas.no_fly import NoFlyZones
        from aosplan.areas.survey import routed

        points, taken = routed(points, NoFlyZones(inputs.area.keep_out))
    sites = FlightPoints(points[:, 0].tolist(), points[:, 1].tolist(), taken)
    layout = planned.layout._replace(sites=sites)
    route = route_of(inputs, layout, planned.solution.baseline_m)
    warnings = tuple(ways_in_zones(inputs, route))
    return with_warnings(replace(planned, route=route, notices=warnings))
