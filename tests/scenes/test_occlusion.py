"""Occlusion, compared with rays that are traced through the same voxels from face to face."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.forests import STANDS, clumped_forest
from support.paths import CLOUDS

from aosplan.errors import RequestError
from aosplan.grid.patterns import local_sites, pattern_for
from aosplan.scenes import hidden_counts
from aosplan.scenes import occlusion as occlusion_module
from aosplan.scenes.hidden_counts import HiddenCount, joint_counts, popcount
from aosplan.scenes.occlusion import Occlusion, PlotWindow
from aosplan.scenes.voxels import VoxelVolume

DATA = CLOUDS


def walk(volume, starts_m, ends_m, focal_height_m=0.0):
    """Whether rays from the focal plane meet a filled voxel of a periodic plot.

    Each ray moves to the next voxel through the face that it reaches first.  All rays are processed
    at the same time.  `starts_m` has the shape (n, 2).  `ends_m` has the shape (n, 3), with heights
    above the focal plane.
    """
    slices, rows, columns = volume.occupied.shape
    start = np.column_stack([starts_m, np.full(len(starts_m), focal_height_m)]) / volume.voxel_m
    end = np.asarray(ends_m) / volume.voxel_m + (0.0, 0.0, focal_height_m / volume.voxel_m)
    direction = end - start
    cell = np.floor(start + 1e-12).astype(int)
    forward = direction > 0.0
    step = np.sign(direction).astype(int)
    with np.errstate(divide="ignore", invalid="ignore"):
        per_cell = np.where(step == 0, np.inf, 1.0 / np.abs(direction))
        reached = np.where(
            step == 0, np.inf, (cell + forward - start) / np.where(step == 0, 1.0, direction)
        )
    hit = np.zeros(len(start), dtype=bool)
    going = np.arange(len(start))
    while True:
        going = going[cell[going, 2] < slices]
        x, y, z = cell[going].T
        filled = volume.occupied[z, y % rows, x % columns]
        hit[going[filled]] = True
        going = going[~filled]
        if going.size == 0:
            return hit
        axis = reached[going].argmin(axis=1)
        cell[going, axis] += step[going, axis]
        reached[going, axis] += per_cell[going, axis]


def targets_of(volume, per_voxel):
    """Positions of targets relative to the plot's corner [m], shape (rows * columns, 2)."""
    _, rows, columns = volume.occupied.shape
    pitch = volume.voxel_m / per_voxel
    x, y = np.meshgrid(np.arange(columns * per_voxel), np.arange(rows * per_voxel))
    return (np.column_stack([x.ravel(), y.ravel()]) + 0.5) * pitch


def walked(volume, altitude_m, position, targets, view, focal_height_m=0.0):
    """The expected result of `Occlusion`, computed with `walk`, for one camera or for one camera
    per target.
    """
    base = targets if view == "telecentric" else 0.5 * np.array(volume.size_m)
    above = np.broadcast_to(base + np.asarray(position), targets.shape)
    ends = np.column_stack([above, np.full(len(targets), altitude_m)])
    return walk(volume, targets, ends, focal_height_m)


def hidden(volume, altitude_m, position, **options):
    occlusion = Occlusion(volume, altitude_m, **options)
    return occlusion.unpack(occlusion.masks([position]))[0]


volumes = st.tuples(st.integers(1, 5), st.integers(1, 7), st.integers(1, 19)).flatmap(
    lambda shape: arrays(np.bool_, shape, elements=st.booleans(), fill=st.nothing())
)


# --- Comparison with rays --------------------------------------------------------------------


