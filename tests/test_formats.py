"""Every format: the same sites in the same order, the rules of its readers, and its limits."""

import itertools
import json
import re
import zipfile
from io import BytesIO

import pytest
from flights import KML, READERS, WPML, commands_of, documents_of, grid, missions, positions_of
from hypothesis import given, settings

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.export import files, formats, render
from aosplan.limits import Limits, limits_of, parts
from aosplan.mission import Mission, Waypoints, photo_lines
from aosplan.presets.dji import DRONES, PAYLOADS


def written(mission, name):
    return render(mission, formats()[name])


def plan_of(mission):
    return json.loads(written(mission, "qgc_plan"))


def texts(element, name):
    return [found.text for found in element.iter(WPML + name)]


# One mission, every format


def test_every_format_has_a_reader_here():
    assert set(READERS) == set(formats())


@given(mission=missions)
@settings(max_examples=60)
def test_the_same_sites_in_the_same_order_in_every_format(mission):
    ways = mission.waypoints
    for name, form in formats().items():
        found = positions_of(name, files([mission], form, "grid").values())
        assert len(found) == len(ways)
        for place, waypoint in zip(found, ways, strict=True):
            assert abs(place[0] - waypoint.latitude) <= 1e-7
            assert abs(place[1] - waypoint.longitude) <= 1e-7
            assert abs(place[2] - waypoint.altitude_m) <= 1e-3


@given(mission=missions)
@settings(max_examples=20)
def test_the_same_mission_gives_the_same_bytes(mission):
    for form in formats().values():
        assert render(mission, form) == render(mission, form)


@pytest.mark.parametrize("name", READERS)
def test_heights_count_from_the_take_off_where_the_ground_is_known(name):
    ground = [200.0 + 3.0 * index for index in range(12)]
    mission = grid(ground_m=ground, takeoff_ground_m=190.0)
    above_ground = name in {"csv", "geojson", "kml"}
    heights = [place[2] for place in positions_of(name, [written(mission, name)])]
    expected = [40.0 if above_ground else 40.0 + up - 190.0 for up in ground]
    assert heights == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("name", ["waypoints", "qgc_plan", "litchi"])
def test_a_terrain_frame_leaves_the_ground_to_the_autopilot(name):
    ground = [200.0 + 3.0 * index for index in range(12)]
    mission = grid(ground_m=ground, takeoff_ground_m=190.0, altitude_frame="terrain")
    content = written(mission, name)
    assert [place[2] for place in positions_of(name, [content])] == [40.0] * 12
    if name == "litchi":
        assert {line.split(b",")[38] for line in content.splitlines()[1:]} == {b"1"}
    else:
        frames = (
            [row[2] for row in commands_of(content.decode()) if row[3] == 16][1:]
            if name == "waypoints"
            else [i["frame"] for i in json.loads(content)["mission"]["items"] if i["command"] == 16]
        )
        assert frames == [10] * 12


def test_wpml_has_no_terrain_frame():
    with pytest.raises(RequestError, match="no height above the ground"):
        written(grid(altitude_frame="terrain"), "wpml")


# Photos


@pytest.mark.parametrize("photo", [None, [index % 4 != 3 for index in range(12)]])
def test_stopping_takes_one_photo_at_each_site_after_its_hold(photo):
    values = {"hold_s": 1.25} | ({} if photo is None else {"photo": photo})
    mission = grid(**values)
    shot = photo or [True] * 12
    rows = commands_of(written(mission, "waypoints").decode())
    sites = [place for place, row in enumerate(rows) if row[3] == 16][1:]
    assert [rows[place + 1][3] == 203 for place in sites] == shot
    assert all(rows[place + 1][8] == 1 for place, yes in zip(sites, shot, strict=True) if yes)
    # ArduPilot keeps whole seconds of a hold.
    assert [rows[place][4] for place in sites] == [2.0 if yes else 0.0 for yes in shot]
    items = plan_of(mission)["mission"]["items"]
    places = [place for place, item in enumerate(items) if item["command"] == 16]
    assert [items[place + 1]["command"] == 2000 for place in places] == shot
    assert [items[place]["params"][0] for place in places] == [1.25 if yes else 0.0 for yes in shot]
    waylines = documents_of(written(mission, "wpml"))["waylines.wpml"]
    marks = list(waylines.iter(f"{KML}Placemark"))
    assert [
        texts(mark, "actionActuatorFunc")[-2:] == ["hover", "takePhoto"] for mark in marks
    ] == shot
    assert set(texts(waylines, "hoverTime")) == {"1.250"}
    for line, yes in zip(written(mission, "litchi").decode().splitlines()[1:], shot, strict=True):
        pairs = line.split(",")[8:38]
        assert pairs[:6] == (
            ["5", "-90", "0", "1250", "1", "0"] if yes else ["5", "-90", *["-1", "0"] * 2]
        )


