"""Ideal flights of mission files are simulated for all combinations of options.

Photos are taken at the planned sites and at no other places.  The flights keep the clearance over
terrain and canopy, do not exceed the drone's speeds, and take the time of the plan.
"""

import itertools
import math
import re
from functools import partial

import numpy as np
import pytest
from support.replay import (
    Ground,
    between,
    check_ardupilot,
    check_px4,
    duration_s,
    fly_litchi,
    fly_mavlink,
    fly_parrot,
    fly_wpml,
    mavlink_items,
    working,
)
from support.terrains import EAST, LINZ, NORTH, UTM, saved, surface

from aosplan.errors import RequestError
from aosplan.flight.drones import DRONES
from aosplan.mission.export import formats, mission_files, notes
from aosplan.mission.flown_path import BEND_M
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest

FLOWN = [name for name, form in formats().items() if form.flown_by]

CRAFT = {
    "dji": {"drone": "dji-m3t"},
    "dji-m30t": {"drone": "dji-m30t"},
    "dji-m350": {"drone": "dji-m350", "payload": "dji-h20t"},
    "dji-mini": {"drone": "dji-mini-4-pro"},
    "autel": {"drone": "autel-evo-max-4t"},
    "parrot": {"drone": "parrot-anafi-thermal"},
    "slow": {"drone": "dji-m3t", "speed": 1.3, "transit_speed": 9.0},
    "slow-parrot": {"drone": "parrot-anafi-thermal", "speed": 1.3, "transit_speed": 9.0},
    "slow-copter": {"autopilot": "ardupilot", "speed": 1.3, "transit_speed": 9.0},
    "slow-px4": {"autopilot": "px4", "speed": 1.3, "transit_speed": 9.0},
    "copter": {"drone": "ardupilot-copter", "camera": "sony-a6000-16mm"},
    "px4": {"drone": "px4-multicopter", "camera": "flir-vue-pro-640-13mm"},
    "px4-mavlink": {
        "drone": "px4-multicopter",
        "camera": "flir-vue-pro-640-13mm",
        "camera_control": "mavlink",
    },
    "some": {},
    "some-ardupilot": {"autopilot": "ardupilot"},
    "some-px4": {"autopilot": "px4"},
}
GRIDS = {
    "trimmed": {"samples": 23, "baseline": 4.2},
    "lanes": {"samples": 30, "baseline": 3.1, "grid": "lanes", "heading": 33.0},
    "line": {"samples": 10, "baseline": 4.012345678, "grid": "line", "line_length": 150.0},
    "far": {"samples": 16, "baseline": 2.5, "takeoff": (48.3398, 14.3261), "heading": 250.0},
    "long": {"samples": 12, "baseline": 3.3, "grid": "line", "line_length": 420.0},
    "resumed": {"samples": 50, "baseline": 0.7, "resume_at": 3},
    "split": {"samples": 90, "baseline": 3.0, "takeoff": (48.3362, 14.3261), "file_waypoints": 40},
}


def relief(x, y):
    """A plain with a ridge of 50 m between the sites and a take-off on a hill."""
    return (
        300.0
        + 50.0 * np.exp(-(((y - 150.0) / 25.0) ** 2))
        + 0.15 * (y - 150.0) * (y > 150.0)
        + 0.05 * x
    )


def rough(x, y):
    """Humps of 16 m that are 20 to 30 m wide."""
    return 300.0 + 8.0 * np.sin(x / 8.0) * np.cos(y / 6.0)


SHAPES = {"takeoff": relief, "terrain": relief, "rough": rough}

PIXEL_M = {"takeoff": 4.0, "terrain": 4.0, "rough": 1.0}
RASTER_M = {
    # Bilinear interpolation of a ridge has an error of its curvature times the square of the pixel
    # size, divided by 8.
    "takeoff": 2.0 * 50.0 / 25.0**2 * 4.0**2 / 8.0,
    "terrain": 2.0 * 50.0 / 25.0**2 * 4.0**2 / 8.0,
    "rough": (8.0 / 8.0**2 + 8.0 / 6.0**2) * 1.0**2 / 8.0,
    "flat": 0.0,
}
"""Largest difference [m] between the heights of each raster and the exact shape of its ground."""

DEGREE_M = 111_700.0

PLACE_M = {"waypoints": 0.5e-8 * DEGREE_M, "parrot": 0.5e-8 * DEGREE_M}
"""Rounding error of latitudes and longitudes with eight decimals.  Other formats have ten
decimals.
"""

