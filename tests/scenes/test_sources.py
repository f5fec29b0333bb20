"""Several files of one stand, COPC, and the correlogram in a scene file."""

import json
import tomllib

import numpy as np
import pytest
import tomli_w
from support.clouds import stand, write_cloud

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.planning.loaded_scene import cloud_files, load_scene
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.files.point_cloud import read_voxels
from aosplan.scenes.files.toml_file import read_scene_file
from aosplan.scenes.files.voxel_file import VoxelStand, stand_npz
from aosplan.scenes.voxels import VoxelVolume

pytest.importorskip("lazrs")


def resolved(scene, *also, folder=""):
    return load_scene(
        PlanRequest(altitude=40, scene=str(scene)), folder=folder, also=map(str, also)
    )


def refusal(*arguments, **given):
    with pytest.raises(RequestError) as caught:
        resolved(*arguments, **given)
    return caught.value


# --- Several files ---


@pytest.fixture(scope="module")
def tiles(tmp_path_factory):
    """A folder with a stand in three tiles, and other files."""
    folder = tmp_path_factory.mktemp("stand") / "tiles"
    folder.mkdir()
    xyz, kind = stand()
    third = (xyz[0] // 7.0).astype(int)
    for i, suffix in enumerate(("laz", "LAS", "copc.laz")):
        write_cloud(folder / f"{i}.{suffix}", xyz[:, third == i], kind[third == i])
    (folder / "readme.txt").write_text("tiles of a stand")
    return folder


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return read_voxels(write_cloud(tmp_path_factory.mktemp("whole") / "whole.laz", *stand()))


def test_tiles_named_in_any_way_are_one_stand(tiles, whole, monkeypatch):
    monkeypatch.chdir(tiles.parent)
    files = sorted(str(path) for path in tiles.iterdir() if path.suffix != ".txt")
    for found in (
        resolved(tiles),
        resolved("tiles"),
        resolved("tiles/"),
        resolved("tiles/*"),
        resolved("tile?/[012].*"),
        resolved(*files),
        resolved(files[0], "tiles/[12]*"),
    ):
        assert np.array_equal(found.volume.occupied, whole.occupied)
        assert found.kind == "cloud"
    assert resolved("tiles/").scene.name == "tiles"


def test_the_saved_request_of_a_folder_of_tiles_gives_the_same_plan(tiles, monkeypatch):
    monkeypatch.chdir(tiles.parent)
    result = plan(PlanRequest(altitude=40, scene="tiles", vhat=0.3))
    assert result.model == "measured"
    assert plan(PlanRequest(**result.request.document())).document() == result.document()


def test_tiles_are_looked_for_beside_the_request(tiles, monkeypatch, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    folder = str(tiles.parent)
    assert resolved("tiles", folder=folder).volume is not None
    assert resolved("tiles/*.laz", folder=folder).volume is not None
    assert "unknown scene" in refusal("tiles").message
    assert "contains no" in refusal("tiles/*.laz").message


def test_the_scene_command_accepts_several_files(tiles, capsys):
    files = sorted(str(path) for path in tiles.iterdir() if path.suffix != ".txt")
    assert run(["scene", *files, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["points"] == 6000
    assert printed["source"] == f"{files[0]} and 2 more"
    assert printed["plot_m"] == [20.25, 12.25]


def test_a_preset_is_preferred_to_a_folder_of_the_same_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "savanna").mkdir()
    assert resolved("savanna").kind == "uniform"
    assert "contains no" in refusal("./savanna").message


def test_a_file_name_with_pattern_characters_is_read_as_a_file(tmp_path):
    path = write_cloud(tmp_path / "a[1].laz", *stand())
    assert cloud_files(str(path)) == (str(path),)
    assert resolved(path).volume is not None


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("tiles/none*.laz",), "'tiles/none*.laz' contains no"),
        (("tiles/*.txt",), "'tiles/*.txt' contains no"),
        (("tiles/0.laz", "tiles/0.laz"), "'tiles/0.laz' is given twice"),
        (("tiles/0.laz", "tiles"), "'tiles/0.laz' is given twice"),
        (("tiles/0.laz", "savanna"), "'savanna' is not a point cloud"),
        (("savanna", "tiles/0.laz"), "'savanna' is not a point cloud"),
        (("tiles/readme.txt", "tiles/0.laz"), "'tiles/readme.txt' is not a point cloud"),
        (("tiles/0.laz", "other.laz"), "other.laz does not exist"),
        (("tiles/0.laz", ""), "'' is not a point cloud"),
    ],
)
def test_options_that_cannot_be_combined_are_named(tiles, monkeypatch, names, said):
    monkeypatch.chdir(tiles.parent)
    assert said in refusal(*names).message


