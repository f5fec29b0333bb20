"""Properties that plans of any scene have."""

import json
import math
from collections import Counter
from dataclasses import replace
from itertools import pairwise, product

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support.plans import places_of, planned

from aosplan import InfeasibleError, PlanRequest, RequestError, plan
from aosplan.grid.patterns import GRIDS

# Grids compared with their waypoints


def extents(result, heading):
    """Size along and across a heading, computed from the positions."""
    turn = math.radians(heading)
    along = [e * math.sin(turn) + n * math.cos(turn) for e, n in places_of(result)]
    across = [e * math.cos(turn) - n * math.sin(turn) for e, n in places_of(result)]
    return max(along) - min(along), max(across) - min(across), along, across


def optimized():
    """Combinations of kinds of grid, objectives, bounds and headings.  The search for the spiral
    with the smallest aperture is slow, and it does not depend on the heading.
    """
    for grid, objective, heading in product(
        GRIDS, ("samples", "aperture", "time"), (0.0, 33.0, 270.0)
    ):
        slow = (grid, objective) == ("spiral", "aperture")
        yield grid, objective, {"vhat": 0.8, "max_samples": 20} if slow else {"vhat": 0.95}, heading
    yield pytest.param("spiral", "aperture", {"vhat": 0.95}, 33.0, marks=pytest.mark.slow)


@pytest.mark.parametrize(("grid", "objective", "bounds", "heading"), [*optimized()])
def test_the_grid_in_the_document_is_the_grid_of_the_waypoints(grid, objective, bounds, heading):
    result = planned(grid=grid, optimize=objective, heading=heading, **bounds)
    document = result.document()
    x, y, along, across = extents(result, heading)
    assert document["grid"]["kind"] == grid
    assert document["grid"]["extent_m"] == pytest.approx([x, y], abs=1e-9)
    assert document["samples"] == len(result.waypoints) == len(set(places_of(result)))
    pitch_x, pitch_y = document["grid"]["pitch_m"]
    assert pitch_x == document["baseline_m"]
    if grid == "spiral":  # one path of sites, like a line
        assert (document["grid"]["rows"], document["grid"]["columns"]) == (1, document["samples"])
        assert pitch_y == 4.0 * pitch_x
        return
    for values, pitch, count in (
        (along, pitch_x, document["grid"]["columns"]),
        (across, pitch_y, document["grid"]["rows"]),
    ):
        steps = {round((value - min(values)) / pitch, 6) for value in values}
        assert steps == set(range(count))


@pytest.mark.parametrize("grid", GRIDS)
def test_flight_length_and_time_are_sums_over_the_waypoints(grid):
    speed, acceleration, hold = 3.0, 1.5, 2.0
    result = planned(grid=grid, vhat=0.9, speed=speed, acceleration=acceleration, hold=hold)
    legs = [math.dist(*pair) for pair in pairwise(places_of(result))]
    time = hold * len(result.waypoints)
    for leg in legs:
        ramp = speed / acceleration
        if leg >= speed * ramp:  # The drone accelerates, flies at constant speed, and decelerates.
            time += 2 * ramp + (leg - speed * ramp) / speed
        else:
            time += 2 * math.sqrt(leg / acceleration)
    assert result.document()["flight"]["length_m"] == pytest.approx(sum(legs), rel=1e-9)
    assert result.document()["flight"]["time_s"] == pytest.approx(time, rel=1e-9)


def test_a_single_waypoint_has_length_zero_and_only_a_hold():
    flight = planned(vhat=0).document()["flight"]
    assert (flight["length_m"], flight["time_s"]) == (0.0, 1.0)


def test_the_removed_sites_of_a_trimmed_grid_are_the_farthest_from_its_middle():
    result = planned()
    pattern = result.solution.pattern
    assert (pattern.rows, pattern.columns, len(pattern.removed)) == (7, 8, 6)
    farthest = max(math.hypot(*place) for place in places_of(result))
    middle = ((pattern.rows - 1) / 2, (pattern.columns - 1) / 2)
    for site in pattern.removed:
        assert 2.8 * math.dist(site, middle) >= farthest - 1e-9


def test_plans_keep_to_the_bounds_on_aperture_and_samples():
    for most in (18.5, 19.0, 19.6):
        result = planned(max_aperture=most)
        assert max(result.extent_m) <= most * (1 + 1e-9)
        assert result.solution.met
    for most in (55, 64, 100):
        result = planned(optimize="aperture", max_samples=most)
        assert result.solution.pattern.samples <= most


# Properties of all plans

scenes = st.fixed_dictionaries(
    {
        "integrated_density": st.floats(0.01, 0.99),
        "occluder_size": st.floats(0.05, 2.0),
        "volume_base": st.floats(0.5, 10.0),
        "volume_height": st.floats(1.0, 25.0),
        "altitude": st.floats(40.0, 200.0),
    }
)
LENGTHS = ("occluder_size", "volume_base", "volume_height", "altitude")
bounds = st.fixed_dictionaries(
    {
        "vhat": st.sampled_from(["0.5", "0.8", "0.9"]),
        "grid": st.sampled_from(GRIDS),
        "optimize": st.sampled_from(["samples", "aperture"]),
        "model": st.sampled_from(["uniform", "layered"]),
        "max_samples": st.just(60),
        "allow_no_common_ground": st.just(True),
    }
)


