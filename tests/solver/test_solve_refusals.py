"""Limits that determined a solution, and errors for targets that cannot be met.  All numbers in the
messages are checked.
"""

import math
import re
from fractions import Fraction

import pytest
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
    vhat,
    widest,
)

from aosplan.errors import InfeasibleError, RequestError
from aosplan.grid.patterns import MOST_SITES
from aosplan.models.uniform import UniformModel
from aosplan.solver.problem import Bounds, GridKind, Problem, Requirement
from aosplan.solver.solve import solve

# --- Limits that determined the result -----------------------------------------------------


def limits(solution):
    return {limit.quantity: limit for limit in solution.limits}


def test_the_limits_name_the_bounds_that_were_reached():
    free = limits(solve(Problem(PAPER, vhat("0.98"))))
    assert set(free) == {"baseline_m", "normalized"}
    assert free["baseline_m"].bound == 3.5
    assert free["normalized"].value == free["normalized"].bound == 0.98

    narrow = solve(Problem(PAPER, vhat("0.9"), bounds=Bounds(max_aperture_m=10.0)))
    assert limits(narrow)["extent_m"].bound == 10.0
    assert limits(narrow)["extent_m"].value == near(10.0, rel=1e-12)
    assert extent(narrow) == near(10.0, rel=1e-12)

    few = limits(solve(Problem(PAPER, vhat("0.98"), bounds=Bounds(max_samples=50))))
    assert (few["samples"].value, few["samples"].bound) == (50, 50)

    fixed = limits(solve(Problem(PAPER, vhat("0.98"), bounds=Bounds(baseline_m=4.0, samples=60))))
    assert fixed["baseline_m"].message == "the baseline is given"
    assert fixed["samples"].message == "the number of photos is given"


def test_every_limit_is_described_with_its_value():
    for objective in OBJECTIVES:
        for problem in problems(7, 15, grid="trimmed", objective=objective):
            found = attempt(problem)
            for limit in found.limits if found else ():
                assert math.isfinite(limit.value)
                assert limit.message
                assert limit.quantity in {"baseline_m", "extent_m", "samples", "normalized"}
                if limit.quantity in {"extent_m", "samples"}:
                    assert limit.value <= limit.bound * (1 + 1e-12)


# --- Targets out of reach ------------------------------------------------------------------


def refused(problem):
    with pytest.raises(InfeasibleError) as caught:
        solve(problem)
    assert "\n" not in caught.value.message + caught.value.hint
    return caught.value


def numbers(pattern, text):
    found = re.search(pattern, text)
    assert found, text
    return tuple(float(number) for number in found.groups())


NUMBER = r"(\d+(?:\.\d+)?(?:e[+-]?\d+)?)"
AT_MOST = rf"the best grid reaches V̂ = {NUMBER} with {NUMBER} samples {NUMBER} m apart"


@pytest.mark.parametrize("grid", KINDS)
def test_the_value_that_a_refusal_calls_reachable_is_reachable(grid):
    """The best value in the message is reached at the baseline in the message, within the bounds,
    and no better value is possible.
    """
    seen = 0
    for problem in problems(8, 80, grid=grid, objective="samples", aperture=True):
        if enumerate_samples(problem, problem.bounds.max_samples) is not None:
            continue
        seen += 1
        best, samples, baseline = numbers(AT_MOST, refused(problem).message)
        pattern = problem.grid.pattern(int(samples))
        assert pattern.samples == samples <= problem.bounds.max_samples
        assert baseline * pattern.longer_side <= problem.bounds.max_aperture_m * 1.001
        reached = problem.model.predict(pattern, baseline).normalized
        assert best == pytest.approx(reached, abs=0.002)
        for other in patterns(problem.grid, problem.bounds.max_samples):
            alternative = problem.model.predict(other, widest(problem, other)).normalized
            assert alternative <= best + 1e-4
    assert seen > 5


@pytest.mark.parametrize("grid", KINDS)
def test_the_aperture_that_a_refusal_calls_enough_is_enough(grid):
    seen = 0
    for problem in problems(9, 150, grid=grid, objective="samples", aperture=True):
        if enumerate_samples(problem, problem.bounds.max_samples) is not None:
            continue
        hint = refused(problem).hint
        if not hint.startswith("--max-aperture"):
            continue
        seen += 1
        enough, samples = numbers(
            rf"--max-aperture {NUMBER} is enough, with {NUMBER} samples", hint
        )
        wider = solve(problem._replace(bounds=problem.bounds._replace(max_aperture_m=enough)))
        assert wider.pattern.samples <= samples
    assert seen > 5


