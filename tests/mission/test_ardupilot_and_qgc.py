"""Files for QGroundControl and Mission Planner, checked with the rules of these programs."""

import json
import re

import pytest
from hypothesis import given, settings
from support.flights import commands_of, documents_of, grid, missions, plan_of, texts, written

from aosplan.errors import RequestError

# QGroundControl: the rules of its own loader (PlanMasterController, MissionController, MissionItem,
# SimpleMissionItem, GeoFenceController, RallyPointController, JsonHelper)

NUMBER, TEXT, LIST, TABLE, YES_NO = (int, float), str, list, dict, bool


def check_keys(table, keys):
    """JsonHelper::validateKeys: required keys with their types; null is allowed for numbers."""
    for name, kind in keys.items():
        assert name in table, name
        if table[name] is None:
            assert kind is NUMBER, name
        else:
            assert isinstance(table[name], kind), name
            assert (kind is YES_NO) == isinstance(table[name], bool), name


def check_plan(plan):
    check_keys(plan, {"fileType": TEXT, "version": NUMBER, "groundStation": TEXT})
    assert (plan["fileType"], plan["version"]) == ("Plan", 1)
    check_keys(plan, {"mission": TABLE, "geoFence": TABLE, "rallyPoints": TABLE})
    check_keys(plan["geoFence"], {"version": NUMBER, "circles": LIST, "polygons": LIST})
    check_keys(plan["rallyPoints"], {"version": NUMBER, "points": LIST})
    assert plan["geoFence"]["version"] == plan["rallyPoints"]["version"] == 2
    mission = plan["mission"]
    kinds = {"plannedHomePosition": LIST, "items": LIST, "firmwareType": NUMBER}
    kinds |= {"vehicleType": NUMBER, "cruiseSpeed": NUMBER, "hoverSpeed": NUMBER, "version": NUMBER}
    check_keys(mission, kinds | {"globalPlanAltitudeMode": NUMBER})
    assert mission["version"] == 2
    assert mission["vehicleType"] == 2
    assert len(mission["plannedHomePosition"]) == 3
    for number, item in enumerate(mission["items"], 1):
        check_keys(item, {"type": TEXT, "frame": NUMBER, "command": NUMBER, "params": LIST})
        check_keys(item, {"autoContinue": YES_NO, "doJumpId": NUMBER})
        assert item["type"] == "SimpleItem"
        assert item["doJumpId"] == number
        assert len(item["params"]) == 7
        for param in item["params"][:4]:
            assert param is None or isinstance(param, NUMBER)
        heights = {"AltitudeMode", "Altitude", "AMSLAltAboveTerrain"} & set(item)
        if item["command"] in {16, 22}:
            assert len(heights) == 3
            check_keys(item, dict.fromkeys(heights, NUMBER))
            assert item["AltitudeMode"] == {3: 1, 10: 4}[item["frame"]]
            assert item["Altitude"] == item["params"][6]
        else:
            assert not heights
            assert item["frame"] == 2


@given(mission=missions)
@settings(max_examples=25)
def test_plans_follow_the_rules_of_qgroundcontrol(mission):
    for autopilot, number in (("px4", 12), ("ardupilot", 3)):
        flown = mission._replace(settings=mission.settings._replace(autopilot=autopilot))
        content = written(flown, "plan").decode()
        assert "NaN" not in content
        plan = json.loads(content)
        check_plan(plan)
        assert plan["mission"]["firmwareType"] == number
        codes = [item["command"] for item in plan["mission"]["items"]]
        assert codes[:3] == [22, 178, 205]
        assert codes[-1] == 20
        # PX4 uses command 2000. ArduPilot uses 203, because it refuses 2000 before version 4.4.
        assert ({203, 2000} & set(codes)) <= {203 if autopilot == "ardupilot" else 2000}
        wired = flown._replace(settings=flown.settings._replace(camera_control="outputs"))
        wired_items = plan_of(wired)["mission"]["items"]
        assert 2000 not in {item["command"] for item in wired_items}


@pytest.mark.parametrize("yaw", [-30.0, 330.0, 1050.0, -1e6 * 360.0 - 30.0])
def test_headings_are_those_of_a_compass(yaw):
    mission = grid()._replace(settings=grid().settings._replace(yaw_deg=yaw))
    rows = commands_of(written(mission, "waypoints").decode())
    assert {row[4] for row in rows if row[3] == 115} == {330.0}
    items = plan_of(mission)["mission"]["items"]
    assert {item["params"][3] for item in items if item["command"] == 16} == {330.0}


