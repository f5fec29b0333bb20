"""DJI WPML, checked with the rules of its specification."""

import zipfile
from io import BytesIO

import pytest
from hypothesis import given, settings
from support.flights import KML, WPML, documents_of, grid, missions, texts, written

from aosplan.errors import RequestError
from aosplan.mission.dji_models import DRONES, PAYLOADS

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
    documents = documents_of(written(mission, "kmz"))
    for name, document in documents.items():
        check_document(name, document)
    (heading,) = set(texts(documents["waylines.wpml"], "waypointHeadingAngle"))
    away = (float(heading) - mission.settings.yaw_deg + 180) % 360 - 180
    assert abs(away) <= 0.5


def test_the_zip_of_wpml_has_fixed_times_and_no_folders():
    archive = zipfile.ZipFile(BytesIO(written(grid(), "kmz")))
    assert archive.testzip() is None
    assert {member.date_time for member in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


@pytest.mark.parametrize("drone", DRONES)
def test_drones_have_their_numbers(drone):
    mission = grid(drone=drone, payload=None if DRONES[drone].payload else "dji-h20t")
    (_, waylines) = documents_of(written(mission, "kmz")).values()
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
        ("mine", {}, "needs a drone", "--drone"),
        ("mine", {"drone": "dji-m300"}, "the payload of the drone dji-m300", "--payload"),
        ("mine", {"drone": "dji-m3x"}, "no code for the drone 'dji-m3x'", "dji-m3t"),
        ("mine", {"drone": "parrot"}, "no code for the drone 'parrot'", "litchi:"),
        ("dji-h20t-thermal", {}, "needs a drone", "dji-m350"),
        ("dji-m3t-thermal", {"drone": "dji-m300"}, "the payload of the drone dji-m300", "dji-h20t"),
        ("dji-m3t-wide", {"payload": "dji-h20t"}, "the drone dji-m3t does not carry", "--drone"),
        ("x", {"drone": "dji-m300", "payload": "dji-m3t"}, "does not carry dji-m3t", "--payload"),
        (None, {}, "needs a drone", "--drone"),
    ],
)
def test_wpml_is_refused_without_a_known_drone_or_payload(camera, values, words, hint):
    mission = grid(**values)._replace(summary={"camera": {"name": camera}})
    with pytest.raises(RequestError) as caught:
        written(mission, "kmz")
    assert words in caught.value.message
    assert hint in caught.value.hint


def test_a_camera_determines_drone_and_payload():
    mission = grid()._replace(summary={"camera": {"name": "dji-m30t-thermal"}})
    (template, _) = documents_of(written(mission, "kmz")).values()
    assert texts(template, "droneEnumValue") == ["67"]
    assert texts(template, "imageFormat") == ["ir"]
    mission = grid(drone="dji-m350")._replace(summary={"camera": {"name": "dji-h20t-wide"}})
    (template, _) = documents_of(written(mission, "kmz")).values()
    assert texts(template, "payloadEnumValue") == ["43"]
    assert texts(template, "imageFormat") == ["wide"]


def test_a_multispectral_camera_stores_its_own_lens():
    plan = grid(drone="dji-m3m")._replace(summary={"camera": {"name": "dji-m3m-multispectral"}})
    for document in documents_of(written(plan, "kmz")).values():
        lenses = texts(document, "payloadLensIndex") + texts(document, "imageFormat")
        assert set(lenses) == {"narrow_band"}
