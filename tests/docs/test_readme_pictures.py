"""The pictures of the README are small enough. In their photos, the hidden share of the ground
equals the share of blocked rays.
"""

import runpy
import shutil
import sys
from importlib import import_module

import numpy as np
import pytest
from support.paths import ROOT

from aosplan.simulation.forests import clumped_forest, generator
from aosplan.simulation.voxel_views import VoxelViews

FOLDER = ROOT / "examples" / "readme"


@pytest.fixture
def beneath(monkeypatch):
    """The script that draws the photos, with pixels that are as large as the voxels."""
    monkeypatch.syspath_prepend(str(FOLDER))
    import beneath

    monkeypatch.setattr(beneath, "PIXEL_M", 0.25)
    yield beneath
    del sys.modules["beneath"]


@pytest.mark.parametrize("name", ["beneath.png", "agreement.png"])
def test_pictures_are_small(name):
    assert 20_000 < (FOLDER / name).stat().st_size < 300_000


@pytest.mark.slow
def test_pictures_are_drawn_by_one_command(tmp_path, monkeypatch, capsys):
    shutil.copytree(FOLDER.parent, tmp_path / "examples")
    scripts = tmp_path / "examples" / "readme"
    monkeypatch.syspath_prepend(scripts)
    for name in ("beneath", "agreement"):
        (scripts / f"{name}.png").unlink()
        monkeypatch.delitem(sys.modules, name, raising=False)
    # Fewer points, and larger pixels than in the README.
    agreement, beneath = import_module("agreement"), import_module("beneath")
    monkeypatch.setattr(agreement, "SAMPLES", (9, 25))
    monkeypatch.setattr(agreement, "BASELINES_M", (0.8, 2.2))
    monkeypatch.setattr(agreement, "STANDS", 4)
    monkeypatch.setattr(beneath, "PIXEL_M", 0.08)
    runpy.run_path(str(scripts / "run.py"), run_name="__main__")
    for name in ("beneath", "agreement"):
        assert (scripts / f"{name}.png").stat().st_size > 5_000
        del sys.modules[name]
    assert capsys.readouterr().out.count("within 2 standard errors") == 3


@pytest.mark.parametrize("site", [(0.0, 0.0), (5.0, -3.0), (-8.0, 8.0)])
def test_a_photo_shows_the_ground_where_rays_reach_it(beneath, site):
    forest = clumped_forest(generator(1), 0.6, 0.25, 2.0, 12.0, (16.0, 14.0))
    _, rows, columns = forest.occupied.shape
    ground = np.full((rows, columns, 3), 2.0)  # brighter than any leaf
    camera = beneath.Camera(forest, (rows, columns))
    seen = camera.photo(site, ground)[..., 0] > 1.0
    views = VoxelViews(forest, beneath.ALTITUDE_M, targets_per_voxel=1)
    counted = views.blocked_views([site]) == 0
    assert 0.2 < counted.mean() < 0.6
    # In each slice, a drawn ray meets only the first and the last of the voxels on its path.
    assert (seen == counted).mean() > 0.97
    assert seen.mean() == pytest.approx(counted.mean(), abs=0.02)
    assert camera.hidden == [pytest.approx(1.0 - seen.mean())]


def test_the_ground_is_visible_if_no_voxel_is_above_it(beneath):
    forest = clumped_forest(generator(1), 0.0, 0.25, 2.0, 12.0, (16.0, 14.0))
    camera = beneath.Camera(forest, (20, 30))
    ground = np.random.default_rng(1).random((20, 30, 3))
    assert np.array_equal(camera.photo((3.0, 1.0), ground), camera.sunlit(ground))
