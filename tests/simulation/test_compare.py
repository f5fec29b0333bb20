"""Predictions compared with simulations: correct models agree, and wrong models are detected."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aosplan import Layer, LayeredScene, PlanRequest, plan
from aosplan.errors import RequestError
from aosplan.models.measured import MeasuredModel
from aosplan.models.model import Prediction
from aosplan.simulation import compare, experiments
from aosplan.simulation.compare import Settings, pictures, simulate, slanted
from aosplan.simulation.experiments import ForestExperiment, middle_of
from aosplan.simulation.forests import clumped_forest, generator, uniform_forest
from aosplan.simulation.moments import estimate

# Large occluders need only small volumes.
UNIFORM = {"density": 0.05, "occluder_size": 0.5, "volume_height": 8.0, "volume_base": 2.0}
QUICK = {"altitude": 60.0, **UNIFORM}


@pytest.fixture(scope="module")
def flight():
    """A plan with nine views.  They are so far apart that the thickness of the volume has no
    effect.
    """
    return plan(PlanRequest(samples=9, baseline=16.0, **QUICK))


def with_shortfall(made, factor):
    """The plan with K multiplied by a factor, as if a wrong model had predicted it."""
    p = made.solution.prediction
    wrong = Prediction(p.density, p.transparency, p.shortfall * factor)
    return replace(made, solution=made.solution._replace(prediction=wrong))


@pytest.fixture(scope="module")
def clumped(flight):
    """The same flight over a clumped stand, which is not what the model describes."""
    return simulate(flight, Settings(1, 0.02, "clumped", "telecentric"))


@pytest.mark.parametrize("forest", ["noise", "uniform", "layered"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_correct_model_agrees_with_the_simulation(flight, forest, seed):
    found = simulate(flight, Settings(seed, 0.004, forest, "telecentric"))
    assert found.agree, found.differences
    assert found.precise
    assert found.samples >= 16


@pytest.mark.parametrize("forest", ["noise", "uniform"])
def test_a_model_that_is_a_tenth_off_in_k_is_caught(flight, forest):
    settings = Settings(1, 0.002, forest, "telecentric")
    assert simulate(flight, settings).agree
    for factor in (0.9, 1.1):
        wrong = simulate(with_shortfall(flight, factor), settings)
        assert not wrong.agree
        assert any(text.startswith("V̂ is ") for text in wrong.differences)


@pytest.mark.parametrize("change", [-0.02, 0.02])
def test_a_model_that_is_off_in_density_is_caught(flight, change):
    p = flight.solution.prediction
    wrong = Prediction(p.density + change, p.transparency - change, p.shortfall)
    broken = replace(flight, solution=flight.solution._replace(prediction=wrong))
    # Noise patterns are left out, because they use the density of the model, which would be wrong
    # too.
    found = simulate(flight, Settings(1, 0.002, "noise"))._replace(predicted=wrong, plan=broken)
    assert not found.agree
    assert found.differences[0].startswith("p is ")


@pytest.mark.parametrize(
    ("forest", "view"), [("uniform", "perspective"), ("layered", "telecentric")]
)
def test_simulated_leaves_agree_with_the_prediction_by_ray_length(flight, forest, view):
    settings = Settings(1, 0.004, forest, view)
    of_cubes, of_leaves = (
        simulate(flight, settings._replace(occluders=kind)) for kind in ("cubes", "leaves")
    )
    assert of_leaves.agree, of_leaves.differences
    assert of_leaves.predicted.density < of_cubes.predicted.density
    assert (of_leaves.occluders, of_leaves.document()["occluders"]) == ("leaves", "leaves")
    # The comparison finds predictions for the other kind of occluders.
    assert not of_leaves._replace(predicted=of_cubes.predicted).agree


def test_as_flown_lists_the_numbers_that_differ_for_the_photos(flight, clumped):
    found = simulate(flight, Settings(1, 0.01))
    assert found.agree
    assert [text.split()[0] for text in found.as_flown] == ["p", "V"]
    assert "is for vertical rays" in found.as_flown[0]
    assert found.document()["as_flown"] == found.as_flown
    # An error of the model is reported as a difference, and not as an effect of the rays.
    assert any(text.startswith("V̂") for text in clumped.differences)
    assert not any(text.startswith("V̂") for text in clumped.as_flown)
    assert simulate(flight, Settings(1, 0.02, "noise")).as_flown == []


@pytest.mark.parametrize("forest", ["noise", "cloud"])
def test_occluders_are_refused_for_forests_that_are_not_generated(flight, forest):
    with pytest.raises(RequestError, match=r"--occluders leaves|--forest cloud"):
        simulate(flight, Settings(forest=forest, occluders="leaves"))


def test_clumped_stands_disagree_with_the_model_of_independent_occluders(clumped):
    assert not clumped.agree
    assert clumped.simulated.normalized < clumped.predicted.normalized - 0.01


def test_layered_scenes_agree_with_the_layered_model(tmp_path):
    (tmp_path / "stand.toml").write_text(
        'name = "stand"\n'
        + "".join(
            f"[[layers]]\nbottom_m = {low}\ntop_m = {low + size}\ndensity = {density}\n"
            f"occluder_size_m = {size}\n"
            for low, density, size in ((2.0, 0.1, 0.5), (6.0, 0.2, 0.5), (9.0, 0.2, 1.0))
        )
    )
    for baseline, view in ((2.0, "telecentric"), (9.0, "perspective")):
        request = PlanRequest(
            altitude=60,
            camera="dji-m3t-wide",
            scene=str(tmp_path / "stand.toml"),
            samples=9,
            baseline=baseline,
        )
        found = simulate(plan(request), Settings(1, 0.006, view=view))
        assert (found.settings.forest, found.plan.model) == ("layered", "layered")
        assert found.agree, found.differences


# Precision, limits, seeds


def test_the_simulation_stops_at_the_requested_precision(flight):
    coarse, fine = (
        simulate(flight, Settings(1, precision, "noise")) for precision in (0.05, 0.0015)
    )
    assert coarse.samples == experiments.FEWEST_SAMPLES
    assert fine.samples > coarse.samples
    error = fine.simulated.expected_standard_error
    assert error <= 0.0015
    assert error > 0.0015 / 1.5  # Between two checks, the number of volumes increases by a quarter.


def test_a_limit_on_targets_ends_a_simulation_and_is_reported(flight):
    found = simulate(flight, Settings(1, 1e-6, "noise", most_targets=5_000_000))
    assert found.targets <= 5_000_000
    assert not found.precise


def test_equal_seeds_give_equal_documents_and_other_seeds_others(flight):
    one, same, other = (
        simulate(flight, Settings(seed, 0.01, "uniform", "telecentric")).document()
        for seed in (5, 5, 6)
    )
    assert one == same
    assert one["simulated"] != other["simulated"]
    assert one["seed"] == 5


def test_progress_counts_up_to_what_is_expected(flight):
    calls = []
    simulate(
        flight, Settings(1, 0.001, "noise"), progress=lambda done, all_: calls.append((done, all_))
    )
    done = [call[0] for call in calls]
    assert done == sorted(done)
    assert all(call[0] < call[1] for call in calls)


@pytest.mark.slow
def test_z_scores_of_volumes_over_seeds_are_those_of_honest_standard_errors(flight):
    z = []
    for seed in range(16):
        settings = Settings(seed, 1.0, "uniform", "telecentric")
        found = simulate(flight, settings)
        z.append(
            [
                (getattr(found.simulated, name) - getattr(found.predicted, name))
                / getattr(found.simulated, f"{name}_standard_error")
                for name in ("density", "expected", "normalized")
            ]
        )
    spread = np.std(z, axis=0, ddof=1)
    expected = math.sqrt(15 / 13)
    assert np.abs(spread / expected - 1).max() < 4 / math.sqrt(2 * 16)
    # V̂ has the given systematic error, which is larger than its standard error. p and V have no
    # systematic error.
    assert np.abs(np.mean(z, axis=0)[:2]).max() < 4 * expected / math.sqrt(16)


# Slanted predictions and requests


def test_slanted_predictions_are_those_of_independent_views():
    rng = np.random.default_rng(1)
    positions = rng.uniform(-10, 10, (5, 2))
    found = slanted(
        1 / 5, lambda x, y: -0.5 - 0.7 * (x + y), positions, (8.0, 4.0), 30.0, "perspective"
    )
    points = (np.arange(9) + 0.5) / 9 - 0.5
    squares, hidden = [], []
    for x in 8.0 * points:
        for y in 4.0 * points:
            slopes = np.abs(positions - (x, y)).sum(axis=1) / 30.0
            p = 1 - np.exp(-0.5 - 0.7 * slopes)
            # This is E[(Σ Y)²] for independent views, computed pair by pair.
            pairs = np.outer(p, p)
            np.fill_diagonal(pairs, p)
            squares.append(pairs.sum() / 25)
            hidden.append(p.mean())
    assert found.density == pytest.approx(np.mean(hidden))
    assert found.expected == pytest.approx(1 - np.mean(squares))
    straight = slanted(
        0.3, lambda x, y: -0.5 - 0.7 * (x + y), np.zeros((4, 2)), (0.0, 0.0), 30.0, "telecentric"
    )
    assert straight == pytest.approx((1 - math.exp(-0.5), math.exp(-0.5), 0.3))


@pytest.mark.slow
def test_patches_represent_the_whole_target_area(monkeypatch):
    def experiment(area):
        return ForestExperiment(
            3,
            lambda rng, size: uniform_forest(rng, 0.05, 0.5, 2.0, 8.0, size),
            np.array([(-4.0, -4.0), (4.0, 4.0)]),
            20.0,
            10.0,
            0.5,
            "perspective",
            area,
        )

    monkeypatch.setitem(experiments.PATCH_OCCLUDERS, "perspective", 12.0)
    many = experiment((30.0, 18.0))
    assert many.patch_m == pytest.approx((6.0, 6.0))
    samples = many.samples()
    found = estimate([next(samples) for _ in range(400)])
    log_clear = 16 * math.log(0.95)
    truth = slanted(
        0.5,
        lambda x, y: log_clear * (1.0 + x + y),
        many.positions_m,
        many.area_m,
        20.0,
        "perspective",
    )
    assert abs(found.density - truth.density) < 4 * found.density_standard_error + 0.003
    assert found.density_standard_error < 0.008
    assert truth.density > 1 - math.exp(log_clear) + 0.1


def test_a_cloud_is_predicted_for_the_simulated_view(flight, monkeypatch):
    volume = clumped_forest(generator(1), 0.6, 0.5, 2.0, 10.0, (24.0, 20.0))
    loaded = replace(flight.inputs.loaded, volume=volume)
    made = replace(flight, inputs=flight.inputs._replace(loaded=loaded, model="measured"))
    for view in ("perspective", "telecentric"):
        found = simulate(made, Settings(view=view))
        truth = MeasuredModel(volume, 60.0, view=view).predict(
            flight.solution.pattern, flight.solution.baseline_m
        )
        assert found.settings.forest == "cloud"
        assert found.predicted == truth
        assert found.agree
        assert found.simulated.expected == pytest.approx(truth.expected, abs=1e-9)
        assert found.simulated.normalized == pytest.approx(truth.normalized, abs=1e-9)
        assert found.samples == 16
        assert found.targets == 4 * 48 * 4 * 40


def test_a_cloud_disagrees_with_the_model_of_independent_layers(flight):
    volume = clumped_forest(generator(1), 0.6, 0.5, 2.0, 10.0, (24.0, 20.0))
    loaded = replace(flight.inputs.loaded, volume=volume)
    made = replace(flight, inputs=flight.inputs._replace(loaded=loaded))
    assert not simulate(made, Settings()).agree


def test_bare_ground_needs_no_experiment():
    bare = plan(PlanRequest(**(QUICK | {"density": 0.0})))
    found = simulate(bare)
    assert found.agree
    assert (found.targets, found.samples) == (0, 0)
    assert found.document()["simulated"]["normalized"] is None
    with pytest.raises(RequestError, match="nothing to draw"):
        pictures(found)


def test_a_single_view_shows_what_one_photo_shows():
    single = plan(PlanRequest(samples=1, baseline=1.0, **QUICK))
    found = simulate(single, Settings(1, 0.01, view="telecentric"))
    assert found.agree
    assert found.simulated.normalized == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "settings", "words"),
    [
        ({}, Settings(forest="cloud"), "voxels of a point cloud"),
        ({"samples": 20_000, "baseline": 0.01}, Settings(), "20000 samples"),
        ({"baseline": 60.0, "samples": 9}, Settings(), "no ground is in all photos"),
        ({"baseline": 70.0, "samples": 9}, Settings(view="telecentric"), "49 degrees off nadir"),
        (
            {"density": 1e-5, "occluder_size": 0.001, "samples": 9, "baseline": 9.0},
            Settings(),
            "too small",
        ),
    ],
)
def test_plans_that_cannot_be_simulated_are_refused(change, settings, words):
    with pytest.raises(RequestError, match=words) as caught:
        simulate(plan(PlanRequest(**(QUICK | change))), settings)
    assert caught.value.hint


def test_a_uniform_forest_needs_a_uniform_scene(flight):
    scene = LayeredScene("stand", (Layer(2.0, 3.0, 0.2, 0.5),))
    loaded = replace(flight.inputs.loaded, scene=scene)
    made = replace(flight, inputs=flight.inputs._replace(loaded=loaded))
    with pytest.raises(RequestError, match="'stand', because this scene has layers"):
        simulate(made, Settings(forest="uniform"))


def test_occluders_count_from_the_focal_plane():
    raised = plan(PlanRequest(focal_height=4.0, samples=9, baseline=20.0, model="layered", **QUICK))
    found = simulate(raised, Settings(1, 0.005, view="telecentric"))
    assert found.agree, found.differences
    lower = plan(PlanRequest(samples=9, baseline=20.0, model="layered", **QUICK))
    assert (
        found.predicted.density
        < simulate(lower, Settings(view="telecentric")).simulated.density - 0.05
    )


# Pictures


def test_pictures_show_the_simulation(flight):
    import io

    from PIL import Image

    found = simulate(flight, Settings(1, 0.05, "uniform", "telecentric"))
    drawn = pictures(found)
    panels = np.asarray(Image.open(io.BytesIO(drawn.picture)))
    seen = np.asarray(Image.open(io.BytesIO(drawn.occlusion_map))) / 255
    assert panels.shape == (seen.shape[0], 3 * seen.shape[1] + 8, 3)
    assert min(seen.shape) >= 300
    assert set(np.unique(np.round(9 * seen, 1))) <= set(range(10))
    assert 1 - seen.mean() == pytest.approx(found.simulated.density, abs=0.15)
    assert drawn.single < drawn.integral < 1


def test_the_middle_view_is_the_nearest_to_the_middle():
    x, y = np.meshgrid(np.arange(3.0), np.arange(5.0))
    assert middle_of(np.column_stack([x.ravel(), y.ravel()])) == 7
    assert middle_of(np.zeros((1, 2))) == 0


def test_the_systematic_error_is_zero_for_patterns_and_small_for_volumes(flight):
    noise = simulate(flight, Settings(1, 0.05, "noise")).tolerance
    assert set(noise.values()) == {0.0}
    volumes = simulate(flight, Settings(1, 0.05, "uniform", "telecentric")).tolerance
    assert 0 < volumes["normalized"] < 0.05 * flight.solution.prediction.shortfall
    assert compare.TOLERANCE["density"] == volumes["density"]
