"""A stand gives the same voxels with all units, reference systems, records and tiles of LAS files."""

import os
import re
import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.clouds import patched, refusal, stand, write_cloud
from support.dresses import EAST_M, NORTH_M, UNITS, geo_keys, wkt, write_dressed

from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.scenes.files.las import PointFile
from aosplan.scenes.files.point_cloud import read_voxels

pytest.importorskip("lazrs")


def placed():
    xyz, kind = stand(count=6000)
    return xyz + np.array([[EAST_M], [NORTH_M], [0.0]]), kind


XYZ, KIND = placed()


def codes(volume):
    """Codes of the warnings. The warning about few points per column is left out, because the stand
    always causes it (1.5 points per column).
    """
    return [code for code, _ in volume.warnings if code != "voxel_below_spacing"]


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    path = tmp_path_factory.mktemp("truth") / "true.las"
    volume = read_voxels(
        write_dressed(path, XYZ, KIND, before=[(2112, wkt("m").encode())], bit=True)
    )
    assert codes(volume) == []
    assert volume.canopy_top_m == 9.0
    return volume


def in_units(across, up):
    return XYZ / [[UNITS[across][0]], [UNITS[across][0]], [UNITS[up][0]]]


def dressed_keys(across, up, *, by_size, up_code):
    keys = {1024: 1, 3072: 32767}
    doubles = ()
    if by_size:
        keys |= {3076: 32767, 3077: (34736, 0)}
        doubles = (UNITS[across][0],)
    else:
        keys |= {3076: UNITS[across][2]}
    return geo_keys(keys | {4099: up_code}, doubles)


@pytest.mark.parametrize("suffix", ["las", "laz"])
@pytest.mark.parametrize("point_format", range(11))
def test_one_stand_in_every_point_format_and_scaling(tmp_path, truth, point_format, suffix):
    bit = {"before": [(2112, wkt("m").encode())], "bit": True}
    if point_format < 6:  # these have keys
        bit = {"before": dressed_keys("m", "m", by_size=False, up_code=9001), "bit": False}
    scale, offset_m = ((1e-4, None), (1e-3, None), (1e-2, 1e6))[point_format % 3]
    path = tmp_path / f"a.{suffix}"
    given = {"point_format": point_format, "scale": scale, "offset_m": offset_m}
    volume = read_voxels(write_dressed(path, XYZ, KIND, **bit, **given))
    assert (volume.points, codes(volume)) == (truth.points, [])
    # Because coordinates are rounded to centimetres, some points move across faces of voxels.
    differing = np.count_nonzero(volume.occupied != truth.occupied)
    assert differing <= (0 if scale < 1e-2 else 0.05 * np.count_nonzero(truth.occupied))


@settings(max_examples=15, suppress_health_check=list(HealthCheck))
@given(
    across=st.sampled_from(list(UNITS)),
    up=st.sampled_from(list(UNITS)),
    way=st.sampled_from(["wkt before", "wkt behind", "keys", "keys with size", "both", "--units"]),
    point_format=st.sampled_from([1, 3, 6, 7]),
    suffix=st.sampled_from(["las", "laz"]),
    tiles=st.sampled_from([1, 3]),
)
def test_one_stand_reads_the_same_from_every_file_format(
    tmp_path_factory, truth, across, up, way, point_format, suffix, tiles
):
    folder = tmp_path_factory.mktemp("dressed")
    xyz = in_units(across, up)
    text = (2112, wkt(across, up).encode() + b"\0")
    keys = dressed_keys(across, up, by_size=way == "keys with size", up_code=UNITS[up][2])
    # If the WKT bit is set, GeoTIFF keys that state metres are ignored.
    wrong = geo_keys({1024: 1, 3076: 9001, 4099: 9001})
    records = {
        "wkt before": {"before": [text], "bit": True},
        "wkt behind": {"behind": [text], "bit": True},
        "keys": {"before": keys, "bit": False},
        "keys with size": {"before": keys, "bit": False},
        "both": {"before": [*wrong, text], "bit": True},
        "--units": {"before": wrong, "bit": False},
    }[way]
    names = {"clarke": "Clarke's foot", "indian": "Indian foot"}
    units = f"{names.get(across, across)},{names.get(up, up)}" if way == "--units" else None
    if "behind" in records:
        point_format = max(point_format, 6)
    paths = [
        write_dressed(
            folder / f"{tile}.{suffix}",
            xyz[:, tile::tiles],
            KIND[tile::tiles],
            point_format=point_format,
            **records,
        )
        for tile in range(tiles)
    ]
    volume = read_voxels(paths, units=units)
    assert np.array_equal(volume.occupied, truth.occupied)
    assert volume.points == truth.points
    said = codes(volume)
    expected = [] if units or across == up == "m" else ["units_converted"]
    if way == "both" and (across, up) != ("m", "m"):
        expected = ["crs_contradicts_itself"] * ((across != "m") + (up != "m")) + expected
    assert said == expected


