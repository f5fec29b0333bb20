"""Trajectory files: positions of the sensor by GPS time."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.files import read_bytes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

COLUMNS = ("gps_time", "x", "y", "z")
MOST_OCTETS = 1 << 30


class Trajectory(NamedTuple):
    """Positions of the sensor at increasing times.

    Attributes
    ----------
    time_s
        Shape (n,): GPS times, as in the point cloud.
    xyz_m
        Shape (3, n): positions in the coordinates of the point cloud.
    """

    time_s: Floats
    xyz_m: Floats

    def covers(self, time_s: Floats) -> NDArray[np.bool_]:
        """Mask of the times that are within the range of times of the file."""
        within: NDArray[np.bool_] = (time_s >= self.time_s[0]) & (time_s <= self.time_s[-1])
        return within

    def at(self, time_s: Floats) -> Floats:
        """Positions at some times, shape (3, n), interpolated linearly."""
        return np.stack([np.interp(time_s, self.time_s, axis) for axis in self.xyz_m])


def read_trajectory(path: str) -> Trajectory:
    """Read a CSV file with the columns gps_time, x, y and z.

    Times and coordinates are in the same systems as in the point cloud. Coordinates are in metres.

    Raises
    ------
    RequestError
        If the file does not exist or is not such a table.
    """
    try:
        text = read_bytes(path, most=MOST_OCTETS).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise RequestError(f"trajectory '{path}' is not a text file", _HINT) from None
    reader = csv.DictReader(io.StringIO(text), skipinitialspace=True)
    try:
        names = [name.strip().lower() for name in reader.fieldnames or ()]
        missing = [name for name in COLUMNS if name not in names]
        if missing:
            raise RequestError(f"trajectory '{path}' has no column '{missing[0]}'", _HINT)
        reader.fieldnames = names
        rows = []
        for row in reader:
            try:
                rows.append([float(row[name] or "") for name in COLUMNS])
            except (TypeError, ValueError):
                raise RequestError(
                    f"trajectory '{path}', line {reader.line_num}: not four numbers", _HINT
                ) from None
    except csv.Error as error:
        raise RequestError(f"trajectory '{path}' is not a CSV file: {error}", _HINT) from None
    table = np.array(rows, dtype=np.float64).reshape(-1, 4)
    if len(table) < 2 or not np.isfinite(table).all():
        raise RequestError(f"trajectory '{path}' has fewer than two finite positions", _HINT)
    table = table[np.argsort(table[:, 0], kind="stable")]
    return Trajectory(table[:, 0], np.ascontiguousarray(table[:, 1:].T))


_HINT = (
    "the file must be a CSV with the columns gps_time,x,y,z, in the times and coordinates of the "
    "cloud"
)
