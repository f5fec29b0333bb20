"""The solver compared with enumeration of all patterns at all baselines."""

import random
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.problems import (
    KINDS,
    OBJECTIVES,
    PAPER,
    attempt,
    enumerate_samples,
    extent,
    near,
    patterns,
    problems,
    reaches,
    vhat,
    visible,
    widest,
)

from aosplan.flight.kinematics import Timing, path_of
from aosplan.models.layered import LayeredModel
from aosplan.models.uniform import UniformModel
from aosplan.scenes.scene import Layer
from aosplan.solver.problem import Bounds, GridKind, Problem
from aosplan.solver.solution import Solution
from aosplan.solver.solve import solve
from aosplan.solver.solve_monotone import fewest_at

# --- Enumeration ---------------------------------------------------------------------------

MOST_KINDS = [
    pytest.param(kind, marks=[pytest.mark.slow] if kind in ("line", "spiral") else [])
    for kind in KINDS
]
"""Kinds of grid.  Lines and spirals are slow tests, because they have a pattern for each number of
samples.
"""


def smallest_baseline(problem, pattern):
    """The smallest baseline that meets the target, found by 45 bisections without the tolerance.

    It is the widest baseline if this one meets the target only within the tolerance, and None if no
    baseline meets the target.
    """
    low, high = 0.0, widest(problem, pattern)
    if not reaches(problem, pattern, high):
        return None
    if not reaches(problem, pattern, high, 0.0):
        return high
    for _ in range(45):
        middle = (low + high) / 2
        low, high = (low, middle) if reaches(problem, pattern, middle, 0.0) else (middle, high)
    return high


def enumerate_baselines(problem, most):
    """Every pattern that reaches the target, with its smallest baseline."""
    found = (
        (pattern, smallest_baseline(problem, pattern)) for pattern in patterns(problem.grid, most)
    )
    return [(pattern, baseline) for pattern, baseline in found if baseline is not None]


def flight_time(problem, pattern, baseline):
    return path_of(pattern).time_s(baseline, problem.timing)


# --- Comparison with enumeration -----------------------------------------------------------


@pytest.mark.parametrize("quantity", ["normalized", "visibility"])
@pytest.mark.parametrize("grid", KINDS)
def test_the_fewest_samples_are_those_that_enumeration_finds(grid, quantity):
    solved = 0
    for problem in problems(1, 30, grid=grid, objective="samples", quantity=quantity):
        expected = enumerate_samples(problem, problem.bounds.max_samples)
        found = attempt(problem)
        assert (found and found.pattern.samples) == expected, problem
        if found is not None:
            solved += 1
            assert found.met
            assert reaches(problem, found.pattern, found.baseline_m)
            # This is the baseline of the paper's rule, or the widest baseline that is allowed.
            if isinstance(problem.model, UniformModel):
                assert found.baseline_m == widest(problem, found.pattern)
            else:
                smallest = smallest_baseline(problem, found.pattern)
                # Near the baseline at which the last neighbours of a spiral stop sharing occluders,
                # K is flat. The tolerance is therefore √(1e-15).
                accuracy = 1e-7 if grid == "spiral" else 1e-11
                assert found.baseline_m == near(smallest, rel=accuracy)
    assert solved > 10


@pytest.mark.parametrize("grid", MOST_KINDS)
def test_the_least_aperture_is_that_of_enumeration_and_takes_the_fewest_samples_within_1_percent(
    grid,
):
    solved = 0
    for problem in problems(2, 15, grid=grid, objective="aperture"):
        candidates = enumerate_baselines(problem, problem.bounds.max_samples)
        found = attempt(problem)
        assert (found is None) == (not candidates), problem
        if found is None:
            continue
        solved += 1
        least = min(baseline * pattern.longer_side for pattern, baseline in candidates)
        expected, baseline = next(
            (pattern, baseline)
            for pattern, baseline in candidates
            if baseline * pattern.longer_side <= 1.01 * least * (1 + 1e-12)
        )
        assert found.pattern == expected, problem
        assert found.baseline_m == near(baseline, rel=1e-11)
    assert solved > 4