def test_px4_reaches_each_site_with_its_nose_along_the_heading():
    for item in plan_of(grid(heading_deg=-30.0))["mission"]["items"]:
        if item["command"] == 16:
            assert item["params"][1:4] == [0.5, 0.0, 330.0]


def test_ardupilot_files_set_the_yaw_before_each_site():
    rows = commands_of(written(grid(heading_deg=-30.0), "waypoints").decode())
    sites = [place for place, row in enumerate(rows) if row[3] == 16][1:]
    assert all(rows[place - 1][3:5] == [115, 330.0] for place in sites)


@given(mission=missions)
@settings(max_examples=25)
def test_waypoint_files_follow_the_rules_of_mission_planner(mission):
    content = written(mission, "waypoints")
    assert content.isascii()
    assert content.endswith(b"\n")
    assert not content.endswith(b"\n\n")
    assert b" " not in content.partition(b"\n")[2]
    assert re.fullmatch(rb"QGC WPL 110\n(\d+\t[01]\t\d+\t\d+(\t-?\d+\.\d{8}){7}\t1\n)+", content)
    rows = commands_of(content.decode())
    assert [row[0] for row in rows] == list(range(len(rows)))
    assert [row[1] for row in rows] == [1, *[0] * (len(rows) - 1)]
    assert rows[0][2:4] == [0, 16]
    assert [row[3] for row in rows[1:4]] == [22, 178, 205]
    assert rows[2][4:7] == [1, mission.settings.speed_mps, -1]
    assert (rows[3][4], rows[3][10]) == (-90, 2)
    assert rows[-1][3] == 20


def test_home_is_the_take_off_and_the_climb_reaches_the_highest_site():
    ground = [200.0 + 3.0 * index for index in range(12)]
    place = {"takeoff_latitude": 48.0, "takeoff_longitude": 14.0, "takeoff_ground_m": 190.0}
    mission = grid(ground_m=ground, **place)
    rows = commands_of(written(mission, "waypoints").decode())
    assert rows[0][8:11] == [48.0, 14.0, 190.0]
    assert rows[1][8:11] == [48.0, 14.0, 83.0]
    assert plan_of(mission)["mission"]["plannedHomePosition"] == [48.0, 14.0, 190.0]
    (template, waylines) = documents_of(written(mission, "kmz")).values()
    # The element is optional, and its height would have to be above the ellipsoid.
    assert texts(template, "takeOffRefPoint") == []
    ellipsoidal = grid(ground_m=ground, **place, height_datum="ellipsoid")
    (template, _) = documents_of(written(ellipsoidal, "kmz")).values()
    assert texts(template, "takeOffRefPoint") == ["48.0000000000,14.0000000000,190.00"]
    assert texts(waylines, "takeOffSecurityHeight") == ["83.0000"]
    assert texts(waylines, "globalRTHHeight") == ["83.0000"]


def test_waypoint_files_are_not_for_px4():
    with pytest.raises(RequestError) as caught:
        written(grid(autopilot="px4"), "waypoints")
    assert "px4" in caught.value.message
    assert ".plan" in caught.value.hint


def test_files_for_another_autopilot_than_the_drones_are_refused():
    for name, autopilot in (
        ("plan", "dji"),
        ("waypoints", "dji"),
        ("kmz", "px4"),
        ("litchi", "ardupilot"),
    ):
        with pytest.raises(RequestError, match="cannot be used for"):
            written(grid(autopilot=autopilot), name)


def test_heights_above_the_terrain_are_refused_for_px4():
    with pytest.raises(RequestError, match="does not accept heights above terrain"):
        plan_of(grid(altitude_frame="terrain", autopilot="px4"))


@pytest.mark.parametrize(
    ("autopilot", "hold", "hint"),
    [("ardupilot", 0.0, "--hold 1"), ("ardupilot", 1.5, "--hold 2"), ("px4", 0.0, "--hold 0.2")],
)
def test_holds_that_an_autopilot_ignores_are_refused(autopilot, hold, hint):
    with pytest.raises(RequestError) as caught:
        plan_of(grid(autopilot=autopilot, hold_s=hold))
    assert caught.value.hint.startswith(f"give {hint}")


def test_zeros_are_moved_by_a_centimetre_for_arducopter():
    mission = grid(1, origin=(0.0, 0.0), altitude_m=0.0, baseline_m=0.0)
    rows = commands_of(written(mission, "waypoints").decode())
    assert [row[8:11] for row in rows[1:] if row[3] == 16][1] == [1e-7, 0.0, 0.01]
