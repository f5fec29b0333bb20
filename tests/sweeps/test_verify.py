"""Simulation of a sample of a sweep's rows: tests of the selection of rows, and of the verdict."""

import json
import math
import shlex

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from scipy import stats
from support.campaigns import sweep

from aosplan.cli.app import run as run_command
from aosplan.cli.schema import json_schema
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.simulation.compare import Settings, simulate
from aosplan.sweeps import scenarios as scenarios_module
from aosplan.sweeps import verify as v
from aosplan.sweeps.grouping import grouping
from aosplan.sweeps.scenarios import ScenarioProduct, ScenarioTable, column_of
from aosplan.sweeps.solve_block import solve_block

pytest.importorskip("polars")

CROSSING = ScenarioProduct(
    {
        "altitude": column_of([10.0, 30.0, 45.0, 60.0, 80.0]),
        "vhat": column_of([0.5, 0.8, 0.9]),
        "camera": column_of(["dji-m3t-thermal", "dji-h20t-thermal"]),
        "speed": column_of([3.0, 4.0, 5.0, 6.0]),
    }
)


def drawing_of(scenarios, rows, seed):
    return v.SamplingPlan(rows, seed, grouping(scenarios).groups)


def sample(scenarios, rows, seed):
    return v.sample(draw(scenarios, rows, seed), drawing_of(scenarios, rows, seed))


def draw(scenarios, rows, seed):
    """Draw from all rows that have a plan."""
    drawing = drawing_of(scenarios, rows, seed)
    found = v.RowSample()
    for index in range(scenarios.blocks):
        block = scenarios.block(index)
        frame = solve_block(block, (), ("samples",))
        part = v.draw_rows(drawing, block, frame, np.arange(block.rows))
        found = part.joined(found, rows=rows)
    return found


def test_the_sample_contains_extremes_and_every_text_value():
    chosen = sample(CROSSING, 20, 7)
    assert len(chosen) == len({each.row for each in chosen}) == 20
    assert [each.row for each in chosen] == sorted(each.row for each in chosen)
    requests = {each: v.scenario(CROSSING, each.row) for each in chosen}
    strata = {name: requests[each] for each in chosen for name in each.strata}
    assert len(strata) == 8
    # Altitudes within the canopy have no plan. The lowest altitude with a plan is therefore the
    # next one.
    assert strata["altitude least"]["altitude"] == 30.0
    assert strata["altitude most"]["altitude"] == 80.0
    assert strata["vhat least"]["vhat"] == 0.5
    assert strata["speed most"]["speed"] == 6.0
    assert strata["camera dji-h20t-thermal"]["camera"] == "dji-h20t-thermal"


@pytest.mark.parametrize("rows", [3, 20])
def test_the_sample_depends_on_nothing_but_the_sweep_and_the_seed(monkeypatch, rows):
    found = []
    for room in (5, 12, 1 << 18):
        monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", room)
        again = ScenarioProduct(CROSSING.values)
        assert again.blocks == {5: 30, 12: 15}.get(room, 1)
        found.append(sample(again, rows, 3))
    assert found[0] == found[1] == found[2]
    assert len(found[0]) == rows
    assert found[0] != sample(CROSSING, rows, 4)


def test_missing_values_are_a_separate_stratum():
    table = ScenarioTable(
        {
            "altitude": column_of([40.0, 50.0, 60.0, 70.0]),
            "samples": column_of([None, 60, 70, None]),
        }
    )
    found = draw(table, 9, 1).strata
    assert {name: row for name, (*_, row) in found.items()} == {
        "altitude least": 0,
        "altitude most": 3,
        "samples least": 1,
        "samples most": 2,
        "samples left out": found["samples left out"][2],
    }
    assert found["samples left out"][2] in {0, 3}


def test_every_row_is_drawn_as_often_as_any_other():
    # For each of 2000 seeds, 10 of 50 rows are drawn. Each row is therefore drawn about 400 times,
    # with variance 2000 · 0.2 · 0.8. Drawing without replacement multiplies the sum of squares by
    # 49/50.
    counts = np.zeros(50)
    for seed in range(2000):
        counts[np.argsort(v.priorities_of(np.arange(50), seed))[:10]] += 1
    chi = ((counts - 400.0) ** 2 / (2000 * 0.2 * 0.8 * 50 / 49)).sum()
    low, high = stats.chi2.ppf([1e-4, 1 - 1e-4], 49)
    assert low < chi < high


# Judgement


def test_chances_are_those_of_student():
    for errors, samples in ((0.0, 16), (1.3, 16), (3.5, 50), (6.0, 4)):
        expected = 2.0 * stats.t.sf(errors, samples - 1)
        assert v.chance_of(errors, samples) == pytest.approx(expected, rel=1e-12)
    assert v.chance_of(math.inf, 16) == 0.0


