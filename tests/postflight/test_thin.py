"""Selections of views, compared with all possible selections and tested for necessary properties."""

import csv
import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from support.forests import STANDS, clumped_forest
from support.slices import slices_shortfall

from aosplan.cli.app import run
from aosplan.cli.schema import json_schema
from aosplan.errors import RequestError
from aosplan.grid.patterns import Pattern, pattern_for
from aosplan.models.correlogram import CorrelogramModel
from aosplan.models.layered import LayeredModel
from aosplan.models.measured import MeasuredModel
from aosplan.models.positions import positions_shortfall
from aosplan.models.uniform import UniformModel
from aosplan.planning.request import PlanRequest
from aosplan.postflight.best_views import (
    choose_views,
    correlations,
    exchanged,
    fewest_shared,
    jointly,
    representing,
    shortfall,
)
from aosplan.postflight.thin import thin_views
from aosplan.postflight.views import read_views
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.presets import find_preset_scene
from aosplan.scenes.scene import Layer
from aosplan.simulation.voxel_views import VoxelViews


def triangles(spacing):
    """Correlation of the uniform model."""

    def correlation(x, y):
        return np.maximum(1.0 - np.abs(x) / spacing, 0.0) * np.maximum(
            1.0 - np.abs(y) / spacing, 0.0
        )

    return correlation


@pytest.mark.parametrize("seed", range(12))
def test_choices_are_near_the_best_of_all_choices(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.0, 6.0, (11, 2))
    shared = correlations(points, triangles(3.0))
    for samples in (3, 5, 8):
        best = min(
            shortfall(shared, np.array(choice)) for choice in combinations(range(11), samples)
        )
        found = shortfall(shared, choose_views(points, samples, triangles(3.0)))
        assert best <= found * (1.0 + 1e-12)
        assert found <= best * 1.05


@pytest.mark.parametrize("seed", range(5))
def test_no_single_exchange_improves_a_choice(seed):
    rng = np.random.default_rng(seed)
    shared = correlations(rng.uniform(0.0, 8.0, (30, 2)), triangles(4.0))
    chosen = exchanged(shared, fewest_shared(shared, 9))
    left = [place for place in range(30) if place not in chosen]
    reached = shortfall(shared, chosen)
    for leaves in range(9):
        for enters in left:
            other = chosen.copy()
            other[leaves] = enters
            assert shortfall(shared, other) >= reached * (1.0 - 1e-9)


def test_the_shortfall_is_that_of_the_positions():
    points = np.random.default_rng(3).uniform(0.0, 30.0, (60, 2))
    chosen = choose_views(points, 20, triangles(5.0))
    shared = correlations(points, triangles(5.0))
    assert shortfall(shared, chosen) == pytest.approx(
        positions_shortfall(points[chosen], 5.0), rel=1e-12
    )


def test_views_a_spacing_apart_are_found_among_many():
    # A line of 401 views every half metre contains 41 views 5 m apart, which share no occluder.
    points = np.column_stack([0.5 * np.arange(401), np.zeros(401)])
    chosen = choose_views(points, 41, triangles(5.0))
    assert shortfall(correlations(points, triangles(5.0)), chosen) == pytest.approx(1 / 41)


def test_choosing_as_many_views_as_exist_returns_all_views():
    points = np.random.default_rng(1).uniform(0, 9, (7, 2))
    assert choose_views(points, 7, triangles(1.0)).tolist() == list(range(7))


def test_views_at_one_place_are_as_good_as_one():
    points = np.zeros((5, 2))
    assert len(choose_views(points, 3, triangles(1.0))) == 3


def test_too_few_and_too_many_views_are_errors():
    with pytest.raises(RequestError, match="2 photos are fewer"):
        choose_views([[0, 0], [1, 1]], 3, triangles(1.0))
    with pytest.raises(RequestError, match="too many"):
        choose_views(np.zeros((9000, 2)), 3, triangles(1.0))