@pytest.mark.parametrize("grid", MOST_KINDS)
def test_no_pattern_that_enumeration_finds_takes_less_time(grid):
    solved = 0
    for problem in problems(3, 20, grid=grid, objective="time"):
        candidates = enumerate_baselines(problem, problem.bounds.max_samples)
        found = attempt(problem)
        assert (found is None) == (not candidates), problem
        if found is None:
            continue
        solved += 1
        least = min(flight_time(problem, *candidate) for candidate in candidates)
        assert flight_time(problem, found.pattern, found.baseline_m) <= least * (1 + 1e-9), problem
    assert solved > 6


TWO_SLICES = LayeredModel([Layer(2.0, 2.0, 0.2, 0.5), Layer(8.0, 8.0, 0.2, 0.5)], 40.0)


@pytest.mark.parametrize(
    ("model", "grid", "target", "timing"),
    [
        (TWO_SLICES, "lanes", "0.9", Timing()),
        (TWO_SLICES, "lanes", "0.9", Timing(1.0, 2.0, 0.5)),
        (TWO_SLICES, "lanes", "0.9", Timing(2.0, 1.0, 0.0)),
        (TWO_SLICES, "rectangle", "0.5", Timing(1.0, 2.0, 0.5)),
        (UniformModel(0.5, 0.5, 4.0), "lanes", "0.8", Timing(1.0, 2.0, 0.5)),
        (UniformModel(0.5, 0.5, 4.0), "lanes", "0.9", Timing(1.0, 2.0, 0.5)),
        (UniformModel(0.5, 0.5, 4.0), "trimmed", "0.9", Timing()),
        (PAPER, "trimmed", "0.95", Timing(10.0, 4.0, 0.0)),
    ],
)
def test_the_least_time_is_found_where_few_samples_need_a_smaller_extent_than_many(
    model, grid, target, timing
):
    """For the same target, a dense grid needs a larger extent than a sparse grid whose samples are
    all at its rim.
    """
    problem = Problem(model, vhat(target), GridKind(grid), objective="time", timing=timing)
    candidates = enumerate_baselines(problem, 60)
    least = min(flight_time(problem, *candidate) for candidate in candidates)
    found = solve(problem)
    assert flight_time(problem, found.pattern, found.baseline_m) <= least * (1 + 1e-9)


def test_without_a_bound_on_samples_the_least_aperture_is_searched_to_400_samples():
    problem = Problem(PAPER, vhat("0.98"), GridKind("square"), objective="aperture")
    candidates = enumerate_baselines(problem, 400)
    least = min(baseline * pattern.longer_side for pattern, baseline in candidates)
    found = solve(problem)
    assert extent(found) <= 1.01 * least
    assert found.pattern.samples == next(
        pattern.samples
        for pattern, baseline in candidates
        if baseline * pattern.longer_side <= 1.01 * least
    )


# --- Fixed numbers -------------------------------------------------------------------------