def test_files_of_two_places_are_refused_as_one_stand(tiles, tmp_path):
    far = write_cloud(tmp_path / "far.laz", stand()[0] + [[2e6], [0], [0]], stand()[1])
    assert "all files are from one place" in refusal(tiles, far).hint


# --- COPC ---


def write_copc(path, xyz, kind):
    """Write the points to five nodes of an octree."""
    copc = pytest.importorskip("copclib")
    unit, zero = copc.Vector3(0.001, 0.001, 0.001), copc.Vector3(0.0, 0.0, 0.0)
    writer = copc.FileWriter(str(path), copc.CopcConfigWriter(6, unit, zero))
    for i, key in enumerate([(0, 0, 0, 0), (1, 0, 0, 0), (1, 1, 0, 0), (1, 0, 1, 0), (1, 1, 1, 0)]):
        points = copc.Points(writer.copc_config.las_header)
        for (x, y, z), one in zip(xyz[:, i::5].T.tolist(), kind[i::5].tolist(), strict=True):
            point = points.CreatePoint()
            point.x, point.y, point.z, point.classification = x, y, z, one
            points.AddPoint(point)
        writer.AddNode(copc.VoxelKey(*key), points)
    writer.Close()
    return path


def test_a_copc_file_is_read_as_a_point_cloud(tmp_path, whole):
    path = write_copc(tmp_path / "stand.copc.laz", *stand())
    found = resolved(path)
    assert np.array_equal(found.volume.occupied, whole.occupied)
    assert found.volume.points == 6000


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_the_error_names_the_truncated_file(tmp_path, share):
    path = write_copc(tmp_path / "stand.copc.laz", *stand())
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    assert str(path) in refusal(path).message


