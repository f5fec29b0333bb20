"""Formats of DJI Fly, Autel and Parrot: tests of structure, numbers and limits, and of missions
that are refused.
"""

import pytest
from hypothesis import given, settings
from support.flights import (
    AUTEL,
    FLYERS,
    KML,
    WPML,
    commands_of,
    documents_of,
    flown_in,
    grid,
    missions,
    texts,
    written,
)

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.flight.drones import DRONES
from aosplan.mission.export import formats, mission_files, render

PLAN = ["plan", "--altitude", "40", "--origin", "48.3358,14.3261", "--quiet"]


def names(element):
    return [child.tag.partition("}")[2] for child in element]


# Missions that all of them refuse


@pytest.mark.parametrize("name", FLYERS)
def test_a_missing_drone_is_requested(name):
    with pytest.raises(RequestError, match="needs a drone") as caught:
        render(grid(), formats()[name])
    assert "--drone NAME" in caught.value.hint


@pytest.mark.parametrize("name", FLYERS)
def test_a_drone_that_flies_another_format_is_refused(name):
    mission = grid(drone="dji-m3t", mission_formats=("kmz",))
    with pytest.raises(RequestError, match="the drone dji-m3t does not fly") as caught:
        render(mission, formats()[name])
    assert caught.value.hint == "it flies kmz"


@pytest.mark.parametrize("name", FLYERS)
@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"trigger": "distance"}, "does not support --trigger distance"),
        ({"altitude_frame": "terrain"}, "not support heights above terrain"),
    ],
)
def test_distance_photos_and_terrain_frames_are_refused(name, values, words):
    flown = flown_in(grid(), name)
    with pytest.raises(RequestError, match=words):
        render(flown._replace(settings=flown.settings._replace(**values)), formats()[name])


@pytest.mark.parametrize("drone", [name for name in DRONES if DRONES[name].mission_formats])
def test_every_drone_writes_exactly_its_own_maker_formats(drone, tmp_path, capsys):
    preset = DRONES[drone]
    assert set(preset.mission_formats) <= set(formats())
    camera = [] if preset.camera else ["--camera", "flir-vue-pro-640-9mm"]
    for name in FLYERS:
        out = tmp_path / name
        status = run([*PLAN, "--drone", drone, *camera, "--out", f"{name}:{out}"])
        assert (status == 0) == out.exists() == (name in preset.mission_formats)
        assert status == 0 or "does not fly" in capsys.readouterr().err


# DJI Fly


@given(mission=missions)
@settings(max_examples=30)
def test_dji_fly_has_the_members_of_wpml_and_the_numbers_of_public_planners(mission):
    members = documents_of(written(mission, "dji-fly"))
    for document in members.values():
        assert texts(document, "droneEnumValue") == ["68"]
        assert texts(document, "droneSubEnumValue") == ["0"]
        for absent in ("payloadInfo", "payloadParam", "payloadLensIndex", "fileSuffix"):
            assert not list(document.iter(WPML + absent))
    waylines = members["waylines.wpml"]
    marks = list(waylines.iter(f"{KML}Placemark"))
    assert texts(waylines, "index") == [str(index) for index in range(len(marks))]
    assert texts(waylines, "distance") == texts(waylines, "duration") == ["0"]
    assert set(texts(waylines, "actionTriggerType")) == {"reachPoint"}
    assert set(texts(waylines, "waypointTurnMode")) == {"toPointAndStopWithDiscontinuityCurvature"}
    assert texts(waylines, "waypointHeadingAngleEnable") == ["1"] * len(marks)
    assert not list(members["template.kml"].iter(f"{KML}Placemark"))


def test_dji_fly_holds_then_takes_one_photo_at_each_site():
    waylines = documents_of(written(grid(12, hold_s=1.5), "dji-fly"))["waylines.wpml"]
    for index, mark in enumerate(waylines.iter(f"{KML}Placemark")):
        done = texts(mark, "actionActuatorFunc")
        assert done == ["gimbalRotate"] * (index == 0) + ["hover", "takePhoto"]
        assert texts(mark, "hoverTime") == ["1.500"]
        assert texts(mark, "actionGroupMode") == ["sequence"]
    assert len(set(texts(waylines, "actionGroupId"))) == 12


