"""Voxel files: a stand that was written is read again, and other content is refused."""

import io
import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.forests import STANDS, clumped_forest

from aosplan.errors import AosplanError, RequestError
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.files.voxel_file import VoxelStand, read_stand, stand_npz
from aosplan.scenes.opacity import Opacity
from aosplan.scenes.voxels import VoxelVolume

FOREST = VoxelVolume(
    clumped_forest(STANDS["beech"], side_m=6.1).occupied,
    0.25,
    x_min_m=478_123.25,
    y_min_m=5_353_000.5,
    min_height_m=0.5,
    points=12_345,
    ground="filter",
    warnings=(("sparse_cloud", "„few“ points"),),
    source="stand.laz",
    assumed="nothing",
)
WHOLE = VoxelStand.of(FOREST)._replace(correlogram=correlogram(FOREST))


def volume_npz(volume):
    return stand_npz(VoxelStand.of(volume))


def read_volume(path):
    return read_stand(path).volume


def test_a_volume_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "stand.npz"
    path.write_bytes(volume_npz(FOREST))
    again = read_volume(str(path))
    assert np.array_equal(again.occupied, FOREST.occupied)
    names = set(FOREST.__dataclass_fields__) - {"occupied"}
    assert {n: getattr(again, n) for n in names} == {n: getattr(FOREST, n) for n in names}


def test_opacity_from_pulses_is_kept_with_its_bounds(tmp_path):
    opacity = Opacity(
        "pulses", "", 0.1, 0.2, 0.3, "equal", (1.0, 20.0), 0.9, 1000, 2, 0.25, 0.06, 1.0, 1.5, 0.7,
        0.2, 1,
    )  # fmt: skip
    bounds = FOREST.occupied, np.zeros_like(FOREST.occupied)
    volume = replace(FOREST, slice_m=0.3, opacity=opacity, bounds=bounds)
    path = tmp_path / "stand.npz"
    path.write_bytes(volume_npz(volume))
    found = read_volume(str(path))
    assert (found.slice_m, found.opacity) == (0.3, opacity)
    assert all(np.array_equal(one, other) for one, other in zip(found.bounds, bounds, strict=True))


@pytest.mark.parametrize(
    "document",
    [{}, {"source": "pulses"}, {"source": "voxels", "seed": "x"}, {"source": "no"}, [1], "voxels"],
)
def test_an_invalid_opacity_is_refused(document):
    with pytest.raises((TypeError, ValueError)):
        Opacity.from_document(document)


def test_layers_and_correlogram_are_kept_with_it(tmp_path):
    path = tmp_path / "stand.npz"
    path.write_bytes(stand_npz(WHOLE))
    again = read_stand(str(path))
    assert again.layers == WHOLE.layers
    assert again.scene("x") == WHOLE.scene("x")
    for name in ("lags", "directions_deg"):
        assert np.array_equal(getattr(again.correlogram, name), getattr(WHOLE.correlogram, name))
    for name in ("rho", "density_by_offset"):
        kept, exact = getattr(again.correlogram, name), getattr(WHOLE.correlogram, name)
        assert np.abs(kept - exact).max() <= 0.5e-6
    assert again.correlogram.density == WHOLE.correlogram.density
    assert stand_npz(again) == stand_npz(WHOLE)


def test_a_file_with_only_voxels_is_read_as_a_stand(tmp_path):
    path = tmp_path / "early.npz"
    path.write_bytes(volume_npz(FOREST))
    with np.load(path) as arrays:
        kept, about = arrays["occupied"], json.loads(arrays["about"].tobytes())
    del about["layers"], about["assumed"]
    np.savez(path, occupied=kept, about=np.frombuffer(json.dumps(about).encode(), np.uint8))
    assert read_stand(str(path)).layers == WHOLE.layers


@pytest.mark.parametrize("layers", [[[1]], [["a", 2, 0.5, 1]], 7, [[3, 2, 0.5, 1]], [], None])
def test_invalid_layers_are_refused(tmp_path, layers):
    path = tmp_path / "odd.npz"
    path.write_bytes(volume_npz(FOREST))
    with np.load(path) as arrays:
        kept, about = arrays["occupied"], json.loads(arrays["about"].tobytes())
    about["layers"] = layers
    np.savez(path, occupied=kept, about=np.frombuffer(json.dumps(about).encode(), np.uint8))
    with pytest.raises(RequestError):
        read_stand(str(path)).scene("x")


def test_the_same_volume_gives_the_same_bytes():
    assert volume_npz(FOREST) == volume_npz(FOREST)


def test_bare_ground_has_no_slices(tmp_path):
    path = tmp_path / "bare.npz"
    path.write_bytes(volume_npz(VoxelVolume(np.zeros((0, 3, 5), dtype=bool), 0.5)))
    assert read_volume(str(path)).occupied.shape == (0, 3, 5)


@pytest.mark.parametrize("cut", [0, 10, 200, -30])
def test_a_truncated_file_is_refused(tmp_path, cut):
    path = tmp_path / "cut.npz"
    path.write_bytes(volume_npz(FOREST)[:cut])
    with pytest.raises(RequestError, match="voxel file"):
        read_volume(str(path))


@given(position=st.integers(0, len(volume_npz(FOREST)) - 1), value=st.integers(0, 255))
def test_a_damaged_file_is_refused_or_still_right(tmp_path_factory, position, value):
    content = bytearray(volume_npz(FOREST))
    content[position] = value
    path = tmp_path_factory.mktemp("damaged") / "stand.npz"
    path.write_bytes(content)
    try:
        again = read_volume(str(path))
    except AosplanError:
        return
    assert np.array_equal(again.occupied, FOREST.occupied)


def test_an_archive_from_elsewhere_is_refused(tmp_path):
    path = tmp_path / "other.npz"
    np.savez(path, something=np.arange(3))
    with pytest.raises(RequestError, match="not a voxel file"):
        read_volume(str(path))


def test_pickles_are_never_opened(tmp_path):
    path = tmp_path / "evil.npz"
    np.savez(path, about=np.array([{"version": 1}], dtype=object), occupied=np.zeros(1))
    with pytest.raises(RequestError, match="not a voxel file"):
        read_volume(str(path))


def test_a_decompression_bomb_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr("aosplan.scenes.files.voxel_file.MOST_OCTETS", 100_000)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("occupied.npy", b"\0" * 1_000_000)
    path = tmp_path / "bomb.npz"
    path.write_bytes(buffer.getvalue())
    with pytest.raises(RequestError, match="more than"):
        read_volume(str(path))
