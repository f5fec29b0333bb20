"""Standard errors, compared with fields of known variance, and with random forests of the same
kind.
"""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from support.forests import STANDS, clumped_forest

from aosplan.grid.patterns import Pattern
from aosplan.models.measured import MeasuredModel
from aosplan.models.model import Prediction
from aosplan.models.uncertainty import (
    OCTAVE,
    PERSPECTIVE,
    SMALLEST_QUARTER,
    UNIFORM,
    ErrorPart,
    Uncertainty,
    finer,
    of_apertures,
    of_clumps,
    of_parts,
    of_targets,
    of_voxel_size,
    quarters,
    with_doubt,
    with_part,
)
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.scenes.files.voxel_file import VoxelStand, stand_npz
from aosplan.scenes.opacity import Opacity
from aosplan.scenes.voxels import VoxelVolume


def statistics(hidden):
    """p̄, V and V̂, computed from their definitions."""
    p, square = hidden.mean(), (hidden**2).mean()
    return p, 1.0 - square, 1.0 - (square - p * p) / (p * (1.0 - p))


@pytest.mark.parametrize(("block", "cell"), [(1, 1), (4, 1), (8, 1), (8, 2)])
def test_errors_are_the_scatter_of_fields_of_blocks(block, cell):
    rng = np.random.default_rng(6)
    side = 96 // block
    fields = [
        np.roll(
            (rng.binomial(9, rng.beta(2.0, 3.0, (side, side))) / 9.0)
            .repeat(block, axis=0)
            .repeat(block, axis=1),
            rng.integers(0, 96, 2),
            axis=(0, 1),
        )
        for _ in range(300)
    ]
    scatter = np.std([statistics(field) for field in fields], axis=0, ddof=1)
    errors = [of_targets(field, cell) for field in fields[:60]]
    for index, name in enumerate(("density", "expected", "normalized")):
        stated = math.sqrt(np.mean([getattr(error, name) ** 2 for error in errors]))
        # The standard deviation has an error of 4 %. With few blocks, noise makes the integral
        # range too large.
        assert 0.88 < stated / scatter[index] < (1.2 if block < 8 else 1.35), name
    assert {error.method for error in errors} == {"integral range"}


def test_errors_do_not_depend_on_the_origin_of_a_periodic_plot():
    rng = np.random.default_rng(7)
    field = rng.random((12, 18)).repeat(4, axis=0).repeat(4, axis=1)
    here, there = of_targets(field), of_targets(np.roll(field, (5, 11), axis=(0, 1)))
    assert here[:3] == pytest.approx(there[:3], rel=1e-9)


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_all_or_nothing_hidden_has_no_normalized_error(value):
    assert of_targets(np.full((16, 16), value))[:4] == (0.0, 0.0, None, "integral range")


def test_the_standard_error_of_parts_follows_from_their_scatter():
    predictions = [Prediction(p, 1.0 - p, k) for p, k in ((0.4, 0.1), (0.5, 0.3), (0.6, 0.2))]
    errors = of_parts(predictions)
    assert errors.density == pytest.approx(0.1 / math.sqrt(3.0), rel=1e-12)
    assert errors.normalized == pytest.approx(0.1 / math.sqrt(3.0), rel=1e-12)
    expected = [each.expected for each in predictions]
    assert errors.expected == pytest.approx(np.std(expected, ddof=1) / math.sqrt(3.0), rel=1e-12)
    assert errors.method == "3 parts of the plot"
    assert of_parts([*predictions, Prediction(0.0, 1.0, 0.1)]).normalized is None


def test_quarters_are_the_plot():
    volume = clumped_forest(STANDS["beech"], side_m=16.0, voxel_m=0.5)
    parts = list(quarters(volume))
    assert {part.occupied.shape[1:] for part in parts} == {(16, 16)}
    lower = np.concatenate([part.occupied for part in parts[:2]], axis=2)
    upper = np.concatenate([part.occupied for part in parts[2:]], axis=2)
    assert (np.concatenate([lower, upper], axis=1) == volume.occupied).all()
    side = 2 * SMALLEST_QUARTER
    assert len(list(quarters(VoxelVolume(np.zeros((3, side, side + 1), dtype=bool), 1.0)))) == 4
    assert not list(quarters(VoxelVolume(np.zeros((3, side - 1, 40), dtype=bool), 1.0)))


def test_the_share_of_views_is_that_of_the_masks():
    model = MeasuredModel(clumped_forest(STANDS["beech"], side_m=16.0, voxel_m=0.5), 50.0)
    pattern = Pattern(3, 4)
    views = model.occlusion.unpack(model.occlusion.masks(model.sites_m(pattern, 1.5)))
    hidden = model.hidden_share(pattern, 1.5)
    assert (hidden == views.mean(axis=0)).all()
    found = model.predict(pattern, 1.5)
    assert statistics(hidden)[1:] == pytest.approx((found.expected, found.normalized), rel=1e-12)


