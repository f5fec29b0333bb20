"""Scenarios that are solved together as arrays, and scenarios that are solved row by row with
shared models, have the same numbers and messages as `plan`.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.sweeps import by_plan, results_of

from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.sweeps.block import STATUSES
from aosplan.sweeps.scenarios import ScenarioProduct, column_of, read_scenarios
from aosplan.sweeps.solve_block import solve_block
from aosplan.sweeps.solve_rows import RESULTS, WHOLE
from aosplan.sweeps.vectorized.solve_columns import solve_columns

pytest.importorskip("polars")

AXES = {
    "altitude": st.floats(5.0, 200.0),
    "focal_height": st.sampled_from([0.0, 1.5, 12.0, 25.0]),
    "coverage": st.floats(0.5, 1.0),
    "max_aperture": st.floats(1.0, 100.0),
    "max_samples": st.integers(1, 100),
    "samples": st.integers(1, 100),
    "baseline": st.floats(0.5, 20.0),
    "grid": st.sampled_from(["trimmed", "rectangle", "square", "line", "lanes"]),
    "speed": st.floats(1.0, 15.0),
    "acceleration": st.floats(0.5, 4.0),
    "clearance": st.sampled_from([0.0, 2.0, 5.0]),
    "hold": st.just(0.0) | st.floats(0.1, 3.0),
    "optimize": st.sampled_from(["samples", "time"]),
    "heading": st.sampled_from([0.0, 33.0, "auto"]),
    "drone": st.sampled_from(["dji-m3t", "dji-m4td", "ardupilot-copter", "none"]),
    "trigger": st.sampled_from(["stop", "distance"]),
    "payload": st.sampled_from(["dji-h20t", "dji-h30t", "dji-m3t"]),
    "autopilot": st.sampled_from(["px4", "ardupilot", "dji"]),
    "camera_control": st.sampled_from(["outputs", "mavlink"]),
    "altitude_frame": st.sampled_from(["takeoff", "terrain"]),
}
TARGETS = (
    {},
    {"vhat": st.sampled_from([0.0, 0.5, 0.9, "95%", 0.98, 0.999, 0.9999999])},
    {"visibility": st.sampled_from([0.0, 0.3, 0.6, "66%", 0.9, 0.99]) | st.floats(0.0, 0.99)},
)
SCENES = (
    {"scene": st.sampled_from(["paper-forest", "conifer-forest"])},
    {
        "density": st.just(0.0) | st.floats(1e-9, 0.05),
        "occluder_size": st.floats(0.05, 1.0),
        "volume_height": st.floats(1.0, 40.0),
        "volume_base": st.just(0.0) | st.floats(0.1, 5.0),
    },
    {
        "integrated_density": st.sampled_from([0.0, 0.2, 0.567, 0.999999, 1.0]),
        "occluder_size": st.floats(0.01, 1.0),
        "volume_height": st.floats(1.0, 40.0),
    },
)
CAMERAS = (
    {},
    {"camera": st.sampled_from(["dji-m3t-thermal", "dji-h20t-thermal"])},
    {
        "fov": st.floats(10.0, 120.0),
        "image_width": st.integers(10, 8000),
        "image_height": st.integers(10, 8000),
    },
    {
        "focal_length": st.floats(2.0, 50.0),
        "sensor_width": st.floats(4.0, 36.0),
        "image_width": st.integers(10, 8000),
        "image_height": st.integers(10, 8000),
    },
)


@st.composite
def crossings(draw):
    strategies = {"altitude": AXES["altitude"]}
    for name in draw(st.sets(st.sampled_from(sorted(AXES)), max_size=5)):
        strategies[name] = AXES[name]
    for alternatives in (TARGETS, SCENES, CAMERAS):
        strategies |= draw(st.sampled_from(alternatives))
    names = draw(st.permutations(sorted(strategies)))
    axes = {
        name: draw(st.lists(strategies[name], min_size=1, max_size=2, unique=True))
        for name in names
    }
    return ScenarioProduct({name: column_of(values) for name, values in axes.items()})


@given(crossing=crossings())
def test_columns_have_the_numbers_and_messages_of_plan(crossing):
    block = crossing.block(0)
    solved = solve_columns(block)
    if solved is None:
        assert {"optimize", "grid", "trigger", "heading", "drone"} & set(crossing.names)
        return
    status, reason = (
        column.reshape(-1) for column in (solved.statuses.status, solved.statuses.reason)
    )
    left = solved.left.reshape(-1)
    for row in np.random.default_rng(0).permutation(block.rows)[:20].tolist():
        if left[row]:
            continue  # Such rows are solved one by one.
        words = "" if reason[row] < 0 else solved.statuses.texts[reason[row]]
        state, why, expected = by_plan(block.request_values(row))
        assert (STATUSES[status[row]], words) == (state, why)
        if state != "ok":
            continue
        for name in RESULTS:
            found = np.broadcast_to(solved.columns[name], block.shape).reshape(-1)[row]
            if name in WHOLE and not math.isnan(expected[name]):
                assert found == expected[name], name
            # A tolerance is needed, because exp and log of arrays and of floats are rounded
            # differently. In a plan, legs are measured between waypoints. The rounding errors of
            # their coordinates are proportional to the total length of all N legs.
            legs = expected["samples"] if name.startswith("flight_") else 0
            rel = 1e-12 + legs * 2.0**-52
            assert found == pytest.approx(expected[name], rel=rel, nan_ok=True), name


ALONE = {
    "altitude": st.sampled_from([10.0, 24.0, 40.0, 60.0]),
    "model": st.sampled_from(["uniform", "layered"]),
    "grid": st.sampled_from(["trimmed", "lanes", "spiral", "line", "best"]),
    "optimize": st.sampled_from(["samples", "aperture", "time", "visibility"]),
    "vhat": st.sampled_from([0.5, 0.8, 0.9]),
    "samples": st.sampled_from([4, 9, 30]),
    "baseline": st.sampled_from([1.0, 3.0]),
    "max_aperture": st.sampled_from([4.0, 30.0]),
    "trigger": st.sampled_from(["stop", "distance"]),
    "wind_speed": st.sampled_from([4.0, 30.0]),
    "rays": st.sampled_from(["nadir", "oblique"]),
    "hold_error": st.sampled_from([0.0, 0.3]),
    "heading": st.sampled_from([0.0, 33.0, "best"]),
    "scene": st.sampled_from(["paper-forest", "nowhere"]),
    "flight_time": st.sampled_from([1.0, 20.0]),
    "line_length": st.just(200.0),
}


@settings(max_examples=8)
@given(data=st.data())
def test_rows_have_the_numbers_and_messages_of_plan(data):
    names = data.draw(st.permutations(sorted(ALONE)))[: data.draw(st.integers(1, 6))]
    axes = {name: [data.draw(ALONE[name])] for name in {*names, "altitude"}}
    if "wind_speed" in axes:
        axes["wind_from"] = [30.0]
    crossing = ScenarioProduct({name: column_of(values) for name, values in axes.items()})
    frame = solve_block(crossing.block(0), [], RESULTS)
    state, why, expected = by_plan(crossing.block(0).request_values(0))
    row = frame.row(0, named=True)
    assert (row["status"], row["reason"] or "") == (state, why)
    for name in RESULTS if state == "ok" else ():
        found = math.nan if row[name] is None else row[name]
        assert found == pytest.approx(expected[name], rel=1e-12, nan_ok=True), name


def test_scenarios_of_one_geometry_share_its_views_whatever_their_order(monkeypatch):
    from aosplan.models import layered

    made = []
    model = layered.LayeredModel
    monkeypatch.setattr(layered, "LayeredModel", lambda *a, **k: made.append(a) or model(*a, **k))
    crossing = ScenarioProduct(
        {
            "vhat": column_of([0.6, 0.7, 0.8]),
            "altitude": column_of([40.0, 60.0]),
            "model": column_of(["layered"]),
            "optimize": column_of(["samples", "aperture"]),
        }
    )
    block = crossing.block(0)
    frame = solve_block(block, crossing.names, RESULTS)
    assert len(made) == 2
    assert frame["altitude"].to_list() == [40.0, 40.0, 60.0, 60.0] * 3
    for row in range(block.rows):
        state, _, expected = by_plan(block.request_values(row))
        assert state == frame["status"][row] == "ok"
        assert frame["baseline_m"][row] == pytest.approx(expected["baseline_m"], rel=1e-12)
        assert frame["samples_required"][row] == expected["samples_required"]


def test_blocks_are_smaller_the_more_scenarios_are_solved_alone(tmp_path):
    def rows_a_block(text):
        path = tmp_path / "s.toml"
        path.write_text(
            "[sweep]\naltitude = { start = 40, stop = 99, count = 600 }\n"
            "speed = { start = 1, stop = 9, count = 512 }\n" + text
        )
        return read_scenarios(str(path)).block(0).rows

    (tmp_path / "scene.toml").write_text(
        'name = "wood"\ndensity = 0.01\noccluder_size_m = 0.2\n'
        "volume_base_m = 2.0\nvolume_height_m = 20.0\n"
    )
    assert rows_a_block("") == rows_a_block("scene = 'scene.toml'\n") == 1 << 18
    assert rows_a_block("max_aperture = 20\ntrigger = 'stop'\n") == 1 << 18
    assert rows_a_block("model = 'layered'\n") == rows_a_block("scene = 'x.laz'\n") == 1 << 10
    assert rows_a_block("grid = ['lanes', 'trimmed', 'line', 'square']\n") == 1 << 12


def test_uniform_scenes_and_cameras_of_files_are_columns(tmp_path):
    (tmp_path / "wood.toml").write_text(
        'name = "wood"\ndensity = 0.01\noccluder_size_m = 0.2\n'
        "volume_base_m = 2.0\nvolume_height_m = 20.0\n"
    )
    (tmp_path / "eye.toml").write_text(
        'name = "eye"\nfocal_length_mm = 9.1\nsensor_width_mm = 7.68\nsensor_height_mm = 6.14\n'
        "image_width_px = 640\nimage_height_px = 512\n"
    )
    values = {"altitude": 40.0, "scene": "wood.toml", "camera": "eye.toml"}
    block = ScenarioProduct({name: column_of([value]) for name, value in values.items()}).block(0)
    solved = solve_columns(block, str(tmp_path))
    assert solved.holds.all()
    expected = results_of(plan(PlanRequest(**values), folder=str(tmp_path)))
    for name in RESULTS:
        assert float(np.ravel(solved.columns[name])[0]) == pytest.approx(expected[name], rel=1e-12)


@pytest.mark.parametrize(
    "axes",
    [
        {"payload": ["dji-h20t", "dji-h30t", "dji-h20n"], "drone": ["dji-m300", "dji-m3t"]},
        {"payload": ["dji-h30t", "dji-h20t"], "camera": ["dji-h20t-thermal", "dji-h30t-wide"]},
        {"autopilot": ["px4", "ardupilot"], "drone": ["px4-multicopter", "dji-m3t"]},
        {"autopilot": ["px4", "ardupilot"], "hold": [0.1, 1.0, 1.5]},
        {"autopilot": ["px4", "dji"], "altitude_frame": ["takeoff", "terrain"]},
        {"camera_control": ["outputs", "mavlink"], "autopilot": ["px4", "dji"]},
        {"drone": ["dji-m3t", "dji-m350"], "speed": [3.0, 30.0], "payload": ["dji-h30t"]},
    ],
)
def test_the_options_of_an_aircraft_decide_together(axes):
    crossing = ScenarioProduct(
        {name: column_of(values) for name, values in ({"altitude": [60.0]} | axes).items()}
    )
    block = crossing.block(0)
    frame = solve_block(block, [], RESULTS)
    for row, shown in enumerate(frame.rows(named=True)):
        state, why, expected = by_plan(block.request_values(row))
        assert (shown["status"], shown["reason"] or "") == (state, why)
        for name in RESULTS if state == "ok" else ():
            assert shown[name] == pytest.approx(expected[name], rel=1e-12), name


def test_fixed_baselines_are_columns_too():
    crossing = ScenarioProduct(
        {
            "altitude": column_of([40.0, 60.0]),
            "baseline": column_of([0.7, 1.5, 2.8, 6.0]),
            "samples": column_of([9, 49, 50]),
        }
    )
    left = solve_columns(crossing.block(0)).left
    # Below the rule's baseline, 2.8 m at 40 m and 4.2 m at 60 m, the volume is treated as slices.
    assert left[0].all(axis=1).tolist() == [True, True, False, False]
    assert left[1].all(axis=1).tolist() == [True, True, True, False]
    assert not left.all(axis=2).any() or not (left.any(axis=2) & ~left.all(axis=2)).any()


@pytest.mark.parametrize(
    "axes",
    [
        {"vhat": [0.9, 0.98], "max_aperture": [200.0]},
        {"vhat": [0.9, 0.98], "max_aperture": [30.0], "max_samples": [20, 300]},
        {"visibility": [0.5, 0.66, 0.99]},
        {"visibility": [0.5, 0.66], "grid": ["line", "square"], "allow_no_common_ground": [True]},
        {"samples": [9, 50], "baseline": [4.5, 6.0], "max_samples": [20]},
        {"samples": [10, 49], "max_aperture": [80.0]},
        {"baseline": [4.5], "vhat": [0.7], "max_samples": [60], "max_aperture": [20.0]},
        {"scene": ["paper-forest", "conifer-forest"], "focal_height": [0.0, 30.0]},
        {"vhat": [0.9, 0.99999999]},
        {"samples": [50], "max_samples": [9_000_000_000_000_000]},
    ],
)
def test_these_scenarios_are_all_solved_as_columns(axes):
    crossing = ScenarioProduct(
        {
            name: column_of(values)
            for name, values in ({"altitude": [10.0, 30.0, 60.0]} | axes).items()
        }
    )
    block = crossing.block(0)
    solved = solve_columns(block)
    assert not solved.left.any()
    for row in range(block.rows):
        status, reason = (
            part.reshape(-1)[row] for part in (solved.statuses.status, solved.statuses.reason)
        )
        words = "" if reason < 0 else solved.statuses.texts[reason]
        assert (STATUSES[status], words) == by_plan(block.request_values(row))[:2]
