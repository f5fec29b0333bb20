"""Point clouds that are damaged, unusual or unreadable: they give one clear error and need little
memory.
"""

import errno
import os
import struct
import sys

import numpy as np
import pytest
from support.clouds import patched, refusal, stand, write_cloud

from aosplan.errors import MissingExtraError, RequestError, SurroundingsError
from aosplan.scenes.files import las
from aosplan.scenes.files import point_cloud as lidar
from aosplan.scenes.files.point_cloud import read_voxels

# --- Bad files and requests ---


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (b"ply\nformat ascii", "is not a LAS or LAZ file"),
        (b"LASF", "ends before the end of its header"),
        (b"LASF" + bytes(300), "contains no points"),
        (b"LASF" + bytes(21) + b"\x04" + bytes(250), "ends before the end of its header"),
    ],
)
def test_files_that_are_not_point_clouds_are_refused_by_name(tmp_path, content, said):
    path = tmp_path / "a.las"
    path.write_bytes(content)
    assert said in refusal(path).message


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    assert "does not exist" in refusal(tmp_path / "none.laz").message
    assert "is a folder" in refusal(tmp_path).message


def test_a_file_without_points_is_named(tmp_path):
    assert "no points" in refusal(write_cloud(tmp_path / "a.laz", np.zeros((3, 0)))).message


@pytest.mark.parametrize("kind", [7, 18])
def test_a_cloud_of_noise_is_named(tmp_path, kind):
    path = write_cloud(tmp_path / "a.laz", stand()[0], kind)
    assert "contains only noise, because all of its 6000 points" in refusal(path).message


@pytest.mark.parametrize("share", [0.02, 0.05, 0.3, 0.7, 0.95, 0.9999])
@pytest.mark.parametrize("suffix", ["las", "laz"])
@pytest.mark.parametrize("point_format", [1, 6])
def test_a_truncated_file_is_named(tmp_path, capfd, suffix, share, point_format):
    path = write_cloud(tmp_path / f"a.{suffix}", *stand(), point_format=point_format)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    assert "truncated" in refusal(path).message
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", ["las", "laz"])
@pytest.mark.parametrize("promised", [6001, 2**40, 2**64 - 1])
def test_a_header_with_too_many_points_is_refused(tmp_path, capfd, suffix, promised):
    path = write_cloud(tmp_path / f"a.{suffix}", *stand())
    assert "truncated" in refusal(patched(path, 247, struct.pack("<Q", promised))).message
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("position", "data", "said"),
    [
        (96, struct.pack("<I", 2**31), "byte 2147483648"),
        (100, struct.pack("<I", 2**32 - 1), "4294967295 records"),
        (104, b"\x8d", "point format 13"),
        (105, struct.pack("<H", 3), "damaged"),
        (131, struct.pack("<d", 0.0), "scale factors 0, 0.001, 0.001"),
        (131, struct.pack("<d", float("nan")), "scale factors nan"),
        (139, struct.pack("<d", -0.001), "scale factors 0.001, -0.001"),
        (147, struct.pack("<d", 1e300), "1e+300"),
        (155, struct.pack("<d", float("inf")), "offsets inf"),
        (139, struct.pack("<d", 1000.0), "too large for a stand"),
    ],
)
def test_a_nonsensical_header_is_refused_by_name(tmp_path, position, data, said):
    path = write_cloud(tmp_path / "a.laz", *stand())
    assert said in refusal(patched(path, position, data)).message


@pytest.mark.parametrize("chunks", [2**32 - 1, 2**20])
def test_a_table_of_chunks_that_would_exhaust_the_memory_is_not_believed(tmp_path, chunks):
    path = write_cloud(tmp_path / "a.laz", *stand())
    content = path.read_bytes()
    start = struct.unpack_from("<I", content, 96)[0]
    table = struct.unpack_from("<q", content, start)[0]
    assert "table of chunks" in refusal(patched(path, table + 4, struct.pack("<I", chunks))).message
    assert "table of chunks" in refusal(patched(path, start, struct.pack("<q", 2**60))).message


def test_a_table_of_chunks_at_the_end_is_found(tmp_path):
    path = write_cloud(tmp_path / "a.laz", *stand())
    whole = read_voxels(path)
    content = path.read_bytes()
    start = struct.unpack_from("<I", content, 96)[0]
    table = content[start : start + 8]
    path.write_bytes(content[:start] + struct.pack("<q", -1) + content[start + 8 :] + table)
    assert (read_voxels(path).occupied == whole.occupied).all()


def test_chunks_longer_than_the_file_are_not_believed(tmp_path, monkeypatch):
    path = write_cloud(tmp_path / "a.laz", *stand())
    monkeypatch.setattr("lazrs.read_chunk_table", lambda *_: [(6000, 2**40)])
    assert "chunks do not fit" in refusal(path).message


def test_compression_without_its_record_is_named(tmp_path):
    path = write_cloud(tmp_path / "a.las", *stand(), point_format=1)
    assert "compression is missing" in refusal(patched(path, 104, b"\x81")).message