def test_stated_errors_are_those_of_other_forests_of_the_same_kind():
    rng = np.random.default_rng(8)
    found = []
    for seed in range(16):
        stand = STANDS["open_pine"]._replace(seed=100 + seed, trees=int(rng.poisson(32)))
        forest = clumped_forest(stand, side_m=48.0, voxel_m=0.75)
        model = MeasuredModel(forest, 50.0, targets_per_voxel=2)
        plan_at = Pattern(5, 5), 2.0
        found.append((model.predict(*plan_at), of_targets(model.hidden_share(*plan_at), 2)))
    for name in ("density", "expected", "normalized"):
        scatter = np.std([getattr(each, name) for each, _ in found], ddof=1)
        stated = math.sqrt(np.mean([getattr(error, name) ** 2 for _, error in found]))
        # the standard deviation of sixteen forests has an error of 18 %
        assert 0.6 < stated / scatter < 1.6, name


# --- Plans -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def stand(tmp_path_factory):
    path = tmp_path_factory.mktemp("stand") / "beech.npz"
    path.write_bytes(
        stand_npz(VoxelStand.of(clumped_forest(STANDS["beech"], side_m=16.0, voxel_m=0.5)))
    )
    return str(path)


def test_a_measured_plan_states_its_errors_and_its_edges(stand):
    result = plan(PlanRequest(altitude=60, scene=stand, baseline=1.5, samples=9, edges="wrapped"))
    visibility = result.document()["visibility"]
    model = MeasuredModel(clumped_forest(STANDS["beech"], side_m=16.0, voxel_m=0.5), 60.0)
    expected = of_targets(model.hidden_share(Pattern(3, 3), 1.5), 4)
    assert visibility["uncertainty"] == expected.document()
    assert "registration" in " ".join(visibility["uncertainty"]["omits"])
    assert 0.0 < visibility["uncertainty"]["normalized"] < 0.3
    assert visibility["uncertainty_reason"] is None
    assert visibility["edges"] == "wrapped"
    assert visibility["noise"] is None


@pytest.mark.slow
def test_position_noise_and_standard_error_are_stated_separately(stand):
    noisy = PlanRequest(altitude=60, scene=stand, baseline=1.5, samples=9, hold_error=0.5)
    visibility = plan(noisy).document()["visibility"]
    assert visibility["noise"]["flights"] == 45
    assert visibility["noise"]["seed"] == 1
    assert 0.0 < visibility["noise"]["normalized_error"] < 0.02
    assert visibility["uncertainty"]["normalized"] > visibility["noise"]["normalized_error"]


@pytest.mark.parametrize("model", ["uniform", "layered"])
def test_models_of_statistics_compare_quarters_of_a_cloud(stand, model):
    request = PlanRequest(altitude=60, scene=stand, baseline=2.5, samples=9, model=model)
    errors = plan(request).document()["visibility"]["uncertainty"]
    assert errors["method"] == "4 parts of the plot"
    assert "model" in errors["omits"][0]
    assert 0.0 < errors["density"] < 0.2
    assert plan(request).document()["visibility"]["edges"] is None
    from aosplan.models.layered import LayeredModel
    from aosplan.scenes.occluder_statistics import layered_scene

    if model == "layered":
        volume = clumped_forest(STANDS["beech"], side_m=16.0, voxel_m=0.5)
        densities = [
            LayeredModel(layered_scene(part, "part").slices(), 60.0).density
            for part in quarters(volume)
        ]
        assert errors["density"] == pytest.approx(np.std(densities, ddof=1) / 2.0, rel=1e-9)


def test_scenes_given_by_numbers_explain_missing_standard_errors():
    for request in (
        PlanRequest(altitude=40),
        PlanRequest(altitude=40, model="layered"),
        PlanRequest(altitude=40, density=0.0, occluder_size=0.2, volume_height=10),
    ):
        visibility = plan(request).document()["visibility"]
        assert visibility["uncertainty"] is None
        assert visibility["uncertainty_reason"]