@pytest.mark.parametrize("quantity", ["normalized", "visibility"])
@pytest.mark.parametrize("grid", KINDS)
def test_at_a_fixed_baseline_the_fewest_samples_are_those_that_enumeration_finds(grid, quantity):
    source = random.Random(4)
    for problem in problems(4, 40, grid=grid, objective="samples", quantity=quantity):
        baseline = problem.model.independent_baseline_m * source.uniform(0.2, 1.5)
        fixed = problem._replace(
            bounds=Bounds(baseline_m=baseline, max_samples=problem.bounds.max_samples)
        )
        expected = next(
            (
                pattern.samples
                for pattern in patterns(problem.grid, problem.bounds.max_samples)
                if reaches(problem, pattern, baseline)
            ),
            None,
        )
        found = attempt(fixed)
        assert (found and found.pattern.samples) == expected, fixed
        assert found is None or found.baseline_m == baseline


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("grid", KINDS)
def test_with_fixed_samples_the_baseline_is_the_smallest_that_does_or_the_papers_rule(
    grid, objective
):
    source = random.Random(5)
    solved = 0
    for problem in problems(5, 15, grid=grid, objective=objective):
        samples = source.randint(1, 60)
        fixed = problem._replace(
            bounds=Bounds(samples=samples, max_aperture_m=problem.bounds.max_aperture_m)
        )
        pattern = problem.grid.pattern(samples)
        smallest = smallest_baseline(fixed, pattern)
        found = attempt(fixed)
        assert (found is None) == (smallest is None), fixed
        if found is None:
            continue
        solved += 1
        assert found.pattern == pattern
        by_rule = objective == "samples" and isinstance(problem.model, UniformModel)
        expected = widest(fixed, pattern) if by_rule else smallest
        assert found.baseline_m == near(expected, rel=1e-11)
    assert solved > 4


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_with_both_fixed_the_plan_is_only_evaluated(objective):
    for baseline, samples in ((3.5, 50), (3.5, 49), (0.1, 3), (100.0, 1)):
        problem = Problem(
            PAPER,
            vhat("0.98"),
            bounds=Bounds(baseline_m=baseline, samples=samples, max_samples=2, max_aperture_m=0.1),
            objective=objective,
        )
        found = solve(problem)
        assert found.baseline_m == baseline
        assert found.pattern.samples == samples
        assert found.prediction == PAPER.predict(found.pattern, baseline)
        assert found.met == reaches(problem, found.pattern, baseline)


def test_with_both_fixed_an_unreachable_visibility_is_missed_and_not_refused():
    """Even infinitely many samples would only reach V = 0.6785.  A plan for a larger V is still
    computed.
    """
    for baseline in (3.5, 1.0):
        problem = Problem(PAPER, visible("0.9"), bounds=Bounds(baseline_m=baseline, samples=49))
        found = solve(problem)
        assert not found.met
        assert found.samples_required is None


# --- Samples required ----------------------------------------------------------------------


@pytest.mark.parametrize("quantity", ["normalized", "visibility"])
@pytest.mark.parametrize("grid", KINDS)
def test_samples_required_are_the_fewest_that_do_at_the_baseline_of_the_answer(grid, quantity):
    """The required samples are compared with patterns of the same kind for lines, lanes and
    spirals, and with all numbers of samples for other grids.
    """
    solved = 0
    for problem in problems(6, 30, grid=grid, objective="samples", quantity=quantity):
        found = attempt(problem._replace(bounds=Bounds()))
        assert found is not None
        counted = problem.grid if grid in ("line", "lanes", "spiral") else GridKind("trimmed")
        required = next(
            pattern.samples
            for pattern in patterns(counted, 10_000)
            if reaches(problem, pattern, found.baseline_m)
        )
        assert found.samples_required == required, problem
        assert found.pattern.samples >= required
        solved += 1
    assert solved == 30


def test_samples_required_give_the_number_a_missed_target_needs():
    for baseline, required in ((3.5, 50), (7.0, 50), (1.75, 100)):
        problem = Problem(PAPER, vhat("0.98"), bounds=Bounds(baseline_m=baseline, samples=9))
        found = solve(problem)
        assert not found.met
        assert found.samples_required == fewest_at(problem, baseline)
        if baseline >= 3.5:
            assert found.samples_required == required
        else:
            assert found.samples_required > required


def test_samples_required_are_null_if_no_plan_can_have_so_many():
    found = solve(Problem(PAPER, vhat("0.98"), bounds=Bounds(baseline_m=1e-4, samples=9)))
    assert found.samples_required is None


# --- Tolerance -----------------------------------------------------------------------------


@given(samples=st.integers(2, 10**6))
def test_a_target_met_exactly_by_a_sample_count_gets_that_count(samples):
    found = solve(Problem(PAPER, vhat(1 - Fraction(1, samples))))
    assert found.pattern.samples == samples
    assert found.samples_required == samples
    assert found.baseline_m == 3.5