def scaled(values, factor):
    return values | {name: values[name] * factor for name in LENGTHS}


@settings(max_examples=20)
@given(scene=scenes, options=bounds, exponent=st.integers(-6, 6))
def test_scaling_every_length_scales_the_baseline_and_nothing_else(scene, options, exponent):
    # Scaling by powers of two is exact, so that even the last digit must not change. The size of an
    # occluder in pixels does not depend on the scale.
    factor = 2.0**exponent
    # This is the number of slices of the layered model.
    assume(scene["volume_height"] / scene["occluder_size"] < 40)
    one = plan(PlanRequest(**scene, **options, clearance=0))
    other = plan(PlanRequest(**scaled(scene, factor), **options, clearance=0))
    assert other.solution.pattern == one.solution.pattern
    assert other.solution.samples_required == one.solution.samples_required
    assert other.solution.baseline_m == pytest.approx(one.solution.baseline_m * factor, rel=1e-12)
    assert other.solution.prediction.normalized == pytest.approx(
        one.solution.prediction.normalized, rel=1e-12
    )


@settings(max_examples=20)
@given(scene=scenes, options=bounds)
def test_evaluating_a_plan_again_meets_its_requirement(scene, options):
    assume(scene["volume_height"] / scene["occluder_size"] < 40)
    solved = plan(PlanRequest(**scene, **options))
    assert solved.solution.met
    assert solved.solution.prediction.shortfall <= (1 - float(options["vhat"])) * (1 + 1e-12)
    fixed = {
        "samples": solved.solution.pattern.samples,
        "baseline": solved.solution.baseline_m,
    }
    again = plan(PlanRequest(**scene, **options, **fixed))
    assert again.solution.met
    assert again.solution.pattern == solved.solution.pattern
    assert again.solution.prediction == solved.solution.prediction
    assert again.waypoints == solved.waypoints


@settings(max_examples=40)
@given(scene=scenes, visibility=st.floats(0.01, 0.99))
def test_absolute_targets_are_reached_or_refused_if_impossible(scene, visibility):
    p = scene["integrated_density"]
    try:
        result = plan(
            PlanRequest(**scene, visibility=visibility, baseline=500.0, allow_no_common_ground=True)
        )
    except InfeasibleError:
        # The target is greater than 1 - p², or so close to 1 - p² that it needs too many samples.
        assert p * (1 - p) / 5_000_000 >= (1 - p * p) - visibility
    else:
        assert result.solution.prediction.expected >= visibility - 1e-12
        assert result.solution.prediction.maximum > visibility or visibility <= 1 - p


@settings(max_examples=20)
@given(scene=scenes, options=bounds, heading=st.integers(-360, 360))
def test_a_request_written_out_and_read_back_makes_the_same_plan(scene, options, heading):
    assume(scene["volume_height"] / scene["occluder_size"] < 40)
    first = plan(PlanRequest(**scene, **options, heading=heading))
    again = plan(PlanRequest(**json.loads(json.dumps(first.request.document()))))
    assert again.request == first.request
    assert again.document() == first.document()


@given(vhat=st.sampled_from(["0.5", "0.75", "0.9", "0.98"]), grid=st.sampled_from(GRIDS))
def test_wider_baselines_never_need_more_samples(vhat, grid):
    counts = [
        planned(
            vhat=vhat, grid=grid, baseline=baseline, allow_no_common_ground=True
        ).solution.samples_required
        for baseline in (0.5, 1.0, 1.5, 2.0, 2.8, 4.0)
    ]
    assert counts == sorted(counts, reverse=True)


@given(coverage=st.floats(0.01, 1.0))
def test_a_larger_coverage_never_reduces_the_baseline(coverage):
    whole = planned(coverage=1.0).solution.baseline_m
    part = planned(coverage=coverage).solution.baseline_m
    assert part <= whole * (1 + 1e-12)
    # b = o h/H, where H is a quantile of the height.
    low, high = 2.506, 20.044
    height = high - coverage * (high - low)
    assert part == pytest.approx(0.2 * 40 / height, rel=2e-3)


def test_files_of_a_request_are_found_in_its_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "s.toml").write_text(
        'name = "there"\ndensity = 0.01\noccluder_size_m = 0.2\n'
        "volume_base_m = 2\nvolume_height_m = 9\n"
    )
    request = PlanRequest(altitude=40, scene="s.toml")
    assert plan(request, folder="sub").scene.name == "there"
    with pytest.raises(RequestError, match="no file"):
        plan(request)


def test_the_saved_request_contains_assumed_values():
    request = planned().request
    assert request == replace(PlanRequest(altitude=40), model="uniform", rays="nadir")


def test_limits_of_a_plan_name_the_bounds_that_were_reached():
    quantities = Counter(limit.quantity for limit in planned(max_aperture=18.5).solution.limits)
    assert quantities["extent_m"] == 1
    assert all(count == 1 for count in quantities.values())
