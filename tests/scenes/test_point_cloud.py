"""Point clouds: valid files give the correct voxels, and invalid files give one clear error."""

import re
import struct
from importlib.util import find_spec

import numpy as np
import pytest
from support.clouds import laspy, patched, refusal, slope, stand, write_cloud
from support.paths import CLOUDS

from aosplan.scenes.files import las, spool
from aosplan.scenes.files import point_cloud as lidar
from aosplan.scenes.files.point_cloud import read_voxels

pytest.importorskip("lazrs")
needs_filter = pytest.mark.skipif(find_spec("CSF") is None, reason="needs the extra lidar")

DATA = CLOUDS


def expected_voxels(xyz, kind, voxel=0.25, cut=2.0):
    """The expected voxels, computed for each point separately, above the known slope."""
    x, y, z = np.round(xyz, 3)
    occupied = {
        (
            int(h / voxel + 1e-6),
            int((b - y.min()) / voxel + 1e-6),
            int((a - x.min()) / voxel + 1e-6),
        )
        for a, b, h in zip(x, y, z - slope(x, y), strict=True)
        if h >= cut
    }
    return sorted(occupied)


def listed(volume):
    return [tuple(index) for index in np.argwhere(volume.occupied).tolist()]


def codes(volume):
    """Codes of the warnings. The warning about few points per column is left out, because it has
    its own test.

    The stand of these tests has 1.5 points per column of 0.25 m.
    """
    return [code for code, _ in volume.warnings if code != "voxel_below_spacing"]


# --- Good files ---


@pytest.mark.parametrize("suffix", ["las", "laz"])
@pytest.mark.parametrize("point_format", [0, 1, 3, 6, 7, 8])
def test_every_format_gives_the_voxels_of_brute_force(tmp_path, suffix, point_format):
    xyz, kind = stand()
    path = write_cloud(tmp_path / f"a.{suffix}", xyz, kind, point_format=point_format)
    volume = read_voxels(path)
    assert listed(volume) == expected_voxels(xyz, kind)
    assert volume.occupied.shape[1:] == (49, 81)
    assert (volume.ground, volume.points, codes(volume)) == ("class", 6000, [])
    assert (volume.voxel_m, volume.min_height_m, volume.source) == (0.25, 2.0, str(path))


@pytest.mark.parametrize(("voxel", "cut"), [(0.5, 0.5), (0.75, 3.25), (1.0, 0.0), (100.0, 2.0)])
def test_voxel_size_and_cut_are_respected(tmp_path, voxel, cut):
    xyz, kind = stand()
    path = write_cloud(tmp_path / "a.laz", xyz, kind)
    volume = read_voxels(path, voxel_m=voxel, min_height_m=cut)
    expected = expected_voxels(xyz, kind, voxel, cut)
    # The slice of the ground itself is left out, because rounding decides which of its points are
    # above the ground.
    if cut == 0.0:
        assert {i for i in listed(volume) if i[0] > 0} == {i for i in expected if i[0] > 0}
    else:
        assert listed(volume) == expected


def test_coordinates_of_a_map_grid_do_not_matter_but_are_kept(tmp_path):
    xyz, kind = stand()
    near = read_voxels(write_cloud(tmp_path / "a.laz", xyz, kind))
    moved = xyz + np.array([[470_000.0], [5_810_000.0], [2279.0]])
    far = read_voxels(write_cloud(tmp_path / "b.laz", moved, kind, offset=[4e5, 5e6, 0.0]))
    assert (far.occupied == near.occupied).all()
    assert (far.x_min_m, far.y_min_m) == pytest.approx((470_000.0, 5_810_000.0))


def test_noise_and_withheld_points_are_dropped(tmp_path):
    xyz, kind = stand()
    clean = read_voxels(write_cloud(tmp_path / "a.laz", xyz, kind))
    far = np.array([[-30.0, 60.0, 10.0, 10.0], [0.0, 0.0, 90.0, 5.0], [50.0, 50.0, 50.0, -40.0]])
    dirty = write_cloud(
        tmp_path / "b.laz",
        np.hstack([far, xyz]),
        np.concatenate([[7, 18, 5, 2], kind]),
        withheld=np.concatenate([[0, 0, 1, 1], 0 * kind]),
    )
    volume = read_voxels(dirty)
    assert (volume.occupied == clean.occupied).all()
    assert volume.points == clean.points