@given(volumes, st.integers(1, 5), st.data())
def test_rays_along_an_axis_are_exact(occupied, per_voxel, data):
    # Rays along an axis do not meet cells at their side, and shifts by whole targets per slice are
    # not rounded. The result is therefore exact for all targets, up to a shift of one voxel per
    # slice.
    volume = VoxelVolume(occupied, 0.5)
    altitude = 16.0
    shift = data.draw(st.integers(-per_voxel, per_voxel))
    offset = np.zeros(2)
    offset[data.draw(st.integers(0, 1))] = shift * altitude / per_voxel
    # The positions are slightly off the lattice, because there is no correct result for a ray
    # through an edge between voxels.
    targets = targets_of(volume, per_voxel)
    got = hidden(volume, altitude, offset, targets_per_voxel=per_voxel)
    want = walked(volume, altitude, offset * (1.0 - 1e-9), targets, "telecentric")
    assert (got.ravel() == want).all()


@given(volumes, st.integers(1, 4), st.floats(-6.0, 6.0), st.floats(-6.0, 6.0))
def test_perspective_rays_are_exact_but_for_the_cell_beside(occupied, per_voxel, x, y):
    volume = VoxelVolume(occupied, 1.0)
    altitude = 40.0
    targets = targets_of(volume, per_voxel)
    got = hidden(volume, altitude, (x, y), view="perspective", targets_per_voxel=per_voxel).ravel()
    want = walked(volume, altitude, (x, y), targets, "perspective")
    # If a ray leaves its cell through two sides in one slice, the tested code ignores the second
    # cell.
    heights = np.arange(len(occupied) + 1)[:, None, None] / altitude
    places = targets * (1.0 - heights) + (0.5 * np.array(volume.size_m) + (x, y)) * heights
    cells = np.floor(places)
    both = (cells[1:] != cells[:-1]).all(axis=2).any(axis=0)
    at_an_edge = (np.abs(places - np.rint(places)) < 1e-9).any(axis=(0, 2))
    sure = ~both & ~at_an_edge
    assert (got[sure] == want[sure]).all()


# Samples, baseline and heading. The headings avoid rays through edges, for which there is no
# correct result.
PLANS = [(4, 0.5, 20.0), (25, 1.5, 30.0), (49, 3.5, 10.0), (100, 5.0, 0.1)]


def assert_like_rays(volume, view, rays=60_000):
    """Check that V and V̂ of plans differ by at most 0.002 from the values of many rays to the same
    targets.
    """
    rng = np.random.default_rng(5)
    occlusion = Occlusion(volume, 50.0, view=view)
    for samples, baseline, heading in PLANS:
        sites = np.column_stack(local_sites(pattern_for("trimmed", samples), baseline, heading))
        count = rays // samples
        chosen = rng.choice(occlusion.targets, count, replace=False)
        targets = targets_of(volume, 4)[chosen]
        got = occlusion.unpack(occlusion.masks(sites)).reshape(samples, -1)[:, chosen]
        ends = np.repeat(sites, count, axis=0), np.tile(targets, (samples, 1))
        want = walked(volume, 50.0, *ends, view).reshape(samples, count)
        (v, vhat), (v_rays, vhat_rays) = visibilities(got), visibilities(want)
        assert v == pytest.approx(v_rays, abs=0.002), (samples, baseline)
        assert vhat == pytest.approx(vhat_rays, abs=0.002), (samples, baseline)


def visibilities(views):
    """V and V̂ from their definitions, for masks of shape (N, targets)."""
    p = views.mean()
    v = 1.0 - (views.mean(axis=0) ** 2).mean()
    return v, (v - (1.0 - p)) / (p * (1.0 - p))


@pytest.mark.slow
@pytest.mark.parametrize("view", ["telecentric", "perspective"])
@pytest.mark.parametrize("name", STANDS)
def test_views_of_generated_forests_agree_with_traced_rays(name, view):
    assert_like_rays(clumped_forest(STANDS[name]), view)


@pytest.mark.slow
@pytest.mark.parametrize("view", ["telecentric", "perspective"])
@pytest.mark.parametrize(("name", "voxel_m"), [("UAS_Clip", 0.25), ("pine_plot", 0.1)])
def test_views_of_real_stands_agree_with_traced_rays(name, voxel_m, view, real_stand):
    assert_like_rays(real_stand(name, voxel_m), view)


