"""Reading of points from LAS and LAZ files in chunks. Errors describe what is wrong with a file.

The header is checked against the size of the file before laspy or its decoder uses it.  With a
damaged header, laspy would try to read billions of records, or would crash because of a lack of
memory.
"""

from __future__ import annotations

import contextlib
import io
import os
import struct
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.errors import AosplanError, RequestError, SurroundingsError, needs_extra
from aosplan.scenes.files.las_crs import Reference, UnclearUnitError, metres_of, read_reference

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from aosplan.crs import Units

    Warned = tuple[str, str]
    Floats = NDArray[np.float64]
    Chunk = tuple[NDArray[np.int32], NDArray[np.uint8], NDArray[np.bool_]]

EXTRA = "lidar"
CHUNK_POINTS = 1_000_000
"""Number of points that are decompressed at once.  The decoder processes parts of them in
parallel.
"""

PLAIN_CHUNK_POINTS = 200_000
"""Number of points that are read at once from an uncompressed file.  They fit into a processor's
cache.
"""

LAST_POINT_FORMAT = 10

LAYERED_FORMAT = 6
"""Smallest number of a point format that is compressed in layers."""

PROBED_POINTS = 100
"""Number of points that are decoded beyond the last point, to test whether there are more. If the
bytes do not belong to points, the decoder returns a few points at most.
"""

LARGEST_PROBED_CHUNK = 1_000_000
"""Number of points of the largest chunk that is decoded beyond its last point."""


class PointFile:
    """A file of points whose header has been checked.

    Parameters
    ----------
    name
        Path of the file.
    units
        Units from the user, which replace those that the file states.

    Attributes
    ----------
    count
        Number of points.
    later_returns
        Number of points that are not the first return of their pulse, from the header.
    scales_m, offsets_m
        Conversion of the integers in the file to metres: ``raw * scales_m + offsets_m``, each of
        shape (3,).
    bounds
        Smallest and largest x and y from the header, in units of the file, shape (2, 2).
    reference
        The coordinate reference system and units that the file states.
    warnings
        Codes, and sentences that continue after the name of the file.

    Raises
    ------
    RequestError
        If the file is missing, damaged or empty, if its coordinates are not in a plane, or if it
        states contradictory units.
    MissingExtraError
        If laspy or its decoder is not installed.
    SurroundingsError
        If the operating system does not allow the file to be read.
    """

    def __init__(self, name: str, units: Units | None = None) -> None:
        self.name = name
        with _faults(name), open(name, "rb") as stream:
            self.count, self.warnings = _check_sizes(stream, name)
            header = _reader(stream).header
            try:
                self.reference = read_reference(header, stream, name)
            except UnclearUnitError:
                if units is None:
                    raise
                self.reference = Reference()
            self.units, doubts = metres_of(self.reference, units)
            self.warnings += doubts
            metres = np.array([self.units.across_m, self.units.across_m, self.units.up_m])
            self.later_returns = int(np.sum(header.number_of_points_by_return[1:]))
            self.bounds: Floats = np.array([header.mins[:2], header.maxs[:2]], dtype=np.float64)
            self._scales: Floats = np.array(header.scales, dtype=np.float64)
            self.scales_m: Floats = self._scales * metres
            self.offsets_m: Floats = header.offsets * metres
            _check_scaling(self.scales_m, self.offsets_m, name)
            if header.are_points_compressed:
                self.warnings += _uncounted(header, stream, *_check_compression(header, stream))

    @property
    def metres(self) -> Floats:
        """Metres in the units of x and of y in the file, shape (2,)."""
        metres: Floats = self.scales_m[:2] / self._scales[:2]
        return metres

    def first_m(self) -> Floats:
        """x, y and z of the first point, shape (3,)."""
        with _faults(self.name), open(self.name, "rb") as stream:
            reader = _reader(stream)
            if reader.header.are_points_compressed:
                _check_compression(reader.header, stream)
            point = reader.read_points(1).array[0]
            raw = np.array([point[axis] for axis in "XYZ"])
            first: Floats = raw * self.scales_m + self.offsets_m
            return first

    def stretch(self, x: float, y: float) -> None:
        """Multiply x and y by factors, to correct the scale of the projection."""
        self.scales_m = self.scales_m * [x, y, 1.0]
        self.offsets_m = self.offsets_m * [x, y, 1.0]

    def chunks(self) -> Iterator[Chunk]:
        """Yield coordinates as integers (3, n), classes (n,) and withheld flags (n,).

        Raises the same errors as the constructor.
        """
        with _faults(self.name), open(self.name, "rb") as stream:
            for chunk in self._records(_reader(stream), stream):
                raw = np.stack([chunk.array[axis] for axis in "XYZ"])
                # The array is made contiguous. NumPy can then compare many elements at once.
                kind = np.ascontiguousarray(chunk.classification)
                yield raw, kind, np.asarray(chunk.withheld, dtype=np.bool_)

    def pulse_chunks(self) -> Iterator[PulseChunk]:
        """Yield points with the attributes of their pulses.

        Raises the same errors as the constructor.
        """
        with _faults(self.name), open(self.name, "rb") as stream:
            reader = _reader(stream, of_pulses=True)
            timed = "gps_time" in reader.header.point_format.dimension_names
            for chunk in self._records(reader, stream):
                yield PulseChunk(
                    np.stack([chunk.array[axis] for axis in "XYZ"]),
                    np.array(chunk.classification, dtype=np.uint8),
                    np.array(chunk.withheld, dtype=np.bool_),
                    np.array(chunk.return_number, dtype=np.uint8),
                    np.array(chunk.number_of_returns, dtype=np.uint8),
                    np.array(chunk.point_source_id, dtype=np.int32),
                    np.array(chunk.gps_time, dtype=np.float64) if timed else None,
                    np.array(chunk.intensity, dtype=np.float32),
                )

    def _records(self, reader: Any, stream: IO[bytes]) -> Iterator[Any]:
        """Yield the points as records of laspy."""
        header = reader.header
        if header.are_points_compressed:
            _check_compression(header, stream)
            yield from reader.chunk_iterator(CHUNK_POINTS)
            return
        end = header.offset_to_point_data + self.count * header.point_format.size
        if os.fstat(stream.fileno()).st_size < end:
            raise ValueError("it ends before its last point")
        header.point_count = self.count  # The file may contain more points than its header states.
        yield from reader.chunk_iterator(PLAIN_CHUNK_POINTS)


