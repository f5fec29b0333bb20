"""Flights with one battery each: tests of their sites, and of the paths from the take-off point and
back.
"""

import json
import math
from itertools import pairwise

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from aosplan.errors import InfeasibleError, RequestError
from aosplan.flight.batteries import TakeoffPoint, flights_of
from aosplan.flight.kinematics import Timing
from aosplan.flight.track import Track
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.planning.saved_plan import read_mission, read_missions

LINZ = (48.3358, 14.3261)


def photos(waypoints):
    return [(w.east_m, w.north_m) for w in waypoints if w.photo]


requests = st.fixed_dictionaries(
    {
        "altitude": st.floats(30.0, 60.0),
        "samples": st.integers(1, 90),
        "baseline": st.floats(0.5, 8.0),
        "grid": st.sampled_from(["trimmed", "square", "line", "lanes"]),
        "trigger": st.sampled_from(["stop", "distance"]),
        "flight_time": st.floats(0.9, 4.0),
        "heading": st.sampled_from([0.0, 33.0, 250.0]),
        "takeoff": st.sampled_from([None, (48.3362, 14.3259)]),
        "wind_speed": st.sampled_from([None, 6.0]),
    }
)


def planned(values):
    wind = {"wind_from": 200.0} if values.get("wind_speed") else {}
    return plan(PlanRequest(**values, **wind, origin=LINZ))


@settings(max_examples=40)
@given(values=requests)
def test_flights_contain_every_site_once_and_fit_the_battery(values):
    try:
        split = planned(values)
    except InfeasibleError:
        assume(False)
    whole = planned(values | {"flight_time": None})
    flights, missions = split.route.flights, split.missions()
    # Each waypoint belongs to one flight, and each site to one flight, in order.
    assert flights[0].first == 0
    assert flights[-1].last == len(split.waypoints) - 1
    assert all(other.first == one.last + 1 for one, other in pairwise(flights))
    assert photos(split.waypoints) == photos(whole.waypoints)
    assert [place for mission in missions for place in photos(mission.waypoints)] == photos(
        whole.waypoints
    )
    assert sum(flight.samples for flight in flights) == len(photos(whole.waypoints))
    assert [(mission.flight, mission.flights) for mission in missions] == [
        (number, len(flights)) for number in range(1, len(flights) + 1)
    ]
    for flight, mission in zip(flights, missions, strict=True):
        # Times are sums with a rounding error for each leg.
        assert flight.time_s <= 60.0 * values["flight_time"] * (1.0 + 1e-12)
        assert len(photos(mission.waypoints)) == flight.samples >= 1
    # Each flight takes the same time as if it were the only flight, from take-off to landing.
    for flight, mission in zip(flights, missions, strict=True):
        ways = mission.waypoints
        track = Track(
            ways.east_m,
            ways.north_m,
            ways.altitude_m,
            ways.photo or [True] * len(ways),
        )
        (alone,) = flights_of(track, split.route.timing, home_of(whole))
        assert alone.time_s == pytest.approx(flight.time_s, rel=1e-9)
        assert alone.length_m == pytest.approx(flight.length_m, rel=1e-9)


def home_of(result):
    if result.request.takeoff is None:
        first = result.waypoints[0]
        return TakeoffPoint(first.east_m, first.north_m, 0.0)
    latitude, longitude = result.request.takeoff
    # This conversion uses the radii of curvature of WGS 84. It is accurate to a millimetre over
    # some tens of metres.
    from pyproj import Geod

    azimuth, _, distance = Geod(ellps="WGS84").inv(LINZ[1], LINZ[0], longitude, latitude)
    turn = math.radians(azimuth)
    return TakeoffPoint(distance * math.sin(turn), distance * math.cos(turn), 0.0)


@settings(max_examples=30)
@given(values=requests)
def test_each_flight_is_too_full_for_the_next_site(values):
    try:
        split = planned(values)
    except InfeasibleError:
        assume(False)
    missions, timing, home = split.missions(), split.route.timing, home_of(split)
    for mission, following in pairwise(missions):
        # With the next site, the flight would be too long. If lines are flown without stops, it
        # would be too long with the next line.
        ways = list(mission.waypoints) + list(following.waypoints)
        count = len(mission.waypoints)
        part = next(
            place
            for place, waypoint in enumerate(ways)
            if place > count + (timing.fly_through) - 1
            and (waypoint.photo if not timing.fly_through else not waypoint.photo)
            and (not timing.fly_through or place > count)
        )
        more = ways[: part + 1]
        track = Track(
            [w.east_m for w in more],
            [w.north_m for w in more],
            [w.altitude_m for w in more],
            [w.photo for w in more],
        )
        (longer,) = flights_of(track, timing, home)
        assert longer.time_s > 60.0 * values["flight_time"]