def test_the_error_of_opacity_is_added_as_an_independent_error():
    rng = np.random.default_rng(2)
    # The standard deviation of a uniform distribution between two bounds.
    assert rng.uniform(0.0, 1.0, 200_000).std() == pytest.approx(UNIFORM, rel=0.01)
    one, other = Prediction(0.7, 0.3, 0.2), Prediction(0.5, 0.5, 0.3)
    found = with_doubt(Uncertainty(0.03, 0.04, None, "parts"), one, other, UNIFORM, "opacity")
    assert found.density == pytest.approx(math.sqrt(0.03**2 + 0.2**2 / 12.0))
    gap = one.expected - other.expected
    assert found.expected == pytest.approx(math.sqrt(0.04**2 + gap**2 / 12.0))
    assert found.normalized is None
    assert found.method == "parts, and opacity"
    (part,) = found.parts
    assert part.source == "opacity"
    assert part[1:3] == pytest.approx((0.2 * UNIFORM, -gap * UNIFORM))
    assert part.normalized is None


def test_parts_add_up_by_their_squares():
    errors = of_targets(np.random.default_rng(1).random((32, 32)))
    more = with_part(with_part(errors, ErrorPart("edges", 0.1, 0.2, 0.3)), of_clumps(180.0))
    for name in ("density", "expected", "normalized"):
        squares = sum(getattr(part, name) ** 2 for part in more.parts)
        assert getattr(more, name) == pytest.approx(math.sqrt(squares), rel=1e-12)
    assert [part.source for part in more.parts] == ["plot", "edges", "clumps"]
    assert more.document()["parts"][1]["normalized"] == 0.3