@pytest.mark.parametrize("grid", KINDS)
def test_if_a_refusal_has_no_remedy_no_larger_aperture_helps(grid):
    for problem in problems(10, 100, grid=grid, objective="samples", aperture=True):
        if enumerate_samples(problem, problem.bounds.max_samples) is not None:
            continue
        if refused(problem).hint == "give a lower target":
            free = problem._replace(bounds=Bounds(max_samples=problem.bounds.max_samples))
            assert enumerate_samples(free, problem.bounds.max_samples) is None


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("grid", KINDS)
def test_the_samples_that_a_refusal_asks_for_are_enough(grid, objective):
    """At most 49 samples are allowed, but 50 are needed.  If rows have to be complete, 51, 56 or 64
    are needed.
    """
    problem = Problem(PAPER, vhat("0.98"), GridKind(grid), Bounds(max_samples=49), objective)
    error = refused(problem)
    (needed,) = numbers(rf"--max-samples {NUMBER}", error.hint)
    allowed = problem._replace(bounds=Bounds(max_samples=int(needed)))
    assert solve(allowed).pattern.samples <= needed


@pytest.mark.parametrize("grid", ["rectangle", "square", "lanes"])
@pytest.mark.parametrize("objective", OBJECTIVES)
def test_too_few_samples_for_whole_rows_are_refused_like_any_other(grid, objective):
    """50 samples would be sufficient, but grids of these kinds need 51, 56 or 64 samples."""
    error = refused(Problem(PAPER, vhat("0.98"), GridKind(grid), Bounds(max_samples=50), objective))
    assert "the best grid reaches V̂ = 0.9" in error.message
    assert error.hint


@pytest.mark.parametrize("baseline", [0.5, 1.0, 3.0, 3.4])
def test_the_baseline_and_samples_in_a_refusal_meet_the_target(baseline):
    for unit in (3.5, 10 / 3, 12.3456, 7.77777):
        model = PAPER._replace(unit_baseline_m=unit)
        bounds = Bounds(baseline_m=baseline * unit / 3.5, max_samples=50)
        error = refused(Problem(model, vhat("0.98"), bounds=bounds))
        wide, samples = numbers(rf"--baseline {NUMBER} on, .* {NUMBER} photos are", error.hint)
        found = solve(Problem(model, vhat("0.98"), bounds=Bounds(baseline_m=wide, max_samples=50)))
        assert found.pattern.samples == samples


def test_a_baseline_with_few_digits_is_not_rounded_in_messages():
    error = refused(Problem(PAPER, vhat("0.98"), bounds=Bounds(baseline_m=1.0, max_samples=50)))
    assert "--baseline 3.5 on" in error.hint


def test_a_baseline_that_breaks_the_bound_on_the_aperture_is_refused():
    bounds = Bounds(baseline_m=3.5, max_aperture_m=20.0)
    error = refused(Problem(PAPER, vhat("0.98"), bounds=bounds))
    samples, needed, most = numbers(
        rf"needs {NUMBER} samples over {NUMBER} m, more than --max-aperture {NUMBER}", error.message
    )
    assert (samples, needed, most) == (50, 24.5, 20.0)
    wide_enough = Bounds(baseline_m=3.5, max_aperture_m=24.5)
    assert solve(Problem(PAPER, vhat("0.98"), bounds=wide_enough)).pattern.samples == 50


@pytest.mark.parametrize("grid", KINDS)
def test_too_few_fixed_samples_are_refused_with_a_sufficient_number(grid):
    for samples in (1, 7, 36):
        error = refused(Problem(PAPER, vhat("0.98"), GridKind(grid), Bounds(samples=samples)))
        best, baseline = numbers(
            rf"the best grid reaches V̂ = {NUMBER}, with photos {NUMBER} m apart", error.message
        )
        pattern = GridKind(grid).pattern(samples)
        assert PAPER.predict(pattern, baseline).normalized == pytest.approx(best, abs=1e-4)
        (needed,) = numbers(rf"at least {NUMBER}", error.hint)
        assert solve(Problem(PAPER, vhat("0.98"), GridKind(grid), Bounds(samples=int(needed)))).met
        assert not solve(
            Problem(
                PAPER, vhat("0.98"), GridKind(grid), Bounds(samples=samples, baseline_m=baseline)
            )
        ).met


@pytest.mark.parametrize("p", [0.1, 0.5, 0.567, 0.9, 0.98765])
def test_a_visibility_beyond_infinitely_many_samples_is_refused_with_the_limit(p):
    model = UniformModel(p, 1.0 - p, 3.5)
    for beyond in (1e-9, 0.001):
        target = Fraction(1 - p**2) + Fraction(beyond)
        error = refused(Problem(model, Requirement("visibility", target)))
        one, infinite = numbers(
            rf"one photo reaches {NUMBER}, and infinitely many photos reach {NUMBER}", error.message
        )
        assert one == pytest.approx(1 - p, rel=1e-3)
        assert infinite == pytest.approx(1 - p**2, rel=1e-3)
        (below,) = numbers(rf"--visibility below {NUMBER}", error.hint)
        less = Fraction(below) * (1 - Fraction(1, 1000))
        assert solve(Problem(model, Requirement("visibility", less))).met


def test_more_sites_than_one_plan_may_have_are_refused():
    just = solve(Problem(PAPER, vhat(1 - Fraction(1, MOST_SITES))))
    assert just.pattern.samples == MOST_SITES
    with pytest.raises((RequestError, InfeasibleError), match=str(MOST_SITES)) as caught:
        solve(Problem(PAPER, vhat(1 - Fraction(1, MOST_SITES + 1))))
    assert caught.value.hint
