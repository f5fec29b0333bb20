"""All formats: tests of the order of sites, of the limits of the formats, and of the rules of the
programs that read the files.
"""

import itertools
import json
import re

import pytest
from hypothesis import given, settings
from support.flights import (
    KML,
    READERS,
    WPML,
    commands_of,
    documents_of,
    flown_in,
    grid,
    missions,
    plan_of,
    positions_of,
    texts,
    written,
)

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.mission.export import formats, mission_files
from aosplan.mission.mission import Mission, Waypoints, photo_lines

# One mission in every format


def test_every_format_has_a_reader_here():
    assert set(READERS) == set(formats())


@given(mission=missions)
@settings(max_examples=15)
def test_the_same_sites_in_the_same_order_in_every_format(mission):
    ways = mission.waypoints
    # If photos are taken while flying, files for autopilots have only the ends of lines: see
    # test_replay.py.
    stopping = mission._replace(settings=mission.settings._replace(trigger="stop"))
    for name, form in formats().items():
        written_ = flown_in(stopping if form.flown_by else mission, name)
        found = positions_of(name, mission_files([written_], form, "grid").values())
        assert len(found) == len(ways)
        for place, waypoint in zip(found, ways, strict=True):
            assert abs(place[0] - waypoint.latitude) <= 1e-7
            assert abs(place[1] - waypoint.longitude) <= 1e-7
            assert abs(place[2] - waypoint.altitude_m) <= 1e-3


@given(mission=missions)
@settings(max_examples=20)
def test_the_same_mission_gives_the_same_bytes(mission):
    for name in formats():
        assert written(mission, name) == written(mission, name)


@pytest.mark.parametrize("name", READERS)
def test_heights_are_above_the_takeoff_if_the_ground_is_known(name):
    ground = [200.0 + 3.0 * index for index in range(12)]
    mission = grid(ground_m=ground, takeoff_ground_m=190.0)
    above_ground = name in {"csv", "geojson", "kml"}
    heights = [place[2] for place in positions_of(name, [written(mission, name)])]
    expected = [40.0 if above_ground else 40.0 + up - 190.0 for up in ground]
    if not above_ground:
        # The drone arrives at the height of the highest site, and descends at the first.
        assert heights.pop(0) == 83.0
    assert heights == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("name", ["waypoints", "plan", "litchi"])
def test_heights_in_the_terrain_frame_are_above_the_ground(name):
    ground = [200.0 + 3.0 * index for index in range(12)]
    mission = grid(
        ground_m=ground, takeoff_ground_m=190.0, altitude_frame="terrain", autopilot=AUTOPILOT[name]
    )
    content = written(mission, name)
    # The height of the transit to the first site is relative to the take-off point, because the
    # ground there is not known.
    assert [place[2] for place in positions_of(name, [content])] == [83.0, *[40.0] * 12]
    if name == "litchi":
        modes = [line.split(b",")[38] for line in content.splitlines()[1:]]
        assert modes == [b"0", *[b"1"] * 12]
    else:
        frames = (
            [row[2] for row in commands_of(content.decode()) if row[3] == 16][1:]
            if name == "waypoints"
            else [i["frame"] for i in json.loads(content)["mission"]["items"] if i["command"] == 16]
        )
        assert frames == [3, *[10] * 12]


def test_wpml_has_no_terrain_frame():
    with pytest.raises(RequestError, match="not support heights above terrain"):
        written(grid(altitude_frame="terrain"), "kmz")


AUTOPILOT = {"waypoints": "ardupilot", "plan": "ardupilot", "litchi": "dji"}

# Photos


