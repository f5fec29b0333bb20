"""Tests of the ground surface: triangles, thinning, the kind of heights, and the filter."""

import os
import sys
from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aosplan.errors import MissingExtraError
from aosplan.scenes.files import ground
from aosplan.scenes.files.ground import filtered, is_level_zero, lowest, surface, vertices


def plane(x, y):
    return 3.0 + 0.2 * x - 0.1 * y


def cloud_on(shape, size, count, seed=0):
    x, y = np.random.default_rng(seed).uniform(0.0, 1.0, (2, count)) * np.reshape(size, (2, 1))
    corners = np.array([[0, 0], [0, size[1]], [size[0], 0], size], dtype=float).T
    x, y = np.hstack([corners, [x, y]])
    return np.stack([x, y, shape(x, y)])


def corners(rows, columns, spacing):
    y, x = np.mgrid[0 : rows + 1, 0 : columns + 1] * spacing
    return x, y


def test_a_plane_is_met_exactly_within_the_hull():
    z = surface(cloud_on(plane, (12.0, 8.0), 200), 16, 24, 0.5)
    assert z.shape == (17, 25)
    assert z == pytest.approx(plane(*corners(16, 24, 0.5)), abs=1e-5)


def test_between_vertices_the_ground_is_the_triangle_through_them():
    points = np.array([[0, 4, 0], [0, 0, 4], [0, 4, 8]], dtype=float)
    assert surface(points, 2, 2, 1.0)[:2, :2] == pytest.approx(np.array([[0, 1], [2, 3]]), abs=1e-6)


def test_outside_the_hull_the_nearest_vertex_counts():
    points = np.array([[0, 1, 0, 1], [0, 0, 1, 1], [5, 6, 7, 8]], dtype=float)
    z = surface(points, 9, 9, 1.0)
    assert z[9, 9] == 8.0
    assert z[0, 9] == 6.0
    assert z[9, 0] == 7.0


@pytest.mark.parametrize(
    "points",
    [[[2, 2, 7]], [[0, 0, 7], [4, 4, 7]], [[0, 0, 7], [1, 1, 7], [3, 3, 7]], [[1, 1, 7]] * 5],
)
def test_vertices_without_a_triangle_are_used_as_nearest_points(points):
    assert (surface(np.array(points, dtype=float).T, 3, 3, 1.0) == 7.0).all()


@pytest.mark.parametrize("nodes", [6, 40, 300])
@pytest.mark.parametrize("shape", [(16, 24), (1, 30), (17, 1), (1, 1)])
def test_fewer_nodes_interpolate_between_them(monkeypatch, nodes, shape):
    rows, columns = shape
    points = cloud_on(plane, (60.0, 60.0), 300) - np.array([[20.0], [20.0], [0.0]])
    monkeypatch.setattr(ground, "MAX_NODES", 10**6)
    exact = surface(points, rows, columns, 0.5)
    monkeypatch.setattr(ground, "MAX_NODES", nodes)
    assert surface(points, rows, columns, 0.5) == pytest.approx(exact, abs=1e-4)


def test_few_points_are_all_vertices_in_their_order():
    points = cloud_on(plane, (5.0, 5.0), 50)
    assert (vertices(np.array_split(points, 3, axis=1), 54, np.array([5.0, 5.0])) == points).all()


@pytest.mark.parametrize("size", [(80.0, 50.0), (4000.0, 1.0), (1.0, 4000.0)])
def test_many_points_are_merged_to_means_that_lie_on_the_same_plane(monkeypatch, size):
    monkeypatch.setattr(ground, "MAX_VERTICES", 400)
    points = cloud_on(plane, size, 5000)
    merged = vertices(np.array_split(points, 7, axis=1), 5004, np.array(size))
    assert 100 < merged.shape[1] < 900
    assert merged[2] == pytest.approx(plane(*merged[:2]))
    assert max(np.ptp(merged, axis=1)) > 0.9 * max(size)


@given(st.integers(0, 2**32 - 1), st.integers(1, 9))
def test_lowest_keeps_the_lowest_point_of_each_cell_with_its_place(seed, pieces):
    rng = np.random.default_rng(seed)
    points = np.round(rng.uniform(0.0, 3.0, (3, 60)), 1)
    low = lowest(np.array_split(points, pieces, axis=1), np.array([3.0, 3.0]), 1.0)
    of_cell = {}
    for x, y, z in points.T:
        of_cell.setdefault((int(x), int(y)), []).append((z, x, y))
    assert len(low.T) == len(of_cell)
    for x, y, z in low.T:
        members = of_cell[int(x), int(y)]
        assert z == min(members)[0]
        assert (z, x, y) in members