def test_damaged_points_give_an_error_and_no_crash(tmp_path):
    path = write_cloud(tmp_path / "a.laz", *stand(), point_format=1)
    content = path.read_bytes()
    middle = len(content) // 2
    patched(path, middle, bytes(255 - byte for byte in content[middle : middle + 2000]))
    # A file without checksums may be decoded to wrong points, but these have to form a plot.
    try:
        volume = read_voxels(path, ground="normalized")
    except RequestError as error:
        message = error.message
    else:
        message = volume.source
        assert volume.points <= 6000
    assert str(path) in message


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"voxel_m": 0.0}, "voxel size 0 m"),
        ({"voxel_m": float("nan")}, "voxel size nan m"),
        ({"min_height_m": -0.5}, "minimum height -0.5 m"),
        ({"min_height_m": float("inf")}, "minimum height inf m"),
        ({"ground": "magic"}, "'magic'"),
    ],
)
def test_a_bad_request_is_named_before_any_file_is_opened(given, said):
    with pytest.raises(RequestError, match=said):
        read_voxels("none.laz", **given)


def test_an_empty_list_of_files_is_refused():
    with pytest.raises(RequestError, match="no point cloud"):
        read_voxels([])


@pytest.mark.parametrize("voxel", [1e-4, 1e-300])
def test_too_many_voxels_are_refused_with_a_possible_size(tmp_path, voxel):
    path = write_cloud(tmp_path / "a.laz", *stand())
    error = refusal(path, voxel_m=voxel)
    assert "20.1 x 12.1 x" in error.message
    size = float(error.hint.split()[2].rstrip(","))
    assert size < 0.02
    assert read_voxels(path, voxel_m=10 * size).occupied.any()


def test_a_file_that_shrinks_while_it_is_read_is_named(tmp_path):
    path = write_cloud(tmp_path / "a.las", *stand())
    file = las.PointFile(str(path))
    os.truncate(path, os.path.getsize(path) - 40)
    with pytest.raises(RequestError, match="truncated: it ends before its last point"):
        list(file.chunks())


# --- Surroundings ---


def test_a_file_without_read_permission_is_reported_as_an_error_of_the_machine(
    tmp_path, monkeypatch
):
    path = write_cloud(tmp_path / "a.laz", *stand())

    def forbidden(name, mode):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), name)

    monkeypatch.setattr(las, "open", forbidden, raising=False)
    with pytest.raises(SurroundingsError, match="Permission denied") as caught:
        read_voxels(path)
    assert str(path) in caught.value.message


@pytest.mark.parametrize("step", ["__init__", "write", "read"])
def test_a_full_disk_is_reported_as_an_error_of_the_machine(tmp_path, monkeypatch, step):
    class Full:
        def __init__(self):
            self.fail("__init__")

        def fail(self, at):
            if at == step:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        def write(self, _):
            self.fail("write")

        def seek(self, position):
            pass

        def read(self, _):
            self.fail("read")

        def close(self):
            pass

    path = write_cloud(tmp_path / "a.laz", *stand())
    monkeypatch.setattr("tempfile.TemporaryFile", Full)
    with pytest.raises(SurroundingsError, match="No space left") as caught:
        read_voxels(path)
    assert "TMPDIR" in caught.value.hint


def test_a_cloud_too_high_is_refused_before_its_ground_is_sought(tmp_path, monkeypatch):
    (x, y, z), _ = stand()
    z[-1] = 84_000.0
    monkeypatch.setattr(lidar, "filtered", lambda *_: pytest.fail("the ground filter works"))
    error = refusal(write_cloud(tmp_path / "a.las", (x, y, z), 1))
    assert "8.4e+04 m (" in error.message
    assert "), which is too large for a stand" in error.message


def test_lack_of_memory_is_an_error_of_the_machine(tmp_path, monkeypatch):
    def fill(*_):
        raise MemoryError

    monkeypatch.setattr(lidar, "fill", fill)
    with pytest.raises(SurroundingsError, match=r"not enough memory .* 0.25 m"):
        read_voxels(write_cloud(tmp_path / "a.laz", *stand()))


@pytest.mark.parametrize("module", ["laspy", "lazrs"])
def test_without_the_optional_dependency_the_error_names_it(tmp_path, monkeypatch, module):
    path = write_cloud(tmp_path / "a.laz", *stand())
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match="'lidar'"):
        read_voxels(path)


def test_importing_the_module_loads_no_point_cloud_library():
    script = "import sys, aosplan.scenes.files.point_cloud, aosplan.scenes.occluder_statistics; print(*sys.modules)"
    subprocess = pytest.importorskip("subprocess")
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    loaded = set(result.stdout.split())
    assert "aosplan.scenes.files.point_cloud" in loaded
    assert not loaded & {"laspy", "lazrs", "CSF", "scipy", "pyproj"}