HEIGHT_M = {"litchi": 0.5e-3, "waypoints": 0.5e-8, "parrot": 0.5e-8}
"""Rounding error of heights.  Formats that are not listed have four decimals."""

SPEED_MPS = dict.fromkeys(("litchi", "kmz", "dji-fly", "autel"), 0.5e-4)
"""Rounding error of speeds with four decimals.  Other formats have eight decimals or more."""


@pytest.fixture(scope="module")
def terrains(tmp_path_factory):
    folder = tmp_path_factory.mktemp("relief")
    pixel = PIXEL_M["takeoff"]
    broad = saved(folder / "relief.tif", surface(relief, pixel=pixel), pixel=pixel)
    return {
        "takeoff": broad,
        "terrain": broad,
        "rough": saved(folder / "rough.tif", surface(rough, size=1200)),
    }


def height_of(frame, latitude, longitude):
    x, y = UTM.transform(longitude, latitude)
    return SHAPES[frame](x - EAST, y - NORTH)


def replayed(name, content, ground, result, mission):
    if name in ("waypoints", "plan"):
        home, items = mavlink_items(name, content)
        autopilot = mission.settings.autopilot or ("ardupilot" if name == "waypoints" else "px4")
        (check_px4 if autopilot == "px4" else check_ardupilot)(items, home)
        return fly_mavlink(name, content, ground)
    takeoff = result.route.takeoff or (
        mission.waypoints.latitude[0],
        mission.waypoints.longitude[0],
    )
    if name == "parrot":
        return fly_parrot(content, ground, takeoff, mission.climb_m())
    if name in ("kmz", "dji-fly", "autel"):
        return fly_wpml(content, ground, takeoff)
    said = " ".join(notes([mission], formats()[name]))
    transit = float(re.search(r"the cruising speed to ([\d.]+) m/s", said)[1])
    return fly_litchi(content, ground, takeoff, transit)


EACH_GRID = ("trimmed", "lanes", "line", "far")
CASES = [
    # In the quick tests, the grids take turns: each combination of the other three options has one
    # of the grids.
    pytest.param(*case, marks=() if sum(place) % len(EACH_GRID) == 0 else pytest.mark.slow)
    for place, case in (
        (next(zip(*pairs, strict=True)), [value for _, value in pairs])
        for pairs in itertools.product(
            *map(enumerate, (CRAFT, ("stop", "distance"), ("flat", *SHAPES), EACH_GRID))
        )
    )
]
CASES += itertools.product(CRAFT, ("stop", "distance"), ("flat",), ("split",))
CASES += itertools.product(
    ("dji", "some-ardupilot"), ("stop", "distance"), ("takeoff", "terrain"), ("long",)
)
CASES += itertools.product(("dji", "some-px4"), ("stop", "distance"), ("flat",), ("resumed",))


@pytest.mark.parametrize(("craft", "trigger", "frame", "grid"), CASES)
def test_files_fly_as_planned(terrains, craft, trigger, frame, grid):
    values = {"altitude": 40.0, "origin": LINZ, "trigger": trigger, **CRAFT[craft], **GRIDS[grid]}
    if frame != "flat":
        values |= {"terrain": terrains[frame]}
        values |= {"altitude_frame": "terrain"} if frame == "terrain" else {}
    try:
        result = plan(PlanRequest(**values))
    except RequestError:
        if (frame, "px4" in craft) != ("terrain", True):
            raise
        return
    written = 0
    for name in FLOWN:
        try:
            for mission in result.missions():
                contents = list(mission_files([mission], formats()[name], "g").values())
                check_flight(name, contents, result, mission, frame)
            written += 1
        except RequestError as refused:
            check_refusal(name, values, refused)
    # Some drones have only formats that support neither photos while flying nor terrain heights.
    # No file is written for these drones.
    assert written or trigger == "distance" or frame == "terrain"


def check_refusal(name, values, refused):
    """Check that the refusal of a file has a hint, and that the drone or the format cannot fly the
    mission.
    """
    assert refused.hint
    form, drone = formats()[name], DRONES.get(values.get("drone", ""))
    autopilot = drone.autopilot if drone else values.get("autopilot")
    flown = () if drone is None else drone.mission_formats or ()
    assert (
        (autopilot is not None and autopilot not in form.flown_by)
        or (form.asks_drone and name not in flown)
        or values["trigger"] not in form.triggers
        or (values.get("altitude_frame") == "terrain" and "ground" not in form.altitudes)
        or refused.message == "PX4 does not accept heights above terrain"
        or re.match("the speed is .* m/s, but |.* has no code for the drone", refused.message)
    ), (name, refused.message)


