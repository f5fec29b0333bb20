"""The stated effects of changes of the scene, compared with plans for the changed scenes."""

import numpy as np
import pytest
from support.forests import STANDS, clumped_forest

from aosplan.grid.patterns import Pattern
from aosplan.models.measured import MeasuredModel
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.planning.sensitivity import FACTORS, QUANTITIES, with_density_factor
from aosplan.scenes.files.voxel_file import VoxelStand, stand_npz
from aosplan.scenes.voxels import VoxelVolume

VOLUME = {"density": 0.01, "occluder_size": 0.2, "volume_height": 15.0, "volume_base": 2.0}


def changes(**options):
    result = plan(PlanRequest(sensitivity=True, **options))
    assert [(c.quantity, c.factor) for c in result.sensitivity] == [
        (quantity, factor) for quantity in QUANTITIES for factor in FACTORS
    ]
    return result, {(c.quantity, c.factor): c for c in result.sensitivity}


def check(change, planned, changed):
    """Compare the stated effect of a change with the planned grid in the changed scene, and with a
    new plan for this scene.
    """
    grid = planned.solution
    fixed = {"baseline": grid.baseline_m, "samples": grid.pattern.samples}
    shown = plan(PlanRequest(**changed, **fixed)).solution
    assert shown.pattern == grid.pattern
    assert change.visibility == pytest.approx(shown.prediction.expected, rel=1e-12)
    assert change.normalized == pytest.approx(shown.prediction.normalized, rel=1e-12)
    own = plan(PlanRequest(**changed)).solution
    assert change.samples == own.pattern.samples
    assert change.baseline_m == pytest.approx(own.baseline_m, rel=1e-9)
    assert change.reason is None


@pytest.mark.parametrize("model", ["uniform", "layered"])
@pytest.mark.parametrize("target", [{"vhat": 0.95}, {"visibility": 0.6, "max_aperture": 15}])
def test_a_uniform_volume_is_changed_number_by_number(model, target):
    options = {"altitude": 40, "model": model, **target}
    planned, found = changes(**options, **VOLUME)
    for factor in FACTORS:
        for quantity, names in (
            ("density", ["density"]),
            ("occluder_size", ["occluder_size"]),
            ("height", ["volume_height", "volume_base"]),
        ):
            scaled = VOLUME | {name: factor * VOLUME[name] for name in names}
            check(found[quantity, factor], planned, options | scaled)


def test_a_given_density_is_kept_unless_density_is_changed():
    planned, found = changes(
        altitude=40, integrated_density=0.5, occluder_size=0.2, volume_height=15
    )
    p, t = 0.5, 0.5
    vhat = planned.solution.prediction.normalized
    assert found["height", 1.2].visibility == pytest.approx(t * (1 + p * vhat), rel=1e-12)
    slices = 15 / 0.2
    d = 1.0 - 0.5 ** (1.0 / slices)
    p = 1.0 - (1.0 - 0.8 * d) ** slices
    assert found["density", 0.8].visibility == pytest.approx((1 - p) * (1 + p * vhat), rel=1e-12)


LAYERS = [(1.0, 3.0, 0.1, 0.4), (5.0, 9.0, 0.3, 0.6), (9.0, 14.0, 0.2, 0.3)]


def layer_file(path, layers):
    text = 'name = "stack"\n' + "".join(
        f"[[layers]]\nbottom_m = {b!r}\ntop_m = {t!r}\ndensity = {d!r}\noccluder_size_m = {o!r}\n"
        for b, t, d, o in layers
    )
    path.write_text(text)
    return str(path)


def test_layers_are_changed_one_by_one(tmp_path):
    options = {"altitude": 40, "vhat": 0.9, "optimize": "aperture"}
    planned, found = changes(**options, scene=layer_file(tmp_path / "stack.toml", LAYERS))
    for factor in FACTORS:
        for quantity, columns in (("density", [2]), ("occluder_size", [3]), ("height", [0, 1])):
            scaled = [
                tuple(
                    value * (factor if index in columns else 1.0) for index, value in enumerate(row)
                )
                for row in LAYERS
            ]
            scene = layer_file(tmp_path / f"{quantity}{factor}.toml", scaled)
            check(found[quantity, factor], planned, options | {"scene": scene})