@pytest.mark.parametrize("photo", [None, [index % 4 != 3 for index in range(12)]])
def test_stopping_takes_one_photo_at_each_site_after_its_hold(photo):
    values = {"hold_s": 2.0} | ({} if photo is None else {"photo": photo})
    mission = grid(**values)
    shot = photo or [True] * 12
    rows = commands_of(written(mission, "waypoints").decode())
    sites = [place for place, row in enumerate(rows) if row[3] == 16][1:]
    assert [rows[place + 1][3] == 203 for place in sites] == shot
    assert all(rows[place + 1][8] == 1 for place, yes in zip(sites, shot, strict=True) if yes)
    assert [rows[place][4] for place in sites] == [2.0 if yes else 0.0 for yes in shot]
    items = plan_of(mission)["mission"]["items"]
    places = [place for place, item in enumerate(items) if item["command"] == 16]
    assert [items[place + 1]["command"] == 2000 for place in places] == shot
    # PX4 takes the photo at the end of the waypoint's hold. Half of the hold is therefore after the
    # photo.
    assert [items[place]["params"][0] for place in places] == [1.0 if yes else 0.0 for yes in shot]
    delays = [items[place + 2] for place, yes in zip(places, shot, strict=True) if yes]
    assert [(item["command"], item["params"][0]) for item in delays] == [(93, 1.0)] * sum(shot)
    waylines = documents_of(written(mission, "kmz"))["waylines.wpml"]
    marks = list(waylines.iter(f"{KML}Placemark"))
    assert [
        texts(mark, "actionActuatorFunc")[-2:] == ["hover", "takePhoto"] for mark in marks
    ] == shot
    assert set(texts(waylines, "hoverTime")) == {"2.000"}
    for line, yes in zip(written(mission, "litchi").decode().splitlines()[1:], shot, strict=True):
        pairs = line.split(",")[8:38]
        assert pairs[:6] == (
            ["5", "-90", "0", "2000", "1", "0"] if yes else ["5", "-90", *["-1", "0"] * 2]
        )


def test_a_distance_trigger_is_on_along_lines_and_off_between_them():
    # The grid has 3 rows of 4 sites.
    mission = grid(12, kind="rectangle", trigger="distance", baseline_m=2.5)
    assert photo_lines(mission) == [(0, 3), (4, 7), (8, 11)]
    rows = commands_of(written(mission, "waypoints").decode())
    switches = [(row[4], row[6]) for row in rows if row[3] == 206]
    assert switches == [(2.5, 1.0), (0.0, 0.0)] * 3
    # After a line without a run-out, the drone continues for half a spacing.
    assert [row[3] for row in rows if row[3] in {203, 206}] == [206, 206] * 3
    items = plan_of(mission)["mission"]["items"]
    assert [item["params"][0] for item in items if item["command"] == 206] == [2.5, 0.0] * 3
    holds = [item["params"][0] for item in items if item["command"] == 16]
    # The file has three points: the first photo, the last photo, and the end of the trigger. PX4
    # stops at the first and at the third point.
    assert holds == [0.01, 0.0, 0.01] * 3
    waylines = documents_of(written(mission, "kmz"))["waylines.wpml"]
    groups = [
        (
            texts(g, "actionGroupStartIndex"),
            texts(g, "actionGroupEndIndex"),
            texts(g, "actionTriggerParam"),
        )
        for g in waylines.iter(f"{WPML}actionGroup")
        if "multipleDistance" in texts(g, "actionTriggerType")
    ]
    assert groups == [([str(k)], [str(k + 2)], ["2.500000"]) for k in (0, 3, 6)]
    intervals = [
        line.split(",")[-1] for line in written(mission, "litchi").decode().splitlines()[1:]
    ]
    assert intervals == ["2.500000", "2.500000", "-1"] * 3


def test_turning_points_take_no_photo_in_flight():
    # Two lines of three sites, with a turning point before and after each line.
    east = [0.0, 3.0, 6.0, 9.0, 12.0, 12.0, 9.0, 6.0, 3.0, 0.0]
    north = [0.0] * 5 + [3.0] * 5
    photo = [False, True, True, True, False] * 2
    ways = Waypoints(east, north, [40.0] * 10, east, north, photo=photo)
    mission = grid(trigger="distance")._replace(waypoints=ways)
    assert photo_lines(mission) == [(1, 3), (6, 8)]
    codes = [row[3] for row in commands_of(written(mission, "waypoints").decode())[4:-1]]
    # The trigger is on from the first site until half a spacing after the last, before the turn.
    assert codes == [115, 16, 115, 16, 206, 115, 16, 206, 115, 16] * 2
    waylines = documents_of(written(mission, "kmz"))["waylines.wpml"]
    stops = ["Stop" in mode for mode in texts(waylines, "waypointTurnMode")]
    assert stops == [True, False, False, True] * 2


@given(mission=missions)
@settings(max_examples=60)
def test_every_photo_is_on_exactly_one_line_of_equal_steps(mission):
    ways, spacing = mission.waypoints, mission.settings.spacing_m
    lines = photo_lines(mission)
    covered = [index for first, last in lines for index in range(first, last + 1)]
    assert covered == list(range(len(ways)))
    for first, last in lines:
        for one, other in itertools.pairwise(range(first, last + 1)):
            step = (ways.east_m[other] - ways.east_m[one], ways.north_m[other] - ways.north_m[one])
            assert (step[0] ** 2 + step[1] ** 2) ** 0.5 == pytest.approx(spacing, rel=0.03)


