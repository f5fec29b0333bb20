"""Crops of point clouds: the plot consists of exactly the points in a rectangle."""

import numpy as np
import pytest
from support.clouds import slope, write_cloud
from support.paths import CLOUDS

from aosplan.errors import RequestError
from aosplan.scenes.files import point_cloud
from aosplan.scenes.files.crop import Crop
from aosplan.scenes.files.point_cloud import read_voxels

pytest.importorskip("pyproj")
EAST, NORTH = 500_000.0, 5_200_000.0
"""The centre of UTM 33N, at 15° east."""

FOOT = 0.3048
UAS = CLOUDS / "UAS_Clip.laz"


def cloud(path, *, metre=1.0, crs="EPSG:32633", size=60.0, east=EAST, **given):
    """A stand of `size` metres at the centre of the zone.  `metre` is the length of a metre in the
    unit of the file.
    """
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0.0, size, (2, 20_000)).round(3)
    high = rng.random(x.size) < 0.5
    z = slope(x, y) + np.where(high, rng.uniform(3.0, 9.0, x.size), 0.0)
    xyz = (np.stack([x + east, y + NORTH, z])) * metre
    offset = np.array([east, NORTH, 0.0]) * metre
    path = write_cloud(path, xyz, np.where(high, 5, 2), crs=crs, offset=offset, **given)
    return path, x, y


def test_a_crop_equals_a_cloud_of_only_its_points(tmp_path):
    path, x, y = cloud(tmp_path / "whole.las")
    inside = (x >= 10.0) & (x <= 40.0) & (y >= 20.0) & (y <= 50.0)
    cut = read_voxels(path, crop=Crop((EAST + 10.0, NORTH + 20.0, EAST + 40.0, NORTH + 50.0)))
    assert cut.points == inside.sum()
    assert cut.x_min_m == pytest.approx(EAST + x[inside].min(), abs=1e-3)
    assert cut.y_min_m == pytest.approx(NORTH + y[inside].min(), abs=1e-3)
    assert cut.size_m == pytest.approx((30.0, 30.0), abs=0.5)
    assert not cut.warnings or "cropped_to_plan" not in dict(cut.warnings)
    assert cut.place == pytest.approx((46.955, 15.0003), abs=0.01)


@pytest.mark.parametrize("suffix", ["las", "laz"])
@pytest.mark.parametrize(("metre", "crs"), [(1.0, "EPSG:32633"), (1.0 / FOOT, None)])
def test_bounds_count_in_the_units_of_the_file(tmp_path, suffix, metre, crs):
    path, x, y = cloud(tmp_path / f"whole.{suffix}", metre=metre, crs=crs)
    # The bounds are half a millimetre away from points, because the file rounds points to a
    # thousandth of its unit.
    bounds = np.array([EAST + 10.0, NORTH + 20.0, EAST + 40.0, NORTH + 50.0]) + 5e-4
    bounds *= metre
    cut = read_voxels(path, crop=Crop(tuple(bounds)), units="m" if metre == 1.0 else "ft")
    assert cut.points == ((x > 10.0) & (x <= 40.0) & (y > 20.0) & (y <= 50.0)).sum()


def degrees(*corners):
    from pyproj import Transformer

    to = Transformer.from_crs("EPSG:32633", "EPSG:4326", always_xy=True)
    (west, south), (east, north) = (to.transform(EAST + x, NORTH + y) for x, y in corners)
    return west, south, east, north


@pytest.mark.parametrize("frame", ["degrees", "either"])
def test_bounds_may_be_degrees(tmp_path, frame):
    path, x, y = cloud(tmp_path / "whole.las")
    bounds = degrees((10.0, 20.0), (40.0, 50.0))
    cut = read_voxels(path, crop=Crop(bounds, frame))
    # On the central meridian, grid north is true north within a centimetre over these distances.
    wanted = ((x >= 10.0) & (x <= 40.0) & (y >= 20.0) & (y <= 50.0)).sum()
    assert cut.points == pytest.approx(wanted, abs=8)
    wider = read_voxels(path, crop=Crop(bounds, frame, margin_m=5.0))
    wanted = ((x >= 5.0) & (x <= 45.0) & (y >= 15.0) & (y <= 55.0)).sum()
    assert wider.points == pytest.approx(wanted, abs=8)