def test_a_missing_vertical_unit_is_that_of_x_and_y_with_a_warning_for_feet(tmp_path, truth):
    path = write_dressed(
        tmp_path / "a.laz",
        in_units("us-ft", "us-ft"),
        KIND,
        before=[(2112, wkt("us-ft").encode())],
        bit=True,
    )
    volume = read_voxels(path)
    assert np.array_equal(volume.occupied, truth.occupied)
    assert codes(volume) == ["vertical_units_assumed", "units_converted"]
    assert "US survey feet" in volume.warnings[0][1]
    assert "--units" in volume.warnings[0][1]


@pytest.mark.parametrize(
    ("vertical", "up"), [(5703, "m"), (6360, "us-ft"), (8228, "ft"), (5103, None), (32767, None)]
)
def test_the_vertical_system_s_own_code_gives_the_unit_of_z(tmp_path, vertical, up):
    """EPSG 5703 is NAVD88 in metres, 6360 is NAVD88 in US survey feet, and 8228 is NAVD88 in feet.
    EPSG 5103 is only the vertical datum, without a unit.
    """
    xyz, kind = stand(count=6000)
    foot = UNITS["us-ft"][0]
    xyz = xyz / [[foot], [foot], [UNITS[up or "us-ft"][0]]] + [[6_561_666.0], [1_940_416.0], [0.0]]
    records = geo_keys({1024: 1, 3072: 2227, 4096: vertical})
    volume = read_voxels(
        write_dressed(tmp_path / "a.laz", xyz, kind, before=records, point_format=1)
    )
    assert volume.canopy_top_m == 9.0
    assert ("vertical_units_assumed" in codes(volume)) == (up is None)


@pytest.mark.parametrize(
    ("keys", "place"),
    [
        ({1024: 1, 3072: 2227, 3076: 9001}, "key 3076"),
        ({1024: 1, 3072: 32633, 4096: 5703, 4099: 9003}, "key 4099"),
        ({1024: 1, 3072: 2227, 4096: 2}, "EPSG 2"),
    ],
)
def test_contradictory_units_are_refused(tmp_path, keys, place):
    path = write_dressed(tmp_path / "a.las", XYZ, KIND, before=geo_keys(keys), point_format=1)
    error = refusal(path)
    assert place in error.message
    assert "--units" in error.hint
    assert read_voxels(path, units="m").canopy_top_m == 9.0


def test_keys_of_an_unknown_unit_are_metres_with_a_warning_or_refused_if_they_speak_of_feet(
    tmp_path,
):
    records = geo_keys({1024: 1, 3072: 32767})
    volume = read_voxels(
        write_dressed(tmp_path / "a.las", XYZ, KIND, before=records, point_format=1)
    )
    assert codes(volume) == ["crs_unreadable"]
    records.append((34737, b"NAD83 / Texas South Central (ftUS)|\0"))
    error = refusal(write_dressed(tmp_path / "b.las", XYZ, KIND, before=records, point_format=1))
    assert "Texas" in error.message


def test_a_file_without_a_reference_system_is_read_in_metres_with_a_warning(tmp_path):
    path = write_cloud(tmp_path / "a.laz", *stand(), crs=None)
    volume = read_voxels(path)
    assert codes(volume) == ["units_assumed"]
    assert str(path) in volume.warnings[0][1]
    assert codes(read_voxels(path, units="m")) == []