def test_a_distance_trigger_is_on_along_lines_and_off_between_them():
    mission = grid(12, kind="rectangle", trigger="distance", baseline_m=2.5)  # 3 rows of 4
    assert photo_lines(mission) == [(0, 3), (4, 7), (8, 11)]
    rows = commands_of(written(mission, "waypoints").decode())
    switches = [(row[4], row[6]) for row in rows if row[3] == 206]
    assert switches == [(2.5, 1.0), (0.0, 0.0)] * 3
    # Where nothing runs out beyond a line, its last photo is one of its own.
    assert [row[3] for row in rows if row[3] in {203, 206}] == [206, 206, 203] * 3
    items = plan_of(mission)["mission"]["items"]
    assert [item["params"][0] for item in items if item["command"] == 206] == [2.5, 0.0] * 3
    holds = [item["params"][0] for item in items if item["command"] == 16]
    assert holds == [0.0, 0.0, 0.0, 1.0] * 3
    waylines = documents_of(written(mission, "wpml"))["waylines.wpml"]
    groups = [
        (
            texts(g, "actionGroupStartIndex"),
            texts(g, "actionGroupEndIndex"),
            texts(g, "actionTriggerParam"),
        )
        for g in waylines.iter(f"{WPML}actionGroup")
        if "multipleDistance" in texts(g, "actionTriggerType")
    ]
    assert groups == [([str(a)], [str(b)], ["2.500"]) for a, b in photo_lines(mission)]
    intervals = [
        line.split(",")[-1] for line in written(mission, "litchi").decode().splitlines()[1:]
    ]
    assert intervals == ["2.500", "2.500", "2.500", "-1"] * 3


def test_turning_points_take_no_photo_in_flight():
    # Two lines of three with a turning point before and after each.
    east = [0.0, 3.0, 6.0, 9.0, 12.0, 12.0, 9.0, 6.0, 3.0, 0.0]
    north = [0.0] * 5 + [3.0] * 5
    photo = [False, True, True, True, False] * 2
    ways = Waypoints(east, north, [40.0] * 10, east, north, photo=photo)
    mission = grid(trigger="distance")._replace(waypoints=ways)
    assert photo_lines(mission) == [(1, 3), (6, 8)]
    codes = [row[3] for row in commands_of(written(mission, "waypoints").decode())[4:-1]]
    one = [115, 16, 115, 16, 206, 115, 16, 115, 16, 115, 16, 206]
    assert codes == one * 2  # on at the first site, off at the turn beyond the last
    waylines = documents_of(written(mission, "wpml"))["waylines.wpml"]
    stops = ["Stop" in mode for mode in texts(waylines, "waypointTurnMode")]
    assert stops == [True, False, False, False, True] * 2


@given(mission=missions)
@settings(max_examples=60)
def test_every_photo_lies_on_one_line_of_equal_steps(mission):
    ways, spacing = mission.waypoints, mission.conduct.spacing_m
    lines = photo_lines(mission)
    covered = [index for first, last in lines for index in range(first, last + 1)]
    assert covered == list(range(len(ways)))
    for first, last in lines:
        for one, other in itertools.pairwise(range(first, last + 1)):
            step = (ways.east_m[other] - ways.east_m[one], ways.north_m[other] - ways.north_m[one])
            assert (step[0] ** 2 + step[1] ** 2) ** 0.5 == pytest.approx(spacing, rel=0.03)


def test_sites_off_any_line_take_single_photos():
    ways = Waypoints([0.0, 3.0, 9.7, 1.1], [0.0, 0.0, 5.3, 8.8], [40.0] * 4, [0.0] * 4, [0.0] * 4)
    mission = grid(trigger="distance")._replace(waypoints=ways)
    assert photo_lines(mission) == [(0, 1), (2, 2), (3, 3)]
    rows = commands_of(written(mission, "waypoints").decode())
    assert [row[3] for row in rows if row[3] in {203, 206}] == [206, 206, 203, 203, 203]


# QGroundControl: the rules of its own loader (PlanMasterController, MissionController, MissionItem,
# SimpleMissionItem, GeoFenceController, RallyPointController, JsonHelper)

