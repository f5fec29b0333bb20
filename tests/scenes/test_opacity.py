"""Opacity from pulses, compared with rays through known leaves and with pulses that were not used
for the fit.
"""

import json

import numpy as np
import pytest
from support.clouds import laspy, write_cloud
from support.leaf_clouds import write_scan
from support.paths import SHARED

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.models.measured import MeasuredModel
from aosplan.scenes.files.ground import surface, vertices
from aosplan.scenes.files.las import PointFile
from aosplan.scenes.files.point_cloud import read_voxels
from aosplan.scenes.pulses import fit
from aosplan.scenes.pulses.trace import VoxelGrid
from aosplan.scenes.voxels import cells_along
from aosplan.simulation.leaf_stands import LeafStand, crowned_stand, hidden_share, laser_scan

UAS = SHARED / "data" / "UAS_Clip.laz"
GRID = (np.arange(3) - 1) * 2.0
NINE = np.stack(np.meshgrid(GRID, GRID), axis=-1).reshape(-1, 2)
SEVEN = (np.arange(7) - 3) * 2.0
FORTY_NINE = np.stack(np.meshgrid(SEVEN, SEVEN), axis=-1).reshape(-1, 2)


@pytest.fixture(scope="module")
def leaves():
    """A stand, p̄ and V of nine views from 50 m (computed by tracing rays), and a scan of the
    stand.
    """
    rng = np.random.default_rng(20)
    stand = crowned_stand(rng, 8.0, leaf_area_index=1.5, crowns=5)
    hidden = hidden_share(stand, 50.0, NINE, 0.08)
    scan = laser_scan(rng, stand, pulses_a_m2=250.0)
    return stand, (float(hidden.mean()), float(1.0 - (hidden**2).mean())), scan


def test_rays_meet_the_leaf_that_a_search_of_all_leaves_finds():
    rng = np.random.default_rng(4)
    stand = crowned_stand(rng, 5.0, leaf_area_index=1.0, crowns=3)
    ground, slope = rng.uniform(0, 5, (2, 60)), rng.uniform(-0.6, 0.6, (2, 60))
    found = stand.first_hits(ground, slope)
    for k in range(60):
        best = 0.0
        lean = np.append(slope[:, k], 1.0)
        for shift in np.stack(np.meshgrid([-2, -1, 0, 1, 2], [-2, -1, 0, 1, 2])).reshape(2, -1).T:
            centre = stand.centre_m + np.append(5.0 * shift, 0.0)[:, np.newaxis]
            foot = np.append(ground[:, k], 0.0)
            rise = (stand.normal * (centre - foot[:, np.newaxis])).sum(axis=0) / (
                lean @ stand.normal
            )
            apart = foot[:, np.newaxis] + lean[:, np.newaxis] * rise - centre
            met = (apart**2).sum(axis=0) <= stand.radius_m**2
            best = max(best, float(rise[met].max(initial=0.0)))
        assert found[k] == pytest.approx(best, abs=1e-9)


@pytest.fixture(scope="module")
def sparse():
    """p̄ and V of nine views of a wider stand, and a scan with 5 pulses per square metre."""
    rng = np.random.default_rng(21)
    stand = crowned_stand(rng, 12.0, leaf_area_index=3.0, crowns=12)
    hidden = hidden_share(stand, 50.0, NINE, 0.25)
    scan = laser_scan(rng, stand, pulses_a_m2=5.0, footprint_m=0.3)
    return (float(hidden.mean()), float(1.0 - (hidden**2).mean())), scan


