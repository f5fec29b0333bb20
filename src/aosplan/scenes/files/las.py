"""LAS and LAZ files: their points by the million, and whatever is wrong with one, named.

What a header says is held against the file before laspy, or the decoder behind it, acts on it:
they would wait for thousands of millions of records, or end the process for want of memory.
"""

from __future__ import annotations

import contextlib
import os
import struct
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from aosplan.errors import AosplanError, RequestError, SurroundingsError, needs_extra

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Chunk = tuple[NDArray[np.int32], NDArray[np.uint8], NDArray[np.bool_]]

EXTRA = "lidar"
CHUNK_POINTS = 1_000_000
"""Points that are decompressed at once; its decoder works on several parts of them in parallel."""

PLAIN_CHUNK_POINTS = 200_000
"""The same where nothing is to decode: few enough to stay in a processor's cache."""

LAST_POINT_FORMAT = 10

# GeoTIFF keys for the model (2 geographic, 3 geocentric), the unit of x and y, the unit of z;
# and the units metre, foot and US survey foot in metres.
MODEL_KEY, UNIT_KEY, VERTICAL_UNIT_KEY = 1024, 3076, 4099
UNIT_M = {9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0}


class PointFile:
    """A file of points, after a look at its header.

    Parameters
    ----------
    name
        Path of the file.

    Attributes
    ----------
    count
        Number of points.
    scales_m, offsets_m
        What makes metres of the integers in the file, ``raw * scales_m + offsets_m``, each of
        shape (3,).
    in_feet
        Whether the file states its coordinates in feet, so that the scales contain a conversion.

    Raises
    ------
    RequestError
        Where the file is missing, damaged, empty or not in a metric or foot system.
    MissingExtraError
        Where laspy or its decoder is not installed.
    SurroundingsError
        Where the machine does not let it be read.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        with _faults(name), open(name, "rb") as stream:
            _check_sizes(stream, name)
            header = _reader(stream).header
            self.count = int(header.point_count)
            metres = _metres_per_unit(header, name)
            self.in_feet = bool((metres != 1.0).any())
            self.scales_m: Floats = header.scales * metres
            self.offsets_m: Floats = header.offsets * metres
            _check_scaling(self.scales_m, self.offsets_m, name)

    def chunks(self) -> Iterator[Chunk]:
        """Yield coordinates as integers, shape (3, n), classes (n,) and withheld flags (n,).

        Raises the same errors.
        """
        with _faults(self.name), open(self.name, "rb") as stream:
            reader = _reader(stream)
            if reader.header.are_points_compressed:
                _check_compression(reader.header, stream)
                records = reader.chunk_iterator(CHUNK_POINTS)
            else:
                records = _plain_records(reader.header, stream)
            for chunk in records:
                raw = np.stack([chunk.array[axis] for axis in "XYZ"])
                # Of one piece, as numbers are compared sixty-four at a time then.
                kind = np.ascontiguousarray(chunk.classification)
                yield raw, kind, np.asarray(chunk.withheld, dtype=np.bool_)


def not_metric(source: str, why: str) -> RequestError:
    """Error for coordinates that are not metres on a plane."""
    return RequestError(
        f"the coordinates of point cloud {source} are not metres on a plane: {why}",
        "reproject it to a metric system such as UTM",
    )


@contextlib.contextmanager
def _faults(name: str) -> Iterator[None]:
    """Turn whatever goes wrong while a file is read into an error of ours."""
    try:
        yield
    except AosplanError:
        raise
    except FileNotFoundError as error:
        raise RequestError(f"point cloud {name} does not exist") from error
    except OSError as error:
        if os.path.isdir(name):
            raise RequestError(f"point cloud {name} is a folder", "name files in it") from error
        raise SurroundingsError(
            f"cannot read point cloud {name}: {error.strerror or error}"
        ) from error
    except Exception as error:
        # laspy, its decoder, struct and numpy each complain about damage in their own way.
        raise RequestError(
            f"point cloud {name} is damaged or truncated: {' '.join(str(error).split())}"
        ) from error


def _reader(stream: IO[bytes]) -> Any:
    with needs_extra("reading point clouds", EXTRA):
        import laspy
    wanted = laspy.DecompressionSelection
    stream.seek(0)
    return laspy.open(
        stream,
        closefd=False,
        # Extended records may hold anything, waveforms of gigabytes among it.
        read_evlrs=False,
        decompression_selection=wanted.base() | wanted.Z | wanted.CLASSIFICATION | wanted.FLAGS,
    )


def _plain_records(header: Any, stream: IO[bytes]) -> Iterator[Any]:
    """Yield records that are not compressed, all in the same memory: each until the next."""
    from laspy import PackedPointRecord

    layout, count = header.point_format, header.point_count
    points = min(CHUNK_POINTS, PLAIN_CHUNK_POINTS, count)
    memory = np.empty(points, layout.dtype())
    stream.seek(header.offset_to_point_data)
    for start in range(0, count, points):
        part = memory[: count - start]
        if stream.readinto(part.view(np.uint8)) < part.nbytes:  # type: ignore[attr-defined]
            raise ValueError("it ends within its points")
        yield PackedPointRecord(part, layout)


def _check_sizes(stream: IO[bytes], name: str) -> None:
    size = os.fstat(stream.fileno()).st_size
    head = stream.read(375)
    if not head:
        raise RequestError(f"point cloud {name} is empty")
    if head[:4] != b"LASF":
        raise RequestError(
            f"{name} is not a LAS or LAZ file: it begins with {head[:4]!r}, not b'LASF'"
        )
    with_long_count = len(head) > 25 and head[25] >= 4
    if len(head) < (375 if with_long_count else 227):
        raise RequestError(f"point cloud {name} is truncated: it ends within its header")
    start, records, kind, width, count = struct.unpack_from("<IIBHI", head, 96)
    if with_long_count:
        (count,) = struct.unpack_from("<Q", head, 247)
    if start > size or records * 54 > start:
        raise RequestError(
            f"point cloud {name} is damaged or truncated: its header places {records} records "
            f"before byte {start}, and the file has {size} bytes"
        )
    # The upper bits of the format mark compression, where the width does not tell the size.
    compressed, layout = kind >= 64, kind % 64
    if layout > LAST_POINT_FORMAT:
        raise RequestError(
            f"point cloud {name} has point format {layout}; LAS has 0 to {LAST_POINT_FORMAT}"
        )
    if count == 0:
        raise RequestError(f"point cloud {name} holds no points")
    if not compressed and count * width > size - start:
        raise RequestError(
            f"point cloud {name} is truncated: its header promises {count} points, and the "
            f"file holds {(size - start) // width}"
        )


def _check_scaling(scales_m: Floats, offsets_m: Floats, name: str) -> None:
    if not ((scales_m > 0.0) & (scales_m < 1e6) & (np.abs(offsets_m) < 1e12)).all():
        scales, offsets = (
            ", ".join(f"{number:g}" for number in numbers) for numbers in (scales_m, offsets_m)
        )
        raise RequestError(
            f"point cloud {name} has the scale factors {scales} and the offsets {offsets}, "
            "which make no coordinates"
        )


def _check_compression(header: Any, stream: IO[bytes]) -> None:
    """See that the compressed chunks fit into the file, as the decoder allocates by their table."""
    with needs_extra("reading compressed point clouds", EXTRA):
        import lazrs
    layouts = header.vlrs.get("LasZipVlr")
    if not layouts:
        raise ValueError("the record that describes its compression is missing")
    start, size = header.offset_to_point_data, os.fstat(stream.fileno()).st_size
    table = _integer_at(stream, start, "<q")
    if table <= 0:  # A writer that could not seek back left it at the end of the file.
        table = _integer_at(stream, size - 8, "<q")
    if not start < table < size or _integer_at(stream, table + 4, "<I") * 16 > size:
        raise ValueError("its table of chunks does not fit into the file")
    stream.seek(start)
    chunks = lazrs.read_chunk_table(stream, lazrs.LazVlr(layouts[0].record_data))
    if sum(length for _, length in chunks) > size - start:
        raise ValueError("its chunks do not fit into the file")
    stream.seek(start)


def _integer_at(stream: IO[bytes], position: int, layout: str) -> int:
    stream.seek(position)
    return int(struct.unpack(layout, stream.read(struct.calcsize(layout)))[0])


def _metres_per_unit(header: Any, name: str) -> Floats:
    """Factors for x, y and z by the file's coordinate reference system; 1 where it has none."""
    try:
        crs = header.parse_crs()
    except Exception:  # noqa: BLE001  One that cannot be read, for whatever reason, states nothing.
        crs = None
    keys = {
        key.id: key.value_offset
        for record in header.vlrs.get("GeoKeyDirectoryVlr")
        for key in record.geo_keys
    }
    on_a_globe = crs is not None and (crs.is_geographic or crs.is_geocentric)
    if on_a_globe or keys.get(MODEL_KEY) in (2, 3):
        raise not_metric(name, "its coordinate reference system is geographic or geocentric")
    axes = [axis.unit_conversion_factor for axis in crs.axis_info] if crs is not None else []
    across = UNIT_M.get(keys.get(UNIT_KEY, 0)) or (axes[0] if len(axes) > 1 else 1.0)
    up = UNIT_M.get(keys.get(VERTICAL_UNIT_KEY, 0)) or (axes[2] if len(axes) > 2 else across)
    return np.array([across, across, up])