def test_a_change_without_a_plan_has_a_reason():
    _, found = changes(altitude=40, max_aperture=20, max_samples=50)
    wide = found["height", 0.8]  # Lower occluders need a wider aperture.
    assert (wide.samples, wide.baseline_m) == (None, None)
    assert wide.visibility is not None
    assert "out of reach" in wide.reason
    _, found = changes(altitude=23)  # The top of the canopy is at 20.04 m.
    assert found["height", 1.2][2:6] == (None, None, None, None)
    assert "which is as high as the cameras" in found["height", 1.2].reason
    assert found["height", 0.8].reason is None
    solid = {"density": 0.9, "occluder_size": 5.0, "volume_height": 4.0, "vhat": 0.3}
    _, found = changes(altitude=40, **solid)
    assert found["density", 1.2].visibility is None
    assert "density 1.08" in found["density", 1.2].reason


def test_nothing_is_changed_unless_asked_for(monkeypatch):
    monkeypatch.setattr("aosplan.planning.sensitivity.changes_of", lambda *_: 1 / 0)
    result = plan(PlanRequest(altitude=40))
    assert result.sensitivity == ()
    assert result.document()["sensitivity"] is None


# --- Voxels ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def forest():
    return clumped_forest(STANDS["beech"], side_m=16.0, voxel_m=0.5)


def test_changes_of_size_and_height_of_voxels_are_changes_of_altitude(forest):
    # A plot of twice the width, in which each voxel is replaced by four, and a plot of twice the
    # height.
    pattern = Pattern(4, 3)
    wide = VoxelVolume(forest.occupied.repeat(2, axis=1).repeat(2, axis=2), 0.5)
    stretched = MeasuredModel(wide, 50.0, targets_per_voxel=2).predict(pattern, 2.0)
    assert MeasuredModel(forest, 100.0).predict(pattern, 2.0) == stretched
    high = VoxelVolume(forest.occupied.repeat(2, axis=0), 0.5)
    raised = MeasuredModel(high, 100.0).predict(pattern, 2.0)
    lower = MeasuredModel(forest, 50.0).predict(pattern, 2.0)
    assert lower.expected == pytest.approx(raised.expected, abs=0.003)
    assert lower.normalized == pytest.approx(raised.normalized, abs=0.006)


def test_a_measured_plan_is_changed_voxel_by_voxel(forest, tmp_path):
    path = tmp_path / "beech.npz"
    path.write_bytes(stand_npz(VoxelStand.of(forest)))
    options = {"altitude": 60.0, "vhat": 0.4, "max_samples": 9}
    planned, found = changes(scene=str(path), **options)
    grid = planned.solution.pattern, planned.solution.baseline_m
    for factor in FACTORS:
        for quantity, model in (
            ("density", MeasuredModel(with_density_factor(forest, factor), 60.0, edges="auto")),
            ("occluder_size", MeasuredModel(forest, 60.0 * factor, edges="auto")),
            ("height", MeasuredModel(forest, 60.0 / factor, edges="auto")),
        ):
            change, shown = found[quantity, factor], model.predict(*grid)
            assert change.visibility == shown.expected
            assert change.normalized == shown.normalized
            assert change.reason is None
            again = model.predict(planned.solution.pattern, change.baseline_m)
            if change.samples == planned.solution.pattern.samples:
                assert again.normalized >= 0.4 * (1 - 1e-12)
    assert found["density", 0.8].visibility > planned.solution.prediction.expected
    assert found["density", 1.2].visibility < planned.solution.prediction.expected


def test_voxels_are_taken_away_and_added_slice_by_slice(forest):
    before = forest.occupied
    counts = before.sum(axis=(1, 2))
    fewer, more = (with_density_factor(forest, factor).occupied for factor in FACTORS)
    assert not (fewer & ~before).any()
    assert (before.sum(axis=(1, 2)) - fewer.sum(axis=(1, 2)) == np.round(0.2 * counts)).all()
    assert not (before & ~more).any()
    added = more & ~before
    beside = np.zeros_like(before)
    for axis in (1, 2):
        for step in (-1, 1):
            beside |= np.roll(before, step, axis=axis)
    assert not (added & ~beside).any()
    room = (beside & ~before).sum(axis=(1, 2))
    assert (added.sum(axis=(1, 2)) == np.minimum(np.round(0.2 * counts), room)).all()
    assert (with_density_factor(forest, 0.8).occupied == fewer).all()
    full = VoxelVolume(np.ones((2, 4, 4), dtype=bool), 1.0)
    assert with_density_factor(full, 1.2).occupied.all()
