"""A worker of a cluster writes only its part, completely or not at all, and only if the input files
are unchanged.
"""

import os
import pickle

import pytest
from support.campaigns import sweep
from support.clusters import CAMPAIGN, assert_error

from aosplan.errors import SurroundingsError
from aosplan.sweeps import scenarios as scenarios_module
from aosplan.sweeps.parts import Parts
from aosplan.sweeps.scenarios import read_scenarios
from aosplan.sweeps.sweep import Sweep

pl = pytest.importorskip("polars")
pytest.importorskip("distributed")

from aosplan.sweeps import cluster as cluster_module  # noqa: E402


@pytest.fixture
def task(tmp_path, monkeypatch):
    """The path of a task's part, its folder, and the task."""
    monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", 40)
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(CAMPAIGN, encoding="utf-8")
    scenarios = read_scenarios(str(campaign))
    sweep = Sweep(scenarios, ("samples",))
    folder = tmp_path / "writing"
    folder.mkdir()
    path = Parts(str(tmp_path / "r.parquet"), sweep).path(3).replace("r.parquet.parts", "")
    told = cluster_module.PartTask(
        sweep._replace(scenarios=cluster_module.single_block(scenarios, 3)),
        3,
        path,
        str(folder),
        (),
    )
    return path, folder, told


def done(told):
    return cluster_module.write_part(cluster_module.own_versions(), pickle.dumps(told))


def test_a_task_that_runs_twice_writes_the_same(task):
    path, folder, told = task
    first = done(told)
    with open(path, "rb") as file:
        content = file.read()
    assert done(told) == first
    assert (first.part, first.rows, first.bytes) == (3, 40, len(content))
    with open(path, "rb") as file:
        assert file.read() == content
    assert os.listdir(folder) == []


def test_a_task_of_a_run_that_has_ended_writes_nothing(task):
    path, folder, told = task
    folder.rmdir()
    with pytest.raises(SurroundingsError, match="does not see the folder"):
        done(told)
    assert not os.path.exists(path)


def test_a_task_of_another_version_writes_nothing(task):
    path, _, told = task
    versions = cluster_module.own_versions() | {"polars": "0.1"}
    with pytest.raises(SurroundingsError, match=r"has polars .*, this machine 0\.1"):
        cluster_module.write_part(versions, pickle.dumps(told))
    assert not os.path.exists(path)


def test_a_task_of_files_that_differ_writes_nothing(task, tmp_path):
    path, _, told = task
    (tmp_path / "stand.csv").write_text("x")
    with pytest.raises(SurroundingsError, match=r"does not have the file '.*stand.csv'"):
        done(told._replace(files=((str(tmp_path / "stand.csv"), 2),)))
    assert not os.path.exists(path)


def test_a_worker_reads_files_again_for_a_new_run(tmp_path):
    scene, path, out = tmp_path / "stand.toml", tmp_path / "s.toml", tmp_path / "r.parquet"
    path.write_text(
        '[sweep]\naltitude = 40\nvhat = 0.8\nmodel = ["uniform", "layered"]\nscene = "stand.toml"\n'
    )
    found = []
    for run, density in enumerate((0.4, 0.6)):
        scene.write_text(
            f'name = "stand"\nintegrated_density = {density}\noccluder_size_m = 1.0\n'
            "volume_base_m = 2.0\nvolume_height_m = 10.0\n"
        )
        scenarios = read_scenarios(str(path))
        (tmp_path / str(run)).mkdir()
        told = cluster_module.PartTask(
            Sweep(
                cluster_module.single_block(scenarios, 0), ("visibility_density",), str(tmp_path)
            ),
            *(0, str(out), str(tmp_path / str(run)), ((str(scene), scene.stat().st_size),)),
        )
        done(told)
        found.append(pl.read_parquet(out)["visibility_density"].to_list())
    assert found == [pytest.approx([0.4] * 2), pytest.approx([0.6] * 2)]


def test_files_of_scenarios_are_named_in_full(tmp_path, monkeypatch, capsys):
    beside = tmp_path / "beside"
    beside.mkdir()
    for place in (tmp_path / "here.toml", beside / "there.toml"):
        place.write_text("x")
    path = beside / "s.toml"
    for name in ("paper-forest", "bare", "tiles", "trimmed"):
        (beside / name).mkdir()
    (beside / "tiles" / "1.laz").write_text("xy")
    path.write_text(
        "[sweep]\naltitude = 40\ngrid = 'trimmed'\nterrain = 'there.toml'\n"
        "scene = ['tiles', 'no.laz', 'paper-forest', 'no.toml', 'bare', '*.las']\n"
    )
    found = Sweep(read_scenarios(str(path)), (), str(beside))
    assert cluster_module.files_of(found) == (
        (str(beside / "there.toml"), 1),
        (str(beside / "tiles" / "1.laz"), 2),
    )
    monkeypatch.chdir(tmp_path)
    path.write_text("[sweep]\naltitude = 40\nscene = ['here.toml']\n")
    assert sweep(path, "--out", tmp_path / "r.csv", "--scheduler", "head:8786") == 2
    assert_error(capsys, "here.toml", "current folder", "full path")