def check_flight(name, contents, result, mission, frame):
    ground = Ground(LINZ, partial(height_of, frame) if frame in SHAPES else lambda *_: 0.0)
    above = mission.above_takeoff_m()
    photo = mission.waypoints.photo or [True] * len(above)
    sites = [
        (*ground.place(w.latitude, w.longitude), up)
        for w, up, taken in zip(mission.waypoints, above, photo, strict=True)
        if taken
    ]
    flights = [replayed(name, content, ground, result, mission) for content in contents]
    shots = [shot for flight in flights for shot in flight.photos]
    # The distance along a line is measured from its first photo. Both ends of the line are rounded,
    # and the spacing has six decimals.
    place_m = 2.0 * math.sqrt(2.0) * PLACE_M.get(name, 0.5e-10 * DEGREE_M) + 1e-4
    place_m += 0.5e-6 * len(sites)
    height_m = HEIGHT_M.get(name, 0.5e-4) + 1e-6
    in_passing = mission.settings.trigger == "distance"
    if frame == "terrain":
        height_m += RASTER_M[frame]
    if in_passing and frame != "flat":
        height_m += BEND_M
    assert len(shots) == len(sites)
    for shot, site in zip(shots, sites, strict=True):
        assert math.dist(shot[:2], site[:2]) < place_m
        assert abs(shot[2] - site[2]) < height_m
    request = result.request
    least = result.scene.canopy_top_m + request.clearance - RASTER_M[frame] - height_m
    fastest = max(result.settings.speed_mps, result.settings.transit_mps)
    fastest += SPEED_MPS.get(name, 0.0)
    home = ground.height(*ground.back(*flights[0].points[0][:2]))
    for flight in flights:
        points = flight.points
        assert math.dist(points[0][:3], points[-1][:3]) < 1e-6
        assert all(point.speed <= fastest for point in points)
        for one, other in itertools.pairwise(points[1:-1]):
            x, y, up = np.linspace(one[:3], other[:3], 60).T
            clear = up + home - ground.height(*ground.back(x, y))
            assert clear.min() > least, (name, one, other)
    check_time(name, flights, result, mission, ground, bends=in_passing and frame != "flat")


def check_time(name, flights, result, mission, ground, *, bends):
    """Check that a file takes the time of the plan, and that each part of a split file takes its
    share of this time.
    """
    motion = {"acceleration": result.request.acceleration, "climb": result.request.climb}
    if len(flights) > 1:
        one_file = mission.settings._replace(file_waypoints=100_000)
        whole = mission._replace(settings=one_file)
        (content,) = mission_files([whole], formats()[name], "g").values()
        (alone,) = (replayed(name, content, ground, result, mission),)
        for part in flights:
            first, *_, last = working(part.points) * 2
            found = duration_s(between(part.points, first, last), **motion)
            assert found == pytest.approx(
                duration_s(between(alone.points, first, last), **motion), abs=1e-3
            )
        flights = [alone]
    expected = result.route.flights[mission.flight - 1].time_s
    points = flights[0].points
    # If the speed of a leg is rounded down, the leg takes longer by the same relative amount.
    slack = sum(
        math.dist(one[:3], other[:3]) / one.speed * SPEED_MPS.get(name, 0.0) / one.speed
        for one, other in itertools.pairwise(points[:-1])
        if one.speed
    )
    # On climbing lines, the climb rate limits the speed, and the file omits bends of less than 0.1
    # m.
    lines = sum(point.spacing == 0.0 for point in points)
    slack += bends * (lines + 1) * 2.0 * BEND_M / result.request.climb
    # PX4 holds at the ends of lines. Rounded positions make legs longer or shorter.
    slack += sum(point.hold for point in points if not point.photos)
    slack += len(points) * PLACE_M.get(name, 0.0)
    if mission.settings.altitude_frame == "terrain":
        # Such a leg is as short as the error of the raster's heights.
        slack += 4.0 * 2.0 * math.sqrt(RASTER_M["terrain"] / result.request.acceleration)
    slack += 0.01
    assert abs(duration_s(points, **motion) - expected) < slack
