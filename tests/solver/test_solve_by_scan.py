"""The search for models whose visibility may decrease if the baseline increases, compared with
enumeration.
"""

import math
import re
from fractions import Fraction
from itertools import count

import pytest
from support.forests import STANDS, Stand, clumped_forest

from aosplan.errors import InfeasibleError
from aosplan.flight.kinematics import path_of
from aosplan.models.correlogram import CorrelogramModel
from aosplan.models.layered import LayeredModel
from aosplan.models.measured import MeasuredModel
from aosplan.models.uniform import UniformModel
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.scene import Layer
from aosplan.solver.problem import Bounds, GridKind, Problem, Requirement
from aosplan.solver.solve import solve
from aosplan.solver.solve_by_scan import VISIBILITY_SLACK, Scan, solve_by_scan
from aosplan.solver.solve_monotone import APERTURE_SLACK

LAYERS = [Layer(2.0 + k, 2.5 + k, 0.03, 0.3) for k in range(15)]
PAPER = UniformModel(0.567, 0.433, 3.5)


def vhat(text):
    return Requirement("normalized", Fraction(text))


class Scanned:
    """A model whose visibility increases with the baseline, but that does not declare this
    property.  The scan is therefore used.
    """

    heading_deg = None
    rises_with_baseline = False
    rule_baseline_m = None
    widest_aperture_m = 60.0

    def __init__(self, model):
        self.model = model
        self.predict = model.predict
        self.independent_baseline_m = self.sharp_baseline_m = model.independent_baseline_m
        self.density, self.transparency = model.density, model.transparency


CLEARING = Stand(5, 4, 14.0, 3.0, 0.5, 0.4, 1.5)
"""A stand with a few dense trees.  For such stands, the surrogate has the largest errors."""


@pytest.fixture(scope="module")
def stands():
    """Problems with the measured model and generated stands.  They are small enough for
    enumeration.
    """
    found = {}
    for name, stand in (("beech", STANDS["beech"]), ("clearing", CLEARING)):
        volume = clumped_forest(stand, side_m=16.0, voxel_m=0.5)
        surrogate = CorrelogramModel(correlogram(volume), 40.0)
        model = MeasuredModel(volume, 40.0, targets_per_voxel=2)
        found[name] = Problem(model, vhat("0.6"), surrogate=surrogate)
    return found


@pytest.fixture(scope="module")
def beech():
    volume = clumped_forest(STANDS["beech"])
    surrogate = CorrelogramModel(correlogram(volume), 50.0)
    return Problem(MeasuredModel(volume, 50.0), vhat("0.6"), surrogate=surrogate)


@pytest.mark.parametrize("objective", ["samples", "aperture"])
@pytest.mark.parametrize("target", ["0.9", "0.95", "0.98"])
def test_the_scan_of_a_monotone_model_agrees_with_the_monotone_solver(objective, target):
    model = LayeredModel(LAYERS, 40.0)
    known = solve(Problem(model, vhat(target), objective=objective))
    found = solve_by_scan(Problem(Scanned(model), vhat(target), objective=objective))
    if objective == "samples":
        assert found.pattern == known.pattern
        assert found.baseline_m == pytest.approx(known.baseline_m, rel=2e-3)
    assert found.met
    side = found.pattern.longer_side * found.baseline_m
    assert side <= 1.012 * known.pattern.longer_side * known.baseline_m


def test_time_is_as_short_as_that_of_any_full_frame():
    model, requirement = Scanned(LayeredModel(LAYERS, 40.0)), vhat("0.95")
    problem = Problem(model, requirement, objective="time")
    found = solve_by_scan(problem)
    least = math.inf
    for index in range(1, 30):
        whole = problem.grid.frame(index).whole
        alone = problem._replace(bounds=Bounds(samples=whole.samples), objective="samples")
        try:
            answer = solve_by_scan(alone)
        except InfeasibleError:
            continue
        least = min(least, path_of(whole).time_s(answer.baseline_m, problem.timing))
    assert path_of(found.pattern).time_s(found.baseline_m, problem.timing) <= least * (1 + 1e-9)


def test_the_best_visibility_of_the_uniform_model_takes_the_fewest_samples_near_it():
    found = solve(Problem(PAPER, vhat("0.98"), objective="visibility"))
    limit = PAPER.transparency * (1 + PAPER.density * (1 - 1 / 400))
    enough = next(
        n
        for n in count(1)
        if PAPER.transparency * (1 + PAPER.density * (1 - 1 / n)) >= limit - VISIBILITY_SLACK
    )
    assert found.pattern.samples == enough
    assert found.baseline_m == 3.5
    # The solution also gives the best value, at 400 photos. This is the largest number for this
    # objective.
    (stated,) = (each for each in found.limits if each.quantity == "visibility")
    assert (stated.value, stated.bound) == (found.prediction.expected, pytest.approx(limit))
    assert "N = 400 and b = 3.5 m" in stated.message


@pytest.mark.parametrize("density", [0.9, 0.98, 0.998])
def test_for_low_visibility_the_slack_is_one_per_cent_of_the_best_value(density):
    """For small visibilities, the slack is not 0.5 % of the ground, because a single photo might be
    within such a slack.
    """
    model = UniformModel(density, 1.0 - density, 3.5)
    found = solve(Problem(model, vhat("0.98"), objective="visibility"))
    # V = (1 - p)(1 + p V̂), and V̂ is at most 1 - 1/N.
    best = (1.0 - density) * (1.0 + density * (1.0 - 1.0 / 400.0))
    assert found.prediction.expected >= 0.99 * best * (1.0 - 1e-12)
    alone = Problem(model, vhat("0.98"), bounds=Bounds(samples=found.pattern.samples - 1))
    fewer = solve(alone._replace(objective="visibility"))
    assert fewer.prediction.expected < 0.99 * best