def test_files_of_different_scales_are_one_cloud(tmp_path):
    xyz, kind = stand()
    whole = read_voxels(write_cloud(tmp_path / "a.laz", xyz, kind))
    west, east = xyz[0] < 7.0, xyz[0] >= 7.0
    parts = [
        write_cloud(tmp_path / "west.laz", xyz[:, west], kind[west]),
        write_cloud(
            tmp_path / "east.las", xyz[:, east], kind[east], scale=[1e-4, 1e-3, 5e-4], offset=7.0
        ),
    ]
    volume = read_voxels([str(part) for part in parts])
    assert (volume.occupied == whole.occupied).all()
    assert volume.points == whole.points
    assert volume.source == f"{parts[0]} and 1 more"


def test_results_do_not_depend_on_chunks_and_blocks(tmp_path, monkeypatch):
    xyz, kind = stand()
    path = write_cloud(tmp_path / "a.laz", xyz, kind)
    whole = read_voxels(path)
    monkeypatch.setattr(las, "CHUNK_POINTS", 1000)
    monkeypatch.setattr(spool, "BLOCK_POINTS", 77)
    assert (read_voxels(path).occupied == whole.occupied).all()


def test_a_file_is_decoded_once(tmp_path, monkeypatch):
    path = write_cloud(tmp_path / "a.laz", *stand())
    decoded = []
    chunks = las.PointFile.chunks
    monkeypatch.setattr(
        las.PointFile, "chunks", lambda file: decoded.append(file.name) or chunks(file)
    )
    read_voxels(path)
    assert decoded == [str(path)]


def test_extents_are_those_of_the_points_and_not_of_the_header(tmp_path):
    xyz, kind = stand()
    path = write_cloud(tmp_path / "a.las", xyz, kind)
    honest = read_voxels(path)
    lies = struct.pack("<6d", 1e9, -1e9, float("nan"), float("inf"), 1e300, -1e300)
    assert (read_voxels(patched(path, 179, lies)).occupied == honest.occupied).all()


def test_progress_rises_to_its_total(tmp_path, monkeypatch):
    xyz, kind = stand()
    kind[::10] = 7
    monkeypatch.setattr(las, "CHUNK_POINTS", 1000)
    reports = []
    read_voxels(
        [write_cloud(tmp_path / name, xyz, kind) for name in ("a.laz", "b.las")],
        progress=lambda done, total: reports.append((done, total)),
    )
    done = [report[0] for report in reports]
    assert done == sorted(done)
    assert reports[-1] == (24_000, 24_000)
    assert {report[1] for report in reports} == {24_000}
    assert len(reports) > 12


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_exceptions_of_the_caller_are_not_changed(tmp_path, error):
    def progress(done, total):
        raise error

    with pytest.raises(error):
        read_voxels(write_cloud(tmp_path / "a.laz", *stand()), progress=progress)


def test_one_point_makes_one_column(tmp_path):
    volume = read_voxels(write_cloud(tmp_path / "a.las", [[5.0], [5.0], [7.0]]), ground="class")
    assert volume.occupied.shape == (0, 1, 1)
    assert codes(volume) == ["no_vegetation"]


def test_one_column_of_points_is_a_plot(tmp_path):
    xyz = [[5.0] * 40, [5.0] * 40, [1.0] * 20 + [9.1] * 20]
    volume = read_voxels(write_cloud(tmp_path / "a.las", xyz, [2] * 20 + [5] * 20))
    assert volume.occupied.shape == (33, 1, 1)
    assert volume.column_occupancy == 1.0


# --- Ground ---


def test_ground_below_thinned_vertices_still_follows_the_slope(tmp_path, monkeypatch):
    monkeypatch.setattr("aosplan.scenes.files.ground.MAX_VERTICES", 300)
    monkeypatch.setattr("aosplan.scenes.files.ground.MAX_NODES", 900)
    xyz, kind = stand(count=40_000)
    path = write_cloud(tmp_path / "a.laz", xyz, kind)
    # At the edges, the nearest vertex is used. Therefore only the interior is compared.
    found, expected = read_voxels(path).occupied, np.zeros((80, 49, 81), dtype=bool)
    expected[tuple(np.transpose(expected_voxels(xyz, kind)))] = True
    inside = np.s_[:, 8:-8, 8:-8]
    slices, rows, columns = found.shape  # without the last cells, which are only partly filled
    differing = found[inside] ^ expected[:slices, :rows, :columns][inside]
    assert differing.sum() < 0.02 * found[inside].sum()


