"""Temporary storage of points on the disk.  The points can be read several times, in blocks."""

from __future__ import annotations

import contextlib
import math
import tempfile
from typing import IO, TYPE_CHECKING, NamedTuple, Self

import numpy as np

from aosplan.errors import SurroundingsError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from aosplan.scenes.files.las import PointFile

    Floats = NDArray[np.float64]

# With this size, the dozen arrays of a block stay in a processor's cache.
BLOCK_POINTS = 1 << 16


class Spool:
    """Points in an anonymous temporary file, as the integers of their files.

    They are stored in pieces of shape (3, n) with the ground points first.
    """

    def __init__(self) -> None:
        with _disk():
            self._file: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  closed on exit
        self._pieces: list[_Piece] = []
        self.count = 0
        self.ground_count = 0
        self.low_m = np.full(3, np.inf)
        self.high_m = np.full(3, -np.inf)
        self.finest_m = math.inf

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def append(self, raw: NDArray[np.int32], ground_count: int, file: PointFile) -> None:
        """Add points of a file, shape (3, n); the first `ground_count` of them are ground."""
        count = raw.shape[1]
        if count == 0:
            return
        with _disk():
            self._file.write(raw.data)
        self._pieces.append(_Piece(count, ground_count, file))
        self.count += count
        self.ground_count += ground_count
        self.low_m = np.minimum(self.low_m, raw.min(axis=1) * file.scales_m + file.offsets_m)
        self.high_m = np.maximum(self.high_m, raw.max(axis=1) * file.scales_m + file.offsets_m)
        self.finest_m = min(self.finest_m, file.scales_m[0])

    def blocks(
        self, origin_m: Floats, unit_m: float = 1.0, *, ground_only: bool = False, every: int = 1
    ) -> Iterator[Floats]:
        """Yield blocks of shape (3, n) with all points, or with every second, third, ... point.

        Coordinates are relative to an origin, in units of `unit_m`.
        """
        position = 0
        for piece in self._pieces:
            with _disk():
                self._file.seek(position)
                data = self._file.read(12 * piece.points)
            position += len(data)
            raw = np.frombuffer(data, np.int32).reshape(3, piece.points)
            if ground_only:
                raw = raw[:, : piece.ground_points : every]
            scale = (piece.file.scales_m / unit_m)[:, np.newaxis]
            shift = ((piece.file.offsets_m - origin_m) / unit_m)[:, np.newaxis]
            for start in range(0, raw.shape[1], BLOCK_POINTS):
                block = raw[:, start : start + BLOCK_POINTS] * scale
                block += shift
                yield block


class _Piece(NamedTuple):
    points: int
    ground_points: int
    file: PointFile


@contextlib.contextmanager
def _disk() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise SurroundingsError(
            "the points cannot be stored in the folder for temporary files: "
            f"{error.strerror or error}",
            "set TMPDIR to a folder with enough space (12 bytes per point)",
        ) from error
