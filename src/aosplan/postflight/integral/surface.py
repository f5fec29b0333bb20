"""Focal surfaces from elevation models: the height of the ground at every pixel of the integral
image.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.postflight.integral.focal_plane import Raster
    from aosplan.postflight.integral.georeference import Georeference

MOST_NODES = 300
"""Number of places along each side of the raster at which the elevation model is read.

Heights are interpolated between them.
"""


def read_slope(text: str) -> tuple[float, float]:
    """Parse the rise of a plane per metre of x and y, as numbers or percentages.

    Raises
    ------
    RequestError
        If the text does not contain two numbers between -2 and 2.
    """
    from aosplan.units import number

    parts = text.split(",")
    if len(parts) != 2:
        raise RequestError(
            f"--slope '{text}' is not X,Y",
            "give the rise to the east and to the north, such as 0.05,-0.03 or 5%,-3%",
        )
    found = [
        number(part.rstrip("% "), "--slope") / (100.0 if part.strip().endswith("%") else 1.0)
        for part in parts
    ]
    if max(map(abs, found)) > 2.0:
        raise RequestError(f"--slope '{text}' is steeper than 2", "5% is 0.05")
    return found[0], found[1]


def relief_of(
    path: str,
    georeference: Georeference | None,
    first_m: NDArray[np.float64],
    raster: Raster,
) -> NDArray[np.float64]:
    """Heights of an elevation model above the take-off point at the pixels of a raster.

    The shape is (rows, columns). The take-off point is assumed to be below the first photo, which
    is at `first_m` along x and y.

    Raises
    ------
    RequestError
        If the recording has no location, or if the elevation model does not cover the raster.
    """
    from aosplan.flight.terrain import Terrain

    if georeference is None:
        raise RequestError(
            "--focal-surface needs photos with positions: the poses have no geographic coordinates",
            "to tilt the plane, give --slope X,Y",
        )
    rows = np.linspace(0.5, raster.rows - 0.5, min(raster.rows, MOST_NODES))
    columns = np.linspace(0.5, raster.columns - 0.5, min(raster.columns, MOST_NODES))
    x, y = np.meshgrid(raster.left_m + raster.gsd_m * columns, raster.top_m - raster.gsd_m * rows)
    x, y = (
        np.append(x.ravel(), first_m[0]),
        np.append(y.ravel(), first_m[1]),
    )
    latitude, longitude = georeference.places(x, y)
    with Terrain(path) as terrain:
        heights = terrain.heights_m(latitude.tolist(), longitude.tolist())
    takeoff = float(heights[-1])
    nodes = heights[:-1].reshape(len(rows), len(columns)) - takeoff
    return _between(nodes, rows, columns, raster)


def _between(
    nodes: NDArray[np.float64],
    rows: NDArray[np.float64],
    columns: NDArray[np.float64],
    raster: Raster,
) -> NDArray[np.float64]:
    """Heights at all pixels, interpolated bilinearly between nodes."""
    wide = np.stack([np.interp(np.arange(raster.columns) + 0.5, columns, line) for line in nodes])
    at = np.arange(raster.rows) + 0.5
    low = np.clip(np.searchsorted(rows, at) - 1, 0, max(len(rows) - 2, 0))
    high = np.minimum(low + 1, len(rows) - 1)
    span = np.maximum(rows[high] - rows[low], 1e-12)
    part = np.clip((at - rows[low]) / span, 0.0, 1.0)[:, None]
    found: NDArray[np.float64] = wide[low] * (1.0 - part) + wide[high] * part
    return found


def read_stack(text: str) -> list[float]:
    """Parse the heights of a stack: ``H1..H2:STEP``, or heights separated by commas.

    Raises
    ------
    RequestError
        If the text has neither of these forms, or if it gives more than 500 heights.
    """
    from aosplan.units import number, positive

    if ".." not in text:
        return [number(part, "--stack", "m") for part in text.split(",")]
    ends, colon, step = text.partition(":")
    low, _, high = ends.partition("..")
    first, last = number(low, "--stack", "m"), number(high, "--stack", "m")
    pitch = positive(step, "--stack", "m") if colon else 1.0
    if not first < last:
        raise RequestError(
            f"--stack '{text}' is empty", "give the lower height first, such as 0..20:2"
        )
    count = math.floor((last - first) / pitch + 1e-9) + 1
    if count > 500:
        raise RequestError(f"--stack '{text}' has {count} heights, more than 500", "a larger step")
    return [first + index * pitch for index in range(count)]
