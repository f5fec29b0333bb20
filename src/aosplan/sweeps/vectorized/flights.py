"""Grids, and lengths and times of the flights over these grids, for whole columns."""

from __future__ import annotations

import math
from collections import Counter
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.flight.kinematics import path_of, stop_to_stop_s
from aosplan.grid.patterns import MOST_SITES, AnyPattern, pattern_for

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from aosplan.sweeps.vectorized.inputs import AircraftColumns


class _Grid(NamedTuple):
    pattern: AnyPattern
    legs: tuple[tuple[float, int], ...]


class GridColumns(NamedTuple):
    """The grid of each scenario: samples, rows, columns, and extents in baselines. Equal grids have
    common legs.

    `places` has the index of the legs of each scenario.
    """

    samples: NDArray[np.int64]
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    legs: list[tuple[tuple[float, int], ...]]
    places: NDArray[np.intp]


@lru_cache(maxsize=4096)
def _grid(grid: str, samples: int) -> _Grid:
    pattern = pattern_for(grid, min(samples, MOST_SITES))
    lengths: Counter[float] = Counter()
    for leg, count in path_of(pattern).legs:
        lengths[math.hypot(leg.x, leg.y)] += count
    return _Grid(pattern, tuple(lengths.items()))


def smallest_grids(wanted: Any, grid: Any) -> GridColumns:
    """The smallest grids with the given numbers of samples.  Each distinct grid is computed
    once.
    """
    kinds, kind_places = np.unique(grid.astype(str), return_inverse=True)
    counts, count_places = np.unique(wanted, return_inverse=True)
    pairs, places = np.unique(
        kind_places.reshape(grid.shape) * len(counts) + count_places.reshape(wanted.shape),
        return_inverse=True,
    )
    found = [
        _grid(str(kinds[pair // len(counts)]), int(counts[pair % len(counts)]))
        for pair in pairs.tolist()
    ]
    shape = np.broadcast_shapes(grid.shape, wanted.shape)

    def column(function: Callable[[AnyPattern], float], dtype: Any) -> NDArray[Any]:
        table = np.array([function(each.pattern) for each in found], dtype=dtype)
        return np.asarray(table[places]).reshape(shape)

    return GridColumns(
        column(lambda pattern: pattern.samples, np.int64),
        column(lambda pattern: pattern.rows, np.int64),
        column(lambda pattern: pattern.columns, np.int64),
        column(lambda pattern: pattern.extent[0], np.float64),
        column(lambda pattern: pattern.extent[1], np.float64),
        [each.legs for each in found],
        places.reshape(shape),
    )


def flights(grids: GridColumns, baseline: Any, aircraft: AircraftColumns) -> tuple[Any, Any]:
    """Length of each path [m], and time of the path with a stop at every site [s]."""
    most = max(map(len, grids.legs))
    table = np.zeros((2, most, len(grids.legs)))
    for column, found in enumerate(grids.legs):
        if found:
            table[:, : len(found), column] = np.transpose(found)
    length, time = 0.0, grids.samples * aircraft.hold_s
    for kind in range(most):
        leg = table[0, kind][grids.places] * baseline
        count = table[1, kind][grids.places]
        length = length + leg * count
        time = (
            time + stop_to_stop_s(leg, aircraft.speed_mps, aircraft.acceleration_mps2, np) * count
        )
    return length, time