def test_a_shortfall_too_large_by_half_the_tolerance_passes_and_by_twice_does_not():
    for samples in (4, 50, 49, 1000):
        for lacking, expected in (("5e-13", samples), ("2e-12", samples + 1)):
            target = 1 - Fraction(1, samples) / (1 + Fraction(lacking))
            bounds = Bounds(baseline_m=3.5)
            found = solve(Problem(PAPER, vhat(target), bounds=bounds))
            assert found.pattern.samples == expected, (samples, lacking)
            assert found.samples_required == expected


def test_a_visibility_met_exactly_by_a_sample_count_gets_that_count():
    """The target V = T (1 + p (1 - 1/N)), written as a decimal, is met exactly, although p and V
    are rounded.
    """
    for p, target, samples in (
        ("0.4", "0.8", 6),
        ("0.5", "0.625", 2),
        ("0.5", "0.74", 25),
        ("0.2", "0.944", 10),
        ("0.6", "0.592", 5),
        ("0.8", "0.352", 20),
    ):
        share = Fraction(p)
        assert 1 - share**2 - share * (1 - share) / samples == Fraction(target)
        model = UniformModel(float(share), float(1 - share), 3.5)
        found = solve(Problem(model, visible(target)))
        assert (found.pattern.samples, found.samples_required) == (samples, samples), (p, target)


# --- Known results -------------------------------------------------------------------------


def test_the_paper_takes_50_samples_3_and_a_half_metres_apart():
    found = solve(Problem(PAPER, vhat("0.98")))
    assert found.pattern.samples == 50
    assert found.baseline_m == 3.5
    assert found.samples_required == 50
    assert found.prediction.shortfall == 0.02
    assert found.met


@pytest.mark.parametrize(
    ("grid", "samples"),
    [("trimmed", 50), ("rectangle", 56), ("square", 64), ("line", 50), ("lanes", 51)],
)
def test_every_kind_of_grid_reaches_98_percent_with_the_known_samples(grid, samples):
    found = solve(Problem(PAPER, vhat("0.98"), GridKind(grid)))
    assert found.pattern.samples == samples
    assert found.samples_required == (51 if grid == "lanes" else 50)


def test_a_target_of_zero_needs_one_sample():
    for requirement in (vhat("0"), visible("0.4"), visible("0")):
        for objective in OBJECTIVES:
            found = solve(Problem(PAPER, requirement, objective=objective))
            assert found.pattern.samples == 1
            assert found.samples_required == 1
            assert found.met


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_lengths_may_all_be_scaled(objective):
    # Speed and acceleration are also scaled, so that the time does not change.
    layers = [Layer(2.0, 4.0, 0.2, 0.3), Layer(6.0, 9.0, 0.3, 0.25)]
    scaled = [Layer(8 * a, 8 * b, density, 8 * size) for a, b, density, size in layers]
    problem = Problem(
        LayeredModel(layers, 50.0),
        vhat("0.9"),
        bounds=Bounds(max_aperture_m=9.0, max_samples=60),
        objective=objective,
    )
    larger = problem._replace(
        model=LayeredModel(scaled, 400.0),
        bounds=Bounds(max_aperture_m=72.0, max_samples=60),
        timing=Timing(40.0, 16.0, 1.0),
    )
    small, large = solve(problem), solve(larger)
    assert large.pattern == small.pattern
    assert large.baseline_m == near(8 * small.baseline_m, rel=1e-11)


def test_a_solution_says_whether_it_meets_the_target():
    assert isinstance(solve(Problem(PAPER, vhat("0.5"))), Solution)
    for samples, met in ((49, False), (50, True)):
        bounds = Bounds(baseline_m=3.5, samples=samples)
        assert solve(Problem(PAPER, vhat("0.98"), bounds=bounds)).met is met
