"""Flight times, compared with a fine integration of the motion, and paths, compared with their
waypoints.
"""

import math
from fractions import Fraction
from itertools import pairwise

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from aosplan.errors import InfeasibleError
from aosplan.flight.kinematics import (
    Path,
    Timing,
    lines_of,
    passing_s,
    path_of,
    stop_to_stop_s,
    wind_mps,
)
from aosplan.flight.track import FlightPoints, Track, with_turns
from aosplan.grid.patterns import LATTICES, pattern_for
from aosplan.models.uniform import UniformModel
from aosplan.solver.problem import Bounds, GridKind, Problem, Requirement
from aosplan.solver.solve import solve

speeds = st.floats(0.5, 20.0)
accelerations = st.floats(0.3, 6.0)


def integrated(bounds, acceleration, stops, step=2e-3):
    """Times at which the fastest motion within the speed limits reaches the ends of the cells.

    `bounds` are the speed limits of the cells, whose length is `step`.  `stops` are the numbers of
    the cell ends at which the drone stops.  The speeds come from a forward and a backward sweep, in
    which v² increases by at most 2 a s over a length s.
    """
    speed = [0.0]
    for cell, bound in enumerate(bounds):
        reach = math.sqrt(speed[-1] ** 2 + 2.0 * acceleration * step)
        speed.append(0.0 if cell + 1 in stops else min(bound, reach))
    for cell in reversed(range(len(bounds))):
        reach = math.sqrt(speed[cell + 1] ** 2 + 2.0 * acceleration * step)
        speed[cell] = min(speed[cell], reach)
    times = [0.0]
    for start, stop in pairwise(speed):
        times.append(times[-1] + 2.0 * step / (start + stop))
    return times


@settings(max_examples=60)
@given(length=st.floats(0.1, 60.0), speed=speeds, acceleration=accelerations)
def test_stop_to_stop_times_equal_an_integration_of_the_fastest_motion(length, speed, acceleration):
    cells = 4000
    times = integrated([speed] * cells, acceleration, {cells}, length / cells)
    time = stop_to_stop_s(length, speed, acceleration)
    # If the speed limit is reached within a cell, the error of the sweep is less than the time for
    # this cell.
    assert times[-1] == pytest.approx(time, rel=1e-3)
    for cell in range(0, cells + 1, 250):
        passed = passing_s(cell * length / cells, length, speed, acceleration)
        assert times[cell] == pytest.approx(passed, abs=1e-3 * time)


def motion(points, timing, bound_of, stops):
    """Times at which points are reached, integrated along the polyline through them."""
    step, bounds, ends = 2e-3, [], [0]
    for start, stop in pairwise(points):
        cells = max(round(math.dist(start, stop) / step), 1)
        bounds += [bound_of(start, stop)] * cells
        ends.append(len(bounds))
    times = integrated(bounds, timing.acceleration_mps2, {ends[place] for place in stops}, step)
    return [times[end] for end in ends]


def track_of(points, photo=None):
    return Track(*map(list, zip(*points, strict=True)), photo or [True] * len(points))


def all_photos(east, north):
    return FlightPoints(list(east), list(north), [True] * len(east))


SLOPED = [(0, 0, 40), (3, 0, 41), (6, 0, 44), (6, 9, 44), (6, 9, 60), (-20, 9, 45.5)]


def bound(start, stop, timing):
    """Speed along a sloped leg.  Its horizontal component is at most the cruise speed, and its
    vertical component at most the climb speed.
    """
    length, level = math.dist(start, stop), math.dist(start[:2], stop[:2])
    rise = abs(stop[2] - start[2])
    return min(
        timing.speed_mps * length / level if level else math.inf,
        timing.climb_mps * length / rise if rise else math.inf,
    )


