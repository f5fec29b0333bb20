"""The search for models whose visibility need not rise with the baseline, against enumeration."""

import math
import re
from fractions import Fraction
from itertools import count, takewhile

import pytest
from forests import STANDS, clumped_forest

from aosplan.errors import InfeasibleError
from aosplan.flight import path_of
from aosplan.models.correlogram import CorrelogramModel, correlogram
from aosplan.models.layered import LayeredModel
from aosplan.models.measured import MeasuredModel
from aosplan.models.uniform import UniformModel
from aosplan.problem import Bounds, GridKind, Problem, Requirement
from aosplan.scene import Layer
from aosplan.search import CONTRAST_SLACK, SCAN_RATIO, VISIBILITY_SLACK, search
from aosplan.solve import solve

LAYERS = [Layer(2.0 + k, 2.5 + k, 0.03, 0.3) for k in range(15)]
PAPER = UniformModel(0.567, 0.433, 3.5)


def vhat(text):
    return Requirement("normalized", Fraction(text))


class Scanned:
    """A model that rises with the baseline but does not say so: searched as if it might fall."""

    rises_with_baseline = False
    rule_baseline_m = None
    widest_aperture_m = 60.0

    def __init__(self, model):
        self.model = model
        self.predict = model.predict
        self.independent_baseline_m = self.sharp_baseline_m = model.independent_baseline_m
        self.density, self.transparency = model.density, model.transparency


@pytest.fixture(scope="module")
def beech():
    volume = clumped_forest(STANDS["beech"])
    sketch = CorrelogramModel(correlogram(volume), 50.0)
    return Problem(MeasuredModel(volume, 50.0), vhat("0.6"), sketch=sketch)


@pytest.mark.parametrize("objective", ["samples", "aperture"])
@pytest.mark.parametrize("target", ["0.9", "0.95", "0.98"])
def test_a_model_that_rises_is_solved_as_by_the_solver_that_knows(objective, target):
    model = LayeredModel(LAYERS, 40.0)
    known = solve(Problem(model, vhat(target), objective=objective))
    found = search(Problem(Scanned(model), vhat(target), objective=objective))
    if objective == "samples":
        assert found.pattern == known.pattern
        assert found.baseline_m == pytest.approx(known.baseline_m, rel=2e-3)
    assert found.met
    side = found.pattern.longer_side * found.baseline_m
    assert side <= 1.012 * known.pattern.longer_side * known.baseline_m


def test_time_is_as_short_as_that_of_any_full_frame():
    model, requirement = Scanned(LayeredModel(LAYERS, 40.0)), vhat("0.95")
    problem = Problem(model, requirement, objective="time")
    found = search(problem)
    least = math.inf
    for index in range(1, 30):
        whole = problem.grid.frame(index).whole
        alone = problem._replace(bounds=Bounds(samples=whole.samples), objective="samples")
        try:
            answer = search(alone)
        except InfeasibleError:
            continue
        least = min(least, path_of(whole).time_s(answer.baseline_m, problem.timing))
    assert path_of(found.pattern).time_s(found.baseline_m, problem.timing) <= least * (1 + 1e-9)


def test_the_best_visibility_of_the_uniform_model_takes_the_fewest_samples_near_it():
    found = solve(Problem(PAPER, vhat("0.98"), objective="visibility"))
    limit = PAPER.transparency * (1 + PAPER.density * (1 - 1 / 400))
    whole = (GridKind().frame(index).most for index in count(1))
    enough = next(
        n
        for n in whole
        if PAPER.transparency * (1 + PAPER.density * (1 - 1 / n)) >= limit - VISIBILITY_SLACK
    )
    assert found.pattern.samples == enough
    assert found.baseline_m == 3.5


def test_contrast_grows_with_independent_samples_up_to_their_bound():
    found = solve(Problem(PAPER, vhat("0.98"), bounds=Bounds(max_samples=64), objective="contrast"))
    assert found.pattern.samples == 64  # 63 is no full frame, and 56 is 6 % short


def enumerated(problem, most):
    """Every full frame at every baseline of a fine scan, by the model alone."""
    frames = takewhile(lambda f: f.most <= most, map(problem.grid.frame, count(1)))
    for frame in frames:
        widest = problem.widest_m(frame.side)
        for step in range(61):
            baseline = widest * SCAN_RATIO ** (-0.5 * step)
            yield frame.whole, baseline, problem.model.predict(frame.whole, baseline)


def test_no_full_frame_of_fewer_samples_meets_the_target_in_a_measured_stand(beech):
    found = search(beech)
    again = beech.model.predict(found.pattern, found.baseline_m)
    assert again == found.prediction
    assert again.normalized >= 0.6 - 1e-12
    meeting = [
        pattern.samples
        for pattern, _, prediction in enumerated(beech, 36)
        if prediction.normalized >= 0.6
    ]
    assert found.pattern.samples <= min(meeting)


@pytest.mark.parametrize("objective", ["visibility", "contrast"])
def test_the_best_of_a_measured_stand_is_near_the_best_of_enumeration(beech, objective):
    problem = beech._replace(objective=objective, bounds=Bounds(max_samples=36))
    found = search(problem)

    def value(prediction):
        return prediction.expected if objective == "visibility" else prediction.contrast

    best = max(value(prediction) for _, _, prediction in enumerated(problem, 36))
    slack = VISIBILITY_SLACK if objective == "visibility" else best * CONTRAST_SLACK
    # The scan's own step may cost as much again.
    assert value(found.prediction) >= best - 2 * slack


def test_a_plot_bounds_the_aperture(beech):
    found = search(beech._replace(requirement=vhat("0.5")))
    assert found.pattern.longer_side * found.baseline_m <= beech.model.widest_aperture_m * (
        1 + 1e-9
    )


def test_out_of_reach_says_what_a_measured_stand_reaches(beech):
    with pytest.raises(InfeasibleError, match=r"V̂ = 0.999 is out of reach") as caught:
        search(beech._replace(requirement=vhat("0.999")))
    said = re.search(r"reach V̂ = ([\d.]+), (\d+) of them ([\d.]+) m apart", caught.value.message)
    reached, samples, baseline = float(said[1]), int(said[2]), float(said[3])
    fixed = Bounds(samples=samples, baseline_m=baseline)
    found = search(beech._replace(bounds=fixed))
    assert found.prediction.normalized == pytest.approx(reached, abs=2e-3)


def test_with_the_baseline_fixed_the_fewest_samples_are_found(beech):
    found = search(beech._replace(bounds=Bounds(baseline_m=4.0), requirement=vhat("0.5")))
    assert found.baseline_m == 4.0
    assert found.samples_required == found.pattern.samples
    fewer = beech.grid.frame(beech.grid.index_of(found.pattern.samples) - 1).whole
    assert beech.model.predict(fewer, 4.0).normalized < 0.5


def test_with_the_samples_fixed_only_the_baseline_is_sought(beech):
    found = search(beech._replace(bounds=Bounds(samples=13), requirement=vhat("0.5")))
    assert found.pattern.samples == 13
    assert found.prediction.normalized == pytest.approx(0.5, abs=0.02)