class PulseChunk(NamedTuple):
    """Some points of a file with the attributes of their pulses.  The arrays have the length n.

    `raw` has shape (3, n).  `time_s` is None if the points of the file have no GPS time.
    """

    raw: NDArray[np.int32]
    kind: NDArray[np.uint8]
    withheld: NDArray[np.bool_]
    number: NDArray[np.uint8]
    total: NDArray[np.uint8]
    line: NDArray[np.int32]
    time_s: Floats | None
    intensity: NDArray[np.float32]


def not_metric(source: str, why: str) -> RequestError:
    """Error for coordinates that are not metres in a plane."""
    return RequestError(
        f"the coordinates of point cloud {source} are not metres on a plane: {why}",
        "reproject it to a projected system in metres, such as UTM",
    )


@contextlib.contextmanager
def _faults(name: str) -> Iterator[None]:
    """Convert any failure while a file is read into an `AosplanError`."""
    try:
        yield
    except AosplanError:
        raise
    except FileNotFoundError as error:
        raise RequestError(f"point cloud {name} does not exist") from error
    except OSError as error:
        if os.path.isdir(name):
            raise RequestError(f"point cloud {name} is a folder", "give the files in it") from error
        raise SurroundingsError(
            f"cannot read point cloud {name}: {error.strerror or error}"
        ) from error
    except (MemoryError, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:
        # laspy, its decoder, struct and numpy report damage with exceptions of many types.
        raise RequestError(
            f"point cloud {name} is damaged or truncated: {' '.join(str(error).split())}"
        ) from error


def _reader(stream: IO[bytes], *, of_pulses: bool = False) -> Any:
    with needs_extra("reading point clouds", EXTRA):
        import laspy
    wanted = laspy.DecompressionSelection
    selection = wanted.base() | wanted.Z | wanted.CLASSIFICATION | wanted.FLAGS
    if of_pulses:
        selection |= wanted.GPS_TIME | wanted.INTENSITY | wanted.POINT_SOURCE_ID
    stream.seek(0)
    return laspy.open(
        stream,
        closefd=False,
        # Extended records are not read, because they may contain gigabytes of data, such as
        # waveforms.
        read_evlrs=False,
        decompression_selection=selection,
    )


def _check_sizes(stream: IO[bytes], name: str) -> tuple[int, list[Warned]]:
    """Number of points, checked against the size of the file, and warnings about the header."""
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
        raise RequestError(f"point cloud {name} is truncated: it ends before the end of its header")
    start, records, kind, width, count = struct.unpack_from("<IIBHI", head, 96)
    end = size
    if with_long_count:
        (count,) = struct.unpack_from("<Q", head, 247)
        waveforms, extended, extended_count = struct.unpack_from("<QQI", head, 227)
        behind = [waveforms, extended if extended_count else 0]
        end = min((place for place in behind if start <= place <= size and place), default=size)
    if start > size or records * 54 > start:
        raise RequestError(
            f"point cloud {name} is damaged or truncated: its header places {records} records "
            f"before byte {start}, and the file has {size} bytes"
        )
    # The upper bits of the format mark compression. The size of compressed points is unknown.
    compressed, layout = kind >= 64, kind % 64
    if layout > LAST_POINT_FORMAT:
        raise RequestError(
            f"point cloud {name} has point format {layout}; LAS defines only 0 to "
            f"{LAST_POINT_FORMAT}"
        )
    if count == 0:
        raise RequestError(f"point cloud {name} contains no points")
    if not compressed and count * width > size - start:
        raise RequestError(
            f"point cloud {name} is truncated: its header counts {count} points, but "
            f"the file has {(size - start) // width}"
        )
    room, rest = divmod(end - start, width) if width and not compressed else (count, 0)
    if room <= count:
        return count, []
    if rest:
        message = f"has {room - count} records after the last point that its header counts"
        return count, [("uncounted_points", message)]
    message = f"contains {room} points, but its header counts {count}; all points are read"
    return room, [("uncounted_points", message)]


def _check_scaling(scales_m: Floats, offsets_m: Floats, name: str) -> None:
    if not ((scales_m > 0.0) & (scales_m < 1e6) & (np.abs(offsets_m) < 1e12)).all():
        scales, offsets = (
            ", ".join(f"{number:g}" for number in numbers) for numbers in (scales_m, offsets_m)
        )
        raise RequestError(
            f"point cloud {name} has the scale factors {scales} and the offsets {offsets}, "
            "from which no coordinates can be computed"
        )


def _check_compression(header: Any, stream: IO[bytes]) -> tuple[bytes, list[tuple[int, int]]]:
    """Check that the compressed chunks fit into the file.

    The decoder allocates memory according to the table of chunks.

    Returns
    -------
    tuple
        The record that describes the compression, and points and bytes of each chunk.
    """
    with needs_extra("reading compressed point clouds", EXTRA):
        import lazrs
    layouts = header.vlrs.get("LasZipVlr")
    if not layouts:
        raise ValueError("the record that describes its compression is missing")
    start, size = header.offset_to_point_data, os.fstat(stream.fileno()).st_size
    table = _integer_at(stream, start, "<q")
    # If the writer could not seek, the position of the table is at the end of the file.
    if table <= 0:
        table = _integer_at(stream, size - 8, "<q")
    if not start < table < size or _integer_at(stream, table + 4, "<I") * 16 > size:
        raise ValueError("its table of chunks does not fit into the file")
    stream.seek(start)
    layout: bytes = layouts[0].record_data
    chunks: list[tuple[int, int]] = lazrs.read_chunk_table(stream, lazrs.LazVlr(layout))
    if sum(length for _, length in chunks) > size - start:
        raise ValueError("its chunks do not fit into the file")
    stream.seek(start)
    return layout, chunks


def _uncounted(
    header: Any, stream: IO[bytes], layout: bytes, chunks: list[tuple[int, int]]
) -> list[Warned]:
    """A warning if the compressed chunks contain more points than the header states."""
    import lazrs

    count = header.point_count
    if not chunks:
        return []
    before = sum(points for points, _ in chunks[:-1])
    if lazrs.LazVlr(layout).uses_variable_size_chunks():
        more = before + chunks[-1][0] > count
    elif before >= count:
        more = True
    # According to the table, all chunks have the same number of points, but the last chunk may be
    # only partly filled.
    else:
        length = chunks[-1][1]
        stream.seek(header.offset_to_point_data + 8 + sum(size for _, size in chunks[:-1]))
        chunk = stream.read(length)
        width = header.point_format.size
        if header.point_format.id >= LAYERED_FORMAT:
            # A chunk that is compressed in layers has its number of points after its first point.
            more = before + struct.unpack_from("<I", chunk, width)[0] > count
        else:
            probed = count - before + PROBED_POINTS
            more = probed <= LARGEST_PROBED_CHUNK and _decodes(layout, chunk, probed * width)
    if not more:
        return []
    message = (
        f"has compressed points after the {count} that its header counts; these points are not read"
    )
    return [("uncounted_points", message)]


def _decodes(layout: bytes, chunk: bytes, size: int) -> bool:
    """Whether a compressed chunk contains at least `size` bytes of points."""
    import lazrs

    alone = io.BytesIO(struct.pack("<q", 8 + len(chunk)) + chunk)
    alone.seek(0, os.SEEK_END)
    lazrs.write_chunk_table(alone, [(1, len(chunk))], lazrs.LazVlr(layout))
    alone.seek(0)
    try:
        lazrs.LasZipDecompressor(alone, layout).decompress_many(np.zeros(size, dtype=np.uint8))
    except lazrs.LazrsError:
        return False
    return True


def _integer_at(stream: IO[bytes], position: int, layout: str) -> int:
    stream.seek(position)
    return int(struct.unpack(layout, stream.read(struct.calcsize(layout)))[0])