def test_numbers_of_a_local_cloud_are_its_coordinates_though_they_could_be_degrees(tmp_path):
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0.0, 60.0, (2, 9000)).round(3)
    path = write_cloud(tmp_path / "a.las", (x, y, rng.uniform(0.0, 9.0, 9000)), crs=None)
    cut = read_voxels(path, crop=Crop((10.0, 20.0, 40.0, 50.0)))
    assert cut.points == ((x >= 10.0) & (x <= 40.0) & (y >= 20.0) & (y <= 50.0)).sum()


def test_tiles_that_a_crop_does_not_meet_are_not_read(tmp_path, monkeypatch):
    from aosplan.scenes.files.las import PointFile

    near, _, _ = cloud(tmp_path / "near.las")
    far, _, _ = cloud(tmp_path / "far.las", east=EAST + 60.0)
    chunks, read = PointFile.chunks, []
    monkeypatch.setattr(PointFile, "chunks", lambda f: read.append(f.name) or chunks(f))
    crop = Crop((EAST + 10.0, NORTH, EAST + 40.0, NORTH + 50.0))
    alone = read_voxels(near, crop=crop)
    read.clear()
    both = read_voxels([near, far], crop=crop)
    assert read == [str(near)]
    assert both.points == alone.points
    np.testing.assert_array_equal(both.occupied, alone.occupied)


def test_wrong_bounds_in_a_header_lose_no_points(tmp_path):
    import struct

    path, _, _ = cloud(tmp_path / "a.las")
    crop = Crop((EAST + 10.0, NORTH + 20.0, EAST + 40.0, NORTH + 50.0))
    honest = read_voxels(path, crop=crop).points
    content = bytearray(path.read_bytes())
    other, _, _ = cloud(tmp_path / "b.las", east=EAST + 500.0)
    bounds = struct.pack("<6d", 10.0, 0.0, 10.0, 0.0, 10.0, 0.0)
    content[179 : 179 + len(bounds)] = bounds
    path.write_bytes(content)
    whole = Crop((EAST + 10.0, NORTH + 20.0, EAST + 540.0, NORTH + 50.0))
    assert read_voxels([path, other], crop=whole).points > honest


def test_a_crop_beside_the_cloud_is_refused_with_its_reach(tmp_path):
    path, _, _ = cloud(tmp_path / "a.las")
    with pytest.raises(RequestError, match="no point of point cloud") as caught:
        read_voxels(path, crop=Crop((EAST - 90.0, NORTH, EAST - 40.0, NORTH + 50.0)))
    assert "x 500000." in caught.value.hint
    with pytest.raises(RequestError, match="no point of point cloud"):
        read_voxels(path, crop=Crop((0.0, 0.0, 1.0, 1.0)))
    with pytest.raises(RequestError, match="not a place in"):
        read_voxels(path, crop=Crop((-170.0, -1.0, -165.0, 91.0), "degrees"))
    bare = write_cloud(tmp_path / "b.las", np.ones((3, 9)) * EAST, crs=None)
    with pytest.raises(RequestError, match="has no coordinate reference system"):
        read_voxels(bare, crop=Crop((10.0, 40.0, 11.0, 41.0), "degrees"))


