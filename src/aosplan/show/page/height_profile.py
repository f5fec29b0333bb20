"""Height profile of a path over terrain: ground, top of the canopy and flight."""

from __future__ import annotations

from itertools import accumulate, pairwise
from math import dist
from typing import TYPE_CHECKING, NamedTuple

from aosplan.show.page.charts import APART, BOTTOM, LEFT, RIGHT, TOP, Tick, scale, ticks

if TYPE_CHECKING:
    from aosplan.planning.result import Plan

MOST = 400
"""Largest number of waypoints that are drawn. If there are more waypoints, only every n-th waypoint
and the last waypoint are drawn.
"""


class Profile(NamedTuple):
    """A profile ready to be drawn.

    Each of the `lines` has a name, points in the format of SVG, and the height of its label.
    `ground` is the outline of the area below the ground line.
    """

    title: str
    summary: str
    x_ticks: list[Tick]
    y_ticks: list[Tick]
    lines: list[tuple[str, str, float]]
    ground: str


def profile_of(plan: Plan) -> Profile | None:
    """The profile of a plan; None if the height of the ground is not known."""
    ways, route = plan.waypoints, plan.route
    if ways.ground_m is None:
        return None
    places = list(zip(ways.east_m, ways.north_m, strict=True))
    along = list(accumulate((dist(*pair) for pair in pairwise(places)), initial=0.0))
    step = -(-len(places) // MOST)
    drawn = sorted({*range(0, len(places), step), len(places) - 1})
    ground = [ways.ground_m[place] for place in drawn]
    flown = [ways.ground_m[place] + ways.altitude_m[place] for place in drawn]
    canopy = [height + plan.scene.canopy_top_m for height in ground]
    low, high = min(ways.ground_m), max(flown)
    low -= 0.08 * (high - low)
    end = along[-1] or 1.0
    x, y = scale(end, LEFT, RIGHT), scale(high - low, BOTTOM, TOP)

    def path(heights: list[float]) -> str:
        return " ".join(
            f"{x(along[place]):.1f},{y(height - low):.1f}"
            for place, height in zip(drawn, heights, strict=True)
        )

    labels: list[tuple[str, str, float]] = []
    for name, heights in (("flight", flown), ("canopy", canopy), ("ground", ground)):
        least = labels[-1][2] + APART if labels else TOP
        labels.append((name, path(heights), max(y(heights[-1] - low), least)))
    return Profile(
        title=f"Heights above {route.datum} [m], by distance along the path [m]",
        summary=(
            f"The ground at the waypoints lies between {min(ways.ground_m):.1f} and "
            f"{max(ways.ground_m):.1f} m. The canopy's top is {plan.scene.canopy_top_m:.1f} m "
            f"above the ground, and the flight is {min(ways.altitude_m):.1f} m above the ground."
        ),
        x_ticks=[Tick(x(value), f"{value:,.4g}") for value in ticks(0.0, end)],
        y_ticks=[Tick(y(value - low), f"{value:,.5g}") for value in ticks(low, high)],
        lines=labels,
        ground=f"{LEFT},{BOTTOM} {path(ground)} {x(along[drawn[-1]]):.1f},{BOTTOM}",
    )
