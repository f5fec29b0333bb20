"""The nearest points are the same from a comparison of all pairs and from a tree."""

import json
import subprocess
import sys

import numpy as np
import pytest
from scipy.spatial import cKDTree

from aosplan.areas import nearest
from aosplan.areas.nearest import Nearest


def lattice():
    east, north = np.meshgrid(np.arange(20) * 2.5, np.arange(15) * 2.5)
    return np.column_stack([east.ravel(), north.ravel()])


@pytest.mark.parametrize("points", [np.random.default_rng(0).normal(0.0, 9.0, (500, 2)), lattice()])
@pytest.mark.parametrize("most", [0, 10_000])
def test_nearest_points_by_direct_comparison_equal_those_of_a_tree(points, most, monkeypatch):
    monkeypatch.setattr(nearest, "MOST_COMPARED", most)
    places = points[:40] + 0.1
    found = Nearest(points).to(places, 9)
    assert found.shape == (40, 9)
    away = np.hypot(*np.moveaxis(points[found] - places[:, None], 2, 0))
    assert away == pytest.approx(cKDTree(points).query(places, 9)[0])
    assert all(len(set(row)) == 9 for row in found.tolist())


def test_a_plan_over_a_small_area_does_not_load_scipy(tmp_path):
    ring = [[14.0, 48.0], [14.0006, 48.0], [14.0006, 48.0004], [14.0, 48.0004], [14.0, 48.0]]
    area = tmp_path / "area.geojson"
    area.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}), encoding="utf-8")
    code = (
        "import sys\nfrom aosplan.cli.app import run\n"
        f"assert run(['plan', '--altitude', '40', '--area', {str(area)!r}, "
        "'--json']) == 0\n"
        "print(sum(name.split('.')[0] == 'scipy' for name in sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == "0"
