"""The choice of grids and headings, and the trade-off, compared with brute force."""

import math
from fractions import Fraction

import numpy as np
import pytest

from aosplan import PlanRequest, plan
from aosplan.errors import InfeasibleError
from aosplan.flight.kinematics import Timing, path_of
from aosplan.models.correlogram import CorrelogramModel
from aosplan.models.layered import LayeredModel
from aosplan.models.measured import MeasuredModel
from aosplan.models.uniform import UniformModel
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.scene import Layer
from aosplan.scenes.voxels import VoxelVolume
from aosplan.solver.problem import Bounds, GridKind, Problem, Requirement
from aosplan.solver.solve import COMPARED, kinds, solve, solve_best, solve_best_heading
from aosplan.solver.solve_by_scan import Candidate, Scan
from aosplan.solver.tradeoff import tradeoff

PAPER = UniformModel(0.567, 0.433, 3.5)
SLICES = LayeredModel([Layer(2.0 + k, 2.5 + k, 0.05, 0.3) for k in range(8)], 40.0)


def vhat(text):
    return Requirement("normalized", Fraction(text))


def extent(solution):
    return solution.pattern.longer_side * solution.baseline_m


def flight_time(problem, solution):
    return path_of(solution.pattern, problem.timing).time_s(solution.baseline_m, problem.timing)


def attempts(problem, grids):
    for grid in grids:
        try:
            yield problem._replace(grid=grid), solve(problem._replace(grid=grid))
        except InfeasibleError:
            continue


@pytest.mark.parametrize("model", [PAPER, SLICES], ids=["uniform", "layered"])
@pytest.mark.parametrize("objective", ["samples", "aperture", "time"])
def test_the_best_grid_is_the_best_of_all_kinds_by_themselves(model, objective):
    bounds = Bounds(max_samples=60)
    problem = Problem(model, vhat("0.9"), bounds=bounds, objective=objective)
    grids = [*kinds("best", "best", "best"), GridKind("rectangle"), GridKind("square")]
    best = solve_best([problem._replace(grid=grid) for grid in kinds("best", "best", "best")])
    every = [solution for _, solution in attempts(problem, grids)]
    assert len(every) > 20
    if objective == "samples":
        assert best.solution.pattern.samples == min(each.pattern.samples for each in every)
    elif objective == "time":
        least = min(flight_time(problem, each) for each in every)
        assert flight_time(problem, best.solution) <= least * (1 + 1e-9)
    else:
        assert extent(best.solution) <= 1.01 * min(extent(each) for each in every)
    assert best.solution.limits[-1].quantity == "choice"
    assert best.problem.name in best.solution.limits[-1].message


def test_a_grid_without_common_ground_is_chosen_only_if_there_is_no_other():
    problem = Problem(PAPER, vhat("0.98"))
    problems = [problem._replace(grid=grid) for grid in kinds("best")]
    # The line has the same number of samples, but a shorter flight.
    assert solve_best(problems).problem.grid.name == "line"
    grounded = solve_best(problems, footprint_m=(30.0, 30.0))
    assert grounded.problem.grid.name == "trimmed"
    assert (
        "line 50 because no ground would be in all photos" in grounded.solution.limits[-1].message
    )
    assert solve_best(problems, footprint_m=(1.0, 1.0)).problem.grid.name == "line"


def test_an_unreachable_target_names_all_compared_grids():
    problem = Problem(PAPER, vhat("0.98"), bounds=Bounds(max_samples=20))
    with pytest.raises(InfeasibleError, match="3 lanes of pitch 4, spiral of pitch 4, line"):
        solve_best([problem._replace(grid=grid) for grid in kinds("best")])


def test_options_that_are_left_open_are_all_compared():
    assert [kind.name for kind in kinds("best")] == list(COMPARED)
    assert len(kinds("lanes", "best", "best")) == 20
    assert {kind.lanes for kind in kinds("lanes", "best", 2.0)} == {2, 3, 4, 5}
    assert all(kind.lane_pitch >= 2.0 for kind in kinds("spiral", None, "best"))
    assert kinds("trimmed") == (GridKind(),)
    assert [kind.name for kind in kinds("best", spirals=False)] == ["trimmed", "lanes", "line"]


# --- Headings ------------------------------------------------------------------------------


def hedges(angle_deg):
    """Parallel walls of leaves.  Views from a line across the walls see more than views from a line
    along them.
    """
    cells = np.arange(64) * 0.25
    x, y = np.meshgrid(cells, cells)
    angle = math.radians(angle_deg)
    # The walls are perpendicular to this direction, which is to the right of the angle.
    across = x * math.cos(angle) - y * math.sin(angle)
    rows = np.zeros((32, 64, 64), dtype=bool)
    rows[12:28] = (across % 4.0 < 1.0) & (np.random.default_rng(1).random((16, 64, 64)) < 0.5)
    return VoxelVolume(rows, 0.25, min_height_m=0.5, source="generated")