def test_a_part_of_very_many_ground_points_is_enough(tmp_path, monkeypatch):
    xyz, kind = stand(count=80_000)
    path = write_cloud(tmp_path / "a.laz", xyz, kind)
    whole = read_voxels(path).occupied
    monkeypatch.setattr(lidar, "ENOUGH_GROUND_POINTS", 4000)
    part = read_voxels(path).occupied
    both = np.s_[: min(len(part), len(whole)), 4:-4, 4:-4]
    assert (part[both] ^ whole[both]).sum() < 0.01 * whole[both].sum()


def test_normalised_heights_are_recognised_with_a_warning(tmp_path):
    xyz, kind = stand()
    flat = xyz - [[0], [0], [1]] * slope(*xyz[:2])
    path = write_cloud(tmp_path / "a.laz", flat, np.where(kind == 2, 0, kind), offset=[0, 0, 3.0])
    volume = read_voxels(path)
    assert (volume.ground, codes(volume)) == ("normalized", ["ground_assumed_normalized"])
    assert listed(volume) == expected_voxels(xyz, kind)
    told = read_voxels(path, ground="normalized")
    assert (told.ground, codes(told)) == ("normalized", [])
    assert (told.occupied == volume.occupied).all()


@needs_filter
@pytest.mark.parametrize("given", ["auto", "filter"])
def test_an_unclassified_cloud_is_filtered_with_a_warning(tmp_path, given):
    xyz, kind = stand(count=12_000)
    volume = read_voxels(write_cloud(tmp_path / "a.laz", xyz, 0), ground=given)
    assert (volume.ground, codes(volume)) == ("filter", ["ground_filtered"])
    share = len(expected_voxels(xyz, kind)) / volume.occupied[0].size
    assert volume.occupied.sum() / volume.occupied[0].size == pytest.approx(share, rel=0.05)


@needs_filter
def test_a_few_ground_points_are_not_enough_for_auto(tmp_path):
    xyz, kind = stand()
    few = np.where((kind == 2) & (np.arange(6000) > 3), 1, kind)
    path = write_cloud(tmp_path / "a.laz", xyz, few)
    assert read_voxels(path).ground == "filter"
    assert read_voxels(path, ground="class").ground == "class"


def test_a_cloud_without_ground_class_gives_an_error_with_a_remedy(tmp_path):
    error = refusal(write_cloud(tmp_path / "a.laz", *stand()[:1], 1), ground="class")
    assert "class 2" in error.message
    assert "filter" in error.hint


def test_a_filter_without_ground_points_gives_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(lidar, "filtered", lambda low, _: low[:, :0])
    error = refusal(write_cloud(tmp_path / "a.laz", *stand()[:1], 1), ground="filter")
    assert "no ground" in error.message


# --- Warnings ---


def test_a_sparse_cloud_gives_a_warning(tmp_path):
    volume = read_voxels(write_cloud(tmp_path / "a.laz", *stand(count=2000)))
    assert codes(volume) == ["sparse_cloud"]
    assert "8.06 points" in volume.warnings[0][1]


def test_bare_ground_is_a_volume_without_slices_with_a_warning(tmp_path):
    xyz, kind = stand()
    volume = read_voxels(write_cloud(tmp_path / "a.laz", xyz[:, kind == 2]), min_height_m=1.0)
    assert volume.occupied.shape == (0, 49, 81)
    assert (volume.column_occupancy, codes(volume)) == (0.0, ["no_vegetation"])


def test_saturated_photos_give_a_warning(tmp_path):
    path = write_cloud(tmp_path / "a.laz", *stand(width=19.9, depth=11.9))
    volume = read_voxels(path, voxel_m=4.0)
    assert codes(volume) == ["saturated"]
    assert "smaller than 4 m, but not below 0.2 m" in volume.warnings[0][1]