@pytest.fixture(scope="module")
def real_stand():
    """A function that returns the voxels of a cloud, from its name and the size of the voxels."""
    known = {}

    def read(name, voxel_m):
        pytest.importorskip("laspy")
        pytest.importorskip("CSF")
        path = DATA / f"{name}.laz"
        if not path.is_file():
            pytest.skip("the real point clouds are not at hand")
        from aosplan.scenes.files.point_cloud import read_voxels

        if (name, voxel_m) not in known:
            known[name, voxel_m] = read_voxels(str(path), voxel_m=voxel_m, min_height_m=0.5)
        return known[name, voxel_m]

    return read


# --- The two views ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def scrub():
    """A random volume that is wider than one word and has odd sizes."""
    rng = np.random.default_rng(1)
    return VoxelVolume(rng.random((12, 23, 31)) < 0.02, 0.5)


@pytest.mark.parametrize("view", ["telecentric", "perspective"])
def test_the_nadir_view_sees_targets_of_empty_columns(scrub, view):
    if view == "telecentric":
        column = scrub.occupied.any(axis=0).repeat(3, axis=0).repeat(3, axis=1)
        assert (hidden(scrub, 20.0, (0.0, 0.0), targets_per_voxel=3) == column).all()
    high = hidden(scrub, 1e9, (0.0, 0.0), view=view, targets_per_voxel=3)
    assert (high == scrub.occupied.any(axis=0).repeat(3, axis=0).repeat(3, axis=1)).all()


def test_a_camera_sees_each_target_at_the_offset_between_them():
    # Targets are in the camera's row, so all rays are along x. Offsets shift by whole targets per
    # slice, so nothing is rounded.
    volume = VoxelVolume(np.random.default_rng(4).random((3, 5, 11)) < 0.2, 1.0)
    altitude, row, camera = 4.0, 2, 5
    perspective = hidden(volume, altitude, (0.0, 0.0), view="perspective", targets_per_voxel=1)
    for column in range(1, 11, 4):
        offset = (camera - column, 0.0)
        telecentric = hidden(volume, altitude, offset, targets_per_voxel=1)
        assert perspective[row, column] == telecentric[row, column]
    assert 0.0 < perspective.mean() < 1.0


def test_only_the_slope_counts_for_telecentric_views(scrub):
    near = hidden(scrub, 20.0, (3.0, -2.0))
    assert (near == hidden(scrub, 60.0, (9.0, -6.0))).all()
    assert (near != hidden(scrub, 60.0, (3.0, -2.0))).any()


def test_shifting_the_volume_periodically_shifts_the_hidden_targets(scrub):
    moved = VoxelVolume(np.roll(scrub.occupied, (4, -7), axis=(1, 2)), 0.5)
    for offset in [(3.1, -2.3), (-11.0, 8.0)]:
        before, after = hidden(scrub, 20.0, offset), hidden(moved, 20.0, offset)
        assert (after == np.roll(before, (16, -28), axis=(0, 1))).all()


def test_mirrored_volumes_mirror_their_views(scrub):
    mirrored = VoxelVolume(scrub.occupied[:, ::-1], 0.5)
    for view in ("telecentric", "perspective"):
        before = hidden(scrub, 20.0, (2.9, -2.3), view=view)
        after = hidden(mirrored, 20.0, (2.9, 2.3), view=view)
        assert (after == before[::-1]).all()


def test_a_turned_volume_turns_its_telecentric_views():
    occupied = np.random.default_rng(2).random((12, 20, 20)) < 0.02
    turned = np.ascontiguousarray(occupied.transpose(0, 2, 1))
    before = hidden(VoxelVolume(occupied, 0.5), 20.0, (3.1, -2.3))
    after = hidden(VoxelVolume(turned, 0.5), 20.0, (-2.3, 3.1))
    assert (after == before.T).all()


# --- The focal plane -------------------------------------------------------------------------


@pytest.mark.parametrize("view", ["telecentric", "perspective"])
def test_a_focal_plane_between_slices_cuts_the_volume(scrub, view):
    cut = VoxelVolume(scrub.occupied[3:], 0.5)
    raised = hidden(scrub, 20.0, (3.1, -2.3), view=view, focal_height_m=1.5)
    assert (raised == hidden(cut, 20.0, (3.1, -2.3), view=view)).all()