NUMBER, TEXT, LIST, TABLE, YES_NO = (int, float), str, list, dict, bool


def check_keys(table, keys):
    """JsonHelper::validateKeys: keys that must be there, of a type; null stands for a number."""
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
        flown = mission._replace(conduct=mission.conduct._replace(autopilot=autopilot))
        content = written(flown, "qgc_plan").decode()
        assert "NaN" not in content
        plan = json.loads(content)
        check_plan(plan)
        assert plan["mission"]["firmwareType"] == number
        codes = [item["command"] for item in plan["mission"]["items"]]
        assert codes[:3] == [22, 178, 205]
        assert codes[-1] == 20
        # Cameras: 2000 for PX4, and 203 for ArduPilot, which refuses 2000 before 4.4.
        assert ({203, 2000} & set(codes)) <= {203 if autopilot == "ardupilot" else 2000}


@pytest.mark.parametrize("yaw", [-30.0, 330.0, 1050.0, -1e6 * 360.0 - 30.0])
def test_headings_are_those_of_a_compass(yaw):
    mission = grid()._replace(conduct=grid().conduct._replace(yaw_deg=yaw))
    rows = commands_of(written(mission, "waypoints").decode())
    assert {row[4] for row in rows if row[3] == 115} == {330.0}
    items = plan_of(mission)["mission"]["items"]
    assert {item["params"][3] for item in items if item["command"] == 16} == {330.0}


def test_px4_reaches_each_site_with_its_nose_along_the_heading():
    for item in plan_of(grid(heading_deg=-30.0))["mission"]["items"]:
        if item["command"] == 16:
            assert item["params"][1:4] == [0.5, 0.0, 330.0]


def test_ardupilot_is_told_its_heading_before_each_site():
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
    assert rows[2][4:7] == [1, mission.conduct.speed_mps, -1]
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
    (template, waylines) = documents_of(written(mission, "wpml")).values()
    assert texts(template, "takeOffRefPoint") == ["48.0000000000,14.0000000000,190.00"]
    assert texts(waylines, "takeOffSecurityHeight") == ["83.00"]
    assert texts(waylines, "globalRTHHeight") == ["83.00"]


def test_waypoint_files_are_not_for_px4():
    with pytest.raises(RequestError) as caught:
        written(grid(autopilot="px4"), "waypoints")
    assert "px4" in caught.value.message
    assert ".plan" in caught.value.hint


# DJI: the rules of the WPML specification

ENUMS = {
    "flyToWaylineMode": {"safely", "pointToPoint"},
    "finishAction": {"goHome", "noAction", "autoLand", "gotoFirstWaypoint"},
    "exitOnRCLost": {"goContinue", "executeLostAction"},
    "executeRCLostAction": {"goBack", "landing", "hover"},
    "templateType": {"waypoint", "mapping2d", "mapping3d", "mappingStrip"},
    "coordinateMode": {"WGS84"},
    "heightMode": {"EGM96", "relativeToStartPoint", "aboveGroundLevel", "realTimeFollowSurface"},
    "executeHeightMode": {"WGS84", "relativeToStartPoint", "realTimeFollowSurface"},
    "gimbalPitchMode": {"manual", "usePointSetting"},
    "imageFormat": {"wide", "zoom", "ir", "narrow_band", "visible"},
    "waypointHeadingMode": {"followWayline", "manually", "fixed", "smoothTransition", "towardPOI"},
    "waypointHeadingPathMode": {"clockwise", "counterClockwise", "followBadArc"},
    "actionGroupMode": {"sequence"},
    "actionTriggerType": {
        "reachPoint",
        "betweenAdjacentPoints",
        "multipleTiming",
        "multipleDistance",
    },
    "actionActuatorFunc": {"takePhoto", "gimbalRotate", "hover"},
    "gimbalHeadingYawBase": {"north"},
    "gimbalRotateMode": {"relativeAngle", "absoluteAngle"},
}
TURNS = {
    "coordinateTurn",
    "toPointAndStopWithDiscontinuityCurvature",
    "toPointAndStopWithContinuityCurvature",
    "toPointAndPassWithContinuityCurvature",
}
ENUMS |= {"waypointTurnMode": TURNS, "globalWaypointTurnMode": TURNS}
FLAGS = ("use", "globalUse", "gimbalPitchRotateEnable", "gimbalRollRotateEnable")