def test_a_cloud_is_cropped_to_the_plan_with_a_warning(tmp_path):
    path, x, y = cloud(tmp_path / "a.las", size=200.0)
    there = Crop(degrees((20.0, 30.0), (60.0, 80.0)), "degrees", 20.0, of_plan=True)
    cut = read_voxels(path, crop=there)
    assert cut.points == pytest.approx(((x <= 80.0) & (y >= 10.0) & (y <= 100.0)).sum(), abs=20)
    assert "around the plan is used, 80 x 90 m" in dict(cut.warnings)["cropped_to_plan"]
    everywhere = Crop(degrees((-20.0, -30.0), (260.0, 280.0)), "degrees", of_plan=True)
    elsewhere = Crop((30.0, 10.0, 30.1, 10.1), "degrees", of_plan=True)
    corner = Crop(degrees((-90.0, -90.0), (20.0, 20.0)), "degrees", of_plan=True)
    for crop in (everywhere, elsewhere, corner):
        whole = read_voxels(path, crop=crop)
        assert whole.points == x.size
        assert "cropped_to_plan" not in dict(whole.warnings)


# --- Wide plots ---


@pytest.fixture
def wide(tmp_path):
    path, _, _ = cloud(tmp_path / "a.las", size=60.0)
    return path


def test_wide_plots_have_larger_voxels_with_a_warning(wide, monkeypatch):
    assert read_voxels(wide).voxel_m == 0.25
    # z has a range of 28 m. With the limit below, a volume of 60 x 60 x 28 m needs voxels of at
    # least 0.38 m.
    monkeypatch.setattr(point_cloud, "USUAL_VOXELS", 1_830_000)
    enlarged = read_voxels(wide)
    assert enlarged.voxel_m == 0.4
    assert (
        "voxels of 0.4 m are used instead of 0.25 m" in dict(enlarged.warnings)["voxels_enlarged"]
    )
    assert "voxels_enlarged" not in dict(read_voxels(wide, voxel_m=0.3).warnings)
    monkeypatch.setattr(point_cloud, "USUAL_VOXELS", 100)
    assert read_voxels(wide).voxel_m == 0.25  # The user has to give sizes above 0.5 m.


def pulses_of(path, **given):
    volume = read_voxels(path, opacity="auto", **given)
    return volume, volume.opacity


@pytest.mark.skipif(not UAS.is_file(), reason="the real point clouds are not at hand")
class TestPulsesOfWidePlots:
    crop = Crop((0.0, 0.0, 0.0, 0.0))

    @pytest.fixture(autouse=True)
    def middle(self):
        """The central 20 m of the cloud."""
        from aosplan.scenes.files.las import PointFile

        low, high = PointFile(str(UAS)).bounds
        x, y = (low + high) / 2.0
        self.crop = Crop((x - 10.0, y - 10.0, x + 10.0, y + 10.0))

    @pytest.mark.slow
    def test_a_crop_has_the_pulses_over_it_alone(self):
        volume, opacity = pulses_of(UAS, crop=self.crop)
        assert opacity.source == "pulses"
        assert volume.size_m == pytest.approx((20.0, 20.0), abs=0.3)
        assert opacity.voxel_m == volume.slice_m == 0.25

    @pytest.mark.slow
    def test_a_share_of_the_pulses_gives_about_the_same_opacity_as_all(self, monkeypatch):
        from aosplan.scenes.pulses import fit

        whole = pulses_of(UAS)
        monkeypatch.setattr(fit, "MOST_RETURNS", whole[0].points // 2)
        part = pulses_of(UAS)
        assert part[1].pulses == pytest.approx(whole[1].pulses / 2, rel=0.05)
        assert part[1].gap_weighted == pytest.approx(whole[1].gap_weighted, abs=0.01)
        assert part[0].column_occupancy == pytest.approx(whole[0].column_occupancy, abs=0.01)

    @pytest.mark.slow
    def test_opacity_from_pulses_uses_larger_voxels_on_wide_plots_and_points_on_wider_ones(
        self, monkeypatch
    ):
        monkeypatch.setattr(point_cloud, "MOST_PULSE_COLUMNS", 3000)
        volume, opacity = pulses_of(UAS, crop=self.crop)
        assert opacity.voxel_m == volume.slice_m == 0.5
        monkeypatch.setattr(point_cloud, "MOST_PULSE_COLUMNS", 500)
        volume, opacity = pulses_of(UAS, crop=self.crop)
        assert opacity.source == "voxels"
        assert "give --crop" in opacity.reason
        assert volume.slice_m is None