@pytest.mark.parametrize(
    ("kept", "error", "warned"),
    [
        ("all", 0.05, ["sparse_cloud"]),
        pytest.param("untimed", 0.05, ["sparse_cloud"], marks=pytest.mark.slow),
        pytest.param(
            "few lines",
            0.12,
            ["sparse_cloud", "pulses_assumed_vertical"],
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "first",
            0.12,
            ["sparse_cloud", "only_first_returns", "pulses_assumed_vertical"],
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_sparse_scan_of_known_leaves_is_predicted(tmp_path, sparse, kept, error, warned):
    (density, expected), scan = sparse
    if kept == "first":
        scan = returns_of(scan, scan.number == 1)
    elif kept == "untimed":
        scan = scan._replace(time_s=0.0 * scan.time_s)
    elif kept == "few lines":  # Each line has too few pulses with several returns.
        scan = scan._replace(line=(scan.time_s * 40.0).astype(np.intp))
    path = write_scan(tmp_path / "sparse.las", scan)
    volume = read_voxels(path, opacity="auto", min_height_m=0.5)
    found = MeasuredModel(volume, 50.0).predict_positions(NINE)
    assert [code for code, _ in volume.warnings if code != "units_assumed"] == warned
    assert found.density == pytest.approx(density, abs=error)
    assert found.expected == pytest.approx(expected, abs=error)
    # Most of the canopy is missing if only voxels with a point are opaque.
    voxels = read_voxels(path, opacity="voxels", min_height_m=0.5)
    binary = MeasuredModel(voxels, 50.0).predict_positions(NINE)
    assert binary.density < density - 0.08
    assert voxels.warnings[-1][0] == "sparse_cloud"


def returns_of(scan, which):
    """Some of the returns of a scan."""
    return type(scan)(*(each[..., which] for each in scan))


def test_one_leaf_hides_the_area_of_its_shadow():
    leaf = LeafStand(2.0, np.array([[1.0], [1.0], [3.0]]), np.array([[0.0], [0.0], [1.0]]), 0.3)
    hidden = hidden_share(leaf, 10.0, np.zeros((1, 2)), 0.01)
    assert hidden.mean() == pytest.approx(np.pi * 0.09 / 4.0, rel=0.01)


@pytest.mark.parametrize("voxel_m", [0.15, pytest.param(0.25, marks=pytest.mark.slow)])
def test_known_leaves_are_predicted_from_their_pulses(tmp_path, leaves, voxel_m):
    _, (density, expected), scan = leaves
    path = write_scan(tmp_path / "leaves.las", scan)
    volume = read_voxels(path, opacity="pulses", min_height_m=0.5, voxel_m=voxel_m)
    assert volume.opacity.energy == "intensity"
    found = MeasuredModel(volume, 50.0).predict_positions(NINE)
    assert found.density == pytest.approx(density, abs=0.01)
    assert found.expected == pytest.approx(expected, abs=0.01)
    # Opaque voxels that contain a point give a very different density.
    binary = MeasuredModel(read_voxels(path, min_height_m=0.5, voxel_m=voxel_m), 50.0)
    assert abs(binary.predict_positions(NINE).density - density) > 0.1


def test_true_visibility_is_within_the_bounds_and_near_equal_energies(tmp_path, leaves):
    _, (density, expected), scan = leaves
    path = write_scan(tmp_path / "leaves.las", scan, calibrated=False)
    volume = read_voxels(path, opacity="auto", min_height_m=0.5)
    opacity = volume.opacity
    assert (opacity.source, opacity.energy, opacity.lines) == ("pulses", "equal", 3)
    assert opacity.gap_first < opacity.gap_weighted < opacity.gap_last
    found = MeasuredModel(volume, 50.0).predict_positions(NINE)
    assert found.density == pytest.approx(density, abs=0.05)
    dense, thin = (
        MeasuredModel(read, 50.0).predict_positions(NINE)
        for read in (_bound(volume, 0), _bound(volume, 1))
    )
    assert thin.density < density < dense.density
    assert dense.expected < expected < thin.expected


def _bound(volume, which):
    from dataclasses import replace

    return replace(volume, occupied=volume.bounds[which], bounds=None)


def test_a_known_trajectory_gives_the_same_opacity_as_the_pulses(tmp_path, leaves):
    stand, _, scan = leaves
    path = write_scan(tmp_path / "leaves.las", scan)
    rows = [
        f"{1000.0 * line + y / 8.0},{0.5 * stand.size_m + offset},{y},80"
        for line, offset in enumerate((-28.0, 0.0, 28.0))
        for y in (0.0, stand.size_m)
    ]
    track = tmp_path / "track.csv"
    track.write_text("\n".join(["gps_time,x,y,z", *rows]), encoding="utf-8")
    found = read_voxels(path, opacity="pulses", min_height_m=0.5)
    known = read_voxels(path, opacity="pulses", min_height_m=0.5, trajectory=str(track))
    assert known.column_occupancy == pytest.approx(found.column_occupancy, abs=0.01)
    assert known.opacity.zenith_deg == pytest.approx(found.opacity.zenith_deg, abs=0.3)


def test_clouds_without_usable_pulses_are_read_as_voxels_with_a_reason(tmp_path, leaves):
    rng = np.random.default_rng(1)
    xyz = np.stack([*rng.uniform(0, 8, (2, 4000)), np.repeat([0.0, 5.0], 2000)])
    path = write_cloud(tmp_path / "single.las", xyz, np.repeat([2, 5], 2000))
    auto, voxels = read_voxels(path, opacity="auto"), read_voxels(path)
    assert (auto.occupied == voxels.occupied).all()
    assert auto.opacity.source == "voxels"
    said = dict(auto.warnings)
    assert "every point is the only return" in said["opacity_from_voxels"]
    assert "opacity_from_voxels" not in dict(voxels.warnings)
    with pytest.raises(RequestError, match="only return"):
        read_voxels(path, opacity="pulses")
    # If the ground was removed from a cloud, no flight line has low returns.
    _, _, scan = leaves
    clipped = scan._replace(on_ground=np.zeros_like(scan.on_ground))
    clipped = type(scan)(*(each[..., scan.xyz_m[2] > 3.0] for each in clipped))
    path = write_scan(tmp_path / "clip.las", clipped)
    said = dict(read_voxels(path, opacity="auto", ground="normalized").warnings)
    assert "no flight line" in said["opacity_from_voxels"]


def test_the_scene_command_prints_results_of_the_pulses(tmp_path, leaves, capsys, monkeypatch):
    monkeypatch.setenv("AOSPLAN_CACHE", str(tmp_path / "cache"))
    path = str(write_scan(tmp_path / "leaves.las", leaves[2]))
    for _ in range(2):  # The first time it is read from the file, the second time from the cache.
        assert run(["scene", path, "--min-height", "0.5", "--json", "--quiet"]) == 0
        opacity = json.loads(capsys.readouterr().out)["opacity"]
        assert opacity["source"] == "pulses"
        assert opacity["gap_first"] < opacity["gap_weighted"] < opacity["gap_last"]
    assert run(["scene", path, "--min-height", "0.5"]) == 0
    shown = capsys.readouterr().out
    assert "of 3 flight lines" in shown
    assert f"{100 * opacity['gap_weighted']:.1f} % of the pulses' energy" in shown
    for option in ("--leaf-size=0.1", "--trajectory=a.csv"):
        assert run(["scene", path, "--opacity", "voxels", option]) == 2
        assert option.split("=", maxsplit=1)[0] in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(not UAS.exists(), reason="needs the cloud")
def test_half_of_the_real_pulses_predict_the_other_half():
    """The held-out pulses are used neither for the fit nor for its scale."""
    beams, grid = _real_beams()
    half = np.random.default_rng(7).random(len(beams.pulses)) < 0.5
    field = fit.fitted_field(beams.take(half), grid)
    other = beams.take(~half)
    other = other.take(fit.through_canopy(other, grid))
    depths = fit.optical_depths([field.rate], other, grid)[0]
    predicted = np.exp(-field.scales["weighted"] * depths)
    reported = other.gaps()["weighted"]
    assert predicted.mean() == pytest.approx(reported.mean(), abs=0.005)
    bins = np.digitize(other.zenith_deg, np.arange(5, 60, 5))
    for number in np.unique(bins):
        of = bins == number
        if np.count_nonzero(of) > 1000:
            assert predicted[of].mean() == pytest.approx(reported[of].mean(), abs=0.01)


def _real_beams():
    cloud = laspy.read(UAS)
    origin_m = np.asarray(cloud.header.mins)
    size = np.asarray(cloud.header.maxs) - origin_m
    ground = (
        np.asarray(cloud.xyz)[np.asarray(cloud.classification) == 2].T - origin_m[:, np.newaxis]
    )
    columns, rows = (cells_along(length, 0.25) for length in size[:2])
    ground_m = surface(vertices([ground], ground.shape[1], size), rows, columns, 0.25)
    grid = VoxelGrid(ground_m, 0.25, 1, 0.5, (float(size[0]), float(size[1])))
    return fit.sound_beams([PointFile(str(UAS))], grid, origin_m)


@pytest.mark.slow
@pytest.mark.skipif(not UAS.exists(), reason="needs the cloud")
def test_density_and_visibility_of_the_real_cloud_hardly_depend_on_voxel_size():
    """p̄ and V hardly depend on the size of voxels.

    Two prototypes without the factors and the contrast of columns gave p = 0.62 to 0.63 at nadir,
    p̄ = 0.65, V = 0.52 and V̂ = 0.76.  With the factors and the contrast, the likelihood of
    held-out pulses is higher.
    """
    found = []
    for voxel_m in (0.15, 0.5):
        volume = read_voxels(UAS, opacity="auto", min_height_m=0.5, voxel_m=voxel_m)
        assert volume.opacity.source == "pulses"
        model = MeasuredModel(volume, 50.0)
        shown = model.predict_positions(FORTY_NINE)
        found.append((model.density, shown.density, shown.expected, shown.normalized))
    nadir, density, expected, normalized = np.array(found).T
    assert nadir == pytest.approx(0.598, abs=0.01)
    assert density == pytest.approx(0.628, abs=0.01)
    assert expected == pytest.approx(0.549, abs=0.01)
    assert normalized == pytest.approx(0.758, abs=0.015)
    assert np.ptp(density) < 0.01
    assert np.ptp(expected) < 0.05 * expected.mean()