NEEDED = {
    "missionConfig": "flyToWaylineMode finishAction exitOnRCLost executeRCLostAction "
    "takeOffSecurityHeight globalTransitionalSpeed globalRTHHeight droneInfo payloadInfo",
    "droneInfo": "droneEnumValue droneSubEnumValue",
    "payloadInfo": "payloadEnumValue payloadPositionIndex",
    "waypointHeadingParam": "waypointHeadingMode waypointHeadingAngle waypointHeadingPathMode",
    "globalWaypointHeadingParam": "waypointHeadingMode waypointHeadingAngle waypointHeadingPathMode",
    "waypointTurnParam": "waypointTurnMode waypointTurnDampingDist",
    "waylineCoordinateSysParam": "coordinateMode heightMode",
    "payloadParam": "payloadPositionIndex imageFormat",
    "actionGroup": "actionGroupId actionGroupStartIndex actionGroupEndIndex actionGroupMode "
    "actionTrigger action",
    "action": "actionId actionActuatorFunc actionActuatorFuncParam",
}
PARAMETERS = {
    "takePhoto": "payloadPositionIndex fileSuffix useGlobalPayloadLensIndex",
    "hover": "hoverTime",
    "gimbalRotate": "payloadPositionIndex gimbalHeadingYawBase gimbalRotateMode "
    "gimbalPitchRotateEnable gimbalPitchRotateAngle gimbalRollRotateEnable gimbalRollRotateAngle "
    "gimbalYawRotateEnable gimbalYawRotateAngle gimbalRotateTimeEnable gimbalRotateTime",
}
FOLDER = {
    "template.kml": "templateType templateId waylineCoordinateSysParam autoFlightSpeed "
    "gimbalPitchMode globalHeight globalWaypointHeadingParam globalWaypointTurnMode "
    "globalUseStraightLine payloadParam",
    "waylines.wpml": "templateId waylineId autoFlightSpeed executeHeightMode",
}
PLACEMARK = {
    "template.kml": "index ellipsoidHeight height useGlobalHeight useGlobalSpeed "
    "useGlobalHeadingParam waypointHeadingParam useGlobalTurnParam waypointTurnParam "
    "useStraightLine gimbalPitchAngle",
    "waylines.wpml": "index executeHeight waypointSpeed waypointHeadingParam waypointTurnParam "
    "useStraightLine",
}


def children(element):
    return {child.tag.removeprefix(WPML) for child in element}


def number_of(element, name):
    return float(element.find(WPML + name).text)


def check_document(name, document):
    for element in document.iter():
        tag = element.tag.removeprefix(WPML)
        if tag in ENUMS:
            assert element.text in ENUMS[tag], (tag, element.text)
        elif tag.startswith(FLAGS):
            assert element.text in {"0", "1"}, tag
        assert set(NEEDED.get(tag, "").split()) <= children(element), tag
        if tag == "action":
            function = element.find(f"{WPML}actionActuatorFunc").text
            params = element.find(f"{WPML}actionActuatorFuncParam")
            assert set(PARAMETERS[function].split()) <= children(params)
        if tag == "waypointHeadingAngle":
            assert -180 <= int(element.text) <= 180
        if tag in {"hoverTime", "actionTriggerParam"}:
            assert float(element.text) > 0
    (config,) = document.iter(f"{WPML}missionConfig")
    assert 2 <= number_of(config, "takeOffSecurityHeight") <= 1500
    assert 0 < number_of(config, "globalTransitionalSpeed") <= 15
    (folder,) = document.iter(f"{KML}Folder")
    assert set(FOLDER[name].split()) <= children(folder)
    marks = folder.findall(f"{KML}Placemark")
    assert 2 <= len(marks) <= 65535
    assert [number_of(mark, "index") for mark in marks] == list(range(len(marks)))
    groups = []
    for index, mark in enumerate(marks):
        assert set(PLACEMARK[name].split()) <= children(mark)
        longitude, latitude = map(float, mark.find(f"{KML}Point/{KML}coordinates").text.split(","))
        assert -180 <= longitude <= 180
        assert -90 <= latitude <= 90
        turn = mark.find(f"{WPML}waypointTurnParam")
        if "Pass" in turn.find(f"{WPML}waypointTurnMode").text:
            assert number_of(turn, "waypointTurnDampingDist") > 0
        for group in mark.iter(f"{WPML}actionGroup"):
            groups.append(group)
            start, end = (number_of(group, f"actionGroup{e}Index") for e in ("Start", "End"))
            assert index == start <= end < len(marks)
            ids = [number_of(action, "actionId") for action in group.iter(f"{WPML}action")]
            assert ids == list(range(len(ids)))
    assert [number_of(group, "actionGroupId") for group in groups] == list(range(len(groups)))
    assert texts(groups[0], "actionActuatorFunc")[0] == "gimbalRotate"
    assert texts(groups[0], "gimbalPitchRotateAngle") == ["-90"]