def test_contrast_grows_with_independent_samples_up_to_their_bound():
    found = solve(Problem(PAPER, vhat("0.98"), bounds=Bounds(max_samples=64), objective="contrast"))
    # Contrast is proportional to √N. The contrast of 63 samples is within 1 % of the contrast of 64
    # samples. The contrast of 62 samples is further below.
    assert found.pattern.samples == 63


def enumerated(problem, most):
    """Every pattern of a kind at every baseline of the scan, with the predictions of the model."""
    scan = Scan(problem)
    for samples in range(1, most + 1):
        pattern = problem.grid.pattern(samples)
        if pattern.samples == samples:
            for baseline in scan.baselines_m(pattern):
                yield pattern, baseline, problem.model.predict(pattern, baseline)


def cost(problem, pattern, baseline):
    """The value that the objective minimizes."""
    if problem.objective == "time":
        return path_of(pattern).time_s(baseline, problem.timing)
    return pattern.samples if problem.objective == "samples" else pattern.longer_side * baseline


KINDS = [GridKind(), GridKind("rectangle"), GridKind("square"), GridKind("line")]
KINDS += [
    GridKind("lanes"),
    GridKind("lanes", 2, 2.0),
    GridKind("spiral", 3, 2.0),
    pytest.param(GridKind("spiral"), marks=pytest.mark.slow),
]
BOUNDS = [
    Bounds(max_samples=30),
    Bounds(max_samples=20, max_aperture_m=12.0),
    Bounds(max_samples=30, baseline_m=3.0),
    Bounds(samples=12),
]


@pytest.mark.parametrize("bounds", BOUNDS, ids=str)
@pytest.mark.parametrize("grid", KINDS, ids=lambda grid: grid.title)
@pytest.mark.parametrize("stand", ["beech", pytest.param("clearing", marks=pytest.mark.slow)])
def test_no_enumerated_grid_has_a_lower_cost(stands, stand, grid, bounds):
    """The solution for every objective is compared with all patterns at all baselines of the scan."""
    problem = stands[stand]._replace(grid=grid, bounds=bounds)
    if bounds.samples is None:
        every = list(enumerated(problem, bounds.max_samples))
    else:
        pattern = grid.pattern(bounds.samples)
        steps = Scan(problem).baselines_m(pattern)
        every = [(pattern, b, problem.model.predict(pattern, b)) for b in steps]
    meeting = [each for each in every if problem.requirement.is_met(each[2])]
    for objective in ("samples", "aperture", "time"):
        asked = problem._replace(objective=objective)
        if not meeting:
            with pytest.raises(InfeasibleError):
                solve_by_scan(asked)
            continue
        found = solve_by_scan(asked)
        assert found.met
        assert found.prediction == problem.model.predict(found.pattern, found.baseline_m)
        least = min(cost(asked, *each[:2]) for each in meeting)
        slack = APERTURE_SLACK if objective == "aperture" else 1.0 + 1e-9
        assert cost(asked, found.pattern, found.baseline_m) <= least * slack
        assert found.pattern.longer_side * found.baseline_m <= asked.widest_aperture_m * (1 + 1e-9)
    for objective in ("visibility", "contrast"):
        asked = problem._replace(objective=objective)
        if not every:
            continue
        found = solve_by_scan(asked)
        scan = Scan(asked)
        best = max(scan.value(each[2]) for each in every)
        assert scan.value(found.prediction) >= scan.near(best) - 0.5 * (best - scan.near(best))
        # No pattern with fewer samples is within the slack of the best one.
        fewer = (scan.value(each[2]) for each in every if each[0].samples < found.pattern.samples)
        assert max(fewer, default=0.0) < best


def test_the_width_of_a_plot_limits_the_aperture(beech):
    found = solve_by_scan(beech._replace(requirement=vhat("0.5")))
    assert found.pattern.longer_side * found.baseline_m <= beech.model.widest_aperture_m * (
        1 + 1e-9
    )


def test_the_error_for_a_measured_stand_gives_its_best_value(beech):
    with pytest.raises(InfeasibleError, match=r"V̂ = 0.999 is out of reach") as caught:
        solve_by_scan(beech._replace(requirement=vhat("0.999")))
    said = re.search(
        r"reaches V̂ = ([\d.]+), with (\d+) samples ([\d.]+) m apart", caught.value.message
    )
    reached, samples, baseline = float(said[1]), int(said[2]), float(said[3])
    fixed = Bounds(samples=samples, baseline_m=baseline)
    found = solve_by_scan(beech._replace(bounds=fixed))
    assert found.prediction.normalized == pytest.approx(reached, abs=2e-3)


def test_with_the_baseline_fixed_the_fewest_samples_are_found(beech):
    found = solve_by_scan(beech._replace(bounds=Bounds(baseline_m=4.0), requirement=vhat("0.5")))
    assert found.baseline_m == 4.0
    assert found.samples_required == found.pattern.samples
    fewer = beech.grid.frame(beech.grid.index_of(found.pattern.samples) - 1).whole
    assert beech.model.predict(fewer, 4.0).normalized < 0.5


def test_with_the_samples_fixed_only_the_baseline_is_sought(beech):
    found = solve_by_scan(beech._replace(bounds=Bounds(samples=13), requirement=vhat("0.5")))
    assert found.pattern.samples == 13
    assert found.prediction.normalized == pytest.approx(0.5, abs=0.02)
