"""Calls as users write them, checked by mypy and pyright but not run."""

from typing import Any, assert_type

from matplotlib.axes import Axes

import aosplan
from aosplan.mission.mission import Waypoint, Waypoints


def usage() -> None:
    """All functions and the types of their results."""
    found = aosplan.plan(altitude=40, vhat="98%", origin=(48.3, 14.3))
    assert_type(found, aosplan.Plan)
    assert_type(aosplan.plan(aosplan.PlanRequest(altitude=40)), aosplan.Plan)
    assert_type(aosplan.plan("request.toml", grid="lanes"), aosplan.Plan)
    assert_type(found.waypoints, Waypoints)
    assert_type(found.waypoints[0], Waypoint)
    assert_type(found.solution.baseline_m, float)
    assert_type(found.__geo_interface__, dict[str, Any])
    assert_type(aosplan.export(found, "grid.csv"), list[str])

    stand = aosplan.read_scene("stand.laz", voxel=0.5)
    assert_type(stand, aosplan.Stand)
    aosplan.plan(altitude=40, scene=stand)

    assert_type(aosplan.simulate(found, seed=7), aosplan.Simulation)
    assert_type(aosplan.simulate(altitude=40).agree, bool)
    assert_type(aosplan.tradeoff(found).columns(), dict[str, list[Any]])
    assert_type(aosplan.sweep({"altitude": [30, 40]}), aosplan.Sweep)
    assert_type(aosplan.sweep("campaign.toml").plot(x="samples", y="flight_time_s"), Axes)
    assert_type(aosplan.review("flown.csv", found).missing, list[int])
    assert_type(aosplan.thin("flown.csv", keep=20, altitude=40).chosen, list[int])
    assert_type(aosplan.integrate("photos", fov_deg=50.8), aosplan.Integral)

    assert_type(aosplan.paper_figure("2b", seed=7), aosplan.PaperFigure)

    aosplan.plan(altitude=[40])  # type: ignore[arg-type]
    aosplan.plan(altidude=40)  # type: ignore[call-arg]