def test_clumps_that_pulses_do_not_resolve_are_those_of_the_benchmark():
    """For each pulse density, the errors are the root mean squares over generated stands with
    calibrated energies.
    """
    with (Path(__file__).parents[2] / "benchmarks/results/opacity.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["opacity"] == "pulses, intensity"]
    for least, most in ((40.0, 80.0), (80.0, 350.0), (350.0, math.inf)):
        chosen = [row for row in rows if least <= float(row["pulses_a_m2"]) < most]
        for density in (least, min(most, 1e6) - 0.1):
            part = of_clumps(density)
            for name in ("density", "expected", "normalized"):
                off = [float(row[name]) - float(row[f"true_{name}"]) for row in chosen]
                assert getattr(part, name) == pytest.approx(
                    np.sqrt(np.mean(np.square(off))), abs=6e-4
                )


def test_the_variation_between_apertures_is_part_of_the_error():
    """If the fields differ only in their means, the error is the standard deviation of these
    means.
    """
    fields = [np.full((8, 8), value) for value in (0.2, 0.4, 0.5, 0.7)]
    errors = of_apertures(fields)
    assert errors.density == pytest.approx(PERSPECTIVE * np.std([0.2, 0.4, 0.5, 0.7], ddof=1))
    seen = [1.0 - value**2 for value in (0.2, 0.4, 0.5, 0.7)]
    assert errors.expected == pytest.approx(PERSPECTIVE * np.std(seen, ddof=1))
    one = np.random.default_rng(4).random((24, 24))
    alone, four = of_targets(one), of_apertures([one] * 4)
    for name, factor in (("density", PERSPECTIVE), ("expected", PERSPECTIVE), ("normalized", 1.0)):
        assert getattr(four, name) == pytest.approx(factor * getattr(alone, name))
    assert of_apertures([*fields, np.ones((8, 8))]).normalized is None


def test_errors_in_perspective_are_the_scatter_of_forests_of_the_same_kind():
    rng = np.random.default_rng(9)
    found = []
    for seed in range(16):
        stand = STANDS["beech"]._replace(seed=200 + seed, trees=max(int(rng.poisson(18)), 1))
        forest = clumped_forest(stand, side_m=24.0, voxel_m=0.75)
        model = MeasuredModel(forest, 50.0, view="perspective", targets_per_voxel=1)
        plan_at = Pattern(3, 3), 2.0
        found.append((model.predict(*plan_at), of_apertures(model.hidden_at_places(*plan_at))))
    for name in ("density", "expected", "normalized"):
        scatter = np.std([getattr(each, name) for each, _ in found], ddof=1)
        stated = math.sqrt(np.mean([getattr(error, name) ** 2 for _, error in found]))
        # the standard deviation of sixteen forests has an error of 18 %
        assert 0.6 < stated / scatter < 1.9, name


def test_targets_of_moved_apertures_are_at_their_places_of_the_plot():
    """For a single distant camera, all apertures hide the same places of the plot."""
    forest = clumped_forest(STANDS["beech"], side_m=16.0, voxel_m=0.5)
    model = MeasuredModel(forest, 1e9, view="perspective")
    columns = forest.occupied.any(axis=0)
    for hidden in model.hidden_at_places(Pattern(1, 1), 1.0):
        assert (hidden == columns).mean() > 0.99


@pytest.mark.parametrize("source", ["pulses", "voxels"])
def test_the_errors_of_a_plan_contain_its_opacity(tmp_path, source):
    """The error follows from the difference between the two bounds, or from the difference to the
    result with voxels of twice the size.
    """
    rng = np.random.default_rng(3)
    middle = rng.random((40, 64, 64)) < 0.02
    thin, dense = (
        middle & (rng.random(middle.shape) < 0.5),
        middle | (rng.random(middle.shape) < 0.02),
    )
    given = {"opacity": Opacity("voxels"), "voxel_m": 0.25}
    if source == "pulses":
        given = {"bounds": (dense, thin), "opacity": PULSES, "voxel_m": 0.25, "slice_m": 0.25}
    path = tmp_path / "s.npz"
    path.write_bytes(stand_npz(VoxelStand.of(VoxelVolume(middle, **given))))
    request = PlanRequest(altitude=40, scene=str(path), samples=9, baseline=2, edges="wrapped")
    solved = plan(request)
    if source == "pulses":
        pair = (VoxelVolume(each, 0.25, slice_m=0.25) for each in (dense, thin))
        share = UNIFORM
    else:
        double = middle.reshape(20, 2, 32, 2, 32, 2).any(axis=(1, 3, 5))
        pair, share = (VoxelVolume(middle, 0.25), VoxelVolume(double, 0.5)), OCTAVE
    sites = [(x, y) for x in (-2.0, 0.0, 2.0) for y in (-2.0, 0.0, 2.0)]
    one, other = (MeasuredModel(each, 40.0).predict_positions(sites) for each in pair)
    wanted = share * abs(one.expected - other.expected)
    if source == "voxels":
        # The depth of random voxels is proportional to their area.
        p, shortfall = 1.0 - one.transparency**0.25, 2.0 * one.shortfall - other.shortfall
        fine = 1.0 - p * p - p * (1.0 - p) * max(shortfall, 0.0)
        wanted = max(wanted, share * abs(one.expected - fine))
    assert solved.uncertainty.expected > wanted
    assert solved.uncertainty.expected == pytest.approx(wanted, rel=0.05)


def test_half_the_voxel_size_is_extrapolated_from_two_sizes():
    """The extrapolation agrees with the result with smaller voxels of the same points."""
    rng = np.random.default_rng(4)
    centres = rng.uniform((0.0, 0.0, 6.0), (12.8, 12.8, 10.0), (14, 3))
    points = centres[rng.integers(0, 14, 12_000)] + rng.normal(0.0, 0.7, (12_000, 3))
    points[:, :2] %= 12.8
    points = points[(points[:, 2] > 2.0) & (points[:, 2] < 12.8)]
    found = []
    for size in (0.2, 0.4, 0.8):
        cells = round(12.8 / size)
        occupied = np.zeros((cells, cells, cells), dtype=bool)
        column, row, level = np.minimum((points / size).astype(int), cells - 1).T
        occupied[level, row, column] = True
        model = MeasuredModel(VoxelVolume(occupied, size), 50.0, targets_per_voxel=2)
        found.append(model.predict_positions([(x, y) for x in (-3, 0, 3) for y in (-3, 0, 3)]))
    fine, middle, coarse = found
    guess = finer(middle, coarse)
    assert coarse.density - fine.density > 0.2
    assert math.log(guess.transparency) == pytest.approx(math.log(fine.transparency), rel=0.15)
    assert guess.expected == pytest.approx(fine.expected, abs=0.04)
    part = of_voxel_size(middle, coarse)
    for name in ("density", "expected"):
        # One octave of the voxel size counts as two standard errors.
        assert abs(getattr(middle, name) - getattr(fine, name)) < 2.3 * getattr(part, name)
        assert abs(getattr(middle, name) - getattr(coarse, name)) < 2.3 * getattr(part, name)


def test_a_dense_stand_may_be_more_open_with_smaller_voxels():
    """If larger voxels hide everything, the error is half the difference to the extrapolated result
    with smaller voxels.
    """
    middle, coarse = Prediction(0.99, 0.01, 0.1), Prediction(1.0, 0.0, 0.1)
    # Without a measured exponent, the optical depth is proportional to the size.
    part = of_voxel_size(middle, coarse)
    assert part.density == pytest.approx(0.5 * (0.99 - 0.9))
    assert part.expected == pytest.approx(0.5 * (finer(middle, coarse).expected - middle.expected))
    assert finer(coarse, coarse) == coarse


PULSES = Opacity(
    "pulses", "", 0.1, 0.2, 0.3, "equal", (1.0, 20.0), 0.9, 1000, 2, 0.25, 0.06, 1.0, 1.5, 0.7, 0.2, 1
)  # fmt: skip