@pytest.mark.parametrize("seed", range(6))
def test_choices_for_visibility_are_near_the_best_of_all_choices(seed):
    rng = np.random.default_rng(seed)
    points, hidden = rng.uniform(0.0, 6.0, (10, 2)), rng.uniform(0.2, 0.9, 10)
    joint = jointly(correlations(points, triangles(3.0)), hidden)
    assert joint.diagonal() == pytest.approx(hidden)
    for samples in (1, 3, 6):
        choices = [np.array(choice) for choice in combinations(range(10), samples)]
        best = min(shortfall(joint, choice) for choice in choices)
        found = shortfall(joint, choose_views(points, samples, triangles(3.0), hidden))
        assert best <= found * (1.0 + 1e-12)
        assert found <= best * 1.02


@pytest.mark.parametrize("seed", range(4))
def test_the_difference_from_all_views_is_that_of_their_masks(seed):
    rng = np.random.default_rng(seed)
    masks = (rng.random((9, 400)) < rng.uniform(0.2, 0.9, (9, 1))).astype(float)
    joint = masks @ masks.T / 400
    for samples in (1, 4, 8):
        changed = representing(joint, samples)
        for choice in (rng.choice(9, samples, replace=False) for _ in range(5)):
            off = masks[choice].mean(axis=0) - masks.mean(axis=0)
            expected = shortfall(changed, choice) + joint.mean()
            assert expected == pytest.approx((off**2).mean(), rel=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_choices_for_similarity_are_near_the_best_of_all_choices(seed):
    rng = np.random.default_rng(seed)
    points, hidden = rng.uniform(0.0, 6.0, (10, 2)), rng.uniform(0.2, 0.9, 10)
    joint = jointly(correlations(points, triangles(3.0)), hidden)
    for samples in (1, 3, 6):
        changed = representing(joint, samples)
        differences = {
            choice: shortfall(changed, np.array(choice)) + joint.mean()
            for choice in combinations(range(10), samples)
        }
        found = choose_views(points, samples, triangles(3.0), hidden, alike=True)
        better = sum(value < differences[tuple(found)] for value in differences.values())
        assert min(differences.values()) >= 0.0
        assert better <= 0.04 * len(differences)


@pytest.mark.parametrize("seed", range(3))
def test_on_another_stand_the_choice_is_more_similar_than_random_ones(seed):
    """The views are chosen with the model of one stand and evaluated with the rays of another
    stand.
    """
    rng = np.random.default_rng(seed)
    judged, known = (
        clumped_forest(STANDS["beech"]._replace(seed=20 + 2 * seed + k), side_m=16.0, voxel_m=0.5)
        for k in range(2)
    )
    points = rng.uniform(-8.0, 8.0, (40, 2))
    rays = VoxelViews(judged, 60.0, targets_per_voxel=1)
    masks = np.stack([rays.blocked_views(point[None]).astype(float) for point in points])
    model = MeasuredModel(known, 60.0)

    def difference(choice):
        return ((masks[choice].mean(axis=0) - masks.mean(axis=0)) ** 2).mean()

    drawn = [difference(rng.choice(40, 10, replace=False)) for _ in range(200)]
    chosen = choose_views(points, 10, model.correlation, model.hidden_at(points), alike=True)
    assert difference(chosen) < np.quantile(drawn, 0.1)


# Models

LAYERS = [Layer(2.0, 3.0, 0.2, 0.3), Layer(6.0, 7.0, 0.4, 0.5), Layer(9.0, 9.5, 0.1, 1.0)]
FOREST = clumped_forest(STANDS["beech"], side_m=16.0, voxel_m=0.5)
MODELS = {
    "uniform": UniformModel(0.6, 0.4, 2.8),
    "layered": LayeredModel(LAYERS, 40.0),
    "correlogram": CorrelogramModel(correlogram(FOREST), 60.0),
}


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("baseline", [0.7, 1.9, 2.7])
def test_correlations_are_those_behind_the_models_predictions(name, baseline):
    # For two views, K = (1 + c)/2. Columns are along the heading, which is north.
    model = MODELS[name]
    pair = 2.0 * model.predict(Pattern(1, 2), baseline).shortfall - 1.0
    along = (0.0, baseline) if name == "correlogram" else (baseline, 0.0)
    for sign in (1.0, -1.0):
        found = model.correlation(*(np.array([sign * each]) for each in along))
        assert found == pytest.approx(pair, rel=1e-12)
    assert model.correlation(np.zeros(1), np.zeros(1)) == pytest.approx(1.0)


@pytest.mark.parametrize("rays", ["nadir", "oblique", "cubes"])
@pytest.mark.parametrize("kind", ["trimmed", "lanes", "spiral"])
@pytest.mark.parametrize("name", ["uniform", "layered"])
def test_positions_of_a_pattern_show_what_the_pattern_shows(name, kind, rays):
    if name == "uniform":
        model = UniformModel(0.6, 0.4, 2.8, rays=rays, altitude_m=40.0)
    else:
        model = LayeredModel(LAYERS, 40.0, rays=rays)
    pattern = pattern_for(kind, 23)
    points = 1.3 * np.array(list(pattern.offsets()))
    expected = model.predict(pattern, 1.3)
    # In the layered model, results are interpolated over the length of rays. For scattered
    # positions, the nodes are different.
    assert tuple(model.predict_positions(points)) == pytest.approx(tuple(expected), rel=1e-6)
    assert model.hidden_at(points).mean() == pytest.approx(expected.density, rel=1e-9)


@pytest.mark.parametrize("name", ["uniform", "layered"])
def test_known_positions_have_no_noise(name):
    if name == "uniform":
        sharp, noisy = (UniformModel(0.6, 0.4, 2.8, hold_error_m=error) for error in (0.0, 0.5))
    else:
        sharp, noisy = (LayeredModel(LAYERS, 40.0, hold_error_m=error) for error in (0.0, 0.5))
    points = np.random.default_rng(2).uniform(-4, 4, (20, 2))
    assert noisy.predict_positions(points) == sharp.predict_positions(points)
    assert noisy.predict(Pattern(4, 5), 1.0) != sharp.predict(Pattern(4, 5), 1.0)


def test_views_of_a_measured_stand_are_chosen_with_its_correlogram():
    model, table = MeasuredModel(FOREST, 60.0), MODELS["correlogram"]
    x, y = np.random.default_rng(4).uniform(-5, 5, (2, 9))
    assert (model.correlation(x, y) == table.correlation(x, y)).all()
    points = np.column_stack([x, y])
    assert (model.hidden_at(points) == table.hidden_at(points)).all()


# The command


@pytest.fixture
def recording(tmp_path, monkeypatch):
    """504 views along lines, as in the paper's Fig. 9, in a CSV with an additional column."""
    monkeypatch.chdir(tmp_path)
    x, y = np.meshgrid(1.2 * np.arange(24), 1.4 * np.arange(21))
    points = np.column_stack([x.ravel(), y.ravel()])
    points += np.random.default_rng(1).normal(0.0, 0.3, points.shape) - points.mean(axis=0)
    rows = [f"{x:.3f},{y:.3f},view {k}" for k, (x, y) in enumerate(points)]
    (tmp_path / "views.csv").write_text("\n".join(["x,y,note", *rows, ""]))
    return points.round(3)


@pytest.mark.parametrize("samples", [50, 25])
def test_504_views_are_thinned(recording, capsys, samples):
    line = ["thin", "views.csv", "--altitude=35", "--samples", str(samples), "--out=kept.csv"]
    assert run([*line, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    Draft202012Validator(json_schema("thinning")).validate(found)
    chosen = [view["index"] for view in found["views"]]
    assert chosen == sorted(set(chosen))
    turned = recording[:, ::-1]  # The heading is north.
    layers = find_preset_scene("paper-forest").slices()
    assert found["kept"]["shortfall"] == pytest.approx(
        slices_shortfall(turned[chosen], layers, 35.0), rel=1e-6
    )
    assert found["all"]["shortfall"] == pytest.approx(
        slices_shortfall(turned, layers, 35.0), rel=1e-6
    )
    # This number of views can be chosen without shared occluders, so the bound is reached.
    assert found["kept"]["shortfall"] == pytest.approx(1.0 / samples, rel=1e-3)
    assert found["bound"]["shortfall"] == 1.0 / samples
    rng = np.random.default_rng(0)
    others = [
        slices_shortfall(turned[rng.choice(504, samples, replace=False)], layers, 35.0)
        for _ in range(20)
    ]
    assert found["kept"]["shortfall"] <= min(others) < np.mean(others)
    rows = list(csv.DictReader(Path("kept.csv").read_text().splitlines()))
    assert list(rows[0]) == ["original_index", "x", "y", "note"]
    assert [int(row["original_index"]) for row in rows] == chosen
    assert [row["note"] for row in rows] == [f"view {index}" for index in chosen]


def test_a_thinned_recording_that_is_thinned_again_keeps_its_places(recording):
    line = ["thin", "--altitude=35", "--quiet"]
    assert run([*line, "views.csv", "--samples=50", "--out=fifty.csv"]) == 0
    assert run([*line, "fifty.csv", "--samples=25", "--out=few.csv"]) == 0
    fifty, few = (Path(name).read_text().split("\n") for name in ("fifty.csv", "few.csv"))
    assert len(few) == 27
    assert set(few) <= set(fifty)


def test_names_of_photos_are_written(tmp_path, monkeypatch, capsys):
    photo = pytest.importorskip("support.geotagged").photo
    monkeypatch.chdir(tmp_path)
    (tmp_path / "photos").mkdir()
    for k in range(6):  # three pairs of neighbours
        photo(tmp_path / "photos" / f"{k}.jpg", 48.0 + 1e-4 * (k // 2) + 1e-7 * k, 14.0)
    photo(tmp_path / "photos" / "nowhere.jpg")
    assert run(["thin", "photos", "--altitude=40", "--samples=3", "--out=-"]) == 0
    out, err = capsys.readouterr()
    assert sorted(int(name.removesuffix(".jpg")) // 2 for name in out.split()) == [0, 1, 2]
    assert "nowhere.jpg" in err


def test_choices_for_visibility_show_more_of_a_measured_stand(tmp_path):
    from aosplan.scenes.files.voxel_file import VoxelStand, stand_npz

    (tmp_path / "stand.npz").write_bytes(stand_npz(VoxelStand.of(FOREST)))
    x, y = np.meshgrid(np.linspace(-14, 14, 12), np.linspace(-14, 14, 12))
    rows = [f"{x},{y}" for x, y in zip(x.ravel(), y.ravel(), strict=True)]
    (tmp_path / "views.csv").write_text("\n".join(["x,y", *rows, ""]))
    views = read_views(str(tmp_path / "views.csv"), on_earth=False)
    request = PlanRequest(altitude=60, scene=str(tmp_path / "stand.npz"))
    apart, most = (thin_views(request, views, 20, best=b) for b in ("normalized", "visibility"))
    model, points = apart.plan.problem.model, np.array(views.positions_m)
    for found in (apart, most):  # The values are exact, because they are counted in all voxels.
        assert found.kept == model.predict_positions(points[found.chosen])
    assert most.kept.expected > apart.kept.expected
    assert most.kept.expected > most.every.expected
    assert apart.kept.shortfall < most.kept.shortfall


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ([], "--samples N is needed"),
        (["--samples=0"], "--samples '0' is not a whole number"),
        (["--samples=505"], "504 photos are fewer"),
        (["--samples=5", "--heading=best"], "photos that are already recorded"),
        (["--samples=5", "--best=most"], "--best 'most'"),
        (["--samples=5", "--density=0", "--occluder-size=1", "--volume-height=9"], "one photo"),
        (["--samples=5", "--out=-", "--json"], "both write to stdout"),
    ],
)
def test_wrong_requests_are_one_clear_error(recording, capsys, extra, words):
    assert run(["thin", "views.csv", "--altitude=35", *extra]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert words in err


def test_thin_reports_the_detection_with_the_chosen_views(tmp_path):
    places = [(2.0 * x, 2.0 * y) for x in range(6) for y in range(6)]
    path = tmp_path / "flown.csv"
    path.write_text("east_m,north_m\n" + "".join(f"{x},{y}\n" for x, y in places))
    request = PlanRequest(
        altitude=40,
        integrated_density=0.8,
        occluder_size=0.5,
        volume_height=3.0,
        find="person",
        contrast=3.0,
        canopy_offset=0.0,
        crown_share=0.0,
    )
    found = thin_views(request, read_views(str(path), on_earth=False), 12)
    every, kept = found.detection
    # On average, twelve views at the rim share fewer occluders than all 36 views. Searches of
    # simulated slices find a share of 0.14 of the targets with all views, and 0.20 with these
    # twelve.
    assert every == pytest.approx(0.14, abs=0.05)
    assert kept == pytest.approx(0.20, abs=0.05)
    assert kept > every
    assert found.document()["detection"] == {"all": every, "kept": kept}
    assert "detection_few_photos" not in {code for code, _ in found.warnings}