def test_the_worst_of_many_is_as_large_as_expected():
    # The largest of 60 normal deviates is simulated 20000 times. Half of the results are above the
    # median, and 1 % are above the critical value.
    worst = np.abs(np.random.default_rng(2).normal(size=(20_000, 60))).max(axis=1)
    for chance in (0.5, v.LEVEL):
        share = (worst > v.worst_expected(60, chance)).mean()
        assert abs(share - chance) < 4.0 * math.sqrt(chance * (1.0 - chance) / 20_000)
    # `chance_of_worst`, the probability of the largest deviate, is the inverse function.
    single = 2.0 * stats.norm.sf(v.worst_expected(60, 0.01))
    assert v.chance_of_worst(single, 60) == pytest.approx(0.01, rel=1e-9)
    assert v.chance_of_worst(1e-300, 60) == pytest.approx(6e-299)
    assert v.chance_of_worst(1.0, 60) == 1.0


def check(seed, request, **settings):
    planned = plan(PlanRequest(**request))
    found = simulate(planned, Settings(seed=seed, **settings))
    return v.Check(v.SampledRow(seed, ()), request, seed, found, "")


@pytest.fixture(scope="module")
def noise_checks():
    """Simulations of the same request that differ only in their seeds."""
    request = {"altitude": 60.0, "vhat": 0.8}
    return tuple(check(seed, request, forest="noise", precision=0.03) for seed in range(40))


def test_chances_of_correct_predictions_are_uniformly_distributed(noise_checks):
    for name in ("density", "expected", "normalized"):
        chances = [
            each.chance
            for found in noise_checks
            for each in found.comparisons()
            if each.quantity == name
        ]
        assert len(chances) == 40
        assert stats.kstest(chances, "uniform").pvalue > 1e-3


def test_correct_predictions_agree_with_their_simulations(noise_checks):
    found = v.Verification(0, 0.005, noise_checks, ())
    assert found.agree
    document = found.document()
    assert document["comparisons"] == 120
    assert document["worst"]["standard_errors"] < document["critical"] * 1.5
    differences = [abs(each.difference) for each in found.comparisons]
    assert abs(document["largest_difference"]["difference"]) == max(differences)


def test_one_wrong_prediction_among_many_is_found(noise_checks):
    simulation = noise_checks[17].simulation
    error = simulation.simulated.density_standard_error
    wrong = simulation.predicted._replace(density=simulation.simulated.density + 9.0 * error)
    checks = list(noise_checks)
    checks[17] = checks[17]._replace(simulation=simulation._replace(predicted=wrong))
    found = v.Verification(0, 0.005, tuple(checks), ())
    assert not found.agree
    worst = found.document()["worst"]
    assert (worst["row"], worst["quantity"]) == (18, "density")
    assert worst["standard_errors"] == pytest.approx(9.0)
    assert worst["chance_of_worst"] < v.LEVEL


def test_a_deviation_that_is_unlikely_alone_is_likely_among_many(noise_checks):
    # In a single comparison of 16 samples, a difference of 3.2 standard errors has a probability of
    # less than 1 %. Among 120 comparisons, the probability of at least one such difference is
    # higher.
    simulation = noise_checks[0].simulation
    assert simulation.samples >= 16
    error = simulation.simulated.density_standard_error
    shifted = simulation.predicted._replace(density=simulation.simulated.density + 3.2 * error)
    doubtful = noise_checks[0]._replace(simulation=simulation._replace(predicted=shifted))
    others = tuple(
        each._replace(
            simulation=each.simulation._replace(
                predicted=each.simulation.predicted._replace(
                    density=each.simulation.simulated.density
                ),
                tolerance={"density": 0.0, "expected": 1.0, "normalized": 1.0},
            )
        )
        for each in noise_checks[1:]
    )
    alone = doubtful._replace(
        simulation=doubtful.simulation._replace(
            tolerance={"density": 0.0, "expected": 1.0, "normalized": 1.0}
        )
    )
    chance = next(alone.comparisons()).chance
    assert chance < v.LEVEL
    assert v.Verification(0, 0.005, (alone, *others), ()).agree
    assert v.Verification(0, 0.005, (alone,), ()).document()["worst"]["chance"] == chance


def test_the_systematic_error_of_the_experiment_is_subtracted(noise_checks):
    first = noise_checks[0]
    (density, *_) = first.comparisons()
    error = first.simulation.simulated.density_standard_error
    wide = first.simulation._replace(tolerance=first.simulation.tolerance | {"density": 1.0})
    assert next(first._replace(simulation=wide).comparisons()).beyond == 0.0
    half = abs(density.difference) / 2.0
    narrow = first.simulation._replace(tolerance=first.simulation.tolerance | {"density": half})
    beyond = next(first._replace(simulation=narrow).comparisons()).beyond
    assert beyond == pytest.approx(half / error, rel=1e-4)