def hedge_problem(grid, heading=0.0, angle=0.0, objective="samples"):
    volume = hedges(angle)
    model = MeasuredModel(volume, 40.0, heading_deg=heading)
    surrogate = CorrelogramModel(correlogram(volume), 40.0, heading_deg=heading)
    bounds = Bounds(max_samples=30, max_aperture_m=12.0)
    return Problem(model, vhat("0.5"), grid, bounds, objective, surrogate=surrogate)


@pytest.mark.slow
def test_a_line_is_flown_across_the_hedges():
    problem = hedge_problem(GridKind("line"))
    best = solve_best_heading([problem])
    heading = best.problem.model.heading_deg
    assert abs((heading - 90.0 + 90.0) % 180.0 - 90.0) <= 30.0
    every = []
    for step in range(12):
        try:
            every.append(solve(problem.turned(15.0 * step)).pattern.samples)
        except InfeasibleError:
            continue
    assert best.solution.pattern.samples <= min(every)
    assert best.solution.prediction == best.problem.model.predict(*best.solution[:2])


def test_turning_a_problem_turns_its_models_and_the_wind_in_its_axes():
    problem = hedge_problem(GridKind("line"))._replace(timing=Timing(wind=(3.0, 1.0)))
    turned = problem.turned(90.0)
    assert turned.model.heading_deg == turned.surrogate.heading_deg == 90.0
    assert problem.model.heading_deg == problem.surrogate.heading_deg == 0.0
    # If the axes turn to the right, wind along the old heading is to the left of the new heading.
    assert turned.timing.wind == pytest.approx((1.0, -3.0))
    pattern = GridKind("line").pattern(5)
    fresh = hedge_problem(GridKind("line"), heading=90.0)
    assert turned.model.predict(pattern, 2.0) == fresh.model.predict(pattern, 2.0)
    assert turned.surrogate.predict(pattern, 2.0) == fresh.surrogate.predict(pattern, 2.0)


# --- The trade-off -------------------------------------------------------------------------


@pytest.mark.parametrize("model", [PAPER, SLICES], ids=["uniform", "layered"])
@pytest.mark.parametrize("grid", [GridKind(), GridKind("lanes"), GridKind("spiral")])
def test_each_row_is_the_smallest_baseline_of_its_samples(model, grid):
    problem = Problem(model, vhat("0.9"), grid, Bounds(max_samples=40), "aperture")
    solution = solve(problem)
    rows = tradeoff([problem], problem, solution)
    counts = [row.pattern.samples for row in rows]
    assert counts == [n for n in range(1, 41) if grid.pattern(n).samples == n]
    for row in rows:
        assert row.prediction == model.predict(row.pattern, row.baseline_m)
        assert row.meets == problem.requirement.is_met(row.prediction)
        if row.meets and not row.chosen:
            narrower = model.predict(row.pattern, 0.999 * row.baseline_m)
            assert not problem.requirement.is_met(narrower)
        if not row.meets:
            assert row.baseline_m == problem.widest_m(row.pattern)
    (chosen,) = (row for row in rows if row.chosen)
    assert (chosen.pattern, chosen.baseline_m) == (solution.pattern, solution.baseline_m)


def test_the_pareto_front_has_the_rows_that_no_row_dominates():
    problems = [
        Problem(SLICES, vhat("0.9"), grid, Bounds(max_samples=60), "time") for grid in kinds("best")
    ]
    best = solve_best(problems)
    rows = tradeoff(problems, best.problem, best.solution)
    measured = [
        (row.pattern.samples, row.pattern.longer_side * row.baseline_m, row.time_s) for row in rows
    ]
    meeting = [one for one, row in zip(measured, rows, strict=True) if row.meets]
    assert any(row.front for row in rows)
    for one, row in zip(measured, rows, strict=True):
        beaten = any(
            other != one and all(a <= b for a, b in zip(other, one, strict=True))
            for other in meeting
        )
        if row.front:
            assert row.meets
            assert not beaten
        elif row.meets:
            assert beaten or measured.count(one) > 1


def test_trade_off_rows_of_a_measured_stand_agree_with_its_model():
    problem = hedge_problem(GridKind(), objective="time")
    solution = solve(problem)
    rows = tradeoff([problem], problem, solution)
    counts = {1, 2, 4, 6, 9, 12, 16, 20, 25, 30}
    assert {row.pattern.samples for row in rows} == counts | {solution.pattern.samples}
    scan = Scan(problem)
    for row in rows:
        assert row.prediction == problem.model.predict(row.pattern, row.baseline_m)
        reached = [
            problem.requirement.is_met(scan.predict(Candidate(row.pattern, baseline)))
            for baseline in scan.baselines_m(row.pattern)
        ]
        assert row.meets == any(reached)


def test_a_scene_without_occluders_has_no_trade_off():
    clear = plan(PlanRequest(altitude=40, density=0, occluder_size=0.2, volume_height=9))
    with pytest.raises(Exception, match="no occluder is above"):
        clear.tradeoff()