@pytest.mark.parametrize("climb", [0.7, 3.0])
def test_the_time_of_a_track_with_stops_equals_an_integration(climb):
    timing = Timing(speed_mps=4.0, acceleration_mps2=1.5, hold_s=0.0, climb_mps=climb)
    times = track_of(SLOPED).times_s(timing)
    true = motion(SLOPED, timing, lambda a, b: bound(a, b, timing), range(len(SLOPED)))
    assert times == pytest.approx(true, rel=2e-3, abs=2e-3)
    held = track_of(SLOPED).times_s(timing._replace(hold_s=2.0))
    assert held == pytest.approx([t + 2.0 * k for k, t in enumerate(times)])


@pytest.mark.parametrize("speed", [1.0, 3.0, 7.0])
@pytest.mark.parametrize("grid", ["trimmed", "lanes", "line"])
def test_the_time_of_lines_without_stops_equals_an_integration(speed, grid):
    timing = Timing(speed, 2.0, 0.0, fly_through=True)
    pattern = pattern_for(grid, 20)
    east = [2.8 * column for _, column in pattern.sites()]
    north = [2.8 * row * pattern.row_pitch for row, _ in pattern.sites()]
    sites = with_turns(
        all_photos(east, north), spacing_m=2.8, run_in_m=timing.run_in_m, heading_deg=90.0
    )
    points = list(zip(sites.east_m, sites.north_m, [40.0] * len(sites.photo), strict=True))
    track = track_of(points, sites.photo)
    turning = [place for place, photo in enumerate(sites.photo) if not photo]
    assert track.stops(timing) == turning  # only at run-ins and run-outs
    true = motion(points, timing, lambda a, b: bound(a, b, timing), turning)
    assert track.times_s(timing) == pytest.approx(true, rel=2e-3, abs=5e-3)


@pytest.mark.parametrize("speed", [1.0, 3.0, 7.0])
def test_photos_while_flying_are_taken_at_constant_speed(speed):
    timing = Timing(speed, 2.0, 0.0, fly_through=True)
    sites = with_turns(
        all_photos([0.0] * 8, [3.0 * k for k in range(8)]),
        spacing_m=3.0,
        run_in_m=timing.run_in_m,
        heading_deg=0.0,
    )
    points = list(zip(sites.east_m, sites.north_m, [0.0] * 10, strict=True))
    times = track_of(points, sites.photo).times_s(timing)
    photos = [time for time, photo in zip(times, sites.photo, strict=True) if photo]
    assert [b - a for a, b in pairwise(photos)] == pytest.approx([3.0 / speed] * 7, rel=1e-12)
    assert photos[0] == pytest.approx(speed / 2.0)  # The first photo is v/a after the stop.


def test_a_steep_line_is_flown_as_slowly_as_its_steepest_leg_allows():
    timing = Timing(5.0, 2.0, 0.0, climb_mps=1.0, fly_through=True)
    points = [(0.0, 3.0 * k, 40.0 + (4.0 if k > 4 else 0.0)) for k in range(12)]
    times = track_of(points).times_s(timing)
    for (start, stop), (one, other) in zip(pairwise(times), pairwise(points), strict=True):
        assert abs(other[2] - one[2]) / (stop - start) <= timing.climb_mps * (1 + 1e-9)


# Wind


@given(speed=st.floats(0.1, 14.0), start=st.floats(0, 360), course=st.floats(0, 360))
def test_the_ground_speed_in_wind_keeps_the_airspeed_limit(speed, start, course):
    timing = Timing(1e3, wind=wind_mps(speed, start), airspeed_mps=15.0)
    u = math.cos(math.radians(course)), math.sin(math.radians(course))
    ground = timing.ground_speed_mps(*u)
    through = [ground * axis - blown for axis, blown in zip(u, timing.wind, strict=True)]
    assert math.hypot(*through) == pytest.approx(15.0, rel=1e-12)
    assert 15.0 - speed <= ground * (1 + 1e-12)
    assert ground <= (15.0 + speed) * (1 + 1e-12)