def test_rows_without_hidden_ground_have_no_comparisons():
    request = {"altitude": 40.0, "density": 0.0, "occluder_size": 0.2, "volume_height": 9.0}
    found = v.Verification(0, 0.005, (check(1, request),), ())
    document = found.document()
    assert (document["agree"], document["worst"], document["comparisons"]) == (None, None, 0)
    assert document["simulated"] == 1


# The command


@pytest.fixture
def campaign(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text("[sweep]\naltitude = [40, 70, 100]\nvhat = [0.5, 0.8]\nspeed = [3, 4, 5, 6]\n")
    return path


@pytest.mark.slow
def test_a_row_is_simulated_again_from_its_document(campaign, tmp_path, capsys):
    line = [campaign, "--simulate", 2, "--seed", 5, "--precision", 0.05]
    assert sweep(*line, "--json") == 0
    out = capsys.readouterr().out
    document = json.loads(out)
    Draft202012Validator(json_schema("sweep")).validate(document)
    found = document["verification"]
    assert (found["seed"], found["agree"], found["simulated"]) == (5, True, 2)
    taken = [name for row in found["rows"] for name in row["strata"]]
    assert set(taken) >= {"altitude least", "altitude most"}
    assert sorted([*taken, *found["strata_left_out"]]) == sorted(
        f"{name} {end}" for name in ("altitude", "vhat", "speed") for end in ("least", "most")
    )
    row = found["rows"][0]
    request = tmp_path / "request.json"
    request.write_text(json.dumps(row["request"]))
    again = ["simulate", str(request), "--seed", str(row["seed"]), "--view", row["view"]]
    assert run_command([*again, "--precision", "0.05", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert {name: printed[name] for name in ("predicted", "simulated", "tolerance", "forest")} == {
        name: row[name] for name in ("predicted", "simulated", "tolerance", "forest")
    }
    # If there is an output file, the same rows are drawn.
    assert sweep(*line, "--json", "--out", tmp_path / "r.csv", "--where", "altitude > 0") == 0
    assert json.loads(capsys.readouterr().out)["verification"] == found


@pytest.mark.slow
def test_the_table_gives_the_command_for_the_worst_row(campaign, capsys):
    with campaign.open("a") as file:
        file.write('scene = "open-woodland"\ncamera = "dji-h20t-thermal"\n')
    line = [campaign, "--simulate", 2, "--precision", 0.05]
    assert sweep(*line) == 0
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 80
    for words in ("2 rows simulated, seed 1", "Predicted and simulated agree.", "Šidák"):
        assert words in out
    # The rest of the output is one shell command in several lines.
    command = out.partition("Again:\n")[2].rstrip("\n")
    assert "\\\n" in command
    program, *again = shlex.split(command.replace("\\\n", ""))
    assert (program, again[0]) == ("aosplan", "simulate")
    assert run_command([*again, "--json"]) == 0
    simulated = json.loads(capsys.readouterr().out)["simulated"]
    assert sweep(*line, "--json") == 0
    found = json.loads(capsys.readouterr().out)["verification"]
    (worst,) = (row for row in found["rows"] if row["row"] == found["worst"]["row"])
    assert simulated == worst["simulated"]


def test_a_row_that_cannot_be_simulated_has_a_reason(tmp_path, capsys):
    path = tmp_path / "s.toml"
    path.write_text("[sweep]\naltitude = [40, 50]\nvhat = 0.5\nhold_error = 0.2\n")
    assert sweep(path, "--simulate", 5, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    Draft202012Validator(json_schema("sweep")).validate(document)
    found = document["verification"]
    assert (found["agree"], found["simulated"]) == (None, 0)
    assert [row["row"] for row in found["rows"]] == [1, 2]
    assert all("--hold-error 0.2" in row["reason"] for row in found["rows"])
    assert sweep(path, "--simulate", 5) == 0
    assert "row 1 is not simulated" in capsys.readouterr().out


def test_without_a_plan_nothing_is_simulated(tmp_path, capsys):
    path = tmp_path / "s.toml"
    path.write_text("[sweep]\naltitude = [5, 6]\n")
    assert sweep(path, "--simulate", 5) == 0
    assert "0 rows simulated" in capsys.readouterr().out


@pytest.mark.slow
def test_without_common_ground_each_target_has_its_own_aperture():
    # No ground is in the photos of all 25 samples if these are 9 m apart.
    values = {
        "altitude": column_of([40.0]),
        "samples": column_of([25]),
        "baseline": column_of([9.0]),
    }
    crossing = ScenarioProduct(values)
    assert min(plan(PlanRequest(altitude=40, samples=25, baseline=9)).common_footprint_m) < 0.0
    drawing = v.SamplingPlan(1, 1, ())
    found = v.verify(crossing, draw(crossing, 1, 1), drawing, Settings(precision=0.1))
    assert found.checks[0].simulation.settings.view == "telecentric"
    assert found.agree