def test_a_focal_plane_within_a_slice_keeps_its_upper_part():
    occupied = np.random.default_rng(3).random((4, 6, 11)) < 0.2
    volume = VoxelVolume(occupied, 1.0)
    targets = targets_of(volume, 2)
    # Shifts are half a target per slice.  As half a slice is above the focal plane, the shifts are
    # 0 at 0 m and 1 target at 0.5 m above this plane.
    offset = (10.0, 0.0)
    got = hidden(volume, 10.0, offset, targets_per_voxel=2, focal_height_m=1.5)
    want = walked(volume, 10.0, (10.0 - 1e-9, 0.0), targets, "telecentric", 1.5)
    assert (got.ravel() == want).all()


def test_an_empty_volume_hides_no_targets(scrub):
    bare = VoxelVolume(np.zeros((0, 3, 4), dtype=bool), 0.5)
    for view in ("telecentric", "perspective"):
        assert not hidden(bare, 1.0, (2.0, 1.0), view=view).any()
        assert not hidden(scrub, 1.0, (2.0, 1.0), view=view, focal_height_m=6.0).any()
        assert not hidden(scrub, 1.0, (2.0, 1.0), view=view, focal_height_m=99.0).any()


def test_a_full_slice_hides_all_targets():
    roof = np.zeros((5, 3, 70), dtype=bool)
    roof[4] = True
    for view in ("telecentric", "perspective"):
        assert hidden(VoxelVolume(roof, 0.5), 20.0, (2.0, 1.0), view=view).all()


# --- Memory ----------------------------------------------------------------------------------


def test_results_do_not_depend_on_how_work_is_divided(scrub, monkeypatch):
    offsets = np.random.default_rng(6).uniform(-15.0, 15.0, (9, 2))
    occlusion = Occlusion(scrub, 20.0)
    whole = occlusion.masks(offsets)
    one_by_one = np.concatenate([occlusion.masks([offset]) for offset in offsets])
    assert (one_by_one == whole).all()
    fresh = np.concatenate([Occlusion(scrub, 20.0).masks([offset]) for offset in offsets])
    assert (fresh == whole).all()
    monkeypatch.setattr(occlusion_module, "OCTETS_IN_CACHE", 1)
    assert (occlusion.masks(offsets) == whole).all()
    monkeypatch.setattr(occlusion_module, "OCTETS_KEPT", 0)
    assert (occlusion.masks(offsets) == whole).all()
    monkeypatch.setattr(occlusion_module, "OCTETS_A_VIEW", 100)
    monkeypatch.setattr(occlusion_module, "OCTETS_AT_ONCE", 3000)
    assert (occlusion.masks(offsets) == whole).all()
    counts = joint_counts(whole)
    monkeypatch.setattr(hidden_counts, "TARGETS_AT_ONCE", 1000)
    assert (joint_counts(whole) == counts).all()