def test_wind_from_the_north_blows_south():
    assert wind_mps(3.0, 0.0) == pytest.approx((-3.0, 0.0))
    # Wind from the east blows to the west.
    assert wind_mps(3.0, 90.0) == pytest.approx((0.0, -3.0), abs=1e-12)
    assert wind_mps(3.0, 120.0, heading_deg=120.0) == pytest.approx((-3.0, 0.0))


def test_a_drone_keeps_its_ground_speed_up_to_the_airspeed_limit():
    calm = Timing(5.0)
    light = Timing(5.0, wind=wind_mps(8.0, 0.0), airspeed_mps=15.0)
    assert light.leg_s(30.0) == calm.leg_s(30.0)  # An airspeed of 13 m/s is possible.
    strong = Timing(5.0, wind=wind_mps(12.0, 0.0), airspeed_mps=15.0)
    assert strong.leg_s(30.0) == pytest.approx(30.0 / 3.0 + 3.0 / 2.0)
    assert strong.leg_s(-30.0) == calm.leg_s(30.0)
    with pytest.raises(InfeasibleError, match="wind of 15 m/s"):
        Timing(5.0, wind=wind_mps(15.0, 0.0), airspeed_mps=15.0).leg_s(-30.0)


# Paths of patterns, which the solver uses, and tracks of waypoints


def flown_track(pattern, baseline, timing):
    sites = [(c * baseline, r * pattern.row_pitch * baseline) for r, c in pattern.sites()]
    x, y = map(list, zip(*sites, strict=True))
    photo = [True] * len(x)
    if timing.fly_through:
        # For a heading of 90 degrees, the x axis of the pattern points east.
        x, y, photo = with_turns(
            all_photos(x, y), spacing_m=baseline, run_in_m=timing.run_in_m, heading_deg=90.0
        )
    return Track(x, y, [0.0] * len(x), photo)


@settings(max_examples=75)
@given(
    grid=st.sampled_from(LATTICES),
    samples=st.integers(1, 80),
    baseline=st.floats(0.1, 30.0),
    speed=speeds,
    through=st.booleans(),
    interval=st.sampled_from([0.0, 0.7, 2.0]),
    least=st.sampled_from([0.0, 1.0]),
    wind=st.sampled_from([(0.0, 0.0), (0.0, 9.0), (-7.0, 3.0), (8.5, 0.0)]),
)
def test_a_path_of_a_pattern_equals_the_track_of_its_waypoints(
    grid, samples, baseline, speed, through, interval, least, wind
):
    pattern = pattern_for(grid, samples)
    timing = Timing(speed, 2.0, 0.0 if through else 1.5, fly_through=through)
    timing = timing._replace(interval_s=interval, wind=wind, airspeed_mps=10.0)
    timing = timing._replace(least_run_in_m=least)
    flown = timing.at(baseline)
    if through and wind != (0.0, 0.0):
        courses = [(1.0, 0.0), (-1.0, 0.0)] if len(list(pattern.sites())) > 1 else [(1.0, 0.0)]
        used = path_of(pattern, timing).courses
        assert set(used) <= set(courses)
        flown = flown._replace(speed_mps=min(flown.ground_speed_mps(*course) for course in used))
    track = flown_track(pattern, baseline, flown)
    first = track.photo.index(True)
    last = len(track.photo) - 1 - track.photo[::-1].index(True)
    times, lengths = track.times_s(flown), track.lengths_m
    path = path_of(pattern, timing)
    assert path.time_s(baseline, timing) == pytest.approx(
        times[last] - times[first] + flown.hold_s, rel=1e-9
    )
    if wind == (0.0, 0.0):
        assert path.length_m(baseline, timing) == pytest.approx(
            lengths[last] - lengths[first], rel=1e-9
        )