@given(mission=missions)
@settings(max_examples=25)
def test_wpml_follows_the_specification(mission):
    documents = documents_of(written(mission, "wpml"))
    for name, document in documents.items():
        check_document(name, document)
    (heading,) = set(texts(documents["waylines.wpml"], "waypointHeadingAngle"))
    away = (float(heading) - mission.conduct.yaw_deg + 180) % 360 - 180
    assert abs(away) <= 0.5


def test_the_zip_of_wpml_has_fixed_times_and_no_folders():
    archive = zipfile.ZipFile(BytesIO(written(grid(), "wpml")))
    assert archive.testzip() is None
    assert {member.date_time for member in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


@pytest.mark.parametrize("drone", DRONES)
def test_drones_have_their_numbers(drone):
    mission = grid(drone=drone, payload=None if DRONES[drone].payload else "dji-h20t")
    (_, waylines) = documents_of(written(mission, "wpml")).values()
    assert texts(waylines, "droneEnumValue") == [str(DRONES[drone].number)]
    assert texts(waylines, "droneSubEnumValue") == [str(DRONES[drone].variant)]
    payload = PAYLOADS[DRONES[drone].payload or "dji-h20t"]
    assert texts(waylines, "payloadEnumValue") == [str(payload)]


def test_numbers_of_drones_are_those_that_dji_publishes():
    # Cloud API, common elements: 60 M300, 89 M350, 67 M30/M30T, 77 M3E/M3T/M3M, 91 M3D/M3TD.
    assert DRONES["dji-m3t"][:2] == (77, 1)
    assert DRONES["dji-m30t"][:2] == (67, 1)
    assert DRONES["dji-m350"][:2] == (89, 0)
    assert (PAYLOADS["dji-h20t"], PAYLOADS["dji-m3t"], PAYLOADS["dji-m30t"]) == (43, 67, 53)


@pytest.mark.parametrize(
    ("camera", "values", "words", "hint"),
    [
        ("mine", {}, "needs to know the drone", "--drone"),
        ("mine", {"drone": "dji-m300"}, "what the drone dji-m300 carries", "--payload"),
        ("mine", {"drone": "dji-m3x"}, "no number for the drone 'dji-m3x'", "dji-m3t"),
        ("mine", {"drone": "parrot"}, "no number for the drone 'parrot'", "litchi:"),
        ("dji-h20t-thermal", {}, "needs to know the drone", "dji-m350"),
        ("dji-m3t-thermal", {"drone": "dji-m300"}, "what the drone dji-m300 carries", "dji-h20t"),
        ("dji-m3t-wide", {"payload": "dji-h20t"}, "the drone dji-m3t does not carry", "--drone"),
        ("x", {"drone": "dji-m300", "payload": "dji-m3t"}, "does not carry dji-m3t", "--payload"),
        (None, {}, "needs to know the drone", "--drone"),
    ],
)
def test_wpml_asks_for_what_it_does_not_know(camera, values, words, hint):
    mission = grid(**values)._replace(summary={"camera": {"name": camera}})
    with pytest.raises(RequestError) as caught:
        written(mission, "wpml")
    assert words in caught.value.message
    assert hint in caught.value.hint


def test_a_camera_tells_its_drone_and_payload():
    mission = grid()._replace(summary={"camera": {"name": "dji-m30t-thermal"}})
    (template, _) = documents_of(written(mission, "wpml")).values()
    assert texts(template, "droneEnumValue") == ["67"]
    assert texts(template, "imageFormat") == ["ir"]
    mission = grid(drone="dji-m350")._replace(summary={"camera": {"name": "dji-h20t-wide"}})
    (template, _) = documents_of(written(mission, "wpml")).values()
    assert texts(template, "payloadEnumValue") == ["43"]
    assert texts(template, "imageFormat") == ["wide"]


# Litchi


@given(mission=missions)
@settings(max_examples=25)
def test_litchi_rows_are_46_plain_numbers(mission):
    header, *lines = written(mission, "litchi").decode().splitlines()
    assert header.count(",") == 45
    for line in lines:
        assert re.fullmatch(r"(-?\d+(\.\d+)?,){45}-?\d+(\.\d+)?", line)
        fields = [float(field) for field in line.split(",")]
        assert 0 <= fields[3] <= 360
        assert fields[6:8] == [2, -90]
        assert set(fields[8:38:2]) <= {-1, 0, 1, 5}
        assert fields[38] == 0


# Limits


def limit_cases():
    for name, form in formats().items():
        for limits in form.limits:
            if limits.waypoints[1] is not None:
                yield name, limits.target, limits.waypoints[1]


@pytest.mark.parametrize(("name", "target", "most"), list(limit_cases()))
def test_no_file_holds_more_than_its_target_takes(name, target, most):
    autopilot = target if target in {"px4", "ardupilot"} else None
    for count in (most, most + 1, 2 * most + 1):
        mission = grid(count, kind="line", autopilot=autopilot)
        pieces = parts(mission, formats()[name])
        sizes = [len(piece.waypoints) for piece in pieces]
        assert max(sizes) <= most
        assert max(sizes) - min(sizes) <= 1
        assert len(sizes) == -(-count // most)
        flown = [east for piece in pieces for east in piece.waypoints.east_m]
        assert flown == mission.waypoints.east_m
        if most < 1000:
            contents = files([mission], formats()[name], "a/grid.b").values()
            assert [len(READERS[name](content)) for content in contents] == sizes


def pairs(count):
    """A mission of many lines of two photos each, which takes the most commands."""
    east = [3.0 * (index % 2) for index in range(count)]
    north = [3.0 * (index // 2) for index in range(count)]
    where = ([1e-5 * value for value in north], [1e-5 * value for value in east])
    return grid()._replace(waypoints=Waypoints(east, north, [40.0] * count, *where))


def test_ardupilot_files_keep_within_its_718_commands():
    for trigger, kind in itertools.product(("stop", "distance"), ("lanes", "spiral", "pairs")):
        mission = pairs(700) if kind == "pairs" else grid(711, kind=kind)
        mission = mission._replace(conduct=mission.conduct._replace(trigger=trigger))
        for content in files([mission], formats()["waypoints"], "g.waypoints").values():
            assert len(commands_of(content.decode())) <= 718
        for content in files([mission], formats()["qgc_plan"], "g.plan").values():
            assert len(json.loads(content)["mission"]["items"]) <= 500


def test_each_part_is_a_whole_mission_of_its_own():
    needed = files([grid(300)], formats()["waypoints"], "grid.waypoints")
    assert list(needed) == ["grid-1.waypoints", "grid-2.waypoints"]
    for content in needed.values():
        rows = commands_of(content.decode())
        assert [row[3] for row in rows[:4]] == [16, 22, 178, 205]
        assert rows[-1][3] == 20
        assert rows[0][8:10] == rows[5][8:10]


def test_several_flights_are_numbered_on():
    flights = [grid(120)._replace(flight=number, flights=2) for number in (1, 2)]
    needed = files(flights, formats()["litchi"], "grid.csv")
    assert list(needed) == [f"grid-{number}.csv" for number in (1, 2, 3, 4)]
    assert flights[0].title == "120 photos over stand, flight 1 of 2"
    assert parts(flights[1], formats()["litchi"])[0].title.endswith("flight 2 of 2, part 1 of 2")


def test_a_drone_that_takes_fewer_waypoints_rules():
    needed = files([grid(85, most_waypoints=40)], formats()["litchi"], "grid.csv")
    assert [len(READERS["litchi"](content)) for content in needed.values()] == [28, 28, 29]
    assert len(files([grid(85, most_waypoints=40)], formats()["csv"], "grid.csv")) == 1


def test_several_files_do_not_fit_into_stdout():
    with pytest.raises(RequestError, match="needs 2 Litchi CSV files, and stdout takes one"):
        files([grid(100)], formats()["litchi"], "-")


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("wpml", {"samples": 1}, "needs 2 waypoints or more, and the mission has 1"),
        ("litchi", {"samples": 1}, "needs 2 waypoints or more"),
        ("wpml", {"baseline_m": 0.4}, "waypoints 1 and 2 are 0.4 m apart"),
        ("wpml", {"baseline_m": 2001.0}, "legs of 0.5 to 2000 m"),
        ("litchi", {"baseline_m": 0.49}, "0.49 m apart"),
        ("wpml", {"speed_mps": 15.5}, "speed 15.5 m/s: DJI WPML takes 0.1 to 15 m/s"),
        ("litchi", {"speed_mps": 16.0}, "speed 16 m/s"),
        ("litchi", {"hold_s": 33.0}, "hold 33 s: Litchi CSV takes 0 to 32 s"),
        ("litchi", {"altitude_m": 501.0}, "height 501 m: Litchi CSV takes -200 to 500 m"),
        ("litchi", {"altitude_m": -201.0}, "height -201 m"),
        ("wpml", {"altitude_m": 1501.0}, "height 1501 m: DJI WPML takes any to 1500 m"),
        ("waypoints", {"altitude_m": 1e6}, "height 1e+06 m"),
    ],
)
def test_what_splitting_does_not_cure_is_refused_with_the_number(name, values, words):
    with pytest.raises(RequestError) as caught:
        files([grid(**values)], formats()[name], "grid")
    assert words in caught.value.message
    assert caught.value.hint


def test_turning_points_on_their_neighbours_are_left_out_where_legs_have_a_least_length():
    east = [-0.4, 0.0, 3.0, 6.0, 6.3, 9.0, 9.4]
    photo = [False, True, True, True, False, True, False]
    ways = Waypoints(east, [0.0] * 7, [40.0] * 7, east, [1e-4 * x for x in east], photo=photo)
    mission = grid(trigger="distance")._replace(waypoints=ways)
    for name, form in formats().items():
        (content,) = files([mission], form, "g").values()
        found = [place[0] for place in positions_of(name, [content])]
        short = form.limits[0].leg_m[0] > 0.4
        assert found == pytest.approx([0.0, 3.0, 6.0, 9.0] if short else east, abs=1e-6), name


def test_one_waypoint_is_enough_elsewhere():
    for name in ("waypoints", "qgc_plan", "kml", "geojson", "csv"):
        assert len(positions_of(name, files([grid(1)], formats()[name], "g").values())) == 1


def test_limits_follow_the_autopilot():
    form = formats()["qgc_plan"]
    assert limits_of(grid(), form).target == "px4"
    assert limits_of(grid(autopilot="ardupilot"), form).target == "ardupilot"


def test_every_limit_names_its_source():
    for form in formats().values():
        for limits in form.limits:
            assert bool(limits.source) == (limits != Limits())


# Hostile names

NAMES = [
    "<script>alert('x')</script>",
    "a & b <c> \"d\" 'e' ]]> <!-- --> <?x?>",
    "nul \0 bell \a escape \x1b[31m delete \x7f",
    "line\nbreak\r\ttab \u2028 \ufffe \ud800",
    "ü" * 10_000,
    "",
    "\N{GRINNING FACE}",
]


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_names_stay_names(name):
    mission = grid()._replace(summary={"scene": {"name": name}, "camera": {"name": "dji-m3t-wide"}})
    for form in formats().values():
        if "\ud800" in name and form.name in {"geojson", "qgc_plan"}:
            continue  # JSON files are UTF-8: half a character never comes out of one
        content = render(mission, form)
        assert len(positions_of(form.name, [content])) == 12
        assert b"<script>" not in content or form.name in {"geojson", "qgc_plan"}
        if form.name == "kml":
            assert len(content) < 4000


@pytest.mark.parametrize("summary", [{}, {"scene": None, "camera": 3}, {"scene": {"name": 7}}])
def test_missions_without_a_summary_are_written_all_the_same(summary):
    mission = grid(drone="dji-m3t")._replace(summary=summary)
    for form in formats().values():
        assert render(mission, form)


# The command line

PLAN = ["plan", "--altitude", "40", "--origin", "48.3358,14.3261", "--quiet"]
LONG = [*PLAN, "--samples", "300", "--baseline", "2"]


def test_split_files_are_written_with_a_hint(tmp_path, capsys):
    out = tmp_path / "grid.waypoints"
    assert run([*[a for a in LONG if a != "--quiet"], "--out", str(out)]) == 0
    err = capsys.readouterr().err
    hints = [line for line in err.splitlines() if line.startswith("hint:")]
    assert hints == [
        f"hint: {formats()['waypoints'].title} needs 2 files here: "
        f"{tmp_path / 'grid-1.waypoints'} to {tmp_path / 'grid-2.waypoints'}"
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "grid-1.waypoints",
        "grid-2.waypoints",
    ]


def test_none_of_the_numbered_files_is_written_if_one_exists(tmp_path, capsys):
    (tmp_path / "grid-2.waypoints").write_text("mine")
    assert run([*LONG, "--out", str(tmp_path / "grid.waypoints")]) == 2
    assert "grid-2.waypoints' exists" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["grid-2.waypoints"]
    assert (tmp_path / "grid-2.waypoints").read_text() == "mine"
    assert run([*LONG, "--out", str(tmp_path / "grid.waypoints"), "--force"]) == 0
    assert len(list(tmp_path.iterdir())) == 2


def test_files_of_an_earlier_longer_mission_are_named(tmp_path, capsys):
    (tmp_path / "grid-3.waypoints").write_text("old")
    arguments = [argument for argument in LONG if argument != "--quiet"]
    assert run([*arguments, "--out", str(tmp_path / "grid.waypoints")]) == 0
    assert "grid-3.waypoints is not of this mission" in capsys.readouterr().err


def test_two_outputs_never_share_a_numbered_file(tmp_path, capsys):
    outs = [
        "--out",
        str(tmp_path / "grid.waypoints"),
        "--out",
        f"csv:{tmp_path / 'grid-1.waypoints'}",
    ]
    assert run([*LONG, *outs]) == 2
    assert "grid-1" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_saved_plan_is_split_as_the_plan_itself(tmp_path, capsys):
    assert run([*[a for a in LONG if a != "--quiet"], "--json"]) == 0
    (tmp_path / "plan.json").write_text(capsys.readouterr().out, encoding="utf-8")
    assert run(["export", str(tmp_path / "plan.json"), "--out", str(tmp_path / "a.plan")]) == 0
    captured = capsys.readouterr()
    assert "a-1.plan, " in captured.out
    assert "hint: " in captured.err
    assert run([*LONG, "--out", str(tmp_path / "b.plan")]) == 0
    assert (tmp_path / "a-2.plan").read_bytes() == (tmp_path / "b-2.plan").read_bytes()


def test_autopilot_and_payload_reach_the_files(tmp_path):
    out = str(tmp_path / "g.plan")
    assert run([*PLAN, "--autopilot", "ardupilot", "--out", out]) == 0
    assert json.loads((tmp_path / "g.plan").read_text())["mission"]["firmwareType"] == 3
    drone = ["--drone", "dji-m350", "--payload", "dji-h20t"]
    assert run([*PLAN, *drone, "--out", str(tmp_path / "g.kmz")]) == 0
    waylines = documents_of((tmp_path / "g.kmz").read_bytes())["waylines.wpml"]
    assert texts(waylines, "payloadEnumValue") == ["43"]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("autopilot", "hal"),
        ("takeoff_latitude", 9000),
        ("takeoff_longitude", -180.5),
        ("speed_mps", -1),
        ("speed_mps", 0),
        ("hold_s", -0.1),
        ("spacing_m", -1),
        ("gimbal_pitch_deg", 1e9),
        ("altitude_frame", "sea"),
        ("most_waypoints", 1),
        ("trigger", "time"),
    ],
)
def test_a_saved_plan_flown_in_strange_ways_is_refused(tmp_path, capsys, name, value):
    assert run([*[a for a in PLAN if a != "--quiet"], "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    document["flight"][name] = value
    (tmp_path / "plan.json").write_text(json.dumps(document))
    assert run(["export", str(tmp_path / "plan.json"), "--out", str(tmp_path / "g.plan")]) == 2
    assert f"flight.{name}" in capsys.readouterr().err
    assert not (tmp_path / "g.plan").exists()


def test_formats_are_listed_with_what_they_need_and_hold(capsys):
    assert run(["formats", "--json"]) == 0
    listed = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert set(listed) == set(formats())
    assert listed["wpml"]["limits"][0]["waypoints"] == [2, 65535]
    assert listed["litchi"]["limits"][0]["waypoints"] == [2, 99]
    assert [one["target"] for one in listed["qgc_plan"]["limits"]] == ["px4", "ardupilot"]
    assert run(["formats"]) == 0
    shown = capsys.readouterr().out
    assert "litchi:PATH" in shown
    assert "2 to 99" in shown


def test_a_mission_without_a_place_is_written_as_csv_alone():
    local = Mission(Waypoints([0.0], [0.0], [40.0]), {})
    for name, form in formats().items():
        if name == "csv":
            assert list(files([local], form, "g.csv")) == ["g.csv"]
        else:
            with pytest.raises(RequestError, match="needs a place on earth"):
                files([local], form, "g")