@pytest.mark.parametrize(("samples", "pieces"), [(99, 1), (100, 2), (250, 3)])
def test_dji_fly_splits_at_99_waypoints(samples, pieces):
    flown = flown_in(grid(samples, kind="line"), "dji-fly")
    found = mission_files([flown], formats()["dji-fly"], "a/grid.kmz")
    assert len(found) == pieces
    counts = [
        len(list(documents_of(content)["waylines.wpml"].iter(f"{KML}Placemark")))
        for content in found.values()
    ]
    assert max(counts) <= 99
    assert sum(counts) == samples


# Autel


def test_autel_has_its_own_namespace_and_numbers():
    content = written(grid(), "autel")
    assert b"dji.com" not in content
    ours = documents_of(content)
    theirs = documents_of(written(grid(), "kmz"))
    for name, document in ours.items():
        assert [e.text for e in document.iter(AUTEL + "droneEnumValue")] == ["11000"]
        assert [e.text for e in document.iter(AUTEL + "droneSubEnumValue")] == ["0"]
        assert [e.text for e in document.iter(AUTEL + "payloadEnumValue")] == ["806"]
        assert not [e for e in document.iter() if e.tag.startswith(WPML)]
        # It has the structure of DJI's specification, which test_wpml.py checks.
        shape = [names(element) for element in document.iter()]
        assert shape == [names(element) for element in theirs[name].iter()]


def test_autel_refuses_a_drone_without_a_number():
    flown = flown_in(grid(drone="mine"), "autel")
    other = flown._replace(settings=flown.settings._replace(drone="mine"))
    with pytest.raises(RequestError, match="no code for the drone 'mine'"):
        render(other, formats()["autel"])


# Parrot: the commands and ranges in Parrot's documentation, messages V1

ALLOWED = {16, 20, 22, 112, 178, 205, 2000, 50000}


@given(mission=missions)
@settings(max_examples=30)
def test_parrot_items_follow_the_documentation_of_the_anafi(mission):
    rows = commands_of(written(mission, "parrot").decode(), 120)
    assert [row[0] for row in rows] == list(range(len(rows)))
    assert {row[3] for row in rows} <= ALLOWED
    assert all(len(row) == 12 and row[1:3] == [0, 3] and row[11] == 1 for row in rows)
    assert (rows[0][3], rows[-1][3]) == (22, 20)
    for row in rows:
        if row[3] == 16:
            assert row[4] == 0  # This value is ignored, because holds are written as delays.
            assert row[5] > 0  # With a radius of 0, the drone would use 5 m.
            assert 0 <= row[7] < 360
    assert [row[4:11] for row in rows if row[3] == 205] == [[-90, 0, 0, 0, 0, 0, 2]]


def test_parrot_waits_before_and_after_each_photo():
    rows = commands_of(written(grid(9, hold_s=3.0), "parrot").decode(), 120)
    site = [[16], [112, 1.5], [2000, 0, 1, 13], [112, 1.5]]
    body = [row[3:4] if row[3] == 16 else row[3 : 3 + (2 if row[3] == 112 else 4)] for row in rows]
    assert body[4:-1] == site * 9
    without = commands_of(written(grid(9, hold_s=0.0), "parrot").decode(), 120)
    assert [row[3] for row in without[4:-1]] == [16, 2000] * 9


def test_parrot_files_have_no_photo_at_turning_points():
    rows = commands_of(written(grid(9, photo=[True] * 8 + [False]), "parrot").decode(), 120)
    assert sum(row[3] == 16 for row in rows) == 9
    assert sum(row[3] == 2000 for row in rows) == 8


@pytest.mark.parametrize("speed", [0.9, 10.1])
def test_parrot_files_limit_the_speed(speed):
    flown = flown_in(grid(speed_mps=speed), "parrot")
    with pytest.raises(RequestError, match=r"allows 1 to 10 m/s"):
        mission_files([flown], formats()["parrot"], "g.mavlink")


def test_pymavlink_reads_the_flight_plan(tmp_path):
    mavwp = pytest.importorskip("pymavlink.mavwp")
    path = tmp_path / "g.mavlink"
    path.write_bytes(written(grid(9), "parrot").replace(b"QGC WPL 120", b"QGC WPL 110"))
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(path)) == 4 + 9 * 4 + 1