@given(
    grid=st.sampled_from(LATTICES),
    samples=st.integers(1, 60),
    baseline=st.floats(0.1, 30.0),
    speed=speeds,
    through=st.booleans(),
    interval=st.sampled_from([0.0, 1.0]),
)
def test_no_pattern_is_flown_faster_than_the_shortest_path(
    grid, samples, baseline, speed, through, interval
):
    timing = Timing(speed, 2.0, 0.0 if through else 1.0, fly_through=through, interval_s=interval)
    pattern = pattern_for(grid, samples)
    bound_s = Path.shortest(pattern.samples, timing).time_s(baseline, timing)
    assert path_of(pattern, timing).time_s(baseline, timing) >= bound_s * (1 - 1e-12)


@pytest.mark.parametrize("grid", ["trimmed", "rectangle", "lanes"])
@pytest.mark.parametrize(
    "timing",
    [
        Timing(5.0, 2.0, 0.0, fly_through=True),
        Timing(9.0, 3.0, 0.0, fly_through=True, interval_s=0.7),
        Timing(9.0, 3.0, 0.0, fly_through=True, interval_s=3.0, least_run_in_m=1.0),
        Timing(5.0, 2.0, 0.5, wind=(6.0, -5.0), airspeed_mps=9.0),
        Timing(5.0, 2.0, 0.0, fly_through=True, wind=(6.0, -5.0), airspeed_mps=9.0),
    ],
    ids=["through", "camera", "slow camera", "wind", "through wind"],
)
def test_the_lowest_time_is_the_minimum_over_all_sample_counts(grid, timing):
    model = UniformModel(0.5, 0.5, 4.0)
    problem = Problem(
        model,
        Requirement("normalized", Fraction(9, 10)),
        GridKind(grid),
        Bounds(max_samples=40),
        "time",
        timing,
    )
    found = solve(problem)
    time = path_of(found.pattern, timing).time_s(found.baseline_m, timing)
    for samples in range(10, 41):
        pattern = problem.grid.pattern(samples)
        baseline = problem.smallest_baseline_m(pattern)
        if baseline is not None and pattern.samples <= 40:
            other = path_of(pattern, timing).time_s(baseline, timing)
            assert time <= other * (1 + 1e-12), samples
    assert problem.meets(found.pattern, found.baseline_m)


@given(grid=st.sampled_from(LATTICES), samples=st.integers(1, 120))
def test_lines_contain_each_site_once_at_multiples_of_the_spacing(grid, samples):
    pattern = pattern_for(grid, samples)
    sites = [(2.0 * c, 2.0 * r * pattern.row_pitch) for r, c in pattern.sites()]
    places = []
    for line in lines_of(sites, 2.0):
        places += range(line.first, line.last + 1)
        assert (line.x, line.y) in {(1.0, 0.0), (-1.0, 0.0)}
        for one, other in pairwise(sites[line.first : line.last + 1]):
            assert other[0] - one[0] == 2.0 * line.x
            assert other[1] == one[1]
    assert places == list(range(len(sites)))


def test_a_gap_of_whole_spacings_does_not_split_a_line_and_others_do():
    sites = [(0.0, 0.0), (2.0, 0.0), (8.0, 0.0), (10.0, 0.0), (13.0, 0.0)]
    assert [line[:2] for line in lines_of(sites, 2.0)] == [(0, 3), (4, 4)]


def test_the_photo_interval_limits_the_speed_by_the_baseline():
    timing = Timing(5.0, 2.0, 0.0, fly_through=True, interval_s=2.0)
    assert timing.at(4.0).speed_mps == 2.0
    assert timing.at(40.0).speed_mps == 5.0
    assert timing._replace(fly_through=False).at(4.0).speed_mps == 5.0


@given(distance=st.floats(0, 1), length=st.floats(0, 1e4), speed=speeds, acceleration=accelerations)
def test_passing_times_increase_and_are_symmetric_in_time(distance, length, speed, acceleration):
    assume(length > 1e-6)
    at = distance * length
    there = passing_s(at, length, speed, acceleration)
    back = passing_s(length - at, length, speed, acceleration)
    whole = stop_to_stop_s(length, speed, acceleration)
    assert 0.0 <= there <= whole * (1 + 1e-12)
    assert there + back == pytest.approx(whole, rel=1e-6, abs=1e-9)