def test_transit_times_agree_with_a_calculation_by_hand():
    # The flight is 30 m up, 40 m to the site, one photo, and back. 40 m take 10.5 s at 5 m/s and 2
    # m/s², and 30 m take 11.5 s at 3 m/s.
    track = Track([0.0], [40.0], [30.0], [True])
    (flight,) = flights_of(track, Timing(5.0, 2.0, 1.5, 3.0), TakeoffPoint(0.0, 0.0, 0.0))
    assert flight.time_s == pytest.approx(2 * (10.5 + 11.5) + 1.5)
    assert flight.length_m == pytest.approx(140.0)


def test_headwind_slows_the_transit_and_tailwind_does_not_speed_it_up():
    track = Track([0.0], [400.0], [30.0], [True])
    timing, home = Timing(5.0, 2.0, 0.0, 3.0), TakeoffPoint(0.0, 0.0, 0.0)
    (calm,) = flights_of(track, timing, home)
    # Against the wind, the ground speed is 15 - 13 = 2 m/s. With the wind, the autopilot keeps 5
    # m/s.
    (windy,) = flights_of(track, timing._replace(wind=(0.0, -13.0), airspeed_mps=15.0), home)
    assert windy.time_s - calm.time_s == pytest.approx((200.0 + 1.0) - (80.0 + 2.5))


def test_the_error_for_an_unreachable_site_gives_its_flight_time():
    with pytest.raises(
        InfeasibleError, match=r"at waypoint 49\) and back takes 0\.[0-9]+ min"
    ) as caught:
        plan(PlanRequest(altitude=40, flight_time=0.2))
    needed = float(caught.value.message.split("takes ")[1].split()[0])
    assert plan(PlanRequest(altitude=40, flight_time=needed * 1.01)).route.flights


def test_total_time_is_that_of_all_flights():
    document = plan(PlanRequest(altitude=40, flight_time=1.5)).document()["flight"]
    assert len(document["flights"]) > 1
    assert document["total_time_s"] == pytest.approx(
        sum(flight["time_s"] for flight in document["flights"])
    )
    one = plan(PlanRequest(altitude=40)).document()["flight"]
    assert len(one["flights"]) == 1
    assert one["total_time_s"] > one["time_s"]


# Resuming a flight


@pytest.mark.parametrize("trigger", ["stop", "distance"])
@pytest.mark.parametrize("at", [0, 1, 5, 17, 30, 48])
def test_a_resumed_plan_takes_the_remaining_photos(trigger, at):
    values = {"altitude": 40, "trigger": trigger, "heading": 20}
    whole, resumed = (plan(PlanRequest(**values, resume_at=k)) for k in (None, at))
    left = [w for w in whole.waypoints if w.photo and w.index >= at]
    assert photos(resumed.waypoints) == photos(left)
    assert resumed.waypoints[0].index == 0
    assert resumed.solution == whole.solution
    assert resumed.route.takeoff_ground_m is None
    if trigger == "distance":
        assert not resumed.waypoints[0].photo  # The resumed flight starts with a run-in.


def test_every_flight_resumes_where_the_one_before_ended():
    values = {"altitude": 40, "flight_time": 1.5, "origin": LINZ}
    missions = plan(PlanRequest(**values)).missions()
    assert len(missions) > 2
    done = 0
    for mission, following in pairwise(missions):
        done += len(mission.waypoints)
        resumed = plan(PlanRequest(**values, resume_at=done)).missions()
        assert resumed[0].waypoints == following.waypoints


# Saved plans


@pytest.mark.parametrize("trigger", ["stop", "distance"])
def test_a_saved_plan_has_the_same_flights(tmp_path, trigger):
    request = PlanRequest(altitude=40, flight_time=1.5, trigger=trigger, origin=LINZ, heading=70)
    result = plan(request)
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(result.document()))
    saved = read_missions(str(path))
    assert len(saved) == len(result.missions()) > 1
    for one, other in zip(saved, result.missions(), strict=True):
        assert one.waypoints == other.waypoints
        assert one.settings == other.settings
        assert (one.flight, one.flights) == (other.flight, other.flights)
    assert read_mission(str(path)).waypoints == result.waypoints


def test_a_saved_plan_whose_flights_lose_a_site_is_refused(tmp_path):
    document = plan(PlanRequest(altitude=40, flight_time=1.5)).document()
    path = tmp_path / "plan.json"
    flights = document["flight"]["flights"]
    for broken in (flights[1:], flights[:1], [*flights, flights[0]], []):
        document["flight"]["flights"] = broken
        path.write_text(json.dumps(document))
        with pytest.raises(RequestError, match="do not contain each waypoint exactly once"):
            read_missions(str(path))
    del document["flight"]["flights"]
    path.write_text(json.dumps(document))
    assert len(read_missions(str(path))) == 1