def test_web_mercator_is_scaled_to_the_ground(tmp_path, truth):
    from pyproj import Transformer

    utm_to_web = Transformer.from_crs("EPSG:32633", "EPSG:3857", always_xy=True)
    # The coordinates are stretched by the inverse of the scale of the projection at this latitude.
    x0, y0 = utm_to_web.transform(EAST_M, NORTH_M)
    latitude = np.radians(
        Transformer.from_crs(32633, 4326, always_xy=True).transform(EAST_M, NORTH_M)[1]
    )
    axis_m, flat = 6378137.0, 1 / 298.257223563
    excess = flat * (2 - flat)
    root = np.sqrt(1 - excess * np.sin(latitude) ** 2)
    x_m = axis_m / root * np.cos(latitude) / axis_m
    y_m = axis_m * (1 - excess) / root**3 * np.cos(latitude) / axis_m
    xyz = (XYZ - [[EAST_M], [NORTH_M], [0.0]]) / [[x_m], [y_m], [1.0]] + [[x0], [y0], [0.0]]
    volume = read_voxels(
        write_cloud(
            tmp_path / "a.laz",
            xyz,
            KIND,
            crs="EPSG:3857",
            offset=np.floor(xyz.min(axis=1)),
            scale=1e-4,
        )
    )
    assert codes(volume) == ["projection_scaled"]
    assert np.array_equal(volume.occupied, truth.occupied)


def test_a_projection_that_distorts_angles_is_refused(tmp_path):
    xyz = XYZ + np.array([[2_000_000.0 - EAST_M], [0.0], [0.0]])
    path = write_cloud(
        tmp_path / "a.laz", xyz, KIND, crs="ESRI:54008", offset=np.floor(xyz.min(axis=1))
    )
    assert "distorts angles" in refusal(path).message


@pytest.mark.parametrize("crs", ["EPSG:2048", "EPSG:32633+5715"])
def test_axes_that_run_west_or_count_depths_are_refused(tmp_path, crs):
    path = write_cloud(tmp_path / "a.laz", *stand(), crs=crs)
    assert refusal(path).hint


def test_tiles_of_different_systems_are_refused(tmp_path):
    one = write_cloud(tmp_path / "a.laz", *stand(), crs="EPSG:32633")
    other = write_cloud(tmp_path / "b.laz", *stand(), crs="EPSG:32632")
    # Both units give the same coordinates within a millimetre.
    alike = write_cloud(tmp_path / "c.laz", *stand(), crs="EPSG:25833")
    silent = write_cloud(tmp_path / "d.laz", *stand(), crs=None)
    higher = write_cloud(tmp_path / "e.laz", *stand(), crs="EPSG:32633+5703")
    ellipsoid = write_cloud(tmp_path / "f.laz", *stand(), crs="EPSG:32633+5773")
    with pytest.raises(Exception, match="different coordinate reference systems"):
        read_voxels([one, other])
    with pytest.raises(Exception, match="different vertical datums"):
        read_voxels([higher, ellipsoid])
    assert codes(read_voxels([one, alike, higher])) == []
    assert codes(read_voxels([one, silent])) == ["units_assumed", "crs_assumed"]


def test_tiles_in_feet_and_in_metres_are_brought_together(tmp_path, truth):
    texts = {"m": wkt("m", "m"), "ft": wkt("ft", "us-ft")}
    paths = [
        write_dressed(
            tmp_path / f"{across}.laz",
            in_units(across, up)[:, part::2],
            KIND[part::2],
            before=[(2112, texts[across].encode())],
            bit=True,
        )
        for part, (across, up) in enumerate([("m", "m"), ("ft", "us-ft")])
    ]
    assert np.array_equal(read_voxels(paths).occupied, truth.occupied)


# Records that are not counted, and points that are far away


@pytest.mark.parametrize("point_format", [3, 6])
def test_uncounted_records_are_read_with_a_warning(tmp_path, point_format):
    path = write_cloud(tmp_path / "a.las", *stand(), point_format=point_format)
    whole = read_voxels(path)
    position, layout = (247, "<Q") if point_format == 6 else (107, "<I")
    volume = read_voxels(patched(path, position, struct.pack(layout, 2000)))
    assert volume.points == whole.points
    assert np.array_equal(volume.occupied, whole.occupied)
    assert codes(volume) == ["uncounted_points"]
    with open(path, "ab") as file:
        file.write(b"odd")
    volume = read_voxels(path)
    assert volume.points == 2000
    assert "uncounted_points" in codes(volume)