# --- The correlogram in a scene file ---


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A stand as a cloud, and the files that are saved from it."""
    folder = tmp_path_factory.mktemp("saved")
    cloud = write_cloud(folder / "stand.laz", *stand(count=8000))
    paths = {"laz": cloud}
    for suffix in ("toml", "npz"):
        paths[suffix] = folder / f"stand.{suffix}"
        assert run(["scene", str(cloud), "--save", str(paths[suffix]), "--quiet"]) == 0
    return paths


def test_a_scene_saved_without_interior_correlograms_counts_all_targets(saved, tmp_path):
    whole = tmp_path / "whole.toml"
    cloud = ["scene", str(saved["laz"]), "--quiet"]
    assert run([*cloud, "--edges", "wrapped", "--save", str(whole)]) == 0
    assert resolved(whole).correlogram.interior == ()
    assert [table.density for table in resolved(saved["toml"]).correlogram.interior] == [
        table.density for table in resolved(saved["npz"]).correlogram.interior
    ]
    assert planned(whole, samples=9, baseline=1.0).edges == "wrapped"
    with pytest.raises(RequestError, match="saved with --edges wrapped"):
        planned(whole, samples=9, baseline=1.0, edges="interior")


def test_a_saved_scene_has_the_correlogram_of_its_cloud(saved):
    found, exact = resolved(saved["toml"]), correlogram(resolved(saved["laz"]).volume)
    assert found.scene.layers == resolved(saved["laz"]).scene.layers
    table = found.correlogram
    assert np.array_equal(table.lags, exact.lags)
    assert np.abs(table.rho - exact.rho).max() <= 0.5e-6
    assert np.abs(table.density_by_offset - exact.density_by_offset).max() <= 0.5e-6
    assert (table.density, table.reach) == (exact.density, exact.reach)


def planned(path, **given):
    return plan(PlanRequest(**({"altitude": 40, "scene": str(path), "heading": 20} | given)))


@pytest.mark.parametrize("edges", ["auto", "wrapped"])
@pytest.mark.parametrize("baseline", [0.6, 1.5, 2.5])
def test_a_plan_by_the_correlogram_is_named_and_near_the_exact_one(saved, baseline, edges):
    fixed = {"baseline": baseline, "samples": 25, "edges": edges}
    exact = planned(saved["laz"], **fixed)
    near = planned(saved["toml"], **fixed)
    assert near.solution.prediction != exact.solution.prediction
    assert near.solution.prediction.normalized == pytest.approx(
        exact.solution.prediction.normalized, abs=0.016
    )
    # The prediction is interpolated between tables of the interior, which have fewer targets.
    assert near.solution.prediction.expected == pytest.approx(
        exact.solution.prediction.expected, abs=0.005 if edges == "wrapped" else 0.01
    )
    document = near.document()
    assert document["visibility"]["edges"] == ("interior" if edges == "auto" else "wrapped")
    assert document["visibility"]["model"] == "measured"
    assert document["visibility"]["approximation"] == "correlogram"
    assert "correlogram_approximation" in [w["code"] for w in document["warnings"]]
    assert exact.document()["visibility"]["approximation"] is None
    assert "correlogram_approximation" not in [w.code for w in exact.warnings]


def test_a_saved_correlogram_selects_the_measured_model_by_default(saved):
    assert planned(saved["toml"], vhat=0.3).model == "measured"
    assert planned(saved["toml"], vhat=0.3).approximation == "correlogram"
    for model in ("layered", "uniform"):
        other = planned(saved["toml"], model=model)
        assert (other.model, other.approximation) == (model, None)


def test_the_saved_request_of_a_scene_file_gives_the_same_plan(saved):
    first = planned(saved["toml"], vhat=0.3)
    assert plan(PlanRequest(**first.request.document())).document() == first.document()


@pytest.mark.parametrize("given", [{"view": "perspective"}, {"focal_height": 1.0}])
def test_requests_beyond_a_saved_correlogram_are_refused(saved, given):
    with pytest.raises(RequestError, match="contains only a correlogram") as caught:
        planned(saved["toml"], **given)
    assert ".npz" in caught.value.hint


def test_a_scene_without_voxels_is_not_simulated_as_a_cloud(saved, capsys):
    wanted = [
        "--altitude",
        "40",
        "--scene",
        str(saved["toml"]),
        "--samples",
        "9",
        "--baseline",
        "1",
    ]
    assert run(["simulate", *wanted, "--quiet"]) == 2
    assert "no voxels that could be simulated" in capsys.readouterr().err


def test_statistics_printed_or_saved_again_are_the_same(saved, tmp_path, capsys):
    printed = {}
    for kind in ("laz", "toml", "npz"):
        assert run(["scene", str(saved[kind]), "--json", "--quiet"]) == 0
        printed[kind] = json.loads(capsys.readouterr().out)
    for name in ("layers", "integrated_density", "correlogram", "density_by_offset"):
        assert printed["toml"][name] == printed["laz"][name]
        assert printed["npz"][name] == printed["laz"][name]
    assert printed["toml"]["density_by_angle"] == printed["laz"]["density_by_angle"]
    (tmp_path / "printed.json").write_text(json.dumps(printed["laz"]))
    again = tmp_path / "again.toml"
    assert run(["scene", str(tmp_path / "printed.json"), "--save", str(again), "--quiet"]) == 0
    saved_again, first = (tomllib.loads(p.read_text()) for p in (again, saved["toml"]))
    assert saved_again == first


def test_a_saved_scene_computes_no_correlogram_or_layers_again(saved, monkeypatch):
    def never(*_, **__):
        raise AssertionError

    monkeypatch.setattr("aosplan.scenes.correlogram.correlogram", never)
    monkeypatch.setattr("aosplan.scenes.occluder_statistics.layered_scene", never)
    for kind in ("npz", "toml"):
        assert planned(saved[kind], vhat=0.3).model == "measured"
        assert run(["scene", str(saved[kind]), "--quiet"]) == 0


def test_the_density_by_angle_is_that_of_single_views(saved, capsys):
    from aosplan.scenes.hidden_counts import popcount
    from aosplan.scenes.occlusion import Occlusion

    assert run(["scene", str(saved["laz"]), "--json", "--quiet"]) == 0
    pairs = json.loads(capsys.readouterr().out)["density_by_angle"]
    volume = resolved(saved["laz"]).volume
    assert pairs[0] == [0.0, volume.column_occupancy]
    occlusion = Occlusion(volume, 1000.0)
    for angle, density in pairs[4::5]:
        turns = np.arange(16) * (np.pi / 8)
        offsets = 1000.0 * np.tan(np.radians(angle)) * np.stack([np.sin(turns), np.cos(turns)])
        hidden = popcount(occlusion.masks(offsets.T)) / occlusion.targets
        assert density == pytest.approx(hidden.mean(), abs=0.004)


LAYER = {"bottom_m": 2.0, "top_m": 2.5, "density": 0.02, "occluder_size_m": 0.25}
TABLE = {
    "lags": [0.1, 0.2],
    "directions_deg": [0.0, 90.0],
    "rho": [[0.5, 0.2], [0.4, 0.1]],
    "reach": 0.3,
}
SCENE = {
    "name": "stand",
    "integrated_density": 0.3,
    "density_by_offset": [[0.3, 0.35], [0.32, 0.4]],
    "layers": [LAYER],
    "correlogram": TABLE,
}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"lags": [0.2, 0.1]}, "lags are not positive and increasing"),
        ({"lags": [0.0, 0.1]}, "lags are not positive and increasing"),
        ({"lags": []}, "lags are not positive and increasing"),
        ({"directions_deg": [0.0, 80.0]}, "half circle"),
        ({"directions_deg": []}, "half circle"),
        ({"rho": [[0.5, 0.2]]}, "rho is of shape (1, 2), not (2, 2)"),
        ({"rho": [[0.5], [0.2, 0.1]]}, "rho is not a table"),
        ({"rho": [[0.5, 1.2], [0.4, 0.1]]}, "rho is not between"),
        ({"reach": 0.0}, "reach 0 is not above 0"),
        ({"reech": 0.1}, "unknown name 'correlogram.reech'"),
    ],
)
def test_an_invalid_correlogram_is_named_in_the_error(tmp_path, change, said):
    path = tmp_path / "stand.toml"
    path.write_text(tomli_w.dumps(SCENE))
    assert read_scene_file(str(path)).correlogram() is not None
    path.write_text(tomli_w.dumps(SCENE | {"correlogram": TABLE | change}))
    with pytest.raises(RequestError) as caught:
        read_scene_file(str(path)).correlogram()
    assert said in caught.value.message
    assert str(path) in caught.value.message


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"density_by_offset": [[0.3, 1.35], [0.32, 0.4]]}, "a density is not between"),
        ({"density_by_offset": [[0.3], [0.32]]}, "density_by_offset is of shape"),
        ({"density_by_offset": None}, "density_by_offset is missing"),
        ({"integrated_density": None}, "density is missing"),
    ],
)
def test_a_correlogram_without_its_densities_is_named(tmp_path, change, said):
    path = tmp_path / "stand.toml"
    table = {name: value for name, value in (SCENE | change).items() if value is not None}
    path.write_text(tomli_w.dumps(table))
    with pytest.raises(RequestError) as caught:
        read_scene_file(str(path)).correlogram()
    assert said in caught.value.message


# --- Warnings of measured plans ---


def codes(result):
    return [warning.code for warning in result.warnings]


@pytest.mark.parametrize("kind", ["npz", "toml"])
def test_a_plot_too_small_for_the_aperture_gives_a_warning(saved, kind):
    # The rays of an aperture may be up to half of the plot's 12.25 m apart at the top of the
    # canopy. The aperture is therefore at most 6.1 m h / 9 m.
    top = resolved(saved["npz"]).scene.canopy_top_m
    widest = 0.5 * 12.25 * 40.0 / top
    within = planned(saved[kind], samples=9, baseline=0.49 * widest)
    beyond = planned(saved[kind], samples=9, baseline=0.52 * widest)
    if kind == "npz":  # A correlogram ends at its last lag, which may be smaller than the reach.
        assert "small_plot" not in codes(within)
    assert "small_plot" in codes(beyond)
    assert "too small for a grid of" in {w.code: w.message for w in beyond.warnings}["small_plot"]


def test_views_that_see_almost_nothing_give_a_warning(tmp_path):
    occupied = np.random.default_rng(3).random((40, 40, 40)) < 0.09
    occupied[:8] = False
    path = tmp_path / "dense.npz"
    path.write_bytes(stand_npz(VoxelStand.of(VoxelVolume(occupied, 0.25))))
    assert resolved(path).scene.integrated_density < 0.96
    assert "saturated" not in codes(planned(path, samples=4, baseline=0.5))
    wide = planned(path, samples=25, baseline=5.0)
    assert wide.solution.prediction.density > 0.98
    assert "saturated" in codes(wide)