def test_a_round_plot_gives_a_warning_with_the_density_inside(tmp_path):
    xyz, kind = stand(width=20.0, depth=20.0, count=40_000)
    inside = np.hypot(xyz[0] - 10.0, xyz[1] - 10.0) < 10.0
    square = read_voxels(write_cloud(tmp_path / "a.laz", xyz, kind))
    disc = read_voxels(write_cloud(tmp_path / "b.laz", xyz[:, inside], kind[inside]))
    assert codes(square) == []
    assert codes(disc) == ["partial_plot"]
    message = disc.warnings[0][1]
    covered = float(re.search(r"cover (\d+)%", message)[1]) / 100
    within = float(re.search(r"but ([\d.]+) in the part", message)[1])
    assert covered == pytest.approx(np.pi / 4, abs=0.04)
    assert within == pytest.approx(square.column_occupancy, rel=0.05)
    assert disc.column_occupancy == pytest.approx(np.pi / 4 * square.column_occupancy, rel=0.05)


@pytest.mark.parametrize("shape", ["rotated", "corner"])
def test_plots_that_are_not_rectangles_give_a_warning(tmp_path, shape):
    xyz, kind = stand(width=20.0, depth=20.0, count=40_000)
    x, y = xyz[:2]
    inside = {
        "rotated": np.abs(x - 10.0) + np.abs(y - 10.0) < 10.0,
        "corner": (x < 14.0) | (y < 10.0),
    }[shape]
    volume = read_voxels(write_cloud(tmp_path / "a.laz", xyz[:, inside], kind[inside]))
    assert codes(volume) == ["partial_plot"]
    # The covered share is the share that remains after clipping, plus half a square of 0.6 m along
    # the rim.
    said = float(re.search(r"cover (\d+)%", volume.warnings[0][1])[1]) / 100
    assert said == pytest.approx({"rotated": 0.5, "corner": 0.85}[shape], abs=0.05)


def test_a_pond_is_not_treated_as_a_hole_in_the_plot(tmp_path):
    xyz, kind = stand(width=20.0, depth=20.0, count=40_000)
    dry = np.hypot(xyz[0] - 9.0, xyz[1] - 9.0) > 5.0
    assert codes(read_voxels(write_cloud(tmp_path / "a.laz", xyz[:, dry], kind[dry]))) == []


@pytest.mark.parametrize(("voxel_m", "points_a_m2"), [(0.1, 40.0), (0.15, 68.0)])
def test_voxels_too_small_for_the_points_give_a_warning_with_a_better_size(
    tmp_path, voxel_m, points_a_m2
):
    count = 2 * round(0.5 * points_a_m2 * 20.1 * 12.1)
    path = write_cloud(tmp_path / "a.laz", *stand(count=count))
    said = dict(read_voxels(path, voxel_m=voxel_m).warnings)["voxel_below_spacing"]
    size = float(re.search(r"--voxel with ([\d.]+) m or more", said)[1])
    assert voxel_m < size < 0.25
    assert "voxel_below_spacing" not in dict(read_voxels(path, voxel_m=size).warnings)
    # The share of columns without a point agrees with a Poisson distribution.
    share = float(re.search(r"so (\d+)% of the columns", said)[1]) / 100.0
    assert share == pytest.approx(np.exp(-points_a_m2 * voxel_m**2), abs=0.02)


# --- Coordinate systems ---


@pytest.mark.parametrize(("point_format", "crs"), [(6, "EPSG:2231"), (3, "EPSG:2231")])
def test_feet_are_converted_to_metres_with_a_warning(tmp_path, point_format, crs):
    xyz, kind = stand()
    foot = 1200 / 3937
    path = write_cloud(
        tmp_path / "a.laz", xyz / foot, kind, point_format=point_format, scale=1e-4, crs=crs
    )
    volume = read_voxels(path)
    assert listed(volume) == expected_voxels(xyz, kind)
    assert codes(volume) == ["vertical_units_assumed", "units_converted"]


def test_heights_in_feet_over_metres_become_metres(tmp_path):
    xyz, kind = stand()
    mixed = xyz / [[1.0], [1.0], [1200 / 3937]]
    volume = read_voxels(
        write_cloud(tmp_path / "a.laz", mixed, kind, scale=1e-4, crs="EPSG:6341+6360")
    )
    assert listed(volume) == expected_voxels(xyz, kind)


