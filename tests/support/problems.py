"""Random and named problems for the solver."""

import random
from fractions import Fraction
from functools import partial

import pytest

from aosplan.errors import InfeasibleError
from aosplan.flight.kinematics import Timing
from aosplan.models.layered import LayeredModel
from aosplan.models.uniform import UniformModel
from aosplan.scenes.scene import Layer
from aosplan.solver.problem import Bounds, GridKind, Problem, Requirement
from aosplan.solver.solve import solve

near = partial(pytest.approx, abs=0.0)
"""`pytest.approx` without the absolute tolerance of 1e-12."""

KINDS = ("trimmed", "rectangle", "square", "line", "lanes", "spiral")
OBJECTIVES = ("samples", "aperture", "time")
PAPER = UniformModel(0.567, 0.433, 3.5)
"""The paper's forest at 50 m."""


def vhat(text):
    return Requirement("normalized", Fraction(text))


def visible(text):
    return Requirement("visibility", Fraction(text))


def patterns(grid, most):
    """All patterns of a kind with at most the given number of samples, in increasing order."""
    samples = 1
    while (pattern := grid.pattern(samples)).samples <= most:
        yield pattern
        samples = pattern.samples + 1


def reaches(problem, pattern, baseline, tolerance=1e-12):
    """Whether the target is reached.  The float that the model predicts is compared in exact
    arithmetic.
    """
    prediction = problem.model.predict(pattern, baseline)
    normalized = problem.requirement.quantity == "normalized"
    lacking = prediction.shortfall if normalized else prediction.mean_squared_error
    allowed = (1 - problem.requirement.target) * (1 + Fraction(tolerance))
    return Fraction(lacking) <= allowed * (1 + Fraction(1, 10**15))


def widest(problem, pattern):
    """The largest useful baseline within the limit on the aperture."""
    baseline = problem.model.independent_baseline_m / pattern.nearest
    if problem.bounds.max_aperture_m is not None and pattern.longer_side > 0:
        baseline = min(baseline, problem.bounds.max_aperture_m / pattern.longer_side)
    return baseline


def enumerate_samples(problem, most):
    """Number of samples of the first pattern that reaches the target at its largest useful
    baseline.
    """
    return next(
        (
            pattern.samples
            for pattern in patterns(problem.grid, most)
            if reaches(problem, pattern, widest(problem, pattern))
        ),
        None,
    )


def extent(solution):
    return solution.pattern.longer_side * solution.baseline_m


def attempt(problem):
    """A solution, or None if the solver raises an error."""
    try:
        return solve(problem)
    except InfeasibleError:
        return None


def random_model(source):
    if source.random() < 0.6:
        density = source.choice([0.1, 0.3, 0.5, 0.567, 0.8, 0.95])
        return UniformModel(density, 1.0 - density, source.uniform(0.5, 6.0))
    layers, bottom = [], 0.0
    for _ in range(source.randint(1, 4)):
        bottom += 5.0 * source.random()
        top = bottom + 0.1 + 3.0 * source.random()
        density = source.choice([0.05, 0.2, 0.5, 0.9])
        layers.append(Layer(bottom, top, density, 10.0 ** source.uniform(-1.5, 0.5)))
        bottom = top
    return LayeredModel(layers, 50.0)


def random_target(source, model, quantity):
    if quantity == "normalized":
        return vhat(source.choice(["0.5", "0.7", "0.8", "0.85", "0.9", "0.92", "0.95"]))
    least = model.transparency
    gain = least * model.density
    return visible(f"{least + gain * source.uniform(0.3, 0.95):.4f}")


def random_grid(source, name):
    pitch = source.choice([2.0, 3.0, 4.0] if name == "spiral" else [1.0, 2.0, 4.0])
    return GridKind(name, source.choice([2, 3, 4]), pitch)


def random_timing(source):
    return Timing(
        source.uniform(1.0, 10.0), source.uniform(0.5, 4.0), source.choice([0.0, 0.5, 1.0, 5.0])
    )


def problems(seed, count, *, grid, objective, quantity="normalized", aperture=None):
    """Random problems with at most 60 samples.  About half of them have a limit on the aperture."""
    source = random.Random(f"{seed} {grid} {objective} {quantity}")
    for _ in range(count):
        model = random_model(source)
        bounded = source.random() < 0.5 if aperture is None else aperture
        yield Problem(
            model,
            random_target(source, model, quantity),
            random_grid(source, grid),
            Bounds(
                max_samples=source.choice([20, 40, 60]),
                max_aperture_m=source.uniform(1.0, 8.0) * model.independent_baseline_m
                if bounded
                else None,
            ),
            objective,
            random_timing(source),
        )
