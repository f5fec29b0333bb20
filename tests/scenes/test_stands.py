"""Plans from point clouds: of generated stands, and of real stands if they are available."""

import json

import numpy as np
import pytest
from support.paths import CLOUDS

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.models.equations import required_samples
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest

laspy = pytest.importorskip("laspy")
pytest.importorskip("lazrs")

DATA = CLOUDS
real = pytest.mark.skipif(not DATA.is_dir(), reason="the real point clouds are not at hand")


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    """The cache of clouds, so that each cloud is read once for all tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AOSPLAN_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def stand(tmp_path_factory):
    """Flat ground and boxes of leaves between 3 and 15 m, in a plot of 20 x 20 m."""
    rng = np.random.default_rng(7)
    ground = rng.uniform(0.0, 20.0, (2, 20_000))
    corners = rng.uniform(0.0, 18.0, (2, 40))
    heights = rng.uniform(3.0, 14.0, 40)
    tree = rng.integers(0, 40, 60_000)
    leaves = corners[:, tree] + rng.uniform(0.0, 2.0, (2, 60_000))
    header = laspy.LasHeader(point_format=6)
    header.scales = np.full(3, 0.001)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y = np.hstack([ground, leaves])
    cloud.z = np.concatenate([np.zeros(20_000), heights[tree] + rng.uniform(0.0, 1.0, 60_000)])
    cloud.classification = np.repeat([2, 5], [20_000, 60_000]).astype(np.uint8)
    path = tmp_path_factory.mktemp("stand") / "stand.laz"
    cloud.write(str(path))
    return str(path)


def planned(scene, **given):
    return plan(PlanRequest(**({"altitude": 50, "scene": str(scene)} | given)))


def test_a_cloud_is_planned_by_its_voxels_unless_told_otherwise(stand):
    result = planned(stand, vhat="0.5")
    assert result.model == "measured"
    assert result.document()["visibility"]["view"] == "telecentric"
    assert result.solution.prediction.normalized >= 0.5
    assert planned(stand, model="uniform").model == "uniform"


@pytest.mark.slow
def test_the_request_of_a_cloud_fed_back_gives_the_same_plan(stand):
    for given in ({"model": "uniform"}, {"vhat": "0.5"}, {"optimize": "contrast"}):
        document = planned(stand, heading=30, **given).document()
        again = plan(PlanRequest(**document["request"])).document()
        assert again == document


def test_the_uniform_model_of_a_cloud_follows_the_coverage_rule(stand):
    result = planned(stand, model="uniform", vhat="98%")
    slabs = sorted((slab.bottom_m, slab.weight) for slab in result.scene.slabs())
    total = sum(weight for _, weight in slabs)
    risen, height = 0.0, None
    for at, weight in reversed(slabs):
        risen, height = risen + weight, at
        if risen >= 0.98 * total * (1 - 1e-12):
            break
    assert result.solution.baseline_m == pytest.approx(0.25 * 50 / height, rel=1e-12)
    assert result.solution.pattern.samples == required_samples("98%")
    assert result.solution.prediction.density == result.scene.measured_density


def test_an_occluder_size_of_ones_own_scales_the_baseline_of_a_cloud(stand):
    # The larger grid is wider than the footprint.
    free = {"model": "uniform", "allow_no_common_ground": True}
    base = planned(stand, **free).solution.baseline_m
    twice = planned(stand, **free, occluder_size=0.5).solution.baseline_m
    assert twice == pytest.approx(2.0 * base, rel=1e-12)


def test_both_views_of_a_stand_are_offered_and_differ(stand):
    fixed = {"baseline": 3.0, "samples": 25}
    below_each = planned(stand, view="telecentric", **fixed)
    below_one = planned(stand, view="perspective", **fixed)
    assert below_one.document()["visibility"]["view"] == "perspective"
    assert below_each.solution.prediction.shortfall != below_one.solution.prediction.shortfall


def test_a_saved_scene_gives_the_uniform_plan_of_its_cloud(stand, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(["scene", stand, "--save", "stand.toml", "--quiet"]) == 0
    of_cloud = planned(stand, model="uniform").solution
    of_file = planned("stand.toml", model="uniform").solution
    assert of_file.baseline_m == pytest.approx(of_cloud.baseline_m, rel=1e-12)
    assert of_file.prediction == of_cloud.prediction


def test_a_scene_saved_with_its_voxels_gives_the_measured_plan_of_its_cloud(
    stand, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert run(["scene", stand, "--save", "stand.npz", "--quiet"]) == 0
    of_cloud = planned(stand, vhat="0.5")
    of_file = planned("stand.npz", vhat="0.5")
    assert of_file.model == "measured"
    assert of_file.solution == of_cloud.solution
    again = plan(PlanRequest(**of_file.document()["request"]))
    assert again.document() == of_file.document()


def test_statistics_of_a_cloud_have_its_correlogram(stand, capsys):
    assert run(["scene", stand, "--json", "--quiet"]) == 0
    document = json.loads(capsys.readouterr().out)
    table = document["correlogram"]
    rho = np.array(table["rho"])
    assert rho.shape == (len(table["directions_deg"]), len(table["lags"]))
    assert np.array(document["density_by_offset"]).shape == rho.shape
    assert rho[:, 0].min() > rho[:, -1].max()  # Close views are similar, and distant views are not.


def test_a_scene_without_voxels_is_not_saved_with_them(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(["scene", "savanna", "--save", "savanna.npz"]) == 2
    assert "no voxels" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("given", [{"scene": "paper-forest"}, {"scene": None}])
def test_the_measured_model_needs_a_cloud(given):
    with pytest.raises(RequestError, match="voxels of a point cloud"):
        plan(PlanRequest(altitude=50, model="measured", **given))
    with pytest.raises(RequestError, match="--view"):
        plan(PlanRequest(altitude=50, view="perspective", **given))


@real
def test_the_real_pine_and_fir_stand_is_planned_end_to_end(tmp_path, capsys):
    geojson, table = tmp_path / "plan.geojson", tmp_path / "plan.csv"
    line = [
        *("plan", "--altitude", "50", "--vhat", "0.98", "--scene", str(DATA / "UAS_Clip.laz")),
        *("--camera", "dji-h20t-thermal", "--model", "uniform", "--opacity", "voxels"),
        *("--origin", "48.3358,14.3261", "--heading", "30", "--allow-no-common-ground"),
        *("--out", str(geojson), "--out", str(table), "--json"),
    ]
    assert run(line) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["baseline_m"] == pytest.approx(4.0, rel=0.01)
    assert document["samples"] == 50
    assert document["visibility"]["density"] == pytest.approx(0.7385, abs=0.002)
    (warning,) = [w for w in document["warnings"] if w["code"] == "no_common_ground"]
    assert "3.251 m" in warning["message"]  # The footprint of 22.76 m is divided by 7 baselines.
    assert len(json.loads(geojson.read_text())["features"]) == 51
    assert len(table.read_text().splitlines()) == 51


@real
@pytest.mark.parametrize(("cut", "baseline"), [(1.0, 5.88), (2.0, 4.0)])
def test_the_coverage_rule_gives_the_known_baseline_for_the_real_stand(cut, baseline):
    cloud = DATA / "UAS_Clip.laz"
    given = {"model": "uniform", "min_height": cut, "opacity": "voxels"}
    by_rule = planned(cloud, **given, allow_no_common_ground=True)
    assert by_rule.solution.baseline_m == pytest.approx(baseline, abs=0.01)
    # With the limit of the footprint, the rule is still used, and the grid is not wider than the
    # footprint.
    bounded = planned(cloud, **given)
    assert bounded.coverage.baseline_m == by_rule.solution.baseline_m
    assert bounded.solution.baseline_m <= by_rule.solution.baseline_m
    assert min(bounded.common_footprint_m) >= 0.0


@real
@pytest.mark.parametrize(
    ("baseline", "density", "visibility", "normalized"),
    [
        (2.0, 0.797, 0.3105, 0.668),
        pytest.param(3.5, 0.826, 0.2923, 0.820, marks=pytest.mark.slow),
    ],
)
def test_the_measured_model_gives_known_values_for_the_real_stand(
    baseline, density, visibility, normalized
):
    # The known values are for voxels with points and for the periodic plot.
    as_then = {"min_height": 0.5, "opacity": "voxels", "edges": "wrapped"}
    result = planned(DATA / "UAS_Clip.laz", samples=49, baseline=baseline, **as_then)
    prediction = result.solution.prediction
    assert prediction.density == pytest.approx(density, abs=0.002)
    assert prediction.expected == pytest.approx(visibility, abs=0.002)
    assert prediction.normalized == pytest.approx(normalized, abs=0.002)


@real
def test_a_stand_without_ground_class_is_planned_with_a_warning():
    pytest.importorskip("CSF")
    result = planned(DATA / "pine_plot.laz", model="uniform")
    assert "ground_filtered" in {warning.code for warning in result.warnings}
    assert result.solution.pattern.samples == 50