def test_sites_outside_lines_have_single_photos():
    ways = Waypoints([0.0, 3.0, 9.7, 1.1], [0.0, 0.0, 5.3, 8.8], [40.0] * 4, [0.0] * 4, [0.0] * 4)
    mission = grid(trigger="distance")._replace(waypoints=ways)
    assert photo_lines(mission) == [(0, 1), (2, 2), (3, 3)]
    rows = commands_of(written(mission, "waypoints").decode())
    assert [row[3] for row in rows if row[3] in {203, 206}] == [206, 206, 203, 203]


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
def test_names_in_missions_are_escaped_in_every_format(name):
    mission = grid()._replace(summary={"scene": {"name": name}, "camera": {"name": "dji-m3t-wide"}})
    for form in formats().values():
        if "\ud800" in name and form.name in {"geojson", "plan"}:
            continue  # JSON files are in UTF-8, which cannot contain half a surrogate pair.
        content = written(mission, form.name)
        assert len(positions_of(form.name, [content])) == 12
        assert b"<script>" not in content or form.name in {"geojson", "plan"}
        if form.name == "kml":
            assert len(content) < 4000


@pytest.mark.parametrize("summary", [{}, {"scene": None, "camera": 3}, {"scene": {"name": 7}}])
def test_missions_without_a_summary_are_written(summary):
    mission = grid(drone="dji-m3t")._replace(summary=summary)
    for name in formats():
        assert written(mission, name)


# The command line

PLAN = ["plan", "--altitude", "40", "--origin", "48.3358,14.3261", "--quiet"]
LONG = [*PLAN, "--samples", "300", "--baseline", "2"]


def test_split_files_are_written_with_a_hint(tmp_path, capsys):
    out = tmp_path / "grid.waypoints"
    assert run([*[a for a in LONG if a != "--quiet"], "--out", str(out)]) == 0
    err = capsys.readouterr().err
    hints = [line for line in err.splitlines() if line.startswith("hint:")]
    assert hints[1:] == [
        f"hint: {formats()['waypoints'].title} needs 2 files here: "
        f"{tmp_path / 'grid-1.waypoints'} to {tmp_path / 'grid-2.waypoints'}",
        "hint: one flight needs several of these files; the drone returns home after each "
        "file, and the planned time does not include these returns",
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


def test_a_hint_names_numbered_files_of_an_earlier_longer_mission(tmp_path, capsys):
    (tmp_path / "grid-3.waypoints").write_text("old")
    arguments = [argument for argument in LONG if argument != "--quiet"]
    assert run([*arguments, "--out", str(tmp_path / "grid.waypoints")]) == 0
    assert "grid-3.waypoints is not part of this mission" in capsys.readouterr().err


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
def test_a_saved_plan_with_invalid_flight_settings_is_refused(tmp_path, capsys, name, value):
    assert run([*[a for a in PLAN if a != "--quiet"], "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    document["flight"][name] = value
    (tmp_path / "plan.json").write_text(json.dumps(document))
    assert run(["export", str(tmp_path / "plan.json"), "--out", str(tmp_path / "g.plan")]) == 2
    assert f"flight.{name}" in capsys.readouterr().err
    assert not (tmp_path / "g.plan").exists()


def test_formats_are_listed_with_requirements_and_limits(capsys):
    assert run(["formats", "--json"]) == 0
    listed = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert set(listed) == set(formats())
    assert listed["kmz"]["limits"][0]["waypoints"] == [2, 65535]
    assert listed["litchi"]["limits"][0]["waypoints"] == [2, 99]
    assert [one["target"] for one in listed["plan"]["limits"]] == ["px4", "ardupilot"]
    assert run(["formats"]) == 0
    shown = capsys.readouterr().out
    assert "litchi:PATH" in shown
    assert "2 to 99" in shown


def test_a_mission_without_a_location_is_written_only_as_csv():
    local = Mission(Waypoints([0.0], [0.0], [40.0]), {})
    for name, form in formats().items():
        if name == "csv":
            assert list(mission_files([local], form, "g.csv")) == ["g.csv"]
        else:
            with pytest.raises(RequestError, match="needs a location"):
                mission_files([local], form, "g")