@pytest.mark.parametrize("keys", [{3076: 9002}, {3076: 9002, 4099: 9002}])
def test_units_in_geotiff_keys_count(tmp_path, keys):
    known = pytest.importorskip("laspy.vlrs.known")
    xyz, kind = stand()
    path = write_cloud(tmp_path / "a.las", xyz / 0.3048, kind, point_format=3, scale=1e-4, crs=None)
    cloud = laspy.read(path)
    record = known.GeoKeyDirectoryVlr()
    record.geo_keys = [known.GeoKeyEntryStruct(i, 0, 1, unit) for i, unit in keys.items()]
    record.geo_keys_header.number_of_keys = len(keys)
    cloud.vlrs.append(record)
    cloud.write(str(path))
    volume = read_voxels(path)
    assert listed(volume) == expected_voxels(xyz, kind)
    said = ["units_converted"] if 4099 in keys else ["vertical_units_assumed", "units_converted"]
    assert codes(volume) == said


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:4979", "EPSG:4978"])
def test_a_geographic_or_geocentric_system_is_refused(tmp_path, crs):
    error = refusal(write_cloud(tmp_path / "a.laz", *stand(), crs=crs))
    assert "geographic" in error.message
    assert "reproject" in error.hint


def test_degrees_are_recognised_without_a_system(tmp_path):
    xyz, kind = stand()
    degrees = xyz * [[1e-5], [1e-5], [1.0]] + [[11.5], [48.1], [0.0]]
    path = write_cloud(tmp_path / "a.laz", degrees, kind, scale=[1e-7, 1e-7, 1e-3], crs=None)
    error = refusal(path)
    assert "11.5" in error.message
    assert "48.1" in error.message
    assert "reproject" in error.hint


def test_an_unreadable_reference_system_gives_a_warning_or_is_refused_if_it_mentions_feet(tmp_path):
    path = write_cloud(tmp_path / "a.las", *stand(), crs="EPSG:6341")
    path.write_bytes(path.read_bytes().replace(b"PROJC", b"PR?JC"))
    volume = read_voxels(path)
    assert volume.size_m == (20.25, 12.25)
    assert codes(volume) == ["crs_unreadable"]
    in_feet = write_cloud(tmp_path / "b.las", *stand(), crs="EPSG:2231")
    in_feet.write_bytes(in_feet.read_bytes().replace(b"PROJC", b"PR?JC"))
    assert "--units" in refusal(in_feet).hint
    assert codes(read_voxels(in_feet, units="m")) == []


# --- Real plots ---


def plot(name):
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{name} is not at hand")
    return path


def test_a_classified_plot_has_the_density_of_two_other_implementations():
    volume = read_voxels(plot("UAS_Clip.laz"), min_height_m=0.5)
    assert volume.column_occupancy == pytest.approx(0.769, abs=0.001)
    assert (volume.ground, codes(volume)) == ("class", [])
    assert volume.canopy_top_m == pytest.approx(32.25)
    # The cloud is 27.10 m x 25.82 m large. It fills 0.40 and 0.28 of the last cells.
    assert volume.occupied.shape[1:] == (103, 108)


@pytest.mark.parametrize(("count", "expected"), [(20_000, (10, 12)), (160, (11, 13))])
def test_a_last_row_of_cells_counts_only_if_the_points_fill_it(tmp_path, count, expected):
    """The plot is 12.3 m x 10.4 m large, with voxels of 1 m.  If points are dense, they show that
    the plot ends before the edge of its last cells.  If they are sparse, the gap at this edge may
    be there by chance.
    """
    rng = np.random.default_rng(5)
    xyz = rng.random((3, count)) * [[12.3], [10.4], [9.0]]
    xyz[:2, :2] = [[0.0, 12.3], [0.0, 10.4]]
    path = write_cloud(tmp_path / "a.laz", xyz, np.zeros(count, dtype=int))
    volume = read_voxels(path, voxel_m=1.0, ground="normalized")
    assert volume.occupied.shape[1:] == expected


@needs_filter
def test_the_filter_agrees_with_the_classification_of_a_plot():
    path = plot("UAS_Clip.laz")
    by_class, by_filter = (
        read_voxels(path, ground=way, min_height_m=0.5) for way in ("class", "filter")
    )
    assert by_filter.column_occupancy == pytest.approx(by_class.column_occupancy, abs=0.005)


@needs_filter
def test_an_unclassified_plot_is_read_with_default_options():
    volume = read_voxels(plot("pine_plot.laz"), min_height_m=0.5)
    assert volume.column_occupancy == pytest.approx(0.988, abs=0.003)
    assert codes(volume) == ["units_assumed", "ground_filtered", "saturated"]
    assert volume.canopy_top_m == pytest.approx(19.5, abs=0.5)