@pytest.mark.parametrize("slice_m", [None, 0.25])
def test_perspective_views_do_not_depend_on_how_work_is_divided(scrub, slice_m, monkeypatch):
    volume = replace(scrub, slice_m=slice_m)
    offsets = np.random.default_rng(7).uniform(-15.0, 15.0, (4, 2))
    whole = Occlusion(volume, 20.0, view="perspective")
    masks = whole.masks(offsets)
    monkeypatch.setattr(occlusion_module, "OCTETS_KEPT", 0)
    monkeypatch.setattr(occlusion_module, "POSITIONS_AT_ONCE", 1)
    again = Occlusion(volume, 20.0, view="perspective")
    assert (again.masks(offsets) == masks).all()
    # The window has so few rows that rays do not meet most rows of the plot.
    window = PlotWindow(9, 5, whole.rows // 3, 70)
    part = Occlusion(volume, 20.0, view="perspective", window=window)
    assert (part.unpack(part.masks(offsets)) == whole.unpack(masks, window)).all()


def test_views_are_the_same_after_any_others(scrub):
    # These offsets are within the previous ones, beyond them on one side, and larger than the plot.
    rng = np.random.default_rng(8)
    occlusion = Occlusion(scrub, 20.0)
    for reach in (3.0, 2.0, 9.0, 60.0, 5.0):
        offsets = rng.uniform(-reach, 0.5 * reach, (3, 2))
        assert (occlusion.masks(offsets) == Occlusion(scrub, 20.0).masks(offsets)).all()


def test_a_distant_view_needs_no_additional_memory(scrub):
    # The shift is a hundred thousand targets, but the result depends only on the shift within one
    # slice.
    far = hidden(scrub, 20.0, (40_000.0, -3.0))
    assert far.shape == (92, 124)


def test_without_views_there_are_no_masks(scrub):
    for view in ("telecentric", "perspective"):
        occlusion = Occlusion(scrub, 20.0, view=view)
        assert occlusion.masks(np.zeros((0, 2))).shape == (0, occlusion.words)


# --- Counting --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def counted(scrub):
    """Masks of some views, the same masks as an array of shape (N, targets), and the number of
    targets.
    """
    offsets = np.random.default_rng(7).uniform(-6.0, 6.0, (37, 2))
    occlusion = Occlusion(scrub, 20.0)
    masks = occlusion.masks(offsets)
    return masks, occlusion.unpack(masks).reshape(len(offsets), -1), occlusion.targets


@pytest.mark.parametrize("numpy_1", [False, True])
def test_popcount_counts_the_bits_of_targets(counted, monkeypatch, numpy_1):
    masks, views, targets = counted
    assert views.shape == (37, targets)
    if numpy_1:
        monkeypatch.delattr(np, "bitwise_count", raising=False)
    assert (popcount(masks) == views.sum(axis=1)).all()
    assert (popcount(masks[:, ::2][::3]) <= views.sum(axis=1)[::3]).all()


def test_joint_counts_are_of_both_hidden(counted):
    masks, views, _ = counted
    numbers = views.astype(int)
    assert (joint_counts(masks) == numbers @ numbers.T).all()


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4, 31, 37])
def test_hidden_count_counts_the_views_hiding_each_target(counted, count):
    masks, views, _ = counted
    tally = HiddenCount(masks.shape[1])
    for mask in masks[:count]:
        tally.add(mask)
    times = views[:count].sum(axis=0)
    assert tally.views == count
    assert tally.moments() == (times.sum(), (times**2).sum())


# --- Errors ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("altitude", "options", "message"),
    [
        (6.0, {}, "altitude 6 m is not above the canopy, whose top is 6 m"),
        (np.nan, {}, "altitude nan m is not above"),
        (np.inf, {}, "altitude inf m is not above"),
        (0.0, {"focal_height_m": 8.0}, "altitude 0 m is not above"),
        (20.0, {"view": "fisheye"}, "view 'fisheye' is unknown"),
        (20.0, {"targets_per_voxel": 0}, "targets_per_voxel 0 is not a whole number from 1"),
        (20.0, {"targets_per_voxel": 1.5}, "targets_per_voxel 1.5 is not"),
        (20.0, {"focal_height_m": -1.0}, "focal height -1 m is not zero or above"),
        (20.0, {"focal_height_m": np.nan}, "focal height nan m is not"),
    ],
)
def test_invalid_arguments_of_occlusion_are_refused(altitude, options, message):
    column = VoxelVolume(np.ones((12, 1, 1), dtype=bool), 0.5)
    with pytest.raises(RequestError) as error:
        Occlusion(column, altitude, **options)
    assert error.value.message.startswith(message)


@pytest.mark.parametrize("positions", [[(0.0, np.nan)], [(np.inf, 0.0)], [1.0, 2.0], [(0, 0, 0)]])
def test_positions_of_wrong_shape_are_refused(scrub, positions):
    with pytest.raises(ValueError, match="shape"):
        Occlusion(scrub, 20.0).masks(positions)