def test_extended_records_are_not_taken_for_points(tmp_path):
    path = write_dressed(
        tmp_path / "a.las", XYZ, KIND, behind=[(2112, wkt("m").encode())], bit=True
    )
    volume = read_voxels(path)
    assert (volume.points, codes(volume)) == (6000, [])
    os.truncate(path, os.path.getsize(path) - 700)
    assert "extended records" in refusal(path).message or "truncated" in refusal(path).message


@pytest.mark.parametrize("point_format", [0, 1, 3, 6, 7])
@pytest.mark.parametrize("counted", [30_000, 50_000, 59_000])  # chunks have 50,000 points
def test_uncounted_compressed_points_give_a_warning(tmp_path, point_format, counted):
    xyz, kind = stand(count=60_000)
    path = write_cloud(tmp_path / "a.laz", xyz, kind, point_format=point_format)
    assert "uncounted_points" not in [code for code, _ in PointFile(str(path)).warnings]
    position, layout = (247, "<Q") if point_format >= 6 else (107, "<I")
    file = PointFile(str(patched(path, position, struct.pack(layout, counted))))
    assert file.count == counted
    assert "uncounted_points" in [code for code, _ in file.warnings]


def test_a_bird_gives_a_warning_in_scene_and_plan(tmp_path):
    xyz, kind = stand()
    xyz, kind = np.column_stack([xyz, [10.0, 6.0, 900.0]]), np.append(kind, 1)
    path = write_cloud(tmp_path / "a.laz", xyz, kind)
    volume = read_voxels(path)
    code, message = volume.warnings[0]
    assert code == "points_far_above"
    assert "x 10.1, y 6.1" in message
    with pytest.raises(Exception, match="is not above the canopy") as caught:
        plan(PlanRequest(altitude=60, scene=str(path)))
    assert "bird" in caught.value.hint
    kind[-1] = 7
    assert codes(read_voxels(write_cloud(tmp_path / "b.laz", xyz, kind))) == []


@pytest.mark.parametrize("step", [-50.0, 40.0])
def test_a_ground_point_far_from_the_others_is_named(tmp_path, step):
    xyz, kind = stand()
    xyz[2, 100] += step
    [(_, message)] = [
        w
        for w in read_voxels(write_cloud(tmp_path / "a.laz", xyz, kind)).warnings
        if w[0] == "ground_outliers"
    ]
    assert f"{abs(step):.2g}" in message
    assert f"x {xyz[0, 100]:.1f}, y {xyz[1, 100]:.1f}" in message


def test_a_cliff_and_an_emergent_tree_are_not_outliers(tmp_path):
    xyz, kind = stand(count=20_000)
    xyz[2] += np.where(xyz[0] > 10.0, 8.0, 0.0)
    xyz[2, -30:] += 8.0
    assert codes(read_voxels(write_cloud(tmp_path / "a.laz", xyz, kind))) == []


@pytest.mark.parametrize(
    ("origin", "said"), [((46.95, 15.0), []), ((37.5, -120.5), ["scene_elsewhere"])]
)
def test_a_scene_from_elsewhere_is_named(tmp_path, origin, said):
    path = write_dressed(
        tmp_path / "a.las", XYZ, KIND, before=[(2112, wkt("m").encode())], bit=True
    )
    assert read_voxels(path).place == pytest.approx((46.9530, 15.0), abs=1e-3)
    found = plan(PlanRequest(altitude=60, scene=str(path), origin=origin, vhat=0.5))
    assert [code for code, _ in found.warnings if code == "scene_elsewhere"] == said


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("away_m", [-300.0, 800.0])
def test_points_far_beside_a_cloud_are_named(tmp_path, axis, away_m):
    xyz, kind = stand()
    xyz[axis, :2] = xyz[axis].min() + away_m, xyz[axis].min() + 0.9 * away_m
    volume = read_voxels(write_cloud(tmp_path / "a.laz", xyz, kind))
    (message,) = [text for code, text in volume.warnings if code == "points_far_beside"]
    # The last column of the stand contains a single point.
    assert int(message.split()[0]) in (2, 3)
    x, y = re.search(r"near x (\S+), y (\S+),", message).groups()
    assert (float(x), float(y)) == pytest.approx(xyz[:2, 0], abs=0.3)