def test_heights_and_elevations_are_distinguished():
    rng = np.random.default_rng(3)
    size = np.array([40.0, 40.0])
    low = np.stack([*rng.uniform(0.0, 40.0, (2, 3000)), rng.uniform(-0.1, 0.1, 3000)])
    assert is_level_zero(low, size, 0.0)
    assert not is_level_zero(low, size, -2.0)
    sloping = low + np.stack([0 * low[0], 0 * low[0], 0.2 * low[0]])
    assert not is_level_zero(sloping, size, 0.0)


def test_a_few_cells_without_ground_do_not_change_the_detection_of_heights():
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(40) + 0.5, np.arange(40) + 0.5))
    low = np.stack([x, y, np.where((x < 5.0) & (y < 20.0), 12.0, 0.0)])
    assert is_level_zero(low, np.array([40.0, 40.0]), 0.0)
    low[2, x < 15.0] = 12.0
    assert not is_level_zero(low, np.array([40.0, 40.0]), 0.0)


@pytest.mark.slow
def test_triangles_agree_with_interpolation_point_by_point():
    interpolate = pytest.importorskip("scipy.interpolate")
    for seed in range(40):
        rng = np.random.default_rng(seed)
        rows, columns = rng.integers(1, 30, 2)
        points = rng.uniform(-1.0, 1.0, (3, 40)) * [[20.0], [20.0], [5.0]]
        if seed % 2:  # The vertices are at nodes, and many of them are on a line.
            points = np.unique(np.round(points), axis=1)
            points = points[:, np.unique(points[:2], axis=1, return_index=True)[1]]
        y, x = np.mgrid[0 : rows + 1, 0 : columns + 1]
        expected = interpolate.LinearNDInterpolator(points[:2].T, points[2])(x, y)
        nearest = interpolate.NearestNDInterpolator(points[:2].T, points[2])(x, y)
        outside = np.isnan(expected)
        found = surface(points, rows, columns, 1.0)
        np.testing.assert_allclose(found[~outside], expected[~outside], rtol=0.0, atol=1e-5)
        # A node may have two nearest vertices at the same distance.
        assert (np.abs(found - nearest)[outside] > 1e-5).sum() <= 0.1 * outside.sum()


def test_a_plane_has_its_slope_and_a_line_has_none():
    points = cloud_on(plane, (30.0, 20.0), 50)
    assert ground.slope(points) == pytest.approx((0.2, -0.1))
    along = np.array([[0.0, 1.0, 2.0], [0.0, 2.0, 4.0], [0.0, 9.0, 18.0]])
    assert ground.slope(along) == (0.0, 0.0)
    assert ground.slope(along[:, :1]) == (0.0, 0.0)


@pytest.fixture
def grove():
    """Lowest points of a slope of 30 % with a canopy over about half of them."""
    if find_spec("CSF") is None:  # Only the tested code should import this module.
        pytest.skip("needs the extra lidar")
    size = np.array([30.0, 20.0])
    low = cloud_on(lambda x, y: 0.3 * x + 0.05 * y, size, 6000, seed=4)
    covered = np.random.default_rng(5).random(low.shape[1]) < 0.5
    low[2, covered] += 9.0
    return lowest([low], size), size


def test_the_filter_finds_a_slope_below_a_canopy(grove):
    low, size = grove
    found = filtered(low, size)
    assert found.shape[1] > 0.6 * low.shape[1]
    assert found[2] == pytest.approx(0.3 * found[0] + 0.05 * found[1], abs=0.1)


def test_the_filter_copes_with_a_plot_that_is_mostly_empty(grove):
    low, _ = grove
    size = np.array([300.0, 20.0])
    far = low + np.array([[270.0], [0.0], [0.0]])
    found = filtered(np.hstack([low, far]), size)
    assert {True, False} == set((found[0] > 150.0).tolist())


def test_the_filter_prints_nothing_and_leaves_no_files(grove, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    filtered(*grove)
    print("after")
    assert capfd.readouterr() == ("after\n", "")
    assert os.listdir(tmp_path) == []


def test_the_filter_works_without_a_stdout(grove, monkeypatch):
    def closed(descriptor):
        raise OSError(9, "Bad file descriptor")

    expected = filtered(*grove)
    monkeypatch.setattr(os, "dup", closed)
    assert (filtered(*grove) == expected).all()


@pytest.mark.parametrize("threads", [None, "3"])
def test_the_filter_leaves_the_environment_as_it_was(grove, monkeypatch, threads):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    if threads is not None:
        monkeypatch.setenv("OMP_NUM_THREADS", threads)
    filtered(*grove)
    assert os.environ.get("OMP_NUM_THREADS") == threads


def test_without_the_filter_the_extra_is_named(grove, monkeypatch):
    monkeypatch.setitem(sys.modules, "CSF", None)
    with pytest.raises(MissingExtraError, match="'lidar'"):
        filtered(*grove)
